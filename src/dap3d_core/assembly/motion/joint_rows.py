"""Rows of joints: C and J of a group, each joint at a pose of its own of body i relative to body j.

And the joints whose rows are kept whatever their poses, with the reasons in words.
"""

from inspect import signature
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.interface.codegen.compile_loops import compiled_loop
from dap3d_core.interface.codegen.instance_layout import prefix_of
from dap3d_core.interface.codegen.kernel_arguments import DERIVATIVES
from dap3d_core.interface.codegen.loop_source import stride
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.element_states import unknown_names
from dap3d_core.kernels.runtime.function_lists import LoopArrays, call_loop, loop_list
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, JP, MASS, A, P, R
from dap3d_core.model.groups import Group
from dap3d_core.model.rigid_motion import Pose, compose, identity, inverse, matrices

#: The loops in the list: C; J; the angles whose turns are counted.
POSITION, ACCELERATION, ANGLE = range(3)
_KINDS = ("position", "acceleration", "angle")
#: Rows from which on joint coordinates cost less than the body coordinates and rows they replace.
LEAST_ROWS = 3
#: Kernels of the rows themselves.
_ROWS = ("C", "C_dot", "J", "gamma", "nu")

ON_TIME = "its rows depend on time"
ON_STATES = "its rows depend on states of its own"
NOT_CLOSED = "no pose with C = 0 was found from the one given"
DEPENDENT = "its rows depend on each other where C = 0"
NOT_CONSTANT = "the axes of its free motions are constant in neither body"
NOT_INVARIANT = "its rows depend on where ground is"


class JointRows:
    """Evaluates the rows of the joints of a group, apart from the mechanism that they belong to.

    Every joint has two bodies of its own. Where one of them is ground it stays there.

    Attributes:
        count, row_count: joints, and rows of each.
        length: m, the unit of displacements: velocities of twists and gradients are in units of it.
    """

    def __init__(self, group: Group, mass: Floats, Jp: Floats, length: float = 1.0) -> None:
        """Args:
        group: joints of one or two bodies.
        mass: (n + 1,) kg, of the bodies and, first, of ground.
        Jp: (n + 1, 3, 3) their inertia matrices in body axes, kg m^2.
        length: m, a length of the scene.
        """
        self.length, self.count = length, group.count
        self.row_count = int(group.type_info.type.rows)  # type: ignore[attr-defined]
        self._slots = len(group.type_info.layout.slots)
        m, bodies = self.count, group.bodies
        self._on_ground = (bodies[:, 1] == 0) if self._slots == 2 else np.ones(m, dtype=bool)
        self._from_ground = bodies[:, 0] == 0
        rows = 1 + np.arange(m)[:, None] + m * np.arange(self._slots)  # in ``_body``, by slot
        self._body = np.zeros((1 + rows.size, BODY_WIDTH))
        self._body[0, A : A + 9 : 4] = self._body[0, P] = 1.0
        self._body[rows, MASS] = mass[bodies]
        self._body[rows[..., None], np.arange(JP, JP + 9)] = Jp[bodies].reshape(*rows.shape, 9)
        idx = self._integers(group, np.where(bodies == 0, 0, rows))
        # no joint here has a function of time: all rows of F are that of none
        functions = np.zeros((1 + int(np.max(group.functions, initial=0)), 5))
        par = group.packed_numbers(0)
        # nor do its rows depend on states of its own
        states = np.zeros(group.type_info.layout.state_width)
        self._arrays = LoopArrays(
            body=self._body, F=functions, idx=idx.ravel(), par=par, states=states
        )
        found = [compiled_loop(group.type_info, kind) for kind in _KINDS]
        self._has_angles = found[ANGLE] is not None
        self._loops = loop_list([loop for loop in found if loop is not None])
        self._group = np.array([0, 0, m], dtype=np.int64)
        self._out = [np.zeros(6 * self.row_count * self._slots * m) for _ in range(3)]

    def _integers(self, group: Group, rows: Integers) -> Integers:
        """The rows of ``idx`` (loop_source.py), with the bodies' rows in ``_body`` (m, slots)."""
        others = group.functions.copy()
        for column in range(len(group.type_info.layout.functions), others.shape[1]):
            for slot in range(self._slots):  # bodies of vectors of no slot
                same = group.functions[:, column] == group.bodies[:, slot]
                others[same, column] = rows[same, slot]
        place = np.arange(self.count)[:, None]
        blocks = 6 * self.row_count * (place * self._slots + np.arange(self._slots))
        first = np.zeros((self.count, int(bool(group.type_info.layout.states))), np.int64)
        idx: Integers = np.hstack([rows, others, first, place * self.row_count, blocks])
        assert idx.shape[1] == stride(group.type_info)
        return idx

    def place(self, pose: Pose, base: Pose | None = None) -> None:
        """Set the poses of bodies i relative to bodies j (m), of which ``base`` are the poses."""
        m = self.count
        ground = identity(m)
        base = ground if base is None else base
        for held, at in ((self._on_ground, ground), (self._from_ground, inverse(pose))):
            held = held[:, None]
            base = Pose(np.where(held, at.r, base.r), np.where(held, at.p, base.p))
        for slot, at in enumerate((compose(base, pose), base)[: self._slots]):
            rows = self._body[1 + m * slot : 1 + m * (slot + 1)]
            rows[:, R : R + 3], rows[:, P : P + 4] = at.r, at.p
            rows[:, A : A + 9] = matrices(at.p).reshape(m, 9)

    def count_turns(self) -> None:
        """Count the turns of angles from the poses set last."""
        if self._has_angles:
            self._out[1][0] = 1.0  # they are kept
            self._call(ANGLE)

    def residuals(self) -> Floats:
        """C (m, rows) at the poses set last."""
        self._out[0][:] = 0.0
        self._call(POSITION)
        return self._out[0][: self.count * self.row_count].reshape(self.count, -1).copy()

    def gradients(self) -> Floats:
        """(m, rows, 6) C for twists of body i, in units of ``length``, at the poses set last."""
        for out in self._out:
            out[:] = 0.0
        self._call(ACCELERATION)
        J = self._out[0].reshape(self.count, self._slots, self.row_count, 6)[:, 0]
        turn = self._body[1 : 1 + self.count, A : A + 9].reshape(-1, 3, 3)
        return np.concatenate([self.length * (J[:, :, :3] @ turn), J[:, :, 3:] @ turn], axis=-1)

    @np.errstate(all="ignore")  # as compiled code: numbers are looked at afterwards
    def _call(self, loop: int) -> None:
        call_loop(self._loops, loop, 0.0, self._arrays, self._group, *self._out)


