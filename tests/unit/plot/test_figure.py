"""Figures on given axes, in windows and in files of each kind; what cannot be drawn is refused."""

import os
import subprocess
import sys
from pathlib import Path

import matplotlib
import matplotlib.image
import numpy as np
import pytest
from support.plain import in_another_process

import dap3d_core as dap
from dap3d_core.plot import FORMATS, plot, save_plot, show_plot
from dap3d_core.result import ResultError, UnknownNameError


def test_without_a_display_there_is_no_window(result):
    with pytest.raises(ResultError, match=r"cannot open a window.*-o writes a file"):
        show_plot(result, "bob.r")


@pytest.mark.slow
@in_another_process
def test_a_window_shows_the_figure(tmp_path):
    """With a way to show windows that only says what it would show."""
    (tmp_path / "says.py").write_text(
        "from matplotlib.backends.backend_agg import FigureCanvasAgg as FigureCanvas\n"
        "from matplotlib.backend_bases import FigureManagerBase as FigureManager\n"
        "def show(*args, **options):\n"
        "    from matplotlib import pyplot\n"
        "    print(pyplot.gcf().axes[0].get_ylabel())\n"
    )
    tests = Path(__file__).parents[2]
    code = (
        "import sys; sys.path[:0] = sys.argv[1:]\n"
        "from support.results import circling\n"
        "from dap3d_core.plot import show_plot\n"
        "show_plot(circling()[0], 'bob.r.x')\n"
    )
    out = subprocess.run(
        [sys.executable, "-c", code, str(tests), str(tmp_path)], capture_output=True, text=True,
        env=os.environ | {"MPLBACKEND": "module://says"}, check=True,
    )  # fmt: skip
    assert out.stdout.strip() == "position of bob, x [m]"


def test_on_axes_that_are_given(result):
    from matplotlib import pyplot

    _, given = pyplot.subplots()
    assert plot(result, "bob.r.x", "bob.r.y", ax=given) is given
    assert len(given.get_lines()) == 2
    with pytest.raises(ValueError, match=r"one unit.*m, J"):
        plot(result, "bob.r.x", "work", ax=given)


@pytest.mark.every(3)
@pytest.mark.parametrize("suffix", FORMATS)
def test_files_of_each_kind(result, tmp_path, suffix):
    path = save_plot(result, ["bob.r", "energy.total", "J1.force.norm"], tmp_path / f"a{suffix}")
    data = path.read_bytes()
    begin = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}[suffix.lower()]
    assert data.startswith(begin)
    assert len(data) > 5000
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    again = save_plot(result, ["bob.r", "energy.total", "J1.force.norm"], tmp_path / f"b{suffix}")
    assert again.read_bytes() == data  # equal figures, equal files


def test_a_picture_is_not_blank_and_has_the_size_asked_for(result, tmp_path):
    path = save_plot(result, "bob.r", tmp_path / "a.png", width=3, height=2, dpi=100)
    pixels = matplotlib.image.imread(path)
    assert pixels.shape[:2] == (200, 300)
    colours = np.unique((pixels[..., :3] * 255).round().reshape(-1, 3), axis=0)
    assert len(colours) > 50


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (dict(path="a.bmp"), r"a figure is one of \.png, \.svg, \.pdf"),
        (dict(path="a"), "a figure is one of"),
        (dict(quantities=[]), "at least one quantity"),
        (dict(x="bob.r"), r"x = bob\.r has components; name one of bob\.r\.x, bob\.r\.y"),
        (dict(width=0), "cannot be"),
        (dict(dpi=1e9), "dpi is from 10 to 1200"),
        (dict(width=float("nan")), "cannot be"),
    ],
)
def test_what_cannot_be_drawn_is_refused(result, tmp_path, options, words):
    given = dict(quantities=["work"], path="a.png") | options
    given["path"] = tmp_path / given["path"]
    with pytest.raises(ValueError, match=words):
        save_plot(result, **given)
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_quantity_is_answered_before_anything_is_written(result, tmp_path):
    with pytest.raises(UnknownNameError, match=r"did you mean 'bob\.r\.z'"):
        save_plot(result, "bbo.r.z", tmp_path / "a.png")
    with pytest.raises(ResultError, match="there is no folder"):
        save_plot(result, "work", tmp_path / "no" / "a.png")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "write",
    [
        lambda result, path, **force: save_plot(result, "work", path, **force),
        lambda result, path, **force: dap.animate(result, path, **force),
        lambda result, path, **force: dap.view(result).save(path, **force),
    ],
    ids=["plot", "animate", "view"],
)
def test_a_file_is_overwritten_only_when_forced(result, tmp_path, write):
    path = tmp_path / "a.png"
    path.write_text("precious")
    with pytest.raises(ResultError, match="the file exists"):
        write(result, path)
    assert path.read_text() == "precious"
    write(result, path, force=True)
    assert path.stat().st_size > 1000
