"""Events that a script asks for: what is watched, and what is done where it passes a level."""

from collections.abc import Callable, Collection, Iterable, Sequence
from functools import cached_property
from typing import Any, TypeVar

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.parameter_change import changed
from dap3d_core.model.state_layout import u_from_y
from dap3d_core.registry.suggestions import nearest, some
from dap3d_core.result import Result
from dap3d_core.simulation.compiled_model import CompiledModel

Kind = TypeVar("Kind")
ACTIONS = ("stop", "record")
#: Samples of an event in a run, some minutes, that ``every`` may require.
MAX_SAMPLES = 1e6
#: Velocities of a body that an event may set, and where they lie among its six.
VELOCITIES = {"r_dot": slice(0, 3), "w": slice(3, 6)}


@attrs.frozen
class Event:
    """Something to look out for: a number that passes a level.

    It is found where it passes, not where it stands: a run that starts beyond the level goes on.

    Attributes:
        of: a quantity by its name in results, one number (``crank.r.z``); or a function of t and
            the ``Instant`` that returns a number.
        below, above: the level, passed downwards or upwards; at most one of below, above, at.
        at: the level, passed in the given direction; by default 0.
        direction: +1 upwards, -1 downwards, 0 both.
        action: "record" notes the instant in ``result.events``; "stop" ends the run there as well;
            a function is called with the ``Instant`` there, and may change numbers of forces,
            velocities of bodies, states of elements and inputs (``Instant.set``), end joints
            and let them hold again (``Instant.release``, ``Instant.engage``).
        name: what it is called in the result; made from the rest where it is left out.
        every: s, the largest distance of two looks at it; by default as its values ask for it.

    Raises:
        ValueError: several levels, one that is no finite number, an action or direction that does
            not exist, or an ``every`` that is no positive time.
        TypeError: ``of`` is neither a name nor a function.
    """

    of: str | Callable[[float, "Instant"], float]
    below: float | None = attrs.field(default=None, kw_only=True)
    above: float | None = attrs.field(default=None, kw_only=True)
    at: float | None = attrs.field(default=None, kw_only=True)
    direction: int = attrs.field(default=0, kw_only=True)
    action: str | Callable[["Instant"], object] = attrs.field(default="record", kw_only=True)
    name: str = attrs.field(default="", kw_only=True)
    every: float | None = attrs.field(default=None, kw_only=True)

    def __attrs_post_init__(self) -> None:
        given = [n for n in ("below", "above", "at") if getattr(self, n) is not None]
        if len(given) > 1:
            raise ValueError(f"an event has one level, not {' and '.join(given)}")
        of: Any = self.of
        if not isinstance(of, str) and not callable(of):
            words = "an event watches a quantity by its name, or a function of t and the instant"
            raise TypeError(f"{words}, not {of!r}")
        if not _is_number(self.level):
            raise ValueError(f"the level of an event is a finite number, not {self.level!r}")
        if self.every is not None and not (_is_number(self.every) and self.every > 0.0):
            raise ValueError(f"every is {self.every!r}; it should be a positive number of seconds")
        if self.direction not in (-1, 0, 1):
            raise ValueError(f"direction is {self.direction!r}; it should be -1, 0 or 1")
        if self.direction and self.sense != self.direction:
            raise ValueError(f"{given[0]} has a direction of its own; leave direction out")
        if not callable(self.action) and self.action not in ACTIONS:
            words = f"action is {self.action!r}; it should be 'stop', 'record' or a function"
            raise ValueError(words)

    @property
    def level(self) -> float:
        """The number that is passed."""
        return next((x for x in (self.below, self.above, self.at) if x is not None), 0.0)

    @property
    def sense(self) -> int:
        """+1 upwards, -1 downwards, 0 both."""
        if self.below is not None:
            return -1
        return 1 if self.above is not None else self.direction

    @property
    def title(self) -> str:
        """Title of the event."""
        if self.name:
            return self.name
        of = self.of if isinstance(self.of, str) else getattr(self.of, "__name__", "event")
        way = {-1: "below", 0: "through", 1: "above"}[self.sense]
        return f"{of} {way} {self.level:g}"

    def value(self, instant: "Instant") -> float:
        """Difference of the watched number and its level.

        Raises:
            ValueError: it is not one finite number.
        """
        of = self.of
        found = instant[of] if isinstance(of, str) else of(instant.t, instant)
        if np.ndim(found):
            raise ValueError(f"event {self.title}: it should be one number, not {np.shape(found)}")
        if not _is_number(found):
            truth = isinstance(found, (bool, np.bool_))
            remedy = "; return a number that changes its sign where the event is" if truth else ""
            raise ValueError(
                f"event {self.title}: it should be a finite number, not {found!r}, at "
                f"t = {instant.t:.9g} s{remedy}"
            )
        return float(found) - self.level


def _is_number(value: Any) -> bool:
    """True for one finite real number; a truth value is none."""
    number = np.asarray(value)
    return number.dtype.kind in "iuf" and not number.shape and bool(np.isfinite(number))


