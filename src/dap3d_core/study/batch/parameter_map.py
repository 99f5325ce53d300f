"""Where the varied numbers of a study stand in a model's arrays, if they can be put there as is.

Most numbers of a scene are copied, unchanged, to places that are known beforehand: masses,
stiffnesses, points, initial velocities. Others go through code of their types, or make something
else of the scene (a direction is normalised, a function has other breaks): for those each point's
model is made anew (study/batch/rebuild.py).
"""

from collections.abc import Iterator
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.formulations.arrays import set_metric
from dap3d_core.formulations.evaluator import Machine
from dap3d_core.interface.body_pose import BodyPose, pose
from dap3d_core.interface.codegen.instance_layout import ANGLE_WIDTH
from dap3d_core.interface.fields import FieldSpec, specs_of
from dap3d_core.interface.types import Function
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, JP, MASS
from dap3d_core.model import Group
from dap3d_core.model.state_layout import from_integrated, join, split, to_integrated
from dap3d_core.scene import Checked, Instance
from dap3d_core.scene.validate.bodies import SMALLEST_INERTIA, ZERO_INERTIA
from dap3d_core.scene.validate.coerce_values import LARGEST
from dap3d_core.simulation.initial.assemble import model_size
from dap3d_core.simulation.initial.undefined_directions import are_undefined
from dap3d_core.study.batch.prepare_dependence import Dependence, dependence_of
from dap3d_core.study.parameters import Number

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

#: Columns of the metric that hold constants of a body: 1/sqrt(m), then U by rows.
METRIC_WIDTH, CONSTANTS = 16, 7
#: Fields of a body that a run starts with.
STATES = ("r", "r_dot", "w")


class NotCopiedError(Exception):
    """A number is not copied to known places."""


@attrs.frozen(eq=False)
class Column:
    """One varied number.

    Attributes:
        number: which.
        targets: places in par that hold a copy of it.
        limits: what the scene's check asks of it; None for any finite number.
        moves_start: whether positions or velocities at the start depend on it, where there are
            joints.
    """

    number: Number
    targets: tuple[int, ...] = ()
    limits: FieldSpec | None = None
    moves_start: bool = False


