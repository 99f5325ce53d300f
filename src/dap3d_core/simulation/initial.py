"""Initial conditions brought onto the constraints, at position and at velocity level (spec 8)."""

from collections.abc import Collection
from itertools import pairwise

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.assembly.system import System
from dap3d_core.formulations.build import set_metric
from dap3d_core.formulations.machine import Machine, Rows
from dap3d_core.linear.plan import Integers
from dap3d_core.linear.rank import DENSE_ROWS, factor_independent
from dap3d_core.model.kinematics import join, split
from dap3d_core.simulation.errors import AssemblyError
from dap3d_core.simulation.offender import find_offender

Floats = NDArray[np.float64]

#: Position residuals above this are corrected; Newton stops below it.
TOLERANCE = 1e-10
MOST_PASSES = 25
#: A pass turns no body by more than this (rad), moves none by more than this part of the model.
MOST_TURN, MOST_SHIFT = 0.5, 0.5
#: Singular values below this part of the largest are left out of the least-norm solution.
RCOND = 1e-10


@attrs.frozen(eq=False)
class Initial:
    """A corrected start.

    Attributes:
        u: (13 n,) the state.
        violation: (position, velocity) largest residuals as given.
        residual: the same after the correction.
        passes: Newton passes at position level.
        moved, turned: largest displacement in m and rotation in rad of a body.
    """

    u: Floats
    violation: tuple[float, float]
    residual: tuple[float, float]
    passes: int
    moved: float
    turned: float


def finite_rows(machine: Machine, t: float, u: Floats) -> Rows:
    """All constraint rows at a state u (13 n,).

    Raises:
        AssemblyError: one of them is not finite there; the message names joint or function.
    """
    rows = machine.rows(t, u)
    good = np.isfinite(rows.C) & np.isfinite(rows.nu) & np.isfinite(rows.gamma)
    good[rows.row[~np.isfinite(rows.value)]] = False
    if not np.all(good):
        joint = machine.model.row_owner(int(np.argmin(good)))
        culprit = find_offender(machine, t, machine.integrated(u), t)
        culprit = culprit or f"joint {joint} is not finite"
        raise AssemblyError(f"the initial positions cannot be assembled: {culprit}")
    return rows


def violation(machine: Machine, u: Floats, t: float = 0.0) -> tuple[float, float]:
    """Largest residuals |C| and |D v - nu| of a state u (13 n,)."""
    if not machine.model.row_count:
        return 0.0, 0.0
    rows = finite_rows(machine, t, u)
    return _largest(rows.C), _largest(_velocity_residual(rows, u))


def correct_initial(
    machine: Machine, u: Floats, t: float = 0.0, hold: Collection[int] = ()
) -> Initial:
    """Correct positions by Newton's method, velocities by a linear step, each by the least change.

    The least change is that of the sum of squares of displacements, rotations and velocities, as in
    the manual. Rows without a position level do not take part in the position stage.

    Args:
        machine: the model.
        u: (13 n,) the state as given.
        t: time, s.
        hold: bodies, from 1, that the position stage leaves where they are.

    Raises:
        AssemblyError: the position residual does not vanish; the message has that of each joint.
    """
    before = violation(machine, u, t)
    if not machine.model.row_count:
        return Initial(u, before, before, 0, 0.0, 0.0)
    start = u
    held = np.array(sorted(hold), dtype=np.int64)
    u, passes = _correct_positions(machine, u, t, held)
    rows = finite_rows(machine, t, u)
    residual = _velocity_residual(rows, u)
    if _largest(residual) > 0.0:
        u = u.copy()
        velocities = u[7 * machine.model.body_count :]
        velocities -= _least_change(machine, rows, residual, t)
    moved, turned = _distance(start, u, machine.model.body_count)
    return Initial(u, before, violation(machine, u, t), passes, moved, turned)


def _correct_positions(machine: Machine, u: Floats, t: float, held: Integers) -> tuple[Floats, int]:
    size = _model_size(machine)
    for passes in range(MOST_PASSES + 1):
        rows = finite_rows(machine, t, u)
        if _largest(rows.C) <= TOLERANCE:
            return u, passes
        if passes == MOST_PASSES:
            break
        change = _least_change(machine, rows, rows.C, t, held).reshape(-1, 6)
        shift = float(np.max(np.linalg.norm(change[:, :3], axis=1)))
        turn = float(np.max(np.linalg.norm(change[:, 3:], axis=1)))
        shift_limit = MOST_SHIFT * size / shift if shift else 1.0
        turn_limit = MOST_TURN / turn if turn else 1.0
        limit = min(1.0, shift_limit, turn_limit)
        u = _displaced(u, -limit * change, machine.model.body_count)
    raise AssemblyError(_failure(machine, rows.C, passes, held))


