"""Reference for the model `rotor`: two equations for the shaft's centre, by SciPy.

Mass centre and bearings lie in one plane, so the rotor moves without tilting:

    m z'' + 2 c z' + 2 k z = -m (e exp(i theta))'',  theta = acceleration t^2 / 2,

z = x + i y the centre of the shaft.
"""

from functools import cache
from typing import Any

import numpy as np
from rigid import Array
from scipy.integrate import solve_ivp

M, E, K, C, ACCELERATION = 20.0, 2e-4, 4e5, 100.0, 60.0


def _unbalance(t: float) -> tuple[complex, complex, complex]:
    """Return e exp(i theta) and its derivatives."""
    arm, rate = E * np.exp(0.5j * ACCELERATION * t * t), ACCELERATION * t
    return arm, 1j * rate * arm, (1j * ACCELERATION - rate**2) * arm


@cache
def _solution(t: float) -> Any:
    """Return z and z' at `t`, from rest."""

    def rate(s: float, y: Array) -> Array:
        return np.array([y[1], -_unbalance(s)[2] - 2.0 * (C * y[1] + K * y[0]) / M])

    start = np.zeros(2, complex)
    return solve_ivp(rate, (0.0, t), start, "DOP853", rtol=1e-12, atol=1e-16).y[:, -1]


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    z, z_dot = _solution(t)
    arm, arm_dot, _ = _unbalance(t)
    return {
        "rP.shaft": np.array([z.real, z.imag, 0.0]),
        "r.rotor": np.array([(z + arm).real, (z + arm).imag, 0.0]),
        "rd.rotor": np.array([(z_dot + arm_dot).real, (z_dot + arm_dot).imag, 0.0]),
        "w.rotor": np.array([0.0, 0.0, ACCELERATION * t]),
    }
