"""Contacts in the course of a run: what happens where one of their switches ends a mode."""

from collections import deque
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from dap3d_core.formulations.contacts.contact_arrays import ContactArrays
from dap3d_core.formulations.contacts.contact_table import (
    GAP,
    REACH,
    SLIP,
    ContactTable,
    words_of_drive,
)
from dap3d_core.formulations.contacts.decide import (
    DRIVES,
    HELD,
    OVERLAPS,
    PRESCRIBED,
    WEDGED,
    decide,
    repeat,
)
from dap3d_core.formulations.contacts.forces import still_speed
from dap3d_core.formulations.contacts.impacts import AT_FLOOR, NEARLY, ROUNDS, TOUCHING, nearly_jams
from dap3d_core.formulations.contacts.rows import follow_joints, keep_velocities, meet, put_rows
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.integrators import Integration, Status
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.interface.contacts.rows import APART
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.model.state_layout import velocities_of
from dap3d_core.registry.suggestions import some
from dap3d_core.result import EventRecord
from dap3d_core.result.note import information
from dap3d_core.scene import Mistake, SceneError
from dap3d_core.scene.errors import MISSING
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.events.jumps import LOSSLESS, MOST_RECORDS, Jumps, rows_to

#: Gap, m of a scene of ordinary size, below which bodies touch where a run begins.
TOUCHING_AT_START = 1e-8
#: Ends of modes within this part of the run: what changes more often comes to no end.
MOST_CHANGES, WITHIN = 2000, 1e-4
#: So many of them show whether bodies came behind a surface, where it touches and opens for ever.
BEHIND = 50
#: Jams that impulses ended, after which as many changes within this part come to none either.
MOST_JAMS, RATTLING = 500, 1e-2
#: So many steps within this part of the run are too many: it would not come to an end.
MOST_STEPS, SLOW = 10_000, 1e-5
#: Stiffness that a change of modes ends within this part of the run, as of slip that turns while it
#: vanishes, is none of the run.
SOON = 1e-3
#: Slip, m/s of an ordinary scene, that may be stiff.
STIFF_SLIP = 1e-4
#: Part of the largest mobility that is rounding of one; part of a unit force, or of what it moves,
#: by which a motion depends on a share.
UNRESOLVED, DEPENDS = 1e-10, 1e-6
#: Slip among the numbers of a contact.
PLANE = slice(SLIP, SLIP + 3)
#: Records of changes from one mode to another.
CHANGES = {(0, 1): "touch", (0, 2): "touch", (1, 0): "lift", (2, 0): "lift", (1, 2): "stick",
           (2, 1): "slip"}  # fmt: skip
#: What was decided at an instant, by which it is decided once more at states nearby.
DECIDED = ("taking", "restitution", "slips", "is_low", "stops", "mode", "way", "near")


