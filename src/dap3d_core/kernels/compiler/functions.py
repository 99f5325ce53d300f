"""Functions of the typed subset of Python to LLVM IR: their types, variables and statements.

A function is compiled for the types of its arguments. A variable has the type of its first value.
Variables live in stack slots, which LLVM turns into registers. Results have the bits of plain
Python: nothing is contracted or reassociated.
"""

import ast
import contextlib
import inspect
import linecache
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any, NoReturn

from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.expressions import Expressions
from dap3d_core.kernels.syntax import parse


class Program:
    """A module of LLVM IR: each function once for each choice of argument types."""

    def __init__(self) -> None:
        self.text: list[str] = []
        #: Declarations of external functions by symbol.
        self.needs: dict[str, str] = {}
        self._done: dict[Any, tuple[str, Any] | None] = {}

    def function(self, function: Any, arguments: Sequence[Any]) -> tuple[str, Any] | None:
        """Name and result type of a function, compiled for types of its arguments.

        None while that very code is compiled: the function calls itself.
        """
        inlined = getattr(function, "is_inlined", False)
        function = inspect.unwrap(function)
        key = function, tuple(arguments)
        if key not in self._done:
            self._done[key] = None
            name = f"{function.__name__}.{len(self._done)}"
            compiler = FunctionCompiler(self, function, tuple(arguments))
            self._done[key] = name, compiler.result
            self.text.append(compiler.text(name, inlined))
        return self._done[key]

    def export(self, function: Any, arguments: Sequence[Any], symbol: str) -> t.Signature:
        """Export a function under a symbol."""
        name, result = self.function(function, arguments) or ("", t.NOTHING)
        words = ", ".join(f"{w} %a{k}" for k, w in enumerate(w for a in arguments for w in a.words))
        type_ = t.result_type(result)
        body = f"  call void @{name}({words})\n  ret void"
        if result.words:
            body = f"  %r = call {type_} @{name}({words})\n  ret {type_} %r"
        outside = f"{'zeroext ' if type_ == 'i1' else ''}{type_}"  # as C has it
        self.text.append(f"define {outside} @{symbol}({words}) nounwind {{\n{body}\n}}\n")
        return t.Signature(tuple(arguments), result)

    def module(self) -> str:
        """The text of the module."""
        return "\n".join([*self.needs.values(), *self.text, "!0 = !{}", ""])


