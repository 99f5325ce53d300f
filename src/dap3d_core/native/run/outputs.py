"""Outputs of an exported model: quantities of a result as compiled code.

They are traced like kernels (kernels/compiler/trace.py), from the arrays of bodies as a report has
placed them, and the reported row.
"""

import math
import operator
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import attrs

from dap3d_core.assembly.motion.joint_motion import TRANSLATION
from dap3d_core.assembly.motion.single_coordinate import single_coordinate
from dap3d_core.formulations.contacts.contact_table import FRICTION, GAP, NORMAL, SLIP
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS
from dap3d_core.integrators.stepping.integration_state import Y
from dap3d_core.interface.fields import SLOTS, specs_of
from dap3d_core.kernels import scalar_math, vectors
from dap3d_core.kernels.compiler.trace import NumberArray, Tracer
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, JP, MASS, A, P, R, V, W
from dap3d_core.model.joint_angles import joint_angle_name
from dap3d_core.model.state_layout import COORDINATES, VELOCITIES
from dap3d_core.native.run.elements import Element, Elements
from dap3d_core.native.run.prepared import PreparedRun, refusal
from dap3d_core.result import Result, ResultError
from dap3d_core.result.errors import UnknownNameError
from dap3d_core.result.quantities.catalogue import ACTIONS
from dap3d_core.result.quantities.lookup import find
from dap3d_core.scene import Mistake, SceneError
from dap3d_core.scene.expressions.expression import WORDS
from dap3d_core.simulation.output.check_outputs import instant_of

#: Quantities of a body that an export without outputs has.
OF_BODIES = ("r", "p", "rd", "w")
SYMBOL = "dap3d_outputs"
#: Bodies (n + 1, BODY_WIDTH), the reported row behind t, functions (k, 5), what loops of elements
#: have found; the values.
_FUNCTION = """define hidden void @{symbol}(ptr %bodies, ptr %row, ptr %F,
                                ptr %elements, ptr %out) nounwind {{
entry:
{body}
  ret void
}}
"""
TURN = 2.0 * math.pi


@attrs.frozen
class Output:
    """A number that an exported model gives.

    Attributes:
        name: of the quantity, with its component.
        unit, label: as of ``Quantity``.
        is_of_state: it is a function of time, state and inputs: steps of contacts report
            accelerations and reactions as means of a step.
    """

    name: str
    unit: str
    label: str
    is_of_state: bool


class NotExportedError(Exception):
    """A quantity that compiled code does not compute; its name."""


@attrs.frozen
class Outputs:
    """Outputs of a model.

    Attributes:
        names: of the quantities that were chosen.
        found: the outputs.
        text: LLVM IR of the function that computes them.
        left_out: outputs of the scene that compiled code does not compute.
        elements: that they are of.
        reads_report: they read more than time, inputs, and bodies as their state places them.
    """

    names: list[str]
    found: list[Output]
    text: str
    left_out: list[str]
    elements: Elements
    reads_report: bool


