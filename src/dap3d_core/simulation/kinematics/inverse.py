"""Inverse dynamics: the forces of actuators that produce a motion."""

import os
import time
from collections.abc import Callable, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.common.friction import PASSES, forces_by
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.registry.arguments import checked
from dap3d_core.result import Result, RunStatistics, information
from dap3d_core.result.arrays import Arrays
from dap3d_core.scene import Scene
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.errors import SimulationError, refuse_collisions
from dap3d_core.simulation.kinematics.kinematics import check_output, result_of
from dap3d_core.simulation.kinematics.motion_data import (
    Motion,
    misfit_notes,
    motion_on,
    read_motion,
)
from dap3d_core.simulation.kinematics.pose_equations import (
    ChosenRows,
    Flags,
    held_states,
    required_forces,
)
from dap3d_core.simulation.kinematics.unknown_forces import (
    Actuator,
    Closed,
    ContactForces,
    DriverActuator,
    actuators_of,
)
from dap3d_core.simulation.redundancy.freedoms import motion_words
from dap3d_core.simulation.redundancy.shared_reactions import refuse_shared, shared_laws
from dap3d_core.simulation.settings import compile_exact

Progress = Callable[[float, float], None]

#: What the record of a result has for its integrator.
NAME = "inverse dynamics"
#: What actuators leave of the forces of a motion, as a part of these, is not worth a note below.
PRODUCED = 1e-8
#: Forces below this part of those of the accelerations are rounding, as of a free fall.
FORCE_ROUNDING = 1e-13
#: Forces that depend on multipliers have settled where a pass changes these by less than this part;
#: what is left after all passes; differences of passes from which the next is extrapolated.
PASS_SETTLED, UNSETTLED, DEPTH = 1e-12, 1e-9, 8
#: Singular values of the actuation below this part of the longest wrench count as zero.
RANK = 1e-9


class Balance:
    """The equations M v_dot - g = D^T lambda + B tau of one instant, and their solution.

    Attributes:
        tau: (k,) forces of the actuators, of least norm; Lam: (rows,) multipliers.
        rank: of the actuation; left: (f,) what it leaves of the forces, in the free motions.
        forces: (k + c,) tau, then those of closed contacts; side: (f,) what all are to have done.
        shares: whether forces of contacts are not unique.
    """

    def __init__(
        self,
        t: float,
        rows: ChosenRows,
        held: Flags,
        actuators: Sequence[Actuator],
        wrenches: Floats,
        closed: Closed | None,
    ) -> None:
        self.t, self.rows, self.held = t, rows, held
        self.actuators, self.wrenches, self.closed = actuators, wrenches, closed
        self.tau = self.Lam = self.left = self.forces = self.side = np.zeros(0)
        self.rank, self.shares = 0, False

    def solve(self, needed: Floats) -> None:
        """Find forces and multipliers that give forces (6 n,) on the bodies.

        Raises:
            SimulationError: contacts leave their cones in all that was found.
        """
        rows, count, closed = self.rows, len(self.actuators), self.closed
        if closed is None:
            forces, self.rank = self._least(self.wrenches, needed)
            wrenches = self.wrenches
        else:
            wrenches, needed = np.hstack([self.wrenches, closed.wrenches]), needed - closed.known
            forces, rank = self._least(wrenches, needed)
            A, side = rows.free.T @ wrenches, rows.free.T @ needed
            forces = closed.contacts.within(closed, self.t, A, side, forces)
            self.rank, self.shares = count, rank < A.shape[1]
            self.forces, self.side = forces, side
        self.tau, self.Lam = forces[:count], np.zeros(len(self.held))
        self.left = rows.free.T @ (needed - wrenches @ forces)
        self.Lam[self.held] = rows.multipliers(needed - wrenches @ forces)
        for force, actuator in zip(self.tau, self.actuators, strict=True):
            if isinstance(actuator, DriverActuator):
                self.Lam[actuator.row] = force / actuator.size(rows.all_rows)
        if closed is not None:
            first = len(self.held) - 3 * closed.contacts.table.count
            self.Lam[first + np.array(closed.Lam, dtype=int)] = closed.scale * forces[count:]

    def _least(self, wrenches: Floats, needed: Floats) -> tuple[Floats, int]:
        """Forces of least norm with N^T B tau nearest to what is needed, and the rank."""
        A, side = self.rows.free.T @ wrenches, self.rows.free.T @ needed
        left, values, right = np.linalg.svd(A, full_matrices=False)
        longest = np.max(np.linalg.norm(self.rows.unit[:, None] * wrenches, axis=0), initial=0.0)
        rank = int(np.sum(values > RANK * longest))
        return right[:rank].T @ ((left[:, :rank].T @ side) / values[:rank]), rank


