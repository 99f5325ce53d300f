"""Branches of kernels in symbolic form: numbers that record ``where`` and never simplify it.

A branch often guards a formula at a point where it has no value: sin(x)/x at zero. An expression of
sympy that is piecewise does not keep such a guard, because sympy moves operations into the pieces.
``Branch`` keeps it: both sides are evaluated, as in a kernel, and its derivative is the branch of
the derivatives.
"""

import operator
from collections.abc import Callable
from typing import Any

import sympy
from sympy.core.relational import Relational
from sympy.logic.boolalg import BooleanAtom, BooleanFunction

Expression = Any


class Branch(sympy.Function):  # type: ignore[misc]
    """``where(condition, a, b)`` of real numbers."""

    nargs = 3
    is_real = True
    is_commutative = True

    @classmethod
    def eval(cls, condition: Any, a: Any, b: Any) -> Any:
        """One of the two sides, where that is known."""
        if a == b or condition == True:  # noqa: E712  (of sympy)
            return a
        return b if condition == False else None  # noqa: E712

    def _eval_derivative(self, symbol: Any) -> Any:
        condition, a, b = self.args
        return Branch(condition, sympy.diff(a, symbol), sympy.diff(b, symbol))


class _Functions:
    """The functions of kernels for symbolic numbers."""

    def __getattr__(self, name: str) -> Callable[..., "SymbolicNumber"]:
        """A function of numbers: sqrt, sin, ..."""
        function = getattr(sympy, name)
        return lambda *numbers: SymbolicNumber(function(*map(expression_of, numbers)))

    def where(self, condition: "SymbolicNumber", a: Any, b: Any) -> Any:
        """``a`` where the condition holds, else ``b``."""
        test, x, y = map(expression_of, (condition, a, b))
        if is_condition(x) or is_condition(y):
            return SymbolicNumber((test & x) | (~test & y))
        return SymbolicNumber(Branch(test, x, y))


def _binary(function: Callable[[Any, Any], Any]) -> tuple[Any, Any]:
    def operate(self: "SymbolicNumber", other: Any) -> "SymbolicNumber":
        return SymbolicNumber(function(self.expression, expression_of(other)))

    def reflected(self: "SymbolicNumber", other: Any) -> "SymbolicNumber":
        return SymbolicNumber(function(expression_of(other), self.expression))

    return operate, reflected


class SymbolicNumber:
    """A number or condition of a kernel, as an expression of sympy.

    Comparisons are conditions, ``==`` too, which of expressions of sympy is an answer.
    """

    __slots__ = ("expression",)
    __hash__ = None  # type: ignore[assignment]
    tracer = _Functions()

    def __init__(self, expression: Expression) -> None:
        self.expression = expression

    __add__, __radd__ = _binary(operator.add)
    __sub__, __rsub__ = _binary(operator.sub)
    __mul__, __rmul__ = _binary(operator.mul)
    __truediv__, __rtruediv__ = _binary(operator.truediv)
    __pow__, __rpow__ = _binary(operator.pow)
    __and__, __rand__ = _binary(operator.and_)
    __or__, __ror__ = _binary(operator.or_)
    __xor__, __rxor__ = _binary(operator.xor)
    __lt__, __le__ = _binary(sympy.Lt)[0], _binary(sympy.Le)[0]
    __gt__, __ge__ = _binary(sympy.Gt)[0], _binary(sympy.Ge)[0]
    __eq__, __ne__ = _binary(sympy.Eq)[0], _binary(sympy.Ne)[0]

    def __neg__(self) -> "SymbolicNumber":
        return SymbolicNumber(-self.expression)

    def __pos__(self) -> "SymbolicNumber":
        return self

    def __invert__(self) -> "SymbolicNumber":
        return SymbolicNumber(~self.expression)

    def __abs__(self) -> "SymbolicNumber":
        return SymbolicNumber(sympy.Abs(self.expression))

    def __mod__(self, other: Any) -> None:
        raise TypeError("the remainder a % b is written as a - b * floor(a / b)")

    __rmod__ = __mod__

    def __bool__(self) -> bool:
        raise TypeError("branches on a number; use where(condition, a, b)")

    @property
    def real(self) -> "SymbolicNumber":
        """The number itself: conditions of complex numbers compare real parts."""
        return self


def is_condition(x: Expression) -> bool:
    """True for a truth value; symbols of sympy are numbers here."""
    return isinstance(x, (Relational, BooleanFunction, BooleanAtom))


def expression_of(x: Any) -> Expression:
    """The expression of a number of a kernel."""
    return x.expression if isinstance(x, SymbolicNumber) else sympy.sympify(x)


def as_argument(value: Any) -> Any:
    """Symbols in nested tuples, or a function of them, as an argument of a kernel."""
    if isinstance(value, tuple):
        return tuple(map(as_argument, value))
    if isinstance(value, type):
        return lambda *x: SymbolicNumber(value(*map(expression_of, x)))
    return SymbolicNumber(value)
