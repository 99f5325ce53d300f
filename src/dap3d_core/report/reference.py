"""The reference of a report: two independent runs, and the expected values of the model."""

import tomllib
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

import attrs
import numpy as np

from dap3d_core.formulations import FORMULATIONS
from dap3d_core.model.groups import Floats
from dap3d_core.model.state_layout import split
from dap3d_core.report.measurement import Bench
from dap3d_core.report.settings_ladder import ADAPTIVE, Setting, controlled
from dap3d_core.result import Result
from dap3d_core.result.post.global_error import difference, largest_norms, least_sizes, sizes_of
from dap3d_core.scene import Scene, SceneError, load
from dap3d_core.simulation import SimulationError

#: Tolerances tried for a reference, the tightest first, which is beyond the ladder: a run that is
#: its own reference has no error.
TIGHTEST = (1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8)
#: Methods with an error that does not vanish with the tolerance (the penalty formulation ends its
#: passes at a residual): references only where no other method fits.
APPROXIMATE = tuple(f.name for f in FORMULATIONS.values() if not f.is_exact)
#: Time limit of a reference run, relative to others.
REFERENCE_LIMIT = 4.0

Tick = Callable[[str], None]

#: Components below are compared with this (SI), not with themselves.
Y_THR = 1e-3
#: Relative difference from which two references have parted: chaos, or a fault.
PARTED = 1e-3


@attrs.frozen
class Expected:
    """Comparison of the reference with the expected.toml of the model.

    Attributes:
        count: number of values compared: those of the state at reported instants.
        deviation: the largest deviation (SI).
        within: all are within the tolerances stated there.
    """

    count: int
    deviation: float
    within: bool


@attrs.frozen(eq=False)
class Reference:
    """The trajectory that errors are measured against.

    Attributes:
        t: (nt,) instants, s; fewer than reported where the two reference runs part.
        u: (nt, 13 n) states there.
        settings: of the reference, and of the second run it is compared with, if any.
        uncertainty: the error e of the second run against it, the smallest error that can be
            measured; None without a second run.
        meaningless_from: the instant, s, from which the two differ by more than 1e-3 of the size,
            so that errors mean nothing; None where they never do.
        expected: comparison with independent values; None where there are none.
        notes: limitations of the reference.
    """

    t: Floats
    u: Floats
    settings: tuple[Setting, ...]
    uncertainty: float | None
    meaningless_from: float | None
    expected: Expected | None
    notes: tuple[str, ...]


def find_reference(bench: Bench, fixed: list[Setting], tick: Tick) -> Reference:
    """The reference of a scene.

    Two runs at the tightest tolerance that each can meet, with different integrators and, where
    more than one method fits, different methods.

    Args:
        bench: runs the settings.
        fixed: settings of fixed steps, used where no tolerance can be met.
        tick: called with the present activity.

    Raises:
        SimulationError: no run was completed; gives the reasons.
    """
    failures: dict[str, str] = {}

    def first_of(settings: Iterable[Setting]) -> tuple[Setting, Result] | None:
        for setting in settings:
            if setting.method not in bench.models:
                continue
            activity = f"reference: {setting}"
            tick(activity)
            limit = REFERENCE_LIMIT * bench.limit_s
            result = bench.run(setting, partial(tick, activity), limit_s=limit)
            if isinstance(result, Result):
                return setting, result
            failures[f"{setting.method}, {setting.integrator}"] = result
        return None

    first = first_of(_candidates(bench, fixed))
    if first is None:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in failures.items())
        reasons = reasons or "; ".join(f"{r.method}: {r.reason}" for r in bench.refused)
        raise SimulationError(f"no run came to its end: {reasons}")
    seconds = [first_of(_others(first[0], _candidates(bench, fixed)))]
    if seconds[0] is not None and seconds[0][0].rtol not in TIGHTEST[:2]:  # steps may do better
        others = [s for s in fixed if s.integrator != first[0].integrator]
        seconds.append(first_of(sorted(others, key=lambda s: s.method in APPROXIMATE)))
    completed = [second for second in seconds if second is not None]
    u = first[1].u
    second = min(completed, key=lambda other: trajectory_error(other[1].u, u), default=None)
    return _reference(bench, first, second)


def _candidates(bench: Bench, fixed: list[Setting]) -> Iterator[Setting]:
    """Settings in order of preference."""
    exact = [name for name in bench.models if name not in APPROXIMATE]
    for methods in (exact, APPROXIMATE):
        for rtol in TIGHTEST:
            for integrator in ADAPTIVE:
                for method in methods:
                    yield controlled(method, integrator, rtol)
        yield from (setting for setting in fixed if setting.method in methods)