@checked
def inverse(
    scene: Scene | str | os.PathLike[str] | CompiledModel,
    motion: Any,
    actuators: Sequence[str] | str | None = None,
    *,
    progress: Progress | None = None,
    allow_code: bool = False,
    announce: Callable[[str], None] | None = None,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
) -> Result:
    """The forces of actuators that produce a motion of a scene.

    M v_dot - g = D^T lambda + B tau is solved for the reactions of the joints and the forces tau
    of the actuators: in the motions N that the joints leave, N^T B tau = N^T (M v_dot - g), tau of
    least norm where it is not unique.

    Args:
        scene: a Scene, what ``load`` takes, or a compiled model.
        motion: a ``Result`` with the same bodies, from which positions, velocities and
            accelerations are taken, and states of elements and inputs of the same names; or
            positions over time: {"t": times, "platform.r.x": values}, a data frame, an
            xarray.Dataset or the path of a CSV file with a header, whose columns are quantities
            that positions determine (body.r.x, body.p.e1, point.r.z, force.length). The motion is
            the nearest to them, by least squares, that the joints allow; its rates are those of
            splines of degree 5 through its positions.
        actuators: names of drivers (which then prescribe nothing) and of force elements whose type
            says what it ``actuates``; by default all drivers.
        progress, allow_code, announce, output, force: as of ``kinematics``.

    Returns:
        A result with the motion, the reactions, and for each actuator the quantity
        ``NAME.actuation``: the force or moment of a driver, positive where it drives its
        coordinate on, the force f_a of a ``ptp``, N or N m.

    Raises:
        SceneError, PluginError, ResultError: as ``compile``; unusable motion, actuators or output.
        SimulationError: the motion leaves freedoms open, or does not fit the joints.

    Source: Nikravesh, Computer-Aided Analysis of Mechanical Systems, 1988, chapter 11.
    """
    check_output(output, force=force)
    given = read_motion(motion)
    compiled = compile_exact(scene, allow_code, announce)
    refuse_collisions(compiled.model, "inverse dynamics")
    with compiled.borrow_evaluator() as evaluator, evaluator.held_inputs():
        result = _solved(compiled, evaluator, given, actuators, progress)
    if output is not None:
        result.save(output, force=force)
    return result


@attrs.define(eq=False)
class _Forces:
    """What is found at each instant, and what limits it.

    Attributes:
        tau: (nt, k) forces of the actuators.
        Lam: (nt, m) multipliers.
        potential, angles, residuals: (nt,), (nt, a), (nt, 3) of the result.
        states: (nt, s) of elements: modes of contacts are those of the motion.
        rank: the least of the actuation; freedoms: the most that the joints leave.
        idle: (k,) actuators that move nothing at any instant; units: of tau.
        shares: whether forces of contacts, with those of actuators, are not unique.
        missing: largest part of the forces that no actuator produces, with its instant and motion.
    """

    tau: Floats
    Lam: Floats
    potential: Floats
    angles: Floats
    residuals: Floats
    states: Floats
    rank: int
    idle: Flags
    units: Sequence[str] = ()
    freedoms: int = 0
    missing: tuple[float, float, Floats] | None = None
    shares: bool = False

    def take(self, balance: Balance, inertial: float, needed: Floats) -> None:
        """Take note of what limits the forces of an instant.

        inertial: N, the largest force that accelerates a body; needed: (6 n,) of all bodies.

        Raises:
            SimulationError: they are not finite.
        """
        free, t = balance.rows.free, balance.t
        self.rank, self.freedoms = min(self.rank, balance.rank), max(self.freedoms, free.shape[1])
        self.shares |= balance.shares
        size = float(np.linalg.norm(balance.left))
        unit = balance.rows.unit
        limit = PRODUCED * float(np.linalg.norm(unit * needed))
        limit += FORCE_ROUNDING * inertial * float(unit[0])
        if size > limit and (self.missing is None or size > self.missing[0]):
            self.missing = size, t, free @ balance.left
        if not (np.all(np.isfinite(balance.tau)) and np.all(np.isfinite(balance.Lam))):
            raise SimulationError(f"the forces are not finite at t = {t:.6g} s")


