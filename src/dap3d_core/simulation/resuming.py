"""Runs that go on from a checkpoint: bit for bit as if they had not been ended."""

import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from dap3d_core.interface import PluginError
from dap3d_core.kernels.cache import driver_digest
from dap3d_core.result import INFORMATION, Result, current_versions
from dap3d_core.scene import SceneError, Simulation, load, parse
from dap3d_core.simulation.asked import check_checkpoint
from dap3d_core.simulation.checkpoint import Checkpoint, path_of, read_checkpoint
from dap3d_core.simulation.compiled import CompiledModel
from dap3d_core.simulation.errors import CheckpointError
from dap3d_core.simulation.event import Event
from dap3d_core.simulation.opening import why_unmade
from dap3d_core.simulation.run import Progress, Run
from dap3d_core.simulation.saving import (
    Saver,
    arrays_of,
    digests_of,
    parts_of,
    remove_parts,
    results_of,
)
from dap3d_core.simulation.standing import Standing


def resume(
    path: str | os.PathLike[str],
    *,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    checkpoint: float = math.inf,
    model: str | os.PathLike[str] | None = None,
    allow_code: bool = False,
    events: Sequence[Event] = (),
    progress: Progress | None = None,
    watch: Callable[[Standing], None] | None = None,
    announce: Callable[[str], None] | None = None,
) -> Result:
    """Go on with a run from its checkpoint; its result is that of a run that was not ended.

    Bit for bit so on the same machine and with the same versions; where they differ, a note says
    so. Once the run has ended by itself, its checkpoint and its unfinished files are removed.

    Args:
        path: the checkpoint, ``RESULT.checkpoint``. The rows that the run had reported are in a
            file beside it: RESULT, or ``RESULT.part`` where the run was killed.
        output, force: another result file, and whether over an existing one. By default RESULT.
        checkpoint: as ``simulate`` has it.
        model, allow_code: where the model's own types stand, and whether they may be loaded; as
            ``open`` has them.
        events: those of the run, given again, in their order.
        progress, watch, announce: as ``simulate`` has them.

    Raises:
        CheckpointError: missing, cut off, damaged, foreign or newer; its rows are gone; the types
            or events are not those of the run.
        PluginError, SceneError: a type is not installed.
        SimulationError, ResultError: as ``simulate``.
    """
    found = resumption(path, model=model, allow_code=allow_code, announce=announce)
    return found.go(
        output, force=force, checkpoint=checkpoint, events=events, progress=progress, watch=watch
    )


def resumption(
    path: str | os.PathLike[str],
    *,
    model: str | os.PathLike[str] | None = None,
    allow_code: bool = False,
    announce: Callable[[str], None] | None = None,
) -> "Resumption":
    """A checkpoint read, its model compiled; arguments and errors as of ``resume``."""
    place = Path(path)
    found = read_checkpoint(place)
    return Resumption(place, found, model=model, allow_code=allow_code, announce=announce)


