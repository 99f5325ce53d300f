"""Public function ``sensitivities``: a run and its derivatives by parameters of the scene."""

import copy
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, Unpack

import numpy as np

from dap3d_core.formulations.programs.change_over import ChangeOver
from dap3d_core.integrators import Integration
from dap3d_core.integrators.stepping.integration_state import Y
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import jit_is_on
from dap3d_core.kernels.runtime.lanes import Differentiation
from dap3d_core.registry.arguments import checked
from dap3d_core.registry.suggestions import some
from dap3d_core.result import Result, ResultError, RunMetadata, find
from dap3d_core.scene import MISSING, Mistake, Scene, SceneError, ValidatedScene
from dap3d_core.settings import RunSettings
from dap3d_core.simulation import CompiledModel, SimulationError
from dap3d_core.simulation.errors import refuse_collisions
from dap3d_core.simulation.failure.narrow_forces import notes_on_derivatives
from dap3d_core.simulation.run import Run
from dap3d_core.simulation.run_state import Callbacks
from dap3d_core.simulation.settings import compiled_for, settings_of
from dap3d_core.simulation.simulate import given_state, start_word
from dap3d_core.study.batch.compiled_batch import arrays_of_numbers
from dap3d_core.study.differences import motion_of
from dap3d_core.study.outputs import Output, Reduction
from dap3d_core.study.parameters import SceneParameter, parameters_named
from dap3d_core.study.sensitivities.neighbours import (
    Neighbours,
    arrays_of,
    floats_of,
    neighbours_of,
    run_beside,
    total_derivative,
)

if TYPE_CHECKING:
    import xarray

    from dap3d_core.simulation.initial.start_state import Start

#: Directions of one run that fill vectors: 8 beside the value, others with it.
FAST = (1, 3, 7, 8, 15)
#: Motion of each body in data sets.
OF_BODIES = ("r", "rd", "w")


