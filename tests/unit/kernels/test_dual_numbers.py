"""Dual numbers: every word of kernels has its derivative, for many instances at once."""

import numpy as np
import pytest

from dap3d_core import kernels as k
from dap3d_core.kernels.dual_numbers import Dual, comparisons

#: Points where all functions below are smooth, in the domain of each.
X = np.array([[0.11], [0.42], [0.73]])
FUNCTIONS = {
    "sum": lambda x: 2.0 + x - 1.5 * x,
    "quotient": lambda x: (1.0 - x) / (3.0 + x) + 2.0 / x - x / 4.0,
    "powers": lambda x: x**3 + x**-2 + x**0.5 + 2.0**x + x**x,
    "sqrt": lambda x: k.sqrt(x),
    "sin": lambda x: k.sin(3.0 * x),
    "cos": lambda x: k.cos(3.0 * x),
    "tanh": lambda x: k.tanh(2.0 * x),
    "asin": lambda x: k.asin(x),
    "acos": lambda x: k.acos(x),
    "exp": lambda x: k.exp(-x),
    "log": lambda x: k.log(x),
    "atan2": lambda x: k.atan2(x, 1.0 - 2.0 * x) + k.atan2(1.0, x) + k.atan2(x, -2.0),
    "hypot": lambda x: k.hypot(x, 1.0 - x),
    "abs": lambda x: k.abs(x - 0.5) + abs(0.5 - x),
    "floor": lambda x: k.floor(10.0 * x) * x,
    "minimum": lambda x: k.minimum(x, 0.5) + k.maximum(x * x, 0.3),
    "where": lambda x: k.where((x > 0.2) & ~(x > 0.6), x * x, (1.0 - x) ** 3),
    "tuples": lambda x: k.where(x < 0.5, (x, 1.0), (2.0, x * x))[1],
    "rint": lambda x: np.rint(10.0 * x) * x,
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_derivative(name):
    """Values are those of floats, derivatives those of central differences.

    Of sixth order with h = 1e-3: 1e-18 times seventh derivatives up to 1e6, and eps / h.
    """
    function, h = FUNCTIONS[name], 1e-3
    dual = function(Dual(X, np.array([[1.0, -2.0]])))
    plain = np.array([[function(np.float64(x))] for x in X[:, 0]])
    np.testing.assert_allclose(np.broadcast_to(dual.value, X.shape), plain, rtol=1e-15)
    slope = (
        sum(
            w * (np.array([[function(x + n * h) - function(x - n * h)] for x in X[:, 0]]))
            for n, w in ((1, 45 / 60), (2, -9 / 60), (3, 1 / 60))
        )
        / h
    )
    both = slope * [1.0, -2.0]
    own = np.broadcast_to(dual.slope, both.shape)
    np.testing.assert_allclose(own, both, rtol=1e-10, atol=1e-11)


def test_powers_of_zero():
    """Their slopes are those of polynomials: 0 of x^0 and x^2, 1 of x; also of dual exponents."""
    zero, still = Dual(np.zeros((1, 1)), np.ones((1, 1))), np.zeros((1, 1))
    for n, slope in ((0, 0.0), (1, 1.0), (2, 0.0)):
        assert (zero**n).slope == slope
        with np.errstate(divide="ignore", invalid="ignore"):
            assert (zero ** Dual(np.full((1, 1), float(n)), still)).slope == slope


def test_a_branch_on_a_number_is_refused():
    """A kernel that branches by ``if`` is told what to write."""
    with pytest.raises(TypeError, match=r"use where\(condition, a, b\)"):
        FUNCTIONS["sum"](Dual(X)) and 1.0


def test_comparisons_by_order_are_recorded():
    """In their order, of all instances; equality is none, and what comes later is left out."""
    x = Dual(X)
    with comparisons() as found:
        k.where((x > 0.5) | (x == 0.5), k.maximum(x, 0.3), 1.0 - x)
    assert (x < 1.0).value.all()
    assert [one.ravel().tolist() for one in found] == [[False, False, True], [False, True, True]]
