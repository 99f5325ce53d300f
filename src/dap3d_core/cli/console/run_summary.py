"""Summary of a run, as JSON data and as text: for ``run``, ``resume``, ``info`` and ``check``.

60 columns are wide enough for all of it.
"""

import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
from rich.text import Text

from dap3d_core.cli.console.console import (
    Terminal,
    count,
    json_value,
    print_json,
    scene_name,
    seconds,
    shell_word,
    size,
    stderr,
    stdout,
)
from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.streams import is_quiet, prints_json

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from dap3d_core.result import Result
    from dap3d_core.simulation import CompiledModel

#: Events that are printed after a run, and of a file.
MOST_EVENTS, MOST_OF_FILE = 6, 200
#: Bodies whose corrected initial conditions are printed, those that were changed most.
MOST_BODIES = 5
#: Forces of actuators that the next command plots.
MOST_PLOTTED = 3
#: Smaller changes, relative for numbers larger than one, are not printed.
PRINTED = 1e-9
#: Smaller changes are rounding.
CHANGED = 1e-12


# ---------------------------------------------------------------------------- data


def run_data(result: "Result") -> dict[str, Any]:
    """The summary of a result as data."""
    summary, error = result.summary, result.error
    instants = len(result.t)
    dof = 6 * summary.body_count - result.settings.get("rank", summary.row_count)
    return {
        "scene": result.record.title,
        "status": result.status,
        "bodies": summary.body_count,
        "joints": len(summary.joint_index),
        "rows": summary.row_count - 3 * len(summary.contact_points),
        "contacts": len(summary.contacts),
        "dof": dof,
        "points": len(summary.point_names),
        "method": result.method,
        "integrator": result.integrator,
        "settings": result.settings,
        "instants": instants,
        "t_start": float(result.t[0]) if instants else None,
        "t_end": float(result.t[-1]) if instants else None,
        **attrs.asdict(result.stats),
        "error_estimate": error
        and {**error.largest, "meaningless_from": error.meaningless_from, "tenfold": error.tenfold},
        "events": [
            {**attrs.asdict(event, filter=lambda field, _: field.name != "u"), "text": event.words}
            for event in result.events
        ],
        "ledger": {name: attrs.asdict(entry) for name, entry in result.ledger.items()},
        "notes": result.notes,
        "versions": result.versions,
    }


def _split_notes(data: dict[str, Any]) -> tuple[str, list[str]]:
    """The reason of the choice of the method, and the other notes."""
    from dap3d_core.result.note import Note

    choice = f"method {data['method']}: "
    notes = list(map(Note, data["notes"]))
    chosen = [note for note in notes if note.text.startswith(choice)][-1:]  # others are of its rows
    others = [str(note) for note in notes if note not in chosen]
    return chosen[0].text.removeprefix(choice) if chosen else "", others


def _violations(data: dict[str, Any]) -> list[str]:
    """The entries of the ledger that are beyond their limits."""
    return [
        f"{name} is {e['value']:.2g}, its limit {e['limit']:.2g}: {e['text']}"
        for name, e in data["ledger"].items()
        if e["ok"] is False
    ]


def correction_data(
    names: Sequence[str], given: "NDArray[np.float64]", u: "NDArray[np.float64]"
) -> dict[str, Any]:
    """The correction of initial conditions as data.

    Args:
        names: of the bodies.
        given: (13 n,) the state of the scene.
        u: (13 n,) the state from which a run starts.
    """
    import numpy as np

    from dap3d_core.model.state_layout import split

    change = np.abs(u - given) / (1.0 + np.abs(given))
    parts = split(change)
    largest = np.max([np.max(part, axis=1) for part in parts], axis=0)
    most = np.argsort(-largest, kind="stable")[:MOST_BODIES]
    arrays = dict(zip(("r", "p", "r_dot", "w"), split(u), strict=True))
    return {
        "changed": bool(np.any(change > CHANGED)),
        "changed_bodies": [n for n, x in zip(names, largest, strict=True) if x > PRINTED],
        "most_changed": [names[k] for k in most if largest[k] > PRINTED],
        "bodies": {
            name: {symbol: json_value(values[k]) for symbol, values in arrays.items()}
            for k, name in enumerate(names)
        },
    }


# ---------------------------------------------------------------------------- a finished run


@attrs.frozen(eq=False)
class RunOutcome:
    """A run that has a result.

    Attributes:
        compiled: the model.
        result: what was computed.
        code: the exit code without ``--strict``.
        reason: why it ended early; "" otherwise.
        checkpoint: file from which ``resume`` continues, or None.
    """

    compiled: "CompiledModel"
    result: "Result"
    code: int
    reason: str
    checkpoint: Path | None


