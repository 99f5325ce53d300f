"""Where a switch comes nearest to zero within a step."""

import numpy as np
import pytest

from dap3d_core.integrators.stepping.event_location import cubic_minimum


def test_a_dip_behind_a_rise_is_seen():
    """As of a gap behind a low bounce, of a body that is about to fall and is thrown up."""
    p = np.polynomial.Polynomial([0.0, 1.0, -3.0, 2.3])
    d = p.deriv()
    roots = d.roots()
    x = cubic_minimum(p(0.0), d(0.0), p(1.0), d(1.0))
    assert p(roots[1]) < 0.5 * p(roots[0])
    assert x == pytest.approx(roots[1], rel=1e-12)


def test_what_is_clear_of_zero_is_passed():
    """A rise alone, and a dip that leaves more than half of the rise before it."""
    assert cubic_minimum(0.0, 1.0, 2.0, 1.0) == 1.0
    p = np.polynomial.Polynomial([1.0, 1.0, -3.0, 2.3])
    d = p.deriv()
    assert cubic_minimum(p(0.0), d(0.0), p(1.0), d(1.0)) == 1.0
