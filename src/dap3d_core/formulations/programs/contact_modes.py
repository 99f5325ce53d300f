"""Modes of contacts in programs: constants, as no step changes them."""

import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.formulations.contacts.equations import NEAR, STATE, WAY
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.interface.contacts.rows import SLIDES


def mode_states(evaluator: Evaluator, y: Floats) -> tuple[Integers, Floats]:
    """Places in a state y (n,) of constants that contacts have there, and their numbers.

    They are modes, and directions of sliding and shares where there are none: of these, and of rows
    that do not hold, nothing is left in a program.
    """
    first = y.size - 1 - evaluator.system.states.size
    places = first + evaluator.system.contacts[:, [STATE]] + np.arange(NEAR + 3)
    values = y[places]
    is_constant = np.ones(values.shape, dtype=bool)
    slides = values[:, 0] == SLIDES
    for k, varies in ((WAY, slides), (NEAR, True)):
        is_constant[:, k : k + 3] = ~(varies & values[:, k : k + 3].any(axis=1))[:, None]
    return places[is_constant], values[is_constant]
