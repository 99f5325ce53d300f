"""Completes a function type that combines others by the types of those in a scene.

The kernel of each combination is made once: it takes the numbers of all its terms, and calls the
kernel of the type with a function for each of them.
"""

from collections.abc import Callable, Sequence
from typing import Any

import attrs

from dap3d_core.interface.codegen.kernel_arguments import SEVERAL, parameters
from dap3d_core.interface.codegen.specialise import bound_kernel, names_behind
from dap3d_core.interface.codegen.type_info import TypeInfo


def bind_terms(type_info: TypeInfo, terms: Sequence[TypeInfo]) -> TypeInfo:
    """A function type that combines functions, with those known.

    Args:
        type_info: the type, with one field of several functions.
        terms: the types of these functions; their numbers follow its own, in this order.
    """
    layout = type_info.layout
    width = layout.par_width + sum(term.layout.par_width for term in terms)
    bound = attrs.evolve(
        type_info,
        layout=attrs.evolve(layout, par_width=width),
        kernels={"value": _kernel(type_info, terms)},
        given=f"({', '.join(term.type.keyword + term.given for term in terms)})",
        terms=tuple(terms),
    )
    return attrs.evolve(bound, names=names_behind(bound, bound.layout))


def _kernel(type_info: TypeInfo, terms: Sequence[TypeInfo]) -> Callable[..., Any]:
    """The kernel ``value`` of a combination, of the argument and the numbers of all terms."""
    kernel = type_info.kernels["value"]
    functions, numbers = [], []
    for k, term in enumerate(terms):
        of_term = parameters(term.kernels["value"])
        numbers += [f"g{k}__{n}" for n in of_term if n != "x"]
        passed = ", ".join("x" if n == "x" else f"g{k}__{n}" for n in of_term)
        functions.append(f"lambda x: g{k}__value({passed})")
    several = f"({', '.join(functions)},)"
    given = {n: several for n in parameters(kernel) if type_info.names[n].derivative == SEVERAL}
    names = {f"g{k}__value": term.kernels["value"] for k, term in enumerate(terms)}
    return bound_kernel(kernel, given, numbers, names)
