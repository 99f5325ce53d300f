"""Kinematics: the motion that drivers prescribe, and the forces that it takes."""

import os
import time
from collections.abc import Callable, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.registry.arguments import checked
from dap3d_core.result import Computed, Result, RunMetadata, RunStatistics, information
from dap3d_core.result.arrays import Arrays, arrays_of, summary_of
from dap3d_core.result.file.atomic_write import check_target, check_utf8
from dap3d_core.result.post.point_motion import kinetic_energy
from dap3d_core.scene import Mistake, Scene, SceneError, Simulation
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.errors import (
    AssemblyError,
    RedundantError,
    SimulationError,
    refuse_contacts,
)
from dap3d_core.simulation.explain import method_note
from dap3d_core.simulation.failure.monitors import UnilateralMonitor
from dap3d_core.simulation.initial_state import InitialState, start_notes
from dap3d_core.simulation.kinematics.driver_coordinate import (
    DriverCoordinate,
    driver_names,
    read_coordinate,
)
from dap3d_core.simulation.kinematics.path import KinematicPath, PathEndError, Pose
from dap3d_core.simulation.kinematics.pose_equations import held_states, own_states, required_forces
from dap3d_core.simulation.redundancy.freedoms import freedoms_left, motion_words
from dap3d_core.simulation.redundancy.shared_reactions import refuse_shared, shared_laws
from dap3d_core.simulation.settings import compile_exact, report_times, settings_of

Progress = Callable[[float, float], None]

#: What the record of a result has for its integrator.
NAME = "kinematics"
#: A path that ends at a smaller singular value than this ends at a singular pose.
SINGULAR_END = 0.02
#: Rows with less than this part of the largest share have no part in what cannot be reached.
SHARE = 0.01
#: Branch points that notes describe.
MOST_BRANCHES = 4


@checked
def kinematics(
    scene: Scene | str | os.PathLike[str] | CompiledModel,
    *,
    t_end: float | None = None,
    dt: float | None = None,
    over: Any = None,
    progress: Progress | None = None,
    allow_code: bool = False,
    announce: Callable[[str], None] | None = None,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
) -> Result:
    """The motion of a scene whose drivers fix every freedom, with reactions and driver forces.

    Positions come from the constraints themselves, not from integration, so that they are at
    rounding at any time; velocities and accelerations from the rows, reactions and the forces of
    drivers by inverse dynamics. Rows that hold velocities alone (a rate driver, a rolling wheel)
    are integrated, to 1e-12. ``work`` is the change of the kinetic energy.

    Args:
        scene: a Scene, what ``load`` takes, or a compiled model.
        t_end, dt: final time and reporting step, s, by default those of the scene.
        over: a driver's coordinate in place of time: "motor.q=0:6.28:200" (from:to:count) or
            {"motor.q": values}, in rad or m from the poses as given. Its function is replaced by
            f(x) = x: t of the result is the coordinate, its rate is 1 rad/s or 1 m/s. Functions of
            other drivers take the coordinate for time.
        progress: called as progress(t, t_end) between instants.
        allow_code, announce: as of ``compile``.
        output, force: file to write, and whether over an existing one.

    Raises:
        SceneError, PluginError, ResultError: as ``compile``; unusable settings or output.
        SimulationError: freedoms are left that no driver fixes; drivers contradict each other; or
            the motion ends at a singular pose or beyond the reach of a driver: what was found
            before is its ``result``.

    Source: Nikravesh, Computer-Aided Analysis of Mechanical Systems, 1988, chapters 3 to 5.
    """
    check_output(output, force=force)
    compiled = compile_exact(scene, allow_code, announce)
    refuse_contacts(compiled.model)
    coordinate = None
    if over is not None:
        coordinate = _coordinate(over, compiled, t_end, dt)
        replaced = coordinate.replaced_in(compiled.scene)
        compiled = compile_exact(replaced, allow_code, announce)
    settings = settings_of(compiled, t_end=t_end, dt=dt)
    if coordinate is None:
        times = report_times(settings.t_end, settings.dt)
    else:
        times = np.sort(coordinate.values)
    with compiled.borrow_evaluator() as evaluator:
        run = _Kinematics(compiled, evaluator, settings, times, coordinate)
        return run.saved(progress, output, force=force)


