"""The model: a checked scene as integers and arrays. No names are looked up after this layer.

Coordinates stand in the state u in the order of the manual: r, p of every body, then r_dot, omega
of every body.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.interface.codegen.reactions import joint_fields
from dap3d_core.interface.types import BodyPose, pose
from dap3d_core.model.groups import Floats, Group, Grouping, Integers, PrepareError
from dap3d_core.model.joint_angles import JointAngles, joint_angle_name
from dap3d_core.model.rotations import read_only
from dap3d_core.model.scales import (
    LATER,
    LONGEST,
    ORDINARY,
    Scales,
    gyrations_of,
    scales_of,
)
from dap3d_core.model.state_layout import (
    COORDINATES,
    VELOCITIES,
    Layout,
    integrated_layout,
    report_layout,
    row_layout,
    split,
    state_layout,
)
from dap3d_core.scene import ValidatedScene
from dap3d_core.scene.contacts.collision_shapes import CollisionShapes
from dap3d_core.scene.validate.validated_scene import Bodies

if TYPE_CHECKING:
    from dap3d_core.model.element_states import ElementState
    from dap3d_core.scene.expressions.expression import Expression


@attrs.frozen(eq=False)
class Model(Bodies):
    """A scene as the solvers take it: its bodies as given, and what acts on them.

    Attributes:
        joint_names, force_names, function_names: in file order, for reports.
        joint_rows: (joints,) rows of each joint.
        joint_start: (joints + 1,) first row of each joint in C, nu, gamma and lambda.
        joint_slots: bodies of each joint by slot, ground 0, in file order.
        position_row: (rows,) True where a row has an equation at position level.
        joints, forces, functions: groups of instances of one type; of the functions those of time
            that an element uses.
        friction: groups of joints' own friction, switched on by forces.
        function_count: number of functions and inputs; F has one row more, for the absent one.
        input_names: in file order.
        input_rows, input_values: (inputs,) their rows of F, and their values at the start of a run.
        point_names, point_body (points,), point_local (points, 3): for rP; animation points last.
        notes: what types warned about.
        contact_laws: (contacts,) law of impact of each point of contact; they are the last joints.
        collisions: the shapes that collide; None where there are none.
        breaks: of joints that may be released, name -> N at which they break; inf: not by itself.
        active: of those that hold only while an expression is positive, that.
        motions: of the joints (assembly/motion); joint_angles: those that are counted. None until
            they are looked for.
    """

    joint_names: tuple[str, ...]
    force_names: tuple[str, ...]
    function_names: tuple[str, ...]
    joint_rows: Integers
    joint_start: Integers
    joint_slots: tuple[tuple[int, ...], ...]
    position_row: np.ndarray
    joints: tuple[Group, ...]
    forces: tuple[Group, ...]
    functions: tuple[Group, ...]
    friction: tuple[Group, ...]
    function_count: int
    point_names: tuple[str, ...]
    point_body: Integers
    point_local: Floats
    notes: tuple[str, ...] = ()
    input_names: tuple[str, ...] = ()
    input_rows: Integers = attrs.field(factory=lambda: np.zeros(0, dtype=np.int64))
    input_values: Floats = attrs.field(factory=lambda: np.zeros(0))
    motions: Any = None
    joint_angles: JointAngles | None = None
    contact_laws: tuple[str, ...] = ()
    collisions: CollisionShapes | None = None
    breaks: Mapping[str, float] = attrs.Factory(dict)
    active: Mapping[str, "Expression"] = attrs.Factory(dict)

    @property
    def contact_count(self) -> int:
        """Number of points of contacts: they are the last of the joints."""
        return len(self.contact_laws)

    @property
    def loaded_contacts(self) -> list[int]:
        """Places of contacts that are friction of a joint by its load, among the joints."""
        loaded = (group for group in self.contacts if group.loaded is not None)
        return [k for group in loaded for k in group.members.tolist()]

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Names of points of contacts, ``NAME#1`` of those of several."""
        return tuple(self.joint_names[len(self.joint_names) - self.contact_count :])

    @property
    def contacts(self) -> tuple[Group, ...]:
        """Groups of joints that are contacts."""
        return tuple(group for group in self.joints if group.type_info.type.is_contact)

    @property
    def joint_row_count(self) -> int:
        """Number of rows of joints that are no contacts: the first of all."""
        return self.row_count - 3 * self.contact_count

    @property
    def body_count(self) -> int:
        """Number of bodies, ground not counted."""
        return len(self.body_names)

    @property
    def row_count(self) -> int:
        """Number of constraint rows."""
        return int(self.joint_start[-1])

    @cached_property
    def own_angle_count(self) -> int:
        """Number of angles of their own that forces and joints count."""
        return sum(g.count * len(g.type_info.layout.angles) for g in self.acting)

    @property
    def joint_angle_count(self) -> int:
        """Number of angles between the bodies of joints."""
        return 0 if self.joint_angles is None else self.joint_angles.count

    @property
    def angle_count(self) -> int:
        """Number of angles whose turns are counted: those of elements, then those of joints."""
        return self.own_angle_count + self.joint_angle_count

    def angles_of(self, group: Group, places: Integers) -> Integers:
        """(k, angles) where those of instances of a group stand among all that are reported."""
        first, width = 0, len(group.type_info.layout.angles)
        for other in self.acting:
            if other is group:
                break
            first += other.count * len(other.type_info.layout.angles)
        return first + width * np.asarray(places)[:, None] + np.arange(width)

    @cached_property
    def angle_names(self) -> tuple[str, ...]:
        """Names of the angles whose turns are counted, in the order in which they are reported."""
        own = (
            f"{kind}s.{names[int(k)]}.{angle}"
            for kind, names, groups in (
                ("force", self.force_names, self.forces),
                ("joint", self.joint_names, self.joints),
            )
            for group in groups
            for k in group.members
            for angle in group.type_info.layout.angles
        )
        found = self.joint_angles.coordinates.tolist() if self.joint_angles else []
        return (*own, *(joint_angle_name(self.joint_names[joint], k) for joint, k in found))

    def unknowns_of(self, joint: str) -> dict[str, int]:
        """Unknowns of a joint -> where they stand among the angles that are reported."""
        names = {n for group in self.joints for n in group.type_info.layout.unknowns}
        places = enumerate(self.angle_names)
        prefix = f"joints.{joint}."
        found = {label.removeprefix(prefix): k for k, label in places if label.startswith(prefix)}
        return {name: k for name, k in found.items() if name in names}

    @cached_property
    def state_count(self) -> int:
        """Numbers of the states of their own that forces and joints have."""
        return sum(g.type_info.layout.state_width * g.count for g in self.acting)

    @cached_property
    def element_states(self) -> "tuple[ElementState, ...]":
        """The states of forces, then of joints, in the order in which they are integrated."""
        if not self.state_count:
            return ()
        from dap3d_core.model.element_states import states_of

        return states_of(self.acting, {"joint": self.joint_names, "force": self.force_names})

    @property
    def state_labels(self) -> list[str]:
        """(states,) names of the numbers of these."""
        return [label for state in self.element_states for label in state.labels]

    @cached_property
    def initial_states(self) -> Floats:
        """(states,) initial values of the states of elements."""
        if not self.state_count:
            return read_only(np.zeros(0))
        from dap3d_core.model.element_states import initial_values

        return read_only(initial_values(self.acting))

    @property
    def acting(self) -> tuple[Group, ...]:
        """Groups of what may have angles or states, in the order of the loops."""
        return (*self.forces, *self.joints)

    @cached_property
    def iterated_forces(self) -> tuple[str, ...]:
        """Names of forces that depend on multipliers: friction of joints, forces on reactions."""
        groups = (*self.friction, *(group for group in self.forces if group.read))
        names = (self.force_names[k] for group in groups for k in group.members.tolist())
        return (*names, *self.contact_names)

    @cached_property
    def brought_forces(self) -> dict[str, str]:
        """Joint -> the force that it brings (``Joint.brings``), whose name holds a dot."""
        return {name.partition(".")[0]: name for name in self.force_names if "." in name}

    @property
    def integrated_layout(self) -> Layout:
        """Layout of the integrated state y, in coordinates of bodies."""
        return integrated_layout(self.body_count, self.state_count)

    @property
    def report_layout(self) -> Layout:
        """Layout of what is reported in addition to the state."""
        inputs = len(self.input_names)
        return report_layout(self.body_count, self.row_count, self.angle_count, inputs)

    @property
    def row_layout(self) -> Layout:
        """Layout of a reported row."""
        states, inputs = self.state_count, len(self.input_names)
        return row_layout(self.body_count, self.row_count, self.angle_count, states, inputs)

    @cached_property
    def irc(self) -> Integers:
        """(n,) index in u of the first coordinate of each body (r, then p)."""
        return read_only(COORDINATES * np.arange(self.body_count, dtype=np.int64))

    @cached_property
    def iru(self) -> Integers:
        """(n,) index in u of the first velocity of each body (r_dot, then omega)."""
        return read_only(state_layout(self.body_count)["velocities"].start + self.irv)

    @cached_property
    def irv(self) -> Integers:
        """(n,) index in v_dot, column in the Jacobian, of the first acceleration of each body."""
        return read_only(VELOCITIES * np.arange(self.body_count, dtype=np.int64))

    @cached_property
    def u0(self) -> Floats:
        """(13 n,) the state as given, p of unit length."""
        coordinates = np.hstack([self.r, self.p]).ravel()
        return read_only(np.concatenate([coordinates, np.hstack([self.r_dot, self.w]).ravel()]))

    @cached_property
    def scales(self) -> Scales:
        """Lengths of the model, m."""
        gyrations = gyrations_of(self.mass, self.Jp)
        return scales_of(gyrations, self.r, self.p, self.point_body, self.point_local)

    @property
    def size(self) -> float:
        """Largest distance of the model from the origin, m; if that is zero, its extent."""
        return float(self.scales.size)

    @property
    def extent(self) -> float:
        """A length of the model, m, wherever it lies: the diagonal of the box about its points.

        Of one point its largest radius of gyration; one metre where there is no body.
        """
        return float(self.scales.extent)

    @property
    def part_size(self) -> float:
        """The size of the largest part, m: arm or radius of gyration of a body, up to the extent.

        A chain of a thousand links has errors as one of ten.
        """
        return float(self.scales.part_size)

    @property
    def length(self) -> float:
        """The length, m, that tolerances speak of: 1 in ordinary scenes, else a power of ten."""
        return float(10.0**self.scales.exponent)

    @cached_property
    def reach(self) -> float:
        """The length, m, of which positions have the rounding: ``length``, or the distance."""
        farthest = float(np.max(np.abs(self.r), initial=0.0))
        return farthest if farthest > ORDINARY[1] * self.length else self.length

    def time(self, forces: Callable[[float], Floats]) -> float:
        """The time, s, that tolerances speak of: a power of ten, 1 of ordinary scenes.

        In that time the start would change by as much as the size of the parts: by its velocities,
        and by what forces do to bodies without joints, which may hold all at first; where nothing
        moves so, by forces that act later. Motions of a scene of ordinary size that are quicker
        than ordinary need no other limits.

        Args:
            forces: gives (n, 6) force and moment on each body, placed as at the start, at t, s.
        """
        of_turning = np.linalg.norm(self.Jp, ord=2, axis=(-2, -1))[:, None]
        _, _, v, w = split(self.u0)

        def fastest(t: float) -> float:
            wrench = forces(t)
            with np.errstate(over="ignore"):  # such a motion is refused by its accelerations
                moving = np.array([v, wrench[:, :3] / self.mass[:, None]]) / self.part_size
                turning = np.array([w, wrench[:, 3:] / of_turning])
                rates = np.linalg.norm([moving, turning], axis=-1).max(axis=(0, -1), initial=0.0)
            return float(max(rates[0], np.sqrt(rates[1])))

        rate = fastest(0.0)
        if not rate > 1.0 / LONGEST:
            later = LATER if self.functions else ()
            rate = next((1.0 / t for t in later if fastest(t) * t >= 1.0), 1.0)
        least = ORDINARY[0] if self.length != 1.0 else 0.0
        if not 1.0 / LONGEST < rate < LONGEST or least <= 1.0 / rate <= ORDINARY[1]:
            return 1.0
        return float(10.0 ** -np.round(np.log10(rate)))

    def row_owner(self, row: int) -> str:
        """Name of the joint that a constraint row belongs to."""
        return self.row_owners([row])[0]

    def row_owners(self, rows: ArrayLike) -> list[str]:
        """Names of the joints that constraint rows belong to, each once, in file order."""
        owners = np.searchsorted(self.joint_start, rows, side="right") - 1
        return [self.joint_names[k] for k in np.unique(owners)]


