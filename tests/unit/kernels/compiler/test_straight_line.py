"""Straight-line programs: what is folded, what is guarded, bits that are those of Python."""

import ctypes
import math

import numpy as np
import pytest
from support.internals import Item, StraightLine, Symbol, TraceError, objects

from dap3d_core.kernels import atan2, cos, exp, sqrt, tanh, where

START = [0.3, -1.7, 2.5, 0.0]


def traced(function, start=START, most=1000):
    """Tracer and results of a function of numbers that are loaded from an array."""
    tracer = StraightLine(most)
    items = [Item(tracer, (lambda: "%x", k), x) for k, x in enumerate(start)]
    return tracer, function(*items)


def compiled(function, start=START):
    """A function of an array by its program: its results, and whether all guards hold."""
    tracer, results = traced(function, start)
    guard = tracer.guard()
    for k, x in enumerate(results):
        tracer.store("%out", k, x)
    text = "\n".join([*tracer.needs.values(), "define i1 @f(ptr %x, ptr %out) {", "entry:",
                      tracer.taken_lines(), f"  ret i1 {guard}", "}"])  # fmt: skip
    [address] = objects.load(objects.compile_ir(text, 3), ["f"])
    call = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_void_p)(address)

    def run(*numbers):
        x, out = np.array(numbers), np.zeros(len(results))
        return call(x.ctypes.data, out.ctypes.data), out

    return run


def mixed(a, b, c, d):
    """Each kind of operation."""
    e = (a + b) * c - d / (1.0 + a * a)
    f = sqrt(abs(e)) + cos(e) * exp(-abs(c)) + atan2(a, b) + tanh(e)
    g = where((e > f) | (b < 0.25), e, -f)
    return e, f, g, g**2, np.sqrt(a * a), np.rint(4.0 * b), 2.0**a


def test_bits_are_those_of_python():
    """Whatever the numbers, also those that are not where the program was written."""
    run, rng = compiled(mixed), np.random.default_rng(1)
    for numbers in rng.normal(scale=2.0, size=(50, 4)).tolist():
        holds, out = run(*numbers)
        assert holds  # there is no branch
        assert out.tolist() == [float(x) for x in mixed(*map(np.float64, numbers))]


def test_zeros_and_ones_fold_and_equal_expressions_are_one():
    """What a scene does not need is not computed."""
    tracer, (x, y) = traced(lambda a, b, c, d: (0.0 * a + 1.0 * b + 0.0 / c, (b + c) * (b + c)))
    lines = tracer.taken_lines()
    assert lines.count("fadd") == 1
    assert lines.count("fmul") == 1
    assert "fdiv" not in lines
    assert isinstance(x, Symbol)
    assert isinstance(y, Symbol)
    assert traced(lambda a, b, c, d: (a * 0.0, 3.0 - 3.0))[1] == (0.0, 0.0)


def test_truths_that_are_known_fold():
    """What a mode rules out leaves nothing of a condition."""
    given = lambda a, b, c, d: (  # noqa: E731
        where((a > 2.0 * a) & (a != a) & False, b, 1.0),
        where((a < b) | True, 2.0, c),
        where((a < b) & True, a, b),
        where(False | (a < b), a, b),
    )
    tracer, (never, always, one, other) = traced(given)
    assert (never, always) == (1.0, 2.0)
    assert one.value == other.value
    assert tracer.taken_lines().count("select") == 1


def signed_products(a, b, c, d):
    """Two products in words, one in numbers."""
    return a * b - (-b) * a, (-a) * b + c, 0.0 - (0.0 - a), a - a


def signed(a, b, c, d):
    """Expressions that differ in signs and order alone."""
    return (
        *signed_products(a, b, c, d), -c - a * b, c / -b, -0.5 * c + d, 0.5 * c - d,
        abs(-a) + max(-b, 0.25),
    )  # fmt: skip


def test_signs_and_order_make_no_further_operations():
    """Products are computed once, and signs go into sums and differences."""
    tracer, results = traced(
        lambda a, b, c, d: (a * b - (-b) * a, (-a) * b + c, 0.0 - (0.0 - a), a - a)
    )
    for k, x in enumerate(results):
        tracer.store("%out", k, x)
    lines = tracer.taken_lines()
    assert [lines.count(word) for word in ("fmul", "fadd", "fsub", "fneg")] == [1, 1, 1, 0]
    assert results[3] == 0.0


def test_signed_numbers_have_the_bits_of_python():
    """But for the sign of a zero."""
    run, rng = compiled(signed), np.random.default_rng(2)
    for numbers in [[0.0, 1.0, -0.0, 0.0], *rng.normal(size=(50, 4)).tolist()]:
        holds, out = run(*numbers)
        if holds:
            assert out.tolist() == [float(x) for x in signed(*map(np.float64, numbers))]


def test_integers_are_numbers():
    """As of ``sum``, which begins with the integer 0."""
    run = compiled(lambda a, b, c, d: (sum([a, b]), 2 * a, 1 - b, 3 / a))
    holds, out = run(0.3, -2.0, 0.0, 0.0)
    assert holds
    assert out.tolist() == [0.3 - 2.0, 0.6, 3.0, 3 / 0.3]


def test_a_branch_becomes_a_guard():
    """The way of the start is taken; elsewhere the guard says that it is the wrong one."""
    run = compiled(lambda a, b, c, d: (a + b,) if a > 0.0 and not b > 0.0 else (a - b,))
    assert run(1.0, -2.0, 0.0, 0.0) == (True, -1.0)
    for numbers in ((-1.0, -2.0), (1.0, 2.0), (math.nan, -1.0), (1.0, math.nan)):
        assert run(*numbers, 0.0, 0.0)[0] is (not (numbers[1] > 0.0) and numbers[0] > 0.0)


def test_too_long_a_program_is_refused():
    """Where the instructions are too many."""
    with pytest.raises(TraceError, match="more than 5 instructions"):
        traced(mixed, most=5)
