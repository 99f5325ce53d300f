"""Inputs of linearised equations: numbers of force elements, and factors on them."""

from collections.abc import Sequence

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.interface.codegen.loop_derivatives import differentiate_loop
from dap3d_core.interface.fields import specs_of
from dap3d_core.model import Group
from dap3d_core.result.arrays import AXES
from dap3d_core.result.errors import UnknownNameError, unknown
from dap3d_core.simulation.linearization.operating_point import OperatingPoint

Floats = NDArray[np.float64]

#: Kinds of fields that may be inputs.
NUMBERS = ("number", "vec3", "vector")


@attrs.frozen(eq=False)
class InputForces:
    """Forces by unit inputs.

    Attributes:
        wrench: (6 n, inputs) force and moment on each body.
        units: SI units of the inputs.
        elements: names of the forces that inputs change.
        notes: of inputs that have no effect.
    """

    wrench: Floats
    units: tuple[str, ...]
    elements: frozenset[str]
    notes: tuple[str, ...]


def input_forces(point: OperatingPoint, names: Sequence[str]) -> InputForces:
    """Forces by inputs, by name.

    Raises:
        UnknownNameError: there is no such force, field or component; names the nearest.
    """
    wrench = np.zeros((6 * point.model.body_count, len(names)))
    units, elements, notes = [], [], []
    with point.compiled.borrow_evaluator() as evaluator:
        evaluator.place(point.t, point.u)
        for k, name in enumerate(names):
            element, _, field = name.partition(".")
            if element not in point.model.force_names:
                raise unknown("force", element, point.model.force_names)
            number = point.model.force_names.index(element)
            for loop, (kind, group) in enumerate(evaluator.loop_groups):
                if kind != "wrench" or number not in group.members:
                    continue
                unit, columns = ("1", []) if not field else _columns(group, name, field)
                wrench[:, k] += _wrench(point, evaluator, loop, group, number, columns)
            units.append(unit)
            elements.append(element)
            if not np.any(wrench[:, k]):
                notes.append(f"input {name} has no effect at this state")
    return InputForces(wrench, tuple(units), frozenset(elements), tuple(notes))


def _columns(group: Group, name: str, field: str) -> tuple[str, list[int]]:
    """Unit of an input, and the index of its number among those of an element."""
    field, _, axis = field.partition(".")
    specs, layout = specs_of(group.type_info.type), group.type_info.layout
    known = [n for n, s in specs.items() if s.kind in NUMBERS and n in layout.numbers]
    if field not in known:
        if field in specs:
            raise UnknownNameError(
                f"{field} of force {name.partition('.')[0]} is no number that its force depends on "
                f"directly, so it cannot be an input (numbers: {', '.join(known) or 'none'})"
            )
        raise unknown(f"input {name!r}: no number", field, known)
    offset, shape = layout.numbers[field]
    if not shape and not axis:
        return specs[field].unit or "1", [offset]
    if shape == (3,) and axis in AXES:
        return specs[field].unit or "1", [offset + AXES.index(axis)]
    what = f"a component of {field} (x, y or z)" if shape == (3,) else f"{field} alone"
    raise UnknownNameError(f"input {name!r}: name {what}")


def _wrench(
    point: OperatingPoint,
    evaluator: object,
    loop: int,
    group: Group,
    number: int,
    columns: list[int],
) -> Floats:
    """(6 n,) force by one input."""
    system = evaluator.system  # type: ignore[attr-defined]
    i0, p0, count = system.groups[loop].tolist()
    own = differentiate_loop(group.type_info, "wrench", point.t, system, (i0, p0, count),
                             numbers=columns)  # fmt: skip
    value, slope = own.outputs["wrench"]
    part = slope[..., -1] if columns else value  # (m, slots, 6)
    result = np.zeros((point.model.body_count + 1, 6))
    mine = group.members == number
    np.add.at(result, own.bodies[mine][:, : value.shape[1]], part[mine])
    return result[1:].ravel()
