"""Freedoms that joints and drivers leave, in words: the bodies that move, and how."""

from collections.abc import Mapping

import numpy as np

from dap3d_core.formulations.constraint_rows import scaled_rows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.linear.rank import DENSE_ROWS
from dap3d_core.model import Model
from dap3d_core.model.rotations import euler_rates
from dap3d_core.model.state_layout import split
from dap3d_core.registry.suggestions import some
from dap3d_core.simulation.initial.least_change import finite_rows
from dap3d_core.simulation.redundancy.redundancy import rank_of

#: Parts of a motion smaller than this part of the largest are not named.
NAMED = 1e-6
#: Coordinates of joints are named that change by more than this part of those of bodies.
PREFERRED = 1e-3
#: Motions that a message gives.
MOST_MOTIONS = 6


def free_motions(evaluator: Evaluator, u: Floats) -> Floats:
    """(6 n, dof) motions in m, rad that the rows allow at t = 0 and u (13 n,), each by itself.

    Each has one coordinate of size one that the others lack, so that motions of different bodies
    do not mix. None where the scene has more than DENSE_ROWS rows.
    """
    model = evaluator.model
    columns = 6 * model.body_count
    if not model.row_count:
        return np.eye(columns)
    if model.row_count > DENSE_ROWS:
        return np.zeros((columns, 0))
    from scipy.linalg import qr

    rows = scaled_rows(finite_rows(evaluator, 0.0, u), model.size)[0]
    rank = rank_of(evaluator, rows).rank
    free = np.linalg.svd(rows.dense())[2][rank:].T
    if not free.shape[1]:
        return free
    chosen = qr(free.T, pivoting=True, mode="r")[1][: free.shape[1]]
    apart = free @ np.linalg.inv(free[chosen])
    return np.asarray(apart * np.tile(np.repeat([model.size, 1.0], 3), model.body_count)[:, None])


def coordinates_of(
    model: Model, u: Floats, motions: Floats, joints: Mapping[str, Floats]
) -> list[str]:
    """Positions that tell motions (6 n, k) in m and rad apart at a state u (13 n,), k names.

    Coordinates of joints come first, by their slopes (6 n,): an angle changes by 1 for a turn of
    1 rad. The Euler parameters stand with twice their changes, which is as much.
    """
    from scipy.linalg import qr

    p = split(u)[1]
    moves = motions.reshape(len(p), 6, -1)
    turns = euler_rates(p[:, None], np.swapaxes(moves[:, 3:], 1, 2))
    changes = np.concatenate([moves[:, :3] / model.size, 2.0 * np.swapaxes(turns, 1, 2)], axis=1)
    names = [f"{body}.{name}" for body in model.body_names
             for name in ("r.x", "r.y", "r.z", "p.e0", "p.e1", "p.e2", "p.e3")]  # fmt: skip
    of_joints = [slope @ motions / PREFERRED for slope in joints.values()]
    names += joints
    changes = np.vstack([changes.reshape(-1, motions.shape[1]), *of_joints])
    order = qr(changes.T, pivoting=True, mode="r")[1]
    return [names[k] for k in order[: motions.shape[1]]]


def motion_words(model: Model, motion: Floats) -> str:
    """A motion (6 n,) in m and rad in words: "coupler turns about [0, 0, 1]"."""
    moves = motion.reshape(-1, 6)
    sizes = [np.linalg.norm(moves[:, :3], axis=1) / model.size,
             np.linalg.norm(moves[:, 3:], axis=1)]  # fmt: skip
    largest = float(np.max(sizes, initial=0.0)) or 1.0
    words = []
    for name, move, shift, turn in zip(model.body_names, moves, *sizes, strict=True):
        parts = []
        if turn > NAMED * largest:
            parts.append(f"turns about {_direction(move[3:])}")
        if shift > NAMED * largest:
            parts.append(f"moves along {_direction(move[:3])}")
        if parts:
            words.append((max(shift, turn), f"{name} {' and '.join(parts)}"))
    words.sort(key=lambda pair: -pair[0])
    return some([text for _, text in words], between="; ")


def freedoms_left(evaluator: Evaluator, u: Floats, dof: int) -> str:
    """The freedoms at a state at t = 0 as a paragraph, a line for each."""
    model = evaluator.model
    motions = free_motions(evaluator, u).T
    count = f"{dof} degree{'s' if dof != 1 else ''} of freedom {'are' if dof != 1 else 'is'} left"
    lines = [f"  ({k}) {motion_words(model, motion)}"
             for k, motion in enumerate(motions[:MOST_MOTIONS], start=1)]  # fmt: skip
    if len(motions) > MOST_MOTIONS:
        lines.append(f"  and {len(motions) - MOST_MOTIONS} more")
    return "\n".join([f"{count}:" if lines else count, *lines])


def _direction(vector: Floats) -> str:
    """A unit vector as text, its largest component positive or not as it is."""
    unit = vector / np.linalg.norm(vector)
    unit = np.where(np.abs(unit) > NAMED, unit, 0.0)
    return "[" + ", ".join(f"{c + 0.0:.3g}" for c in unit) + "]"
