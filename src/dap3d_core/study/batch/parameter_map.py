"""Maps varied parameters of a study to entries of a model's arrays, where they can be copied there.

Most numbers of a scene are copied, unchanged, to entries that are known in advance: masses,
stiffnesses, points, initial velocities. Others go through code of their types, or change more (a
direction is normalised, a function has other breaks): then each point's model is rebuilt
(study/batch/batch.py).
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.assembly.metric import METRIC_CONSTANTS, METRIC_WIDTH
from dap3d_core.assembly.turns import IS_POINT
from dap3d_core.formulations.arrays import mass_flags, set_metric
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.joint import node_layout as node
from dap3d_core.interface.element_states import INITIAL, TOLERANCE
from dap3d_core.interface.examine.constants import prepared
from dap3d_core.interface.fields import FieldSpec, specs_of
from dap3d_core.interface.types import (
    BodyPose,
    Function,
    TypeBase,
    acts_on_all,
    has_prepare,
    turns_of,
)
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, JP, MASS
from dap3d_core.model import Group
from dap3d_core.model.groups import Floats, Integers, as_object
from dap3d_core.model.model import ReferencePoses
from dap3d_core.model.scales import Scales, gyrations_of, moments_of, scales_of
from dap3d_core.model.state_layout import join, split, u_from_y, y_from_u
from dap3d_core.scene import Instance, ValidatedScene
from dap3d_core.scene.validate.bodies import SMALLEST_INERTIA, ZERO_INERTIA
from dap3d_core.scene.validate.coerce_values import LARGEST
from dap3d_core.simulation.initial.undefined_directions import are_undefined
from dap3d_core.study.parameters import SceneParameter

Booleans = NDArray[np.bool_]

#: Fields of a body's initial state.
STATES = ("r", "r_dot", "w")


class NotCopiedError(Exception):
    """A parameter is not copied to known entries."""


@attrs.frozen(eq=False)
class MappedParameter:
    """One varied parameter.

    Attributes:
        path, index: of the parameter.
        targets: indices in par of its copies.
        limits: that the scene's check sets; None for any finite number.
        moves_start: True if positions or velocities at the start depend on it, where there are
            joints.
    """

    path: tuple[str, ...]
    index: tuple[int, ...]
    targets: tuple[int, ...] = ()
    limits: FieldSpec | None = None
    moves_start: bool = False

    def is_valid(self, value: Floats) -> Booleans:
        """Values (k,) that the scene's check accepts."""
        good = np.abs(value) <= LARGEST  # NaN is not
        spec = self.limits
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


