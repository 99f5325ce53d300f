"""Quantities of a result by name, such as ``crank.r.z``, as plots and tables name them."""

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from dap3d_core.interface.fields import SLOTS
from dap3d_core.model.groups import Floats
from dap3d_core.model.joint_angles import JOINT_ANGLES
from dap3d_core.registry.suggestions import nearest
from dap3d_core.result.arrays import AXES, POINT, ModelSummary
from dap3d_core.result.errors import LISTED, ResultError, UnknownNameError
from dap3d_core.result.quantities.catalogue import (
    ACTIONS,
    POINT_ARRAYS,
    QUANTITIES,
    SYSTEM,
    Quantity,
    QuantityOwner,
    QuantitySource,
)
from dap3d_core.scene.coerce import canonical

NORM = "norm"
#: Names of joint coordinates, of which a joint has some.
COORDINATE = re.compile(r"q[1-9]\d?(_dot)?|(angle|length)(_rate)?")
#: A quantity of the actuators of inverse dynamics alone.
ACTUATION = "actuation"
#: Kinds with names that a result knows without its scene; forces are looked up after them.
NAMED = ("body", "point", "joint")


def find(result: QuantitySource, name: str) -> Quantity:
    """Returns a quantity of a result.

    A whole vector, ``crank.r``; a component, ``crank.r.z``; or its length, ``crank.r.norm``. Where
    a body and a point share a name, it is the body's unless only the point has the quantity; a
    joint goes before a force of its name.

    Args:
        result: what the quantity is computed from.
        name: ``BODY.`` r p rd w wp rdd wd wpd roll pitch yaw; ``POINT.`` r v a (also rP rPd rPdd);
            ``JOINT.`` or ``JOINT.SLOT.`` force moment force_body moment_body moment_at_point,
            without a slot on the body of the first; ``JOINT.lambda`` (rows from 1); ``JOINT.`` q1
            q1_dot q2 q2_dot ... angle length angle_rate length_rate; ``JOINT.`` and ``FORCE.``
            states of their own, their numbers from 1; ``CONTACT.`` gap normal friction slip mode;
            ``FORCE.`` or ``FORCE.SLOT.`` the actions as
            of a joint; ``FORCE.`` length length_rate tension energy; energy.kinetic .potential
            .total; work; ``NAME.actuation`` of actuators of inverse dynamics; constraint.position
            .velocity .acceleration; t; inputs and outputs of the scene.

    Raises:
        UnknownNameError: there is no such quantity; names the nearest.
        ResultError: reactions and forces of a result without its model.
        TypeError: the name is not text.
    """
    if not isinstance(name, str):
        raise TypeError(f"a quantity is named by text such as 'crank.r.z', not by {name!r}")
    name = canonical(name)
    if name in SYSTEM:
        label, unit, values = SYSTEM[name]
        if name == "t":  # of kinematics over a coordinate, which takes the place of time
            settings = result.record.settings
            label, unit = settings.get("over") or label, settings.get("over_unit") or unit
        return Quantity(name, values(result), label, label, unit, ())
    if name in result.summary.input_names:
        column = result.arrays.inputs[:, result.summary.input_names.index(name)]
        return Quantity(name, column, "input", f"input {name}", "1", (), "input")
    if contact := _contact_quantity(result, name):
        return contact
    for kinds in (NAMED, ("force",)):
        for owner, attribute, component in _parsed(result, name, kinds):
            if owner.kind == "joint" and not component and COORDINATE.fullmatch(attribute):
                if coordinate := _coordinate(result, name, owner, attribute):
                    return coordinate
            elif attribute in QUANTITIES[owner.kind]:
                if not component or component in _components(result, owner, attribute):
                    return _quantity(result, name, owner, attribute, component)
            elif own := own_quantity(result, name, owner, attribute, component):
                return own
    if output := _output(result, name):
        return output
    raise _unknown(result, name)


