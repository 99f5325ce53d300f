"""Joints and forces of a model as geometry: points, vectors and numbers of their fields."""

from collections.abc import Iterator
from typing import Any

import attrs

from dap3d_core.interface.fields import slot_of, specs_of
from dap3d_core.interface.types import acts_on_all
from dap3d_core.model import Model
from dap3d_core.model.groups import Group
from dap3d_core.result import Result, ResultError
from dap3d_core.scene.validate.shapes import Shape
from dap3d_core.view.scene3d.contact_shapes import contact_shapes
from dap3d_core.view.scene3d.primitives import Located, Point, floats_of

ORIGIN = (0.0, 0.0, 0.0)


@attrs.frozen
class ElementGeometry:
    """A joint or a force with its geometry.

    Attributes:
        name, keyword: its own, and that of its type.
        symbol: declared by its type, one of ``interface.types.SYMBOLS``; "" where there is none.
        bodies: slot -> body index, ground 0.
        points: slot -> the point ``P_i``, ``P_j``, ... on that body.
        vectors: field -> body index and direction there.
        numbers: field -> number.
        has_ends: True where the type declares a vector between two points.
        chain: points of a list, in order.
    """

    name: str
    keyword: str
    symbol: str
    bodies: dict[str, int]
    points: dict[str, Located]
    vectors: dict[str, Located]
    numbers: dict[str, float]
    has_ends: bool
    chain: list[Located]

    @property
    def moving(self) -> tuple[int, ...]:
        """Indices of its bodies without ground."""
        return tuple(body for body in self.bodies.values() if body)

    def place(self, slot: str) -> Located:
        """The element's point on the body of a slot, the origin where it has none."""
        return self.points.get(slot, (self.bodies[slot], ORIGIN))


@attrs.frozen
class Elements:
    """Joints and forces; none, and why, where the model cannot be made again.

    Contacts are drawn by ``surfaces``, what they touch with.
    """

    joints: list[ElementGeometry]
    contacts: list[ElementGeometry]
    surfaces: list[Shape]
    forces: list[ElementGeometry]
    gravity: Point | None
    missing: str


def elements_of(result: Result) -> Elements:
    """The joints and forces of a result."""
    try:
        model = result.model
    except ResultError as error:
        return Elements([], [], [], [], None, str(error))
    joints, forces = joints_of(model), forces_of(model)
    contacts, surfaces = _in_order(model.contacts, model.joint_names), contact_shapes(model)
    return Elements(joints, contacts, surfaces, forces, gravity_of(model), "")


def joints_of(model: Model) -> list[ElementGeometry]:
    """The joints of a model, in file order, without contacts."""
    groups = [g for g in model.joints if not g.type_info.type.is_contact]
    return _in_order(groups, model.joint_names)


def forces_of(model: Model) -> list[ElementGeometry]:
    """The forces that act on bodies of their own, in file order; what joints bring is theirs."""
    groups = [g for g in model.forces if not acts_on_all(g.type_info.type)]
    brought = model.brought_forces.values()
    return [one for one in _in_order(groups, model.force_names) if one.name not in brought]


def gravity_of(model: Model) -> Point | None:
    """(3,) gravitational acceleration, m/s^2, or None.

    It is that of a force on each body with ``gravity`` and the direction ``wgt``, as ``weight``.
    """
    for group in model.forces:
        numbers = group.of_instance(0)
        if getattr(group.type_info.type, "each_body", False) and {"gravity", "wgt"} <= set(numbers):
            return floats_of(numbers["gravity"] * numbers["wgt"])
    return None


def _in_order(groups: Any, names: tuple[str, ...]) -> list[ElementGeometry]:
    elements = {
        int(member): _geometry(group, k, names[int(member)])
        for group in groups
        for k, member in enumerate(group.members)
    }
    return [elements[member] for member in sorted(elements)]


def _geometry(group: Group, member: int, name: str) -> ElementGeometry:
    layout, specs = group.type_info.layout, specs_of(group.type_info.type)
    bodies = dict(zip(layout.slots, map(int, group.bodies[member]), strict=True))
    has_ends = any(spec.kind == "vector2" for spec in specs.values())
    on = dict(_bodies_of_vectors(group, member, bodies))
    points: dict[str, Located] = {}
    vectors: dict[str, Located] = {}
    numbers: dict[str, float] = {}
    chain: list[Located] = []
    lists = tuple(f"{field}_" for field, spec in specs.items() if spec.kind == "points")
    for field, value in group.of_instance(member).items():
        kind = specs[field].kind if field in specs else ""
        slot = slot_of(field)
        is_end = has_ends and field in ("P_i", "P_j")
        if value.shape == (3,) and slot in bodies and (kind == "point" or is_end):
            points[slot] = bodies[slot], floats_of(value)
            if field.startswith(lists):
                chain.append(points[slot])
        elif value.shape == (3,) and field in on:
            vectors[field] = on[field], floats_of(value)
        elif value.shape == () and kind == "number":
            numbers[field] = float(value)
    symbol = group.type_info.type.symbol
    return ElementGeometry(
        name, group.keyword, symbol, bodies, points, vectors, numbers, has_ends, chain
    )


def _bodies_of_vectors(
    group: Group, member: int, bodies: dict[str, int]
) -> Iterator[tuple[str, int]]:
    """The body of each vector field: that of its slot, ground, or the one the scene names."""
    layout = group.type_info.layout
    others = dict(zip(layout.others, group.functions[member, len(layout.functions) :], strict=True))
    for field, spec in specs_of(group.type_info.type).items():
        slot = slot_of(field)
        if spec.kind != "vector":
            continue
        if spec.ground:
            yield field, 0
        elif field in others:
            yield field, int(others[field])
        elif slot in bodies:
            yield field, bodies[slot]
