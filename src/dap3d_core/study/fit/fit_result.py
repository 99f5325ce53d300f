"""Result of a fit."""

import attrs
import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.result import Result
from dap3d_core.scene import Scene


@attrs.frozen(eq=False, repr=False)
class Fit:
    """Fitted values, their confidence, and how well they explain the data.

    ``print`` shows it as a table, ``dap.plot`` draws it. Arrays over parameters are in the order
    of ``values``, those over times in the order of the data.

    Attributes:
        values: parameter -> its fitted value, in the unit of the scene.
        interval: parameter -> (low, high) of 95 % confidence: infinite where the data do not
            determine it, NaN at a bound.
        covariance, correlation: (d, d) of the values; inf and NaN as above.
        t: (nt,) times of the data, s.
        measured: output -> (nt,) the data, NaN where nothing was measured.
        fitted: output -> (nt,) of the run at the optimum.
        residuals: output -> (nt,) measured minus fitted.
        sigma: output -> (nt,) standard deviations; empty where none were given.
        units: output -> SI unit.
        quantities: output -> name of the quantity in results.
        cost: half the sum of the squares of the residuals, over sigma if it was given.
        degrees: of freedom: measured numbers less determined parameters.
        chi_square: reduced, 2 cost / degrees, where sigma was given: about 1 where the scene
            explains the data as well as sigma lets it; else None.
        iterations, runs: evaluations of the derivatives; runs of the scene in all.
        status: "converged", or "stopped" where the iterations were used up.
        message: why the search ended.
        notes: parameters that cannot be distinguished, have no effect, are at a bound; errors of
            interpolation.
        scene: with the fitted values.
        result: the run of that scene.
    """

    values: dict[str, float]
    interval: dict[str, tuple[float, float]]
    covariance: Floats
    correlation: Floats
    t: Floats
    measured: dict[str, Floats]
    fitted: dict[str, Floats]
    residuals: dict[str, Floats]
    sigma: dict[str, Floats]
    units: dict[str, str]
    quantities: dict[str, str]
    cost: float
    degrees: int
    chi_square: float | None
    iterations: int
    runs: int
    status: str
    message: str
    notes: tuple[str, ...]
    scene: Scene
    result: Result

    def __repr__(self) -> str:
        values = ", ".join(f"{name} = {value:.6g}" for name, value in self.values.items())
        return f"<Fit {self.status}: {values}>"

    def __str__(self) -> str:
        wide = max(len("parameter"), *(len(name) for name in self.values))
        lines = [
            f"{self.status} after {self.iterations} iterations, {self.runs} runs: {self.message}",
            f"{'parameter':{wide}}  {'value':>14}  95 % interval",
        ]
        for name, value in self.values.items():
            lines.append(f"{name:{wide}}  {value:14.8g}  {_interval(*self.interval[name])}")
        wide = max(len("output"), *(len(name) for name in self.measured))
        lines.append(f"{'output':{wide}}  {'rms residual':>14}")
        for name, residual in self.residuals.items():
            rms = float(np.sqrt(np.nanmean(residual**2))) if np.isfinite(residual).any() else np.nan
            lines.append(f"{name:{wide}}  {rms:14.4g}  {self.units[name]}".rstrip())
        if self.chi_square is not None:
            lines.append(
                f"reduced chi-square {self.chi_square:.4g}, {self.degrees} degrees of freedom"
            )
        return "\n".join([*lines, *(f"note: {note}" for note in self.notes)])


def _interval(low: float, high: float) -> str:
    if np.isnan(low):
        return "at its bound"
    return "not determined" if np.isinf(low) else f"{low:.8g} ... {high:.8g}"