class FunctionCompiler(Expressions):
    """Compiles one function for one choice of argument types."""

    def __init__(
        self, program: Program, function: Callable[..., Any], arguments: tuple[Any, ...]
    ) -> None:
        super().__init__(program.needs)
        self.program, self.function, self.node = program, function, definition(function)
        given = self.node.args
        if given.vararg or given.kwarg or given.kwonlyargs or given.posonlyargs:
            self.refuse(self.node, "takes more than plain arguments", "name each of them")
        self.arguments = dict(zip([a.arg for a in given.args], arguments, strict=True))
        self.stored = stored_names(self.node)
        #: Type and stack slots of each variable.
        self.variables: dict[str, tuple[Any, list[str]]] = {}
        #: Names of loops over constants, which are constants in them.
        self.constants: dict[str, t.Value] = {}
        #: Labels to continue at, and behind, each enclosing loop.
        self.loops: list[tuple[str, str]] = []
        self.result: Any = None
        for name, type_ in self.arguments.items():
            if not isinstance(type_, t.Known):
                words = tuple(f"%{name}.{k}.a" for k in range(len(type_.words)))
                self.store(self.node, name, t.Value(type_, words))
        self.statements(self.node.body)
        if not self.is_dead:
            if self.result not in (None, t.NOTHING):
                self.refuse(self.node, "may end without a result", "return a result on every path")
            self.result = t.NOTHING
            self.line("ret void")

    def refuse(self, node: ast.AST, why: str, remedy: str) -> NoReturn:
        """Raise a CompileError: what is wrong, what to write instead, file and line."""
        where = f"{self.function.__code__.co_filename}:{node.lineno}"
        raise t.CompileError(f"{self.function.__qualname__}: {why}; {remedy} [{where}]")

    def text(self, name: str, inlined: bool) -> str:
        """The text of the function."""
        separate = {a.arg for a in self.node.args.args
                    if getattr(a.annotation, "id", "") == "SeparateFloats"}  # fmt: skip
        head = ", ".join(f"{w}{' noalias' * (n in separate and w == 'ptr')} %{n}.{k}.a"
                         for n, type_ in self.arguments.items()
                         for k, w in enumerate(type_.words))  # fmt: skip
        attributes = "nounwind inlinehint" if inlined else "nounwind"
        lines = "\n".join(["entry:", *self.places, *self.lines])
        type_ = t.result_type(self.result)
        return f"define internal {type_} @{name}({head}) {attributes} {{\n{lines}\n}}\n"

    def store(self, node: ast.AST, name: str, value: t.Value) -> None:
        """Assign a value to a variable, which has the type of its first one."""
        if name not in self.variables:
            self.variables[name] = value.type, self.place(value.type, name)
        type_, slots = self.variables[name]
        if type_ != value.type:
            self.refuse(node, f"{name} holds a {t.name_of(type_)} and a {t.name_of(value.type)}",
                        "take two names, or convert one")  # fmt: skip
        self.write_to(slots, value)

    def load(self, name: str) -> t.Value:
        """The value of a variable."""
        type_, slots = self.variables[name]
        return self.read_from(slots, type_)

    # ------------------------------------------------------------------ statements

    def statements(self, nodes: Sequence[ast.stmt]) -> None:
        """Compile statements, up to the first that ends the block."""
        for node in nodes:
            if self.is_dead:
                return
            self.compile_node(node)

    def _Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Constant):  # a docstring
            return
        self.value(node.value)
        if not isinstance(node.value, ast.Call):
            self.refuse(node, "an expression that does nothing", "give it a name or remove it")

    def _Pass(self, node: ast.Pass) -> None:
        pass

    def _Return(self, node: ast.Return) -> None:
        value = t.Value(t.NOTHING) if node.value is None else self.value(node.value)
        self.result = self.result or value.type
        if self.result != value.type:
            self.refuse(node, "returns values of several types", "return one type")
        type_, whole = t.result_type(self.result), "".join(value.words)
        if len(value.words) > 1:
            whole = "undef"
            for k, (kind, word) in enumerate(zip(self.result.words, value.words, strict=True)):
                whole = self.new(f"insertvalue {type_} {whole}, {kind} {word}, {k}")
        self.line(f"ret {type_} {whole}".rstrip())
        self.is_dead = True

    def _Assign(self, node: ast.Assign) -> None:
        value = self.value(node.value)
        for target in node.targets:
            self._assign(target, value)

    def _assign(self, target: ast.expr, value: t.Value) -> None:
        if isinstance(target, ast.Name):
            self.store(target, target.id, value)
        elif isinstance(target, ast.Tuple):
            if not isinstance(value.type, t.Tuple) or len(value.type.items) != len(target.elts):
                self.refuse(target, f"unpacks {len(target.elts)} values that are not there",
                            "give it a tuple of as many")  # fmt: skip
            for part, item in zip(target.elts, t.items_of(value), strict=True):
                self._assign(part, item)
        else:
            slots, item = self.number_at(target)
            self.write_to(slots, self.cast(target, value, item))

    def _AugAssign(self, node: ast.AugAssign) -> None:
        target = node.target
        if isinstance(target, ast.Name):
            before = self._Name(target)
            after = self.operation(node, node.op, before, self.value(node.value))
            self.store(node, target.id, after)
            return
        slots, item = self.number_at(target)
        before = self.read_from(slots, item)
        after = self.operation(node, node.op, before, self.value(node.value))
        self.write_to(slots, self.cast(node, after, item))

    def _If(self, node: ast.If) -> None:
        test = self.condition(node.test)
        if test.constant is not None:
            self.statements(node.body if test.constant else node.orelse)
            return
        self.fork(test, partial(self.statements, node.body), partial(self.statements, node.orelse))

    def _While(self, node: ast.While) -> None:
        if node.orelse:
            self.refuse(node, "while with else", "set a number where the loop is left")
        head, body, end = self.label(), self.label(), self.label()
        self.jump(head)
        self.start(head)
        test = self.condition(node.test)
        self.branch(test, body, end)
        self.start(body)
        self._repeat(node, head, end)
        self.start(end)
        if test.constant and not any(isinstance(n, ast.Break) for n in ast.walk(node)):
            self.line("unreachable")
            self.is_dead = True

    def _repeat(self, node: ast.For | ast.While, again: str, end: str) -> None:
        """The body of a loop, and the jump behind it."""
        self.loops.append((again, end))
        self.statements(node.body)
        self.loops.pop()
        self.jump(again)

    def _Break(self, node: ast.Break) -> None:
        self.jump(self.loops[-1][1])

    def _Continue(self, node: ast.Continue) -> None:
        self.jump(self.loops[-1][0])

    def _For(self, node: ast.For) -> None:
        if node.orelse:
            self.refuse(node, "for with else", "set a number where the loop is left")
        if isinstance(node.iter, ast.Call) and getattr(node.iter.func, "id", "") == "range":
            self._count(node, node.iter)
            return
        over = self.value(node.iter)
        if not isinstance(over.type, t.Tuple):
            self.refuse(node, "a loop over what is no range", "write for k in range(...)")
        if any(isinstance(n, (ast.Break, ast.Continue)) for n in ast.walk(node)):
            self.refuse(node, "break or continue in a loop over a tuple", "loop over a range")
        items, names = t.items_of(over), stored_names(node.target)
        if not all(map(t.is_constant, items)) or names & self._stored_but_for(node.target):
            names = set()
        for item in items:
            if names:
                self.constants |= _named(node.target, item)
            else:
                self._assign(node.target, item)
            self.statements(node.body)
        for name in names:
            self.constants.pop(name, None)

    def _stored_but_for(self, target: ast.expr) -> set[str]:
        """Names that the function assigns to elsewhere than in the target of a loop."""
        here = {id(n) for n in ast.walk(target)}
        return {n.id for n in _stores(self.node) if id(n) not in here}

    def _count(self, node: ast.For, call: ast.Call) -> None:
        """``for k in range(...)``; assignments to k do not change the count."""
        given = [self.whole(a, self.value(a)) for a in call.args]
        first, last = (t.constant(0), given[0]) if len(given) == 1 else given[:2]
        step = given[2] if len(given) > 2 else t.constant(1)
        if not step.constant:
            self.refuse(node, "the step of a range is zero or no constant", "count in a while loop")
        counter = self.place(t.INT, "for")
        self.write_to(counter, first)
        head, body, again, end = (self.label() for _ in range(4))
        self.jump(head)
        self.start(head)
        k = self.read_from(counter, t.INT)
        order = ast.Lt() if step.constant > 0 else ast.Gt()
        self.branch(self.comparison(node, order, k, last), body, end)
        self.start(body)
        self._assign(node.target, k)
        self._repeat(node, again, end)
        self.start(again)
        k = self.read_from(counter, t.INT)
        self.write_to(counter, self.operation(node, ast.Add(), k, step))
        self.jump(head)
        self.start(end)


