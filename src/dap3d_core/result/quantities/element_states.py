"""States of their own of joints and forces as quantities: ``spring.z``, ``spring.z.2``."""

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


def components_of(summary: ModelSummary, owner: QuantityOwner, state: str) -> tuple[str, ...]:
    """Components of a state, from 1; none of a number, or where there is no such state."""
    return tuple(c for c in states_of(summary, owner).get(state, {}) if c)


def state_quantity(
    source: QuantitySource, name: str, owner: QuantityOwner, state: str, component: str
) -> Quantity | None:
    """A state of an owner, or a component of it; None where it has none of this name."""
    columns = states_of(source.summary, owner).get(state, {})
    if not columns or (component and component not in columns):
        return None
    label = f"{state} of {owner.label}" + (f", {component}" if component else "")
    if component or "" in columns:
        values = source.arrays.states[:, columns[component]]
        return Quantity(name, values, state, label, "SI", (), "state")
    values = source.arrays.states[:, list(columns.values())]
    return Quantity(name, values, state, label, "SI", tuple(columns), "state")
