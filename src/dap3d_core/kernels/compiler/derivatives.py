"""LLVM IR of a program to that of the program and its derivatives, by forward differentiation.

Every float becomes a vector: its value and its derivatives, here called slopes, by some directions.
Lane 0, the value, has the bits of the program alone: branches, indices and iterations are decided
by it. Slopes follow the chain rule one instruction at a time, so nothing need be known of what is
computed: kernels of third parties, factorisation, projection and step control alike. Where a
function has no derivative, slopes are zero where they would be infinite, and else those of the side
that is computed.

Code may say what differentiation by instructions does not know (``with_slopes``,
``is_differentiated``, ``values_alone`` of intrinsics.py): these are lines with a remark.

Sums of products of slopes may be fused (``contract``), as what gives lane 0 may not.

The text is that of this compiler (writer.py, functions.py, trace.py), one instruction a line.
Source: A. Griewank, A. Walther, Evaluating Derivatives, 2nd ed., SIAM 2008, chapter 3.
"""

import re
from collections.abc import Callable

from dap3d_core.kernels.compiler.lanes import CALL, NUMBER, VectorWriter, rewritten
from dap3d_core.kernels.compiler.types import CompileError, bits
from dap3d_core.kernels.compiler.writer import DIFFERENTIATED, SLOPES, VALUES

_BINARY = re.compile(r"(fmul|fdiv) double (\S+), (\S+)")
_COMPARED = re.compile(r"fcmp (\w+) double (\S+), (\S+)")
_OPERANDS = re.compile(r"(?:f(?:add|sub|mul|div|neg)|select i1|call) .*double.*")
_NAMED = re.compile(r"(?<=double )%[\w.]+|(?<=, )%[\w.]+")
_JOINED = re.compile(rf"select i1 true, double (\S+), double (\S+) {SLOPES}")
_ZERO, _ONE = bits(0.0), bits(1.0)
#: Of functions that derivatives call.
_PURE = " nobuiltin nounwind willreturn memory(none)"
#: Constant but for steps.
_FLAT = ("llvm.floor.f64", "llvm.ceil.f64", "llvm.rint.f64")