def _coordinate(
    over: Any, compiled: CompiledModel, t_end: float | None, dt: float | None
) -> DriverCoordinate:
    if t_end is not None or dt is not None:
        words = "over a driver's coordinate nothing depends on time: leave t_end and dt out"
        raise SceneError([Mistake("over", over, words)])
    return read_coordinate(over, compiled)


def check_output(output: str | os.PathLike[str] | None, *, force: bool) -> None:
    """Refuse an output that cannot be written, before any work.

    Raises:
        ResultError: the reason, and what to do.
    """
    if output is not None:
        check_utf8("write", output)
        check_target(output, force)


def result_of(
    compiled: CompiledModel,
    arrays: Arrays,
    notes: Sequence[str],
    settings: dict[str, Any],
    **record: Any,
) -> Result:
    """The result of a motion that was found, not integrated: its work is that of kinetic energy.

    settings, record: of the metadata.
    """
    model, summary = compiled.model, summary_of(compiled.model)
    kinetic = kinetic_energy(summary, arrays.u)
    pulling = UnilateralMonitor(model)
    pulling.update(arrays)
    of_all = {"length": model.length, "project": True, "conservative": False}
    about = RunMetadata(
        scene_text=compiled.scene_text,
        method=compiled.method,
        notes=[*notes, *pulling.notes()],
        types=compiled.types,
        settings=settings | of_all | {"work_from_energy": True},
        **record,
    )
    arrays = attrs.evolve(arrays, work=kinetic - kinetic[0])
    return Result(summary, arrays, about, lambda: (model, lambda: compiled.evaluator))