def _quantity(
    result: QuantitySource, name: str, owner: QuantityOwner, attribute: str, component: str
) -> Quantity:
    kind, unit, _, function, rate = QUANTITIES[owner.kind][attribute]
    if attribute == ACTUATION:
        actuators, units = (
            str(result.record.settings.get(name, "")).split(", ")
            for name in ("actuators", "actuation_units")
        )
        unit = dict(zip(actuators, units, strict=False)).get(owner.name) or unit
    label = f"{kind} of {owner.label}" + (f", {component}" if component else "")
    rate = f"{owner.label}.{rate}" if rate else ""
    values, columns = function(result, owner), _columns(result, owner, attribute)
    if component:
        values = _component_of(values, columns, component)
        rate = f"{rate}.{component}" if rate and component != NORM else ""
    components = () if component else columns
    return Quantity(name, values, kind, label, unit, components, owner.kind, rate)


def _output(result: QuantitySource, name: str) -> Quantity | None:
    """An output of the scene, or a component of it; None where there is none."""
    head, _, component = name.partition(".")
    if head not in result.outputs:
        return None
    output = result.output_cache.get(head)
    if output is None:
        from dap3d_core.result.quantities.outputs import note_of_undefined, output_quantity

        expression = result.outputs[head]
        operands = {operand: find(result, operand) for operand in expression.names}
        output = output_quantity(head, expression, operands, result.arrays.t.shape)
        if note := note_of_undefined(output, operands.values(), result.arrays.t):
            result.note(note)
        result.output_cache[head] = output
    if not component:
        return output
    columns = output.components
    if component not in _with_norm(columns):
        return None
    values = _component_of(output.values, columns, component)
    return output._replace(name=name, values=values, label=f"{head}, {component}", components=())


def joint_coordinates(result: QuantitySource) -> Iterator[Quantity]:
    """The coordinates q1, q2, ... of all joints that have some, each followed by its rate.

    Raises:
        ResultError: the model is not available.
    """
    for joint in result.summary.joint_index:
        with suppress(UnknownNameError):
            for k in range(len(result.coordinates(joint).units)):
                yield find(result, f"{joint}.q{k + 1}")
                yield find(result, f"{joint}.q{k + 1}_dot")


def available_outputs(result: QuantitySource) -> Iterator[Quantity]:
    """The outputs of the scene that can be computed: some need the model for that."""
    for name in result.outputs:
        with suppress(ResultError):
            yield find(result, name)


def _with_norm(columns: tuple[str, ...]) -> tuple[str, ...]:
    """Names that may follow a quantity: those of its columns, and of the length of a vector."""
    return (*columns, NORM) if columns == AXES else columns


def _component_of(values: Floats, columns: tuple[str, ...], component: str) -> Floats:
    if component == NORM:
        return np.asarray(np.linalg.norm(values, axis=1))
    return values[:, columns.index(component)]


def _coordinate(
    result: QuantitySource, name: str, owner: QuantityOwner, attribute: str
) -> Quantity | None:
    """A coordinate of a joint or its rate; None where it has none of this name."""
    try:
        coordinates = result.coordinates(owner.name)
    except UnknownNameError:
        return None
    if attribute not in coordinates.names:
        return None
    k, is_rate = coordinates.names[attribute]
    values, unit = (coordinates.q, coordinates.q_dot)[is_rate][:, k], coordinates.units[k]
    alias = next((alias for alias, place in coordinates.aliases.items() if place == k), "")
    kind = alias or f"coordinate q{k + 1}"
    kind, unit = (f"{kind} rate", f"{unit}/s") if is_rate else (kind, unit)
    rate = "" if is_rate else f"{owner.name}.q{k + 1}_dot"
    return Quantity(name, values, kind, f"{kind} of {owner.name}", unit, (), "coordinate", rate)


def _columns(result: QuantitySource, owner: QuantityOwner, attribute: str) -> tuple[str, ...]:
    """Names of the columns of a quantity."""
    if attribute == "lambda" and owner.kind == "joint":
        return tuple(str(k + 1) for k in range(result.summary.joint_rows[owner.place]))
    if attribute == "tension" and owner.kind == "force":
        with suppress(ResultError, UnknownNameError):
            tension = result.force(owner.name).tension
            shape = () if tension is None else tension.shape[1:]
            return tuple(str(k + 1) for count in shape for k in range(count))
    if known := QUANTITIES[owner.kind].get(attribute):
        return known.components
    return tuple(c for c in states_of(result.summary, owner).get(attribute, {}) if c)


