"""Arithmetic, comparisons and conditional expressions to LLVM IR."""

import ast
import operator
from collections.abc import Callable
from typing import Any

from dap3d_core.kernels.compiler.types import (
    BOOL,
    COMPLEX,
    FLOAT,
    INT,
    NOTHING,
    NUMBERS,
    CompileError,
    Tuple,
    Value,
    constant,
    items_of,
    wider,
)
from dap3d_core.kernels.compiler.words import WORDS, complex_product, complex_quotient
from dap3d_core.kernels.compiler.writing import Writer, name_of

OPERATORS: dict[type, tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Add: ("add", operator.add),
    ast.Sub: ("sub", operator.sub),
    ast.Mult: ("mul", operator.mul),
    ast.Div: ("div", operator.truediv),
    ast.FloorDiv: ("floordiv", operator.floordiv),
    ast.Mod: ("mod", operator.mod),
    ast.Pow: ("pow", operator.pow),
    ast.BitAnd: ("and", operator.and_),
    ast.BitOr: ("or", operator.or_),
    ast.BitXor: ("xor", operator.xor),
    ast.LShift: ("shl", operator.lshift),
    ast.RShift: ("ashr", operator.rshift),
}
COMPARISONS: dict[type, tuple[str, str, Callable[[Any, Any], Any]]] = {
    ast.Lt: ("olt", "slt", operator.lt),
    ast.LtE: ("ole", "sle", operator.le),
    ast.Gt: ("ogt", "sgt", operator.gt),
    ast.GtE: ("oge", "sge", operator.ge),
    ast.Eq: ("oeq", "eq", operator.eq),
    ast.NotEq: ("une", "ne", operator.ne),
}
LOGIC = {"and", "or", "xor", "shl", "ashr"}


