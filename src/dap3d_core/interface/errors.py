"""The error of an unusable type: where the fault is in the author's file, and its remedy."""

import os
import re
from collections.abc import Callable, Collection
from difflib import get_close_matches
from errno import ENOMEM
from inspect import get_annotations, getsourcefile, unwrap
from pathlib import Path
from traceback import extract_tb
from typing import Any

import attrs

from dap3d_core.interface.fields import specs_of

#: The maker of a field by its annotation; of numbers by default.
MAKERS = {"Point": "point", "Vector": "vector", "Vector2": "vector2", "Body": "body"}
#: What a scene names a type by, after the distribution and a colon where two have one of its name.
KEYWORD = re.compile(r"\w(?:[\w.-]*\w)?")
#: Where this program is.
OWN = f"{Path(__file__).parents[1]}{os.sep}"
#: Of the dynamic linker, and of threads.
MEMORY_WORDS = ("failed to map segment", "cannot allocate memory", "can't start new thread")


class PluginError(Exception):
    """A type or a plugin cannot be used; the message names file, type, function and remedy."""


def is_out_of_memory(error: BaseException | None) -> bool:
    """True if an exception, or one that it arose from, is due to a lack of memory.

    A library whose file does not fit into the address space is reported as one that is not found.
    """
    seen: set[int] = set()  # an exception that was raised from itself has no end
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        text = str(error).lower()
        is_lack = isinstance(error, MemoryError) or getattr(error, "errno", None) == ENOMEM
        if is_lack or any(words in text for words in MEMORY_WORDS):
            return True
        error = error.__cause__ or error.__context__
    return False


def plain_words() -> str:
    """The remedy for a kernel written with anything but the functions of kernels."""
    from dap3d_core.kernels import __all__ as words  # imports numpy
    from dap3d_core.kernels import scalar_math

    mathematics = [name for name in words if hasattr(scalar_math, name) and name != "where"]
    return (
        "branch by where(condition, a, b), not by if, while, and, or, not, min or max, and take "
        f"{', '.join(mathematics)} from dap3d_core.kernels, not from math or numpy"
    )


def where_is(type_: type) -> str:
    """File and class of a type, for messages."""
    try:
        file = getsourcefile(type_) or type_.__module__
    except (TypeError, OSError):
        file = type_.__module__
    return f"{file}: {type_.__name__}"


def is_own(kernel: Callable[..., Any]) -> bool:
    """True for a function of this program, which calls those of an author."""
    return unwrap(kernel).__code__.co_filename.startswith(OWN)


def line_of(error: BaseException, kernel: Callable[..., Any]) -> str:
    """The line of the author's file in which an exception arose: " [FILE:LINE]"."""
    file, frames = unwrap(kernel).__code__.co_filename, extract_tb(error.__traceback__)
    if is_own(kernel):
        files = [frame.filename for frame in frames if not frame.filename.startswith(OWN)]
        file = files[-1] if files else file
    lines = [f.lineno for f in frames if f.filename == file]
    return f" [{file}:{lines[-1]}]" if lines else ""


def fault_of_keyword(type_: Any) -> str:
    """The reason why a type cannot be named by its keyword; "" where it can."""
    keyword = type_.keyword
    if not isinstance(keyword, str) or not keyword:
        example = f'keyword = "{type_.__name__.lower()}"'
        return f"has no keyword; add e.g. {example}, without an annotation"
    if KEYWORD.fullmatch(keyword):
        return ""
    return f"has keyword = {keyword!r}, which is no word; use letters, digits, and - _ . in it"


def no_field(type_: type, name: str) -> str:
    """The message for a member that looks like a field and is none, with the remedy; or ""."""
    for class_ in type_.__mro__:
        annotation = get_annotations(class_).get(name)
        if annotation is None or name in specs_of(type_):
            continue
        declared = {a.name: a.default for a in attrs.fields(type_)}
        value = declared.get(name, vars(class_).get(name, attrs.NOTHING))
        word = getattr(annotation, "__name__", str(annotation))
        given = "" if value is attrs.NOTHING else f" = {value!r}"
        return f"{name}: {word}{given} is no field; write {name}: {word} = {_maker(word, value)}"
    return ""


def name_hint(type_: type, name: str, names: Collection[str]) -> str:
    """What may be meant by a name in a kernel that no field offers; or ""."""
    if name == "self":
        return "kernels take no self, but fields by their names; "
    if declared := no_field(type_, name):
        return f"{declared}; "
    meant = re.sub(r"^(r_dot|rd)_", "v_", name).replace("omega_", "w_")
    near = get_close_matches(meant, names, 1)
    return f"did you mean {near[0]}? " if near else ""


def _maker(word: str, value: Any) -> str:
    default = "" if value is attrs.NOTHING else repr(value)
    if isinstance(value, bool) or word == "bool":
        return f"choice((False, True){f', {default}' if default else ''})"
    if isinstance(value, tuple) and len(value) == 3:
        return f"vec3({default})"
    return f"{MAKERS.get(word, 'number')}({default})"
