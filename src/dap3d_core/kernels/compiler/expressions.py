"""Expressions of the typed subset of Python to LLVM IR: names, operations, arrays, calls."""

import ast
import builtins
import inspect
import types
from collections.abc import Callable, Hashable, Sequence
from functools import lru_cache, partial
from typing import Any

from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.intrinsics import FORMS, KNOWN
from dap3d_core.kernels.compiler.writer import Writer

#: Remedies for what is outside the subset.
INSTEAD = {
    kind: remedy
    for kinds, remedy in {
        "ListComp": "loop over a range, and write into an array",
        "GeneratorExp SetComp DictComp": "loop over a range",
        "List": "pass an array, or a tuple",
        "Dict Set": "pass arrays",
        "Lambda": "put a function at the top of the module",
        "JoinedStr": "format texts in Python",
        "NamedExpr": "assign in a line of its own",
        "Yield": "write into an array",
        "Await": "compiled code waits for nothing",
        "Starred": "name each argument",
        "AnnAssign": "assign without an annotation",
        "With": "open nothing in compiled code",
        "Try": "test before, and return a number that says what went wrong",
        "Raise Assert": "return a number that says what went wrong",
        "FunctionDef": "put the function at the top of its module",
        "ClassDef": "put the class at the top of its module",
        "Import ImportFrom": "import at the top of the module",
        "Global Nonlocal": "pass an array that is written to",
        "Delete": "leave the name as it is",
        "Match": "write if and elif",
    }.items()
    for kind in kinds.split()
}


