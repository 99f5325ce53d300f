"""Complex steps: derivatives of all words of the kernels, against closed forms."""

import math

import numpy as np
import pytest
from support.internals import unwound

from dap3d_core.kernels import atan2, cos, lookup, norm2, sin, sqrt, tanh, where
from dap3d_core.testing.samples.complex_step import STEP, Stepped

X = 0.7
FORMULAS = {
    "sqrt": (sqrt, 0.5 / math.sqrt(X)),
    "sin": (sin, math.cos(X)),
    "cos": (cos, -math.sin(X)),
    "tanh": (tanh, 1.0 - math.tanh(X) ** 2),
    "atan2 of y": (lambda x: atan2(x, 2.0), 2.0 / (X * X + 4.0)),
    "atan2 of x": (lambda x: atan2(-2.0, x), 2.0 / (X * X + 4.0)),
    "where": (lambda x: where(x > 0.0, 3.0 * x, 0.0), 3.0),
    "where not": (lambda x: where(x < 0.0, 3.0 * x, 0.0), 0.0),
    "abs": (lambda x: abs(-x) + abs(x), 2.0),
    "max": (lambda x: max(x, 0.5) + min(x, 0.5) * x, 1.5),
    "powers": (lambda x: x**3 + x**0.5 + 2.0**x,
               3 * X**2 + 0.5 / math.sqrt(X) + 2.0**X * math.log(2.0)),
    "quotients": (lambda x: 1.0 / x - (1 - x) / (x + 2), -1 / X**2 + 3 / (X + 2) ** 2),
    "remainder": (lambda x: (10.0 * x) % 2.0 + (-x) % 3.0, 9.0),
    "floor": (lambda x: x * math.floor(10.0 * x) + x // 0.1 + round(x), 7.0),
    "norm2": (lambda x: norm2((x, -x, 1.0)), 4.0 * X),
    "lookup": (lambda x: lookup(([0.0, 5.0, 1.0, 6.0], 0, 2, (0.0, 0.0)), x)[1] * x, 5.0),
    "turns": (lambda x: unwound(x, 20.0), 1.0),
    "numpy's floats": (lambda x: np.float64(2.0) * x + np.float64(1.0) - x / np.float64(4.0), 1.75),
}  # fmt: skip


@pytest.mark.parametrize(("formula", "slope"), FORMULAS.values(), ids=FORMULAS)
def test_derivatives(formula, slope):
    """To some roundings; the value is that of the same formula of a float."""
    found = formula(Stepped(X, STEP))
    assert float(getattr(found, "real", found)) == pytest.approx(formula(X), rel=1e-15)
    if slope:
        assert isinstance(found, Stepped)
    assert getattr(found, "imag", 0.0) / STEP == pytest.approx(slope, rel=1e-14)


def test_comparisons_are_those_of_the_real_part():
    """So a kernel takes the branch that it takes for floats."""
    x = Stepped(X, STEP)
    assert x == X
    assert bool(x != X) is False
    assert X <= x <= X
    assert 0.5 < x < Stepped(1.0, -STEP)
    assert x > 0.5
    assert x >= Stepped(X)
    assert hash(x) == hash(complex(X, STEP))
    assert not Stepped(0.0, STEP)
    assert x.slope == 1.0


def test_what_takes_floats_alone_says_so():
    """The derivative is not lost quietly."""
    with pytest.raises(TypeError):
        math.sin(Stepped(X, STEP))
    with pytest.raises(TypeError):
        float(Stepped(X, STEP))
