"""Reads scene files: data only, nothing in them is executed."""

import os
import re
import stat
from functools import cache
from pathlib import Path
from typing import Any

from dap3d_core.registry.arguments import checked
from dap3d_core.registry.regular_files import read_regular
from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene.coerce import canonical, entry_of, keys_of, plain, with_identifiers
from dap3d_core.scene.contacts.tables import Collisions
from dap3d_core.scene.errors import MISSING, Key, MistakeList, SceneError, dotted, file_error
from dap3d_core.scene.scene import Scene
from dap3d_core.scene.tables import (
    HEADER_KEYS,
    NAMED,
    SCENE_FILE,
    SCHEMA,
    TABLES,
    Animation,
    AnimationPoint,
    Element,
    Simulation,
)

#: Where a scene has what other programs write at the top.
WHERE_ELSE = {
    "gravity": 'it is a force: [forces.gravity] with type = "weight"',
    "drivers": 'they are joints: [joints.NAME] with type = "rel-rot" or another',
    "springs": 'they are forces: [forces.NAME] with type = "ptp"',
    "t_end": "write it under [simulation]",
    "dt": "write it under [simulation]",
}
#: Keys of a table [include.NAME].
INCLUDE_KEYS = frozenset({"file", "at", "parameters"})
#: Larger files are refused before they are read.
LARGEST_FILE = 64 * 2**20
#: Keys of more parts are refused unread: parsing takes time and memory quadratic in their number.
MOST_PARTS = 32
_LONG_KEY = re.compile(
    r"""(?:^|[,{[])[ \t]*+(?:(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+)"""
    rf"{{{MOST_PARTS}}}",
    re.MULTILINE,
)
#: Python reads no longer whole numbers.
_LONG_NUMBER = re.compile(r"[0-9][0-9_]{4300}")
#: How ``tomllib`` begins to say that a key or a table is there twice.
_TWICE = ("Cannot declare", "Cannot overwrite")
#: Maximal nesting of tables and lists; a scene needs five levels.
DEEPEST = 50

#: The first bytes of HDF5 files, and so of results.
HDF5 = b"\x89HDF"


@checked
def load(source: str | bytes | os.PathLike[str]) -> Scene:
    """Read a scene; ``check`` validates its values.

    Args:
        source: a folder with a ``scene.toml``, a TOML file, or the name of a shipped model, with
            or without its group (``A04``, ``benchmarks/A04``).

    Raises:
        SceneError: there is no such file, or it is not TOML; says where and what to do.
    """
    return _load(source, ())


def _load(source: str | bytes | os.PathLike[str], within: tuple[Path, ...]) -> Scene:
    """A scene that the scenes of other files include, the outermost first."""
    path, notes = _find(source)
    scene = scene_of(_parse(read_text(path, LARGEST_FILE), path), path, within)
    scene.notes += notes
    return scene


def parse(text: str) -> Scene:
    """A scene from the text of a scene file, such as the one a result carries.

    Raises:
        SceneError: the text is not TOML.
    """
    return scene_of(tables_of(text))


def tables_of(text: str) -> dict[str, Any]:
    """The tables of the text of a scene file, or of its beginning, as written.

    Raises:
        SceneError: the text is not TOML.
    """
    return _parse(text, Path("scene"))


def shipped_models() -> dict[str, Path]:
    """The folders of the models that come with dap3d, by name; those of a group come last.

    A group is a folder of models, such as ``benchmarks``.
    """
    return dict(_shipped_models())


@cache
def _shipped_models() -> dict[str, Path]:
    """The same, looked for once: a scene may include hundreds of files."""
    root = _models_folder()
    files = [f for depth in ("*", "*/*") for f in sorted(root.glob(f"{depth}/{SCENE_FILE}"))]
    return {file.parent.name: file.parent for file in files}


def group_of(folder: Path) -> str:
    """The group that the folder of a shipped model belongs to, "" if to none."""
    return folder.parent.name if folder.parent != _models_folder() else ""


