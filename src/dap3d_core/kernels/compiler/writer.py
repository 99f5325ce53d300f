"""LLVM IR of one function: instructions, casts, arithmetic, comparisons, blocks, stack slots."""

import ast
import operator
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NoReturn

from dap3d_core.kernels.compiler import types as t

#: LLVM intrinsics, exact on every platform.
EXACT = ("sqrt", "fabs", "floor", "ceil", "rint")
#: Functions of the C library, which plain Python calls as well. LLVM must not replace them
#: (nobuiltin): its own versions may round differently.
LIBRARY = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "asin", "acos", "atan",
           "atan2", "pow", "hypot", "nextafter")  # fmt: skip
#: Remarks on lines that mean more where a program is differentiated (derivatives).
SLOPES, SLOPE, COUNT, VALUES = "; slopes", "; slope", "; count of slopes", "; values alone"


class Writer:
    """Writes the instructions of one function: from values to values, without syntax trees.

    ``node``, in the arguments of its methods, is what an error refers to.
    """

    def __init__(self, needs: dict[str, str]) -> None:
        """Args:
        needs: takes the declarations of external functions, by symbol.
        """
        self.needs = needs
        self.lines: list[str] = []
        self.places: list[str] = []
        self.count, self.is_dead = 0, False

    def refuse(self, node: Any, why: str, remedy: str) -> NoReturn:
        """Raise an error: what is wrong, what to write instead, and where."""
        raise NotImplementedError

    def line(self, text: str) -> None:
        """Add an instruction."""
        self.lines.append(f"  {text}")

    def new(self, text: str) -> str:
        """Add an instruction with a result; returns the name of the result."""
        self.count += 1
        self.lines.append(f"  %t{self.count} = {text}")
        return f"%t{self.count}"

    def emit(self, type_: t.Scalar, text: str) -> t.Value:
        """Add an instruction with a number of one word as its result."""
        return t.Value(type_, (self.new(text),))

    def call(self, name: str, *words: str) -> t.Value:
        """A call of an intrinsic or a function of the C library."""
        symbol = f"llvm.{name}.f64" if name in EXACT else name
        kind = "" if name in EXACT else " nobuiltin nounwind willreturn memory(none)"
        self.needs[symbol] = f"declare double @{symbol}({', '.join(['double'] * len(words))}){kind}"
        given = ", ".join(f"double {x}" for x in words)
        return self.emit(t.FLOAT, f"call double @{symbol}({given}){kind}")

    # ------------------------------------------------------------------ blocks, stack slots

    def label(self) -> str:
        """A new name of a block or a variable."""
        self.count += 1
        return f"L{self.count}"

    def start(self, label: str) -> None:
        """Begin a block."""
        self.lines.append(f"{label}:")
        self.is_dead = False

    def jump(self, label: str) -> None:
        """End a block with a jump, unless it has ended."""
        if not self.is_dead:
            self.line(f"br label %{label}")
        self.is_dead = True

    def branch(self, condition: t.Value, one: str, other: str) -> None:
        """End a block with a conditional jump."""
        self.line(f"br i1 {condition.word}, label %{one}, label %{other}")

    def fork(
        self, condition: t.Value, one: Callable[[], Any], other: Callable[[], Any] = lambda: None
    ) -> None:
        """Run what ``one`` writes where a condition holds, else what ``other`` writes."""
        *labels, end = (self.label() for _ in range(3))
        self.branch(condition, *labels)
        goes_on = False
        for label, write in zip(labels, (one, other), strict=True):
            self.start(label)
            write()
            goes_on |= not self.is_dead
            self.jump(end)
        if goes_on:
            self.start(end)

    def place(self, type_: Any, name: str) -> list[str]:
        """Stack slots for the words of a value, initialised to zero."""
        slots = []
        for word in type_.words:
            self.count += 1
            slots.append(f"%{name}.{self.count}.s")
            zero = {"ptr": "null", "double": "0.0"}.get(word, "0")
            self.places += [f"  {slots[-1]} = alloca {word}",
                            f"  store {word} {zero}, ptr {slots[-1]}"]  # fmt: skip
        return slots

    def write_to(self, slots: Sequence[str], value: t.Value) -> None:
        """Store a value in stack slots, or in the words of an array item."""
        for word, x, slot in zip(value.type.words, value.words, slots, strict=True):
            self.line(f"store {word} {x}, ptr {slot}")

    def read_from(self, slots: Sequence[str], type_: Any) -> t.Value:
        """Load a value from stack slots, or from the words of an array item."""
        pairs = zip(type_.words, slots, strict=True)
        return t.Value(type_, tuple(self.new(f"load {w}, ptr {s}") for w, s in pairs))

    # ------------------------------------------------------------------ from one type to another

    def cast(self, node: Any, value: t.Value, type_: Any) -> t.Value:
        """A value converted to another type."""
        have = value.type
        if have == type_:
            return value
        if (have, type_) in CASTS:
            if value.constant is not None:
                return t.constant(PYTHON[type_](value.constant))
            return self.emit(type_, CASTS[have, type_].format(value.word))
        if type_ == t.COMPLEX and have in t.NUMBERS:
            return t.Value(t.COMPLEX, (self.cast(node, value, t.FLOAT).word, t.bits(0.0)))
        if isinstance(have, t.Struct) and have.begins_with(type_):
            return t.Value(type_, value.words)
        if isinstance(have, t.Array) and type_ == t.Array(have.item, 0):
            return t.Value(type_, value.words[:1])
        self.refuse(node, f"a {t.name_of(have)} is given for a {t.name_of(type_)}",
                    "pass what the function takes")  # fmt: skip

    def whole(self, node: Any, value: t.Value) -> t.Value:
        """A value that must be an integer."""
        if value.type not in (t.INT, t.BOOL):
            self.refuse(node, f"a {t.name_of(value.type)} is an index or a count",
                        "take an integer, int(x)")  # fmt: skip
        return self.cast(node, value, t.INT)

    # ------------------------------------------------------------------ arithmetic

    def operation(self, node: Any, op: ast.operator, a: t.Value, b: t.Value) -> t.Value:
        """An operation of two numbers, in the narrowest type that has it and holds both."""
        python, instructions = OPERATORS.get(type(op), (None, {}))
        if python is not None and a.constant is not None and b.constant is not None:
            try:
                folded = t.constant(python(a.constant, b.constant))
            except (ArithmeticError, TypeError, ValueError) as error:
                self.refuse(node, str(error), "change the constants")
            return folded or self.refuse(node, "no number of 64 bits", "change the constants")
        common = t.wider(a.type, b.type)
        wide = t.NUMBERS[t.NUMBERS.index(common) :] if common else ()
        types = [kind for kind in wide if kind in instructions]
        if not types or (isinstance(op, ast.Pow) and common != t.FLOAT):
            remedy = INSTEAD.get(type(op), "take integers, int(x)")
            self.refuse(node, self._operands(op, a, b), remedy if common else ONE_BY_ONE)
        a, b = self.cast(node, a, types[0]), self.cast(node, b, types[0])
        instruction = instructions[types[0]]
        if callable(instruction):
            return instruction(self, a, b)
        pairs = zip(a.words, b.words, strict=True)
        return t.Value(types[0], tuple(self.new(f"{instruction} {x}, {y}") for x, y in pairs))

    def _operands(self, op: ast.AST, a: t.Value, b: t.Value) -> str:
        return f"no {type(op).__name__} of a {t.name_of(a.type)} and a {t.name_of(b.type)}"

    def negative(self, node: Any, value: t.Value) -> t.Value:
        """-x."""
        if value.constant is not None:
            return t.constant(-value.constant)
        if value.type in (t.FLOAT, t.COMPLEX):
            return t.Value(value.type, tuple(self.new(f"fneg double {x}") for x in value.words))
        return self.emit(t.INT, f"sub nsw i64 0, {self.cast(node, value, t.INT).word}")

    def negation(self, value: t.Value) -> t.Value:
        """The contrary of a truth value."""
        if value.constant is not None:
            return t.constant(not value.constant)
        return self.emit(t.BOOL, f"xor i1 {value.word}, true")

    def comparison(self, node: Any, op: ast.cmpop, a: t.Value, b: t.Value) -> t.Value:
        """One comparison."""
        if isinstance(op, (ast.Is, ast.IsNot)):
            if t.NOTHING not in (a.type, b.type):
                self.refuse(node, "is compares more than None", "write ==")
            return t.constant((a.type == b.type) == isinstance(op, ast.Is))
        if isinstance(op, (ast.In, ast.NotIn)) and isinstance(b.type, t.Tuple):
            result = t.constant(False)
            for item in t.items_of(b):
                same = self.comparison(node, ast.Eq(), a, item)
                result = self.operation(node, ast.BitOr(), result, same)
            return result if isinstance(op, ast.In) else self.negation(result)
        type_ = t.wider(a.type, b.type, t.INT)
        if type(op) not in COMPARISONS or type_ is None:
            self.refuse(node, self._operands(op, a, b), ONE_BY_ONE)
        python, integer, real, join = COMPARISONS[type(op)]
        if a.constant is not None and b.constant is not None:
            return t.constant(python(a.constant, b.constant))
        if type_ == t.COMPLEX and not join:
            self.refuse(node, "an order of complex numbers", "compare their parts")
        pairs = zip(self.cast(node, a, type_).words, self.cast(node, b, type_).words, strict=True)
        relation = f"icmp {integer} i64" if type_ == t.INT else f"fcmp {real} double"
        parts = [self.emit(t.BOOL, f"{relation} {x}, {y}") for x, y in pairs]
        return parts[0] if len(parts) == 1 else self.operation(node, join, *parts)

    def select(self, node: Any, condition: t.Value, a: t.Value, b: t.Value) -> t.Value:
        """``a`` where a condition holds, else ``b``; numbers, in their common type."""
        type_ = t.wider(a.type, b.type)
        pairs = zip(self.cast(node, a, type_).words, self.cast(node, b, type_).words, strict=True)
        head, word = f"select i1 {condition.word}", type_.words[0]
        return t.Value(type_, tuple(self.new(f"{head}, {word} {x}, {word} {y}") for x, y in pairs))


