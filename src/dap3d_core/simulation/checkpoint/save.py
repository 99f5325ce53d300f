"""Checkpoints of a run: when they are written, and their content."""

import json
import math
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import attrs
from numpy.typing import NDArray

from dap3d_core.assembly.arrays import CHECKPOINTED
from dap3d_core.kernels.runtime.source_digest import driver_digest
from dap3d_core.result import Computed, Result, ResultError, open_result
from dap3d_core.result.metadata import to_json
from dap3d_core.simulation.checkpoint.file import (
    Checkpoint,
    path_of,
    read_checkpoint,
    write_checkpoint,
)
from dap3d_core.simulation.errors import CheckpointError
from dap3d_core.simulation.run_state import RunState


class CheckpointWriter:
    """Writes the checkpoints of a run.

    Attributes:
        path: where they stand.
        has_written: whether there is one of this run.
    """

    def __init__(self, run: RunState, seconds: float, *, force: bool) -> None:
        """Args:
            run: the run, which has an output.
            seconds: from one checkpoint to the next.
            force: give up a checkpoint of another run.

        Raises:
            ResultError: there is one of another run.
        """
        assert run.recorder.output is not None
        self.path = path_of(run.recorder.output)
        if self.path.exists() and not force:
            raise ResultError(
                f"{self.path} exists: a run that was ended goes on from it (dap3d resume); force "
                "gives it up"
            )
        self.has_written = False
        self._run, self._seconds = run, seconds
        self._next = time.perf_counter() + seconds

    def begin(self) -> None:
        """Write the first checkpoint before anything is integrated, where more are to follow.

        So a run that is killed at any later moment can be resumed.
        """
        if math.isfinite(self._seconds):
            self._save()

    def update(self) -> None:
        """Write a checkpoint if it is time."""
        if time.perf_counter() >= self._next:
            self._save()

    def _save(self) -> None:
        self._run.recorder.to_disk(lambda: self._run.record("done"))
        self.write()
        self._next = time.perf_counter() + self._seconds

    def leave(self, error: BaseException) -> None:
        """Write a checkpoint where a run is ended from outside, its result being saved.

        ``error.checkpoint`` names it, if the run is between two chunks.
        """
        run = self._run
        if run.is_whole:
            self.write()
            Computed(checkpoint=self.path).attach(error)

    def write(self) -> None:
        """Write a checkpoint of the present run, once its rows are in a file."""
        write_checkpoint(self.path, checkpoint_of(self._run))
        self.has_written = True

    def remove(self) -> None:
        """The run has finished and is not resumed. The checkpoint is removed last.

        That of another run, which has taken its place, stays.
        """
        recorder = self._run.recorder
        assert recorder.output is not None
        remove_parts(recorder.output, recorder.run)
        with suppress(CheckpointError):
            if read_checkpoint(self.path).header["run"] == recorder.run:
                self.path.unlink(missing_ok=True)


def results_of(files: Iterable[Path], run: str) -> Iterator[tuple[Path, Result]]:
    """Those of some files that can be read and are of a run, given its identity."""
    for file in files:
        with suppress(ResultError):
            result = open_result(file)
            if result.record.run == run:
                yield file, result


def parts_of(output: Path) -> list[Path]:
    """Unfinished files next to a result file."""
    return sorted(output.parent.glob(f"{output.name}.part*"))


def remove_parts(output: Path, run: str, *, kept: Path | None = None) -> None:
    """Remove the unfinished files that a run has left next to its result file, except one."""
    for part, _ in results_of(parts_of(output), run):
        if part != kept:
            part.unlink()


def checkpoint_of(run: RunState) -> Checkpoint:
    """State of a run between two chunks, its rows taken."""
    recorder, compiled = run.recorder, run.compiled
    assert recorder.output is not None
    header: dict[str, Any] = {
        "run": recorder.run,
        "output": recorder.output.name,
        "rows": recorder.count,
        "t": run.present.t,
        "integrations": len(run.integrations),
        "crossed": run.crossed,
        "until": run.until if math.isfinite(run.until) else None,
        "scene": compiled.scene_text,
        "method": compiled.requested_method,
        "formulation": compiled.method,
        "settings": attrs.asdict(run.settings),
        "estimate_error": run.estimate_error is True,
        "start_is_interpolated": run.start is not None and run.start.is_interpolated,
        "notes": run.notes,
        "wall_time_s": time.perf_counter() - run.started,
        "compile_time_s": run.compile_time,
        "driver": driver_digest("integrators"),
        "types": {name: one["digest"] for name, one in compiled.types.items()},
    }
    if run.event_locator is not None:
        header["events"] = run.event_locator.state()
    if run.jumps is not None:
        header["jumps"] = run.jumps.state()
    if run.control is not None:
        header["controllers"] = run.control.state(run.integrations)
    return Checkpoint(json.loads(to_json(header)), arrays_of(run))


def arrays_of(run: RunState) -> dict[str, NDArray[Any]]:
    """Arrays from which a run is resumed, by name."""
    found = {
        f"{k}.{name}": array
        for k, integration in enumerate(run.integrations)
        for name, array in integration.all_arrays()
    }
    if run.start is not None:
        found["start.u"] = run.start.u
        if run.start.angles is not None:
            found["start.angles"] = run.start.angles
        if run.start.states is not None:
            found["start.states"] = run.start.states
    return found | {f"system.{name}": getattr(run.evaluator.system, name) for name in CHECKPOINTED}
