"""How a run ended, and what is said of it."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs

from dap3d_core.cli.console.console import (
    Terminal,
    facts,
    items,
    messages,
    output,
    print_json,
    say,
    size,
    title,
)
from dap3d_core.cli.console.initial_state import show_start, start_facts
from dap3d_core.cli.console.run_facts import facts_of, violations_of, warnings_of
from dap3d_core.cli.console.run_summary import run_pairs, show_events, show_ledger, show_remarks
from dap3d_core.cli.process import exit_codes

if TYPE_CHECKING:
    from dap3d_core.result import Result
    from dap3d_core.simulation import CompiledModel


@attrs.frozen(eq=False)
class Outcome:
    """A run that left a result.

    Attributes:
        compiled: the model.
        result: what was computed.
        code: the exit code, but for ``--strict``.
        reason: why it ended early; "" where it did not.
        checkpoint: from where ``resume`` goes on; None where it cannot.
    """

    compiled: "CompiledModel"
    result: "Result"
    code: int
    reason: str
    checkpoint: Path | None


def tell(
    outcome: Outcome, model: str, target: Path, *, strict: bool, as_json: bool, quiet: bool
) -> int:
    """Tell how a run ended that was saved; returns the exit code."""
    found = facts_of(outcome.result)
    faults = violations_of(found)
    code = outcome.code
    if strict and code == exit_codes.DONE and (faults or warnings_of(found)):
        code = exit_codes.FAILED
    if as_json:
        print_json(
            {
                "model": model,
                "file": str(target),
                **found,
                "initial": _initial(outcome),
                "reason": outcome.reason,
                "checkpoint": str(outcome.checkpoint) if outcome.checkpoint else None,
                "exit_code": code,
            }
        )
    elif not quiet:
        _show_all(output(), outcome, found, target)
    if outcome.reason or (quiet and not as_json):
        _show_faults(messages(), outcome, faults if quiet else [], target)
    if code != outcome.code:
        say(messages(), "--strict: there are warnings, or the ledger does not close; exit code 1")
    return code


def _show_all(console: Terminal, outcome: Outcome, found: dict[str, Any], target: Path) -> None:
    words = found["scene"] or "scene without a name"
    title(console, words if found["status"] == "done" else f"{words}: {found['status']}")
    if outcome.compiled.scene.description:
        say(console, str(outcome.compiled.scene.description), indent=2)
    facts(console, run_pairs(found))
    _show_corrected(console, outcome)
    show_events(console, found)
    show_ledger(console, found)
    show_remarks(console, found)
    say(console, f"{target} written ({size(target.stat().st_size)}). Next:", whole=True)
    name = shlex.quote(str(target))
    body = outcome.result.subject.body_names[0]
    quantity = shlex.quote(f"{body}.r")
    commands = (f"plot {name} {quantity}", f"view {name} --open", f"animate {name}", f"info {name}")
    for line in commands:
        say(console, f"dap3d {line}", "green", indent=2, whole=True)


def _show_faults(console: Terminal, outcome: Outcome, faults: list[str], target: Path) -> None:
    items(console, faults, "red")
    if outcome.reason:
        result = outcome.result
        say(console, outcome.reason, "bold red")
        last = f"t = {result.t[-1]:.6g} s"
        say(console, f"what was computed until then, up to {last}, is in {target}")
        if outcome.checkpoint is not None:
            name = shlex.quote(str(outcome.checkpoint))
            say(console, "to go on from there:")
            say(console, f"dap3d resume {name}", "green", indent=2, whole=True)


def _show_corrected(console: Terminal, outcome: Outcome) -> None:
    initial = _initial(outcome)
    if initial is not None:
        show_start(console, initial)


def _initial(outcome: Outcome) -> dict[str, Any] | None:
    """The initial conditions after their correction; None where none was asked for or needed."""
    result = outcome.result
    if not (result.settings.get("correct") and result.subject.row_count and len(result.t)):
        return None
    first = result.arrays.part(slice(1)).u[0]
    return start_facts(result.subject.body_names, outcome.compiled.model.u0, first)
