"""Axes of joints and shapes."""

from math import atan2, pi
from typing import Any

from dap3d_core.interface.formats import FormatError, XmlElement, axis_angle


def unit(axis: tuple[float, ...], element: XmlElement) -> tuple[float, ...]:
    """An axis of length 1.

    Raises:
        FormatError: its length is 0.
    """
    length = sum(x * x for x in axis) ** 0.5
    if not length > 0.0:
        raise FormatError("an axis needs a direction; its length is 0", element.place)
    return axis if sorted(map(abs, axis)) == [0.0, 0.0, 1.0] else tuple(x / length for x in axis)


def across(normal: tuple[float, ...]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Two unit vectors x, y with x cross y along a unit vector."""
    k = min(range(3), key=lambda n: abs(normal[n]))
    n = normal
    e = [0.0, 0.0, 0.0]
    e[k] = 1.0
    y = (n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0])
    length = sum(c * c for c in y) ** 0.5
    y = (y[0] / length, y[1] / length, y[2] / length)
    x = (y[1] * n[2] - y[2] * n[1], y[2] * n[0] - y[0] * n[2], y[0] * n[1] - y[1] * n[0])
    return x, y


def along(z: tuple[float, ...]) -> Any:
    """The least rotation that turns the z axis to a unit vector, as MuJoCo takes it."""
    x, y = -z[1], z[0]  # (0, 0, 1) x z
    sine = (x * x + y * y) ** 0.5
    if sine < 1e-14:
        return axis_angle((1.0, 0.0, 0.0), 0.0 if z[2] > 0.0 else pi)
    return axis_angle((x / sine, y / sine, 0.0), atan2(sine, z[2]))
