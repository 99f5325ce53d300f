"""The state that a run starts from: corrected if requested, with the rank of its constraints."""

from typing import TYPE_CHECKING

import attrs

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene import Scene
from dap3d_core.simulation.initial import assemble
from dap3d_core.simulation.redundancy.redundancy import Redundancy, redundancy_of

if TYPE_CHECKING:
    from dap3d_core.simulation.initial.start_state import StartState


#: A start this far off the constraints, in units of the scene, left uncorrected, gets a note.
OFF_CONSTRAINTS = 1e-6


@attrs.frozen(eq=False)
class InitialState:
    """Initial state of a run.

    Attributes:
        u: (13 n,) the state.
        initial: what its correction did; None where it was not corrected.
        redundancy: of the constraints there.
        angles: (angles,) from which turns are counted on; None where they begin at zero.
        states: (s,) of elements; None for their initial values.
        notes: where it comes from, if not from the scene.
    """

    u: Floats
    initial: assemble.Initial | None
    redundancy: Redundancy
    angles: Floats | None = None
    states: Floats | None = None
    notes: tuple[str, ...] = ()


def find_start(
    evaluator: Evaluator,
    correct: bool,
    hold: tuple[str, ...],
    metric: str = "unit",
    state: "StartState | None" = None,
) -> InitialState:
    """The start of a run.

    Args:
        correct: whether its initial conditions are brought onto the constraints.
        hold: names of bodies that the correction of positions leaves where they are.
        metric: "unit" or "mass", of ``correct_initial``.
        state: to start from in place of the scene's initial conditions.

    Raises:
        AssemblyError: the positions cannot be assembled, or a row is not finite.
    """
    u, angles, states, initial = evaluator.model.u0, None, None, None
    notes: tuple[str, ...] = ()
    if state is not None:
        u, angles, states, notes = state.u, state.angles, state.states, state.notes
    evaluator.states = evaluator.model.initial_states if states is None else states
    if evaluator.has_unknowns:  # whatever was evaluated before
        evaluator.start(0.0, u, angles, states)
    if correct or (state is not None and state.is_interpolated):
        held = [evaluator.model.body_names.index(name) + 1 for name in hold]
        initial = assemble.correct_initial(evaluator, u, hold=held, metric=metric)
        u = initial.u
    return InitialState(u, initial, redundancy_of(evaluator, u), angles, states, notes)


def start_notes(start: InitialState, evaluator: Evaluator, scene: Scene) -> list[str]:
    """Text on the correction of a start, or that it is off the constraints."""
    notes = list(start.notes)
    if start.initial is not None:
        return notes + assemble.correction_notes(start.initial, evaluator, scene)
    position, velocity = assemble.violation(evaluator, start.u)
    if max(position, velocity * evaluator.time) <= OFF_CONSTRAINTS * evaluator.model.length:
        return notes
    return [
        *notes,
        f"the initial conditions violate the constraints (position {position:.2g}, "
        f"velocity {velocity:.2g}) and were not corrected; switch correct on",
    ]
