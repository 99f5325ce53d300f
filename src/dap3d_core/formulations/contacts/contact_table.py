"""The contacts of a model by their numbers, and what they say of themselves at a state."""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return, no-untyped-call"

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import System
from dap3d_core.assembly.evaluate import zero
from dap3d_core.formulations.contacts.contact_arrays import (
    ContactArrays,
    ContactOutputs,
    contact_arrays,
)
from dap3d_core.formulations.contacts.forces import still_speed
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.formulations.switches import POSITION_ROUNDING
from dap3d_core.interface.codegen.compile_loops import compiled_loop
from dap3d_core.interface.contacts.rows import STILL, STILL_IN_ELLIPSE, direction
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.runtime.function_lists import loop_list

#: Numbers that the kernel ``tension`` of a contact returns (interface/contacts/rows.py), from
#: these on: gap, normal force, friction, slip, point of contact, reach, force.
GAP, NORMAL, FRICTION, SLIP, PLACE, REACH, FORCE, WIDTH = 0, 1, 2, 5, 8, 11, 12, 15
#: Those of a law of friction of its own, behind them: coefficients that slide, and that stick.
SLIDING, STICKING, LAW_WIDTH = 0, 2, 4
#: Columns of ``ContactOutputs.groups`` behind those of a group of loops.
NUMBERS, FIRST = 3, 4


