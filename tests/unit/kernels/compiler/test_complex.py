"""Complex numbers of compiled code, which plain Python takes from numpy: in all bits.
Programs drawn at random: tests/fuzz/programs.py."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.at_all_levels import VALUES, compiled_at_all_levels, same_bits
from support.internals import COMPLEX, Array
from support.plain import jit_is_on

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")


@pytest.mark.slow
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