@cache
def _definitions(file: str, everywhere: bool) -> dict[int, ast.FunctionDef]:
    """Functions of a file by their first line, decorators included."""
    tree = parse("".join(linecache.getlines(file)))
    nodes = ast.walk(tree) if everywhere else tree.body
    found = (node for node in nodes if isinstance(node, ast.FunctionDef))
    return {min([d.lineno for d in node.decorator_list] + [node.lineno]): node for node in found}


def _named(target: ast.expr, value: t.Value) -> dict[str, t.Value]:
    """The parts of a value by the names that a loop gives them."""
    if isinstance(target, ast.Name):
        return {target.id: value}
    parts = zip(target.elts, t.items_of(value), strict=True)  # type: ignore[attr-defined]
    return {name: x for part, item in parts for name, x in _named(part, item).items()}


@cache
def _stores(node: ast.AST) -> list[ast.Name]:
    """Where a function, or a part of it, assigns to names; no expression of the subset does."""
    if isinstance(node, ast.expr):  # a target
        names = (n for n in ast.walk(node) if isinstance(n, ast.Name))
        return [n for n in names if isinstance(n.ctx, ast.Store)]
    targets = [*getattr(node, "targets", ()), *filter(None, [getattr(node, "target", None)])]
    blocks = *getattr(node, "body", ()), *getattr(node, "orelse", ())
    return [name for part in (*targets, *blocks) for name in _stores(part)]


def stored_names(node: ast.AST) -> set[str]:
    """Names that a function, or a part of it, assigns to."""
    return {n.id for n in _stores(node)}


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
    raise t.CompileError(
        f"the source of {function.__qualname__} cannot be read; put it into a file, as def "
        f"[{code.co_filename}:{code.co_firstlineno}]"
    )
