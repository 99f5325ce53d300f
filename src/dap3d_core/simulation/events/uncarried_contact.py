"""Contact that stays, of elements that act by impulses alone: nothing carries it."""

from typing import Any

import numpy as np

from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.formulations.jumps.law import ImpossibleJumpError, JumpLaw
from dap3d_core.kernels.array_types import Floats

#: A switch is at zero within this part of the length of the scene.
AT_ZERO = 1e-9
#: Parts of the run: the time of a difference quotient, and of the look ahead at what accelerations
#: do. The second is larger, as what comes of it must exceed the rounding of the first.
DIFFERENCE, AHEAD = 1e-8, 1e-4
#: A difference of values of a switch is rounding below this part of its size.
SWITCH_ROUNDING = 1e-15
#: An impulse stops what approaches where it leaves no more than this part of the rate.
STOPPED = 1e-6


class UncarriedContact:
    """Finds switches of elements without a wrench at which contact stays.

    There accelerations close a gap which the impulse of the element would stop: it acts where the
    switch crosses, and does so no more.

    Attributes:
        pushes: (switches,) of forces whose rows push, and carry nothing.
        is_bare: (switches,) of elements that jump, and carry nothing.
    """

    def __init__(self, evaluator: Evaluator, law: JumpLaw) -> None:
        self._evaluator, self._law = evaluator, law
        types: list[Any] = [switch.group.type_info for switch in evaluator.switches]
        bare = [info.type.kind == "joint" or "wrench" not in info.kernels for info in types]
        pushes = [info.type.kind == "force" and bool(info.type.unilateral) for info in types]
        self.is_bare = law.elements.is_jump & np.array(bare, dtype=bool)
        self.pushes = self.is_bare & np.array(pushes, dtype=bool)

    @IGNORE_FLOAT_ERRORS
    def closing(self, t: float, y: Floats, sides: Floats, span: float) -> list[int]:
        """Switches where contact stays at time t and integrated state y.

        Args:
            sides: (switches,) +1 or -1, the side that each is on, or 0.
            span: s, of the run.
        """
        if not self.is_bare.any():
            return []
        values, size = self._evaluator.switch_values(t, y), max(1.0, self._evaluator.model.length)
        closed = (sides < 0.0) | (sides == 0.0) & (values <= SWITCH_ROUNDING * size)
        candidates = self.is_bare & closed & (self.pushes | (values >= -AT_ZERO * size))
        if not candidates.any():
            return []
        ahead = AHEAD * span
        later = y + ahead * self._evaluator.slope(t, y)
        rates, rates_later = self.rates(t, y, span), self.rates(t, later, span)
        candidates &= (sides < 0.0) | (rates <= 0.0)  # else it is on its way out
        closes = rates_later < -SWITCH_ROUNDING * size / (DIFFERENCE * span)
        stays = candidates & self.pushes & (closes | (sides < 0.0))
        found = [k for k in np.flatnonzero(candidates & closes & ~self.pushes).tolist()
                 if self._stops(k, t, later, rates_later[k], span)]  # fmt: skip
        return sorted([*np.flatnonzero(stays).tolist(), *found])

    def _stops(self, k: int, t: float, y: Floats, rate: float, span: float) -> bool:
        """True if the element of switch k stops or reverses it where it crosses at such a rate."""
        evaluator = self._evaluator
        states, crossing = evaluator.states, np.zeros(len(evaluator.switches))
        crossing[k] = -1.0
        try:
            jump = self._law.jump(t, evaluator.body_state(y), crossing, crossing, 0.0)
        except ImpossibleJumpError:
            return False
        finally:
            evaluator.states = states
        after = evaluator.coordinates.with_jump(y, jump.dv, states, 0.0)
        return bool(self.rates(t, after, span)[k] >= STOPPED * rate)

    def rates(self, t: float, y: Floats, span: float) -> Floats:
        """(switches,) rates of the switches, by a difference over a part of the run."""
        evaluator, h = self._evaluator, DIFFERENCE * span
        later = evaluator.switch_values(t + h, y + h * evaluator.slope(t, y))
        return np.asarray((later - evaluator.switch_values(t, y)) / h)
