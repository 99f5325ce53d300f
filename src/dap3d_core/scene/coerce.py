"""Conversion of values from scripts and files to plain Python."""

from functools import cache
from keyword import iskeyword
from typing import Any
from unicodedata import normalize

import attrs

_PLAIN = frozenset({float, int, bool, type(None)})


def canonical(text: str) -> str:
    """A text with composed characters (Unicode's form NFC), as scenes hold all names.

    Letters that look alike remain different: the micro sign is no Greek mu.
    """
    return text if text.isascii() else normalize("NFC", text)


def with_identifiers(fields: dict[str, Any]) -> dict[str, Any]:
    """Fields of a type by the names that Python gives them in its class (Unicode's form NFKC).

    Unchanged where two of them would be one: the check then refuses the one that is unknown.
    """
    if all(map(str.isascii, fields)):
        return fields
    found = {normalize("NFKC", name): value for name, value in fields.items()}
    return found if len(found) == len(fields) else fields


def plain(value: Any) -> Any:
    """A value as plain Python: arrays and lists become tuples, numpy's numbers Python's.

    Arrays of objects are returned unchanged, for ``check`` to refuse.
    """
    kind = type(value)
    if kind in _PLAIN:
        return value
    if kind is str:
        return canonical(value)
    if kind is tuple:
        for v in value:
            if type(v) not in _PLAIN:
                break
        else:
            return value
    if kind is list or kind is tuple:
        return tuple([v if type(v) in _PLAIN else plain(v) for v in value])
    if kind is dict:
        return {plain(k): plain(v) for k, v in value.items()}
    if hasattr(value, "tolist"):
        return _of_array(value)
    for base in (str, float, int):
        if isinstance(value, base):
            return canonical(base.__str__(value)) if base is str else base(value)
    return plain(list(value)) if isinstance(value, (list, tuple)) else value


def _of_array(value: Any) -> Any:
    """An array or a number of numpy as plain Python; objects and masked numbers unchanged."""
    sort = getattr(getattr(value, "dtype", None), "kind", "")
    if not value.shape and getattr(value, "mask", False):  # a missing number
        return value
    listed = value if sort == "O" else value.tolist()
    if type(listed) is not type(value):
        return plain(listed)
    return float(listed) if sort == "f" else listed  # long doubles are returned unchanged


@cache
def keys_of(class_: type) -> frozenset[str]:
    """The keys that a table of the scene file may hold, given the class it becomes."""
    return frozenset(a.name.rstrip("_") for a in attrs.fields(class_)) - {"name"}


def entry_of(class_: type, name: str, fields: dict[str, Any]) -> Any:
    """An entry of a table; a key that is a word of Python has an underscore in its class."""
    return class_(name, **{f"{k}_" if iskeyword(k) else k: v for k, v in fields.items()})
