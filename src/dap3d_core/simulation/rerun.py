"""Runs made again from what their results hold, and compared."""

import os
from collections.abc import Callable
from typing import Any

import attrs
import numpy as np

from dap3d_core.registry.arguments import checked
from dap3d_core.result import Computed, Result, ResultError, current_versions
from dap3d_core.result.arrays import COLUMNS, Arrays, is_summary_of
from dap3d_core.scene import load
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.open_result import compile_again, open_result
from dap3d_core.simulation.output.monitor import RunProgress
from dap3d_core.simulation.output.type_sources import changed_types
from dap3d_core.simulation.run_state import GIVEN_START
from dap3d_core.simulation.simulate import simulate

#: Settings that a result holds and ``simulate`` takes.
SETTINGS = ("t_end", "dt", "rtol", "atol", "step", "project", "correct", "correct_metric")


@attrs.frozen(eq=False)
class Reproduction:
    """A run and its repetition.

    Attributes:
        again: the result of the repetition.
        instants: how many instants were compared, from the first on.
        differences: largest difference of each array that is not equal bit for bit, SI, by name;
            zeros are equal whatever their signs.
        versions: those that differ: name -> (of the result, here).
        types: those whose formulas have changed since the run, with what brings them.
    """

    again: Result
    instants: int
    differences: dict[str, float]
    versions: dict[str, tuple[str, str]]
    types: list[str]

    @property
    def equal(self) -> bool:
        """True if all arrays are equal bit for bit."""
        return not self.differences


class _StopComparisonError(Exception):
    """The repetition has come as far as the result."""


@checked
def rerun(
    result: Result | str | os.PathLike[str],
    *,
    model: str | os.PathLike[str] | None = None,
    allow_code: bool = False,
    watch: Callable[[RunProgress], None] | None = None,
    announce: Callable[[str], None] | None = None,
) -> Reproduction:
    """Run a result's scene again with its settings and compare, bit for bit.

    Same versions and the same kind of machine give the same arrays. Of a result that ended early,
    the part that is there is compared.

    Args:
        result: the result, or its file.
        model, allow_code: where the model's own types stand, and whether they may be loaded.
        watch, announce: as ``simulate`` has them.

    Raises:
        ResultError: the file cannot be read; it lacks the settings; events of a script changed or
            ended the run, which are not in it; its types are not installed.
    """
    first = result if isinstance(result, Result) else open_result(result)
    settings = _settings(first)
    compiled = compile_again(
        first.scene_text, None if model is None else load(model).path,
        lambda reason: ResultError(f"the run cannot be made again: {reason}"),
        method=first.settings["method"], allow_code=allow_code, announce=announce,
        joint=first.method == "joint",
    )  # fmt: skip
    if not is_summary_of(first.summary, compiled.model):
        raise ResultError(
            "the run cannot be made again: the scene in its result gives other bodies or joints "
            "than its arrays are of; the file was changed, or its types were"
        )
    end = first.t[-1]

    def compare_stop(standing: RunProgress) -> None:
        if watch is not None:
            watch(standing)
        if first.status != "done" and standing.t > end:
            raise _StopComparisonError

    try:
        again = simulate(compiled, watch=compare_stop, announce=announce, **settings)
    except (_StopComparisonError, SimulationError) as error:
        again = Computed.of(error).result
    instants, differences = _compared(first, again)
    versions = {
        name: (number, current_versions().get(name, "none"))
        for name, number in first.versions.items()
        if current_versions().get(name) != number
    }
    types = changed_types(first.record.types or {}, compiled.types)
    return Reproduction(again, instants, differences, versions, types)


def _settings(result: Result) -> dict[str, Any]:
    lacking = [name for name in (*SETTINGS, "method") if name not in result.settings]
    if lacking or not len(result.arrays):
        what = f"the settings {', '.join(lacking)}" if lacking else "any instant"
        raise ResultError(f"the run cannot be made again: its result lacks {what}")
    if any(event.kind in ("stop", "change") for event in result.events):
        raise ResultError(
            "the run cannot be made again: events of a script ended or changed it, which its "
            "result does not hold; run the script again"
        )
    if setters := result.settings.get("controllers"):
        raise ResultError(
            f"the run cannot be made again: its inputs were set by {', '.join(setters)}, which its "
            "result does not hold; run the script again"
        )
    start = result.settings.get("start", "scene")  # which older results lack
    if start == GIVEN_START:
        raise ResultError(
            "the run cannot be made again: it started from a state that a script or --from gave, "
            "which its result does not hold; start it from there again"
        )
    settings = {"integrator": result.integrator, "start": start}
    return settings | {n: result.settings[n] for n in SETTINGS}


def _compared(first: Result, again: Result) -> tuple[int, dict[str, float]]:
    """Number of instants, and the largest differences where bits differ."""
    count = len(first.arrays)
    if first.status == "done" and len(again.arrays) != count:
        return min(count, len(again.arrays)), {"t": float("nan")}
    differences: dict[str, float] = {}
    done = 0
    for block in first.arrays.blocks():
        other = again.arrays.part(slice(done, done + len(block)))
        if len(other) < len(block):  # the repetition has ended earlier
            block = block.part(slice(len(other)))
            differences["t"] = float("nan")
        _compare(block, other, differences)
        done += len(block)
    return done, differences


def _compare(one: Arrays, other: Arrays, differences: dict[str, float]) -> None:
    for column in COLUMNS:
        a, b = getattr(one, column.name), getattr(other, column.name)
        # A scene's own program leaves out products with zero: zeros may come out with other signs.
        if not np.array_equal(a, b, equal_nan=True):
            worst = float(np.max(np.abs(a - b)))
            differences[column.name] = max(worst, differences.get(column.name, 0.0))
