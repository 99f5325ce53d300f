"""Frames: a position and a rotation, and the forms in which formats write rotations."""

from collections.abc import Sequence
from math import cos, sin, sqrt
from typing import Any

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats


def _vector(value: Any) -> Floats:
    return np.array(value, dtype=np.float64).reshape(3)


def _matrix(value: Any) -> Floats:
    return np.array(value, dtype=np.float64).reshape(3, 3)


@attrs.frozen(eq=False)
class Frame:
    """The pose of a frame in another one.

    Attributes:
        r: (3,) its origin, m.
        A: (3, 3) its axes as columns.
    """

    r: Floats = attrs.field(default=(0.0, 0.0, 0.0), converter=_vector)
    A: Floats = attrs.field(factory=lambda: np.eye(3), converter=_matrix)

    def __matmul__(self, other: "Frame") -> "Frame":
        """The pose of ``other``, given in this frame, in the frame that this one is given in."""
        return Frame(self.r + self.A @ other.r, self.A @ other.A)

    def inverse(self) -> "Frame":
        """The pose of the other frame in this one."""
        return Frame(-self.A.T @ self.r, self.A.T)

    def is_identity(self) -> bool:
        """True if the two frames are the same, exactly."""
        return not self.r.any() and np.array_equal(self.A, np.eye(3))


IDENTITY = Frame()


def rpy(angles: Sequence[float]) -> Floats:
    """The rotation of roll, pitch and yaw, about fixed axes x, y, z in this order (URDF, SDF)."""
    return euler_angles(angles, "XYZ")


def rpy_of(A: Floats) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation; the yaw is 0 where only its sum with the roll counts."""
    pitch = float(np.arctan2(-A[2, 0], np.hypot(A[0, 0], A[1, 0])))
    if np.hypot(A[0, 0], A[1, 0]) < 1e-9:
        return float(np.arctan2(-A[1, 2], A[1, 1])), pitch, 0.0
    yaw = float(np.arctan2(A[1, 0], A[0, 0]))
    return float(np.arctan2(A[2, 1], A[2, 2])), pitch, yaw


def euler_angles(angles: Sequence[float], sequence: str = "xyz") -> Floats:
    """The rotation of three angles about axes that turn along (x, y, z) or stay (X, Y, Z).

    Args:
        angles: in the order of ``sequence``, rad.
        sequence: three letters, as MJCF's ``eulerseq``.
    """
    A = np.eye(3)
    for letter, angle in zip(sequence, angles, strict=True):
        turn = axis_angle(np.eye(3)["xyz".index(letter.lower())], angle)
        A = A @ turn if letter.islower() else turn @ A
    return A


def axis_angle(axis: Sequence[float] | Floats, angle: float) -> Floats:
    """The rotation by an angle (rad) about a unit axis."""
    x, y, z = axis
    c, s = cos(angle), sin(angle)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + s * K + (1.0 - c) * (K @ K))


def from_quaternion(q: Sequence[float]) -> Floats:
    """The rotation of a quaternion w, x, y, z, which is normalised.

    Raises:
        ValueError: it is zero.
    """
    w, x, y, z = q
    n = w * w + x * x + y * y + z * z
    if not n > 0.0:
        raise ValueError("a quaternion of length 0 is no rotation")
    s = 2.0 / n
    return np.array([
        [1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
        [s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)],
        [s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)],
    ])  # fmt: skip


def quaternion(A: Floats) -> tuple[float, float, float, float]:
    """The unit quaternion w, x, y, z of a rotation; the largest component is positive."""
    trace = float(np.trace(A))
    squares = [1.0 + trace, *(1.0 + 2.0 * float(A[k, k]) - trace for k in range(3))]
    k = max(range(4), key=lambda n: squares[n])
    x = 0.5 * sqrt(squares[k])
    skew = [A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]]
    if k == 0:
        parts = [x, *(s / (4.0 * x) for s in skew)]
    else:
        others = [(A[k - 1, n] + A[n, k - 1]) / (4.0 * x) for n in range(3)]
        others[k - 1] = x
        parts = [skew[k - 1] / (4.0 * x), *others]
    length = sqrt(sum(float(part) ** 2 for part in parts))
    w, x, y, z = (float(part) / length for part in parts)
    return w, x, y, z
