"""Reads and checks measured data: columns of times and of quantities."""

import csv
import io
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.registry.regular_files import read_regular
from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene import MISSING, Mistake

#: Names of the column of times, and entries of a CSV file where nothing was measured.
TIMES = ("t", "time")
EMPTY = ("", "nan", "na", "n/a", "null", "none")


@attrs.frozen(eq=False)
class MeasuredData:
    """Measured quantities, such as those that a fit compares with runs.

    Attributes:
        t: (nt,) times as given, s: in any order, also equal ones.
        values: label -> (nt,) measured, SI; NaN where nothing was measured.
        quantities: label -> name of the quantity in results.
        sigma: label -> (nt,) standard deviations; empty where they are unknown.
        units: label -> unit in the header of a file, where it has one.
    """

    t: Floats
    values: dict[str, Floats]
    quantities: dict[str, str]
    sigma: dict[str, Floats]
    units: dict[str, str] = attrs.field(factory=dict)

    @property
    def count(self) -> int:
        """Number of measured values."""
        return int(sum(np.isfinite(v).sum() for v in self.values.values()))

    def weighted(self, values: Mapping[str, Floats]) -> Floats:
        """Values (..., nt) by label as one vector (..., count), over standard deviations."""
        parts = []
        for label, data in self.values.items():
            measured = np.isfinite(data)
            sigma = self.sigma[label][measured] if self.sigma else 1.0
            parts.append(values[label][..., measured] / sigma)
        return np.concatenate(parts, axis=-1)

    def unlike(self, label: str, unit: str) -> str:
        """What is wrong with the unit in a file of a quantity in another one; "" where they agree.

        unit: of the quantity, "" where it is not known.
        """
        given = self.units.get(label, "")
        if not given or not unit or _plain(given) == _plain(unit):
            return ""
        return f"the file has it in {given}, and it is in {unit}: convert the column"


def _plain(unit: str) -> str:
    """A unit without what people write differently: N*m and N m, m/s² and m/s^2, rad/s and 1/s."""
    for written, plain in (("²", "2"), ("-", "1"), ("rad", "1")):
        unit = unit.replace(written, plain)
    return "".join(c for c in unit if c not in " *·.^")


def is_number(value: Any) -> bool:
    """True for one number that is no truth value."""
    return isinstance(value, (int, float, np.number)) and not isinstance(value, bool)


def read_measured(
    measured: Any, outputs: Any, sigma: Any
) -> tuple[MeasuredData | None, dict[str, str], list[Mistake]]:
    """Measured data as ``fit`` takes them, None with mistakes; label -> quantity; the mistakes."""
    mistakes: list[Mistake] = []
    units: dict[str, str] = {}
    columns = _columns(measured, units, mistakes)
    if mistakes:
        return None, {}, mistakes
    named = [name for name in TIMES if name in columns]
    if not named:
        remedy = f"there are {', '.join(columns)}" if columns else ""
        what = "the times of the measurements are missing: a column called t, in s"
        return None, {}, [Mistake("measured", MISSING, what, remedy=remedy)]
    if units.get(named[0], "") not in ("", "s"):
        what = f"times are in s, and not in {units[named[0]]}: convert the column"
        mistakes.append(Mistake(f"measured.{named[0]}", MISSING, what))
    times = _numbers(named[0], columns.pop(named[0]), mistakes)
    chosen = _chosen(columns, outputs, mistakes)
    values = {label: _numbers(label, columns[label], mistakes) for label in chosen}
    if times is not None:
        bad = times[~(np.isfinite(times) & (times >= 0.0))]
        if len(bad):
            what = "a run begins at t = 0: times are numbers from 0, in s"
            mistakes.append(Mistake(f"measured.{named[0]}", float(bad[0]), what))
        elif not len(times):
            mistakes.append(Mistake("measured", MISSING, "there are no measurements"))
        for label, array in values.items():
            if array is not None and len(array) != len(times):
                what = f"{len(array)} values for {len(times)} times"
                mistakes.append(Mistake(f"measured.{label}", MISSING, what))
    good = {label: v for label, v in values.items() if v is not None}
    for label, data in good.items():
        if np.isinf(data).any():
            what = "not finite; give NaN where nothing was measured"
            mistakes.append(Mistake(f"measured.{label}", float(data[np.isinf(data)][0]), what))
    if not mistakes and not any(np.isfinite(v).any() for v in good.values()):
        mistakes.append(Mistake("measured", MISSING, "there is nothing that was measured"))
    deviations = {} if mistakes or sigma is None else _deviations(sigma, good, mistakes)
    if mistakes or times is None:
        return None, chosen, mistakes
    return MeasuredData(times, good, chosen, deviations, units), chosen, []


def _columns(measured: Any, units: dict[str, str], mistakes: list[Mistake]) -> dict[str, Any]:
    """Name -> values of a CSV file, a mapping, a data frame or a data set; units of the file."""
    if isinstance(measured, (str, os.PathLike)):
        return _read_csv(Path(measured), units, mistakes)
    if hasattr(measured, "data_vars"):
        return {str(name): variable.values for name, variable in measured.variables.items()
                if name in TIMES or name in measured.data_vars}  # fmt: skip
    if hasattr(measured, "keys") and hasattr(measured, "__getitem__"):
        return {str(name): measured[name] for name in measured.keys()}  # noqa: SIM118  data frames
    what = (
        "measured data are a mapping {'t': times, 'mass.r.x': values}, an xarray.Dataset, or the "
        "path of a CSV file with a header"
    )
    mistakes.append(Mistake("measured", measured, what))
    return {}


