"""A result as an xarray.Dataset: every array with named dimensions, labels and units."""

from typing import TYPE_CHECKING, Any

import numpy as np

from dap3d_core.result.arrays import COLUMNS
from dap3d_core.result.file.schema import CONSTANTS, NAMES, attributes
from dap3d_core.result.post.global_error import U_ERROR
from dap3d_core.result.quantities.catalogue import AXES, EULER

if TYPE_CHECKING:
    import xarray

    from dap3d_core.result.result import Result

#: name: (dimensions besides time, unit, meaning) of what is computed from the stored arrays.
_COMPUTED = {
    "r": (("body", "axis"), "m", "position of the mass centre"),
    "p": (("body", "euler"), "1", "Euler parameters, body to global"),
    "rd": (("body", "axis"), "m/s", "velocity of the mass centre"),
    "w": (("body", "axis"), "rad/s", "angular velocity, global axes"),
    "wp": (("body", "axis"), "rad/s", "angular velocity, body axes"),
    "rdd": (("body", "axis"), "m/s^2", "acceleration of the mass centre"),
    "wd": (("body", "axis"), "rad/s^2", "angular acceleration, global axes"),
    "wpd": (("body", "axis"), "rad/s^2", "angular acceleration, body axes"),
    "rP": (("point", "axis"), "m", "position of the point"),
    "rPd": (("point", "axis"), "m/s", "velocity of the point"),
    "rPdd": (("point", "axis"), "m/s^2", "acceleration of the point"),
}


def dataset_of(result: "Result") -> "xarray.Dataset":
    """A result as an xarray.Dataset.

    Returns:
        Dimensions time, body, point, axis, euler, state, velocity, row, joint; coordinates t (s)
        as ``time``, and names; each variable with ``units`` and ``long_name``; the attributes of
        the file. Jacobian and reactions are left out: they need the model.
    """
    import xarray

    subject = result.subject
    variables: dict[str, Any] = {}
    optional = (U_ERROR,) if result.arrays.has_error else ()
    for column in (*COLUMNS[1:], *optional):
        dimensions = ("time", column.dimension) if column.dimension else ("time",)
        about = {"units": column.unit, "long_name": column.meaning}
        variables[column.name] = (dimensions, getattr(result.arrays, column.name), about)
    for name, (dimensions, unit, meaning) in _COMPUTED.items():
        about = {"units": unit, "long_name": meaning}
        variables[name] = (("time", *dimensions), getattr(result, name), about)
    for name in ("kinetic", "total"):
        about = {"units": "J", "long_name": f"{name} energy"}
        variables[f"{name}_energy"] = (("time",), getattr(result.energy, name), about)
    for constant in CONSTANTS:
        about = {"units": constant.unit, "long_name": constant.meaning}
        variables[constant.name] = (constant.dimensions, getattr(subject, constant.name), about)
    owners = np.repeat(np.array(subject.joint_names, dtype=str), subject.joint_rows)
    labels = {
        "body": subject.body_names,
        "point": subject.point_names,
        "joint": subject.joint_names,
        "axis": AXES,
        "euler": EULER,
    }
    coordinates = {
        name: (name, np.array(names, dtype=str), {"units": "1", "long_name": NAMES[name]})
        for name, names in labels.items()
    } | {
        "time": ("time", result.t, {"units": "s", "long_name": "time"}),
        "row_joint": ("row", owners, {"units": "1", "long_name": "joint of the constraint row"}),
    }
    about_all = attributes(subject, result.record)
    return xarray.Dataset(variables, coordinates, about_all)
