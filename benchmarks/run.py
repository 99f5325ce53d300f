"""All benchmarks, as tables and as JSON.

``make bench``, or ``python benchmarks/run.py [--only NAME ...] [-o FILE]``. scale_long,
streaming and collisions, some minutes, study and start are run only when they are named. With
``--docs`` the figures of hard_cases, long_time, chaos, flips and hinges go to
docs/reference/hard-cases.md as well; ``--only hard`` is all of these.
"""

import argparse
import json
import platform
import sys
from pathlib import Path

# Scenes and closed equations of the tests serve here, too.
sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))

import calls
import collisions
import contact
import derivatives
import derived
import elements
import extension
import hard
import hard.chaos
import hard.flips
import hard.hinges
import hard.long_time
import joint_motions
import kernels
import lanes
import llvmlite
import numpy
import points
import programs
import projection
import right_hand_side
import scale
import start
import states
import step_parts
import streaming
import study
import tree_loops
import trees
import whole_runs
from rich.console import Console
from rich.table import Table

#: What is run only when it is named.
NAMED = ("collisions", "scale_long", "streaming", "study", "start")
#: Columns that a table has at most beside its first.
COLUMNS = 8
#: Columns that every table of one title has, and those of sentences, which stand below.
LEADING, WORDS = ("case", "run"), ("why", "said")
#: What docs/reference/hard-cases.md is made of.
HARD = ("hard_cases", "long_time", "chaos", "flips", "hinges")


def tables(console, title, rows):
    """Print rows of one shape, wide ones as several tables with the same first columns."""
    keys = [k for k in dict.fromkeys(k for row in rows for k in row) if k not in WORDS]
    first = [key for key in keys if key in LEADING] or keys[:1]
    keys = [key for key in keys if key not in first]
    for k in range(0, len(keys), COLUMNS):
        table(console, title, rows, [*first, *keys[k : k + COLUMNS]])
    for row in rows:
        if words := [row[key] for key in WORDS if row.get(key)]:
            console.print(f"{row['case']}, {row['run']}: {' -- '.join(words)}", highlight=False)


def table(console, title, rows, keys):
    """Print some columns of rows."""
    shown = Table(title=title, title_justify="left")
    for key in keys:
        shown.add_column(key.replace("_", " "), justify="right")
    for row in rows:
        shown.add_row(*(_text(row.get(key)) for key in keys))
    console.print(shown)


def _text(value):
    return "" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)


def main():
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", default=[], help="benchmarks by name; hard: all those")
    parser.add_argument("--against", help="a program to compare the chains with (build, rk4)")
    parser.add_argument("-o", "--output", default="benchmarks/results.json")
    parser.add_argument("--docs", action="store_true", help="renew the page on hard cases")
    arguments = parser.parse_args()
    benchmarks = {
        "right_hand_side": lambda: right_hand_side.measure(arguments.against),
        "trees": trees.measure,
        "choice": trees.choice,
        "tree_loops": tree_loops.measure,
        "kernels": kernels.measure,
        "derivatives": derivatives.measure,
        "derived": derived.measure,
        "elements": elements.measure,
        "extension": extension.measure,
        "states": states.measure,
        "call": calls.call,
        "projection": projection.measure,
        "dop853_on_a_chain": whole_runs.dop853_on_a_chain,
        "large": whole_runs.large,
        "start_up": whole_runs.start_up,
        "start": start.measure,
        "scale": scale.measure,
        "scale_long": scale.long_chain,
        "streaming": streaming.measure,
        "study": study.measure,
        "points": points.measure,
        "contact": contact.measure,
        "collisions": collisions.measure,
        "lanes": lanes.measure,
        "programs": programs.measure,
        "step_parts": step_parts.measure,
        "joint_motions": joint_motions.measure,
        "hard_cases": hard.measure,
        "long_time": hard.long_time.measure,
        "chaos": hard.chaos.measure,
        "flips": hard.flips.measure,
        "hinges": hard.hinges.measure,
    }
    only = {name for word in arguments.only for name in (HARD if word == "hard" else (word,))}
    if unknown := only - benchmarks.keys():
        sys.exit(f"no benchmark {', '.join(sorted(unknown))}; there are {', '.join(benchmarks)}")
    console, found = Console(), {}
    for name, measure in benchmarks.items():
        if name in only or (not only and name not in NAMED):
            found[name] = measure()
            tables(console, name.replace("_", " "), found[name])
    if arguments.docs:
        hard.write_page([row for name in HARD for row in found.get(name, [])])
    versions = {
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "llvmlite": llvmlite.__version__,
    }
    path = Path(arguments.output)
    path.write_text(json.dumps({"versions": versions, **found}, indent=1))
    console.print(f"written to {path}")


if __name__ == "__main__":
    main()
