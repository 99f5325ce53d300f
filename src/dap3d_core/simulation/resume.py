"""Runs that go on from a checkpoint: bit for bit as if they had not been ended."""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import UNSETTLED
from dap3d_core.integrators import Status
from dap3d_core.integrators.stepping.integration_state import MOST_COUNTED
from dap3d_core.integrators.stepping.restore import check_alike, restored
from dap3d_core.kernels.runtime.source_digest import driver_digest
from dap3d_core.model.state_layout import u_from_y
from dap3d_core.registry.arguments import checked
from dap3d_core.result import Result, current_versions, information
from dap3d_core.result.file.validate import are_texts
from dap3d_core.scene import SceneError, Simulation, check_simulation, load
from dap3d_core.simulation.checkpoint.save import (
    parts_of,
    path_of,
    read_checkpoint,
    remove_parts,
    results_of,
)
from dap3d_core.simulation.control.sampled import Controller
from dap3d_core.simulation.errors import CheckpointError
from dap3d_core.simulation.events.event import Event
from dap3d_core.simulation.handover import switch_integrator
from dap3d_core.simulation.initial.given_state import state_of
from dap3d_core.simulation.initial.start_state import StartState
from dap3d_core.simulation.open_result import compile_again
from dap3d_core.simulation.output.monitor import RunProgress
from dap3d_core.simulation.output.type_sources import digests_of
from dap3d_core.simulation.run import Run
from dap3d_core.simulation.run_state import Callbacks, Progress, RunState
from dap3d_core.simulation.settings import check_checkpoint, report_times


@checked
def resume(
    path: str | os.PathLike[str],
    *,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    checkpoint: float = math.inf,
    model: str | os.PathLike[str] | None = None,
    allow_code: bool = False,
    events: Sequence[Event] = (),
    controllers: Sequence[Controller] = (),
    progress: Progress | None = None,
    watch: Callable[[RunProgress], None] | None = None,
    announce: Callable[[str], None] | None = None,
) -> Result:
    """Go on with a run from its checkpoint; its result is that of a run that was not ended.

    Bit for bit so on the same machine and with the same versions; where they differ, a note says
    so. Once the run has ended by itself, its checkpoint and its unfinished files are removed.

    Args:
        path: the checkpoint, ``RESULT.checkpoint``. The rows that the run had reported are in a
            file next to it: RESULT, or ``RESULT.part`` where the run was killed.
        output, force: another result file, and whether over an existing one. By default RESULT.
        checkpoint: as ``simulate`` has it.
        model, allow_code: where the model's own types stand, and whether they may be loaded; as
            ``open`` has them.
        events, controllers: those of the run, given again, in their order. Inputs stay; what a
            controller remembers by itself is not stored.
        progress, watch, announce: as ``simulate`` has them.

    Raises:
        CheckpointError: missing, cut off, damaged, foreign or newer; its rows are gone; the types
            or events are not those of the run.
        PluginError, SceneError: a type is not installed.
        SimulationError, ResultError: as ``simulate``.
    """
    found = ResumedRun(path, model=model, allow_code=allow_code, announce=announce)
    return found.execute(
        output, force=force, checkpoint=checkpoint, events=events, progress=progress, watch=watch,
        controllers=controllers,
    )  # fmt: skip


