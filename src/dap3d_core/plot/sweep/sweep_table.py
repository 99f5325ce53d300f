"""The data set of a sweep as plots need it: its numbers, its outputs, the status of its points."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.model.groups import Floats
from dap3d_core.plot.style import unit_text
from dap3d_core.registry.suggestions import nearest
from dap3d_core.result import UnknownNameError
from dap3d_core.study import REDUCTIONS, PointStatus
from dap3d_core.study.sweep.dataset import at_places, evenly, varied_of

if TYPE_CHECKING:
    import xarray

#: Dimensions that are no varied number.
POINT, TIME = "point", "time"
#: Values that reach so far, greatest over least, lie on a log scale when their logarithmic steps
#: differ by less than this, relative.
LOG_SCALE_RATIO, EVEN = 10.0, 1e-6
#: Names that an error lists.
LISTED = 12
#: Status of a point with a result: outputs of other points are not drawn as values.
DONE = PointStatus.DONE.value


@attrs.frozen(eq=False)
class Variable:
    """A number or an output: its name in the data set, label and unit of its axis, values."""

    name: str
    label: str
    unit: str
    values: Floats
    is_log: bool = False


@attrs.frozen(eq=False)
class Table:
    """A sweep, or a part of it.

    Attributes:
        data: its data set, without dimensions of one value.
        sampled: True where its points are samples.
        numbers, outputs: names of the numbers that still vary, and of the outputs.
        words: title, and what was cut or left out.
    """

    data: "xarray.Dataset"
    sampled: bool
    numbers: tuple[str, ...]
    outputs: tuple[str, ...]
    words: tuple[str, ...]

    @property
    def status(self) -> NDArray[np.int8]:
        """Status of each point, over the axes of the numbers."""
        if "status" in self.data:
            status = self.data["status"].transpose(*self.dimensions, missing_dims="ignore")
            return np.asarray(status.values).reshape(self.shape)
        return np.full(self.shape, DONE, dtype=np.int8)

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Dimensions of the points."""
        return (POINT,) if self.sampled else self.numbers

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each dimension."""
        return tuple(self.data.sizes.get(d, 1) for d in self.dimensions)

    @property
    def size(self) -> int:
        """Number of points."""
        return math.prod(self.shape)

    def check(self, output: str) -> None:
        """Refuse a name of no output: an UnknownNameError names the nearest."""
        if output not in self.outputs:
            raise unknown("output", output, self.outputs)

    def default_outputs(self, x: str | None) -> tuple[str, ...]:
        """The outputs that are drawn where none is named: no series, unless over time."""
        return tuple(n for n in self.outputs if x is None or not self.is_series(n))

    def is_series(self, name: str) -> bool:
        """True for an output with a value at each instant."""
        return TIME in self.data[name].dims

    def number(self, name: str) -> Variable:
        """A varied number, an axis of a grid or over all samples; also ``time``."""
        values = np.asarray(self.data[name].values, dtype=float)
        unit = self.data[name].attrs.get("units", "")
        return Variable(name, name, unit, values, self._is_log(name, values))

    def output(self, name: str) -> Variable:
        """An output (points..., [time]); NaN where the run did not go to its end."""
        about = self.data[name].attrs
        ordered = self.data[name].transpose(*self.dimensions, ..., missing_dims="ignore")
        shape = (*self.shape, self.data.sizes[TIME]) if self.is_series(name) else self.shape
        values = np.array(ordered.values, dtype=float).reshape(shape)
        values[~np.isfinite(values)] = np.nan
        if not self.is_series(name):
            values[self.status != DONE] = np.nan
        label = str(about.get("long_name", name))
        word = name.rpartition(":")[2]
        if ":" in name and word in REDUCTIONS and word != "series":
            label = f"{label}, {word}"
        return Variable(name, label, str(about.get("units", "")), values)

    def flat(self, name: str) -> Variable:
        """A number or an output over all points in one row (n,)."""
        if name in self.outputs:
            output = self.output(name)
            return attrs.evolve(output, values=output.values.ravel())
        number = self.number(name)
        if self.sampled or not self.numbers:
            return number
        axes = [self.number(n).values for n in self.numbers]
        grid = np.meshgrid(*axes, indexing="ij")[self.numbers.index(name)]
        return attrs.evolve(number, values=grid.ravel())

    def thinned(self, most: int) -> "Table":
        """The table with so many points at most, evenly chosen; its ``words`` say so."""
        if self.size <= most:
            return self
        chosen = zip(self.dimensions, evenly(self.shape, most), strict=True)
        index = {axis: k for axis, k in chosen if axis in self.data.dims}
        fewer = attrs.evolve(self, data=at_places(self.data, index))
        return attrs.evolve(fewer, words=(*self.words, f"{fewer.size} of {self.size} points"))

    def _is_log(self, name: str, values: Floats) -> bool:
        """True for a number that varies evenly in its logarithm."""
        spec = varied_of(self.data).get(name, "")
        if isinstance(spec, str) and spec.replace(" ", "").endswith(":log"):
            return bool(np.all(values > 0.0))
        if self.sampled or name == TIME or len(values) < 3 or np.any(values <= 0.0):
            return False
        if values[-1] < LOG_SCALE_RATIO * values[0]:
            return False
        steps = np.diff(np.log(values))
        return bool(np.ptp(steps) <= EVEN * np.abs(steps).max())


def table_of(data: "xarray.Dataset", at: Mapping[str, float] | None = None) -> Table:
    """The table of a data set.

    Args:
        data: of a sweep, perhaps with points chosen by xarray.
        at: dimension -> value; the nearest one remains.

    Raises:
        ValueError: this is no sweep, it has no points, or a value is not finite.
        UnknownNameError: the sweep has no such dimension.
    """
    varied = [name for name in varied_of(data) if name in data.coords]
    sampled = POINT in data.dims
    cut, words = _cut(data, at or {}, varied, sampled)
    for name in varied:
        if name in cut.dims and cut.sizes[name] == 1:
            cut = cut.isel({name: 0})
    if 0 in cut.sizes.values():
        raise ValueError("the sweep has no points: there is nothing to draw")
    alone = [n for n in varied if n not in cut.dims and not cut[n].ndim]
    words += [f"{n} = {float(cut[n]):.6g}{_unit(cut, n)}" for n in alone]
    dimensions = [n for n in varied if n in cut.dims]
    if not sampled:
        unsorted = [n for n in dimensions if np.any(np.diff(cut[n].values) < 0.0)]
        cut = cut.sortby(unsorted) if unsorted else cut
        if not dimensions and varied:  # a single point is drawn over its last number
            cut, dimensions = cut.expand_dims(varied[-1]), [varied[-1]]
            words = [w for w in words if not w.startswith(f"{varied[-1]} = ")]
    numbers = tuple(n for n in varied if n in cut.coords) if sampled else tuple(dimensions)
    title = str(data.attrs.get("model", ""))
    others = ("status", "note")
    outputs = tuple(
        str(n) for n in cut.data_vars if n not in others and "parameter" not in cut[n].dims
    )
    return Table(cut, sampled, numbers, outputs, tuple(w for w in (title, *words) if w))


def _cut(
    data: "xarray.Dataset", at: Mapping[str, float], varied: Sequence[str], sampled: bool
) -> tuple["xarray.Dataset", list[str]]:
    """The data set at the values nearest to ``at``, and words for it."""
    words = []
    axes = [n for n in (*varied, TIME) if n in data.dims]
    for name, value in at.items():
        if name in varied and sampled:
            raise ValueError(
                f"samples have no axes: {name} cannot be held at {value:g}; x = {name} draws "
                "outputs over it"
            )
        if name not in axes:
            raise unknown("dimension", name, axes)
        if not math.isfinite(value):
            raise ValueError(f"{name} = {value} is no value to cut at")
        data = data.isel({name: int(np.argmin(np.abs(data[name].values - value)))})
        if name == TIME:
            words.append(f"t = {float(data[TIME]):.6g} s")
    return data, words


def _unit(data: "xarray.Dataset", name: str) -> str:
    unit = data[name].attrs.get("units", "")
    return f" {unit_text(unit)[1:-1]}" if unit not in ("", "1") else ""


def unknown(what: str, name: str, known: Sequence[str]) -> UnknownNameError:
    """The error for a name that a sweep does not have; lists the names that it has."""
    shown = ", ".join(known[:LISTED]) + (", ..." if len(known) > LISTED else "")
    words = f"the sweep has no {what} {name!r}" + (f" ({what}s: {shown})" if known else "")
    return UnknownNameError(words, nearest(name, known))
