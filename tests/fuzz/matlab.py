"""Folders of MATLAB models with something wrong, and what must be true of their import."""

import functools
import json
import tempfile
from pathlib import Path

import numpy as np
from hypothesis import strategies as st
from support.matlab import MODELS, SMALL

import dap3d_core as dap
from dap3d_core.scene import check, parse
from fuzz.acceptable import registry, strict
from fuzz.damage import flipped, seeds

#: An import that computes for longer hangs, s.
HANG = 20
#: What a line may be replaced by, besides lines of other models.
STATEMENTS = (
    "x = zeros(1e9);", "x = 1:1e12;", "x = ones(1e4, 1e4);", "x = eye(10000);",
    "x = repmat(1, 1e6, 1e6);", "x = [1e308 + 1e308];", "x = 1e308 * 10;", "x = -1e308 - 1e308;",
    "x = [1e200 1e200] * [1e200; 1e200];", "x = 2 ^ 1e9;", "x = (-8) ^ (1/3);", "x = 0 / 0;",
    "x = sqrt(-1);", "x = atan2([], []);", "x = diag([]);", "x = norm(zeros(0, 1));",
    "x = norm([1e200 1e200]);", "x = acos(2);", "x = zeros(-1);", "x = zeros(0.5);",
    "x = " + "(" * 60 + "1" + ")" * 60 + ";", "x = " + "(" * 3000 + "1" + ")" * 3000 + ";",
    "x = " + "[" * 400 + "1" + "]" * 400 + ";", "x = " + "-" * 3000 + "1;",
    "x = " + "1+" * 3000 + "1;", "x = " + "2^" * 500 + "1;", "x = 1" + "'" * 999 + ";",
    "while 1, end", "for k = 1:1e9, x = k; end", "system('touch hacked');", "eval('x = 1;');",
    "!touch hacked", "delete('*')", "x = @(y) y;", "Bodies = [Bodies; Bodies];",
    "Bodies(1e9) = B1;", "Bodies(0).mass = 1;", "Bodies(end).mass = 1e-320;", "Bodies(1.5) = B1;",
    "Bodies(end + 1) = Bodies(1);", "B1.mass(1e9) = 1;", "B1.r(end) = 1e308;", "B1.Jp(:) = 1;",
    "B1.B1 = B1;", "B1 = B1.r;", "B1.color = 3;", "B1.r = 'abc';", "B1 = Body_struct;",
    "B1 = Joint_struct;", "[a, b] = size(x);", "x = {1, 2};", "x.y.z = 1;", "x(2)(3) = 1;",
    "clear all", "return", "function f", "end", "%{", "...", "x = 1 ...", "'", "x = 'a''b';",
    'x = "a";', "x = 1e999;", "x = 0x1F;", "x = 1i;", "x = Inf;", "x = NaN;", "pi = 3;", "x = é;",
    "global x", "include_global", "x += 1;", "x++;", "x.('a') = 1;", "x = [1 -1; 2];",
    "Joints = [];", "Points = 3;", "J1.type = 'rev';", "S1.type = 'user';", "S1.gravity = [];",
    "C1.type = 'c';",
)  # fmt: skip
NUMBERS = ("0", "-1", "1e308", "1e-320", "1e999", "1e100", "99", "1.5", "1:3", "[]", "pi", "end",
           "x", "'a'",
           "inf", "NaN", "1e9", "(1", "[1;2]", "[1 2 3 4]")  # fmt: skip
WORDS = ("(", ")", "[", "]", "{", "}", "'", '"', ";", ",", "...", "%", "=", "==", "'", ".", ":",
         "^", "\\", "!",
         "\r", "\t", "\0", "é", "\u2018", "@", "end", "~", "&", "1e", "\U0001f600")  # fmt: skip


@functools.cache
def models():
    """The files of each folder that models are made from."""
    folders = [f for f in sorted(MODELS.iterdir()) if (f / "inBodies.m").exists()]
    found = [{p.name: p.read_text() for p in sorted(f.glob("*.m"))} for f in folders]
    return [dict(SMALL), *found]


def _line(lines, k, rng):
    lines.insert(k, STATEMENTS[rng.integers(len(STATEMENTS))])


def _replaced(lines, k, rng):
    name, sign, _ = lines[k].partition("=")
    if sign:
        lines[k] = f"{name}= {NUMBERS[rng.integers(len(NUMBERS))]};"


def _moved(lines, k, rng):
    lines.insert(int(rng.integers(len(lines))), lines.pop(k))


def _removed(lines, k, rng):
    del lines[k]


def _borrowed(lines, k, rng):
    model = models()[rng.integers(len(models()))]
    other = "\n".join(model.values()).split("\n")
    lines.insert(k, other[rng.integers(len(other))])


def _spoilt(lines, k, rng):
    at = int(rng.integers(len(lines[k]) + 1))
    lines[k] = lines[k][:at] + WORDS[rng.integers(len(WORDS))] + lines[k][at:]


def _cut(lines, k, rng):
    lines[k] = lines[k][: int(rng.integers(len(lines[k]) + 1))]
    del lines[k + 1 :]


CHANGES = (_line, _line, _replaced, _replaced, _moved, _removed, _borrowed, _spoilt, _cut)


@st.composite
def damaged_models(draw):
    """A folder as JSON, name -> text: a model with a few changes."""
    files = dict(draw(st.sampled_from(models())))
    rng = np.random.default_rng(draw(seeds))
    for _ in range(draw(st.integers(1, 4))):
        name = str(rng.choice(list(files)))
        lines = files[name].split("\n")
        CHANGES[rng.integers(len(CHANGES))](lines, int(rng.integers(len(lines))), rng)
        files[name] = "\n".join(lines)
        if rng.integers(40) == 0:
            del files[name]
            break
    if draw(st.integers(0, 9)) == 0 and files:
        name = str(rng.choice(list(files)))
        files[name] = flipped(files[name].encode(), rng, 2).decode("latin-1")
    return json.dumps(files).encode()


def check_model(data):
    """A folder is refused with every mistake named, or becomes a scene; nothing of it is run."""
    files = json.loads(data)
    with tempfile.TemporaryDirectory() as folder, strict(HANG):
        for name, text in files.items():
            Path(folder, name).write_bytes(text.encode("utf-8", "surrogatepass"))
        try:
            scene, report = dap.import_matlab(folder, registry())
        except dap.SceneError as error:
            _examine(error, folder)
            return "refused"
        finally:
            assert {p.name for p in Path(folder).iterdir()} == set(files), "a file was made"
        assert parse(scene.to_toml()) == scene
        if not report.stub:
            check(scene, registry())
    return "read"


def _examine(error, folder):
    """Each mistake says what is wrong, and in which file."""
    assert error.mistakes
    str(error).encode("utf-8")
    for mistake in error.mistakes:
        assert mistake.what, mistake
        assert mistake.file.startswith(folder), mistake
