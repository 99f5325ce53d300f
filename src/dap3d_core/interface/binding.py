"""Types completed by what a scene gives them: functions of an argument, the friction of a joint.

A kernel that calls ``f(x)`` is compiled once for each type of function it meets: the kernel is
copied with the function's own kernel in the place of ``f``, and the numbers of the function stand
behind those of the element (compiled code takes no closure there; docs/decisions/0001).
"""

import ast
import inspect
import textwrap
from collections.abc import Callable, Mapping
from typing import Any

import attrs

from dap3d_core.interface.checks import Examined, PluginError, where_is
from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.layout import Layout
from dap3d_core.interface.namespace import (
    DERIVATIVES,
    FRICTION_NUMBERS,
    friction_names,
    in_order,
    namespace,
    parameters,
)


def argument_functions(type_: type) -> tuple[str, ...]:
    """The function fields of a type that are of an argument, in order."""
    return tuple(n for n, s in specs_of(type_).items() if s.kind == "function" and s.argument)


def bind_functions(examined: Examined, functions: Mapping[str, Examined]) -> Examined:
    """A type whose functions of an argument are known.

    Args:
        examined: the type.
        functions: function field -> the type of the function given.

    Returns:
        the type with the numbers of these functions behind its own, in the order of the fields.

    Raises:
        PluginError: a kernel does more with a function than to call it, or has no source.
    """
    layout, names = examined.layout, dict(examined.names)
    kernels = examined.kernels
    title = []
    for field, given in functions.items():
        prefix = "f" if field == "function" else field
        behind = _behind(given.layout, layout.par_width)
        value = given.kernels["value"]
        own = in_order(namespace(given.type, behind), [n for n in parameters(value) if n != "x"])
        extra = {q.name: attrs.evolve(q, name=f"{prefix}__{q.name}") for q in own}
        names |= {q.name: q for q in extra.values() if q.name not in names}
        wanted = ["x" if n == "x" else extra[n].name for n in parameters(value)]
        called = {f"{prefix}{suffix}": order for order, suffix in enumerate(DERIVATIVES)}
        kernels = {
            name: _with_function(examined, name, kernel, called, value, wanted)
            for name, kernel in kernels.items()
        }
        layout = attrs.evolve(layout, par_width=behind.par_width)
        title.append(given.type.keyword)
    return attrs.evolve(
        examined, layout=layout, names=names, kernels=kernels, given=f"({', '.join(title)})"
    )


def bind_friction(examined: Examined) -> Examined:
    """A joint's kernel ``friction`` as an element of its own: mu, v_tol, radius behind its numbers.

    Raises:
        PluginError: the joint has no such kernel.
    """
    kernel = examined.kernels.get("friction")
    if kernel is None:
        raise PluginError(f"{where_is(examined.type)} defines no friction")
    layout, names = examined.layout, dict(examined.names)
    numbers, width = dict(layout.numbers), layout.par_width
    for name, quantity in friction_names(examined.type.rows).items():  # type: ignore[attr-defined]
        if name in FRICTION_NUMBERS and name not in examined.layout.numbers:
            numbers[name] = width, ()
            quantity = attrs.evolve(quantity, code=f"par[p1 + {width}]")
            width += 1
        names[name] = quantity if name not in examined.layout.numbers else names[name]
    layout = attrs.evolve(layout, numbers=numbers, par_width=width)
    return attrs.evolve(examined, layout=layout, names=names, kernels={"friction": kernel})


def _behind(layout: Layout, start: int) -> Layout:
    """A layout whose numbers begin at ``start``."""
    return attrs.evolve(
        layout,
        numbers={n: (start + at, shape) for n, (at, shape) in layout.numbers.items()},
        tables={n: (start + at, columns) for n, (at, columns) in layout.tables.items()},
        par_width=start + layout.par_width,
    )


def _with_function(
    examined: Examined,
    name: str,
    kernel: Callable[..., Any],
    called: Mapping[str, int],
    value: Callable[..., Any],
    wanted: list[str],
) -> Callable[..., Any]:
    """The kernel with its calls of a function replaced by calls of the function's own kernel."""
    if not set(called) & set(parameters(kernel)):
        return kernel
    who = f"{where_is(examined.type)}.{name}"
    try:
        lines, first = inspect.getsourcelines(kernel)
        tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, TypeError, SyntaxError) as error:
        raise PluginError(f"{who}: its source cannot be read ({error})") from error
    ast.increment_lineno(tree, first - 1)
    definition = tree.body[0]
    if not isinstance(definition, ast.FunctionDef):
        raise PluginError(f"{who} is to be written with def, for it calls a function")
    numbers = [n for n in wanted if n != "x"]
    known_as = f"{min(called, key=len)}__value"
    replaced = _Calls(called, wanted, known_as)
    definition.body = [replaced.visit(line) for line in definition.body]
    kept = [a for a in definition.args.args if a.arg not in called]
    definition.args.args = [*kept, *(ast.arg(n) for n in numbers)]
    definition.decorator_list = []
    if replaced.other:
        raise PluginError(f"{who} may only call {', '.join(replaced.other)}, with one argument")
    plain = {**kernel.__globals__, known_as: value}
    code = compile(ast.fix_missing_locations(tree), kernel.__code__.co_filename, "exec")
    exec(code, plain)  # the plugin's own source, as importing it did
    pasted: Callable[..., Any] = plain[definition.name]
    return pasted


class _Calls(ast.NodeTransformer):
    """``f(x)`` -> ``f__value(x, numbers...)[0]``."""

    def __init__(self, called: Mapping[str, int], wanted: list[str], known_as: str) -> None:
        self.called, self.wanted, self.known_as = called, wanted, known_as
        self.other: list[str] = []

    def visit_Call(self, node: ast.Call) -> ast.AST:
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if name not in self.called or len(node.args) != 1 or node.keywords:
            return self.generic_visit(node)
        argument = self.visit(node.args[0])
        arguments = [argument if n == "x" else ast.Name(n, ast.Load()) for n in self.wanted]
        call = ast.Call(ast.Name(self.known_as, ast.Load()), arguments, [])
        index = ast.Constant(self.called[name])
        return ast.copy_location(ast.Subscript(call, index, ast.Load()), node)

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if node.id in self.called:
            self.other.append(node.id)
        return node
