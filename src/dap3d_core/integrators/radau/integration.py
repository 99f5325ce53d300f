"""An integration by Radau IIA of orders 5, 9 and 13."""

from collections.abc import Container, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.assembly.arrays import System
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.stabilized_index2.jacobian import BODY, FIRST_ROW, Tangent
from dap3d_core.formulations.stabilized_index2.stage_equations import StageMatrix
from dap3d_core.formulations.stabilized_index2.state_tangent import OF_LOOPS, make_tangent
from dap3d_core.integrators.radau import state as at
from dap3d_core.integrators.radau.dense_output import dense_state, find_slope
from dap3d_core.integrators.radau.error import estimate_error, find_work, measure_stage_noise
from dap3d_core.integrators.radau.newton import factorise_both, find_stages, find_tangent
from dap3d_core.integrators.radau.order import set_tolerances
from dap3d_core.integrators.radau.state import RadauState
from dap3d_core.integrators.radau.step import advance
from dap3d_core.integrators.radau.tableau import FEWEST, MOST_STAGES, ORDERS, STAGES, radau_method
from dap3d_core.integrators.stepping.integration import Integration, Refusals
from dap3d_core.integrators.stepping.restore import check_alike, check_pivots, restored
from dap3d_core.integrators.stepping.rounding import SMALLEST_ATOL
from dap3d_core.kernels.array_types import Integers
from dap3d_core.kernels.compiler.types import FLOAT, Signature, Tuple
from dap3d_core.kernels.runtime.cache import table_of
from dap3d_core.kernels.runtime.function_lists import LOOP_LIST
from dap3d_core.linear.lu import LuPlan, StateNode, make_lu_plan
from dap3d_core.linear.ordering.ordering import JointNode
from dap3d_core.model import Model
from dap3d_core.model.state_layout import COORDINATES, VELOCITIES

#: e_i of a tangent with dependent rows as part of the squared length of row i. Rows that depend on
#: others on the constraints alone, as those of Bennett's linkage, are independent by d aside, where
#: predicted stages are: below d^2 of this part the tangent takes them for rows that hold the motion
#: (docs/decisions/0033). Above, rows that are as little independent converge slowly.
REGULAR = 1e-6


#: The error estimate of steps with five and seven stages may be so many times the tolerance.
LOOSER = 3.0
#: Arrays of states of elements, which a scene without any has not in its checkpoints.
OF_STATES = ("tangent.states.", "matrix.state_")
#: Arrays that each tangent writes before it reads them.
SCRATCH = ("tangent.wide.", *(f"tangent.{name}" for name in OF_LOOPS))


def make_matrix(evaluator: Evaluator, tangent: Any) -> tuple[StageMatrix, LuPlan]:
    """Places of the parts of the matrix s - J, and its elimination program."""
    plan, model = evaluator.plan, evaluator.model
    nodes, n = plan.ordering.nodes, model.body_count
    starts = [int(plan.joint_row[node.joints[0]]) for node in nodes]
    readings = tangent.readings.tolist()
    reading = [_node_of(row[FIRST_ROW], starts, nodes) for row in readings]
    read = [(k, row[BODY]) for k, row in zip(reading, readings, strict=True) if row[BODY]]
    states = _state_nodes(model, nodes)
    blocks = tangent.blocks.tolist()
    coupled = [(a, b) for _, a, b in blocks if a != b]
    lu = make_lu_plan(n, nodes, coupled, states, read)
    of_row = {}
    joints = []
    for k, node in enumerate(nodes):
        first = starts[k]
        of_row[first] = k
        joints.append((lu.place[k, k], node.rows, first))
    places = []
    for _, b, _, first, _ in plan.blocks.tolist():
        k, body = of_row[first], lu.body(b)
        places.append((lu.place[k, body], lu.place[body, k], int(lu.joint_first[k])))
    state_nodes, state_places = _state_tables(evaluator, states, lu)
    held = np.zeros(plan.row_size, dtype=np.int64)
    held[evaluator.system.row] = model.position_row
    matrix = StageMatrix(
        nodes=lu.nodes,
        columns=lu.columns,
        updates=lu.updates,
        body_first=lu.body_first,
        body_place=np.array(
            [0, *(lu.place[b, b] for b in map(lu.body, range(1, n + 1)))], np.int64
        ),
        pair_place=np.array([lu.place[lu.body(a), lu.body(b)] for _, a, b in blocks], np.int64),
        block_place=np.array(places, dtype=np.int64).reshape(-1, 3),
        joint_place=np.array(joints, dtype=np.int64).reshape(-1, 3),
        read_place=np.array(
            [
                (
                    lu.place[lu.body(row[BODY]), k] if row[BODY] else -1,
                    nodes[k].rows,
                    row[FIRST_ROW] - starts[k],
                )
                for k, row in zip(reading, readings, strict=True)
            ],
            dtype=np.int64,
        ).reshape(-1, 3),
        state_nodes=state_nodes,
        state_places=state_places,
        held=held,
        spin=np.zeros((n + 1, 15)),
        D=np.zeros(plan.block_size),
        compliance=np.zeros(plan.row_size),
    )
    return matrix, lu


