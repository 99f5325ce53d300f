"""Differentiated functions of the subset: values have the bits of the function, slopes are exact.
Slopes are compared with complex steps where the function is analytic, else with differences."""

import cmath
import math

import attrs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.at_all_levels import function_of, made_of, programs, same_bits
from support.internals import (
    Arrays,
    CompileError,
    DifferentiatedArrays,
    Floats,
    Integers,
    Matrix,
    Program,
    compiled,
    differentiated,
    pointer,
    units,
)
from support.plain import jit_is_on
from support.structs import Inner, Numbers

from dap3d_core.kernels import scalar_math
from dap3d_core.kernels.compiler.derivatives import differentiate

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")


@compiled
def smooth(numbers):
    """Every operation and function that is analytic."""
    x, out, order = numbers.x, numbers.out, pointer(numbers.order)
    for k in range(order.shape[0]):
        a, b, m = x[order[k]], x[k], 16 * k
        out[m] = a + b * 3.0 - a / b - 2.0 / a + b / 7.0
        out[m + 1] = math.sin(a) + math.cos(a * b) + math.tan(0.3 * a)
        out[m + 2] = np.sqrt(a * a + 1.0) ** 0.3
        out[m + 3] = (1.0 + a * a) ** b + a**2.0
        out[m + 4] = math.exp(a) * math.log(b * b + 0.5)
        out[m + 5] = math.asin(0.1 * a) + math.acos(0.1 * b) - math.atan(a)
        out[m + 6] = math.sinh(a) + math.cosh(b) + math.tanh(a * b)
        out[m + 7] = product(numbers.inner, a, k)
        out[m + 8] = k + float(order[k] > 1) * a
        out[m + 9] = -a * -b


@compiled
def product(inner, a, k):
    """A row of a table times a number and its square."""
    row, (b, c) = inner.table[k], (a, a * a)
    return row[0] * b + row[1] * c


@compiled
def with_corners(numbers):
    """What is no analytic function: orders, branches, functions of two numbers."""
    x, out = numbers.x, numbers.out
    a, b, c = x[0], x[1], x[2]
    out[0] = max(a, b, 0.5) - min(a, -b)
    out[1] = abs(a) + np.sign(a) + np.rint(3.0 * b)
    out[2] = math.atan2(a, b) + abs(complex(b, c))
    if a > b:
        out[3] = a * a
    else:
        out[3] = b * c
    z = complex(a, b)
    w = z * complex(c, 2.0) / (z + complex(1.0, c))
    out[4], out[5] = w.real, w.imag
    out[6] = out[int(abs(a))]
    out[7] = np.nextafter(a, 9.0)


@compiled
def with_remarks(numbers):
    x, out = numbers.x, numbers.out
    out[0] = scalar_math.with_slopes(x[0], x[1] * x[2])
    out[1] = scalar_math.with_slopes(x[0], 0.0)
    out[2] = 2.0 if scalar_math.is_differentiated() else 1.0
    product = x[1] * x[2]
    for k in range(scalar_math.slope_count()):
        out[3 + k] = scalar_math.slope(product, k)


@compiled
def norm(numbers):
    scalar_math.values_alone()
    x, out = numbers.x, numbers.out
    largest = 0.0
    for k in range(3):
        largest = max(largest, abs(-x[k]) / (math.sin(x[k]) + 2.0 * k + 3.0) - x[0] * x[1])
        out[k] = largest


@compiled
def at_corners(numbers):
    """Functions without a derivative at zero."""
    x, out = numbers.x, numbers.out
    zero = x[0] - x[0]
    out[0] = np.sqrt(zero * x[1])
    out[1] = abs(complex(zero, zero * x[1]))
    out[2] = math.atan2(zero, zero * x[1])
    out[3] = abs(zero * x[1])
    out[4] = (zero * x[1]) ** 0.5


def arrays(rng):
    table = Inner(table=rng.normal(size=(3, 2)))
    x = rng.uniform(0.3, 1.5, size=3) * rng.choice([-1.0, 1.0], size=3)  # away from 1 / 0
    return Numbers(x=x, out=np.zeros(48), order=np.array([0, 2, 1]), inner=table)


