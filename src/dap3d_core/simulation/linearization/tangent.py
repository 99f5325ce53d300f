"""Derivatives of the equations of motion at a state, by displacements, velocities, multipliers.

Of the constrained equations of body coordinates

    M a = f + D^T lambda        C = 0        D v - nu = 0        D a - gamma = 0

the terms that linearisation, equilibrium and any Newton iteration need. All are exact to rounding:
the loops of the types run in differentiated form (interface/codegen/loop_derivatives.py).
Reactions have stiffness too: D^T lambda changes its direction where bodies move, without which a
hanging pendulum has no frequency.

Displacements are (delta r, theta) of each body, with theta a rotation vector in global axes,
A <- (1 + theta~) A, at unchanged velocities (r_dot, omega), omega in global axes; forces are
(force, moment about the mass centre), global axes. So every vector has 6 n components, in the order
of the bodies.
"""

from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.formulations.common.sparse_entries import SparseEntries, components
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.interface.codegen.loop_derivatives import LoopDerivatives, differentiate_loop
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.model import Group, Model
from dap3d_core.model.element_states import paths_where
from dap3d_core.model.rotations import rotation, skew
from dap3d_core.model.state_layout import split, velocities_of
from dap3d_core.registry.suggestions import some
from dap3d_core.simulation.errors import SimulationError

if TYPE_CHECKING:
    from dap3d_core.formulations.common.state_derivatives import StateDerivatives


@attrs.frozen(eq=False, kw_only=True)
class TangentMatrices:
    """The equations of motion at a state and their derivatives; matrices are scipy CSR arrays.

    With R = f + D^T lambda - M a, the derivatives are those of R at fixed a and lambda.

    Attributes:
        M: (6 n, 6 n) mass matrix, kg and kg m^2, global axes.
        f: (6 n,) applied forces and moments, with the gyroscopic moments -omega x J omega, the
            friction of joints and forces on reactions.
        a: (6 n,) accelerations r_ddot, omega_dot at which R was differentiated.
        multipliers: (rows,) lambda at which R was differentiated.
        D: (rows, 6 n) constraint Jacobian.
        stiffness: (6 n, 6 n) -dR/dx by displacements, reactions and inertia included.
        damping: (6 n, 6 n) -dR/dv by velocities, gyroscopic terms included.
        friction_by_multipliers: (6 n, rows) df/dlambda; without entries where no force depends on
            reactions.
        velocity_by_displacement: (rows, 6 n) d(D v - nu)/dx; by velocities it is D.
        acceleration_by_displacement: (rows, 6 n) d(D a - gamma)/dx at fixed a.
        acceleration_by_velocity: (rows, 6 n) d(D a - gamma)/dv.
        states: the derivatives by and of states of elements; None where there are none.
    """

    M: Any
    f: Floats
    a: Floats
    multipliers: Floats
    D: Any
    stiffness: Any
    damping: Any
    friction_by_multipliers: Any
    velocity_by_displacement: Any
    acceleration_by_displacement: Any
    acceleration_by_velocity: Any
    states: "StateDerivatives | None" = None


def tangent_matrices(
    evaluator: Evaluator,
    t: float,
    u: Floats,
    multipliers: Floats | None = None,
    a: Floats | None = None,
) -> TangentMatrices:
    """Derivatives of the equations of motion at time t and state u (13 n,).

    Args:
        evaluator: of the model, by an exact formulation.
        t, u: time, s; state. Counted turns are those that the evaluator has.
        multipliers: (rows,) lambda; with ``a`` by default those of the motion from this state.
        a: (6 n,) accelerations; zeros for statics.

    Raises:
        SimulationError: a derivative is not finite; names the elements.
    """
    model = evaluator.model
    if multipliers is None or a is None:
        reported = evaluator.report(t, u)
        layout = model.report_layout
        a = reported[layout["v_dot"]] if a is None else a
        multipliers = reported[layout["Lam"]] if multipliers is None else multipliers
    D = evaluator.rows(t, u).sparse()
    evaluator.place(t, u)
    assembly = _Assembly(evaluator, t, np.asarray(multipliers, float), np.asarray(a, float), u)
    for loop, (kind, group) in enumerate(evaluator.loop_groups):
        if kind in ("wrench", "friction", "acceleration"):
            assembly.add(loop, kind, group)
    M = assembly.add_inertia(u)
    states = None
    if model.state_count:
        from dap3d_core.formulations.common.state_derivatives import state_derivatives

        states = state_derivatives(evaluator, t, velocities_of(u), assembly.multipliers, assembly.a)
        _check_states(model, states, t)
    return TangentMatrices(
        M=M,
        f=assembly.f,
        a=assembly.a,
        multipliers=assembly.multipliers,
        D=D,
        states=states,
        **assembly.matrices(),
    )


