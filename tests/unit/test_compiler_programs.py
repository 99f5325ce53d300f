"""Programs drawn at random: plain Python and compiled code, however made, give the same bits."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.at_all_levels import (
    VALUES,
    compiled_at_all_levels,
    function_of,
    programs,
    same_bits,
)

from dap3d_core.kernels import atan2, exp, sin
from dap3d_core.kernels.cache import jit_is_on
from dap3d_core.kernels.compiler.types import COMPLEX, FLOAT, INT, Array

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")
VECTOR, MATRIX, INTEGERS = Array(FLOAT, 1), Array(FLOAT, 2), Array(INT, 1)


def helper(p, q):
    """What a program calls: two ways out, and a tuple on the way."""
    pair = p * q, p - q
    if pair[0] > pair[1]:
        return pair[0]
    return pair[1] + q


@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(programs(), st.lists(VALUES, min_size=10, max_size=10),
       st.lists(st.integers(-50, 50), min_size=3, max_size=3))  # fmt: skip
def test_random_programs_have_the_same_bits_everywhere(source, values, whole):
    function = function_of(source, helper=helper, sin=sin, exp=exp, atan2=atan2)

    def run(tried):
        x, m = np.array(values[:4]), np.array(values[4:]).reshape(2, 3)
        n, out = np.array(whole), np.zeros(7)
        with np.errstate(all="ignore"):
            tried(x, m, n, out)
        return np.concatenate([x, m.ravel(), out])

    wanted = run(function)
    for level, tried in compiled_at_all_levels(
        function, (VECTOR, MATRIX, INTEGERS, VECTOR)
    ).items():
        assert same_bits(wanted, run(tried)), (level, source)


@settings(max_examples=40, deadline=None)
@given(st.lists(VALUES, min_size=4, max_size=4))
def test_complex_numbers_are_numpys(values):
    """Products, quotients, magnitudes and sums, of complex numbers and of a real one with them."""

    def of_complex(z, out):
        a, b = z[0], z[1]
        out[0], out[1], out[2] = a * b, a / b, a - b
        out[3], out[4], out[5] = 2.5 * a, 1.0 / b, complex(abs(a), a.imag)
        out[6] = -a
        out[6] *= b

    z = np.array([complex(values[0], values[1]), complex(values[2], values[3])])
    wanted = np.zeros(7, dtype=complex)
    with np.errstate(all="ignore"):
        of_complex(z, wanted)
    numbers = Array(COMPLEX, 1)
    for tried in compiled_at_all_levels(of_complex, (numbers, numbers)).values():
        found = np.zeros(7, dtype=complex)
        tried(z.copy(), found)
        assert same_bits(wanted.view(float), found.view(float))
