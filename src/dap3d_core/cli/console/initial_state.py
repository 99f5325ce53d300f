"""The corrected initial conditions, as data and in words: for ``run`` and ``check``."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from dap3d_core.cli.console.console import Terminal, count, plain, say
from dap3d_core.cli.console.run_summary import show_state

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

#: Bodies whose corrected initial conditions are printed, those that were changed most.
MOST_BODIES = 5
#: Changes of less, per unit where the number is larger than one, are not printed.
PRINTED = 1e-9
#: Changes of less are rounding.
CHANGED = 1e-12


def start_facts(
    names: Sequence[str], given: "NDArray[np.float64]", u: "NDArray[np.float64]"
) -> dict[str, Any]:
    """What the correction of a start did.

    Args:
        names: of the bodies.
        given: (13 n,) the state as the scene gives it.
        u: (13 n,) the state that a run starts from.

    Returns:
        changed: whether anything was; changed_bodies: names of the bodies that show it;
        most_changed: those of them that are printed; bodies: name -> r, p, r_dot, w of all.
    """
    import numpy as np

    from dap3d_core.model.state_layout import split

    change = np.abs(u - given) / (1.0 + np.abs(given))
    parts = split(change)
    largest = np.max([np.max(part, axis=1) for part in parts], axis=0)
    most = np.argsort(-largest, kind="stable")[:MOST_BODIES]
    r, p, r_dot, w = split(u)
    arrays = {"r": r, "p": p, "r_dot": r_dot, "w": w}
    return {
        "changed": bool(np.any(change > CHANGED)),
        "changed_bodies": [n for n, x in zip(names, largest, strict=True) if x > PRINTED],
        "most_changed": [names[k] for k in most if largest[k] > PRINTED],
        "bodies": {
            name: {q: plain(values[k]) for q, values in arrays.items()}
            for k, name in enumerate(names)
        },
    }


def show_start(console: Terminal, initial: dict[str, Any]) -> None:
    """The initial conditions of the bodies that were changed, as the manual reports them."""
    if not initial["changed"]:
        say(console, "initial conditions: they fulfil the constraints, nothing was changed")
        return
    changed = initial["changed_bodies"]
    if not changed:
        say(console, f"initial conditions: corrected by less than {PRINTED:g}")
        return
    bodies = {name: initial["bodies"][name] for name in initial["most_changed"]}
    heading = "corrected initial conditions (SI, global axes)"
    show_state(console, heading, bodies)
    if len(changed) > len(bodies):
        more = count(len(changed) - len(bodies), "body", "bodies")
        say(console, f"and {more} more, changed less; --json prints all", indent=2)