def _joints_read(model: Model, group: Group) -> list[tuple[Integers, int]]:
    """The joints whose multipliers the instances of a group read, (m,) each, and their rows."""
    joints = [j.members for j in group.read] if group.joints is None else [group.joints]
    if group.type_info.type.is_contact:
        joints = [group.members]
    found = [(members, int(model.joint_rows[members[0]])) for members in joints]
    if group.loaded is not None:
        type_: Any = group.type_info.type
        found.append((group.loaded, type_.load[-1] + 1))
    return found


def _check_states(model: Model, own: "StateDerivatives", t: float) -> None:
    """Refuses rates of states without derivatives; names the states."""
    wrong = ~np.isfinite(own.rates)
    for matrix in (own.rate_by_displacement, own.rate_by_velocity, own.rate_by_states):
        wrong |= ~np.isfinite(np.asarray(abs(matrix).sum(axis=1)).ravel())
    if names := paths_where(model.element_states, wrong):
        raise SimulationError(
            f"the rate of {some(names)} has no derivative at t = {t:g} s: the "
            "equations cannot be linearised here; move the state off this point"
        )


class _Assembly:
    """Adds up the derivatives of all elements."""

    def __init__(
        self, evaluator: Evaluator, t: float, multipliers: Floats, a: Floats, u: Floats
    ) -> None:
        model: Model = evaluator.model
        self.evaluator, self.t, self.model = evaluator, t, model
        self.multipliers, self.a = multipliers, a
        six, rows = 6 * model.body_count, model.row_count
        self.f = np.zeros(six)
        names = ("stiffness", "damping")
        self.entries = {name: SparseEntries(six, six) for name in names}
        self.entries["friction_by_multipliers"] = SparseEntries(six, rows)
        for name in ("velocity_by_displacement", "acceleration_by_displacement",
                     "acceleration_by_velocity"):  # fmt: skip
            self.entries[name] = SparseEntries(rows, six)
        _, _, v, w = split(u)
        ground = np.zeros((1, 6))
        self.v = np.vstack([ground, np.hstack([v, w])])
        self.a_of_body = np.vstack([ground, a.reshape(-1, 6)])
        place = evaluator.system.row
        self.model_row = np.zeros(len(evaluator.system.multipliers), dtype=np.int64)
        self.model_row[place] = np.arange(rows)
        self.minus_lambda = np.zeros(len(self.model_row))
        self.minus_lambda[place] = -multipliers

    def matrices(self) -> dict[str, Any]:
        """All matrices by name."""
        return {name: entries.matrix() for name, entries in self.entries.items()}

    def add(self, loop: int, kind: str, group: Group) -> None:
        """Add the elements of a group."""
        system = self.evaluator.system
        i0, p0, count = system.groups[loop].tolist()
        own = differentiate_loop(
            group.type_info, kind, self.t, system, (i0, p0, count), self.minus_lambda
        )
        if not all(np.all(np.isfinite(x)) for pair in own.outputs.values() for x in pair):
            raise SimulationError(self._not_finite(kind, group, own))
        if kind == "acceleration":
            self._add_joints(group, own)
        else:
            self._add_forces(kind, group, own)

    def _add_forces(self, kind: str, group: Group, own: LoopDerivatives) -> None:
        value, slope = own.outputs[kind]
        slots = value.shape[1]
        row = components(own.bodies[:, :slots])  # (m, slots, 6)
        np.add.at(self.f, row[row >= 0], value[row >= 0])
        self._add_by_motion(own.bodies, row, -slope, "stiffness", "damping")
        if kind == "friction":
            first = 12 * own.bodies.shape[1]
            for members, rows in _joints_read(self.model, group):
                column = self.model.joint_start[members][:, None, None, None] + np.arange(rows)
                part = slope[..., first : first + rows]
                self.entries["friction_by_multipliers"].add(row[..., None], column, part)
                first += rows

    def _add_joints(self, group: Group, own: LoopDerivatives) -> None:
        J, J_slope = own.outputs["J"]
        slots, rows = J.shape[1:3]
        bodies = own.bodies[:, :slots]
        start = self.model.joint_start[group.members]
        row = start[:, None] + np.arange(rows)  # (m, rows)
        reaction = np.einsum("msrcd,mr->mscd", J_slope, self.multipliers[row])
        self._add_by_motion(own.bodies, components(bodies), -reaction, "stiffness", "damping")
        rate = np.einsum("msrcd,msc->mrd", J_slope, self.v[bodies]) - own.outputs["nu"][1]
        self._add_by_motion(own.bodies, row, rate, "velocity_by_displacement", None)
        acceleration = np.einsum("msrcd,msc->mrd", J_slope, self.a_of_body[bodies])
        acceleration -= own.outputs["gamma"][1]
        self._add_by_motion(own.bodies, row, acceleration, "acceleration_by_displacement",
                            "acceleration_by_velocity")  # fmt: skip

    def _add_by_motion(
        self, bodies: Integers, row: Integers, slope: Floats, positions: str, velocities: str | None
    ) -> None:
        """Add slopes (*row.shape, d) to the matrices of displacements and of velocities."""
        columns = components(bodies)  # (m, places, 6)
        more = (1,) * (row.ndim - 1)
        for place in range(bodies.shape[1]):
            column = columns[:, place].reshape(len(bodies), *more, 6)
            part = slope[..., 12 * place : 12 * place + 12]
            self.entries[positions].add(row[..., None], column, part[..., :6])
            if velocities:
                self.entries[velocities].add(row[..., None], column, part[..., 6:])

    def add_inertia(self, u: Floats) -> Any:
        """Add the gyroscopic moments and the derivatives of M a; returns M."""
        model = self.model
        n = model.body_count
        _, p, _, w = split(u)
        A = rotation(p)
        J = A @ model.Jp @ np.swapaxes(A, -1, -2)
        blocks = np.zeros((n, 6, 6))
        blocks[:, :3, :3] = model.mass[:, None, None] * np.eye(3)
        blocks[:, 3:, 3:] = J
        place = np.arange(6 * n).reshape(n, 6)
        mass = SparseEntries(6 * n, 6 * n)
        mass.add(place[:, :, None], place[:, None, :], blocks)
        h, alpha = _times(J, w), self.a.reshape(n, 6)[:, 3:]
        self.f[place[:, 3:]] -= np.cross(w, h)
        w_tilde, h_tilde = skew(w), skew(h)
        turning = w_tilde @ (J @ w_tilde - h_tilde) + J @ skew(alpha) - skew(_times(J, alpha))
        where = place[:, 3:, None], place[:, None, 3:]
        self.entries["stiffness"].add(*where, turning)
        self.entries["damping"].add(*where, w_tilde @ J - h_tilde)
        return mass.matrix()

    def _not_finite(self, kind: str, group: Group, own: LoopDerivatives) -> str:
        """Which elements have no derivative here, in words."""
        wrong = np.zeros(group.count, dtype=bool)
        for pair in own.outputs.values():
            for x in pair:
                wrong |= ~np.isfinite(x.reshape(group.count, -1)).all(axis=1)
        model = self.model
        is_joint = group.type_info.type.kind == "joint" and kind == "acceleration"
        names = model.joint_names if is_joint else model.force_names
        words = list(dict.fromkeys(names[int(k)] for k in group.members[wrong]))
        return (
            f"{'joint' if is_joint else 'force'} {some(words)} has no derivative at "
            f"t = {self.t:g} s: the equations cannot be linearised here; move the state off this "
            "point"
        )


def _times(J: Floats, w: Floats) -> Floats:
    """J w for each body."""
    return np.einsum("nij,nj->ni", J, w)
