"""Newton-Euler equations read backwards: the forces that given accelerations take."""

import numpy as np
from numpy.typing import NDArray

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.model.rotations import to_body, to_global
from dap3d_core.model.state_layout import split

Floats = NDArray[np.float64]


def required_forces(evaluator: Evaluator, t: float, u: Floats, v_dot: Floats) -> Floats:
    """(6 n,) force and moment on each body that joints have to give: M v_dot - g.

    Args:
        evaluator: of the model.
        t: time, s.
        u: (13 n,) state.
        v_dot: (6 n,) accelerations.
    """
    model = evaluator.model
    _, p, _, w = split(u)
    accelerations = v_dot.reshape(-1, 6)
    spin, rise = to_body(p, w), to_body(p, accelerations[:, 3:])
    moment = np.einsum("brc,bc->br", model.Jp, rise)
    moment += np.cross(spin, np.einsum("brc,bc->br", model.Jp, spin))
    force = model.mass[:, None] * accelerations[:, :3]
    inertial = np.hstack([force, to_global(p, moment)])
    return np.asarray((inertial - evaluator.applied_forces(t, u)).ravel())
