"""Symbols of joints and forces: the one that the type declares, else its declared fields."""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import attrs
import numpy as np

from dap3d_core.interface.fields import slot_of
from dap3d_core.view.scene3d.elements import ORIGIN, ElementGeometry
from dap3d_core.view.scene3d.primitives import Located, Mark, Span, ball, bar, plain, turned_to
from dap3d_core.view.scene3d.sampled_motion import Motion

#: One calm colour for all joints, one for springs; bodies have colours of their own.
JOINT, FORCE = "#5b6470", "#8a6d3b"

Pieces = Iterator[Mark | Span]


@attrs.frozen(eq=False)
class Drawer:
    """Draws elements of one scene.

    Attributes:
        motion: poses of its bodies.
        unit: radius of a thin link, m; all sizes follow it.
        joints: all joints, among which a driver finds the one it drives.
    """

    motion: Motion
    unit: float
    joints: Sequence[ElementGeometry]

    def joint(self, one: ElementGeometry) -> list[Mark | Span]:
        """The solids of a joint."""
        return self._draw(one, one.symbol, "joints", JOINT)

    def force(self, one: ElementGeometry) -> list[Mark | Span]:
        """The solids of a force: a spring between its ends, or what its type declares.

        A force between two bodies whose type declares no point on them, such as a contact, has no
        solids: bodies that it does not touch would look joined. Its arrow shows where it acts.
        """
        if not (one.symbol or one.points or one.vectors):
            return []
        symbol = one.symbol or ("spring" if one.has_ends else "")
        return self._draw(one, symbol, "forces", FORCE)

    def _draw(self, one: ElementGeometry, symbol: str, layer: str, color: str) -> list[Mark | Span]:
        pieces = DRAWINGS[symbol](self, one)
        return [attrs.evolve(p, layer=layer, color=color, owner=one.name) for p in pieces]

    def start(self, body: int, point: Located) -> Located:
        """A point of another body at the first instant, in coordinates of a body."""
        return body, plain(self.motion.point_in(body, self.motion.points([point])[0, 0]))

    def home(self, one: ElementGeometry, body: int) -> Located:
        """The point on a body of an element without points.

        It is at the driven joint, one with a point between the same bodies; else at the origin of
        the element's first moving body.
        """
        between = set(one.bodies.values())
        for other in self.joints:
            if other is not one and other.points and set(other.bodies.values()) == between:
                return self.start(body, next(iter(other.points.values())))
        return self.start(body, (next((b for b in one.bodies.values() if b), 0), ORIGIN))

    def base(self, one: ElementGeometry, field: str) -> Located:
        """The start of the vector of a field: the point of its slot, or the home."""
        slot, body = slot_of(field) or "", one.vectors[field][0]
        point = one.points.get(slot)
        if point is not None and point[0] == body:
            return point
        if one.points:
            return self.start(body, next(iter(one.points.values())))
        return self.home(one, body)


def _ball(to: Drawer, one: ElementGeometry) -> Pieces:
    """A ball at the point; of an element without points around that of its joint."""
    if one.points:
        yield ball("", *one.place("i"), 1.8 * to.unit)
    else:
        yield ball("", *to.home(one, one.bodies["i"]), 2.6 * to.unit)


def _block(to: Drawer, one: ElementGeometry) -> Pieces:
    edge = 4.5 * to.unit
    yield Mark("", "box", one.bodies["i"], ORIGIN, (edge, edge, edge))


def _cross(to: Drawer, one: ElementGeometry) -> Pieces:
    """The two arms of the cross, each fixed in its body."""
    yield ball("", *one.place("i"), 1.5 * to.unit)
    for field in ("a_i", "n_j"):
        body, axis = one.vectors[field]
        yield bar(body, to.base(one, field)[1], axis, 0.9 * to.unit, 8.0 * to.unit)


def _hinge(to: Drawer, one: ElementGeometry) -> Pieces:
    """A pin along the axis, with a collar at its middle."""
    body, at = one.place("i")
    axis = one.vectors["a_i"][1]
    yield bar(body, at, axis, 1.1 * to.unit, 7.0 * to.unit)
    yield bar(body, at, axis, 2.0 * to.unit, 2.6 * to.unit)


