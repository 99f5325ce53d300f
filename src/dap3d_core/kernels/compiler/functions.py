"""Functions of the typed subset of Python to LLVM IR: their types, variables and statements.

A function is compiled for the types of its arguments. Types of variables are inferred by compiling
the function until none changes any more. Variables live in stack slots, which LLVM turns into
registers. Results have the bits of plain Python: nothing is contracted or reassociated.
"""

import ast
import contextlib
import inspect
import linecache
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.expressions import Expressions


class Program:
    """A module of LLVM IR: each function once for each choice of argument types."""

    def __init__(self) -> None:
        self.text: list[str] = []
        #: Declarations of external functions by symbol.
        self.needs: dict[str, str] = {}
        self._done: dict[Any, tuple[str, Any] | None] = {}

    def function(self, function: Any, arguments: Sequence[Any]) -> tuple[str, Any]:
        """Name and result type of a function, compiled for types of its arguments."""
        inlined = getattr(function, "is_inlined", False)
        function = inspect.unwrap(function)
        key = function, tuple(arguments)
        if key not in self._done:
            self._done[key] = None
            name = f"{function.__name__}.{len(self._done)}"
            compiler = FunctionCompiler(self, function, tuple(arguments), name)
            self._done[key] = name, compiler.result
            self.text.append(compiler.finished(inlined))
        done = self._done[key]
        if done is None:
            raise t.CompileError(f"{function.__qualname__} calls itself; write a loop")
        return done

    def export(self, function: Any, arguments: Sequence[Any], symbol: str) -> t.Signature:
        """Export a function under a symbol; booleans are integers in its arguments and result."""
        name, result = self.function(function, arguments)
        words = [(w, f"%a{k}") for k, w in enumerate(w for a in arguments for w in a.words)]
        outside = ", ".join(f"{'i64' if w == 'i1' else w} {x}" for w, x in words)
        lines = [f"  {x}.b = trunc i64 {x} to i1" for w, x in words if w == "i1"]
        inside = ", ".join(f"{w} {x}{'.b' if w == 'i1' else ''}" for w, x in words)
        returned = t.result_type(result)
        if returned == "i1":
            lines += [f"  %r = call i1 @{name}({inside})", "  %i = zext i1 %r to i64"]
            lines, returned = [*lines, "  ret i64 %i"], "i64"
        elif returned == "void":
            lines += [f"  call void @{name}({inside})", "  ret void"]
        else:
            lines += [f"  %r = call {returned} @{name}({inside})", f"  ret {returned} %r"]
        body = "\n".join(lines)
        self.text.append(f"define {returned} @{symbol}({outside}) nounwind {{\n{body}\n}}\n")
        return t.Signature(tuple(arguments), result)

    def module(self) -> str:
        """The text of the module."""
        return "\n".join([*self.needs.values(), *self.text, "!0 = !{}", ""])


