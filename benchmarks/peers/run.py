"""dap3d beside the programs that one would pick instead: ``make bench-peers``.

Each program runs on each scene in a process of its own, one thread, scene by scene, so that rivals
are measured next to each other in time; then all of it again, pass after pass, with the settings
that decide. Times are medians of the passes, in CPU time of the thread. What is measured is kept as
it comes: a run that was stopped goes on where it stood.
"""

import argparse
import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import goals
import levels
import mechanisms
from rich.console import Console
from rich.table import Table
from worker import MISSING

HERE = Path(__file__).parent
RESULTS = HERE / "results.json"
UNFINISHED = HERE.parents[1] / "build" / "peers" / "unfinished.json"
#: Seconds after which a worker is given up.
LIMIT = 600


class Records:
    """Everything measured so far, in a file."""

    def __init__(self, path):
        self.path = path
        fresh = {"versions": {}, "skipped": {}, "notes": [], "done": [], "cells": []}
        self.data = json.loads(path.read_text()) if path.exists() else fresh
        self.places = {self._key(c): c for c in self.data["cells"]}

    @staticmethod
    def _key(cell):
        return tuple(cell[k] for k in ("scene", "program", "method", "parameter"))

    def add(self, scene, program, record):
        """Take one line of a worker."""
        if "version" in record:
            self.data["versions"][program] = record["version"]
        elif "missing" in record:
            self.data["skipped"][program] = record["missing"]
        elif "left_out" in record:
            self.data["notes"].append(f"{program}, {scene}: {record['left_out']}")
        else:
            seconds = record.pop("seconds")
            cell = {"scene": scene, "program": program, **record, "seconds": []}
            cell = self.places.setdefault(self._key(cell), cell)
            if seconds is not None:
                cell["seconds"].append(float(f"{seconds:.4g}"))
            if cell not in self.data["cells"]:
                self.data["cells"].append(cell)

    def save(self, path=None):
        """Write, one cell a line; the file is whole at any moment."""
        path = path or self.path
        path.parent.mkdir(parents=True, exist_ok=True)
        head = {k: v for k, v in self.data.items() if k != "cells"}
        cells = ",\n".join(json.dumps(c) for c in self.data["cells"])
        text = json.dumps(head)[:-1] + ', "cells": [\n' + cells + "\n]}\n"
        beside = path.with_suffix(".new")
        beside.write_text(text)
        beside.replace(path)


def work(records, program, scene, only, cap, console):
    """Run a worker and take what it says."""
    command = [sys.executable, str(HERE / "worker.py"), program, scene, "--cap", str(cap)]
    if only is not None:
        command += ["--only", json.dumps(only)]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    source = [str(HERE.parents[1] / folder) for folder in ("src", "plugins")]
    env = os.environ | threads | {"PYTHONPATH": os.pathsep.join(source)}
    try:
        done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=LIMIT)
        out, code, words = done.stdout, done.returncode, done.stderr
    except subprocess.TimeoutExpired as stopped:
        out, code, words = (stopped.stdout or b"").decode(), -1, "took too long"
    count = 0
    for line in out.splitlines():
        if line.startswith("CELL "):
            records.add(scene, program, json.loads(line[5:]))
            count += 1
    if code == MISSING:
        console.print(f"{program} is skipped: {records.data['skipped'][program]}")
    elif code != 0:
        last = " ".join(words.split())[-200:]
        console.print(f"{program}, {scene}: the process ended with {code} ({last})")
        records.data["notes"].append(f"{program}, {scene}: ended with {code}")
    return count


def measure(records, scenes, programs, passes, cap, console):
    """All passes; what is done is left alone."""
    for turn in range(passes):
        for scene in scenes:
            counts = []
            for program in programs:
                place = [turn, scene, program]
                if place in records.data["done"] or program in records.data["skipped"]:
                    continue
                cells = records.data["cells"]
                only = levels.deciding(cells, scene, program) if turn else None
                if only is None or only:
                    counts.append(work(records, program, scene, only, cap, console))
                records.data["done"].append(place)
                records.save()
            if counts:
                console.print(f"pass {turn + 1} of {passes}, {scene}: {sum(counts)} cells")


def shown(rows, title):
    """A table of rows that are alike."""
    made = Table(title=title, title_justify="left")
    if not rows:
        return made
    for key in rows[0]:
        made.add_column(key.replace("_", " "), justify="right")
    for row in rows:
        made.add_row(*(_text(v) for v in row.values()))
    return made


def _text(value):
    if isinstance(value, bool):
        return "yes" if value else "NO"
    return "" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)


def report(data, console):
    """All tables."""
    scenes = list(dict.fromkeys(cell["scene"] for cell in data["cells"]))
    import tables

    console.print(shown(tables.times(data["cells"], scenes), "milliseconds to 1e-3 / 1e-6 / 1e-9"))
    price = tables.price(data["cells"])
    if price:
        console.print(shown(price, "price of a force written in Python"))
    front = tables.whole(data["cells"], scenes)
    if front:
        console.print(shown(front, "dap.simulate in whole (dop853)"))
    rows = goals.table(data["cells"], scenes)
    if rows:
        console.print(shown(rows, "against the goals"))
    judged = [row["met"] for row in rows if row["met"] is not None]
    console.print(f"{sum(judged)} of {len(judged)} goals met")
    for program, why in data["skipped"].items():
        console.print(f"{program} was skipped: {why}")


def main():
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--passes", type=int, default=5)
    parser.add_argument("--quick", action="store_true",
                        help="the sizes that marks belong to, three passes")  # fmt: skip
    parser.add_argument("--scenes", help="keys of scenes, such as spherical-chain-8, with commas")
    parser.add_argument("--programs", help="with commas; dap3d and those of the extra `peers`")
    parser.add_argument("--cap", type=float, default=2.5, help="no finer setting after this, s")
    parser.add_argument("--fresh", action="store_true", help="forget a run that was stopped")
    parser.add_argument("--show", action="store_true", help="print what is there; measure nothing")
    parser.add_argument("-o", "--output", type=Path, default=RESULTS)
    arguments = parser.parse_args()
    console = Console(width=None if sys.stdout.isatty() else 150)
    if arguments.show:
        report(json.loads(arguments.output.read_text()), console)
        return
    unfinished = arguments.output.with_suffix(".unfinished")
    if arguments.output == RESULTS:
        unfinished = UNFINISHED
    if arguments.fresh:
        unfinished.unlink(missing_ok=True)
    keys = [m.key for m in mechanisms.all_mechanisms(arguments.quick)]
    scenes = arguments.scenes.split(",") if arguments.scenes else keys
    programs = arguments.programs.split(",") if arguments.programs else list(levels.PROGRAMS)
    wrong = {*scenes} - {m.key for m in mechanisms.all_mechanisms()} | {
        p for p in programs if importlib.util.find_spec(f"{p}_peer") is None
    }
    if wrong:
        parser.error(f"unknown: {', '.join(sorted(wrong))}; scenes are {', '.join(keys)}")
    records = Records(unfinished)
    passes = min(arguments.passes, 3) if arguments.quick else arguments.passes
    measure(records, scenes, programs, passes, arguments.cap, console)
    records.save(arguments.output)
    unfinished.unlink(missing_ok=True)
    report(records.data, console)
    console.print(f"written to {arguments.output}")


if __name__ == "__main__":
    main()
