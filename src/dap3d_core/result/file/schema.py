"""How a result lies in a NetCDF-4 file: dimensions, variables with units, attributes."""

import os
from typing import TYPE_CHECKING, Any, NamedTuple

import attrs
import numpy as np

from dap3d_core.result.arrays import COLUMNS, Arrays, Column, column_sizes
from dap3d_core.result.event_record import Occurrence
from dap3d_core.result.metadata import Record, Statistics, to_json
from dap3d_core.result.post.global_error import U_ERROR
from dap3d_core.result.quantities.catalogue import AXES, EULER

if TYPE_CHECKING:
    from dap3d_core.result.model_summary import Subject

#: Version of this layout, raised when an older reader would misread it.
FORMAT = 1
CONVENTIONS = "dap3d-result"
#: The attribute by which a file of many runs is known (study/sweep/dataset.py): its version.
SWEEP = "dap3d_sweep"


class Constant(NamedTuple):
    """A variable without time: its name, dimensions, unit and meaning."""

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
#: Variables that name the entries of a dimension of the same name.
NAMES = {
    "body": "names of the bodies",
    "joint": "names of the joints",
    "point": "names of the points; animation points come last",
    "axis": "axes of a vector",
    "euler": "Euler parameters, body to global",
}


def sizes(subject: "Subject") -> dict[str, int]:
    """Length of every dimension but time; those of length 0 do not appear in the file."""
    return {
        "body": subject.body_count,
        "axis": 3,
        "axis_2": 3,
        "euler": 4,
        **column_sizes(subject),
        "joint": len(subject.joint_names),
        "point": len(subject.point_names),
    }


def attributes(subject: "Subject", record: Record) -> dict[str, Any]:
    """The global attributes: what is no array. Lists and tables are JSON."""
    types = {} if record.types is None else {"types": to_json(record.types)}
    return types | {
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
        "has_potential": np.int32(subject.has_potential),
        "is_isolated": np.int32(subject.is_isolated),
        "scene": record.scene_text,
    }


def record_of(found: dict[str, Any]) -> Record:
    """The record from a file's attributes as ``attributes`` makes them, JSON already read."""
    return Record(
        scene_text=str(found["scene"]),
        status=str(found["status"]),
        method=str(found["method"]),
        integrator=str(found["integrator"]),
        run=str(found["run"]),
        types=found["types"],
        notes=found["notes"],
        settings=found["settings"],
        stats=Statistics(**found["statistics"]),
        events=[Occurrence(**event) for event in found["events"]],
        known_versions=found["versions"],
    )


def define(
    dataset: Any, subject: "Subject", record: Record, nt: int, *, with_error: bool = False
) -> int:
    """Define everything in a new file and write all but the rows.

    Each variable lies in one piece, its rows behind all else.

    Args:
        dataset: a netCDF4.Dataset, empty.
        subject, record: what the file is about.
        nt: number of reported instants there is room for.
        with_error: whether an estimate of the error of u comes, too.

    Returns:
        Where the rows begin, in bytes: what lies before says what the file is.
    """
    length = sizes(subject)
    dataset.createDimension("time", nt or None)
    for name, count in length.items():
        if count:
            dataset.createDimension(name, count)
    for name, meaning in NAMES.items():
        if length[name]:
            values = {"axis": AXES, "euler": EULER}.get(name)
            values = getattr(subject, f"{name}_names") if values is None else values
            variable = dataset.createVariable(name, str, (name,))
            _describe(variable, "1", meaning)
            variable[:] = np.array(values, dtype=object)
    for constant in CONSTANTS:
        if length[constant.dimensions[0]]:
            values = getattr(subject, constant.name)
            kind = "i8" if values.dtype.kind == "i" else "f8"
            variable = dataset.createVariable(
                constant.name, kind, constant.dimensions, fill_value=False
            )
            _describe(variable, constant.unit, constant.meaning)
            variable[:] = values
    for column in (*COLUMNS, U_ERROR) if with_error else COLUMNS:
        if length.get(column.dimension, 1):
            _column(dataset, column, length, nt)
    write_attributes(dataset, attributes(subject, record))
    dataset.sync()
    return os.path.getsize(dataset.filepath())


def take_places(dataset: Any) -> None:
    """Give the rows of a file that was defined their places in it.

    Writing rows changes nothing else of the file from now on, so that a writer may be killed at any
    moment. What was not written is zero, and takes no room on a disk.
    """
    nt = len(dataset.dimensions["time"])
    for column in (*COLUMNS, U_ERROR):
        if nt and column.name in dataset.variables:
            dataset.variables[column.name][nt - 1] = 0.0


def _column(dataset: Any, column: Column, length: dict[str, int], nt: int) -> None:
    """The variable of a column, its rows to come."""
    dimensions = ("time", column.dimension) if column.dimension else ("time",)
    storage: dict[str, Any] = {"contiguous": True} if nt else {}
    variable = dataset.createVariable(column.name, "f8", dimensions, fill_value=False, **storage)
    _describe(variable, column.unit, column.meaning)
    if column.name != "t":
        variable.setncattr_string("coordinates", "t")


def write_attributes(dataset: Any, found: dict[str, Any]) -> None:
    """Write global attributes, text as strings."""
    for name, value in found.items():
        if isinstance(value, str):
            dataset.setncattr_string(name, value)
        else:
            dataset.setncattr(name, value)


def write_rows(dataset: Any, arrays: Arrays, first: int) -> None:
    """Write arrays but ``t`` into the rows of a file from ``first`` on."""
    rows = slice(first, first + len(arrays))
    for column in (*COLUMNS[1:], U_ERROR):
        if column.name in dataset.variables:
            dataset.variables[column.name][rows] = getattr(arrays, column.name)


def write_times(dataset: Any, arrays: Arrays, first: int) -> None:
    """Write ``t`` of the same rows, which says that they are there: once they are in the file."""
    dataset.variables["t"][first : first + len(arrays)] = arrays.t


def _describe(variable: Any, unit: str, meaning: str) -> None:
    variable.setncattr_string("units", unit)
    variable.setncattr_string("long_name", meaning)
