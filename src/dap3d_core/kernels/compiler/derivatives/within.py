"""Slopes within vectors whose first lane is the value.

Lane 0 has the bits of the program alone, and decides its branches. An item of an array is such a
vector.
"""

import re

from dap3d_core.kernels.compiler.derivatives.instructions import ONE, ZERO, Instructions
from dap3d_core.kernels.compiler.lanes import CALL, NUMBER, VectorWriter
from dap3d_core.kernels.compiler.writer import COUNT, SLOPE, SLOPES, VALUES

_BINARY = re.compile(r"(fmul|fdiv) double (\S+), (\S+)")
_COMPARED = re.compile(r"fcmp (\w+) double (\S+), (\S+)")
_OPERANDS = re.compile(r"(?:f(?:add|sub|mul|div|neg)|select i1|call) .*double.*")
_NAMED = re.compile(r"(?<=double )%[\w.]+|(?<=, )%[\w.]+")
_ONE = re.compile(rf"select i1 true, double \S+, double (\S+) {SLOPE} (\S+)")
_JOINED = re.compile(rf"select i1 true, double (\S+), double (\S+) {SLOPES}")


class WithinWriter(VectorWriter, Instructions):
    """Rewrites the lines of one function."""

    def __init__(self, count: int, external: set[str]) -> None:
        """Args:
        count: numbers for each float.
        external: as of ``Instructions``.
        """
        VectorWriter.__init__(self, count, external)
        Instructions.__init__(self, count, external)
        others = [f"i32 {count + k}" for k in range(1, count)]
        self._first = f"<{count} x i32> <{', '.join(['i32 0', *others])}>"
        self._name, self._has_slopes = "", True

    def constant(self, word: str) -> str:
        """A number without slopes."""
        return "<" + ", ".join([f"DOUBLE {word}"] + [f"DOUBLE {ZERO}"] * (self.count - 1)) + ">"

    def special(self, name: str, text: str) -> list[str] | None:
        """As of ``VectorWriter``."""
        if "double" not in text and not text.endswith((COUNT, VALUES)):
            return None
        self.out, self._name, self._splats = [], name, {}
        return self.out if self._has_written(text) else None

    def _has_written(self, text: str) -> bool:
        if text.endswith(VALUES):
            self._has_slopes = False
            self.out.append(f"  {self._name} = {text}")
        elif not self._has_slopes and self._has_written_value(text):
            pass
        elif found := _BINARY.fullmatch(text):
            operation, a, b = found.groups()
            write = self._product if operation == "fmul" else self._quotient
            write(a, b)
        elif found := _COMPARED.fullmatch(text):
            relation, a, b = found.groups()
            a, b = self._value(a), self._value(b)
            self.out.append(f"  {self._name} = fcmp {relation} double {a}, {b}")
        elif found := _JOINED.fullmatch(text):
            self.out.append(self._join(self._word(found[1]), self._word(found[2])))
        elif text.endswith(COUNT):
            self.out.append(f"  {self._name} = add i64 {self.count - 1}, 0")
        elif found := _ONE.fullmatch(text):
            place = self.new(f"add i64 {found[2]}, 1")
            of = f"{self.vector} {self._word(found[1])}, i64 {place}"
            self._finish(self.new(f"extractelement {of}"))
        elif text.startswith("fptosi double "):
            value = self._value(text.split()[2])
            self.out.append(f"  {self._name} = fptosi double {value} to i64")
        elif text.startswith(("sitofp ", "uitofp ")):
            self._finish(self.new(text))
        elif (found := CALL.match(text)) and self.is_of_numbers(found[1]):
            self._function(found[1], [a.split()[-1] for a in found[2].split(", ")], text, found[2])
        else:
            return False
        return True

    def _has_written_value(self, text: str) -> bool:
        """As ``_has_written``, where no number has slopes."""
        if text.startswith("load double, "):
            self._finish(self.new(text))
            return True
        found = CALL.match(text)
        if not _OPERANDS.fullmatch(text) or (found and not self.is_of_numbers(found[1])):
            return False
        self._finish(self.new(_NAMED.sub(lambda word: self._value(word[0]), text)))
        return True

    # ------------------------------------------------------------------ parts of an instruction

    def _word(self, word: str) -> str:
        """The vector of a name or a constant."""
        is_number = NUMBER.fullmatch(word)
        return self.constant(word).replace("DOUBLE", "double") if is_number else word

    def _value(self, word: str) -> str:
        if NUMBER.fullmatch(word):
            return word
        return self.new(f"extractelement {self.vector} {word}, i32 0")

    def _join(self, value: str, slopes: str) -> str:
        """The last line: lane 0 of one vector, the others of another."""
        v = self.vector
        return f"  {self._name} = shufflevector {v} {value}, {v} {slopes}, {self._first}"

    def _finish(self, value: str, slopes: str = "zeroinitializer") -> None:
        """The last line: a number as value, and slopes."""
        self.out.append(
            f"  {self._name} = insertelement {self.vector} {slopes}, double {value}, i32 0"
        )

    # ------------------------------------------------------------------ instructions

    def _product(self, a: str, b: str) -> None:
        for x, y in ((a, b), (b, a)):
            if NUMBER.fullmatch(x):
                self.out.append(
                    f"  {self._name} = fmul {self.vector} {self._word(y)}, {self.splat(x)}"
                )
                return
        one = self.lanewise("fmul", self.splat(self._value(a)), b)
        self.out.append(self._join(one, self.total(one, a, self._value(b))))

    def _quotient(self, a: str, b: str) -> None:
        """(a / b)' = (a' - (a / b) b') / b."""
        if NUMBER.fullmatch(b):
            a, b = self._word(a), self.splat(b)
            self.out.append(f"  {self._name} = fdiv {self.vector} {a}, {b}")
            return
        divisor = self._value(b)
        value = self.number("fdiv", self._value(a), divisor)
        rest = self.total(self._word(a), b, value, is_negative=True)
        over = self.splat(self.number("fdiv", ONE, divisor))
        self._finish(value, self.lanewise("fmul", rest, over))

    def _function(self, function: str, words: list[str], text: str, arguments: str) -> None:
        values = [self._value(word) for word in words]
        y = self.new(text.replace(arguments, ", ".join(f"double {x}" for x in values), 1))
        slopes = ["" if NUMBER.fullmatch(word) else word for word in words]
        self._finish(y, self.of_function(function, y, values, slopes) or "zeroinitializer")
