"""The data of a page of a sweep: motions of its points, run again, with numbers and outputs."""

import json
import math
import os
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.result import Computed, Result, ResultError, UnknownNameError, find
from dap3d_core.scene import Mistake, SceneError, load, parse
from dap3d_core.simulation import CompiledModel, SimulationError, simulate
from dap3d_core.simulation.output.type_sources import digests_of
from dap3d_core.study import REDUCTIONS, PointStatus, SceneParameter, parameters_named, with_values
from dap3d_core.study.sweep.dataset import at_places, evenly, varied_of
from dap3d_core.view.page_data import page_data
from dap3d_core.view.scene3d.sampled_motion import Extent, stage

if TYPE_CHECKING:
    import xarray

#: Points of a page at most; and characters of their data, beyond which there are fewer.
MOST_POINTS, MOST_CHARACTERS = 50, 40_000_000
#: Reported instants of a run where the sweep reported at its end alone.
REPORTS = 200
#: Status of a point -> word on the page.
WORDS = {status.value: status.name.lower() for status in PointStatus}


def _check_types(data: "xarray.Dataset", compiled: CompiledModel) -> None:
    """Refuse to run points again with other formulas than those of the stored outputs."""
    try:
        known = dict(json.loads(data.attrs.get("types", "{}")))
    except (TypeError, ValueError) as error:
        raise ResultError(f"the sweep does not say which types it used: {error}") from error
    here = digests_of(compiled.checked)
    changed = [name for name, digest in known.items() if here.get(name) != digest]
    if changed:
        raise ResultError(
            f"the formulas of {', '.join(changed)} have changed since the sweep: its points cannot "
            "be run again with them. Bring back the files of these types, or run the sweep again"
        )


@attrs.frozen(eq=False)
class SweepPoints:
    """The points of a sweep that a page shows.

    Attributes:
        data: the sweep's data set, reduced to these points.
        names: of the numbers that vary.
        sampled: True where the points are samples.
        total: number of points of the sweep.
        samples: (k,) indices of samples in the sweep.
    """

    data: "xarray.Dataset"
    names: tuple[str, ...]
    sampled: bool
    total: int = 0
    samples: tuple[int, ...] = ()

    @classmethod
    def of(cls, data: "xarray.Dataset", most: int) -> "SweepPoints":
        """So many points at most, evenly chosen along each axis, with the first and the last."""
        every = cls(data, tuple(varied_of(data)), "point" in data.dims)
        missing = [name for name in every.names if name not in data.coords]
        if missing:
            what = f"the data set has no values of {missing[0]}: no point can be run again"
            raise ValueError(what)
        index = dict(zip(every.axes, evenly(every.shape, most), strict=True))
        samples = tuple(map(int, index.get("point", ())))
        return attrs.evolve(every, data=at_places(data, index), total=every.count, samples=samples)

    @property
    def axes(self) -> list[str]:
        """The dimensions, each of which has a slider."""
        return ["point"] if self.sampled else [n for n in self.names if n in self.data.dims]

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each axis."""
        return tuple(self.data.sizes[axis] for axis in self.axes)

    @property
    def count(self) -> int:
        """Number of points."""
        return math.prod(self.shape)

    def __iter__(self) -> Iterator["xarray.Dataset"]:
        """The data sets of the single points, the last axis fastest."""
        for index in np.ndindex(*self.shape):
            yield self.data.isel(dict(zip(self.axes, index, strict=True)))


class SweepRuns:
    """The scene of a sweep, whose points are run again; ``between`` is called during runs."""

    def __init__(
        self,
        data: "xarray.Dataset",
        names: Sequence[str],
        model: str | os.PathLike[str] | None,
        allow_code: bool,
        announce: Callable[[str], None] | None,
        between: Callable[[float, float], None] | None = None,
    ) -> None:
        """Check and compile the scene; a SceneError where its types are not allowed here."""
        self.scene = parse(str(data.attrs.get("scene", "")))
        if model is not None:
            self.scene.path = load(model).path
        settings = self.scene.simulation
        at_end = not settings.dt or (settings.t_end and settings.dt >= settings.t_end)
        if at_end and settings.t_end and "simulation.dt" not in names:
            settings.dt = settings.t_end / REPORTS
        try:
            compiled = CompiledModel(self.scene, allow_code=allow_code, announce=announce)
        except SceneError as error:
            if model is not None:
                raise
            raise SceneError(map(_own, error.mistakes)) from error
        _check_types(data, compiled)
        self._registry, self._between = compiled.checked.registry, between
        self._numbers: tuple[SceneParameter, ...] = parameters_named(compiled.checked, names)

    def result(self, values: Sequence[float]) -> tuple[Result | None, str]:
        """The result of a point, perhaps a part of it, and why it went no further."""
        scene = with_values(self.scene, self._numbers, values)
        try:
            compiled = CompiledModel(scene, registry=self._registry)
            return simulate(compiled, progress=self._between), ""
        except (SceneError, SimulationError) as error:
            return Computed.of(error).result, " ".join(str(error).split())


def _own(mistake: Mistake) -> Mistake:
    """An unknown type may be one of a model's own, which a sweep does not hold."""
    if not str(mistake.key).endswith(".type"):
        return mistake
    remedy = "a type of the model's own needs the model: --model MODEL --allow-code (model=)"
    return attrs.evolve(mistake, remedy=remedy)


