"""Distance of a trajectory from a reference: the measure of the IFToMM benchmark library.

e = sqrt(mean over instants and components of (|y - y_ref| / max(|y_ref|, y_thr))^2), y_thr = 1e-3
(Gonzalez, Dopico, Gonzalez, Cuadrado 2006), taken of the whole state u: positions, Euler
parameters, velocities, angular velocities. Euler parameters p and -p are one orientation.
"""

import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.model.state_layout import split
from dap3d_core.result.post.global_error import difference, largest_norms, least_sizes, sizes_of

#: Components below are compared with this (SI), not with themselves.
Y_THR = 1e-3
#: Relative difference from which two references have parted: chaos, or a fault.
PARTED = 1e-3


def trajectory_error(u: Floats, reference: Floats) -> float:
    """The error e of states (nt, 13 n) against those of a reference at the same instants."""
    off = difference(reference, u) / np.maximum(np.abs(reference), Y_THR)
    return float(np.sqrt(np.mean(off**2)))


def final_position_error(u: Floats, reference: Floats) -> float:
    """The largest distance of a mass centre from its reference at the last instant, m."""
    off = difference(reference[-1:], u[-1:])
    r = split(off)[0]
    return float(np.max(np.linalg.norm(r, axis=2), initial=0.0))


def first_parting(t: Floats, u: Floats, other: Floats, length: float) -> int | None:
    """Index of the first instant at which two trajectories have parted; None where they never do.

    They have parted where a vector r, p, r_dot or w of some body differs by more than ``PARTED`` of
    the largest such vector of the run; ``length``, m, is that of the scene (``least_sizes``).
    """
    sizes, least = sizes_of(u), least_sizes(t, length)
    apart = np.zeros(len(u), dtype=bool)
    for name, off in largest_norms(difference(u, other)).items():
        apart |= off > PARTED * max(sizes[name], least[name])
    return int(np.argmax(apart)) if apart.any() else None
