"""Conversion of values from scripts and files to plain Python."""

from typing import Any

_PLAIN = frozenset({float, int, str, bool, type(None)})


def plain(value: Any) -> Any:
    """A value as plain Python: arrays and lists become tuples, numpy's numbers Python's.

    Arrays of objects are returned unchanged, for ``check`` to refuse.
    """
    kind = type(value)
    if kind in _PLAIN:
        return value
    if kind is tuple:
        for v in value:
            if type(v) not in _PLAIN:
                break
        else:
            return value
    if kind is list or kind is tuple:
        return tuple([v if type(v) in _PLAIN else plain(v) for v in value])
    if kind is dict:
        return {k: plain(v) for k, v in value.items()}
    if hasattr(value, "tolist"):
        return _of_array(value)
    for base in (str, float, int):
        if isinstance(value, base):
            return base.__str__(value) if base is str else base(value)
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
