"""A result as a NetCDF file for other programs: all arrays, or selected quantities."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dap3d_core.result.arrays import AXES, EULER
from dap3d_core.result.errors import ResultError
from dap3d_core.result.file.atomic_write import whole_file
from dap3d_core.result.file.library import NETCDF, writing
from dap3d_core.result.file.schema import about, attributes, new_variable
from dap3d_core.result.post.force_output import DENSE_ROWS, rows_at
from dap3d_core.result.quantities.catalogue import ACTIONS
from dap3d_core.result.quantities.lookup import CONTACT_QUANTITIES, find, joint_coordinates
from dap3d_core.result.quantities.xarray_dataset import add_outputs, dataset_of, dimensions_of

if TYPE_CHECKING:
    import xarray

    from dap3d_core.result.result import Result


def dataset_to_write(result: "Result", reactions: bool = True) -> "xarray.Dataset":
    """All arrays of a result but the Jacobian; what needs the model can be left out.

    That is reactions and coordinates of joints, and contacts.

    Raises:
        ResultError: the model for the reactions is not available.
    """
    dataset = dataset_of(result)
    parts = (reactions_of, coordinates_of, contacts_of) if reactions else ()
    for part in parts:
        dataset = dataset.merge(part(result), combine_attrs="override")
    dataset = add_outputs(dataset, result)
    return dataset.drop_dims([name for name, count in dataset.sizes.items() if not count])


def why_no_reactions(result: "Result") -> str:
    """The reason that reactions of joints, and contacts, cannot be computed, "" if they can."""
    try:
        if result.summary.joint_names:
            _ = result.evaluator
    except ResultError as error:
        return str(error)
    return ""


def reactions_of(result: "Result") -> "xarray.Dataset":
    """The reactions of all joints on all their bodies, ground included (post/force_output.py).

    Returns:
        Dimensions time, reaction, axis; coordinate ``reaction`` (JOINT.SLOT), with the joint and
        the body of each. ``reaction_moment_at_point`` is NaN where a joint has no point of its own
        on the body.

    Raises:
        ResultError: the model is not available.
    """
    import xarray

    if not result.summary.joint_index:
        return xarray.Dataset()
    actions = [
        (f"{joint}.{slot}", joint, action)
        for joint, by_slot in result.reactions().items()
        for slot, action in by_slot.items()
    ]
    variables: dict[str, Any] = {}
    for part, (label, unit) in ACTIONS.items():
        values = np.full((len(result.t), len(actions), 3), np.nan)
        for k, (_, _, action) in enumerate(actions):
            vector = getattr(action, part)
            if vector is not None:
                values[:, k] = vector
        dimensions = ("time", "reaction", "axis")
        variables[f"reaction_{part}"] = (dimensions, values, about(unit, f"reaction {label}"))
    names, joints, bodies = np.array(
        [(name, joint, action.body) for name, joint, action in actions], dtype=str
    ).T
    coordinates = {
        "reaction": ("reaction", names, about("1", "joint and body slot")),
        "reaction_joint": ("reaction", joints, about("1", "joint")),
        "reaction_body": ("reaction", bodies, about("1", "body that it acts on")),
    }
    return xarray.Dataset(variables, coordinates)


def coordinates_of(result: "Result") -> "xarray.Dataset":
    """The coordinates of all joints that have some, and their rates.

    Returns:
        Dimensions time, coordinate; ``joint_q`` and ``joint_q_dot``; coordinate ``coordinate``
        (JOINT.q1) with the unit of each, rad or m.

    Raises:
        ResultError: the model is not available.
    """
    import xarray

    quantities = list(joint_coordinates(result))
    coordinates, rates = quantities[::2], quantities[1::2]
    if not coordinates:
        return xarray.Dataset()
    variables: dict[str, Any] = {}
    for name, some, text in (("joint_q", coordinates, "joint coordinates"),
                             ("joint_q_dot", rates, "their rates")):  # fmt: skip
        values = np.stack([one.values for one in some], axis=1)
        variables[name] = (("time", "coordinate"), values, about("SI", text))
    names, units = np.array([(one.name, one.unit) for one in coordinates], dtype=str).T
    labels = {
        "coordinate": ("coordinate", names, about("1", "joint coordinate")),
        "coordinate_unit": ("coordinate", units, about("1", "unit of the coordinate")),
    }
    return xarray.Dataset(variables, labels)


def contacts_of(result: "Result") -> "xarray.Dataset":
    """What the declared contacts do, at each of their points.

    Returns:
        Dimensions time, contact, axis; ``contact_gap``, ``contact_normal``, ``contact_friction``,
        ``contact_slip``, ``contact_mode``; coordinate ``contact`` with the names of the points, and
        ``contact_turns``, 1 for those whose gap, slip and moments are in rad, rad/s and N m.

    Raises:
        ResultError: the model is not available.
    """
    import xarray

    points = result.summary.contact_points
    outputs = [result.contact(point) for point in points]
    variables: dict[str, Any] = {}
    for name, part in CONTACT_QUANTITIES.items() if points else ():
        values = np.stack([getattr(one, part.attribute) for one in outputs], axis=1)
        units = {one.units[part.attribute] for one in outputs}
        dimensions = ("time", "contact", "axis")[: values.ndim]
        unit = units.pop() if len(units) == 1 else "SI"
        variables[f"contact_{name}"] = (dimensions, values, about(unit, part.label))
    turns = [int(one.units["slip"] == "rad/s") for one in outputs]
    coordinates = {
        "contact": ("contact", np.array(points, dtype=str), about("1", "point of a contact")),
        "contact_turns": ("contact", turns, about("1", "1 where it turns")),
    }
    return xarray.Dataset(variables, coordinates if points else None)


def selection_of(result: "Result", names: Iterable[str]) -> "xarray.Dataset":
    """Quantities by name, each a variable of that name over time.

    Raises:
        UnknownNameError: there is no such quantity.
        ResultError: the model is needed and not available, or NetCDF does not allow the name.
    """
    import xarray

    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {"time": ("time", result.t, about("s", "time"))}
    for name in names:
        quantity = find(result, name)
        if "/" in name:
            raise ResultError(f"a NetCDF file has no variable {name!r} with '/': write a .csv file")
        dimensions = dimensions_of(quantity)
        if quantity.components in (AXES, EULER):
            coordinates[dimensions[1]] = (dimensions[1], list(quantity.components))
        variables[name] = (dimensions, quantity.values, about(quantity.unit, quantity.label))
    return xarray.Dataset(variables, coordinates, attributes(result.summary, result.record))


def write_netcdf(
    result: "Result", path: Path, dataset: "xarray.Dataset", *, jacobian: bool, force: bool
) -> list[dict[str, Any]]:
    """Writes a dataset of a result to a file, whole or not at all.

    Args:
        result: source of the dataset.
        path: the file.
        dataset: what is written.
        jacobian: True to add ``Jac`` (time, row, velocity), an instant at a time; beyond 1000 rows
            its non-zero entries ``Jac_value`` (time, entry) at ``Jac_row``, ``Jac_column``.
        force: True to overwrite an existing file.

    Returns:
        Of each array in the file: name, dimensions, shape, unit, meaning.

    Raises:
        ResultError: the file cannot be written, or the model for a Jacobian is not available.
    """
    import netCDF4

    jacobian = jacobian and result.summary.row_count > 0
    if jacobian:
        _ = result.evaluator
    with whole_file(path, force) as part, NETCDF, writing(path):
        _put(dataset, part)
        with netCDF4.Dataset(part, "a") as file:
            if jacobian:
                _add_jacobian(file, result)
            return [
                {
                    "name": name,
                    "dimensions": list(variable.dimensions),
                    "shape": list(variable.shape),
                    "unit": str(getattr(variable, "units", "")),
                    "meaning": str(getattr(variable, "long_name", "")),
                }
                for name, variable in file.variables.items()
            ]


def write_dataset(dataset: "xarray.Dataset", path: Path, *, force: bool) -> None:
    """Writes a dataset that is no result to a file, whole or not at all.

    Raises:
        ResultError: the file cannot be written, or exists and ``force`` is off.
    """
    with whole_file(path, force) as part, NETCDF, writing(path):
        _put(dataset, part)


def _put(dataset: "xarray.Dataset", part: Path) -> None:
    plain = dataset.assign_attrs(Conventions="dap3d-post")  # not opened as a result
    encoding = {str(n): {"_FillValue": None} for n in (*plain.data_vars, *plain.coords)}
    plain.to_netcdf(part, format="NETCDF4", engine="netcdf4", encoding=encoding)


def _add_jacobian(file: Any, result: "Result") -> None:
    meaning = "constraint Jacobian D, D v = nu"
    sparse = result.summary.row_count > DENSE_ROWS
    sizes = {"row": result.summary.row_count, "velocity": 6 * result.summary.body_count}
    for name, size in sizes.items():
        if name not in file.dimensions:
            file.createDimension(name, size)
    variable = None
    for k, rows in enumerate(rows_at(result.evaluator, result.t, result.u, result.inputs)):
        if variable is None and sparse:
            file.createDimension("entry", len(rows.value))
            for name, places in (("row", rows.row), ("column", rows.column)):
                text = about("1", f"{name} of an entry")
                new_variable(file, f"Jac_{name}", "i8", ("entry",), text)[:] = places
            text = about("SI", f"{meaning}, entries")
            variable = new_variable(file, "Jac_value", "f8", ("time", "entry"), text)
        elif variable is None:
            dimensions = ("time", "row", "velocity")
            variable = new_variable(file, "Jac", "f8", dimensions, about("SI", meaning))
        variable[k] = rows.value if sparse else rows.dense()
