"""The arrays that a result stores; all others are computed from them."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import attrs
import numpy as np

from dap3d_core.model.groups import Floats, Integers
from dap3d_core.model.state_layout import Layout, from_integrated, row_layout, state_layout
from dap3d_core.result.model_summary import Subject


class Column(NamedTuple):
    """One stored array: its name, its dimension besides time ("" for none), unit and meaning."""

    name: str
    dimension: str
    unit: str
    meaning: str


#: Numbers in a block.
BLOCK = 2**18

#: "SI" stands where the unit differs from entry to entry; the meaning says how.
COLUMNS = (
    Column("t", "", "s", "time"),
    Column(
        "u",
        "state",
        "SI",
        "state: r (m), p of each body, then r_dot (m/s), omega (rad/s, global axes) of each body",
    ),
    Column(
        "v_dot",
        "velocity",
        "SI",
        "accelerations: r_ddot (m/s^2), omega_dot (rad/s^2, global axes) of each body",
    ),
    Column("Lam", "row", "SI", "Lagrange multipliers by joint and row (N, N m or as the row says)"),
    Column("work", "", "J", "work done on the system by forces and drivers since the start"),
    Column("potential_energy", "", "J", "potential energy of the forces that have one"),
    Column("position_residual", "", "SI", "largest |C| of the constraint rows"),
    Column("velocity_residual", "", "SI", "largest |D v - nu| of the constraint rows"),
    Column("acceleration_residual", "", "SI", "largest |D v_dot - gamma| of the constraint rows"),
    Column("angles", "angle", "rad", "angles of forces and joints that count whole turns"),
)


@attrs.frozen(eq=False)
class Arrays:
    """What was reported, for n bodies and m constraint rows at nt instants; read-only.

    Attributes:
        t: (nt,) s.
        u: (nt, 13 n) states, angular velocities in global axes (spec 1).
        v_dot: (nt, 6 n) accelerations r_ddot, omega_dot of each body, global axes.
        Lam: (nt, m) Lagrange multipliers.
        work: (nt,) J, done on the system by forces and drivers.
        potential_energy: (nt,) J.
        position_residual, velocity_residual, acceleration_residual: (nt,) largest magnitude.
        angles: (nt, k) of k angles whose turns are counted, rad, as ``Model.angles_of`` has them.
        u_error: (nt, 13 n) estimated error of u (post/global_error.py); None where none was asked
        for.
    """

    t: Floats
    u: Floats
    v_dot: Floats
    Lam: Floats
    work: Floats
    potential_energy: Floats
    position_residual: Floats
    velocity_residual: Floats
    acceleration_residual: Floats
    angles: Floats
    u_error: Floats | None = None

    def __attrs_post_init__(self) -> None:
        for column in COLUMNS:
            getattr(self, column.name).flags.writeable = False
        if self.u_error is not None:
            self.u_error.flags.writeable = False

    def __len__(self) -> int:
        return len(self.t)

    @property
    def has_error(self) -> bool:
        """Whether there is an estimate of the error of u."""
        return self.u_error is not None

    def part(self, rows: slice) -> "Arrays":
        """The same for some of the instants; of arrays in memory these are views."""
        error = None if self.u_error is None else self.u_error[rows]
        return arrays_from((getattr(self, column.name)[rows] for column in COLUMNS), error)

    def at(self, places: Integers) -> "Arrays":
        """The same at some instants alone, (k,) places."""
        return arrays_from(getattr(self, column.name)[places] for column in COLUMNS)

    def blocks(self) -> "Iterator[Arrays]":
        """Parts of some hundred thousand numbers each, in order: all of it in little memory."""
        width = len(COLUMNS) + self.width
        for rows in block_rows(len(self), width):
            yield self.part(rows)

    @property
    def width(self) -> int:
        """Numbers of u, v_dot, Lam and angles at an instant."""
        return sum(a.shape[1] for a in (self.u, self.v_dot, self.Lam, self.angles))

    def with_error(self, u_error: Floats) -> "Arrays":
        """The same with an estimate of the error of u."""
        return arrays_from((getattr(self, column.name) for column in COLUMNS), u_error)


def arrays_from(columns: Iterable[Floats], u_error: Floats | None = None) -> Arrays:
    """Arrays from those of ``COLUMNS``, in their order."""
    names = (column.name for column in COLUMNS)
    return Arrays(**dict(zip(names, columns, strict=True)), u_error=u_error)


def joined(parts: Sequence[Arrays]) -> Arrays:
    """Parts that follow on one another, as one."""
    columns = ([getattr(part, column.name) for part in parts] for column in COLUMNS)
    return arrays_from(np.concatenate(column) for column in columns)


def block_rows(count: int, width: int) -> Iterator[slice]:
    """Slices of ``count`` rows of ``width`` numbers, each of BLOCK numbers or one row."""
    step = max(1, BLOCK // max(1, width))
    return (slice(first, min(first + step, count)) for first in range(0, count, step))


def column_sizes(subject: Subject) -> dict[str, int]:
    """Length of each dimension that a column may have besides time."""
    n, row = subject.body_count, _layout(subject)
    sizes = {"velocity": "v_dot", "row": "Lam", "angle": "angles"}
    return {"state": state_layout(n).size} | {k: row.length(name) for k, name in sizes.items()}


def row_width(subject: Subject) -> int:
    """Numbers in a row as the integrator delivers it."""
    return _layout(subject).size


def _layout(subject: Subject) -> Layout:
    return row_layout(subject.body_count, subject.row_count, subject.angle_count)


def _states(y: Floats) -> Floats:
    """States of integrated states, bit for bit the same however the rows are cut into pieces.

    Of one vector alone numpy adds the products in another order than of several.
    """
    if len(y) > 1:
        return from_integrated(y)
    return from_integrated(np.repeat(y, 2, axis=0))[:1] if len(y) else y[:, :-1]


def arrays_of(rows: Floats, subject: Subject) -> Arrays:
    """Take apart rows as the integrator delivers them.

    Args:
        rows: (nt, row_width): t; the integrated state (angular velocity in body axes, work last);
            v_dot; lambda; angles; potential energy; largest residuals of the three levels.
        subject: whose rows they are.

    Raises:
        ValueError: the rows have another width.
    """
    rows = np.asarray(rows, dtype=float)
    width = row_width(subject)
    if rows.ndim != 2 or rows.shape[1] != width:
        raise ValueError(f"rows should have the shape (nt, {width}), not {rows.shape}")
    layout = _layout(subject)
    t, *_, work, v_dot, Lam, angles, energy, residuals = (rows[:, layout[n]] for n in layout.names)
    u = _states(rows[:, layout["coordinates"].start : layout["work"].stop])
    columns = (t[:, 0], u, v_dot, Lam, work[:, 0], energy[:, 0], *residuals.T, angles)
    return arrays_from(np.array(column) for column in columns)
