"""Texts with something wrong: a good one with one or several random changes."""

import functools
import re

import numpy as np
from hypothesis import strategies as st

import dap3d_core as dap
from fuzz.scenes import scenes

#: Small scenes that come with dap3d, and between them have most of what a file may hold.
MODELS = ("pen1", "pen2", "fourbar2", "fourbar3", "bodies2", "tri")

VALUES = (
    "nan", "-nan", "inf", "-inf", "1e308", "-1e308", "1e154", "1e100", "1e99", "-1e99", "1e-99",
    "1e-320", "-1e-320", "1e999", "0", "-0.0", "-1", "1", "2.5", "1e12", "true", "false", '""',
    '"1"', '"1,5"', '" "', '"ground"', '"ground.O"', '"a\\u0000b"', '"\\u202e\\ud7ff"',
    "'''a\nb'''",
    "[]", "[[]]", "[1.0]", "[1.0, 2.0]", "[0.0, 0.0, 0.0]", "[1e-320, 0.0, 0.0]", "[1e99, 1e99, 0]",
    "[1.0, 2.0, 3.0, 4.0]", "[[1.0, 2.0, 3.0]]", "[nan, 0.0, 0.0]", '["a", "b", "c"]', "{}",
    "{a = 1}", "[{}]", "1979-05-27", "1979-05-27T07:32:00Z", "07:32:00", "0x" + "f" * 5000,
    "1" * 400, "1" * 5000, "-9223372036854775809", "0b1", "0o7", "[" * 90 + "]" * 90,
    "[" * 2000 + "]" * 2000, "{a=" * 90 + "1" + "}" * 90, "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0]]",
)  # fmt: skip
WORDS = ("", "a", "bodies", "type", "name", "é", "\u212a", "x" * 300, '"', "'", "=", "[", "]", "#",
         "\n", "\r", "\0", "\ufeff", "\U0001f600", ".", "..", "ground", "\u2028", ",",
         "-1")  # fmt: skip
LINES = (
    "[[bodies]]", "[bodies]", "bodies = 3", "[bodies.ground]", "[bodies.b9]", '["bodies"."b\\n"]',
    "[joints.x]", "[functions.f]\ntype = 'spline'\nx = [0, 1]\ny = [0, 1, 2]", "[shapes.s]",
    "[shapes.s]\ntype = 'mesh'\nfile = '../a.stl'\nbody = 'ground'", "[animation]\npoints = 3",
    "[[animation.points]]\nbody = 'ground'", "[unknown]", "a" + ".a" * 3000 + " = 1",
    "[" + "a." * 500 + "a]", "points.p.body.x = 1", "[scene.scene]", "x = [\n1,\n2 # é\n]",
)  # fmt: skip


@functools.cache
def text_of(model):
    return dap.load(model).to_toml()


def _misspelt(word, rng):
    k = int(rng.integers(len(word) + 1))
    return str(rng.choice((word[:k] + word[k + 1 :], word[:k] + "x" + word[k:], word.upper())))


def _key(lines, k, rng):
    name, sign, value = lines[k].partition(" = ")
    lines[k] = _misspelt(name, rng) + sign + value


def _value(lines, k, rng):
    name, sign, _ = lines[k].partition(" = ")
    if sign:
        lines[k] = f"{name} = {VALUES[rng.integers(len(VALUES))]}"


def _number(lines, k, rng):
    found = list(re.finditer(r"-?\d+\.?\d*(e[-+]?\d+)?", lines[k]))
    if found:
        one = found[rng.integers(len(found))]
        lines[k] = lines[k][: one.start()] + str(rng.choice(VALUES[:22])) + lines[k][one.end() :]


def _reference(lines, k, rng):
    names = re.findall(r'"[^"]+"', "\n".join(lines)) or ['"a"']
    own = list(re.finditer(r'"[^"]*"', lines[k]))
    if own:
        one, other = own[rng.integers(len(own))], names[rng.integers(len(names))]
        other = f'"{_misspelt(other[1:-1], rng)}"' if rng.integers(2) else other
        lines[k] = lines[k][: one.start()] + other + lines[k][one.end() :]


def _remove(lines, k, rng):
    del lines[k : k + int(rng.integers(1, 4))]


def _double(lines, k, rng):
    lines.insert(int(rng.integers(len(lines) + 1)), lines[k])


def _move(lines, k, rng):
    lines.insert(int(rng.integers(len(lines))), lines.pop(k))


def _insert(lines, k, rng):
    lines.insert(k, LINES[rng.integers(len(LINES))])


def _word(lines, k, rng):
    at = int(rng.integers(len(lines[k]) + 1))
    lines[k] = lines[k][:at] + WORDS[rng.integers(len(WORDS))] + lines[k][at:]


def _cut(lines, k, rng):
    lines[k] = lines[k][: int(rng.integers(len(lines[k]) + 1))]
    del lines[k + 1 :]


def _reorder(lines, k, rng):
    blocks = "\n".join(lines).split("\n\n")
    rng.shuffle(blocks)
    lines[:] = "\n\n".join(blocks).split("\n")


#: Most changes leave a text that is TOML, so that what comes after parsing is reached, too.
CHANGES = (_key, _value, _value, _value, _number, _number, _number, _reference, _reference, _remove,
           _double, _move, _insert, _word, _cut, _reorder)  # fmt: skip


def flipped(data, rng, count):
    """Bytes of which some were replaced by others."""
    array = np.frombuffer(data, dtype=np.uint8).copy()
    if len(array):
        array[rng.integers(len(array), size=count)] = rng.integers(256, size=count)
    return array.tobytes()


def changed(text, seed, count):
    """A text after some changes of its lines."""
    rng = np.random.default_rng(seed)
    lines = text.split("\n")
    for _ in range(count):
        if not lines:
            break
        CHANGES[rng.integers(len(CHANGES))](lines, int(rng.integers(len(lines))), rng)
    return "\n".join(lines)


seeds = st.integers(0, 2**32 - 1)


@st.composite
def damaged_scenes(draw):
    """The bytes of a scene file with something wrong; few of them are still a scene."""
    text = draw(st.one_of(st.sampled_from(MODELS).map(text_of), scenes(bodies=3)))
    text = changed(text, draw(seeds), draw(st.integers(1, 3)))
    data = text.encode("utf-8", "surrogatepass")
    if draw(st.integers(0, 9)) == 0:
        data = flipped(data, np.random.default_rng(draw(seeds)), draw(st.integers(1, 3)))
    return data
