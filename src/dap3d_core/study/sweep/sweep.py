"""The door to a sweep: one scene, run at many combinations of its numbers."""

import os
from collections.abc import Callable
from contextlib import closing, suppress
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.result import ResultError
from dap3d_core.scene import Mistake, Scene, SceneError, check_simulation, load
from dap3d_core.simulation.output.free_space import check_room_of_points
from dap3d_core.study.design import Design, design_of
from dap3d_core.study.outputs import Output, outputs_of
from dap3d_core.study.study import Ensemble, Study
from dap3d_core.study.sweep.dataset import InMemory, layout_of, open_sweep
from dap3d_core.study.sweep.file import Growing
from dap3d_core.study.sweep.schema import NOTE
from dap3d_core.study.workers.threads import run_here

if TYPE_CHECKING:
    import xarray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Larger packs gain nothing, and a hard point would hold up more of the others.
LARGEST_PACK = 1024
#: How a name of a NetCDF variable does not begin, and what it does not hold.
NO_NAME = "a name in a NetCDF file begins with a letter, a digit or _ and holds no slash"


def sweep(
    scene: Scene | str | os.PathLike[str],
    vary: Any,
    *,
    outputs: Any,
    sample: int | None = None,
    design: str = "lhs",
    seed: int = 0,
    t_end: float | None = None,
    dt: float | None = None,
    method: str | None = None,
    integrator: str | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    step: float | None = None,
    correct: bool | None = None,
    project: bool | None = None,
    correct_metric: str | None = None,
    allow_code: bool = False,
    threads: int | None = None,
    client: Any = None,
    pack: int = 1,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    resume: bool = False,
    progress: Callable[[int, int], None] | None = None,
    announce: Callable[[str], None] | None = None,
) -> "xarray.Dataset":
    """Run a scene at many points, combinations of values of its numbers (docs/how-to/sweeps.md).

    They are those of ``simulate`` of the changed scene; remarks in docs/concepts/studies.md.

    Args:
        scene: a Scene, or what ``load`` takes.
        vary: name of a number (``bodies.crank.mass``) -> how it varies: a list or an array of
            numbers, "1:5:9" (from:to:count), "1:100:5:log"; for samples "1:5", "3~0.1" (normal).
        outputs: quantities ("crank.r.z:max"), functions of a ``Result``, or label -> one of these.
        sample, design, seed: number of samples (without: a grid), "lhs", "random", "sobol" or
            "halton", seed.
        t_end, dt, method, integrator, rtol, atol, step, correct, project, correct_metric: as
            ``simulate`` has them; so has it allow_code. announce: as ``compile``.
        threads, client: points at once, or a ``distributed.Client`` whose workers run them.
        pack: points that take their steps together, for speed: equal within the tolerances only.
        output, force, resume: file to write; over another; go on with ``OUTPUT.part``.
        progress: called as progress(done, total).

    Returns:
        the outputs over the numbers, or over ``point``; NaN, ``status``, ``note`` where one failed.

    Raises:
        SceneError, PluginError, SimulationError, ResultError: nothing can be run or kept. What ends
            it later (Ctrl-C, an exception of ``progress``) has the points so far as ``.result``.
    """
    settings = dict(t_end=t_end, dt=dt, method=method, integrator=integrator, rtol=rtol, atol=atol,
                    step=step, correct=correct, project=project,
                    correct_metric=correct_metric)  # fmt: skip
    study, plan = _asked(scene, vary, outputs, (sample, design, seed), settings, allow_code, pack)
    runner = _Runner(threads, client, progress, announce, force=force, resume=resume)
    return runner.run(study, plan, output)


def _asked(
    scene: Any,
    vary: Any,
    outputs: Any,
    sampling: tuple[Any, ...],
    settings: Any,
    allow_code: bool,
    pack: Any,
) -> tuple[Study, Design]:
    """The study and its points, as far as they can be judged before the scene is compiled."""
    mistakes = _pack_mistakes(pack)
    chosen = scene.copy() if isinstance(scene, Scene) else load(scene)
    given = {k: v for k, v in settings.items() if v is not None}
    chosen.simulation = attrs.evolve(chosen.simulation, **given)
    plan: Design | None = None
    kept: tuple[Output, ...] = ()
    try:
        check_simulation(chosen.simulation, chosen.bodies)
    except SceneError as error:  # others are found again with the whole scene, with their lines
        about = given.keys() | ({"step"} if "integrator" in given else set())
        about = about | ({"dt"} if "t_end" in given else set())
        mistakes += [m for m in error.mistakes if m.key in about]
    try:
        plan = design_of(vary, *sampling)
    except SceneError as error:
        mistakes += error.mistakes
    try:
        kept = outputs_of(outputs)
    except SceneError as error:
        mistakes += error.mistakes
    if mistakes or plan is None:
        raise SceneError(mistakes)
    names = tuple(varied.name for varied in plan.varied)
    return Study(chosen, names, kept, allow_code, pack), plan


def _pack_mistakes(pack: Any) -> list[Mistake]:
    if isinstance(pack, int) and not isinstance(pack, bool) and 1 <= pack <= LARGEST_PACK:
        return []
    what = f"the points of a pack are a whole number from 1 to {LARGEST_PACK}"
    return [Mistake("pack", pack, what)]


