"""Public function ``sensitivities``: a run and its derivatives by parameters of the scene."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import jit_is_on
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
from dap3d_core.study.differences import motion_of
from dap3d_core.study.outputs import Output, Reduction
from dap3d_core.study.parameters import SceneParameter, parameters_named
from dap3d_core.study.sensitivities.differentiated_run import DifferentiatedRun
from dap3d_core.study.sensitivities.neighbours import (
    Neighbours,
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
        found = find(self.result, quantity)
        if found.components:
            raise ResultError(f"{quantity} is a vector; take {found.columns[0]}")
        value = float(found.values[-1])
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
    names, given = [by] if isinstance(by, str) else list(by), dict[str, Any](settings)
    own = compiled.scene.copy()
    if take_varied(own, names, given):
        compiled = CompiledModel(own, method=compiled.requested_method,
                                 registry=compiled.checked.registry, like=compiled)  # fmt: skip
    parameters = parameters_by(compiled.checked, names)
    check_differentiable(parameters, "by")
    given["start"] = start_word(start)
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
            run = DifferentiatedRun(compiled, simulation, Callbacks(), start=state)
            results.append(run.carry(beside, base, lanes).execute())
        runs.append(run)
    for note in _notes(compiled, runs, results[0]):
        results[0].note(note)
    return Sensitivities(results[0], runs, parameters)


def take_varied(scene: Scene, names: Sequence[str], settings: dict[str, Any]) -> bool:
    """Move settings that are given and vary, such as ``simulation.t_end``, into a scene.

    Returns:
        True if there are some.
    """
    varied = [name for name, value in settings.items() if value is not None
              and f"simulation.{name}" in names]  # fmt: skip
    for name in varied:
        setattr(scene.simulation, name, settings.pop(name))
    return bool(varied)


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


def _notes(
    compiled: CompiledModel, runs: "Sequence[DifferentiatedRun]", result: Result
) -> list[str]:
    """Notes on laws, and on uncorrected starts that leave their constraints."""
    notes = notes_on_derivatives(compiled.checked)
    found = [
        beside.parameter.name for run in runs for beside in run.neighbours if beside.is_brought_back
    ]
    if found:
        notes.append(
            f"derivatives: the start leaves its constraints with {some(found)} and is not "
            "corrected: they are those of a start that is brought onto the constraints (switch "
            "correct on for runs that do so)"
        )
    if (t := min((run.in_turns for run in runs), default=np.inf)) < np.inf:
        notes.append(
            f"derivatives: at t = {t:.6g} s contacts that share a load began to slide in turns of "
            "slip and stick, by rounding; as a rule derivatives are right behind that, but may be "
            "off by some parts of a hundred: compare with runs of values nearby, or give the "
            "contacts a larger mu_s"
        )
    return notes


def parameters_by(checked: ValidatedScene, names: Sequence[str]) -> tuple[SceneParameter, ...]:
    """The parameters that an argument ``by`` names.

    Raises:
        SceneError: there are none, or wrong names, with the nearest.
    """
    if not names:
        what = "name a parameter of the scene, such as bodies.crank.mass"
        raise SceneError([Mistake("by", MISSING, what)])
    return parameters_named(checked, names, "by")