def _floored(writer: Writer, a: t.Value, b: t.Value, is_mod: bool) -> t.Value:
    """Quotient or remainder: Python rounds down, the processor towards zero."""
    new = writer.new
    quotient, rest = (new(f"{name} i64 {a.word}, {b.word}") for name in ("sdiv", "srem"))
    some = new(f"icmp ne i64 {rest}, 0")
    below = new(f"icmp slt i64 {new(f'xor i64 {rest}, {b.word}')}, 0")
    exact, other = (
        (rest, f"add i64 {rest}, {b.word}") if is_mod else (quotient, f"sub i64 {quotient}, 1")
    )
    off = new(f"and i1 {some}, {below}")
    return writer.emit(t.INT, f"select i1 {off}, i64 {new(other)}, i64 {exact}")


def _power(writer: Writer, a: t.Value, b: t.Value) -> t.Value:
    """``pow`` of the C library, as in plain Python."""
    return writer.call("pow", a.word, b.word)


def _complex_product(writer: Writer, a: t.Value, b: t.Value) -> t.Value:
    """(a0 b0 - a1 b1, a0 b1 + a1 b0)."""
    (a0, a1), (b0, b1), new = a.words, b.words, writer.new
    p, q, r, s = (new(f"fmul double {x}, {y}") for x, y in ((a0, b0), (a1, b1), (a0, b1), (a1, b0)))
    return t.Value(t.COMPLEX, (new(f"fsub double {p}, {q}"), new(f"fadd double {r}, {s}")))


