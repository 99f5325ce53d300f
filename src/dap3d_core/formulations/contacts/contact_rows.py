"""The contacts of a model at one state: gaps, rows, forces, as arrays of Python."""

from collections.abc import Iterator, Sequence
from functools import cached_property, reduce
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.contacts.contact_arrays import ContactArrays, contact_arrays
from dap3d_core.formulations.contacts.loads import find_modes as seek_modes
from dap3d_core.formulations.contacts.modes import nearly_jams as seek_jam
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.interface.codegen.compile_loops import compiled_loop
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.function_lists import LoopArrays, call_loop, loop_list
from dap3d_core.model.rotations import rotation
from dap3d_core.model.state_layout import split

#: Numbers that the kernel ``tension`` of a contact returns (interface/contacts/rows.py).
GAP, NORMAL = 0, 1
FRICTION, SLIP, PLACE = slice(2, 5), slice(5, 8), slice(8, 11)
REACH, FORCE, WIDTH = 11, slice(12, 15), 15
#: Those of a law of friction of its own, behind them: coefficients that slide, and that stick.
SLIDING, STICKING, LAW_WIDTH = slice(0, 2), slice(2, 4), 4
#: Velocities that are set are met to this part of their size; of a change this part is rounding.
HELD, CANCELLED = 1e-9, 1e-15


def length_of(vector: Floats) -> float:
    """The length of a vector of one component or more."""
    return float(reduce(np.hypot, vector, 0.0))


def least_inverse(mobility: Floats, free: Floats) -> Floats:
    """Pseudo-inverse of the mobility of rows, which have units of their own: m and rad.

    Of rows that depend on each other it is the least, as equations.py has them. free: (rows,)
    mobilities of each alone, without joints.
    """
    s = 1.0 / np.sqrt(np.maximum(free, 1e-300))
    scaled = s[:, None] * mobility * s
    return s[:, None] * np.linalg.pinv(scaled, rcond=1e-12, hermitian=True) * s


