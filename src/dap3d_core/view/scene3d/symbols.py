"""How joints and forces look: by the kind that their keyword says, else by what they declare."""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import attrs
import numpy as np

from dap3d_core.interface.fields import slot_of
from dap3d_core.model.groups import Floats
from dap3d_core.view.scene3d.elements import ORIGIN, Placed
from dap3d_core.view.scene3d.primitives import Located, Mark, Span, ball, bar, plain, turned_to
from dap3d_core.view.scene3d.sampled_motion import Motion

#: One calm colour for all joints, one for springs; bodies have colours of their own.
JOINT, FORCE = "#5b6470", "#8a6d3b"


@attrs.frozen(eq=False)
class Drawer:
    """Draws elements of one scene.

    Attributes:
        motion: where its bodies are.
        unit: radius of a thin link, m; all sizes follow it.
        joints: all joints, among which a driver looks for the one it drives.
    """

    motion: Motion
    unit: float
    joints: Sequence[Placed]

    def joint(self, one: Placed) -> "Drawing":
        """The marks and spans of a joint."""
        return self._drawn(one, LOOKS.get(one.keyword, _declared), "joints", JOINT)

    def force(self, one: Placed) -> "Drawing":
        """The marks and spans of a force: a spring between its ends, or what its type declares.

        A force between two bodies whose type declares no place on them, such as a contact, has no
        mark: bodies that it does not touch would look joined. Its arrow shows where it acts.
        """
        if not one.points and not one.vectors:
            return Drawing([], [])
        look = _spring if one.has_ends else LOOKS.get(one.keyword, _declared)
        return self._drawn(one, look, "forces", FORCE)

    def _drawn(self, one: Placed, look: "Look", layer: str, color: str) -> "Drawing":
        try:
            pieces = list(look(self, one))
        except (KeyError, ValueError):  # a type of the model's own that took a standard keyword
            pieces = list(_declared(self, one))
        found = [attrs.evolve(p, layer=layer, color=color, owner=one.name) for p in pieces]
        marks = [p for p in found if isinstance(p, Mark)]
        return Drawing(marks, [p for p in found if isinstance(p, Span)])

    def home(self, one: Placed, body: int) -> Located:
        """Where on a body something without a point of its own stands.

        At the joint that is driven, one with a point between the same bodies; else at the origin
        of the element's first moving body.
        """
        between = set(one.bodies.values())
        for other in self.joints:
            if other is not one and other.points and set(other.bodies.values()) == between:
                slot = next(iter(other.points))
                place = self.motion.points([other.points[slot]])[0, 0]
                return body, plain(self.motion.point_in(body, place))
        mover = next((b for b in one.bodies.values() if b), 0)
        place = self.motion.points([(mover, ORIGIN)])[0, 0]
        return body, plain(self.motion.point_in(body, place))

    def stand(self, one: Placed, field: str) -> Located:
        """Where the vector of a field is drawn: at the point of its slot, or at the home."""
        slot, body = slot_of(field) or "", one.vectors[field][0]
        point = one.points.get(slot)
        if point is not None and point[0] == body:
            return point
        if one.points:
            place = self.motion.points([next(iter(one.points.values()))])[0, 0]
            return body, plain(self.motion.point_in(body, place))
        return self.home(one, body)


class Drawing(NamedTuple):
    """What stands for an element."""

    marks: list[Mark]
    spans: list[Span]


Pieces = Iterator[Mark | Span]
Look = Callable[[Drawer, Placed], Pieces]


# ---------------------------------------------------------------- by kind


def _hinge(to: Drawer, one: Placed) -> Pieces:
    """A pin along the axis, with a collar at its middle."""
    body, at = one.place("i")
    axis = one.vectors["a_i"][1]
    yield bar(body, at, axis, 1.1 * to.unit, 7.0 * to.unit)
    yield bar(body, at, axis, 2.0 * to.unit, 2.6 * to.unit)


def _ball(to: Drawer, one: Placed) -> Pieces:
    yield ball("", *one.place("i"), 1.8 * to.unit)


def _cross(to: Drawer, one: Placed) -> Pieces:
    """The two arms of the cross, each fixed in its body."""
    yield ball("", *one.place("i"), 1.5 * to.unit)
    for field in ("a_i", "n_j"):
        body, axis = one.vectors[field]
        at = to.stand(one, field)[1]
        yield bar(body, at, axis, 0.9 * to.unit, 8.0 * to.unit)


