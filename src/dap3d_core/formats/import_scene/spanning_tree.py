"""The tree of an articulated model: which joint places each link, and where the links are."""

from collections.abc import Iterator

import attrs
import numpy as np

from dap3d_core.interface.formats.articulation import KINDS, WORLD, Articulation, Joint
from dap3d_core.interface.formats.frames import IDENTITY, Frame
from dap3d_core.interface.formats.joint_motion import joint_motion, rest_coordinates, reversed_joint
from dap3d_core.interface.formats.remarks import FormatError
from dap3d_core.kernels.array_types import Floats
from dap3d_core.registry.suggestions import did_you_mean


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
        if model.fixed_base is False:
            _hang_parents(placing, loops)
        roots = [name for name in model.links if name not in placing]
        order, children = list(roots), dict[str, list[str]]()
        for name, joint in placing.items():
            children.setdefault(joint.parent, []).append(name)
        order += children.get(WORLD, [])
        for name in order:  # grows
            order += children.get(name, [])
        if len(order) < len(model.links):
            lost = next(name for name in model.links if name not in set(order))
            what = f"link {lost} hangs from itself: its joints form a circle without a root"
            raise FormatError(what, model.links[lost].place)
        return cls(model, placing, loops, roots, order)

    def place(self) -> dict[str, Placed]:
        """Poses and velocities of all links where the model starts."""
        placed = {WORLD: Placed(IDENTITY)}
        for name in self.roots:
            placed[name] = Placed(self.model.base_poses.get(name, IDENTITY))
        for name in self.order:
            joint = self.placing.get(name)
            if joint is not None:
                placed[name] = _next(placed[joint.parent], joint)
        return placed

    def in_loops(self) -> set[str]:
        """The names of the joints that move with closed loops, those that close them included."""
        names: set[str] = set()
        for joint in self.loops:
            names |= {joint.name, *set(self._above(joint.parent)) ^ set(self._above(joint.child))}
        return names

    def _above(self, link: str) -> Iterator[str]:
        """The names of the joints between a link and its root."""
        while link in self.placing:
            yield self.placing[link].name
            link = self.placing[link].parent


def _hang_parents(placing: dict[str, Joint], loops: list[Joint]) -> None:
    """Let joints place their parents where these hang from nothing.

    Such a joint is taken the other way round, with the same coordinate.
    """
    reversible = ("fixed", "revolute", "prismatic", "screw", "cylindrical")
    for joint in tuple(loops):
        above = joint.child
        while above in placing and above != joint.parent:
            above = placing[above].parent
        held = joint.parent == WORLD or joint.parent in placing or above == joint.parent
        if joint.kind in reversible and not (joint.closes or held):
            placing[joint.parent] = reversed_joint(joint)
            loops.remove(joint)


def _check(model: Articulation, joint: Joint) -> None:
    for end in (joint.parent, joint.child):
        if end != WORLD and end not in model.links:
            hint = did_you_mean(end, model.links, "; {}")
            raise FormatError(f"joint {joint.name}: there is no link {end!r}{hint}", joint.place)
    if joint.parent == joint.child:
        what = f"joint {joint.name}: parent and child are the same link, {joint.child}"
        raise FormatError(what, joint.place)


def _next(parent: Placed, joint: Joint) -> Placed:
    """The child of a joint."""
    size = KINDS[joint.kind]
    motion, v, w = joint_motion(
        joint, joint.position or rest_coordinates(joint), joint.rate or (0.0,) * size
    )
    base = parent.frame @ joint.in_parent
    moved = base @ motion
    frame = moved @ joint.in_child.inverse()
    w_joint = parent.w + base.A @ w
    arm = moved.r - parent.frame.r
    v_joint = parent.v + np.cross(parent.w, arm) + base.A @ v
    return Placed(frame, v_joint + np.cross(w_joint, frame.r - moved.r), w_joint)