class ModelError(ValueError):
    """Types refuse elements of the scene.

    Attributes:
        faults: (kind, name of the element, the type's own words) of each.
    """

    def __init__(self, *faults: tuple[str, str, str]) -> None:
        super().__init__(*faults)
        self.faults = faults


def build_model(checked: ValidatedScene) -> Model:
    """Turn a checked scene into a model.

    Raises:
        ModelError: the ``prepare`` of types refuses elements: all of them.
        PluginError: the ``prepare`` of a type failed.
    """
    poses = ReferencePoses(checked)
    holding = checked.holding
    rows = np.array([j.type_info.row_count for j in holding], dtype=np.int64)
    mask = [j.type_info.type.constraint_mask() for j in holding]  # type: ignore[attr-defined]
    groups = _Groups(checked, poses)
    model = Model(
        **{field.name: getattr(checked, field.name) for field in attrs.fields(Bodies)},
        joint_names=tuple(j.name for j in holding),
        force_names=tuple(f.name for f in checked.forces),
        function_names=tuple(f.name for f in checked.functions),
        joint_rows=rows,
        joint_start=np.concatenate([[0], np.cumsum(rows)]).astype(np.int64),
        joint_slots=tuple(j.bodies for j in holding),
        position_row=np.array([there for m in mask for there in m], dtype=bool),
        joints=groups.joints,
        forces=groups.forces,
        functions=groups.functions,
        friction=groups.friction,
        function_count=len(checked.functions) + len(checked.inputs),
        point_names=tuple(checked.point_names),
        point_body=checked.point_body,
        point_local=checked.point_local,
        notes=tuple(groups.notes),
        input_names=tuple(checked.inputs),
        input_rows=1 + len(checked.functions) + np.arange(len(checked.inputs)),
        input_values=np.array(list(checked.inputs.values()), dtype=float),
        collisions=checked.collisions,
        contact_laws=tuple(contact.values["law"] for contact in checked.contacts),
        breaks={j.name: j.breaks_at for j in checked.joints if j.breaks_at is not None},
        active={j.name: j.active for j in checked.joints if j.active is not None},
    )
    for value in attrs.astuple(model, recurse=False):
        if isinstance(value, np.ndarray):
            read_only(value)
    return model


