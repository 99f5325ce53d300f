"""Errors of runs."""

from collections.abc import Sequence
from typing import Any

from dap3d_core.result import ResultError


class SimulationError(Exception):
    """A run could not start or go on; ``result`` is what was computed until then, or None."""

    def __init__(self, message: str, result: Any = None) -> None:
        super().__init__(message)
        self.result = result


def refuse_contacts(model: Any, what: str) -> None:
    """Refuse what does not know yet that contacts hold and let go.

    Args:
        model: of a scene.
        what: that is asked for, as the subject of a sentence.

    Raises:
        SimulationError: the scene has contacts.
    """
    if model.contact_count:
        raise SimulationError(
            f"{what} does not take contacts yet, and the scene has some "
            f"({model.contact_names[0].partition('#')[0]}): take them out, or run the scene "
            "(simulate), which does. Stops with a stiffness k, and friction with a w_tol or v_tol, "
            "are no contacts"
        )
    refuse_collisions(model, what)


def refuse_collisions(model: Any, what: str) -> None:
    """Refuse what knows declared contacts, and not what steps alone can follow; as above."""
    if model.collisions is not None:
        raise SimulationError(
            f"{what} does not take shapes that collide yet, and the scene has some "
            f"({model.collisions.names[0]}): leave collides = true out, or run the scene "
            "(simulate), which does"
        )
    refuse_breaks(model, what)


def refuse_breaks(model: Any, what: str) -> None:
    """Refuse what does not know that joints break; as above."""
    for joint in model.breaks:
        raise SimulationError(
            f"{what} does not take joints that may break or hold at times yet, and the scene has "
            f"some ({joint}): leave breaks_at and active out, or run the scene (simulate), which "
            "does"
        )


class RedundantError(SimulationError):
    """The scene has redundant constraints, which the chosen formulation cannot solve."""


class AssemblyError(SimulationError):
    """The initial conditions could not be brought onto the constraints.

    Attributes:
        joints: names of the joints that are open, the worst first; empty where a row is not finite.
    """

    def __init__(self, message: str, joints: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.joints = tuple(joints)


class CheckpointError(ResultError):
    """A checkpoint that cannot be read, or a run that cannot go on from it; says what to do."""
