"""Layout of a result in a NetCDF-4 file: dimensions, variables with units, attributes."""

import os
from collections.abc import Mapping
from typing import Any, NamedTuple

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.result.arrays import (
    AXES,
    COLUMNS,
    EULER,
    U_ERROR,
    Arrays,
    Column,
    ModelSummary,
    column_sizes,
)
from dap3d_core.result.contact_table import FIELDS, ContactTable, no_contacts
from dap3d_core.result.event_record import EventRecord
from dap3d_core.result.metadata import RUNNING, RunMetadata, RunStatistics, to_json

#: Version of this layout, raised when an older reader would misread it.
FORMAT = 1
CONVENTIONS = "dap3d-result"
#: Attribute of files with the points of a sweep (study/sweep/dataset.py): their version.
SWEEP = "dap3d_sweep"


class Constant(NamedTuple):
    """A variable without time: name, dimensions, unit and meaning."""

    name: str
    dimensions: tuple[str, ...]
    unit: str
    meaning: str


CONSTANTS = (
    Constant("mass", ("body",), "kg", "mass"),
    Constant(
        "Jp", ("body", "axis", "axis_2"), "kg m^2", "inertia about the mass centre, body axes"
    ),
    Constant("joint_rows", ("joint",), "1", "constraint rows of each joint, in the order of Lam"),
    Constant("point_body", ("point",), "1", "body of each point, counted from 1; 0 is ground"),
    Constant("point_local", ("point", "axis"), "m", "points in the axes of their bodies"),
)
#: Variables with the names of the entries of a dimension.
NAMES = {
    "body": "names of the bodies",
    "joint": "names of the joints",
    "point": "names of the points; animation points come last",
    "element_state": "names of the states of their own of forces and joints",
    "angle": "names of the angles whose turns are counted",
    "input": "names of the inputs",
    "axis": "axes of a vector",
    "euler": "Euler parameters, body to global",
}


def about(unit: str, meaning: str) -> dict[str, str]:
    """Attributes of a variable, without ``units`` where its unit is not known."""
    return {"units": unit, "long_name": meaning} if unit else {"long_name": meaning}


def attributes(summary: ModelSummary, record: RunMetadata) -> dict[str, Any]:
    """Global attributes. Lists and tables are JSON."""
    types = {} if record.types is None else {"types": to_json(record.types)}
    actuation = {"actuation": to_json(record.actuation)} if record.actuation else {}
    return (
        types
        | actuation
        | {
            "Conventions": CONVENTIONS,
            "format": np.int32(FORMAT),
            "title": record.title.replace("\0", ""),
            "source": f"dap3d {record.versions.get('dap3d', 'unknown')}",
            "status": record.status,
            "method": record.method,
            "integrator": record.integrator,
            "run": record.run,
            "notes": to_json(record.notes),
            "settings": to_json(record.settings),
            "statistics": to_json(attrs.asdict(record.stats)),
            "events": to_json([attrs.asdict(event) for event in record.events]),
            "versions": to_json(record.versions),
            "has_potential": np.int32(summary.has_potential),
            "is_isolated": np.int32(summary.is_isolated),
            "scene": record.scene_text,
        }
    )


def record_of(values: dict[str, Any], contacts: ContactTable) -> RunMetadata:
    """The record in a file's ``attributes``, with JSON decoded, and its contacts."""
    texts = {name: str(values[name]) for name in ("status", "method", "integrator", "run")}
    return RunMetadata(
        scene_text=str(values["scene"]),
        types=values["types"],
        notes=values["notes"],
        settings=values["settings"],
        actuation=values["actuation"],
        stats=RunStatistics(**values["statistics"]),
        events=[EventRecord(**event) for event in values["events"]],
        contacts=contacts,
        known_versions=values["versions"],
        **texts,
    )


def define(
    dataset: Any, summary: ModelSummary, record: RunMetadata, nt: int, *, with_error: bool = False
) -> int:
    """Defines a new file and writes all but the rows.

    Each variable is contiguous, its rows behind all else.

    Args:
        dataset: a netCDF4.Dataset, empty.
        summary, record: model and metadata of the run.
        nt: number of reported instants to make room for.
        with_error: True to make room for an estimate of the error of u.

    Returns:
        Offset of the rows, in bytes: what lies before it describes the file.
    """
    entries = {
        "body": summary.body_names,
        "axis": AXES,
        "axis_2": AXES,
        "euler": EULER,
        **{name: range(size) for name, size in column_sizes(summary).items()},
        **{kind: getattr(summary, f"{kind}_names") for kind in ("joint", "point", "input")},
        "element_state": summary.state_names,
    }
    if summary.angle_names:  # files of older programs have none
        entries["angle"] = summary.angle_names
    dataset.createDimension("time", nt or None)
    for name, values in entries.items():
        if len(values):
            dataset.createDimension(name, len(values))
    for name, meaning in NAMES.items():
        if len(entries.get(name, ())) and not isinstance(entries[name], range):
            _store(dataset, name, (name,), np.array(entries[name], object), about("1", meaning))
    for name, dimensions, unit, meaning in CONSTANTS:
        if dimensions[0] in dataset.dimensions:
            _store(dataset, name, dimensions, getattr(summary, name), about(unit, meaning))
    if record.status != RUNNING and record.contacts.names:
        _write_contacts(dataset, record.contacts)
    _define_rows(dataset, (*COLUMNS, U_ERROR) if with_error else COLUMNS, is_sized=bool(nt))
    write_attributes(dataset, attributes(summary, record))
    dataset.sync()
    return os.path.getsize(dataset.filepath())


