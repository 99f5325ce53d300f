"""Completes types by a scene's functions of an argument and by the friction of a joint.

A kernel that calls ``f(x)``, or ``f(x, y)``, is compiled once for each type of function: the kernel
is copied with the function's own kernel in place of ``f``, and the numbers of the function follow
those of the element (compiled code takes no closure there; docs/decisions/0001).
"""

import ast
import inspect
import textwrap
from collections.abc import Callable, Mapping
from typing import Any

import attrs

from dap3d_core.interface.codegen.instance_layout import InstanceLayout
from dap3d_core.interface.codegen.kernel_arguments import (
    FRICTION_NUMBERS,
    KernelArgument,
    argument_names,
    derivative_names,
    friction_names,
    in_order,
    namespace,
    parameters,
    stored,
)
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.errors import PluginError, where_is


def uncalled(type_info: TypeInfo) -> str:
    """An unknown function that kernels call; "" where there is none."""
    names = {n for kernel in type_info.kernels.values() for n in parameters(kernel)}
    return min((n for n in names if n in type_info.names and type_info.names[n].derivative >= 0),
               key=len, default="")  # fmt: skip


#: Suffix of the name of the knots of a function.
KNOTS = "__knots"
#: Kernels in the order in which they are searched for the arguments of functions.
CALLING = ("C", "C_dot", "gamma", "wrench")


def bind_functions(
    type_info: TypeInfo, functions: Mapping[str, TypeInfo], knots: Mapping[str, int]
) -> TypeInfo:
    """A type with known functions of an argument.

    Args:
        examined: the type.
        functions: function field -> the type of the function given.
        knots: function field -> number of arguments at which that function changes its form.

    Returns:
        the type with the numbers of these functions after its own, in the order of the fields, and
        the knots of each after its numbers. Where there are any it has a kernel ``knot``: the
        distances of the arguments of the functions from their knots.

    Raises:
        PluginError: a kernel does more with a function than to call it, or has no source.
    """
    layout, names = type_info.layout, dict(type_info.names)
    calls: dict[str, tuple[_Given, int]] = {}
    for field, of_argument in functions.items():
        prefix = "f" if field == "function" else field
        behind = of_argument.layout.shifted(layout.par_width)
        value = of_argument.kernels["value"]
        names_of_value = parameters(value)
        all_names = _names_of(of_argument, behind)
        arguments = argument_names(of_argument.type)
        own = in_order(all_names, [n for n in names_of_value if n not in arguments])
        names |= {f"{prefix}__{q.name}": attrs.evolve(q, name=f"{prefix}__{q.name}") for q in own}
        wanted = tuple(n if n in arguments else f"{prefix}__{n}" for n in names_of_value)
        knots_name = f"{prefix}{KNOTS}"
        given = _Given(f"{prefix}__value", value, arguments, wanted, knots_name, knots[field])
        suffixes = derivative_names(len(arguments))
        calls |= {f"{prefix}{s}": (given, order) for order, s in enumerate(suffixes)}
        width = behind.par_width
        layout = attrs.evolve(layout, par_width=width + given.knot_count)
        if given.knot_count:
            shape = (given.knot_count,)
            numbers = layout.numbers | {given.knots: (width, shape)}
            layout = attrs.evolve(layout, numbers=numbers)
            names[given.knots] = KernelArgument(
                given.knots, shape, False, stored(layout, given.knots)
            )
    kernels = {n: _with_functions(type_info, n, k, calls) for n, k in type_info.kernels.items()}
    title = f"({', '.join(g.type.keyword + g.given for g in functions.values())})"
    bound = attrs.evolve(type_info, layout=layout, names=names, kernels=kernels, given=title)
    calling = [
        n for n in CALLING if set(parameters(type_info.kernels.get(n, _nothing))) & set(calls)
    ]
    if not calling or not any(knots.values()):
        return bound
    distances = _Distances(calls)
    kernel = _with_functions(type_info, calling[0], type_info.kernels[calling[0]], calls, distances)
    paths = tuple(f"out[{k}]" for k in range(len(distances.found)))
    return attrs.evolve(
        bound, kernels=bound.kernels | {"knot": kernel}, outputs=bound.outputs | {"knot": paths}
    )


def _names_of(function: TypeInfo, layout: InstanceLayout) -> dict[str, KernelArgument]:
    """Names of a function whose numbers are shifted."""
    if not function.terms:
        return namespace(function.type, layout)
    from dap3d_core.interface.codegen.terms import names_behind

    return names_behind(function, layout)


def is_knots(name: str) -> bool:
    """True if a number of a layout holds the knots of a function."""
    return name.endswith(KNOTS)


def _nothing() -> None:
    """A kernel without parameters."""


@attrs.frozen
class _Given:
    """The kernel of a given function.

    Its name in the copy, itself, what it is a function of, all it takes (that and the names of its
    numbers), the name and number of its knots.
    """

    known_as: str
    value: Callable[..., Any]
    arguments: tuple[str, ...]
    wanted: tuple[str, ...]
    knots: str
    knot_count: int