class Sensitivities:
    """A run and its derivatives by p parameters.

    Attributes:
        result: of the run, bit for bit that of ``simulate``.
        parameters: by which it is differentiated.
        values: (p,) of the parameters, in the scene.
    """

    def __init__(
        self,
        result: Result,
        runs: "Sequence[DifferentiatedRun]",
        parameters: Sequence[SceneParameter],
    ) -> None:
        """Args: the result, runs with the derivatives by some parameters each, all of these."""
        self.result, self.parameters = result, tuple(parameters)
        self.values = np.array([float(p.value or 0.0) for p in parameters])
        self._base = runs[0].base
        self._neighbours: tuple[Neighbours, ...] = sum((tuple(r.neighbours) for r in runs), ())
        self._rows = np.concatenate(runs[0].reported)
        parts = [np.concatenate(run.slopes) for run in runs]
        self._slopes = np.concatenate(parts, axis=-1)
        self._instants = {
            t: np.concatenate([run.instants[t] for run in runs]) for t in runs[0].instants
        }
        self._known: dict[str, Floats] = {}

    def __repr__(self) -> str:
        return f"<Sensitivities by {', '.join(self.names)} of {self.result!r}>"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    def of(self, quantity: str) -> Floats:
        """(nt, p) derivatives of a quantity at the reported instants; of a vector (nt, 3, p).

        Args:
            quantity: a name as of ``Result.quantity``.

        Raises:
            UnknownNameError, ResultError: as ``Result.quantity``.
        """
        if quantity not in self._known:
            find(self.result, quantity)
            of_model = not self._is_of_rows(quantity)
            self._known[quantity] = self._derivative(
                lambda result: result.quantity(quantity).values, of_model=of_model
            )
        return self._known[quantity]

    def final(self, quantity: str) -> Floats:
        """(p,) derivatives of a quantity at the end; of a vector (3, p). Errors as ``of``."""
        return self.of(quantity)[-1]

    def derivative(self, function: Callable[[Result], Any]) -> Floats:
        """Derivatives (..., p) of what a smooth function computes of a result."""
        return self._derivative(function, of_model=True)

    def of_number(self, quantity: str, number: Callable[[Floats, Floats], Any]) -> Floats:
        """(p,) derivatives of a number of a quantity's values (nt,) and of the times (nt,)."""
        return self._derivative(
            lambda result: number(result.quantity(quantity).values, result.t),
            of_model=not self._is_of_rows(quantity),
        )

    def _is_of_rows(self, quantity: str) -> bool:
        """True if a quantity is computed from reported rows and what the parameters leave alone."""
        outputs = [Output(quantity, quantity)]
        return all(Reduction(self._base.compiled, self.parameters, outputs).of_rows.values())

    def _derivative(self, function: Callable[[Result], Any], *, of_model: bool) -> Floats:
        def of_rows(run: Run, rows: Floats) -> Floats:
            evaluator, record = run.evaluator, RunMetadata(scene_text=run.compiled.scene_text)
            whole = evaluator.with_inputs(rows, evaluator.model.input_values)
            result = Result.of_run(evaluator.model, whole, record, lambda: evaluator)
            return np.asarray(function(result), dtype=float)

        motion = motion_of(self._base.evaluator.model.body_count)
        return total_derivative(
            of_rows,
            self._neighbours,
            self._base,
            self._rows,
            self._slopes,
            motion,
            of_model=of_model,
        )

    @property
    def event_times(self) -> Floats:
        """(k, p) derivatives of the instants of ``result.events``; NaN of those of scripts."""
        none = np.full(len(self.parameters), np.nan)
        found = [self._instants.get(event.t, none) for event in self.result.events]
        return np.array(found).reshape(-1, len(self.parameters))

    def elasticities(self, quantity: str) -> Floats:
        """(p,) p/q dq/dp of a scalar quantity q at the end: per cent of it by a per cent of p.

        Raises:
            ResultError: the quantity is a vector. Others as ``of``.
        """
        if components := find(self.result, quantity).components:
            raise ResultError(f"{quantity} is a vector; take {quantity}.{components[0]}")
        value = float(self.result.quantity(quantity).values[-1])
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.final(quantity) * self.values / value)

    @checked
    def to_xarray(self, quantities: Sequence[str] = ()) -> "xarray.Dataset":
        """Quantities over time and their derivatives ``d NAME`` over time and parameter.

        Args:
            quantities: names; by default the motion of each body and the outputs of the scene.
        """
        import xarray

        summary = self.result.summary
        usual = [f"{body}.{q}" for body in summary.body_names for q in OF_BODIES]
        variables: dict[str, Any] = {}
        for name in quantities or [*usual, *self.result.outputs]:
            values, label, unit = self.result.quantity(name)
            width = values.shape[1] if values.ndim > 1 else 0
            dims = ("time", *{0: (), 3: ("axis",)}.get(width, (f"{name}_row",)))
            about = {"units": unit, "long_name": label}
            variables[name] = dims, values, about
            about = {
                "units": f"{unit} per unit of parameter",
                "long_name": f"derivative of {label}",
            }
            variables[f"d {name}"] = (*dims, "parameter"), self.of(name), about
        coordinates = {
            "time": self.result.t,
            "parameter": list(self.names),
            "value": ("parameter", self.values),
            "axis": list("xyz"),
        }
        about = {"scene": self.result.scene_text}
        return xarray.Dataset(variables, coordinates, about)

    @checked
    def save(
        self, path: str | os.PathLike[str], quantities: Sequence[str] = (), force: bool = False
    ) -> None:
        """Write ``to_xarray`` to a NetCDF-4 file, whole or not at all.

        Raises:
            ResultError: the file cannot be written, or exists and ``force`` is off.
        """
        from dap3d_core.result.quantities.netcdf_export import write_dataset

        write_dataset(self.to_xarray(quantities), Path(path), force=force)


@checked
def sensitivities(
    scene: Scene | str | os.PathLike[str] | CompiledModel,
    by: Sequence[str] | str,
    *,
    start: "Start | None" = None,
    allow_code: bool = False,
    announce: Callable[[str], None] | None = None,
    **settings: Unpack[RunSettings],
) -> Sensitivities:
    """Simulate a scene, with exact derivatives of the run by parameters of the scene.

    The compiled code of the run is differentiated, step by step as the run takes them; instants of
    located events carry derivatives, chosen lengths of steps do not. What is computed in Python,
    models, starts and jumps, has differences of sixth order. Details, and where a derivative means
    little: docs/concepts/sensitivities.md.

    Args:
        scene: a Scene, what ``load`` takes, or a compiled model; allow_code, announce: as there.
        by: names of parameters as ``sweep`` varies them: ``bodies.crank.mass``, ``points.A.sPp.x``,
            ``parameters.length``.
        t_end, dt, method, integrator, rtol, atol, step: as of ``simulate``; likewise correct,
            project, correct_metric, start.

    Raises:
        SceneError, PluginError: as ``simulate``; an unknown parameter, with the nearest.
        SimulationError: the run stopped; no derivative by a parameter.
    """
    compiled = compiled_for(scene, allow_code, announce, **settings)
    refuse_collisions(compiled.model, "a run with derivatives")
    parameters = parameters_by(compiled.checked, [by] if isinstance(by, str) else list(by))
    check_differentiable(parameters, "by")
    given: dict[str, Any] = {**settings, "start": start_word(start)}
    method = given.pop("method", None)
    state = given_state(start, compiled)
    base = run_beside(compiled, given, (), state)
    directions, lanes = directions_of(len(parameters))
    runs, results = [], []
    for first in range(0, len(parameters), directions):
        part = parameters[first : first + directions]
        beside = [neighbours_of(compiled, parameter, given, base) for parameter in part]
        with compiled.borrow_evaluator():
            simulation = settings_of(compiled, method=method, **given)
            run = DifferentiatedRun(compiled, simulation, Callbacks(announce=announce), start=state)
            results.append(run.carry(beside, base, lanes).execute())
        runs.append(run)
    for note in _notes(compiled, runs):
        results[0].note(note)
    return Sensitivities(results[0], runs, parameters)


