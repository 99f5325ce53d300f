"""States that a run starts from in place of the scene's: of a result at an instant, at rest."""

from collections.abc import Mapping
from numbers import Real
from typing import Any, Protocol

import attrs
import numpy as np

from dap3d_core.interface import PluginError
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Model, ModelError, build_model
from dap3d_core.model.joint_angles import JOINT_ANGLES
from dap3d_core.model.rotations import angular_velocities, euler_rates
from dap3d_core.model.state_layout import join, split
from dap3d_core.registry.suggestions import nearest, some
from dap3d_core.result import Result, information
from dap3d_core.scene import Mistake, Scene, SceneError, ValidatedScene, parse
from dap3d_core.scene import check as validate
from dap3d_core.scene.errors import shown

#: A time is a reported one if it differs from it by this part of the result's span.
SAME_TIME = 1e-12


@attrs.frozen(eq=False)
class StartState:
    """A state of a model to start from.

    Attributes:
        u: (13 n,) the state.
        angles: (angles,) angles whose turns are counted, in the order of the model; None where
            turns begin at zero.
        notes: where it comes from.
        is_interpolated: it is near the constraints, and has to be brought onto them.
        states: (s,) states of elements, in the order of the model; None for their initial values.
        ended: joints that hold no more, of those that may break.
    """

    u: Floats
    angles: Floats | None
    notes: tuple[str, ...] = ()
    is_interpolated: bool = False
    states: Floats | None = None
    ended: tuple[str, ...] = ()


@attrs.frozen(eq=False)
class NamedState:
    """A state of bodies by name, of whatever scene.

    Attributes:
        title: its source, for messages.
        body_names: (n,) in the order of the state.
        u: (13 n,) the state.
        angles: name (``Model.angle_names``) -> angle whose turns are counted, rad.
        notes, is_interpolated, ended: as of ``StartState``.
        states: name (``ModelSummary.state_names``) -> state of an element.
        given: input, or force.field -> value that a script had given it.
    """

    title: str
    body_names: tuple[str, ...]
    u: Floats
    angles: Mapping[str, float]
    notes: tuple[str, ...] = ()
    is_interpolated: bool = False
    states: Mapping[str, float] = attrs.field(factory=dict)
    ended: tuple[str, ...] = ()
    given: Mapping[str, Any] = attrs.field(factory=dict)


class HasNamedState(Protocol):
    """An equilibrium."""

    @property
    def state(self) -> NamedState:
        """Its state."""


#: What a run can start from: a word of the setting ``start``, a result, a result and a time (None
#: for its end), an equilibrium.
Start = str | Result | tuple[Result, float | None] | HasNamedState | StartState


def start_state(start: Any, model: Model, checked: ValidatedScene) -> StartState:
    """The state that a start means for a model whose bodies have the same names.

    start: a result, a result and a time, an equilibrium, or a state of the model.

    Raises:
        SceneError: it is nothing of these, a body is missing in it, the result is empty, or has no
            such time; its key is ``start``.
    """
    if isinstance(start, StartState):
        return start
    if isinstance(start, Result):
        start = start, None
    named: Any
    if isinstance(start, tuple) and len(start) == 2 and isinstance(start[0], Result):
        named = _state_of_result(*start, model, checked)
    else:
        named = getattr(start, "state", None)
    if not isinstance(named, NamedState):
        raise _mistake(
            type(start).__name__,
            'should be a result, (result, time), an equilibrium, "scene" or "equilibrium"',
        )
    return _matched(named, model, checked.scene)


def _mistake(value: Any, what: str) -> SceneError:
    return SceneError([Mistake("start", value, what)])


def _matched(named: NamedState, model: Model, scene: Scene) -> StartState:
    """The state of the model's bodies."""
    place = {body: k for k, body in enumerate(named.body_names)}
    missing = [body for body in model.body_names if body not in place]
    if missing:
        near = [f"{body} (nearest: {near})" if (near := nearest(body, list(place))) else body
                for body in missing]  # fmt: skip
        noun = "body" if len(missing) == 1 else "bodies"
        raise _mistake(
            named.title,
            f"it is of another scene: it has no {noun} {some(near)}; its bodies are "
            f"{some(list(place))}",
        )
    notes = list(named.notes)
    unused = [body for body in place if body not in model.body_names]
    if unused:
        listed = some(unused)
        notes.append(f"bodies of the start that the scene does not have: {listed}")
    index = [place[body] for body in model.body_names]
    r, p, v, w = split(named.u)
    u = join(r[index], p[index], v[index], w[index])
    names = model.angle_names
    uncounted = sorted({
        n.rpartition(".")[0].replace(JOINT_ANGLES, "joints.") for n in names
        if n not in named.angles
    })  # fmt: skip
    if uncounted:
        listed = some(uncounted)
        notes.append(f"turns are counted from zero, for the start has none: {listed}")
    angles = np.array([named.angles.get(name, 0.0) for name in names]) if names else None
    labels = model.state_labels
    if missing := sorted({n.rpartition(".")[0] for n in labels if n not in named.states}):
        listed = some(missing)
        notes.append(f"states begin with their initial values, for the start has none of {listed}")
    given = zip(labels, model.initial_states.tolist(), strict=True)
    states = np.array([named.states.get(n, value) for n, value in given]) if labels else None
    notes += _numbers_notes(named, model, scene)
    return StartState(u, angles, tuple(notes), named.is_interpolated, states, _ended(named, model))


