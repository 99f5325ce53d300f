"""All benchmarks, as tables and as JSON.

``make bench``, or ``python benchmarks/run.py [--only NAME] [-o FILE]``.
"""

import argparse
import json
import platform
import sys
from pathlib import Path

import calls
import kernels
import numba
import numpy
import right_hand_side
import whole_runs
from rich.console import Console
from rich.table import Table


def table(console, title, rows):
    """Print rows of one shape."""
    keys = list(dict.fromkeys(key for row in rows for key in row))
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
    parser.add_argument("--only", help="one benchmark by name")
    parser.add_argument("--against", help="a program to compare the chains with (build, rk4)")
    parser.add_argument("-o", "--output", default="benchmarks/results.json")
    arguments = parser.parse_args()
    benchmarks = {
        "right_hand_side": lambda: right_hand_side.measure(arguments.against),
        "kernels": kernels.measure,
        "call": calls.call,
        "dop853_on_a_chain": whole_runs.dop853_on_a_chain,
        "large": whole_runs.large,
        "start_up": whole_runs.start_up,
    }
    if arguments.only and arguments.only not in benchmarks:
        sys.exit(f"no benchmark {arguments.only}; there are {', '.join(benchmarks)}")
    console, found = Console(), {}
    for name, measure in benchmarks.items():
        if arguments.only in (None, name):
            found[name] = measure()
            table(console, name.replace("_", " "), found[name])
    versions = {
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "numba": numba.__version__,
    }
    path = Path(arguments.output)
    path.write_text(json.dumps({"versions": versions, **found}, indent=1))
    console.print(f"written to {path}")


if __name__ == "__main__":
    main()
