"""Interpolation between instants of a run: a cubic, within parts between jumps of velocities."""

from itertools import groupby, pairwise

import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.result.arrays import Arrays, joined
from dap3d_core.result.result import Result

Ends = Floats | tuple[Floats, Floats]


def cubic(a: float, h: float | Floats, x: Ends, x_dot: Ends) -> Floats:
    """Hermite interpolation at a fraction ``a`` of a step h; x, x_dot (2, ...) at its ends."""
    s, b = a * a * (3.0 - 2.0 * a), a * (1.0 - a)
    return (1.0 - s) * x[0] + s * x[1] + b * h * ((1.0 - a) * x_dot[0] - a * x_dot[1])


def smooth_parts(result: Result) -> list[Result]:
    """A result cut at its jumps; itself alone where there are none.

    A part ends with the state before a jump, and the next begins with that after it: a report at
    the very instant has been taken after it, and is left out. Of these two
    the states are known; accelerations and what else was evaluated at reports are NaN.
    """
    # Records of one instant, as of the corners of a box, are one jump.
    events = [event for event in result.events if event.u_after is not None]
    if not events:
        return [result]
    jumps = {t: list(group) for t, group in groupby(events, lambda event: event.t)}
    rows: list[Arrays | None] = [None]
    for t, group in jumps.items():
        rows += [_row(result, t, state) for state in (group[0].u, group[-1].u_after)]
    rows.append(None)
    ends = [-np.inf, *jumps, np.inf]
    parts = []
    for (begin, end), first, last in zip(pairwise(ends), rows[::2], rows[1::2], strict=True):
        start = 0 if first is None else int(np.searchsorted(result.t, begin, side="right"))
        inner = slice(start, int(np.searchsorted(result.t, end)))
        pieces = [piece for piece in (first, result.arrays.part(inner), last) if piece is not None]
        part = Result(result.summary, joined(pieces), result.record, lambda: result._origin)
        parts.append(part)
    return [part for part in parts if len(part.t)]


def _row(result: Result, t: float, u: tuple[float, ...] | None) -> Arrays:
    """Arrays of one instant, of which the state is known alone."""
    arrays = result.arrays
    nothing = [np.full((1, *column.shape[1:]), np.nan) for column in arrays.columns()]
    row = Arrays(*nothing)
    row.t, row.u = np.array([t]), np.array([u])
    return row
