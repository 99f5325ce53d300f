"""One program on one scene, in a process of its own: prints one line of JSON for each setting.

``python worker.py PROGRAM SCENE [--only JSON] [--cap SECONDS]``; run.py calls it.
"""

import argparse
import importlib
import json
import math
import statistics
import sys
import warnings

#: Errors below this need no finer setting: beyond the finest level there is nothing to win.
FINE_ENOUGH = 2e-10
#: Total seconds, and numbers of runs, that one setting is timed for.
LEAST_TOTAL, MOST_TOTAL, LEAST, MOST = 0.05, 1.5, 3, 50
#: What a worker returns where its program cannot be imported.
MISSING = 3


def timed(run):
    """Median seconds of runs that time themselves, and the steps of one; the first warms up."""
    seconds, steps = run()
    times = [seconds] if seconds > 0.3 else []
    spent = seconds
    while len(times) < MOST and spent < MOST_TOTAL:
        if len(times) >= LEAST and spent > LEAST_TOTAL:
            break
        times.append(run()[0])
        spent += times[-1]
    return statistics.median(times), steps


def say(**record):
    """One line for run.py."""
    print("CELL " + json.dumps(record), flush=True)


def climb(name, parameters, start, error_at, cap, only):
    """All settings of one method, from coarse to fine, as long as that makes sense."""
    for parameter in parameters:
        if only is not None and [name, parameter] not in only:
            continue
        where = {"method": name, "parameter": parameter}
        try:
            run, end = start(parameter)
            seconds, steps = timed(run)
            error = error_at(*end())
        except (Exception, SystemExit) as problem:
            why = " ".join(str(problem).split())[:160] or type(problem).__name__
            say(**where, seconds=None, failed=why)
            continue
        found = error if math.isfinite(error) else None
        say(**where, seconds=seconds, steps=steps, error=found)
        if only is None and (error < FINE_ENOUGH or seconds > cap):
            break


def main():
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("scene")
    parser.add_argument("--only", help="pairs of method and parameter, as JSON")
    parser.add_argument("--cap", type=float, default=2.5, help="no finer setting after this, s")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    try:
        peer = importlib.import_module(f"{arguments.program}_peer")
    except ImportError as problem:
        say(missing=str(problem))
        sys.exit(MISSING)
    import mechanisms
    import references

    mechanism = mechanisms.mechanism_of(arguments.scene)
    reference = references.load()[arguments.scene]
    say(version=peer.VERSION)
    only = json.loads(arguments.only) if arguments.only else None
    try:
        ladders = peer.ladders(mechanism)
    except MemoryError as problem:
        say(left_out=str(problem))
        return

    def error_at(x, R):
        return mechanisms.error_of(mechanism, reference, x, R)

    for name, parameters, start in ladders:
        climb(name, parameters, start, error_at, arguments.cap, only)


if __name__ == "__main__":
    main()
