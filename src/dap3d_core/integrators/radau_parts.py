"""The parts of a Radau step as first-class functions, each compiled by itself.

A compiled function that calls another one takes in its code, and optimises it again; calls by
pointer keep the parts apart.
"""

from typing import Any

from dap3d_core.assembly.system import SYSTEM
from dap3d_core.formulations.stage import Matrix
from dap3d_core.formulations.tangent import Tangent
from dap3d_core.integrators.radau_dense import find_slope
from dap3d_core.integrators.radau_method import RadauMethod
from dap3d_core.integrators.radau_newton import (
    estimate_error,
    factorise_both,
    find_stages,
    find_tangent,
)
from dap3d_core.integrators.radau_work import RadauWork
from dap3d_core.kernels.cache import compiled, jit_is_on
from dap3d_core.kernels.lists import (
    COMPLEX_VECTOR,
    INTEGER_MATRIX,
    INTEGERS,
    LOOP_LIST,
    MATRIX,
    TENSOR,
    VECTOR,
    List,
    fill,
    function_type,
    named_tuple_type,
    number_signature,
)

_MEMBERS: dict[Any, dict[str, Any]] = {
    RadauMethod: {"A": MATRIX, "inverse": MATRIX, "T": MATRIX, "T_inverse": MATRIX},
    Tangent: {"elements": INTEGER_MATRIX, "pairs": INTEGERS, "blocks": INTEGER_MATRIX},
    Matrix: {
        **dict.fromkeys(("nodes", "columns", "updates", "block_place", "joint_place"),
                        INTEGER_MATRIX),
        **dict.fromkeys(("body_first", "body_place", "pair_place", "held"), INTEGERS),
        "spin": MATRIX,
    },
    RadauWork: {
        **dict.fromkeys(("integer", "pivots", "pivotsc"), INTEGERS),
        **dict.fromkeys(("state", "k", "terms", "rows", "Z", "Z_old", "F", "R", "x", "along"),
                        MATRIX),
        **dict.fromkeys(("multipliers", "last_multipliers", "G", "frames"), TENSOR),
        **dict.fromkeys(("xc", "alongc", "Kc"), COMPLEX_VECTOR),
    },
}  # fmt: skip


def _type(class_: Any, **more: Any) -> Any:
    known = _MEMBERS[class_] | more
    return named_tuple_type(class_, [known.get(name, VECTOR) for name in class_._fields])


PART = number_signature(
    _type(RadauWork, method=_type(RadauMethod)), SYSTEM, LOOP_LIST, _type(Tangent), _type(Matrix)
)
PART_TYPE = function_type(PART)


@compiled
def _empty() -> Any:
    return List.empty_list(PART_TYPE)


@compiled
def _append(parts: Any, part: Any) -> None:
    parts.append(part)


def radau_parts() -> Any:
    """find_tangent, factorise_both, find_stages, estimate_error, find_slope as a typed list.

    Each is called as part(t, h, work, system, loops, tangent, matrix).
    """
    parts = (find_tangent, factorise_both, find_stages, estimate_error, find_slope)
    if jit_is_on():
        for part in parts:
            part.compile(PART)
    return fill(_empty, _append, PART_TYPE, parts)