class ParameterMap:
    """Makes the table of numbers of many points at once.

    Attributes:
        parameters: those that vary, in order.
        moves_start: True if the start depends on any of them; moves: if points or bodies move.
        places: (w,) indices in the model's numbers (``numbers_of``), of the table's columns.
        keeps_poses: True if bodies start where they do in the scene as given.
    """

    def __init__(
        self, checked: ValidatedScene, evaluator: Evaluator, parameters: Sequence[SceneParameter]
    ) -> None:
        """Find the entries.

        Raises:
            NotCopiedError: one of the parameters has none.
        """
        self._checked, self._evaluator = checked, evaluator
        self._elements = (*checked.joints, *checked.forces, *checked.functions)
        self._poses = ReferencePoses(checked)
        self._dependence: dict[int, _Dependence] = {}
        self.parameters = tuple(self._mapped(parameter) for parameter in parameters)
        self.moves_start = any(p.moves_start for p in self.parameters)
        self.keeps_poses = all(
            not p.moves_start or p.path[0] == "functions" or p.path[2] in ("r_dot", "w")
            for p in self.parameters
        )
        self.moves = self.moves_start or any(p.table == "points" for p in parameters)
        angles = evaluator.model.joint_angles
        if self.moves and angles is not None and np.any(angles.constants[:, IS_POINT]):
            raise NotCopiedError  # points of joints are among the constants of their angles
        bodies = {p.path[1] for p in parameters if p.path[0] == "bodies"
                  and p.path[2] in ("mass", "Jp")}  # fmt: skip
        self._bodies = np.array(sorted(checked.body_index[b] - 1 for b in bodies), dtype=np.int64)
        system, n = evaluator.system, 1 + self._bodies[:, None]
        if any(group.type_info.layout.unknowns for group in evaluator.model.joints):
            raise NotCopiedError  # their unknowns are sought anew for each point
        self._moves_parts = any(
            p.table == "points" or (p.table == "bodies" and p.path[2] == "r") for p in parameters
        )
        self._changes_scales = self._moves_parts or len(self._bodies) > 0
        #: Masses (n,), moments of inertia (n, 3) and radii of gyration (n,) of the scene.
        mass, Jp = checked.mass, checked.Jp
        self._of_scene = mass, moments_of(Jp), gyrations_of(mass, Jp)
        counters = np.r_[0:0, *evaluator.turn_places()]  # zero at the start of each run
        self._counters = len(counters)
        body = system.par.size + n * BODY_WIDTH
        metric = system.par.size + system.body.size + n * METRIC_WIDTH
        assert JP == MASS + 1
        inertias = []  # numbers of the coordinates, where they have some
        if len(self._bodies):
            first = system.par.size + system.body.size + system.metric.size
            inertias.append(first + evaluator.coordinates.inertia_places(1 + self._bodies))
        self.places = np.concatenate(
            [
                counters,
                [target for p in self.parameters for target in p.targets],
                (body + MASS + np.arange(10)).ravel(),
                (metric + np.arange(METRIC_CONSTANTS)).ravel(),
                *inertias,
            ]
        ).astype(np.int64)

    def table(self, values: Floats, *, is_checked: bool = True) -> tuple[Floats, Booleans]:
        """Numbers for ``places`` of points whose varied parameters are ``values`` (k, d).

        is_checked: masses and inertias that are not valid are those of the scene.

        Returns:
            (k, w) numbers; (k,) False where the scene's check refuses a point, and its numbers are
            not valid, and where its size or its masses are such that a run has other tolerances or
            passes.
        """
        valid = np.ones(len(values), dtype=bool)
        parts = [np.zeros((len(values), self._counters))]
        for parameter, value in zip(self.parameters, values.T, strict=True):
            valid &= parameter.is_valid(value)
            parts.append(np.repeat(value[:, None], len(parameter.targets), axis=1))
        if len(self._bodies):
            mass, Jp, _, fine = self._inertias(values)
            valid &= fine
            if is_checked:
                mass[~fine], Jp[~fine] = (
                    of[self._bodies] for of in (self._checked.mass, self._checked.Jp)
                )
            metric = np.zeros((1 + mass.size, METRIC_WIDTH))
            set_metric(metric, mass.ravel(), Jp.reshape(-1, 3, 3))
            body = np.concatenate([mass[..., None], Jp.reshape(*mass.shape, 9)], axis=-1)
            parts += [part.reshape(len(values), -1)
                      for part in (body, metric[1:, :METRIC_CONSTANTS])]  # fmt: skip
            parts.append(self._evaluator.coordinates.inertias(1 + self._bodies, mass, Jp))
        if self._changes_scales:
            valid[valid] &= self._has_scales_of_scene(values[valid])
        return np.hstack(parts), valid

    def sizes(self, values: Floats) -> Floats:
        """(k,) ``Model.size`` of points."""
        *_, gyrations = self._of_bodies(values)
        return np.broadcast_to(self._scales(gyrations, values).size, len(values))

    def states(self, values: Floats, u0: Floats) -> Floats:
        """Integrated states (k, ...) to start from; u0 (13 n,) is that of the scene."""
        u = np.repeat(u0[None], len(values), axis=0)
        r, p, v, w = (part.copy() for part in split(u))
        parts = {"r": r, "r_dot": v, "w": w}
        for parameter, value in zip(self.parameters, values.T, strict=True):
            path = parameter.path
            if path[0] == "bodies" and path[2] in parts:
                body = self._checked.body_index[path[1]] - 1
                parts[path[2]][:, body, parameter.index[0]] = value
        return y_from_u(join(r, p, v, w), states=self._evaluator.model.initial_states)

    def set_states(self, y0: Floats, values: Floats) -> None:
        """Set the initial values of elements' states that vary, in states y0 (k, ...)."""
        model = self._evaluator.model
        first = model.integrated_layout["states"].start
        for parameter, value in zip(self.parameters, values.T, strict=True):
            table, name, field = (*parameter.path, "", "")[:3]
            for state in model.element_states:
                own = (f"{state.kind}s", state.element, f"{state.name}{INITIAL}")
                if (table, name, field) == own:
                    component = parameter.index[0] if parameter.index else 0
                    y0[:, first + state.first + component] = value

    def are_undefined(self, table: Floats, y0: Floats, sizes: Floats) -> Booleans:
        """Points, of these sizes, at whose start y0 (k, ...) a direction is undefined."""
        evaluator, count = self._evaluator, len(table)
        first_of = {id(group): first for group, first in self._groups()}

        def numbers_of(group: Group) -> Floats:
            first, size = first_of[id(group)], group.numbers.size
            numbers = np.repeat(group.numbers.reshape(1, -1), count, axis=0)
            own = (self.places >= first) & (self.places < first + size)
            numbers[:, self.places[own] - first] = table[:, own]
            return numbers.reshape(count, *group.numbers.shape)

        u = u_from_y(y0, evaluator.model.state_count)
        return are_undefined(evaluator.model, u, numbers_of, float(np.max(sizes, initial=0.0)))

    def _mapped(self, parameter: SceneParameter) -> MappedParameter:
        table = parameter.table
        if table == "bodies":
            return self._of_body(parameter)
        if table == "points":
            return self._of_point(parameter)
        if table in ("joints", "forces", "functions"):
            return self._of_element(parameter)
        raise NotCopiedError

    def _of_body(self, parameter: SceneParameter) -> MappedParameter:
        path, index = parameter.path, parameter.index
        _, name, field = path
        body = self._checked.body_index[name]
        read = {part for one in self._elements for b, part in self._reads(one).poses if b == body}
        by_mass = str(self._checked.scene.simulation.correct_metric) == "mass"
        if field == "mass":
            limits = FieldSpec("number", 1.0, positive=True)
            return MappedParameter(path, index, limits=limits, moves_start=by_mass)
        if field not in ("Jp", *STATES) or field in read or len(index) != 1:
            raise NotCopiedError  # two entries of a whole inertia matrix would have to change
        return MappedParameter(path, index, moves_start=field != "Jp" or by_mass)

    def _of_point(self, parameter: SceneParameter) -> MappedParameter:
        targets: list[int] = []
        moves_start = False
        for instance in self._elements:
            for field in _point_fields(self._checked, instance, parameter.path[1]):
                if field in self._reads(instance).fields:
                    raise NotCopiedError
                targets += self._targets(instance, field, parameter.index)
                moves_start = moves_start or instance in self._checked.joints
        return MappedParameter(
            parameter.path, parameter.index, tuple(targets), moves_start=moves_start
        )

    def _of_element(self, parameter: SceneParameter) -> MappedParameter:
        table, name, field = parameter.path
        instance = next((i for i in getattr(self._checked, table) if i.name == name), None)
        if instance is None:  # a rigid stop, which is a contact
            raise NotCopiedError
        type_: Any = instance.type_info.type
        spec = specs_of(type_).get(field)
        if spec is None or spec.kind not in ("number", "vec3"):
            raise NotCopiedError
        if type_.prepare_functions is not TypeBase.prepare_functions:
            raise NotCopiedError
        if table == "joints":
            model = self._evaluator.model
            assert model.joint_angles is not None
            if model.joint_names.index(name) in model.joint_angles.coordinates[:, 0]:
                raise NotCopiedError  # the axis of its angle may depend on the number
        if field.endswith(TOLERANCE) and field.removesuffix(TOLERANCE) in type_.state_lengths():
            raise NotCopiedError
        # with another value another variant may apply
        selects_variant = any(field in conditions for conditions, _ in type_.variants)
        if selects_variant or field in self._reads(instance).fields:
            raise NotCopiedError
        if table == "functions" and not self._is_smooth_in_time(instance):
            raise NotCopiedError
        targets = tuple(self._targets(instance, field, parameter.index))
        limits = spec if spec.kind == "number" else None
        return MappedParameter(parameter.path, parameter.index, targets, limits, table != "forces")

    def _is_smooth_in_time(self, function: Instance) -> bool:
        """True for a function of time alone, without breaks at which a step has to end."""
        called = any(
            instance.values.get(field) == function.name
            for instance in self._elements
            for field in instance.type_info.argument_functions
        )
        type_: Any = function.type_info.type
        return not called and type_.breaks is Function.breaks

    def _reads(self, instance: Instance) -> "_Dependence":
        key = id(instance)
        if key not in self._dependence:
            n = len(self._checked.body_names)
            self._dependence[key] = dependence_of(instance, self._poses, n)
        return self._dependence[key]

    def _targets(self, instance: Instance, field: str, index: tuple[int, ...]) -> Iterator[int]:
        """Indices in par of a component of a field of an element."""
        if field in self._reads(instance).constants:
            raise NotCopiedError
        component = index[0] if index else 0
        if any(self._rows_of(instance, read).size for g, _ in self._groups() for read in g.read):
            raise NotCopiedError  # forces that read its reaction have a copy of its numbers
        for group, first in self._groups():
            spot = group.type_info.layout.numbers.get(field)
            if spot is not None:
                for k in self._rows_of(instance, group):
                    yield first + k * group.numbers.shape[1] + spot[0] + component

    def _rows_of(self, instance: Instance, group: Group) -> Integers:
        """Rows of a group whose numbers come from an element."""
        checked, kind = self._checked, group.type_info.type.kind
        has_friction = any(group is other for other in self._evaluator.model.friction)
        own: Any = ()
        if instance in checked.joints and kind == "joint":
            members = group.joints if has_friction else group.members
            own = members == checked.joints.index(instance)
        elif instance in checked.forces and (kind == "force" or has_friction):
            own = group.members == checked.forces.index(instance)
        elif instance in checked.functions and kind == "function":
            own = group.members == checked.functions.index(instance)
        return np.flatnonzero(own)

    def _groups(self) -> Iterator[tuple[Group, int]]:
        """Each group of the model that has a loop, with the index in par of its first number."""
        seen = set()
        for q, (_, group) in enumerate(self._evaluator.loop_groups):
            if id(group) not in seen:
                seen.add(id(group))
                yield group, int(self._evaluator.system.groups[q, 1])

    def _inertias(self, values: Floats) -> tuple[Floats, Floats, Floats, Booleans]:
        """Masses (k, b), inertia matrices, moments (k, b, 3) that vary; (k,) True if valid."""
        checked, count = self._checked, len(values)
        mass = np.repeat(checked.mass[self._bodies][None], count, axis=0)
        Jp = np.repeat(checked.Jp[self._bodies][None], count, axis=0)
        for parameter, value in zip(self.parameters, values.T, strict=True):
            path, index = parameter.path, parameter.index
            if path[0] == "bodies" and path[2] in ("mass", "Jp"):
                b = int(np.searchsorted(self._bodies, checked.body_index[path[1]] - 1))
                if path[2] == "mass":
                    mass[:, b] = value
                else:
                    Jp[:, b, index[0], index[0]] = value
        valid = np.all((mass >= SMALLEST_INERTIA) & (mass <= LARGEST), axis=1)
        moments = moments_of(np.where(np.abs(Jp) <= LARGEST, Jp, 0.0))
        least, middle, most = moments.T
        sound = (least > ZERO_INERTIA * most) & (most >= SMALLEST_INERTIA)
        valid &= np.all(sound & (most <= least + middle), axis=0)
        return mass, Jp, moments, valid

    def _of_bodies(self, values: Floats) -> tuple[Floats, ...]:
        """As ``_of_scene`` with a first axis (k,), where they vary and are valid."""
        if not len(self._bodies):
            return self._of_scene
        mass, Jp, moments, valid = self._inertias(values)
        mass, Jp, moments = mass[valid], Jp[valid], moments[valid]
        every = tuple(np.repeat(of[None], len(values), axis=0) for of in self._of_scene)
        for of, own in zip(every, (mass, moments, gyrations_of(mass, Jp)), strict=True):
            of[np.ix_(valid, self._bodies)] = own
        return every

    def _scales(self, gyrations: Floats, values: Floats) -> Scales:
        """Scales of points whose bodies have these radii of gyration."""
        checked, r, local = self._checked, self._checked.r, self._checked.point_local
        if self._moves_parts:
            r, local = (np.repeat(of[None], len(values), axis=0) for of in (r, local))
        for parameter, value in zip(self.parameters, values.T, strict=True):
            table, name, field = (*parameter.path, "", "")[:3]
            if table == "points":
                local[:, checked.point_names.index(name), parameter.index[0]] = value
            elif (table, field) == ("bodies", "r"):
                r[:, checked.body_index[name] - 1, parameter.index[0]] = value
        return scales_of(gyrations, r, checked.p, checked.point_body, local)

    def _has_scales_of_scene(self, values: Floats) -> Booleans:
        """(k,) True where tolerances and flags of masses are those of the scene."""
        model = self._evaluator.model
        mass, moments, gyrations = self._of_bodies(values)
        scales = self._scales(gyrations, values)
        own = mass_flags(*self._of_scene[:2], model.part_size)
        is_same = np.all(mass_flags(mass, moments, scales.part_size) == own, axis=-1)
        is_same &= scales.exponent == model.scales.exponent
        tree = self._evaluator.system.tree
        if tree is not None and np.any(tree.nodes[:, node.MOTION] == node.PRISMATIC):
            is_same &= scales.part_size == model.part_size  # it is their coordinates at the start
        return np.asarray(is_same, dtype=np.bool_)


