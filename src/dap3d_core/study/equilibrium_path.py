"""Public function ``equilibrium_path``: equilibria over a parameter, through turning points."""

import os
from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Model, ModelError, build_model
from dap3d_core.model.rotations import read_only
from dap3d_core.model.state_layout import split
from dap3d_core.registry import load_registry
from dap3d_core.registry.arguments import checked
from dap3d_core.result import Quantity, information
from dap3d_core.result.arrays import AXES, EULER
from dap3d_core.result.quantities.lookup import find
from dap3d_core.scene import Mistake, Scene, SceneError, ValidatedScene, check, load
from dap3d_core.simulation import CompiledModel, SimulationError
from dap3d_core.simulation.equilibrium.continuation import (
    Continuation,
    End,
    Kind,
    ParameterStatics,
    PathPoint,
)
from dap3d_core.simulation.equilibrium.equilibrium import Equilibrium, equilibrium
from dap3d_core.simulation.equilibrium.rest import least_multipliers
from dap3d_core.simulation.equilibrium.search import stability_of
from dap3d_core.simulation.initial.start_state import Start, StartState
from dap3d_core.simulation.settings import compiled_for
from dap3d_core.study.design import FORMS
from dap3d_core.study.outputs import Output, Reduction
from dap3d_core.study.parameters import SceneParameter, read_values, with_values

if TYPE_CHECKING:
    import xarray

#: Attributes that say of each point whether something is true of it.
MARKS = ("given", "turning", "branching", "stable")
#: Models that are kept: differences by the parameter come back to a value.
KEPT = 32
#: What changes by less than this part of its size over the whole path is constant.
CONSTANT = 1e-12