def _link(to: Drawer, one: ElementGeometry) -> Pieces:
    start, end = one.place("i"), one.place("j")
    yield Span("", "rod", start, end, 0.8 * to.unit)
    yield ball("", *start, 1.6 * to.unit)
    yield ball("", *end, 1.6 * to.unit)


def _plate(to: Drawer, one: ElementGeometry) -> Pieces:
    """A ball on the body and a plate on ground, both at the point."""
    yield ball("", *one.place("i"), 2.0 * to.unit)
    at = to.motion.points([one.place("i")])[0, 0]
    yield bar(0, at, one.vectors["a_j"][1], 7.0 * to.unit, 0.3 * to.unit)


def _ring(to: Drawer, one: ElementGeometry) -> Pieces:
    """A ring about the first vector, the axis of a rotation."""
    field, (_, axis) = next(iter(one.vectors.items()))
    yield Mark("", "ring", *to.base(one, field), (4.0 * to.unit,) * 3, turned_to(axis))


def _sleeve(to: Drawer, one: ElementGeometry) -> Pieces:
    yield from _on_rail(to, one, "cylinder", 2.2 * to.unit)


def _slider(to: Drawer, one: ElementGeometry) -> Pieces:
    yield from _on_rail(to, one, "box", 4.0 * to.unit)


def _on_rail(to: Drawer, one: ElementGeometry, kind: str, width: float) -> Pieces:
    """A rail along a_j, as long as the motion, and a solid on it."""
    (body, at), (rail_body, rail_at), along = one.place("i"), one.place("j"), one.vectors["a_j"]
    direction = to.motion.direction(along)
    ends = to.motion.points([one.place("i"), one.place("j")])
    reach = np.einsum("tc,tc->t", ends[:, 0] - ends[:, 1], direction)
    low, high = min(reach.min(), 0.0) - 6.0 * to.unit, max(reach.max(), 0.0) + 6.0 * to.unit
    middle = np.asarray(rail_at) + 0.5 * (low + high) * np.asarray(along[1])
    yield bar(rail_body, middle, along[1], 0.7 * to.unit, float(high - low))
    axis = to.motion.vector_in(body, direction[0])
    yield Mark("", kind, body, at, (width, width, 6.0 * to.unit), turned_to(axis))


def _spring(to: Drawer, one: ElementGeometry) -> Pieces:
    yield Span("", "spring", one.place("i"), one.place("j"), 2.2 * to.unit)


def _wheel(to: Drawer, one: ElementGeometry) -> Pieces:
    """A thin disk about the y axis of the body, with spokes that show how it turns."""
    body, R = one.bodies["i"], one.numbers["radius"]
    y = (0.0, 1.0, 0.0)
    yield Mark("", "ring", body, ORIGIN, (0.95 * R, 0.95 * R, 0.5 * R), turned_to(y))
    yield bar(body, ORIGIN, y, 0.12 * R, 3.0 * (0.04 * R))
    for axis in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)):
        yield bar(body, ORIGIN, axis, 0.035 * R, 1.9 * R)
    yield ball("", body, (0.95 * R, 0.0, 0.0), 0.1 * R)


def _declared_fields(to: Drawer, one: ElementGeometry) -> Pieces:
    """Points as balls, vectors as lines, a vector between points as a rod, a list as a chain."""
    if one.has_ends:
        yield Span("", "rod", one.place("i"), one.place("j"), 0.5 * to.unit)
    for start, end in pairwise(one.chain):
        yield Span("", "rod", start, end, 0.5 * to.unit)
    for point in one.chain or one.points.values():
        yield ball("", *point, 1.8 * to.unit)
    for field, (_, axis) in one.vectors.items():
        yield bar(*to.base(one, field), axis, 0.6 * to.unit, 12.0 * to.unit)
    if not one.points and not one.vectors:
        bodies = [(body, ORIGIN) for body in one.bodies.values() if body]
        for start, end in pairwise(bodies):
            yield Span("", "rod", start, end, 0.5 * to.unit)


#: Symbol (``interface.types.SYMBOLS``) -> what draws it.
DRAWINGS: dict[str, Callable[[Drawer, ElementGeometry], Pieces]] = {
    "": _declared_fields,
    "ball": _ball,
    "block": _block,
    "cross": _cross,
    "hinge": _hinge,
    "link": _link,
    "plate": _plate,
    "ring": _ring,
    "sleeve": _sleeve,
    "slider": _slider,
    "spring": _spring,
    "wheel": _wheel,
}
