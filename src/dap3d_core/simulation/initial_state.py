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
        state: what was taken in place of the scene's initial conditions; None for these.
    """

    u: Floats
    initial: assemble.Initial | None
    redundancy: Redundancy
    state: "StartState | None" = None

    @property
    def angles(self) -> Floats | None:
        """(angles,) angles from which turns are counted on; None where they begin at zero."""
        return None if self.state is None else self.state.angles

    @property
    def states(self) -> Floats | None:
        """(s,) states of elements; None for their initial values."""
        return None if self.state is None else self.state.states


def find_start(
    evaluator: Evaluator,
    correct: bool,
    hold: tuple[str, ...],
    metric: str = "unit",
    state: "StartState | None" = None,
) -> InitialState:
    """The start of a run.

    Args:
        evaluator: the model.
        correct: whether its initial conditions are brought onto the constraints.
        hold: names of bodies that the correction of positions leaves where they are.
        metric: "unit" or "mass", of ``correct_initial``.
        state: to start from in place of the scene's initial conditions.

    Raises:
        AssemblyError: the positions cannot be assembled, or a row is not finite.
    """
    u, initial = evaluator.model.u0 if state is None else state.u, None
    given = None if state is None else state.states
    evaluator.states = evaluator.model.initial_states if given is None else given
    if evaluator.has_unknowns:  # whatever was evaluated before
        evaluator.start(0.0, u, None if state is None else state.angles, given)
    if correct or (state is not None and state.is_interpolated):
        held = [evaluator.model.body_names.index(name) + 1 for name in hold]
        initial = assemble.correct_initial(evaluator, u, hold=held, metric=metric)
        u = initial.u
    return InitialState(u, initial, redundancy_of(evaluator, u), state)


def start_notes(start: InitialState, evaluator: Evaluator, scene: Scene) -> list[str]:
    """Text on the correction of a start, or that it is off the constraints."""
    notes = list(start.state.notes) if start.state is not None else []
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
