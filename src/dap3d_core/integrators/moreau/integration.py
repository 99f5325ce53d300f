"""An integration by time stepping of contacts.

Moreau, Unilateral contact and dry friction in finite freedom dynamics (1988), with the gap term of
Anitescu and Potra (Nonlinear Dynamics 14, 1997): a step of length h is

    M (v+ - v_free) = J^T x,   u = J v+ + bias,   0 <= x_N _|_ u_N >= 0,   x_T by Coulomb's law

where v_free comes of the explicit midpoint rule without contacts, in parts of the step where forces
are stiff, and bias of the normal is e u_N
of before where a gap closes at speed, else max(gap, 0) / h. Positions follow by the trapezoidal
rule, second order, or by v+ for bodies that collide; then what overlaps is moved apart.
"""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from collections.abc import Iterator
from typing import Any, ClassVar

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.integrators.moreau.contact_set import ContactFinder, ContactSet
from dap3d_core.integrators.moreau.problem import NEAR, Problem
from dap3d_core.integrators.stepping.integration import Integration
from dap3d_core.integrators.stepping.integration_state import (
    NOT_FINITE,
    OTHER,
    RUNNING,
    IntegrationState,
    Y,
)
from dap3d_core.integrators.stepping.output import may_step
from dap3d_core.integrators.stepping.step_control import count_turns, end_of_step
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.array_struct import MATRIX
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.model.rotations import rotation
from dap3d_core.model.state_layout import bodies_of, split, u_from_y, y_from_u

#: Gaps, m of a scene of ordinary size, below which overlaps are left; passes that remove them.
OVERLAP, PASSES = 1e-12, 8
#: A contact collides where it approaches by more than this times h times the acceleration.
COLLIDES = 4.0
#: Margin of contacts, as parts of the way of a step, and m of a scene of ordinary size.
MARGIN, LEAST_MARGIN = 1.2, 1e-6
#: A contact whose friction is on its cone to this part slides.
ON_CONE = 1e-6
#: Contacts of a shape whose impulses are kept for the next step.
KEPT = 12
#: Parts of a step are at most this over the largest rate of the forces: an oscillation of that rate
#: gains 5e-4 of its amplitude in one. Steps between two estimates of it, and their passes, which
#: change y by this part; parts of a step at most.
PART, RENEWED, RATE_PASSES, RATE_CHANGE, MOST_PARTS = 0.25, 25, 8, 1e-7, 1000


@attrs.define(eq=False, kw_only=True, slots=False)
class MoreauState(IntegrationState):
    """State of an integration by time stepping."""

    types: ClassVar[dict[str, Any]] = {**IntegrationState.types, "memory": MATRIX}

    memory: Floats  # (room, 4) key of a contact, or -1, and its impulse, N s, global axes
    rate: Floats  # (1,) largest rate of the forces without contacts, 1/s


@compiled
def state_at(work: Any, t: float, y: Floats) -> None:
    """The state reached: steps end where something is reported."""
    for i in range(y.size):
        y[i] = work.state[Y, i]


@compiled
def goes_on(work: Any, functions: Any, system: Any, loops: Any, limit: int) -> bool:
    """Report what is reached; True if a step is to be taken now."""
    return may_step(work, state_at, limit, functions[1], functions[2], system, loops)


@compiled
def take_state(work: Any, functions: Any, system: Any, loops: Any) -> None:
    """Count turns up to the state reached."""
    if work.calls_accepted != 0:
        count_turns(work, functions[3], system, loops)