def scene_of(
    data: dict[str, Any], path: Path | None = None, within: tuple[Path, ...] = ()
) -> Scene:
    """A scene from the tables of a scene file; ``Scene.faults`` holds their mistakes.

    Args:
        data: the tables.
        path: the file; None of a text, which includes no others.
        within: the files that include this one, the outermost first.
    """
    mistakes = MistakeList()
    for name, content in data.items():
        if name not in TABLES:
            value = MISSING if isinstance(content, (dict, list)) else plain(content)
            what = f"unknown table; a scene has {', '.join(TABLES)}"
            remedy = WHERE_ELSE.get(name, "")
            nearest = "" if remedy else mistakes.nearest(name, TABLES)
            mistakes.add((name,), value, what, nearest, remedy)
    scene = Scene(faults=mistakes.mistakes, path=path)
    header = _known(mistakes, ("scene",), data.get("scene", {}), HEADER_KEYS)
    scene.name = header.get("name", "")
    scene.description = header.get("description", "")
    scene.schema = header.get("schema", SCHEMA)
    for table, class_ in NAMED.items():
        named = getattr(scene, table)
        for name, content in _table(mistakes, (table,), data.get(table, {})).items():
            named[name] = _entry(mistakes, (table, name), content, class_)
    for table in ("requires", "parameters", "outputs"):
        content = _table(mistakes, (table,), data.get(table, {}))
        setattr(scene, table, {name: plain(value) for name, value in content.items()})
    if "collisions" in data:
        content = _known(mistakes, ("collisions",), data["collisions"], keys_of(Collisions))
        scene.collisions = Collisions(**content)
    scene.animation = _animation(mistakes, data.get("animation", {}))
    settings = data.get("simulation", {})
    scene.simulation = Simulation(
        **_known(mistakes, ("simulation",), settings, keys_of(Simulation))
    )
    for name, content in _table(mistakes, ("include",), data.get("include", {})).items():
        _include(mistakes, scene, name, content, within)
    return scene


def _include(
    mistakes: MistakeList, scene: Scene, name: str, content: Any, within: tuple[Path, ...]
) -> None:
    """Add a sub-assembly to a scene."""
    key = ("include", name)
    entry = _known(mistakes, key, content, INCLUDE_KEYS)
    file, path = plain(entry.get("file", MISSING)), scene.path
    if type(file) is not str or file == MISSING:
        mistakes.add((*key, "file"), file, 'is required: the scene file, such as "axle.toml"')
        return
    if path is None:
        mistakes.add(key, MISSING, "a text has no folder in which to find files to include")
        return
    found, within = path.parent / file, (*within, path.resolve())
    if found.resolve() in within:
        chain = " -> ".join(f.name for f in (*within, found))
        mistakes.add((*key, "file"), file, f"files include one another in a circle: {chain}")
        return
    try:
        part = _load(file if file in shipped_models() else found, within)
    except SceneError as error:
        for mistake in error.mistakes:
            mistakes.add((*key, "file"), file, str(mistake))
        return
    from dap3d_core.scene.include import included

    parameters = plain(entry.get("parameters", {}))
    added = included(mistakes, key, part, plain(entry.get("at", {})), parameters)
    if added is not None:
        added.add_to(scene, mistakes)


def _table(mistakes: MistakeList, key: Key, content: Any) -> dict[str, Any]:
    """The content of a table; empty, and a mistake, for anything else."""
    if isinstance(content, dict):
        return content
    what = f"should be a table, [{dotted(key)}]"
    if isinstance(content, list):
        what = f"should be a table: write [{dotted(key)}] with single brackets, names below it"
    mistakes.add(key, plain(content), what)
    return {}


def _known(
    mistakes: MistakeList, key: Key, content: Any, allowed: frozenset[str]
) -> dict[str, Any]:
    """The known keys of a table; the others are mistakes."""
    table = _table(mistakes, key, content)
    if table.keys() <= allowed:
        return table
    mistakes.add_unknown_keys(key, {k: plain(v) for k, v in table.items()}, allowed)
    return {k: v for k, v in table.items() if k in allowed}


def _entry(mistakes: MistakeList, key: Key, content: Any, class_: type) -> Any:
    name = str(key[-1])
    if class_ is Element:
        table = with_identifiers(_table(mistakes, key, content))
        fields = {k: plain(v) for k, v in table.items()}
        return Element(name, fields.pop("type", None), fields)
    return entry_of(class_, name, _known(mistakes, key, content, keys_of(class_)))


