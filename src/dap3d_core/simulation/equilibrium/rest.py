"""Equilibria of a compiled model: search, stability, reactions, what is to be said of them."""

from collections.abc import Iterator

import attrs
import numpy as np

from dap3d_core.formulations.common.friction import PASSES, forces_by
from dap3d_core.formulations.constraint_rows import ConstraintRows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.interface.codegen.kernel_arguments import parameters
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Group, Model
from dap3d_core.model.state_layout import at_rest, velocities_of
from dap3d_core.registry.suggestions import MOST_NAMES, some
from dap3d_core.result import information
from dap3d_core.simulation.equilibrium.search import (
    Outcome,
    Search,
    Stability,
    stability_of,
)
from dap3d_core.simulation.equilibrium.statics import (
    MOST_STEPS,
    OPEN,
    SETTLED,
    StaticPose,
    Statics,
    moving_states,
    refuse_carried,
    unsettled_part,
)
from dap3d_core.simulation.errors import AssemblyError, SimulationError, refuse_collisions
from dap3d_core.simulation.initial.start_state import StartState

#: Singular values of the Jacobian below this part are left out of the least multipliers.
RCOND = 1e-10
#: The forces that joints bring have settled where a pass changes the multipliers by less than this
#: part; they are carried by joints where less than the second part of them is left.
PASS_SETTLED, CARRIED = 1e-12, 1e-8
#: Gap, m of a scene of ordinary size, below which bodies touch.
TOUCHING = 1e-8
#: Bodies that move this part of the largest motion, or more, are named.
ALIKE = 0.5
#: A direction counts as an axis if this cosine belongs to it.
ALONG_AXIS = 0.999


@attrs.frozen(eq=False)
class EquilibriumSolution:
    """An equilibrium as it was found.

    Attributes:
        u: (13 n,) the state, without velocities.
        angles: (angles,) angles whose turns are counted, rad.
        states: (s,) states of elements.
        multipliers: (rows,) lambda, those of least norm where they are not unique.
        unbalanced: (n, 6) force, N, and moment about the mass centre, N m, of forces and reactions
            together on each body.
        search, stability: how it was found, whether it is stable.
        notes: what to know of it.
    """

    u: Floats
    angles: Floats
    states: Floats
    multipliers: Floats
    unbalanced: Floats
    search: Search
    stability: Stability
    notes: tuple[str, ...]


def find_rest(
    evaluator: Evaluator, u: Floats, angles: Floats | None = None, states: Floats | None = None
) -> EquilibriumSolution:
    """The equilibrium that a model comes to from a state u (13 n,) on the constraints.

    Args:
        u: the state; its velocities are left out.
        angles: (angles,) from which turns are counted on; None where they begin at zero.
        states: (s,) states of elements to begin with; None for their initial values.

    Raises:
        SimulationError: there is none, or none was found; names what gives way.
    """
    refuse_collisions(evaluator.model, "the search for an equilibrium")
    evaluator.start(0.0, u, angles, states)
    if evaluator.model.contact_count:
        _hold_contacts(evaluator, u, "at the start of the search for an equilibrium")
    search = Search(Statics(evaluator), u)
    if evaluator.model.state_count:
        _let_states_rest(evaluator, search, u)
    if search.outcome is not Outcome.BALANCED:
        raise SimulationError(failure(search, evaluator.model))
    statics, pose = Statics(evaluator), search.pose
    if evaluator.model.contact_count:
        _hold_contacts(evaluator, pose.u, "no equilibrium: where the forces balance")
    stability = stability_of(statics, pose)
    rows = evaluator.rows(0.0, pose.u)
    multipliers, unbalanced = least_multipliers(statics, pose.u)
    return EquilibriumSolution(
        pose.u,
        evaluator.counted_angles(0.0, pose.u),
        evaluator.states.copy(),
        multipliers,
        unbalanced,
        search,
        stability,
        (*findings(search, stability, evaluator.model), *assumptions(evaluator, u, rows)),
    )


