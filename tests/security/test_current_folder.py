"""The current folder may be that of a stranger's model: no file in it governs what dap3d does.
But for the files that a command names. matplotlib reads a settings file there when it is
imported, so each test is a process of its own."""

import os

import pytest
from support.falling import SCENE
from support.process import run, start

import dap3d_core as dap

PLOT = """
import dap3d_core as dap
from dap3d_core.plot import animate, save_plot
result = dap.open("run.nc")
save_plot(result, ["stone.r"], "curve.svg", force=True)
animate(result, "snapshot.svg", at=0.0, force=True)
import matplotlib
print(matplotlib.rcParams["lines.linewidth"], matplotlib.rcParams["text.usetex"])
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with a result."""
    (tmp_path / "scene.toml").write_text(SCENE)
    dap.simulate(dap.load(tmp_path / "scene.toml"), t_end=0.2, dt=0.1).save(tmp_path / "run.nc")
    return tmp_path


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes as POSIX has them")
def test_a_matplotlibrc_is_not_opened(folder):
    """Whatever it holds, also what would stop the import: whoever opens this pipe waits."""
    os.mkfifo(folder / "matplotlibrc")
    assert run(PLOT, cwd=folder, MPLCONFIGDIR=folder / "none") == "1.5 False"


@pytest.mark.slow
def test_a_home_that_cannot_be_written_is_no_matter(folder):
    """matplotlib has a cache of its own, and two lines of advice where it cannot keep that."""
    (folder / "home").write_text("no folder")
    process = start(PLOT, cwd=folder, HOME=folder / "home", MPLCONFIGDIR="", XDG_CONFIG_HOME="")
    assert process.communicate(timeout=300)[1] == ""
    assert process.returncode == 0


@pytest.mark.slow
def test_names_are_no_tex_whatever_the_users_own_settings(folder):
    """The user may have TeX set for pictures of his own; here LaTeX would be started."""
    (folder / "config").mkdir()
    (folder / "config" / "matplotlibrc").write_text("text.usetex: True\n")
    (folder / "bin").mkdir()
    latex = folder / "bin" / "latex"
    latex.write_text("#!/bin/sh\ntouch tex-was-here\nexit 1\n")
    latex.chmod(0o755)
    path = f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"
    assert run(PLOT, cwd=folder, MPLCONFIGDIR=folder / "config", PATH=path).endswith("True")
    assert not list(folder.rglob("tex-was-here"))


@pytest.mark.slow
def test_a_script_that_has_set_matplotlib_up_keeps_it(folder):
    """Its own figures, and so its own decision: only our import leaves the file out."""
    (folder / "matplotlibrc").write_text("lines.linewidth: 77\n")
    assert run(f"import matplotlib\n{PLOT}", cwd=folder).startswith("77.0")