def _animation(mistakes: MistakeList, content: Any) -> Animation:
    known = _known(mistakes, ("animation",), content, keys_of(Animation))
    tables = known.get("points", [])
    if not isinstance(tables, list):
        what = 'should be a list of tables such as {body = "crank", sPp = [0.0, 0.0, 1.0]}'
        mistakes.add(("animation", "points"), plain(tables), what)
        tables = []
    keys = keys_of(AnimationPoint)
    points = [
        AnimationPoint(**_known(mistakes, ("animation", "points", k), table, keys))
        for k, table in enumerate(tables)
    ]
    return Animation(points, known.get("limits"))


# ---------------------------------------------------------------------------- files


def _find(source: Any) -> tuple[Path, list[str]]:
    """The scene file of a name, folder or path, with notes on the choice."""
    text = os.fsdecode(source)
    if not text.strip():
        raise file_error("", "the name of the model is empty; give a name, a folder or a file")
    if re.match(r"[A-Za-z][A-Za-z0-9+.-]+://", text):
        raise file_error(text, "a URL cannot be loaded", remedy="download it and give the file")
    path, models = Path(text), shipped_models()
    shipped = _shipped(text, models)
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError):
        if shipped is not None:
            return shipped / SCENE_FILE, []
        raise _not_found(path, text, models) from None
    except OSError as error:
        raise unreadable(path, error) from None
    if not stat.S_ISDIR(mode):
        return path, []
    if not (path / SCENE_FILE).exists():
        if shipped is not None:
            return shipped / SCENE_FILE, []
        others = sorted(f.name for f in path.glob("*.toml"))
        remedy = f"it holds {', '.join(others[:5])}; give that file" if others else ""
        raise file_error(path, f"the folder has no {SCENE_FILE}", remedy=remedy)
    notes = []
    if shipped is not None and shipped.resolve() != path.resolve():
        notes.append(f"{text} is also the name of a shipped model; the folder {path} was read")
    return path / SCENE_FILE, notes


def _shipped(text: str, models: dict[str, Path]) -> Path | None:
    """The folder of the shipped model that NAME or GROUP/NAME means."""
    folder = models.get(text.rpartition("/")[2])
    if folder is None:
        return None
    names = (folder.name, Path(group_of(folder), folder.name).as_posix())
    return folder if text in names else None


def _models_folder() -> Path:
    """The folder of the shipped models: in the package once installed, else next to the sources."""
    package = Path(__file__).parents[2]
    installed = package / "models_shipped"
    return installed if installed.is_dir() else package.parents[1] / "models"


def _parse(text: str, path: Path) -> dict[str, Any]:
    import tomllib

    if long := _LONG_KEY.search(text):
        what = f"a key of more than {MOST_PARTS} parts; those of a scene have 4 at most"
        raise file_error(path, what, line=text.count("\n", 0, long.end()) + 1)
    try:
        data = tomllib.loads(canonical(text))
    except RecursionError:
        raise _too_deep(path) from None
    except ValueError as error:  # TOMLDecodeError, and integers of thousands of digits
        words = str(error)
    else:
        if _is_too_deep(data):
            raise _too_deep(path)
        return data
    place = re.search(r"\(at line (\d+), column (\d+)\)", words)
    what = re.sub(r"\s*\(at [^()]*\)$", "", words)
    line: int | None
    remedy = ""
    if place is not None:
        line = int(place[1])
        what = f"{what} at line {line}, column {place[2]}"
        if what.startswith(_TWICE):
            what = _twice(canonical(text), line) or what
        if "'='" not in words:  # which says all where there is none
            remedy = _remedy(text.splitlines()[line - 1], int(place[2]) - 1)
    elif long := _LONG_NUMBER.search(text):
        line = text.count("\n", 0, long.end()) + 1
        what = "a number of thousands of digits"
    else:
        line = text.count("\n") + 1 if "end of document" in words else None
        what += " at the end of the file" if line else ""
    what = f"not valid TOML: {what}"
    if path.suffix == ".m":
        remedy = "this is a MATLAB file; dap3d import-matlab FOLDER makes a scene of it"
    elif path.suffix in (".urdf", ".sdf", ".xml", ".xacro"):
        remedy = f"this is a model of another program; dap3d import {path.name} makes a scene of it"
    raise file_error(path, what, line=line, remedy=remedy)