class EquilibriumPath:
    """Equilibria of n bodies along a path over a parameter: k points, in the order of the path.

    Attributes:
        parameter, unit: its dotted name and SI unit.
        values: (k,) values of the parameter.
        length: (k,) of the path so far, in parts of the range of the parameter and of the scene.
        given: (k,) bool, True where the parameter has one of the values that were given.
        turning: (k,) bool, True at turning points, where the parameter is largest or least.
        branching: (k,) bool, True where a stiffness changes its sign without a turn: another path
            crosses there, as where a column buckles.
        stable: (k,) bool as ``Equilibrium.stable``; False at turning points.
        stiffness: (k,) the least stiffness of a freedom, N m, as of ``Equilibrium``.
        u: (k, 13 n) states: r, p, zero velocities.
        r, p: (k, n, 3) positions, m; (k, n, 4) Euler parameters.
        Lam: (k, m) Lagrange multipliers, as of ``Equilibrium``.
        residual: (k,) largest unbalanced force, as a part of the largest force: rounding.
        end: "reached": at the last value; "returned": back at the first one, behind turning points;
            "stuck": no equilibrium follows; "long": too many steps.
        notes: what was assumed, and what to know of the path.
    """

    def __init__(
        self, compiled: CompiledModel, family: "_Family", points: list[PathPoint], end: End,
        notes: list[str],
    ) -> None:  # fmt: skip
        """Compose a path of its points."""
        self._compiled, self._family, self._points = compiled, family, points
        self.parameter, self.unit = family.parameter.name, family.parameter.unit
        self.values = read_only(np.array([family.value_of(point.s) for point in points]))
        self.length = read_only(family.lengths(points))
        kinds = [point.kind for point in points]
        self.given = np.isin([point.s for point in points], family.given)
        self.turning = np.array([kind is Kind.TURNING for kind in kinds])
        self.branching = np.array([kind is Kind.BRANCHING for kind in kinds])
        self.stable = np.array([family.is_stable(point) for point in points])
        self.stiffness = np.array([np.min(point.stiffness, initial=np.inf) for point in points])
        self.u = read_only(np.array([point.pose.u for point in points]))
        parts = [split(u) for u in self.u]
        self.r, self.p = (read_only(np.array([part[q] for part in parts])) for q in (0, 1))
        self.residual = np.array([point.pose.residual for point in points])
        self._rows = np.array([family.row(point) for point in points])
        lam = compiled.model.row_layout["Lam"]
        self.Lam = read_only(self._rows[:, lam])
        self.end = end.value
        self.notes = notes
        self._quantities: dict[str, Quantity] = {}

    def __repr__(self) -> str:
        turns = int(np.sum(self.turning))
        return (
            f"<EquilibriumPath over {self.parameter}: {len(self.values)} points, "
            f"{turns} turning point{'' if turns == 1 else 's'}, {self.end}>"
        )

    @checked
    def of(self, quantity: str) -> Floats:
        """(k,) or (k, components) values of a quantity, such as ``crank.r.z``, ``J1.force.norm``.

        Args:
            quantity: a name as of ``Result.quantity``.

        Raises:
            UnknownNameError: there is no such quantity; names the nearest.
        """
        return self.quantity(quantity).values

    def quantity(self, name: str) -> Quantity:
        """A quantity with its label, unit and components; as ``of``."""
        if name not in self._quantities:
            self._quantities[name] = self._family.quantity(name, self._points, self._rows)
        return self._quantities[name]

    def largest_motion(self) -> str:
        """The coordinate of a body that changes most along the path, ``node.r.z``."""
        names = self._compiled.model.body_names
        length = self._family.statics.statics.length
        ranges = {
            f"{name}.r.{axis}": float(np.ptp(self.r[:, k, q])) / length
            for k, name in enumerate(names)
            for q, axis in enumerate(AXES)
        }
        most = max(ranges, key=ranges.__getitem__)
        if ranges[most] > CONSTANT:
            return most
        angles = [f"{name}.{angle}" for name in names for angle in ("roll", "pitch", "yaw")]
        return max(angles, key=lambda name: float(np.ptp(self.of(name))))

    @checked
    def equilibrium(self, k: int) -> Equilibrium:
        """The equilibrium at a point, with reactions and ``.scene()``.

        Raises:
            IndexError: there is no such point.
        """
        point = self._points[k]
        scene = self._family.scene(point.s)
        angles = self._rows[k, self._compiled.model.row_layout["angles"]]
        start = StartState(point.pose.u, angles, states=point.states)
        compiled = compiled_for(scene, self._family.allow_code, integrator="auto")
        return equilibrium(compiled, start=start)

    @checked
    def to_dict(self, *quantities: str) -> dict[str, Any]:
        """The path as data of numbers, text and lists, with quantities by name."""
        return {
            "parameter": self.parameter,
            "unit": self.unit,
            "end": self.end,
            **{name: getattr(self, name).tolist()
               for name in ("values", *MARKS, "stiffness", "residual")},
            "quantities": {name: self.of(name).tolist() for name in quantities},
            "notes": list(self.notes),
        }  # fmt: skip

    @checked
    def to_xarray(self, *quantities: str) -> "xarray.Dataset":
        """The path as a data set over ``point``, with r, p and quantities by name."""
        import xarray

        names = self._compiled.model.body_names
        data: dict[str, Any] = {
            "r": (("point", "body", "axis"), self.r, {"units": "m"}),
            "p": (("point", "body", "euler"), self.p, {"units": "1"}),
            "stiffness": ("point", self.stiffness, {"units": "N m"}),
        }
        for name in quantities:
            found = self.quantity(name)
            dimensions = ("point", f"component of {name}")[: found.values.ndim]
            data[name] = (dimensions, found.values, {"units": found.unit, "long_name": found.label})
        about = {"units": self.unit, "long_name": self.parameter}
        marks = {name: ("point", getattr(self, name)) for name in MARKS}
        labels = {"body": list(names), "axis": list(AXES), "euler": list(EULER)}
        coordinates = {"value": ("point", self.values, about), **marks, **labels}
        return xarray.Dataset(data, coordinates, {"parameter": self.parameter, "end": self.end})


