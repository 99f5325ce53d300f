"""LLVM IR of one scene to that of several scenes of one structure, one in each lane of a vector.

Every float becomes a vector, every array of floats one of vectors: item k of all scenes lies
together. Integers, addresses and branches on them are common to all scenes. Operations on vectors
round as those on numbers do, and functions of the C library are called lane by lane, so that each
lane has the bits of its scene alone. What decides by a number is refused: scenes would part there.

The text is that of this compiler (writer.py, functions.py, trace.py), one instruction a line.
"""

import re
from collections.abc import Callable, Iterator

from dap3d_core.kernels.compiler.types import CompileError
from dap3d_core.kernels.compiler.writer import EXACT

NUMBER = re.compile(r"(?<![\w.%@])(?:0x[0-9A-F]{16}|-?\d+\.\d+)(?![\w.])")
DOUBLE = re.compile(r"(?<![\w.%@])double(?![\w.])")
RESULT = re.compile(r"  (%[\w.]+) = (.*)")
CALL = re.compile(r"call double @(\w[\w.]*)\(([^)]*)\)")
_JOINED = re.compile(r"(and|or|xor) i1 (\S+), (\S+)")
_SELECTED = re.compile(r"select i1 (%[\w.]+), (\w+) ([^,]+), \w+ (.+)")
_CONVERTED = re.compile(r"(sitofp|uitofp) (i\d+) (\S+) to double")
_PLACED = re.compile(r"(load|  store) <")


class VectorWriter:
    """Rewrites the lines of one function, with a vector for each float.

    Items of arrays lie close together: a vector of an odd length may be loaded from any number.
    """

    def __init__(self, count: int, external: set[str]) -> None:
        """Args:
        count: lanes.
        external: functions of the C library that the module declares.
        """
        self.count, self.external = count, external
        self.vector = f"<{count} x double>"

    def constant(self, word: str) -> str:
        """The vector of a constant; DOUBLE for ``double``."""
        return "<" + ", ".join([f"DOUBLE {word}"] * self.count) + ">"

    def special(self, name: str, text: str) -> list[str] | None:
        """Instructions whose vector form is another; None of all others."""
        raise NotImplementedError

    def check(self, name: str, text: str) -> None:
        """Refuse, or note, an instruction that is rewritten word by word."""

    def lines(self, line: str) -> Iterator[str]:
        """The lines that take the place of one."""
        found = RESULT.fullmatch(line)
        name, text = found.groups() if found else ("", line)
        if found and (written := self.special(name, text)) is not None:
            yield from written
            return
        self.check(name, text)
        text = self.wide(text)
        if _PLACED.match(text):
            text = text if ", align 8" in text else f"{text}, align 8"
        yield f"  {name} = {text}" if found else text

    def wide(self, text: str) -> str:
        """A text with vectors in the place of numbers."""
        if text.startswith("getelementptr"):
            return DOUBLE.sub(f"[{self.count} x double]", text)
        vectors = DOUBLE.sub(self.vector, NUMBER.sub(lambda n: self.constant(n[0]), text))
        return vectors.replace("DOUBLE", "double")


def rewritten(text: str, writer: Callable[[set[str]], VectorWriter]) -> Iterator[str]:
    """The lines of a module, those of its functions rewritten.

    writer: makes the one of a function, given the functions of the C library.
    """
    external = set(re.findall(r"^declare double @(\w+)\(", text, re.MULTILINE))
    lines = writer(external)
    for line in text.splitlines():
        if line.startswith("define "):
            lines = writer(external)
        if line.startswith("declare "):  # those of this compiler give no numbers
            yield lines.wide(line) if line.startswith("declare void ") else line
        else:
            yield from lines.lines(line)