class _Differentiator(VectorWriter):
    """Rewrites the lines of one function."""

    def __init__(self, count: int, external: set[str]) -> None:
        super().__init__(count, external)
        others = [f"i32 {count + k}" for k in range(1, count)]
        self._first = f"<{count} x i32> <{', '.join(['i32 0', *others])}>"
        self._zeros = f"<{count} x i32> zeroinitializer"
        self._out: list[str] = []
        self._name, self._parts, self._has_slopes = "", 0, True

    def constant(self, word: str) -> str:
        """A number without slopes."""
        return "<" + ", ".join([f"DOUBLE {word}"] + [f"DOUBLE {_ZERO}"] * (self.count - 1)) + ">"

    def special(self, name: str, text: str) -> list[str] | None:
        """As of ``VectorWriter``."""
        if "double" not in text and not text.endswith((DIFFERENTIATED, VALUES)):
            return None
        self._out, self._name, self._parts = [], name, 0
        return self._out if self._has_written(text) else None

    def _has_written(self, text: str) -> bool:
        if text.endswith(VALUES):
            self._has_slopes = False
            self._out.append(f"  {self._name} = {text}")
        elif not self._has_slopes and self._has_written_value(text):
            pass
        elif found := _BINARY.fullmatch(text):
            operation, a, b = found.groups()
            write = self._product if operation == "fmul" else self._quotient
            write(a, b)
        elif found := _COMPARED.fullmatch(text):
            relation, a, b = found.groups()
            a, b = self._value(a), self._value(b)
            self._out.append(f"  {self._name} = fcmp {relation} double {a}, {b}")
        elif found := _JOINED.fullmatch(text):
            self._out.append(self._join(self._word(found[1]), self._word(found[2])))
        elif text.endswith(DIFFERENTIATED):
            self._out.append(f"  {self._name} = or i1 true, true")
        elif text.startswith("fptosi double "):
            value = self._value(text.split()[2])
            self._out.append(f"  {self._name} = fptosi double {value} to i64")
        elif text.startswith(("sitofp ", "uitofp ")):
            self._finish(self._new(text))
        elif (found := CALL.match(text)) and self._is_of_numbers(found[1]):
            self._function(found[1], [a.split()[-1] for a in found[2].split(", ")], text, found[2])
        else:
            return False
        return True

    def _has_written_value(self, text: str) -> bool:
        """As ``_has_written``, where no number has slopes."""
        if text.startswith("load double, "):
            self._finish(self._new(text))
            return True
        found = CALL.match(text)
        if not _OPERANDS.fullmatch(text) or (found and not self._is_of_numbers(found[1])):
            return False
        self._finish(self._new(_NAMED.sub(lambda word: self._value(word[0]), text)))
        return True

    def _is_of_numbers(self, function: str) -> bool:
        return function.startswith("llvm.") or function in self.external

    # ------------------------------------------------------------------ parts of an instruction

    def _new(self, text: str) -> str:
        self._parts += 1
        self._out.append(f"  {self._name}.{self._parts} = {text}")
        return f"{self._name}.{self._parts}"

    def _word(self, word: str) -> str:
        """The vector of a name or a constant."""
        is_number = NUMBER.fullmatch(word)
        return self.constant(word).replace("DOUBLE", "double") if is_number else word

    def _value(self, word: str) -> str:
        if NUMBER.fullmatch(word):
            return word
        return self._new(f"extractelement {self.vector} {word}, i32 0")

    def _splat(self, word: str) -> str:
        """Lane 0 in all lanes."""
        if NUMBER.fullmatch(word):
            return "<" + ", ".join([f"double {word}"] * self.count) + ">"
        return self._new(f"shufflevector {self.vector} {word}, {self.vector} undef, {self._zeros}")

    def _wide(self, operation: str, a: str, b: str) -> str:
        return self._new(f"{operation} {self.vector} {a}, {b}")

    def _number(self, operation: str, *words: str) -> str:
        return self._new(f"{operation} double {', '.join(words)}")

    def _call(self, function: str, *words: str) -> str:
        kind = "" if function.startswith("llvm.") else _PURE
        given = ", ".join(f"double {word}" for word in words)
        return self._new(f"call double @{function}({given}){kind}")

    def _join(self, value: str, slopes: str) -> str:
        """The last line: lane 0 of one vector, the others of another."""
        v = self.vector
        return f"  {self._name} = shufflevector {v} {value}, {v} {slopes}, {self._first}"

    def _finish(self, value: str, slopes: str = "zeroinitializer") -> None:
        """The last line: a number as value, and slopes."""
        self._out.append(
            f"  {self._name} = insertelement {self.vector} {slopes}, double {value}, i32 0"
        )

    def _scaled(self, factor: str, word: str) -> str:
        """Slopes of a vector times a number, zero where that is not finite."""
        size = self._call("llvm.fabs.f64", factor)
        good = self._new(f"fcmp olt double {size}, {bits(float('inf'))}")
        factor = self._new(f"select i1 {good}, double {factor}, double {_ZERO}")
        first = self._new(f"insertelement {self.vector} undef, double {factor}, i32 0")
        return self._wide("fmul", self._splat(first), self._word(word))

    # ------------------------------------------------------------------ instructions

    def _product(self, a: str, b: str) -> None:
        if NUMBER.fullmatch(a) or NUMBER.fullmatch(b):
            a, b = (self._splat(x) if NUMBER.fullmatch(x) else x for x in (a, b))
            self._out.append(f"  {self._name} = fmul {self.vector} {a}, {b}")
            return
        one = self._wide("fmul", self._splat(a), b)
        other = self._wide("fmul contract", a, self._splat(b))
        self._out.append(self._join(one, self._wide("fadd contract", one, other)))

    def _quotient(self, a: str, b: str) -> None:
        """(a / b)' = (a' - (a / b) b') / b."""
        if NUMBER.fullmatch(b):
            a, b = self._word(a), self._splat(b)
            self._out.append(f"  {self._name} = fdiv {self.vector} {a}, {b}")
            return
        divisor = self._value(b)
        value, over = (
            self._number("fdiv", self._value(a), divisor),
            self._number("fdiv", _ONE, divisor),
        )
        first = self._new(f"insertelement {self.vector} undef, double {value}, i32 0")
        part = self._wide("fmul contract", self._splat(first), b)
        rest = self._wide("fsub contract", self._word(a), part)
        first = self._new(f"insertelement {self.vector} undef, double {over}, i32 0")
        self._finish(value, self._wide("fmul", rest, self._splat(first)))

    def _function(self, function: str, words: list[str], text: str, arguments: str) -> None:
        values = [self._value(word) for word in words]
        given = ", ".join(f"double {value}" for value in values)
        y = self._new(text.replace(arguments, given, 1))
        if function in _FLAT:
            self._finish(y)
            return
        if function == "nextafter":
            self._finish(y, self._word(words[0]))
            return
        if function not in _FACTORS:
            raise CompileError(f"{function} has no derivative")
        slopes = ""
        for word, factor in zip(words, _FACTORS[function](self, y, *values), strict=True):
            if not NUMBER.fullmatch(word):
                part = self._scaled(factor, word)
                slopes = self._wide("fadd", slopes, part) if slopes else part
        self._finish(y, slopes or "zeroinitializer")