@checked
def equilibrium_path(
    scene: Scene | str | os.PathLike[str],
    parameter: str,
    values: Any,
    *,
    start: Start | None = None,
    allow_code: bool = False,
    announce: Callable[[str], None] | None = None,
) -> EquilibriumPath:
    """Follow an equilibrium of a scene over a parameter, through its turning points.

    The path begins at the equilibrium that ``equilibrium`` finds at the first value, and is
    followed by its length (pseudo-arc-length continuation: Riks 1972, Keller 1977), stable or not,
    to the last value. Where no equilibrium exists beyond a value, as at the load at which a truss
    snaps through, the path turns and the parameter runs back; it may come to a value several times.
    A path that comes back to the first value ends there. Turning points are located to rounding.

    Args:
        scene: a Scene, or what ``load`` takes.
        parameter: what ``sweep`` may vary: ``forces.load.f.z``, ``parameters.angle``.
        values: two or more values, rising or falling, at all of which the path is reported
            wherever it comes to them, or text: "0:5:11" (from:to:count). Steps between them are
            points as well, as many as the curve takes.
        start: what the search at the first value starts from, as of ``equilibrium``.
        allow_code, announce: as of ``compile``.

    Raises:
        SceneError, PluginError: an unknown parameter, with the nearest; invalid values; a parameter
            on which no equilibrium depends; others as ``load``.
        SimulationError: there is no equilibrium at the first value; says why.
    """
    scene = scene if isinstance(scene, Scene) else load(scene)
    own = check(scene, load_registry(), allow_code=allow_code)
    varied, numbers = read_values(own, parameter, values)
    _check_values(varied, values, numbers)
    first = with_values(scene, [varied], [numbers[0]])
    compiled = compiled_for(first, allow_code, announce, integrator="auto")
    try:
        rest = equilibrium(compiled, start=start)
    except SimulationError as error:
        raise SimulationError(f"at {varied.name} = {numbers[0]:g}: {error}") from error
    family = _Family(compiled, own, varied, numbers, allow_code)
    family.start(rest)
    continuation = Continuation(family.statics, family.given)
    end = continuation.run(rest.u)
    path = EquilibriumPath(compiled, family, continuation.points, end, list(rest.notes))
    _check_effect(path)
    path.notes += _path_notes(path, numbers)
    return path


def _check_values(varied: SceneParameter, values: Any, numbers: Floats) -> None:
    """Refuse values that no path can follow."""
    what = ""
    steps = np.diff(numbers)
    if varied.whole:
        what = f"{varied.name} is a whole number, which no path can follow"
    elif len(numbers) < 2:
        what = f"a path takes two values or more: {FORMS}"
    elif not (np.all(steps > 0.0) or np.all(steps < 0.0)):
        what = "the values of a path rise or fall from the first to the last"
    if what:
        raise SceneError([Mistake("values", values, what)])


def _check_effect(path: EquilibriumPath) -> None:
    """Refuse a parameter that nothing depends on."""
    parts = (path.u, path.Lam, path.stiffness[:, None], path.stable[:, None].astype(float))
    for part in parts:
        finite = np.where(np.isfinite(part), part, 0.0)
        if np.any(np.ptp(finite, axis=0) > CONSTANT * np.max(np.abs(finite), initial=0.0)):
            return
    what = (
        f"{path.parameter} does not matter: poses, reactions and stiffness at rest are the same at "
        "all values"
    )
    raise SceneError([Mistake("parameter", path.parameter, what)])


def _path_notes(path: EquilibriumPath, numbers: Floats) -> list[str]:
    """Where other paths cross, and how the path ends where not at the last value."""
    name, last = path.parameter, f"{path.values[-1]:.6g}"
    notes = [
        f"another path crosses at {name} = {value:.6g}, where a stiffness changes its sign though "
        "the parameter does not turn; a start aside leads to that path"
        for value in path.values[path.branching]
    ]
    if path.end == "returned":
        what = (
            f"the path turns before {name} = {numbers[-1]:g}, and ends at {last} again; values "
            "that begin beyond it follow the path further"
        )
        notes.append(information(what))
    elif path.end == "stuck":
        notes.append(
            f"the path ends at {name} = {last}: no step goes on there. Forces may jump, joints may "
            "come to the end of their reach, or another path may cross"
        )
    elif path.end == "long":
        notes.append(f"the path was followed for {len(path.values)} points, to {name} = {last}")
    return notes