def _numbers_notes(named: NamedState, model: Model, scene: Scene) -> list[str]:
    """That the run does not begin with the inputs and numbers of forces that a script had set."""
    own: dict[str, Any] = dict(zip(model.input_names, model.input_values.tolist(), strict=True))
    for name in named.given:
        force, _, field = name.rpartition(".")
        if force in scene.forces:
            own[name] = scene.forces[force].fields.get(field)
    others = [f"{name} ({shown(value)}, here {shown(own[name])})"
              for name, value in named.given.items()
              if name in own and not np.array_equal(value, own[name])]  # fmt: skip
    if not others:
        return []
    return [
        "the run begins with the inputs and numbers of forces of the scene; where it starts, "
        f"scripts had given {named.title} others: {some(others)}"
    ]


def _ended(named: NamedState, model: Model) -> tuple[str, ...]:
    """The joints of a model that do not hold at the state."""
    ended = tuple(joint for joint in named.ended if joint in model.joint_names)
    for joint in ended:
        if joint not in model.breaks:
            raise _mistake(
                named.title,
                f"joint {joint} does not hold there: leave it out of the scene, or give it a force "
                "that it breaks at (breaks_at)",
            )
    return ended


def _state_of_result(result: Result, t: Any, model: Model, checked: ValidatedScene) -> NamedState:
    """The state of a result at a time, s; None for its end.

    Between two reported instants it is interpolated: r, p by polynomials of degree five through
    positions, velocities and accelerations at both, the velocities by their derivatives.
    """
    title = result.record.title or "the result"
    if not len(result.t):
        raise _mistake(title, "the result holds no instant: nothing can start from it")
    before, after, fraction = _interval(result, t)
    time = float(result.t[before] + fraction * (result.t[after] - result.t[before]))
    notes = [information(f"the start is the state of {title} at t = {time:.9g} s; the run begins "
             "at t = 0, and so do functions of time")]  # fmt: skip
    if before != after:
        _refuse_between(result, before, after)
        notes.append(
            information(
                f"the start was interpolated between the reported instants "
                f"{result.t[before]:.9g} s and {result.t[after]:.9g} s of the result"
            )
        )
    angles: dict[str, float] = {}
    if model.angle_count and result.summary.angle_count:
        values = (1.0 - fraction) * result.arrays.angles[before]
        values = values + fraction * result.arrays.angles[after]
        names = result.summary.angle_names or _angle_names_of(result, checked)
        angles = dict(zip(names, values.tolist(), strict=False))  # none where they are not known
    u = _state_at(result, before, after, fraction)
    states = _states_at(result, before, after, fraction)
    own = parse(result.scene_text).inputs if result.summary.input_names else {}
    inputs = zip(result.summary.input_names, result.inputs[before].tolist(), strict=True)
    given = {name: value for name, value in inputs if value != own[name].value}
    ended: dict[str, bool] = {}
    for event in result.events:
        if event.t <= time and event.kind in ("break", "engage"):
            ended |= dict.fromkeys(
                event.name.removeprefix("joint ").split(", "), event.kind == "break"
            )
    return NamedState(title, result.summary.body_names, u, angles, tuple(notes),
                      before != after, states, tuple(n for n, has in ended.items() if has),
                      given | set_by_events(result, time))  # fmt: skip


def set_by_events(result: Result, t: float) -> dict[str, Any]:
    """Numbers of forces that events of a script had set by a time, force.field -> value."""
    return {
        f"{force}.{field}": value
        for event in result.events if event.t <= t
        for force, fields in event.changes.items() for field, value in fields.items()
    }  # fmt: skip


def _states_at(result: Result, before: int, after: int, fraction: float) -> dict[str, float]:
    """States of elements by name; between reported instants by a cubic through the nearest."""
    names = result.summary.state_names
    if not names or before == after:
        values = result.arrays.states[before] if names else np.zeros(0)
        return dict(zip(names, values.tolist(), strict=True))
    near = np.arange(max(0, before - 1), min(len(result.t), after + 2))
    t = result.t[near]
    time = result.t[before] + fraction * (result.t[after] - result.t[before])
    weights = [np.prod([(time - s) / (x - s) for s in t if s != x]) for x in t]
    values = np.array(weights) @ result.arrays.states[near]
    return dict(zip(names, values.tolist(), strict=True))


