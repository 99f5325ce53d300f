"""Building blocks of the compiler: syntax trees, instructions, blocks, stack slots, casts."""

import ast
import contextlib
import linecache
from collections.abc import Callable
from functools import cache
from typing import Any, NoReturn

from dap3d_core.kernels.compiler.types import (
    BOOL,
    COMPLEX,
    FLOAT,
    INT,
    NUMBERS,
    Array,
    CompileError,
    Known,
    Numbers,
    Pointer,
    Struct,
    Tuple,
    Value,
    bits,
    constant,
    group,
    items_of,
    wider,
)


@cache
def _definitions(file: str, everywhere: bool) -> dict[int, ast.FunctionDef]:
    """Functions of a file by their first line, decorators included."""
    tree = ast.parse("".join(linecache.getlines(file)))
    nodes = ast.walk(tree) if everywhere else tree.body
    found = (node for node in nodes if isinstance(node, ast.FunctionDef))
    return {min([d.lineno for d in node.decorator_list] + [node.lineno]): node for node in found}


@cache
def stored_names(node: ast.FunctionDef) -> set[str]:
    """Names that a function assigns to."""
    names = (n for n in ast.walk(node) if isinstance(n, ast.Name))
    return {n.id for n in names if isinstance(n.ctx, ast.Store)}


def definition(function: Callable[..., Any]) -> ast.FunctionDef:
    """The syntax tree of a function.

    Raises:
        CompileError: its source is not available.
    """
    code = function.__code__
    with contextlib.suppress(SyntaxError):
        for everywhere in (False, True):
            if found := _definitions(code.co_filename, everywhere).get(code.co_firstlineno):
                return found
    raise CompileError(
        f"the source of {function.__qualname__} cannot be read; put it into a file, as def "
        f"[{code.co_filename}:{code.co_firstlineno}]"
    )


def result_type(type_: Any) -> str:
    """LLVM type of a result."""
    words: tuple[str, ...] = type_.words
    if len(words) > 1:
        return f"{{{', '.join(words)}}}"
    return words[0] if words else "void"


def name_of(type_: Any) -> str:
    """Description of a type for messages."""
    if isinstance(type_, Array):
        return f"array of {type_.item.name}s with {type_.ndim} indices"
    if isinstance(type_, Known):
        return "function" if callable(type_.value) else "module"
    return str(getattr(type_, "name", type(type_).__name__.lower()))


class Writer:
    """Writes the instructions of one function."""

    function: Callable[..., Any]
    lines: list[str]
    places: list[str]
    count: int
    is_dead: bool

    def refuse(self, node: Any, why: str, remedy: str) -> NoReturn:
        """Raise a CompileError: what is wrong, what to write instead, file and line."""
        where = f"{self.function.__code__.co_filename}:{node.lineno}"
        raise CompileError(f"{self.function.__qualname__}: {why}; {remedy} [{where}]")

    def compile_node(self, node: ast.AST, noun: str, remedies: dict[str, str]) -> Any:
        """Compile a node of the syntax tree by the method that is named after its type."""
        kind = type(node).__name__
        method = getattr(self, f"_{kind}", None)
        if method is None:
            self.refuse(node, f"{kind} is no {noun} of compiled code",
                        remedies.get(kind, "see docs/concepts/compiled-python.md"))  # fmt: skip
        return method(node)

    def line(self, text: str) -> None:
        """Add an instruction."""
        self.lines.append(f"  {text}")

    def new(self, text: str) -> str:
        """Add an instruction with a result; returns the name of the result."""
        self.count += 1
        self.lines.append(f"  %t{self.count} = {text}")
        return f"%t{self.count}"

    def label(self) -> str:
        """A new block label."""
        self.count += 1
        return f"L{self.count}"

    # ------------------------------------------------------------------ from one type to another

    def cast(self, node: Any, value: Value, type_: Any) -> Value:
        """A value converted to another type."""
        have = value.type
        if have == type_:
            return value
        if type_ in NUMBERS and have in NUMBERS:
            return self._number(node, value, type_)
        if isinstance(type_, Tuple) and wider(have, type_) == type_:
            pairs = zip(items_of(value), type_.items, strict=True)
            return group([self.cast(node, item, t) for item, t in pairs])
        if isinstance(have, Struct) and have.begins_with(type_):
            return Value(type_, value.words)
        if isinstance(type_, Numbers) and isinstance(have, Array):
            return Value(type_, value.words[:1])
        if isinstance(type_, Pointer) and isinstance(have, Pointer):
            return value
        self.refuse(node, f"a {name_of(have)} stands where a {name_of(type_)} must be",
                    "hand on what the function takes")  # fmt: skip

    def _number(self, node: Any, value: Value, type_: Any) -> Value:
        have, c = value.type, value.constant
        if c is not None and type_ != COMPLEX and have != COMPLEX:
            known = constant({BOOL: bool, INT: int, FLOAT: float}[type_](c))
            assert known is not None
            return known
        if type_ == COMPLEX:
            return Value(COMPLEX, (self.cast(node, value, FLOAT).word, bits(0.0)))
        if have == COMPLEX:
            self.refuse(node, "a complex number stands where a real one must be", "take .real")
        x = value.word
        text = {
            (INT, FLOAT): f"sitofp i64 {x} to double",
            (BOOL, FLOAT): f"uitofp i1 {x} to double",
            (BOOL, INT): f"zext i1 {x} to i64",
            (FLOAT, INT): f"fptosi double {x} to i64",
            (INT, BOOL): f"icmp ne i64 {x}, 0",
            (FLOAT, BOOL): f"fcmp une double {x}, 0.0",
        }[have, type_]
        return Value(type_, (self.new(text),))

    def integer(self, node: Any, value: Value) -> Value:
        """A value that must be an integer."""
        if value.type not in (INT, BOOL):
            self.refuse(node, f"a {name_of(value.type)} counts or is an index",
                        "take a whole number, int(x)")  # fmt: skip
        return self.cast(node, value, INT)

    # ------------------------------------------------------------------ blocks

    def start(self, label: str) -> None:
        """Begin a block."""
        self.lines.append(f"{label}:")
        self.is_dead = False

    def jump(self, label: str) -> None:
        """End a block with a jump, unless it has ended."""
        if not self.is_dead:
            self.line(f"br label %{label}")
        self.is_dead = True

    def branch(self, condition: Value, one: str, other: str) -> None:
        """End a block with a conditional jump."""
        self.line(f"br i1 {condition.word}, label %{one}, label %{other}")

    # ------------------------------------------------------------------ variables

    def place(self, type_: Any, name: str) -> list[str]:
        """Stack slots for the words of a value, initialised to zero."""
        found = []
        for word in type_.words:
            self.count += 1
            slot = f"%{name}.{self.count}.s"
            zero = {"ptr": "null", "double": "0.0"}.get(word, "0")
            self.places += [f"  {slot} = alloca {word}", f"  store {word} {zero}, ptr {slot}"]
            found.append(slot)
        return found

    def write_to(self, slots: list[str], value: Value) -> None:
        """Store a value in stack slots."""
        for word, x, slot in zip(value.type.words, value.words, slots, strict=True):
            self.line(f"store {word} {x}, ptr {slot}")

    def read_from(self, slots: list[str], type_: Any) -> Value:
        """Load a value from stack slots."""
        pairs = zip(type_.words, slots, strict=True)
        return Value(type_, tuple(self.new(f"load {w}, ptr {s}") for w, s in pairs))
