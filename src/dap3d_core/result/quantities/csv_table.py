"""A result as a CSV table: a row for each instant, a column for each component, with its unit."""

import csv
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TextIO

import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.result.arrays import AXES
from dap3d_core.result.errors import ResultError
from dap3d_core.result.file.atomic_write import whole_file
from dap3d_core.result.post.force_output import DENSE_ROWS, jacobians
from dap3d_core.result.quantities import lookup
from dap3d_core.result.quantities.catalogue import ACTIONS, MOTION, SYSTEM, Quantity

if TYPE_CHECKING:
    from dap3d_core.result.result import Result

#: Numbers that are converted to text at a time.
_BLOCK = 1_000_000
#: First characters of cells that spreadsheets take for a formula.
FORMULA = ("=", "+", "-", "@")


class TableColumn(NamedTuple):
    """A column: name of the quantity, unit, values (nt,)."""

    name: str
    unit: str
    values: Floats

    @property
    def heading(self) -> str:
        """Head of the column, ``crank.r.x [m]``; the name alone where the unit is not known.

        An apostrophe precedes a name that a spreadsheet would evaluate as a formula.
        """
        mark = "'" if self.name.startswith(FORMULA) else ""
        return f"{mark}{self.name} [{self.unit}]" if self.unit else f"{mark}{self.name}"


def columns_of(result: "Result", reactions: bool = True) -> list[TableColumn]:
    """All columns: time, bodies, points, joints, contacts, outputs, energies, residuals.

    Named as in ``Result.quantity``. Where a body and a point share a name, the point's are called
    NAME.rP.x, NAME.rPd.x, NAME.rPdd.x.

    Args:
        result: what is tabulated.
        reactions: True to include reactions, coordinates and contacts, which need the model.

    Raises:
        ResultError: the model is not available.
    """
    time, *others = (TableColumn(n, q.unit, q.values(result)) for n, q in SYSTEM.items())
    columns = [time, *_of_motion(result, "body"), *_of_motion(result, "point")]
    for joint, number, row in _rows(result):
        columns.append(TableColumn(f"{joint}.lambda.{number}", "SI", result.Lam[:, row]))
    if reactions:
        columns.extend(_of_joints(result))
        points, names = result.summary.contact_points, lookup.CONTACT_QUANTITIES
        contacts = (lookup.find(result, f"{point}.{name}") for point in points for name in names)
        for quantity in (*lookup.joint_coordinates(result), *contacts):
            columns.extend(_of_quantity(quantity))
    for output in lookup.available_outputs(result):
        columns.extend(_of_quantity(output))
    return columns + others


def selected(result: "Result", names: Iterable[str]) -> list[TableColumn]:
    """The time, and columns for quantities by name; a vector gives one for each component.

    Raises:
        UnknownNameError: there is no such quantity.
        ResultError: the model is needed and not available.
    """
    columns = {"t": TableColumn("t", "s", result.t)}
    for name in names:
        columns |= {column.name: column for column in _of_quantity(lookup.find(result, name))}
    return list(columns.values())


def jacobian_columns(result: "Result") -> list[TableColumn]:
    """The columns of the Jacobian, JOINT.Jac.ROW.BODY.rd.x and so on, without their values.

    Raises:
        ResultError: it is too large for a table, or the model is not available.
    """
    summary = result.summary
    if summary.row_count > DENSE_ROWS:
        raise ResultError(
            f"a Jacobian of {summary.row_count:,} rows does not go into a table (at most "
            f"{DENSE_ROWS:,}): write a .nc file, which holds its non-zero entries"
        )
    if summary.row_count:
        _ = result.evaluator
    velocities = [f"{b}.{q}.{c}" for b in summary.body_names for q in ("rd", "w") for c in AXES]
    return [
        TableColumn(f"{joint}.Jac.{number}.{velocity}", "SI", np.zeros(0))
        for joint, number, _ in _rows(result)
        for velocity in velocities
    ]


def write_csv(
    result: "Result",
    path: Path,
    columns: list[TableColumn],
    jacobian: list[TableColumn] | None = None,
    *,
    force: bool = False,
) -> None:
    """Writes columns to a file, whole or not at all. Numbers read back bit for bit.

    Args:
        result: what the columns were taken from.
        path: the file.
        columns: from ``columns_of`` or ``selected``.
        jacobian: from ``jacobian_columns``; values are computed some instants at a time.
        force: True to overwrite an existing file.

    Raises:
        ResultError: the file cannot be written.
    """
    with whole_file(path, force) as part, part.open("w", newline="", encoding="utf-8") as file:
        _write(file, result, columns, jacobian or [])


def _write(
    file: TextIO, result: "Result", columns: list[TableColumn], jacobian: list[TableColumn]
) -> None:
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(column.heading for column in (*columns, *jacobian))
    size = max(1, _BLOCK // len((*columns, *jacobian)))
    for start in range(0, len(result.t), size):
        rows = slice(start, start + size)
        block = np.column_stack([column.values[rows] for column in columns])
        if jacobian:
            D = jacobians(result.evaluator, result.t[rows], result.u[rows], result.inputs[rows])
            block = np.hstack([block, D.reshape(len(D), -1)])
        writer.writerows(block.tolist())  # repr of a float: reading gives the same number


def _of_motion(result: "Result", kind: str) -> Iterator[TableColumn]:
    """Columns of the motion of all bodies or all points."""
    motions = [(m, getattr(result, m.array)) for m in MOTION if m.owner == kind]
    for k, owner in enumerate(getattr(result.summary, f"{kind}_names")):
        is_shared = kind == "point" and owner in result.summary.body_index
        for motion, values in motions:
            name = f"{owner}.{motion.array if is_shared else motion.quantity}"
            yield from _components(name, motion.unit, values[:, k], motion.components)


def _of_joints(result: "Result") -> Iterator[TableColumn]:
    for joint, actions in result.reactions().items():
        for slot, action in actions.items():
            for part, (_, unit) in ACTIONS.items():
                values = getattr(action, part)
                if values is not None:
                    yield from _components(f"{joint}.{slot}.{part}", unit, values, AXES)


def _of_quantity(quantity: Quantity) -> Iterator[TableColumn]:
    columns = np.atleast_2d(quantity.values.T)
    for name, values in zip(quantity.columns, columns, strict=True):
        yield TableColumn(name, quantity.unit, values)


def _components(
    name: str, unit: str, values: Floats, components: Iterable[str]
) -> Iterator[TableColumn]:
    for k, component in enumerate(components):
        yield TableColumn(f"{name}.{component}", unit, values[:, k])


def _rows(result: "Result") -> Iterator[tuple[str, int, int]]:
    """(joint, row of the joint from 1, row of the model)."""
    summary = result.summary
    for joint, place in summary.joint_index.items():
        for k in range(int(summary.joint_rows[place])):
            yield joint, k + 1, int(summary.joint_start[place]) + k
