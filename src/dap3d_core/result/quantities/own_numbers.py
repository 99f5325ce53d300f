"""States of joints and forces, and unknowns of joints, as quantities: ``spring.z.2``, ``peg.s``."""

from contextlib import suppress

from dap3d_core.model.joint_angles import JOINT_ANGLES
from dap3d_core.result.errors import ResultError
from dap3d_core.result.model_summary import ModelSummary
from dap3d_core.result.quantities.catalogue import Quantity, QuantityOwner, QuantitySource


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
    if owner.kind == "joint" and not owner.slot and _has_own_angles(source.summary):
        with suppress(ResultError):
            return source.model.unknowns_of(owner.name)
    return {}


def _has_own_angles(summary: ModelSummary) -> bool:
    """True if elements have angles or unknowns of their own, so far as that is known."""
    names = summary.angle_names or [""] * summary.angle_count
    return any(not name.startswith(JOINT_ANGLES) for name in names)


def own_names(source: QuantitySource, owner: QuantityOwner) -> tuple[str, ...]:
    """Names of the states and unknowns of an owner."""
    return (*states_of(source.summary, owner), *unknowns_of(source, owner))


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
