"""Numbers of many instances: what kernels compute of each is what floats give."""

import numpy as np
import pytest

from dap3d_core import kernels as k
from dap3d_core.testing.samples.many_numbers import Many, comparisons

X = np.array([[0.11], [0.42], [0.73]])
FUNCTIONS = {
    "sum": lambda x: 2.0 + x - 1.5 * x - (-x) + (1.0 - x),
    "quotient": lambda x: (1.0 - x) / (3.0 + x) + 2.0 / x - x / 4.0,
    "powers": lambda x: x**3 + x**-2 + x**0.5 + 2.0**x + x**x,
    "functions": lambda x: k.sqrt(x) + k.sin(x) + k.tanh(x) + k.asin(x) + k.exp(-x) + k.log(x),
    "atan2": lambda x: k.atan2(x, 1.0 - 2.0 * x) + k.atan2(1.0, x) + k.atan2(x, -2.0),
    "abs": lambda x: k.abs(x - 0.5) + abs(0.5 - x) + k.floor(10.0 * x) * x,
    "minimum": lambda x: k.minimum(x, 0.5) + k.maximum(x * x, 0.3),
    "where": lambda x: k.where((x > 0.2) & ~(x > 0.6), x * x, (1.0 - x) ** 3),
    "tuples": lambda x: k.where(x < 0.5, (x, 1.0), (2.0, x * x))[1],
    "rint": lambda x: np.rint(10.0 * x) * x,
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_each_value_is_that_of_a_float(name):
    """To the last digits: numpy's functions of vectors round apart from those of numbers."""
    function = FUNCTIONS[name]
    plain = np.array([[function(np.float64(x))] for x in X[:, 0]])
    found = np.broadcast_to(function(Many(X)).value, X.shape)
    np.testing.assert_allclose(found, plain, rtol=1e-15)


def test_comparisons_by_order_are_recorded_and_others_are_not():
    with comparisons() as found:
        k.where((Many(X) > 0.2) | (Many(X) == 0.11), 1.0, 2.0)
        k.where(Many(X) <= 0.42, 1.0, 2.0)
    assert [x.ravel().tolist() for x in found] == [[False, True, True], [True, True, False]]


def test_a_branch_is_refused():
    with pytest.raises(TypeError, match="where"):
        bool(Many(X))