class FunctionCompiler(Expressions):
    """Compiles one function for one choice of argument types."""

    def __init__(
        self,
        program: Program,
        function: Callable[..., Any],
        arguments: tuple[Any, ...],
        name: str,
    ) -> None:
        self.program, self.function, self.name = program, function, name
        self.node = definition(function)
        given = self.node.args
        if given.vararg or given.kwarg or given.kwonlyargs or given.posonlyargs:
            self.refuse(self.node, "takes more than plain arguments", "name each of them")
        self.arguments = dict(zip([a.arg for a in given.args], arguments, strict=True))
        self.stored = stored_names(self.node)
        self.types: dict[Any, Any] = {}
        self.changes: dict[ast.AST, set[str]] = {}
        self.result: Any = None
        for _ in range(10):
            self.is_settled = True
            self._compile()
            if self.is_settled:
                return
        self.refuse(self.node, "has variables whose types do not settle", "give each one type")

    def finished(self, inlined: bool) -> str:
        """The text of the function."""
        parameters = [(w, f"%{n}.{k}.a") for n, kind in self.arguments.items()
                      for k, w in enumerate(kind.words)]  # fmt: skip
        head = ", ".join(f"{w} {x}" for w, x in parameters)
        attributes = "nounwind inlinehint" if inlined else "nounwind"
        lines = "\n".join(["entry:", *self.places, *self.lines])
        return (
            f"define internal {t.result_type(self.result)} @{self.name}({head}) {attributes} "
            f"{{\n{lines}\n}}\n"
        )

    def _compile(self) -> None:
        self.lines, self.places, self.count, self.is_dead = [], [], 0, False
        self.slots: dict[Any, list[str]] = {}
        #: Variable of each name, None where that depends on the path.
        self.current: dict[str, Any] = {}
        #: Labels to continue at, and behind, each enclosing loop.
        self.loops: list[tuple[str, str]] = []
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

    def store(self, node: ast.AST, name: str, value: t.Value) -> None:
        """Assign a value to a variable.

        Numbers share one variable of the widest type; a value of any other type makes it a new
        variable of the same name.
        """
        type_ = value.type
        family = "number" if t.wider(type_, t.INT) else type_
        if isinstance(type_, t.Tuple):
            family = "tuple", len(type_.items)
        key = name, family
        before = self.types.setdefault(key, type_)
        both = t.wider(before, type_)
        if both is None:
            self.refuse(node, f"{name} holds values of several types", "take two names")
        if both != before:
            self.types[key], self.is_settled = both, False
        if key not in self.slots:
            self.slots[key] = self.place(self.types[key], name)
        self.current[name] = key
        self.write_to(self.slots[key], self.cast(node, value, self.types[key]))

    def load(self, node: ast.AST, name: str) -> t.Value:
        """The value of a variable."""
        key = self.current[name]
        if key is None:
            self.refuse(node, f"{name} is of another type on another path", "take two names")
        if isinstance(self.types[key], t.Known) or self.types[key] == t.NOTHING:
            return t.Value(self.types[key])
        return self.read_from(self.slots[key], self.types[key])

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
        before = value.type if self.result is None else self.result
        self.result = t.wider(before, value.type)
        if self.result is None:
            self.refuse(node, "returns values of several types", "return one type")
        if self.result != before:
            self.is_settled = False
        words = self.cast(node, value, self.result).words
        type_, whole = t.result_type(self.result), "undef"
        if len(words) > 1:
            for k, (kind, word) in enumerate(zip(self.result.words, words, strict=True)):
                whole = self.new(f"insertvalue {type_} {whole}, {kind} {word}, {k}")
        self.line(f"ret {type_} {whole if len(words) > 1 else ''.join(words)}".rstrip())
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
        one, other, end = self.label(), self.label(), self.label()
        self.branch(test, one, other)
        before, ends = dict(self.current), []
        for label, body in ((one, node.body), (other, node.orelse)):
            self.current = dict(before)
            self.start(label)
            self.statements(body)
            if not self.is_dead:
                ends.append(self.current)
                self.jump(end)
        self.is_dead = not ends
        if ends:
            first, last = ends[0], ends[-1]
            both = {**first, **last}
            differ = {n for n in first if n in last and first[n] != last[n]}
            self.current = {n: None if n in differ else key for n, key in both.items()}
            self.start(end)

    def _While(self, node: ast.While) -> None:
        if node.orelse:
            self.refuse(node, "while with else", "set a number where the loop is left")
        head, body, end = self.label(), self.label(), self.label()
        self.jump(head)
        self.start(head)
        test = self.condition(node.test)
        self.branch(test, body, end)
        self.start(body)
        self._repeat(node, head, end, None)
        self.jump(head)
        self.start(end)
        if test.constant and not any(isinstance(n, ast.Break) for n in ast.walk(node)):
            self.line("unreachable")
            self.is_dead = True

    def _repeat(self, node: ast.For | ast.While, again: str, end: str, k: t.Value | None) -> None:
        """The body of a loop; k: the value of its variable.

        A variable that changes its type in the body has no type at its start and after the loop.
        """
        before, changes = dict(self.current), self.changes.setdefault(node, set())
        self.current.update(dict.fromkeys(changes))
        if k is not None and isinstance(node, ast.For):
            self._assign(node.target, k)
        self.loops.append((again, end))
        self.statements(node.body)
        self.loops.pop()
        found = {n for n, key in before.items() if self.current[n] != key}
        if found - changes:
            changes.update(found)
            self.is_settled = False
        self.current.update(dict.fromkeys(changes))

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
        for item in t.items_of(over):
            self._assign(node.target, item)
            self.statements(node.body)

    def _count(self, node: ast.For, call: ast.Call) -> None:
        """``for k in range(...)``; assignments to k do not change the count."""
        given = [self.cast(a, self.integer(a, self.value(a)), t.INT) for a in call.args]
        first, last = (t.constant(0), given[0]) if len(given) == 1 else given[:2]
        step = given[2] if len(given) > 2 else t.constant(1)
        if step.constant == 0:
            self.refuse(node, "the step of a range is zero", "take another one")
        [counter] = self.place(t.INT, "for")
        self.line(f"store i64 {first.word}, ptr {counter}")
        head, body, again, end = (self.label() for _ in range(4))
        self.jump(head)
        self.start(head)
        k = self.new(f"load i64, ptr {counter}")
        below = self.new(f"icmp slt i64 {k}, {last.word}")
        above = self.new(f"icmp sgt i64 {k}, {last.word}")
        upwards = self.new(f"icmp sgt i64 {step.word}, 0")
        test = self.emit(t.BOOL, f"select i1 {upwards}, i1 {below}, i1 {above}")
        self.branch(test, body, end)
        self.start(body)
        self._repeat(node, again, end, t.Value(t.INT, (k,)))
        self.jump(again)
        self.start(again)
        following = self.new(f"load i64, ptr {counter}")
        following = self.new(f"add nsw i64 {following}, {step.word}")
        self.line(f"store i64 {following}, ptr {counter}")
        self.jump(head)
        self.start(end)


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
    raise t.CompileError(
        f"the source of {function.__qualname__} cannot be read; put it into a file, as def "
        f"[{code.co_filename}:{code.co_firstlineno}]"
    )
