"""Prints expressions as the source of a kernel, with common subexpressions computed once."""

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partialmethod
from typing import Any

import sympy
from sympy.printing.pycode import PythonCodePrinter

from dap3d_core.interface.codegen.kernel_arguments import KernelArgument
from dap3d_core.interface.derive.program import Steps
from dap3d_core.interface.derive.symbolic import DerivationError, Symbols, flat

#: sympy's functions that kernels have under the same name.
WORDS = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "atan", "atan2", "exp", "log", "asin", "acos",
         "floor")  # fmt: skip


class KernelPrinter(PythonCodePrinter):  # type: ignore[misc]
    """Prints expressions in the functions of kernels; ``used`` collects these."""

    def __init__(self) -> None:
        super().__init__({"fully_qualified_modules": False, "strict": False})
        self.used: set[str] = set()

    def _call(self, word: str, *arguments: Any) -> str:
        self.used.add(word)
        return f"{word}({', '.join(map(self._print, arguments))})"

    def _print_Integer(self, number: Any) -> str:
        return f"{int(number)}.0"

    _print_Zero = _print_One = _print_NegativeOne = _print_Integer

    def _print_Rational(self, number: Any) -> str:
        return f"({number.p}.0 / {number.q}.0)"

    _print_Half = _print_Rational

    def _print_Float(self, number: Any) -> str:
        return repr(float(number))

    _print_Pi = _print_Exp1 = _print_Float

    def _print_Pow(self, power: Any, rational: bool = False) -> str:
        base, exponent = power.as_base_exp()
        if exponent.is_Rational and exponent.q <= 2:
            root = self._call("sqrt", base) if exponent.q == 2 else self._bracketed(base)
            count = abs(int(exponent.p))
            product = f"{root}**{count}" if count > 1 else root
            return product if exponent > 0 else f"(1.0/{product})"
        return f"{self._bracketed(base)}**({self._print(exponent)})"

    def _bracketed(self, x: Any) -> str:
        return self._print(x) if x.is_Symbol else f"({self._print(x)})"

    def _print_Abs(self, magnitude: Any) -> str:
        return f"abs({self._print(magnitude.args[0])})"

    def _print_sign(self, sign: Any) -> str:
        (x,) = sign.args
        return self._call("where", x > 0, sympy.Integer(1), sympy.Integer(-1))

    def _print_Branch(self, branch: Any) -> str:
        return self._call("where", *branch.args)

    def _joined(self, operator: str, conditions: Any) -> str:
        return f"({operator.join(map(self._print, conditions.args))})"

    _print_And = partialmethod(_joined, " & ")
    _print_Or = partialmethod(_joined, " | ")
    _print_Xor = partialmethod(_joined, " ^ ")

    def _print_Not(self, condition: Any) -> str:
        return f"({self._print(condition.args[0])} ^ True)"

    def _print_Function(self, call: Any) -> str:
        name = type(call).__name__
        if name in WORDS:
            return self._call(name, *call.args)
        is_given = isinstance(call, sympy.core.function.AppliedUndef) or hasattr(call, "fdiff")
        if not is_given or type(call).__module__.startswith("sympy"):
            raise DerivationError(f"kernels have no {name}; write the formulas by hand")
        return f"{name}({', '.join(map(self._print, call.args))})"

    _print_sin = _print_cos = _print_tanh = _print_atan2 = _print_Function
    _print_tan = _print_sinh = _print_cosh = _print_atan = _print_Function
    _print_exp = _print_log = _print_asin = _print_acos = _print_floor = _print_Function


