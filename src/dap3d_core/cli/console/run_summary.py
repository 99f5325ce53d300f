"""The facts of a run, rendered: 60 columns hold them."""

from typing import Any

from rich.text import Text

from dap3d_core.cli.console.console import (
    Terminal,
    count,
    items,
    say,
    seconds,
    show,
    table,
    title,
)
from dap3d_core.cli.console.run_facts import reason_of, remarks_of, violations_of

#: Events that a summary shows.
MOST_EVENTS = 6


def run_pairs(found: dict[str, Any]) -> list[tuple[str, str]]:
    """What was modelled, how it was solved, what it cost: names and words."""
    return [
        ("modelled", modelled(found)),
        ("method", method(found)),
        ("integrator", integrator(found)),
        ("simulated", simulated(found)),
        ("steps", f"{found['steps']:,} taken, {found['rejected']:,} rejected"),
        ("evaluations", evaluations(found)),
        ("duration", duration(found)),
        ("error", error_estimate(found)),
    ]


def show_ledger(console: Terminal, found: dict[str, Any]) -> None:
    """The ledger as a table; what is beyond its limit is explained."""
    if not found["ledger"]:
        return
    title(console, "ledger")
    rows = []
    for name, entry in found["ledger"].items():
        limit = "-" if entry["limit"] is None else f"{entry['limit']:.1e}"
        rows.append((name, f"{entry['value']:.1e}", limit, _verdict(entry["ok"])))
    columns = ("quantity", "value", "limit", "ok")
    show(console, table(columns, rows, right=(1, 2), fixed=(0, 1, 2, 3)))
    items(console, violations_of(found), "red")


def show_notes(console: Terminal, notes: list[str]) -> None:
    """Notes as a list, under a heading."""
    if notes:
        title(console, "notes")
        items(console, notes)


def show_events(console: Terminal, found: dict[str, Any]) -> None:
    """What happened at instants that were located: the first few, and how many more."""
    events = [event["text"] for event in found["events"]]
    if events:
        title(console, "events")
        items(console, events[:MOST_EVENTS])
        if len(events) > MOST_EVENTS:
            say(console, f"and {len(events) - MOST_EVENTS} more", indent=2)


def show_remarks(console: Terminal, found: dict[str, Any]) -> None:
    """The notes of a run besides the choice of its method."""
    show_notes(console, remarks_of(found))


def modelled(found: dict[str, Any]) -> str:
    """Bodies, joints, rows, freedoms."""
    words = count(found["bodies"], "body", "bodies")
    if found["joints"]:
        rows = count(found["rows"], "row")
        words += f", {count(found['joints'], 'joint')} ({rows})"
    dof = count(found["dof"], "degree").replace("no degrees", "0 degrees")
    return f"{words}; {dof} of freedom"


def method(found: dict[str, Any]) -> str:
    """The formulation and why."""
    reason = reason_of(found)
    return f"{found['method']}: {reason}" if reason else str(found["method"])


def integrator(found: dict[str, Any]) -> str:
    """The integrator and what controls it."""
    settings = found["settings"]
    if settings.get("step"):
        control = f"steps of {settings['step']:g} s"
    elif settings.get("rtol") is not None:
        control = f"rtol {settings['rtol']:g}, atol {_atol(settings['atol'])}"
    else:
        control = ""
    words = ", ".join(w for w in (str(found["integrator"]), control) if w)
    if found["rows"]:
        words += ", projected" if settings.get("project") else ", not projected"
    return words


def _atol(atol: Any) -> str:
    if isinstance(atol, dict):
        return ", ".join(f"{name} = {value:g}" for name, value in atol.items())
    return f"{atol:g}"


def simulated(found: dict[str, Any]) -> str:
    """The time span and the number of instants."""
    if not found["instants"]:
        return "nothing"
    span = f"t = {found['t_start']:g} to {found['t_end']:.6g} s"
    if found["t_start"] == found["t_end"]:
        span = f"t = {found['t_start']:g} s"
    return f"{span}, {count(found['instants'], 'instant')} reported"


def evaluations(found: dict[str, Any]) -> str:
    """Right-hand sides and projections."""
    words = f"{found['rhs']:,} of the right-hand side"
    return words + (f", {count(found['projections'], 'projection')}" if found["rows"] else "")


def duration(found: dict[str, Any]) -> str:
    """Wall time of the run and of what came before."""
    return f"{seconds(found['wall_time_s'])}; to prepare {seconds(found['compile_time_s'])}"


def error_estimate(found: dict[str, Any]) -> str:
    """The largest estimated errors; "" where none were asked for."""
    error = found["error_estimate"]
    if error is None:
        return ""
    words = (
        f"estimated, at most {error['r']:.1e} m and {error['rd']:.1e} m/s of mass centres, "
        f"{error['p']:.1e} of Euler parameters, {error['w']:.1e} rad/s; no bound"
    )
    when = error["meaningless_from"]
    if when is None:
        return words
    words = f"{words}. From t = {when:.6g} s on beyond 1e-3 of the size: no longer meaningful"
    tenfold = error["tenfold"]
    return words if tenfold is None else f"{words}; until then tenfold every {tenfold:.3g} s"


def _verdict(ok: bool | None) -> Text:
    if ok is None:
        return Text("-")
    return Text("yes", style="green") if ok else Text("NO", style="bold red")


def show_state(console: Terminal, title_words: str, bodies: dict[str, Any]) -> None:
    """Coordinates and velocities of bodies, as the manual reports them.

    Args:
        console: where.
        title_words: the heading.
        bodies: name -> {"r": 3, "p": 4, "r_dot": 3, "w": 3 numbers}.
    """
    title(console, title_words)
    say(console, _line("", ["x, e0", "y, e1", "z, e2", "e3"]))
    for name, state in bodies.items():
        say(console, name, "cyan", indent=2)
        for symbol, values in state.items():
            say(console, _line(symbol, [_short(x) for x in values]))


def _line(symbol: str, words: list[str]) -> str:
    """A row of at most 53 columns."""
    return f"    {symbol:5}" + "".join(f"{word:>11}" for word in words)


def _short(x: float) -> str:
    """A number in at most 10 characters; what is far below any tolerance is zero."""
    if abs(x) < 1e-12:
        return "0"
    return f"{x:.5f}" if 1e-3 <= abs(x) < 1e3 else f"{x:.3e}"
