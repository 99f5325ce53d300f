"""Words on a run that stalled: what limits its steps, and which setting changes that."""

from collections.abc import Sequence

import numpy as np

from dap3d_core.formulations import RHS
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.integrators import IMPLICIT, Integration
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.result import information

#: What components are, by their letters in tolerances.
WORDS = {
    "r": "position",
    "p": "orientation",
    "v": "velocity",
    "w": "angular velocity",
    "z": "state of an element",
}
#: An iteration that converges slower than this limits the steps.
SLOW = 0.3
#: ``rounding_state`` where errors are rounding.
AT_ROUNDING = 2

#: A note says why where so many steps, and this part of those tried, were refused.
MANY, PART = 10, 0.1


def describe_stall(evaluator: Evaluator, integration: Integration) -> str:
    """What limits the steps of an integration that stalled, and what would change that."""
    work = integration.work
    what = _fastest(evaluator, integration)
    if work.rounding_state == AT_ROUNDING:
        limit = f"rounding of the rates limits them, first that of {what}"
        remedy = (
            "Larger tolerances (rtol, atol) let longer steps pass; inertias that differ less, or "
            "a place nearer to the origin, make the rounding smaller"
        )
    elif not integration.implicit:
        limit = f"what changes fastest is {what}"
        remedy = (
            f"Where that is stiff, as contact and friction at rest are, integrator {IMPLICIT.name} "
            "or auto takes longer steps; else larger tolerances (rtol, atol) do"
        )
    elif work.convergence_rate > SLOW or work.last_rejected:
        limit = (
            "the iteration for the stages of a longer step does not converge, for a force or a row "
            f"changes within it; what changes fastest is {what}"
        )
        remedy = (
            "Let forces there change over a wider range (v_tol, w_tol of friction, k of contact), "
            "or give a smaller rtol where rtol times a velocity is more than v_tol"
        )
    else:
        limit = f"the error limits them, first that of {what}"
        remedy = "Give larger tolerances (rtol, atol), or a larger atol for that quantity alone"
    return f"At {work.h:.2g} s, {limit}. {remedy}"


@IGNORE_FLOAT_ERRORS
def _fastest(evaluator: Evaluator, integration: Integration) -> str:
    """Quantity and body whose rate changes most in a step, by the tolerances."""
    work, y, h = integration.work, integration.y, float(integration.work.h)
    rates = np.zeros((2, len(y)))
    for k in range(2):
        argument = y + k * h * rates[0]
        evaluator.functions[RHS](
            integration.t + k * h, argument, rates[k], evaluator.system, evaluator.loops
        )
    size = work.error_size
    scale = work.tolerance[at.ABSOLUTE, :size] + work.rtol * np.abs(y[:size])
    change = np.abs(rates[1] - rates[0])[:size] / scale
    worst = int(np.argmax(np.where(np.isfinite(change), change, np.inf)))
    return component_words(evaluator, worst)


def component_words(evaluator: Evaluator, component: int) -> str:
    """Quantity and body of a component of the integrated state."""
    coordinates = evaluator.coordinates
    name, body = WORDS[coordinates.quantities[component]], int(coordinates.bodies[component])
    return f"the {name} of body {evaluator.model.body_names[body]}" if body >= 0 else f"a {name}"


def describe_refusals(evaluator: Evaluator, integration: Integration) -> str:
    """Steps that were refused, by the reason; "" where none was."""
    found, parts = integration.refusals, []
    if found is None:
        return ""
    if found.iteration:
        parts.append(
            f"{found.iteration} whose iteration for the stages did not converge (what changed most "
            f"there, most often: {component_words(evaluator, found.worst)})"
        )
    if found.singular:
        parts.append(f"{found.singular} whose matrix was singular")
    if found.error:
        parts.append(f"{found.error} for their error")
    return ", ".join(parts)


def refusal_notes(evaluator: Evaluator, runs: Sequence[Integration]) -> list[str]:
    """A note on each integration that refused many steps."""
    notes: list[str] = []
    for run in runs:
        if run.refusals is None:
            continue
        refused, tried = sum(run.refusals[:3]), run.statistics.steps + run.statistics.rejected
        if refused >= MANY and refused > PART * tried:
            words = describe_refusals(evaluator, run)
            notes.append(information(f"{run.name} refused {refused} of {tried} steps: {words}"))
    return notes
