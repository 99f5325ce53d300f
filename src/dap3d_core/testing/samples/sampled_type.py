"""A type, or one of its variants, at random poses on and off the constraint manifold."""

import math
import random
from collections.abc import Callable, Iterator, Mapping
from itertools import product
from typing import Any, TypeVar

import attrs
import numpy as np

from dap3d_core.interface import Function, number
from dap3d_core.interface.codegen.reactions import with_sample_reactions
from dap3d_core.interface.codegen.specialise import bind_friction, bind_functions
from dap3d_core.interface.codegen.terms import bind_terms
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.contacts.resistance import resisting_type
from dap3d_core.interface.contacts.rows import STICKS
from dap3d_core.interface.element_states import unknown_names
from dap3d_core.interface.errors import where_is
from dap3d_core.interface.examine.examine import ATTEMPTS, examine
from dap3d_core.interface.examine.random_values import numbers
from dap3d_core.interface.fields import sized_fields, specs_of
from dap3d_core.kernels.array_types import Floats
from dap3d_core.testing.samples.random_element import Kernels, RandomElement, RefusalError, draw
from dap3d_core.testing.samples.random_state import BODIES, HELD, Direction, State, random_state

Cached = TypeVar("Cached")
#: |C| of an assembled pose; maximal numbers of Newton steps and of starts.
ASSEMBLED, NEWTON_STEPS, STARTS = 1e-11, 40, 12
#: Newton's method has failed where it does not halve |C| in this number of steps.
STALLED = 8
#: Smallest singular value of J, relative to the largest, of an acceptable pose.
SINGULAR = 1e-3
#: Functions that a type which combines functions is given.
TERMS = 3
#: Errors of kernels at poses where they are undefined.
UNDEFINED = (ZeroDivisionError, OverflowError, FloatingPointError)


class UndefinedError(ValueError):
    """The kernels of a type return no finite numbers at any of many random poses."""


@attrs.frozen(eq=False)
class Sample:
    """An element in a state.

    Attributes:
        kernels: of its type.
        element: the instance.
        state: poses and velocities of the bodies.
        grounded: slot j is on ground.
        label: name of the random pose.
        seed: of all poses.
    """

    kernels: Kernels
    element: RandomElement
    state: State
    grounded: bool
    label: str
    seed: int

    def value(self, name: str, state: State | None = None) -> Floats:
        """The value of a kernel, here or in another state."""
        return self.kernels.value(name, self.element, self.state if state is None else state)

    def slope(self, name: str, along: Direction) -> Floats:
        """Its derivative by complex step; a kernel may raise on complex numbers."""
        return self.kernels.slope(name, self.element, self.state, along)

    def rate(self, name: str, along: Direction) -> Floats:
        """Its derivative by complex step, or by differences where a kernel takes floats alone."""
        try:
            return self.slope(name, along)
        except Exception:
            return self.difference(name, along)[0]

    def difference(self, name: str, along: Direction) -> tuple[Floats, Floats]:
        """Its derivative by sixth-order central differences, and an error bound.

        The bound is large where a branch lies among the samples: ten times the difference of two
        step sizes, and of the bend between the sides that does not shrink with the step.
        """
        return self.difference_of(lambda state: self.value(name, state), along)

    def bend(self, along: Direction) -> tuple[Floats, Floats]:
        """The second derivative of C along a direction, and an error bound."""
        return self.difference_of(lambda s: attrs.evolve(self, state=s).rate("C", along), along)

    def difference_of(
        self, value: Callable[[State], Floats], along: Direction
    ) -> tuple[Floats, Floats]:
        """The derivative of a function of the state along a direction, as ``difference``."""
        h, here = 1e-3, value(self.state)
        odd, even = {}, {}
        own = self.kernels.state_rate(self.element, self.state, along)
        for k in (1, 2, 3, 4, 6):
            ahead, back = (value(self._moved(along, own, s * k * h)) for s in (1, -1))
            odd[k], even[k] = ahead - back, np.abs(ahead - 2.0 * here + back) / (k * h)
        one, two = (
            (45.0 * odd[k] - 9.0 * odd[2 * k] + odd[3 * k]) / (60.0 * k * h) for k in (1, 2)
        )
        corner = np.maximum(even[1] - 0.5 * even[4], 0.0)
        return two, 10.0 * (np.abs(one - two) + corner)

    def _moved(self, along: Direction, own: Floats, h: float) -> State:
        """The state after a step along a direction, in which its own states have the rates own."""
        moved = self.state.moved(along, h)
        return attrs.evolve(moved, own=moved.own + h * own) if len(own) else moved

    @property
    def is_good(self) -> bool:
        """True if all kernels return finite numbers, and no switch ends a run here."""
        names = self.kernels.names()
        type_: Any = self.kernels.type_info.type
        if "switch" in names and type_.switch_words and np.min(self.value("switch")) <= 0.0:
            return False
        return all(np.isfinite(self.value(name)).all() for name in names)

    def pose(self) -> dict[str, Any]:
        """The pose by name, for messages."""
        s = self.state
        slots = self.kernels.type_info.layout.slots
        pose: dict[str, Any] = {"seed": self.seed, "pose": self.label, "t": float(s.t)}
        for k, slot in enumerate(slots, start=1):
            pose |= {f"{n}_{slot}": tuple(x[k].tolist()) for n, x in
                      (("r", s.r), ("p", s.p), ("v", s.v), ("w", s.w))}  # fmt: skip
        return pose | {n: v for n, v in self.element.fields.items() if n not in pose}