def _others(first: Setting, settings: Iterable[Setting]) -> list[Setting]:
    """Settings with another integrator or method than the first, the most different ones first."""
    integrator, method = first.integrator, first.method
    others = [s for s in settings if (s.integrator, s.method) != (integrator, method)]
    return sorted(
        others,
        key=lambda s: (s.method in APPROXIMATE, s.integrator == integrator, s.method == method),
    )


def _reference(
    bench: Bench, first: tuple[Setting, Result], second: tuple[Setting, Result] | None
) -> Reference:
    setting, result = first
    settings: tuple[Setting, ...] = (setting,)
    count, uncertainty = len(result.t), None
    meaningless_from = None
    notes = []
    if second is None:
        notes.append("the reference is a single run: its own uncertainty is not known")
    else:
        settings = (setting, second[0])
        parting = first_parting(result.t, result.u, second[1].u, result.record.length)
        if parting is not None:
            count = max(parting, 1)
            meaningless_from = float(result.t[parting])
            notes.append(
                f"the two reference runs differ by more than 1e-3 of the size from "
                f"t = {meaningless_from:.6g} s on (chaos, or a fault in one): errors are "
                "measured up to there alone"
            )
        uncertainty = trajectory_error(second[1].u[:count], result.u[:count])
    for each in settings:
        if each.rtol is None or each.rtol > TIGHTEST[0]:
            tight = f"rtol {TIGHTEST[0]:g}"
            notes.append(f"{each} serves as reference: at {tight} none like it came to its end")
    expected = compare_with_expected(bench, result)
    if expected is not None and not expected.within:
        notes.append(
            f"the reference deviates from the model's expected.toml by {expected.deviation:.2g}, "
            "more than the tolerance there"
        )
    return Reference(
        result.t[:count],
        result.u[:count],
        settings,
        uncertainty,
        meaningless_from,
        expected,
        tuple(notes),
    )


def compare_with_expected(bench: Bench, result: Result) -> Expected | None:
    """Compare with the expected.toml of the scene; None where it has no value of this run.

    Compared are r, p, rd, w of bodies at reported instants after the start, each within the
    tolerance stated there. A scene that was changed since it was read has no expected values.
    """
    path = bench.scene.path
    if path is None or not _is_as_read(bench.scene, path):
        return None
    try:
        checks = tomllib.loads((path.parent / "expected.toml").read_text("utf-8"))["check"]
    except (OSError, ValueError, KeyError):
        return None
    count, deviation, within = 0, 0.0, True
    for check in checks:
        head, _, body = str(check["quantity"]).partition(".")
        index = result.summary.body_index.get(body)
        if head not in ("r", "p", "rd", "w") or index is None or not check.get("t"):
            continue
        (rows,) = np.nonzero(np.abs(result.t - check["t"]) <= 1e-12 * abs(check["t"]))
        if not len(rows):
            continue
        expected = np.array(check["value"], dtype=float)
        value = getattr(result, head)[rows[0], index]
        if head == "p" and value @ expected < 0.0:
            value = -value
        error = float(np.max(np.abs(value - expected)))
        count += 1
        deviation, within = max(deviation, error), within and error <= check["tolerance"]
    return Expected(count, deviation, within) if count else None


def _is_as_read(scene: Scene, path: Path) -> bool:
    """True if a scene equals its file, but for the duration and the method of the run."""
    try:
        read = load(path)
    except SceneError:
        return False
    settings = scene.simulation
    names = ("correct", "project", "hold", "correct_metric", "start")
    same = all(getattr(read.simulation, name) == getattr(settings, name) for name in names)
    read.simulation = settings
    return same and read.to_toml() == scene.to_toml()


def trajectory_error(u: Floats, reference: Floats) -> float:
    """The error e of states (nt, 13 n) against those of a reference at the same instants."""
    off = difference(reference, u) / np.maximum(np.abs(reference), Y_THR)
    return float(np.sqrt(np.mean(off**2)))


def final_position_error(u: Floats, reference: Floats) -> float:
    """The largest distance of a mass centre from its reference at the last instant, m."""
    off = difference(reference[-1:], u[-1:])
    r = split(off)[0]
    return float(np.max(np.linalg.norm(r, axis=2), initial=0.0))


def first_parting(t: Floats, u: Floats, other: Floats, length: float) -> int | None:
    """Index of the first instant at which two trajectories have parted; None where they never do.

    They have parted where a vector r, p, r_dot or w of some body differs by more than ``PARTED`` of
    the largest such vector of the run; ``length``, m, is that of the scene (``least_sizes``).
    """
    sizes, least = sizes_of(u), least_sizes(t, length)
    apart = np.zeros(len(u), dtype=bool)
    for name, off in largest_norms(difference(u, other)).items():
        apart |= off > PARTED * max(sizes[name], least[name])
    return int(np.argmax(apart)) if apart.any() else None