def _least_change(
    machine: Machine, rows: Rows, residual: Floats, t: float, held: Integers | None = None
) -> Floats:
    """The shortest x (6 n,) with D x = residual, on all rows.

    With ``held`` (bodies, maybe none) on the position rows alone, and zero on these bodies.
    """
    if machine.model.row_count > DENSE_ROWS:
        return _sparse_least_change(machine, residual, t, held)
    D = rows.dense()
    if held is None:
        held = np.zeros(0, dtype=np.int64)
    else:
        keep = machine.model.position_row
        D, residual = D[keep], residual[keep]
    D.reshape(len(D), -1, 6)[:, held - 1] = 0.0
    solution: Floats = np.asarray(np.linalg.lstsq(D, residual, rcond=RCOND)[0], dtype=np.float64)
    solution.reshape(-1, 6)[held - 1] = 0.0  # rounding
    return solution


def _sparse_least_change(
    machine: Machine, residual: Floats, t: float, held: Integers | None
) -> Floats:
    """The same by the block factorisation, every mass and inertia set to one; for many rows."""
    from dap3d_core.formulations.standard import correct, linearise

    system: System = machine.system
    metric = system.metric.copy()
    n = machine.model.body_count
    try:
        set_metric(system.metric, np.ones(n), np.tile(np.eye(3), (n, 1, 1)))
        system.metric[1:, 7:16] = system.body[1:, 3:12]
        if held is not None:
            system.metric[held] = 0.0
        linearise(t, system, machine.loops, False)
        if held is not None:
            row, _, place = machine.pattern
            system.D[place[~machine.model.position_row[row]]] = 0.0
        factor_independent(machine.plan, system.D, system.K)
        system.C[:] = 0.0
        system.C[system.row] = -residual
        correct(system)
        change = system.force[6:].reshape(n, 6).copy()
    finally:
        system.metric[:] = metric
    A = system.body[1:, 3:12].reshape(n, 3, 3)
    change[:, 3:] = np.einsum("brc,bc->br", A, change[:, 3:])  # body axes there, global ones here
    return change.ravel()


def _displaced(u: Floats, change: Floats, n: int) -> Floats:
    """The state with r + dr, and with p + 1/2 G^T dtheta of unit length (dtheta global, small)."""
    r, p, v, w = split(u, n)
    e0, e, turn = p[:, :1], p[:, 1:], 0.5 * change[:, 3:]
    dp = np.hstack([-np.sum(e * turn, axis=1, keepdims=True), e0 * turn + np.cross(turn, e)])
    p = p + dp
    return join(r + change[:, :3], p / np.linalg.norm(p, axis=1, keepdims=True), v, w)


def _distance(u: Floats, other: Floats, n: int) -> tuple[float, float]:
    r, p, _, _ = split(u, n)
    s, q, _, _ = split(other, n)
    cosine = np.clip(np.abs(np.sum(p * q, axis=1)), 0.0, 1.0)
    sine = np.linalg.norm(p - np.sign(np.sum(p * q, axis=1))[:, None] * q, axis=1)
    small, large = 4.0 * np.arcsin(np.clip(sine / 2.0, 0, 1)), 2.0 * np.arccos(cosine)
    angle = np.where(cosine > 0.9, small, large)
    shift = np.linalg.norm(r - s, axis=1)
    return float(np.max(shift, initial=0.0)), float(np.max(angle, initial=0.0))


def _velocity_residual(rows: Rows, u: Floats) -> Floats:
    v = u[-rows.shape[1] :]
    return np.bincount(rows.row, rows.value * v[rows.column], minlength=rows.shape[0]) - rows.nu


def _model_size(machine: Machine) -> float:
    """A length of the model: its extent, or one metre where it has none."""
    points = np.vstack([machine.model.r, machine.model.point_local])
    return float(np.max(np.abs(points), initial=0.0)) or 1.0


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values), initial=0.0))


def _failure(machine: Machine, C: Floats, passes: int, held: Integers) -> str:
    model = machine.model
    worst = np.array([_largest(C[a:b]) for a, b in pairwise(model.joint_start)])
    still_open = [k for k in np.argsort(-worst)[:10] if worst[k] > TOLERANCE]
    names = ", ".join(model.body_names[b - 1] for b in held)
    return "\n".join(
        [
            "the initial positions cannot be assembled: "
            f"after {passes} passes these joints are still open",
            *(f"  {model.joint_names[k]}: residual {worst[k]:.3g}" for k in still_open),
            "check the points, axes and lengths of these joints; "
            "contradictory joints cannot be assembled",
            *([f"held where they are: {names}"] if names else []),
        ]
    )
