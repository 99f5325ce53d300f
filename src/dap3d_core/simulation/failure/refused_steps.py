"""Why an implicit integration refused steps, in words."""

from collections.abc import Sequence

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.integrators import Integration
from dap3d_core.result import information
from dap3d_core.simulation.failure.stall import component_words

#: A note says why where so many steps, and this part of those tried, were refused.
MANY, PART = 10, 0.1


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