def _complex_quotient(writer: Writer, a: t.Value, b: t.Value) -> t.Value:
    """Smith's division as numpy does it: by the ratio of the smaller part to the larger one."""
    (a0, a1), (b0, b1), new = a.words, b.words, writer.new

    def of(name: str, x: str, y: str) -> str:
        return new(f"{name} double {x}, {y}")

    def choose(condition: str, x: str, y: str) -> str:
        return new(f"select i1 {condition}, double {x}, double {y}")

    size0, size1 = (writer.call("fabs", x).word for x in b.words)
    test = of("fcmp oge", size0, size1)
    large, small = choose(test, b0, b1), choose(test, b1, b0)
    ratio = of("fdiv", small, large)
    scale = of("fdiv", t.bits(1.0), of("fadd", large, of("fmul", small, ratio)))
    r0, r1 = of("fmul", a0, ratio), of("fmul", a1, ratio)
    real = choose(test, of("fadd", a0, r1), of("fadd", r0, a1))
    imag = choose(test, of("fsub", a1, r0), of("fsub", r1, a0))
    is_zero = of("fcmp oeq", of("fadd", size0, size1), t.bits(0.0))
    pairs = zip(a.words, (real, imag), strict=True)
    return t.Value(t.COMPLEX, tuple(choose(is_zero, of("fdiv", x, size0), of("fmul", y, scale))
                                for x, y in pairs))  # fmt: skip


