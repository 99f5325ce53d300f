"""Where in an author's file something is wrong, and what stands there in place of it."""

from collections.abc import Callable
from inspect import get_annotations, unwrap
from traceback import extract_tb
from typing import Any

import attrs

from dap3d_core.interface.fields import specs_of

#: The maker of a field by what stands behind its name; of numbers by default.
MAKERS = {"Point": "point", "Vector": "vector", "Vector2": "vector2", "Body": "body"}


def line_of(error: BaseException, kernel: Callable[..., Any]) -> str:
    """The line of the author's file in which an exception arose: " [FILE:LINE]"."""
    file = unwrap(kernel).__code__.co_filename
    lines = [f.lineno for f in extract_tb(error.__traceback__) if f.filename == file]
    return f" [{file}:{lines[-1]}]" if lines else ""


def no_field(type_: type, name: str) -> str:
    """That a class has a name which looks like a field and is none, with the remedy; or ""."""
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
