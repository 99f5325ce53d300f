"""The data set of a sweep: what its dimensions, variables and attributes are, and how it is read.

Of a grid there is a dimension for each number that varies, called by its name; of samples there is
``point``, along which the numbers are coordinates. Outputs are variables called by their names;
series have ``time`` as their last dimension. Derivatives, ``d NAME``, have ``parameter`` behind.
"""

import json
import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, TypeVar

import attrs
import numpy as np
import xarray  # noqa: TID253, this module is loaded where there is a data set

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.registry.arguments import checked
from dap3d_core.result import ResultError, current_versions
from dap3d_core.result.arrays import LARGE
from dap3d_core.result.file.checksum import check_checksums, check_signature
from dap3d_core.result.file.library import opened, reading, unreadable
from dap3d_core.result.file.schema import SWEEP, about
from dap3d_core.result.file.validate import check_claims
from dap3d_core.result.metadata import to_json
from dap3d_core.scene.display import html_table
from dap3d_core.simulation.output.type_sources import digests_of
from dap3d_core.study.design import Design
from dap3d_core.study.ensemble import Ensemble
from dap3d_core.study.study import Batch, PointStatus, derivative_name

Read = TypeVar("Read")

#: Version of the format, raised when an older reader would misread it.
FORMAT = 1
#: Dimension of the parameters of derivatives.
PARAMETER = "parameter"
#: Seconds that a reader waits for who writes the file.
PATIENCE = 1.0
#: Attributes whose text is JSON.
JSON = ("varied", "outputs", "versions")
ABOUT_STATUS = {
    "long_name": "how the run at the point ended",
    "units": "1",
    "flag_values": np.array([status.value for status in PointStatus], dtype=np.int8),
    "flag_meanings": " ".join(status.name.lower() for status in PointStatus),
}
ABOUT_NOTE = {"long_name": "what there is to say of the point", "units": "1"}


#: Variables of up to so many bytes are read whole: single values from a file take far longer.
READ_WHOLE = 2**30


@attrs.frozen(eq=False)
class Variable:
    """A variable of a data set: name, dimensions, attributes."""

    name: str
    dimensions: tuple[str, ...]
    about: dict[str, Any]


@attrs.frozen(eq=False)
class Coordinate(Variable):
    """One whose values are known from the start."""

    values: Floats


@attrs.frozen(eq=False)
class SweepLayout:
    """Layout of the data set of a sweep, without the values that its runs give.

    Attributes:
        sizes: length of each dimension, ``time`` last where there is a series.
        dimensions: those of the points.
        coordinates: the numbers that vary, and ``time``.
        outputs: what is kept of each run.
        attributes: of the data set.
    """

    sizes: dict[str, int]
    dimensions: tuple[str, ...]
    coordinates: tuple[Coordinate, ...]
    outputs: tuple[Variable, ...]
    attributes: dict[str, Any]

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the points."""
        return tuple(self.sizes[name] for name in self.dimensions)

    @property
    def count(self) -> int:
        """Number of points."""
        return int(np.prod(self.shape))

    @property
    def width(self) -> int:
        """Numbers that are kept of one point."""
        of_point = len(self.dimensions)
        return int(sum(np.prod(self.shape_of(o)[of_point:]) for o in self.outputs))

    def shape_of(self, variable: Variable) -> tuple[int, ...]:
        """The shape of a variable."""
        return tuple(self.sizes[name] for name in variable.dimensions)


def layout_of(ensemble: Ensemble, design: Design, points: Floats) -> SweepLayout:
    """The layout of a sweep.

    Args:
        ensemble: what runs the points.
        design: which points there are.
        points: (N, numbers) the values of the numbers.
    """
    sampled = design.count is not None
    values = list(points.T) if sampled else design.axes
    coordinates = [
        Coordinate(
            number.name,
            design.dimensions if sampled else (number.name,),
            {"long_name": number.name, "units": number.unit},
            axis,
        )
        for number, axis in zip(ensemble.parameters, values, strict=True)
    ]
    sizes = dict(zip(design.dimensions, design.shape, strict=True))
    if any(output.reduction == "series" for output in ensemble.outputs):
        sizes["time"] = len(ensemble.times)
        coordinates.append(Coordinate("time", ("time",), about("s", "time"), ensemble.times))
    outputs = [
        Variable(
            output.name,
            (*design.dimensions, "time") if output.reduction == "series" else design.dimensions,
            about(ensemble.units[output.name], ensemble.labels[output.name]),
        )
        for output in ensemble.outputs
    ]
    if ensemble.study.gradients:
        sizes[PARAMETER] = len(ensemble.parameters)
        for o in outputs.copy():
            unit, label = o.about.get("units", "1"), o.about["long_name"]
            about_it = about(f"{unit} per unit of parameter", f"derivative of {label}")
            dimensions = (*o.dimensions, PARAMETER)
            outputs.append(Variable(derivative_name(o.name), dimensions, about_it))
    about_all = _attributes(ensemble, design, outputs)
    return SweepLayout(sizes, design.dimensions, tuple(coordinates), tuple(outputs), about_all)


def _attributes(
    ensemble: Ensemble, design: Design, variables: Sequence[Variable]
) -> dict[str, Any]:
    scene = ensemble.compiled.scene
    varied = [{"name": v.name, "spec": v.spec} for v in design.varied]
    outputs = [
        {"name": v.name, "label": v.about["long_name"], "unit": v.about.get("units", "")}
        for v in variables
    ]
    found: dict[str, Any] = {
        SWEEP: np.int32(FORMAT),
        "model": str(scene.name).replace("\0", ""),
        "scene": ensemble.requested.scene.to_toml(),
        "varied": to_json(varied),
        "outputs": to_json(outputs),
        "design": design.name,
        "types": to_json(digests_of(ensemble.compiled.checked)),
        "versions": to_json(current_versions()),
    }
    return found if design.seed is None else found | {"seed": np.int64(design.seed)}


class InMemory:
    """The points of a sweep in memory.

    Attributes:
        layout: of the data set.
    """

    def __init__(self, layout: SweepLayout) -> None:
        self.layout = layout
        count = layout.count
        self._status = np.zeros(count, dtype=np.int8)
        self._notes = np.full(count, "", dtype=object)
        self._values = {o.name: np.full(layout.shape_of(o), np.nan) for o in layout.outputs}

    @property
    def todo(self) -> Integers:
        """The points that are still to be run."""
        return np.flatnonzero(self._status == PointStatus.OPEN)

    def put(self, places: Integers, batch: Batch) -> None:
        """Store the results of some points."""
        for name, whole in self._values.items():
            values = batch.values[name]
            whole.reshape(len(self._status), *values.shape[1:])[places] = values
        self._notes[places] = batch.notes
        self._status[places] = batch.status

    def finish(self) -> None:
        """As of ``SweepFile``: there is nothing to write."""

    leave = finish

    def dataset(self) -> "xarray.Dataset":
        """Content so far."""
        layout = self.layout
        shape, dimensions = layout.shape, layout.dimensions
        variables = {o.name: (o.dimensions, self._values[o.name], o.about) for o in layout.outputs}
        variables["status"] = (dimensions, self._status.reshape(shape), ABOUT_STATUS)
        variables["note"] = (dimensions, self._notes.reshape(shape), ABOUT_NOTE)
        coordinates = {c.name: (c.dimensions, c.values, c.about) for c in layout.coordinates}
        return _with_names(Sweep(variables, coordinates, layout.attributes))


@checked
def open_sweep(path: str | os.PathLike[str]) -> "xarray.Dataset":
    """Read what ``sweep`` wrote.

    Args:
        path: its file; also ``NAME.part`` of a sweep that has not ended, whose ``status`` says
            which points are there.

    Returns:
        The data set as ``sweep`` gives it. Variables of a large one stay in the file until they
        are requested.

    Raises:
        ResultError: there is no such file, it is no sweep, damaged, or of a newer dap3d.
    """
    file = Path(path)
    check_signature(file, "sweep")
    return _patiently(file, _opened)


def _patiently(file: Path, read: Callable[[Path], Read]) -> Read:
    """Read a file; one that grows is tried again for a while, for it may be written just now."""
    grows = file.suffix.startswith(".part")
    until = time.monotonic() + (PATIENCE if grows else 0.0)
    while True:
        try:
            return read(file)
        except ResultError:
            if time.monotonic() > until:
                raise
            time.sleep(0.02)


def _opened(file: Path) -> "xarray.Dataset":
    """Content of a file."""
    import xarray

    check_checksums(file)
    with reading(file):
        with opened(file) as dataset:
            check_format(file, dataset)
            check_claims(file, dataset)
        found = xarray.open_dataset(
            file, engine="netcdf4", decode_times=False, decode_timedelta=False
        )
        found = found.set_coords([name for name in varied_of(found) if name in found])
        found = found.drop_encoding()  # how a file holds it is no property of the data
        if found.nbytes <= LARGE:
            with found:
                found.load()
    sweep = _with_names(Sweep(found.data_vars, found.coords, found.attrs))
    sweep.set_close(found.close)
    return sweep


def _with_names(sweep: "Sweep") -> "Sweep":
    """A sweep whose dimension of derivatives has the names of the parameters."""
    if PARAMETER not in sweep.dims:
        return sweep
    return sweep.assign_coords({PARAMETER: list(varied_of(sweep))})


def varied_of(data: "xarray.Dataset") -> dict[str, Any]:
    """Name of each number that varies in a sweep, and how it was given.

    Raises:
        ValueError: the data set is of no sweep.
    """
    if SWEEP not in data.attrs:
        raise ValueError(
            f"the data set is of no sweep: it has no attribute {SWEEP}; dap.sweep and "
            "dap.open_sweep give one (keep_attrs=True keeps attributes in xarray)"
        )
    try:
        return {str(one["name"]): one.get("spec", "") for one in json.loads(data.attrs["varied"])}
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"the sweep does not say what varies: {error}") from error


def is_sweep(path: str | os.PathLike[str]) -> bool:
    """True if the file exists and is that of a sweep."""

    def has_points(file: Path) -> bool:
        check_checksums(file)
        with reading(file), opened(file) as dataset:
            return SWEEP in dataset.ncattrs()

    try:
        check_signature(Path(path))
        return _patiently(Path(path), has_points)
    except ResultError:
        return False


def check_format(file: Path, dataset: Any) -> None:
    """Refuse a file that is no sweep of a version that this program reads.

    Raises:
        ResultError: says what it is.
    """
    names = dataset.ncattrs()
    if SWEEP not in names:
        what = "a NetCDF-4 file, but no sweep of dap3d"
        if "Conventions" in names and dataset.getncattr("Conventions") == "dap3d-result":
            what = "it is the result of one run, not of a sweep; dap.open reads it"
        raise ResultError(f"cannot read {file}: {what}")
    try:
        found = int(dataset.getncattr(SWEEP))
    except (TypeError, ValueError) as error:
        raise unreadable(file, error) from error
    if found > FORMAT:
        raise ResultError(
            f"cannot read {file}: a newer dap3d wrote it in format {found}, this program reads up "
            f"to {FORMAT}; install a newer dap3d"
        )
    missing = [n for n in (*JSON, "scene", "design", "model") if n not in names]
    missing += [n for n in ("status", "note") if n not in dataset.variables]
    if missing:
        raise unreadable(file, ValueError(f"it has no {missing[0]}"))


class Sweep(xarray.Dataset):  # type: ignore[no-untyped-call]
    """An ``xarray.Dataset`` that shows itself as one line, and in a notebook as two tables.

    Selections of it are of this class, too. What is no sweep any more, such as sums without
    attributes, is shown as xarray does.
    """

    __slots__ = ()

    def __repr__(self) -> str:
        words = self._words()
        return super().__repr__() if words is None else f"<Sweep {words}>"

    def _repr_html_(self) -> str:
        """The numbers that vary and the outputs; all text in them is escaped."""
        words = self._words()
        if words is None:
            return str(super()._repr_html_())
        numbers = [
            (name, self[name].attrs.get("units", ""), self[name].size, *_ends(self[name].values))
            for name in self._varied()
        ]
        outputs = [
            (name, one.attrs.get("units", ""), " x ".join(map(str, one.dims)) or "one point")
            for name, one in self.data_vars.items()
            if name not in ("status", "note")
        ]
        return (
            f"<p><strong>{escape(f'Sweep {words}')}</strong></p>"
            f"{html_table(('number', 'unit', 'values', 'least', 'largest'), numbers)}"
            f"{html_table(('output', 'unit', 'along'), outputs)}"
        )

    def _words(self) -> str | None:
        """Scene, points and how they ended, outputs; None where this is no sweep any more."""
        if SWEEP not in self.attrs or "status" not in self.data_vars:
            return None
        status = self["status"]
        sizes = " x ".join(map(str, status.shape)) or "1"
        along = f" ({', '.join(self._varied())})" if self._varied() else ""
        counts = [(int(np.sum(status.values == s.value)), s.name.lower()) for s in PointStatus]
        ended = ", ".join(f"{n} {word}" for n, word in counts if n) or "none"
        outputs = ", ".join(str(n) for n in self.data_vars if n not in ("status", "note"))
        return f"{self.attrs.get('model', '')!r}: {sizes} points{along}, {ended}; {outputs}"

    def _varied(self) -> list[str]:
        """Names of the numbers that vary here."""
        try:
            return [name for name in varied_of(self) if name in self.coords]
        except ValueError:
            return []


def _ends(values: Any) -> tuple[Any, Any]:
    """The least and the largest value, as text."""
    if not values.size:
        return "", ""
    return f"{np.min(values):.6g}", f"{np.max(values):.6g}"


def at_places(data: "xarray.Dataset", places: Mapping[str, Integers]) -> "xarray.Dataset":
    """A data set at some indices along its dimensions."""

    def subset(array: "xarray.DataArray") -> "xarray.DataArray":
        index = {axis: k for axis, k in places.items() if axis in array.dims}
        return (array.compute() if array.nbytes <= READ_WHOLE else array).isel(index)

    return data.map(subset, keep_attrs=True)


def evenly(shape: Sequence[int], most: int) -> list[Integers]:
    """Indices along each axis with at most ``most`` combinations (1 or more), (k,) rising.

    No axis keeps more indices than the longest that is shortened; the first and the last index of
    an axis are among them where it keeps two or more.
    """
    low, high = 1, max(shape, default=1)
    while low < high:
        cap = (low + high + 1) // 2
        fits = math.prod(min(length, cap) for length in shape) <= most
        low, high = (cap, high) if fits else (low, cap - 1)
    return [
        np.unique(np.linspace(0, length - 1, min(length, low)).round().astype(np.int64))
        for length in shape
    ]
