"""Writers of slopes: beside values, as vectors of their own, or within vectors with the value.

Beside: the instructions of the program stay as they are, and an item of an array is followed by its
slopes. Numbers that come of no array have no slopes, which are not computed then.

Within: lane 0 of a vector is the value, has the bits of the program alone, and decides its
branches. An item of an array is such a vector.
"""

import re

from dap3d_core.kernels.compiler.derivatives.instructions import ONE, ZERO, Instructions, layout
from dap3d_core.kernels.compiler.lanes import CALL, DOUBLE, NUMBER, RESULT, VectorWriter
from dap3d_core.kernels.compiler.types import CompileError
from dap3d_core.kernels.compiler.writer import COUNT, SLOPE, SLOPES, VALUES

_NUMBER = re.compile(r"double ([^\s,)]+)")
_BINARY = re.compile(r"f(add|sub|mul|div) double (\S+), (\S+)")
_SELECTED = re.compile(r"select i1 (\S+), double (\S+), double (\S+)( ; .*)?")
_CALL = re.compile(r"(  )?call (.+?) ([@%][\w.]+)\((.*?)\)(.*)")
_EXTRACTED = re.compile(r"extractvalue ({.*}) (\S+), (\d+)")
_INSERTED = re.compile(r"insertvalue ({.*}) (\S+), (.*), (\d+)")
_LOADED = re.compile(r"load double, ptr (%[\w.]+)")
_STORED = re.compile(r"  store double (\S+), ptr (%[\w.]+)")
_RETURNED = re.compile(r"  ret double (\S+)")
#: Instructions of numbers whose results have no slopes, or are no numbers.
_PLAIN = re.compile(r"(fcmp \w+|fptosi) double|[su]itofp ")