def _read_csv(path: Path, units: dict[str, str], mistakes: list[Mistake]) -> dict[str, Any]:
    """The columns of a CSV file, but # lines; units, in brackets after names, by name."""
    try:
        lines = io.StringIO(read_regular(path).decode("utf-8-sig"), newline="")
        rows = [(k, row) for k, row in enumerate(csv.reader(lines), start=1)
                if any(row) and not row[0].startswith("#")]  # fmt: skip
    except (OSError, ValueError, csv.Error) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        mistakes.append(Mistake("measured", str(path), f"cannot be read as a CSV file: {why}"))
        return {}
    if not rows:
        mistakes.append(Mistake("measured", str(path), "the file is empty"))
        return {}
    heads = [head.partition("[") for head in rows[0][1]]
    names = [head[0].strip() for head in heads]
    units.update((name, head[2].strip(" ]")) for name, head in zip(names, heads, strict=True))
    between = next((c for c in ";\t" if len(names) == 1 and c in names[0]), "")
    if between:
        what = f"columns are between commas, not {between!r}; a number has a decimal point"
        mistakes.append(Mistake("measured", MISSING, what, file=str(path), line=rows[0][0]))
        return {}
    for name in {n for n in names if names.count(n) > 1}:
        what = "two columns have this name"
        mistakes.append(Mistake(f"measured.{name}", MISSING, what, file=str(path), line=rows[0][0]))
    columns: dict[str, Any] = {name: np.full(len(rows) - 1, np.nan) for name in names}
    for k, (line, row) in enumerate(rows[1:]):
        if len(row) != len(names):
            what = f"{len(row)} columns, the header has {len(names)}"
            mistakes.append(Mistake("measured", MISSING, what, file=str(path), line=line))
            continue
        for name, text in zip(names, row, strict=True):
            try:
                columns[name][k] = np.nan if text.strip().lower() in EMPTY else float(text)
            except ValueError:
                mistakes.append(Mistake(f"measured.{name}", text, "should be a number",
                                        file=str(path), line=line))  # fmt: skip
    return columns


def _chosen(columns: dict[str, Any], outputs: Any, mistakes: list[Mistake]) -> dict[str, str]:
    """Label -> quantity of the columns that are used."""
    quantities: dict[str, Any] = {name: name for name in columns}
    if isinstance(outputs, Mapping):
        quantities = {str(column): name for column, name in outputs.items()}
    elif isinstance(outputs, (str, list, tuple)):
        quantities = {str(n): n for n in ([outputs] if isinstance(outputs, str) else outputs)}
    elif outputs is not None:
        what = "outputs are names of columns, or column -> name of its quantity"
        mistakes.append(Mistake("outputs", outputs, what))
    if not quantities:
        mistakes.append(Mistake("measured", MISSING, "there is no quantity besides the time"))
    for column, quantity in quantities.items():
        if column not in columns:
            near = nearest(column, columns)
            remedy = "" if near else f"there are {', '.join(columns)}"
            what = "the measured data have no such column"
            mistakes.append(Mistake(f"outputs.{column}", MISSING, what, near, remedy))
        if not isinstance(quantity, str):
            what = "the name of a quantity is text such as 'crank.r.z'"
            mistakes.append(Mistake(f"outputs.{column}", quantity, what))
    return {c: name for c, name in quantities.items() if c in columns and isinstance(name, str)}


def _numbers(name: str, values: Any, mistakes: list[Mistake]) -> Floats | None:
    """Values as (nt,) numbers, or a mistake and None."""
    key = f"measured.{name}"
    try:
        array = np.asarray(values)
        if array.dtype.kind not in "fiuO":
            raise ValueError
        numbers = np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError):
        listed = () if isinstance(values, str) or not np.iterable(values) else values
        shown = next((v for v in listed if not is_number(v)), values)
        mistakes.append(Mistake(key, shown, "should be numbers, one for each time"))
        return None
    if numbers.ndim != 1:
        what = f"should be one number for each time, and has the shape {numbers.shape}"
        remedy = "name its components, such as crank.r.z" if numbers.ndim == 2 else ""
        mistakes.append(Mistake(key, MISSING, what, remedy=remedy))
        return None
    return numbers


def _deviations(
    sigma: Any, values: dict[str, Floats], mistakes: list[Mistake]
) -> dict[str, Floats]:
    """Label -> (nt,) standard deviations."""
    given = dict(sigma) if isinstance(sigma, Mapping) else dict.fromkeys(values, sigma)
    for label in given:
        if label not in values:
            what = "this is none of the measured quantities"
            near = nearest(label, values)
            mistakes.append(Mistake(f"sigma.{label}", MISSING, what, near))
    deviations = {}
    for label, data in values.items():
        key = f"sigma.{label}" if isinstance(sigma, Mapping) else "sigma"
        if label not in given:
            what = "with standard deviations each quantity needs one"
            mistakes.append(Mistake(key, MISSING, what))
            continue
        try:
            array = np.broadcast_to(np.asarray(given[label], dtype=np.float64), data.shape)
        except (TypeError, ValueError):
            what = f"a standard deviation is a number, or one for each of the {len(data)} times"
            mistakes.append(Mistake(key, given[label], what))
            continue
        bad = array[np.isfinite(data) & ~((array > 0.0) & np.isfinite(array))]
        if len(bad):
            mistakes.append(Mistake(key, float(bad[0]), "a standard deviation is above 0"))
        deviations[label] = array
    return deviations