def _twice(text: str, line: int) -> str:
    """Where a key that a line gives again was given first; "" where that is not found."""
    from dap3d_core.scene.validate.mistake_collector import lines_of

    again = max(lines_of(text.splitlines()[line - 1]), key=len, default=())
    before = [n for key, n in lines_of(text).items() if key[-len(again) :] == again and n < line]
    return f"{dotted(again)} is there twice, first in line {max(before)}" if before else ""


#: Invalid values that users of other languages write, and the remedy.
_HABITS = (
    (r"[+-]?\d+,\d+", "a number has a decimal point, and no comma"),
    (r"[+-]?(\.\d+|\d+\.)([eE][+-]?\d+)?", "write digits on both sides of the decimal point"),
    (r"(?i)[+-]?(nan|inf|infinity)", "a scene has finite numbers alone"),
    (r"(True|False|TRUE|FALSE)", "write true or false"),
    (r"[+-]?[\d.]+([ ;]+[+-]?[\d.]+)+", "write commas between the items of a list"),
    (
        r"[\d.+-]+ *(?!e)[a-zA-Z/*^°%].*",
        'write numbers alone, in SI units, or an angle as "30 deg"',
    ),
    (r"\(.*", "write a list in square brackets"),
    (r"[^\W\d][\w .-]*", "write text in quotes, and names with spaces or accents"),
)
_DELIMITERS = re.compile(r"[][{},=#]")


def _remedy(line: str, column: int) -> str:
    """The remedy for an invalid value, where it or the item at the column is one of ``_HABITS``."""
    value = line.partition("=")[2].partition("#")[0]
    item = _DELIMITERS.split(line[:column])[-1] + _DELIMITERS.split(line[column:])[0]
    for habit, remedy in _HABITS:
        if any(re.fullmatch(habit, text.strip()) for text in (value, item)):
            return remedy
    return ""


def _is_too_deep(data: dict[str, Any]) -> bool:
    """True if tables and lists are nested more than ``DEEPEST`` levels deep."""
    level: list[Any] = [data]
    for _ in range(DEEPEST):
        inside = (v for c in level for v in (c.values() if type(c) is dict else c))
        level = [v for v in inside if type(v) in (dict, list)]
        if not level:
            return False
    return True


def _too_deep(path: Path) -> SceneError:
    what = f"lists or tables are nested too deeply: more than {DEEPEST} within one another"
    return file_error(path, what)


def _not_found(path: Path, text: str, models: dict[str, Path]) -> SceneError:
    near = nearest(path.name, _scene_files(path.parent))
    near = str(path.with_name(near)) if near else nearest(text, models)
    what = f"there is no file or folder {text!r}, and no shipped model of that name"
    if near:
        what += f"; did you mean {near!r}?"
    return file_error("", what, remedy=f"shipped models: {', '.join(models) or 'none'}")


def _scene_files(folder: Path) -> list[str]:
    """Names of the scene files in a folder."""
    try:
        return sorted(f.name for f in folder.glob("*.toml"))
    except (OSError, ValueError):
        return []


def read_text(path: Path, largest: int, remedy: str = "save it as UTF-8") -> str:
    """The text of a file of at most ``largest`` bytes, without a byte order mark.

    Raises:
        SceneError: it is too large, no regular file or no text; ``remedy`` is for other encodings.
    """
    try:
        info = path.stat()
        if not stat.S_ISREG(info.st_mode):
            raise file_error(path, "is not a regular file")
        if info.st_size > largest:
            size, most = info.st_size / 2**20, largest >> 20
            what = f"has {size:.{0 if most > 1 else 1}f} MiB; at most {most} MiB are read"
            raise file_error(path, what, remedy="build a scene of this size with a script")
        data = read_regular(path, largest)
    except OSError as error:
        raise unreadable(path, error) from None
    if b"\0" in data:
        hint = "it may be a result: dap3d info describes it" if data.startswith(HDF5) else ""
        raise file_error(path, "is not a text file: it holds NUL bytes", remedy=hint)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        what = f"is not UTF-8 text: byte {error.object[error.start]:#04x} cannot be read"
        raise file_error(path, what, line=line, remedy=remedy) from None


def unreadable(path: Path, error: Exception) -> Exception:
    """The error for a file or folder that the system does not read."""
    reason = getattr(error, "strerror", None) or error
    return file_error(path, f"cannot be read: {reason}")
