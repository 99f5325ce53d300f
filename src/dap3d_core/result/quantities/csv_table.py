"""A result as a CSV table: a row for each instant, a column for each component, with its unit."""

import csv
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TextIO

import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.result.errors import ResultError
from dap3d_core.result.file.atomic_write import whole_file
from dap3d_core.result.post.reactions import DENSE_ROWS, jacobians
from dap3d_core.result.quantities.catalogue import ACTIONS, AXES, BODY, KINDS, POINT_ARRAYS, WHOLE
from dap3d_core.result.quantities.lookup import find

if TYPE_CHECKING:
    from dap3d_core.result.result import Result

#: Numbers that are turned into text at a time.
_BLOCK = 1_000_000
#: How a cell begins that spreadsheets take for a formula.
FORMULA = ("=", "+", "-", "@")


class Column(NamedTuple):
    """A column: the quantity's name, its unit, its values (nt,)."""

    name: str
    unit: str
    values: Floats

    @property
    def heading(self) -> str:
        """What stands above it: ``crank.r.x [m]``.

        Behind an apostrophe where a spreadsheet would take the name for a formula and work it out.
        """
        mark = "'" if self.name.startswith(FORMULA) else ""
        return f"{mark}{self.name} [{self.unit}]"


def columns_of(result: "Result", reactions: bool = True) -> list[Column]:
    """All columns: time, bodies, points, multipliers, reactions, energies, residuals.

    Named as ``Result.quantity`` takes them. Where a body and a point share a name, the point's are
    called NAME.rP.x, NAME.rPd.x, NAME.rPdd.x.

    Args:
        result: whose.
        reactions: whether reactions, which need the model, are among them.

    Raises:
        ResultError: the model cannot be had.
    """
    time, *others = WHOLE
    parts = [_of_whole(result, [time]), _of_bodies(result), _of_points(result), _of_rows(result)]
    if reactions:
        parts.append(_of_joints(result))
    return [column for part in [*parts, _of_whole(result, others)] for column in part]


def selected(result: "Result", names: Iterable[str]) -> list[Column]:
    """The time, and columns for quantities by name; a vector gives one for each component.

    Raises:
        UnknownNameError: there is no such quantity.
        ResultError: the model is needed and cannot be had.
    """
    columns = {"t": Column("t", "s", result.t)}
    for name in names:
        found = find(result, name)
        if found.values.ndim == 1:
            columns[name] = Column(name, found.unit, found.values)
        else:
            for k, component in enumerate(found.components):
                full = f"{name}.{component}"
                columns[full] = Column(full, found.unit, found.values[:, k])
    return list(columns.values())


def jacobian_columns(result: "Result") -> list[Column]:
    """The columns of the Jacobian, JOINT.Jac.ROW.BODY.rd.x and so on, without their values.

    Raises:
        ResultError: it is too large for a table, or the model cannot be had.
    """
    subject = result.subject
    if subject.row_count > DENSE_ROWS:
        raise ResultError(
            f"a Jacobian of {subject.row_count:,} rows does not go into a table (at most "
            f"{DENSE_ROWS:,}): write a .nc file, which holds its non-zero entries"
        )
    if subject.row_count:
        _ = result.machine
    velocities = [f"{b}.{q}.{c}" for b in subject.body_names for q in ("rd", "w") for c in AXES]
    nothing = np.zeros(0)
    return [
        Column(f"{joint}.Jac.{number}.{velocity}", "SI", nothing)
        for joint, number, _ in _rows(result)
        for velocity in velocities
    ]


def write_csv(
    result: "Result",
    path: Path,
    columns: list[Column],
    jacobian: list[Column] | None = None,
    *,
    force: bool = False,
) -> None:
    """Write columns to a file, whole or not at all. Numbers read back bit for bit.

    Args:
        result: whose columns they are.
        path: the file.
        columns: as ``columns_of`` or ``selected`` make them.
        jacobian: as ``jacobian_columns`` makes them; values are computed some instants at a time.
        force: whether an existing file is overwritten.

    Raises:
        ResultError: the file cannot be written.
    """
    with whole_file(path, force) as part, part.open("w", newline="", encoding="utf-8") as file:
        _write(file, result, columns, jacobian or [])


def _write(file: TextIO, result: "Result", columns: list[Column], more: list[Column]) -> None:
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(column.heading for column in (*columns, *more))
    size = max(1, _BLOCK // len((*columns, *more)))
    for start in range(0, len(result.t), size):
        rows = slice(start, start + size)
        block = np.column_stack([column.values[rows] for column in columns])
        if more:
            D = jacobians(result.machine, result.t[rows], result.u[rows])
            block = np.hstack([block, D.reshape(len(D), -1)])
        writer.writerows(block.tolist())  # repr of a float: reading gives the same number


def _of_whole(result: "Result", names: Iterable[str]) -> Iterator[Column]:
    for name in names:
        _, unit, values = WHOLE[name]
        yield Column(name, unit, values(result))


def _of_bodies(result: "Result") -> Iterator[Column]:
    arrays = {name: getattr(result, name) for name in BODY}
    for k, body in enumerate(result.subject.body_names):
        for name, kind in BODY.items():
            yield from _components(f"{body}.{name}", kind.unit, arrays[name][:, k], kind.components)


def _of_points(result: "Result") -> Iterator[Column]:
    bodies = frozenset(result.subject.body_names)
    arrays = {name: getattr(result, name) for name in POINT_ARRAYS}
    for k, point in enumerate(result.subject.point_names):
        for name, word in POINT_ARRAYS.items():
            shown = f"{point}.{name if point in bodies else word}"
            unit = KINDS["point"][word].unit
            yield from _components(shown, unit, arrays[name][:, k], AXES)


def _of_rows(result: "Result") -> Iterator[Column]:
    for joint, number, row in _rows(result):
        yield Column(f"{joint}.lambda.{number}", "SI", result.Lam[:, row])


def _of_joints(result: "Result") -> Iterator[Column]:
    for joint, actions in result.reactions().items():
        for slot, action in actions.items():
            for part, (_, unit) in ACTIONS.items():
                values = getattr(action, part)
                if values is not None:
                    yield from _components(f"{joint}.{slot}.{part}", unit, values, AXES)


def _components(
    name: str, unit: str, values: Floats, components: Iterable[str]
) -> Iterator[Column]:
    for k, component in enumerate(components):
        yield Column(f"{name}.{component}", unit, values[:, k])


def _rows(result: "Result") -> Iterator[tuple[str, int, int]]:
    """(joint, row of the joint from 1, row of the model)."""
    subject = result.subject
    for joint, start, count in zip(
        subject.joint_names, subject.joint_start, subject.joint_rows, strict=False
    ):
        for k in range(int(count)):
            yield joint, k + 1, int(start) + k
