"""One implicit integration, seen from Python; it has the face of ``Integration``."""

from collections.abc import Container, Iterator
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.formulations.common.constraints import PART as REGULAR
from dap3d_core.formulations.evaluator import Machine
from dap3d_core.formulations.stabilized_index2.jacobian_tables import coupled_bodies, make_tangent
from dap3d_core.formulations.stabilized_index2.stage_equations import Matrix
from dap3d_core.integrators.radau import state as at
from dap3d_core.integrators.radau.dispatch import radau_parts
from dap3d_core.integrators.radau.state import RadauWork
from dap3d_core.integrators.radau.step import advance
from dap3d_core.integrators.radau.tableau import ORDER, radau_method
from dap3d_core.integrators.runge_kutta.integration import Integration, switches_of
from dap3d_core.integrators.runge_kutta.tableau import Integers
from dap3d_core.integrators.stepping import integration_state
from dap3d_core.integrators.stepping.input_checks import (
    check_control,
    check_sizes,
    check_state_and_times,
)
from dap3d_core.integrators.stepping.restore import check_alike, check_pivots, restored
from dap3d_core.integrators.stepping.rounding import SMALLEST_ATOL
from dap3d_core.linear.lu.plan import LuPlan, make_lu_plan


class Effort(NamedTuple):
    """What an implicit integration has done besides what ``Statistics`` counts."""

    iterations: int
    jacobians: int
    factorisations: int


def make_matrix(machine: Machine, tangent: Any) -> tuple[Matrix, LuPlan]:
    """Places of the parts of the matrix s - J, and its elimination program."""
    plan, model = machine.plan, machine.model
    nodes, n = plan.ordering.nodes, model.body_count
    lu = make_lu_plan(n, nodes, coupled_bodies(tangent))
    of_row = {}
    joints = []
    for k, node in enumerate(nodes):
        first = int(plan.joint_row[node.joints[0]])
        of_row[first] = k
        joints.append((lu.joint_block(k), node.rows, first))
    places = []
    for _, b, _, first, _ in plan.blocks.tolist():
        k = of_row[first]
        places.append((*lu.joint_blocks(k, b), int(lu.joint_first[k])))
    held = np.zeros(plan.row_size, dtype=np.int64)
    held[machine.system.row] = model.position_row
    blocks = tangent.blocks.tolist()
    matrix = Matrix(
        nodes=lu.nodes,
        columns=lu.columns,
        updates=lu.updates,
        body_first=lu.body_first,
        body_place=np.array([0, *(lu.body_block(b, b) for b in range(1, n + 1))], dtype=np.int64),
        pair_place=np.array([lu.body_block(a, b) for _, a, b in blocks], dtype=np.int64),
        block_place=np.array(places, dtype=np.int64).reshape(-1, 3),
        joint_place=np.array(joints, dtype=np.int64).reshape(-1, 3),
        held=held,
        spin=np.zeros((n + 1, 15)),
        D=np.zeros(plan.block_size),
        compliance=np.zeros(plan.row_size),
    )
    return matrix, lu


