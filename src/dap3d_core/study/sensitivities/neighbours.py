"""Runs at their starts with other values of one parameter: differences of what Python computes.

Models are made and starts are corrected in Python. Nothing of that is integrated, so that its
derivatives come from differences of sixth order, whose error is near rounding.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.coordinates import UnsuitableError
from dap3d_core.integrators.stepping.integration_state import BEFORE, INSTANT
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.array_struct import Arrays
from dap3d_core.model.state_layout import STATE
from dap3d_core.scene import Mistake, SceneError
from dap3d_core.simulation import CompiledModel, SimulationError
from dap3d_core.simulation.initial.assemble import correct_initial
from dap3d_core.simulation.initial_state import InitialState
from dap3d_core.simulation.run import Run
from dap3d_core.simulation.run_state import Callbacks
from dap3d_core.simulation.settings import settings_of
from dap3d_core.study.parameters import SceneParameter, all_parameters, with_values

#: Steps of differences, over the size of the parameter: rounding over the step is near 1e-13, and
#: what the sixth power of the step leaves of 1/sqrt(mass) below that. Others are for starts that
#: wide changes tear apart.
STEPS = (3e-3, 1e-3, 1e-4)
#: Offsets of differences in steps: central, and to either side where a value has a limit.
OFFSETS = (-3, -2, -1, 1, 2, 3), (0, 1, 2, 3, 4, 5, 6), (0, -1, -2, -3, -4, -5, -6)
#: A change of a state, over its size, in differences of functions of it.
CHANGE = 1e-3
#: Residual of corrected starts: of rounding.
EXACT = 1e-15
#: What is written before it is read, or counts: without derivatives by parameters.
WITHOUT = ("rows", "crossings")


def weights_of(offsets: tuple[int, ...]) -> Floats:
    """Weights of values at some offsets in the derivative at 0, of highest order."""
    powers = np.vander(np.array(offsets, dtype=float), increasing=True).T
    return np.linalg.solve(powers, np.eye(len(offsets))[1])


def differences(function: Callable[[float], Floats], step: float) -> Floats:
    """The derivative at 0 of a function, by central differences of sixth order."""
    offsets = OFFSETS[0]
    pairs = zip(offsets, weights_of(offsets), strict=True)
    return weighted([(w, function(k * step)) for k, w in pairs]) / step


def weighted(pairs: Sequence[tuple[float, Any]]) -> Any:
    """The sum of weights times values, whose weights add up to zero: exactly 0 of equal values."""
    _, first = pairs[0]
    return sum(w * (value - first) for w, value in pairs[1:])


class RunBeside(Run):
    """A run for differences: its start is corrected as far as rounding allows, not to 1e-10.

    Attributes:
        is_brought_back: it is not corrected, and was off the constraints.
    """

    is_brought_back = False

    def _start(self) -> InitialState:
        start = super()._start()
        if start.initial is None:
            return start
        names = self.evaluator.model.body_names
        hold = [names.index(name) + 1 for name in self.settings.hold]
        metric = str(self.settings.correct_metric)
        exact = correct_initial(self.evaluator, start.u, hold=hold, metric=metric, tolerance=EXACT)
        return attrs.evolve(start, u=exact.u)


@attrs.frozen(eq=False)
class Neighbours:
    """Runs with other values of one parameter.

    Attributes:
        parameter: which.
        runs: each at its start.
        weights: of what each run has, in the derivative.
        offsets: how far the parameter is from its value in each.
    """

    parameter: SceneParameter
    runs: tuple[Run, ...]
    weights: tuple[float, ...]
    offsets: tuple[float, ...]

    def derivative(self, function: Callable[[Run], Any]) -> Any:
        """The derivative by the parameter of what a function gives of a run."""
        pairs = zip(self.weights, self.runs, strict=True)
        return weighted([(w, function(run)) for w, run in pairs])


def run_beside(
    compiled: CompiledModel,
    given: dict[str, Any],
    change: Sequence[tuple[SceneParameter, float]] = (),
    start: Any = None,
) -> Run:
    """A run of a scene with a model of its own, at its start; given: settings; start: a state."""
    changed = with_values(compiled.scene, [p for p, _ in change], [value for _, value in change])
    registry = compiled.checked.registry
    model = CompiledModel(changed, method=compiled.method, registry=registry, like=compiled)
    settings = settings_of(model, **{**given, "method": compiled.method})
    run = RunBeside(model, settings, Callbacks(), start=start)
    run.initialise()
    if run.present.work.projects and not settings.correct:
        if not run.present.project():
            raise SimulationError("the start cannot be brought onto its constraints")
        run.is_brought_back = bool(run.present.work.projection_moved)
    return run


def neighbours_of(
    compiled: CompiledModel, parameter: SceneParameter, given: dict[str, Any], base: Run
) -> Neighbours:
    """Neighbours of a run by a parameter.

    Args:
        compiled: the model of the scene as given.
        parameter: of its scene.
        given: settings of the run.
        base: the run itself, at its start.

    Raises:
        SceneError: the parameter has no value, or is a whole number.
        SimulationError: the scene cannot be run near its value, or has another structure there.
    """
    _check(parameter)
    value, why = float(parameter.value or 0.0), ""
    for offsets in OFFSETS:
        for step in STEPS:
            h = step * _size(compiled, parameter)
            try:
                runs = tuple(
                    run_beside(compiled, given, [(parameter, value + k * h)], base.start)
                    if k
                    else base
                    for k in offsets
                )
            except (SceneError, SimulationError, UnsuitableError, ValueError) as error:
                why = " ".join(str(error).split())
                continue
            if any(not _are_alike(base, run) for run in runs):
                why = "the model has another structure there"
                continue
            weights = tuple((weights_of(offsets) / h).tolist())
            return Neighbours(parameter, runs, weights, tuple(k * h for k in offsets))
    raise SimulationError(
        f"there is no derivative by {parameter.name} at {value:g}: with values near it, the scene "
        f"cannot be run as here: {why}"
    )


def _check(parameter: SceneParameter) -> None:
    if parameter.value is None:
        what = "the scene leaves this number to its type; give it a value"
        raise SceneError([Mistake("by", parameter.name, what)])


def _size(compiled: CompiledModel, parameter: SceneParameter) -> float:
    """The size of a parameter: of one that is zero, of the vector it belongs to, or 1."""
    if parameter.value:
        return abs(parameter.value)
    same = [p for p in all_parameters(compiled.checked) if p.path == parameter.path]
    return max((abs(p.value) for p in same if p.value), default=1.0)


def arrays_of(run: Run) -> Iterator[tuple[str, Any]]:
    """Name and array of all that the compiled loop of a run's integration reads and writes."""
    for k, struct in enumerate(run.present.loop_arguments):
        if isinstance(struct, Arrays):
            yield from ((f"{k}.{name}", array) for name, array in struct.walk())


