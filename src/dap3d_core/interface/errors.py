"""The error of an unusable type: where the fault is in the author's file, and its remedy."""

from collections.abc import Callable
from inspect import get_annotations, getsourcefile, unwrap
from traceback import extract_tb
from typing import Any

import attrs

from dap3d_core.interface.fields import specs_of

#: The maker of a field by its annotation; of numbers by default.
MAKERS = {"Point": "point", "Vector": "vector", "Vector2": "vector2", "Body": "body"}


class PluginError(Exception):
    """A type or a plugin cannot be used; the message names file, type, function and remedy."""


def plain_words() -> str:
    """The remedy for a kernel written with anything but the words of kernels."""
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


def line_of(error: BaseException, kernel: Callable[..., Any]) -> str:
    """The line of the author's file in which an exception arose: " [FILE:LINE]"."""
    file = unwrap(kernel).__code__.co_filename
    lines = [f.lineno for f in extract_tb(error.__traceback__) if f.filename == file]
    return f" [{file}:{lines[-1]}]" if lines else ""


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


def _maker(word: str, value: Any) -> str:
    default = "" if value is attrs.NOTHING else repr(value)
    if isinstance(value, bool) or word == "bool":
        return f"choice((False, True){f', {default}' if default else ''})"
    if isinstance(value, tuple) and len(value) == 3:
        return f"vec3({default})"
    return f"{MAKERS.get(word, 'number')}({default})"
