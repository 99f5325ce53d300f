"""Straight-line programs: functions of the core run once with symbols, for one scene.

Integers, topology and most numbers of the scene are constants of the program: loops unroll, zeros
and ones fold, equal expressions are computed once, and what is written into arrays on the way stays
in registers. A number that is read before it was written is loaded. A branch on a number takes the
way of the state at which the program is written, and becomes a guard: where one fails, the program
has stored nothing, and calls the function that it stands for. Results have the bits of that.
"""

import ast
import math
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.trace import Symbol, TraceError, Tracer
from dap3d_core.kernels.compiler.writer import COMPARISONS, OPERATORS

_ZERO = (0.0, -0.0)
_NEGATIVE = re.compile(r"-(%\w+)")


class StraightLine(Tracer):
    """Records a program; knows the number of each symbol at the state where it is written.

    Attributes:
        guards: conditions, by their names, and whether each one holds.
    """

    def __init__(self, most: int) -> None:
        """Args:
        most: instructions at most.
        """
        super().__init__()
        self.guards: dict[str, bool] = {}
        self._most = most
        self._known: dict[str, str] = {}
        self._numbers: dict[str, Any] = {}

    def new(self, text: str) -> str:
        """As of ``Writer``; the same instruction once."""
        text = self._with_negatives(text)
        name = self._known.get(text)
        if name is None:
            if len(self._known) > self._most:
                raise TraceError(f"takes more than {self._most} instructions")
            name = self._known[text] = super().new(text)
        return name

    def line(self, text: str) -> None:
        """As of ``Writer``."""
        super().line(self._with_negatives(text))

    def _with_negatives(self, text: str) -> str:
        """An instruction with the names of negatives, which are computed where they are used."""
        if "-%" not in text:
            return text
        return _NEGATIVE.sub(lambda found: self.new(f"fneg double {found[1]}"), text)

    def guard(self) -> str:
        """The condition that all guards are as they were."""
        word = "true"
        for name, truth in self.guards.items():
            as_before = name if truth else self.new(f"xor i1 {name}, true")
            word = as_before if word == "true" else self.new(f"and i1 {word}, {as_before}")
        return word

    def taken_lines(self) -> str:
        """The instructions so far, which are left out of those to come."""
        lines, self.lines = "\n".join(self.lines), []
        return lines

    def store(self, base: str, k: int, x: Any) -> None:
        """Store a number at an index of an array."""
        word, at = self.word(x), self.new(f"getelementptr inbounds double, ptr {base}, i64 {k}")
        self.line(f"store double {word}, ptr {at}, align 8")

    def store_together(self, base: str, k: int, numbers: Sequence[Any]) -> None:
        """Store numbers from an index of an array on, as one vector.

        What loads that vector soon after would wait for numbers that were stored one by one. LLVM
        parts such a store again unless it is volatile.
        """
        vector, word = f"<{len(numbers)} x double>", "poison"
        for i, x in enumerate(numbers):
            word = self.new(f"insertelement {vector} {word}, double {self.word(x)}, i64 {i}")
        at = self.new(f"getelementptr inbounds double, ptr {base}, i64 {k}")
        self.line(f"store volatile {vector} {word}, ptr {at}, align 8")

    def number(self, value: t.Value) -> Any:
        """The number of a value at the state where the program is written."""
        return self._numbers[value.word] if value.constant is None else value.constant

    def at(self, value: t.Value, number: Any) -> t.Value:
        """A value, with its number noted."""
        self._numbers[value.word] = number
        return value

    def symbol(self, value: t.Value) -> Any:
        """A constant as itself."""
        return Symbol(self, value) if value.constant is None else value.constant

    def decide(self, condition: t.Value) -> bool:
        """The truth of a condition, which becomes a guard."""
        truth = bool(self.number(condition))
        self.guards[self.cast(None, condition, t.BOOL).word] = truth
        return truth

    def operation(self, node: Any, op: ast.operator, a: t.Value, b: t.Value) -> t.Value:
        """As of ``Writer``, but for zeros, ones and signs; a + b is b + a."""
        kind = type(op)
        folded = _folded(kind, a, b)
        if folded is not None:
            return self.negative(node, b) if folded is NEGATIVE else folded
        if kind in OF_FLOATS and t.FLOAT in (a.type, b.type):
            return self._of_floats(kind, self.cast(node, a, t.FLOAT), self.cast(node, b, t.FLOAT))
        result = super().operation(node, op, a, b)
        if result.constant is None:
            self.at(result, OPERATORS[kind][0](self.number(a), self.number(b)))
        return result

    def _of_floats(self, kind: type, a: t.Value, b: t.Value) -> t.Value:
        """An operation of two floats by their words without signs; most of a trace is this."""
        if a.constant is not None and b.constant is not None:
            return super().operation(None, kind(), a, b)
        (a, of_a), (b, of_b) = _unsigned(kind, a), _unsigned(kind, b)
        is_negative = of_a
        if kind is ast.Mult or kind is ast.Div:
            is_negative = of_a != of_b
        elif of_a and of_b:
            if kind is ast.Sub:
                is_negative, a, b = False, b, a
        elif of_a or of_b:
            if kind is ast.Add:
                is_negative, kind = False, ast.Sub
                a, b = (b, a) if of_a else (a, b)
            else:
                kind = ast.Add
        result = _folded(kind, a, b)
        if result is None:
            result = self._instruction(kind, a, b)
        return self.negative(None, result) if is_negative else result

    def _instruction(self, kind: type, a: t.Value, b: t.Value) -> t.Value:
        """The instruction of an operation of two floats, and its number at this state."""
        if a.words > b.words and (kind is ast.Add or kind is ast.Mult):
            a, b = b, a
        python, instruction = OF_FLOATS[kind]
        name = self.new(f"{instruction} {a.words[0]}, {b.words[0]}")
        x, y = self.number(a), self.number(b)
        self._numbers[name] = python(np.float64(x) if y == 0.0 else x, y)
        return t.Value(t.FLOAT, (name,))

    def negative(self, node: Any, value: t.Value) -> t.Value:
        """As of ``Writer``, by the sign of the word: most are sums and products in the end."""
        if value.constant is not None or value.type != t.FLOAT:
            return super().negative(node, value)
        word = value.word[1:] if value.word.startswith("-") else f"-{value.word}"
        return self.at(value._replace(words=(word,)), -self.number(value))

    def comparison(self, node: Any, op: ast.cmpop, a: t.Value, b: t.Value) -> t.Value:
        """As of ``Writer``."""
        result = super().comparison(node, op, a, b)
        if result.constant is None:
            self.at(result, bool(COMPARISONS[type(op)][0](self.number(a), self.number(b))))
        return result

    def select(self, node: Any, condition: t.Value, a: t.Value, b: t.Value) -> t.Value:
        """As of ``Writer``."""
        if condition.constant is not None or a.words == b.words:
            return a if condition.constant in (None, True) else b
        result = super().select(node, condition, a, b)
        return self.at(result, self.number(a if self.number(condition) else b))

    def cast(self, node: Any, value: t.Value, type_: Any) -> t.Value:
        """As of ``Writer``."""
        result = super().cast(node, value, type_)
        if result is not value and result.constant is None:
            number = {t.BOOL: bool, t.INT: int, t.FLOAT: float}[type_](self.number(value))
            self.at(result, number)
        return result

    def __getattr__(self, name: str) -> Callable[..., Any]:
        """A function of floats."""
        written = super().__getattr__(name)
        python = NUMBERS.get(name) or getattr(math, name)

        def call(*given: Any) -> Any:
            values = [self.number(self.value(x)) for x in given]
            try:
                number = python(*values)
            except (ValueError, OverflowError):
                number = math.nan
            if all(self.value(x).constant is not None for x in given):
                return number
            result = written(*given)
            self.at(result.value, number)
            return result

        return call


