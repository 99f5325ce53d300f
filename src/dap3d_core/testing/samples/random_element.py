"""A random instance of a type, and its kernels in plain Python and compiled.

A kernel is run by its group loop: in plain Python on numbers of any kind, and compiled.
"""

import random
import warnings
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.interface.codegen.compile_loops import write
from dap3d_core.interface.codegen.instance_layout import ANGLE_WIDTH, size
from dap3d_core.interface.codegen.loop_source import LOOP_KINDS, kernels_of
from dap3d_core.interface.codegen.reactions import sample_size
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.errors import where_is
from dap3d_core.interface.examine.constants import prepared, set_ends
from dap3d_core.interface.examine.random_values import numbers, random_field
from dap3d_core.interface.fields import FieldSpec, specs_of
from dap3d_core.interface.types import BodyPose, pose
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.function_lists import LoopArrays, call_loop, loop_list
from dap3d_core.kernels.runtime.loop_modules import build, source_of
from dap3d_core.testing.samples.complex_step import STEP, Stepped
from dap3d_core.testing.samples.many_numbers import Many
from dap3d_core.testing.samples.random_state import BODIES, State

#: The loop of each kernel; J of a force is computed with its impulse.
LOOP_OF = {kernel: kind for kind, kernels in LOOP_KINDS.items() for kernel in kernels}
LOOP_OF["J"] = "acceleration"
#: Kernels of the jumps of a force; those of jumps that take which switches have crossed.
OF_JUMPS = ("J", "impulse")
JUMPING = frozenset(("impulse", "reset"))
#: Probability that an optional number, point or function is left out.
LEFT_OUT = 0.3


class RefusalError(ValueError):
    """A type refuses the random values of its fields, in its own words."""


@attrs.frozen(eq=False)
class RandomElement:
    """An instance: its numbers as a group loop reads them.

    Attributes:
        fields: values of its fields, for messages.
        idx: bodies of its slots (1, 2, 3), rows of functions, bodies of vectors, first state,
            row, blocks.
        par: its numbers, followed by tables.
        lam: multipliers, for the friction of a joint; reactions that a force reads.
    """

    fields: Mapping[str, Any]
    idx: tuple[int, ...]
    par: tuple[float, ...]
    lam: tuple[float, ...]