def check_every(events: Sequence[Event], t_end: float) -> None:
    """Check that a run to t_end does not sample an event without end.

    Raises:
        ValueError: the ``every`` of an event is too short for the run.
    """
    least = t_end / MAX_SAMPLES
    for event in events:
        if event.every is not None and event.every < least:
            raise ValueError(
                f"event {event.title}: every = {event.every:g} s would sample it "
                f"{t_end / event.every:.3g} times in a run of {t_end:g} s; every should be at "
                f"least {least:g} s. Leave it out: an event is sampled as closely as it changes"
            )


def checked_events(events: Any, bodies: Collection[str]) -> tuple[Event, ...]:
    """The events of a run.

    Args:
        events: as given.
        bodies: names of the bodies, whose roll and yaw at one instant lack whole turns: where they
            step from pi to -pi they would pass every level.

    Raises:
        TypeError: they are not several ``Event``.
        ValueError: one watches roll or yaw.
    """
    found = several(events, Event, "events")
    for event in found:
        body, _, angle = event.of.rpartition(".") if isinstance(event.of, str) else ("", "", "")
        if angle in ("roll", "yaw") and body in bodies:
            raise ValueError(
                f"event {event.title}: {event.of} steps by a turn at pi, past every level; "
                "watch the angle of a joint, which counts turns, or a function such as "
                f'lambda t, s: math.sin(s["{event.of}"] - level)'
            )
    return found


def several(given: Any, kind: type[Kind], argument: str) -> tuple[Kind, ...]:
    """The objects that an argument lists.

    Raises:
        TypeError: they are not several of this kind.
    """
    name = f"dap.{kind.__name__}"
    if isinstance(given, kind):
        single = argument.removesuffix("s")
        raise TypeError(f"{argument} is a list of {name}; write [{single}] for a single one")
    found = tuple(given) if isinstance(given, Iterable) else (given,)
    for one in found:
        if not isinstance(one, kind):
            raise TypeError(f"{argument} is a list of {name}, not of {one!r}")
    return found


class Instant:
    """A state in the course of a run.

    Attributes:
        t: s.
        u: (13 n,) the state, read-only, in the order of ``Result.u``.
    """

    def __init__(
        self,
        compiled: CompiledModel,
        t: float,
        y: Floats,
        numbers: "Numbers",
        complete: Callable[[Floats], None],
    ) -> None:
        """Args: the model, time, the integrated state, numbers that may be changed; what completes
        rows of reports, as of ``Integration``.
        """
        self._compiled, self._y, self._numbers = compiled, y, numbers
        self._complete = complete
        self.t = t
        self._body_state = numbers.evaluator.body_state(y)
        u = u_from_y(self._body_state[None], compiled.model.state_count)[0]
        u.flags.writeable = False
        self.u: Floats = u
        self.changes: dict[str, dict[str, Any]] = {}
        #: number of a body, from 0 -> (6,) velocities that it is to have, NaN where any
        self.velocities: dict[int, Floats] = {}
        #: first place of a state of an element -> its new numbers
        self.states: dict[int, Floats] = {}
        #: number of an input -> its new value
        self.inputs: dict[int, float] = {}
        #: joints that end here, and that hold again
        self.released: list[str] = []
        self.engaged: list[str] = []

    def __getitem__(self, name: str) -> Any:
        """A quantity by its name in results: a number, or (components,).

        Raises:
            UnknownNameError: there is no such quantity.
        """
        values = self._result.quantity(name).values[0]
        return values if np.ndim(values) else float(values)

    def set(self, name: str, **fields: Any) -> None:
        """Change numbers of a force or an input from here on, velocities or states here.

        All that holds in this run alone. Velocities and states are set together when the action has
        returned: by impulses on these bodies, with the joints held, so that the velocities of all
        others follow (docs/how-to/jumps.md).

        Args:
            name: of the force, body, joint or input.
            fields: of a force field -> new value, a number, three numbers or a matrix; of a force
                or joint state -> new value, a number or as many as it has; of a body ``r_dot``,
                ``w``: three numbers in global axes, None for one that the joints give; of an input
                ``value``, a number.

        Raises:
            ValueError: there is no such element or field, or the value is not allowed.
        """
        bodies, inputs = self._compiled.model.body_names, self._compiled.model.input_names
        numbers = {n: value for n, value in fields.items() if not self._set_state(name, n, value)}
        if name in bodies and (numbers.keys() <= VELOCITIES.keys() or not self._has_force(name)):
            self._set_velocities(name, bodies.index(name), numbers)
            fields = {field: list(value) for field, value in fields.items()}
        elif name in inputs and not self._has_force(name):
            self._set_input(name, inputs.index(name), numbers)
        elif numbers:
            self._numbers.set(name, numbers)
        self.changes.setdefault(name, {}).update(fields)

    def release(self, joint: str) -> None:
        """End a joint that has ``breaks_at``, for the rest of this run or until it is engaged.

        Raises:
            ValueError: there is no such joint, it has no ``breaks_at``, or it has ``active``.
        """
        self._check_released(joint)
        self.released.append(joint)

    def engage(self, joint: str) -> None:
        """Let a joint that has ended hold again.

        Its bodies are to stand as it wants them, within 1e-6 of the scene's length; velocities jump
        onto its rows by impulses in it and in other joints, which take energy.

        Raises:
            ValueError: as of ``release``.
        """
        self._check_released(joint)
        self.engaged.append(joint)

    def _check_released(self, joint: str) -> None:
        model = self._compiled.model
        breaks = [name for name in model.breaks if name not in model.active]
        if joint in model.active:
            raise ValueError(f"joint {joint} is active by {model.active[joint].text!r}; release "
                             "and engage it by an input there, which the event sets")  # fmt: skip
        if joint not in breaks:
            known = f"there are {some(breaks, 20)}" if breaks else "there are none"
            raise ValueError(
                f"{joint!r} is no joint that may be released: {known}; give it breaks_at, inf "
                "where it never breaks by itself"
            )

    def _set_state(self, element: str, name: str, value: Any) -> bool:
        """Set a state of an element; False where it has none of this name."""
        for state in self._compiled.model.element_states:
            if (state.element, state.name) == (element, name):
                break
        else:
            return False
        numbers = np.atleast_1d(np.asarray(value, dtype=object))
        if numbers.shape != (state.length,) or not all(map(_is_number, numbers)):
            wanted = "a finite number" if state.length == 1 else f"{state.length} finite numbers"
            raise ValueError(f"{element}.{name} = {value!r} should be {wanted}")
        self.states[state.first] = numbers.astype(float)
        return True

    def _set_input(self, name: str, index: int, fields: dict[str, Any]) -> None:
        for field, value in fields.items():
            if field != "value":
                raise ValueError(f"an input has a value; {name}.{field} does not exist")
            if not _is_number(value):
                raise ValueError(f"{name}.value = {value!r} should be a finite number")
            self.inputs[index] = float(value)

    def _has_force(self, name: str) -> bool:
        return name in self._compiled.model.force_names

    def _set_velocities(self, name: str, body: int, fields: dict[str, Any]) -> None:
        velocities = self.velocities.get(body, np.full(6, np.nan))
        for field, value in fields.items():
            if field not in VELOCITIES:
                words = f"an event sets {' and '.join(VELOCITIES)} of a body"
                raise ValueError(f"{words}; {name}.{field} stays as it is in a run")
            parts = list(value) if np.ndim(value) == 1 else []
            if len(parts) != 3 or not all(x is None or _is_number(x) for x in parts):
                words = "three finite numbers, None for one that the joints give"
                raise ValueError(f"{name}.{field} = {value!r} should be {words}")
            velocities[VELOCITIES[field]] = [np.nan if x is None else x for x in parts]
        self.velocities[body] = velocities

    @cached_property
    def _result(self) -> Result:
        from dap3d_core.simulation.output.check_outputs import instant_of

        text, evaluator = self._compiled.scene_text, self._numbers.evaluator
        return instant_of(text, evaluator, self.t, self._y, self._complete)


