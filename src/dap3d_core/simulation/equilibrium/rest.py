"""Equilibria of a compiled model: search, stability, reactions, what is to be said of them."""

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.result import INFORMATION
from dap3d_core.simulation.equilibrium.notes import assumptions, failure, findings
from dap3d_core.simulation.equilibrium.search import Outcome, Search, search_equilibrium
from dap3d_core.simulation.equilibrium.stability import Stability, stability_of
from dap3d_core.simulation.equilibrium.statics import Statics
from dap3d_core.simulation.errors import SimulationError, refuse_contacts
from dap3d_core.simulation.initial.start_state import StartState

#: Singular values of the Jacobian below this part are left out of the least multipliers.
RCOND = 1e-10


@attrs.frozen(eq=False)
class Rest:
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
    evaluator: Evaluator,
    u: Floats,
    angles: Floats | None = None,
    states: Floats | None = None,
) -> Rest:
    """The equilibrium that a model comes to from a state u (13 n,) on the constraints.

    Args:
        evaluator: the model.
        u: the state; its velocities are left out.
        angles: (angles,) from which turns are counted on; None where they begin at zero.
        states: (s,) states of elements to begin with; None for their initial values.

    Raises:
        SimulationError: there is none, or none was found; names what gives way.
    """
    refuse_contacts(evaluator.model, "the search for an equilibrium")
    evaluator.start(0.0, u, angles, states)
    search = search_equilibrium(evaluator, u)
    if evaluator.model.state_count:
        search = _with_states(evaluator, search)
    if search.outcome is not Outcome.BALANCED:
        raise SimulationError(failure(search, evaluator.model))
    statics, pose = Statics(evaluator), search.pose
    stability = stability_of(statics, pose)
    rows = evaluator.rows(0.0, pose.u)
    multipliers, unbalanced = least_multipliers(statics, pose.u)
    return Rest(
        pose.u,
        evaluator.counted_angles(0.0, pose.u),
        evaluator.states.copy(),
        multipliers,
        unbalanced,
        search,
        stability,
        (*findings(search, stability, evaluator.model), *assumptions(evaluator, u, rows)),
    )


def least_multipliers(statics: Statics, u: Floats) -> tuple[Floats, Floats]:
    """(rows,) multipliers of least norm at an equilibrium u (13 n,), (n, 6) what they leave."""
    evaluator = statics.evaluator
    D = evaluator.rows(statics.t, u).dense()
    force = evaluator.applied_forces(statics.t, u).ravel()
    multipliers = np.zeros(len(D))
    if len(D):
        multipliers = -np.linalg.lstsq(D.T * statics.scale[:, None], statics.scale * force,
                                       rcond=RCOND)[0]  # fmt: skip
    return multipliers, (force + D.T @ multipliers).reshape(-1, 6)


def _with_states(evaluator: Evaluator, search: Search) -> Search:
    """The search, its pose such that the states of elements are at rest as well.

    Raises:
        SimulationError: states do not come to rest; names them.
    """
    from dap3d_core.simulation.equilibrium.balanced_states import find_together
    from dap3d_core.simulation.equilibrium.states_at_rest import moving_states

    moving = moving_states(evaluator, 0.0, search.pose.u)
    if not moving:
        return search
    statics = Statics(evaluator)
    statics.settles = False
    found = find_together(statics, search.pose)
    if found is None:
        names = ", ".join(f"{state.element}.{state.name}" for state in moving)
        raise SimulationError(f"no equilibrium: the rate of {names} vanishes neither for any "
                              "value of the state nor at another pose")  # fmt: skip
    return attrs.evolve(search, pose=found, outcome=Outcome.BALANCED)


def start_at_rest(evaluator: Evaluator, u: Floats) -> StartState:
    """The equilibrium that a model comes to from a state u (13 n,), for a run to start there.

    Raises:
        SimulationError: there is none.
    """
    rest = find_rest(evaluator, u)
    steps = rest.search.steps
    note = f"{INFORMATION}the run starts at an equilibrium, found in {steps} steps"
    return StartState(rest.u, rest.angles, (note, *rest.notes), states=rest.states)