NUMBERS: dict[str, Callable[..., float]] = {
    "fabs": abs, "rint": lambda x: float(np.rint(x)), "floor": lambda x: float(math.floor(x)),
    "ceil": lambda x: float(math.ceil(x)),
}  # fmt: skip
NEGATIVE = t.Value(t.NOTHING)
#: Of an operation of floats: that of Python, and its instruction.
OF_FLOATS = {
    kind: (OPERATORS[kind][0], OPERATORS[kind][1][t.FLOAT])
    for kind in (ast.Add, ast.Sub, ast.Mult, ast.Div)
}


def _unsigned(kind: type, value: t.Value) -> tuple[t.Value, bool]:
    """What a number is the negative of, of constants where it is a factor; whether it is one."""
    if value.constant is None:
        word = value.words[0]
        return (t.Value(t.FLOAT, (word[1:],)), True) if word[0] == "-" else (value, False)
    if value.constant < 0 and (kind is ast.Mult or kind is ast.Div):
        return t.constant(-value.constant), True
    return value, False


def _folded(kind: type, a: t.Value, b: t.Value) -> t.Value | None:
    """The result where one operand is zero, one or a truth; NEGATIVE: -b; None: it is none."""
    if (a.constant is None) == (b.constant is None):
        same = kind is ast.Sub and a.constant is None and a.words == b.words
        return t.constant(0.0) if same else None
    if (kind is ast.BitAnd or kind is ast.BitOr) and a.type == b.type == t.BOOL:
        known, other = (b, a) if a.constant is None else (a, b)
        return other if bool(known.constant) == (kind is ast.BitAnd) else known
    if kind is ast.Add:
        return b if a.constant in _ZERO else a if b.constant in _ZERO else None
    if kind is ast.Sub:
        if b.constant is not None:
            return a if b.constant in _ZERO else None
        return NEGATIVE if a.constant in _ZERO else None
    if kind is ast.Mult:
        for x, y in ((a, b), (b, a)):
            if x.constant in _ZERO and x.constant is not None:
                return t.constant(0.0)
            if x.constant == 1.0 and y.type == t.FLOAT:
                return y
        return None
    if kind is ast.Div:
        if a.constant is not None and a.constant in _ZERO:
            return t.constant(0.0)
        return a if b.constant == 1.0 and a.type == t.FLOAT else None
    return None


class Item(Symbol):
    """A number of an array, loaded where it is read before the program writes it."""

    __slots__ = ("_loaded", "_number", "_where")

    def __init__(self, tracer: StraightLine, where: Any, number: float) -> None:
        self.tracer, self._where, self._number, self._loaded = tracer, where, number, None

    @property
    def value(self) -> t.Value:  # type: ignore[override]
        """The number, which is loaded here if it was not before."""
        if self._loaded is None:
            base, k = self._where
            at = self.tracer.new(f"getelementptr inbounds double, ptr {base()}, i64 {k}")
            word = self.tracer.new(f"load double, ptr {at}, align 8")
            self._loaded = self.tracer.at(t.Value(t.FLOAT, (word,)), self._number)
        return self._loaded