def differentiated_run(function, one, directions):
    """The results (48,) and their slopes (48, d) along directions of x, (3, d), and of the table.
    Those of the table are of x as well, row by row."""
    wide = DifferentiatedArrays(one, 1 + directions.shape[1])
    wide.slopes(one.x)[:] = directions
    wide.slopes(one.inner.table)[:] = np.repeat(directions, 2, axis=0)
    entry = differentiated(function.compile([units.type_of(one)]), 1 + directions.shape[1])
    entry(wide)
    wide.give()
    return one.out.copy(), wide.slopes(one.out).copy()


def changed(one, direction, h):
    """Numbers changed by h along a direction."""
    table = Inner(table=one.inner.table + h * direction[:, None])
    return Numbers(x=one.x + h * direction, out=np.zeros(48), order=one.order, inner=table)


def differences(function, one, direction):
    """Central differences of sixth order, (48,)."""
    h, total = 1e-3, 0.0
    for k, weight in enumerate((45.0, -9.0, 1.0), 1):
        for sign in (1.0, -1.0):
            other = changed(one, direction, sign * k * h)
            function(other)
            total = total + sign * weight * other.out / (60.0 * h)
    return total


@pytest.mark.every(4)
@pytest.mark.parametrize("count", [2, 3, 4, 8, 9, 10])
@pytest.mark.parametrize("function", [smooth, with_corners])
def test_values_have_the_bits_of_the_function_and_slopes_are_its_derivatives(function, count):
    rng = np.random.default_rng(count)
    for _ in range(5):
        one = arrays(rng)
        directions = rng.normal(size=(3, count - 1))
        plain = changed(one, np.zeros(3), 0.0)
        function(plain)
        values, slopes = differentiated_run(function, one, directions)
        assert values.tobytes() == plain.out.tobytes()
        for k in range(count - 1):
            expected = differences(function, one, directions[:, k])
            # differences of sixth order: rounding 1e-13 over the step, times numbers up to 10
            np.testing.assert_allclose(slopes[:, k], expected, rtol=1e-8, atol=1e-9)