class _Kinematics:
    """One analysis: the rows of its instants, notes and counts."""

    def __init__(
        self,
        compiled: CompiledModel,
        evaluator: Evaluator,
        settings: Simulation,
        times: Floats,
        coordinate: DriverCoordinate | None,
    ) -> None:
        self.compiled, self.evaluator, self.settings = compiled, evaluator, settings
        self.times, self.coordinate = times, coordinate
        note = method_note(compiled.method, compiled.reason, settings.method)
        self.notes = [*compiled.notes, note]
        self.rows: list[Floats] = []
        self.paths: list[KinematicPath] = []
        self.started = time.perf_counter()
        self.branches: list[tuple[float, Floats]] = []
        self.rank = 0

    def saved(
        self, progress: Progress | None, output: str | os.PathLike[str] | None, *, force: bool
    ) -> Result:
        """The result of all instants; in the output, also where an exception ends the analysis."""
        try:
            self.execute(progress)
            result = self.result("done")
        except BaseException as error:
            status = "interrupted" if isinstance(error, KeyboardInterrupt) else "stopped"
            part = self.result(status, error)
            if part is not None and output is not None:
                part.save(output, force=force)
            Computed(part).attach(error)
            raise
        assert result is not None
        if output is not None:
            result.save(output, force=force)
        return result

    def execute(self, progress: Progress | None) -> None:
        """All instants, in their order or, where a coordinate falls, in the opposite one.

        Raises:
            SimulationError: the motion cannot start, or ends before.
        """
        u = self._start().u
        try:
            self._follow(u, progress)
        except PathEndError as end:
            raise SimulationError(self._ended(end)) from end
        except AssemblyError as error:  # rows that are not finite
            where = self._instant(self.paths[-1].pose.t if self.paths else 0.0)
            words = str(error).partition(": ")[2]
            raise SimulationError(f"no pose follows that at {where}: {words}") from error

    def _follow(self, u: Floats, progress: Progress | None) -> None:
        """The path from the start u (13 n,), and its poses at the instants."""
        self.evaluator.start(0.0, u)
        falling = self.coordinate is not None and self.coordinate.values[-1] < self.times[-1]
        times = self.times[::-1] if falling else self.times
        if times[0] != 0.0:  # a coordinate begins elsewhere: go there first
            path = self._path(0.0, u, float(times[0]))
            while not path.is_done:
                self._advance(path)
                self.evaluator.count_turns(path.pose.t, path.pose.u)
            u = path.pose.u
        path = self._path(float(times[0]), u, float(times[-1]))
        self._report(path.pose, is_singular=False)
        done, direction = 1, -1.0 if falling else 1.0
        while done < len(times):
            self._advance(path)
            while done < len(times) and direction * (times[done] - path.pose.t) <= 0.0:
                self._report(*path.at(float(times[done])))
                done += 1
            self.evaluator.count_turns(path.pose.t, path.pose.u)
            if progress is not None:
                progress(abs(path.pose.t - times[0]), abs(times[-1] - times[0]))

    def result(self, status: str, error: BaseException | None = None) -> Result | None:
        """The result of the instants so far; None of none."""
        if not self.rows:
            return None
        notes = [*self.notes, *self._branch_notes()]
        rows = np.array(self.rows)
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        if isinstance(error, SimulationError):
            notes.append(str(error))
        return result_of(
            self.compiled,
            arrays_of(rows, summary_of(self.evaluator.model)),
            notes,
            {
                "t_end": float(self.times[-1]),
                "dt": self.settings.dt if self.coordinate is None else None,
                **self._over(),
                "correct": self.times[0] == 0.0,
                "rank": self.rank,
            },
            stats=RunStatistics(
                steps=sum(path.steps for path in self.paths),
                rejected=sum(path.rejected for path in self.paths),
                rhs=sum(path.evaluations for path in self.paths),
                wall_time_s=time.perf_counter() - self.started,
                compile_time_s=self.compiled.compile_time,
            ),
            status=status,
            integrator=NAME,
        )

    # ------------------------------------------------------------------ the start

    def _start(self) -> InitialState:
        """The assembled start, where no freedom is left."""
        settings, compiled = self.settings, self.compiled
        start = compiled.start(True, settings.hold, str(settings.correct_metric))
        self.notes += start_notes(start, self.evaluator, compiled.scene)
        self.notes += held_states(own_states(compiled.model))
        redundancy = start.redundancy
        self.rank, words = redundancy.rank.rank, redundancy.describe()
        if redundancy.singular is not None:
            raise SimulationError(
                f"kinematics cannot start at a singular pose: {redundancy.singular.describe()}\n"
                "Start at another pose; the analysis goes through this one"
            )
        if redundancy.contradictions:
            raise RedundantError(f"{words}. No motion satisfies them all")
        if redundancy.bindings:
            raise RedundantError(words)
        if redundancy.rank.dof:
            raise SimulationError(self._freedoms(start))
        laws = shared_laws(compiled.checked, self.evaluator, start.u, redundancy)
        refuse_shared(laws, self.evaluator)
        if redundancy.rank.redundant:
            self.notes.append(
                f"{words}. The motion is unique; reactions in these joints are not (reported are "
                "those of least |lambda|)"
            )
            lines = redundancy.describe_reactions()
            self.notes += [information(f"{line}") for line in lines]
        return start

    def _freedoms(self, start: InitialState) -> str:
        """Why kinematics is not possible: the freedoms that no driver fixes."""
        drivers = driver_names(self.compiled)
        have = f"the drivers ({', '.join(drivers)}) leave" if drivers else "it has no driver:"
        left = freedoms_left(self.evaluator, start.u, start.redundancy.rank.dof)
        head, _, rest = left.partition("\n")
        if drivers:
            head = head.replace(" are left", "").replace(" is left", "")
        return "\n".join([
            f"kinematics needs drivers that fix every freedom of the scene; {have} {head}",
            *([rest] if rest else []),
            "add a driver joint for each (dap3d plugins lists the types), or simulate the scene",
        ])  # fmt: skip

    # ------------------------------------------------------------------ instants

    def _path(self, t: float, u: Floats, end: float) -> KinematicPath:
        self.paths.append(KinematicPath(self.evaluator, t, u, end))
        return self.paths[-1]

    def _advance(self, path: KinematicPath) -> None:
        """A step, with a note where it leads through a singular pose."""
        path.advance()
        instant = path.singular_instant()
        if instant is not None:
            pose, _ = path.at(instant)
            self.branches.append((instant, pose.rows.smallest()[2]))

    def _branch_notes(self) -> list[str]:
        """Where the motion led through singular poses, in words."""
        notes = []
        for instant, motion in self.branches[:MOST_BRANCHES]:
            notes.append(
                f"branch point at {self._instant(instant)}: the pose is singular, and another "
                f"motion begins there ({motion_words(self.evaluator.model, motion)}); the one that "
                "goes on smoothly is taken. Reactions grow without a bound towards it, unless "
                "the forces vanish there"
            )
        if len(self.branches) > MOST_BRANCHES:
            notes.append(f"and {len(self.branches) - MOST_BRANCHES} branch points more")
        return notes

    def _report(self, pose: Pose, is_singular: bool) -> None:
        """Keep a row of output."""
        layout = self.evaluator.model.row_layout
        self.evaluator.count_turns(pose.t, pose.u)
        report = self.evaluator.report(pose.t, pose.u)
        row = np.concatenate([[pose.t], self.evaluator.integrated(pose.u), report])
        row[layout["v_dot"]] = pose.v_dot  # from the rows alone, nearer to rounding
        row[layout["residuals"].stop - 1] = pose.residual
        if is_singular:  # of the reactions what the motion determines
            needed = required_forces(self.evaluator, pose.t, pose.u, pose.v_dot)
            row[layout["Lam"]] = pose.rows.adjoint(needed)
        if not np.all(np.isfinite(row)):
            raise SimulationError(f"the forces are not finite at {self._instant(pose.t)}")
        self.rows.append(row)

    def _over(self) -> dict[str, str]:
        """Name and unit of the coordinate that stands for time, for the record."""
        if self.coordinate is None:
            return {}
        model, rows = self.evaluator.model, self.paths[-1].pose.rows.rows
        first = model.joint_start[model.joint_names.index(self.coordinate.driver)]
        entries = rows.value[(rows.row == first) & (rows.column % 6 < 3)]
        return {"over": f"{self.coordinate.driver}.q", "over_unit": "m" if entries.any() else "rad"}

    def _instant(self, t: float) -> str:
        if self.coordinate is None:
            return f"t = {t:.10g} s"
        return f"{self.coordinate.driver}.q = {t:.10g}"

    def _ended(self, end: PathEndError) -> str:
        """Why the motion ends, in words."""
        model, rows = self.evaluator.model, end.pose.rows
        value, left, motion = rows.smallest()
        if value > SINGULAR_END:
            return (
                f"no pose follows that at {self._instant(end.pose.t)}: what drivers prescribe "
                "jumps there, or their rates are not those of their positions"
            )
        share = np.abs(rows.left_out(left))
        moves = motion_words(model, motion)
        owners = model.row_owners(np.flatnonzero(share > SHARE * np.max(share)))
        return (
            f"dead point at {self._instant(end.t)}: what {', '.join(owners) or 'the drivers'} "
            f"prescribes from there on is beyond the reach of the joints. Towards it {moves}, "
            "faster and faster: no driver fixes that motion there. Let the driver turn back "
            "before, or drive another coordinate"
        )
