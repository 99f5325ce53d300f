"""Stored arrays of a result, and what it holds of its model: all other quantities follow."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import NamedTuple

import attrs
import numpy as np

from dap3d_core.model import Model
from dap3d_core.model.groups import Floats, Integers
from dap3d_core.model.rotations import read_only
from dap3d_core.model.state_layout import Layout, bodies_of, row_layout, state_layout, u_from_y

#: Components of a vector, and of Euler parameters.
AXES = ("x", "y", "z")
EULER = ("e0", "e1", "e2", "e3")
#: Numbers in a block.
BLOCK = 2**18
#: Results of more bytes are not read as a whole, and long runs hold no more in memory.
LARGE = 2**26
#: Separates the name of a contact from the number of one of its points.
POINT = "#"


@attrs.frozen(eq=False)
class ModelSummary:
    """The part of a model that a result and its file hold.

    Attributes:
        body_names, joint_names, point_names: in file order; ground is not among the bodies,
            animation points come last, and points of contacts, which have rows, behind the joints.
        mass: (n,) kg.
        Jp: (n, 3, 3) inertia matrices in body axes, kg m^2.
        joint_rows: (joints,) constraint rows of each joint.
        point_body: (points,) body of each point: 1 to n, 0 for ground.
        point_local: (points, 3) coordinates on that body, m.
        has_potential: True if every force has a potential (which a damper in it may not).
        is_isolated: True if momentum is conserved: no force, and no joint with ground or with a
            single body.
        angle_count: number of angles with counted turns.
        angle_names: of these, as in ``Model.angle_names``; none in files of older programs.
        state_names: (states,) of each number of the elements' states: forces.spring.z, or
            forces.spring.z.1 where there are several.
        input_names: of the inputs, in file order.
    """

    body_names: tuple[str, ...]
    mass: Floats
    Jp: Floats
    joint_names: tuple[str, ...]
    joint_rows: Integers
    point_names: tuple[str, ...]
    point_body: Integers
    point_local: Floats
    has_potential: bool
    is_isolated: bool
    angle_count: int = 0
    angle_names: tuple[str, ...] = ()
    state_names: tuple[str, ...] = ()
    input_names: tuple[str, ...] = ()

    @property
    def body_count(self) -> int:
        """Number of bodies n, ground not counted."""
        return len(self.body_names)

    @property
    def row_count(self) -> int:
        """Number of constraint rows m."""
        return int(self.joint_rows.sum())

    @cached_property
    def joint_start(self) -> Integers:
        """(joints + 1,) first row of each joint."""
        return np.concatenate([[0], np.cumsum(self.joint_rows)]).astype(np.int64)

    @cached_property
    def body_index(self) -> dict[str, int]:
        """Name of a body -> its index."""
        return _index(self.body_names)

    @cached_property
    def point_index(self) -> dict[str, int]:
        """Name of a point -> its index."""
        return _index(self.point_names)

    @cached_property
    def joint_index(self) -> dict[str, int]:
        """Name of a joint -> its index; of joints that are no points of contacts."""
        count = len(self.joint_names) - sum(map(len, self.contacts.values()))
        return _index(self.joint_names[:count])

    @cached_property
    def contacts(self) -> dict[str, list[str]]:
        """Declared contacts, each with the names of its points, in the order of the scene."""
        found: dict[str, list[str]] = {}
        known = set(self.state_names)
        for label in self.state_names:
            kind, name, *state = label.split(".")
            if kind == "joints" and state == ["mode"] and f"joints.{name}.near.1" in known:
                found.setdefault(name.partition(POINT)[0], []).append(name)
        return found

    @property
    def contact_points(self) -> list[str]:
        """Names of the points of all contacts."""
        return [point for points in self.contacts.values() for point in points]


def _index(names: tuple[str, ...]) -> dict[str, int]:
    return {name: k for k, name in enumerate(names)}


def is_summary_of(summary: ModelSummary, model: Model) -> bool:
    """True if arrays of a summary have the layout of a model's bodies and rows."""
    return (
        tuple(model.body_names) == tuple(summary.body_names)
        and tuple(model.joint_names) == tuple(summary.joint_names)
        and np.array_equal(model.joint_rows, summary.joint_rows)
    )


def summary_of(model: Model) -> ModelSummary:
    """The summary of a model."""
    same = ("body_names", "mass", "Jp", "joint_names", "joint_rows", "point_names", "point_body",
            "point_local", "angle_count", "angle_names", "input_names")  # fmt: skip
    return ModelSummary(
        **{name: getattr(model, name) for name in same},
        has_potential=all("energy" in g.type_info.type.kernels() for g in model.forces),
        is_isolated=not model.forces
        and all(len(slots) > 1 and 0 not in slots for slots in model.joint_slots),
        state_names=tuple(model.state_labels),
    )


class Column(NamedTuple):
    """A stored array: name, dimension besides time ("" for none), unit and meaning.

    The unit is "SI" where it differs from entry to entry; the meaning lists the units.
    """

    name: str
    dimension: str
    unit: str
    meaning: str

    @property
    def dimensions(self) -> tuple[str, ...]:
        """All dimensions, time first."""
        return ("time", self.dimension) if self.dimension else ("time",)


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
    Column("angles", "angle", "rad", "angles of forces and joints, whole turns counted"),
    Column("states", "element_state", "SI", "states of their own of forces and joints"),
    Column("inputs", "input", "1", "inputs of the scene, as they acted at that instant"),
)
#: Present only where a run estimated its error (post/global_error.py).
U_ERROR = Column(
    "u_error", "state", "SI", "estimated global error of the state u, entry by entry; no bound"
)


