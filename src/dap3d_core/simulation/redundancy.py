"""Redundant constraints: how many, where, and what to do about them (spec 8)."""

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.assembly.evaluate import place_bodies
from dap3d_core.formulations.machine import Machine
from dap3d_core.linear.rank import DENSE_ROWS, Rank, dense_rank, sparse_rank
from dap3d_core.simulation.initial import finite_rows

Floats = NDArray[np.float64]

#: Redundant rows whose combination misses zero by more than this contradict each other.
CONSISTENT = 1e-8


@attrs.frozen(eq=False)
class Redundancy:
    """Rank of the constraints at a state.

    Attributes:
        rank: rows, rank, degrees of freedom.
        joints: names of the joints whose rows depend on each other, in file order.
        contradiction: how much prescribed velocities of dependent rows disagree.
    """

    rank: Rank
    joints: tuple[str, ...]
    contradiction: float

    def describe(self) -> str:
        """One paragraph for people."""
        rank = self.rank
        if not rank.redundant:
            return f"{rank.rows} rows, all independent; {rank.dof} degrees of freedom"
        text = (
            f"{rank.redundant} of {rank.rows} constraint rows are redundant (rank {rank.rank} "
            f"by {rank.method}, tolerance {rank.tolerance:.1e}); {rank.dof} degrees of freedom. "
            f"The joints that share a freedom: {', '.join(self.joints)}"
        )
        if self.contradiction > CONSISTENT:
            text += (
                ". They contradict each other: "
                f"their prescribed velocities disagree by {self.contradiction:.3g}"
            )
        return text


def redundancy_of(machine: Machine, u: Floats, t: float = 0.0) -> Redundancy:
    """Rank of the constraints of a model at a state u (13 n,).

    Raises:
        AssemblyError: a row is not finite there.
    """
    model = machine.model
    rows = finite_rows(machine, t, u)
    if model.row_count <= DENSE_ROWS:
        rank = dense_rank(rows.dense())
    else:
        system = machine.system
        place_bodies(machine.integrated(u), system.body, system.metric)
        rank = sparse_rank(machine.plan, system.D, system.metric, system.row, 6 * model.body_count)
    shared = np.array(rank.shared, dtype=np.int64)
    involved = np.unique(np.searchsorted(model.joint_start, shared, side="right") - 1)
    gap = 0.0
    if rank.dependencies.size:
        gap = float(np.max(np.abs(rank.dependencies @ rows.nu), initial=0.0))
    return Redundancy(rank, tuple(model.joint_names[k] for k in involved), gap)