def _solved(
    compiled: CompiledModel,
    evaluator: Evaluator,
    given: Any,
    names: Sequence[str] | str | None,
    progress: Progress | None,
) -> Result:
    started, model = time.perf_counter(), evaluator.model
    chosen = actuators_of(compiled, evaluator, names)
    held = np.ones(model.row_count, dtype=bool)
    held[[a.row for a in chosen if isinstance(a, DriverActuator)]] = False
    held[model.joint_row_count :] = False  # contacts hold by their forces
    settings = compiled.scene.simulation
    start = compiled.start(True, settings.hold, str(settings.correct_metric))
    refuse_shared(shared_laws(compiled.checked, evaluator, start.u, start.redundancy), evaluator)
    evaluator.start(0.0, start.u)
    motion = motion_on(evaluator, given, start.u, held, compiled.scene_text)
    evaluator.start(float(motion.t[0]), motion.u[0])
    contacts = ContactForces(evaluator) if model.contact_count else None
    forces = _forces(evaluator, motion, chosen, held, contacts, progress)
    position, velocity, acceleration = forces.residuals.T
    arrays = Arrays(
        motion.t.copy(), motion.u, motion.v_dot, forces.Lam, np.zeros(len(motion.t)),
        forces.potential, position, velocity, acceleration, forces.angles, forces.states,
        motion.inputs,
    )  # fmt: skip
    notes = [*compiled.notes, *misfit_notes(motion.misfit), *_notes(evaluator, chosen, forces),
             *held_states(motion.held), *(contacts.notes() if contacts else [])]  # fmt: skip
    return result_of(
        compiled,
        arrays,
        notes,
        {
            "t_end": float(motion.t[-1]),
            "actuators": ", ".join(actuator.name for actuator in chosen),
            "actuation_units": ", ".join(forces.units),
            "correct": False,
            "rank": 6 * model.body_count - forces.freedoms,
        },
        stats=RunStatistics(
            wall_time_s=time.perf_counter() - started, compile_time_s=compiled.compile_time
        ),
        integrator=NAME,
        actuation={a.name: forces.tau[:, k] for k, a in enumerate(chosen)},
    )


def _forces(
    evaluator: Evaluator,
    motion: Motion,
    actuators: list[Actuator],
    held: Flags,
    contacts: ContactForces | None,
    progress: Progress | None,
) -> _Forces:
    """Forces and reactions at all instants."""
    model, count = evaluator.model, len(motion.t)
    layout = model.report_layout
    out = _Forces(np.zeros((count, len(actuators))), np.zeros((count, model.row_count)),
                  np.zeros(count), np.zeros((count, model.angle_count)), np.zeros((count, 3)),
                  motion.states, rank=len(actuators),
                  idle=np.ones(len(actuators), dtype=bool))  # fmt: skip
    for k, (t, u, v_dot) in enumerate(zip(motion.t.tolist(), motion.u, motion.v_dot, strict=True)):
        evaluator.states = motion.states[k]
        evaluator.set_inputs(motion.inputs[k])
        if motion.angles is None:
            evaluator.count_turns(t, u)
        else:
            evaluator.begin_turns(t, u, motion.angles[k])
        report = evaluator.report(t, u)
        out.angles[k] = report[layout["angles"]]
        needed = required_forces(evaluator, t, u, v_dot)
        rows = ChosenRows(evaluator, t, u, held)
        own = [a.wrench(t, rows.all_rows) for a in actuators]
        wrenches = np.array(own).reshape(-1, len(needed)).T
        out.idle &= ~wrenches.any(axis=0)
        out.units = out.units or [a.unit(rows.all_rows) for a in actuators]
        out.potential[k] = report[layout["potential_energy"]][0]
        out.potential[k] -= sum(a.potential() for a in actuators)
        needed = needed + wrenches @ [a.given for a in actuators]  # tau takes the place of these
        closed = contacts.at(t, u) if contacts else None
        if closed is not None:
            out.states[k] = closed.states
        balance = Balance(t, rows, held, actuators, wrenches, closed)
        _solve(balance, evaluator, u, needed)
        out.tau[k], out.Lam[k] = balance.tau, balance.Lam
        v = u[-6 * model.body_count :]
        out.residuals[k] = (np.max(np.abs(rows.rows.C[held]), initial=0.0),
                            rows.residual(v, rows.rows.nu),
                            rows.residual(v_dot, rows.rows.gamma))  # fmt: skip
        out.take(balance, model.mass.max() * np.abs(v_dot).max(initial=0.0), needed)
        if progress is not None:
            progress(t, float(motion.t[-1]))
    return out


