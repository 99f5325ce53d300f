"""Quantities of contacts: ``floor.gap``, ``floor.friction.x``, ``floor.mode``."""

from typing import NamedTuple

import numpy as np

from dap3d_core.result.arrays import AXES
from dap3d_core.result.errors import UnknownNameError
from dap3d_core.result.post.contact_output import POINT, contact_names
from dap3d_core.result.quantities.catalogue import Quantity, QuantitySource


class _Part(NamedTuple):
    """Attribute of a ``ContactOutput``, what it is, its unit, whether it is a vector."""

    attribute: str
    label: str
    unit: str
    is_vector: bool = False


CONTACT_QUANTITIES = {
    "gap": _Part("gap", "gap", "m"),
    "normal": _Part("normal_force", "normal force", "N"),
    "friction": _Part("friction", "friction", "N", True),
    "slip": _Part("slip", "slip", "m/s", True),
    "mode": _Part("mode", "mode", "1"),
}


def contact_quantity(source: QuantitySource, name: str) -> Quantity | None:
    """A quantity of a contact; None where the name is of no contact.

    Vectors by components or ``norm``; those of a contact with several points are of ``NAME#1``;
    scalars of such a contact have a column for each point.

    Raises:
        UnknownNameError: the contact has no such quantity.
    """
    head, *rest = name.split(".")
    names = contact_names(source.summary.state_names)
    points = names.get(head.partition(POINT)[0])
    if points is None or (POINT in head and head not in points):
        return None
    part = CONTACT_QUANTITIES.get(rest[0]) if rest else None
    component = rest[1] if len(rest) == 2 else ""
    several = len(points) > 1 and POINT not in head
    allowed = (*AXES, "norm", "") if part is not None and part.is_vector else ("",)
    if part is None or len(rest) > 2 or component not in allowed or (several and part.is_vector):
        known = ", ".join(f"{head}.{n}" for n in CONTACT_QUANTITIES)
        more = f"; vectors are those of a point, {points[0]}.slip.x" if several else ""
        raise UnknownNameError(f"there is no quantity {name!r}; contact {head} has {known}{more}")
    values = np.asarray(getattr(source.contact(head), part.attribute), dtype=float)
    label = f"{part.label} of {head}" + (f", {component}" if component else "")
    components = AXES if part.is_vector else tuple(points) if several else ()
    if component:
        column = np.linalg.norm(values, axis=1) if component == "norm" else None
        values = values[:, AXES.index(component)] if column is None else column
        components = ()
    return Quantity(name, values, part.label, label, part.unit, components, "contact")
