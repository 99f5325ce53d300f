"""Checks of laws where they have branches, and where bodies rest exactly.

A law that jumps where a condition of ``where`` changes needs a ``switch`` that changes its sign
there: else steps go across the jump. A formula that is derived must have a value where the one that
it is derived from has a slope.
"""

from collections import Counter
from collections.abc import Iterator
from typing import Any, ClassVar

import attrs
import numpy as np

from dap3d_core.interface.derive.derive import missing
from dap3d_core.kernels.array_types import Floats
from dap3d_core.testing.checks.compare import Comparison, body_words
from dap3d_core.testing.checks.findings import CheckOutcome
from dap3d_core.testing.samples.complex_step import Stepped
from dap3d_core.testing.samples.many_numbers import comparisons
from dap3d_core.testing.samples.random_state import BODIES, Direction, State
from dap3d_core.testing.samples.sampled_type import UNDEFINED, Sample, SampledType

#: Kernels that make the motion jump where they do, by kind of type.
LAWS = {"force": ("wrench", "rate"), "joint": ("C", "nu", "gamma", "rate"), "function": ()}
#: Samples whose surroundings are searched, distance on both sides and places on the way.
SAMPLES, REACH, PLACES = 2, 4.0, 65
#: Halvings of an interval in which a condition changes; a jump is more than this part of the law.
HALVINGS, JUMP = 60, 1e-6
#: Two halvings in a row that leave so small a part of a jump show that there is none: what the law
#: changes by beside a jump is halved each time, and can hide it once.
CONTINUOUS = JUMP / 8.0
#: Changes of a condition that are looked at: where it changes its law jumps, or does not.
TRIES = 8
#: A switch changes its sign within this distance of the place.
NEAR = 1e-6
#: A slope is one where its error bound is less than this part of it.
SMOOTH = 1e-4


class ComparedPart(float):
    """A real part that remembers the results of its comparisons."""

    __slots__ = ()
    __hash__ = float.__hash__
    results: ClassVar[list[bool]] = []


class ComparedNumber(Stepped):
    """A number that compares by such a part."""

    __slots__ = ()
    __hash__ = complex.__hash__

    @property
    def real(self) -> ComparedPart:
        """The real part."""
        return ComparedPart(super().real)


def _compared(name: str) -> Any:
    compare = getattr(float, name)

    def method(self: Any, other: Any) -> Any:
        holds = compare(self, other)
        ComparedPart.results.append(bool(holds))
        return holds

    return method


for _name in ("__lt__", "__le__", "__gt__", "__ge__"):
    setattr(ComparedPart, _name, _compared(_name))


def switches(subject: SampledType) -> CheckOutcome:
    """Where a law jumps, a switch changes its sign."""
    words = "a law jumps only where a switch changes its sign"
    c = Comparison("branches", subject, "", words)
    for name in LAWS[subject.type.kind]:
        if name in subject.kernels.names():
            c.kernel = name
            for sample in subject.samples[:SAMPLES]:
                try:
                    finding = _unseen_jump(sample, name)
                except Exception as error:  # of a kernel that takes floats alone
                    c.note(f"{name} was left out: {type(error).__name__}: {error} (see plain)")
                    break
                if finding:
                    c.fail(finding, sample)
                    break
    return c.outcome(sized=False)


def _unseen_jump(sample: Sample, name: str) -> str:
    """The first jump of a law along the directions of its bodies that no switch sees, in words."""
    tried: Counter[int] = Counter()
    for words, along in _directions(sample):
        path = _Path(sample, name, along)
        for place in path.changes(tried):
            close = [x for x in map(path.value, path.bracket(place)) if x is not None]
            if len(close) < 2:
                continue
            jump = np.abs(close[1] - close[0])
            size = 1.0 + float(np.max(np.abs(close)))
            if not np.max(jump) > JUMP * size:
                continue
            sides = [path.switch(place + h) for h in (-NEAR, NEAR)]
            if np.any(sides[0] * sides[1] <= 0.0):
                continue
            there = "no switch is defined"
            if sides[0].size:
                values = ", ".join(f"{x:.4g}" for x in np.ravel(sides[0]))
                there = f"no switch changes its sign there (it is {values})"
            return (
                f"{name} jumps by {np.max(jump):.6g} where a condition of where changes, along "
                f"{words}, and {there}: steps go across the jump. Let switch be zero there, or let "
                "the law change over a small range"
            )
    return ""


