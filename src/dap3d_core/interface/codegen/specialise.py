"""Completes types by a scene's functions of an argument and by the friction of a joint.

A kernel that calls ``f(x)``, or ``f(x, y)``, is compiled once for each type of function: it is
given the function's own kernel for ``f``; the numbers of the function follow those of the element.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from random import Random
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

#: Suffix of the name of the knots of a function.
KNOTS = "__knots"
#: Kernels in the order in which they are searched for the arguments of functions.
CALLING = ("C", "C_dot", "gamma", "wrench")


def uncalled(type_info: TypeInfo) -> str:
    """An unknown function that kernels call; "" where there is none."""
    names = {n for kernel in type_info.kernels.values() for n in parameters(kernel)}
    return min((n for n in names if n in type_info.names and type_info.names[n].derivative >= 0),
               key=len, default="")  # fmt: skip


def bind_functions(
    type_info: TypeInfo, functions: Mapping[str, TypeInfo], knots: Mapping[str, int]
) -> TypeInfo:
    """A type with known functions of an argument.

    Args:
        type_info: the type.
        functions: function field -> the type of the function given.
        knots: function field -> number of arguments at which that function changes its form.

    Returns:
        the type with the numbers of these functions after its own, in the order of the fields, and
        the knots of each after its numbers. Where there are any it has a kernel ``knot``: the
        distances of the arguments of the functions from their knots.
    """
    layout, names = type_info.layout, dict(type_info.names)
    given: list[_Given] = []
    for field, function in functions.items():
        one = _Given("f" if field == "function" else field, function, knots[field])
        behind = function.layout.shifted(layout.par_width)
        of_function = names_behind(function, behind)
        own = in_order(of_function, one.own(parameters(function.kernels["value"])))
        names |= {one.name(q.name): attrs.evolve(q, name=one.name(q.name)) for q in own}
        layout = attrs.evolve(layout, par_width=behind.par_width + one.knot_count)
        if one.knot_count:
            shape = (one.knot_count,)
            numbers = layout.numbers | {one.knots: (behind.par_width, shape)}
            layout = attrs.evolve(layout, numbers=numbers)
            names[one.knots] = KernelArgument(one.knots, shape, False, stored(layout, one.knots))
        given.append(one)
    kernels = {n: _with_functions(k, given) for n, k in type_info.kernels.items()}
    outputs, knotted = dict(type_info.outputs), [one for one in given if one.knot_count]
    if getattr(type_info.type, "is_contact", False):  # arguments are sought: most are of no state
        knotted = []
    calling = (k for n in CALLING if (k := type_info.kernels.get(n)) and _called(k, knotted))
    if kernel := next(calling, None):
        distances = _distances(kernel, type_info, knotted)
        body = f"x__ = []\n{{}}\nreturn ({', '.join(distances)},)"
        kernels["knot"] = _with_functions(kernel, given, body)
        outputs["knot"] = tuple(f"out[{k}]" for k in range(len(distances)))
    title = f"({', '.join(g.type.keyword + g.given for g in functions.values())})"
    return attrs.evolve(
        type_info, layout=layout, names=names, kernels=kernels, outputs=outputs, given=title
    )


def names_behind(type_info: TypeInfo, layout: InstanceLayout) -> dict[str, KernelArgument]:
    """Names of a function type whose numbers are shifted, with those of its terms."""
    names = namespace(type_info.type, layout)
    if not type_info.terms:
        return names
    start = layout.par_width - sum(term.layout.par_width for term in type_info.terms)
    for k, term in enumerate(type_info.terms):
        behind = term.layout.shifted(start)
        start = behind.par_width
        for name, quantity in names_behind(term, behind).items():
            if name != "x":
                names[f"g{k}__{name}"] = attrs.evolve(quantity, name=f"g{k}__{name}")
    return names


@attrs.frozen(eq=False)
class _Given:
    """A function that the elements of a type are given.

    Attributes:
        prefix: of its names in kernels.
        function: its type.
        knot_count: number of its knots.
    """

    prefix: str
    function: TypeInfo
    knot_count: int

    @property
    def knots(self) -> str:
        """Name of its knots."""
        return f"{self.prefix}{KNOTS}"

    @property
    def calls(self) -> dict[str, int]:
        """Names by which kernels call it and its derivatives, with the place of each value."""
        suffixes = derivative_names(len(argument_names(self.function.type)))
        return {f"{self.prefix}{suffix}": order for order, suffix in enumerate(suffixes)}

    def name(self, own: str) -> str:
        """One of its names beside those of the element."""
        return f"{self.prefix}__{own}"

    def own(self, names: Iterable[str]) -> list[str]:
        """Those of its names that are not its arguments."""
        return [n for n in names if n not in argument_names(self.function.type)]

    def expression(self, call: str, *, noted: bool) -> str:
        """Expression for what a kernel calls; ``noted``: it adds its argument to ``x__``."""
        arguments = argument_names(self.function.type)
        known = {n: f"note__(x__, {n})" if noted and self.knot_count else n for n in arguments}
        wanted = parameters(self.function.kernels["value"])
        passed = ", ".join(known.get(n) or self.name(n) for n in wanted)
        value = f"{self.name('value')}({passed})"
        if not noted:
            value = f"once__(values__, {self.prefix!r}, ({', '.join(arguments)},), lambda: {value})"
        return f"lambda {', '.join(arguments)}: {value}[{self.calls[call]}]"


def _called(kernel: Callable[..., Any], given: Iterable[_Given]) -> dict[str, _Given]:
    """Functions, and derivatives of them, that a kernel calls."""
    return {n: one for one in given for n in parameters(kernel) if n in one.calls}


def _with_functions(
    kernel: Callable[..., Any], given: Iterable[_Given], body: str = "return {}"
) -> Callable[..., Any]:
    """The kernel with the functions that it calls."""
    called = _called(kernel, given)
    if not called:
        return kernel
    noted = "x__" in body
    expressions = {n: one.expression(n, noted=noted) for n, one in called.items()}
    numbers: list[str] = []
    names: dict[str, Any] = {"note__": note} if noted else {}
    if not noted:
        names["once__"], body = once, f"values__ = {{{{}}}}\n{body}"
    for one in called.values():
        value = one.function.kernels["value"]
        numbers += map(one.name, one.own(parameters(value)))
        numbers += [one.knots] if noted and one.knot_count else []
        names[one.name("value")] = value
    return bound_kernel(kernel, expressions, numbers, names, body)


def bound_kernel(
    kernel: Callable[..., Any],
    given: Mapping[str, str],
    numbers: Iterable[str],
    names: Mapping[str, Any],
    body: str = "return {}",
) -> Callable[..., Any]:
    """A kernel with some of its parameters known.

    Args:
        kernel: the kernel.
        given: parameter -> the expression that takes its place.
        numbers: further parameters, which these expressions name.
        names: what they call.
        body: lines around the kernel's call.
    """
    wanted = parameters(kernel)
    others = dict.fromkeys([*(n for n in wanted if n not in given), *numbers])
    call = f"kernel__({', '.join(given.get(n, n) for n in wanted)})"
    lines = "".join(f"    {line}\n" for line in body.format(call).splitlines())
    source = f"def bound({', '.join(others)}):\n{lines}"
    namespace = {**names, "kernel__": kernel, "__name__": kernel.__module__}
    # file, line and name of the kernel: what is compiled is named by a digest of them
    exec(compile(source, kernel.__code__.co_filename, "exec"), namespace)  # made of names alone
    bound: Any = namespace["bound"]
    line = kernel.__code__.co_firstlineno
    bound.__code__ = bound.__code__.replace(co_qualname=kernel.__qualname__, co_firstlineno=line)
    bound.kernels = (kernel, *names.values())  # wherever they were defined: in a notebook, say
    return bound


def once(
    values: dict[Any, Any], f: str, arguments: tuple[Any, ...], call: Callable[[], Any]
) -> Any:
    """What a function f returns for these arguments, called at first: f and f_dot are one call."""
    key = (f, *map(id, arguments))
    if key not in values:
        values[key] = arguments, call()  # kept, so that no other object takes their place
    return values[key][1]


def note(arguments: list[Any], x: Any) -> Any:
    """Add an argument to those that functions with knots are called with."""
    arguments.append(x)
    return x


def _distances(
    kernel: Callable[..., Any], type_info: TypeInfo, knotted: Collection[_Given]
) -> list[str]:
    """Expressions for the distances from knots of the arguments ``x__`` in a kernel's calls.

    The kernel is called once with random numbers, to see which functions it calls, in which order;
    an argument of both f and f_dot counts once.
    """
    from dap3d_core.interface.examine.random_values import random_quantity

    calls: list[tuple[_Given, str, Any]] = []
    called, rng = _called(kernel, knotted), Random(1)

    def argument(name: str) -> Any:
        value = random_quantity(type_info.names[name], rng)
        if name not in called:
            return value

        def function(x: float) -> Any:
            calls.append((called[name], name, x))
            return value(x)

        return function

    kernel(*map(argument, parameters(kernel)))
    return [
        f"x__[{k}] - {one.knots}[{n}]"
        for k, (one, name, x) in enumerate(calls)
        if not any(o is one and other != name and x is y for o, other, y in calls[:k])
        for n in range(one.knot_count)
    ]


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