class Resumption:
    """A checkpoint with the model that it belongs to.

    Attributes:
        compiled: the model.
        output: the result file of the run.
    """

    def __init__(
        self,
        path: Path,
        found: Checkpoint,
        *,
        model: str | os.PathLike[str] | None,
        allow_code: bool,
        announce: Callable[[str], None] | None,
    ) -> None:
        """Make the model again; arguments and errors as of ``resume``."""
        self.path, self._found, self._announce = path, found, announce
        header = found.header
        scene = parse(header["scene"])
        scene.path = None if model is None else load(model).path
        try:
            self.compiled = CompiledModel(
                scene, method=header["method"], allow_code=allow_code, announce=announce
            )
        except (PluginError, SceneError) as error:
            words = why_unmade(error, allowed=allow_code and model is not None)
            raise CheckpointError(f"cannot resume from {path}: {words}") from error
        self._check_types()
        # its name alone: what a file says does not point out of its folder
        self.output = path.with_name(Path(header["output"]).name)

    def go(
        self,
        output: str | os.PathLike[str] | None = None,
        *,
        force: bool = False,
        checkpoint: float = math.inf,
        events: Sequence[Event] = (),
        progress: Progress | None = None,
        watch: Callable[[Standing], None] | None = None,
    ) -> Result:
        """Go on to the end; arguments and errors as of ``resume``."""
        check_checkpoint(checkpoint, self.output)
        target = self.output if output is None else Path(output)
        with self.compiled.in_use():
            run = self._run(target, events, watch, force=force)
            run.saver = Saver(run, checkpoint, force=force or self._is_ours(target))
            try:
                result = run.finish(progress)
            except BaseException as error:
                if hasattr(error, "checkpoint"):  # it takes the place of this one
                    self._remove_what_is_replaced(target)
                raise
        self._remove_what_is_replaced(target)
        return result

    def _run(
        self,
        target: Path,
        events: Sequence[Event],
        watch: Callable[[Standing], None] | None,
        *,
        force: bool,
    ) -> Run:
        """The run, standing where the checkpoint was written, with the rows until there."""
        header = self._found.header
        before, earlier = self._rows_so_far()
        settings = Simulation(**header["settings"] | {"hold": tuple(header["settings"]["hold"])})
        estimate = bool(header["estimate_error"])
        run = Run(self.compiled, settings, self._announce, events, watch, estimate_error=estimate)
        ours = target.exists() and target.samefile(before)
        run.keep(target, force=force or ours, identity=header["run"])
        assert run.keeper is not None
        run.prepare()
        self._restore(run)
        for block in earlier:
            run.keeper.add(block, lambda: run.record("done"))
        return run

    def _remove_what_is_replaced(self, target: Path) -> None:
        """Remove the unfinished rows of the run, and this checkpoint where another file goes on.

        A result file stays, whatever it holds.
        """
        remove_parts(self.output, self._found.header["run"])
        if not self._is_ours(target):
            self.path.unlink(missing_ok=True)

    def _is_ours(self, target: Path) -> bool:
        """Whether the checkpoints of the run that goes on replace this one."""
        other = path_of(target)
        return other.exists() and other.samefile(self.path)

    def _check_types(self) -> None:
        known, here = self._found.header["types"], digests_of(self.compiled.checked)
        changed = [name for name in known if known[name] != here.get(name)]
        if changed:
            raise CheckpointError(
                f"cannot resume from {self.path}: the formulas of {', '.join(changed)} have "
                "changed since; run the scene anew, or bring back the files of these types"
            )

    def _rows_so_far(self) -> tuple[Path, Any]:
        """The file that has the rows of the run, and these, block by block."""
        header = self._found.header
        files = (self.output, *parts_of(self.output))
        for file, result in results_of(files, header["run"]):
            if len(result.arrays) >= header["rows"]:
                return file, _first(result, header["rows"])
        raise CheckpointError(
            f"cannot resume from {self.path}: the rows of its run are gone; neither {self.output} "
            f"nor {self.output.name}.part holds them. Run the scene anew"
        )

    def _restore(self, run: Run) -> None:
        """Stand where the checkpoint was written."""
        header, stored = self._found.header, dict(self._found.arrays)
        given = stored.pop("events.given", None)
        self._restore_events(run, given)
        self._put_back(run, stored)
        while len(run.runs) < header["integrations"]:
            run.begin_implicit()
            self._put_back(run, stored)
        run.notes = [*header["notes"], *self._notes()]
        run.started -= header["wall_time_s"]
        run.compile_time += header["compile_time_s"]

    def _put_back(self, run: Run, stored: dict[str, Any]) -> None:
        for name, array in arrays_of(run):
            before = stored.get(name)
            if before is None or before.shape != array.shape or before.dtype != array.dtype:
                raise CheckpointError(
                    f"cannot resume from {self.path}: its scene gives another model here ({name}); "
                    "run the scene anew with this program"
                )
            if array.flags.writeable:
                array[...] = before

    def _restore_events(self, run: Run, given: Any) -> None:
        events = self._found.header.get("events")
        titles = events["titles"] if events else []
        asked = [event.title for event in run.watcher.events] if run.watcher else []
        if titles != asked:
            raise CheckpointError(
                f"cannot resume from {self.path}: the run has the events {titles or 'none'}, given "
                f"are {asked or 'none'}; give the same again, in their order"
            )
        if events and run.watcher is not None:
            run.watcher.restore(events, None if given is None else given.copy())

    def _notes(self) -> list[str]:
        """Where the run went on, and whether its digits may differ."""
        header = self._found.header
        notes = [f"{INFORMATION}resumed from a checkpoint at t = {header['t']:.9g} s"]
        here = current_versions()
        other = [
            f"{name} {number} (here {here.get(name)})"
            for name, number in header["versions"].items()
            if here.get(name) != number
        ]
        if header["driver"] != driver_digest("integrators") and not other:
            other = ["another state of dap3d's sources"]
        if other:
            notes.append(
                f"the checkpoint was made with {', '.join(other)}: digits may differ from those of "
                "a run that was not ended"
            )
        return notes


def _first(result: Result, count: int) -> Any:
    """The first rows of a result, block by block."""
    left = count
    for block in result.arrays.blocks():
        if left:
            yield block.part(slice(min(left, len(block))))
            left -= min(left, len(block))
