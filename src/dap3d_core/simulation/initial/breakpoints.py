"""Break points of functions of time: instants that no step passes, steps too long for one."""

from itertools import pairwise

import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.model import Model
from dap3d_core.model.knots import breaks_of
from dap3d_core.result import information
from dap3d_core.scene import Simulation, ValidatedScene

#: Instants of a run at which functions are looked at, besides those near their breaks.
SAMPLES = 64
#: Parts of the stretch between two breaks at which they are looked at, and how many stretches.
BETWEEN, STRETCHES = (0.21, 0.5, 0.79), 32
#: Parts of the stretch between two breaks at which a step ends: a pulse is not between two steps.
SEEN = (0.29, 0.67)
#: A change within less than this part of a run is as quick as steps can resolve.
QUICKEST = 1e-7
#: Steps or reports that a swing takes at least, to be followed or seen.
LEAST_PER_PERIOD = 4.0
#: The golden ratio: multiples of it, less their whole part, fall in step with no period.
GOLDEN = 0.6180339887498949


class Breakpoints:
    """Break points and rates of the functions of time of a model in a run from 0 to t_end.

    Attributes:
        t_end: s.
        stops: instants that no step goes over, in order, with whether a function takes another form
            there; between two of these there are others, so that a step sees what happens.
        periods: name of a function -> period, s, of a swing with its range and its largest second
            derivative, where it has these.
    """

    def __init__(self, checked: ValidatedScene, evaluator: Evaluator, t_end: float) -> None:
        used = sorted({int(k) for group in evaluator.model.functions for k in group.members})
        functions = {k: checked.functions[k] for k in used}
        self.stops = stops_of(checked, evaluator.model, t_end)
        self.t_end = t_end
        self.periods: dict[str, float] = {}
        if functions and t_end > 0.0:
            instants = _instants([t for t, jumps in self.stops if jumps], t_end)
            values = np.array([evaluator.function_values(t) for t in instants])
            spread, bend = np.ptp(values[:, :, 0], axis=0), np.max(np.abs(values[:, :, 2]), axis=0)
            for k, function in functions.items():
                if 0.0 < spread[k] < np.inf and 0.0 < bend[k] < np.inf:
                    period = 2.0 * np.pi * float(np.sqrt(0.5 * spread[k] / bend[k]))
                    self.periods[function.name] = period

    def notes(self, settings: Simulation, dt: float) -> list[str]:
        """Functions that steps of fixed length do not follow, or that reports do not show."""
        found = []
        for name, period in self.periods.items():
            about = f"functions.{name} swings or changes within some {period:.2g} s"
            step = settings.step
            if period < QUICKEST * self.t_end:
                found.append(
                    f"{about}, too little for the steps of a run of {self.t_end:g} s: what it does "
                    "there may be missed; let it change more slowly, or run for less time"
                )
            elif step is not None and LEAST_PER_PERIOD * float(step) > period:
                found.append(
                    f"{about}, less than {LEAST_PER_PERIOD:g} steps of {float(step):g} s, which do "
                    f"not follow it: give a step of at most {period / 20.0:.2g} s, or none"
                )
            elif 0.5 * LEAST_PER_PERIOD * dt > period:
                found.append(
                    information(
                        f"{about}, and results stand {dt:g} s apart, which do not show it "
                        f"(aliasing); a dt of at most {period / 4.0:.2g} s does"
                    )
                )
        return found


def stops_of(checked: ValidatedScene, model: Model, t_end: float) -> list[tuple[float, bool]]:
    """``Breakpoints.stops`` alone."""
    functions = [checked.functions[int(k)] for group in model.functions for k in group.members]
    breaks = sorted({float(t) for f in functions for t in breaks_of(f) if 0.0 < t < t_end})
    between = [a + part * (b - a) for a, b in pairwise(breaks) for part in SEEN]
    return sorted([*((t, True) for t in breaks), *((t, False) for t in between)])


def _instants(breaks: list[float], t_end: float) -> list[float]:
    """Instants at which functions are sampled."""
    corners = [0.0, *breaks[:STRETCHES], t_end]
    inner = [a + part * (b - a) for a, b in pairwise(corners) for part in BETWEEN]
    return [*corners, *inner, *(t_end * (GOLDEN * np.arange(1, SAMPLES) % 1.0)).tolist()]