class _Groups:
    """The groups of a scene's elements; each kind names its own elements where one is refused."""

    def __init__(self, checked: ValidatedScene, poses: "ReferencePoses") -> None:
        n = len(checked.body_names)
        kinds = ("joint", "force", "function")
        by_kind = {k: Grouping(k, poses, n, checked.functions) for k in kinds}
        names = {"joint": checked.holding, "force": checked.forces, "function": checked.functions}
        every = (*checked.holding, *checked.forces)
        used = {place for instance in every for place in instance.functions}
        functions = [k for k in range(len(checked.functions)) if k + 1 in used]
        through = [(k, f) for k, f in enumerate(checked.forces) if f.type_info.friction_joint]
        direct = [k for k, f in enumerate(checked.forces) if not f.type_info.friction_joint]
        joints = {j.name: (k, j) for k, j in enumerate(checked.holding)}
        index = {name: k for name, (k, _) in joints.items()}
        faults: list[tuple[str, str, str]] = []

        def made(kind: str, make: Callable[[], tuple[Group, ...]]) -> tuple[Group, ...]:
            """Groups; none, and faults with the names of elements of a kind, if types refuse."""
            try:
                return make()
            except PrepareError as error:
                known = names[kind]
                faults.extend((kind, known[member].name, words) for member, words in error.faults)
                return ()

        def groups(kind: str, places: Sequence[int]) -> tuple[Group, ...]:
            return by_kind[kind].groups([names[kind][k] for k in places], places)

        self.joints = made("joint", lambda: by_kind["joint"].loaded_groups(checked.holding, index))
        are_good = not faults
        self.forces = made("force", lambda: groups("force", direct))
        self.functions = made("function", lambda: groups("function", functions))
        if not faults and any(joint_fields(group.type_info.type) for group in self.forces):
            from dap3d_core.model.reaction_groups import bound_to_joints

            of = self.forces, checked.forces, self.joints, checked.joints
            self.forces = made("force", lambda: bound_to_joints(*of))
        friction = by_kind["joint"].friction
        self.friction = made("force", lambda: friction(through, joints)) if are_good else ()
        if faults:
            raise ModelError(*faults)
        self.notes = [note for grouping in by_kind.values() for note in grouping.notes]


class ReferencePoses(dict[int, BodyPose]):
    """Reference poses by body index, ground included, made when a type's ``prepare`` asks."""

    def __init__(self, checked: ValidatedScene) -> None:
        super().__init__({0: pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))})
        self._checked = checked

    def __missing__(self, body: int) -> BodyPose:
        checked, k = self._checked, body - 1
        made = pose(checked.r_0[k], checked.p_0[k], checked.Jp[k])
        self[body] = made
        return made
