"""Structs of arrays that compiled functions of the tests read and write."""

import attrs

from support.internals import Arrays, Floats, Integers, Matrix


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Inner(Arrays):
    """A struct within a struct."""

    table: Matrix


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Numbers(Arrays):
    """What the functions of a test read and write."""

    x: Floats
    out: Floats
    order: Integers
    inner: Inner