def kernel_source(
    name: str,
    value: Sequence[Any],
    steps: Steps,
    symbols: Symbols,
    offered: Mapping[str, KernelArgument],
) -> tuple[str, set[str]]:
    """The source of a kernel that returns these expressions, and the words that it uses.

    Args:
        name: of the kernel.
        value: nested lists of expressions.
        steps: the expressions of symbols in them.
        symbols, offered: the names that it may use.
    """
    lines, numbers = _ordered(steps, flat(value), symbols, offered)
    used = [x for _, x in lines] + numbers
    called = {type(call).__name__ for x in used for call in x.atoms(sympy.Function)}
    free = set().union(*(x.free_symbols for x in used)) - {s for s, _ in lines}
    if unknown := free - set(symbols.owner):
        hidden = min(map(str, unknown)).partition("[")[0].lstrip("_")
        raise DerivationError(
            f"{name} needs {hidden}, the velocity of the body, whose name a field has taken; "
            "give the field another name"
        )
    needed = {symbols.owner[s][0] for s in free} | called
    wanted = [n for n in offered if n in needed]
    printer = KernelPrinter()
    text = [f"{s} = {printer.doprint(x)}" for s, x in lines]
    text += _returned(value, iter([printer.doprint(x) for x in numbers]))
    body = "".join(f"    {line}\n" for line in text)
    return f"def {name}({', '.join(wanted)}):\n{body}", printer.used


def _ordered(
    steps: Steps, numbers: Sequence[Any], symbols: Symbols, offered: Mapping[str, KernelArgument]
) -> tuple[list[tuple[Any, Any]], list[Any]]:
    """The steps that the numbers need, in order of dependence (e0, e1, ...), and the numbers."""
    written = [factored(x) for x in (*steps.values(), *numbers)]
    common, reduced = sympy.cse(written, symbols=symbols.fresh)
    known = dict(common) | dict(zip(steps, reduced, strict=False))
    results = reduced[len(steps) :]
    order: dict[Any, Any] = {}

    def visit(expression: Any) -> None:
        for s in sorted(expression.free_symbols & set(known), key=str):
            if s not in order:
                visit(known[s])
                order[s] = known[s]

    same: dict[Any, Any] = {}  # steps that equal a symbol
    for symbol, x in known.items():
        known[symbol] = x = x.xreplace(same)
        if x.is_Atom:
            same[symbol] = x
    results = [x.xreplace(same) for x in results]
    for x in results:
        visit(x)
    free = (f"e{k}" for k in itertools.count() if f"e{k}" not in offered)
    renamed = {s: sympy.Symbol(next(free), real=True) for s in order}
    lines = [(renamed[s], x.xreplace(renamed)) for s, x in order.items()]
    return lines, [x.xreplace(renamed) for x in results]


def factored(expression: Any) -> Any:
    """An expression with the most frequent symbol of each sum factored out, recursively."""
    if expression.is_Atom:
        return expression
    if not expression.is_Add:
        return expression.func(*map(factored, expression.args))
    terms = [sympy.Mul.make_args(term) for term in expression.args]
    counts = Counter(f for term in terms for f in term if f.is_Symbol)
    most = max(counts.values(), default=1)
    if most < 2:
        return sympy.Add(*map(factored, expression.args))
    factor = min((f for f, n in counts.items() if n == most), key=str)
    inside = [sympy.Mul(*(f for f in term if f != factor)) for term in terms if factor in term]
    outside = [factored(sympy.Mul(*term)) for term in terms if factor not in term]
    return sympy.Add(sympy.Mul(factor, factored(sympy.Add(*inside)), evaluate=False), *outside)


def _returned(value: Any, numbers: Any) -> list[str]:
    """The lines of the return statement: rows of a matrix on one line each, else numbers."""

    def lines(part: Any, depth: int) -> list[str]:
        indent = "    " * depth
        if not isinstance(part, (list, tuple)):
            return [f"{indent}{next(numbers)},"]
        if depth > 1 and not isinstance(part[0], (list, tuple)):
            return [f"{indent}({', '.join(next(numbers) for _ in part)}),"]
        return [f"{indent}(", *(line for p in part for line in lines(p, depth + 1)), f"{indent}),"]

    first, *between, last = lines(value, 0)
    return [f"return {first}", *between, last.rstrip(",")]
