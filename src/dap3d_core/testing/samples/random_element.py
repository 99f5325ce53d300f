"""One instance of a type with random fields, and its kernels, in plain Python and compiled.

A kernel is run by the group loop that the core writes for it: in plain Python on numbers of any
kind, and as it is compiled for a run.
"""

import random
import warnings
from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.interface.body_pose import BodyPose, pose
from dap3d_core.interface.codegen.examined import Examined
from dap3d_core.interface.codegen.instance_layout import ANGLE_WIDTH, size
from dap3d_core.interface.codegen.loop_source import LOOP_KINDS, write
from dap3d_core.interface.errors import where_is
from dap3d_core.interface.examine.examine import ATTEMPTS, prepared, set_ends
from dap3d_core.interface.examine.random_values import numbers, random_field
from dap3d_core.interface.fields import FieldSpec, specs_of
from dap3d_core.kernels.runtime.function_lists import LoopArrays, call_loop, loop_list
from dap3d_core.kernels.runtime.loop_modules import build, source_of
from dap3d_core.testing.samples.complex_step import STEP, Stepped
from dap3d_core.testing.samples.random_state import BODIES, Floats, State

#: Which loop a kernel belongs to.
LOOP_OF = {kernel: kind for kind, kernels in LOOP_KINDS.items() for kernel in kernels}
#: How often a number that may be left out, a point, or a function, is left out.
LEFT_OUT = 0.3


class Refusal(ValueError):  # noqa: N818 - the type's own, of random values
    """A type refuses the random values of its fields, in its own words."""


@attrs.frozen(eq=False)
class Element:
    """An instance: its numbers as a group loop reads them.

    Attributes:
        fields: what was given for it, for messages.
        idx: bodies of its slots (1, 2, 3), rows of functions, bodies of vectors, row, blocks.
        par: its numbers, tables behind them.
        lam: multipliers, for the friction of a joint.
    """

    fields: Mapping[str, Any]
    idx: tuple[int, ...]
    par: tuple[float, ...]
    lam: tuple[float, ...]


@attrs.frozen(eq=False)
class Kernels:
    """The kernels of a type, or of a variant, to be called for an element in a state.

    Attributes:
        examined: the type; functions of an argument are known.
    """

    examined: Examined
    _plain: dict[str, Any] = attrs.field(factory=dict)
    _compiled: dict[str, Any] = attrs.field(factory=dict)

    def names(self) -> tuple[str, ...]:
        """The kernels there are; a joint's friction is an element of its own."""
        found = self.examined.kernels
        return tuple(n for n in found if n != "friction" or len(found) == 1)

    def value(self, name: str, element: Element, state: State) -> Floats:
        """What a kernel returns, as an array of its rows.

        C (position rows,), C_dot (velocity rows,), J (slots, rows, 6), gamma and nu (rows,), wrench
        and friction (slots, 2, 3), energy (1,), switch (n,), value (4,).
        """
        body, table = state.body().astype(object), state.table().astype(object)
        return self._run(name, element, float(state.t), body, table).astype(float)

    def slope(self, name: str, element: Element, state: State, along: Any) -> Floats:
        """The derivative of what a kernel returns along a direction, by complex step.

        Raises:
            Exception: whatever a kernel raises that does not take complex numbers.
        """
        body = _stepped(state.body(), state.body_rate(along))
        table = _stepped(state.table(), state.table_rate(along))
        found = self._run(name, element, Stepped(state.t, STEP * along.time), body, table)
        slopes = [x.imag / STEP if isinstance(x, complex) else 0.0 for x in found.ravel()]
        return np.array(slopes).reshape(found.shape)

    def _run(self, name: str, element: Element, t: Any, body: Any, table: Any) -> NDArray[Any]:
        if name not in self._plain:
            kernel = {name: self.examined.kernels[name]}
            loop: Any = write(attrs.evolve(self.examined, kernels=kernel), LOOP_OF[name])
            namespace: dict[str, Any] = {"__name__": "dap3d_plain_loop"}
            exec(source_of(loop), namespace)  # the core's own text, as building it does
            self._plain[name] = namespace["loop"]
            namespace.update(loop.kernels)
        arrays = _Plain(body, table, element.idx, element.par)
        outs = self._outs(object, element)
        self._plain[name](t, arrays, 0, 0, 1, *outs)
        taken: NDArray[Any] = self._taken(name, table, outs)
        return taken

    def compiled_values(self, kind: str, element: Element, state: State) -> dict[str, Floats]:
        """What the kernels of a loop return when they run compiled, by name.

        Raises:
            CompileError: they cannot be compiled.
        """
        if kind not in self._compiled:
            loop: Any = write(self.examined, kind)
            self._compiled[kind] = loop_list([build(loop)])
        table = state.table()
        idx, par = np.array(element.idx, dtype=np.int64), np.array(element.par, dtype=float)
        arrays = LoopArrays(body=state.body(), F=table, idx=idx, par=par)
        outs, group = self._outs(float, element), np.array([0, 0, 1])
        call_loop(self._compiled[kind], 0, float(state.t), arrays, group, *outs)
        here = [n for n in LOOP_KINDS[kind] if n in self.examined.kernels]
        return {name: self._taken(name, table, outs) for name in here}

    def _outs(self, dtype: Any, element: Element) -> tuple[NDArray[Any], ...]:
        """Three outputs, large enough for every kernel; the second holds a joint's multipliers."""
        rows = getattr(self.examined.type, "rows", 0)
        count = 6 * BODIES * max(rows, 1) + len(self.examined.outputs.get("switch", ()))
        outs = tuple(np.zeros(count) for _ in range(3))
        if "friction" in self.names():
            outs[1][:rows] = -np.array(element.lam)  # as the solution stands there
        return tuple(out.astype(dtype) for out in outs)

    def _taken(self, name: str, table: NDArray[Any], outs: tuple[NDArray[Any], ...]) -> Any:
        type_: Any = self.examined.type
        slots = len(self.examined.layout.slots)
        if name == "J":
            return outs[0][: 6 * type_.rows * slots].reshape(slots, type_.rows, 6)
        if name == "C":
            return outs[0][list(type_.position_rows())]
        if name == "C_dot":
            return outs[0][list(type_.velocity_rows())]
        if name in ("gamma", "nu"):
            return outs[1 if name == "gamma" else 2][: type_.rows]
        if name in ("wrench", "friction"):
            return outs[0][6 : 6 * (slots + 1)].reshape(slots, 2, 3)
        if name == "value":
            return table[1, :4]
        return outs[0][: len(self.examined.outputs[name])]


