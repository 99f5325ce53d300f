"""The words that kernels are written with: vectors, matrices and scalar mathematics."""

import cmath
import inspect
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.internals import Loop, LoopArrays, build, call_loop, loop_list
from support.plain import jit_is_on

from dap3d_core import kernels
from dap3d_core.kernels import (
    abs,
    acos,
    add,
    asin,
    atan,
    atan2,
    conjugate,
    cos,
    cosh,
    cross,
    dot,
    euler_parameters,
    exp,
    eye,
    floor,
    hstack,
    hypot,
    log,
    matmul,
    maximum,
    minimum,
    mod,
    neg,
    norm2,
    normals,
    quaternion_product,
    rotate,
    rotation_matrix,
    rotation_vector,
    row,
    scale,
    sign,
    sin,
    sinh,
    skew,
    sqrt,
    sub,
    tan,
    tanh,
    transpose,
    where,
)

number = st.floats(-1e3, 1e3, allow_subnormal=False)
vec = st.tuples(number, number, number)
mat = st.tuples(vec, vec, vec)
many = settings(max_examples=50, deadline=None)


def near(found, wanted, size=1.0):
    """Equal but for rounding: sums of three products of numbers up to ``size``."""
    return np.allclose(np.array(found), np.array(wanted), rtol=1e-14, atol=1e-14 * size)


# ------------------------------------------------------------------ identities


@many
@given(vec, vec, number)
def test_sums_and_products_are_those_of_numpy(a, b, x):
    """Each component one operation: equal to the last bit, but for sums of products."""
    A, B = np.array(a), np.array(b)
    assert add(a, b) == tuple((A + B).tolist())
    assert sub(a, b) == tuple((A - B).tolist())
    assert neg(a) == tuple((-A).tolist())
    assert scale(x, a) == tuple((x * A).tolist())
    assert near(dot(a, b), A @ B, 3e6)
    assert near(norm2(a), A @ A, 3e6)
    assert near(cross(a, b), np.cross(A, B), 2e6)


@many
@given(vec, vec)
def test_skew_matrix_is_the_vector_product(a, b):
    """skew(a) b = a x b exactly (a zero is added, no more), and skew(-a) is its transpose."""
    assert rotate(skew(a), b) == cross(a, b)
    assert np.array_equal(np.array(skew(neg(a))), np.array(skew(a)).T)


@many
@given(mat, vec)
def test_rotate_is_a_matrix_times_a_vector(A, s):
    """rotate(A, s) = A s, sums of three products; the identity returns s itself."""
    assert near(rotate(A, s), np.array(A) @ np.array(s), 3e6)
    assert rotate(eye(1.0), s) == s


@many
@given(vec, vec, vec)
def test_triple_products(a, b, c):
    """a . (b x c) is invariant under rotation of its three; a x (b x c) = b (a.c) - c (a.b).
    Products of three numbers up to 1e3, six of them."""
    assert near(dot(a, cross(b, c)), dot(c, cross(a, b)), 6e9)
    assert near(cross(a, cross(b, c)), sub(scale(dot(a, c), b), scale(dot(a, b), c)), 6e9)


def test_blocks_of_a_jacobian():
    """row and hstack put the translational part first; eye is a multiple of the identity."""
    assert row((1, 2, 3), (4, 5, 6)) == (1, 2, 3, 4, 5, 6)
    P, Q = ((1, 2, 3), (4, 5, 6), (7, 8, 9)), ((-1, -2, -3), (-4, -5, -6), (-7, -8, -9))
    assert np.array_equal(hstack(P, Q), np.hstack([P, Q]))
    assert np.array_equal(eye(2.5), 2.5 * np.eye(3))


# ------------------------------------------------------------------ normals


AXES = [
    (1.0, 0.0, 0.0),
    (0.0, -2.0, 0.0),
    (0.0, 0.0, 1e-12),
    (1.0, 1.0, 1.0),
    (1.0, -1.0, 1e-9),
    (-3e5, 4e5, 5e5),
    *(tuple(a) for a in np.random.default_rng(0).normal(size=(10, 3)).tolist()),
]


@pytest.mark.parametrize("axis", AXES)
def test_normals_complete_an_axis_to_a_right_handed_triad(axis):
    """For the unit axis a: a x n = m, n x m = a, m x a = n, of unit length, to rounding."""
    n, m = normals(axis)
    a = np.array(axis) / np.linalg.norm(axis)
    assert near(np.cross(a, n), m, 4.0)
    assert near(np.cross(n, m), a, 4.0)
    assert near(np.cross(m, a), n, 4.0)
    assert near([n @ np.array(n), m @ np.array(m)], [1.0, 1.0], 4.0)