class ResumedRun:
    """A checkpoint with the model that it belongs to.

    Attributes:
        compiled: the model.
        output: the result file of the run.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        model: str | os.PathLike[str] | None = None,
        allow_code: bool = False,
        announce: Callable[[str], None] | None = None,
    ) -> None:
        """Read a checkpoint, compile its model; arguments and errors as of ``resume``."""
        self.path = Path(path)
        self._found = read_checkpoint(self.path)
        header = self._found.header
        self.compiled = compile_again(
            header["scene"], None if model is None else load(model).path,
            lambda reason: CheckpointError(f"cannot resume from {path}: {reason}"),
            method=header["method"], allow_code=allow_code, announce=announce,
            joint=header.get("formulation") == "joint",  # which older checkpoints lack
        )  # fmt: skip
        known, here = self._found.header["types"], digests_of(self.compiled.checked)
        changed = [name for name in {**known, **here} if known.get(name) != here.get(name)]
        if changed:
            raise CheckpointError(
                f"cannot resume from {self.path}: the formulas of {', '.join(changed)} have "
                "changed since; run the scene anew, or bring back the files of these types"
            )
        # its name alone: what a file says does not point out of its folder
        self.output = self.path.with_name(Path(header["output"]).name)

    def execute(
        self,
        output: str | os.PathLike[str] | None = None,
        *,
        force: bool = False,
        checkpoint: float = math.inf,
        events: Sequence[Event] = (),
        progress: Progress | None = None,
        watch: Callable[[RunProgress], None] | None = None,
        controllers: Sequence[Controller] = (),
    ) -> Result:
        """Go on to the end; arguments and errors as of ``resume``."""
        check_checkpoint(checkpoint, self.output)
        target = self.output if output is None else Path(output)
        header, (before, earlier) = self._found.header, self._rows_so_far()
        is_own = target.exists() and target.samefile(before)

        def restore(run: RunState) -> None:
            self._restore(run)
            for block in earlier:
                run.recorder.add(block, lambda: run.record("done"))
            if self._is_ours(target) and run.recorder.count:  # else each kill leaves one more
                run.recorder.to_disk(lambda: run.record("done"))
                remove_parts(self.output, header["run"], kept=run.recorder.part)

        with self.compiled.borrow_evaluator():
            run = Run(self.compiled, self._settings(),
                      Callbacks(progress=progress, watch=watch), events,
                      output=target, force=force or is_own, identity=header["run"],
                      estimate_error=bool(header["estimate_error"]),
                      start=self._start_state(), controllers=controllers)  # fmt: skip
            run.save_every(checkpoint, force=force or self._is_ours(target))
            try:
                result = run.execute(restore)
            except BaseException as error:
                if hasattr(error, "checkpoint"):  # it takes the place of this one
                    self._remove_what_is_replaced(target)
                raise
        self._remove_what_is_replaced(target)
        return result

    def _remove_what_is_replaced(self, target: Path) -> None:
        """Remove the unfinished rows of the run, and this checkpoint where another file continues.

        A result file stays, whatever it holds.
        """
        remove_parts(self.output, self._found.header["run"])
        if not self._is_ours(target):
            self.path.unlink(missing_ok=True)

    def _is_ours(self, target: Path) -> bool:
        """True if checkpoints of the resumed run replace this one."""
        other = path_of(target)
        return other.exists() and other.samefile(self.path)

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

    def _settings(self) -> Simulation:
        """The settings of the run, checked as those of a scene are."""
        stored = self._found.header["settings"]
        names = {field.name for field in attrs.fields(Simulation)}
        if stored.keys() != names or not isinstance(stored["hold"], list):
            other = ", ".join(sorted(stored.keys() ^ names)) or "hold"
            raise self._damaged(f"its settings are not those of a run ({other})")
        settings = Simulation(**stored | {"hold": tuple(stored["hold"])})
        try:
            check_simulation(settings, self.compiled.model.body_names)
            report_times(settings.t_end, settings.dt)
        except SceneError as error:
            raise self._damaged(f"its settings make no sense: {error}") from error
        return settings

    def _start_state(self) -> StartState | None:
        """The state that the run was started from in place of its scene's; None without one."""
        stored, model = self._found.arrays, self.compiled.model
        if "start.u" not in stored:
            return None
        for name, count in (("angles", model.angle_count), ("states", model.state_count)):
            numbers = stored.get(f"start.{name}", np.zeros(0))
            if numbers.size != count or not np.isfinite(numbers).all():
                raise self._damaged(f"the {name} of its start are of another model, or not finite")
        try:
            u = state_of(stored["start.u"], model.body_names)
        except ValueError as error:
            raise self._damaged(f"its start: {error}") from error
        ended = self._found.header.get("start_without", [])
        if not are_texts(ended) or not set(ended) <= set(model.breaks):
            raise self._damaged("the joints that do not hold at its start are of another model")
        return StartState(
            u,
            stored.get("start.angles"),
            is_interpolated=self._found.header.get("start_is_interpolated") is True,
            states=stored.get("start.states"),
            ended=tuple(ended),
        )

    def _restore(self, run: RunState) -> None:
        """Stand where the checkpoint was written."""
        header, stored = self._found.header, self._found.arrays
        locator, control = run.event_locator, run.control
        events = locator.events if locator else ()
        self._check_given("events", {"titles": [one.title for one in events]})
        self._check_given("controllers", {
            "titles": control.titles if control else [],
            "every": [one.every for one in control.controllers] if control else [],
        }, " and as often")  # fmt: skip
        try:
            if locator is not None:
                locator.restore(header.get("events"))
            if header["integrations"] == 2:
                switch_integrator(run)
                if run.integrations[0].implicit != ("0.own" in stored):  # which implicit ones have
                    run.integrations.reverse()
            for k, integration in enumerate(run.integrations):
                first = f"{k}."
                integration.restore(
                    {n.removeprefix(first): a for n, a in stored.items() if n.startswith(first)}
                )
            if len(run.integrations) > 1 and run.integrations[0].status is Status.RUNNING:
                raise ValueError("its first integration goes on, and there is a second")
            run.crossed, until = header["crossed"], header["until"]
            run.until = math.inf if until is None else until
            restore_system(run, stored)
            if run.jumps is not None:
                run.jumps.restore(header.get("jumps"))
            if control is not None:
                control.restore(header["controllers"], run.integrations)
            check_position(run, header["rows"])
        except ValueError as error:
            raise self._damaged(str(error)) from error
        run.notes = [*header["notes"], *self._notes(run.present.t)]
        run.started -= header["wall_time_s"]
        run.compile_time += header["compile_time_s"]

    def _damaged(self, words: str) -> CheckpointError:
        return CheckpointError(
            f"cannot resume from {self.path}: {words}; it was changed, or another program made it. "
            "Run the scene anew"
        )

    def _check_given(self, what: str, here: Mapping[str, list[Any]], how: str = "") -> None:
        """CheckpointError where events or controllers are not given as they were to the run."""
        known = self._found.header.get(what) or {}
        if any(known.get(key, []) != values for key, values in here.items()):
            raise CheckpointError(
                f"cannot resume from {self.path}: the run has the {what} "
                f"{known.get('titles') or 'none'}, given are {here['titles'] or 'none'}; give the "
                f"same again, in their order{how}"
            )

    def _notes(self, t: float) -> list[str]:
        """Notes on the time of resumption, and on digits that may differ."""
        header = self._found.header
        notes: list[str] = [information(f"resumed from a checkpoint at t = {t:.9g} s")]
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