class RadauIntegration(Integration):
    """An initial value problem on its way, integrated by Radau IIA of order 5.

    Parameters
    ----------
    machine
        The model; its formulation is unconstrained, standard or lsq (whose rows may depend on each
        other), not penalty.
    y0, times, rtol, atol, step, first_step, project_on, error_size, report_size, buffer_rows, ends
        As for ``Integration``.

    Raises
    ------
    ValueError
        For times, sizes, tolerances or steps that make no sense.
    """

    name = "radau"
    adaptive = True
    implicit = True

    def __init__(
        self,
        machine: Machine,
        y0: ArrayLike,
        times: ArrayLike,
        *,
        rtol: float = 1e-8,
        atol: ArrayLike = 1e-10,
        step: float | None = None,
        first_step: float | None = None,
        project_on: bool = False,
        error_size: int | None = None,
        report_size: int = 0,
        buffer_rows: int = 256,
        ends: ArrayLike = (),
    ) -> None:
        y = np.array(y0, dtype=np.float64)
        instants = np.array(times, dtype=np.float64)
        check_state_and_times(y, instants)
        check_control(cast(Any, self), rtol, atol, instants, step=step, first_step=first_step)
        error_size = y.size - 1 if error_size is None else error_size
        check_sizes(error_size, y.size - 1, buffer_rows)
        tangent = make_tangent(machine)
        matrix, lu = make_matrix(machine, tangent)
        self.machine, self.lu_plan, self.tangent, self.matrix = machine, lu, tangent, matrix
        self._work = _make_work(machine, lu, y, instants, buffer_rows, report_size, ends)
        self.work = cast(Any, self._work)  # its first arrays are those of Integration
        real, own, integer = self._work.real, self._work.own, self._work.integer
        real[integration_state.RTOL], absolute = estimate_tolerances(rtol, atol)
        self._work.tolerance[integration_state.ABSOLUTE] = absolute
        real[integration_state.STEP], real[integration_state.H] = step or 0.0, first_step or 0.0
        real[integration_state.T] = instants[0]
        own[at.FACCON] = own[at.ERROR_ACCEPTED] = 1.0
        own[at.PART] = REGULAR if machine.formulation.accepts_redundant else 0.0
        integer[integration_state.ORDER], integer[integration_state.ERROR_SIZE] = ORDER, error_size
        integer[integration_state.DENSE], integer[integration_state.PROJECT_ON] = 1, project_on
        integer[integration_state.WATCHED] = machine.counts_turns

    @cached_property
    def _parts(self) -> Any:
        return radau_parts()

    def _advance(self, budget: int) -> None:
        machine = self.machine
        advance(
            self._work, machine.functions, self._parts, machine.system, machine.loops,
            self.tangent, self.matrix, budget,
        )  # fmt: skip

    def _project(self) -> bool:
        """Nothing: it starts anew on the constraints by itself."""
        return True

    def state_arrays(self) -> list[Any]:
        """As ``Integration.state_arrays``."""
        matrix = self.matrix
        return [*super().state_arrays(), matrix.spin, matrix.D, matrix.compliance]

    def all_arrays(self) -> Iterator[tuple[str, Any]]:
        """As ``Integration.all_arrays``."""
        yield from super().all_arrays()
        yield from self.tangent.walk("tangent.")
        yield from self.matrix.walk("matrix.")

    def restored(self, name: str, array: Any, found: Any) -> Any:
        """As ``Integration.restored``."""
        if name == "own":
            return restored(name, array, found, (at.PART,))
        if name.startswith("method.") or (array.dtype.kind == "i" and "." in name):
            return restored(name, array, found, range(len(array)))
        if name in ("pivots", "pivotsc"):
            check_alike(name, found, array)
            sizes = self.lu_plan.nodes[:-1, 0]
            check_pivots(name, found, np.repeat(sizes, sizes))
        return super().restored(name, array, found)

    def allowed_integers(self, found: Integers) -> dict[int, Container[int]]:
        """As ``Integration.allowed_integers``."""
        return super().allowed_integers(found) | at.ALLOWED

    @property
    def slope(self) -> Any:
        """As ``Integration.slope``."""
        return (
            self._work.state[at.SLOPE].copy()
            if self.work.integer[integration_state.FRESH]
            else None
        )

    @property
    def effort(self) -> Effort:
        """What has been done besides steps and stages."""
        integer = self.work.integer
        names = (at.ITERATIONS, at.JACOBIANS, at.FACTORISATIONS)
        return Effort(*(int(integer[k]) for k in names))

    @property
    def multipliers(self) -> tuple[Any, Any]:
        """(rows,) mu and lambda of the last stage, in the order of the model."""
        row = self.machine.system.row
        last = self._work.last_multipliers[2]
        return last[0, row].copy(), last[1, row].copy()


def estimate_tolerances(rtol: float, atol: ArrayLike) -> tuple[float, Any]:
    """Tolerances of the error estimate, which is of order 3, for those of the result (RADAU5)."""
    leading = rtol if rtol > 0.0 else np.max(atol)
    factor = 0.1 * leading ** (2.0 / 3.0) / leading
    return rtol * factor, np.maximum(np.multiply(atol, factor), SMALLEST_ATOL)


def _make_work(
    machine: Machine, lu: LuPlan, y: Any, times: Any, buffer_rows: int, report_size: int, ends: Any
) -> RadauWork:
    n, rows, bodies = y.size, machine.plan.row_size, machine.model.body_count + 1
    state = np.zeros((at.RADAU_STATES, n))
    state[integration_state.Y] = y
    real = np.zeros(integration_state.LENGTHS + machine.length_count)
    integer = np.zeros(at.RADAU_INTEGERS, dtype=np.int64)
    real[[integration_state.LIMIT, integration_state.CUT, integration_state.LONGEST]] = np.inf
    switches, crossings = switches_of(integer, ends)
    return RadauWork(
        real=real,
        own=np.zeros(at.OWN),
        integer=integer,
        times=times,
        state=state,
        k=np.zeros((2, n)),
        terms=np.zeros((at.TERMS, n)),
        rows=np.empty((buffer_rows, 1 + n + report_size)),
        switches=switches,
        crossings=crossings,
        tolerance=np.zeros((integration_state.TOLERANCES, n)),
        Z=np.zeros((3, n)),
        Z_old=np.zeros((3, n)),
        F=np.zeros((3, n)),
        R=np.zeros((3, n)),
        multipliers=np.zeros((3, 2, rows)),
        last_multipliers=np.zeros((3, 2, rows)),
        G=np.zeros((3, 2, rows)),
        frames=np.zeros((3, bodies, 13)),
        x=np.zeros((3, lu.size)),
        along=np.zeros((3, bodies)),
        xr=np.zeros(lu.size),
        alongr=np.zeros(bodies),
        xc=np.zeros(lu.size, dtype=np.complex128),
        alongc=np.zeros(bodies, dtype=np.complex128),
        K=np.zeros(lu.matrix_size),
        Kc=np.zeros(lu.matrix_size, dtype=np.complex128),
        pivots=np.zeros(lu.size, dtype=np.int64),
        pivotsc=np.zeros(lu.size, dtype=np.int64),
        method=radau_method(),
    )