def bind_friction(type_info: TypeInfo) -> TypeInfo:
    """A joint's kernel ``friction`` as a separate element: mu, v_tol, radius follow its numbers.

    Raises:
        PluginError: the joint has no such kernel.
    """
    kernel = type_info.kernels.get("friction")
    if kernel is None:
        raise PluginError(f"{where_is(type_info.type)} defines no friction")
    layout, names = type_info.layout, dict(type_info.names)
    numbers, width = dict(layout.numbers), layout.par_width
    for name, quantity in friction_names(type_info.type.rows).items():  # type: ignore[attr-defined]
        if name in FRICTION_NUMBERS and name not in type_info.layout.numbers:
            numbers[name] = width, ()
            quantity = attrs.evolve(quantity, code=f"par[p1 + {width}]")
            width += 1
        names[name] = quantity if name not in type_info.layout.numbers else names[name]
    layout = attrs.evolve(layout, numbers=numbers, par_width=width)
    return attrs.evolve(type_info, layout=layout, names=names, kernels={"friction": kernel})


def _with_functions(
    type_info: TypeInfo,
    name: str,
    kernel: Callable[..., Any],
    calls: Mapping[str, tuple[_Given, int]],
    replaced: "_Calls | None" = None,
) -> Callable[..., Any]:
    """The kernel with its calls of functions replaced by calls of the functions' own kernels."""
    called = [n for n in parameters(kernel) if n in calls]
    if not called:
        return kernel
    who = f"{where_is(type_info.type)}.{name}"
    try:
        lines, first = inspect.getsourcelines(kernel)
        tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, TypeError, SyntaxError) as error:
        raise PluginError(f"{who}: its source cannot be read ({error})") from error
    ast.increment_lineno(tree, first - 1)
    definition = tree.body[0]
    if not isinstance(definition, ast.FunctionDef):
        raise PluginError(f"{who} is to be written with def, for it calls a function")
    replaced = _Calls(calls) if replaced is None else replaced
    replaced.generic_visit(definition)
    if replaced.other:
        count = "one argument" if len(calls[called[0]][0].arguments) == 1 else "two arguments"
        raise PluginError(f"{who} may only call {', '.join(replaced.other)}, with {count}")
    others = [a for a in definition.args.args if a.arg not in called]
    used = dict.fromkeys(calls[n][0] for n in called)
    numbers = [n for given in used for n in (*given.wanted, *replaced.names(given))
               if n not in given.arguments]  # fmt: skip
    definition.args.args = [*others, *(ast.arg(n) for n in numbers)]
    definition.decorator_list = []
    plain = kernel.__globals__ | {given.known_as: given.value for given in used}
    code = compile(ast.fix_missing_locations(tree), kernel.__code__.co_filename, "exec")
    exec(code, plain)  # the plugin's own source, already imported
    copied: Callable[..., Any] = plain[definition.name]
    return copied


class _Calls(ast.NodeTransformer):
    """``f(x)`` -> ``f__value(x, numbers...)[0]``."""

    def __init__(self, calls: Mapping[str, tuple[_Given, int]]) -> None:
        self.calls = calls
        self.other: list[str] = []

    def visit_Call(self, node: ast.Call) -> ast.AST:
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        given, order = self.calls.get(name, (None, 0))
        if given is None or len(node.args) != len(given.arguments) or node.keywords:
            return self.generic_visit(node)
        values = [self.argument(given, self.visit(value)) for value in node.args]
        known = dict(zip(given.arguments, values, strict=True))
        arguments = [known.get(n, ast.Name(n, ast.Load())) for n in given.wanted]
        call = ast.Call(ast.Name(given.known_as, ast.Load()), arguments, [])
        return ast.copy_location(ast.Subscript(call, ast.Constant(order), ast.Load()), node)

    def argument(self, given: _Given, node: ast.expr) -> ast.expr:
        """The argument of a function in the copy."""
        return node

    def names(self, given: _Given) -> tuple[str, ...]:
        """Further parameters of the copy, besides the numbers of a function."""
        return ()

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if node.id in self.calls:
            self.other.append(node.id)
        return node


class _Distances(_Calls):
    """The same, but the copy returns the distance of each argument from each knot."""

    def __init__(self, calls: Mapping[str, tuple[_Given, int]]) -> None:
        super().__init__(calls)
        self.found: list[ast.expr] = []
        self._known: dict[str, str] = {}
        self._new: list[ast.stmt] = []

    def argument(self, given: _Given, node: ast.expr) -> ast.expr:
        key = f"{given.known_as}({ast.dump(node)})"
        if key not in self._known:  # the same for f(x) and f_dot(x)
            name = self._known[key] = f"x__{len(self._known)}"
            self._new.append(ast.Assign([ast.Name(name, ast.Store())], node))
            for k in range(given.knot_count):
                knot = ast.Subscript(ast.Name(given.knots, ast.Load()), ast.Constant(k), ast.Load())
                self.found.append(ast.BinOp(ast.Name(name, ast.Load()), ast.Sub(), knot))
        return ast.Name(self._known[key], ast.Load())

    def names(self, given: _Given) -> tuple[str, ...]:
        return (given.knots,) if given.knot_count else ()

    def visit_Assign(self, node: ast.Assign) -> list[ast.AST]:
        self.generic_visit(node)
        return [*self._pending(), node]

    def visit_Return(self, node: ast.Return) -> list[ast.AST]:
        self.generic_visit(node)  # its calls count, its value does not
        return [*self._pending(), ast.Return(ast.Tuple(list(self.found), ast.Load()))]

    def _pending(self) -> list[ast.stmt]:
        """Assignments of arguments that precede a line."""
        pending, self._new = self._new, []
        return pending