def _hold_contacts(evaluator: Evaluator, u: Floats, where: str) -> None:
    """Let what touches at a pose of u (13 n,) hold, as far as friction does: the cone problem."""
    from dap3d_core.formulations.contacts.contact_table import GAP, ContactTable, words_of_drive
    from dap3d_core.formulations.contacts.decide import find_modes_at_rest

    table, still = ContactTable(evaluator), at_rest(u)
    gaps, limit = table.outputs(0.0, still)[:, GAP], TOUCHING * table.length
    s, touching = table.arrays(), np.flatnonzero(gaps < limit)
    s.y[:] = evaluator.integrated(still)
    s.in_touch[: len(touching)], s.in_touch_count = touching, len(touching)
    given = evaluator.system, evaluator.loops, evaluator.functions, table.tensions
    if find_modes_at_rest(0.0, s, *given):
        bad = [table.names[k] for k in np.flatnonzero((s.mode == 1.0) & (s.mu > 0.0))]
        slips = "slips"
    else:
        bad, slips = [table.names[k] for k in np.flatnonzero(s.jams)], "jams"
    if (drives := np.flatnonzero(~(np.minimum(s.mu, s.mu_s) >= 0.0))).size:
        c = int(drives[0])
        words = words_of_drive(table.names[c], float(min(s.mu[c], s.mu_s[c]) * s.arm[c]))
        raise SimulationError(f"{where} contact {words}")
    if over := [table.names[k] for k in np.flatnonzero(gaps < -limit)]:
        bad, slips = over, "overlaps"
    if bad:
        raise SimulationError(
            f"{where} contact {some(bad)} {slips}. Contacts rest where friction holds "
            "them from the start on: take a start that rests, such as the end of a damped run "
            "(start=result)"
        )
    states = evaluator.states.copy()
    states[table.mode], states[table.way], states[table.near] = s.mode, s.way, 0.0
    evaluator.states = states


def least_multipliers(statics: Statics, u: Floats) -> tuple[Floats, Floats]:
    """(rows,) multipliers of least norm at an equilibrium u (13 n,), (n, 6) what they leave."""
    evaluator = statics.evaluator
    D = evaluator.rows(statics.t, u).dense()
    force = evaluator.applied_forces(statics.t, u).ravel()
    multipliers = _least(statics, D, force)
    if evaluator.model.brought_forces:
        multipliers, force = _with_brought(statics, u, D, force, multipliers)
    return multipliers, (force + D.T @ multipliers).reshape(-1, 6)


def _least(statics: Statics, D: Floats, force: Floats) -> Floats:
    """(rows,) multipliers of least norm that balance forces (6 n,)."""
    if not len(D):
        return np.zeros(0)
    least = np.linalg.lstsq(D.T * statics.scale[:, None], statics.scale * force, rcond=RCOND)[0]
    return -least


def _with_brought(
    statics: Statics, u: Floats, D: Floats, applied: Floats, multipliers: Floats
) -> tuple[Floats, Floats]:
    """Multipliers and forces (6 n,), with the forces that joints bring: in rigid bearings."""
    evaluator, force = statics.evaluator, applied
    left = statics.scale * (applied + D.T @ multipliers)
    for _ in range(PASSES):
        evaluator.place(statics.t, u)
        force = applied + forces_by(statics.t, evaluator.system, evaluator.loops, multipliers)[6:]
        before, multipliers = multipliers, _least(statics, D, force)
        if np.max(np.abs(multipliers - before)) <= PASS_SETTLED * np.max(np.abs(multipliers)):
            break
    moves = statics.scale * (force + D.T @ multipliers) - left
    if np.max(np.abs(moves)) > CARRIED * np.max(np.abs(statics.scale * (force - applied))):
        names = some(list(evaluator.model.brought_forces.values()))
        raise SimulationError(
            f"statics does not know how forces of {names} move the wheels that they press apart: "
            "their axes are not held by joints. Take the force gear, an elastic mesh, or "
            "pressure_angle = 0"
        )
    return multipliers, force


