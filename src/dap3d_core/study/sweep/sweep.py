"""Sweeps: one scene, run at many combinations of values of its parameters."""

import os
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from typing import TYPE_CHECKING, Any, Unpack

import attrs
import numpy as np

from dap3d_core.registry.arguments import checked
from dap3d_core.result import Computed, ResultError
from dap3d_core.scene import Mistake, Scene, SceneError, check_simulation, load
from dap3d_core.settings import RunSettings
from dap3d_core.simulation.output.free_space import check_room_of_points
from dap3d_core.study.design import Design, design_of
from dap3d_core.study.ensemble import Ensemble
from dap3d_core.study.outputs import outputs_of
from dap3d_core.study.study import Study
from dap3d_core.study.sweep.dataset import InMemory, layout_of
from dap3d_core.study.sweep.file import NOTE, SweepFile
from dap3d_core.study.workers.threads import RunPoints, run_here

if TYPE_CHECKING:
    import xarray

INVALID_NAME = "a name in a NetCDF file begins with a letter, a digit or _ and holds no slash"


@checked
def sweep(
    scene: Scene | str | os.PathLike[str],
    vary: Any,
    *,
    outputs: Any,
    sample: int | None = None,
    design: str = "lhs",
    seed: int = 0,
    start: str | None = None,
    allow_code: bool = False,
    gradients: bool = False,
    threads: int | None = None,
    client: Any = None,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    resume: bool = False,
    progress: Callable[[int, int], None] | None = None,
    announce: Callable[[str], None] | None = None,
    **settings: Unpack[RunSettings],
) -> "xarray.Dataset":
    """Run a scene at many points, combinations of values of its parameters (docs/how-to/sweeps.md).

    Args:
        scene: a Scene, or what ``load`` takes.
        vary: name of a parameter (``bodies.crank.mass``) -> how it varies: a list or an array of
            numbers, "1:5:9" (from:to:count), "1:100:5:log"; for samples "1:5", "3~0.1" (normal).
        outputs: quantities ("crank.r.z:max"), functions of a ``Result``, or label -> one of these.
        sample, design, seed: number (without: a grid), "lhs", "random", "sobol" or "halton", seed.
        t_end, dt, method, integrator, rtol, atol, step: as of ``simulate``; likewise correct,
            project, correct_metric, start (a word), allow_code; announce as of ``compile``.
        gradients: True for exact derivatives ``d OUTPUT`` by what varies, along ``parameter``.
        threads, client: points at once; a ``distributed.Client`` whose workers run them.
        output, force, resume: file to write; overwrite it; continue with ``OUTPUT.part``.
        progress: called as progress(done, total).

    Returns:
        the outputs over the parameters, or ``point``; NaN, ``status``, ``note`` where one failed.

    Raises:
        SceneError, PluginError, SimulationError, ResultError: nothing can be run or stored; what
            ends it later (Ctrl-C, say) has the points so far as ``.result``.
    """
    given = {**settings, "start": start}
    study, plan = _read(scene, vary, outputs, (sample, design, seed), given, allow_code)
    study = attrs.evolve(study, gradients=gradients)
    runner = _Runner(threads, client, progress, announce, force=force, resume=resume)
    return runner.run(study, plan, output)


def _read(
    scene: Any,
    vary: Any,
    outputs: Any,
    sampling: tuple[Any, ...],
    settings: dict[str, Any],
    allow_code: bool,
) -> tuple[Study, Design]:
    """The study and its points, as far as they can be checked before the scene is compiled."""
    mistakes: list[Mistake] = []
    changed = scene.copy() if isinstance(scene, Scene) else load(scene)
    given = {k: v for k, v in settings.items() if v is not None}
    changed.simulation = attrs.evolve(changed.simulation, **given)
    try:
        check_simulation(changed.simulation, changed.bodies)
    except SceneError as error:  # other mistakes come again with the whole scene, with their lines
        keys = given.keys() | ({"step"} if "integrator" in given else set())
        keys = keys | ({"dt"} if "t_end" in given else set())
        mistakes += [m for m in error.mistakes if m.key in keys]
    try:
        plan = design_of(vary, *sampling)
    except SceneError as error:
        mistakes += error.mistakes
    try:
        computed = outputs_of(outputs)
    except SceneError as error:
        mistakes += error.mistakes
    if mistakes:
        raise SceneError(mistakes)
    return Study(changed, tuple(v.name for v in plan.varied), computed, allow_code), plan