class BesideWriter(Instructions):
    """Rewrites the lines of one function."""

    def __init__(self, lanes: int, external: set[str], lines: list[str]) -> None:
        """Args:
        lanes: slopes of a float.
        external: as of ``Instructions``.
        lines: of the function.
        """
        super().__init__(lanes, external)
        self._width, self._first = layout(lanes + 1)
        self._align = f"align {8 * self._first}"
        self._pair = f"{{double, {self.vector}}}"
        self._has_slopes = not any(line.endswith(VALUES) for line in lines)
        #: Vectors of slopes by the names of numbers; those of others are zero.
        self._slopes: dict[str, str] = {}
        self._slots: set[str] = set()
        #: Numbers in slots, as known in the present block.
        self._held: dict[str, str] = {}

    def _zero_or(self, word: str) -> str:
        return self._slopes.get(word, "zeroinitializer")

    # ------------------------------------------------------------------ instructions

    def lines(self, line: str) -> list[str]:
        """The lines that take the place of one."""
        self.out = []
        found = RESULT.fullmatch(line)
        name, text = found.groups() if found else ("", line)
        if line.endswith(":"):
            self._held, self._splats = {}, {}
            self.out.append(line)
        elif line.startswith("define "):
            self._define(line)
        elif line.startswith("declare "):  # those of this compiler that give numbers are defined
            is_own = line.startswith("declare void ")
            self.out.append(
                re.sub(r"\bdouble( %[\w.]+)?", rf"\g<0>, {self.vector}", line) if is_own else line
            )
        elif call := _CALL.fullmatch(text):
            self._call(name, text, *call.groups()[1:])
        elif text.endswith(COUNT):
            self.out.append(f"  {name} = add i64 {self.lanes}, 0")
        elif "double" not in text or _PLAIN.match(text):
            self.out.append(line)
        elif text.startswith("getelementptr "):
            self.out.append(DOUBLE.sub(f"[{self._width} x double]", line))
        elif not self._has_written(name, text, line):
            raise CompileError(f"differentiation does not know {text}")
        return self.out

    def _has_written(self, name: str, text: str, line: str) -> bool:
        if text.startswith("alloca "):
            self._allocate(name, text, line)
        elif found := _EXTRACTED.fullmatch(text):
            self._extract(name, *found.groups())
        elif found := _INSERTED.fullmatch(text):
            self._insert(name, *found.groups())
        elif found := _RETURNED.fullmatch(text):
            one = self.new(f"insertvalue {self._pair} undef, double {found[1]}, 0")
            slopes = f"{self.vector} {self._zero_or(found[1])}"
            two = self.new(f"insertvalue {self._pair} {one}, {slopes}, 1")
            self.out.append(f"  ret {self._pair} {two}")
        elif text.startswith("  ret "):
            self.out.append(DOUBLE.sub(self._pair, line))
        else:
            self.out.append(line)
            return self._has_slopes_written(name, text)
        return True

    def _has_slopes_written(self, name: str, text: str) -> bool:
        """Write slopes behind the instruction of a number."""
        if found := _STORED.match(text):
            self._store(*found.groups())
        elif found := _LOADED.match(text):
            self._load(name, found[1])
        elif found := _BINARY.fullmatch(text):
            kind, a, b = found.groups()
            self._keep(name, getattr(self, f"_{kind}")(name, a, b))
        elif text.startswith("fneg double "):
            slopes = self._slopes.get(text.split()[-1])
            self._keep(name, slopes and self.lanewise("fneg", slopes))
        elif found := _SELECTED.fullmatch(text):
            condition, a, b, remark = found.groups()
            of = [self._zero_or(word) for word in (a, b)]
            if remark == f" {SLOPES}":
                self._keep(name, self._slopes.get(b))
            elif remark and remark.startswith(f" {SLOPE} "):
                place = f"i64 {remark.split()[-1]}"
                line = f"  {name} = extractelement {self.vector} {of[1]}, {place}"
                self.out[-1] = line
            elif of[0] != of[1]:
                one, other = (f"{self.vector} {x}" for x in of)
                self._keep(name, self.new(f"select i1 {condition}, {one}, {other}"))
            else:
                self._keep(name, self._slopes.get(a))
        else:
            return False
        return True

    def _keep(self, name: str, slopes: str | None) -> None:
        if slopes and self._has_slopes:
            self._slopes[name] = slopes

    def _define(self, line: str) -> None:
        line = re.sub(r"double (%[\w.]+)", rf"double \1, {self.vector} \1.d", line)
        for name in re.findall(r"(%[\w.]+)\.d\b", line):
            self._keep(name, f"{name}.d")
        head, bracket, rest = line.partition("(")
        self.out.append(DOUBLE.sub(self._pair, head) + bracket + rest)

    def _allocate(self, name: str, text: str, line: str) -> None:
        if text == "alloca double":
            self._slots.add(name)
            self.out += [line, f"  {name}.d = alloca {self.vector}"]
        else:
            wide = DOUBLE.sub(f"[{self._width} x double]", line.removesuffix(", align 8"))
            self.out.append(f"{wide}, {self._align}")

    def _place(self, at: str) -> str:
        """Where the slopes of the number at an address are."""
        if at in self._slots:
            return f"{at}.d"
        return self.new(f"getelementptr inbounds double, ptr {at}, i64 {self._first}")

    def _load(self, name: str, at: str) -> None:
        if at in self._held:
            self._keep(name, self._slopes.get(self._held[at]))
        elif self._has_slopes:
            self._keep(name, self.new(f"load {self.vector}, ptr {self._place(at)}, {self._align}"))

    def _store(self, word: str, at: str) -> None:
        place, slopes = self._place(at), self._zero_or(word)
        self.out.append(f"  store {self.vector} {slopes}, ptr {place}, {self._align}")
        if at in self._slots:
            self._held[at] = word

    def _mul(self, name: str, a: str, b: str) -> str:
        slopes = ""
        for x, factor in ((a, b), (b, a)):
            if x in self._slopes:
                slopes = self.total(slopes, self._slopes[x], factor)
        return slopes

    def _div(self, name: str, a: str, b: str) -> str:
        """(a / b)' = (a' - (a / b) b') / b."""
        slopes = self._slopes.get(a, "")
        if by := self._slopes.get(b):
            slopes = self.total(slopes, by, name, is_negative=True)
        return slopes and self.lanewise("fmul", slopes, self.splat(self.number("fdiv", ONE, b)))

    def _add(self, name: str, a: str, b: str) -> str:
        one, other = self._slopes.get(a, ""), self._slopes.get(b, "")
        return self.lanewise("fadd", one, other) if one and other else one or other

    def _sub(self, name: str, a: str, b: str) -> str:
        one, other = self._slopes.get(a, ""), self._slopes.get(b, "")
        if not one or not other:
            return one or (other and self.lanewise("fneg", other))
        return self.lanewise("fsub", one, other)

    # ------------------------------------------------------------------ calls, groups of numbers

    def _group(self, type_: str) -> str:
        return DOUBLE.sub(self._pair, type_)

    def _extract(self, name: str, type_: str, group: str, k: str) -> None:
        of = f"extractvalue {self._group(type_)} {group}, {k}"
        is_number = type_[1:-1].split(", ")[int(k)] == "double"
        self.out.append(f"  {name} = {of}{', 0' if is_number else ''}")
        if is_number:
            self._keep(name, self.new(f"{of}, 1"))

    def _insert(self, name: str, type_: str, group: str, given: str, k: str) -> None:
        type_, (kind, word) = self._group(type_), given.split()
        if kind == "double":
            group = self.new(f"insertvalue {type_} {group}, {given}, {k}, 0")
            given, k = f"{self.vector} {self._zero_or(word)}", f"{k}, 1"
        self.out.append(f"  {name} = insertvalue {type_} {group}, {given}, {k}")

    def _call(self, name: str, text: str, type_: str, function: str, given: str, kind: str) -> None:
        if function[0] == "@" and self.is_of_numbers(function[1:]):
            self.out.append(f"  {name} = {text}")
            words = _NUMBER.findall(given)
            slopes = [self._slopes.get(word, "") for word in words]
            self._keep(name, self.of_function(function[1:], name, words, slopes))
            return
        given = _NUMBER.sub(lambda x: f"{x[0]}, {self.vector} {self._zero_or(x[1])}", given)
        call = f"call {self._group(type_)} {function}({given}){kind}"
        if type_ == "double":
            both = self.new(call)
            self.out.append(f"  {name} = extractvalue {self._pair} {both}, 0")
            self._keep(name, self.new(f"extractvalue {self._pair} {both}, 1"))
        else:
            self.out.append(f"  {name} = {call}" if name else f"  {call}")


_SCALED = re.compile(r"(fmul|fdiv) double (\S+), (\S+)")
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
        elif found := _SCALED.fullmatch(text):
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
        divisor = self._value(b)
        value, rest = self.number("fdiv", self._value(a), divisor), self._word(a)
        if not NUMBER.fullmatch(b):
            rest = self.total(rest, b, value, is_negative=True)
        over = self.splat(self.number("fdiv", ONE, divisor))
        self._finish(value, self.lanewise("fmul", rest, over))

    def _function(self, function: str, words: list[str], text: str, arguments: str) -> None:
        values = [self._value(word) for word in words]
        y = self.new(text.replace(arguments, ", ".join(f"double {x}" for x in values), 1))
        slopes = ["" if NUMBER.fullmatch(word) else word for word in words]
        self._finish(y, self.of_function(function, y, values, slopes) or "zeroinitializer")