class Places:
    """Makes the table of numbers of many points at once.

    Attributes:
        columns: of the varied numbers, in order.
        moves_start: whether the start depends on any of them; moves: whether points or bodies are
            elsewhere then.
        places: (w,) places in par, body and metric, one behind the other, of the table's columns.
    """

    def __init__(self, checked: Checked, machine: Machine, numbers: tuple[Number, ...]) -> None:
        """Find the places.

        Raises:
            NotCopiedError: one of the numbers has no such places.
        """
        self._checked, self._machine = checked, machine
        self._poses = _poses(checked)
        self._dependence: dict[int, Dependence] = {}
        self.columns = tuple(self._column(number) for number in numbers)
        self.moves_start = any(column.moves_start for column in self.columns)
        self.moves = self.moves_start or any(n.table == "points" for n in numbers)
        bodies = {n.path[1] for n in numbers if n.table == "bodies" and n.path[2] in ("mass", "Jp")}
        self._bodies = np.array(sorted(checked.body_index[b] - 1 for b in bodies), dtype=np.int64)
        self._par = self._own_places()
        counters = _turn_counters(machine)
        self._counters = len(counters)
        system, n = machine.system, 1 + self._bodies
        body = system.par.size + n[:, None] * BODY_WIDTH
        metric = system.par.size + system.body.size + n[:, None] * METRIC_WIDTH
        self.places = np.concatenate(
            [
                counters,
                self._par,
                (body + MASS + np.arange(10)).ravel(),
                (metric + np.arange(CONSTANTS)).ravel(),
            ]
        ).astype(np.int64)
        assert JP == MASS + 1

    def table(self, values: Floats) -> tuple[Floats, Booleans]:
        """Numbers for ``places`` of points whose varied numbers are ``values`` (k, d).

        Returns:
            (k, w) numbers; (k,) whether the scene's check lets a point pass: where not, its
            numbers make no sense.
        """
        good = np.ones(len(values), dtype=bool)
        for column, value in zip(self.columns, values.T, strict=True):
            good &= _allowed(column, value)
        parts = [np.zeros((len(values), self._counters))]
        for column, value in zip(self.columns, values.T, strict=True):
            parts.append(np.repeat(value[:, None], len(column.targets), axis=1))
        if len(self._bodies):
            mass, Jp, fine = self._inertias(values)
            good &= fine
            metric = np.zeros((1 + len(mass) * len(self._bodies), METRIC_WIDTH))
            set_metric(metric, mass.ravel(), Jp.reshape(-1, 3, 3))
            parts.append(
                np.concatenate([mass[..., None], Jp.reshape(*mass.shape, 9)], axis=-1).reshape(
                    len(values), -1
                )
            )
            parts.append(metric[1:, :CONSTANTS].reshape(len(values), -1))
        return np.hstack(parts), good

    def states(self, values: Floats, u0: Floats) -> Floats:
        """(k, 13 n + 1) integrated states to start from; u0 (13 n,) is that of the scene."""
        u = np.repeat(u0[None], len(values), axis=0)
        r, p, v, w = (part.copy() for part in split(u))
        parts = {"r": r, "r_dot": v, "w": w}
        for column, value in zip(self.columns, values.T, strict=True):
            number = column.number
            if number.table == "bodies" and number.path[2] in parts:
                body = self._checked.body_index[number.path[1]] - 1
                parts[number.path[2]][:, body, number.places[0]] = value
        return to_integrated(join(r, p, v, w))

    def are_undefined(self, table: Floats, y0: Floats) -> Booleans:
        """Points at whose start y0 (k, 13 n + 1) the direction of an element is undefined."""
        machine, count = self._machine, len(table)
        model = machine.model
        first_of = {id(group): first for group, first in self._groups()}

        def numbers_of(group: Group) -> Floats:
            first, size = first_of[id(group)], group.numbers.size
            numbers = np.repeat(group.numbers.reshape(1, -1), count, axis=0)
            own = (self.places >= first) & (self.places < first + size)
            numbers[:, self.places[own] - first] = table[:, own]
            return numbers.reshape(count, *group.numbers.shape)

        u = from_integrated(y0)
        return are_undefined(model, u, numbers_of, model_size(machine))

    # ------------------------------------------------------------------ one number

    def _column(self, number: Number) -> Column:
        table = number.table
        if table == "bodies":
            return self._of_body(number)
        if table == "points":
            return self._of_point(number)
        if table in ("joints", "forces", "functions"):
            return self._of_element(number)
        raise NotCopiedError

    def _of_body(self, number: Number) -> Column:
        _, name, field = number.path
        body = self._checked.body_index[name]
        read = {
            part
            for instance in self._elements()
            for b, part in self._of(instance).poses
            if b == body
        }
        by_mass = str(self._checked.scene.simulation.correct_metric) == "mass"
        if field == "mass":
            limits = FieldSpec("number", 1.0, positive=True)
            return Column(number, limits=limits, moves_start=by_mass)
        if field not in ("Jp", *STATES) or field in read or len(number.places) != 1:
            raise NotCopiedError  # of a whole inertia matrix two numbers would have to change
        return Column(number, moves_start=field != "Jp" or by_mass)

    def _of_point(self, number: Number) -> Column:
        targets: list[int] = []
        name, moves = number.path[1], False
        for instance in self._elements():
            for field in _point_fields(self._checked, instance, name):
                if field in self._of(instance).fields:
                    raise NotCopiedError
                found = list(self._targets(instance, field, number.places))
                targets += found
                moves = moves or instance in self._checked.joints
        return Column(number, tuple(targets), moves_start=moves)

    def _of_element(self, number: Number) -> Column:
        table, name, field = number.path
        instance = next(i for i in getattr(self._checked, table) if i.name == name)
        spec = specs_of(instance.examined.type).get(field)
        needs = self._of(instance)
        if spec is None or spec.kind not in ("number", "vec3") or field in needs.fields:
            raise NotCopiedError
        type_: Any = instance.examined.type
        if any(field in conditions for conditions, _ in type_.variants):
            raise NotCopiedError  # with another value another variant may stand in
        if table == "functions" and not self._is_smooth_of_time(instance):
            raise NotCopiedError
        targets = tuple(self._targets(instance, field, number.places))
        limits = spec if spec.kind == "number" else None
        return Column(number, targets, limits, moves_start=table != "forces")

    def _is_smooth_of_time(self, function: Instance) -> bool:
        """Whether a function is of time alone, and no step has to end at breaks of it."""
        called = any(
            instance.values.get(field) == function.name
            for instance in self._elements()
            for field in instance.examined.argument_functions
        )
        type_: Any = function.examined.type
        return not called and type_.breaks is Function.breaks

    # ------------------------------------------------------------------ where things are

    def _elements(self) -> Iterator[Instance]:
        checked = self._checked
        yield from (*checked.joints, *checked.forces, *checked.functions)

    def _of(self, instance: Instance) -> Dependence:
        key = id(instance)
        if key not in self._dependence:
            n = len(self._checked.body_names)
            self._dependence[key] = dependence_of(instance, self._poses, n)
        return self._dependence[key]

    def _targets(self, instance: Instance, field: str, places: tuple[int, ...]) -> Iterator[int]:
        """Places in par that hold a component of a field of an element."""
        if field in self._of(instance).constants:
            raise NotCopiedError
        for group, first in self._groups():
            spot = group.examined.layout.numbers.get(field)
            if spot is None:
                continue
            for k in self._rows_of(instance, group):
                component = places[0] if places else 0
                yield first + k * group.numbers.shape[1] + spot[0] + component

    def _rows_of(self, instance: Instance, group: Group) -> Integers:
        """Rows of a group whose numbers come from an element."""
        checked, model = self._checked, self._machine.model
        rubs = any(group is other for other in model.friction)
        kind = group.examined.type.kind
        if instance in checked.joints and kind == "joint":
            members = group.joints if rubs else group.members
            return np.flatnonzero(members == checked.joints.index(instance))
        if instance in checked.forces and (kind == "force" or rubs):
            return np.flatnonzero(group.members == checked.forces.index(instance))
        if instance in checked.functions and kind == "function":
            return np.flatnonzero(group.members == checked.functions.index(instance))
        return np.zeros(0, dtype=np.int64)

    def _groups(self) -> Iterator[tuple[Group, int]]:
        """Each group of the model that has a loop, with the place in par of its numbers."""
        seen = set()
        for q, (_, group) in enumerate(self._machine.what):
            if id(group) not in seen:
                seen.add(id(group))
                yield group, int(self._machine.system.groups[q, 1])

    def _own_places(self) -> Integers:
        return np.array([t for c in self.columns for t in c.targets], dtype=np.int64)

    def _inertias(self, values: Floats) -> tuple[Floats, Floats, Booleans]:
        """Masses (k, b), inertia matrices (k, b, 3, 3) of bodies that vary; (k,) whether sound."""
        checked, count = self._checked, len(values)
        mass = np.repeat(checked.mass[self._bodies][None], count, axis=0)
        Jp = np.repeat(checked.Jp[self._bodies][None], count, axis=0)
        for column, value in zip(self.columns, values.T, strict=True):
            number = column.number
            if number.table != "bodies" or number.path[2] not in ("mass", "Jp"):
                continue
            b = int(np.searchsorted(self._bodies, checked.body_index[number.path[1]] - 1))
            if number.path[2] == "mass":
                mass[:, b] = value
            else:
                Jp[:, b, number.places[0], number.places[0]] = value
        fine = np.all((mass >= SMALLEST_INERTIA) & (mass <= LARGEST), axis=1)
        least, middle, most = np.linalg.eigvalsh(np.where(np.abs(Jp) <= LARGEST, Jp, 0.0)).T
        sound = (least > ZERO_INERTIA * most) & (most >= SMALLEST_INERTIA)
        fine &= np.all(sound & (most <= least + middle), axis=0)
        mass[~fine], Jp[~fine] = checked.mass[self._bodies], checked.Jp[self._bodies]
        return mass, Jp, fine