def _directions(sample: Sample) -> Iterator[tuple[str, Direction]]:
    """Directions in which the arguments of an element change, in words."""
    layout = sample.kernels.type_info.layout
    is_joint = sample.kernels.type_info.type.kind == "joint"  # its poses are those with C = 0
    turns = not layout.angles  # a counted angle jumps, if its body does, by whole turns
    for slot, letter in enumerate(layout.slots):
        if sample.state.mass[slot + 1] <= 0.0:
            continue  # ground
        for column in range(0 if is_joint else 6 if turns else 3):
            yield body_words(sample, slot, column), Direction.of(slot, column)
        for column in range(6):
            axis, what = "xyz"[column % 3], "angular velocity" if column > 2 else "velocity"
            yield f"the {what} of body {letter} along {axis}", _Speeding.of(slot, column)
    yield "time", Direction.in_time()


class _Speeding(Direction):
    """A direction of velocities: ``move`` and ``turn`` are rates of them."""


class _Path:
    """A kernel along a direction from a sample."""

    def __init__(self, sample: Sample, name: str, along: Direction) -> None:
        self._sample, self._name, self._along = sample, name, along
        self._width = 2.0 * REACH / (PLACES - 1)

    def changes(self, tried: Counter[int]) -> Iterator[float]:
        """Distances at which a condition changes and the law may jump, a few of each condition.

        tried: how often each condition was met, on other ways as well.
        """
        places = np.linspace(-REACH, REACH, PLACES)
        first = self._results(places[0])
        if not first:  # both sides of a where are evaluated: it compares everywhere, or nowhere
            return
        results = self._all_results(places, first)
        for k in range(PLACES - 1):
            one, other = results[k], results[k + 1]
            for which in np.flatnonzero(np.array(one) != np.array(other)):
                tried[int(which)] += 1
                if tried[int(which)] > TRIES:
                    continue
                place = self._located(places[k], places[k + 1], int(which), one[which])
                if place is not None:
                    yield place

    def _located(self, low: float, high: float, which: int, first: bool) -> float | None:
        """Where a condition changes, from behind; None where the law is continuous there."""
        laws = [self._evaluated(low)[0], self._evaluated(high)[0]]
        small = 0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if middle in (low, high):  # neighbouring numbers
                break
            law, results = self._evaluated(middle)
            if results[which] == first:
                low, laws[0] = middle, law
            else:
                high, laws[1] = middle, law
            change, size = np.max(np.abs(laws[1] - laws[0])), 1.0 + np.max(np.abs(laws))
            small = small + 1 if change < CONTINUOUS * size else 0
            if small == 2:
                return None
        return float(high)

    def bracket(self, place: float) -> tuple[float, float]:
        """Distances just before and behind a place."""
        gap = 4.0 * np.finfo(float).eps * (1.0 + abs(place))
        return place - gap, place + gap

    def value(self, x: float) -> Floats | None:
        """The kernel; None where it has no finite value."""
        value = self._sample.kernels.ieee_value(self._name, self._sample.element, self._at(x))
        return value if np.isfinite(value).all() else None

    def switch(self, x: float) -> Floats:
        """The switches of the type; empty where it has none."""
        if "switch" not in self._sample.kernels.names():
            return np.zeros(0)
        return self._sample.value("switch", self._at(x))

    def _evaluated(self, x: float) -> tuple[Floats, list[bool]]:
        """The kernel, and the results of all comparisons that it makes."""
        ComparedPart.results.clear()
        law = self._sample.kernels.value_with(
            ComparedNumber, self._name, self._sample.element, self._at(x)
        )
        return law.astype(complex).real, list(ComparedPart.results)

    def _results(self, x: float) -> list[bool]:
        """Results of all comparisons that the kernel makes."""
        return self._evaluated(x)[1]

    def _all_results(self, places: Floats, first: list[bool]) -> list[list[bool]]:
        """The same at all places, at once where the kernel takes a vector for each number."""
        try:
            with comparisons() as found, np.errstate(all="ignore"):
                self._sample.kernels.value_at_all(
                    self._name, self._sample.element, [self._at(x) for x in places]
                )
        except Exception:  # it branches on a number, as in a search in a long table
            found = []
        results = [[bool(np.ravel(one)[k % one.size]) for one in found] for k in range(len(places))]
        return results if results[0] == first else [first, *map(self._results, places[1:])]

    def _at(self, x: float) -> State:
        state, along = self._sample.state, self._along
        if isinstance(along, _Speeding):
            return attrs.evolve(state, v=state.v + x * along.move, w=state.w + x * along.turn)
        return state.moved(along, x)


