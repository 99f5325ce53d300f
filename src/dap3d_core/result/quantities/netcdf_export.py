"""A result as a NetCDF file for other programs: all arrays, or quantities that are picked."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dap3d_core.result.errors import ResultError
from dap3d_core.result.file.atomic_write import cannot, whole_file
from dap3d_core.result.file.library import NETCDF
from dap3d_core.result.file.schema import attributes
from dap3d_core.result.post.reactions import DENSE_ROWS, rows_at
from dap3d_core.result.quantities.catalogue import ACTIONS, AXES, EULER
from dap3d_core.result.quantities.lookup import find

if TYPE_CHECKING:
    import xarray

    from dap3d_core.result.result import Result


def dataset_to_write(result: "Result", reactions: bool = True) -> "xarray.Dataset":
    """All arrays of a result but the Jacobian; ``reactions`` says whether those are among them.

    Raises:
        ResultError: the model for the reactions cannot be had.
    """
    dataset = result.to_xarray()
    if reactions and result.subject.joint_names:
        dataset = dataset.merge(reactions_of(result), combine_attrs="override")
    return dataset.drop_dims([name for name, count in dataset.sizes.items() if not count])


def why_no_reactions(result: "Result") -> str:
    """Why the reactions of joints cannot be computed, "" where they can."""
    try:
        if result.subject.joint_names:
            _ = result.machine
    except ResultError as error:
        return str(error)
    return ""


def reactions_of(result: "Result") -> "xarray.Dataset":
    """The reactions of all joints on all their bodies, ground included (post/reactions.py).

    Returns:
        Dimensions time, reaction, axis; coordinate ``reaction`` (JOINT.SLOT), with the joint and
        the body of each. ``reaction_moment_at_point`` is NaN where a joint has no point of its own
        on the body.

    Raises:
        ResultError: the model cannot be had.
    """
    import xarray

    actions = [
        (f"{joint}.{slot}", joint, action)
        for joint, by_slot in result.reactions().items()
        for slot, action in by_slot.items()
    ]
    variables: dict[str, Any] = {}
    for part, (words, unit) in ACTIONS.items():
        values = np.full((len(result.t), len(actions), 3), np.nan)
        for k, (_, _, action) in enumerate(actions):
            found = getattr(action, part)
            if found is not None:
                values[:, k] = found
        about = {"units": unit, "long_name": f"reaction {words}"}
        variables[f"reaction_{part}"] = (("time", "reaction", "axis"), values, about)
    names, joints, bodies = (
        np.array(column, dtype=str)
        for column in (
            [name for name, _, _ in actions],
            [joint for _, joint, _ in actions],
            [action.body for _, _, action in actions],
        )
    )
    coordinates = {
        "reaction": ("reaction", names, {"units": "1", "long_name": "joint and body slot"}),
        "reaction_joint": ("reaction", joints, {"units": "1", "long_name": "joint"}),
        "reaction_body": ("reaction", bodies, {"units": "1", "long_name": "body that it acts on"}),
    }
    return xarray.Dataset(variables, coordinates)


def selection_of(result: "Result", names: Iterable[str]) -> "xarray.Dataset":
    """Quantities by name, each a variable of that name over time.

    Raises:
        UnknownNameError: there is no such quantity.
        ResultError: the model is needed and cannot be had, or NetCDF cannot have such a name.
    """
    import xarray

    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {"time": ("time", result.t, {"units": "s", "long_name": "time"})}
    for name in names:
        found = find(result, name)
        if "/" in name:
            raise ResultError(f"a NetCDF file has no variable {name!r} with '/': write a .csv file")
        dimensions = {AXES: ("axis",), EULER: ("euler",), (): ()}.get(found.components)
        if found.values.ndim == 1:
            dimensions = ()
        elif dimensions is None:
            dimensions = (f"{name}_row",)
        if dimensions and dimensions[0] in ("axis", "euler"):
            coordinates[dimensions[0]] = (dimensions[0], list(found.components))
        about = {"units": found.unit, "long_name": found.label}
        variables[name] = (("time", *dimensions), found.values, about)
    return xarray.Dataset(variables, coordinates, attributes(result.subject, result.record))


def write_netcdf(
    result: "Result", path: Path, dataset: "xarray.Dataset", *, jacobian: bool, force: bool
) -> list[dict[str, Any]]:
    """Write a dataset of a result to a file, whole or not at all.

    Args:
        result: whose arrays they are.
        path: the file.
        dataset: what is written.
        jacobian: whether ``Jac`` (time, row, velocity) is added, an instant at a time; beyond 1000
            rows its non-zero entries ``Jac_value`` (time, entry) at ``Jac_row``, ``Jac_column``.
        force: whether an existing file is overwritten.

    Returns:
        Of each array in the file: name, dimensions, shape, unit, meaning.

    Raises:
        ResultError: the file cannot be written, or the model for a Jacobian cannot be had.
    """
    import netCDF4

    about = {**dataset.attrs, "Conventions": "dap3d-post"}  # no result: it cannot be opened as one
    jacobian = jacobian and result.subject.row_count > 0
    if jacobian:
        _ = result.machine
    with whole_file(path, force) as part, NETCDF:
        try:
            plain = dataset.assign_attrs(about)
            encoding = {str(n): {"_FillValue": None} for n in (*plain.data_vars, *plain.coords)}
            plain.to_netcdf(part, format="NETCDF4", engine="netcdf4", encoding=encoding)
            with netCDF4.Dataset(part, "a") as file:
                if jacobian:
                    _add_jacobian(file, result)
                return _contents(file)
        except (OSError, RuntimeError) as error:
            if isinstance(error, ResultError):
                raise
            raise cannot("write", path, error) from error


def _add_jacobian(file: Any, result: "Result") -> None:
    words = "constraint Jacobian D, D v = nu"
    sparse = result.subject.row_count > DENSE_ROWS
    for name, count in (("row", result.subject.row_count),
                        ("velocity", 6 * result.subject.body_count)):  # fmt: skip
        if name not in file.dimensions:
            file.createDimension(name, count)
    variable = None
    for k, rows in enumerate(rows_at(result.machine, result.t, result.u)):
        if variable is None and sparse:
            file.createDimension("entry", len(rows.value))
            for name, places in (("row", rows.row), ("column", rows.column)):
                _new(file, f"Jac_{name}", "i8", ("entry",), "1", f"{name} of an entry")[:] = places
            variable = _new(file, "Jac_value", "f8", ("time", "entry"), "SI", f"{words}, entries")
        elif variable is None:
            variable = _new(file, "Jac", "f8", ("time", "row", "velocity"), "SI", words)
        variable[k] = rows.value if sparse else rows.dense()


def _new(
    file: Any, name: str, kind: str, dimensions: tuple[str, ...], unit: str, words: str
) -> Any:
    variable = file.createVariable(name, kind, dimensions, fill_value=False)
    variable.setncattr_string("units", unit)
    variable.setncattr_string("long_name", words)
    return variable


def _contents(file: Any) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "dimensions": list(variable.dimensions),
            "shape": list(variable.shape),
            "unit": str(getattr(variable, "units", "1")),
            "meaning": str(getattr(variable, "long_name", "")),
        }
        for name, variable in file.variables.items()
    ]