def floats_of(run: Run) -> dict[str, Floats]:
    """Those of them that have derivatives, flat, by name."""
    return {
        name: array.reshape(-1).view(np.float64)
        for name, array in arrays_of(run)
        if array.dtype.kind in "fc" and array.size and name.rpartition(".")[2] not in WITHOUT
    }


def _are_alike(one: Run, other: Run) -> bool:
    """True if the arrays of two runs are of the same sizes, and the same steps end at breaks."""
    shapes = [[(name, array.shape) for name, array in arrays_of(run)] for run in (one, other)]
    if shapes[0] != shapes[1]:
        return False
    stops = [run.present.work.stops for run in (one, other)]
    jumps = [table[BEFORE] < table[INSTANT] for table in stops]
    return bool(np.array_equal(*jumps))


def change_along(state: Floats, slopes: Floats) -> float:
    """How far to go along slopes, for differences of functions of a state; 0 where there are none.

    So far that the state changes by ``CHANGE`` of its largest number.
    """
    size, speed = (float(np.max(np.abs(x), initial=0.0)) for x in (state, slopes))
    return CHANGE * max(size, 1e-3) / speed if speed > 0.0 and math.isfinite(speed) else 0.0


def motion_of(body_count: int) -> slice:
    """Columns of poses and velocities in rows; reactions, which may be large, are behind them."""
    return slice(1, 1 + STATE * body_count)


def total_derivative(
    function: Callable[[Run, Floats], Floats],
    beside: Sequence[Neighbours],
    base: Run,
    x: Floats,
    slopes: Floats,
    motion: slice,
) -> Floats:
    """Derivatives (..., p) of what Python computes of a run and of numbers x.

    Args:
        function: of a run and numbers.
        beside: neighbours of the run by each parameter; base: the run itself.
        x: the numbers; slopes: (..., p) their derivatives.
        motion: those of them (of the last axis) of which it may be a curved function.
    """
    found = []
    for j, neighbours in enumerate(beside):
        along = slopes[..., j]
        total = neighbours.derivative(lambda run: function(run, x))
        if step := change_along(x[..., motion], along[..., motion]):
            total = total + differences(lambda e: function(base, x + e * along), step)  # noqa: B023
        found.append(total)
    return np.stack(found, axis=-1)
