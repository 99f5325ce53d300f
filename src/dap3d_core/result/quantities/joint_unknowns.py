"""Unknowns of their own of joints as quantities: ``contact.s``."""

from contextlib import suppress

from dap3d_core.result.errors import ResultError
from dap3d_core.result.quantities.catalogue import Quantity, QuantityOwner, QuantitySource


def unknowns_of(source: QuantitySource, owner: QuantityOwner) -> dict[str, int]:
    """Columns of the unknowns of an owner; none where the model for them is not available."""
    if owner.kind == "joint" and not owner.slot and source.summary.angle_count:
        with suppress(ResultError):
            return source.model.unknowns_of(owner.name)
    return {}


def unknown_quantity(
    source: QuantitySource, name: str, owner: QuantityOwner, unknown: str, component: str
) -> Quantity | None:
    """An unknown of a joint; None where it has none of this name."""
    column = unknowns_of(source, owner).get(unknown)
    if column is None or component:
        return None
    values = source.arrays.angles[:, column]
    return Quantity(name, values, unknown, f"{unknown} of {owner.label}", "SI", (), owner.kind)