def sweep_data(
    data: "xarray.Dataset",
    quantities: Sequence[str],
    fps: float | None,
    *,
    model: str | os.PathLike[str] | None = None,
    allow_code: bool = False,
    progress: Callable[[int, int], None] | None = None,
    announce: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """The data of the page of a sweep, ready for JSON: that of one point, and of all others.

    Args:
        data: of the sweep.
        quantities: curves that are shown at first; by default those of the sweep's outputs.
        fps: frames a second.
        model, allow_code: the model whose own types and meshes are used, and permission for them.
        progress: called as progress(done, total), repeatedly during runs as well.
        announce: called with the names of kernels that are compiled.

    Raises:
        UnknownNameError, ValueError: as ``view``; no point can be run.
        SceneError: the scene of the sweep cannot be used here.
    """
    points = SweepPoints.of(data, MOST_POINTS)
    if not points.count:
        raise ValueError("the sweep has no points: there is nothing to show")
    counts = [0, points.count]

    def report(*_: float) -> None:
        if progress is not None:
            progress(*counts)

    runs = SweepRuns(data, points.names, model, allow_code, announce, report)
    pages = _PointPages(runs, points.names, quantities, fps)
    first = next((page for page in map(pages.of, points) if page is not None), None)
    if first is None:
        why = next((fault for fault in pages.faults.values() if fault), "")
        raise ValueError(f"there is nothing to show: none of {points.total} points runs: {why}")
    size = len(json.dumps(first))
    points = SweepPoints.of(data, max(2, min(MOST_POINTS, MOST_CHARACTERS // size)))
    made: list[dict[str, Any] | None] = []
    counts[1] = points.count
    for point in points:
        made.append(pages.of(point))
        counts[0] += 1
        report()
    return _joined(points, made, pages)


class _PointPages:
    """The data of the pages of single points, each run once; ``faults`` by the point's values."""

    def __init__(
        self, runs: SweepRuns, names: Sequence[str], quantities: Sequence[str], fps: float | None
    ) -> None:
        self._runs, self._names = runs, names
        self._quantities, self._fps = list(quantities), fps
        self._pages: dict[tuple[float, ...], dict[str, Any] | None] = {}
        self.faults: dict[tuple[float, ...], str] = {}

    def values(self, point: "xarray.Dataset") -> tuple[float, ...]:
        """The numbers of a point."""
        return tuple(float(point[name].values) for name in self._names)

    def of(self, point: "xarray.Dataset") -> dict[str, Any] | None:
        """Data of a point; None where it does not run."""
        values = self.values(point)
        if values not in self._pages:
            page = None
            result, self.faults[values] = self._runs.result(values)
            if result is not None and len(result.t):
                scene = parse(result.scene_text).resolved()
                scene.path = self._runs.scene.path
                names = self._quantities or _outputs_of(result, point)
                page = page_data(result, scene, names, self._fps, share=MOST_POINTS)
            self._pages[values] = page
        return self._pages[values]


def _outputs_of(result: Result, point: "xarray.Dataset") -> list[str]:
    """The quantities from which the outputs of a sweep are computed."""
    names = []
    for name in map(str, point.data_vars):
        quantity, _, reduction = name.rpartition(":")
        try:
            names.append(find(result, quantity if reduction in REDUCTIONS else name).name)
        except (UnknownNameError, ResultError):
            continue
    return list(dict.fromkeys(names))


def _joined(
    points: SweepPoints, pages: list[dict[str, Any] | None], made: _PointPages
) -> dict[str, Any]:
    """The page of the first point that has one, with those of all."""
    present = [page for page in pages if page is not None]
    common = {"stage": _stage(present), "scales": _scales(present)}
    first, data = {**present[0], **common}, points.data
    outputs = [
        str(n)
        for n in data.data_vars
        if n not in ("status", "note") and not {"time", "parameter"} & set(data[n].dims)
    ]

    def row(point: "xarray.Dataset", page: dict[str, Any] | None) -> dict[str, Any]:
        """A point; of its page only what differs from the first."""
        values = made.values(point)
        status = int(point["status"].values) if "status" in point else PointStatus.DONE.value
        own = None
        if page is not None:
            own_stage = {**common["stage"], "gravity": page["stage"]["gravity"]}
            own = {**page, **common, "stage": own_stage}
            own = {key: value for key, value in own.items() if value != first[key]}
        return {
            "values": list(values),
            "outputs": [_number(point[name].values) for name in outputs],
            "status": WORDS.get(status, str(status)),
            "note": (str(point["note"].values) if "note" in point else "") or made.faults[values],
            "data": own,
        }

    note = f"{points.count} of {points.total} points of the sweep are on this page, evenly chosen"
    sweep = {
        "notes": [note] if points.count < points.total else [],
        "sliders": [_slider(points, axis) for axis in points.axes],
        "numbers": [_axis(data, name) for name in points.names],
        "outputs": [_axis(data, name) for name in outputs],
        "points": [row(point, page) for point, page in zip(points, pages, strict=True)],
    }
    return {**first, "sweep": sweep}


def _slider(points: SweepPoints, axis: str) -> dict[str, Any]:
    """A slider along an axis: its values; of samples their indices."""
    if points.sampled:
        return {"name": axis, "values": list(points.samples), "of": points.total}
    return {**_axis(points.data, axis), "values": [float(v) for v in points.data[axis].values]}


def _axis(data: "xarray.Dataset", name: str) -> dict[str, Any]:
    about = data[name].attrs
    label, unit = str(about.get("long_name", name)), str(about.get("units", ""))
    return {"name": name, "label": label, "unit": unit}


def _number(value: Any) -> float | None:
    return float(value) if math.isfinite(float(value)) else None


def _stage(pages: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """One stage for the motions of all points: the camera does not move between them."""
    stages = [page["stage"] for page in pages]
    center, extent = (np.array([s[k] for s in stages]) for k in ("center", "extent"))
    low, high = (center - 0.5 * extent).min(axis=0), (center + 0.5 * extent).max(axis=0)
    farthest = np.concatenate([np.array(s["farthest"]).reshape(-1, 3) for s in stages])
    view = np.array([stages[0]["eye"], stages[0]["up"]])
    sides = np.concatenate([np.eye(3), view, np.cross(view[:1], view[1:])])
    distance = farthest @ np.concatenate([sides, -sides]).T
    farthest = farthest[np.unique(distance.argmax(axis=0))]
    common = stage(Extent(low, high, farthest), stages[0]["gravity"])
    return {**common, "unit": float(np.median([s["unit"] for s in stages]))}


def _scales(pages: Sequence[dict[str, Any]]) -> dict[str, float]:
    """One scale for the arrows of all points: the longest one stays on the page."""

    def scale(what: str) -> float:
        shown = (p for p in pages if any(arrow["what"] == what for arrow in p["arrows"]))
        return min((float(page["scales"][what]) for page in shown), default=1.0)

    return {what: scale(what) for what in ("force", "moment")}
