"""The coordinate of a joint that has a single one, from the poses and velocities of its bodies.

As in coordinates.py, for one joint, in plain numbers or symbols.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from dap3d_core.assembly.motion.joint_motion import ROTATION, TRANSLATION, ModelMotions
from dap3d_core.kernels import atan2, conjugate, cross, dot, rotate, sub
from dap3d_core.kernels.runtime.loop_support import P, R, V, W

#: Names of the coordinate, and of its rate.
NAMES = {
    ROTATION: (("angle", "q1"), ("angle_rate", "q1_dot")),
    TRANSLATION: (("length", "q1"), ("length_rate", "q1_dot")),
}
#: ``size`` numbers from ``first`` on (kernels/runtime/loop_support.py) of a body; rows of its
#: rotation matrix.
Vector = Callable[[int, int, int], Any]
Axes = Callable[[int], Any]


class SingleCoordinate(NamedTuple):
    """A coordinate between bodies i and j of a joint.

    Attributes:
        joint: the joint. kind: ROTATION or TRANSLATION. i, j: the bodies, ground 0.
        axis: fixed in body i. start: r, or p, of body i seen from body j, where it is zero.
    """

    joint: int
    kind: str
    i: int
    j: int
    axis: tuple[float, ...]
    start: tuple[float, ...]

    def value(self, vector: Vector, axes: Axes) -> Any:
        """The length, m, or the angle within a turn, rad."""
        if self.kind == TRANSLATION:
            gone = sub(vector(self.i, R, 3), vector(self.j, R, 3))
            return dot(sub(gone, rotate(axes(self.j), self.start)), rotate(axes(self.i), self.axis))
        turned = product(conjugate(vector(self.j, P, 4)), vector(self.i, P, 4))
        turned = product(conjugate(self.start), turned)
        return 2.0 * atan2(dot(turned[1:], self.axis), turned[0])

    def rate(self, vector: Vector, axes: Axes) -> Any:
        """Its rate, m/s or rad/s."""
        now, w_j = rotate(axes(self.i), self.axis), vector(self.j, W, 3)
        if self.kind == ROTATION:
            return dot(now, sub(vector(self.i, W, 3), w_j))
        carried = cross(w_j, sub(vector(self.i, R, 3), vector(self.j, R, 3)))
        moved = sub(vector(self.i, V, 3), vector(self.j, V, 3))
        return dot(sub(moved, carried), now)


def single_coordinate(
    motions: ModelMotions, joint: int, name: str
) -> tuple[SingleCoordinate, bool] | None:
    """The coordinate of a joint with a single one, and whether a name is of its rate."""
    for group in motions.motions:
        places = np.flatnonzero(group.joints == joint)
        if not len(places) or len(group.parts) != 1 or group.parts[0].kind not in NAMES:
            continue
        kind = group.parts[0].kind
        names, rates = NAMES[kind]
        if name not in (*names, *rates):
            return None
        one = group.take(places)
        bodies = int(one.body_i[0]), int(one.body_j[0])
        start = one.start.r if kind == TRANSLATION else one.start.p
        axis, zero = (tuple(x[0].tolist()) for x in (one.axis(0), start))
        return SingleCoordinate(joint, kind, *bodies, axis, zero), name in rates
    return None


def product(a: Any, b: Any) -> tuple[Any, ...]:
    """The quaternion product a b."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )
