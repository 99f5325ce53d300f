"""The data of a page of a sweep: the motions of its points, run again, and what was kept of each.

Numbers of the scene and outputs stand beside the motion of the point that is chosen.
"""

import json
import math
import os
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.result import Result, ResultError, UnknownNameError, find
from dap3d_core.result.file.schema import SWEEP
from dap3d_core.scene import Mistake, SceneError, load, parse
from dap3d_core.simulation import CompiledModel, SimulationError, simulate
from dap3d_core.simulation.output.type_sources import digests_of
from dap3d_core.study import REDUCTIONS, Number, PointStatus, numbers_named, with_values
from dap3d_core.study.sweep.subsample import at_places, evenly
from dap3d_core.view.page_data import page_data
from dap3d_core.view.scene3d.camera import stage

if TYPE_CHECKING:
    import xarray

#: Points of a page at most; and characters of their data, beyond which there are fewer.
MOST_POINTS, MOST_CHARACTERS = 50, 40_000_000
#: Reports of a run whose sweep had reports at its end alone.
REPORTS = 200
#: How points ended, as the page says it.
WORDS = {status.value: status.name.lower() for status in PointStatus}


@attrs.frozen(eq=False)
class Points:
    """The points of a sweep that a page shows.

    Attributes:
        data: the sweep's data set, with these points alone.
        names: of the numbers that vary.
        sampled: whether the points are samples.
        total: how many points the sweep has.
        places: (k,) of samples: their places in the sweep.
    """

    data: "xarray.Dataset"
    names: tuple[str, ...]
    sampled: bool
    total: int
    places: tuple[int, ...] = ()

    @classmethod
    def of(cls, data: "xarray.Dataset", most: int) -> "Points":
        """So many points at most, evenly chosen along each axis; the first and last are there."""
        names = _names(data)
        sampled = "point" in data.dims
        axes = ["point"] if sampled else [n for n in names if n in data.dims]
        sizes = [data.sizes[axis] for axis in axes]
        places = dict(zip(axes, evenly(sizes, most), strict=True))
        shown = tuple(map(int, places["point"])) if sampled else ()
        return cls(at_places(data, places), names, sampled, math.prod(sizes), shown)

    @property
    def axes(self) -> list[str]:
        """What a slider is for."""
        return ["point"] if self.sampled else [n for n in self.names if n in self.data.dims]

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each axis."""
        return tuple(self.data.sizes[axis] for axis in self.axes)

    def __iter__(self) -> Iterator["xarray.Dataset"]:
        """The data sets of the single points, the last axis fastest."""
        for place in np.ndindex(*self.shape):
            yield self.data.isel(dict(zip(self.axes, place, strict=True)))


def _names(data: "xarray.Dataset") -> tuple[str, ...]:
    """Names of the numbers that vary."""
    if SWEEP not in data.attrs:
        raise ValueError(
            f"the data set is of no sweep: it has no attribute {SWEEP}; dap.sweep and "
            "dap.open_sweep give one"
        )
    try:
        names = tuple(str(one["name"]) for one in json.loads(data.attrs["varied"]))
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"the sweep does not say what varies: {error}") from error
    missing = [name for name in names if name not in data.coords]
    if missing:
        raise ValueError(f"the data set has no values of {missing[0]}: no point can be run again")
    return names


def _check_types(data: "xarray.Dataset", compiled: CompiledModel) -> None:
    """Refuse to run points again with other formulas than those of the outputs beside them."""
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


class Runs:
    """The scene of a sweep, whose points are run again.

    Attributes:
        scene: with the settings of the runs.
    """

    def __init__(
        self,
        data: "xarray.Dataset",
        names: Sequence[str],
        model: str | os.PathLike[str] | None,
        allow_code: bool,
        announce: Callable[[str], None] | None,
        between: Callable[[float, float], None] | None = None,
    ) -> None:
        """Check and compile the scene; ``between`` is called now and then during a run.

        Raises:
            SceneError: the scene cannot be used, as where its types are not allowed.
            ResultError: formulas of its types have changed since the sweep.
        """
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
            raise error if model is not None else SceneError(map(_own, error.mistakes)) from error
        _check_types(data, compiled)
        self._registry, self._between = compiled.checked.registry, between
        self._numbers: tuple[Number, ...] = numbers_named(compiled.checked, names)

    def result(self, values: Sequence[float]) -> tuple[Result | None, str]:
        """The result of a point as far as it went, and why it went no further."""
        scene = with_values(self.scene, self._numbers, values)
        try:
            compiled = CompiledModel(scene, registry=self._registry)
            return simulate(compiled, progress=self._between), ""
        except (SceneError, SimulationError) as error:
            return getattr(error, "result", None), " ".join(str(error).split())


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
    """Everything that the page of a sweep knows, ready for JSON: that of one point, and all others.

    Args:
        data: of the sweep.
        quantities: curves that are shown at once; without any those that the sweep kept.
        fps: frames a second.
        model, allow_code: the model whose own types and meshes are used, and whether they may be.
        progress: called as progress(done, total), now and then during runs as well.
        announce: told the names of kernels that are compiled.

    Raises:
        UnknownNameError, ValueError: as ``view``; no point can be run.
        SceneError: the scene of the sweep cannot be used here.
    """
    points = Points.of(data, MOST_POINTS)
    if not math.prod(points.shape):
        raise ValueError("the sweep has no points: there is nothing to show")
    counts = [0, math.prod(points.shape)]

    def tell(*_: float) -> None:
        if progress is not None:
            progress(*counts)

    runs = Runs(data, points.names, model, allow_code, announce, tell)
    pages = _Pages(runs, points.names, quantities, fps)
    first = next((page for page in map(pages.of, points) if page is not None), None)
    if first is None:
        why = next((words for words in pages.faults.values() if words), "")
        raise ValueError(f"there is nothing to show: none of {points.total} points runs: {why}")
    size = len(json.dumps(first))
    points = Points.of(data, max(2, min(MOST_POINTS, MOST_CHARACTERS // size)))
    found: list[dict[str, Any] | None] = []
    counts[1] = math.prod(points.shape)
    for point in points:
        found.append(pages.of(point))
        counts[0] += 1
        tell()
    return _together(points, found, pages)


class _Pages:
    """The data of the pages of single points, each run once."""

    def __init__(
        self, runs: Runs, names: Sequence[str], quantities: Sequence[str], fps: float | None
    ) -> None:
        self._runs, self._names = runs, names
        self._quantities, self._fps = list(quantities), fps
        self._found: dict[tuple[float, ...], dict[str, Any] | None] = {}
        self.faults: dict[tuple[float, ...], str] = {}

    def values(self, point: "xarray.Dataset") -> tuple[float, ...]:
        """The numbers of a point."""
        return tuple(float(point[name].values) for name in self._names)

    def of(self, point: "xarray.Dataset") -> dict[str, Any] | None:
        """Data of a point; None where it does not run."""
        values = self.values(point)
        if values not in self._found:
            result, self.faults[values] = self._runs.result(values)
            there = result is not None and len(result.t)
            self._found[values] = self._page(result, point) if result and there else None
        return self._found[values]

    def _page(self, result: Result, point: "xarray.Dataset") -> dict[str, Any]:
        scene = parse(result.scene_text)
        scene.path = self._runs.scene.path
        names = self._quantities or _kept(result, point)
        return page_data(result, scene, names, self._fps, share=MOST_POINTS)


def _kept(result: Result, point: "xarray.Dataset") -> list[str]:
    """The quantities that the outputs of a sweep are made of."""
    found = []
    for name in map(str, point.data_vars):
        quantity, _, reduction = name.rpartition(":")
        wanted = quantity if reduction in REDUCTIONS else name
        try:
            found.append(find(result, wanted).name)
        except (UnknownNameError, ResultError):
            continue
    return list(dict.fromkeys(found))


def _together(points: Points, pages: list[dict[str, Any] | None], made: _Pages) -> dict[str, Any]:
    """The page of the first point that has one, with those of all."""
    there = [page for page in pages if page is not None]
    common = {"stage": _stage(there), "scales": _scales(there)}
    first = {**there[0], **common}
    data, shown = points.data, math.prod(points.shape)
    outputs = [
        str(n) for n in data.data_vars if n not in ("status", "note") and "time" not in data[n].dims
    ]
    notes = []
    if shown < points.total:
        notes = [f"{shown} of {points.total} points of the sweep are on this page, evenly chosen"]
    sliders = [_slider(points, axis) for axis in points.axes]
    return {
        **first,
        "sweep": {
            "notes": notes,
            "sliders": sliders,
            "numbers": [_about(data, name) for name in points.names],
            "outputs": [_about(data, name) for name in outputs],
            "points": [
                _point(point, page, first, common, outputs, made)
                for point, page in zip(points, pages, strict=True)
            ],
        },
    }


def _slider(points: Points, axis: str) -> dict[str, Any]:
    """A slider along an axis: its values; along samples their places among all."""
    if points.sampled:
        return {"name": axis, "values": list(points.places), "of": points.total}
    return {**_about(points.data, axis), "values": [float(v) for v in points.data[axis].values]}


def _about(data: "xarray.Dataset", name: str) -> dict[str, Any]:
    about = data[name].attrs
    return {
        "name": name,
        "label": str(about.get("long_name", name)),
        "unit": str(about.get("units", "")),
    }


def _point(
    point: "xarray.Dataset",
    page: dict[str, Any] | None,
    first: dict[str, Any],
    common: dict[str, Any],
    outputs: Sequence[str],
    made: _Pages,
) -> dict[str, Any]:
    """What the page says of a point; of its own data what differs from the first point's."""
    values = made.values(point)
    status = int(point["status"].values) if "status" in point else PointStatus.DONE.value
    note = str(point["note"].values) if "note" in point else ""
    own = None
    if page is not None:
        stage_here = {**common["stage"], "gravity": page["stage"]["gravity"]}
        mine = {**page, **common, "stage": stage_here}
        own = {k: v for k, v in mine.items() if v != first[k]}
    return {
        "values": list(values),
        "outputs": [_number(point[name].values) for name in outputs],
        "status": WORDS.get(status, str(status)),
        "note": note or made.faults[values],
        "data": own,
    }