@attrs.frozen(eq=False)
class Kernels:
    """The kernels of a type, or of a variant, for elements in a state.

    Attributes:
        type_info: the type, with known functions of an argument.
        crossing: of all switches, for jumps: +1 or -1 where they have crossed to that side, or 0.
    """

    type_info: TypeInfo
    crossing: float = 1.0
    _plain: dict[str, Any] = attrs.field(factory=dict)
    _compiled: dict[str, Any] = attrs.field(factory=dict)

    def names(self) -> tuple[str, ...]:
        """Names of the kernels; a joint's friction is a separate element."""
        kernels = self.type_info.kernels
        return tuple(n for n in kernels if n != "friction" or len(kernels) == 1)

    def value(self, name: str, element: RandomElement, state: State) -> Floats:
        """The value of a kernel, as an array of its rows.

        C (position rows,), G (position rows, unknowns), C_dot (velocity rows,), J (slots, rows, 6),
        gamma and nu (rows,), wrench and friction (slots, 2, 3), energy (1,), switch (n,), value
        (4,) or (6,), rate and reset (states,), impulse (rows,) or (slots, 2, 3).
        """
        body, table = state.body().astype(object), state.table().astype(object)
        own = state.own.astype(object)
        return self._run(name, element, float(state.t), body, table, own).astype(float)

    @np.errstate(all="ignore")  # as compiled code does
    def ieee_value(self, name: str, element: RandomElement, state: State) -> Floats:
        """The same by IEEE arithmetic: what is undefined is infinite or no number."""
        arrays = state.body(), state.table(), state.own
        return self._run(name, element, np.float64(state.t), *arrays).astype(float)

    def value_with(
        self, number: Any, name: str, element: RandomElement, state: State
    ) -> NDArray[Any]:
        """The same of numbers of a class, which is called with each."""
        to_numbers = np.frompyfunc(number, 1, 1)
        body = state.body()[: len(self.type_info.layout.slots) + 1]  # no other row is read
        arrays = (to_numbers(x) for x in (body, state.table(), state.own.astype(object)))
        return self._run(name, element, number(state.t), *arrays)

    def value_at_all(
        self, name: str, element: RandomElement, states: Sequence[State]
    ) -> NDArray[Any]:
        """The same of numbers of many instances, of all states at once."""
        count = len(self.type_info.layout.slots) + 1
        parts = [(x.body()[:count], x.table(), x.own) for x in states]
        t = Many(np.array([[x.t] for x in states]))
        return self._run(name, element, t, *map(_of_all, zip(*parts, strict=True)))

    def state_rate(self, element: RandomElement, state: State, along: Any) -> Floats:
        """The rates of the element's states along a direction."""
        rate = np.zeros(len(state.own))
        if len(along.own):
            rate += along.own
        if along.time and len(rate) and "rate" in self.type_info.kernels:
            rate += along.time * self.value("rate", element, state)
        return rate

    def slope(self, name: str, element: RandomElement, state: State, along: Any) -> Floats:
        """The derivative of a kernel along a direction, by complex step.

        Raises:
            Exception: of a kernel that does not take complex numbers.
        """
        body = _stepped(state.body(), state.body_rate(along))
        table = _stepped(state.table(), state.table_rate(along))
        own = _stepped(state.own, self.state_rate(element, state, along))
        value = self._run(name, element, Stepped(state.t, STEP * along.time), body, table, own)
        slopes = [x.imag / STEP if isinstance(x, complex) else 0.0 for x in value.ravel()]
        return np.array(slopes).reshape(value.shape)

    def _run(
        self, name: str, element: RandomElement, t: Any, body: Any, table: Any, own: Any
    ) -> NDArray[Any]:
        if name not in self._plain:
            kernels, of_jumps = self.type_info.kernels, self._jumps_by(name)
            kernel = {n: k for n, k in kernels.items() if n == name or (of_jumps and n in OF_JUMPS)}
            kind = "impulse" if of_jumps else LOOP_OF[name]
            loop: Any = write(attrs.evolve(self.type_info, kernels=kernel), kind)
            namespace: dict[str, Any] = {"__name__": "dap3d_plain_loop"}
            exec(source_of(loop), namespace)  # text generated by the core
            self._plain[name] = namespace["loop"]
            namespace.update(loop.kernels)
        arrays = SimpleNamespace(body=body, F=table, idx=element.idx, par=element.par, states=own,
                                 rates=np.zeros(len(own), object))  # fmt: skip
        outs = self._outs(object, element)
        self._plain[name](t, arrays, 0, 0, 1, *outs)
        return self._value_in(name, table, outs, arrays.rates)

    def _jumps_by(self, name: str) -> bool:
        """True for a kernel of the jumps of a force."""
        return self.type_info.type.kind == "force" and name in OF_JUMPS

    def compiled_values(self, kind: str, element: RandomElement, state: State) -> dict[str, Floats]:
        """The values of the kernels of a loop, run compiled, by name.

        Raises:
            CompileError: they cannot be compiled.
        """
        if kind not in self._compiled:
            loop: Any = write(self.type_info, kind)
            self._compiled[kind] = loop_list([build(loop)])
        table = state.table()
        idx, par = np.array(element.idx, dtype=np.int64), np.array(element.par, dtype=float)
        arrays = LoopArrays(body=state.body(), F=table, idx=idx, par=par, states=state.own)
        outs, group = self._outs(float, element), np.array([0, 0, 1])
        call_loop(self._compiled[kind], 0, float(state.t), arrays, group, *outs)
        of_loop = kernels_of(self.type_info.type.kind, kind)
        names = [n for n in of_loop if n in self.type_info.kernels]
        return {name: self._value_in(name, table, outs, arrays.rates) for name in names}

    def _outs(self, dtype: Any, element: RandomElement) -> tuple[NDArray[Any], ...]:
        """Three outputs, large enough for every kernel; the second holds a joint's multipliers."""
        rows = getattr(self.type_info.type, "rows", 0)
        counts = [len(self.type_info.outputs.get(n, ())) for n in ("switch", *OF_JUMPS)]
        count = max(6 * BODIES * max(rows, 1), len(element.lam)) + sum(counts)
        outs = tuple(np.zeros(count) for _ in range(3))
        if not JUMPING.isdisjoint(self.names()):
            outs[2][: counts[0]] = self.crossing
        if "friction" in self.names() or (not rows and element.lam):
            outs[1][: len(element.lam)] = -np.array(element.lam)  # the solution is minus lambda
        return tuple(out.astype(dtype) for out in outs)

    def _value_in(
        self, name: str, table: NDArray[Any], outs: tuple[NDArray[Any], ...], rates: NDArray[Any]
    ) -> Any:
        type_: Any = self.type_info.type
        slots = len(self.type_info.layout.slots)
        if self._jumps_by(name) or name == "impulse":
            return self._jump_in(name, outs[0], slots)
        if name == "J":
            return outs[0][: 6 * type_.rows * slots].reshape(slots, type_.rows, 6)
        if name == "G":
            rows = len(type_.position_rows())
            return outs[0][: len(self.type_info.outputs["G"])].reshape(rows, -1)
        if name == "C":
            return outs[0][list(type_.position_rows())]
        if name == "C_dot":
            return outs[0][list(type_.velocity_rows())]
        if name in ("gamma", "nu"):
            return outs[1 if name == "gamma" else 2][: type_.rows]
        if name in ("wrench", "friction"):
            return outs[0][6 : 6 * (slots + 1)].reshape(slots, 2, 3)
        if name == "value":
            of_two = len(self.type_info.outputs["value"]) > 4  # the last two are behind y
            return np.concatenate([table[1, :4], table[2, 1:3]]) if of_two else table[1, :4]
        if name == "rate":
            return rates
        return outs[0][: len(self.type_info.outputs[name])]

    def _jump_in(self, name: str, out: NDArray[Any], slots: int) -> NDArray[Any]:
        """Impulses, or rows of a force, of the loop of jumps."""
        outputs = self.type_info.outputs
        count = len(outputs["impulse"])
        if name == "J":
            return out[count : count + len(outputs["J"])].reshape(slots, -1, 6)
        has_rows = self._jumps_by(name) and "J" in outputs
        return out[:count] if has_rows else out[:count].reshape(slots, 2, 3)


