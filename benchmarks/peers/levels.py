"""From cells to times: what a program needs to reach an error."""

import math
import statistics

LEVELS = (1e-3, 1e-6, 1e-9)
OURS, PEERS = "dap3d", ("exudyn", "mujoco", "drake", "pinocchio")
PROGRAMS = (OURS, *PEERS)
#: Methods with this prefix are whole calls of a program's front door; they stand beside the others.
WHOLE = "simulate: "
#: An error beyond this, m: another branch of the motion.
LOST = 0.1
#: Settings are measured again where they may decide: this near the best method of a program.
NEAR = 1.6


def seconds_of(cell):
    """Median over the passes; None where the setting failed."""
    return statistics.median(cell["seconds"]) if cell["seconds"] else None


def ladders_of(cells, scene, program):
    """Method -> cells that ran, from fast to slow, without whole calls."""
    found = {}
    for cell in cells:
        good = cell["scene"] == scene and cell["program"] == program and cell["seconds"]
        if good and cell.get("error") is not None and not cell["method"].startswith(WHOLE):
            found.setdefault(cell["method"], []).append(cell)
    return {name: sorted(_sure(row), key=seconds_of) for name, row in found.items()}


def _sure(row):
    """Cells from coarse to fine without those that were right by luck: a finer one is LOST."""
    last = max((i for i, cell in enumerate(row) if cell["error"] > LOST), default=-1)
    return [c for i, c in enumerate(row) if i > last or c["error"] > LOST]


def reached(ladder, level):
    """(seconds, cells that say so) to reach an error by one method.

    Between two neighbouring settings the time is interpolated, error and time as logarithms. Where
    the coarsest setting is good enough its own time counts.
    """
    before = None
    for cell in ladder:
        seconds, error = seconds_of(cell), max(cell["error"], 1e-16)
        if error <= level:
            if before is None:
                return seconds, [cell]
            other, worse = seconds_of(before), before["error"]
            part = math.log(worse / level) / math.log(worse / error)
            return other * (seconds / other) ** part, [before, cell]
        before = cell
    return math.inf, []


def best(cells, scene, program, level):
    """(seconds, method) of the best method of a program; infinity and "" where none reaches it."""
    ladders = ladders_of(cells, scene, program)
    times = [(reached(ladder, level)[0], name) for name, ladder in ladders.items()]
    return min(times, default=(math.inf, "")) if times else (math.inf, "")


def deciding(cells, scene, program):
    """[method, parameter] of the settings that decide a program's best times in a scene."""
    ladders, found = ladders_of(cells, scene, program), []
    for level in LEVELS:
        limit = NEAR * best(cells, scene, program, level)[0]
        for ladder in ladders.values():
            seconds, row = reached(ladder, level)
            if seconds <= limit and row:
                found += row
    found += [c for c in cells if c["scene"] == scene and c["program"] == program and c["seconds"]
              and (c["method"].startswith(WHOLE) or scene.startswith("ball"))]  # fmt: skip
    return [list(pair) for pair in dict.fromkeys((c["method"], c["parameter"]) for c in found)]