def _node_of(row: int, starts: Sequence[int], nodes: Sequence[JointNode]) -> int:
    """The joint node that a row belongs to."""
    return next(k for k, node in enumerate(nodes) if 0 <= row - starts[k] < node.rows)


def _state_nodes(model: Model, nodes: Sequence[JointNode]) -> list[StateNode]:
    """The elements with states of their own, in the order of these."""
    node_of = {joint: k for k, node in enumerate(nodes) for joint in node.joints}
    found = []
    for group in model.acting:
        width, is_joint = group.type_info.layout.state_width, group.type_info.type.kind == "joint"
        for member, bodies in zip(group.members.tolist(), group.bodies.tolist(), strict=True):
            if width:
                found.append(StateNode(width, tuple(bodies), node_of[member] if is_joint else -1))
    return found


def _state_tables(
    evaluator: Evaluator, states: Sequence[StateNode], lu: LuPlan
) -> tuple[Integers, Integers]:
    """Tables ``nodes`` and ``places`` of ``fill_states``."""
    plan, model = evaluator.plan, evaluator.model
    joints = [int(k) for g in model.joints if g.type_info.layout.states for k in g.members]
    joint = iter(joints)
    rows, places, first = [], [], 0
    widest = max((len(node.bodies) for node in states), default=0)
    for e, node in enumerate(states):
        own_node = lu.element(e)
        diagonal = lu.place[own_node, own_node]
        row = [first, int(lu.element_first[e]), diagonal, 0, 0, 0, 0, node.size]
        if node.joint >= 0:
            of_node = plan.ordering.nodes[node.joint]
            own = int(plan.joint_row[next(joint)])
            shift = own - int(plan.joint_row[of_node.joints[0]])
            row[3:7] = lu.place[node.joint, own_node], of_node.rows, shift, own
        rows.append(row)
        flat = []
        for b in node.bodies:
            body = lu.body(b)
            flat += [lu.place[own_node, body], lu.place[body, own_node]] if b else [-1, -1]
        places.append(flat + [-1] * (2 * widest - len(flat)))
        first += node.size
    return (
        np.array(rows, dtype=np.int64).reshape(-1, 8),
        np.array(places, dtype=np.int64).reshape(len(states), 2 * widest),
    )


