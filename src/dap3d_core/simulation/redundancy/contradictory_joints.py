"""Joints that a run cannot fulfil together from some time on: a driver that goes beyond reach.

Where a linkage is stretched out, or two drivers disagree, one combination of rows vanishes or
nearly does, and what functions of time ask of it does not: no velocity has it. That alone may be a
moment's rounding, so that the joints are put together a little later, too.
"""

import numpy as np

from dap3d_core.formulations.constraint_rows import ConstraintRows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Model
from dap3d_core.model.state_layout import velocities_of
from dap3d_core.simulation.errors import AssemblyError
from dap3d_core.simulation.initial.assemble import FIT, correct_positions, max_speed
from dap3d_core.simulation.initial.least_change import displaced, finite_rows
from dap3d_core.simulation.redundancy.near_redundant import HELD

#: Rows beyond which nothing is looked for.
MOST_ROWS = 300
#: How far the bodies would go until the latest instant that is tried, in rad or parts of the model;
#: the earlier ones, as parts of that time.
TRIED_MOTION, EARLIER = 0.05, (1e-6, 1e-4, 1e-2, 1.0)
#: Singular values below this part of the largest are those of rows that nearly depend.
NEARLY = 1e-2
#: A row takes part in a combination with this part of its largest weight.
PART_TAKEN = 0.05
#: What is asked of a combination is nothing below this part of what is asked of its rows.
NOTHING = 1e-6
HALVINGS = 40
NONE = np.zeros(0, dtype=np.int64)


def find_contradiction(evaluator: Evaluator, t: float, y: Floats, rank: int) -> str:
    """Message on joints that contradict each other from about time t on; "" if none do.

    Args:
        evaluator: the model.
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
        return correct_positions(evaluator, moved, later, NONE)[0]
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
    drivers = _owners(model, combination * rows.nu)
    others = [k for k in _owners(model, combination) if k not in drivers]
    asking = " and ".join(_driver(evaluator, k, t) for k in drivers)
    ask = "asks" if len(drivers) == 1 else "ask"
    against = f"joints {_listed(model, others)} cannot follow" if others else "no motion has both"
    return f"from t = {t:.6g} s on {against}: what {asking} {ask} for is out of reach"


def _driver(evaluator: Evaluator, k: int, t: float) -> str:
    """A joint with its functions of time and their values."""
    model, values = evaluator.model, evaluator.function_values(t)
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
            return f"joint {model.joint_names[k]}" + (f" ({', '.join(words)})" if words else "")
    return f"joint {model.joint_names[k]}"


def _come_to_hold(evaluator: Evaluator, t: float, u: Floats, rank: int) -> str:
    """Joints whose rows depended on each other at the start and nearly do."""
    rows: ConstraintRows = evaluator.rows(t, u)
    left, values, _ = np.linalg.svd(rows.dense(), full_matrices=False)
    fit = FIT * min(1.0, evaluator.model.size)
    held = [k for k in range(rank, len(values)) if fit < values[k] < HELD * values[0]]
    if not held:
        return ""
    joints = _owners(evaluator.model, left[:, held[0]])
    return (
        f"joints {_listed(evaluator.model, joints)} contradict each other: their rows, redundant "
        "at the start, have come to hold a motion that they left free"
    )


def _owners(model: Model, weights: Floats) -> list[int]:
    """Joints that take part in a combination of rows, in file order."""
    size = np.abs(weights)
    taking = np.flatnonzero(size > PART_TAKEN * np.max(size))
    return sorted({int(k) for k in np.searchsorted(model.joint_start, taking, side="right") - 1})


def _listed(model: Model, joints: list[int]) -> str:
    return ", ".join(model.joint_names[k] for k in joints)