def restore_system(run: RunState, stored: Mapping[str, Any]) -> None:
    """Give the model the turns, changed numbers and counts of a checkpoint; the rest is its own.

    What else ``par`` holds, such as the places of tables, compiled code takes for indices.

    Raises:
        ValueError: they are of another model, or not finite.
    """
    par, settings = run.evaluator.system.par, run.evaluator.system.settings
    changes, locator = np.zeros(len(par), dtype=bool), run.event_locator
    for places in run.evaluator.turn_places():
        changes[places] = True
    if locator and locator.changed_forces:
        changes |= locator.numbers.changeable(locator.changed_forces)
    new = restored("system.par", par, stored.get("system.par"), np.flatnonzero(~changes))
    counts: Any = stored.get("system.settings")
    check_alike("system.settings", counts, settings)
    own = counts[UNSETTLED]
    if not (np.isfinite(new).all() and 0.0 <= own <= MOST_COUNTED):
        raise ValueError("the numbers of its forces, turns or counts are not finite")
    par[:], settings[UNSETTLED] = new, own


def check_position(run: RunState, rows: int) -> None:
    """Checks that a restored run is at a state of its model, after so many rows.

    Raises:
        ValueError: it does not.
    """
    model, last = run.evaluator.model, run.present
    y = run.evaluator.body_state(last.y)
    state_of(u_from_y(y[None], model.state_count)[0], model.body_names)
    reported = last.work.next_report
    if rows - reported not in (0, 1):  # an event that ends a run reports its own instant
        raise ValueError(f"{rows} rows are reported of the {reported} that its instants need")
