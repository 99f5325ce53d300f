"""Reference for the model `marble_run`: rolling, flight, landing and rolling in closed form."""

import numpy as np
from rigid import Array
from scipy.optimize import brentq

GRAVITY, R, TILT, ROLL, MU = 9.81, 0.02, 0.2, 0.5, 0.4
WEIGHT = np.array([0.0, -GRAVITY])
#: Along the boards, to the right, and out of them: x and z.
DOWN, OUT = np.array([np.cos(TILT), -np.sin(TILT)]), np.array([np.sin(TILT), np.cos(TILT)])
UP, OUT_OF_LOWER = np.array([DOWN[0], -DOWN[1]]), np.array([-OUT[0], OUT[1]])
#: The middle of the upper side of the lower board; the end of the upper one is the origin.
LOWER = np.array([0.2, -0.15])
ROLLING = 5.0 / 7.0 * GRAVITY * np.sin(TILT)


def _state(t: float) -> tuple[Array, Array, float]:
    """Return place and velocity of the centre, and the spin about y, at `t`."""
    at_end = np.sqrt(2.0 * ROLL / ROLLING)
    rolled = min(t, at_end)
    v = ROLLING * rolled
    r = R * OUT + (0.5 * ROLLING * rolled**2 - ROLL) * DOWN
    if t <= at_end:
        return r, v * DOWN, v / R

    def flown(s: float) -> Array:
        return r + v * s * DOWN + 0.5 * s * s * WEIGHT

    falls = float(brentq(lambda s: (flown(s) - LOWER) @ OUT_OF_LOWER - R, 0.0, 1.0))
    s = min(t - at_end, falls)
    place, velocity, spin = flown(s), v * DOWN + s * WEIGHT, v / R
    if s < falls:
        return place, velocity, spin
    # It does not bounce. Friction ends the slip: a solid ball keeps 5/7 of its speed, 2/7 of spin.
    along, into = velocity @ UP, -velocity @ OUT_OF_LOWER
    assert abs(along - R * spin) * 2.0 / 7.0 < MU * into, "it would slip on"
    along = (5.0 * along + 2.0 * R * spin) / 7.0
    s = t - at_end - falls
    place = place + (along * s - 0.5 * ROLLING * s * s) * UP
    return place, (along - ROLLING * s) * UP, (along - ROLLING * s) / R


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    place, velocity, spin = _state(t)
    return {
        "r.marble": np.array([place[0], 0.0, place[1]]),
        "rd.marble": np.array([velocity[0], 0.0, velocity[1]]),
        "w.marble": np.array([0.0, spin, 0.0]),
    }