def _of_all(values: Sequence[Floats]) -> NDArray[Any]:
    """Arrays of one shape as one of numbers of many instances, (states, 1) each."""
    all_values = np.array(values)
    numbers = np.empty(all_values.shape[1:], object)
    for index in np.ndindex(numbers.shape):
        numbers[index] = Many(all_values[(slice(None), *index)][:, None])
    return numbers


def _stepped(values: Floats, rates: Floats) -> NDArray[Any]:
    stepped = values.astype(object)
    for index in zip(*np.nonzero(rates), strict=True):
        stepped[index] = Stepped(values[index], STEP * rates[index])
    return stepped


def draw(
    type_info: TypeInfo, choices: Mapping[str, Any], rng: random.Random, state: State
) -> RandomElement:
    """An element with random fields, prepared for the poses of a state.

    Args:
        type_info: the type, with known functions of an argument.
        choices: given values of choices.
        rng: random numbers.
        state: the poses, and the functions of time.

    Raises:
        RefusalError: the type refuses these values.
    """
    fields = {
        name: choices[name] if name in choices else _field(spec, rng)
        for name, spec in specs_of(type_info.type).items()
    }
    slots, functions = type_info.layout.slots, type_info.layout.functions
    load: tuple[int, ...] = getattr(type_info.type, "load", ())  # rows of a joint, behind its own
    rows = [k + 1 if f else 0 for k, f in enumerate(state.functions) if k < len(functions)]
    others = [rng.randrange(1, len(slots) + 1) for _ in type_info.layout.others]
    idx = [*range(1, len(slots) + 1), *rows, *others, *([0] if type_info.layout.states else [])]
    if type_info.type.kind == "joint":
        width = 6 * type_info.type.rows  # type: ignore[attr-defined]
        idx += [0, *(width * k for k in range(len(slots)))]
        idx += [type_info.type.rows] if load else []  # type: ignore[attr-defined]
        if getattr(type_info.type, "resists", ""):
            idx.append(type_info.layout.states["near"][0])  # its own, as if of the other
    elif type_info.type.kind == "function":
        idx += [1]
    poses = {s: pose(state.r[k + 1], state.p[k + 1]) for k, s in enumerate(slots)}
    values = _values(type_info, fields, poses, rng)
    seen = {n for n, spec in specs_of(type_info.type).items() if spec.given}
    shown = {n: v for n, v in fields.items()
             if n in seen and isinstance(v, (bool, int, float, str, tuple))}  # fmt: skip
    count = getattr(type_info.type, "rows", 0) + (load[-1] + 1 if load else 0)
    lam = numbers(rng, count or sample_size(type_info))
    return RandomElement(shown, tuple(idx), tuple(_numbers(type_info, values, rng)), lam)


