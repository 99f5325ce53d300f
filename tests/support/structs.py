"""Structs of arrays that compiled functions of the tests read and write."""

from typing import Any

import attrs

from support.internals import INTEGERS, MATRIX, Arrays


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Inner(Arrays):
    """A struct within a struct."""

    types = {"table": MATRIX}  # noqa: RUF012
    table: Any


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Numbers(Arrays):
    """What the functions of a test read and write."""

    types = {"order": INTEGERS, "inner": Inner.type_of()}  # noqa: RUF012
    x: Any
    out: Any
    order: Any
    inner: Any