def _components(result: QuantitySource, owner: QuantityOwner, attribute: str) -> tuple[str, ...]:
    """Names that may follow a quantity."""
    return _with_norm(_columns(result, owner, attribute))


def _indices(
    result: QuantitySource, kinds: Iterable[str] = tuple(QUANTITIES)
) -> dict[str, Mapping[str, int]]:
    """Names of each kind with their indices; those of forces are read from the scene."""
    return {
        kind: {name: k for k, name in enumerate(result.force_names)}
        if kind == "force"
        else getattr(result.summary, f"{kind}_index")
        for kind in kinds
    }


def _owners(
    result: QuantitySource, label: str, kinds: Iterable[str] = tuple(QUANTITIES)
) -> Iterator[QuantityOwner]:
    """Possible owners of a name, with or without a slot at its end."""
    head, _, slot = label.rpartition(".")
    for kind, indices in _indices(result, kinds).items():
        if label in indices:
            yield QuantityOwner(kind, label, indices[label])
        elif kind in ("joint", "force") and slot in SLOTS and head in indices:
            yield QuantityOwner(kind, head, indices[head], slot)


def _parsed(
    result: QuantitySource, name: str, kinds: Iterable[str]
) -> Iterator[tuple[QuantityOwner, str, str]]:
    """Possible (owner, attribute, component or "") of a name."""
    parts = name.split(".")
    for tail in (2, 1)[len(parts) < 3 :]:
        attribute, component = parts[-tail], parts[-1] if tail == 2 else ""
        for owner in _owners(result, ".".join(parts[:-tail]), kinds):
            known = POINT_ARRAYS if owner.kind == "point" else {}
            if not owner.slot or attribute in ACTIONS:
                yield owner, known.get(attribute, attribute), component


def _unknown(result: QuantitySource, name: str) -> UnknownNameError:
    """The error for a name: its owner, its attribute or its component is wrong."""
    if _is_expression(result, name):
        remedy = "declare it in [outputs], scene.outputs[NAME] = EXPRESSION, and give its name"
        return UnknownNameError(f"{name!r} is an expression and no name: {remedy}")
    parts = name.split(".")
    for size in (2, 1):  # an animation point has a dot in its name
        for owner in _owners(result, ".".join(parts[:size])):
            fault = _fault(result, owner, parts[size:])
            return UnknownNameError(fault, _suggestion(result, owner.label, parts[size:]))
    if parts[0] in result.outputs:
        output = find(result, parts[0])
        components = ", ".join(_with_norm(output.components)) or "no components"
        return UnknownNameError(f"the output {parts[0]} has {components}, not {name!r}")
    heads = [n for n in SYSTEM if n.startswith(f"{parts[0]}.")]
    names = {kind: tuple(indices) for kind, indices in _indices(result).items()}
    names["contact"] = tuple(result.summary.contacts)
    inside = [n for of_kind in names.values() for n in of_kind if n.startswith(f"{name}/")]
    if inside:
        part = f"parts of the sub-assembly {name!r} have names such as {inside[0]}"
        return UnknownNameError(f"{part}; in expressions they stand in quotes: '{inside[0]}.r.x'")
    if heads or len(parts) == 1:
        known = (*SYSTEM, *result.summary.input_names, *result.outputs)
        choices = heads or ["BODY.r", "BODY.w.z", "POINT.v", "JOINT.force.norm", *known]
        fault = f"there is no quantity {name!r}; there are {', '.join(choices)}"
        return UnknownNameError(fault, nearest(name, known))
    size = 2 if parts[0] == "animation" and len(parts) > 2 else 1
    given = ".".join(parts[:size])
    fault = f"there is no body, point, joint, contact or force {given!r}"
    near = nearest(given, [n for of_kind in names.values() for n in of_kind])
    if not near and sum(map(len, names.values())) <= LISTED:
        fault += "".join(f"; {kind}: {', '.join(known)}" for kind, known in names.items() if known)
    if near in result.summary.contacts:
        return UnknownNameError(fault, ".".join([near, *parts[size:]]))
    return UnknownNameError(fault, _suggestion(result, near, parts[size:]))


