"""Poses and states of elements at rest together: forces balance, and rates vanish."""

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.simulation.equilibrium.states_at_rest import (
    MOST_STEPS,
    OPEN,
    SETTLED,
    unsettled_part,
)
from dap3d_core.simulation.equilibrium.statics import StaticPose, Statics
from dap3d_core.simulation.errors import AssemblyError


def find_together(statics: Statics, pose: StaticPose) -> StaticPose | None:
    """The pose at which forces and rates vanish, by Newton's method; None where it finds none."""
    evaluator, kept, before = statics.evaluator, statics.evaluator.states, np.inf
    for _ in range(MOST_STEPS):
        fixed = statics.fixed_tangent(pose)
        own = fixed.states
        assert own is not None
        left = max(pose.residual, unsettled_part(own, evaluator.states))
        if left <= SETTLED:
            return pose
        if not left < 1e3 * before:
            break
        before = min(before, left)
        basis = statics.scale[:, None] * pose.free
        matrix = np.block(
            [[-statics.reduced(fixed.stiffness, pose), basis.T @ own.force_by_states.toarray()],
             [own.rate_by_displacement @ basis, own.rate_by_states.toarray()]]
        )  # fmt: skip
        step = _least_solution(matrix, -np.concatenate([pose.unbalanced, own.rates]))
        evaluator.states = evaluator.states + step[pose.free.shape[1] :]
        try:
            moved = statics.moved(pose.u, pose.free @ step[: pose.free.shape[1]])
            pose = statics.at(statics.closed(moved))
        except (AssemblyError, np.linalg.LinAlgError):
            break
    evaluator.states = kept
    return None


def _least_solution(matrix: Floats, side: Floats) -> Floats:
    """The least solution of equations of different units, columns and rows scaled."""
    rows = np.max(np.abs(matrix), axis=1, initial=0.0)
    rows[rows == 0.0] = 1.0
    columns = np.max(np.abs(matrix / rows[:, None]), axis=0, initial=0.0)
    columns[columns == 0.0] = 1.0
    scaled = matrix / rows[:, None] / columns
    found: Floats = np.linalg.lstsq(scaled, side / rows, rcond=OPEN)[0] / columns
    return found