def _let_states_rest(evaluator: Evaluator, search: Search, u: Floats) -> None:
    """Make the pose of a search from u one at which the states of elements are at rest as well."""
    refuse_carried(evaluator, u, search.pose.u)
    moving = moving_states(evaluator, search.pose.u)
    if not moving:
        return
    statics = Statics(evaluator)
    statics.settles = False
    found = solve_coupled(statics, search.pose)
    if found is None:
        raise SimulationError(f"no equilibrium: the rate of {moving} vanishes neither for any "
                              "value of the state nor at another pose")  # fmt: skip
    search.pose, search.outcome = found, Outcome.BALANCED


def start_at_rest(evaluator: Evaluator, u: Floats) -> StartState:
    """The equilibrium that a model comes to from a state u (13 n,), for a run to start there.

    Raises:
        SimulationError: there is none.
    """
    rest = find_rest(evaluator, u)
    steps = rest.search.steps
    note = information(f"the run starts at an equilibrium, found in {steps} steps")
    return StartState(rest.u, rest.angles, (note, *rest.notes), states=rest.states)


def solve_coupled(statics: Statics, pose: StaticPose) -> StaticPose | None:
    """The pose at which forces and rates vanish, by Newton's method; None where it finds none."""
    evaluator, kept, before = statics.evaluator, statics.evaluator.states, np.inf
    for _ in range(MOST_STEPS):
        fixed = statics.fixed_tangent(pose)
        own = fixed.states
        assert own is not None
        left = max(pose.residual, unsettled_part(own, evaluator.states))
        if left <= SETTLED:
            return pose
        if not left < 1e3 * before:
            break
        before = min(before, left)
        basis = statics.scale[:, None] * pose.free
        matrix = np.block(
            [[-statics.reduced(fixed.stiffness, pose), basis.T @ own.force_by_states.toarray()],
             [own.rate_by_displacement @ basis, own.rate_by_states.toarray()]]
        )  # fmt: skip
        step = _least_solution(matrix, -np.concatenate([pose.unbalanced, own.rates]))
        evaluator.states = evaluator.states + step[pose.free.shape[1] :]
        try:
            pose = statics.behind(pose.u, pose.free @ step[: pose.free.shape[1]])
        except (AssemblyError, np.linalg.LinAlgError):
            break
    evaluator.states = kept
    return None


def _least_solution(matrix: Floats, side: Floats) -> Floats:
    """The least solution of equations of different units, columns and rows scaled."""
    rows = np.max(np.abs(matrix), axis=1, initial=0.0)
    rows[rows == 0.0] = 1.0
    columns = np.max(np.abs(matrix / rows[:, None]), axis=0, initial=0.0)
    columns[columns == 0.0] = 1.0
    scaled = matrix / rows[:, None] / columns
    return np.linalg.lstsq(scaled, side / rows, rcond=OPEN)[0] / columns


def findings(search: Search, stability: Stability, model: Model) -> Iterator[str]:
    """Notes on the equilibrium itself."""
    if not stability.stable:
        moves = describe_motion(model, stability.escaping[0])
        where = "the start is" if search.started_balanced else "it is"
        yield (
            f"{where} an unstable equilibrium: it leaves along a freedom of {moves}; "
            "move a body off it to see where the scene comes to rest"
        )
    elif search.started_balanced:
        yield information("the start is an equilibrium")
    if search.left:
        yield (
            "an unstable equilibrium lay on the way and was left to one of two sides that are "
            "alike; the pose on the other side may be another equilibrium"
        )
    count = len(stability.indifferent)
    if count:
        moves = describe_motion(model, stability.indifferent[0])
        others = f" and {count - 1} more" if count > 1 else ""
        yield information(
            f"indifferent: nothing drives or holds a freedom of {moves}{others}; "
            "it is where the start has it"
        )
    if not stability.is_symmetric:
        yield information(
            "forces without a potential act: stability is that of small motions, "
            "with masses and dampers"
        )


