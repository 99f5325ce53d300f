"""Expressions of scenes at random: arithmetic, and what is none."""

import numpy as np
from hypothesis import strategies as st
from support.internals import WORDS, ExpressionError, parse_expression

from fuzz.acceptable import strict

HANG = 10
PIECES = ("t", "a.r", "a.r.z", "'J1.lambda.1'", "pi", "1", "2.5", "1e308", "0", "9**9", "(", ")",
          "+", "-", "*", "/", "%", "**", ",", ".", "'", '"', "<", "<=", "==", " and ", " or ",
          " not ", " if ", " else ", "[", "]", "{", "}", "lambda:", ":=", "\\", "\0", "\n", "#",
          "__class__", "é", "\ud800", *WORDS)  # fmt: skip
T = np.linspace(-1.0, 1.0, 4)


def expressions():
    """Texts of expressions, as bytes."""
    words = st.lists(st.sampled_from(PIECES), max_size=40).map("".join)
    nested = st.integers(0, 2500).map(lambda count: "(" * count + "t" + ")" * count)
    long = st.integers(0, 2500).map(lambda count: "-" * count + "t")
    texts = st.one_of(words, st.text(max_size=30), nested, long)
    return texts.map(lambda text: text.encode("utf-8", "surrogatepass"))


def check_expression(data: bytes) -> str:
    """A text is evaluated to finite numbers and NaN, or refused in a line of words."""
    text = data.decode("utf-8", "surrogatepass")
    with strict(HANG):
        try:
            expression = parse_expression(text)
            values = {
                n: np.stack([T, T, T], 1) if n.endswith(".r") else T for n in expression.names
            }
            found = expression.evaluate(values)
        except ExpressionError as error:
            words = str(error)
            assert words
            assert "\n" not in words
            return "refused"
        assert not np.isinf(found).any()
        assert found.shape in ((), (4,), (4, 3))
    return "evaluated"
