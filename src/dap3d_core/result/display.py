"""Representation of a result at a prompt and in a notebook."""

from collections.abc import Sequence
from html import escape
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from dap3d_core.result.errors import ResultError
from dap3d_core.scene import SceneError
from dap3d_core.scene.display import html_table


class ResultDisplay:
    """The representations of a result; all text in them is escaped."""

    def __repr__(self) -> str:
        result: Any = self
        times = f", t = {result.t[0]:g} ... {result.t[-1]:g} s" if len(result.t) else ""
        return (
            f"<Result {result.record.title!r}: {result.status}, {result.summary.body_count} "
            f"bodies, {result.summary.row_count} rows, {len(result.t)} instants{times}>"
        )

    def _repr_html_(self) -> str:
        """The mechanism at the start, the main facts, the ledger and the notes, for notebooks."""
        result: Any = self
        stats = result.stats
        facts = [
            ("method", result.method),
            ("integrator", result.integrator),
            ("steps", f"{stats.steps:,} taken, {stats.rejected:,} rejected"),
            ("evaluations", f"{stats.rhs:,} of the right-hand side"),
            ("duration", f"{stats.wall_time_s:.3g} s; to prepare {stats.compile_time_s:.3g} s"),
        ]
        ledger = [
            (name, f"{e.value:.1e}", "" if e.limit is None else f"{e.limit:.1e}",
             {True: "yes", False: "NO", None: ""}[e.ok])
            for name, e in result.ledger.items()
        ]  # fmt: skip
        image, missing = _picture(result) if len(result.t) else ("", ())
        parts = [f"<p><strong>{escape(repr(self)[1:-1])}</strong></p>", image]
        parts.append(html_table(("", "of the run"), facts))
        if ledger:
            parts.append(html_table(("ledger", "value", "limit", "ok"), ledger))
        notes = "".join(f"<li>{escape(note)}</li>" for note in (*result.notes, *missing))
        return "".join(parts) + (f"<ul>{notes}</ul>" if notes else "")


def _picture(result: Any) -> tuple[str, Sequence[str]]:
    """An image of the first instant, as ``dap.animate`` draws it, and notes on what it lacks.

    Plots are made of results, not results of plots: what draws is looked up when there is a page to
    draw on. Without matplotlib, or without bodies that can be drawn, there is no image.
    """
    try:
        animate = import_module("dap3d_core.plot").animate
        with TemporaryDirectory() as folder:
            film = animate(result, Path(folder) / "mechanism.png")
            return str(film._repr_html_()), film.notes
    except (ImportError, OSError, ValueError, ResultError, SceneError):
        return "", ()