def _correction(outcome: RunOutcome) -> dict[str, Any] | None:
    """The correction of a run; None if there was none to make."""
    result = outcome.result
    if not (result.settings.get("correct") and result.summary.row_count and len(result.t)):
        return None
    if result.settings.get("start", "scene") != "scene":
        return None
    first = result.arrays.part(slice(1)).u[0]
    return correction_data(result.summary.body_names, outcome.compiled.model.u0, first)


def report_run(outcome: RunOutcome, model: str, target: Path, *, strict: bool) -> int:
    """Report a run that was saved; returns the exit code."""
    from dap3d_core.result.note import warnings_of

    data = run_data(outcome.result)
    initial = _correction(outcome)
    violations = _violations(data)
    code = outcome.code
    warnings = list(warnings_of(_split_notes(data)[1]))
    if strict and code == exit_codes.DONE and (violations or warnings):
        code = exit_codes.FAILED
    if prints_json():
        about = {"model": model, "file": str(target), **data, "initial": initial}
        checkpoint = str(outcome.checkpoint) if outcome.checkpoint else None
        end = {"reason": outcome.reason, "checkpoint": checkpoint, "exit_code": code}
        print_json(about | end)
    elif not is_quiet():
        _show_run(outcome, data, initial, target)
    if is_quiet() and not prints_json():
        stderr().items(violations, "red")
    if outcome.reason:
        console = stderr()
        console.say(outcome.reason, "bold red")
        symbol, unit = _abscissa(outcome.result.settings)
        last = f"{symbol} = {outcome.result.t[-1]:.6g} {unit}"
        console.say(f"what was computed until then, up to {last}, is in {target}")
        if outcome.checkpoint is not None:
            console.say("to continue from there:")
            command = f"dap3d resume {shell_word(outcome.checkpoint)}"
            console.say(command, "green", indent=2, whole=True)
    if code != outcome.code:
        stderr().say("--strict: there are warnings, or the ledger does not close; exit code 1")
    return code


def _show_run(
    outcome: RunOutcome, data: dict[str, Any], initial: dict[str, Any] | None, target: Path
) -> None:
    console = stdout()
    name = scene_name(data["scene"])
    console.title(name if data["status"] == "done" else f"{name}: {data['status']}")
    if outcome.compiled.scene.description:
        console.say(str(outcome.compiled.scene.description), indent=2)
    console.facts(run_pairs(data))
    if initial is not None:
        show_correction(console, initial)
    show_details(console, data)
    console.say(f"{target} written ({size(target.stat().st_size)}). Next:", whole=True)
    file = shell_word(target)
    quantities = [f"{name}.actuation" for name in outcome.result.record.actuation]
    quantities = quantities or list(outcome.compiled.scene.outputs)
    quantities = quantities or [f"{outcome.result.summary.body_names[0]}.r"]
    words = " ".join(map(shlex.quote, quantities[:MOST_PLOTTED]))
    commands = (f"plot {file} {words}", f"view {file} --open", f"animate {file}", f"info {file}")
    for command in commands:
        console.say(f"dap3d {command}", "green", indent=2, whole=True)


# ---------------------------------------------------------------------------- text


def run_pairs(data: dict[str, Any]) -> list[tuple[str, str]]:
    """Model, method and cost of a run: names and texts."""
    reason = _split_notes(data)[0]
    evaluations = f"{data['rhs']:,} of the right-hand side"
    if data["rows"]:
        evaluations += f", {count(data['projections'], 'projection')}"
    wall, preparation = seconds(data["wall_time_s"]), seconds(data["compile_time_s"])
    return [
        ("modelled", _modelled(data)),
        ("method", f"{data['method']}: {reason}" if reason else str(data["method"])),
        ("integrator", _integrator(data)),
        ("simulated", _simulated(data)),
        ("steps", f"{data['steps']:,} taken, {data['rejected']:,} rejected"),
        ("evaluations", evaluations),
        ("duration", f"{wall}; to prepare {preparation}"),
        ("error", _error_text(data["error_estimate"])),
    ]


def _modelled(data: dict[str, Any]) -> str:
    text = count(data["bodies"], "body", "bodies")
    if data["joints"]:
        text += f", {count(data['joints'], 'joint')} ({count(data['rows'], 'row')})"
    if data["contacts"]:
        text += f", {count(data['contacts'], 'contact')}"
    return f"{text}; {degrees_of_freedom(data['dof'])}"


def degrees_of_freedom(number: int) -> str:
    """Degrees of freedom in words."""
    return count(number, "degree").replace("no degrees", "0 degrees") + " of freedom"