#: Conversions of numbers.
CASTS = {
    (t.INT, t.FLOAT): "sitofp i64 {} to double",
    (t.BOOL, t.FLOAT): "uitofp i1 {} to double",
    (t.BOOL, t.INT): "zext i1 {} to i64",
    (t.FLOAT, t.INT): "fptosi double {} to i64",
    (t.INT, t.BOOL): "icmp ne i64 {}, 0",
    (t.FLOAT, t.BOOL): "fcmp une double {}, 0.0",
}
#: Those of constants.
PYTHON: dict[Any, Callable[[Any], Any]] = {t.BOOL: bool, t.INT: int, t.FLOAT: float}
#: Of each operator: that of Python, and the instruction for each type of both operands.
OPERATORS: dict[type, tuple[Any, dict[Any, Any]]] = {
    ast.Add: (operator.add,
              {t.INT: "add nsw i64", t.FLOAT: "fadd double", t.COMPLEX: "fadd double"}),
    ast.Sub: (operator.sub,
              {t.INT: "sub nsw i64", t.FLOAT: "fsub double", t.COMPLEX: "fsub double"}),
    ast.Mult: (operator.mul,
               {t.INT: "mul nsw i64", t.FLOAT: "fmul double", t.COMPLEX: _complex_product}),
    ast.Div: (operator.truediv, {t.FLOAT: "fdiv double", t.COMPLEX: _complex_quotient}),
    ast.FloorDiv: (operator.floordiv, {t.INT: partial(_floored, is_mod=False)}),
    ast.Mod: (operator.mod, {t.INT: partial(_floored, is_mod=True)}),
    ast.Pow: (operator.pow, {t.FLOAT: _power}),
    ast.BitAnd: (operator.and_, {t.BOOL: "and i1", t.INT: "and i64"}),
    ast.BitOr: (operator.or_, {t.BOOL: "or i1", t.INT: "or i64"}),
    ast.BitXor: (operator.xor, {t.BOOL: "xor i1", t.INT: "xor i64"}),
    ast.LShift: (operator.lshift, {t.INT: "shl i64"}),
    ast.RShift: (operator.rshift, {t.INT: "ashr i64"}),
}  # fmt: skip
ONE_BY_ONE = "take numbers, one by one"
INSTEAD = {ast.Pow: "multiply, or take floats", ast.MatMult: ONE_BY_ONE}
#: Of each comparison: that of Python, of integers, of floats; how complex numbers join their parts.
COMPARISONS: dict[type, tuple[Any, str, str, Any]] = {
    ast.Lt: (operator.lt, "slt", "olt", None),
    ast.LtE: (operator.le, "sle", "ole", None),
    ast.Gt: (operator.gt, "sgt", "ogt", None),
    ast.GtE: (operator.ge, "sge", "oge", None),
    ast.Eq: (operator.eq, "eq", "oeq", ast.BitAnd()),
    ast.NotEq: (operator.ne, "ne", "une", ast.BitOr()),
}