def _refuse_between(result: Result, before: int, after: int) -> None:
    """SceneError where nothing leads across from one reported instant to the next.

    Velocities jump there, or a body turns by more than half a turn: the counted angles say so where
    it rests at both.
    """
    first, last = float(result.t[before]), float(result.t[after])
    between = f"between the reported instants {first:.9g} s and {last:.9g} s"
    remedy = "give one of these as the time of the start"
    title = result.record.title or "the result"
    for jump in result.events:
        if jump.u_after is not None and first < jump.t <= last:
            raise _mistake(title, f"velocities jumped at t = {jump.t:.9g} s, {between}; {remedy}")
    speed = np.linalg.norm(result.w[[before, after]], axis=-1).max(axis=0)
    fastest = int(np.argmax(speed))
    turn = np.abs(result.arrays.angles[after] - result.arrays.angles[before])
    if speed[fastest] * (last - first) > np.pi:
        turns = f"{result.summary.body_names[fastest]} turns at {speed[fastest]:.3g} rad/s,"
    elif turn.max(initial=0.0) > np.pi:
        turns = f"an angle changes by {turn.max():.3g} rad,"
    else:
        return
    raise _mistake(
        title,
        f"{turns} by more than half a turn {between}: the pose is not known there; {remedy}, or "
        "report more often",
    )


def _interval(result: Result, t: Any) -> tuple[int, int, float]:
    """The reported instants before and after a time, and the fraction between them."""
    times, last = result.t, len(result.t) - 1
    if t is None:
        return last, last, 0.0
    if isinstance(t, (bool, np.bool_)) or not isinstance(t, Real) or not np.isfinite(float(t)):
        raise _mistake(t, "the time of a start is a number of seconds")
    t = float(t)
    first, end = float(times[0]), float(times[-1])
    margin = SAME_TIME * max(abs(first), abs(end))
    if not first - margin <= t <= end + margin:
        raise _mistake(t, f"the result reaches from t = {first:.9g} s to {end:.9g} s")
    k = int(np.argmin(np.abs(times - t)))
    if abs(times[k] - t) <= margin:
        return k, k, 0.0
    k = int(np.searchsorted(times, t)) - 1
    return k, k + 1, float((t - times[k]) / (times[k + 1] - times[k]))


def _state_at(result: Result, before: int, after: int, fraction: float) -> Floats:
    """The state (13 n,) of a result between two reported instants."""
    if before == after:
        return np.array(result.u[before])
    h = float(result.t[after] - result.t[before])
    ends = []
    for k in (before, after):
        r, p, v, w = split(result.u[k])
        a = result.v_dot[k].reshape(-1, 6)
        p_dot = euler_rates(p, w)
        p_ddot = euler_rates(p, a[:, 3:]) + euler_rates(p_dot, w)
        ends.append((np.hstack([r, p]), np.hstack([v, p_dot]), np.hstack([a[:, :3], p_ddot])))
    q, q_dot = _quintic(ends[0], ends[1], h, fraction)
    p, p_dot = q[:, 3:], q_dot[:, 3:]
    length = np.linalg.norm(p, axis=1, keepdims=True)
    w = angular_velocities(p, p_dot) / length**2
    return join(q[:, :3], p / length, q_dot[:, :3], w)


def _quintic(
    start: tuple[Floats, Floats, Floats], end: tuple[Floats, Floats, Floats], h: float, s: float
) -> tuple[Floats, Floats]:
    """Value and derivative at fraction s of the polynomial with given derivatives at both ends."""
    (x, v, a), (y, w, b) = start, end
    d = y - x - h * v - 0.5 * h * h * a
    e = h * (w - v - h * a)
    f = h * h * (b - a)
    c3, c4, c5 = 10 * d - 4 * e + 0.5 * f, -15 * d + 7 * e - f, 6 * d - 3 * e + 0.5 * f
    value = x + s * (h * v + s * (0.5 * h * h * a + s * (c3 + s * (c4 + s * c5))))
    slope = v + (s * h * h * a + s * s * (3 * c3 + s * (4 * c4 + s * 5 * c5))) / h
    return value, slope


def _angle_names_of(result: Result, checked: ValidatedScene) -> tuple[str, ...]:
    """Names of the angles of a result, from its scene: nothing is compiled. None if it has types
    that are not installed.
    """
    try:
        other = validate(parse(result.scene_text), checked.registry)
        names = build_model(other).angle_names
    except (SceneError, PluginError, ModelError):
        return ()
    return names if len(names) == result.summary.angle_count else ()
