"""A result as an xarray.Dataset: every array with named dimensions, labels and units."""

from typing import TYPE_CHECKING, Any

import numpy as np

from dap3d_core.result.arrays import AXES, COLUMNS, EULER, U_ERROR
from dap3d_core.result.file.schema import CONSTANTS, NAMES, about, attributes
from dap3d_core.result.quantities.catalogue import MOTION, SYSTEM, Quantity, QuantitySource
from dap3d_core.result.quantities.lookup import available_outputs

if TYPE_CHECKING:
    import xarray

#: Dimension of the states of elements, left out where there are none.
STATES = "element_state"
#: Variables and dimensions that a Jacobian adds to a file (netcdf_export.py).
JACOBIAN = ("Jac", "Jac_row", "Jac_column", "Jac_value", "entry", "velocity")


def dataset_of(result: QuantitySource) -> "xarray.Dataset":
    """A result as an xarray.Dataset.

    Returns:
        Dimensions time, body, point, axis, euler, state, velocity, row, joint, input; coordinates
        t (s) as ``time``, and names; each variable with ``units`` and ``long_name``; the attributes
        of the file. Jacobian and reactions are left out: they need the model.
    """
    import xarray

    summary, arrays = result.summary, result.arrays
    variables: dict[str, Any] = {}
    for column in (*COLUMNS[1:], U_ERROR) if arrays.has_error else COLUMNS[1:]:
        values = getattr(arrays, column.name)
        if column.dimension == STATES and not values.shape[1]:
            continue
        variables[column.name] = (column.dimensions, values, about(column.unit, column.meaning))
    for motion in MOTION:
        dimensions = ("time", *motion.dimensions)
        values = getattr(result, motion.array)
        variables[motion.array] = (dimensions, values, about(motion.unit, motion.meaning))
    for name in ("kinetic", "total"):
        energy = SYSTEM[f"energy.{name}"]
        values = energy.values(result)
        variables[f"{name}_energy"] = (("time",), values, about(energy.unit, energy.label))
    for constant in CONSTANTS:
        values = getattr(summary, constant.name)
        text = about(constant.unit, constant.meaning)
        variables[constant.name] = (constant.dimensions, values, text)
    joint_of_row = np.repeat(np.array(summary.joint_names, dtype=str), summary.joint_rows)
    labels = {
        "body": summary.body_names,
        "point": summary.point_names,
        "joint": summary.joint_names,
        "axis": AXES,
        "euler": EULER,
        **({"input": summary.input_names} if summary.input_names else {}),
        **({"angle": summary.angle_names} if summary.angle_names else {}),
    }
    if summary.state_names:
        labels[STATES] = summary.state_names
    coordinates = {
        name: (name, np.array(names, dtype=str), about("1", NAMES[name]))
        for name, names in labels.items()
    } | {
        "time": ("time", arrays.t, about("s", "time")),
        "row_joint": ("row", joint_of_row, about("1", "joint of the constraint row")),
    }
    return xarray.Dataset(variables, coordinates, attributes(summary, result.record))


def dimensions_of(quantity: Quantity) -> tuple[str, ...]:
    """Dimensions of the variable of a quantity, time first."""
    if quantity.values.ndim == 1:
        return ("time",)
    return "time", {AXES: "axis", EULER: "euler"}.get(quantity.components, f"{quantity.name}_row")


def add_outputs(dataset: "xarray.Dataset", result: QuantitySource) -> "xarray.Dataset":
    """A data set with the outputs of the scene that can be computed.

    They have their names, with ``_output`` behind those that an array or a dimension has already.
    """
    taken = {*dataset.variables, *dataset.dims, *JACOBIAN}
    variables: dict[str, Any] = {}
    for output in available_outputs(result):
        name = f"{output.name}_output" if output.name in taken else output.name
        text = f"output {output.name} = {result.outputs[output.name].text}"
        variables[name] = (dimensions_of(output), output.values, about(output.unit, text))
    return dataset.assign(variables)
