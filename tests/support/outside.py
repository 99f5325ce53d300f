"""Virtual environments of a user, into which wheels are installed.
What dap3d depends on is lent from the environment of the tests, package by package, without
anything of dap3d: to download llvmlite, scipy and the rest again would take minutes and prove
nothing. Nothing of the working tree can be reached."""

import importlib.util
import json
import os
import subprocess
import sys
import venv
from pathlib import Path

import pytest

#: What pip says where it can reach no index.
NO_INDEX = ("Could not find a version", "No matching distribution", "Could not install")


def shell(**variables):
    """The environment of a shell that knows nothing of the tests."""
    ours = ("DAP3D_", "COVERAGE_", "PYTHON", "COLUMNS")
    return {k: v for k, v in os.environ.items() if not k.startswith(ours)} | variables


def isolated():
    """How pip builds: with what is installed here, where that is enough."""
    return ["--no-build-isolation"] if importlib.util.find_spec("hatchling") else []


def pip(*arguments, cwd=None, **variables):
    """Run the pip of the tests; skip where it would need an index that is not there."""
    done = subprocess.run(
        [sys.executable, "-m", "pip", "--disable-pip-version-check", *map(str, arguments)],
        env=shell(**variables), cwd=cwd, capture_output=True, text=True,
    )  # fmt: skip
    if done.returncode and any(words in done.stderr for words in NO_INDEX):
        pytest.skip("no package index is in reach, and hatchling is not installed here")
    assert done.returncode == 0, done.stdout + done.stderr


def build(source, wheels, **variables):
    """Make a wheel of a source folder."""
    pip("wheel", "--quiet", "--no-deps", *isolated(), "--wheel-dir", wheels, source, **variables)


class Outside:
    """A virtual environment and a folder to work in."""

    def __init__(self, folder):
        self.folder, self.wheels = folder / "work", folder / "wheels"
        self.folder.mkdir()
        self.cache = folder / "cache"
        venv.create(folder / "venv", symlinks=True)
        scripts = "Scripts" if os.name == "nt" else "bin"
        self.bin = folder / "venv" / scripts
        self.python = self.bin / Path(sys.executable).name
        if not self.python.exists():
            self.python = self.bin / "python"
        self._lend_dependencies(folder / "dependencies")

    def _lend_dependencies(self, folder):
        folder.mkdir()
        sites = (Path(path) for path in sys.path if Path(path).name == "site-packages")
        entries = {entry.name: entry for site in sites for entry in site.iterdir()}
        for name, entry in entries.items():
            if "dap3d" not in name.lower() and entry.suffix != ".pth":
                (folder / name).symlink_to(entry)
        site = self.run(self.python, "-c", "import site; print(site.getsitepackages()[0])").stdout
        Path(site.strip(), "lent.pth").write_text(f"{folder}\n")

    def run(self, *words, code=0, cwd=None, **variables):
        """Run a program there; it ends with this code and never with a traceback."""
        env = shell(DAP3D_CACHE_DIR=str(self.cache), MPLBACKEND="Agg", **variables)
        done = subprocess.run(
            list(map(str, words)), cwd=cwd or self.folder, env=env, capture_output=True, text=True,
            timeout=300,
        )  # fmt: skip
        assert "Traceback" not in done.stderr, done.stderr
        assert done.returncode == code, done.stdout + done.stderr
        return done

    def dap3d(self, *words, **options):
        """Run its dap3d."""
        return self.run(self.bin / "dap3d", *words, **options)

    def install(self, *wheels):
        """Install wheels there, as they are."""
        pip("--python", self.python, "install", "--quiet", "--no-deps", "--no-index", *wheels)

    def plugins(self):
        """What ``dap3d plugins`` says, by keyword and distribution."""
        found = json.loads(self.dap3d("plugins", "--json").stdout)["types"]
        return {(t["keyword"], t["distribution"]): t for t in found}
