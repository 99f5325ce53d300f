"""Rates at a state where switches have been read: those of closed contacts take all they need."""

import numpy as np

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.scalar_math import is_differentiated


@compiled
def take_watched(t: float, y: Floats, out: Floats, system: System) -> bool:
    """True where switches were read last at this state: then dy/dt is known."""
    watched, n = system.watched, y.shape[0]
    is_known = watched[0] == t and not is_differentiated()
    if is_known:
        for k in range(n):
            is_known &= watched[1 + k] == y[k]
    watched[0] = np.inf - np.inf  # once: numbers of the scene may change
    if is_known:
        for k in range(n):
            out[k] = watched[1 + n + k]
    return is_known


@compiled
def store_watched(t: float, y: Floats, system: System) -> None:
    """Note the state at which dy/dt stands in ``watched``."""
    system.watched[0] = t
    for k in range(y.shape[0]):
        system.watched[1 + k] = y[k]