def _number(value: Any) -> float | None:
    number = float(value)
    return number if math.isfinite(number) else None


def _stage(pages: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """One stage for the motions of all points: the camera stays where it is."""
    stages = [page["stage"] for page in pages]
    center, extent = (np.array([s[k] for s in stages]) for k in ("center", "extent"))
    low, high = (center - 0.5 * extent).min(axis=0), (center + 0.5 * extent).max(axis=0)
    farthest = np.concatenate([np.array(s["farthest"]).reshape(-1, 3) for s in stages])
    toward = np.array([stages[0]["eye"], stages[0]["up"]])
    sides = np.concatenate([np.eye(3), toward, np.cross(toward[:1], toward[1:])])
    places = farthest @ np.concatenate([sides, -sides]).T
    farthest = farthest[np.unique(places.argmax(axis=0))]
    found = stage((low, high, farthest), stages[0]["gravity"])  # type: ignore[arg-type]
    return {**found, "unit": float(np.median([s["unit"] for s in stages]))}


def _scales(pages: Sequence[dict[str, Any]]) -> dict[str, float]:
    """One scale for the arrows of all points: the longest one stays on the page."""
    kinds = [{arrow["what"] for arrow in page["arrows"]} for page in pages]
    return {
        what: min(
            (p["scales"][what] for p, kind in zip(pages, kinds, strict=True) if what in kind),
            default=1.0,
        )
        for what in ("force", "moment")
    }
