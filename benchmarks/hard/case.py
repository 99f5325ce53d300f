"""A hard case as a record, what is tried on it, and what a try gives."""

import statistics
import time
from collections.abc import Callable

import attrs
import numpy as np

import dap3d_core as dap
from dap3d_core.result import Result
from dap3d_core.scene import Scene, SceneError
from dap3d_core.simulation import SimulationError

#: A run that takes longer, s, is ended; those that pass take a small part of it.
PATIENCE = 20.0
#: Runs of a try; the median of their times is kept.
REPEATS = 3
#: A try that takes longer, s, is run once.
LONG = 2.0
#: Smallest magnitude that a relative error is taken of (Gonzalez, Dopico, Gonzalez, Cuadrado 2006).
SMALL = 1e-3


@attrs.frozen
class Try:
    """One way to run a case.

    Attributes:
        method, integrator: of the run; "auto" chooses.
        settings: what else ``dap.simulate`` is given.
        why: why it does not pass, "" where it does; a failure without a reason is none to show.
    """

    integrator: str = "dop853"
    method: str = "auto"
    settings: dict[str, float] = attrs.field(factory=dict)
    why: str = ""

    @property
    def title(self) -> str:
        """Integrator, method where one is asked for, and what sets the step."""
        method = "" if self.method == "auto" else f" {self.method}"
        step, rtol = self.settings.get("step"), self.settings.get("rtol")
        how = f"h = {step:g}" if step else f"rtol {rtol:g}" if rtol else "rtol 1e-8"
        free = "" if self.settings.get("project", True) else ", no projection"
        return f"{self.integrator}{method}, {how}{free}"


@attrs.frozen
class Case:
    """A scene, what makes it hard, and how far a run is from what is known of it.

    Attributes:
        name, title: a short name and a name in words.
        hard: what makes it hard, in a sentence.
        scene: makes the scene.
        t_end, dt: the run, s.
        error: error of a result against the reference; which error, says ``measured``.
        measured: what the error is.
        source: where the reference comes from.
        tries: what is run.
        test: the file of the tests that cover it.
        loose: a run passes whose error is at most this many times its rtol (with a fixed step,
            1e-8): 1e3, as in the ledger, and more where the motion itself multiplies errors.
        floor: what the reference leaves out, or to how many digits it is known.
        slow: whether its first try takes longer than a test may that is run each time.
    """

    name: str
    title: str
    hard: str
    scene: Callable[[], Scene]
    t_end: float
    dt: float
    error: Callable[[Result], float]
    measured: str
    source: str
    tries: tuple[Try, ...]
    test: str
    loose: float = 1e3
    floor: float = 0.0
    slow: bool = False

    def limit(self, attempt: Try) -> float:
        """The largest error with which a try passes."""
        return max(self.loose * attempt.settings.get("rtol", 1e-8), self.floor)

    def simulate(self, attempt: Try) -> Result:
        """One run.

        Raises:
            SceneError, SimulationError: the method refuses the scene; the run stopped.
        """
        # the only types of their own are those of shipped models
        compiled = dap.compile(self.scene(), method=attempt.method, allow_code=True)
        settings = {"t_end": self.t_end, "dt": self.dt, "integrator": attempt.integrator}
        started = []

        def progress(t, t_end):
            started.append(time.process_time())  # compiled by then
            if started[-1] - started[0] > PATIENCE:
                raise SimulationError(f"at t = {t:.3g} s of {t_end:g} s after {PATIENCE:g} s", None)

        return dap.simulate(compiled, progress=progress, **(settings | attempt.settings))


def relative_error(found, reference, small=SMALL):
    """The error e: root of the mean over instants and components of squared relative errors."""
    size = np.maximum(np.abs(reference), small)
    return float(np.sqrt(np.mean(((found - reference) / size) ** 2)))


def run_case(case):
    """One row for each try of a case: as JSON has it."""
    return [_row(case, attempt) for attempt in case.tries]


def _row(case, attempt):
    row = {"case": case.name, "run": attempt.title}
    try:
        result = case.simulate(attempt)
    except (SceneError, SimulationError) as error:
        said = str(error).split(". ")[0].splitlines()[0]
        return row | {"passes": False, "why": attempt.why, "said": said}
    error = case.error(result)
    row |= {"passes": bool(error <= case.limit(attempt)), "error": error}
    if not row["passes"]:
        row["why"] = attempt.why
    return row | drift_of(result) | {"seconds": seconds(case, attempt)}


def drift_of(result):
    """What should be conserved or zero, and what the run cost."""
    ledger = result.ledger
    return {
        "method": result.method,
        "ledger": ", ".join(k for k, entry in ledger.items() if entry.ok is False) or "ok",
        "energy": ledger["energy"].value,
        "C": ledger["position"].value,
        "p": ledger["quaternion"].value,
        "steps": result.stats.steps,
        "rhs": result.stats.rhs,
    }


def seconds(case, attempt):
    """Median processor time of a run that is compiled already, s."""
    found = []
    while len(found) < REPEATS and sum(found) < LONG:
        start = time.process_time()
        case.simulate(attempt)
        found.append(time.process_time() - start)
    return statistics.median(found)