def new_variable(
    dataset: Any,
    name: str,
    kind: Any,
    dimensions: tuple[str, ...],
    about: Mapping[str, Any],
    fill_value: Any = False,
    **storage: Any,
) -> Any:
    """Defines a variable with its attributes; other arguments as of ``Dataset.createVariable``."""
    variable = dataset.createVariable(name, kind, dimensions, fill_value=fill_value, **storage)
    write_attributes(variable, about)
    return variable


def _store(
    dataset: Any,
    name: str,
    dimensions: tuple[str, ...],
    values: NDArray[Any],
    about: dict[str, str],
) -> None:
    """Defines a variable of integers, numbers or texts, and writes its values."""
    kind, fill = {"i": ("i8", False), "O": (str, None)}.get(values.dtype.kind, ("f8", False))
    new_variable(dataset, name, kind, dimensions, about, fill)[:] = values


def _write_contacts(dataset: Any, contacts: ContactTable) -> None:
    """Writes the contacts of shapes; where there is none, the names of the shapes alone."""
    sizes = {"contact_shape": len(contacts.names), "side": 2, "contact": len(contacts)}
    for name, size in sizes.items():
        if size:
            dataset.createDimension(name, size)
    shapes = "contact_shape"
    names = np.array(contacts.names, object)
    _store(dataset, shapes, (shapes,), names, about("1", "names of the shapes that collide"))
    for name, (dimensions, unit, meaning) in FIELDS.items() if len(contacts) else ():
        values = getattr(contacts, name)
        _store(dataset, f"contact_{name}", dimensions, values, about(unit, meaning))


def contacts_of(dataset: Any) -> ContactTable:
    """The contacts of shapes of a file.

    Raises:
        ValueError: a shape is named that there is not, or a number is none that a run leaves.
    """
    if "contact_shape" not in dataset.variables:
        return no_contacts()
    names = tuple(map(str, dataset.variables["contact_shape"][:]))
    if "contact" not in dataset.dimensions:
        return attrs.evolve(no_contacts(), names=names)
    parts = {name: np.asarray(dataset.variables[f"contact_{name}"][:]) for name in FIELDS}
    inside = (parts["pair"] >= 0) & (parts["pair"] < len(names))
    if not inside.all() or not all(np.isfinite(values).all() for values in parts.values()):
        raise ValueError("contacts are of no run")
    return ContactTable(names, **parts)


def _define_rows(dataset: Any, columns: tuple[Column, ...], *, is_sized: bool) -> None:
    """Defines the variables of the columns whose dimensions there are."""
    storage: dict[str, Any] = {"contiguous": True} if is_sized else {}
    for column in columns:
        if dataset.dimensions.keys() >= set(column.dimensions):
            coordinates = {"coordinates": "t"} if column.name != "t" else {}
            attributes = about(column.unit, column.meaning) | coordinates
            new_variable(dataset, column.name, "f8", column.dimensions, attributes, **storage)


def allocate_rows(dataset: Any) -> None:
    """Allocates the rows of a defined file.

    Writing rows then changes nothing else of the file, so that the writer may be killed at any
    moment. What is not written is zero, and takes no space on a disk.
    """
    nt = len(dataset.dimensions["time"])
    for column in (*COLUMNS, U_ERROR):
        if nt and column.name in dataset.variables:
            dataset.variables[column.name][nt - 1] = 0.0


def write_attributes(item: Any, values: Mapping[str, Any]) -> None:
    """Writes attributes of a data set or a variable, text as strings."""
    for name, value in values.items():
        if isinstance(value, str):
            item.setncattr_string(name, value)
        else:
            item.setncattr(name, value)


def write_rows(dataset: Any, arrays: Arrays, first: int) -> None:
    """Writes arrays other than ``t`` into the rows of a file from ``first`` on."""
    rows = slice(first, first + len(arrays))
    for column in (*COLUMNS[1:], U_ERROR):
        if column.name in dataset.variables:
            dataset.variables[column.name][rows] = getattr(arrays, column.name)


def write_times(dataset: Any, arrays: Arrays, first: int) -> None:
    """Writes ``t`` of the same rows, once they are in the file: it marks them as present."""
    dataset.variables["t"][first : first + len(arrays)] = arrays.t
