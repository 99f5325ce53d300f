"""The scale of energies: on it a conserved energy is the level line that it should be."""

import numpy as np

from dap3d_core.result import Quantity, Result

#: Quantities that are drawn on the scale of the energies of their run.
ENERGIES = ("energy.kinetic", "energy.potential", "energy.total")


def span_of(result: Result, quantity: Quantity) -> float:
    """The span, J, that an axis should have at least to show an energy of a run, else 0.

    It is the larger of the changes of kinetic and potential energy. Where neither changes by more
    than the ledger allows for errors, as of a body that turns freely, it is the kinetic energy.
    """
    if quantity.name not in ENERGIES:
        return 0.0
    kinetic, potential = result.energy.kinetic, result.energy.potential
    exchanged, most = max(float(np.ptp(kinetic)), float(np.ptp(potential))), float(kinetic.max())
    entry = result.ledger.get("energy")
    errors = most * (entry.limit or 0.0) if entry else 0.0
    return exchanged if exchanged > errors else most


def drift_of(result: Result, quantity: Quantity) -> str:
    """Words on the drift of the total energy of a run that should conserve it, else "".

    It is relative, as the ledger's: "total energy" where there are potentials, "energy" of bodies
    on which nothing does work.
    """
    if quantity.name != "energy.total":
        return ""
    free = not result.summary.has_potential and not np.any(result.work - result.work[0])
    entry = result.ledger.get("energy" if free else "total energy")
    return f" (drift {entry.value:.1g})" if entry else ""
