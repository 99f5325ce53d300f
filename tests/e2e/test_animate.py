"""``dap3d animate`` and ``dap3d plot`` as a user has them: files, messages, windows, interrupts."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest
from PIL import Image
from tests.e2e.test_terminal import in_terminal, lines

import dap3d_core as dap


@pytest.fixture
def runs(dap3d):
    """Two runs of one model, pen1.nc and sub/pen1.nc."""
    (dap3d.folder / "sub").mkdir()
    result = dap.simulate("pen1", t_end=1.0, dt=0.05)
    result.save(dap3d.folder / "pen1.nc")
    dap.simulate("pen1", t_end=1.0, dt=0.1, rtol=1e-4).save(dap3d.folder / "sub" / "pen1.nc")
    return result


@pytest.mark.slow
def test_a_film(dap3d, runs):
    done = dap3d.succeed("animate", "pen1.nc", "--speed", "0.5", "--fps", "10", "--size", "200")
    assert done.stderr == ""  # no bar where nobody looks at a terminal
    assert done.stdout.startswith("pen1.gif written (")
    assert "21 frames at 10 a second, 0.5 x real time" in done.stdout
    with Image.open(dap3d.folder / "pen1.gif") as image:
        assert (image.n_frames, image.size[0]) == (21, 200)
    told = dap3d("animate", "pen1.nc", "-o", "a.png", "--at", "0.5", "--view", "x", "--json")
    found = json.loads(told.stdout)
    assert (found["file"], found["frames"], found["width"]) == ("a.png", 1, 640)


@pytest.mark.slow
def test_ctrl_c_leaves_no_file(dap3d, runs):
    process = dap3d.start("animate", "pen1.nc", "--speed", "0.005", "--fps", "50", "-o", "a.gif")
    end = time.monotonic() + 60
    while not list(dap3d.folder.glob("a.gif*")) and time.monotonic() < end:
        time.sleep(0.02)
    time.sleep(1.0)  # among its frames, not while the file is made
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert err == "interrupted; nothing was written\n"
    assert "Traceback" not in err
    assert out == ""
    assert not list(dap3d.folder.glob("a.gif*"))


@pytest.mark.slow
def test_a_film_shows_its_progress_in_a_narrow_terminal(dap3d, runs):
    words = ("animate", "pen1.nc", "--speed", "0.5", "--fps", "10", "--size", "200")
    code, shown = in_terminal(dap3d, 60, *words)
    assert code == 0, shown
    assert max(map(len, lines(shown))) <= 60
    assert "frame" in shown
    assert "of 21" in shown


@pytest.mark.slow
def test_several_runs_are_told_apart_by_their_folders(dap3d, runs):
    """In an SVG, whose text stays text; a result that is named twice is a mistake."""
    dap3d.succeed("plot", "pen1.nc", "sub/pen1.nc", "cone.r.z", "-o", "a.svg", "--width", "60")
    text = (dap3d.folder / "a.svg").read_text()
    assert ">sub/pen1<" in text
    assert f">{dap3d.folder.name}/pen1<" in text
    assert 'width="170' in text  # points: 60 mm
    again = dap3d("plot", "pen1.nc", "./pen1.nc", "cone.r.z", "-o", "b.svg")
    assert again.returncode == 2
    assert "named twice" in again.stderr


def test_a_window_that_cannot_be_opened_is_told(refuse, pen1, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    assert "cannot open a window" in refuse("plot", "pen1.nc", "cone.r.z", "--show")


@pytest.mark.slow
def test_no_colour_when_asked(dap3d):
    _, shown = in_terminal(dap3d, 80, "models", "--no-color")
    assert "\x1b[3" not in shown
    assert "pen1" in shown
    _, coloured = in_terminal(dap3d, 80, "models")
    assert "\x1b[3" in coloured


@pytest.mark.slow
def test_the_command_needs_no_display_and_no_window_package(dap3d, pen1):
    """pyplot, which opens windows, stays out; so do the solver's kernels."""
    script = (
        "import sys; from dap3d_core.cli import main;"
        "code = main(['animate', 'pen1.nc', '--at', '0', '-o', 'a.png']);"
        "print(code, 'matplotlib.pyplot' in sys.modules, 'dap3d_joints' in sys.modules)"
    )
    variables = {k: v for k, v in os.environ.items() if k != "DISPLAY"}
    done = subprocess.run([sys.executable, "-c", script], cwd=dap3d.folder, capture_output=True,
                          text=True, env=variables)  # fmt: skip
    assert done.stdout.splitlines()[-1] == "0 False False", done.stderr
