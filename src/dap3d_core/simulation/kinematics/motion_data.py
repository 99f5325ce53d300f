"""A given motion as states and accelerations on the constraints of a scene.

Of data the positions are found at each instant, nearest to them in the sense of least squares and
on the constraints; splines through the positions give velocities and accelerations, which are
brought onto the rows of their levels by the least change.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.element_states import ElementState
from dap3d_core.model.rotations import angular_velocities
from dap3d_core.model.state_layout import join, split, velocities_of
from dap3d_core.result import Result, RunMetadata
from dap3d_core.result.arrays import Arrays, summary_of
from dap3d_core.result.errors import UnknownNameError
from dap3d_core.result.quantities.lookup import find
from dap3d_core.result.quantities.measured_data import MeasuredData, read_measured
from dap3d_core.scene import MISSING, Mistake, SceneError
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.initial.assemble import max_speed
from dap3d_core.simulation.initial.least_change import displaced
from dap3d_core.simulation.kinematics.pose_equations import ChosenRows, Flags, own_states
from dap3d_core.simulation.redundancy.freedoms import coordinates_of

#: Degree of the splines; the fewest instants, which a spline of degree 3 goes through.
DEGREE, FEWEST = 5, 4
#: Changes, in lengths of the scene and rad, over which quantities are differentiated, and
#: derivatives that are zero.
SPAN, NOTHING = 1e-5, 1e-7
#: Passes of the Gauss-Newton iteration, and the change (rad, parts of the model) that ends it.
MOST_PASSES, SETTLED = 50, 1e-12
#: Slopes of quantities are computed anew behind a larger change.
SLOPES_ANEW = 1e-2
#: Changes no longer shrink below this: rounding.
LEAST_CHANGE = 1e-8
#: No pass turns a body by more, or moves it by more of the model.
MOST_CHANGE = 0.5
#: Motions that move the data by less than this part of the others are not seen by them.
SEEN = 1e-7


@attrs.frozen(eq=False)
class Motion:
    """A motion at nt instants.

    Attributes:
        t: (nt,) s.
        u: (nt, 13 n) states on the constraints.
        v_dot: (nt, 6 n) accelerations.
        misfit: quantity -> largest distance of the data from the motion, in its unit.
        angles: (nt, angles) that a run has counted, in the order of the model; None of data.
        states: (nt, states) of elements: those of the run, else their initial values.
        inputs: (nt, inputs) those of the run, else the values of the scene.
        held: the states that keep their initial values.
    """

    t: Floats
    u: Floats
    v_dot: Floats
    misfit: dict[str, float]
    angles: Floats | None
    states: Floats
    inputs: Floats
    held: list[ElementState]


def read_motion(motion: Any) -> Result | MeasuredData:
    """A motion as ``inverse`` takes it.

    Raises:
        SceneError: it is none, or its times do not increase.
    """
    if isinstance(motion, Result):
        return motion
    data, _, mistakes = read_measured(motion, None, None)
    if data is not None:
        back = np.flatnonzero(np.diff(data.t) <= 0.0)
        if len(back):
            k = int(back[0]) + 1
            words = f"times must increase; number {k + 1} is not beyond the one before it"
            mistakes = [Mistake("measured.t", float(data.t[k]), words)]
        elif len(data.t) < FEWEST:
            words = f"accelerations need {FEWEST} instants or more; there are {len(data.t)}"
            mistakes = [Mistake("measured.t", MISSING, words)]
    if mistakes:
        raise SceneError(
            attrs.evolve(m, key=m.key.replace("measured", "motion", 1),
                         what=m.what.replace("measured data are", "a motion is a Result,"))
            for m in mistakes
        )  # fmt: skip
    assert data is not None
    return data


def motion_on(
    evaluator: Evaluator,
    given: Result | MeasuredData,
    start: Floats,
    chosen: Flags,
    scene_text: str,
) -> Motion:
    """The motion of a scene nearest to one that is given.

    Args:
        given: the motion.
        start: (13 n,) a pose near the first one, for data.
        chosen: (rows,) the constraint rows that hold; others belong to actuators.
        scene_text: the scene, as the text of a scene file.

    Raises:
        SceneError: the data have columns that are no positions of the scene, or lack its bodies.
        SimulationError: the data leave freedoms of the scene open, or fit none of its poses.
    """
    angles: Floats | None = None
    model, count = evaluator.model, len(given.t)
    states, inputs = (np.tile(x, (count, 1)) for x in (model.initial_states, model.input_values))
    held = own = own_states(model)
    if isinstance(given, Result):
        t, u, v_dot = given.t, *_states_of(evaluator, given)
        misfit: dict[str, float] = {}
        labels = [label if s in own else "" for s in model.element_states for label in s.labels]
        taken = _take(states, labels, given.arrays.states, given.summary.state_names)
        _take(inputs, model.input_names, given.arrays.inputs, given.summary.input_names)
        held = [s for s in own if not taken.issuperset(s.labels)]
        columns = [given.summary.angle_names.index(name) for name in evaluator.model.angle_names
                   if name in given.summary.angle_names]  # fmt: skip
        if len(columns) == evaluator.model.angle_count:
            angles = given.arrays.angles[:, columns]
    else:
        t = given.t
        fit = _Fit(evaluator, given, chosen, scene_text)
        positions = []
        for k in range(len(t)):
            start = fit.pose(k, start)
            positions.append(start)
        u, v_dot = differentiated(t, np.array(positions))
        misfit = fit.misfit
    u, v_dot = u.copy(), v_dot.copy()
    for k, time in enumerate(t):
        u[k], v_dot[k] = _on_rows(evaluator, float(time), u[k], v_dot[k], chosen)
    return Motion(t, u, v_dot, misfit, angles, states, inputs, held)


def _take(
    values: Floats, names: Sequence[str], given: Floats, given_names: Sequence[str]
) -> set[str]:
    """Put columns of the same names in ``values`` (nt, names); these names."""
    taken = set(names) & set(given_names)
    for name in taken:
        values[:, names.index(name)] = given[:, given_names.index(name)]
    return taken


def differentiated(t: Floats, u: Floats) -> tuple[Floats, Floats]:
    """States (nt, 13 n) with velocities, and accelerations (nt, 6 n), of splines through poses."""
    from scipy.interpolate import make_interp_spline

    r, p, _, _ = split(u)
    degree = DEGREE if len(t) > DEGREE else FEWEST - 1
    splines = [make_interp_spline(t, x, k=degree) for x in (r, p)]
    (v, rate), (a, second) = ([s(t, nu=order) for s in splines] for order in (1, 2))
    w, rise = (angular_velocities(p, x) for x in (rate, second))
    return join(r, p, v, w), np.concatenate([a, rise], axis=-1).reshape(len(t), -1)


def _on_rows(
    evaluator: Evaluator, t: float, u: Floats, v_dot: Floats, chosen: Flags
) -> tuple[Floats, Floats]:
    """A state and accelerations brought onto the rows, by the least change."""
    before = np.inf
    for _ in range(MOST_PASSES):
        rows = ChosenRows(evaluator, t, u, chosen)
        change = rows.least(rows.rows.C)
        size = max_speed(evaluator, change)
        if size <= SETTLED or (size <= LEAST_CHANGE and size > 0.5 * before):
            break
        u, before = displaced(u, -change), size
    else:
        raise SimulationError(
            f"at t = {t:.6g} s the motion does not fit the joints of the scene: no pose near it is "
            "assembled"
        )
    u = u.copy()
    velocities_of(u)[:] = rows.onto(velocities_of(u), rows.rows.nu)
    rows = ChosenRows(evaluator, t, u, chosen)
    return u, rows.onto(v_dot, rows.rows.gamma)


def _states_of(evaluator: Evaluator, result: Result) -> tuple[Floats, Floats]:
    """States and accelerations of the bodies of a scene in a result, by name."""
    names, index = evaluator.model.body_names, result.summary.body_index
    lacking = [name for name in names if name not in index]
    if lacking:
        words = f"the result has no body {lacking[0]!r}; its bodies: {', '.join(index)}"
        raise SceneError([Mistake("motion", MISSING, words)])
    if not len(result.t):
        raise SceneError([Mistake("motion", MISSING, "the result has no instants")])
    places = [index[name] for name in names]
    parts = [part[:, places] for part in split(result.u)]
    v_dot = result.v_dot.reshape(len(result.t), -1, 6)[:, places]
    return join(*parts), v_dot.reshape(len(result.t), -1)


class _Fit:
    """Positions nearest to data, on the constraints."""

    def __init__(
        self, evaluator: Evaluator, data: MeasuredData, chosen: Flags, scene_text: str
    ) -> None:
        self._scene_text = scene_text  # for the names of forces
        self.evaluator, self.data, self.chosen = evaluator, data, chosen
        self.misfit = dict.fromkeys(data.values, 0.0)
        self._summary = summary_of(evaluator.model)
        self._labels = list(data.values)
        self._units: dict[str, str] = {}
        length, n = evaluator.model.length, evaluator.model.body_count
        self._length, self._spans = length, SPAN * np.tile(np.repeat([length, 1.0], 3), n)

    def pose(self, k: int, start: Floats) -> Floats:
        """The state (13 n,), without velocities, at instant k from one near it."""
        t = float(self.data.t[k])
        target = np.array([self.data.values[label][k] for label in self._labels])
        measured = np.isfinite(target)
        u, before = start, np.inf
        for _ in range(MOST_PASSES):
            rows = ChosenRows(self.evaluator, t, u, self.chosen)
            if before > SLOPES_ANEW:
                values, slopes = self._quantities(t, u)
            else:
                values = self._values(np.array([t]), u[None])[:, 0]
            if k == 0 and before == np.inf:
                self._check_columns(slopes)
            change = -rows.least(rows.rows.C)
            error = (self._gap(target, values) - slopes @ change)[measured]
            units = np.array([self._length if self._units[label] == "m" else 1.0
                              for label in self._labels])[measured]  # fmt: skip
            seen, error = slopes[measured] @ rows.free / units[:, None], error / units
            self._check_seen(rows, seen, t, u)
            change = change + rows.free @ np.linalg.lstsq(seen, error, rcond=None)[0]
            size = max_speed(self.evaluator, change)
            if not np.isfinite(size):
                break
            u = displaced(u, min(1.0, MOST_CHANGE / max(size, 1e-300)) * change)
            if size <= SETTLED or (size <= LEAST_CHANGE and size > 0.5 * before):
                found = np.abs(self._gap(target, self._values(np.array([t]), u[None])[:, 0]))
                for label, gap in zip(self._labels, found, strict=True):
                    if np.isfinite(gap):
                        self.misfit[label] = max(self.misfit[label], float(gap))
                return u
            before = size
        raise SimulationError(
            f"at t = {t:.6g} s no pose of the scene is found that is nearest to the motion: begin "
            "it near the poses as given, and give instants closer to each other"
        )

    def _quantities(self, t: float, u: Floats) -> tuple[Floats, Floats]:
        """Values (labels,) of the quantities, and slopes (labels, 6 n) by central differences."""
        values = self._values(*self._near(t, u))
        return values[:, 0], self._slopes(values)

    def _near(self, t: float, u: Floats) -> tuple[Floats, Floats]:
        """The state and those on both sides of it, of each motion of a body, and their times."""
        one = np.diag(self._spans)
        steps = np.vstack([0.0 * one[:1], one, -one])
        near = np.array([displaced(u, step) for step in steps])
        return np.full(len(near), t), near

    def _slopes(self, values: Floats) -> Floats:
        """Central differences (..., 6 n) of values (..., 12 n + 1) at the states of ``_near``."""
        count = len(self._spans)
        return (values[..., 1 : count + 1] - values[..., count + 1 :]) / (2.0 * self._spans)

    def _of_joints(self, t: float, u: Floats) -> dict[str, Floats]:
        """Slopes (6 n,) of the coordinates of joints, lengths as parts of the model."""
        result, slopes = self._result(*self._near(t, u)), {}
        for joint in result.summary.joint_names:
            with suppress(UnknownNameError):
                found = result.coordinates(joint)
                names = {k: name for name, k in found.aliases.items()}
                for k, unit in enumerate(found.units):
                    size = self.evaluator.model.size if unit == "m" else 1.0
                    name = names.get(k, f"q{k + 1}")
                    slopes[f"{joint}.{name}"] = self._slopes(found.q[:, k]) / size
        return slopes

    def _values(self, t: Floats, u: Floats) -> Floats:
        """(labels, k) the quantities of the data at states (k, 13 n)."""
        result = self._result(t, u)
        return np.array([self._found(result, label) for label in self._labels])

    def _result(self, t: Floats, u: Floats) -> Result:
        """States (k, 13 n) as a result."""
        model, count = self.evaluator.model, len(t)
        nothing = np.zeros(count)
        arrays = Arrays(t, u, np.zeros((count, 6 * model.body_count)),
                        np.zeros((count, model.row_count)), nothing, nothing, nothing, nothing,
                        nothing, np.zeros((count, model.angle_count)),
                        np.tile(self.evaluator.states, (count, 1)),
                        np.tile(model.input_values, (count, 1)))  # fmt: skip
        record = RunMetadata(scene_text=self._scene_text)
        return Result(self._summary, arrays, record, lambda: (model, lambda: self.evaluator))

    def _found(self, result: Result, label: str) -> Floats:
        try:
            quantity = find(result, self.data.quantities[label])
        except UnknownNameError as error:
            raise SceneError([Mistake(f"motion.{label}", MISSING, str(error))]) from error
        if quantity.values.ndim > 1:
            words = f"name one of its components: {', '.join(quantity.columns)}"
            raise SceneError([Mistake(f"motion.{label}", MISSING, words)])
        self._units[label] = quantity.unit
        return quantity.values

    def _gap(self, target: Floats, values: Floats) -> Floats:
        """What is missing to the data, (labels,): of angles the least, whatever their turns."""
        gap = target - values
        turns = [self._units[label] == "rad" for label in self._labels]
        return np.where(turns, gap - 2.0 * np.pi * np.round(gap / (2.0 * np.pi)), gap)

    def _check_columns(self, slopes: Floats) -> None:
        """Refuse quantities that positions do not change: velocities, forces."""
        for label, slope in zip(self._labels, slopes, strict=True):
            size = self._length if self._units[label] == "m" else 1.0
            if words := self.data.unlike(label, self._units[label]):
                raise SceneError([Mistake(f"motion.{label}", MISSING, words)])
            if np.max(np.abs(slope * self._spans)) <= NOTHING * SPAN * size:
                words = (
                    "positions do not change this quantity: a motion is given by positions "
                    "(crank.r.x, rod.p.e1, tip.r.z, spring.length); leave the column out"
                )
                raise SceneError([Mistake(f"motion.{label}", MISSING, words)])

    def _check_seen(self, rows: ChosenRows, seen: Floats, t: float, u: Floats) -> None:
        """Refuse data that leave a freedom open."""
        freedoms = rows.free.shape[1]
        if not freedoms:
            return
        _, values, right = np.linalg.svd(seen) if len(seen) else (0, np.zeros(0), np.eye(freedoms))
        rank = int(np.sum(values > SEEN * max(1.0, np.max(values, initial=0.0))))
        if rank < freedoms:
            motions = rows.free @ right[rank:].T
            joints = self._of_joints(t, u)
            names = ", ".join(coordinates_of(self.evaluator.model, u, motions, joints))
            raise SimulationError(
                f"at t = {t:.6g} s the motion leaves {freedoms - rank} of {freedoms} degrees of "
                f"freedom open: give {names} as well, or other positions that move with the same "
                "bodies"
            )


def misfit_notes(misfit: Mapping[str, float]) -> list[str]:
    """How far data are from the motion, in words."""
    worst = {label: gap for label, gap in misfit.items() if gap > 1e-9}
    if not worst:
        return []
    listed = sorted(worst.items(), key=lambda pair: -pair[1])[:6]
    words = ", ".join(f"{label} by {gap:.3g}" for label, gap in listed)
    return [f"the data do not fit the joints exactly; the motion nearest to them misses {words}"]