@pytest.mark.parametrize("axis", AXES)
def test_first_normal_is_the_coordinate_axis_least_aligned(axis):
    """n lies in the plane of the axis and the coordinate axis least aligned, on its side."""
    n, _ = normals(axis)
    k = int(np.argmin(np.abs(axis)))
    u = np.eye(3)[k]
    assert n[k] > 0.5  # at least sqrt(2/3) for the axis of equal components
    assert abs(np.linalg.det([n, u, np.array(axis) / np.linalg.norm(axis)])) < 1e-14


@pytest.mark.parametrize("axis", [(0.0, 0.0, 0.0), (math.nan, 1.0, 0.0)])
def test_an_axis_needs_a_length(axis):
    """No triad is made from nothing."""
    with pytest.raises(ValueError, match="needs a length"):
        normals(axis)


# ------------------------------------------------------------------ mathematics


ONE = [
    (sqrt, math.sqrt, lambda x: 0.5 / math.sqrt(x), [1e-3, 0.5, 2.0, 1e6]),
    (sin, math.sin, math.cos, [-3.0, -1e-8, 0.5, 2.0]),
    (cos, math.cos, lambda x: -math.sin(x), [-3.0, 1e-8, 0.5, 2.0]),
    (tanh, math.tanh, lambda x: 1.0 - math.tanh(x) ** 2, [-2.0, 0.0, 0.5, 5.0]),
    (tan, math.tan, lambda x: 1.0 + math.tan(x) ** 2, [-1.0, 0.0, 1.5]),
    (atan, math.atan, lambda x: 1.0 / (1.0 + x * x), [-30.0, 0.0, 0.5]),
    (sinh, math.sinh, math.cosh, [-2.0, 0.0, 5.0]),
    (cosh, math.cosh, math.sinh, [-2.0, 0.5, 5.0]),
]
one = pytest.mark.parametrize(
    ("function", "real", "slope", "x"),
    [(f, r, s, x) for f, r, s, values in ONE for x in values],
    ids=lambda v: getattr(v, "__name__", str(v)),
)
POINTS = [(0.3, 0.7), (0.3, -0.7), (-0.3, -0.7), (-0.3, 0.7), (1.0, 0.0), (-2.0, 0.0), (0.0, 2.0)]


@one
def test_functions_of_a_float_are_those_of_the_library(function, real, slope, x):
    """The same float, and one of numpy gives one of numpy, so that 1 / 0 is then no exception."""
    assert function(x) == real(x)
    found = function(np.float64(x))
    assert found == real(x)
    assert type(found) is np.float64


@one
def test_complex_step_is_the_derivative(function, real, slope, x):
    """Im f(x + ih) / h = f'(x) with h = 1e-30: no difference is taken, so rounding alone is left.
    tanh near one loses digits of 1 - tanh^2 in the expected value: 1e-11."""
    found = function(complex(x, 1e-30))
    assert found.real == pytest.approx(real(x), rel=1e-15)
    assert found.imag / 1e-30 == pytest.approx(slope(x), rel=1e-11)


@pytest.mark.parametrize(("y", "x"), POINTS)
def test_complex_step_of_atan2_is_its_derivative_in_all_quadrants(y, x):
    """d atan2 = (x dy - y dx) / (x^2 + y^2), the branch cut's both sides included; rounding."""
    h, square = 1e-30, x * x + y * y
    assert atan2(y, x) == math.atan2(y, x)
    along_y, along_x = atan2(complex(y, h), x), atan2(y, complex(x, h))
    assert along_y.real == along_x.real == math.atan2(y, x)
    assert along_y.imag / h == pytest.approx(x / square, rel=1e-15)
    assert along_x.imag / h == pytest.approx(-y / square, rel=1e-15)


@pytest.mark.parametrize(
    ("function", "x", "value"),
    [
        *((function, x, math.nan) for function, x in (
            (sqrt, -1.0), (sin, math.inf), (cos, -math.inf), (sqrt, math.nan), (log, -1.0),
            (acos, 2.0))),
        (exp, 1e4, math.inf), (log, 0.0, -math.inf), (floor, -math.inf, -math.inf),
    ],
)  # fmt: skip
@pytest.mark.parametrize("kind", [float, np.float64])
def test_outside_its_domain_a_function_is_nan_or_infinite(function, x, value, kind):
    """No exception, as in compiled code: the run finds it and names its source."""
    np.testing.assert_equal(function(kind(x)), value)


def test_atan2_of_nothing_has_a_value_and_no_slope():
    """At the origin the angle is that of the library, zero, and its derivative is NaN."""
    assert atan2(0.0, 0.0) == 0.0
    stepped = atan2(complex(0.0, 1e-30), complex(0.0, 0.0))
    assert stepped.real == 0.0
    assert math.isnan(stepped.imag)


def test_where_takes_one_of_two():
    """Numbers, complex numbers and vectors; the condition may be numpy's."""
    assert where(True, 1.0, 2.0) == 1.0
    assert where(np.float64(1.0) > 2.0, 1.0, 2.0) == 2.0
    assert where(False, 1.0, 2j) == 2j
    assert where(True, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0)) == (1.0, 2.0, 3.0)