def test_slopes_of_analytic_functions_are_those_of_complex_steps():
    rng = np.random.default_rng(7)
    one = arrays(rng)
    directions = rng.normal(size=(3, 5))
    _, slopes = differentiated_run(smooth, one, directions)
    step = 1e-30
    for k in range(5):
        a = complex(one.x[0], step * directions[0, k])
        expected = [
            a + a * 3.0 - a / a - 2.0 / a + a / 7.0,
            cmath.sin(a) + cmath.cos(a * a) + cmath.tan(0.3 * a),
            cmath.sqrt(a * a + 1.0) ** 0.3,
            (1.0 + a * a) ** a + a * a,
            cmath.exp(a) * cmath.log(a * a + 0.5),
            cmath.asin(0.1 * a) + cmath.acos(0.1 * a) - cmath.atan(a),
            cmath.sinh(a) + cmath.cosh(a) + cmath.tanh(a * a),
        ]
        found = slopes[: len(expected), k]
        # a few roundings of numbers of order one
        np.testing.assert_allclose(found, np.imag(expected) / step, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("count", [3, 4])  # within vectors of four; beside
def test_code_says_what_derivatives_of_results_are(count):
    one = arrays(np.random.default_rng(1))
    directions = np.eye(3, count)
    values, slopes = differentiated_run(with_remarks, one, directions)
    assert values[:6].tolist() == [one.x[0], one.x[0], 2.0, 0.0, one.x[2], one.x[1]]
    np.testing.assert_array_equal(slopes[0, :3], [0.0, one.x[2], one.x[1]])
    assert not slopes[1:6].any()
    plain = changed(one, np.zeros(3), 0.0)
    with_remarks(plain)
    assert plain.out[:4].tolist() == [one.x[0], one.x[0], 1.0, one.out[3]]
    assert scalar_math.with_slopes(1.0, 2.0) == 1.0
    assert not scalar_math.is_differentiated()
    assert scalar_math.slope(1.0, 0) == scalar_math.slope_count() == 0


@compiled
def over_seven(numbers):
    """Numbers over a constant, and over a number of a table."""
    for k in range(3):
        numbers.out[k] = numbers.x[k] / 7.0
        numbers.out[3 + k] = numbers.x[k] / numbers.inner.table[0, 0]


@pytest.mark.parametrize("count", [7, 8])
def test_what_has_no_slopes_divides_as_a_constant_does(count):
    """Programs of scenes have as constants what general code loads."""
    rng = np.random.default_rng(1)
    one, directions = arrays(rng), rng.normal(size=(3, count))
    one.inner.table[0, 0], directions[0] = 7.0, 0.0
    values, slopes = differentiated_run(over_seven, one, directions)
    assert values[:3].tobytes() == values[3:6].tobytes()
    assert slopes[1:3].any()
    assert np.array_equal(slopes[:3], slopes[3:6])


def test_norms_have_values_alone():
    one = arrays(np.random.default_rng(1))
    values, slopes = differentiated_run(norm, one, np.eye(3))
    norm(one)
    assert values.tobytes() == one.out.tobytes()
    assert not slopes.any()


def test_slopes_are_finite_where_functions_have_corners():
    one = arrays(np.random.default_rng(1))
    _, slopes = differentiated_run(at_corners, one, np.eye(3))
    assert np.all(np.isfinite(slopes[:5]))


def test_numbers_that_python_changes_lose_their_slopes():
    one = arrays(np.random.default_rng(1))
    wide = DifferentiatedArrays(one, 3)
    wide.slopes(one.x)[:] = 1.0
    one.x[1] = 5.0
    wide.take()
    assert wide.matrix(one.x)[1, 0] == 5.0
    np.testing.assert_array_equal(wide.slopes(one.x)[1], 0.0)
    np.testing.assert_array_equal(wide.slopes(one.x)[[0, 2]], 1.0)


def test_a_function_without_a_derivative_is_refused():
    text = "declare double @j0(double)\ndefine void @f() {\n  %1 = call double @j0(double 0.5)\n}\n"
    with pytest.raises(CompileError, match="j0 has no derivative"):
        differentiate(text, 3)


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Drawn(Arrays):
    """What a program drawn at random reads and writes."""

    x: Floats
    m: Matrix
    n: Integers
    out: Floats


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(programs(), st.integers(2, 5))
def test_values_of_programs_drawn_at_random_have_their_bits(source, count):
    function = function_of(source, helper=helper, sin=scalar_math.sin, exp=scalar_math.exp,
                           atan2=scalar_math.atan2)  # fmt: skip

    whole = function_of(
        "def f(numbers):\n    target(numbers.x, numbers.m, numbers.n, numbers.out)\n",
        target=function,
    )
    rng = np.random.default_rng(list(source.encode()))
    given_numbers = rng.uniform(-10.0, 10.0, 10), rng.integers(-50, 51, 3)
    program = Program()
    signature = program.export(whole, (Drawn.type_of(),), "drawn")
    text = program.module()
    plain, wide = numbers_drawn(*given_numbers), numbers_drawn(*given_numbers)
    made_of(text, "drawn", signature, ["O0"])["O0"](plain)
    lanes = DifferentiatedArrays(wide, count)
    for array in (wide.x, wide.m):
        lanes.slopes(array)[:] = rng.normal(size=lanes.slopes(array).shape)
    made_of(differentiate(text, count), "drawn", signature, ["O0"])["O0"](lanes)
    lanes.give()
    for name in ("x", "m", "out"):
        assert same_bits(getattr(plain, name), getattr(wide, name))


def helper(p, q):
    """What a program calls."""
    return p * q if p > q else p - q


def numbers_drawn(numbers, integers):
    x, m = numbers[:4].copy(), numbers[4:].reshape(2, 3).copy()
    return Drawn(x=x, m=m, n=integers.copy(), out=np.zeros(7))
