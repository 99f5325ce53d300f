"""Loops over tuples of constants in compiled code."""

import numpy as np
import pytest
from support.at_all_levels import compiled_at_all_levels
from support.internals import FLOAT, INT, VECTOR, Array, CompileError, Program
from support.plain import jit_is_on

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")

#: Rows of several lengths, which are values of several types.
ROWS = ((0, ((2.0, 1),)), (1, ((0.5, 0), (-1.5, 2), (0.25, 1))), (2, ()))


def row_sum(row, k, out):
    for number, terms in ROWS:
        if number == row:
            for weight, j in terms:
                out[number] += weight * k[j, number]


def last_of(x, out):
    y = 5.0
    for y in (1.0, 2.0):  # noqa: B007 its last value is used
        out[0] += x
    out[1] = y


def used_behind(out):
    for x, _ in ((1.0, 2.0), (3.0, 4.0)):
        out[0] += x
    out[1] = x


def test_items_of_several_types_are_constants_of_the_code():
    """A name of such a loop is no variable, which would be of one type."""
    k = np.arange(9.0).reshape(3, 3)
    for tried in compiled_at_all_levels(row_sum, (INT, Array(FLOAT, 2), VECTOR)).values():
        for row in range(3):
            wanted, found = np.zeros(3), np.zeros(3)
            row_sum(row, k, wanted)
            tried(row, k, found)
            assert np.array_equal(found, wanted)
            assert np.any(found) == (row < 2)


def test_a_name_that_is_a_variable_as_well_has_its_last_value():
    for tried in compiled_at_all_levels(last_of, (FLOAT, VECTOR)).values():
        found = np.zeros(2)
        tried(3.0, found)
        assert found.tolist() == [6.0, 2.0]


def test_a_constant_of_a_loop_is_not_known_behind_it():
    with pytest.raises(CompileError, match="x has no value yet"):
        Program().function(used_behind, (Array(FLOAT, 1),))
