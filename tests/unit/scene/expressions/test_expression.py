"""Expressions: their values are those of the same arithmetic; nothing but arithmetic is read."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.internals import DEEPEST, LONGEST, WORDS, ExpressionError, parse_expression

from dap3d_core import kernels

T = np.linspace(0.1, 0.9, 5)
A, B = np.arange(15.0).reshape(5, 3), np.ones((5, 3))
VALUES = {"t": T, "a.r": A, "b.r": B, "J1.lambda.1": 2.0 * T, "a.p": np.ones((5, 4))}


CASES = [
    ("2*t + 1", 2 * T + 1),
    ("-t ** 2", -(T**2)),
    ("2 ** -t", 2**-T),
    ("t - 0.2 - 0.1", T - 0.2 - 0.1),
    ("(t + 1) % 0.7", (T + 1) % 0.7),
    ("'J1.lambda.1' / 4", T / 2),
    ("where(0.2 < t <= 0.5, 1, -1)", np.where((T > 0.2) & (T <= 0.5), 1.0, -1.0)),
    ("not t > 0.5 or t == 0.9", (~(T > 0.5) | (T == 0.9)).astype(float)),
    ("(t > 0.2) + (t > 0.5)", (T > 0.2).astype(float) + (T > 0.5)),
    ("t * a.r - b.r", T[:, None] * A - B),
    ("dot(a.r, b.r)", A.sum(axis=1)),
    ("norm(a.r - b.r)", np.linalg.norm(A - B, axis=1)),
    ("cross(a.r, b.r)", np.cross(A, B)),
    ("atan2(t, 2) + asin(t) + acos(t)", np.arctan2(T, 2) + np.arcsin(T) + np.arccos(T)),
    ("hypot(t, minimum(t, 0.5)) - maximum(t, 0.3)",
     np.hypot(T, np.minimum(T, 0.5)) - np.maximum(T, 0.3)),
    ("floor(10*t) + abs(-t) + tanh(t)", np.floor(10 * T) + T + np.tanh(T)),
    ("sin(t)*cos(t)*tan(t)*exp(t)*log(t)*sqrt(t)",
     np.sin(T) * np.cos(T) * np.tan(T) * np.exp(T) * np.log(T) * np.sqrt(T)),
    ("sinh(t) + cosh(t) + atan(t)", np.sinh(T) + np.cosh(T) + np.arctan(T)),
    ("sign(t - 0.5) + mod(-t, 0.7)", np.sign(T - 0.5) + np.mod(-T, 0.7)),
    ("2\n * t  # twice", 2 * T),
    ("pi", np.pi),
]  # fmt: skip


@pytest.mark.parametrize(("text", "expected"), CASES)
def test_values(text, expected):
    """The same numbers, to rounding, as numpy gives for the same operations."""
    found = parse_expression(text).evaluate(VALUES)
    assert found.shape == np.shape(expected)
    np.testing.assert_allclose(found, expected, rtol=4e-16, atol=1e-300)


def test_every_word_is_evaluated_above():
    texts = " ".join(text for text, _ in CASES)
    assert [word for word in WORDS if f"{word}(" not in texts] == []


def test_names_are_listed_once_in_their_order():
    assert parse_expression("b.r.x + t*a.r.z - b.r.x + 'x y.r.z'").names == (
        "b.r.x", "t", "a.r.z", "x y.r.z",
    )  # fmt: skip


def test_what_has_no_finite_value_is_nan():
    for text in ("1 / (t - t)", "sqrt(-t)", "log(t - t)", "exp(1e9 * t)"):
        assert np.isnan(parse_expression(text).evaluate(VALUES)).all()


def test_a_comparison_with_nan_is_nan_and_a_branch_that_is_not_taken_is_not():
    values = {"t": np.array([np.nan, 1.0])}
    np.testing.assert_array_equal(
        parse_expression("where(t > 0, 1, 2)").evaluate(values), [np.nan, 1.0]
    )
    np.testing.assert_array_equal(parse_expression("where(t, t, t/0)").evaluate(values)[1], 1.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (" ", "is empty"),
        ("t + ", "is no expression"),
        ("J1.lambda.1", "stands in quotes"),
        ("__import__('os').system('true')", "there is no function"),
        ("().__class__.__bases__", "a dot joins parts of a name"),
        ("sin(t).real", "a dot joins parts of a name"),
        ("t.__class__()", "there is no function"),
        ("(lambda: 1)()", "calls something without a name"),
        ("lambda: 1", "Python syntax Lambda"),
        ("[t for t in t]", "Python syntax ListComp"),
        ("f'{t}'", "Python syntax JoinedStr"),
        ("t[0]", "named by a dot"),
        ("t if t else t", "where(condition, value, otherwise)"),
        ("t ^ 2", "has the operator ^, no arithmetic; a power is written **"),
        ("t, t", "without commas"),
        ("(x := t)", "Python syntax NamedExpr"),
        ("t; t", "is no expression"),
        ("True", "Python syntax Constant"),
        ("1j", "Python syntax Constant"),
        ("t in t", "compares by another operator"),
        ("sine(t)", "did you mean 'sin'"),
        ("sin", "sin is a function"),
        ("sin(t, t)", "takes 1 argument"),
        ("atan2(t)", "takes 2 arguments"),
        ("sin(x=t)", "without keywords"),
        ("sin(*t)", "Python syntax Starred"),
        ("9 ** 9 ** 9", "is not a finite number"),
        ("t * 1e999", "too large"),
        ("9" * 400, "too large"),
        ("1 / 0", "'/' of 1 and 0 is not a finite number"),
        ("'a'.r", "a part in quotes"),
        ("'' + t", "an empty name"),
        ("t \\ t", "backslash"),
        ("t\0", "is no expression"),
        ("\ud800", "is no expression"),
        ("norm(1)", "takes vectors"),
        ("t" * (LONGEST + 1), "is too long"),
        ("(" * 900 + "t" + ")" * 900, "is no expression"),
        ("-" * 1900 + "t", "nested too deeply"),
        ("+".join("t" * (DEEPEST + 2)), "nested too deeply"),
        ("<".join("t" * (DEEPEST + 2)), "nested too deeply"),
    ],
)  # fmt: skip
def test_what_is_refused(text, words):
    with pytest.raises(ExpressionError) as refused:
        parse_expression(text)
    what, remedy, near = refused.value.fault
    assert words in f"{what}; {remedy}; did you mean {near!r}"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("norm(t)", "norm takes vectors"),
        ("dot(a.r, t)", "dot takes vectors"),
        ("cross(a.p, a.p)", "three components"),
        ("a.r + a.p", "vectors of 3 and 4 components"),
    ],
)
def test_vectors_that_do_not_match(text, words):
    with pytest.raises(ExpressionError, match=words):
        parse_expression(text).evaluate(VALUES)


@given(st.lists(st.sampled_from(
    ["t", "a.r", "1", "2.5", "(", ")", "+", "-", "*", "/", "**", ",", ".", "'", "sin", "where",
     "norm", "<", " and ", " if ", " else ", "[", "]", "lambda", "not ", "1e400", "\n", "#", "é"]
), max_size=30).map("".join))  # fmt: skip
def test_any_text_is_refused_in_words_or_evaluated(text):
    """No other exception, and no other value than finite numbers and NaN."""
    found, words = np.zeros(1), "evaluated"
    try:
        expression = parse_expression(text)
        found = expression.evaluate({name: VALUES.get(name, T) for name in expression.names})
    except ExpressionError as error:
        words = str(error)
    assert words
    assert "\n" not in words
    assert not np.isinf(found).any()


def test_expressions_have_all_words_of_kernels_for_numbers():
    scalar = [name for name in kernels.__all__
              if getattr(kernels, name).__module__.endswith("scalar_math")]  # fmt: skip
    assert set(scalar) <= set(WORDS)
    assert len(scalar) > 10
