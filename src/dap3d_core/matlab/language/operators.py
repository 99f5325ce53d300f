"""Operators of MATLAB, in MATLAB's order of precedence.

The grammar gives operands and operators; which operator binds first is decided here, because the
grammar reads ``-x^2`` as ``(-x)^2``, which in MATLAB is ``-(x^2)``. From the tightest:

    transpose ' .' and power ^ .^   from left to right
    signs + -
    * .* / ./                       from left to right
    + -                             from left to right
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.matlab.language.parse import text_of
from dap3d_core.matlab.language.values import LARGEST_MATRIX, Broken, Numbers, kind_of, size_of

if TYPE_CHECKING:
    from tree_sitter import Node

SUMS, PRODUCTS, POWERS = ("+", "-"), ("*", "/", ".*", "./"), ("^", ".^")
TRANSPOSES = ("'", ".'")
#: Nodes of the grammar whose parts are operands and operators.
OPERATIONS = ("binary_operator", "unary_operator", "postfix_operator")
#: Parts of a tree that mean nothing.
EXTRAS = ("comment", "line_continuation")


class RefusalError(Exception):
    """Something outside the language, or wrong in it: where, what, and what to do."""

    def __init__(self, node: "Node", what: str, remedy: str = "", nearest: str = "") -> None:
        super().__init__(what)
        self.node, self.what, self.remedy, self.nearest = node, what, remedy, nearest


class ReportedError(Exception):
    """A value is needed that could not be found, which was reported already."""


@attrs.frozen
class _Token:
    """An operator, by its text, or an operand, whose text is empty."""

    node: "Node"
    operator: str = ""


def tokens_of(node: "Node") -> list[_Token]:
    """Operands and operators of an operation, from left to right. A pair of brackets is one."""
    found: list[_Token] = []
    waiting = [node]
    while waiting:  # no recursion: a long sum is a deep tree
        part = waiting.pop()
        if part.type in OPERATIONS:
            waiting += [n for n in reversed(part.children) if n.type not in EXTRAS]
        elif part.is_named:
            found.append(_Token(part))
        else:
            found.append(_Token(part, text_of(part)))
    return found


class Operation:
    """The value of an operation.

    Args:
        node: the operation.
        value: finds the value of an operand.
    """

    def __init__(self, node: "Node", value: Callable[["Node"], Any]) -> None:
        self.tokens, self.place, self.value = tokens_of(node), 0, value
        self.node = node

    def result(self) -> Numbers:
        """The value of the whole."""
        with np.errstate(all="ignore"):  # what is not finite is refused
            found = self._sum()
        if self.place < len(self.tokens):
            token = self.tokens[self.place]
            what = f"the operator {text_of(token.node)} is not read"
            raise RefusalError(self.node, what, f"known: {' '.join((*SUMS, *PRODUCTS, *POWERS))} '")
        return found

    def _next_is(self, operators: tuple[str, ...]) -> bool:
        here = self.place < len(self.tokens)
        return here and self.tokens[self.place].operator in operators

    def _take(self) -> _Token:
        if self.place >= len(self.tokens):
            raise RefusalError(self.node, "an operand is missing")
        self.place += 1
        return self.tokens[self.place - 1]

    def _sum(self) -> Numbers:
        found = self._product()
        while self._next_is(SUMS):
            operator = self._take().operator
            other = self._product()
            self._fits(operator, found, other)
            found = self._checked(found + other if operator == "+" else found - other)
        return found

    def _product(self) -> Numbers:
        found = self._signed()
        while self._next_is(PRODUCTS):
            operator = self._take().operator
            found = self._multiplied(operator, found, self._signed())
        return found

    def _signed(self) -> Numbers:
        negative = False
        while self._next_is(SUMS):
            negative ^= self._take().operator == "-"
        found = self._power()
        return -found if negative else found

    def _power(self) -> Numbers:
        found = self._operand()
        signed = False
        while self._next_is((*POWERS, *TRANSPOSES)):
            if signed:
                what = "what follows a power with a sign is read differently by different programs"
                raise RefusalError(self.node, what, "write it with brackets, such as 2^(-1)")
            operator = self._take().operator
            if operator in TRANSPOSES:
                found = found.T
                continue
            negative = False
            while self._next_is(SUMS):
                negative ^= self._take().operator == "-"
                signed = True
            exponent = self._operand()
            found = self._raised(operator, found, -exponent if negative else exponent)
        return found

    def _operand(self) -> Numbers:
        token = self._take()
        if token.operator:
            raise RefusalError(self.node, f"the operator {token.operator} is not read here")
        return numbers(self.value(token.node), token.node)

    def _multiplied(self, operator: str, a: Numbers, b: Numbers) -> Numbers:
        if operator in (".*", "./"):
            self._fits(operator, a, b)
        elif operator == "/" and b.size != 1:
            raise RefusalError(self.node, f"division by {kind_of(b)} is not read")
        elif operator == "*" and 1 not in (a.size, b.size):
            if a.shape[1] != b.shape[0]:
                what = f"matrices of {size_of(a)} and {size_of(b)} cannot be multiplied"
                raise RefusalError(self.node, what)
            check_size(a.size * b.shape[1], self.node)  # what is multiplied
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

    def _checked(self, found: Numbers) -> Numbers:
        return checked(found, self.node)


def checked(found: Numbers, node: "Node") -> Numbers:
    """A matrix of finite numbers and reasonable size.

    Raises:
        RefusalError: it is none.
    """
    check_size(found.size, node)
    if not np.isfinite(found).all():
        raise RefusalError(node, "the value is not a finite real number")
    return found


def check_size(count: int, node: "Node") -> None:
    """Whether an array of so many entries may be made.

    Raises:
        RefusalError: it would be too large.
    """
    if count > LARGEST_MATRIX:
        raise RefusalError(node, f"an array of {count} entries is no part of a model")


def numbers(value: Any, node: "Node") -> Numbers:
    """A value that is a number or a matrix.

    Raises:
        RefusalError: it is something else.
        ReportedError: it could not be found, which was reported already.
    """
    if isinstance(value, Broken):
        raise ReportedError
    if not isinstance(value, np.ndarray):
        raise RefusalError(node, f"a number is needed here, not {kind_of(value)}")
    return value