def check_differentiable(parameters: Sequence[SceneParameter], key: str) -> None:
    """Refuse parameters without derivatives; key: the argument that names them.

    Raises:
        SceneError: a parameter has no derivative.
        SimulationError: nothing is compiled.
    """
    if not jit_is_on():
        raise SimulationError("derivatives of runs are those of compiled code: unset DAP3D_PLAIN")
    mistakes = [Mistake(key, p.name, why) for p in parameters if (why := no_derivative(p))]
    if mistakes:
        raise SceneError(mistakes)


def no_derivative(parameter: SceneParameter) -> str:
    """Why there is no derivative by a parameter, "" where there may be one."""
    if parameter.table == "simulation" and parameter.path[-1] != "t_end":
        return "this says how a run is computed; a run has derivatives by what it computes alone"
    if parameter.whole:
        return "this is a whole number, by which there is no derivative"
    return ""


def directions_of(count: int) -> tuple[int, int]:
    """Directions of a run, for so many parameters in blocks of one size; and of its code."""
    blocks = -(-count // FAST[-1])
    directions = -(-count // blocks)
    return directions, next(lanes for lanes in FAST if lanes >= directions)


def _notes(compiled: CompiledModel, runs: "Sequence[DifferentiatedRun]") -> list[str]:
    """Notes on laws, and where an uncorrected start leaves its constraints with a parameter."""
    of_laws = notes_on_derivatives(compiled.checked)
    found = [
        beside.parameter.name for run in runs for beside in run.neighbours if beside.is_brought_back
    ]
    if not found:
        return of_laws
    return [
        *of_laws,
        f"derivatives: the start leaves its constraints with {some(found)} and is not "
        "corrected: they are those of a start that is brought onto the constraints (switch correct "
        "on for runs that do so)",
    ]


def parameters_by(checked: ValidatedScene, names: Sequence[str]) -> tuple[SceneParameter, ...]:
    """The parameters that an argument ``by`` names.

    Raises:
        SceneError: there are none, or wrong names, with the nearest.
    """
    if not names:
        what = "name a parameter of the scene, such as bodies.crank.mass"
        raise SceneError([Mistake("by", MISSING, what)])
    return parameters_named(checked, names, "by")


class DifferentiatedRun(Run):
    """A run with its derivatives by some parameters.

    Attributes:
        neighbours: of each parameter.
        base: the run at its start, for differences of what Python computes.
        reported, slopes: (k, width) rows in coordinates of bodies, and (k, width, p) their
            derivatives, in parts.
        instants: time of each located event and jump -> (p,) its derivatives.
    """

    def carry(self, neighbours: Sequence[Neighbours], base: Run, lanes: int) -> Self:
        """Carry derivatives from the start on; lanes: directions that code is compiled for."""
        self.neighbours, self.base, self._lanes = list(neighbours), base, lanes
        self.reported: list[Floats] = []
        self.slopes: list[Floats] = []
        self.instants: dict[float, Floats] = {}
        return self

    def begin(self, integration: Integration) -> None:
        """As of ``RunState``: the integration is differentiated.

        Raises:
            SimulationError: it is the second one of the run.
        """
        if self.integrations:
            raise SimulationError(
                "derivatives end where an integrator hands over to another one; take one alone "
                "(integrator radau, where the scene is stiff)"
            )
        super().begin(integration)
        self._differentiation = Differentiation(1 + self._lanes)
        integration.call = self._differentiation.call  # type: ignore[method-assign]
        integration.rows = self._rows  # type: ignore[method-assign]
        self._seed()
        integration.compile()
        if integration.takes_programs:
            self.programs = self._programs()
        if self.jumps is not None:
            law = type(self.jumps)
            self.jumps.begin = self._jumping(law.begin)  # type: ignore
            self.jumps.apply = self._jumping(law.apply)  # type: ignore

    def _slopes_of(self, array: Floats) -> Floats:
        """(size, p) view of the derivatives of an array of the integration."""
        return self._differentiation.slopes(array)[:, : len(self.neighbours)]

    def _seed(self) -> None:
        """Derivatives of all numbers at the start."""
        for argument in self.present.loop_arguments:
            self._differentiation.wide(argument)
        arrays = floats_of(self)
        ends = np.cumsum([array.size for array in arrays.values()])[:-1]
        for j, beside in enumerate(self.neighbours):
            if beside.copied is not None:
                of_numbers, of_state = beside.copied
                for array, slope in zip(arrays_of_numbers(self.evaluator), of_numbers, strict=True):
                    self._slopes_of(array)[:, j] = slope
                self._slopes_of(self.present.work.state[Y])[:, j] = of_state
                continue
            found = beside.derivative(
                lambda run: _finite(np.concatenate([*floats_of(run).values()]))
            )
            for array, slope in zip(arrays.values(), np.split(found, ends), strict=True):
                self._slopes_of(array)[:, j] = slope

    def _programs(self) -> ChangeOver:
        """Programs of the scene in differentiated form; numbers that have slopes are loaded."""
        evaluator = copy.copy(self.evaluator)
        evaluator.functions = self._differentiation.wide(evaluator.functions)
        evaluator.loops = self._differentiation.wide(evaluator.loops)
        varied = {
            name: np.flatnonzero(self._slopes_of(array).any(axis=1))
            for name, array in evaluator.system.walk()
            if array.dtype.kind == "f" and array.size
        }
        return ChangeOver(evaluator, varied, self._differentiation.count)

    def _rows(self) -> Floats:
        """As ``Integration.rows``; their derivatives are kept."""
        integration = self.present
        work, count = integration.work, int(integration.work.row_count)
        raw = work.rows[:count].copy()
        slopes = self._slopes_of(work.rows)[: count * work.rows.shape[1]]
        slopes = slopes.reshape(count, work.rows.shape[1], len(self.neighbours)).copy()
        if count and not self.evaluator.coordinates.are_of_bodies:
            motion = slice(1, work.state.shape[1])  # without the work done, which may be large
            slopes = self._derivative(
                lambda run, rows: run.evaluator.body_rows(rows), raw, slopes, motion
            )
        if count:
            self.slopes.append(slopes)
            self.reported.append(self.evaluator.body_rows(raw))
        for row in work.crossings[: integration.crossing_count]:
            place = int(np.flatnonzero(work.crossings[:, 0] == row[0])[0])
            self.instants[float(row[0])] = self._slopes_of(work.crossings)[3 * place].copy()
        return type(integration).rows(integration)

    def _derivative(
        self, function: Callable[[Run, Floats], Floats], x: Floats, slopes: Floats, motion: slice
    ) -> Floats:
        return total_derivative(function, self.neighbours, self.base, x, slopes, motion)

    def _jumping(self, change: Callable[..., None]) -> Callable[[Integration], None]:
        """A jump of velocities, whose derivatives are those of the law that Python solves."""
        of = self.jumps
        assert of is not None

        def jump(integration: Integration) -> None:
            work = integration.work
            present = [(name, array.copy()) for name, array in arrays_of(self)]
            of_time = self._slopes_of(work.real)[work.indices("real")["t"]].copy()
            of_state = self._slopes_of(work.state)[: work.state.shape[1]].copy()
            given = np.append(work.state[Y], work.t)
            system = {
                name: self._slopes_of(array).copy()
                for name, array in arrays_of(self)
                if array.dtype.kind == "f" and not name.startswith("0.") and array.size
            }

            def after(run: Run, state: Floats) -> Floats:
                arrays = dict(arrays_of(run))
                offset, j = self._offset_of(run)
                for name, array in present:
                    arrays[name][...] = array
                    if offset and name in system:
                        arrays[name] += offset * system[name][:, j].reshape(array.shape)
                own = run.present.work
                own.state[Y], own.t = state[:-1], state[-1]
                jumps = type(of)(run.evaluator)
                jumps.span = of.span
                jumps.repeat_of(of)
                try:
                    change(jumps, run.present)
                except SimulationError as error:  # shorter differences may not come to that
                    failures.append(error)
                    return np.full_like(own.state[Y], np.nan)
                return own.state[Y].copy()

            failures: list[SimulationError] = []
            change(of, integration)
            motion = slice(0, -2)  # without the work done and time
            slopes = self._derivative(after, given, np.vstack([of_state, of_time]), motion)
            if np.isnan(slopes).any():
                what = f"there is no derivative of what happens at t = {work.t:.9g} s"
                raise SimulationError(f"{what}: {failures[-1]}") from failures[-1]
            self.instants[float(work.t)] = of_time
            self._differentiation.take()
            self._slopes_of(work.state)[: work.state.shape[1]] = slopes

        return jump

    def _offset_of(self, run: Run) -> tuple[float, int]:
        """How far the parameter of a neighbour is from its value, and which one it is."""
        for j, beside in enumerate(self.neighbours):
            if offset := beside.offset_of(run):
                return offset, j
        return 0.0, 0


def _finite(x: Floats) -> Floats:
    """Numbers, with zero for those that are not finite: limits that are not set."""
    return np.where(np.isfinite(x), x, 0.0)
