"""Camera of pages: the upward direction, the ground grid, the position of the eye."""

from typing import Any

import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.view.scene3d.primitives import floats_of
from dap3d_core.view.scene3d.sampled_motion import Extent

#: A motion is planar where one of its extents is below this fraction of the largest.
PLANAR = 0.12


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