def refusal_of(type_info: TypeInfo) -> str:
    """The reason why no joint of a type has a known motion, from its declaration; "" for none."""
    type_: Any = type_info.type
    slots = len(type_info.layout.slots)
    if slots > 2:
        return f"it joins {('three', 'four')[slots - 3] if slots < 5 else slots} bodies"
    if unknowns := unknown_names(type_):
        return f"it has unknowns of its own: {', '.join(unknowns)}"
    if type_.velocity_rows():
        return "it has rows of the velocity level"
    if "t" in _names_in_rows(type_info):
        return ON_TIME
    if _names_in_rows(type_info) & type_info.layout.states.keys():
        return ON_STATES
    if type_.rows < LEAST_ROWS:
        rows = "1 row costs" if type_.rows == 1 else f"{type_.rows} rows cost"
        return f"its {rows} less than {6 - type_.rows} joint coordinates"
    return ""


def refused_joints(group: Group) -> dict[int, str]:
    """Reasons for joints of a group by their places in the model; those that have one."""
    reasons: dict[int, str] = {}
    if reason := refusal_of(group.type_info):
        reasons = dict.fromkeys(group.members.tolist(), reason)
    return reasons | dict.fromkeys(group.members[_depends_on_time(group)].tolist(), ON_TIME)


def two_bodies(group: Group) -> Integers:
    """(m, 2) the bodies of the two slots; ground where a type has one."""
    bodies = np.zeros((group.count, 2), dtype=np.int64)
    bodies[:, : group.bodies.shape[1]] = group.bodies
    return bodies


def two_slots(group: Group) -> tuple[str, str]:
    """The slots of the two bodies; "ground" where a type has one."""
    i, j = (*group.type_info.layout.slots, "ground")[:2]
    return i, j


def _depends_on_time(group: Group) -> Any:
    """(m,) True for joints whose rows take a function of time that they are given."""
    names = _names_in_rows(group.type_info)
    depends = np.zeros(group.count, dtype=bool)
    for column, field in enumerate(group.type_info.layout.functions):
        f = prefix_of(group.type_info.type, field)
        if names & {field, *(f"{f}{suffix}" for suffix in (*DERIVATIVES, "_0"))}:
            depends |= group.functions[:, column] > 0
    return depends


def _names_in_rows(type_info: TypeInfo) -> set[str]:
    kernels = (k for n, k in type_info.kernels.items() if n in _ROWS)
    return {name for kernel in kernels for name in signature(kernel).parameters}
