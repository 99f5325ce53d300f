"""The least change of a state that fulfils linear equations, and what a change makes of its rows.

The least sum of squares of displacements in m (in units of ``Model.length`` where the scene is not
of ordinary size) and rotations in rad as they are (metric "unit", the manual's), or weighted by
masses and inertias (metric "mass").
"""

import attrs
import numpy as np

from dap3d_core.assembly.arrays import System
from dap3d_core.formulations.arrays import set_metric
from dap3d_core.formulations.constraint_rows import ConstraintRows, scaled_rows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.linear.rank import DENSE_ROWS, FEW_ROWS, factor_independent, has_loops
from dap3d_core.model.rigid_motion import conjugate, quaternion_product, rotation_vector
from dap3d_core.model.rotations import euler_rates
from dap3d_core.model.state_layout import join, split, velocities_of
from dap3d_core.simulation.errors import AssemblyError
from dap3d_core.simulation.failure.diagnosis import find_offender

#: Singular values below this part of the largest are left out of the least-norm solution.
RCOND = 1e-10


def finite_rows(evaluator: Evaluator, t: float, u: Floats) -> ConstraintRows:
    """All constraint rows at a state u (13 n,).

    Raises:
        AssemblyError: one of them is not finite there; the message names joint or function.
    """
    rows = evaluator.rows(t, u)
    good = np.isfinite(rows.C) & np.isfinite(rows.nu) & np.isfinite(rows.gamma)
    good[rows.row[~np.isfinite(rows.value)]] = False
    if not np.all(good):
        joint = evaluator.model.row_owner(int(np.argmin(good)))
        culprit = find_offender(evaluator, t, evaluator.integrated(u), t)
        culprit = culprit or f"joint {joint} is not finite"
        raise AssemblyError(f"the initial positions cannot be assembled: {culprit}")
    return rows


def quadratic_part(evaluator: Evaluator, still: Floats, v: Floats, t: float) -> Floats:
    """The part of gamma (rows,) that is quadratic in the velocities, at v (6 n,).

    still: (13 n,) the pose, without velocities.
    """
    total = -2.0 * finite_rows(evaluator, t, still).gamma
    for sign in (1.0, -1.0):
        moving = still.copy()
        velocities_of(moving)[:] = sign * v
        total += finite_rows(evaluator, t, moving).gamma
    return 0.5 * total


def least_change(
    evaluator: Evaluator,
    rows: ConstraintRows,
    residual: Floats,
    t: float,
    held: Integers | None = None,
    metric: str = "unit",
) -> Floats:
    """The shortest x (6 n,) with D x = residual, on all rows.

    With ``held`` (bodies, maybe none) on the position rows alone, and zero on these bodies.
    """
    count = evaluator.model.row_count
    if count > DENSE_ROWS or (
        count > FEW_ROWS
        and (held is None or not len(held))
        and not has_loops(evaluator.plan, evaluator.blocks(rows))
    ):
        return sparse_least_change(evaluator, residual, t, held, metric)
    D, residual = scaled_system(evaluator, rows, residual, held, metric)
    solution: Floats = np.asarray(np.linalg.lstsq(D, residual, rcond=RCOND)[0], dtype=np.float64)
    change = displacements(evaluator, solution, metric)
    if held is not None:
        change[held - 1] = 0.0  # rounding
    return change.ravel()


def scaled_system(
    evaluator: Evaluator, rows: ConstraintRows, residual: Floats, held: Integers | None, metric: str
) -> tuple[Floats, Floats]:
    """D (m, 6 n) and the residual (m,) in coordinates whose least squares are the least change."""
    length = evaluator.model.length
    if length != 1.0:  # rows of very different units
        gradient = scaled_rows(rows, length)[1]
        rows = attrs.evolve(rows, value=rows.value / gradient[rows.row])
        residual = residual / gradient
    D = rows.dense()
    if held is None:
        held = np.zeros(0, dtype=np.int64)
    else:
        keep = evaluator.model.position_row
        D, residual = D[keep], residual[keep]
    block = D.reshape(len(D), -1, 6)
    block[:, held - 1] = 0.0
    scale, frame = mass_scaling(evaluator)
    if metric == "mass":
        block[:, :, :3] *= scale
        block[:, :, 3:] = np.einsum("mbr,brc->mbc", block[:, :, 3:], frame)
    else:
        block[:, :, :3] *= length
    return D, residual