def _ensemble(study: Study, announce: Callable[[str], None] | None) -> Ensemble:
    """What runs the points; names and outputs that are wrong are told together."""
    try:
        return Ensemble(study, announce)
    except SceneError as error:
        mistakes = error.mistakes
    if all(mistake.key == "vary" for mistake in mistakes):
        try:
            Ensemble(attrs.evolve(study, names=()))
        except SceneError as error:
            mistakes = (*mistakes, *error.mistakes)
    raise SceneError(mistakes)


def _check_names(ensemble: Ensemble, plan: Design, *, in_file: bool) -> None:
    """Refuse outputs called like numbers, numbers that are not whole, and names no file takes."""
    names = [number.name for number in ensemble.numbers]
    kept = [output.name for output in ensemble.outputs]
    mistakes = [
        Mistake("outputs", name, "this is the name of a number that varies; take another label")
        for name in kept
        if name in names
    ]
    twice = dict.fromkeys(name for name in kept if kept.count(name) > 1)
    mistakes += [Mistake("outputs", name, "an output is named once only") for name in twice]
    for number, varied in zip(ensemble.numbers, plan.varied, strict=True):
        values = varied.values
        if number.whole and (values is None or not np.all(values == np.round(values))):
            what = "this is a whole number; list whole values"
            mistakes.append(Mistake(f"vary {number.name}", varied.spec, what))
    for key, given in (("vary", names), ("outputs", kept)) if in_file else ():
        remedy = "rename it" if key == "vary" else 'give it a label: {"label": quantity}'
        mistakes += [
            Mistake(key, name, NO_NAME, remedy=remedy) for name in given if not _fits_file(name)
        ]
    if mistakes:
        raise SceneError(mistakes)


def _fits_file(name: str) -> bool:
    """Whether a NetCDF file takes the name of a variable."""
    first = name[0]
    return "/" not in name and name == name.strip() and (first.isalnum() or first == "_")


def _check_room(ensemble: Ensemble, plan: Design, output: str | os.PathLike[str] | None) -> None:
    """Refuse what fits neither into memory nor on the disk."""
    series = [o for o in ensemble.outputs if o.reduction == "series"]
    width = 8 * (len(ensemble.outputs) + len(series) * (len(ensemble.times) - 1))
    # beside the outputs: status and note; in memory the points, while they are drawn three times
    width += 1 + (NOTE if output is not None else 8 + 3 * 8 * len(plan.varied))
    check_room_of_points(plan.size, width, output)


@attrs.frozen(eq=False)
class _Runner:
    """Where points are run, and who is told; as ``sweep`` has them."""

    threads: int | None
    client: Any
    progress: Callable[[int, int], None] | None
    announce: Callable[[str], None] | None
    force: bool
    resume: bool

    def run(
        self, study: Study, plan: Design, output: str | os.PathLike[str] | None
    ) -> "xarray.Dataset":
        """Run the points of a study that are missing, and keep what comes of them."""
        self._refuse(output)
        ensemble = _ensemble(study, self.announce)
        _check_names(ensemble, plan, in_file=output is not None)
        if not self.force:
            _check_room(ensemble, plan, output)
        if self.client is None:
            ensemble.prepare(self.announce)
        points = plan.points()
        layout = layout_of(ensemble, plan, points)
        kept: InMemory | Growing = InMemory(layout)
        if output is not None:
            kept = Growing(layout, output, force=self.force, resume=self.resume)
        try:
            self._go(ensemble, points, kept)
            if isinstance(kept, Growing):
                kept.finish()
        except BaseException as error:
            with suppress(ResultError, AttributeError):
                error.result = _so_far(kept)  # type: ignore[attr-defined]
            raise
        return kept.dataset() if isinstance(kept, InMemory) else open_sweep(kept.target)

    def _refuse(self, output: str | os.PathLike[str] | None) -> None:
        mistakes = []
        if self.resume and output is None:
            what = "a sweep goes on from the part of its file"
            mistakes.append(Mistake("resume", True, what, remedy="give output"))
        if self.client is not None and self.threads is not None:
            what = "threads are of this machine; the workers of a client have their own"
            mistakes.append(Mistake("threads", self.threads, what))
        if mistakes:
            raise SceneError(mistakes)

    def _go(self, ensemble: Ensemble, points: Floats, kept: InMemory | Growing) -> None:
        todo, total = kept.todo, len(points)
        done = total - len(todo)
        self._tell(done, total)
        with closing(self._found(ensemble, points, todo)) as found:
            for places, batch in found:
                kept.put(places, batch)
                done += len(places)
                self._tell(done, total)

    def _found(self, ensemble: Ensemble, points: Floats, places: Integers) -> Any:
        """What comes of the points, here or on a cluster: an iterator of places and batches."""
        if self.client is None:
            return run_here(ensemble, points, places, self.threads)
        from dap3d_core.study.workers.dask_cluster import run_on

        return run_on(self.client, ensemble.study, points, places)

    def _tell(self, done: int, total: int) -> None:
        if self.progress is not None:
            self.progress(done, total)


def _so_far(kept: InMemory | Growing) -> "xarray.Dataset":
    """What a sweep that is ended has computed; its part stays."""
    if isinstance(kept, InMemory):
        return kept.dataset()
    kept.leave()
    return open_sweep(kept.part)
