"""Outputs of a study: what is computed from each run, from its result or its rows."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.model import Model
from dap3d_core.model.groups import Floats
from dap3d_core.registry.suggestions import nearest
from dap3d_core.result import Quantity, Result, ResultError, RunMetadata, UnknownNameError, find
from dap3d_core.scene import MISSING, Mistake, SceneError
from dap3d_core.scene.coerce import plain
from dap3d_core.scene.errors import shown
from dap3d_core.simulation import CompiledModel, SimulationError
from dap3d_core.simulation.output.check_outputs import probe_of
from dap3d_core.study.parameters import TABLES, SceneParameter, with_values


def _integral(values: Floats, t: Floats) -> Any:
    """The integral over time, by the trapezoidal rule."""
    return np.trapezoid(values, t, axis=-1)


def _mean(values: Floats, t: Floats) -> Any:
    """The mean over time."""
    span = t[-1] - t[0]
    return _integral(values, t) / span if span else values[..., -1]


#: Of values (..., nt) of a quantity at the reported instants t (nt,).
REDUCTIONS: dict[str, Callable[[Floats, Floats], Any]] = {
    "end": lambda values, t: values[..., -1],
    "final": lambda values, t: values[..., -1],  # the same
    "min": lambda values, t: np.min(values, axis=-1),
    "max": lambda values, t: np.max(values, axis=-1),
    "mean": _mean,
    "rms": lambda values, t: np.sqrt(_mean(values**2, t)),
    "integral": _integral,
    "series": lambda values, t: values,
}

#: Names of other variables in a study's data set.
RESERVED = ("point", "time", "status", "note")
FORM = "an output is text such as 'crank.r.z:max', or a function of the result"
#: Parameters that change the reporting times.
TIMING = (("simulation", "t_end"), ("simulation", "dt"))
#: Quantities of the model that are computed with masses, and of joints, that are in the rows.
OF_MASSES, IN_ROWS = ("kinetic energy", "total energy"), "Lagrange multipliers"


@attrs.frozen
class Output:
    """One value or series that is computed from each run.

    Attributes:
        name: its label, by default the text that defines it, ``crank.r.z:max``.
        of: name of a scalar quantity; or a function of the ``Result`` that returns one number.
        reduction: one of ``REDUCTIONS``; "" for a function.
    """

    name: str
    of: str | Callable[[Result], Any]
    reduction: str = "end"

    def value(self, result: Result) -> Any:
        """The output of one run: a number, or with "series" (nt,); NaN without an instant.

        Raises:
            SimulationError: a function raises an exception, or does not return a number.
        """
        if callable(self.of):
            return self._returned(self.of, result)
        if not len(result.t):
            return np.empty(0) if self.reduction == "series" else np.nan
        return REDUCTIONS[self.reduction](result.quantity(self.of).values, result.t)

    def columns(self, quantity: Quantity) -> "list[Output]":
        """An output for each column of its quantity: ``crank.r:max`` -> ``crank.r.x:max``, ..."""
        if not quantity.components:
            return [self]
        head, colon, tail = self.name.rpartition(":")
        head, colon, tail = (head, colon, tail) if colon else (self.name, "", "")
        return [
            attrs.evolve(
                self,
                name=f"{column if head == self.of else f'{head}.{c}'}{colon}{tail}",
                of=column,
            )
            for c, column in zip(quantity.components, quantity.columns, strict=True)
        ]

    def _returned(self, function: Callable[[Result], Any], result: Result) -> float:
        try:
            value = function(result)
        except Exception as error:
            message = f"the function of output {self.name!r} raises {type(error).__name__}: {error}"
            raise SimulationError(message) from error
        try:
            return float(value)
        except (TypeError, ValueError) as error:
            message = f"the function of output {self.name!r} should return one number"
            raise SimulationError(f"{message}, not {shown(value)}") from error


def outputs_of(given: Any) -> tuple[Output, ...]:
    """Outputs as given by a script or a command line.

    Args:
        given: name of a quantity, with a reduction after a colon (one of ``REDUCTIONS``, by default
            "end"); a function of the ``Result`` that returns one number, labelled by its name; a
            list of these; or label -> one of these.

    Raises:
        SceneError: none, one twice, an unknown reduction, an invalid label; all mistakes.
    """
    if isinstance(given, str) or callable(given):
        given = [given]
    if isinstance(given, Mapping):
        pairs = list(given.items())
    elif isinstance(given, Iterable):
        pairs = [(getattr(of, "__name__", "") if callable(of) else of, of) for of in given]
    else:
        raise SceneError([Mistake("outputs", given, FORM)])
    pairs = [(plain(label), plain(of)) for label, of in pairs]
    if not pairs:
        raise SceneError([Mistake("outputs", MISSING, f"name at least one output; {FORM}")])
    read = [_output(label, of) for label, of in pairs]
    outputs = [one for one in read if isinstance(one, Output)]
    mistakes = [one for one in read if isinstance(one, Mistake)]
    names = [output.name for output in outputs]
    twice = dict.fromkeys(name for name in names if names.count(name) > 1)
    mistakes += [Mistake("outputs", name, "an output is named once only") for name in twice]
    if mistakes:
        raise SceneError(mistakes)
    return tuple(outputs)


def _output(label: Any, of: Any) -> Output | Mistake:
    if not callable(of) and not isinstance(of, str):
        return Mistake("outputs", of, FORM)
    if callable(of) and (not isinstance(label, str) or not label or label == "<lambda>"):
        what = "a function without a name of its own needs a label"
        return Mistake("outputs", MISSING, what, remedy='give {"label": function}')
    if not isinstance(label, str) or not label.strip() or not label.isprintable():
        return Mistake("outputs", label, "the label of an output is text of one line")
    if label in RESERVED:
        return Mistake("outputs", label, "this name is reserved in every study; take another")
    if callable(of):
        return Output(label, of, "")
    quantity, colon, reduction = of.rpartition(":")
    if not colon or "." in reduction:  # names of bodies may hold a colon
        quantity, reduction = of, "end"
    if reduction in REDUCTIONS and quantity:
        return Output(label, quantity, reduction)
    if not quantity:
        return Mistake("outputs", of, FORM)
    near = nearest(reduction, REDUCTIONS)
    what = f"the reduction after the colon is one of {', '.join(REDUCTIONS)}"
    return Mistake("outputs", of, what, f"{quantity}:{near}" if near else "")


def unknown_quantity(key: str, value: str, error: UnknownNameError | ResultError) -> Mistake:
    """The mistake of a value that names no quantity, with the nearest."""
    return Mistake(key, value, str(error.args[0]), getattr(error, "nearest", ""))


def _moves_joints(parameter: SceneParameter) -> bool:
    """True if joints may have other axes, points or poses in the scene with another value."""
    if parameter.table == "bodies":
        return parameter.path[2] not in ("mass", "Jp", "r_dot", "w")
    return parameter.table not in ("forces", "simulation")


def _sources(result: Result, quantity: Quantity) -> list[Quantity]:
    """The quantity itself; of an output of the scene all others that it is computed from."""
    sources, names = [quantity], set(quantity.operands)
    for source in sources:
        new = [name for name in source.operands if name not in names or source is quantity]
        names.update(new)
        sources += [find(result, name) for name in new]
    return [source for source in sources if source.owner != "output"]


class Reduction:
    """Computes the outputs of a study from the rows that its runs report.

    Attributes:
        outputs: those requested, each vector in its components.
        labels, units: of each output, by name.
        compiled, parameters: the model of the scene as given, and what varies.
        of_rows: whether each output can be computed from the rows of many runs at once, by name.
    """

    def __init__(
        self,
        compiled: CompiledModel,
        parameters: Sequence[SceneParameter],
        outputs: Sequence[Output],
    ) -> None:
        """Look the outputs up.

        Raises:
            SceneError: an unknown quantity; or a series of a length that varies.
        """
        self.compiled, self.parameters = compiled, parameters
        tables = {parameter.table for parameter in parameters}
        self._moves_joints = any(map(_moves_joints, parameters))
        self._tables = set(TABLES) if "parameters" in tables else tables
        self.labels: dict[str, str] = {}
        self.units: dict[str, str] = {}
        self.of_rows: dict[str, bool] = {}
        self.outputs = self._look_up(outputs)
        timing = [parameter.name for parameter in parameters if parameter.path in TIMING]
        series = [output.name for output in self.outputs if output.reduction == "series"]
        if timing and series:
            what = f"a series has the same length at each point, and {timing[0]} varies"
            remedy = "use one number of it, such as :end, :max or :mean"
            raise SceneError(Mistake("outputs", name, what, remedy=remedy) for name in series)

    def reduce(self, rows: Floats, times: Floats) -> dict[str, Floats]:
        """The outputs that are ``of_rows``, (k,) or (k, nt), of k runs' rows (k, nt, width)."""
        k, nt, width = rows.shape
        result, values_of = None, {}
        for output in self.outputs:
            if not self.of_rows[output.name]:
                continue
            result = result or self.result(self.compiled.model, rows.reshape(k * nt, width))
            values = result.quantity(str(output.of)).values.reshape(k, nt)
            values_of[output.name] = REDUCTIONS[output.reduction](values, times)
        return values_of

    def result(
        self,
        model: Model,
        rows: Floats,
        evaluator: Evaluator | None = None,
        point: Sequence[float] | None = None,
    ) -> Result:
        """A result in memory, of rows of a model that an evaluator evaluates.

        point: values of the parameters; by default those of the scene.
        """
        text = self.compiled.scene_text
        if point is not None and "parameters" in text and "outputs" in text:  # which may read them
            text = with_values(self.compiled.scene, self.parameters, point).to_toml()
        record = RunMetadata(scene_text=text)
        evaluator = evaluator or self.compiled.evaluator
        rows = evaluator.with_inputs(rows, model.input_values)
        return Result.of_run(model, rows, record, lambda: evaluator)

    def _look_up(self, outputs: Sequence[Output]) -> tuple[Output, ...]:
        probe = probe_of(self.compiled.scene_text, self.compiled.evaluator)
        expanded: list[Output] = []
        mistakes: list[Mistake] = []
        for output in outputs:
            components, label, unit, of_rows = [output], output.name, "", False
            if not callable(output.of):
                try:
                    quantity = find(probe, output.of)
                except (UnknownNameError, ResultError) as error:
                    mistakes.append(unknown_quantity("outputs", output.name, error))
                    continue
                components = output.columns(quantity)
                label, unit = quantity.label, quantity.unit
                of_rows = all(map(self._is_of_rows, _sources(probe, quantity)))
                if quantity.owner == "output" and self._tables == set(TABLES):
                    of_rows &= not any(e.parameters for e in probe.outputs.values())
            expanded += components
            if output.reduction == "integral":
                unit = f"{unit} s".strip()
            for name in (component.name for component in components):
                self.labels[name], self.units[name], self.of_rows[name] = label, unit, of_rows
        if mistakes:
            raise SceneError(mistakes)
        return tuple(expanded)

    def _is_of_rows(self, quantity: Quantity) -> bool:
        """True if a quantity is computed with nothing that varies from point to point."""
        if quantity.owner == "coordinate":
            return not self._moves_joints
        if quantity.owner == "joint" and quantity.kind != IN_ROWS:
            return self._tables <= {"forces"}
        if quantity.owner in ("force", "contact"):
            return not self._tables
        if quantity.owner in ("point", "input"):
            return f"{quantity.owner}s" not in self._tables
        return quantity.kind not in OF_MASSES or "bodies" not in self._tables
