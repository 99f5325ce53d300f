"""Joints that nearly depend on each other and bind: hinges of a door whose axes nearly agree.

Rows whose combination vanishes but for a small number s are neither of two things. Below
``FIT`` they count as redundant: the joints are put together to no more than that. From ``HELD`` on
the equations of motion hold them. Between the two the equations let the bodies move and the
positions do not, which no step can settle.

A pose near a singular one has such rows as well, but there the motion that s nearly allows leads
away from it. So it is tried: who can be put together along that motion does not bind.

Such rows arise in a run as well, where a linkage is stretched out or two drivers disagree: what
functions of time ask of the combination does not vanish with it, so that no velocity has it. That
alone may be a moment's rounding, so that the joints are put together a little later, too.
"""

import attrs
import numpy as np

from dap3d_core.formulations.constraint_rows import ConstraintRows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.linear.rank import DENSE_ROWS
from dap3d_core.model import Model
from dap3d_core.model.state_layout import coordinates_of, velocities_of
from dap3d_core.simulation.errors import AssemblyError
from dap3d_core.simulation.initial.assemble import FIT, Assembly, fit_of, max_speed
from dap3d_core.simulation.initial.least_change import displaced, finite_rows, largest_move

#: From this part of the largest singular value on rows are held: the root of the regularisation of
#: lsq, 1e-9 of a row's square.
HELD = 3e-5
#: The move that is tried: no body by more than this angle (rad), or this part of the model.
TURN, SHIFT = 0.2, 0.1
#: It leads away if this part of it is left when the joints are closed again.
AWAY = 0.05
#: A joint takes part in a combination whose rows have this part of its largest weight.
PART_TAKEN = 0.05
#: Rows beyond which no contradiction is looked for.
MOST_ROWS = 300
#: How far the bodies would go until the latest instant that is tried, in rad or parts of the model;
#: the earlier ones, as parts of that time.
TRIED_MOTION, EARLIER = 0.05, (1e-6, 1e-4, 1e-2, 1.0)
#: Singular values below this part of the largest are those of rows that nearly depend.
NEARLY = 1e-2
#: What is asked of a combination is nothing below this part of what is asked of its rows.
NOTHING = 1e-6
HALVINGS = 40


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
        found.append(Binding(tuple(_taking_part(model, left[:, k])), float(values[k])))
    return tuple(found)


def _leads_away(evaluator: Evaluator, u: Floats, t: float, direction: Floats) -> bool:
    """True if the joints can be closed at another pose in this direction (6 n,)."""
    step = direction.reshape(-1, 6) * np.repeat([evaluator.model.length, 1.0], 3)
    shift, turn = largest_move(step)
    moved = displaced(u, step / max(shift / (SHIFT * evaluator.model.size), turn / TURN))
    try:
        closed, _ = Assembly(evaluator, t).close(moved)
    except AssemblyError:
        return False
    gone, asked = coordinates_of(closed - u), coordinates_of(moved - u)
    return float(asked @ gone) > AWAY * float(asked @ asked)


def find_contradiction(evaluator: Evaluator, t: float, y: Floats, rank: int) -> str:
    """Message on joints that contradict each other from about time t on; "" if none do.

    Args:
        t, y: time and integrated state of the last step.
        rank: that of the constraints at the start.
    """
    model = evaluator.model
    if not 0 < model.row_count <= MOST_ROWS:
        return ""
    u = evaluator.hold(y)
    try:
        finite_rows(evaluator, t, u)
    except AssemblyError:  # which find_offender reports
        return ""
    return _out_of_reach(evaluator, t, u) or _come_to_hold(evaluator, t, u, rank)


def _out_of_reach(evaluator: Evaluator, t: float, u: Floats) -> str:
    speed = max_speed(evaluator, velocities_of(u))
    span = TRIED_MOTION / speed if speed else TRIED_MOTION * (1.0 + abs(t))
    good = t
    for part in EARLIER:
        late = t + part * span
        if _closed(evaluator, u, t, late) is None:
            break
        good = late
    else:
        return ""
    for _ in range(HALVINGS):
        middle = 0.5 * (good + late)
        if not good < middle < late:
            break
        if _closed(evaluator, u, t, middle) is None:
            late = middle
        else:
            good = middle
    closed = _closed(evaluator, u, t, good)
    return "" if closed is None else _words(evaluator, good, closed)


def _closed(evaluator: Evaluator, u: Floats, t: float, later: float) -> Floats | None:
    """The bodies at a later time, put together; None where they cannot be."""
    moved = displaced(u, (later - t) * velocities_of(u))
    try:
        return Assembly(evaluator, later).close(moved)[0]
    except AssemblyError:
        return None


def _words(evaluator: Evaluator, t: float, u: Floats) -> str:
    """The drivers that ask for too much, and of whom."""
    model, rows = evaluator.model, evaluator.rows(t, u)
    left, values, _ = np.linalg.svd(rows.dense())
    small = np.ones(len(left), dtype=bool)
    small[: len(values)] = values < NEARLY * values[0]
    combination = left[:, small] @ (left[:, small].T @ rows.nu)
    if np.linalg.norm(combination) <= NOTHING * np.linalg.norm(rows.nu):
        return ""
    drivers = _taking_part(model, combination * rows.nu)
    others = [name for name in _taking_part(model, combination) if name not in drivers]
    asking = " and ".join(_driver(evaluator, name, t) for name in drivers)
    ask = "asks" if len(drivers) == 1 else "ask"
    against = f"joints {', '.join(others)} cannot follow" if others else "no motion has both"
    return f"from t = {t:.6g} s on {against}: what {asking} {ask} for is out of reach"


def _driver(evaluator: Evaluator, name: str, t: float) -> str:
    """A joint with its functions of time and their values."""
    model, values = evaluator.model, evaluator.function_values(t)
    k = model.joint_names.index(name)
    for group in model.joints:
        for place in np.flatnonzero(group.members == k):
            count = len(group.type_info.layout.functions)
            used = [int(f) - 1 for f in group.functions[place, :count] if f > 0]
            names = (*model.function_names, *model.input_names)
            words = [
                f"{'function' if f < len(model.function_names) else 'input'} {names[f]}: "
                f"{values[f, 0]:.6g}"
                for f in used
            ]
            return f"joint {name}" + (f" ({', '.join(words)})" if words else "")
    return f"joint {name}"


def _come_to_hold(evaluator: Evaluator, t: float, u: Floats, rank: int) -> str:
    """Joints whose rows depended on each other at the start and nearly do."""
    rows: ConstraintRows = evaluator.rows(t, u)
    left, values, _ = np.linalg.svd(rows.dense(), full_matrices=False)
    fit = FIT * min(1.0, evaluator.model.size)
    held = [k for k in range(rank, len(values)) if fit < values[k] < HELD * values[0]]
    if not held:
        return ""
    joints = ", ".join(_taking_part(evaluator.model, left[:, held[0]]))
    return (
        f"joints {joints} contradict each other: their rows, redundant "
        "at the start, have come to hold a motion that they left free"
    )


def _taking_part(model: Model, weights: Floats) -> list[str]:
    """Joints that take part in a combination of rows, in file order."""
    size = np.abs(weights)
    return model.row_owners(np.flatnonzero(size > PART_TAKEN * np.max(size)))
