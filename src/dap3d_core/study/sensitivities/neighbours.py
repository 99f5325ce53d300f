"""Runs at their starts with other values of one parameter: differences of what Python computes.

Models are made and starts are corrected in Python. Nothing of that is integrated, so that its
derivatives come from differences of sixth order, whose error is near rounding. Where a parameter is
copied (study/batch), as those of forces, masses and initial states, they are known to rounding.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial
from typing import Any, NamedTuple

import attrs
import numpy as np

from dap3d_core.assembly.arrays import EVEN, LENGTH, WEAK
from dap3d_core.formulations.coordinates import UnsuitableError
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.integrators.stepping.integration_state import BEFORE, INSTANT
from dap3d_core.interface.fields import specs_of
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.array_struct import Arrays
from dap3d_core.scene import Mistake, SceneError
from dap3d_core.simulation import CompiledModel, SimulationError
from dap3d_core.simulation.initial.assemble import correct_initial
from dap3d_core.simulation.initial_state import InitialState
from dap3d_core.simulation.run import Run
from dap3d_core.simulation.run_state import Callbacks
from dap3d_core.simulation.settings import settings_of
from dap3d_core.study.batch.compiled_batch import Starts, arrays_of_numbers
from dap3d_core.study.batch.parameter_map import NotCopiedError, ParameterMap
from dap3d_core.study.batch.slopes import COPIES, starts_with_slopes
from dap3d_core.study.differences import (
    OFFSETS,
    SHORTER,
    SHORTER_STEPS,
    best_of,
    change_along,
    differences,
    power_of_two,
    slope_at,
    weighted,
    weights_of,
)
from dap3d_core.study.parameters import SceneParameter, all_parameters, with_values

#: Steps of differences, over the size of the parameter: rounding over the step is near 1e-13, and
#: what the sixth power of the step leaves of 1/sqrt(mass) below that. Others are for starts that
#: wide changes tear apart.
STEPS = (3e-3, 1e-3, 1e-4)
#: Residual of corrected starts: of rounding.
EXACT = 1e-15
#: A vector of this length, but for so much, is a direction; one that is turned by more, where a
#: parameter differs by a step, is another choice.
UNIT, TURNED = 1e-12, 0.3
#: What is written before it is read, or counts: without derivatives by parameters.
WITHOUT = ("rows", "crossings")


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


class RunsBeside(NamedTuple):
    """Runs with other values of one parameter.

    Attributes:
        runs: each at its start.
        weights: of what each run has, in the derivative.
        offsets: how far the parameter is from its value in each.
        places: the same in steps.
    """

    runs: tuple[Run, ...]
    weights: tuple[float, ...]
    offsets: tuple[float, ...]
    places: tuple[int, ...]


@attrs.define(eq=False, slots=False)
class Neighbours:
    """A parameter, and runs with other values of it, made where they are needed.

    Attributes:
        parameter: which.
        copied: as of ``copied_slopes``: the derivatives of all numbers by it, where they are known.
    """

    parameter: SceneParameter
    copied: tuple[list[Floats], Floats] | None
    _make: Callable[[float], RunsBeside]
    _closer: list[RunsBeside] = attrs.field(factory=list)

    @cached_property
    def made(self) -> RunsBeside:
        """The runs. Errors as of ``neighbours_of``."""
        return self._make(1.0)

    @property
    def is_brought_back(self) -> bool:
        """True if a run that is not corrected was off the constraints."""
        runs = self.made.runs if self.copied is None else ()
        return any(isinstance(run, RunBeside) and run.is_brought_back for run in runs)

    def derivative(self, function: Callable[[Run], Any]) -> Any:
        """The derivative by the parameter of what a function gives of a run."""
        pairs = zip(self.made.weights, self.made.runs, strict=True)
        return weighted([(w, function(run)) for w, run in pairs])

    def smooth_derivative(self, function: Callable[[Run], Any]) -> Any:
        """The same, by closer runs where a corner or a jump of the function lies among these."""
        return best_of(
            slope_at([function(run) for run in made.runs], made.places, max(made.offsets, key=abs)
                     / max(made.places, key=abs))
            for made in self._ever_closer()
        )  # fmt: skip

    def _ever_closer(self) -> Iterator[RunsBeside]:
        yield self.made
        for k in range(1, SHORTER_STEPS):
            if len(self._closer) < k:
                self._closer.append(self._make(SHORTER**-k))
            yield self._closer[k - 1]

    def offset_of(self, run: Run) -> float:
        """How far the parameter is from its value in a run; 0 where the run is none of these."""
        for made in (self.made, *self._closer):
            for offset, other in zip(made.offsets, made.runs, strict=True):
                if other is run:
                    return offset
        return 0.0


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
    """Neighbours of a run by a parameter; runs are made now unless derivatives are known.

    Args:
        compiled: the model of the scene as given.
        parameter: of its scene.
        given: settings of the run.
        base: the run itself, at its start.

    Raises:
        SceneError: the parameter has no value, or is a whole number.
        SimulationError: the scene cannot be run near its value, or has another structure there.
    """
    if parameter.value is None:
        what = "the scene leaves this number to its type; give it a value"
        raise SceneError([Mistake("by", parameter.name, what)])
    size = _size(compiled, parameter)
    copied = copied_slopes(base, parameter, size)
    found = Neighbours(parameter, copied, partial(_made, compiled, parameter, size, given, base))
    if copied is None:
        _ = found.made
    return found


def _made(
    compiled: CompiledModel,
    parameter: SceneParameter,
    size: float,
    given: dict[str, Any],
    base: Run,
    part: float,
) -> RunsBeside:
    """Runs beside a run, a part of the usual steps away; else as of ``neighbours_of``."""
    value, why = float(parameter.value or 0.0), ""
    for offsets in OFFSETS:
        for step in STEPS:
            h = power_of_two(part * step * size)
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
            if any(_whole_numbers(run) != _whole_numbers(base) for run in runs):
                raise SimulationError(
                    f"there is no derivative by {parameter.name} at {value:g}: whole numbers, such "
                    "as counts of teeth, follow from it, and jump"
                )
            if any(not _are_alike(base, run) for run in runs):
                why = "the model has another structure there"
                continue
            weights = tuple((weights_of(offsets) / h).tolist())
            return RunsBeside(runs, weights, tuple(k * h for k in offsets), offsets)
    raise SimulationError(
        f"there is no derivative by {parameter.name} at {value:g}: with values near it, the scene "
        f"cannot be run as here: {why}"
    )


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
    """True if the arrays of two runs are of the same sizes, and the same steps end at breaks.

    The scales that tolerances speak of, and flags of masses, are the same: they jump with a number.
    Directions that types have chosen (``normals``) are those of the one, turned a little.
    """
    shapes = [[(name, array.shape) for name, array in arrays_of(run)] for run in (one, other)]
    if shapes[0] != shapes[1]:
        return False
    scales = [_scales(run.evaluator) for run in (one, other)]
    stops = [run.present.work.stops for run in (one, other)]
    jumps = [table[BEFORE] < table[INSTANT] for table in stops]
    directions = [_vectors(run) for run in (one, other)]
    is_unit = [np.abs(np.linalg.norm(v, axis=1) - 1.0) < UNIT for v in directions]
    turns = np.linalg.norm(directions[0] - directions[1], axis=1)
    has_turned = np.any(is_unit[0] & is_unit[1] & (turns > TURNED))
    same = np.array_equal(jumps[0], jumps[1]) and np.array_equal(scales[0], scales[1])
    return same and not has_turned


def _scales(evaluator: Evaluator) -> Floats:
    """Those of a scene, its flags of masses, and the masses by which contacts measure forces."""
    units = [group.number("unit_mass") for group in evaluator.model.contacts]
    own = evaluator.system.settings[[LENGTH, EVEN, WEAK]]
    return np.concatenate([own, [evaluator.time], *units])


def _whole_numbers(run: Run) -> list[list[float]]:
    """Those of elements, such as the counts of teeth that stand for two radii."""
    return [
        group.number(name).tolist()
        for group in run.evaluator.model.acting
        for name, spec in specs_of(group.type_info.type).items()
        if spec.whole
    ]


def _vectors(run: Run) -> Floats:
    """(k, 3) vectors among the constants of elements."""
    found = [
        group.numbers[:, first : first + 3]
        for group in run.evaluator.model.acting
        for first, shape in group.type_info.layout.numbers.values()
        if shape == (3,)
    ]
    return np.concatenate([np.zeros((0, 3)), *found])


def total_derivative(
    function: Callable[[Run, Floats], Floats],
    beside: Sequence[Neighbours],
    base: Run,
    x: Floats,
    slopes: Floats,
    motion: slice,
    *,
    of_model: bool = True,
) -> Floats:
    """Derivatives (..., p) of what Python computes of a run and of numbers x.

    Args:
        function: of a run and numbers.
        beside: neighbours of the run by each parameter; base: the run itself.
        x: the numbers; slopes: (..., p) their derivatives.
        motion: those of them (of the last axis) of which it may be a curved function.
        of_model: False where the function reads nothing of the run's model that may vary.
    """
    found = []
    none = 0.0 if of_model else np.zeros_like(function(base, x))
    for j, neighbours in enumerate(beside):
        along = slopes[..., j]
        total = neighbours.smooth_derivative(lambda run: function(run, x)) if of_model else none
        if step := change_along(x[..., motion], along[..., motion]):
            total = total + differences(lambda e: function(base, x + e * along), step)  # noqa: B023
        if np.isnan(total).any():  # beside a limit, which moves with both
            total = neighbours.smooth_derivative(
                lambda run: function(run, x + neighbours.offset_of(run) * along)  # noqa: B023
            )
        found.append(total)
    return np.stack(found, axis=-1)


def copied_slopes(
    run: Run, parameter: SceneParameter, size: float
) -> tuple[list[Floats], Floats] | None:
    """Derivatives of arrays, flat, as of ``arrays_of_numbers``, and (n,) of the state at the start.

    No model is made at other values. None where the parameter is not copied, or where joints may
    move with it at the start.

    Args:
        run: at its start.
        parameter, size: of its scene, and its size.
    """
    evaluator, model = run.evaluator, run.evaluator.model
    coordinates, is_plain = evaluator.coordinates, run.present.takes_programs and not model.breaks
    is_plain &= run.settings.start == "scene" and run.start is None
    if not is_plain or any(switch.jumps for switch in evaluator.switches):
        return None
    try:
        if parameter.table not in ("bodies", "points", "forces"):
            return None
        by_map = ParameterMap(run.compiled.checked, evaluator, (parameter,))
    except NotCopiedError:
        return None
    if by_map.moves_start and (model.row_count or not coordinates.are_of_bodies):
        return None

    def starts(values: Floats) -> Starts:
        table, _ = by_map.table(values, is_checked=False)
        if coordinates.are_of_bodies:
            y0 = by_map.states(values, model.u0)
            by_map.set_states(y0, values)
        else:
            y0 = np.zeros((len(values), coordinates.size + 1))
        return Starts(table, by_map.places, y0, 0)

    x = np.array([parameter.value])
    found = starts_with_slopes(starts, x, np.array([size]), *COPIES)
    if found is None:
        return None
    _, of_numbers, of_state = found
    ends = np.cumsum([array.size for array in arrays_of_numbers(evaluator)])
    slopes = np.zeros(ends[-1])
    slopes[by_map.places] = of_numbers[:, 0]
    return np.split(slopes, ends[:-1]), of_state[:, 0]
