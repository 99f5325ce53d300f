"""Motions of joints: the frame of a joint on its child in that on its parent."""

from collections.abc import Sequence

import attrs
import numpy as np

from dap3d_core.interface.formats.articulation import KINDS, Joint
from dap3d_core.interface.formats.frames import IDENTITY, Frame, axis_angle, from_quaternion
from dap3d_core.kernels.array_types import Floats

ZERO = np.zeros(3)


def rest_coordinates(joint: Joint) -> tuple[float, ...]:
    """The coordinates where the frames of a joint coincide."""
    if joint.kind == "ball":
        return (1.0, 0.0, 0.0, 0.0)
    if joint.kind == "free":
        return (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    return (0.0,) * KINDS[joint.kind]


def joint_motion(
    joint: Joint, q: Sequence[float], rate: Sequence[float]
) -> tuple[Frame, Floats, Floats]:
    """The frame of a joint on its child, in that on its parent, and the velocities of the child.

    A ball has a quaternion and the angular velocity in axes of the child; a free joint position and
    quaternion, and the velocity in the parent's axes with that angular velocity.

    Returns:
        The frame; velocity of its origin and angular velocity, both in the axes of the frame on
        the parent.
    """
    axes = [np.asarray(axis, dtype=float) for axis in joint.axes]
    if joint.kind == "fixed":
        return IDENTITY, ZERO, ZERO
    if joint.kind == "ball":
        A = from_quaternion(tuple(q))
        return Frame(A=A), ZERO, A @ np.asarray(rate)
    if joint.kind == "free":
        A = from_quaternion(tuple(q[3:]))
        return Frame(q[:3], A), np.asarray(rate[:3]), A @ np.asarray(rate[3:])
    if joint.kind == "universal":
        first = axis_angle(axes[0], q[0])
        A = first @ axis_angle(axes[1], q[1])
        return Frame(A=A), ZERO, rate[0] * axes[0] + rate[1] * (first @ axes[1])
    if joint.kind == "planar":
        normal = np.cross(axes[0], axes[1])
        v = rate[0] * axes[0] + rate[1] * axes[1]
        A = axis_angle(normal, q[2])
        return Frame(q[0] * axes[0] + q[1] * axes[1], A), v, rate[2] * normal
    axis = axes[0]
    turn, slide = {
        "revolute": (1.0, 0.0),
        "prismatic": (0.0, 1.0),
        "screw": (1.0, joint.pitch / (2.0 * np.pi)),
        "cylindrical": (1.0, 0.0),
    }[joint.kind]
    distance, speed = slide * q[0], slide * rate[0]
    if joint.kind == "cylindrical":
        distance, speed = q[1], rate[1]
    frame = Frame(distance * axis, axis_angle(axis, turn * q[0]))
    return frame, speed * axis, turn * rate[0] * axis


def held(joint: Joint, q: float) -> Joint:
    """A hinge or a slider that is fixed at a coordinate, which is still its position."""
    moved, _, _ = joint_motion(joint, (q,), (0.0,))
    return attrs.evolve(joint, kind="fixed", in_parent=joint.in_parent @ moved,
                        position=(q,), rate=())  # fmt: skip


def reversed_joint(joint: Joint) -> Joint:
    """The same joint with parent and child exchanged; its coordinate keeps its sense."""
    axes = tuple(tuple(-x for x in axis) for axis in reversed(joint.axes))
    return attrs.evolve(joint, parent=joint.child, child=joint.parent, in_parent=joint.in_child,
                        in_child=joint.in_parent, axes=axes)  # fmt: skip