@attrs.frozen(eq=False)
class SampledType:
    """A type, or a variant of it, with its random samples.

    Attributes:
        type_info: the type or variant, with known functions of an argument.
        choices: values of fields of the variant.
        seed, poses: of the samples, and the number of each sort.
    """

    type_info: TypeInfo
    choices: Mapping[str, Any]
    seed: int
    poses: int
    _cache: dict[str, Any] = attrs.field(factory=dict)

    @property
    def type(self) -> Any:
        """The class."""
        return self.type_info.type

    @property
    def variant(self) -> str:
        """The values of the variant, for users."""
        return ", ".join(f"{n} = {str(v).lower() if isinstance(v, bool) else v}"
                         for n, v in self.choices.items())  # fmt: skip

    @property
    def drawn_choices(self) -> dict[str, Any]:
        """Values of fields that its random elements have in common."""
        specs = specs_of(self.type)
        conditions = dict.fromkeys(self.type_info.argument_functions, True) | dict(self.choices)
        return {n: "cubic" if specs[n].kind == "function" else v for n, v in conditions.items()
                if n in specs and not (specs[n].is_optional or specs[n].by_name)
                and (v is not False or specs[n].kind == "choice")}  # fmt: skip

    @property
    def kernels(self) -> Kernels:
        """Its kernels."""
        return self.cached("kernels", lambda: Kernels(self.type_info))

    @property
    def friction(self) -> "SampledType":
        """The friction of a joint as a separate element."""
        return self.cached(
            "friction",
            lambda: SampledType(bind_friction(self.type_info), self.choices, self.seed, self.poses),
        )

    def resisting(self, how: str) -> "SampledType":
        """What resists rolling ("roll") or spinning ("spin") at a contact, as a separate type."""
        type_info = with_functions(examine(resisting_type(self.type, how)), self.choices)
        return SampledType(type_info, self.choices, self.seed, self.poses)

    @property
    def samples(self) -> list[Sample]:
        """Random poses off the manifold; of elements of two bodies or more the last is on ground.

        Raises:
            UndefinedError: there are none with finite numbers.
        """
        return self.cached("samples", lambda: [self._sample(k) for k in range(self.poses)])

    @property
    def assembled(self) -> list[Sample]:
        """Random poses with C = 0 and velocities with J v = nu; fewer where Newton failed."""
        return self.cached("assembled", lambda: list(self._assembled()))

    def again(self) -> list[Sample]:
        """The samples, drawn anew from the same random numbers."""
        return [self._sample(k) for k in range(self.poses)]

    def cached(self, name: str, make: Callable[[], Cached]) -> Cached:
        """The value of ``make``, computed once for each name."""
        if name not in self._cache:
            self._cache[name] = make()
        return self._cache[name]

    def _sample(self, k: int, start: int = 0) -> Sample:
        title = f"{self.seed} {self.type.__qualname__} {k} {start}"
        rng = random.Random(title)
        layout = self.type_info.layout
        grounded = k == self.poses - 1 > 0 and layout.slots[1:2] == ("j",)
        given = given_rows(self.type_info, lambda: k % 2 == 0 or rng.random() < 0.5)
        given += [False] if self.type.kind == "function" else []  # the row that it fills itself
        reason = "its kernels give no finite numbers"
        for _ in range(ATTEMPTS):
            state = random_state(rng, given, grounded=grounded)
            try:
                element = draw(self.type_info, self.drawn_choices, rng, state)
                state = random_state(rng, given, grounded=grounded)
                count = getattr(self.type, "arguments", 1) - 1  # y of a function of two
                if count := count or len(unknown_names(self.type)):
                    unknowns = np.array([numbers(rng, 2) for _ in range(count)])
                    state = attrs.evolve(state, unknowns=unknowns)
                if layout.states:
                    own = np.array(numbers(rng, layout.state_width))
                    if self.type.is_contact:  # it sticks, so that all of its rows hold
                        own = np.array([STICKS, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
                    state = attrs.evolve(state, own=own)
                sample = Sample(self.kernels, element, state, grounded,
                                f"pose {k + 1} off the manifold", self.seed)  # fmt: skip
                if sample.is_good:
                    return sample
            except RefusalError as error:
                reason = str(error)
            except UNDEFINED:
                continue
        who = where_is(self.type)
        raise UndefinedError(f"{who}: {ATTEMPTS} random elements in a row: {reason}")

    def _assembled(self) -> Iterator[Sample]:
        starts = STARTS
        for k in range(self.poses):
            found = [assembled(self._sample(k, 1))]
            while (found[-1] is None or _is_singular(found[-1])) and len(found) < starts:
                found.append(assembled(self._sample(k, len(found) + 1)))
            starts = 1 if len(found) == STARTS else starts  # further ones would fail as well
            samples = [sample for sample in found if sample is not None]
            if samples:
                yield attrs.evolve(samples[-1], label=f"pose {k + 1} on the manifold")


def sampled_types(type_info: TypeInfo, seed: int, poses: int) -> list[SampledType]:
    """The type itself, unless variants replace it for all values, and its variants."""
    variants = []
    own = own_values(type_info)
    if own is not None:
        variants.append((own, type_info))
    variants += [(dict(conditions), e) for conditions, e in type_info.variants]
    return [
        SampledType(_alone(with_functions(sample, values)), values, seed, poses)
        for values, e in variants
        for sample in _samples(e)
    ]


def _samples(type_info: TypeInfo) -> list[TypeInfo]:
    """The type for some lengths of its lists; itself where it has none."""
    if not sized_fields(type_info.type):
        return [type_info]
    from dap3d_core.interface.examine.sized_types import sample_classes

    return [examine(class_) for class_ in sample_classes(type_info.type)]


def _alone(type_info: TypeInfo) -> TypeInfo:
    """The type with random numbers for what a scene's joints and equations give."""
    if type_info.layout.unknowns:
        from dap3d_core.interface.codegen.unknowns import with_sample_unknowns

        return with_sample_unknowns(type_info)
    return with_sample_reactions(type_info)


def with_functions(type_info: TypeInfo, values: Mapping[str, Any]) -> TypeInfo:
    """The type with a cubic for each function of an argument, unless the variant has none."""
    if any(spec.kind == "functions" for spec in specs_of(type_info.type).values()):
        return bind_terms(type_info, [examine(Cubic)] * TERMS)
    specs = specs_of(type_info.type)
    given = {f: examine(CubicOfTwo if specs[f].arguments > 1 else Cubic)
             for f in type_info.argument_functions if values.get(f, True)}  # fmt: skip
    return bind_functions(type_info, given, dict.fromkeys(given, 0)) if given else type_info


def given_rows(type_info: TypeInfo, is_given: Callable[[], bool]) -> list[bool | str]:
    """For each function of time of a type whether it is given; HELD for an input."""
    specs = specs_of(type_info.type)
    return [
        HELD if specs[name].kind == "input" else is_given() for name in type_info.layout.functions
    ]


def own_values(type_info: TypeInfo) -> dict[str, Any] | None:
    """Values of choices for which no variant replaces the type; None where there are none."""
    specs = specs_of(type_info.type)
    names = [n for n in specs if any(n in conditions for conditions, _ in type_info.variants)]
    without = [(specs[n].is_optional,) * (not specs[n].required) for n in names]
    ways = [specs[n].choices or way for n, way in zip(names, without, strict=True)]
    for values in (dict(zip(names, way, strict=True)) for way in product(*ways)):
        given = {n: v or None if specs[n].is_reference else v for n, v in values.items()}
        if type_info.chosen(given) is type_info:
            return values
    return None


def position_jacobian(sample: Sample) -> Floats:
    """dC/dq (position rows, slots, 6) by complex step, or by differences where that fails."""
    slots = len(sample.kernels.type_info.layout.slots)
    columns = [sample.rate("C", Direction.of(slot, k)) for slot in range(slots) for k in range(6)]
    return np.stack(columns, axis=-1).reshape(len(columns[0]), -1, 6)


def gradient(sample: Sample) -> Floats:
    """(position rows, unknowns) dC/ds by complex step, or by differences where that fails."""
    type_: Any = sample.kernels.type_info.type
    count = len(sample.state.unknowns)
    columns = [sample.rate("C", Direction.of_unknown(k, count)) for k in range(count)]
    return np.stack(columns, axis=1) if count else np.zeros((len(type_.position_rows()), 0))


def gradient_of_rows(sample: Sample) -> Floats:
    """(rows, unknowns) the same, with zeros in the rows of the velocity level."""
    type_: Any = sample.kernels.type_info.type
    whole = np.zeros((type_.rows, len(sample.state.unknowns)))
    if whole.size:
        whole[list(type_.position_rows())] = gradient(sample)
    return whole


def assembled(sample: Sample) -> Sample | None:
    """The sample brought to C = 0 by Newton's method and to J v = nu; None where that fails."""
    kernels, sizes = sample.kernels, [math.inf] * STALLED
    slots = len(kernels.type_info.layout.slots)
    free = [s for s in range(slots) if not (sample.grounded and s == 1)]
    try:
        for _ in range(NEWTON_STEPS if "C" in kernels.names() else 0):
            C = sample.value("C")
            if not np.isfinite(C).all():
                return None
            sizes.append(float(np.max(np.abs(C), initial=0.0)))
            if sizes[-1] < ASSEMBLED:
                break
            if sizes[-1] > 0.5 * sizes[-1 - STALLED]:
                return None
            C_q = position_jacobian(sample)[:, free].reshape(len(C), -1)
            step = -np.linalg.lstsq(np.hstack([C_q, gradient(sample)]), C, rcond=1e-10)[0]
            step *= min(1.0, 0.7 / max(float(np.max(np.abs(step))), 1e-300))
            bodies, unknowns = np.split(step, [C_q.shape[1]])
            whole = np.zeros((BODIES, 6))
            whole[1 + np.array(free)] = bodies.reshape(-1, 6)
            along = Direction(whole[:, :3], whole[:, 3:], unknowns=tuple(unknowns.tolist()))
            sample = attrs.evolve(sample, state=sample.state.moved(along, 1.0))
        else:
            if "C" in kernels.names():
                return None
        J, state = sample.value("J"), sample.state
        nu = sample.value("nu") if "nu" in kernels.names() else np.zeros(J.shape[1])
        x = state.velocities(slots)
        flat = J[free].transpose(1, 0, 2).reshape(J.shape[1], -1)
        flat, count = np.hstack([flat, gradient_of_rows(sample)]), 6 * len(free)
        v = np.concatenate([x[free].ravel(), state.unknowns[:, 1]])
        off = flat @ v - nu
        if not np.isfinite(off).all():  # LAPACK would say so on stderr, in words of its own
            return None
        v -= np.linalg.lstsq(flat, off, rcond=1e-10)[0]
        x[free] = v[:count].reshape(-1, 6)
        unknowns = np.column_stack([state.unknowns[:, 0], v[count:]])
        moving = attrs.evolve(state.with_velocity(x), unknowns=unknowns)
        result = attrs.evolve(sample, state=moving)
        return result if result.is_good else None
    except (*UNDEFINED, np.linalg.LinAlgError):
        return None


def _is_singular(sample: Sample) -> bool:
    """True if the rows of J are nearly dependent."""
    J = sample.value("J")
    rows = np.hstack([J.transpose(1, 0, 2).reshape(J.shape[1], -1), gradient_of_rows(sample)])
    values = np.linalg.svd(rows, compute_uv=False)
    return bool(values[-1] < SINGULAR * values[0])


__all__ = ["Sample", "SampledType", "UndefinedError", "assembled", "own_values", "sampled_types"]


class Cubic(Function):
    """f = a + b x + c x^2 + d x^3."""

    keyword = "cubic"
    a: float = number(doc="coefficient of x^0")
    b: float = number(doc="of x^1")
    c: float = number(doc="of x^2")
    d: float = number(doc="of x^3")

    def value(x: Any, a: Any, b: Any, c: Any, d: Any) -> Any:  # noqa: N805
        f = a + x * (b + x * (c + x * d))
        return f, b + x * (2.0 * c + 3.0 * x * d), 2.0 * c + 6.0 * x * d, 6.0 * d


class CubicOfTwo(Function):
    """f = a + b x + c y + x y (d x + e y), with no two derivatives alike."""

    keyword, arguments = "cubic-of-two", 2
    a: float = number(doc="constant")
    b: float = number(doc="coefficient of x")
    c: float = number(doc="of y")
    d: float = number(doc="of x^2 y")
    e: float = number(doc="of x y^2")

    def value(x: Any, y: Any, a: Any, b: Any, c: Any, d: Any, e: Any) -> Any:  # noqa: N805
        f = a + b * x + c * y + x * y * (d * x + e * y)
        f_x, f_y = b + y * (2.0 * d * x + e * y), c + x * (d * x + 2.0 * e * y)
        return f, f_x, f_y, 2.0 * d * y, 2.0 * (d * x + e * y), 2.0 * e * x
