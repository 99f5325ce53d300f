"""Tests if redundant constraints are so at all poses, or only at one.

The rank can drop at special poses: links in line, axes parallel. Near a pose it can only be higher,
so other poses of the same assembly tell: the bodies are moved along a random direction that the
position rows leave free, put together again, and the rank is taken there.
"""

import attrs
import numpy as np

from dap3d_core.formulations.constraint_rows import scaled_rows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.state_layout import coordinates_of
from dap3d_core.simulation.errors import AssemblyError
from dap3d_core.simulation.initial.assemble import Assembly
from dap3d_core.simulation.initial.least_change import (
    displaced,
    finite_rows,
    largest_move,
    least_change,
)
from dap3d_core.simulation.redundancy.redundancy import Redundancy, rank_of

#: Poses that are tried up to this many rows; beyond, the last number.
POSES = ((300, 3), (1000, 2), (10**9, 1))
#: No body is turned by more than this (rad), or moved by more than this part of the model.
TURN, SHIFT = 0.4, 0.2
#: A move that cannot be put together is tried again at half its size, so many times.
HALVINGS = 5
#: What is left of a random direction below this part is rounding: nothing can move.
FREE = 1e-8
#: A pose counts as another one if it differs by this part of the requested one.
ANOTHER = 0.05

NONE = np.zeros(0, dtype=np.int64)


@attrs.frozen
class GenericRank:
    """Redundancy of the same scene at other poses.

    Attributes:
        poses: ranks found there.
        redundant: rows that are redundant at all of them; None where nothing could be moved.
        everywhere: whether as many are redundant there as at the pose asked about; None where
            nothing could be moved.
    """

    poses: tuple[int, ...]
    redundant: int | None
    everywhere: bool | None

    def describe(self, redundancy: Redundancy) -> str:
        """A sentence without its full stop."""
        here = redundancy.rank.redundant
        if self.everywhere is None:
            return (
                "whether they are redundant everywhere or only at this pose cannot be told: "
                "the scene cannot be moved"
            )
        count = len(self.poses)
        poses = "another pose" if count == 1 else f"{count} other poses"
        if self.everywhere:
            return f"as many are redundant at {poses}: it is not this pose alone"
        ranks = ", ".join(str(rank) for rank in self.poses)
        return (
            f"{here - (self.redundant or 0)} of the {here} are redundant only at this pose, "
            f"{self.redundant or 'none'} at {poses} too (ranks there: {ranks})"
        )


def redundancy_elsewhere(evaluator: Evaluator, u: Floats, redundancy: Redundancy) -> GenericRank:
    """Take the rank at other poses that the joints allow at t = 0; the same ones each time.

    Args:
        u: (13 n,) an assembled state.
        redundancy: that of u.
    """
    rows = evaluator.model.row_count
    count = next(number for limit, number in POSES if rows <= limit)
    ranks = []
    for k in range(count):
        other = _other_pose(evaluator, u, np.random.default_rng(k))
        if other is not None:
            rows_there = finite_rows(evaluator, 0.0, other)
            ranks.append(
                rank_of(evaluator, scaled_rows(rows_there, evaluator.model.length)[0]).rank
            )
    if not ranks:
        return GenericRank((), None, None)
    redundant = rows - max(ranks)
    return GenericRank(tuple(ranks), redundant, redundant == redundancy.rank.redundant)


def _other_pose(evaluator: Evaluator, u: Floats, rng: "np.random.Generator") -> Floats | None:
    """A state at another pose, or None where the joints allow none."""
    n, size = evaluator.model.body_count, evaluator.model.size
    rows = finite_rows(evaluator, 0.0, u)
    wish = rng.standard_normal((n, 6))
    wish[:, :3] *= size
    wish = wish.ravel()
    free = wish - least_change(evaluator, rows, rows.product(wish), 0.0, NONE)
    if np.linalg.norm(free) <= FREE * np.linalg.norm(wish):
        return None
    shift, turn = largest_move(free)
    extent = max(shift / (SHIFT * size), turn / TURN)
    for halving in range(HALVINGS + 1):
        step = free / (extent * 2.0**halving)
        try:
            other, _ = Assembly(evaluator).close(displaced(u, step))
        except AssemblyError:
            continue
        gone = np.linalg.norm(coordinates_of(other - u))
        if gone > ANOTHER * np.linalg.norm(coordinates_of(displaced(u, step) - u)):
            return other
    return None
