"""Layouts of state vectors and of reported rows. All offsets into them are computed here.

The state u of n bodies holds the coordinates r, p of each, then the velocities r_dot, omega. The
integrated state y has the same order, with omega' in body axes; behind them stand the states of
elements that have some (docs/decisions/0054), and last the work done on the system
(docs/decisions/0002). A reported row is t, y, and what is evaluated there.
"""

from collections.abc import Callable
from functools import cache
from itertools import accumulate

import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.rotations import to_body, to_global

#: Coordinates (r, p) and velocities (r_dot, omega) of a body, and both.
COORDINATES, VELOCITIES = 7, 6
STATE = COORDINATES + VELOCITIES


class Layout:
    """A vector cut into named segments.

    Attributes:
        names: of the segments, in their order.
        size: entries of the vector.
    """

    def __init__(self, **sizes: int) -> None:
        """Args: the number of entries of each segment, in their order."""
        ends = list(accumulate(sizes.values(), initial=0))
        self._slices = dict(zip(sizes, map(slice, ends[:-1], ends[1:]), strict=True))
        self.names = tuple(sizes)
        self.size = ends[-1]

    def __getitem__(self, name: str) -> slice:
        return self._slices[name]

    def length(self, name: str) -> int:
        """Number of entries of a segment."""
        return self._slices[name].stop - self._slices[name].start


@cache
def state_layout(n: int) -> Layout:
    """Layout of the state u of n bodies."""
    return Layout(coordinates=COORDINATES * n, velocities=VELOCITIES * n)


@cache
def integrated_layout(n: int, states: int = 0) -> Layout:
    """Layout of the integrated state y of n bodies and so many states of elements."""
    return Layout(coordinates=COORDINATES * n, velocities=VELOCITIES * n, states=states, work=1)


@cache
def tree_layout(angles: int, lengths: int, rotations: int, poses: int, states: int = 0) -> Layout:
    """Layout of the integrated state of trees in joint coordinates, and the work.

    Of coordinates: angles, lengths, Euler parameters, (r, p); then their rates: of the latter two
    omega' and (r_dot, omega'); then the states of elements.
    """
    return Layout(
        angles=angles,
        lengths=lengths,
        rotations=4 * rotations,
        poses=COORDINATES * poses,
        angle_rates=angles,
        length_rates=lengths,
        rotation_rates=3 * rotations,
        pose_rates=VELOCITIES * poses,
        states=states,
        work=1,
    )


@cache
def report_layout(n: int, rows: int, angles: int, inputs: int = 0) -> Layout:
    """Layout of reports in addition to the state: n bodies, constraint rows, angles, inputs.

    Compiled code writes all but the inputs.
    """
    sizes = {"v_dot": VELOCITIES * n, "Lam": rows, "angles": angles}
    return Layout(**sizes, potential_energy=1, residuals=3, inputs=inputs)


@cache
def row_layout(n: int, rows: int, angles: int, states: int = 0, inputs: int = 0) -> Layout:
    """Layout of a reported row."""
    parts = integrated_layout(n, states), report_layout(n, rows, angles, inputs)
    return Layout(t=1, **{name: part.length(name) for part in parts for name in part.names})


def body_count_of(u: Floats) -> int:
    """Number of bodies of states u (..., 13 n) or y (..., 13 n + 1)."""
    return int(u.shape[-1]) // STATE


def coordinates_of(u: Floats) -> Floats:
    """View of the coordinates (..., 7 n) of states u or y."""
    return u[..., state_layout(body_count_of(u))["coordinates"]]


def velocities_of(u: Floats) -> Floats:
    """View of the velocities (..., 6 n) of states u or y."""
    return u[..., state_layout(body_count_of(u))["velocities"]]


def by_body(u: Floats) -> Floats:
    """Coordinates and velocities of each body, (..., n, 13), of states u or y; a copy."""
    n = body_count_of(u)
    q = coordinates_of(u).reshape(*u.shape[:-1], n, COORDINATES)
    v = velocities_of(u).reshape(*u.shape[:-1], n, VELOCITIES)
    return np.concatenate([q, v], axis=-1)


def at_rest(u: Floats) -> Floats:
    """The state (13 n,) without velocities."""
    still = u.copy()
    velocities_of(still)[:] = 0.0
    return still


def split(u: ArrayLike) -> tuple[Floats, Floats, Floats, Floats]:
    """Views r (..., n, 3), p (..., n, 4), r_dot (..., n, 3), w (..., n, 3) of states u or y."""
    u = np.asarray(u, dtype=float)
    n = body_count_of(u)
    q = coordinates_of(u).reshape(*u.shape[:-1], n, COORDINATES)
    v = velocities_of(u).reshape(*u.shape[:-1], n, VELOCITIES)
    return q[..., :3], q[..., 3:], v[..., :3], v[..., 3:]


def join(r: ArrayLike, p: ArrayLike, v: ArrayLike, w: ArrayLike) -> Floats:
    """States u (..., 13 n) from r, p, r_dot, w of n bodies: the inverse of ``split``."""
    q = np.concatenate([r, p], axis=-1)
    s = np.concatenate([v, w], axis=-1)
    return np.concatenate([q.reshape(*q.shape[:-2], -1), s.reshape(*s.shape[:-2], -1)], axis=-1)


def y_from_u(u: ArrayLike, work: ArrayLike = 0.0, states: ArrayLike = ()) -> Floats:
    """Integrated states y of states u (..., 13 n) and states of elements (..., s) or (s,)."""
    u, own = np.asarray(u, dtype=float), np.asarray(states, dtype=float)
    size = u.shape[-1]
    y = np.empty((*u.shape[:-1], size + own.shape[-1] + 1))
    y[..., :size], y[..., size:-1], y[..., -1] = u, own, work
    _to_frames(to_body, y[..., :size])
    return y


def bodies_of(y: Floats, states: int) -> Floats:
    """View of the bodies' part (..., 13 n) of integrated states y with so many states."""
    return y[..., : y.shape[-1] - 1 - states]


def u_from_y(y: ArrayLike, states: int = 0) -> Floats:
    """States u (..., 13 n) of integrated states y with so many states of elements."""
    u = bodies_of(np.asarray(y, dtype=float), states).copy()
    _to_frames(to_global, u)
    return u


def _to_frames(turn: Callable[[Floats, Floats], Floats], u: Floats) -> None:
    """Turn the angular velocities of states u (..., 13 n) into other axes, in place."""
    _, p, _, w = split(u)
    w[...] = turn(p, w)
