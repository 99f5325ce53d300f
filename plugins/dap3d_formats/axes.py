"""Axes of joints and shapes."""

from collections.abc import Sequence
from math import atan2, pi
from typing import Any

from dap3d_core.interface.formats import FormatError, XmlElement, axis_angle, from_quaternion


def unit(axis: tuple[float, ...], element: XmlElement) -> tuple[float, ...]:
    """An axis of length 1.

    Raises:
        FormatError: its length is 0.
    """
    length = sum(x * x for x in axis) ** 0.5
    if not length > 0.0:
        raise FormatError("an axis needs a direction; its length is 0", element.place)
    return axis if sorted(map(abs, axis)) == [0.0, 0.0, 1.0] else tuple(x / length for x in axis)


def turn(quaternion: Sequence[float], element: XmlElement) -> Any:
    """The rotation of a quaternion w, x, y, z of an element.

    Raises:
        FormatError: its length is 0.
    """
    try:
        return from_quaternion(quaternion)
    except ValueError as error:
        raise FormatError(str(error), element.place) from None


def across(normal: tuple[float, ...]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Two unit vectors x, y with x cross y along a unit vector."""
    k = min(range(3), key=lambda n: abs(normal[n]))
    y = cross(normal, tuple(float(n == k) for n in range(3)))
    length = sum(c * c for c in y) ** 0.5
    y = (y[0] / length, y[1] / length, y[2] / length)
    return cross(y, normal), y


def cross(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, float, float]:
    """The cross product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def along(z: tuple[float, ...]) -> Any:
    """The least rotation that turns the z axis to a unit vector, as MuJoCo takes it."""
    x, y = -z[1], z[0]  # (0, 0, 1) x z
    sine = (x * x + y * y) ** 0.5
    if sine < 1e-14:
        return axis_angle((1.0, 0.0, 0.0), 0.0 if z[2] > 0.0 else pi)
    return axis_angle((x / sine, y / sine, 0.0), atan2(sine, z[2]))