def _field(spec: FieldSpec, rng: random.Random) -> Any:
    if not spec.required and rng.random() < LEFT_OUT:
        if spec.kind == "point":
            return (0.0, 0.0, 0.0)  # the mass centre
        if spec.kind == "number" and spec.default is None:
            return None
    return rng.choice(spec.choices) if spec.kind == "choice" else random_field(spec, rng)


def _values(
    type_info: TypeInfo, fields: dict[str, Any], poses: Mapping[str, BodyPose], rng: random.Random
) -> dict[str, Any]:
    """Values of fields, ends of a vector between points, and constants of ``prepare``."""
    instance = type_info.type(**fields)
    ends: dict[str, Any] = {}

    def end() -> Any:
        return tuple(rng.uniform(-1.5, 1.5) for _ in range(3))

    set_ends(instance, end)
    if any(spec.kind == "vector2" for spec in specs_of(type_info.type).values()):
        ends = {name: getattr(instance, name) for name in ("P_i", "P_j")}
        fields |= ends
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return fields | ends | prepared(instance, poses)
    except ValueError as error:
        raise RefusalError(f"{where_is(type_info.type)}.prepare refuses: {error}") from error


def _numbers(type_info: TypeInfo, values: Mapping[str, Any], rng: random.Random) -> list[float]:
    layout, fields = type_info.layout, specs_of(type_info.type)
    par = [rng.uniform(0.5, 1.5) for _ in range(layout.par_width)]  # of given functions, too
    for name, (offset, shape) in layout.numbers.items():
        value = values.get(name)
        if value is None and name in fields and fields[name].by_name:
            value = 0.0
        if value is None and (name in fields or name in layout.constants):
            raise RefusalError(f"{name} is missing")
        if value is None:  # of a friction
            value = rng.uniform(0.5, 1.5)
        flat = np.asarray(value, dtype=float).ravel().tolist()
        if len(flat) != size(shape):
            raise RefusalError(f"prepare returned {name} with another shape than at first")
        par[offset : offset + size(shape)] = flat
    for name, (offset, columns) in layout.tables.items():
        rows = np.asarray(values[name], dtype=float).ravel().tolist()
        par[offset], par[offset + 1] = float(len(par)), float(len(rows) // columns)
        par += rows
    for offset in layout.angles.values():
        # an earlier angle, of several turns, without a rate
        par[offset : offset + ANGLE_WIDTH] = rng.uniform(-10.0, 10.0), 0.0, 0.0
    return par
