"""Fuzz: random and damaged inputs for some minutes; what fails is kept in build/fuzz.

    python tests/fuzz/run.py [TARGET...] [--minutes 10] [--seed N]    all targets, or some
    python tests/fuzz/run.py TARGET --repeat FILE                     one input again

Each target works in a process of its own. One that ends by a signal, or has not ended an input
after two minutes, is a find as well. Exit code: 0, or 1 where something was found.
"""

import argparse
import collections
import hashlib
import importlib.util
import json
import os
import queue
import subprocess
import sys
import threading
import time
import traceback
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[0] = str(ROOT / "tests")
FINDS = ROOT / "build" / "fuzz"
#: Inputs after which a worker reports, and seconds without a report after which it is ended.
BATCH, PATIENCE = 25, 300
#: Targets of the coverage-guided fuzzer, which needs the extra "fuzz" (guided.py).
GUIDED = ("scene-bytes", "matlab-bytes")
HYPOTHESIS = ("scenes", "damaged", "matlab", "models", "results", "numbers", "quantities",
              "expressions", "commands", "programs", "contacts", "gradients",
              "instants")  # fmt: skip


def keep(target, data, words, ending):
    """Write a find, with how to repeat it; returns its file."""
    folder = FINDS / target
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{hashlib.sha256(data).hexdigest()[:12]}{ending}"
    path.write_bytes(data)
    again = f"python tests/fuzz/run.py {target} --repeat {path.relative_to(ROOT)}"
    path.with_suffix(".log").write_text(f"{again}\n\n{words}\n", encoding="utf-8", errors="replace")
    return path


def work(name, number, seconds):
    """Check inputs of a target; prints a JSON object after each batch."""
    from fuzz.targets import TARGETS

    target = TARGETS[name]
    current = FINDS / name / "current"
    current.parent.mkdir(parents=True, exist_ok=True)
    end, last = time.monotonic() + seconds, b""
    while time.monotonic() < end:
        counts, found = collections.Counter(), []

        def before(data, words, counts=counts):
            nonlocal last
            last = data
            if words is None:
                current.write_bytes(data)
            else:
                counts[words] += 1
            if time.monotonic() > end + 5:
                raise KeyboardInterrupt

        try:
            target.run(number, BATCH, before=before)
        except KeyboardInterrupt:
            pass
        except Exception as error:
            vars(error).pop("__notes__", None)  # hypothesis shows the input there, at any length
            path = keep(name, last, "".join(traceback.format_exception(error)), target.ending)
            counts["FOUND"] += 1
            found = [str(path), _place_of(error)]
        print(json.dumps({"counts": counts, "found": found}), flush=True)
        number += 1
    current.unlink(missing_ok=True)


def _place_of(error):
    """The last line of our own code in a traceback, and the error."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if str(ROOT) in f.filename]
    place = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}: " if frames else ""
    return f"{place}{type(error).__name__}: {' '.join(str(error).split())[:200]}"


class Worker:
    """A process that works on one target, and what it said."""

    def __init__(self, name, number, seconds):
        self.name, self.end = name, time.monotonic() + seconds
        self.counts, self.places = collections.Counter(), {}
        self.number, self.process = number, None

    def go(self):
        """Work until the time is up; a worker that fell is replaced."""
        while (left := self.end - time.monotonic()) > 1.0:
            script = "guided.py" if self.name in GUIDED else "run.py"
            words = [self.name, "--work", str(left), "--seed", str(self.number)]
            self.process = subprocess.Popen(
                [sys.executable, str(Path(__file__).with_name(script)), *words],
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                cwd=ROOT,
            )  # fmt: skip
            self.number += 1_000_000
            said = self._listen()
            if self.process.returncode:
                self._fell(said)

    def _listen(self):
        lines, said = queue.SimpleQueue(), collections.deque(maxlen=40)

        def pump():
            for line in self.process.stdout:
                lines.put(line)
            lines.put(None)

        pumping = threading.Thread(target=pump, daemon=True)
        pumping.start()
        while True:
            try:
                line = lines.get(timeout=PATIENCE)
            except queue.Empty:
                self.process.kill()
                said.append(f"no word for {PATIENCE} s: ended\n")
                break
            if line is None:
                break
            if not line.startswith('{"counts"'):
                said.append(line)
                continue
            report = json.loads(line)
            self.counts.update(report["counts"])
            if report["found"]:
                path, place = report["found"]
                if self.places.setdefault(place, path) == path:
                    print(f"{self.name}: FOUND {place}\n    {path}", flush=True)
        self.process.wait()
        pumping.join()
        self.process.stdout.close()
        return "".join(said)

    def _fell(self, said):
        current = FINDS / self.name / "current"
        data = current.read_bytes() if current.exists() else b""
        path = keep(self.name, data, f"ended with {self.process.returncode}\n{said}", ".input")
        place = f"the process ended with {self.process.returncode}"
        self.counts["FOUND"] += 1
        self.places[f"{place} ({path.name})"] = str(path)
        print(f"{self.name}: FOUND {place}\n    {path}\n{said}", flush=True)

    def line(self):
        counts = ", ".join(f"{words} {n}" for words, n in self.counts.most_common())
        return f"{self.name}: {sum(self.counts.values())} inputs ({counts})"


def everything(names, minutes, number):
    """All targets in turn, as many at a time as there are processors; the exit code."""
    at_once = max(1, min(len(names), len(os.sched_getaffinity(0))))
    seconds = 60.0 * minutes * at_once / len(names)
    waiting, done, running = [(n, number) for n in names], [], {}
    while waiting or running:
        while waiting and len(running) < at_once:
            worker = Worker(*waiting.pop(0), seconds)
            running[worker] = threading.Thread(target=worker.go)
            running[worker].start()
        time.sleep(2.0)
        for worker, thread in list(running.items()):
            thread.join(timeout=4.0)
            print(worker.line(), flush=True)
            if not thread.is_alive():
                done.append(worker)
                del running[worker]
    print("\n" + "\n".join(worker.line() for worker in done))
    found = {f"{w.name}: {place}": path for w in done for place, path in w.places.items()}
    for place, path in found.items():
        print(f"FOUND {place}\n    {path}")
    print(f"{len(found)} finds" + (f", in {FINDS.relative_to(ROOT)}" if found else ""))
    return 1 if found else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    guided = GUIDED if importlib.util.find_spec("atheris") else ()
    parser.add_argument("targets", nargs="*", choices=[[], *HYPOTHESIS, *GUIDED], metavar="TARGET")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--repeat", type=Path)
    parser.add_argument("--work", type=float, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.work is not None:
        return work(asked.targets[0], asked.seed, asked.work)
    if asked.repeat is not None:
        from fuzz.repeating import repeat

        return repeat(asked.targets[0], asked.repeat.read_bytes())
    if not guided and not asked.targets:
        print("atheris is not installed: no coverage-guided targets")
    return everything(asked.targets or [*HYPOTHESIS, *guided], asked.minutes, asked.seed)


if __name__ == "__main__":
    sys.exit(main())