# ---------------------------------------------------------------------- derivatives of functions

_D = _Differentiator


def _fabs(d: _D, y: str, x: str) -> list[str]:
    below = d._new(f"fcmp olt double {x}, {_ZERO}")
    return [d._new(f"select i1 {below}, double {bits(-1.0)}, double {_ONE}")]


def _negative(d: _D, word: str) -> str:
    return d._new(f"fneg double {word}")


def _asin(d: _D, y: str, x: str) -> list[str]:
    rest = d._number("fsub", _ONE, d._number("fmul", x, x))
    return [d._number("fdiv", _ONE, d._call("llvm.sqrt.f64", rest))]


def _atan2(d: _D, angle: str, y: str, x: str) -> list[str]:
    square = d._number("fadd", d._number("fmul", x, x), d._number("fmul", y, y))
    return [d._number("fdiv", x, square), d._number("fdiv", _negative(d, y), square)]


def _pow(d: _D, y: str, x: str, n: str) -> list[str]:
    """N x^(n - 1); x^n log x."""
    lower = d._call("pow", x, d._number("fsub", n, _ONE))
    return [d._number("fmul", n, lower), d._number("fmul", y, d._call("log", x))]


#: Of each function: writes its derivatives by its arguments, given its value and these.
_FACTORS: dict[str, Callable[..., list[str]]] = {
    "llvm.sqrt.f64": lambda d, y, x: [d._number("fdiv", bits(0.5), y)],
    "llvm.fabs.f64": _fabs,
    "sin": lambda d, y, x: [d._call("cos", x)],
    "cos": lambda d, y, x: [_negative(d, d._call("sin", x))],
    "tan": lambda d, y, x: [d._number("fadd", _ONE, d._number("fmul", y, y))],
    "sinh": lambda d, y, x: [d._call("cosh", x)],
    "cosh": lambda d, y, x: [d._call("sinh", x)],
    "tanh": lambda d, y, x: [d._number("fsub", _ONE, d._number("fmul", y, y))],
    "exp": lambda d, y, x: [y],
    "log": lambda d, y, x: [d._number("fdiv", _ONE, x)],
    "asin": _asin,
    "acos": lambda d, y, x: [_negative(d, _asin(d, y, x)[0])],
    "atan": lambda d, y, x: [
        d._number("fdiv", _ONE, d._number("fadd", _ONE, d._number("fmul", x, x)))
    ],
    "atan2": _atan2,
    "hypot": lambda d, r, x, y: [d._number("fdiv", x, r), d._number("fdiv", y, r)],
    "pow": _pow,
}


def differentiate(text: str, count: int) -> str:
    """A module of LLVM IR whose floats are vectors: a value and ``count`` - 1 derivatives.

    Raises:
        CompileError: it calls a function without a derivative.
    """
    lines = list(rewritten(text, lambda external: _Differentiator(count, external)))
    called = set(re.findall(r"call double @(\w[\w.]*)\(", "\n".join(lines)))
    declared = set(re.findall(r"^declare double @(\w[\w.]*)\(", text, re.MULTILINE))
    for function in sorted(called - declared):
        takes = "double, double" if function == "pow" else "double"
        kind = "" if function.startswith("llvm.") else _PURE
        lines.append(f"declare double @{function}({takes}){kind}")
    return "\n".join([*lines, ""])