def _solve(balance: Balance, evaluator: Evaluator, u: Floats, needed: Floats) -> None:
    """Solve a balance with the forces that depend on multipliers."""
    closed, t, states = balance.closed, balance.t, evaluator.states
    balance.solve(needed)
    guess, taken, rests, rest = balance.Lam, list[Floats](), list[Floats](), np.zeros(0)
    model = evaluator.model
    depends = len(model.iterated_forces) > model.contact_count or bool(model.loaded_contacts)
    for _ in range(PASSES if depends else 0):
        if closed is not None:
            closed.take_loads(guess)
            evaluator.states = closed.loaded
        evaluator.place(t, u)
        balance.solve(needed - forces_by(t, evaluator.system, evaluator.loops, guess)[6:])
        evaluator.states, rest = states, balance.Lam - guess
        if np.max(np.abs(rest), initial=0.0) <= PASS_SETTLED * np.max(np.abs(guess), initial=0.0):
            break
        taken, rests = [*taken, guess][-DEPTH:], [*rests, rest][-DEPTH:]
        guess = _extrapolated(balance.Lam, taken, rests)
    if not np.max(np.abs(rest), initial=0.0) <= UNSETTLED * np.abs(balance.Lam).max(initial=0.0):
        raise SimulationError(
            f"forces that depend on reactions of joints do not settle at t = {t:.6g} s: they raise "
            "their own load by more than that load"
        )
    if closed is not None:
        closed.contacts.take(closed, t, balance.forces, balance.side)


def _extrapolated(given: Floats, taken: list[Floats], rests: list[Floats]) -> Floats:
    """What a fixed point is taken for next (Anderson, J. ACM 12 (1965) 547).

    Args:
        given: what the last of ``taken`` gave.
        taken, rests: the last guesses, and by how much each gave something else.
    """
    if len(rests) < 2:
        return given
    changes, moves = np.diff(rests, axis=0).T, np.diff(taken, axis=0).T
    share = np.linalg.lstsq(changes, rests[-1], rcond=1e-10)[0]
    found: Floats = given - (moves + changes) @ share
    return found


def _notes(evaluator: Evaluator, actuators: list[Actuator], forces: _Forces) -> list[str]:
    """Redundant actuators, and forces that none produces, in words."""
    notes: list[str] = []
    names = ", ".join(actuator.name for actuator in actuators)
    surplus = len(actuators) - forces.rank - int(forces.idle.sum())
    drivers = [a.name for a in actuators if isinstance(a, DriverActuator)]
    if drivers:
        notes.append(
            information(
                f"{', '.join(drivers)} prescribe{'s' * (len(drivers) == 1)} nothing here: "
                "the motion is the one given, and the driver's actuation is the force that it takes"
            )
        )
    if forces.idle.any():
        idle = ", ".join(
            a.name for a, is_idle in zip(actuators, forces.idle, strict=True) if is_idle
        )
        notes.append(f"{idle} moves nothing at any instant: an input or a function that is its "
                     "factor is zero; give the input a value")  # fmt: skip
    if surplus > 0:
        notes.append(
            f"the actuation is redundant: of {len(actuators)} actuators ({names}) "
            f"{forces.rank} are independent; reported are the forces of least norm, the square "
            "root of the sum of their squares in N and N m"
        )
    if forces.shares:
        notes.append(
            information(
                "forces of contacts and actuators are not unique; reported are those of least norm "
                "within the cones of friction"
            )
        )
    if forces.missing is not None:
        size, t, motion = forces.missing
        acting = f"the actuators ({names})" if names else "contacts alone"
        notes.append(
            f"{acting} cannot produce the whole motion: at t = {t:.6g} s {size:.3g} (N, N m) is "
            f"missing, where {motion_words(evaluator.model, motion)}; name actuators that move "
            "this, too"
        )
    return notes