class RadauIntegration(Integration):
    """An initial value problem, integrated by Radau IIA of orders 5, 9 and 13.

    Parameters
    ----------
    evaluator
        The model; its formulation is unconstrained, standard or lsq (whose rows may depend on each
        other), not penalty.
    y0, times, options
        As for ``Integration``.

    Raises
    ------
    ValueError
        For times, sizes, tolerances or steps that make no sense.
    """

    name = "radau"
    implicit = True
    state_class = RadauState
    state_rows = at.RADAU_STATES
    unscaled_size = 1  # the work done
    loop = staticmethod(advance)
    dense = staticmethod(dense_state)

    tangent: Any
    #: Types of tangent and matrix; the parts of a step, the tangent first.
    tangent_kinds: tuple[Any, Any] = (Tangent.type_of(), StageMatrix.type_of())
    parts: tuple[Any, ...] = (
        find_tangent, factorise_both, find_stages, estimate_error, find_slope, measure_stage_noise,
        find_work,
    )  # fmt: skip

    def __init__(
        self, evaluator: Evaluator, y0: ArrayLike, times: ArrayLike, **options: Any
    ) -> None:
        self.evaluator = evaluator
        self._y0 = y0
        #: Steps of fixed length are of order 5: their order is the caller's to know.
        self.most_stages = FEWEST if options.get("step") else MOST_STAGES
        super().__init__(
            evaluator.functions, evaluator.system, evaluator.loops, y0, times,
            length_count=evaluator.length_count, watched=evaluator.watched, **options,
        )  # fmt: skip
        work = self.work
        work.convergence_factor = work.accepted_error = 1.0
        work.regularisation = REGULAR if self._accepts_redundant else 0.0
        work.order, work.has_dense_output = ORDERS[0], 1
        work.stages = work.last_stages = FEWEST
        work.newton_limit = work.tolerances[0, at.LIMIT]

    @property
    def _accepts_redundant(self) -> bool:
        """True if rows of the tangent may depend on each other."""
        return self.evaluator.formulation.accepts_redundant

    def own_arrays(self, size: int, length_count: int) -> dict[str, Any]:
        """As ``Integration.own_arrays``; makes the tangent and the matrix, too."""
        rows, bodies, groups = self.make_tangent()
        lu, most, pairs = self.lu_plan, self.most_stages, self.most_stages // 2
        shapes: dict[str, Any] = {
            "own": len(RadauState.indices("own")),
            "k": (2, size),
            "terms": (at.TERMS, size),
            "nodes": at.TERMS,
            "blamed": size,
            **dict.fromkeys(("Z", "Z_old", "F", "R"), (most, size)),
            **dict.fromkeys(("multipliers", "last_multipliers", "G"), (most, 2, rows)),
            "frames": (most, bodies, 13),
            "x": (most, lu.size),
            "along": (most, bodies),
            **dict.fromkeys(("xr", "pivots"), lu.size),
            **dict.fromkeys(("xc", "pivotsc"), (pairs, lu.size)),
            "alongr": bodies,
            "alongc": (pairs, bodies),
            "K": lu.matrix_size,
            "Kc": (pairs, lu.matrix_size),
        }
        dtypes: dict[str, Any] = dict.fromkeys(("xc", "alongc", "Kc"), np.complex128)
        dtypes |= dict.fromkeys(("pivots", "pivotsc"), np.int64)
        arrays = {name: np.zeros(s, dtypes.get(name, np.float64)) for name, s in shapes.items()}
        arrays |= {"tolerances": self._tolerances, "counts": np.array(groups, dtype=np.int64)}
        return arrays | {"method": radau_method()}

    def make_tangent(self) -> tuple[int, int, tuple[int, int, int]]:
        """Make tangent, matrix and loops; rows, bodies with ground, and components of each kind.

        The kinds are coordinates, their rates, states of elements.
        """
        evaluator = self.evaluator
        self.tangent, self.own_loops = make_tangent(evaluator)
        self.matrix, self.lu_plan = make_matrix(evaluator, self.tangent)
        n, states = evaluator.model.body_count, evaluator.model.state_count
        return evaluator.plan.row_size, n + 1, (COORDINATES * n, VELOCITIES * n, states)

    def error_tolerances(self, rtol: float, atol: ArrayLike) -> tuple[float, Any]:
        """As ``Integration.error_tolerances``: those of order 5; ``tolerances`` has all."""
        size = np.size(self._y0)
        found = [estimate_tolerances(rtol, atol, s) for s in STAGES if s <= self.most_stages]
        self._tolerances = np.array(
            [[r, limit, *np.broadcast_to(a, size)] for r, limit, a in found]
        )
        return found[0][0], found[0][2]

    @cached_property
    def _parts(self) -> Any:
        """The parts of a step as first-class functions, each compiled separately.

        A compiled function that calls another one takes in its code, and optimises it again; calls
        by pointer keep the parts apart: part(t, h, work, (system, loops, tangent, matrix)).
        The tangent stands by itself: no derivative of a run needs its derivatives, as the iteration
        converges to the same stages with any.
        """
        given = Tuple((System.type_of(), LOOP_LIST, *self.tangent_kinds))
        kinds = RadauState.type_of(), given
        tangents = table_of(Signature(kinds), (self.parts[0],), values_alone=True)
        signature = Signature((FLOAT, FLOAT, *kinds), FLOAT)
        return table_of(signature, self.parts[1:]), tangents

    @property
    def loop_arguments(self) -> tuple[Any, ...]:
        """As ``Integration.loop_arguments``."""
        evaluator = self.evaluator
        return (self.work, evaluator.functions, *self._parts, evaluator.system, self.own_loops,
                self.tangent, self.matrix)  # fmt: skip

    def state_arrays(self) -> list[Any]:
        """As ``Integration.state_arrays``."""
        matrix = self.matrix
        return [*super().state_arrays(), matrix.spin, matrix.D, matrix.compliance]

    def all_arrays(self) -> Iterator[tuple[str, Any]]:
        """As ``Integration.all_arrays``."""
        yield from super().all_arrays()
        own = (*self.tangent.walk("tangent."), *self.matrix.walk("matrix."))
        without = SCRATCH if self.evaluator.model.state_count else (*SCRATCH, *OF_STATES)
        yield from ((name, array) for name, array in own if not name.startswith(without))

    def restored(self, name: str, array: Any, found: Any) -> Any:
        """As ``Integration.restored``."""
        if name == "own":
            return restored(name, array, found, self.indices("own", ("regularisation",)))
        is_constant = name.startswith("method.") or name in ("tolerances", "counts")
        if is_constant or (array.dtype.kind == "i" and "." in name):
            return restored(name, array, found, range(len(array)))
        if name in ("pivots", "pivotsc"):
            check_alike(name, found, array)
            sizes = self.lu_plan.nodes[:-1, 0]
            check_pivots(name, found, np.repeat(sizes, sizes))
        return super().restored(name, array, found)

    def restore(self, found: Mapping[str, Any]) -> None:
        """As ``Integration.restore``."""
        super().restore(found)
        set_tolerances(self.work)

    def allowed_integers(self, found: Mapping[str, int]) -> dict[str, Container[int]]:
        """As ``Integration.allowed_integers``."""
        stages = [s for s in STAGES if s <= self.most_stages]
        of_order = dict.fromkeys(("stages", "last_stages"), stages)
        return super().allowed_integers(found) | at.ALLOWED | of_order

    @property
    def dy_dt(self) -> Any:
        """As ``Integration.dy_dt``."""
        return self.work.state[at.SLOPE].copy() if self.work.first_stage_valid else None

    @property
    def refusals(self) -> Refusals:
        """As of ``Integration.refusals``."""
        w = self.work
        return Refusals(
            int(w.error_refusals), int(w.iteration_refusals), int(w.singular_refusals),
            int(np.argmax(w.blamed)),
        )  # fmt: skip


def estimate_tolerances(rtol: float, atol: ArrayLike, stages: int) -> tuple[float, float, Any]:
    """Relative tolerance of the error estimate, limit of the iteration, absolute tolerances.

    The estimate is of order s, the step's end of 2 s - 1: it is compared with a tenth of the
    tolerance to the power (s + 1) / (2 s) (RADAU). With more than three stages dense output has
    order s + 1 only (dense_output.py): it is held to the tolerance by LOOSER of it at most. The
    iteration ends with a change of a thirtieth of the tolerance.
    """
    leading = rtol if rtol > 0.0 else float(np.max(atol))
    factor = 0.1 * leading ** ((stages + 1.0) / (2.0 * stages)) / leading
    if stages > FEWEST:
        factor = min(factor, LOOSER)
    limit = min(0.03, 0.1**1.5 / factor)
    return rtol * factor, limit, np.maximum(np.multiply(atol, factor), SMALLEST_ATOL)
