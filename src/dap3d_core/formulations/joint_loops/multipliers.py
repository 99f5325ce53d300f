"""Multipliers of kept rows among those of all rows: their reactions on the bodies of the tree."""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.formulations.joint_loops.layout import (
    CUT_WIDTH,
    END_BLOCK,
    END_BODY,
    END_WIDTH,
    FIRST,
    FIRST_END,
    FIRST_ROW,
    LAST_END,
    ROW_COUNT,
)
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled


@compiled
def add_kept_reactions(system: System, left: Floats) -> None:
    """-lambda of the kept rows into ``multipliers``, and what is left for the joints of the tree.

    left: as of ``joint_multipliers``.
    """
    kept = system.tree.kept
    cuts, ends, D = pointer(kept.cuts), pointer(kept.ends), pointer(system.D)
    for q in range(kept.cuts.shape[0]):
        c = CUT_WIDTH * q
        rows, first, place = cuts[c + ROW_COUNT], cuts[c + FIRST], cuts[c + FIRST_ROW]
        for r in range(rows):
            system.multipliers[place + r] = -kept.multipliers[first + r]
        for e in range(cuts[c + FIRST_END], cuts[c + LAST_END]):
            b = 6 * ends[END_WIDTH * e + END_BODY]
            for r in range(rows):
                d, x = ends[END_WIDTH * e + END_BLOCK] + 6 * r, kept.multipliers[first + r]
                for i in range(6):
                    left[b + i] -= D[d + i] * x


@compiled
def power_of_kept_drivers(system: System) -> float:
    """Power of the reactions of kept rows: only those that move do work."""
    kept, power = system.tree.kept, 0.0
    for q in range(kept.cuts.shape[0]):
        first, place = kept.cuts[q, FIRST], kept.cuts[q, FIRST_ROW]
        for r in range(kept.cuts[q, ROW_COUNT]):
            power += kept.multipliers[first + r] * system.nu[place + r]
    return power
