"""Reference for the model `wiper`: the loop of the four-bar in closed form, in complex numbers."""

import numpy as np
from rigid import Array

BASE, CRANK, ROD, ROCKER, BLADE = 0.25, 0.06, 0.24, 0.08, 0.5
SPEED = 45 * 2.0 * np.pi / 60.0
TO_TIP = BLADE * np.exp(-1j * np.radians(17.0))


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    pin = CRANK * np.exp(1j * SPEED * t)
    diagonal = abs(BASE - pin)
    inside = np.arccos((diagonal**2 + ROCKER**2 - ROD**2) / (2.0 * diagonal * ROCKER))
    lever = (pin - BASE) / diagonal * np.exp(-1j * inside)
    end = BASE + ROCKER * lever
    rod = (end - pin) / ROD
    # i w_rod ROD rod - i w ROCKER lever = -i SPEED pin, in real and imaginary part
    matrix = np.array(
        [[(ROD * rod).real, -(ROCKER * lever).real], [(ROD * rod).imag, -(ROCKER * lever).imag]]
    )
    of_rod, of_rocker = np.linalg.solve(matrix, [-(SPEED * pin).real, -(SPEED * pin).imag])
    tip = TO_TIP * lever
    return {
        "r.rod": _vector(pin + 0.5 * ROD * rod),
        "w.rod": np.array([of_rod, 0.0, 0.0]),
        "w.rocker": np.array([of_rocker, 0.0, 0.0]),
        "rP.tip": _vector(BASE + tip),
        "rPd.tip": _vector(1j * of_rocker * tip),
    }


def _vector(z: complex) -> Array:
    """Return a point of the y-z plane as a vector."""
    return np.array([0.0, z.real, z.imag])