def _is_expression(result: QuantitySource, text: str) -> bool:
    """True of text that computes something from quantities that there are."""
    if text.replace(".", "_").isidentifier():
        return False
    from dap3d_core.scene.expressions.expression import Call, ExpressionError, parse_expression

    try:
        expression = parse_expression(text)
        return isinstance(expression.root, Call) and all(find(result, n) for n in expression.names)
    except (ExpressionError, UnknownNameError):
        return False


def _attributes(result: QuantitySource, owner: QuantityOwner) -> tuple[str, ...]:
    """Names that may follow an owner."""
    names = ACTIONS if owner.slot else QUANTITIES[owner.kind]
    is_actuator = owner.name in result.record.actuation
    known = [name for name in names if name != ACTUATION or is_actuator]
    own = [*states_of(result.summary, owner), *unknowns_of(result, owner)]
    if owner.kind == "joint" and not owner.slot:
        with suppress(ResultError, UnknownNameError):  # where the model for them is at hand
            own += result.coordinates(owner.name).names
    if owner.kind == "force" and not owner.slot:
        with suppress(ResultError):  # as above
            try:
                output = result.force(owner.name)
            except UnknownNameError:  # it acts on every body
                return ()
            known = [name for name in known if getattr(output, name, name) is not None]
    return (*known, *own)


def _fault(result: QuantitySource, owner: QuantityOwner, rest: list[str]) -> str:
    attributes = _attributes(result, owner)
    if not attributes:
        return f"the {owner.kind} {owner.label!r} has no quantities: it acts on no body of its own"
    if not rest:
        return f"which quantity of the {owner.kind} {owner.label!r}: {', '.join(attributes)}"
    if rest[0] not in attributes:
        if owner.kind == "joint" and COORDINATE.fullmatch(rest[0]):
            try:
                result.coordinates(owner.name)
            except UnknownNameError as error:
                return str(error)
        return f"the {owner.kind} {owner.label!r} has {', '.join(attributes)}, not {rest[0]!r}"
    components = ", ".join(_components(result, owner, rest[0])) or "no components"
    return f"{owner.label}.{rest[0]} has {components}, not {'.'.join(rest[1:])!r}"


def _suggestion(result: QuantitySource, label: str, rest: list[str]) -> str:
    """The nearest valid name of a quantity of an owner, or ""."""
    for owner in _owners(result, label) if rest else ():
        attribute = nearest(rest[0], _attributes(result, owner))
        if attribute:
            components = _components(result, owner, attribute)
            component = nearest(rest[1], components) if len(rest) > 1 else ""
            return ".".join([label, attribute, *([component] if component else [])])
    return ""


def names_of(result: QuantitySource, begin: str = "") -> list[str]:
    """Names of quantities that continue a beginning by one part, in the scene's order.

    Args:
        result: what has the quantities.
        begin: start of a name: "" gives all owners, "crank." the quantities of a body, "crank.r."
            the components, "J1.j." the actions of a joint on its second body.

    Returns:
        Whole names, and names of owners, which end in a dot.
    """
    contacts = dict.fromkeys((*result.summary.contacts, *result.summary.contact_points))
    owners = [name for indices in _indices(result).values() for name in indices]
    owners += contacts
    known = (*SYSTEM, *result.summary.input_names, *result.outputs)
    names = [*(f"{name}." for name in owners), *known]
    head = begin.rpartition(".")[0]
    if head in result.outputs:
        names += [f"{head}.{one}" for one in _with_norm(find(result, head).components)]
    label, _, attribute = head.rpartition(".")
    for owner in _owners(result, head):
        names += [f"{head}.{one}" for one in _attributes(result, owner)]
    for owner in _owners(result, label):
        if attribute in _attributes(result, owner):
            names += [f"{head}.{one}" for one in _components(result, owner, attribute)]
    if head in contacts:
        names += [f"{head}.{one}" for one in CONTACT_QUANTITIES]
    elif label in contacts and attribute in CONTACT_QUANTITIES:
        is_vector = CONTACT_QUANTITIES[attribute].is_vector
        names += [f"{head}.{one}" for one in (*AXES, NORM) if is_vector]
    names = [name for name in dict.fromkeys(names) if name.startswith(begin) and name != begin]
    if len(names) == 1 and names[0].endswith("."):
        return names_of(result, names[0])
    return names