class ContactJumps(Jumps):
    """Changes velocities and modes of contacts where the integrations of a run stop for it."""

    def __init__(self, evaluator: Evaluator) -> None:
        """Args: the evaluator of the run.

        Raises:
            SceneError: elements of the scene change velocities by laws of their own.
        """
        super().__init__(evaluator)
        others = [s for s in evaluator.switches if s.jumps and not s.is_contact]
        if others:
            name = others[0].name(evaluator.model)
            what = "changes velocities by a law of its own, which contacts do not know"
            remedy = "describe what it does by a contact, or take the contacts out"
            raise SceneError([Mistake(name, MISSING, what, remedy=remedy)])
        model = evaluator.model
        if readers := model.iterated_forces[: -model.contact_count]:
            what = (
                "depends on reactions in joints, and the modes of contacts are found without that"
            )
            remedy = "take it out, or the contacts; friction of its own a contact has (mu)"
            raise SceneError([Mistake(f"forces.{readers[0]}", MISSING, what, remedy=remedy)])
        in_bodies = evaluator
        if not evaluator.coordinates.are_of_bodies:  # what is decided is so in those
            in_bodies = Evaluator(model, "lsq")
        self._in_bodies = in_bodies
        self.table = ContactTable(in_bodies)
        #: The next instant has what is kept as decided.
        self.repeats = False
        self._stood = (0, -np.inf)
        self._latest: deque[tuple[float, str]] = deque(maxlen=MOST_CHANGES)
        #: largest energy, J, that Newton's law has given in an instant; the instant, and contacts
        self._gain: tuple[float, float, str] = (0.0, 0.0, "")
        #: Names of contacts that shared what they carry, slid, and moved as they shared it.
        self._sharing: set[str] = set()
        #: Contacts that left where several motions go on, and instants, s.
        self._left: dict[str, float] = {}

    @cached_property
    def arrays(self) -> ContactArrays:
        """What is decided on."""
        s = self.table.arrays(ROUNDS)
        s.jammed = -1
        return s

    def begin(self, integration: Integration) -> None:
        """Find the modes at the start; what touches and approaches collides there.

        Raises:
            SceneError: bodies overlap.
        """
        self.arrays.starts = 1
        self._resolve(integration, TOUCHING_AT_START * self.table.length)
        self.arrays.starts = 0

    def _overlap(self, k: int, depth: float) -> Mistake:
        """What is said of a contact whose gap is negative at the start."""
        unit = "rad" if self.table.turns[k] else "m"
        remedy = "move them apart by that along the normal"
        if unit == "rad":
            remedy = "turn them back by that about the axis, or change the bound"
        elif self.table.movable[k]:
            remedy += ", or have them moved until they touch (touch = true)"
        least = TOUCHING_AT_START * self.table.length[k]
        return Mistake(
            self.table.names[k], MISSING, f"its bodies overlap by {depth:.6g} {unit} at the start",
            remedy=f"{remedy}; a gap of up to {least:g} {unit} counts as touching",
        )  # fmt: skip

    def apply(self, integration: Integration) -> None:
        """Go on behind the end of a mode."""
        work = integration.work
        crossed, table = work.switches[at.CROSSED].copy(), self.table
        work.switches[at.CROSSED] = 0.0
        work.status = Status.RUNNING
        work.switches[at.COUNT][table.switches.ravel()] = 0.0  # it is counted here
        ended = crossed[table.switches] != 0.0
        if not self.repeats:
            self._refuse_endless(integration, [table.names[c] for c in np.nonzero(ended)[0]])
        self._resolve(integration, TOUCHING * table.length, ended)

    def share(self, some: Integers, others: Integers) -> bool:
        """As of ``Jumps``."""
        s, switches = self.arrays, self.table.switches
        one, other = (np.isin(switches, found).any(axis=1) for found in (some, others))
        feel = s.feels + np.identity(len(switches), dtype=np.int64)
        return bool(feel[np.ix_(one, other)].any() and s.near.any())

    def slips(self, integration: Integration) -> Floats:
        """As of ``Jumps``."""
        slips: Floats = self.table.outputs(integration.t, self._place(integration))[:, PLANE]
        return slips

    def sliding(self) -> list[int]:
        """As of ``Jumps``."""
        switches: list[int] = self.table.switches[self._slide(), 1].tolist()
        return switches

    def sliding_from_rest(self, integration: Integration) -> dict[str, int]:
        """As of ``Jumps``."""
        table, speeds = self.table, np.linalg.norm(self.slips(integration), axis=1)
        places = [c for c in np.flatnonzero(self._slide()).tolist()
                  if speeds[c] <= still_speed(self.arrays, c)]  # fmt: skip
        return {table.names[c]: c for c in places}

    def _slide(self) -> Any:
        """(m,) of each contact whether it slides in a plane, against friction."""
        slides = (self._evaluator.states[self.table.mode] == 1.0) & (self.arrays.mu > 0.0)
        return slides & self.table.holds[:, 1:].all(axis=1)

    def repeat_of(self, other: Jumps) -> None:
        """As of ``Jumps``."""
        assert isinstance(other, ContactJumps)
        s, of = self.arrays, other.arrays
        for name in DECIDED:
            getattr(s, name)[:] = getattr(of, name)
        s.round_count, self.repeats = of.round_count, True

    def follow(self, integration: Integration) -> None:
        """Where steps have become too short for the run to come to an end: slip jams, or is stiff.

        Raises:
            SimulationError: it ends.
        """
        steps, t = integration.statistics.steps, integration.t
        (before, since), span = self._stood, self._span_of(integration)
        is_slow = integration.status is Status.STIFF
        is_at_floor = integration.status in (Status.STEP_FLOOR, Status.NOT_FINITE)
        stalls = integration.status is Status.STALLED and not integration.implicit
        is_stalled = is_slow or is_at_floor or stalls
        if not is_stalled and (t - since > SLOW * span or steps < before):
            self._stood = (steps, t)
        elif is_stalled or steps - before > MOST_STEPS:
            s, table, u = self.arrays, self.table, self._state_of(integration)
            modes = self._evaluator.states[table.mode]
            self._put_rows(integration)
            slip = np.linalg.norm(table.outputs(t, u)[:, PLANE], axis=1)
            sliding = np.where(modes == 1.0, slip, np.inf)
            closed = np.flatnonzero(modes > 0.5).tolist()
            s.touching[: len(closed)], s.touching_count = closed, len(closed)
            table.put_directions(s)
            s.jammed = nearly_jams(s, AT_FLOOR if is_at_floor else NEARLY)
            if s.jammed >= 0:
                self._stood, integration.work.status = (steps, t), Status.JUMPED
                return
            if is_slow and not np.any(sliding < STIFF_SLIP * table.speed):
                integration.work.status = Status.RUNNING
            if is_slow or is_at_floor or not closed:
                return
            names = [self.table.names[c] for c in closed]
            slowest = (
                f"the slowest slip is {sliding.min():.2g} m/s; " if np.any(modes == 1.0) else ""
            )
            raise SimulationError(
                f"the run stopped at t = {t:.9g} s: {steps - before} steps brought it on by "
                f"{t - since:.2g} s, with contacts {', '.join(names)} closed; {slowest}slip that "
                "turns while it is next to nothing asks for steps as short. Integrator radau may "
                "pass; a larger mu_s, above mu, lets it begin at once; or end the run by an event"
            )

    def _refuse_endless(self, integration: Integration, names: list[str]) -> None:
        """SimulationError where changes of contacts follow each other ever faster."""
        latest, t = self._latest, integration.t
        latest.append((t, ", ".join(names)))
        passed, jams = t - latest[0][0], self.arrays.freed
        within = (RATTLING if jams > MOST_JAMS else WITHIN) * self._span_of(integration)
        if len(latest) % BEHIND == 0 and t - latest[-BEHIND][0] <= within:
            self._refuse_overlap(integration)
        if len(latest) < MOST_CHANGES or passed > within:
            return
        every = sorted({name for _, some in latest for name in some.split(", ")})
        start = f"the run stopped at t = {t:.9g} s: contacts {', '.join(every)}"
        if jams > MOST_JAMS:
            raise SimulationError(
                f"{start} rattle: slip jams again and again, {jams} times by now, and each time an "
                f"impulse ends it and lifts what falls back at once, {MOST_CHANGES} changes within "
                f"{passed:.2g} s. Smaller mu of these contacts ends that"
            )
        raise SimulationError(
            f"{start} changed {MOST_CHANGES} times within {passed:.2g} s, ever faster. Smaller e "
            "of these contacts ends bounces sooner (e = 0: at once); or end the run by an event "
            "before"
        )

    def _refuse_overlap(self, integration: Integration) -> None:
        """SimulationError where bodies came behind a surface past its end, which lies in them."""
        table, t = self.table, integration.t
        names = {name for _, some in self._latest for name in some.split(", ")}
        outputs = table.outputs(t, self._state_of(integration))
        depth = np.where(outputs[:, REACH] < 0.0, 0.0, -outputs[:, GAP])
        for c in np.flatnonzero(depth > TOUCHING_AT_START * table.length).tolist():
            if table.names[c] in names:
                raise SimulationError(
                    f"the run stopped at t = {t:.9g} s: contact {table.names[c]} begins where its "
                    f"bodies overlap by {depth[c]:.3g} m: they came past an end of its surface, "
                    "beyond which nothing touches. Let the surface begin before that, or give its "
                    "end a contact of its own (ball_ball, whose radius_i is 0 of an edge), or a "
                    "curve that is a thin wall a depth"
                )

    def notes(self, integration: Integration) -> list[str]:
        """Notes where impacts gave energy, and where more happened than is kept."""
        found: list[str] = []
        gain, t, names = self._gain
        if gain > 0.0:
            found.append(
                f"an impact at t = {t:.9g} s gave {gain:.3g} J, the most of this run ({names}): "
                "Newton's law does so beside friction and beside other laws or e; "
                'law = "poisson" of all that strikes at once does not'
            )
        for name, t in [*self._left.items()][:1]:
            found.append(
                f"forces of contacts that slide were no longer decided at t = {t:.9g} s, where "
                f"several motions go on by Coulomb's law: {name} left; feet on springs decide that"
            )
        if self._sharing:
            found.append(
                f"contacts {some(sorted(self._sharing))} share what they carry, which bodies leave "
                "open, and slid in unlike directions or with unlike friction: the motion depends "
                "on how they share it, here as feet of one stiffness do where that presses all of "
                "them, else so that all are as far inside their cones as can be; let three points "
                "touch, or give the body feet on springs"
            )
        if self.count > MOST_RECORDS:
            words = f"contacts changed {self.count} times; the first {MOST_RECORDS} changes are"
            found.append(information(f"{words} kept"))
        return found

    def set_state(
        self,
        integration: Integration,
        bodies: Mapping[int, Floats],
        states: Mapping[int, Floats],
        title: str,
    ) -> tuple[Floats, float]:
        """As of ``Jumps``: joints carry it, and what then approaches collides.

        Raises:
            SimulationError: the joints do not allow such velocities.
        """
        system, loops, s = self._in_bodies.system, self._in_bodies.loops, self.arrays
        model, u = self._evaluator.model, self._place(integration)
        follow_joints(float(integration.t), s, system, loops)
        rows = [np.append(row[6:], change) for row, change in rows_to(u, bodies)]
        given = np.array(rows).reshape(-1, 6 * model.body_count + 1)
        scratch = np.zeros((len(given), len(s.v))), np.zeros((len(given), len(given) + 1))
        if rows and not meet(s, given, *scratch, system):
            raise self._impossible(integration.t, title, bodies)
        keep_velocities(s, system)
        first_state = model.integrated_layout["states"].start
        for first, numbers in states.items():
            s.y[first_state + first :][: len(numbers)] = numbers
        after, work = self._after(u), s.taken_work
        self._take_decided(integration, work)
        self.settle(integration)
        return after, work

    def settle(self, integration: Integration) -> None:
        """Find velocities and modes anew, where joints have ended or velocities were set."""
        self._resolve(integration, TOUCHING * self.table.length)

    def _place(self, integration: Integration) -> Floats:
        """Make the state, and what forces remember, those of an integration; its u (13 n,)."""
        evaluator, in_bodies, s = self._evaluator, self._in_bodies, self.arrays
        s.y[:] = evaluator.body_state(integration.y)
        u: Floats = evaluator.hold(s.y)
        if in_bodies is not evaluator:
            in_bodies.system.par[:] = evaluator.system.par
            in_bodies.set_inputs(evaluator.inputs)
            in_bodies.states = evaluator.states
        return u

    def _put_rows(self, integration: Integration) -> None:
        """Rows at the present state."""
        evaluator, t, u = self._in_bodies, integration.t, self._place(integration)
        evaluator.place(t, u)
        put_rows(float(t), self.arrays, evaluator.system, evaluator.loops)

    def _after(self, u: Floats) -> Floats:
        """The state u (13 n,) with present velocities."""
        after = u.copy()
        velocities_of(after)[:] = self.arrays.v
        return after

    @IGNORE_FLOAT_ERRORS
    def _resolve(self, integration: Integration, touching: Floats, ended: Any = 0) -> None:
        """Velocities and modes at the present state.

        Args:
            touching: (m,) gap, m or rad, below which each contact touches.
            ended: (m, 2) True of switches of contacts that have changed their sign.
        """
        evaluator, table, t, s = self._in_bodies, self.table, float(integration.t), self.arrays
        u = self._place(integration)
        s.limit[:], s.ended[:] = touching, ended
        given = t, s, evaluator.system, evaluator.loops
        if self.repeats:
            sharing = [table.names[c] for c in np.flatnonzero(s.near.any(axis=1))]
            if not repeat(*given, evaluator.functions, table.tensions):
                raise SimulationError(
                    f"contacts {', '.join(sharing)} share what they carry, and others of them "
                    "slide with values nearby; let fewer points touch"
                )
            self._take_decided(integration, float(np.sum(s.work)))
            return
        if failure := decide(*given, evaluator.functions, table.tensions):
            self._refuse(t, failure)
        if s.jammed >= 0 and s.mode[s.jammed] == 0.0:
            self._left.setdefault(table.names[s.jammed], t)
        s.jammed = -1
        work, struck = float(np.sum(s.work)), np.flatnonzero(np.abs(s.impulses[:, 0]) > 0.0)
        self.lose |= abs(work) > LOSSLESS * s.exchanged
        if work > max(LOSSLESS * s.exchanged, self._gain[0]) and np.any(s.newton[struck]):
            self._gain = (work, t, ", ".join(table.names[c] for c in struck))
        self._take_decided(integration, work)
        self._sharing |= {table.names[c] for c in moved_by_share(s, table.under)}
        after, works = self._after(u), s.work.copy()
        resisting = np.flatnonzero(table.under >= 0)
        np.add.at(works, table.under[resisting], s.work[resisting])
        for c in struck.tolist():
            self._note(c, t, "impact", u, after, float(works[c]))
        for c in np.flatnonzero(s.rests_soon).tolist():
            self._note(c, t + float(s.rest_time[c]), "rest")
        for c in np.flatnonzero(s.was != s.mode).tolist():
            kind = CHANGES.get((int(s.was[c]), int(s.mode[c])), "")
            if kind and ((s.was[c] and s.mode[c]) or not table.alone[c]):
                self._note(c, t, kind, u)

    def _refuse(self, t: float, failure: int) -> None:
        """The error where nothing is decided."""
        s, names = self.arrays, self.table.names
        if failure == OVERLAPS:
            gap, reach = s.says.found[:, [GAP, REACH]].T
            gaps, limit = np.where(reach < 0.0, APART, gap), s.limit
            over = np.flatnonzero(gaps < -limit).tolist()
            raise SceneError([self._overlap(c, -gaps[c]) for c in over])
        start = f"the run stopped at t = {t:.9g} s: contact "
        jammed = " with ".join(names[c] for c in np.flatnonzero(s.jams))
        if failure == PRESCRIBED or (failure == WEDGED and self._is_prescribed()):
            closes = names[s.culprit] if failure == PRESCRIBED else jammed
            raise SimulationError(
                f"{start}{closes} closes, and joints or drivers prescribe the motion of "
                "its bodies: nothing that it pushes with can stop them"
            )
        if failure == DRIVES:
            mu = min(s.mu[s.culprit], s.mu_s[s.culprit]) * s.arm[s.culprit]
            raise SimulationError(f"{start}{words_of_drive(names[s.culprit], mu)}")
        if failure == WEDGED:
            is_newton = np.any(s.newton[s.jams != 0])
            remedy = 'Under law = "poisson" it stops' if is_newton else "Smaller mu may help"
            raise SimulationError(
                f"{start}{jammed} jams: no impulse within the cone of its friction gives it the "
                f"velocity that its law of impact asks for. {remedy}"
            )
        raise SimulationError(
            f"{start}{jammed} jams: its friction presses the bodies together by more than it lets "
            "them give way, and no motion with Coulomb's law goes on from here"
        )

    def _is_prescribed(self) -> bool:
        """Whether joints prescribe that contacts that jam close, together where not each alone."""
        s, own = self.arrays, len(self.arrays.lam_free)
        normals = 3 * np.flatnonzero(s.jams)
        mobility, ways = np.linalg.eigh(s.W[np.ix_(normals, normals)])
        held = ways[:, mobility <= HELD * np.max(s.W.diagonal())]
        rates = s.J[own + normals] @ s.v_before
        return bool(np.linalg.norm(held.T @ rates) > 0.5 * np.linalg.norm(rates) > 0.0)

    def _take_decided(self, integration: Integration, work: float) -> None:
        """Make the state ``y``, or the changes that led to it, that of an integration."""
        coordinates, s = self._evaluator.coordinates, self.arrays
        states = s.y[self._evaluator.model.integrated_layout["states"]].copy()
        y = s.y.copy()
        if not coordinates.are_of_bodies:
            y = coordinates.with_jump(integration.y, s.v - s.v_before, states, work)
            coordinates.displace(y, s.moved)
        self._go_on(integration, y, states)

    def _go_on(self, integration: Integration, y: Floats, states: Floats) -> None:
        """Make a state and states of elements those from the instant on."""
        evaluator, work = self._evaluator, integration.work
        work.state[at.Y] = y
        integration.restart()
        if 0.0 <= work.t - work.t_stiff < SOON * (work.times[-1] - work.times[0]):
            work.t_stiff, work.stiff_steps = np.inf, 0
        evaluator.states = states
        evaluator.slope(integration.t, y)

    def _note(
        self, c: int, t: float, kind: str, u: Any = None, after: Any = None, work: float = 0.0
    ) -> None:
        name = self.table.names[c]
        self._record(
            EventRecord(name=name, t=t, direction=0, kind=kind, u=u, u_after=after, work=work)
        )