class _Widener(VectorWriter):
    """Rewrites the lines of one function for several scenes."""

    def __init__(self, count: int, external: set[str]) -> None:
        super().__init__(count, external)
        self._mask = f"<{count} x i1>"
        #: Results that are conditions of numbers, one for each lane.
        self._conditions: set[str] = set()

    def check(self, name: str, text: str) -> None:
        """As of ``VectorWriter``; CompileError where it decides by a number."""
        if self._has_condition(text):
            raise CompileError("decides by a number that differs from scene to scene")
        if "fptosi double" in text:
            raise CompileError("makes an index of a number that differs from scene to scene")
        if text.startswith("fcmp "):
            self._conditions.add(name)

    def _has_condition(self, text: str) -> bool:
        return any(word in self._conditions for word in re.findall(r"%[\w.]+", text))

    def special(self, name: str, text: str) -> list[str] | None:
        """As of ``VectorWriter``."""
        if found := CALL.match(text):
            function, arguments = found.groups()
            if function.startswith("llvm."):
                exact = function.replace(".f64", f".v{self.count}f64")
                return [f"  {name} = {self.wide(text.replace(function, exact))}"]
            return self._each(name, text, arguments) if function in self.external else None
        if (found := _JOINED.fullmatch(text)) and self._has_condition(text):
            a, b = map(self._condition, found.groups()[1:])
            self._conditions.add(name)
            return [f"  {name} = {found[1]} {self._mask} {a}, {b}"]
        if (found := _SELECTED.fullmatch(text)) and found[1] in self._conditions:
            condition, kind, a, b = found.groups()
            if kind == "i1":
                a, b = (f"{self._mask} {self._condition(x)}" for x in (a, b))
                self._conditions.add(name)
                return [f"  {name} = select {self._mask} {condition}, {a}, {b}"]
            if kind == "double":
                return [f"  {name} = {self.wide(text).replace('i1', self._mask, 1)}"]
        if found := _CONVERTED.fullmatch(text):
            operation, kind, word = found.groups()
            if word in self._conditions:
                return [f"  {name} = {operation} {self._mask} {word} to {self.vector}"]
            return [f"  {name}.1 = {text}", *self._splat(name, f"{name}.1")]
        return None

    def _splat(self, name: str, word: str) -> list[str]:
        """A number in all lanes."""
        zeros = f"<{self.count} x i32> zeroinitializer"
        return [
            f"  {name}.2 = insertelement {self.vector} undef, double {word}, i32 0",
            f"  {name} = shufflevector {self.vector} {name}.2, {self.vector} undef, {zeros}",
        ]

    def _condition(self, word: str) -> str:
        """A condition of numbers, or a constant, for all lanes."""
        if word in self._conditions:
            return word
        if word not in ("true", "false"):
            raise CompileError("joins a condition of numbers with one of integers")
        return "<" + ", ".join([f"i1 {word}"] * self.count) + ">"

    def _each(self, name: str, text: str, arguments: str) -> list[str]:
        """A call for each lane."""
        words = [a.split()[-1] for a in arguments.split(", ")]
        lines, before = [], "undef"
        for lane in range(self.count):
            parts = []
            for k, word in enumerate(words):
                if word.startswith("%"):
                    part = f"{name}.{lane}.{k}"
                    lines.append(f"  {part} = extractelement {self.vector} {word}, i32 {lane}")
                    word = part
                parts.append(f"double {word}")
            result, after = f"{name}.{lane}", name if lane == self.count - 1 else f"{name}.{lane}.v"
            lines.append(f"  {result} = {text.replace(arguments, ', '.join(parts), 1)}")
            lines.append(
                f"  {after} = insertelement {self.vector} {before}, double {result}, i32 {lane}"
            )
            before = after
        return lines


def widen(text: str, count: int) -> str:
    """A module of LLVM IR for ``count`` scenes at once.

    Raises:
        CompileError: it decides by a number.
    """
    wide = VectorWriter(count, set()).wide
    lines = []
    for line in rewritten(text, lambda external: _Widener(count, external)):
        is_exact = any(f"@llvm.{name}.f64" in line for name in EXACT)
        is_declared = line.startswith("declare ") and is_exact
        lines.append(wide(line).replace(".f64", f".v{count}f64") if is_declared else line)
    return "\n".join([*lines, ""])
