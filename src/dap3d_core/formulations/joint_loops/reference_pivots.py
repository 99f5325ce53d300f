"""Pivots of kept rows at the start of a run: which depend on each other, and how large they are."""

import numpy as np

from dap3d_core.assembly.arrays import Floats
from dap3d_core.assembly.tree_arrays import KeptRowArrays
from dap3d_core.formulations import RHS
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.formulations.joint_loops.layout import PART_OF_ROW, PLACE
from dap3d_core.formulations.joint_loops.profile import PART
from dap3d_core.linear.ldlt.factor import SINGULAR_PIVOT_RATIO

#: Compliances by which rows are judged, as parts of their diagonals.
SMALL = 1e-9
#: They are divided by this; a pivot that falls by its root or more has nothing else.
LESS = 16.0


@IGNORE_FLOAT_ERRORS
def judge_kept_rows(evaluator: Evaluator, y: Floats) -> None:
    """Find out whether kept rows depend on each other at a state, and store their pivots.

    The pivot of a row that depends on others is what compliances make of it, and follows them.
    """
    kept: KeptRowArrays = evaluator.system.tree.kept
    if evaluator.model.contact_count:  # those that close make other pivots
        kept.smallest[:], kept.settings[PART_OF_ROW] = 0.0, PART
        return
    more, less = (_pivots(evaluator, y, part) for part in (SMALL, SMALL / LESS))
    redundant = ~(more < np.sqrt(LESS) * less)
    kept.smallest[:] = np.where(redundant, 0.0, SINGULAR_PIVOT_RATIO * less)
    kept.settings[PART_OF_ROW] = PART if redundant.any() else 0.0


def _pivots(evaluator: Evaluator, y: Floats, part: float) -> Floats:
    kept = evaluator.system.tree.kept
    kept.settings[PART_OF_ROW] = part
    evaluator.functions[RHS](0.0, y, np.zeros_like(y), evaluator.system, evaluator.loops)
    pivots: Floats = 1.0 / kept.matrix[kept.profile[:, PLACE] + np.arange(len(kept.profile))]
    return pivots