def moved_by_share(s: ContactArrays, under: Integers) -> list[int]:
    """Contacts that share what they carry, and whose friction moves bodies as they share it.

    What they may carry more or less of, without a change of the rates of their rows, does so with
    the friction of what slides.

    Args:
        s: with modes and forces as decided.
        under: (m,) of what resists rolling, the contact that presses it; else -1.
    """
    share = np.flatnonzero(s.near.any(axis=1))
    if not np.any((s.mode[share] == 1.0) & (s.force[share, 1:].any(axis=1))):
        return []
    rows = [3 * c + i for c in share for i in range(3)
            if (s.mode[c] == 2.0 or i == 0) and (i > 0 or s.gapless[c] == 0.0)]  # fmt: skip
    with_friction = np.zeros((len(s.W), len(rows)))
    for k, row in enumerate(rows):
        with_friction[row, k], c = 1.0, row // 3
        for of in np.flatnonzero((s.mode == 1.0) & ((under == c) | (np.arange(len(under)) == c))):
            if row % 3 == 0 and s.force[c, 0] > 0.0:
                with_friction[3 * of + 1 : 3 * of + 3, k] = s.force[of, 1:] / s.force[c, 0]
    _, size, across = np.linalg.svd(s.W[rows] @ with_friction)
    free = with_friction @ across[np.sum(size > UNRESOLVED * size[0]) :].T
    _, moved, ways = np.linalg.svd(s.moves.T @ free, full_matrices=False)
    least = DEPENDS * np.max(np.linalg.norm(s.moves, axis=1))
    carried = np.abs(free @ ways[moved > least].T).max(axis=1, initial=0.0)
    return [c for c in share.tolist() if carried[3 * c : 3 * c + 3].max() > DEPENDS]
