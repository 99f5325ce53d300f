"""The tree of an articulated model: which joint places each link, and where the links are."""

from collections.abc import Mapping, Sequence

import attrs
import numpy as np

from dap3d_core.interface.formats.articulation import KINDS, WORLD, Articulation, Joint
from dap3d_core.interface.formats.frames import IDENTITY, Frame, axis_angle, from_quaternion
from dap3d_core.interface.formats.remarks import FormatError
from dap3d_core.kernels.array_types import Floats
from dap3d_core.registry.suggestions import nearest

ZERO = np.zeros(3)


@attrs.frozen(eq=False)
class Placed:
    """A link in the world: its pose, its velocity (3,) m/s and angular velocity (3,) rad/s."""

    frame: Frame
    v: Floats = attrs.field(factory=lambda: np.zeros(3))
    w: Floats = attrs.field(factory=lambda: np.zeros(3))


@attrs.frozen(eq=False)
class SpanningTree:
    """Which joint places each link.

    Attributes:
        model: the model.
        placing: link -> the joint whose child it is.
        loops: joints that place no link.
        roots: links that no joint places.
        order: links, each after its parent.
    """

    model: Articulation
    placing: dict[str, Joint]
    loops: list[Joint]
    roots: list[str]
    order: list[str]

    @classmethod
    def of(cls, model: Articulation) -> "SpanningTree":
        """The tree of a model.

        Raises:
            FormatError: a joint names a link that is not there, or links hang in a circle.
        """
        placing: dict[str, Joint] = {}
        loops: list[Joint] = []
        for joint in model.joints.values():
            _check(model, joint)
            if joint.closes or joint.child == WORLD or joint.child in placing:
                loops.append(joint)
            else:
                placing[joint.child] = joint
        roots = [name for name in model.links if name not in placing]
        order, children = list(roots), _children(placing)
        order += children.get(WORLD, [])
        for name in order:  # grows
            order += children.get(name, [])
        if len(order) < len(model.links):
            lost = next(name for name in model.links if name not in set(order))
            what = f"link {lost} hangs from itself: its joints form a circle without a root"
            raise FormatError(what, model.links[lost].place)
        return cls(model, placing, loops, roots, order)

    def place(
        self,
        positions: Mapping[str, Sequence[float]],
        rates: Mapping[str, Sequence[float]],
    ) -> dict[str, Placed]:
        """Poses and velocities of all links.

        Args:
            positions: joint -> its coordinates; by default where the model starts.
            rates: joint -> rates of its coordinates; by default 0.
        """
        placed = {WORLD: Placed(IDENTITY)}
        for name in self.roots:
            placed[name] = Placed(self.model.base_poses.get(name, IDENTITY))
        for name in self.order:
            joint = self.placing.get(name)
            if joint is not None:
                q = positions.get(joint.name, joint.position)
                placed[name] = _next(placed[joint.parent], joint, q, rates.get(joint.name, ()))
        return placed


def _children(placing: Mapping[str, Joint]) -> dict[str, list[str]]:
    children: dict[str, list[str]] = {}
    for name, joint in placing.items():
        children.setdefault(joint.parent, []).append(name)
    return children


def _check(model: Articulation, joint: Joint) -> None:
    for end in (joint.parent, joint.child):
        if end != WORLD and end not in model.links:
            near = nearest(end, model.links)
            hint = f"; did you mean {near!r}?" if near else ""
            raise FormatError(f"joint {joint.name}: there is no link {end!r}{hint}", joint.place)
    if joint.parent == joint.child:
        what = f"joint {joint.name}: parent and child are the same link, {joint.child}"
        raise FormatError(what, joint.place)


def _next(parent: Placed, joint: Joint, q: Sequence[float], rate: Sequence[float]) -> Placed:
    """The child of a joint."""
    size = KINDS[joint.kind]
    motion, v, w = joint_motion(
        joint, tuple(q) or rest_coordinates(joint), tuple(rate) or (0.0,) * size
    )
    base = parent.frame @ joint.in_parent
    moved = base @ motion
    frame = moved @ joint.in_child.inverse()
    w_joint = parent.w + base.A @ w
    arm = moved.r - parent.frame.r
    v_joint = parent.v + np.cross(parent.w, arm) + base.A @ v
    return Placed(frame, v_joint + np.cross(w_joint, frame.r - moved.r), w_joint)


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