@attrs.frozen
class _Plain:
    body: Any
    F: Any
    idx: Any
    par: Any


def _stepped(values: Floats, rates: Floats) -> NDArray[Any]:
    found = values.astype(object)
    for place in zip(*np.nonzero(rates), strict=True):
        found[place] = Stepped(values[place], STEP * rates[place])
    return found


def draw(
    examined: Examined, choices: Mapping[str, Any], rng: random.Random, state: State
) -> Element:
    """An element with random fields, prepared for the poses of a state.

    Args:
        examined: the type, functions of an argument known.
        choices: words of choices that are given.
        rng: where its numbers come from.
        state: the poses; which of the functions of time are there.

    Raises:
        Refusal: the type refuses these values.
    """
    fields = {
        name: choices[name] if name in choices else _field(spec, rng)
        for name, spec in specs_of(examined.type).items()
    }
    slots, functions = examined.layout.slots, examined.layout.functions
    rows = [k + 1 if f else 0 for k, f in enumerate(state.functions) if k < len(functions)]
    others = [rng.randrange(1, len(slots) + 1) for _ in examined.layout.others]
    idx = [*range(1, len(slots) + 1), *rows, *others]
    if examined.type.kind == "joint":
        width = 6 * examined.type.rows  # type: ignore[attr-defined]
        idx += [0, *(width * k for k in range(len(slots)))]
    elif examined.type.kind == "function":
        idx += [1]
    places = {s: pose(state.r[k + 1], state.p[k + 1]) for k, s in enumerate(slots)}
    values = _values(examined, fields, places, rng)
    shown = {n: v for n, v in fields.items() if isinstance(v, (bool, int, float, str, tuple))}
    lam = numbers(rng, getattr(examined.type, "rows", 0))
    return Element(shown, tuple(idx), tuple(_numbers(examined, values, rng)), lam)


def _field(spec: FieldSpec, rng: random.Random) -> Any:
    if not spec.required and rng.random() < LEFT_OUT:
        if spec.kind == "point":
            return (0.0, 0.0, 0.0)  # the mass centre
        if spec.kind == "number" and spec.default is None:
            return None
    return rng.choice(spec.choices) if spec.kind == "choice" else random_field(spec, rng)


def _values(
    examined: Examined,
    fields: dict[str, Any],
    places: Mapping[str, BodyPose],
    rng: random.Random,
) -> dict[str, Any]:
    """Fields, ends of a vector between points, and what ``prepare`` returns for them."""
    instance = examined.type(**fields)
    ends: dict[str, Any] = {}

    def end() -> Any:
        return tuple(rng.uniform(-1.5, 1.5) for _ in range(3))

    set_ends(instance, end)
    if any(spec.kind == "vector2" for spec in specs_of(examined.type).values()):
        ends = {name: getattr(instance, name) for name in ("P_i", "P_j")}
        fields |= ends
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return fields | ends | prepared(instance, places)
    except ValueError as error:
        raise Refusal(f"{where_is(examined.type)}.prepare refuses: {error}") from error


def _numbers(examined: Examined, values: Mapping[str, Any], rng: random.Random) -> list[float]:
    layout, fields = examined.layout, specs_of(examined.type)
    par = [rng.uniform(0.5, 1.5) for _ in range(layout.par_width)]  # of given functions, too
    for name, (offset, shape) in layout.numbers.items():
        value = values.get(name)
        if value is None and (name in fields or name in layout.constants):
            raise Refusal(f"{name} is missing")
        if value is None:  # what a friction adds
            value = rng.uniform(0.5, 1.5)
        flat = np.asarray(value, dtype=float).ravel().tolist()
        if len(flat) != size(shape):
            raise Refusal(f"prepare returned {name} with another shape than at first")
        par[offset : offset + size(shape)] = flat
    for name, (offset, columns) in layout.tables.items():
        rows = np.asarray(values[name], dtype=float).ravel().tolist()
        par[offset], par[offset + 1] = float(len(par)), float(len(rows) // columns)
        par += rows
    for offset in layout.angles.values():
        # turns that were counted before, and no rate there
        par[offset : offset + ANGLE_WIDTH] = rng.uniform(-10.0, 10.0), 0.0, 0.0
    return par


__all__ = ["ATTEMPTS", "LOOP_OF", "Element", "Kernels", "Refusal", "draw"]