def _ensemble(study: Study, announce: Callable[[str], None] | None) -> Ensemble:
    """The ensemble of a study; wrong names and wrong outputs are reported together."""
    try:
        return Ensemble(study, announce)
    except SceneError as error:
        mistakes = error.mistakes
    if all(mistake.key == "vary" for mistake in mistakes):
        try:
            Ensemble(attrs.evolve(study, names=(), gradients=False))
        except SceneError as error:
            mistakes = (*mistakes, *error.mistakes)
    raise SceneError(mistakes)


def _check_names(ensemble: Ensemble, plan: Design, *, in_file: bool) -> None:
    """Refuse labels that are taken, fractions of integers, and names that no file takes."""
    names = [parameter.name for parameter in ensemble.parameters]
    labels = [output.name for output in ensemble.outputs]
    what = "this is the name of a number that varies; take another label"
    mistakes = [Mistake("outputs", name, what) for name in labels if name in names]
    twice = dict.fromkeys(name for name in labels if labels.count(name) > 1)
    mistakes += [Mistake("outputs", name, "an output is named once only") for name in twice]
    for parameter, varied in zip(ensemble.parameters, plan.varied, strict=True):
        values = varied.values
        if parameter.whole and (values is None or not np.all(values == np.round(values))):
            what = "this is a whole number; list whole values"
            mistakes.append(Mistake(f"vary {parameter.name}", varied.spec, what))
    if in_file:
        label = 'give it a label, {"label": quantity}, or name it in [outputs] of the scene'
        for key, given, remedy in (
            ("vary", names, "rename it, or make it one of the [parameters]"),
            ("outputs", labels, label),
        ):
            invalid = [name for name in given if not _fits_file(name)]
            mistakes += [Mistake(key, name, INVALID_NAME, remedy=remedy) for name in invalid]
    if mistakes:
        raise SceneError(mistakes)


def _fits_file(name: str) -> bool:
    """True for a valid name of a NetCDF variable."""
    first = name[0]
    return "/" not in name and name == name.strip() and (first.isalnum() or first == "_")


@attrs.frozen(eq=False)
class _Runner:
    """Runs points here or on a cluster; attributes as the arguments of ``sweep``."""

    threads: int | None
    client: Any
    progress: Callable[[int, int], None] | None
    announce: Callable[[str], None] | None
    force: bool
    resume: bool

    def run(
        self, study: Study, plan: Design, output: str | os.PathLike[str] | None
    ) -> "xarray.Dataset":
        """Run the points of a study that are missing, and store their outputs."""
        self._check_options(output)
        ensemble = _ensemble(study, self.announce)
        _check_names(ensemble, plan, in_file=output is not None)
        if not self.force:
            series = [o for o in ensemble.outputs if o.reduction == "series"]
            width = 8 * (len(ensemble.outputs) + len(series) * (len(ensemble.times) - 1))
            width *= 1 + len(plan.varied) * ensemble.study.gradients
            # in addition status and note; in memory the points, three times while they are drawn
            width += 1 + (NOTE if output is not None else 8 + 3 * 8 * len(plan.varied))
            check_room_of_points(plan.size, width, output)
        if self.client is None:
            ensemble.prepare()
        points = plan.points()
        layout = layout_of(ensemble, plan, points)
        store: InMemory | SweepFile = InMemory(layout)
        if output is not None:
            store = SweepFile(layout, output, force=self.force, resume=self.resume)
        try:
            self._run_points(ensemble, points, store)
            store.finish()
        except BaseException as error:
            with suppress(ResultError):
                store.leave()
                Computed(store.dataset()).attach(error)
            raise
        return store.dataset()

    def _check_options(self, output: str | os.PathLike[str] | None) -> None:
        mistakes = []
        if self.resume and output is None:
            what = "a sweep is resumed from the part of its file"
            mistakes.append(Mistake("resume", True, what, remedy="give output"))
        if self.client is not None and self.threads is not None:
            what = "threads are of this machine; the workers of a client have their own"
            mistakes.append(Mistake("threads", self.threads, what))
        if mistakes:
            raise SceneError(mistakes)

    def _run_points(self, ensemble: Ensemble, points: Any, store: InMemory | SweepFile) -> None:
        todo, total = store.todo, len(points)
        done = total - len(todo)
        self._report(done, total)
        batches: Any = self._batches(ensemble, points, todo)
        with closing(batches):
            for index, batch in batches:
                store.put(index, batch)
                done += len(index)
                self._report(done, total)

    def _batches(self, ensemble: Ensemble, points: Any, index: Any) -> Iterator[RunPoints]:
        """Outputs of the points as they are computed, here or on a cluster."""
        if self.client is None:
            return run_here(ensemble, points, index, self.threads)
        from dap3d_core.study.workers.dask_cluster import run_on

        return run_on(self.client, ensemble.study, points, index)

    def _report(self, done: int, total: int) -> None:
        if self.progress is not None:
            self.progress(done, total)