def _slider(to: Drawer, one: Placed, kind: str = "box") -> Pieces:
    """A rail along a_j, as long as the motion, and a sleeve on it."""
    (body, at), (rail, along) = one.place("i"), one.vectors["a_j"]
    yield _rail(to, one)
    axis = to.motion.vector_in(body, to.motion.direction((rail, along))[0])
    size = (2.2 * to.unit, 2.2 * to.unit, 6.0 * to.unit)
    if kind == "box":
        size = (4.0 * to.unit, 4.0 * to.unit, 6.0 * to.unit)
    yield Mark("", kind, body, at, size, turned_to(axis))


def _rail(to: Drawer, one: Placed) -> Mark:
    body, at = one.place("j")
    direction = to.motion.direction(one.vectors["a_j"])
    ends = to.motion.points([one.place("i"), one.place("j")])
    reach = np.einsum("tc,tc->t", ends[:, 0] - ends[:, 1], direction)
    low, high = min(reach.min(), 0.0) - 6.0 * to.unit, max(reach.max(), 0.0) + 6.0 * to.unit
    axis = np.asarray(one.vectors["a_j"][1])
    middle: Floats = np.asarray(at) + 0.5 * (low + high) * axis
    return bar(body, middle, axis, 0.7 * to.unit, float(high - low))


def _cylindrical(to: Drawer, one: Placed) -> Pieces:
    return _slider(to, one, "cylinder")


def _link(to: Drawer, one: Placed) -> Pieces:
    start, end = one.place("i"), one.place("j")
    yield Span("", "rod", start, end, 0.8 * to.unit)
    yield ball("", *start, 1.6 * to.unit)
    yield ball("", *end, 1.6 * to.unit)


def _wheel(to: Drawer, one: Placed) -> Pieces:
    """A thin disk about the y axis of the body, with a spoke that shows how it turns."""
    body, R = one.bodies["i"], one.numbers["radius"]
    flat, y = 0.04 * R, (0.0, 1.0, 0.0)
    yield Mark("", "ring", body, ORIGIN, (0.95 * R, 0.95 * R, 0.5 * R), turned_to(y))
    yield bar(body, ORIGIN, y, 0.12 * R, 3.0 * flat)
    for axis in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)):
        yield bar(body, ORIGIN, axis, 0.035 * R, 1.9 * R)
    yield ball("", body, (0.95 * R, 0.0, 0.0), 0.1 * R)


def _motor(to: Drawer, one: Placed) -> Pieces:
    """A ring about the axis of the rotation that is driven."""
    (field, *_) = one.vectors
    body, at = to.stand(one, field)
    size = (4.0 * to.unit, 4.0 * to.unit, 4.0 * to.unit)
    yield Mark("", "ring", body, at, size, turned_to(one.vectors[field][1]))


def _fixed(to: Drawer, one: Placed) -> Pieces:
    edge = 4.5 * to.unit
    yield Mark("", "box", one.bodies["i"], ORIGIN, (edge, edge, edge))


def _plane(to: Drawer, one: Placed) -> Pieces:
    """A ball on the body and a plate on ground, both at the point."""
    yield ball("", *one.place("i"), 2.0 * to.unit)
    normal = one.vectors["a_j"][1]
    at = to.motion.points([one.place("i")])[0, 0]
    yield bar(0, at, normal, 7.0 * to.unit, 0.3 * to.unit)


def _spring(to: Drawer, one: Placed) -> Pieces:
    yield Span("", "spring", one.place("i"), one.place("j"), 2.2 * to.unit)


def _declared(to: Drawer, one: Placed) -> Pieces:
    """Any type: its points as balls, its vectors as lines, a vector between points as a rod."""
    if one.has_ends:
        yield Span("", "rod", one.place("i"), one.place("j"), 0.5 * to.unit)
    for point in one.points.values():
        yield ball("", *point, 1.8 * to.unit)
    for field, (_, axis) in one.vectors.items():
        body, at = to.stand(one, field)
        yield bar(body, at, axis, 0.6 * to.unit, 12.0 * to.unit)
    if not one.points and not one.vectors and len(one.bodies) > 1:
        bodies = [(body, ORIGIN) for body in one.bodies.values() if body]
        for start, end in pairwise(bodies):
            yield Span("", "rod", start, end, 0.5 * to.unit)


#: Keyword of a type -> how it looks; all others are drawn by what they declare.
LOOKS: dict[str, Look] = {
    "rev": _hinge,
    "sph": _ball,
    "univ": _cross,
    "cyl": _cylindrical,
    "tran": _slider,
    "sph-sph": _link,
    "disk": _wheel,
    "fix": _fixed,
    "rP": _plane,
    "rel-rot": _motor,
    "drive-rot": _motor,
    "rot_sda": _motor,
}
