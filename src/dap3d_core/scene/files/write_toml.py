"""Writes scenes as scene files, without loss: floats are written to the last bit."""

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import attrs

from dap3d_core.scene.coerce import plain
from dap3d_core.scene.errors import MISSING, Mistake, SceneError, file_error
from dap3d_core.scene.tables import NAMED, SCENE_FILE, Element, SceneTables

#: Maximal bits of an integer; TOML requires readers to take 64, Python writes some 14000.
LONGEST_INTEGER = 4096
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_ESCAPES = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def to_toml(scene: SceneTables) -> str:
    """The text of the scene file of a scene; reading it gives an equal scene.

    Raises:
        SceneError: the scene holds something that a scene file cannot.
    """
    if scene.faults:
        raise SceneError(m for _, m in scene.faults)
    header = {"name": scene.name, "description": scene.description, "schema": scene.schema}
    lines = _table("scene", ((k, v) for k, v in header.items() if v != ""))
    lines += _table("requires", scene.requires.items(), needed=False)
    lines += _table("parameters", scene.parameters.items(), needed=False)
    for table in NAMED:
        for name, entry in getattr(scene, table).items():
            lines += _table(f"{table}.{_key(name)}", _fields(entry))
    lines += _table("outputs", scene.outputs.items(), needed=False)
    if scene.collisions is not None:
        lines += _table("collisions", _fields(scene.collisions))
    if scene.animation.points or scene.animation.limits is not None:
        lines += _animation(scene)
    lines += _table("simulation", _fields(scene.simulation), needed=False)
    return "\n".join(lines)


def save(scene: SceneTables, path: str | Path, force: bool) -> Path:
    """Write a scene to a file, whole or not at all; returns the file.

    Raises:
        SceneError: the scene holds something a scene file cannot, or the file cannot be written,
            or exists and ``force`` is off.
    """
    from dap3d_core.kernels.runtime.sealed_files import replace_file

    text = to_toml(scene)
    try:
        path = Path(path)
        path = path / SCENE_FILE if path.is_dir() else path
        if not force and os.path.exists(path):
            raise file_error(path, "exists; force=True overwrites it")
        replace_file(Path(os.path.realpath(path)), text.encode("utf-8"))  # a link stays one
    except (OSError, ValueError) as error:  # ValueError: NUL in the path
        reason = error.strerror if isinstance(error, OSError) else error
        raise file_error(path, f"cannot be written: {reason}") from error
    return path


def _table(title: str, pairs: Iterable[tuple[str, Any]], *, needed: bool = True) -> list[str]:
    lines = [f"{_key(k)} = {_value(v, f'{title}.{k}')}" for k, v in pairs]
    return [f"[{title}]", *lines, ""] if lines or needed else []


def _fields(entry: Any) -> Iterator[tuple[str, Any]]:
    """Fields that differ from their defaults; a default that was given again is written too."""
    if isinstance(entry, Element):
        if entry.type is not None:
            yield "type", entry.type
        yield from entry.fields.items()
        return
    for field in attrs.fields(type(entry)):
        value = getattr(entry, field.name)
        if field.name == "name" or value is None or value is field.default:
            continue
        if type(value) is bool and value == field.default:
            continue
        yield field.name.rstrip("_"), value


def _animation(scene: SceneTables) -> list[str]:
    lines = ["[animation]"]
    points = [dict(_fields(point)) for point in scene.animation.points]
    if points:
        items = [f"    {_value(point, 'animation.points')}," for point in points]
        lines += ["points = [", *items, "]"]
    if scene.animation.limits is not None:
        lines.append(f"limits = {_value(scene.animation.limits, 'animation.limits')}")
    return [*lines, ""]


def _value(value: Any, place: str) -> str:
    kind = type(value)
    if kind is float:
        return repr(value)
    if kind is tuple:
        return f"[{', '.join([repr(v) if type(v) is float else _value(v, place) for v in value])}]"
    if kind is str:
        return _text(value)
    if kind is bool:
        return "true" if value else "false"
    if kind is int:
        if value.bit_length() > LONGEST_INTEGER:
            raise SceneError([Mistake(place, value, "a scene file cannot hold so large a number")])
        return repr(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(k)} = {_value(v, place)}" for k, v in value.items()) + "}"
    if hasattr(value, "isoformat"):  # a date: no value of a scene, but TOML knows it
        return str(value.isoformat())
    other = plain(value)
    if other is value or type(other) is kind:
        raise SceneError([Mistake(place, value, f"a scene file cannot hold {kind.__name__}")])
    return _value(other, place)


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _text(name)


def _text(text: str) -> str:
    return f'"{"".join(map(_character, text))}"'


def _character(c: str) -> str:
    if c in _ESCAPES:
        return _ESCAPES[c]
    if c.isprintable():
        return c
    if 0xD800 <= ord(c) < 0xE000:
        raise SceneError([Mistake("", MISSING, f"text with {c!r} cannot be written as UTF-8")])
    return f"\\u{ord(c):04x}" if ord(c) < 0x10000 else f"\\U{ord(c):08x}"