class Operations(Writer):
    """Compiles operations; their operands are compiled in expressions.py."""

    value: Callable[[ast.expr], Value]

    def condition(self, node: ast.expr) -> Value:
        """The truth value of an expression."""
        value = self._both(node, True) if isinstance(node, ast.BoolOp) else self.value(node)
        if value.type not in (BOOL, INT, FLOAT):
            self.refuse(node, f"a {name_of(value.type)} is a condition", "compare numbers")
        return self.cast(node, value, BOOL)

    def _UnaryOp(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            value = self.condition(node.operand)
            if value.constant is not None:
                return constant(not value.constant)  # type: ignore[return-value]
            return Value(BOOL, (self.new(f"xor i1 {value.word}, true"),))
        value = self.value(node.operand)
        if value.type not in NUMBERS or isinstance(node.op, ast.Invert):
            self.refuse(node, f"no such operation on a {name_of(value.type)}", "take numbers")
        if isinstance(node.op, ast.UAdd):
            return value
        if value.constant is not None:
            return constant(-value.constant)  # type: ignore[return-value]
        if value.type in (FLOAT, COMPLEX):
            words = tuple(self.new(f"fneg double {x}") for x in value.words)
            return Value(value.type, words)
        return Value(INT, (self.new(f"sub nsw i64 0, {self.cast(node, value, INT).word}"),))

    def _BinOp(self, node: ast.BinOp) -> Value:
        return self.operation(node, node.op, self.value(node.left), self.value(node.right))

    def operation(self, node: Any, op: ast.operator, a: Value, b: Value) -> Value:
        """An operation of two numbers."""
        if type(op) not in OPERATORS or a.type not in NUMBERS or b.type not in NUMBERS:
            self.refuse(node, f"no {type(op).__name__} of a {name_of(a.type)} and a "
                        f"{name_of(b.type)}", "take numbers, one by one")  # fmt: skip
        name, python = OPERATORS[type(op)]
        type_ = wider(a.type, b.type)
        if a.constant is not None and b.constant is not None and type_ != COMPLEX:
            try:
                return self._known_number(node, python(a.constant, b.constant))
            except (ArithmeticError, TypeError, ValueError) as error:
                if isinstance(error, CompileError):
                    raise
                self.refuse(node, str(error), "change the constants")
        if name == "pow":
            return self._power(node, a, b)
        if name in LOGIC:
            if type_ not in (BOOL, INT):
                self.refuse(node, f"bits of a {name_of(type_)}", "take whole numbers")
            type_ = BOOL if type_ == BOOL and name in ("and", "or", "xor") else INT
            a, b = self.cast(node, a, type_), self.cast(node, b, type_)
            return Value(type_, (self.new(f"{name} {type_.words[0]} {a.word}, {b.word}"),))
        if name == "div":
            type_ = wider(type_, FLOAT)
        if type_ == BOOL:
            type_ = INT
        a, b = self.cast(node, a, type_), self.cast(node, b, type_)
        if type_ == INT:
            return self._integers(name, a, b)
        if name in ("floordiv", "mod"):
            self.refuse(node, "// or % of floats", "take whole numbers, int(x)")
        if type_ == COMPLEX:
            return self._complex(name, a, b)
        return Value(FLOAT, (self.new(f"f{name} double {a.word}, {b.word}"),))

    def _known_number(self, node: Any, number: Any) -> Value:
        value = constant(number)
        if value is None:
            self.refuse(node, "a constant of more than 64 bits", "take a smaller one")
        return value

    def _complex(self, name: str, a: Value, b: Value) -> Value:
        """An operation of complex numbers, with the rounding of numpy."""
        if name == "mul":
            return complex_product(self, a, b)
        if name == "div":
            return complex_quotient(self, a, b)
        pairs = zip(a.words, b.words, strict=True)
        return Value(COMPLEX, tuple(self.new(f"f{name} double {x}, {y}") for x, y in pairs))

    def _integers(self, name: str, a: Value, b: Value) -> Value:
        if name in ("add", "sub", "mul"):
            return Value(INT, (self.new(f"{name} nsw i64 {a.word}, {b.word}"),))
        quotient = self.new(f"sdiv i64 {a.word}, {b.word}")
        rest = self.new(f"srem i64 {a.word}, {b.word}")
        some = self.new(f"icmp ne i64 {rest}, 0")
        signs = self.new(f"xor i64 {rest}, {b.word}")
        below = self.new(f"icmp slt i64 {signs}, 0")
        off = self.new(f"and i1 {some}, {below}")  # Python rounds down, C towards zero
        is_mod = name == "mod"
        exact = rest if is_mod else quotient
        other = self.new(f"add i64 {rest}, {b.word}" if is_mod else f"sub i64 {quotient}, 1")
        return Value(INT, (self.new(f"select i1 {off}, i64 {other}, i64 {exact}"),))

    def _power(self, node: Any, a: Value, b: Value) -> Value:
        """``pow`` of the C library, as in plain Python."""
        if COMPLEX in (a.type, b.type):
            self.refuse(node, "a power of complex numbers", "multiply")
        if FLOAT not in (a.type, b.type):
            self.refuse(node, "an integer to an integer power", "multiply, or take a float")
        return WORDS["pow"](self, node, [a, b])

    def comparison(self, node: Any, op: ast.cmpop, a: Value, b: Value) -> Value:
        """One comparison."""
        if isinstance(op, (ast.Is, ast.IsNot)):
            if NOTHING not in (a.type, b.type):
                self.refuse(node, "is compares more than None", "write ==")
            return constant((a.type == b.type) == isinstance(op, ast.Is))  # type: ignore[return-value]
        if isinstance(op, (ast.In, ast.NotIn)) and isinstance(b.type, Tuple):
            found = constant(False)
            for item in items_of(b):
                same = self.comparison(node, ast.Eq(), a, item)
                found = self.operation(node, ast.BitOr(), found, same)  # type: ignore[arg-type]
            if isinstance(op, ast.NotIn):
                found = self.operation(node, ast.BitXor(), found, constant(True))  # type: ignore[arg-type]
            return found  # type: ignore[return-value]
        if type(op) not in COMPARISONS or a.type not in NUMBERS or b.type not in NUMBERS:
            self.refuse(node, f"no {type(op).__name__} of a {name_of(a.type)} and a "
                        f"{name_of(b.type)}", "compare numbers, one by one")  # fmt: skip
        real, whole, python = COMPARISONS[type(op)]
        if a.constant is not None and b.constant is not None:
            return constant(bool(python(a.constant, b.constant)))  # type: ignore[return-value]
        type_ = wider(wider(a.type, b.type), INT)
        a, b = self.cast(node, a, type_), self.cast(node, b, type_)
        if type_ == COMPLEX:
            if real not in ("oeq", "une"):
                self.refuse(node, "an order of complex numbers", "compare their parts")
            parts = [self.new(f"fcmp {real} double {x}, {y}")
                     for x, y in zip(a.words, b.words, strict=True)]  # fmt: skip
            join = "and" if real == "oeq" else "or"
            return Value(BOOL, (self.new(f"{join} i1 {parts[0]}, {parts[1]}"),))
        text = f"icmp {whole} i64" if type_ == INT else f"fcmp {real} double"
        return Value(BOOL, (self.new(f"{text} {a.word}, {b.word}"),))

    def _Compare(self, node: ast.Compare) -> Value:
        values = [self.value(node.left), *(self.value(c) for c in node.comparators)]
        found: Value | None = None
        for op, a, b in zip(node.ops, values[:-1], values[1:], strict=True):
            part = self.comparison(node, op, a, b)
            found = part if found is None else self.operation(node, ast.BitAnd(), found, part)
        assert found is not None
        return found

    def _BoolOp(self, node: ast.BoolOp) -> Value:
        return self._both(node, False)

    def _both(self, node: ast.BoolOp, is_condition: bool) -> Value:
        """``and`` or ``or``; operands may be numbers where only their truth is used."""
        decides = isinstance(node.op, ast.Or)
        slots, end = self.place(BOOL, "both"), self.label()
        values = []
        for k, part in enumerate(node.values):
            value = self.condition(part) if is_condition else self.value(part)
            if value.type != BOOL:
                self.refuse(part, f"and, or of a {name_of(value.type)}", "compare it: x != 0")
            values.append(value)
            self.write_to(slots, value)
            if value.constant == decides or k == len(node.values) - 1:
                break
            if value.constant is None:
                more = self.label()
                self.branch(value, *((end, more) if decides else (more, end)))
                self.start(more)
        self.jump(end)
        self.start(end)
        if all(v.constant is not None for v in values):
            return values[-1]
        return self.read_from(slots, BOOL)

    def _IfExp(self, node: ast.IfExp) -> Value:
        test = self.condition(node.test)
        if test.constant is not None:
            return self.value(node.body if test.constant else node.orelse)
        one, other, end = self.label(), self.label(), self.label()
        self.branch(test, one, other)
        whole, parts, values = self.lines, [], []
        for label, part in ((one, node.body), (other, node.orelse)):
            self.lines = []
            self.start(label)
            values.append(self.value(part))
            parts.append(self.lines)
        type_ = wider(values[0].type, values[1].type)
        if type_ is None:
            self.lines = whole
            self.refuse(node, f"a {name_of(values[0].type)} or a {name_of(values[1].type)}",
                        "let both be of one type")  # fmt: skip
        slots = self.place(type_, "either")
        for lines, value in zip(parts, values, strict=True):
            self.lines = lines
            self.write_to(slots, self.cast(node, value, type_))
            self.line(f"br label %{end}")
        self.lines = [*whole, *parts[0], *parts[1]]
        self.start(end)
        return self.read_from(slots, type_)
