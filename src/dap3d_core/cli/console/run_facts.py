"""What there is to say of a run, as plain data: what ``run`` and ``info`` show or print as JSON."""

from typing import TYPE_CHECKING, Any

import attrs

if TYPE_CHECKING:
    from dap3d_core.result import Occurrence, Result


def facts_of(result: "Result") -> dict[str, Any]:
    """The facts of a result."""
    subject = result.subject
    instants = len(result.t)
    dof = 6 * subject.body_count - result.settings.get("rank", subject.row_count)
    return {
        "scene": result.record.title,
        "status": result.status,
        "bodies": subject.body_count,
        "joints": len(subject.joint_names),
        "rows": subject.row_count,
        "dof": dof,
        "points": len(subject.point_names),
        "method": result.method,
        "integrator": result.integrator,
        "settings": result.settings,
        "instants": instants,
        "t_start": float(result.t[0]) if instants else None,
        "t_end": float(result.t[-1]) if instants else None,
        **attrs.asdict(result.stats),
        "error_estimate": _error_estimate(result),
        "events": [_event(event) for event in result.events],
        "ledger": {name: attrs.asdict(entry) for name, entry in result.ledger.items()},
        "notes": result.notes,
        "versions": result.versions,
    }


def _event(event: "Occurrence") -> dict[str, Any]:
    """An occurrence without its state, with its words."""
    found = attrs.asdict(event, filter=lambda field, _: field.name != "u")
    return {**found, "text": event.words}


def _error_estimate(result: "Result") -> dict[str, Any] | None:
    """The largest estimated errors by symbol, and from when on they are too large to be of use."""
    error = result.error
    if error is None:
        return None
    until = {"meaningless_from": error.meaningless_from, "tenfold": error.tenfold}
    return {**error.largest, **until}


def reason_of(facts: dict[str, Any]) -> str:
    """Why the method was chosen; it stands as a note in the result."""
    return next(
        (
            n.removeprefix(f"method {facts['method']}: ")
            for n in facts["notes"]
            if _is_choice(n, facts)
        ),
        "",
    )


def remarks_of(facts: dict[str, Any]) -> list[str]:
    """The notes besides the choice of the method, which is no change of anything asked for."""
    return [n for n in facts["notes"] if not _is_choice(n, facts)]


def warnings_of(facts: dict[str, Any]) -> list[str]:
    """The notes that tell of a change of what was asked for; others are for information."""
    from dap3d_core.result import INFORMATION

    return [n for n in remarks_of(facts) if not n.startswith(INFORMATION)]


def violations_of(facts: dict[str, Any]) -> list[str]:
    """The entries of the ledger that are beyond their limits, in words."""
    return [
        f"{name} is {e['value']:.2g}, its limit {e['limit']:.2g}: {e['text']}"
        for name, e in facts["ledger"].items()
        if e["ok"] is False
    ]


def _is_choice(note: str, facts: dict[str, Any]) -> bool:
    return note.startswith(f"method {facts['method']}: ")