def displacements(evaluator: Evaluator, x: Floats, metric: str) -> Floats:
    """From these coordinates (6 n,) to displacements (n, 6) in m and rad."""
    change = x.reshape(-1, 6).copy()
    if metric == "mass":
        return unscaled(change, *mass_scaling(evaluator))
    change[:, :3] *= evaluator.model.length
    return change


def mass_scaling(evaluator: Evaluator) -> tuple[Floats, Floats]:
    """1/sqrt(m) (n, 1) and B (n, 3, 3) of the bodies as placed (linear/ldlt/factor.py)."""
    metric = evaluator.system.metric[1:]
    return metric[:, :1], metric[:, 7:16].reshape(-1, 3, 3)


def unscaled(change: Floats, scale: Floats, frame: Floats) -> Floats:
    """From the coordinates in which masses are one, (n, 6), to metres and rad in global axes."""
    return np.hstack([scale * change[:, :3], np.einsum("brc,bc->br", frame, change[:, 3:])])


def sparse_least_change(
    evaluator: Evaluator,
    residual: Floats,
    t: float,
    held: Integers | None = None,
    metric: str = "unit",
) -> Floats:
    """The same by the block factorisation, for many rows; metric "unit" sets every mass to one."""
    from dap3d_core.formulations.common.constraints import correct, linearise

    system: System = evaluator.system
    before = system.metric.copy()
    n = evaluator.model.body_count
    try:
        if metric == "unit":
            light = np.full(n, evaluator.model.length**-2)
            set_metric(system.metric, light, np.tile(np.eye(3), (n, 1, 1)))
            system.metric[1:, 7:16] = system.body[1:, 3:12]
        if held is not None:
            system.metric[held] = 0.0
        linearise(t, system, evaluator.loops)
        if held is not None:
            row, _, place = evaluator.pattern
            system.D[place[~evaluator.model.position_row[row]]] = 0.0
        factor_independent(evaluator.plan, system.D, system.K)
        system.residual[:] = 0.0
        system.residual[system.row] = -residual
        correct(system)
        change = unscaled(system.change[6:].reshape(n, 6), *mass_scaling(evaluator))
    finally:
        system.metric[:] = before
    return change.ravel()


def displaced(u: Floats, change: Floats) -> Floats:
    """The state with r + dr, and with p + 1/2 G^T dtheta of unit length (dtheta global, small).

    change: (n, 6) or (6 n,) dr, dtheta of each body.
    """
    r, p, v, w = split(u)
    change = change.reshape(-1, 6)
    p = p + euler_rates(p, change[:, 3:])
    return join(r + change[:, :3], p / np.linalg.norm(p, axis=1, keepdims=True), v, w)


def largest_move(change: Floats) -> tuple[float, float]:
    """Largest displacement, m, and rotation, rad, of a body in a change (n, 6) or (6 n,)."""
    moves = change.reshape(-1, 2, 3)
    shift, turn = np.max(np.linalg.norm(moves, axis=2), axis=0, initial=0.0).tolist()
    return shift, turn


def displacement(u: Floats, other: Floats) -> tuple[Floats, Floats]:
    """Displacements, m, and rotation vectors, rad, global axes, (n, 3), from a state to another."""
    r, p, _, _ = split(u)
    s, q, _, _ = split(other)
    return s - r, rotation_vector(quaternion_product(q, conjugate(p)))