def states_of(summary: ModelSummary, owner: QuantityOwner) -> dict[str, dict[str, int]]:
    """Columns of each state of an owner: component ("" of a single number) -> column."""
    found: dict[str, dict[str, int]] = {}
    if owner.slot:
        return found
    for column, label in enumerate(summary.state_names):
        kind, element, name, *component = label.split(".")
        if kind == f"{owner.kind}s" and element == owner.name:
            found.setdefault(name, {})["".join(component)] = column
    return found


def unknowns_of(source: QuantitySource, owner: QuantityOwner) -> dict[str, int]:
    """Columns of the unknowns of an owner; none where the model for them is not available."""
    # angles of elements and unknowns, so far as their names are known
    names = source.summary.angle_names or [""] * source.summary.angle_count
    has_own = any(not name.startswith(JOINT_ANGLES) for name in names)
    if owner.kind == "joint" and not owner.slot and has_own:
        with suppress(ResultError):
            return source.model.unknowns_of(owner.name)
    return {}


def own_quantity(
    source: QuantitySource, name: str, owner: QuantityOwner, attribute: str, component: str
) -> Quantity | None:
    """A state or an unknown of an owner, or a component; None where it has none of this name."""
    columns = states_of(source.summary, owner).get(attribute)
    if columns is None:
        column = unknowns_of(source, owner).get(attribute)
        if column is None or component:
            return None
        values, kind = source.arrays.angles[:, column], owner.kind
        return Quantity(name, values, attribute, f"{attribute} of {owner.label}", "SI", (), kind)
    if component and component not in columns:
        return None
    label = f"{attribute} of {owner.label}" + (f", {component}" if component else "")
    if component or "" in columns:
        values = source.arrays.states[:, columns[component]]
        return Quantity(name, values, attribute, label, "SI", (), "state")
    values = source.arrays.states[:, list(columns.values())]
    return Quantity(name, values, attribute, label, "SI", tuple(columns), "state")


class _Part(NamedTuple):
    """Attribute of a ``ContactOutput``, what it is, whether it is a vector."""

    attribute: str
    label: str
    is_vector: bool = False


CONTACT_QUANTITIES = {
    "gap": _Part("gap", "gap"),
    "normal": _Part("normal_force", "normal force"),
    "friction": _Part("friction", "friction", True),
    "slip": _Part("slip", "slip", True),
    "mode": _Part("mode", "mode"),
}


def _contact_quantity(source: QuantitySource, name: str) -> Quantity | None:
    """A quantity of a contact, such as ``floor.friction.x``; None of a name of no contact.

    Vectors by components or ``norm``; those of a contact with several points are of ``NAME#1``;
    scalars of such a contact have a column for each point.
    """
    head, *rest = name.split(".")
    points = source.summary.contacts.get(head.partition(POINT)[0])
    if points is None or (POINT in head and head not in points):
        return None
    part = CONTACT_QUANTITIES.get(rest[0]) if rest else None
    component = rest[1] if len(rest) == 2 else ""
    several = len(points) > 1 and POINT not in head
    allowed = (*AXES, NORM, "") if part is not None and part.is_vector else ("",)
    if part is None or len(rest) > 2 or component not in allowed or (several and part.is_vector):
        known = ", ".join(f"{head}.{n}" for n in CONTACT_QUANTITIES)
        more = f"; vectors are those of a point, {points[0]}.slip.x" if several else ""
        raise UnknownNameError(f"there is no quantity {name!r}; contact {head} has {known}{more}")
    contact = source.contact(head)
    values = np.asarray(getattr(contact, part.attribute), dtype=float)
    unit = contact.units[part.attribute]
    kind = "moment" if part.attribute == "normal_force" and unit == "N m" else part.label
    label = f"{kind} of {head}" + (f", {component}" if component else "")
    components = AXES if part.is_vector else tuple(points) if several else ()
    if component:
        values, components = _component_of(values, AXES, component), ()
    return Quantity(name, values, kind, label, unit, components, "contact")