class ContactTable:
    """The contacts of a model by their numbers, in the order of the model.

    Attributes:
        names: of each point of contact.
        mu, mu_s, e: (m,) coefficients of friction, along the first tangent, and restitution.
        ratio, ratio_s: (m,) the same along the second tangent, as parts of them: 1 but in ellipses.
        newton: (m,) True where the law of impact is Newton's.
        turns: (m,) 1 of those whose gap or slip is an angle, 0 of others.
        length: (m,) what limits of gaps are multiplied by: the length of the scene, m; 1 rad of
            those that turn.
        speed: (m,) the same of speeds: that length in the time of the scene.
        rounding: (m,) m, of gaps.
        arm: (m,) m, of those that turn: on it their angles are gaps and slip, as of the others; 1.
        movable: (m,) True of those that a scene may have moved until they touch.
        alone: (m,) True of friction without a gap: of joints.
        holds: (m, 3) True of the rows that act where it sticks.
        gapless: (m,) 1 where the first row is one of slip, and not along a normal; else 0.
        says, tensions: what they say of themselves, and the loops that find it.
        loads: contact -> rows of the joint whose load its friction has, and whether they push.
        under: (m,) of what resists rolling the contact that presses, which is before it; else -1.
        mode, way, near: (m,), (m, 3), (m, 3) where each has them among the states of elements.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        """Args: the evaluator of the model."""
        model = evaluator.model
        self.evaluator, self.count = evaluator, model.contact_count
        first = len(model.joint_names) - self.count
        self.names = model.contact_names
        self.turns = np.zeros(self.count)
        self.alone = np.zeros(self.count, dtype=bool)
        self.holds = np.ones((self.count, 3), dtype=bool)
        self.loads: dict[int, tuple[Integers, bool]] = {}
        self.under: Integers = np.full(self.count, -1)
        self.newton = np.array([law == "newton" for law in model.contact_laws], dtype=bool)
        self.numbers = {name: np.zeros(self.count) for name in ("mu", "mu_s", "e")}
        self.movable = np.array(["#" not in name for name in self.names], dtype=bool)
        self.ratio, self.ratio_s = np.ones((2, self.count))
        self.mode = np.zeros(self.count, dtype=np.int64)
        self.switches: Integers = np.zeros((self.count, 2), dtype=np.int64)
        groups, order, loops = [], list[int](), []
        places = {(s.element, s.name): s.first for s in model.element_states if s.kind == "joint"}
        for group in model.contacts:
            which = group.members - first
            type_: Any = group.type_info.type
            self.turns[which], self.alone[which] = type_.at is None, type_.is_friction_alone()
            self.holds[which] = type_.holds
            if group.loaded is not None and type_.resists:
                self.under[which] = group.loaded - first
            elif group.loaded is not None:
                starts = model.joint_start[group.loaded][:, None] + type_.load
                self.loads |= {int(c): (rows, type_.pushes)
                               for c, rows in zip(which, starts, strict=True)}  # fmt: skip
            self.movable[which] &= not type_.is_smooth
            for name, values in self.numbers.items():
                values[which] = group.number(name)
            self.mode[which] = [places[self.names[k], "mode"] for k in which]
            q = next(q for q, (kind, g) in enumerate(evaluator.loop_groups)
                     if g is group and kind == "switch")  # fmt: skip
            loops.append(compiled_loop(group.type_info, "tension"))
            width = WIDTH + LAW_WIDTH * type_.has_law()
            groups.append([*evaluator.system.groups[q], width, len(order)])
            order += which.tolist()
        self.tensions: Any = loop_list(loops)
        sizes = [group[2] * group[NUMBERS] for group in groups]
        self.says = ContactOutputs(
            groups=np.array(groups, dtype=np.int64).reshape(-1, FIRST + 1),
            which=np.array(order, dtype=np.int64), found=np.zeros((self.count, WIDTH)),
            values=np.zeros(max(sizes, default=0)), place=np.zeros(1),
        )  # fmt: skip
        self.length = np.where(self.turns > 0.0, 1.0, model.length)
        self.arm, self.speed = model.length / self.length, self.length / evaluator.time
        reach = np.where(self.turns > 0.0, model.length, model.reach)
        self.rounding = POSITION_ROUNDING * reach
        self.gapless = (self.alone & self.holds[:, 0]).astype(float)
        self.way: Integers = self.mode[:, None] + np.arange(1, 4)
        self.near: Integers = self.mode[:, None] + np.arange(4, 7)
        self.mu, self.mu_s, self.e = (self.numbers[n] for n in ("mu", "mu_s", "e"))
        for k, switch in enumerate(evaluator.switches):
            if switch.is_contact:
                place = int(switch.group.members[switch.place]) - first
                self.switches[place, switch.part] = k

    def arrays(self, rounds: int = 0) -> ContactArrays:
        """Those of compiled code, with the coefficients of the table.

        rounds: of an impact that are kept.
        """
        evaluator, model = self.evaluator, self.evaluator.model
        names = ("e", "ratio", "ratio_s", "gapless", "arm", "turns", "says", "switches", "rounding")
        given = {name: getattr(self, name) for name in names}
        slots = model.joint_slots[len(model.joint_names) - self.count :]
        places, order = evaluator.system.row, np.zeros(evaluator.plan.row_size, dtype=np.int64)
        order[places] = np.arange(len(places))
        s = contact_arrays(self.count, model.joint_row_count, len(self.loads), rounds, given | {
            "mu": self.mu / self.arm,
            "mu_s": self.mu_s / self.arm,
            "length": self.length * self.arm,
            "speed": self.speed * self.arm,
            "newton": self.newton.astype(np.int64),
            "alone": self.alone.astype(np.int64),
            "under": self.under,
            "holds": self.holds.astype(np.int64),
            "state": self.mode,
            "frame_body": np.array([one[0] or one[1] for one in slots], dtype=np.int64),
            "frame_sign": np.array([1.0 if one[0] else -1.0 for one in slots]),
            "model_row": order,
            "y": evaluator.integrated(model.u0),
            "v": np.zeros(6 * model.body_count),
            "report": np.zeros(evaluator.report_size),
        })  # fmt: skip
        for c, (rows, pushes) in self.loads.items():
            s.load_row[c], s.load_count[c], s.load_pushes[c] = rows[0], len(rows), pushes
        return s

    @IGNORE_FLOAT_ERRORS
    def outputs(self, t: float, u: Floats, Lam: Floats | None = None) -> Floats:
        """(m, WIDTH) what each contact says of itself at a state u (13 n,), with these multipliers.

        The states of elements are those of the evaluator. Lam: (rows,) in the order of the model.
        """
        evaluator, s = self.evaluator, self.evaluator.system
        evaluator.place(t, u)
        minus_lambda = np.zeros_like(s.multipliers)
        if Lam is not None:
            minus_lambda[s.row] = -Lam
        put_outputs(float(t), self.says, minus_lambda, s, self.tensions)
        return self.says.found.copy()

    def across(self, c: int) -> slice:
        """The rows of slip of a contact."""
        return slice(0 if self.gapless[c] else 1, 3)

    def put_directions(self, s: ContactArrays) -> None:
        """Slips of what slides along its friction: of slow ones the first direction has a part.

        They are as fast as what is not at rest: friction acts along them, however slow they are.
        """
        states = self.evaluator.states
        for c in np.flatnonzero((states[self.mode] == 1.0) & ~self.alone).tolist():
            frame, slip = s.frames[c], s.slip[c] @ s.frames[c]
            still = STILL if s.ratio[c] == 1.0 else STILL_IN_ELLIPSE
            size = max(np.linalg.norm(slip), 2.0 * still_speed(s, c))
            d = direction(slip / s.arm[c], frame[0], states[self.way[c]], still)
            s.slip[c] = size * (frame @ d)


def words_of_drive(name: str, mu: float) -> str:
    """That friction of a contact is negative, or no number."""
    return (
        f"{name} would drive: its coefficient of friction, or length of what resists rolling or "
        f"spinning, is {mu:.6g} there, and such laws (grip, resist) return finite numbers that are "
        "not negative; change its numbers, or the law"
    )


@compiled
def call_tension(
    t: float, k: int, o: ContactOutputs, minus_lambda: Floats, system: System, tensions: Any
) -> None:
    """Numbers of the contacts of loop k into ``values``."""
    loop, group = tensions[k], o.groups[k]
    zero(o.values)
    o.place[0] = 0.0
    loop(t, system, group[0], group[1], group[2], pointer(o.values), pointer(o.place),
         pointer(minus_lambda))  # fmt: skip


@compiled
def put_outputs(
    t: float, o: ContactOutputs, minus_lambda: Floats, system: System, tensions: Any
) -> None:
    """What each contact says, into ``found``, with the bodies as placed."""
    for k in range(o.groups.shape[0]):
        call_tension(t, k, o, minus_lambda, system, tensions)
        width, first = o.groups[k, NUMBERS], o.groups[k, FIRST]
        for q in range(o.groups[k, 2]):
            row = o.found[o.which[first + q]]
            for i in range(WIDTH):
                row[i] = o.values[width * q + i]


@compiled
def find_grips(t: float, s: ContactArrays, system: System, tensions: Any) -> None:
    """Coefficients of contacts whose law of friction is their own, with the bodies as placed."""
    o, laws = s.says, 0
    for k in range(o.groups.shape[0]):
        laws += o.groups[k, NUMBERS] > WIDTH
    if laws == 0:
        return
    for c in range(s.state.shape[0]):  # slip of today alone has a part
        for i in range(3):
            place = s.state[c] + 1 + i
            s.kept_way[c, i], system.states[place] = system.states[place], 0.0
    for k in range(o.groups.shape[0]):
        width, first = o.groups[k, NUMBERS], o.groups[k, FIRST]
        if width > WIDTH:
            call_tension(t, k, o, system.multipliers, system, tensions)
            for q in range(o.groups[k, 2]):
                c, law = o.which[first + q], o.values[width * q + WIDTH :]
                s.mu[c], s.mu_s[c] = law[SLIDING] / s.arm[c], law[STICKING] / s.arm[c]
                s.ratio[c] = law[SLIDING + 1] / law[SLIDING] if law[SLIDING] > 0.0 else 1.0
                s.ratio_s[c] = law[STICKING + 1] / law[STICKING] if law[STICKING] > 0.0 else 1.0
    for c in range(s.state.shape[0]):
        for i in range(3):
            system.states[s.state[c] + 1 + i] = s.kept_way[c, i]