def _allowed(column: Column, value: Floats) -> Booleans:
    """Which values the scene's check would let pass."""
    good = np.abs(value) <= LARGEST  # NaN is not
    spec = column.limits
    if spec is None:
        return good
    if spec.positive:
        good &= value > 0.0
    if spec.minimum is not None:
        good &= value >= spec.minimum
    if spec.maximum is not None:
        good &= value <= spec.maximum
    if spec.whole:
        good &= value == np.round(value)
    return good


def _poses(checked: Checked) -> dict[int, BodyPose]:
    poses = {0: pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))}
    for k in range(len(checked.body_names)):
        poses[k + 1] = pose(checked.r[k], checked.p[k], checked.Jp[k])
    return poses


def _point_fields(checked: Checked, instance: Instance, point: str) -> Iterator[str]:
    """Fields of an element that hold the coordinates of a declared point."""
    scene, table = checked.scene, f"{instance.examined.type.kind}s"
    element = getattr(scene, table)[instance.name]
    for field, spec in specs_of(instance.examined.type).items():
        if spec.kind == "point" and element.fields.get(field) == point:
            yield field
        if spec.kind == "vector2":
            declared = scene.vectors2.get(element.fields.get(field))
            for end in ("P_i", "P_j"):
                given = getattr(declared, end) if declared else element.fields.get(end)
                if given == point:
                    yield end


def _turn_counters(machine: Machine) -> Integers:
    """Places in par where turns of angles are counted: zero at the start of each run."""
    found: list[Any] = [np.zeros(0, dtype=np.int64)]
    for q, (kind, group) in enumerate(machine.what):
        if kind == "angle":
            first, width = int(machine.system.groups[q, 1]), group.examined.layout.par_width
            offsets = group.examined.layout.angles.values()
            every = [offset + k for offset in offsets for k in range(ANGLE_WIDTH)]
            found += [first + at + width * np.arange(group.count) for at in every]
    return np.concatenate(found)