def _integrator(data: dict[str, Any]) -> str:
    """The integrator, and the control of its step."""
    settings, text = data["settings"], str(data["integrator"])
    if settings.get("step"):
        text += f", steps of {settings['step']:g} s"
    elif settings.get("rtol") is not None:
        atol = settings["atol"]
        parts = atol.items() if isinstance(atol, dict) else [("", atol)]
        limits = ", ".join(f"{name and f'{name} = '}{value:g}" for name, value in parts)
        text += f", rtol {settings['rtol']:g}, atol {limits}"
    if data["rows"]:
        text += ", projected" if settings.get("project") else ", not projected"
    return text


def _simulated(data: dict[str, Any]) -> str:
    """The span of time, or of a driver's coordinate, and the number of reported instants."""
    if not data["instants"]:
        return "nothing"
    label, unit = _abscissa(data["settings"])
    span = f"{label} = {data['t_start']:g} to {data['t_end']:.6g} {unit}"
    if data["t_start"] == data["t_end"]:
        span = f"{label} = {data['t_start']:g} {unit}"
    return f"{span}, {count(data['instants'], 'instant')} reported"


def _abscissa(settings: Mapping[str, Any]) -> tuple[str, str]:
    """Symbol and unit of time, or of the driver's coordinate that kinematics has in its place."""
    return settings.get("over") or "t", settings.get("over_unit") or "s"


def _error_text(error: dict[str, Any] | None) -> str:
    """The largest estimated errors; "" without an estimate."""
    if error is None:
        return ""
    text = (
        f"estimated, at most {error['r']:.1e} m and {error['rd']:.1e} m/s of mass centres, "
        f"{error['p']:.1e} of Euler parameters, {error['w']:.1e} rad/s; no bound"
    )
    if error["meaningless_from"] is None:
        return text
    since = f"From t = {error['meaningless_from']:.6g} s on beyond 1e-3 of the size"
    text = f"{text}. {since}: no longer meaningful"
    tenfold = error["tenfold"]
    return text if tenfold is None else f"{text}; until then tenfold every {tenfold:.3g} s"


def show_details(console: Terminal, data: dict[str, Any], most: int = MOST_EVENTS) -> None:
    """Print events, ``most`` of them, ledger and notes, but for the choice of the method."""
    events = [event["text"] for event in data["events"]]
    console.section("events", events[:most])
    if len(events) > most:
        where = "dap3d info" if most == MOST_EVENTS else "--json"
        console.say(f"and {len(events) - most} more, which {where} lists", indent=2)
    if data["ledger"]:
        _show_ledger(console, data)
    console.section("notes", _split_notes(data)[1])


def _show_ledger(console: Terminal, data: dict[str, Any]) -> None:
    console.title("ledger")
    verdicts = {None: Text("-"), True: Text("yes", "green"), False: Text("NO", "bold red")}
    rows = [
        (name, f"{e['value']:.1e}", "-" if e["limit"] is None else f"{e['limit']:.1e}",
         verdicts[e["ok"]])
        for name, e in data["ledger"].items()
    ]  # fmt: skip
    console.table(("quantity", "value", "limit", "ok"), rows, right=(1, 2), fixed=(0, 1, 2, 3))
    console.items(_violations(data), "red")


def show_correction(console: Terminal, initial: dict[str, Any]) -> None:
    """Print the initial conditions of the bodies that were changed, as the manual reports them."""
    if not initial["changed"]:
        console.say("initial conditions: they fulfil the constraints, nothing was changed")
        return
    changed, printed = initial["changed_bodies"], initial["most_changed"]
    if not changed:
        console.say(f"initial conditions: corrected by less than {PRINTED:g}")
        return
    console.title("corrected initial conditions (SI, global axes)")
    console.say(_line("", ["x, e0", "y, e1", "z, e2", "e3"]))
    for name in printed:
        console.say(name, "cyan", indent=2)
        for symbol, values in initial["bodies"][name].items():
            console.say(_line(symbol, map(_short, values)))
    if len(changed) > len(printed):
        more = count(len(changed) - len(printed), "body", "bodies")
        console.say(f"and {more} more, changed less; --json prints all", indent=2)


def _line(symbol: str, words: Iterable[str]) -> str:
    """A row of at most 53 columns."""
    return f"    {symbol:5}" + "".join(f"{word:>11}" for word in words)


def _short(x: float) -> str:
    """A number in at most 10 characters; what is far below any tolerance is zero."""
    if abs(x) < 1e-12:
        return "0"
    return f"{x:.5f}" if 1e-3 <= abs(x) < 1e3 else f"{x:.3e}"
