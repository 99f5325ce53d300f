"""Integrations that take a run over from each other: where it is stiff, at singular poses, at slip.

The iteration of Radau IIA does not converge where a weak singular value of the constraints changes
its sign, and its steps stop short of it. Those of dop853 are placed about it
(integrators/stepping/singular_poses.py, docs/decisions/0007), so it takes the run across.

Slip of contacts that begins with no acceleration is stiff while it is slow (docs/decisions/0097):
where an explicit integration does not get on, Radau IIA takes the run to where it is faster.
"""

from collections.abc import Sequence

import numpy as np

from dap3d_core.formulations import PROJECT
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.integrators import EXPLICIT, IMPLICIT, Integration, Status
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.singular_poses import NOW, RATE, forget_measures
from dap3d_core.kernels.array_types import Floats
from dap3d_core.result import information
from dap3d_core.simulation.run_state import RunState

WHY_STIFF = "motions that have died away limit the steps, not the error of those that go on"
#: A singular pose is met where it is less than this part of the run away.
NEAR = 0.05
#: Rates of lengths are taken over this part of the run.
APART = 1e-5
#: The implicit integrator takes over again behind this many times the way to the pose.
BEHIND = 3.0
#: A length that goes to zero with a higher power of the time left than this is not near zero.
HIGHEST = 6.0
#: Part of the run in which slip that has begun becomes fast enough for explicit steps.
SLIPPING = 1e-4
#: The first step there, by the explicit ones: at first slip changes by as much as it is within few
#: of them, and the iteration for the stages converges where it changes by some times as much.
FIRST = 30.0
SLOW_SLIP = information(
    "explicit steps became too short, as slip asks for that begins with next to no acceleration: "
    f"{IMPLICIT.name} took the run on until it was faster"
)
#: How an integration ends that does not get through a singular pose.
FAILURES = (Status.STEP_FLOOR, Status.NOT_FINITE, Status.PROJECTION_FAILED, Status.STALLED)


def hand_over(run: RunState) -> bool:
    """Let the other integration go on where the present one leaves the run to it; whether so.

    An explicit one does where the scene is stiff, or behind a singular pose; an implicit one
    before such a pose, once. Of slow slip it is the other way round.
    """
    present, settings, left = run.present, run.settings, np.inf
    slips = _leaves_slip(run)
    if not slips and present.status in (Status.STIFF, Status.RUNNING):
        run.until = np.inf
        if present.status is Status.RUNNING:
            present.work.status = Status.FINISHED
    elif not slips:
        left = _left(run)
        has_just_begun = len(run.integrations) > 1 and run.integrations[0].t >= present.t
        if left == np.inf or has_just_begun or settings.step or not settings.project:
            return False
        run.until = present.t + BEHIND * left
        run.crossed.append(present.t + left)
    if len(run.integrations) == 1:
        switch_integrator(run)
    else:
        take_over(run.integrations[0], present)
        run.integrations.reverse()
        run.observe_present()
    if left < np.inf:
        _aim_across(run, left)
    elif slips and run.present.implicit:
        run.present.work.h = FIRST * present.work.h
    return True


def _leaves_slip(run: RunState) -> bool:
    """Whether slow slip stops the present integration; sets ``until`` when another goes on."""
    present, first = run.present, run.integrations[0].work
    if present.implicit and run.until < np.inf and present.status in FAILURES:
        run.until, first.stops_when_slow = np.inf, 0  # it does not get through either
        return True
    if present.status is not Status.STIFF or not present.work.stops_when_slow:
        return False
    run.until = present.t + SLIPPING * run.t_end
    if SLOW_SLIP not in run.notes:
        run.notes.append(SLOW_SLIP)
    return True


def switch_integrator(run: RunState) -> None:
    """Continue with the other one of the explicit and the implicit integrator."""
    present = run.present
    if not present.implicit and run.until == np.inf:
        until = f"{EXPLICIT.name} until t = {present.t:.6g} s"
        note = f"integrator auto: {until}, then {IMPLICIT.name}: {WHY_STIFF}"
        run.notes.append(information(note))
    integrator = EXPLICIT if present.implicit else IMPLICIT
    options = run.options | {"first_step": None}
    integration = integrator.make(run.evaluator, present.y, run.times, **options)
    take_over(integration, present)
    run.begin(integration)


