"""Damaged URDF, SDF and MJCF files, and what must be true of their import."""

import functools
import re
import sys
import tempfile
from pathlib import Path

import numpy as np
from support.process import REPOSITORY

import dap3d_core as dap
from fuzz.acceptable import registry, strict
from fuzz.damage import seeds

#: An import that computes for longer hangs, s.
HANG = 20
DATA = REPOSITORY / "tests" / "data" / "formats"
VALUES = (
    "", "0", "-1", "1e308", "1e-320", "1e999", "nan", "inf", "1 2", "0 0 0", "1 2 3 4 5 6 7",
    "world", "__model__", "true", "auto", "main", "x" * 5000, "\u2018", "../../etc/passwd",
    "/etc/passwd", "file:///etc/passwd", "http://127.0.0.1:9/x", "package://p/x.stl",
    "model://m", "a::b", "${1/0}", "$(find x)", "%n%s", "1,2,3", "0x10", "&#0;",
)  # fmt: skip
ELEMENTS = (
    '<include file="model.xml"/>', '<include file="../x.xml"/>',
    "<include><uri>model.sdf</uri></include>",
    '<geom type="mesh" mesh="m"/>', '<mesh name="m" file="/etc/passwd"/>', "<body/>", "<link/>",
    "<joint/>", '<joint type="ball"/>', '<joint type="planar"/>', "<freejoint/>", "<model/>",
    '<default class="a"/>', "<frame/>", '<replicate count="1000000000"/>', "<inertial/>",
    '<xacro:property name="x" value="${__import__(1)}"/>', "<!DOCTYPE a>", "<!ENTITY x 'y'>", "&x;",
    '<mimic joint="left"/>', "<static>true</static>", "<equality><weld/></equality>", "<a>" * 300,
    '<compiler inertiafromgeom="true" settotalmass="1"/>', "<world/>", "<?xml version='1.1'?>",
)  # fmt: skip


@functools.cache
def models():
    """Suffix and text of the files that models are made from."""
    files = (path for path in sorted(DATA.iterdir()) if path.is_file())
    return [(path.suffix, path.read_text()) for path in files]


def _value(text, rng):
    """Another value of an attribute, or another number."""
    places = list(re.finditer(r'"([^"]*)"|>([^<>]*[0-9][^<>]*)<', text))
    place = places[rng.integers(len(places))]
    group = 1 if place[1] is not None else 2
    other = VALUES[rng.integers(len(VALUES))]
    return text[: place.start(group)] + other + text[place.end(group) :]


def _line(text, rng):
    """A line left out, doubled or moved, or an element put in."""
    lines = text.split("\n")
    k, kind = rng.integers(len(lines)), rng.integers(4)
    if kind == 0:
        del lines[k]
    elif kind == 1:
        lines.insert(k, lines[rng.integers(len(lines))])
    elif kind == 2:
        lines.insert(k, ELEMENTS[rng.integers(len(ELEMENTS))])
    else:
        lines[k], lines[k - 1] = lines[k - 1], lines[k]
    return "\n".join(lines)


def _word(text, rng):
    """One word in place of another, everywhere."""
    words = sorted(set(re.findall(r"[A-Za-z_]\w+", text)))
    old, new = (words[rng.integers(len(words))] for _ in range(2))
    return re.sub(rf"\b{old}\b", new, text, count=int(rng.integers(3)))


def _character(text, rng):
    k = rng.integers(len(text))
    return text[:k] + chr(rng.integers(1, 300)) + text[k + rng.integers(3) :]


def _damaged(number):
    rng = np.random.default_rng(number)
    suffix, text = models()[rng.integers(len(models()))]
    if rng.integers(20) == 0:
        suffix = (".urdf", ".sdf", ".xml", ".xacro")[rng.integers(4)]
    for _ in range(rng.integers(1, 5)):
        text = (_value, _value, _line, _word, _character)[rng.integers(5)](text, rng)
    return f"{suffix}\n{text}".encode()


def damaged_model_files():
    """A suffix in the first line, then a file."""
    return seeds.map(_damaged)


_watched: list[Path] = []
_opened: list[str] = []


@functools.cache
def _watch():
    """Note what is opened while a model is read."""

    def note(event, arguments):
        if _watched and event in ("open", "socket.connect", "subprocess.Popen", "os.system"):
            _opened.append(str(arguments[0]) if event == "open" else event)

    sys.addaudithook(note)


def _is_own(name):
    """True for files of Python, of the installed packages and of this repository's sources."""
    if not name.startswith("/"):
        return name.isdigit()  # a descriptor
    homes = (sys.prefix, sys.base_prefix, *filter(None, sys.path))
    path = Path(name)
    return path.is_relative_to(_watched[0]) or name.startswith(homes)


def check_model_file(data):
    """It becomes a checked scene, or is refused in words; no other file is opened."""
    _watch()
    registry()
    suffix, _, text = data.partition(b"\n")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"model{suffix.decode('latin-1')}")
        path.write_bytes(text)
        _opened.clear()
        _watched[:] = [Path(folder)]
        try:
            with strict(HANG):
                scene, report = dap.import_model(path, registry=registry())
                assert scene.bodies
                assert str(list(report.translated)) is not None
                words = "read"
        except dap.SceneError as error:
            for mistake in error.mistakes:
                assert mistake.what, mistake
                assert mistake.file, mistake
            words = "refused"
        finally:
            others = [name for name in _opened if not _is_own(name)]
            _watched.clear()
        assert not others, others
    return words
