"""What time stepping of contacts left unsolved."""

from collections.abc import Sequence

from dap3d_core.integrators import STEPPING, Integration
from dap3d_core.result.note import information

#: A residual above this part of the largest impulse is a warning, and an overlap above this part of
#: the length of the scene.
UNSOLVED = 1e-3
#: Overlaps at the start above this part of the length of the scene are told.
LEAST_OVERLAP = 1e-8


def stepping_notes(integrations: Sequence[Integration], length: float) -> list[str]:
    """Residual, overlap and work of friction of a run by time stepping; none of other runs.

    length: of the scene, m.
    """
    states = [one.work for one in integrations if one.name == STEPPING.name]
    if not states:
        return []
    residual, deepest = max(w.largest_residual for w in states), max(w.deepest for w in states)
    rubbed = abs(sum(w.friction_work for w in states))
    words = (
        f"contacts were solved to {residual:.2g} of the largest impulse of a step, bodies overlap "
        f"by {deepest:.2g} m at most; friction took {rubbed:.6g} J"
    )
    notes: list[str] = [information(words)]
    if residual > UNSOLVED:
        notes = [f"{words}: where bodies rest is not to be trusted; give a shorter contact_step"]
    elif deepest > UNSOLVED * length:
        notes = [f"{words}: joints or drivers hold them where they cannot move apart"]
    if (overlap := states[0].overlap_at_start) > LEAST_OVERLAP * length:
        notes.append(
            f"bodies overlapped by {overlap:.2g} m at the start, and were moved apart: move them"
        )
    return notes
