"""The command line as a user has it, in a folder of its own.
Compiled code is that of all tests, but where a test is about it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.browser import Opened, browser
from support.falling import SCENE
from support.process import ONE_CORE, UNOPTIMISED

import dap3d_core as dap

COMMAND = [str(Path(sys.executable).with_name("dap3d"))]


def environment(**variables):
    """What a user's shell has: no width, no settings of test tools."""
    dropped = (
        "COVERAGE_",
        "COLUMNS",
        "LINES",
        "NO_COLOR",
        "FORCE_COLOR",
        "DAP3D_PLAIN",
        "DAP3D_BLOCK",
    )
    kept = {k: v for k, v in os.environ.items() if not k.startswith(dropped)}
    own = {"DAP3D_CACHE_DIR": str(UNOPTIMISED), "PYTHONPATH": str(ONE_CORE)}
    return kept | own | {k: str(v) for k, v in variables.items()}


class CommandLine:
    """Runs ``dap3d`` in a folder, without a traceback."""

    def __init__(self, folder, capfd):
        self.folder, self.capfd = folder, capfd

    def start(self, *arguments, **variables):
        """Start a command as a process of its own, where that is the summary."""
        return subprocess.Popen(
            [*COMMAND, *map(str, arguments)],
            cwd=self.folder,
            env=environment(**variables),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def __call__(self, *arguments, **variables):
        """Run a command to its end, here: a process takes most of its time to begin."""
        from dap3d_core.cli import main

        self.capfd.readouterr()
        with pytest.MonkeyPatch.context() as here:
            here.chdir(self.folder)
            given = environment(**variables)
            for name in os.environ.keys() - given.keys():
                here.delenv(name)
            for name, value in given.items():
                here.setenv(name, value)
            code = main([str(a) for a in arguments])
        out, err = self.capfd.readouterr()
        assert "Traceback" not in err, err
        return subprocess.CompletedProcess(arguments, code, out, err)

    def succeed(self, *arguments, **variables):
        """Run a command that ends well."""
        done = self(*arguments, **variables)
        assert done.returncode == 0, done.stderr
        return done


@pytest.fixture
def dap3d(tmp_path, capfd):
    """The command line in a folder of its own, ``dap3d.folder``."""
    return CommandLine(tmp_path, capfd)


@pytest.fixture(scope="session")
def pen1_file(tmp_path_factory):
    """The file of a short run of pen1, six instants."""
    file = tmp_path_factory.mktemp("pen1") / "pen1.nc"
    dap.simulate("pen1", t_end=0.1, dt=0.02).save(file)
    return file


@pytest.fixture
def pen1(dap3d, pen1_file):
    """That result, which lies in the folder of the command line as pen1.nc."""
    shutil.copy(pen1_file, dap3d.folder)
    return dap.open(pen1_file)


@pytest.fixture
def refuse(dap3d):
    """Run a command and see it refused; what it says."""

    def call(*arguments):
        done = dap3d(*arguments)
        assert done.returncode == 2, done
        assert done.stderr
        assert not done.stderr.startswith("unexpected")
        assert done.stdout == ""
        return done.stderr

    return call


@pytest.fixture
def scene_file(tmp_path):
    """Writes a scene, a falling stone with some words replaced, and returns its file."""

    def write(*replaced, name="fall.toml"):
        text = SCENE
        for old, new in replaced:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture(scope="module")
def chromium():
    with browser() as found:
        yield found


@pytest.fixture
def show(chromium, tmp_path):
    """Opens pages, or the files of such, in a browser. At the end none has complained."""
    shown = []

    def call(page, **window):
        file = page if isinstance(page, Path) else page.save(tmp_path / f"{len(shown)}.html")
        shown.append(Opened(chromium, file, **window))
        return shown[-1]

    yield call
    for found in shown:
        found.close()
        assert found.complaints == []