class _Family:
    """The models of a scene over a parameter, evaluated by one evaluator.

    Attributes:
        parameter: what varies.
        given: (k,) the values that are reported, as parts of the range.
        evaluator: evaluates the model that was loaded last.
        statics: the balance of forces over the parameter.
        allow_code: whether the model's own types may be loaded.
    """

    def __init__(
        self, compiled: CompiledModel, own: ValidatedScene, parameter: SceneParameter,
        numbers: Floats, allow_code: bool,
    ) -> None:  # fmt: skip
        self.parameter, self.allow_code = parameter, allow_code
        self.evaluator = compiled.new_evaluator()
        self._compiled, self._own = compiled, own
        self._first, self._range = float(numbers[0]), float(numbers[-1] - numbers[0])
        self.given = (numbers - self._first) / self._range
        self._model = lru_cache(maxsize=KEPT)(self._build)
        self._exact: dict[float, float] = dict(
            zip(self.given.tolist(), numbers.tolist(), strict=True)
        )
        self._load(1.0)  # mistakes at the last value are reported at once
        self.statics = ParameterStatics(self.evaluator, self._load)

    def value_of(self, s: float) -> float:
        """The value of the parameter at a part of its range."""
        return self._exact.get(s, self._first + s * self._range)

    def scene(self, s: float) -> Scene:
        """The scene at a part of the range."""
        return with_values(self._compiled.scene, [self.parameter], [self.value_of(s)])

    def _build(self, s: float) -> Model:
        return build_model(check(self.scene(s), self._own.registry))

    def _load(self, s: float) -> None:
        try:
            self.evaluator.load(self._model(s))
        except (ModelError, ValueError) as error:
            what = f"at {self.value_of(s):g} the scene has another structure: {error}"
            raise SceneError([Mistake("parameter", self.parameter.name, what)]) from error

    def start(self, rest: Equilibrium) -> None:
        """Begin at an equilibrium at the first value."""
        self.statics.load(0.0)
        self.evaluator.start(0.0, rest.u, rest.angles, rest.states)

    def lengths(self, points: list[PathPoint]) -> Floats:
        """(k,) length of the path up to each point, of its chords."""
        chords = [np.linalg.norm(self.statics.chord(a, b.s, b.pose.u)) for a, b in pairwise(points)]
        return np.concatenate([[0.0], np.cumsum(chords)])

    def is_stable(self, point: PathPoint) -> bool:
        """Whether a point is stable: at a turning point the potential has no minimum."""
        if point.kind is Kind.TURNING:
            return False
        self.statics.load(point.s, point)
        return stability_of(self.statics.statics, point.pose).stable

    def row(self, point: PathPoint) -> Floats:
        """A row of a result at rest at a point."""
        self.statics.load(point.s, point)
        evaluator, u = self.evaluator, point.pose.u
        layout = evaluator.model.report_layout
        report = evaluator.report(0.0, u)
        report[layout["v_dot"]] = 0.0
        report[layout["Lam"]] = least_multipliers(self.statics.statics, u)[0]
        return np.concatenate([[0.0], evaluator.integrated(u), report[: evaluator.report_size]])

    def quantity(self, name: str, points: list[PathPoint], rows: Floats) -> Quantity:
        """A quantity of points with their rows (k, ...)."""
        reduction = Reduction(self._compiled, [self.parameter], [])
        self.statics.load(points[0].s, points[0])
        quantity = find(reduction.result(self.evaluator.model, rows, self.evaluator), name)
        reduction = Reduction(self._compiled, [self.parameter], [Output(name, name)])
        if all(reduction.of_rows.values()):
            return quantity
        values = []
        for point, row in zip(points, rows, strict=True):
            self.statics.load(point.s, point)
            value = [self.value_of(point.s)]
            one = reduction.result(self.evaluator.model, row[None], self.evaluator, value)
            values.append(one.quantity(name).values[0])
        return quantity._replace(values=np.array(values))
