"""Joints that nearly depend on each other and bind: hinges of a door whose axes nearly agree.

Rows whose combination vanishes but for a small number s are neither of two things. Below
``FIT`` they count as redundant: the joints are put together to no more than that. From ``HELD`` on
the equations of motion hold them. Between the two the equations let the bodies move and the
positions do not, which no step can settle.

A pose near a singular one has such rows as well, but there the motion that s nearly allows leads
away from it. So it is tried: who can be put together along that motion does not bind.
"""

import attrs
import numpy as np

from dap3d_core.formulations.constraint_rows import ConstraintRows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.linear.rank.rank import DENSE_ROWS
from dap3d_core.model.state_layout import coordinates_of
from dap3d_core.simulation.errors import AssemblyError
from dap3d_core.simulation.initial.assemble import FIT, correct_positions, fit_of
from dap3d_core.simulation.initial.least_change import displaced

#: From this part of the largest singular value on rows are held: the root of the regularisation of
#: lsq, 1e-9 of a row's square.
HELD = 3e-5
#: The move that is tried: no body by more than this angle (rad), or this part of the model.
TURN, SHIFT = 0.2, 0.1
#: It leads away if this part of it is left when the joints are closed again.
AWAY = 0.05
#: Joints take part whose rows have this weight in the combination.
PART_TAKEN = 0.05


@attrs.frozen
class Binding:
    """Joints that leave a motion free but for a small number.

    Attributes:
        joints: their names, in file order.
        size: the singular value of the combination of their rows that nearly vanishes.
    """

    joints: tuple[str, ...]
    size: float

    @property
    def words(self) -> str:
        """A sentence without its full stop."""
        return (
            f"{', '.join(self.joints)} bind: they would leave one more motion free, but for "
            f"{self.size:.2g}, too much to be taken for redundant (below {FIT:g}) and too little "
            f"to hold. Make their points and axes agree to {FIT:g}, or replace one of them by a "
            "joint with fewer rows"
        )


def bindings(
    evaluator: Evaluator, rows: ConstraintRows, u: Floats, t: float
) -> tuple[Binding, ...]:
    """Joints that bind at a state u (13 n,), whose rows these are, scaled.

    Sought among up to DENSE_ROWS rows; those of the position level alone are tried.
    """
    model = evaluator.model
    if model.row_count > DENSE_ROWS:
        return ()
    left, values, right = np.linalg.svd(rows.dense(), full_matrices=False)
    fit = fit_of(model)
    found = []
    for k in np.flatnonzero((values > fit) & (values < HELD * values[0])):
        if any(_leads_away(evaluator, u, t, sign * right[k]) for sign in (1.0, -1.0)):
            continue
        taking = np.abs(left[:, k]) > PART_TAKEN * np.max(np.abs(left[:, k]))
        joints = tuple(model.row_owners(np.flatnonzero(taking)))
        found.append(Binding(joints, float(values[k])))
    return tuple(found)


def _leads_away(evaluator: Evaluator, u: Floats, t: float, direction: Floats) -> bool:
    """True if the joints can be closed at another pose in this direction (6 n,)."""
    step = direction.reshape(-1, 6) * np.repeat([evaluator.model.length, 1.0], 3)
    extent = max(
        float(np.max(np.linalg.norm(step[:, :3], axis=1))) / (SHIFT * evaluator.model.size),
        float(np.max(np.linalg.norm(step[:, 3:], axis=1))) / TURN,
    )
    moved = displaced(u, step / extent)
    try:
        closed, _ = correct_positions(evaluator, moved, t, np.zeros(0, dtype=np.int64))
    except AssemblyError:
        return False
    gone, asked = coordinates_of(closed - u), coordinates_of(moved - u)
    return float(asked @ gone) > AWAY * float(asked @ asked)