class ContactTable:
    """The contacts of a model by their numbers, in the order of the model.

    Attributes:
        names: of each point of contact.
        mu, mu_s, e: (m,) coefficients of friction, along the first tangent, and restitution.
        ratio, ratio_s: (m,) the same along the second tangent, as parts of them: 1 but in ellipses.
        newton: (m,) True where the law of impact is Newton's.
        turns: (m,) 1 of those whose gap or slip is an angle, 0 of others.
        length: (m,) what limits of gaps and speeds are multiplied by: the length of the scene, m;
            1 rad of those that turn.
        movable: (m,) True of those that a scene may have moved until they touch.
        alone: (m,) True of friction without a gap: of joints.
        holds: (m, 3) True of the rows that act where it sticks.
        gapless: (m,) 1 where the first row is one of slip, and not along a normal; else 0.
        loads: contact -> rows of the joint whose load its friction has, and whether they push.
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
        self.newton = np.array([law == "newton" for law in model.contact_laws], dtype=bool)
        self.numbers = {name: np.zeros(self.count) for name in ("mu", "mu_s", "e")}
        self.movable = np.array(["#" not in name for name in self.names], dtype=bool)
        self.ratio, self.ratio_s = np.ones((2, self.count))
        self.mode = np.zeros(self.count, dtype=np.int64)
        self.switches: Integers = np.zeros((self.count, 2), dtype=np.int64)
        self._loops = []
        places = {(s.element, s.name): s.first for s in model.element_states if s.kind == "joint"}
        for group in model.contacts:
            which = group.members - first
            type_: Any = group.type_info.type
            self.turns[which], self.alone[which] = type_.at is None, type_.is_friction_alone()
            self.holds[which] = type_.holds
            if group.loaded is not None:
                starts = model.joint_start[group.loaded][:, None] + type_.load
                self.loads |= {int(c): (rows, type_.pushes)
                               for c, rows in zip(which, starts, strict=True)}  # fmt: skip
            self.movable[which] &= not type_.is_smooth
            for name, values in self.numbers.items():
                values[which] = group.number(name)
            self.mode[which] = [places[self.names[k], "mode"] for k in which]
            q = next(q for q, (kind, g) in enumerate(evaluator.loop_groups)
                     if g is group and kind == "switch")  # fmt: skip
            loop = loop_list([compiled_loop(group.type_info, "tension")])
            width = WIDTH + LAW_WIDTH * (type_.grip is not None)
            self._loops.append((loop, evaluator.system.groups[q], which, width))
        self.length = np.where(self.turns > 0.0, 1.0, model.length)
        self.gapless = (self.alone & self.holds[:, 0]).astype(float)
        self.way: Integers = self.mode[:, None] + np.arange(1, 4)
        self.near: Integers = self.mode[:, None] + np.arange(4, 7)
        self.mu, self.mu_s, self.e = (self.numbers[n] for n in ("mu", "mu_s", "e"))
        for k, switch in enumerate(evaluator.switches):
            if switch.is_contact:
                place = int(switch.group.members[switch.place]) - first
                self.switches[place, switch.part] = k

    @cached_property
    def arrays(self) -> ContactArrays:
        """Those of compiled code, with the coefficients of the table."""
        names = ("mu", "mu_s", "e", "ratio", "ratio_s", "gapless", "length")
        given = {name: getattr(self, name) for name in names}
        model = self.evaluator.model
        s = contact_arrays(self.count, model.joint_row_count, len(self.loads), given)
        s.newton[:], s.alone[:], s.holds[:] = self.newton, self.alone, self.holds
        for c, (rows, pushes) in self.loads.items():
            s.load_row[c], s.load_count[c], s.load_pushes[c] = rows[0], len(rows), pushes
        return s

    def across(self, c: int) -> slice:
        """The rows of slip of a contact."""
        return slice(0 if self.gapless[c] else 1, 3)

    @IGNORE_FLOAT_ERRORS
    def outputs(self, t: float, u: Floats, Lam: Floats | None = None) -> Floats:
        """(m, WIDTH) what each contact says of itself at a state u (13 n,), with these multipliers.

        The states of elements are those of the evaluator. Lam: (rows,) in the order of the model.
        """
        found = np.zeros((self.count, WIDTH))
        for which, values in self._values(t, u, Lam, self._loops):
            found[which] = values[:, :WIDTH]
        return found

    @IGNORE_FLOAT_ERRORS
    def find_grips(self, t: float, u: Floats) -> None:
        """Coefficients of contacts whose law of friction is their own, at a state u (13 n,)."""
        laws = [loop for loop in self._loops if loop[-1] > WIDTH]
        if not laws:
            return
        evaluator, states = self.evaluator, self.evaluator.states
        evaluator.states = states.copy()
        evaluator.states[self.way] = 0.0  # slip of today alone has a part
        for which, values in self._values(t, u, None, laws):
            for place, mu, ratio in (
                (SLIDING, self.mu, self.ratio), (STICKING, self.mu_s, self.ratio_s)
            ):  # fmt: skip
                first, second = values[:, WIDTH:][:, place].T
                mu[which] = first
                ratio[which] = np.where(
                    first > 0.0, second / np.where(first > 0.0, first, 1.0), 1.0
                )
        evaluator.states = states

    def _values(
        self, t: float, u: Floats, Lam: Floats | None, loops: Sequence[Any]
    ) -> Iterator[tuple[Integers, Floats]]:
        """Contacts, by their numbers, with what some loops return."""
        evaluator, s = self.evaluator, self.evaluator.system
        evaluator.place(t, u)
        minus_lambda = np.zeros_like(s.multipliers)
        if Lam is not None:
            minus_lambda[s.row] = -Lam
        arrays = LoopArrays(body=s.body, F=s.F, idx=s.idx, par=s.par, states=s.states)
        for loop, group, which, width in loops:
            out = np.zeros(len(which) * width)
            call_loop(loop, 0, float(t), arrays, group, out, np.zeros(1), minus_lambda)
            yield which, out.reshape(-1, width)

    def against(self, c: int, way: Floats) -> Floats:
        """(2,) what friction of a sliding contact acts against, in parts of mu: a unit vector."""
        if self.ratio[c] == 1.0:
            return way
        across = np.array([way[0], self.ratio[c] * way[1]])
        found: Floats = across * [1.0, self.ratio[c]] / max(float(np.hypot(*across)), 1e-300)
        return found

    def slip_against(self, c: int, force: Floats) -> Floats:
        """(2,) the direction in which a contact begins to slip against friction at its limit."""
        along = -force if self.ratio_s[c] == 1.0 else -force / [1.0, self.ratio_s[c] ** 2]
        found: Floats = along / length_of(along)
        return found


class ContactRows:
    """Rows of all contacts at one state, as if they stuck, with the joints held.

    Attributes:
        v: (6 n,) velocities; M, inverse: (6 n, 6 n) masses and their inverse, global axes.
        G: (3 m, 6 n) rows, normal first.
        frames: (m, 3, 3) normal and tangents.
        P: (6 n, 6 n) changes of velocity by impulses, with the joints held.
        driven: (m, 3) velocity at each contact, in its frame, of the motion that drivers prescribe:
            of those that the joints allow the one of least energy. Impulses do their work, with
            that of the drivers, along what is left of the slip.
        reaction: (rows, 3 m) what forces of contacts change of multipliers of joints.
        row_size: (rows,) sizes of the rows of joints, by masses: roots of their mobilities.
    """

    @IGNORE_FLOAT_ERRORS
    def __init__(self, table: ContactTable, t: float, u: Floats) -> None:
        """Args: the contacts; time and state u (13 n,). States of the evaluator stay."""
        evaluator, self.t, self.u = table.evaluator, t, u
        self._table, model = table, evaluator.model
        self.states = evaluator.states
        evaluator.states = self._stuck_states()
        rows = evaluator.rows(t, u)
        evaluator.states = self.states
        D, own = rows.dense(), model.joint_row_count
        self.D, self.G, self._nu = D[:own], D[own:], rows.nu[:own]
        self.C = rows.C[own:].reshape(-1, 3)[:, 0]
        self._free: Floats | None = None
        self.free_multipliers: Any = None
        _, p, v, w = split(u)
        self.v = np.hstack([v, w]).ravel()
        n = model.body_count
        self.M, self.inverse = np.zeros((2, 6 * n, 6 * n))
        A = rotation(p)
        for b in range(n):
            i, k = slice(6 * b, 6 * b + 3), slice(6 * b + 3, 6 * b + 6)
            self.M[i, i], self.inverse[i, i] = np.eye(3) * model.mass[b], np.eye(3) / model.mass[b]
            self.M[k, k] = A[b] @ model.Jp[b] @ A[b].T
            self.inverse[k, k] = A[b] @ np.linalg.inv(model.Jp[b]) @ A[b].T
        self.P, self.driven = self.inverse, np.zeros((table.count, 3))
        self.reaction, self.row_size = np.zeros((own, 3 * table.count)), np.zeros(own)
        if own:
            held = self.inverse @ self.D.T
            mobility = self.D @ held
            self.row_size = np.sqrt(np.diag(mobility))
            least = least_inverse(mobility, np.diag(mobility))
            answer = held @ least
            self.P = self.inverse - answer @ held.T
            self.driven = (self.G @ (answer @ self._nu)).reshape(-1, 3)
            if table.loads:
                self.reaction = -least @ held.T @ self.G.T
        self.W = self.G @ self.P @ self.G.T

    @cached_property
    def frames(self) -> Floats:
        """(m, 3, 3) normal and tangents of each contact, or the axis of a moment; global axes."""
        blocks = self.G.reshape(-1, 3, len(self.v) // 6, 6)
        blocks = blocks[..., :3] + blocks[..., 3:] * self._table.turns[:, None, None, None]
        found = np.zeros((len(blocks), 3, 3))
        slots = self._table.evaluator.model.joint_slots[-len(blocks) :]
        for k, bodies in enumerate(slots):
            body, sign = (bodies[0], 1.0) if bodies[0] else (bodies[1], -1.0)
            found[k] = sign * blocks[k, :, body - 1]
        return found

    def _stuck_states(self) -> Floats:
        """States of elements as if all contacts stuck."""
        table, stuck = self._table, self.states.copy()
        stuck[table.mode] = 2.0
        stuck[table.way.ravel()] = stuck[table.near.ravel()] = 0.0
        return stuck

    @property
    def free(self) -> Floats:
        """(3 m,) rates of slip at these velocities, where all contacts are open, joints held."""
        if self._free is None:
            evaluator, table = self._table.evaluator, self._table
            apart, own = self.states.copy(), evaluator.model.joint_row_count
            apart[table.mode] = 0.0
            evaluator.states = apart
            report = evaluator.report(self.t, self.with_velocities(self.v))
            self.free_multipliers = report[evaluator.model.report_layout["Lam"]][:own]
            evaluator.states = self.states
            gamma = evaluator.placed_gamma(self.t, self._stuck_states())[own:]
            self._free = self.G @ report[: len(self.v)] - gamma
        return self._free

    @cached_property
    def feels(self) -> Any:
        """(m, m) True where a force of the second contact changes slip or load of the first."""
        count = len(self.W) // 3
        size = np.sqrt(np.maximum(np.diag(self.W), 0.0))
        felt = np.abs(self.W) > 1e-14 * size[:, None] * size
        found = felt.reshape(count, 3, -1, 3).any(axis=(1, 3))
        changes = np.abs(self.reaction) * self.row_size[:, None] > 1e-14 * size
        for c, (rows, _) in self._table.loads.items():
            found[c] |= changes[rows].reshape(-1, count, 3).any(axis=(0, 2))
        return found | found.T if self._table.loads else found

    @property
    def closing(self) -> Floats:
        """(m,) rates of gaps; zero where there is none."""
        found: Floats = np.where(self._table.gapless > 0.0, 0.0, self.slip[:, 0])
        return found

    def change(self, dv: Floats) -> None:
        """Change the velocities by dv (6 n,); of what cancels no rounding is left."""
        v = self.v + dv
        v[np.abs(v) <= CANCELLED * np.abs(dv)] = 0.0
        self.v, self._free, self.free_multipliers = v, None, None

    def follow(self, given: Sequence[tuple[Floats, float]] = ()) -> bool:
        """Bring velocities onto the joints by impulses in them, and rows to what they are given.

        Args:
            given: rows (6 n + 6,), ground first, and changes of their rates.

        Returns:
            False where joints hold what a row is to change.
        """
        R = np.array([row[6:] for row, _ in given]).reshape(-1, len(self.v))
        target = R @ self.v + [change for _, change in given]
        for N, P, rates in ((self.D, self.inverse, self._nu), (R, self.P, target)):
            if len(N):
                held = P @ N.T
                free = np.einsum("ij,ji->i", N, self.inverse @ N.T)
                self.change(held @ least_inverse(N @ held, free) @ (rates - N @ self.v))
        missed, size = np.abs(R @ self.v - target), np.abs(target)
        return bool(np.all(missed <= HELD * np.maximum(size.max(initial=0.0), 1.0)))

    @property
    def slip(self) -> Floats:
        """(m, 3) velocity at each contact, in its frame."""
        found: Floats = (self.G @ self.v).reshape(-1, 3)
        return found

    def with_velocities(self, v: Floats) -> Floats:
        """The state u (13 n,) with other velocities."""
        u = self.u.copy()
        u[-len(v) :] = v
        return u

    def kick(self, x: Floats) -> None:
        """Let impulses (3 m,) act."""
        self.change(self.P @ self.G.T @ x)

    def lifted(
        self, values: Floats, held: list[int], others: list[int], slack: Floats | None = None
    ) -> Floats:
        """(6 n,) least change of positions, or velocities, with the joints held.

        It brings ``values`` (m,), gaps or their rates, of held contacts to zero, and of others that
        would be less than zero by more than a slack (m,).
        """
        N, active = self.G[::3], [c for c in held if not self._table.gapless[c]]
        normal, x = self.W[::3, ::3], np.zeros(0)
        least = np.zeros(len(values)) if slack is None else -slack
        for _ in range(len(others) + 1):
            block = normal[np.ix_(active, active)]
            x = np.asarray(np.linalg.lstsq(block, -values[active], rcond=1e-12)[0])
            moved = values + normal[:, active] @ x
            below = [c for c in others if c not in active and moved[c] < least[c]]
            if not below:
                break
            active += below
        found: Floats = self.P @ N[active].T @ x
        return found

    def rows_of(self, contacts: list[int]) -> Integers:
        """The rows of some contacts."""
        rows: Integers = (3 * np.array(contacts, dtype=np.int64)[:, None] + np.arange(3)).ravel()
        return rows

    def put(self, contacts: list[int]) -> ContactArrays:
        """Arrays of compiled code for some contacts at these velocities."""
        s = self._table.arrays
        s.W[:], s.slip[:] = self.W, self.slip
        s.touching[: len(contacts)], s.touching_count = contacts, len(contacts)
        return s


class JamError(ValueError):
    """No mode is consistent: sliding presses its bodies together; names the contact."""


@attrs.frozen
class Modes:
    """Modes, directions of sliding and shares of all contacts, global axes.

    Attributes:
        mode: (m,) 0 open, 1 slides, 2 sticks.
        way: (m, 3) unit vectors of sliding, zero where none is known; of friction alone that
            sticks 1.0 for rows that do not hold, as others hold what they would.
        near: (m, 3) forces on body i of those that share what they carry.
        force: (m, 3) forces with which they were found, in the frames of the contacts.
    """

    mode: Floats
    way: Floats
    near: Floats
    force: Floats


def find_modes(
    table: ContactTable,
    rows: ContactRows,
    touching: list[int],
    sliding: dict[int, Floats],
    leaving: list[int],
) -> Modes:
    """The modes at the state of ``rows``.

    Args:
        table, rows: the contacts, and what they are at this state.
        touching: contacts of no gap.
        sliding: contacts at rest that begin to slide -> direction in their frames, (2,).
        leaving: contacts whose normal force has just vanished: they open where nothing keeps them.

    Raises:
        JamError: a contact jams.
    """
    s = rows.put(touching)
    s.free[:], s.frames[:], s.feels[:], s.load[:] = rows.free, rows.frames, rows.feels, table.alone
    s.lam_free[:], s.reaction[:] = rows.free_multipliers, rows.reaction
    s.begins[:] = s.leaves[:] = 0
    for c, way in sliding.items():
        s.begins[c], s.begin_way[c, 0] = 1, 0.0
        s.begin_way[c, table.across(c)] = way
    s.leaves[leaving] = 1
    if not seek_modes(s):
        raise JamError(" with ".join(table.names[c] for c in np.flatnonzero(s.jams)))
    return Modes(s.mode.copy(), s.way.copy(), s.near.copy(), s.force.copy())


def nearly_jams(table: ContactTable, rows: ContactRows, closed: list[int]) -> str:
    """Name of a contact whose friction leaves next to nothing of how it gives way; "" of none."""
    c = seek_jam(rows.put(closed))
    return table.names[c] if c >= 0 else ""