def _point_fields(checked: ValidatedScene, instance: Instance, point: str) -> Iterator[str]:
    """Fields of an element that hold the coordinates of a declared point."""
    fields, vectors2 = instance.fields, checked.scene.vectors2
    if any(isinstance(v, list | tuple) and point in v for v in fields.values()):
        raise NotCopiedError
    for field, spec in specs_of(instance.type_info.type).items():
        if spec.kind == "point" and fields.get(field) == point:
            yield field
        if spec.kind == "vector2":
            declared = vectors2.get(fields.get(field, ""))
            for end in ("P_i", "P_j"):
                given = getattr(declared, end) if declared else fields.get(end)
                if given == point:
                    yield end


class _Dependence(NamedTuple):
    """Dependence of the constants of an element.

    Attributes:
        fields: names of its own fields that are read.
        poses: (body index, "r", "p", "A" or "Jp") that are read.
        constants: names of the constants, which are no copies of fields.
    """

    fields: frozenset[str]
    poses: frozenset[tuple[int, str]]
    constants: frozenset[str]


def dependence_of(
    instance: Instance, poses: Mapping[int, BodyPose], body_count: int
) -> _Dependence:
    """Fields and poses that ``prepare`` reads for an element; none where its type has none.

    It is run once on an element whose fields, and the bodies' poses, record that they are read.
    Nothing else can change what it returns: with other values of what was not read it takes the
    same way through its code.

    Args:
        instance: a checked element.
        poses: of each body index, ground included.
        body_count: for elements that act on each body.
    """
    type_: Any = instance.type_info.type
    fields: set[str] = set()
    read: set[tuple[int, str]] = set()
    constants: set[str] = set()
    if has_prepare(type_):
        slots = instance.type_info.layout.slots
        each = acts_on_all(type_)
        for bodies in turns_of(type_, body_count) if each else [instance.bodies]:
            recorded = {
                slot: _RecordedPose(poses[body], body, read)
                for slot, body in zip(slots, bodies, strict=True)
            }
            constants |= prepared(_recorded(instance, fields), recorded).keys()
    return _Dependence(frozenset(fields), frozenset(read), frozenset(constants))


def _recorded(instance: Instance, read: set[str]) -> Any:
    """The element as ``prepare`` gets it, of a class that records reads of its fields."""
    type_: Any = instance.type_info.type
    names = {*specs_of(type_), "P_i", "P_j"}
    initial = set(read)

    class Recorded(type_):  # type: ignore[misc]
        def __getattribute__(self, name: str) -> Any:
            if name in names:
                read.add(name)
            return super().__getattribute__(name)

    element = as_object(instance, Recorded)
    read.intersection_update(initial)  # without what its construction has read
    return element


class _RecordedPose(BodyPose):
    """A pose that records what is read of it."""

    def __init__(self, pose: BodyPose, body: int, read: set[tuple[int, str]]) -> None:
        super().__init__(pose.r, pose.p, pose.A, pose.Jp)
        object.__setattr__(self, "note", (body, read))

    def __getattribute__(self, name: str) -> Any:
        if name in ("r", "p", "A", "Jp"):
            body, read = object.__getattribute__(self, "note")
            read.add((body, name))
        return super().__getattribute__(name)
