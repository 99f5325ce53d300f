"""Motion at the instants of a page: instants, points, extent."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import attrs
import numpy as np

from dap3d_core.model.groups import Floats, Integers
from dap3d_core.model.rotations import to_body, to_global
from dap3d_core.result import Result
from dap3d_core.result.post.point_motion import motion_of
from dap3d_core.view.scene3d.primitives import Located, floats_of

#: Without ``fps`` the page holds every instant, up to so many numbers of poses (16 MB).
MOST_NUMBERS = 4_000_000
#: More frames than this mean every instant.
_MOST_FRAMES = 1e6
#: Number of instants from which the extent of a motion is computed.
_EXTENT_INSTANTS = 200

#: A motion is planar where one of its extents is below this fraction of the largest.
PLANAR = 0.12


def instants_to_show(t: Floats, bodies: int, fps: float | None) -> Integers:
    """(k,) increasing indices of the instants of a page; the first and the last are among them.

    Args:
        t: (nt,) reported instants, s.
        bodies: number of bodies.
        fps: frames a second; None for every instant, as far as they fit a page.
    """
    last = len(t) - 1
    if fps is None:
        most = max(2, MOST_NUMBERS // (7 * max(bodies, 1)))
        if len(t) <= most:
            return np.arange(len(t))
        return np.unique(np.linspace(0, last, most).round().astype(np.int64))
    if (t[-1] - t[0]) * fps > _MOST_FRAMES:
        return np.arange(len(t))
    wanted = np.append(np.arange(t[0], t[-1], 1.0 / fps), t[-1])
    after = np.clip(np.searchsorted(t, wanted), 1, max(last, 1))
    after = np.minimum(after, last)
    before = np.maximum(after - 1, 0)
    nearest = np.where(wanted - t[before] <= t[after] - wanted, before, after)
    return np.unique(np.concatenate([[0], nearest, [last]])).astype(np.int64)


def at_instants(result: Result, index: Integers) -> Result:
    """A result reduced to some of its instants, with the model of the whole."""
    if len(index) == len(result.t):
        return result
    return result.at(index)


class Extent(NamedTuple):
    """Least and largest coordinates (3,) of a motion, and the points (k, 3) farthest out, m."""

    low: Floats
    high: Floats
    farthest: Floats


@attrs.frozen(eq=False)
class Motion:
    """Poses of n bodies at nt instants; ground is body 0."""

    result: Result

    @property
    def poses(self) -> Floats:
        """(nt, n, 7) r (m) and p of each body."""
        return np.asarray(np.concatenate([self.result.r, self.result.p], axis=2))

    def points(self, located: Iterable[Located]) -> Floats:
        """(nt, k, 3) points, global axes, m."""
        points = list(located)
        body = np.array([b for b, _ in points], dtype=np.int64)
        local = np.array([at for _, at in points], dtype=float).reshape(-1, 3)
        return motion_of(body, local, self.result.u, self.result.v_dot, 0)

    def direction(self, vector: Located) -> Floats:
        """(nt, 3) a vector fixed in a body, global axes."""
        body, local = vector
        if body == 0:
            return np.broadcast_to(np.asarray(local, dtype=float), (len(self.result.t), 3))
        return np.asarray(to_global(self.result.p[:, body - 1], np.asarray(local, dtype=float)))

    def vector_in(self, body: int, direction: Floats) -> Floats:
        """(3,) components in a body of a global direction (3,) at the first instant."""
        if body == 0:
            return direction
        return np.asarray(to_body(self.result.p[0, body - 1], direction))

    def extent(self, located: Iterable[Located], reach: float = 0.0) -> Extent:
        """The extent of points over the motion, enlarged by ``reach``, m."""
        index = np.linspace(0, len(self.result.t) - 1, min(_EXTENT_INSTANTS, len(self.result.t)))
        few = at_instants(self.result, np.unique(index.round().astype(np.int64)))
        points = Motion(few).points(located).reshape(-1, 3)
        farthest = points[np.argmax(points @ _DIRECTIONS.T, axis=0)] + reach * _DIRECTIONS
        return Extent(points.min(axis=0) - reach, points.max(axis=0) + reach, farthest)


def _directions(count: int) -> Floats:
    """(count, 3) unit vectors spread over the sphere."""
    k = np.arange(count)
    z = 1.0 - (2.0 * k + 1.0) / count
    angle, radius = np.pi * (3.0 - np.sqrt(5.0)) * k, np.sqrt(1.0 - z * z)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])


_DIRECTIONS = _directions(96)


def stage(reached: Extent, gravity: tuple[float, ...] | None) -> dict[str, Any]:
    """The stage of a page.

    Args:
        reached: extent of the motion.
        gravity: (3,) m/s^2, or None.

    Returns:
        ``center``, ``extent``, ``size``: of the box that holds the motion; ``farthest``: (k, 3)
        points that must be visible; ``up``: (3,) unit vector; ``ground``: height of the grid
        along up; ``eye``: (3,) direction from the centre to the eye; ``gravity``.
    """
    low, high, farthest = reached
    extent = high - low
    size = float(np.linalg.norm(extent)) or 1.0
    flat = int(np.argmin(extent)) if extent.min() < PLANAR * extent.max() else None
    up = _up(gravity, flat)
    least = float(np.minimum(low * up, high * up).sum())
    near_zero = -0.03 * size <= least <= 0.75 * size
    return {
        "center": floats_of(0.5 * (low + high)),
        "extent": floats_of(extent),
        "size": size,
        "farthest": [[float(f"{x:.6g}") for x in point] for point in farthest],
        "up": floats_of(up + 0.0),
        "ground": 0.0 if near_zero else least - 0.02 * size,
        "eye": floats_of(_eye(up, flat)),
        "gravity": gravity,
    }


def _up(gravity: tuple[float, ...] | None, flat: int | None) -> Floats:
    """Against gravity; else z, or y where the motion lies in the plane of x and y."""
    g = np.asarray(gravity if gravity is not None else (0.0, 0.0, 0.0))
    if np.linalg.norm(g) > 0.0:
        return np.asarray(-g / np.linalg.norm(g))
    return np.asarray(np.eye(3)[1 if flat == 2 else 2])


def _eye(up: Floats, flat: int | None) -> Floats:
    """From where x, or else y, points to the right; nearly normal to the plane of planar motion."""
    across = np.eye(3)[flat if flat is not None else 1]
    upright = abs(float(across @ up)) < 0.5
    if flat is not None and upright:
        # x to the right and up upwards: the eye is in the direction of x cross up
        right = np.eye(3)[0 if flat != 0 else 1]
        across = across * (1.0 if float(np.cross(right, up) @ across) > 0.0 else -1.0)
        eye = across + 0.22 * up + 0.3 * np.cross(up, across)
    else:
        side = np.eye(3)[int(np.argmin(np.abs(up)))]
        right = side - (side @ up) * up
        front = np.cross(right, up)
        eye = front + 0.55 * right + 0.55 * up
    return np.asarray(eye / np.linalg.norm(eye))
