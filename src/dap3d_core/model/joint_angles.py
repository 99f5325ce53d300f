"""Angles of joints that are counted over whole turns, as the driver measures them."""

import attrs

from dap3d_core.model.groups import Floats, Integers

#: How the names of angles of joints begin.
JOINT_ANGLES = "motions."


@attrs.frozen(eq=False)
class JointAngles:
    """Angles of the joints of a model, those of a joint in their order.

    Attributes:
        coordinates: (k, 2) joint, and index of the angle among the joint's coordinates.
        bodies: (k, 2) bodies i and j, ground 0.
        rotations: (k,) the only rotation of its joint, or the first or second one.
        constants: (k, CONSTANT_WIDTH); the names of both are in assembly/turns.py.
    """

    coordinates: Integers
    bodies: Integers
    rotations: Integers
    constants: Floats

    @property
    def count(self) -> int:
        """Number of angles."""
        return len(self.rotations)


def joint_angle_name(joint: str, coordinate: int) -> str:
    """Name of an angle of a joint among all that are counted; coordinates count from 0."""
    return f"{JOINT_ANGLES}{joint}.q{coordinate + 1}"
