"""Tables made from the cells: rows of dictionaries, for the screen and for the documentation."""

import math

import levels


def times(cells, scenes):
    """Milliseconds of each program to the three levels; a dash where it does not get there."""
    rows = []
    for scene in scenes:
        if scene.startswith("ball"):
            continue
        row = {"scene": scene}
        for program in levels.PROGRAMS:
            found = [levels.best(cells, scene, program, level)[0] for level in levels.LEVELS]
            row[program] = " / ".join(_ms(seconds) for seconds in found)
        rows.append(row)
    return rows


def _ms(seconds):
    return f"{1e3 * seconds:.3g}" if math.isfinite(seconds) else "-"


def price(cells):
    """Microseconds a step of the ball without the force and with it written in Python."""
    rows = []
    for program in levels.PROGRAMS:
        base = None
        for cell in cells:
            if cell["program"] != program or cell["scene"] != "ball-1" or not cell["seconds"]:
                continue
            us = 1e6 * levels.seconds_of(cell) / cell["steps"]
            method, what = cell["method"].split(", ", 1)
            if what == "no force":
                base = us
            rows.append({"program": program, "method": method, "force": what, "us_a_step": us,
                         "times_without": us / base if base else None})  # fmt: skip
    return rows


def whole(cells, scenes):
    """What ``dap.simulate`` takes beside the integration alone, at the same setting."""
    rows = []
    for scene in scenes:
        mine = [c for c in cells if c["scene"] == scene and c["program"] == levels.OURS]
        same = "dop853, projected" if scene.startswith("four-bars") else "dop853"
        bare = {c["parameter"]: c for c in mine if c["method"] == same and c["seconds"]}
        for cell in mine:
            if not cell["method"].startswith(levels.WHOLE) or not cell["seconds"]:
                continue
            other = bare.get(cell["parameter"])
            if other:
                rows.append({"scene": scene, "rtol": cell["parameter"],
                             "whole_ms": 1e3 * levels.seconds_of(cell),
                             "integration_ms": 1e3 * levels.seconds_of(other)})  # fmt: skip
    return rows