def outputs_of(prepared: PreparedRun, names: Sequence[str] | None) -> Outputs:
    """Outputs of a model; the run's memory then has what they need.

    Args:
        prepared: the run.
        names: of quantities; None for the outputs of the scene that can be exported, and where it
            has none, the motion of its bodies.

    Raises:
        SceneError: a name is unknown, or what it names cannot be exported.
    """
    model = prepared.evaluator.model
    chosen = list(names) if names is not None else list(prepared.compiled.scene.outputs)
    if not chosen and names is None:
        chosen = [f"{body}.{q}" for body in model.body_names for q in OF_BODIES]
    chosen = [name for name in dict.fromkeys(chosen) if name not in model.input_names]
    result, tracer = _first_row(prepared), Tracer()
    quantities = _Quantities(prepared, result, tracer)
    found: list[Output] = []
    left_out: dict[str, str] = {}
    values: list[Any] = []
    for name in chosen:
        try:
            quantity = find(result, name)
            quantities.is_of_state = True
            value = quantities.value(name)
        except (UnknownNameError, ResultError) as error:
            raise SceneError([Mistake("outputs", name, str(error))]) from error
        except NotExportedError as error:
            if names is None:
                left_out[name] = f"outputs.{name}: {error} is computed by Python alone"
                continue
            raise refusal(
                f"output {name}: {error} is computed by Python alone",
                "name motions, quantities of joints, forces and contacts, energies, or expressions",
            ) from None
        parts = list(value) if isinstance(value, tuple) else [value]
        for word, part in zip(quantity.columns, parts, strict=True):
            if word not in [output.name for output in found]:
                found.append(Output(word, quantity.unit, quantity.label,
                                    quantities.is_of_state))  # fmt: skip
                values.append(part)
    for k, x in enumerate(values):
        word = tracer.word(x)
        place = tracer.new(f"getelementptr inbounds double, ptr %out, i64 {k}")
        tracer.line(f"store double {word}, ptr {place}, align 8")
    program = tracer.program
    program.text.append(_FUNCTION.format(symbol=SYMBOL, body="\n".join(tracer.lines)))
    prepared.more += quantities.elements.finish()
    names_of = [name for name in chosen if name not in left_out]
    reads = quantities.reads_report or bool(quantities.elements.calls)
    text, left = program.module(), list(left_out.values())
    return Outputs(names_of, found, text, left, quantities.elements, reads)


@IGNORE_FLOAT_ERRORS
def _first_row(prepared: PreparedRun) -> Result:
    """The result of the start alone, for names, units and components."""
    y, text = prepared.run.present.work.state[Y], prepared.compiled.scene_text
    return instant_of(text, prepared.evaluator, 0.0, y)


