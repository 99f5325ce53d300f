"""Messages on the end of a run and on the events before it."""

from collections.abc import Sequence
from typing import Any

from dap3d_core.formulations.common.friction import PASSES
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.integrators import Integration, Status
from dap3d_core.integrators.stepping.event_location import CHATTER
from dap3d_core.integrators.stepping.integration_state import LOGGED
from dap3d_core.model.state_layout import u_from_y
from dap3d_core.result import EventRecord, information
from dap3d_core.simulation.failure.diagnosis import AHEAD, fastest_body, find_offender
from dap3d_core.simulation.failure.stall import describe_refusals, describe_stall
from dap3d_core.simulation.redundancy.near_redundant import find_contradiction

REASONS = {
    Status.STEP_FLOOR: "the step size fell to the resolution of time",
    Status.NOT_FINITE: "a number came up that is beyond 1e+100, infinite or not a number",
    Status.PROJECTION_FAILED: "the state could not be projected onto the constraints",
    Status.STALLED: "its steps are so short that it would not end",
}


def accuracy_warnings(evaluator: Evaluator) -> list[str]:
    """Notes on what was computed less surely than all else."""
    notes: list[str] = []
    if (count := evaluator.friction_failure_count) and evaluator.model.friction:
        notes.append(
            f"friction: the multipliers did not settle in {PASSES} passes, {count} times, "
            "reports included; the last ones were used. Motion there is uncertain: a high mu may "
            "lock the joint by itself"
        )
    if count := evaluator.singular_reports:
        notes.append(
            f"{count} times a pose was singular where it was reported: the rows leave "
            "accelerations open there, and those reported, with their multipliers, are not "
            "determined"
        )
    return notes


def why_stopped(evaluator: Evaluator, integration: Integration, rank: int) -> str:
    """Reason why an integration ended early, with the element to blame; rank: that of the start."""
    t, y = integration.t, evaluator.body_state(integration.y)
    head = f"the run stopped at t = {t:.9g} s"
    if integration.status is Status.SWITCHED:
        switch = evaluator.switches[integration.terminal_switch]
        return f"{head}: {_title(evaluator, integration.terminal_switch)}: {switch.words}"
    if integration.status is Status.CHATTERED:
        return f"{head}: {_chatter(evaluator, integration)}"
    if integration.status is Status.DRIVEN:
        return f"{head}: {integration.driving}"
    t_stop = integration.t_stop if integration.t_stop is not None else t
    message = f"{head}: {REASONS[integration.status]}"
    if integration.status is Status.STEP_FLOOR and (step := integration.work.fixed_step):
        message = (
            f"{head}: a step of {step:g} s, as given, cannot be taken there; give a shorter step, "
            "or none, and rtol chooses the steps"
        )
    words = describe_refusals(evaluator, integration)
    if integration.status is Status.STEP_FLOOR and words:
        message = f"{message} (refused so far: {words})"
    if integration.status is not Status.NOT_FINITE:
        culprit = find_contradiction(evaluator, t, y, rank)
        if culprit:
            return f"{head}: {culprit}"
    if integration.status is Status.STALLED:
        return f"{message}. {describe_stall(evaluator, integration)}"
    culprit = jammed_forces(evaluator, t, y) or find_offender(evaluator, t, y, t_stop)
    if not culprit and integration.status is Status.NOT_FINITE:
        culprit = integration.too_fast or fastest_body(evaluator, y)
    reasons = [words for words in (culprit, integration.overlapping) if words]
    return f"{message}: {'; '.join(reasons)}" if reasons else message


def jammed_forces(evaluator: Evaluator, t: float, y: Any) -> str:
    """The forces on reactions where these did not settle in a run that failed, in words; or ""."""
    model = evaluator.model
    reading = [model.force_names[k] for g in model.forces if g.read for k in g.members.tolist()]
    if not reading:
        return ""
    if not evaluator.friction_failure_count:  # of radau, which iterates on its stages
        for later in AHEAD:
            evaluator.rhs(t + later * (1.0 + abs(t)), u_from_y(y, model.state_count))
    if not evaluator.friction_failure_count:
        return ""
    return (
        f"force{'s' if len(reading) > 1 else ''} {', '.join(reading)}: the reactions that they "
        f"read did not settle in {PASSES} passes. A brake that raises its own load by more than "
        "that load jams: no acceleration fits it"
    )


def occurrences(
    evaluator: Evaluator, runs: Sequence[Integration], of_script: Sequence[EventRecord]
) -> list[EventRecord]:
    """Records of the located events, in their order."""
    last = runs[-1]
    ended = last.status is Status.SWITCHED
    found = []
    for t, which, side in (crossing for run in runs for crossing in run.crossings):
        switch = evaluator.switches[int(which)]
        ends = ended and int(which) == last.terminal_switch and side < 0.0 and bool(switch.words)
        kind = switch.group.type_info.type.kind
        found.append(
            EventRecord(
                name=f"{kind} {switch.name(evaluator.model)}",
                t=float(t),
                direction=int(side),
                kind="end" if ends else "switch",
            )
        )
    return sorted([*found, *of_script], key=lambda event: event.t)


def event_notes(runs: Sequence[Integration], events: Sequence[EventRecord]) -> list[str]:
    """Notes on what happened: an event that stopped the run, more crossings than are kept."""
    notes: list[str] = [information(f"the run was stopped by an event, {event.words}")
             for event in events if event.kind == "stop"]  # fmt: skip
    if (count := sum(run.crossing_count for run in runs)) > LOGGED:
        notes.append(
            information(f"switches changed their sign {count} times; the first {LOGGED} are kept")
        )
    return notes


def _title(evaluator: Evaluator, which: int) -> str:
    switch = evaluator.switches[which]
    group = switch.group
    return f"{group.type_info.type.kind} {switch.name(evaluator.model)} ({group.keyword})"


def _chatter(evaluator: Evaluator, integration: Integration) -> str:
    """Message on a chattering switch, its duration, and the remedy."""
    since, count = integration.chatter
    switch = evaluator.switches[integration.terminal_switch]
    if switch.jumps:
        return (
            f"{_title(evaluator, integration.terminal_switch)} bounces to rest: velocities jumped "
            f"{count} times within {integration.t - since:.2g} s (more than {CHATTER} in a "
            "millionth of the run end it). Let a spring carry slow contact, as v_rest and k of "
            "ptp_stop and its like do, or end the run by an event before"
        )
    return (
        f"{_title(evaluator, integration.terminal_switch)} chatters: its switch changed its sign "
        f"{count} times within {integration.t - since:.2g} s (more than {CHATTER} in a millionth "
        "of the run end it). On either side its law drives the motion back to the other; let the "
        "law change over a small range, as tanh does, or give it a range in which it stays as it is"
    )
