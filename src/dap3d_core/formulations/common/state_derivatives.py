"""Derivatives by and of the states of elements, exact to rounding, by differentiated loops.

What linearisation and equilibrium need besides the derivatives by the motion of the bodies
(simulation/linearization/tangent.py, where displacements and forces are explained).
"""

from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.common.sparse_entries import SparseEntries, components
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.interface.codegen.loop_derivatives import differentiate_loop
from dap3d_core.interface.codegen.loop_source import computes_rate
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.model import Group
from dap3d_core.model.element_states import first_states

#: Kinds of loops that may see states.
KINDS = ("rate", "wrench", "friction", "acceleration", "position")


@attrs.frozen(eq=False, kw_only=True)
class StateDerivatives:
    """Rates of s states of elements of n bodies, and derivatives; matrices are scipy CSR arrays.

    Attributes:
        rates: (s,) derivatives of the states in time.
        rate_by_displacement, rate_by_velocity: (s, 6 n).
        rate_by_states: (s, s).
        force_by_states: (6 n, s) of applied forces and reactions D^T lambda, lambda fixed.
        position_by_states: (rows, s) dC/dz.
        velocity_by_states: (rows, s) d(D v - nu)/dz.
        acceleration_by_states: (rows, s) d(D a - gamma)/dz.
    """

    rates: Floats
    rate_by_displacement: Any
    rate_by_velocity: Any
    rate_by_states: Any
    force_by_states: Any
    position_by_states: Any
    velocity_by_states: Any
    acceleration_by_states: Any


def state_derivatives(
    evaluator: Evaluator, t: float, v: Floats, multipliers: Floats, a: Floats
) -> StateDerivatives:
    """Derivatives at the bodies as placed, and ``evaluator.states``.

    Args:
        evaluator: of the model; its bodies and functions are placed.
        t: time, s.
        v, a: (6 n,) velocities and accelerations of the bodies.
        multipliers: (rows,) lambda.
    """
    model, system = evaluator.model, evaluator.system
    assembly = _Assembly(evaluator, v, multipliers, a)
    minus_lambda = np.zeros(len(system.multipliers))
    minus_lambda[system.row] = -multipliers
    for loop, (kind, group) in enumerate(evaluator.loop_groups):
        if kind not in KINDS or not group.type_info.layout.states:
            continue
        i0, p0, count = system.groups[loop].tolist()
        states = first_states(model.acting, group)
        also = ("rate",) if kind == "wrench" and computes_rate(group.type_info) else ()
        for what in (kind, *also):
            own = differentiate_loop(group.type_info, what, t, system, (i0, p0, count),
                                     minus_lambda, states=True)  # fmt: skip
            assembly.add(what, group, own.bodies, own.outputs, states)
    return StateDerivatives(rates=assembly.rates, **assembly.matrices())


class _Assembly:
    """Adds up the derivatives of all elements."""

    def __init__(self, evaluator: Evaluator, v: Floats, multipliers: Floats, a: Floats) -> None:
        model = evaluator.model
        six, rows, s = 6 * model.body_count, model.row_count, model.state_count
        self.start, self.multipliers = model.joint_start, multipliers
        self.v, self.a = (np.vstack([np.zeros((1, 6)), x.reshape(-1, 6)]) for x in (v, a))
        self.rates = np.zeros(s)
        by_rows = ("position_by_states", "velocity_by_states", "acceleration_by_states")
        shapes = {"rate_by_displacement": (s, six), "rate_by_velocity": (s, six),
                  "rate_by_states": (s, s), "force_by_states": (six, s),
                  **dict.fromkeys(by_rows, (rows, s))}  # fmt: skip
        self.entries = {name: SparseEntries(*shape) for name, shape in shapes.items()}

    def matrices(self) -> dict[str, Any]:
        """All matrices by name."""
        return {name: entries.matrix() for name, entries in self.entries.items()}

    def add(
        self,
        kind: str,
        group: Group,
        bodies: Integers,
        outputs: dict[str, tuple[Floats, Floats]],
        first: Integers,
    ) -> None:
        """Add the elements of a group; first: (m,) their first states."""
        layout = group.type_info.layout
        width, slots = layout.state_width, len(layout.slots)
        own = first[:, None] + np.arange(width)  # (m, width)
        if kind == "rate":
            value, slope = outputs["rate"]
            self.rates[own] = value
            self.entries["rate_by_states"].add(
                own[:, :, None], own[:, None, :], slope[..., -width:]
            )
            for place in range(bodies.shape[1]):
                column = components(bodies[:, place])[:, None]
                part = slope[..., 12 * place : 12 * place + 12]
                for name, of_level in (("rate_by_displacement", part[..., :6]),
                                       ("rate_by_velocity", part[..., 6:])):  # fmt: skip
                    self.entries[name].add(own[:, :, None], column, of_level)
        elif kind in ("wrench", "friction"):
            slope = outputs[kind][1][..., -width:]
            row = components(bodies[:, :slots])
            self.entries["force_by_states"].add(row[..., None], own[:, None, None], slope)
        else:
            self.add_rows(kind, group, bodies[:, :slots], outputs, own)

    def add_rows(
        self,
        kind: str,
        group: Group,
        bodies: Integers,
        outputs: dict[str, tuple[Floats, Floats]],
        own: Integers,
    ) -> None:
        """Add joints whose rows see their states; own: (m, width) these."""
        width = own.shape[1]
        rows = next(iter(outputs.values()))[0].shape[2 if kind == "acceleration" else 1]
        row = self.start[group.members][:, None] + np.arange(rows)
        where = row[..., None], own[:, None]
        if kind == "position":
            self.entries["position_by_states"].add(*where, outputs["C"][1][..., -width:])
            return
        J = outputs["J"][1][..., -width:]
        reaction = np.einsum("msrcd,mr->mscd", J, self.multipliers[row])
        place = components(bodies)[..., None]
        self.entries["force_by_states"].add(place, own[:, None, None], reaction)
        for name, motion, side in (("velocity_by_states", self.v, "nu"),
                                   ("acceleration_by_states", self.a, "gamma")):  # fmt: skip
            moved = np.einsum("msrcd,msc->mrd", J, motion[bodies])
            self.entries[name].add(*where, moved - outputs[side][1][..., -width:])