class MoreauIntegration(Integration):
    """An initial value problem with contacts, in steps of equal length.

    Attributes:
        problem: of the last step; None where no contact was near.
        step_length: its length, s.
        largest_residual: of all steps, a part of the largest impulse of each.
        friction_work: of all steps so far, J, not positive.
        deepest: largest overlap at the end of a step, m.
        overlap_at_start: that of before the first step, m, which moves bodies apart.
    """

    name, adaptive = "moreau", False
    state_class = MoreauState
    problem: Problem | None = None
    step_length = 0.0
    largest_residual = friction_work = deepest = overlap_at_start = 0.0

    def __init__(self, evaluator: Evaluator, y0: Any, times: Any, **options: Any) -> None:
        """Args: the evaluator of the model; the others as of ``Integration``."""
        self._evaluator = evaluator
        options |= {"watched": min(evaluator.watched, 1), "ends": (),
                    "length_count": evaluator.length_count}  # fmt: skip
        options.pop("stop_when_stiff", None)
        self._finder = ContactFinder(evaluator)
        functions = evaluator.functions, evaluator.system, evaluator.loops
        super().__init__(*functions, y0, times, **options)
        model = evaluator.model
        self._mean = np.zeros(6 * model.body_count)
        self._inverse = np.linalg.inv(model.Jp)
        self._contact_rows: list[Floats] = [Integration.contact_rows]
        self._shapes_met: Floats = self._contact_rows[0]

    def own_arrays(self, size: int, length_count: int) -> dict[str, Any]:
        """As ``Integration.own_arrays``."""
        model = self._evaluator.model
        shapes = 0 if model.collisions is None else np.count_nonzero(model.collisions.body)
        memory = np.full((KEPT * shapes + model.contact_count, 4), -1.0)
        return {"memory": memory, "rate": np.zeros(1)}

    @IGNORE_FLOAT_ERRORS
    def _advance(self, budget: int) -> None:
        work, arguments = self.work, self._arguments
        limit = work.rhs_count + budget
        while True:
            rows = int(work.row_count)
            again = goes_on(work, *arguments, limit)
            self._complete(rows)
            if not again:
                return
            self._step(min(float(end_of_step(work)), float(work.step_limit)))

    def _complete(self, first: int) -> None:
        """Put mean accelerations and forces of the last step, and modes, into rows of reports."""
        work, model, table = self.work, self._evaluator.model, self._finder.table
        rows = work.rows[first : work.row_count]
        if not len(rows) or work.step_count == 0:
            return
        layout, own = model.row_layout, model.joint_row_count
        rows[:, layout["v_dot"]] = self._mean
        if self.problem is None:
            return
        for t in rows[:, 0]:
            self._contact_rows.append(self._shapes_met.copy())
            self._contact_rows[-1][:, 0] = t
        forces = rows[:, layout["Lam"]]
        forces[:, :own] += self.problem.y / self.step_length
        if table is not None:  # their forces are the last
            x = self.problem.x[-table.count :]
            forces[:, own:] = x.ravel() / self.step_length
            rows[:, layout["states"]][:, table.mode] = self._modes(x, table.mu)

    @staticmethod
    def _modes(x: Floats, mu: Floats) -> Floats:
        """Modes (m,) of contacts by their impulses: 0 open, 1 slides, 2 sticks."""
        on_cone = np.hypot(x[:, 1], x[:, 2]) >= (1.0 - ON_CONE) * mu * x[:, 0]
        return np.where(x[:, 0] <= 0.0, 0.0, np.where(on_cone, 1.0, 2.0))

    # ---------------------------------------------------------------- a step

    def _step(self, t1: float) -> None:
        work, evaluator, t = self.work, self._evaluator, float(self.work.t)
        h = t1 - t
        y, states = work.state[Y].copy(), evaluator.model.state_count
        free = self._free(t, y, h)
        u, u_free = u_from_y(y[None], states)[0], u_from_y(free[None], states)[0]
        self.step_length = h
        contacts = self._near(t, u, u_free, h)
        overlap = -float(contacts.gap.min(initial=0.0))
        if work.step_count == 0:
            self.overlap_at_start = overlap
        else:  # what the projection of the last step has left
            self.deepest = max(self.deepest, overlap)
        after, worked = self._with_contacts(t, u, u_free, contacts, h)
        self._mean = (after - u)[-len(self._mean) :] / h
        own = free[len(free) - 1 - states : -1]
        work.state[OTHER] = y
        work.state[Y] = y_from_u(after, free[-1] + worked, own)
        work.t_dense, work.h_dense, work.t = t, h, t1
        work.step_count += 1
        work.segment_step += 1
        if not np.all(np.abs(work.state[Y]) <= 1e100):
            work.t_stop, work.status = t1, NOT_FINITE
            return
        if work.projects and evaluator.model.joint_row_count and not self.project():
            return
        take_state(work, *self._arguments)

    def _free(self, t: float, y: Floats, h: float) -> Floats:
        """The state at the end of a step without contacts, by the explicit midpoint rule."""
        if self.work.step_count % RENEWED == 0:
            self.work.rate[0] = self._largest_rate(t, y)
        wanted = np.nan_to_num(np.ceil(h * self.work.rate[0] / PART), nan=1.0)
        parts = int(np.clip(wanted, 1, MOST_PARTS))
        free, h = y, h / parts
        for k in range(parts):
            begun = t + k * h
            middle = free + 0.5 * h * self._slope(begun, free)
            free = free + h * self._slope(begun + 0.5 * h, middle)
            p = split(bodies_of(free, self._evaluator.model.state_count))[1]
            p /= np.linalg.norm(p, axis=1, keepdims=True)
        return free

    def _slope(self, t: float, y: Floats) -> Floats:
        slope = np.zeros_like(y)
        self._arguments[0][0](t, y, slope, *self._arguments[1:])
        self.work.rhs_count += 1
        return slope

    def _largest_rate(self, t: float, y: Floats) -> float:
        """Largest size of an eigenvalue of df/dy, 1/s, by powers of it.

        Source: the nonlinear power method of Sommeijer, Shampine, Verwer, RKC: an explicit solver
        for parabolic PDEs (J. Comp. Appl. Math. 88, 1997). Of an oscillation two powers are taken
        together: one changes m to m/s, the other back.
        """
        at_y, found = self._slope(t, y), [0.0, 0.0]
        change = np.cos(np.arange(1.0, y.size + 1.0))  # has a part of every direction
        for _ in range(RATE_PASSES):
            change[-1] = 0.0  # work changes nothing
            size = float(np.linalg.norm(change))
            if not 0.0 < size < np.inf:
                break
            change *= RATE_CHANGE * (1.0 + float(np.linalg.norm(y[:-1]))) / size
            size = float(np.linalg.norm(change))
            change = self._slope(t, y + change) - at_y
            found.append(float(np.linalg.norm(change[:-1])) / size)
        return float(np.sqrt(found[-1] * found[-2]))

    def _near(self, t: float, u: Floats, u_free: Floats, h: float) -> ContactSet:
        """Contacts that may close within a step."""
        _, _, v, w = split(u)
        _, _, v1, w1 = split(u_free)
        speed = np.maximum(np.linalg.norm(v, axis=1), np.linalg.norm(v1, axis=1))
        spin = np.maximum(np.linalg.norm(w, axis=1), np.linalg.norm(w1, axis=1))
        margin = np.zeros(len(speed) + 1)
        least = LEAST_MARGIN * self._evaluator.model.length
        margin[1:] = MARGIN * h * (speed + spin * self._finder.reach[1:]) + least
        return self._finder.find(t, u, margin)

    def _problem(self, t: float, u: Floats, contacts: ContactSet) -> Problem:
        """The problem of contacts at a state u (13 n,)."""
        model, A = self._evaluator.model, rotation(split(u)[1])
        inverse, masses = np.zeros((2, len(A) + 1, 6, 6))
        turned = A.transpose(0, 2, 1)
        both = (inverse, 1.0 / model.mass, self._inverse), (masses, model.mass, model.Jp)
        for found, mass, Jp in both:
            found[1:, [0, 1, 2], [0, 1, 2]] = mass[:, None]
            found[1:, 3:, 3:] = A @ Jp @ turned
        own = model.joint_row_count
        D = self._evaluator.rows(t, u).dense()[:own] if own else np.zeros((0, 6 * len(A)))
        return Problem(contacts, inverse, masses, D)

    def _with_contacts(
        self, t: float, u: Floats, u_free: Floats, contacts: ContactSet, h: float
    ) -> tuple[Floats, float]:
        """State u at the end of a step, and the work of its impulses, J."""
        self.problem = None
        if not len(contacts.gap):
            return u_free, 0.0
        problem = self._problem(t, u, contacts)
        before, v = _velocities(u), _velocities(u_free)
        approach, normal = problem.velocity(before)[:, 0], problem.velocity(v)[:, 0]
        fall = COLLIDES * float(np.abs(v - before).max())
        collides = (approach < -fall) & (contacts.gap + h * np.minimum(approach, normal) < 0.0)
        bias = np.where(collides & (contacts.e > 0.0), contacts.e * approach,
                        np.maximum(contacts.gap, 0.0) / h)  # fmt: skip
        end = problem.solve(v, bias, contacts.mu, self._remembered(contacts), self.work.rtol)
        self.problem = problem
        self._remember(contacts, problem.x)
        self.largest_residual = max(self.largest_residual, problem.residual)
        mean = 0.5 * (v + end)
        works = problem.x * problem.velocity(mean)
        self._meet(contacts, problem.x / h)
        self.friction_work += float(works[:, 1:].sum())
        moved = 0.5 * h * (end - v)
        impact = np.zeros(len(before), dtype=bool)
        if collides.any():
            hit = np.isin(problem.groups, problem.groups[collides])
            impact[contacts.bodies[hit].ravel()] = True
        if len(problem.y) and collides.any():
            impact[:] = True
        impact = impact[1:]
        after = u_free.copy()
        r, p, v1, w1 = split(after)
        r0, p0, _, _ = split(u)
        r[impact], p[impact] = r0[impact], p0[impact]
        moved = np.where(impact[:, None], h * end[1:], moved[1:])
        _move(r, p, moved)
        v1[:], w1[:] = end[1:, :3], end[1:, 3:]
        self._part(t + h, after)
        return after, float(works.sum()) + problem.work_of_joints(mean)

    def _meet(self, contacts: ContactSet, force: Floats) -> None:
        """Keep what shapes push with, (m, 3) N in the frames of contacts, for a report."""
        closed = np.flatnonzero(force[: len(contacts.shapes), 0] > 0.0)
        frame = contacts.J[closed, :, :3]
        self._shapes_met = np.column_stack([
            np.zeros(len(closed)), contacts.shapes[closed],
            self._modes(force[closed], contacts.mu[closed]), contacts.gap[closed],
            contacts.point[closed], frame[:, 0], np.einsum("mr,mrk->mk", force[closed], frame),
        ])  # fmt: skip

    def _part(self, t: float, u: Floats) -> None:
        """Move bodies that overlap apart, by the least change in the metric of their masses."""
        least = OVERLAP * self._evaluator.model.length
        r, p, _, _ = split(u)
        margin = np.full(len(r) + 1, 0.5 * LEAST_MARGIN * self._evaluator.model.length)
        deepest = 0.0
        for _ in range(PASSES):
            contacts = self._finder.find(t, u, margin)
            contacts = contacts.some(np.flatnonzero(contacts.gap < 2.0 * margin[0]))
            deepest = max(0.0, -float(contacts.gap.min(initial=0.0)))
            if deepest <= least:
                break
            problem = self._problem(t, u, contacts)
            none, zero = np.zeros((len(r) + 1, 6)), np.zeros(len(contacts.gap))
            moves = problem.solve(none, contacts.gap, zero, np.zeros((len(zero), 3)), NEAR)
            _move(r, p, moves[1:])
        self.deepest = max(self.deepest, deepest)

    # ---------------------------------------------------------------- impulses of the last step

    def _remembered(self, contacts: ContactSet) -> Floats:
        """(m, 3) impulses of the last step in the frames of contacts, zero of new ones."""
        memory = self.work.memory
        keys = memory[:, 0]
        found = np.zeros((len(contacts.key), 3))
        order = np.argsort(keys, kind="stable")
        place = np.searchsorted(keys[order], contacts.key)
        place = order[np.minimum(place, len(keys) - 1)] if len(keys) else place
        known = keys[place] == contacts.key if len(keys) else np.zeros(len(place), dtype=bool)
        impulses = memory[place[known], 1:]
        found[known] = np.einsum("mrk,mk->mr", contacts.J[known, :, :3], impulses)
        found[:, 0] = np.maximum(found[:, 0], 0.0)
        return found

    def _remember(self, contacts: ContactSet, x: Floats) -> None:
        memory = self.work.memory
        closed = np.flatnonzero(x[:, 0] > 0.0)[: len(memory)]
        memory[:] = -1.0
        memory[: len(closed), 0] = contacts.key[closed]
        memory[: len(closed), 1:] = np.einsum("mr,mrk->mk", x[closed], contacts.J[closed, :, :3])

    # ---------------------------------------------------------------- as of Integration

    def state_within(self, t: float) -> Floats | None:
        """As ``Integration.state_within``, linear."""
        work = self.work
        if work.status != RUNNING or not work.t_dense < t <= work.t_dense + work.h_dense:
            return None
        part = (t - work.t_dense) / work.h_dense
        found: Floats = (1.0 - part) * work.state[OTHER] + part * work.state[Y]
        return found

    @property
    def contact_rows(self) -> Floats:  # type: ignore[override]
        """As of ``Integration``."""
        found: Floats = np.concatenate(self._contact_rows)
        found.flags.writeable = False
        return found

    def all_arrays(self) -> Iterator[tuple[str, Any]]:
        """As ``Restorable.all_arrays``."""
        yield from super().all_arrays()
        yield "contacts", self.contact_rows

    def restored(self, name: str, array: Any, found: Any) -> Any:
        """As ``Restorable.restored``."""
        if name != "contacts":
            return super().restored(name, array, found)
        shapes = 0 if self._finder.shapes is None else len(self._finder.shapes.names)
        if found is None or found.shape[1:] != array.shape[1:] or found.dtype != array.dtype:
            raise ValueError("contacts: no such table can be")
        if not np.isfinite(found).all() or not np.isin(found[:, 1:3], np.arange(shapes)).all():
            raise ValueError("contacts: they are of other shapes")
        self._contact_rows = [found]
        return found

    @property
    def dy_dt(self) -> Floats | None:
        """None: rates jump with impulses."""
        return None


def _velocities(u: Floats) -> Floats:
    """(n + 1, 6) velocities of a state u, those of ground first."""
    _, _, v, w = split(u)
    return np.concatenate([np.zeros((1, 6)), np.hstack([v, w])])


def _move(r: Floats, p: Floats, d: Floats) -> None:
    """Move and turn bodies by d (n, 6), m and rad in global axes, in place."""
    r += d[:, :3]
    angle = np.linalg.norm(d[:, 3:], axis=1)
    b = 0.5 * np.sinc(0.5 * angle / np.pi)[:, None] * d[:, 3:]
    a, e = np.cos(0.5 * angle), p[:, 1:].copy()
    e0 = p[:, 0].copy()
    p[:, 0] = a * e0 - np.sum(b * e, axis=1)
    p[:, 1:] = a[:, None] * e + b * e0[:, None] + np.cross(b, e)
    p /= np.linalg.norm(p, axis=1, keepdims=True)