class _Quantities:
    """Quantities as symbols: a number, or a tuple of components."""

    def __init__(self, prepared: PreparedRun, result: Result, tracer: Tracer) -> None:
        self._tracer, self._result, self._prepared = tracer, result, prepared
        self.elements = Elements(prepared)
        #: False once a value needs rates.
        self.is_of_state, self.reads_report = True, False
        self._values = NumberArray(tracer, "%elements")
        model = self._model = prepared.evaluator.model
        self._body = NumberArray(tracer, "%bodies", width=BODY_WIDTH)
        self._row, self._F = NumberArray(tracer, "%row"), NumberArray(tracer, "%F", width=5)
        self._t = self._row[-1]
        #: Of the report in a row: behind the integrated state.
        self._report = len(prepared.run.present.work.state[Y])
        self._layout = model.report_layout

    def value(self, name: str) -> Any:
        """A quantity by its name in results.

        Raises:
            NotExportedError: compiled code does not compute it.
        """
        model = self._model
        if name in self._result.outputs:
            return self._result.outputs[name].fold(self.value, self._call)
        if name in model.input_names:
            return self._F[int(model.input_rows[model.input_names.index(name)]), 0]
        system = self._of_system().get(name)
        if system is not None:
            return system()
        whole, _, component = name.rpartition(".")
        if len(points := self._result.summary.contacts.get(whole, ())) > 1:
            return tuple(self.value(f"{point}.{component}") for point in points)
        for owner, slot, attribute in self._parsed(name):
            return self._of_owner(owner, slot, attribute, name)
        if whole in self._result.outputs or list(self._parsed(whole)):
            vector = self.value(whole)
            if component == "norm" and isinstance(vector, tuple):
                return scalar_math.sqrt(_dot(vector, vector))
            columns = find(self._result, whole).components
            if isinstance(vector, tuple) and component in columns:
                return vector[columns.index(component)]
        raise NotExportedError(name)

    def _parsed(self, name: str) -> list[tuple[str, str, str]]:
        """Owner, slot and attribute of a name, where it is a whole quantity of one."""
        head, _, attribute = name.rpartition(".")
        owner, _, slot = head.rpartition(".")
        model = self._model
        elements = {*model.joint_names, *model.force_names}
        if head in {*model.body_names, *self._result.summary.point_names, *elements}:
            return [(head, "", attribute)]
        return [(owner, slot, attribute)] if owner in elements and slot in SLOTS else []

    def _of_owner(self, owner: str, slot: str, attribute: str, name: str) -> Any:
        model, summary = self._model, self._result.summary
        if owner in model.body_names and attribute in _OF_BODY:
            return self._of_body(1 + model.body_names.index(owner), attribute)
        if owner in summary.point_index and attribute in _OF_POINT:
            k = summary.point_index[owner]
            local = tuple(summary.point_local[k].tolist())
            return self._of_point(int(summary.point_body[k]), local, _OF_POINT[attribute])
        if owner in model.contact_names:
            self.is_of_state &= attribute in ("gap", "slip")
        for state in model.element_states:
            if (state.element, state.name) == (owner, attribute):
                return self._of_element_state(state.first, state.length)
        if owner in model.contact_names and attribute in OF_CONTACT:
            contact = self.elements.contact(owner)
            first, size = OF_CONTACT[attribute]
            numbers = tuple(self._values[contact.first + first + k] for k in range(size))
            return numbers if size > 1 else numbers[0]
        if owner in model.joint_names:
            joint = model.joint_names.index(owner)
            if attribute == "lambda":
                return self._multipliers(joint)
            if attribute in ACTIONS:
                element = self.elements.joint(owner)
                if element is None:
                    raise NotExportedError(name)
                wrench = self._reaction(element, slot, joint)
                if owner in self._model.brought_forces:
                    brought = self.elements.force(self._model.brought_forces[owner])
                    assert brought is not None  # as every force
                    wrench = tuple(map(operator.add, wrench, self._wrench(brought, slot)))
                return self._action(element, slot, attribute, wrench)
            found = self._coordinate(owner, joint, attribute)
            if found is not None:
                return found
        elif owner in model.force_names:
            element = self.elements.force(owner)
            if element is not None and attribute in ACTIONS:
                return self._action(element, slot, attribute, self._wrench(element, slot))
            found = element and self._of_force(element, attribute)
            if found is not None:
                return found
        raise NotExportedError(name)

    # ---------------------------------------------------------------- joints and forces

    def _of_element_state(self, first: int, length: int) -> Any:
        """States of elements stand before the work, which is the last of the integrated state."""
        start = self._report - 1 - len(self._model.initial_states) + first
        numbers = tuple(self._row[start + k] for k in range(length))
        return numbers if length > 1 else numbers[0]

    def _multipliers(self, joint: int) -> tuple[Any, ...]:
        first, rows = int(self._model.joint_start[joint]), int(self._model.joint_rows[joint])
        return tuple(self._reported("Lam", first + k) for k in range(rows))

    def _reaction(self, element: Element, slot: str, joint: int) -> tuple[Any, ...]:
        """D^T lambda on the body of a slot: force and moment."""
        Lam, place = self._multipliers(joint), element.place(slot)
        first = element.first + 6 * len(Lam) * place
        column = [tuple(self._values[first + 6 * r + v] for r in range(len(Lam))) for v in range(6)]
        return tuple(_dot(rows, Lam) for rows in column)

    def _wrench(self, element: Element, slot: str) -> tuple[Any, ...]:
        self.is_of_state &= not element.reads_loads
        body = int(element.group.bodies[element.index][element.place(slot)])
        return tuple(self._values[element.first + 6 * body + v] for v in range(6))

    def _action(self, element: Element, slot: str, part: str, wrench: Any) -> Any:
        """Part of a ``Reaction``."""
        place = element.place(slot)
        axes = self._axes(int(element.group.bodies[element.index][place]))
        force, moment = wrench[:3], wrench[3:]
        if part == "moment_at_point":
            local = element.local(place)
            assert local is not None  # the result has such a quantity
            return vectors.sub(moment, vectors.cross(tuple(_dot(a, local) for a in axes), force))
        vector = force if part.startswith("force") else moment
        if part.endswith("_body"):
            return tuple(_dot(tuple(row[k] for row in axes), vector) for k in range(3))
        return vector

    def _of_force(self, element: Element, attribute: str) -> Any:
        """Part of a ``ForceOutput``; None where it is none that is a number."""
        specs = specs_of(element.group.type_info.type).values()
        if attribute == "energy" and element.energy >= 0:
            return self._values[element.energy]
        if any(spec.kind == "vector2" for spec in specs):
            return self._along(element).get(attribute)
        is_single = element.group.type_info.outputs.get("tension", ()) == ("out",)
        return self._values[element.tension] if attribute == "tension" and is_single else None

    def _along(self, element: Element) -> dict[str, Any]:
        """Length, its rate and the tension of an element between points P_i and P_j."""
        ends = []
        for body, end in zip(element.group.bodies[element.index].tolist(), "ij", strict=False):
            at, _ = element.group.type_info.layout.numbers[f"P_{end}"]
            local = tuple(element.group.numbers[element.index, at : at + 3].tolist())
            ends.append([self._of_point(int(body), local, level) for level in (0, 1)])
        d, rate = (vectors.sub(b, a) for a, b in zip(*ends, strict=True))
        length = scalar_math.sqrt(_dot(d, d))
        d = tuple(scalar_math.where(length == 0.0, y, x) for x, y in zip(d, rate, strict=True))
        size = scalar_math.sqrt(_dot(d, d))
        size = scalar_math.where(size > 0.0, size, 1.0)
        tension = _dot(d, self._wrench(element, "i")[:3]) / size
        return {"length": length, "length_rate": _dot(d, rate) / size, "tension": tension}

    # ---------------------------------------------------------------- bodies, points, the whole

    def _vector(self, body: int, first: int, size: int = 3) -> tuple[Any, ...]:
        if body == 0:
            return tuple(1.0 if first == P and k == 0 else 0.0 for k in range(size))
        return tuple(self._body[body, first + k] for k in range(size))

    def _axes(self, body: int) -> tuple[Any, ...]:
        """Rows of the rotation matrix of a body."""
        if body == 0:
            return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
        return tuple(self._vector(body, A + 3 * k) for k in range(3))

    def _reported(self, part: str, k: int) -> Any:
        self.reads_report = True
        if part in ("v_dot", "Lam") or (part, k) == ("residuals", 2):
            self.is_of_state = False
        return self._row[self._report + self._layout[part].start + k]

    def _acceleration(self, body: int, first: int) -> tuple[Any, ...]:
        if body == 0:
            return 0.0, 0.0, 0.0
        return tuple(self._reported("v_dot", 6 * (body - 1) + first + k) for k in range(3))

    def _of_body(self, body: int, attribute: str) -> tuple[Any, ...]:
        if attribute.startswith("wp"):
            part = self._vector(body, W) if attribute == "wp" else self._acceleration(body, 3)
            axes = self._axes(body)
            return tuple(_dot(tuple(row[k] for row in axes), part) for k in range(3))
        if attribute in ("rdd", "wd"):
            return self._acceleration(body, 0 if attribute == "rdd" else 3)
        place, first, size = {"r": (0, R, 3), "p": (3, P, 4), "rd": (0, V, 3), "w": (0, W, 3)}[
            attribute
        ]
        if attribute == "w" or not self._prepared.evaluator.coordinates.are_of_bodies:
            return self._vector(body, first, size)
        # of the state as it is: that of the arrays is of unit length
        place += VELOCITIES * (body - 1) if attribute == "rd" else COORDINATES * (body - 1)
        place += COORDINATES * self._model.body_count if attribute == "rd" else 0
        return tuple(self._row[place + k] for k in range(size))

    def _of_point(self, body: int, local: tuple[float, ...], level: int) -> Any:
        """Position, velocity or acceleration of a point fixed in a body."""
        if body == 0:
            return local if level == 0 else (0.0, 0.0, 0.0)
        arm, w = tuple(_dot(row, local) for row in self._axes(body)), self._vector(body, W)
        if level == 0:
            return vectors.add(self._vector(body, R), arm)
        carried = vectors.cross(w, arm)
        if level == 1:
            return vectors.add(self._vector(body, V), carried)
        turned = vectors.cross(self._acceleration(body, 3), arm)
        moved = vectors.add(self._acceleration(body, 0), turned)
        return vectors.add(moved, vectors.cross(w, carried))

    def _of_system(self) -> dict[str, Callable[[], Any]]:
        potential = partial(self._reported, "potential_energy", 0)
        residuals = {
            f"constraint.{level}": partial(self._reported, "residuals", k)
            for k, level in enumerate(("position", "velocity", "acceleration"))
        }
        return residuals | {
            "t": lambda: self._t,
            "work": lambda: self._row[self._report - 1],
            "energy.kinetic": self._kinetic,
            "energy.potential": potential,
            "energy.total": lambda: self._kinetic() + potential(),
        }

    def _kinetic(self) -> Any:
        total: Any = 0.0
        for body in range(1, 1 + self._model.body_count):
            v, w = self._vector(body, V), self._of_body(body, "wp")
            inertia = tuple(_dot(self._vector(body, JP + 3 * k), w) for k in range(3))
            total = total + 0.5 * (self._body[body, MASS] * _dot(v, v) + _dot(w, inertia))
        return total

    # ---------------------------------------------------------------- joints

    def _coordinate(self, name: str, joint: int, attribute: str) -> Any:
        """The coordinate, or its rate, of a joint that has a single one; None for others."""
        found = single_coordinate(self._model.motions, joint, attribute)
        if found is None:
            return None
        coordinate, is_rate = found
        if is_rate:
            return coordinate.rate(self._vector, self._axes)
        q = coordinate.value(self._vector, self._axes)
        if coordinate.kind == TRANSLATION:
            return q
        names = list(self._model.angle_names)
        if joint_angle_name(name, 0) not in names:
            raise NotExportedError(name)
        counted = self._reported("angles", names.index(joint_angle_name(name, 0)))
        return q - TURN * self._tracer.rint((q - counted) / TURN)

    # ---------------------------------------------------------------- expressions

    def _call(self, word: str, *given: Any) -> Any:
        if word in WORDS and WORDS[word].takes_vectors:
            if word == "cross":
                return vectors.cross(*given)
            found = _dot(given[0], given[-1])
            return scalar_math.sqrt(found) if word == "norm" else found
        sizes = {len(x) for x in given if isinstance(x, tuple)}
        if sizes:
            size = sizes.pop()
            rows = [x if isinstance(x, tuple) else (x,) * size for x in given]
            return tuple(self._call(word, *row) for row in zip(*rows, strict=True))
        truth = _TRUTHS.get(word)
        if truth is not None:
            return scalar_math.where(truth(*given), 1.0, 0.0)
        if word == "where":
            return scalar_math.where(self._is_true(given[0]), given[1], given[2])
        if word in ("and", "or", "not"):
            a, *rest = map(self._is_true, given)
            both = ~a if not rest else (a & rest[0] if word == "and" else a | rest[0])
            return scalar_math.where(both, 1.0, 0.0)
        if word in _OPERATIONS:
            return _OPERATIONS[word](*given)
        return getattr(scalar_math, word)(*given)

    def _is_true(self, x: Any) -> Any:
        if isinstance(x, (int, float)):  # a constant is a condition of its own
            x = self._t * 0.0 + x
        return x != 0.0


#: Quantities of contacts: first of the numbers that they say of themselves, how many.
OF_CONTACT = {"gap": (GAP, 1), "normal": (NORMAL, 1), "friction": (FRICTION, 3), "slip": (SLIP, 3)}
#: Quantities of bodies and points; of these the derivative that they are.
_OF_BODY = ("r", "p", "rd", "w", "wp", "rdd", "wd", "wpd")
_OF_POINT = {"r": 0, "v": 1, "a": 2, "rP": 0, "rPd": 1, "rPdd": 2}
_OPERATIONS: dict[str, Callable[..., Any]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv,
    "%": scalar_math.mod, "**": operator.pow, "neg": operator.neg,
}  # fmt: skip
_TRUTHS: dict[str, Callable[..., Any]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
    "==": operator.eq, "!=": operator.ne,
}  # fmt: skip


def _dot(a: Any, b: Any) -> Any:
    """Sum of products of components, from the first on."""
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total
