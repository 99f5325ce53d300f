"""Names of quantities and command lines at random, and what must be true of their answers."""

import contextlib
import functools
import io
import json
import os
import tempfile
from pathlib import Path

import numpy as np
from hypothesis import strategies as st
from support.falling import SCENE
from support.process import REPOSITORY

import dap3d_core as dap
from dap3d_core.cli import main
from dap3d_core.result import ResultError, UnknownNameError, names_of
from dap3d_core.scene import parse
from fuzz.acceptable import strict

HANG = 30
PIECES = ("", ".", "..", "r", "z", "x", "norm", "J1", "J2", "crank", "follower", "ground", "O",
          "animation",
          "animation.1", "1", "-1", "i", "j", "k", "force", "moment", "lambda", "lambda.1",
          "lambda.99", "energy",
          "kinetic", "t", "work", "constraint", "position", "é", " ", "\0", "x" * 400, "R", "rPdd",
          "length",
          "wp", "force_body", "gravity", "%s", "{0}", "__class__", "\n")  # fmt: skip


@functools.cache
def run():
    return dap.simulate(REPOSITORY / "models" / "fourbar3", t_end=0.05, dt=0.01)


@functools.cache
def all_names():
    found, waiting = [], [""]
    while waiting:
        begin = waiting.pop()
        for name in names_of(run(), begin):
            if name not in found:
                found.append(name)
                waiting.append(name if name.endswith(".") else f"{name}.")
    return found


@st.composite
def quantity_names(draw):
    """The name of a quantity, right or wrong, as bytes."""
    words = st.lists(st.sampled_from(PIECES), max_size=5).map(".".join)
    name = draw(st.one_of(st.sampled_from(all_names()), words, st.text(max_size=12)))
    if draw(st.booleans()) and name:
        k = draw(st.integers(0, len(name)))
        name = name[:k] + draw(st.sampled_from(PIECES)) + name[k + draw(st.integers(0, 2)) :]
    return name.encode("utf-8", "surrogatepass")


def check_quantity(data):
    """A name gives finite numbers that fit its labels, or is unknown, in words."""
    name = data.decode("utf-8", "surrogatepass")
    with strict(HANG):
        try:
            found = run().quantity(name)
        except (UnknownNameError, ResultError) as error:
            words = str(error)
            assert words
            assert "\n" not in words
            return "refused"
        assert np.isfinite(found.values).all()
        assert len(found.values) == len(run().t)
        assert found.values.ndim < 3
        assert found.label
    return "found"


COMMANDS = ("run", "run", "run", "check", "check", "plot", "post", "info", "models", "plugins",
            "describe",
            "import-matlab", "resume", "animate", "export", "new-plugin", "", "--help", "Run",
            "--version")  # fmt: skip
OPTIONS = ("-o", "--output", "--t-end", "--dt", "--method", "--integrator", "--rtol", "--atol",
           "--step",
           "--no-correct", "--no-project", "--strict", "--force", "--allow-code", "--json",
           "--debug",
           "--no-color", "-h", "--help", "--x", "--width", "--height", "--kind", "--t_end", "-t",
           "--", "-",
           "--quantity", "--fps", "--estimate-error", "--jacobian", "--csv",
           "--tolerance")  # fmt: skip
ARGUMENTS = ("fall.toml", "fall", "run.nc", "empty.toml", "folder", "missing.nc", "text.nc",
             "stone.r.z", "stone.w",
             "energy.total", "t", "0.1", "0.01", "0", "-1", "nan", "inf", "1e308", "1e-9",
             "1e-320", "x", "", " ",
             "auto", "standard", "dop853", "rk4", "radau", "adams", "sph", "weight", "joint",
             "out.nc", "out.png",
             "out.toml", "out.csv", "no/such/out.nc", "folder/out.nc", "/dev/null", "a\nb", "é.nc",
             "x" * 300,
             "http://a/b", "~", "*", "%d", "1,5", "0x10", "1_0", "١", "٠.٥", "--", "fall.toml/x",
             "my-type", "class", "../up", "\udcff")  # fmt: skip


@st.composite
def command_lines(draw):
    """The words after ``dap3d``, as JSON."""
    word = st.sampled_from((*ARGUMENTS, *ARGUMENTS, *OPTIONS))
    pair = st.tuples(st.sampled_from(OPTIONS), st.sampled_from(ARGUMENTS)).map(list)
    parts = draw(st.lists(st.one_of(word.map(lambda w: [w]), pair), max_size=5))
    first = draw(
        st.sampled_from(("fall.toml", "fall.toml", "run.nc", "run.nc", "folder", "text.nc"))
    )
    words = [draw(st.sampled_from(COMMANDS)), *([first] * draw(st.booleans()))]
    return json.dumps(words + [w for part in parts for w in part]).encode()


@functools.cache
def result_bytes():
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "run.nc")
        dap.simulate(parse(SCENE)).save(path)
        return path.read_bytes()


@contextlib.contextmanager
def folder_of_files():
    """A folder to work in, with a scene, a result and some that are neither."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "work", "folder").mkdir(parents=True)
        os.chdir(Path(folder, "work"))
        try:
            Path("fall.toml").write_text(SCENE)
            Path("run.nc").write_bytes(result_bytes())
            Path("text.nc").write_text("no result")
            Path("empty.toml").touch()
            yield Path()
        finally:
            os.chdir(before)


def check_command(data):
    """A command line ends with an exit code, and says in words what was wrong with it."""
    words = json.loads(data)
    out, err = io.StringIO(), io.StringIO()
    streams = contextlib.redirect_stdout(out), contextlib.redirect_stderr(err)
    with folder_of_files(), strict(HANG), streams[0], streams[1]:
        try:
            code = main(words)
        except SystemExit as error:
            code = error.code
    said = err.getvalue()
    assert code in (0, 1, 2, 3), code
    if "--debug" not in words:
        assert "Traceback" not in said, said
    assert not any(line.startswith("unexpected ") for line in said.splitlines()), said
    assert code == 0 or said or "--json" in words, "failed without a word"
    assert code != 0 or "Error" not in said, said
    if code in (0, 2, 3) and "--json" in words and out.getvalue().startswith("{"):
        json.loads(out.getvalue())
    return f"exit {code}"