class Expressions(Writer):
    """Compiles the expressions of a function; statements are in functions.py."""

    def compile_node(self, node: ast.AST) -> Any:
        """Compile a node of the syntax tree by the method that is named after its type."""
        kind = type(node).__name__
        method = getattr(self, f"_{kind}", None)
        if method is None:
            self.refuse(node, f"{kind} is not part of compiled code",
                        INSTEAD.get(kind, "see docs/concepts/compiled-python.md"))  # fmt: skip
        return method(node)

    #: The value of an expression.
    value = compile_node

    def _Constant(self, node: ast.Constant) -> t.Value:
        value = t.constant(node.value)
        if value is None:
            self.refuse(node, f"{node.value!r} is no real number of 64 bits", "take numbers")
        return value

    def _Tuple(self, node: ast.Tuple) -> t.Value:
        return t.group([self.value(item) for item in node.elts])

    # ------------------------------------------------------------------ names

    def _Name(self, node: ast.Name) -> t.Value:
        name = node.id
        argument = self.arguments.get(name)
        if isinstance(argument, t.Known) and name not in self.stored:
            return self._known(node, name, argument.value)
        if name in self.constants:
            return self.constants[name]
        if name in self.variables:
            return self.load(name)
        if name in self.stored:
            self.refuse(node, f"{name} has no value yet", "assign one on every path")
        for names in (self.function.__globals__, vars(builtins)):
            if name in names:
                return self._known(node, name, names[name])
        self.refuse(node, f"{name} is not defined", "define or import it")

    def _known(self, node: ast.AST, name: str, value: Any) -> t.Value:
        number = t.constant(value)
        if number is not None:
            return number
        if callable(value) or isinstance(value, types.ModuleType):
            return t.Value(t.Known(value))
        self.refuse(node, f"{name} is a {type(value).__name__} of the module",
                    "pass it as an argument")  # fmt: skip

    def _Attribute(self, node: ast.Attribute) -> t.Value:
        value, name = self.value(node.value), node.attr
        type_ = value.type
        if isinstance(type_, t.Known) and isinstance(type_.value, types.ModuleType):
            if hasattr(type_.value, name):
                return self._known(node, name, getattr(type_.value, name))
        elif isinstance(type_, t.Array) and name == "shape":
            return t.group([t.Value(t.INT, (w,)) for w in value.words[1:]])
        elif isinstance(type_, t.Array) and name == "size":
            return t.Value(t.INT, (self.count_of(value.words[1:]),))
        elif isinstance(type_, t.Struct):
            if name in value.type.scalars:
                return self.read_from(*self._scalar(node, value, name))
            return self._member(node, value, name)
        elif type_ in (t.FLOAT, t.COMPLEX) and name in ("real", "imag"):
            words = (*value.words, t.bits(0.0))
            return t.Value(t.FLOAT, (words[name == "imag"],))
        self.refuse(node, f"a {t.name_of(type_)} has no {name} here",
                    "arrays have shape and size, structs their members")  # fmt: skip

    def _member(self, node: ast.Attribute, value: t.Value, name: str) -> t.Value:
        first = 0
        for member, type_ in value.type.members:
            if member == name:
                break
            first += len(type_.words)
        else:
            names = ", ".join([*dict(value.type.members), *value.type.scalars])
            self.refuse(node, f"{value.type.name} has no member {name}", f"it has {names}")
        words = []
        for k, word in enumerate(type_.words):
            at = self.new(f"getelementptr inbounds i64, ptr {value.word}, i64 {first + k}")
            words.append(self.new(f"load {word}, ptr {at}, align 8, !invariant.load !0"))
        return t.Value(type_, tuple(words))

    # ------------------------------------------------------------------ operations

    def _UnaryOp(self, node: ast.UnaryOp) -> t.Value:
        if isinstance(node.op, ast.Not):
            return self.negation(self.condition(node.operand))
        value = self.value(node.operand)
        if value.type not in t.NUMBERS or not isinstance(node.op, ast.USub):
            self.refuse(node, f"no {type(node.op).__name__} of a {t.name_of(value.type)}",
                        "take numbers")  # fmt: skip
        return self.negative(node, value)

    def _BinOp(self, node: ast.BinOp) -> t.Value:
        return self.operation(node, node.op, self.value(node.left), self.value(node.right))

    def _Compare(self, node: ast.Compare) -> t.Value:
        values = [self.value(node.left), *(self.value(c) for c in node.comparators)]
        result = None
        for op, a, b in zip(node.ops, values[:-1], values[1:], strict=True):
            part = self.comparison(node, op, a, b)
            result = part if result is None else self.operation(node, ast.BitAnd(), result, part)
        return result

    def condition(self, node: ast.expr) -> t.Value:
        """The truth value of an expression."""
        value = (
            self._chain(node, self.condition) if isinstance(node, ast.BoolOp) else self.value(node)
        )
        if value.type not in (t.BOOL, t.INT):
            self.refuse(node, f"a {t.name_of(value.type)} is a condition", "compare numbers")
        return self.cast(node, value, t.BOOL)

    def _BoolOp(self, node: ast.BoolOp) -> t.Value:
        return self._chain(node, self.value)

    def _chain(self, node: ast.BoolOp, read: Callable[[ast.expr], t.Value], k: int = 0) -> t.Value:
        """``and`` or ``or`` of the parts from the k-th one, each read by a function."""
        part, is_last = node.values[k], k == len(node.values) - 1
        value, decides = read(part), isinstance(node.op, ast.Or)
        if value.type != t.BOOL:
            self.refuse(part, f"and, or of a {t.name_of(value.type)}", "compare it: x != 0")
        if is_last or value.constant == decides:
            return value
        if value.constant is not None:
            return self._chain(node, read, k + 1)
        name = f"both.{self.label()}"  # no name of Python's
        self.store(part, name, value)
        self.fork(self.negation(value) if decides else value,
                  lambda: self.store(part, name, self._chain(node, read, k + 1)))  # fmt: skip
        return self.load(name)

    def _IfExp(self, node: ast.IfExp) -> t.Value:
        test = self.condition(node.test)
        if test.constant is not None:
            return self.value(node.body if test.constant else node.orelse)
        values, ends = [], []

        def arm(part: ast.expr) -> None:
            values.append(self.value(part))
            ends.append(len(self.lines))

        self.fork(test, partial(arm, node.body), partial(arm, node.orelse))
        one, other = (value.type for value in values)
        type_ = one if one == other else t.wider(one, other)
        if type_ is None:
            self.refuse(node, f"a {t.name_of(one)} or a {t.name_of(other)}",
                        "let both be of one type")  # fmt: skip
        slots = self.place(type_, "either")
        for value, end in reversed(list(zip(values, ends, strict=True))):
            self.lines, behind = self.lines[:end], self.lines[end:]
            self.write_to(slots, self.cast(node, value, type_))
            self.lines += behind
        return self.read_from(slots, type_)

    # ------------------------------------------------------------------ arrays

    def count_of(self, lengths: Sequence[str]) -> str:
        """The product of lengths."""
        count = lengths[0] if lengths else "1"
        for length in lengths[1:]:
            count = self.new(f"mul nsw i64 {count}, {length}")
        return count

    def index(self, node: ast.expr, length: str) -> str:
        """The word of an index; a negative constant counts from the end."""
        index = self.whole(node, self.value(node))
        if index.constant is not None and index.constant < 0:
            return self.new(f"add nsw i64 {length}, {index.constant}")
        return index.word

    def address(self, array: t.Value, places: Sequence[ast.expr]) -> str:
        """Address of the part of an array that leading indices select."""
        at = "0"
        for k, length in enumerate(array.words[1:]):
            if k > 0 and at != "0":
                at = self.new(f"mul nsw i64 {at}, {length}")
            if k < len(places):
                index = self.index(places[k], length)
                at = self.new(f"add nsw i64 {at}, {index}") if at != "0" else index
        return self.item(array, at)

    def item(self, array: t.Value, k: str) -> str:
        """Address of the k-th item of an array."""
        item = array.type.item.words
        kind = f"[{len(item)} x {item[0]}]" if len(item) > 1 else item[0]
        return self.new(f"getelementptr inbounds {kind}, ptr {array.word}, i64 {k}")

    def slots_at(self, address: str, item: Any) -> list[str]:
        """Addresses of the words of an item."""
        step = f"getelementptr inbounds {item.words[0]}, ptr {address}, i64"
        return [address, *(self.new(f"{step} {k}") for k in range(1, len(item.words)))]

    def _scalar(self, node: ast.Attribute, struct: t.Value, name: str) -> tuple[list[str], Any]:
        member, k = struct.type.scalars[name]
        array = self._member(node, struct, member)
        return self.slots_at(self.item(array, str(k)), array.type.item), array.type.item

    def number_at(self, node: ast.expr) -> tuple[list[str], Any]:
        """Addresses of the words, and type, of a number that is to be changed."""
        if isinstance(node, ast.Attribute):
            struct = self.value(node.value)
            if node.attr not in getattr(struct.type, "scalars", ()):
                self.refuse(node, f"{node.attr} of a {t.name_of(struct.type)} is given a value",
                            "only arrays and scalars of structs change")  # fmt: skip
            return self._scalar(node, struct, node.attr)
        if not isinstance(node, ast.Subscript):
            self.refuse(node, "a value is given to what is no name and no number",
                        "only names, arrays and scalars of structs change")  # fmt: skip
        array, places = self.value(node.value), _parts(node.slice)
        if not isinstance(array.type, t.Array):
            self.refuse(node, f"a {t.name_of(array.type)} is written into", "only arrays change")
        if len(places) != array.type.ndim or any(isinstance(p, ast.Slice) for p in places):
            self.refuse(node, "more than one number is written at once", "write a loop")
        return self.slots_at(self.address(array, places), array.type.item), array.type.item

    def _Subscript(self, node: ast.Subscript) -> t.Value:
        value, places = self.value(node.value), _parts(node.slice)
        type_ = value.type
        if isinstance(type_, t.Tuple):
            return self._tuple_item(node, value)
        if isinstance(type_, t.Table):
            k = self.whole(node.slice, self.value(node.slice)).word
            at = self.new(f"getelementptr inbounds i64, ptr {value.word}, i64 {k}")
            return t.Value(t.Pointer(type_.signature), (self.new(f"load ptr, ptr {at}"),))
        if not isinstance(type_, t.Array) or len(places) > type_.ndim:
            self.refuse(node, f"a {t.name_of(type_)} has no such index", "index arrays and tuples")
        if isinstance(node.slice, ast.Slice):
            return self._slice(node.slice, value)
        if any(isinstance(p, ast.Slice) for p in places):
            self.refuse(node, "a slice that is not of whole rows", "write a loop")
        at = self.address(value, places)
        if len(places) < type_.ndim:
            shape = value.words[1 + len(places) :]
            return t.Value(t.Array(type_.item, type_.ndim - len(places)), (at, *shape))
        return self.read_from(self.slots_at(at, type_.item), type_.item)

    def _tuple_item(self, node: ast.Subscript, value: t.Value) -> t.Value:
        k, items = self.value(node.slice).constant, t.items_of(value)
        if not isinstance(k, int) or not -len(items) <= k < len(items):
            self.refuse(node, f"the index of a tuple of {len(items)} is no constant within it",
                        "unpack it, or take an array")  # fmt: skip
        return items[k]

    def _slice(self, node: ast.Slice, array: t.Value) -> t.Value:
        """Rows of an array; upper bounds are limited to its length, as in Python."""
        if node.step is not None:
            self.refuse(node.step, "a slice with a step", "write a loop")
        _, length, *inner = array.words

        def bound(given: ast.expr | None, default: str) -> str:
            if given is None:
                return default
            k = self.index(given, length)
            is_inside = self.new(f"icmp slt i64 {k}, {length}")
            return self.new(f"select i1 {is_inside}, i64 {k}, i64 {length}")

        first, last = bound(node.lower, "0"), bound(node.upper, length)
        at = self.item(array, self.count_of([first, *inner]))
        return t.Value(array.type, (at, self.new(f"sub nsw i64 {last}, {first}"), *inner))

    # ------------------------------------------------------------------ calls

    def _Call(self, node: ast.Call) -> t.Value:
        called = self.value(node.func)
        if isinstance(called.type, t.Pointer):
            return self._call_pointer(node, called)
        if not isinstance(called.type, t.Known):
            self.refuse(node, f"a {t.name_of(called.type)} is called", "call functions")
        function = called.type.value
        if node.keywords:
            self.refuse(node, "a call with names", "give arguments by position")
        arguments = [self.value(a) for a in node.args]
        name = KNOWN.get(function) if isinstance(function, Hashable) else None
        name = name or getattr(function, "intrinsic", None)
        if name is not None:
            return FORMS[name](self, node, arguments)
        plain = inspect.unwrap(function)
        if not isinstance(plain, types.FunctionType) or plain.__module__ in ("numpy", "math"):
            name = getattr(function, "__qualname__", repr(function))
            self.refuse(node, f"{name} is not known to compiled code",
                        "call a function of the subset, or one that it names")  # fmt: skip
        return self._call_function(node, function, arguments)

    def _call_function(self, node: ast.Call, function: Any, arguments: list[t.Value]) -> t.Value:
        name, signature = inspect.unwrap(function).__qualname__, _signature(function)
        try:
            given = signature.bind(*arguments)
        except TypeError as error:
            self.refuse(node, f"{name} is not called as it is defined: {error}",
                        f"it takes {', '.join(signature.parameters)}")  # fmt: skip
        given.apply_defaults()
        types_, words = [], []
        for parameter, value in given.arguments.items():
            if not isinstance(value, t.Value):
                value = self._known(node, parameter, value)
            if getattr(function, "is_inlined", False) and value.constant is not None:
                types_.append(t.Known(value.constant))
                continue
            types_.append(value.type)
            words += [f"{w} {x}" for w, x in zip(value.type.words, value.words, strict=True)]
        done = self.program.function(function, types_)
        if done is None:
            self.refuse(node, f"{name} calls itself", "write a loop")
        return self._result_of(f"@{done[0]}", done[1], words)

    def _call_pointer(self, node: ast.Call, called: t.Value) -> t.Value:
        """A call of a function from a table."""
        wanted = called.type.signature.arguments
        if node.keywords or len(node.args) != len(wanted):
            self.refuse(node, f"{len(node.args)} arguments for a function of {len(wanted)}",
                        "give each by its position")  # fmt: skip
        words = []
        for part, type_ in zip(node.args, wanted, strict=True):
            value = self.cast(part, self.value(part), type_)
            words += [f"{w} {x}" for w, x in zip(type_.words, value.words, strict=True)]
        return self._result_of(called.word, called.type.signature.result, words)

    def _result_of(self, name: str, result: Any, words: Sequence[str]) -> t.Value:
        """Emit a call; returns its result."""
        type_, count = t.result_type(result), len(result.words)
        call = f"call {type_} {name}({', '.join(words)})"
        if count == 0:
            self.line(call)
            return t.Value(result)
        whole = self.new(call)
        if count == 1:
            return t.Value(result, (whole,))
        parts = (self.new(f"extractvalue {type_} {whole}, {k}") for k in range(count))
        return t.Value(result, tuple(parts))


#: Parameters of functions, most of which are called more than once; scenes make some of their own.
_signature = lru_cache(maxsize=4096)(inspect.signature)


def _parts(node: ast.expr) -> list[ast.expr]:
    """The indices in brackets."""
    return list(node.elts) if isinstance(node, ast.Tuple) else [node]