def test_complex_functions_are_those_of_the_library():
    """Off the real axis, too; the last bit is the library's."""
    z = complex(0.3, -0.7)
    for function, other in [(sqrt, cmath.sqrt), (sin, cmath.sin), (cos, cmath.cos)]:
        assert function(z) == other(z)
    assert tanh(z) == cmath.tanh(z)


# ------------------------------------------------------------------ sympy


def test_symbols_pass_through_all_words():
    """Every word takes sympy symbols; with numbers put in, the result is that of floats (1e-14)."""
    sympy = pytest.importorskip("sympy")
    symbols = sympy.symbols("a0:3 b0:3", real=True)
    values = (0.3, -1.2, 0.8, 1.1, 0.4, -0.6)
    expressions, wanted = formula(*symbols), formula(*values)
    found = [
        float(sympy.sympify(e).subs(dict(zip(symbols, values, strict=True)))) for e in expressions
    ]
    assert found == pytest.approx(wanted, rel=1e-14, abs=1e-14)


# ------------------------------------------------------------------ compiled code


def formula(a0, a1, a2, b0, b1, b2):
    """Every word of the kernels, in one tuple of numbers."""
    a, b = (a0, a1, a2), (b0, b1, b2)
    A = skew(a)
    H = hstack(eye(b0), A)
    r = row(add(a, b), sub(a, b))
    return (
        *scale(dot(a, b), cross(a, neg(b))),
        *rotate(A, b),
        *H[0],
        *H[1],
        *H[2],
        *r,
        sqrt(norm2(a)),
        sin(a0) + cos(a1),
        tanh(b0 * b1),
        atan2(b0, b1),
        where(a0 > b0, a1, b1),
        where(a0 < b0, a2, b2),
        minimum(a0, b0) + maximum(a1, b1),
        hypot(a0, b0) + abs(a1 - b1),
        exp(0.3 * a0) * log(1.0 + b0 * b0),
        asin(tanh(a0)) + acos(tanh(b0)),
        floor(3.0 * a0),
        tan(a0) + atan(b0),
        sinh(0.3 * a1) + cosh(0.3 * b1),
        sign(a0) + mod(b0, 0.3),
    )


def turns(a0, a1, a2, b0, b1, b2):
    """The words of rotations; apart, as symbols make branches of branches of them."""
    a, b = (a0, a1, a2), (b0, b1, b2)
    return (
        *rotation_vector(quaternion_product(conjugate((0.8, *scale(0.1, a))), (0.6, *b))),
        *rotation_vector(matmul(transpose(rotation_matrix(a)), rotation_matrix(b))),
        *euler_parameters(rotation_matrix(scale(2.0, b))),
    )


def test_the_formulas_use_every_word():
    """What the tests above and below run over is complete: all public words, but for ``normals``,
    for ``lookup`` and ``item``, which read tables (interface/codegen/test_specialise.py), for
    ``by_body`` (interface/examine/test_sized_types.py), ``root`` (verification/
    test_curved_contacts.py) and those of cables (verification/test_tendons.py)."""
    used = set(formula.__code__.co_names) | set(turns.__code__.co_names)
    others = {"normals", "lookup", "item", "by_body", "root", "wrapped"}
    words = {word for word in kernels.__all__ if not word.startswith("cable_")}
    assert used == words - others
    assert all(inspect.getdoc(getattr(kernels, word)) for word in kernels.__all__)


@pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled with DAP3D_PLAIN=1")
@pytest.mark.parametrize("formula", [formula, turns])
def test_compiled_words_are_the_plain_ones(formula):
    """In all bits; NaN is NaN."""
    count = len(formula(*(6 * [0.5])))
    lines = ["out = kernel_formula(par[0], par[1], par[2], par[3], par[4], par[5])"]
    lines += [f"out1[{k}] = out[{k}]" for k in range(count)]
    loops = loop_list([build(Loop("words", {"kernel_formula": formula}, lines))])
    found, wanted = np.zeros(count), np.zeros(count)
    edges = [(-1.0, math.inf, 0.0, 0.0, 0.0, 0.0), (math.nan, 1.0, 2.0, 3.0, 4.0, 5.0)]
    for values in [*np.random.default_rng(1).normal(size=(50, 6)), *map(np.array, edges)]:
        arrays = LoopArrays(body=np.zeros((1, 32)), F=np.zeros((1, 5)), par=values,
                            idx=np.zeros(1, dtype=np.int64))  # fmt: skip
        call_loop(loops, 0, 0.0, arrays, (0, 0, 1), found, found, found)
        with np.errstate(all="ignore"):
            wanted[:] = formula(*values)
        np.testing.assert_array_equal(found, wanted)
