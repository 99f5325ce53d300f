"""The page on hard cases from its figures.

The figures stand beside the page, docs/reference/hard-cases.json, so that a test can tell whether
they agree. Times stand as ratios to the first run of their case: seconds are those of one machine.
"""

import json
from pathlib import Path

from hard.list import CASES
from hard.tables import chaos_table, flips_table, hinges_table, table

DOCS = Path(__file__).resolve().parents[2] / "docs" / "reference"
FIGURES, PAGE = DOCS / "hard-cases.json", DOCS / "hard-cases.md"
PICTURE = DOCS / "hard-cases-long-time.png"
CHAOS, HINGES = DOCS / "hard-cases-chaos.png", DOCS / "hard-cases-hinges.png"
#: The page between a pair of these is made here; the rest is written by hand.
BEGIN, END = "<!-- {}: made by benchmarks/run.py -->\n", "<!-- end of {} -->\n"


def figures(rows):
    """What of the rows the page shows: all but seconds, in whose place stand ratios.

    Raises:
        ValueError: a run did not pass and nobody says why.
    """
    first, kept = {}, []
    for row in rows:
        row = dict(row)
        if not row.get("passes", True) and not row["why"]:
            raise ValueError(f"{row['case']}, {row['run']} does not pass: {row.get('said', '')}")
        seconds = row.pop("seconds", None)
        if seconds is not None:
            row["time"] = _rounded(seconds / first.setdefault(row["case"], seconds))
        kept.append({k: _rounded(v) if isinstance(v, float) else v for k, v in row.items()})
    return kept


def _rounded(value):
    return float(f"{value:.2g}")


def write(rows):
    """Write the figures of these rows in the place of older ones, the page and its pictures."""
    from hard import chaos, hinges, long_time

    measured = figures(rows)
    cases = {row["case"] for row in measured}
    older = json.loads(FIGURES.read_text()) if FIGURES.exists() else []
    kept = [*(row for row in older if row["case"] not in cases), *measured]
    FIGURES.write_text(json.dumps(kept, indent=1) + "\n")
    PAGE.write_text(renewed(PAGE.read_text(), kept))
    if any("roundings" in row for row in measured):
        long_time.draw(PICTURE)
    if any("tenfold" in row for row in measured):
        chaos.draw(CHAOS)
    if scanned := [row for row in measured if "size" in row]:
        hinges.draw(scanned, HINGES)


def renewed(page, kept):
    """The page with the tables of these figures."""
    tables = {
        "cases": cases_table, "runs": runs_table, "long runs": long_table,
        "chaos": chaos_table, "flips": flips_table, "hinges": hinges_table,
    }  # fmt: skip
    for name, made in tables.items():
        begin, end = BEGIN.format(name), END.format(name)
        head, rest = page.split(begin)
        page = head + begin + "\n" + made(kept) + "\n" + end + rest.split(end)[1]
    return page


def cases_table(kept):
    """A row for each case; below, what makes each hard, what fails and why."""
    rows, told = [], []
    for case in CASES:
        of_case = [row for row in kept if row["case"] == case.name]
        good = [row for row in of_case if row["passes"]]
        best = min(good, key=lambda row: row["error"])
        count = f"{len(good)} of {len(of_case)}"
        name = f"**{case.name}**"
        rows.append((name, count, f"{best['error']:.1e}", best["run"], f"{best['steps']}"))
        told.append(f"- {name}: {case.title}; {case.hard} ([test](../../{case.test})).\n")
        told += [
            f"  - fails: {row['run']}: {row['why']}.\n" for row in of_case if not row["passes"]
        ]
    heads = ("case", "runs that pass", "least e", "by", "steps")
    return table(heads, rows) + "\n" + "".join(told)


def runs_table(kept):
    """A row for each run."""
    names = {case.name for case in CASES}
    rows = []
    for row in kept:
        if row["case"] not in names:
            continue
        passes = "yes" if row["passes"] else "no"
        numbers = [f"{row[k]:.1e}" if k in row else "" for k in ("error", "energy", "C", "p")]
        counts = [str(row.get(k, "")) for k in ("steps", "rhs")]
        time = f"{row['time']:g}" if "time" in row else ""
        ledger = row.get("ledger", "")
        rows.append((row["case"], row["run"], passes, *numbers, ledger, *counts, time))
    heads = ("case", "run", "passes", "e", "energy", "|C|", "||p| - 1|", "ledger", "steps", "rhs",
             "time")  # fmt: skip
    return table(heads, rows)


def long_table(kept):
    """A row for each long run."""
    rows = []
    for row in kept:
        if "roundings" not in row:
            continue
        power = "" if row["power"] is None else f"{row['power']:.1f}"
        other = [f"{row[k]:.1e}" if k in row else "" for k in ("L", "C", "Cv", "p")]
        rows.append((row["case"], row["run"], str(row["steps"]), f"{row['energy']:.1e}", power,
                     f"{row['roundings']:.2g}", *other, f"{row['time']:g}"))  # fmt: skip
    heads = ("run", "settings", "steps", "energy", "power of t", "energy / (eps √steps)",
             "L", "|C|", "|D v|", "||p| - 1|", "time")  # fmt: skip
    return table(heads, rows)