def take_over(integration: Integration, before: Integration) -> None:
    """Continue the run with another integration, from the state of the present one."""
    work = integration.work
    work.state[at.Y] = before.work.state[at.Y]
    work.t, work.next_report = before.t, before.work.next_report
    work.t_stiff, work.status = np.inf, Status.RUNNING
    work.error_across_singularity = work.failed_error_rate = 0.0
    work.near_singular_landings = work.stalled_steps = 0
    work.stiff_steps = work.nonstiff_steps = work.attempt_count = 0
    work.t_attempted, work.stall_start = before.t, work.rhs_count
    if hasattr(work, "lengths"):
        forget_measures(work)
    integration.restart()


def stiffness_notes(integrations: Sequence[Integration], integrator: str) -> list[str]:
    """That the scene is stiff for the one integration of a run, where it is."""
    t = integrations[0].t_stiff
    if t is None or len(integrations) > 1:
        return []
    used = EXPLICIT.name if integrator == "auto" else integrator
    return [
        information(
            f"the scene is stiff from t = {t:.6g} s on: {WHY_STIFF}. {used} takes small "
            f"steps for that; {IMPLICIT.name}, or auto, takes fewer"
        )
    ]


def _left(run: RunState) -> float:
    """Time left until the near pose that has stopped the implicit integrator; infinite if none."""
    present, span = run.present, run.t_end
    if not present.implicit or present.status not in FAILURES:
        return np.inf
    lengths = lengths_at(run.evaluator, present.t, present.y, span)
    now, rate = lengths[:, lengths[RATE] < 0.0]
    nearest = float(np.min(-now / rate, initial=np.inf))
    return nearest if nearest < NEAR * span else np.inf


def _aim_across(run: RunState, left: float) -> None:
    """Aim the first explicit step across the pose; a trial step moves closer."""
    present = run.present
    span = run.t_end
    present.work.lengths[[NOW, RATE]] = lengths_at(run.evaluator, present.t, present.y, span)
    present.work.h = left / present.work.widest_gap_abscissa


@IGNORE_FLOAT_ERRORS
def lengths_at(evaluator: Evaluator, t: float, y: Floats, span: float) -> Floats:
    """(2, m) lengths that projection gives, and their rates, as singular_poses.py has them.

    A length that falls ever slower is given the mean rate until it vanishes.

    Args:
        t, y: state of the motion, on the constraints.
        span: length of the run, s.
    """
    slope, h = evaluator.slope(t, y), APART * span
    now, before, earlier = (_lengths(evaluator, t - k * h, y - k * h * slope) for k in range(3))
    rate, bend = (now - before) / h, (now - 2.0 * before + earlier) / h**2
    return np.array([now, mean_rate(now, rate, bend)])


@np.errstate(all="ignore")
def mean_rate(now: Floats, rate: Floats, bend: Floats) -> Floats:
    """(m,) mean rates of lengths that fall ever slower until they vanish; of others their rates.

    By the parabola of these second derivatives; where it does not reach zero by a power of the time
    left: the powers of c d^k are k, for 1 - now bend / rate^2 = 1 / k.
    """
    inside = rate**2 - 2.0 * bend * now
    powers = np.rint(1.0 / (1.0 - now * bend / rate**2))
    powers = np.where((powers > 1.0) & (powers <= HIGHEST), powers, 1.0)
    mean = np.where(inside >= 0.0, 0.5 * (rate - np.sqrt(inside)), rate / powers)
    return np.where((rate < 0.0) & (bend > 0.0), mean, rate)


def _lengths(evaluator: Evaluator, t: float, y: Floats) -> Floats:
    found = np.zeros(at.MEASURES - at.PROJECTED + evaluator.length_count)
    evaluator.functions[PROJECT](t, y.copy(), found, evaluator.system, evaluator.loops)
    return found[at.MEASURES - at.PROJECTED :]


def crossing_notes(crossed: Sequence[float]) -> list[str]:
    """Note on the times of poses that the explicit integrator crossed for the implicit one."""
    if not crossed:
        return []
    often = "once" if len(crossed) == 1 else f"{len(crossed)} times"
    return [
        information(
            f"{IMPLICIT.name} met a singular pose {often} (first at "
            f"t = {crossed[0]:.6g} s), where {EXPLICIT.name} took the run across"
        )
    ]


def singular_failure_message(message: str, run: RunState) -> str:
    """Message for a run that the implicit integrator ended before a singular pose.

    message: the former.
    """
    left = _left(run)
    if left == np.inf:
        return message
    return (
        f"{message}. Integrator {IMPLICIT.name} cannot cross the singular pose at "
        f"t = {run.present.t + left:.6g} s; {EXPLICIT.name} and auto can, with project on and "
        "steps that their error chooses"
    )
