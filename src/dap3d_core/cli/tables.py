"""The post-processor's arrays (spec 10) as a CSV table or a NetCDF file."""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dap3d_core.cli.exits import Refused

if TYPE_CHECKING:
    from dap3d_core.result import Result

AXES, EULER = ("x", "y", "z"), ("e0", "e1", "e2", "e3")
#: Arrays of the bodies, with the names of their components.
BODY = {"r": AXES, "p": EULER} | dict.fromkeys(("rd", "w", "wp", "rdd", "wd", "wpd"), AXES)
#: Arrays of the points, and what ``dap3d plot`` calls them.
POINT = {"rP": "r", "rPd": "v"}
#: Instants that are turned into text at a time.
BLOCK = 1000

Column = tuple[str, Any]


def write_csv(result: "Result", target: Path, *, jacobian: bool, force: bool) -> str:
    """Write a table: t, and a column for each component, named as quantities are.

    Where a body and a point share a name, the point's columns are called NAME.rP.x and NAME.rPd.x.

    Returns:
        What was written, in words.

    Raises:
        ResultError: the file cannot be written, or a Jacobian is asked for that cannot be had.
    """
    from dap3d_core.result.files import cannot, whole_file

    columns = [("t", result.t), *_body_columns(result), *_point_columns(result)]
    columns += _multiplier_columns(result)
    if jacobian:
        columns += _jacobian_columns(result)
    with whole_file(target, force) as part:
        try:
            _write(part, columns, len(result.t))
        except OSError as error:
            raise cannot("write", target, error) from error
    return f"{len(result.t)} instants, {len(columns)} columns"


def write_netcdf(result: "Result", target: Path, *, jacobian: bool, force: bool) -> str:
    """Write every array with named dimensions and units.

    Returns:
        What was written, in words.

    Raises:
        ResultError: as ``write_csv``.
    """
    from dap3d_core.result.files import cannot, whole_file

    dataset = result.to_xarray()
    dataset.attrs["Conventions"] = "dap3d-post"  # no result: it cannot be opened as one
    if jacobian:
        about = {"units": "SI", "long_name": "constraint Jacobian D, D v = nu"}
        dataset["Jac"] = (("time", "row", "velocity"), _dense(result), about)
    with whole_file(target, force) as part:
        try:
            dataset.to_netcdf(part, format="NETCDF4", engine="netcdf4")
        except (OSError, RuntimeError) as error:
            raise cannot("write", target, error) from error
    return f"{len(result.t)} instants, {len(dataset.data_vars)} arrays"


def _write(path: Path, columns: list[Column], count: int) -> None:
    import numpy as np

    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(name for name, _ in columns)
        for start in range(0, count, BLOCK):
            block = np.column_stack([values[start : start + BLOCK] for _, values in columns])
            writer.writerows(block.tolist())  # repr of a float: reading gives the same number


def _body_columns(result: "Result") -> Iterator[Column]:
    arrays = {name: getattr(result, name) for name in BODY}
    for k, body in enumerate(result.subject.body_names):
        for name, components in BODY.items():
            for c, component in enumerate(components):
                yield f"{body}.{name}.{component}", arrays[name][:, k, c]


def _point_columns(result: "Result") -> Iterator[Column]:
    bodies = frozenset(result.subject.body_names)
    for k, point in enumerate(result.subject.point_names):
        for name, word in POINT.items():
            shown = name if point in bodies else word
            for c, component in enumerate(AXES):
                yield f"{point}.{shown}.{component}", getattr(result, name)[:, k, c]


def _multiplier_columns(result: "Result") -> Iterator[Column]:
    for name, row in _rows(result):
        yield f"{name[0]}.lambda.{name[1]}", result.Lam[:, row]


def _jacobian_columns(result: "Result") -> Iterator[Column]:
    D = _dense(result)
    velocities = [f"{b}.{q}.{c}" for b in result.subject.body_names for q in ("rd", "w")
                  for c in AXES]  # fmt: skip
    for (joint, number), row in _rows(result):
        for column, velocity in enumerate(velocities):
            yield f"{joint}.Jac.{number}.{velocity}", D[:, row, column]


def _rows(result: "Result") -> Iterator[tuple[tuple[str, int], int]]:
    """(joint, row of the joint from 1), row of the model."""
    subject = result.subject
    row = 0
    for joint, rows in zip(subject.joint_names, subject.joint_rows, strict=True):
        for k in range(int(rows)):
            yield (joint, k + 1), row
            row += 1


def _dense(result: "Result") -> Any:
    D = result.Jac
    if isinstance(D, list):
        raise Refused(
            f"with {result.subject.row_count:,} rows the Jacobian is sparse: "
            "take result.Jac in Python, or leave --jac out"
        )
    return D