def rest(subject: SampledType) -> CheckOutcome:
    """Derived formulas have values at exact rest where the given ones have slopes."""
    words = "derived formulas are finite at rest, at identical poses, at zero length"
    c = Comparison("rest", subject, "", words)
    derived = missing(subject.type, "value" in subject.kernels.names())
    source = {"joint": "C", "force": "energy", "function": "value"}[subject.type.kind]
    names = subject.kernels.names()
    for sample in subject.samples if source in names else ():
        for where, state in _rest_states(sample):
            there = attrs.evolve(sample, state=state)
            for name in (n for n in derived if n in names):
                if np.isfinite(_value(there, name)).all():
                    continue
                c.kernel = name
                text = f"{name} is no finite number {where}"
                if _has_slopes(there, source):
                    c.fail(
                        f"{text}, and {source} is smooth there: guard the formula by where", there
                    )
                else:
                    c.note(f"{text}, where {source} has no slope: no scene can begin there")
    return c.outcome(sized=False)


def _rest_states(sample: Sample) -> Iterator[tuple[str, State]]:
    """States at rest of a sample, with what is special of them."""
    still = attrs.evolve(sample.state.at_rest(), t=0.0)
    yield "at rest", still
    aligned = attrs.evolve(still, p=np.tile((1.0, 0.0, 0.0, 0.0), (BODIES, 1)))
    yield "where no body is turned", aligned
    yield "where all bodies are at the origin", attrs.evolve(aligned, r=np.zeros((BODIES, 3)))
    layout, r = sample.kernels.type_info.layout, np.zeros((BODIES, 3))
    for k, slot in enumerate(layout.slots, start=1):
        if (place := layout.numbers.get(f"P_{slot}")) is not None:
            r[k] = -np.array(sample.element.par[place[0] : place[0] + 3])
    yield "where its points coincide", attrs.evolve(aligned, r=r)


def _has_slopes(sample: Sample, name: str) -> bool:
    """True if a kernel has slopes along all directions, by differences."""
    layout = sample.kernels.type_info.layout
    along = [Direction.of(s, k) for s in range(len(layout.slots)) for k in range(6)]
    for direction in (*along, Direction.in_time()):
        slope, bound = sample.difference_of(lambda state: _value(sample, name, state), direction)
        if not np.all(bound <= SMOOTH * (1.0 + np.abs(slope))):
            return False
    return True


def _value(sample: Sample, name: str, state: State | None = None) -> Floats:
    here = sample.state if state is None else state
    try:
        return sample.kernels.ieee_value(name, sample.element, here)
    except UNDEFINED:
        return np.full(1, np.nan)