@attrs.define(eq=False, slots=False)
class Arrays:
    """Arrays of n bodies and m constraint rows at nt instants; read-only.

    Attributes:
        t: (nt,) s.
        u: (nt, 13 n) states, angular velocities in global axes.
        v_dot: (nt, 6 n) accelerations r_ddot, omega_dot of each body, global axes.
        Lam: (nt, m) Lagrange multipliers.
        work: (nt,) J, done on the system by forces and drivers.
        potential_energy: (nt,) J.
        position_residual, velocity_residual, acceleration_residual: (nt,) largest magnitude.
        angles: (nt, k) of k angles whose turns are counted, rad, as in ``Model.angles_of``.
        states: (nt, s) states of forces and joints, as in ``ModelSummary.state_names``.
        inputs: (nt, k) of k inputs of the scene.
        u_error: (nt, 13 n) estimated error of u; None where the run made no estimate.
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
    states: Floats
    inputs: Floats
    u_error: Floats | None = None

    def __attrs_post_init__(self) -> None:
        for array in self.columns():
            read_only(array)
        if self.u_error is not None:
            read_only(self.u_error)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def has_error(self) -> bool:
        """True if there is an estimate of the error of u."""
        return self.u_error is not None

    @property
    def width(self) -> int:
        """Numbers of u, v_dot, Lam, angles, states and inputs at an instant."""
        every = self.u, self.v_dot, self.Lam, self.angles, self.states, self.inputs
        return sum(a.shape[1] for a in every)

    def columns(self) -> Iterator[Floats]:
        """The arrays of ``COLUMNS``, in their order."""
        return (getattr(self, column.name) for column in COLUMNS)

    def part(self, rows: slice) -> "Arrays":
        """Arrays of some of the instants; views where the arrays are in memory."""
        part = Arrays(*(array[rows] for array in self.columns()))
        return part if self.u_error is None else part.with_error(self.u_error[rows])

    def at(self, indices: Integers) -> "Arrays":
        """Arrays at single instants, (k,) rising indices, without the estimate of the error."""
        return Arrays(*(array[indices] for array in self.columns()))

    def blocks(self) -> "Iterator[Arrays]":
        """Consecutive parts of about BLOCK numbers each."""
        step = max(1, BLOCK // (len(COLUMNS) + self.width))
        return (self.part(slice(first, first + step)) for first in range(0, len(self), step))

    def with_error(self, u_error: Floats) -> "Arrays":
        """The same arrays, in memory, with an estimate of the error of u."""
        arrays = Arrays(*self.columns())
        arrays.u_error = read_only(u_error)
        return arrays


def joined(parts: Sequence[Arrays]) -> Arrays:
    """Consecutive parts as one."""
    columns = zip(*(part.columns() for part in parts), strict=True)
    return Arrays(*map(np.concatenate, columns))


def column_sizes(summary: ModelSummary) -> dict[str, int]:
    """Length of each dimension that a column may have besides time."""
    row = _layout(summary)
    sizes = {"velocity": "v_dot", "row": "Lam", "angle": "angles", "element_state": "states"}
    state = state_layout(summary.body_count).size
    inputs = len(summary.input_names)
    return {"state": state} | {k: row.length(name) for k, name in sizes.items()} | {"input": inputs}


def _layout(summary: ModelSummary) -> Layout:
    s = summary
    states, inputs = len(s.state_names), len(s.input_names)
    return row_layout(s.body_count, s.row_count, s.angle_count, states, inputs)


def _states(y: Floats, states: int) -> Floats:
    """States u of integrated states, bit for bit the same however the rows are cut into pieces.

    Of one vector alone numpy adds the products in another order than of several.
    """
    if len(y) > 1:
        return u_from_y(y, states)
    return u_from_y(np.repeat(y, 2, axis=0), states)[:1] if len(y) else bodies_of(y, states)


def arrays_of(rows: Floats, summary: ModelSummary) -> Arrays:
    """Splits rows of integrator output into arrays.

    Args:
        rows: (nt, width): t; the integrated state (angular velocity in body axes; states of
            elements; work last); v_dot; lambda; angles; potential energy; largest residuals of the
            three levels; inputs.
        summary: the model of the rows.

    Raises:
        ValueError: the rows have another width.
    """
    rows = np.asarray(rows, dtype=float)
    width = _layout(summary).size
    if rows.ndim != 2 or rows.shape[1] != width:
        raise ValueError(f"rows should have the shape (nt, {width}), not {rows.shape}")
    layout = _layout(summary)
    t, _, _, states, work, v_dot, Lam, angles, energy, residuals, inputs = (
        rows[:, layout[name]] for name in layout.names
    )
    y = rows[:, layout["coordinates"].start : layout["work"].stop]
    u = _states(y, states.shape[1])
    columns = (
        t[:, 0],
        u,
        v_dot,
        Lam,
        work[:, 0],
        energy[:, 0],
        *residuals.T,
        angles,
        states,
        inputs,
    )
    return Arrays(*map(np.array, columns))
