"""Operators of MATLAB, in MATLAB's order of precedence.

The grammar gives operands and operators; precedence is applied here, because the grammar reads
``-x^2`` as ``(-x)^2``, which in MATLAB is ``-(x^2)``. From the tightest:

    transpose ' .' and power ^ .^   from left to right
    signs + -
    * .* / ./                       from left to right
    + -                             from left to right
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_matlab.language.parse import text_of
from dap3d_matlab.language.values import LARGEST_MATRIX, Broken, Numbers, kind_of, size_of

if TYPE_CHECKING:
    from tree_sitter import Node

SUMS, PRODUCTS, POWERS = ("+", "-"), ("*", "/", ".*", "./"), ("^", ".^")
TRANSPOSES = ("'", ".'")
#: Nodes of the grammar that consist of operands and operators.
OPERATIONS = ("binary_operator", "unary_operator", "postfix_operator")
#: Nodes without a meaning.
EXTRAS = ("comment", "line_continuation")


class RefusalError(Exception):
    """A node outside the language, or wrong in it, with the fault and its remedy."""

    def __init__(self, node: "Node", what: str, remedy: str = "", nearest: str = "") -> None:
        super().__init__(what)
        self.node, self.what, self.remedy, self.nearest = node, what, remedy, nearest


class ReportedError(Exception):
    """A value is needed that is broken by a mistake already reported."""


@attrs.frozen
class _Token:
    """An operator, by its text, or an operand, with an empty text."""

    node: "Node"
    operator: str = ""


def tokens_of(node: "Node") -> list[_Token]:
    """Operands and operators of an operation, from left to right; brackets are one operand."""
    tokens: list[_Token] = []
    waiting = [node]
    while waiting:  # no recursion: a long sum is a deep tree
        part = waiting.pop()
        if part.type in OPERATIONS:
            waiting += [n for n in reversed(part.children) if n.type not in EXTRAS]
        elif part.is_named:
            tokens.append(_Token(part))
        else:
            tokens.append(_Token(part, text_of(part)))
    return tokens


class Operation:
    """The value of an operation.

    Args:
        node: the operation.
        value: returns the value of an operand.
    """

    def __init__(self, node: "Node", value: Callable[["Node"], Any]) -> None:
        self.tokens, self.index, self.value = tokens_of(node), 0, value
        self.node = node

    def result(self) -> Numbers:
        """The value of the whole."""
        with np.errstate(all="ignore"):  # values that are not finite are refused
            value = self._sum()
        if self.index < len(self.tokens):
            token = self.tokens[self.index]
            what = f"the operator {text_of(token.node)} is not read"
            raise RefusalError(self.node, what, f"known: {' '.join((*SUMS, *PRODUCTS, *POWERS))} '")
        return value

    def _next_is(self, operators: tuple[str, ...]) -> bool:
        return self.index < len(self.tokens) and self.tokens[self.index].operator in operators

    def _take(self) -> _Token:
        if self.index >= len(self.tokens):
            raise RefusalError(self.node, "an operand is missing")
        self.index += 1
        return self.tokens[self.index - 1]

    def _sum(self) -> Numbers:
        return self._from_left(SUMS, self._product, self._added)

    def _product(self) -> Numbers:
        return self._from_left(PRODUCTS, self._signed, self._multiplied)

    def _from_left(
        self,
        operators: tuple[str, ...],
        operand: Callable[[], Numbers],
        apply: Callable[[str, Numbers, Numbers], Numbers],
    ) -> Numbers:
        value = operand()
        while self._next_is(operators):
            value = apply(self._take().operator, value, operand())
        return value

    def _signed(self) -> Numbers:
        sign = self._sign()
        value = self._power()
        return -value if sign == "-" else value

    def _sign(self) -> str:
        """The sign of an operand; "" for none."""
        sign = ""
        while self._next_is(SUMS):
            sign = "-" if (self._take().operator == "-") != (sign == "-") else "+"
        return sign

    def _power(self) -> Numbers:
        value, sign = self._operand(), ""
        while self._next_is((*POWERS, *TRANSPOSES)):
            if sign:
                what = "what follows a power with a sign is read differently by different programs"
                raise RefusalError(self.node, what, "write it with brackets, such as 2^(-1)")
            operator = self._take().operator
            if operator in TRANSPOSES:
                value = value.T
                continue
            sign = self._sign()
            exponent = self._operand()
            value = self._raised(operator, value, -exponent if sign == "-" else exponent)
        return value

    def _operand(self) -> Numbers:
        token = self._take()
        if token.operator:
            raise RefusalError(self.node, f"the operator {token.operator} is not read here")
        return numbers(self.value(token.node), token.node)

    def _added(self, operator: str, a: Numbers, b: Numbers) -> Numbers:
        self._fits(operator, a, b)
        return self._checked(a + b if operator == "+" else a - b)

    def _multiplied(self, operator: str, a: Numbers, b: Numbers) -> Numbers:
        if operator in (".*", "./"):
            self._fits(operator, a, b)
        elif operator == "/" and b.size != 1:
            raise RefusalError(self.node, f"division by {kind_of(b)} is not read")
        elif operator == "*" and 1 not in (a.size, b.size):
            if a.shape[1] != b.shape[0]:
                what = f"matrices of {size_of(a)} and {size_of(b)} cannot be multiplied"
                raise RefusalError(self.node, what)
            check_size(a.size * b.shape[1], self.node)  # the number of products
            return self._checked(a @ b)
        return self._checked(a * b if "*" in operator else a / b)

    def _raised(self, operator: str, a: Numbers, b: Numbers) -> Numbers:
        if operator == "^" and (a.size, b.size) != (1, 1):
            raise RefusalError(self.node, "powers of matrices are not read", "write .^")
        self._fits(operator, a, b)
        return self._checked(np.asarray(a**b))

    def _fits(self, operator: str, a: Numbers, b: Numbers) -> None:
        if a.shape != b.shape and 1 not in (a.size, b.size):
            what = f"sizes {size_of(a)} and {size_of(b)} do not fit the operator {operator}"
            raise RefusalError(self.node, what)

    def _checked(self, value: Numbers) -> Numbers:
        return checked(value, self.node)


def checked(value: Numbers, node: "Node") -> Numbers:
    """A matrix of finite numbers and reasonable size.

    Raises:
        RefusalError: it is none.
    """
    check_size(value.size, node)
    if not np.isfinite(value).all():
        raise RefusalError(node, "the value is not a finite real number")
    return value


def check_size(count: int, node: "Node") -> None:
    """Check the size of an array.

    Raises:
        RefusalError: it would be too large.
    """
    if count > LARGEST_MATRIX:
        raise RefusalError(node, f"an array of {count} entries is no part of a model")


def numbers(value: Any, node: "Node") -> Numbers:
    """A value that is a number or a matrix.

    Raises:
        RefusalError: it is something else.
        ReportedError: it is broken by a mistake already reported.
    """
    if isinstance(value, Broken):
        raise ReportedError
    if not isinstance(value, np.ndarray):
        raise RefusalError(node, f"a number is needed here, not {kind_of(value)}")
    return value