class Numbers:
    """The numbers of the forces of a compiled model; what was changed can be put back.

    Attributes:
        evaluator: that has them.
        given: those of the scene, once they were changed; else None.
    """

    def __init__(self, compiled: CompiledModel, evaluator: Evaluator) -> None:
        self._compiled, self.evaluator = compiled, evaluator
        self.given: Floats | None = None

    def set(self, force: str, fields: dict[str, Any]) -> None:
        """As ``Instant.set``."""
        model, par = self._compiled.model, self.evaluator.system.par
        names = model.force_names
        if force not in names:
            known = (*names, *model.body_names, *model.input_names)
            near = nearest(force, known)
            hint = f"did you mean {near!r}?" if near else f"there are {some(known, 20)}"
            raise ValueError(f"there is no force, body or input {force!r}; {hint}")
        change = changed(self._compiled.checked, model, names.index(force), fields)
        if self.given is None:
            self.given = par.copy()
        count, width = change.group.numbers.shape
        first = self._first(change.group)
        table = par[first : first + count * width].reshape(count, width)
        rows = table[change.places]
        rows[change.where] = change.new[change.where]
        table[change.places] = rows

    def changeable(self, forces: Collection[str]) -> NDArray[np.bool_]:
        """Mask of the numbers in ``par`` that ``set`` may have changed, given names of forces."""
        model = self._compiled.model
        found = np.zeros(len(self.evaluator.system.par), dtype=bool)
        numbers = [k for k, name in enumerate(model.force_names) if name in forces]
        for group in (*model.forces, *model.friction):
            changes = np.zeros(group.numbers.shape, dtype=bool)
            changes[np.isin(group.members, numbers)] = True
            for instance, offset, _ in group.tables:
                changes[instance, offset : offset + 2] = False
            if changes.any():
                first = self._first(group)
                found[first : first + changes.size] |= changes.ravel()
        return found

    def put_back(self) -> None:
        """Make the numbers those of the scene again."""
        if self.given is not None:
            self.evaluator.system.par[:] = self.given
            self.given = None

    def _first(self, group: Any) -> int:
        evaluator = self.evaluator
        q = next(k for k, (_, g) in enumerate(evaluator.loop_groups) if g is group)
        return int(evaluator.system.groups[q, 1])
