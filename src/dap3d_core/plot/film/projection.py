"""Camera of animations: a parallel projection, and the visible part of the motion."""

import re
from itertools import product
from typing import NamedTuple

import numpy as np

from dap3d_core.model.groups import Floats

AXES = "xyz"
#: Default view: azimuth about z from x, elevation, degrees.
AZIMUTH, ELEVATION = -60.0, 22.0
#: A motion thinner than this fraction of its size is plane.
THIN = 1e-3
#: Margins as fractions of the size: around a motion without limits; around one in space.
MARGIN, EDGE = 0.06, 0.03
#: Axis along which the camera looks -> axes to the right and up.
PLANES = {"x": (1, 2), "y": (0, 2), "z": (0, 1)}


class Camera(NamedTuple):
    """A parallel projection.

    Attributes:
        right, up, towards: (3,) unit vectors: to the right and up in the picture, to the viewer.
        plane: "x", "y" or "z" where the camera looks along that axis, else "".
    """

    right: Floats
    up: Floats
    towards: Floats
    plane: str

    @property
    def axes(self) -> Floats:
        """(3, 2) directions of the picture's axes."""
        return np.asarray(np.stack([self.right, self.up], axis=1))

    def project(self, points: Floats) -> Floats:
        """Points (..., 3) in the picture (..., 2), m."""
        return np.asarray(points @ self.axes)

    def depth(self, points: Floats) -> Floats:
        """Coordinates of points (..., 3) towards the viewer, m; larger is nearer."""
        return np.asarray(points @ self.towards)


def camera_of(view: str | None, extent: Floats) -> Camera:
    """The camera of a view of a motion.

    Args:
        view: "x", "y", "z": along that axis; "AZIMUTH,ELEVATION" in degrees; None: along the axis
            across a plane motion, else from the side and above.
        extent: (3, 2) of the motion, m.

    Raises:
        ValueError: any other view.
    """
    word = _thin_axis(extent) if view is None else view.strip().lower()
    if word in PLANES:
        right, up = (np.eye(3)[k] for k in PLANES[word])
        return Camera(right, up, np.cross(right, up), word)
    azimuth, elevation = AZIMUTH, ELEVATION
    if word:
        number = r"([+-]?\d+(?:\.\d*)?)"
        match = re.fullmatch(rf"{number}\s*,\s*{number}", word)
        if match is None or not -90.0 <= float(match[2]) <= 90.0:
            raise ValueError(
                f"a view is x, y or z (along that axis) or AZIMUTH,ELEVATION in degrees such as "
                f"-60,22 (elevation from -90 to 90), not {view!r}"
            )
        azimuth, elevation = float(match[1]), float(match[2])
    a, e = np.radians([azimuth, elevation])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    up = np.array([-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)])
    return Camera(right, up, np.cross(right, up), "")


def _thin_axis(extent: Floats) -> str:
    """The axis in which a motion has no extent, "" where it has one in all or in none."""
    sizes = extent[:, 1] - extent[:, 0]
    return next((AXES[k] for k in (2, 1, 0) if sizes[k] < THIN * sizes.max()), "")


def with_margin(extent: Floats) -> Floats:
    """Limits (3, 2) around an extent, never empty, m."""
    room = MARGIN * float(np.max(extent[:, 1] - extent[:, 0])) or 1.0
    return np.asarray(extent + np.array([-room, room]))


def leaves(limits: Floats, extent: Floats, camera: Camera) -> bool:
    """True where the visible part of a motion leaves limits, beyond rounding."""
    seen = [k for k in range(3) if AXES[k] != camera.plane]
    slack = 1e-9 * float(np.max(limits[:, 1] - limits[:, 0]))
    low, high = limits[seen, 0] - slack, limits[seen, 1] + slack
    return bool(np.any(extent[seen, 0] < low) or np.any(extent[seen, 1] > high))


def visible_rectangle(camera: Camera, limits: Floats, motion: Floats) -> Floats:
    """The visible rectangle (2, 2): least and largest in the directions of the picture, m.

    Args:
        camera: the camera.
        limits: (3, 2) of the room, m: all of it in a plane; else its floor and the motion above.
        motion: (2, 2) extent of the motion in the picture, m.
    """
    corners = camera.project(np.array(list(product(*limits))))  # every other one on the floor
    room, floor = _extent(corners), _extent(corners[::2])
    if camera.plane:
        return room
    low = np.maximum(room[:, 0], np.minimum(floor[:, 0], motion[:, 0]))
    high = np.minimum(room[:, 1], np.maximum(floor[:, 1], motion[:, 1]))
    edge = EDGE * float(np.max(high - low))
    return np.stack([low - edge, high + edge], axis=1)


def _extent(points: Floats) -> Floats:
    return np.stack([points.min(axis=0), points.max(axis=0)], axis=1)


def fill_limits(rectangle: Floats, width: float, height: float) -> Floats:
    """The limits (2, 2) around a rectangle (2, 2) that have the shape of width x height."""
    middle, size = rectangle.mean(axis=1), rectangle[:, 1] - rectangle[:, 0]
    half = 0.5 * max(size[0] / width, size[1] / height) * np.array([width, height])
    return np.stack([middle - half, middle + half], axis=1)


def round_number(x: float) -> float:
    """The number of the row ..., 0.5, 1, 2, 5, 10, ... nearest to x > 0."""
    power = 10.0 ** np.floor(np.log10(x))
    best = min((1.0, 2.0, 5.0, 10.0), key=lambda m: abs(np.log(m * power / x)))
    return float(f"{best * power:.6g}")


def floor_grid(limits: Floats, spacing: float) -> Floats:
    """(q, 2, 3) lines at multiples of a spacing on the floor of a box (3, 2)."""
    z, lines = limits[2, 0], []
    for axis, other in ((0, 1), (1, 0)):
        first, last = np.ceil(limits[axis, 0] / spacing), np.floor(limits[axis, 1] / spacing)
        for at in spacing * np.arange(first, last + 1):
            line = np.full((2, 3), z)
            line[:, axis], line[:, other] = at, limits[other]
            lines.append(line)
    return np.array(lines).reshape(-1, 2, 3)
