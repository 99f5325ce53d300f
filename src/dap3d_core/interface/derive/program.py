"""Expressions with common parts in steps, and their derivatives."""

from collections.abc import Iterator, Sequence
from typing import Any

import attrs
import sympy

from dap3d_core.interface.derive.branches import Branch

Expression = Any
Steps = dict[Expression, Expression]
#: Conditions, each with the answer that it must have.
Guard = tuple[tuple[Expression, bool], ...]


@attrs.frozen
class Program:
    """Expressions with common parts in steps, so that derivatives of steps are steps.

    A branch is a step of its own, whose two sides are symbols or numbers.

    Attributes:
        steps: symbol -> expression over the symbols before it.
        results: expressions over all of them.
        fresh: symbols for further steps; numbered from zero in each derivation, as the order of a
            sum depends on names.
    """

    steps: dict[Expression, Expression]
    results: list[Expression]
    fresh: Iterator[Expression]

    @classmethod
    def of(cls, results: Sequence[Expression], fresh: Iterator[Expression]) -> "Program":
        """A step for each common subexpression, branch and argument of a function."""
        common, reduced = sympy.cse(results, symbols=fresh)
        steps: dict[Expression, Expression] = {}
        known: dict[Expression, Expression] = {}

        def named(x: Expression) -> Expression:
            if x.is_Atom:
                return x
            if x not in known:
                known[x] = next(fresh)
                steps[known[x]] = x
            return known[x]

        def split(x: Expression) -> Expression:
            if x.is_Atom:
                return x
            arguments = [split(a) for a in x.args]
            if isinstance(x, Branch):
                condition, *sides = arguments
                return named(Branch(condition, *map(named, sides)))
            if isinstance(x, sympy.Function) or (x.is_Pow and not x.exp.is_Integer):
                arguments = [named(a) for a in arguments]
            return x.func(*arguments)

        for symbol, expression in common:
            steps[symbol] = split(expression)
        return cls(steps, [split(x) for x in reduced], fresh)

    def gradient(self, result: int) -> tuple["Program", dict[Expression, Expression]]:
        """Derivatives of one result by the symbols that are not steps (reverse accumulation).

        What only one side of a branch uses has a weight of zero on the other, where its own
        derivative may be infinite: products with that are zero there by a branch of their own.

        Returns:
            the program with the steps that they need, and the derivatives by symbol.
        """
        steps = dict(self.steps)
        found: dict[Expression, dict[Guard, list[Expression]]] = {}

        def give(symbol: Expression, guard: Guard, weight: Expression) -> None:
            found.setdefault(symbol, {}).setdefault(guard, []).append(weight)

        def give_all(expression: Expression, guard: Guard, weight: Expression) -> None:
            if isinstance(expression, Branch):
                condition, *sides = expression.args
                for side, answer in zip(sides, (True, False), strict=True):
                    if side.is_Symbol and (condition, not answer) not in guard:
                        own = (condition, answer)
                        inner = guard if own in guard else (*guard, own)
                        give(side, inner, _guarded(weight, inner[len(guard) :]))
                return
            for s in sorted(expression.free_symbols, key=str):
                slope = derivative(expression, s)
                is_finite = slope.is_polynomial() and slope.free_symbols.isdisjoint(steps)
                term = weight * slope
                give(s, guard, term if is_finite else _guarded(term, guard))

        give_all(self.results[result], (), sympy.Integer(1))
        for symbol, expression in reversed(self.steps.items()):
            for guard, weights in found.pop(symbol, {}).items():
                weight = sympy.Add(*weights)
                if not weight.is_Atom:
                    step = next(self.fresh)
                    steps[step], weight = weight, step
                if weight != 0:
                    give_all(expression, guard, weight)
        program = attrs.evolve(self, steps=steps)
        sums = {
            s: [x for terms in by_guard.values() for x in terms] for s, by_guard in found.items()
        }
        return program, {s: sympy.Add(*terms) for s, terms in sums.items()}

    def plain(self, result: int) -> Expression:
        """One result without steps."""
        known: dict[Expression, Expression] = {}
        for symbol, expression in self.steps.items():
            known[symbol] = expression.xreplace(known)
        return self.results[result].xreplace(known)


def _guarded(expression: Expression, guard: Guard) -> Expression:
    """The expression where a guard holds, else zero."""
    zero = sympy.Integer(0)
    for condition, answer in reversed(guard):
        sides = (expression, zero) if answer else (zero, expression)
        expression = Branch(condition, *sides)
    return expression


def derivative(expression: Expression, symbol: Expression) -> Expression:
    """Derivative; that of a jump (of a sign, a branch, ``floor``) is zero."""
    found, zero = sympy.diff(expression, symbol), sympy.Integer(0)
    if expression.has(sympy.floor):  # of which sympy knows no derivative
        found = found.replace(sympy.Subs, lambda *_: zero).replace(
            sympy.Derivative, lambda *_: zero
        )
    return found.replace(sympy.DiracDelta, lambda *_: zero)