def assumptions(evaluator: Evaluator, start: Floats, rows: ConstraintRows) -> Iterator[str]:
    """Notes on what statics leaves out.

    Args:
        start: (13 n,) the state that the search began at.
        rows: of the constraints at the equilibrium.
    """
    model = evaluator.model
    if np.any(velocities_of(start)):
        yield information("velocities of the start are left out")
    timed = [name for group in model.forces for name in _of_time(group, model)]
    if timed:
        listed = some(timed)
        yield information(f"forces that depend on time are those at t = 0: {listed}")
    driven = model.row_owners(np.flatnonzero(rows.nu))
    if driven:
        listed = some(driven)
        yield information(f"drivers are at rest at their initial values: {listed}")
    if model.friction:
        yield (
            "friction is left out: with it the scene can rest at other poses near this one as well"
        )
    rolling = model.row_owners(np.flatnonzero(~model.position_row & (rows.nu == 0.0)))
    if rolling:
        yield information(
            "what rolls or sticks constrains displacements as it does velocities: "
            f"{some(rolling)}; where the scene comes to rest depends on the way there"
        )


def _of_time(group: Group, model: Model) -> Iterator[str]:
    """Names of the forces of a group that depend on time."""
    law = "friction" if group.read else "wrench"
    always = "t" in parameters(group.type_info.kernels[law])
    functions = len(group.type_info.layout.functions)
    for member, columns in zip(group.members, group.functions[:, :functions], strict=True):
        if always or set(columns.tolist()) - {0, *model.input_rows.tolist()}:
            yield model.force_names[int(member)]


def failure(search: Search, model: Model) -> str:
    """Why a search found no equilibrium."""
    pose = search.pose
    if search.outcome is Outcome.RUNAWAY:
        return (
            f"there is no equilibrium: nothing stops {describe_motion(model, search.motion)} "
            "without end (free fall, or a drive without a load?); add a joint or a spring that "
            "holds it"
        )
    moves = describe_motion(model, pose.free @ pose.unbalanced)
    return (
        f"no equilibrium was found in {search.steps} steps: {pose.residual:.2g} of the forces is "
        f"not balanced along a freedom of {moves}. Start nearer to the equilibrium; the forces may "
        "jump there, or have none"
    )


def describe_motion(model: Model, x: Floats) -> str:
    """Which bodies move most, and how the first of these does.

    x: (n, 6) or (6 n,) displacement in parts of a length of the scene, and rotation vector, of
        each body, global axes.
    """
    x = np.asarray(x).reshape(-1, 6)
    shift, turn = (np.linalg.norm(part, axis=1) for part in (x[:, :3], x[:, 3:]))
    slides = float(np.max(shift, initial=0.0)) > float(np.max(turn, initial=0.0))
    amount, part = (shift, x[:, :3]) if slides else (turn, x[:, 3:])
    order = np.argsort(-amount, kind="stable")
    most = [int(k) for k in order if amount[k] >= ALIKE * amount[order[0]]]
    names = ", ".join(model.body_names[k] for k in sorted(most[:MOST_NAMES]))
    more = f" and {len(most) - MOST_NAMES} more" if len(most) > MOST_NAMES else ""
    first = most[0]
    verb = "moves along" if slides else "turns about"
    which = "which" if len(most) == 1 else f"of which {model.body_names[first]}"
    noun = "body" if len(most) == 1 else "bodies"
    return f"{noun} {names}{more}, {which} {verb} {direction(part[first])}"


def direction(vector: Floats) -> str:
    """The direction of a vector: an axis with its sign, or three components."""
    unit = vector / np.linalg.norm(vector)
    k = int(np.argmax(np.abs(unit)))
    if abs(unit[k]) >= ALONG_AXIS:
        return f"{'-' if unit[k] < 0.0 else '+'}{'xyz'[k]}"
    return "(" + ", ".join(f"{c:.2g}" for c in np.round(unit, 2) + 0.0) + ")"
