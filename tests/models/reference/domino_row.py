"""Reference for the model `domino_row`: the first domino about its edge until it meets the second.
When all are at rest, the last one lies flat, and the table carries their weight."""

import numpy as np
from rigid import Array
from scipy.integrate import solve_ivp

GRAVITY, MASS, HEIGHT, THICK, APART, TURN, COUNT = 9.81, 0.01, 0.05, 0.008, 0.025, 6.0, 5
DIAGONAL, CORNER = np.hypot(HEIGHT, THICK), np.arctan2(THICK, HEIGHT)
REST = 0.4


def _turned(t: float) -> tuple[float, float]:
    """Return angle and speed of the first domino about its lower edge at `t`."""

    def rate(_: float, y: Array) -> list[float]:
        return [y[1], 1.5 * GRAVITY / DIAGONAL * np.sin(y[0] - CORNER)]

    found = solve_ivp(rate, (0.0, t), [0.0, TURN], "DOP853", rtol=1e-12, atol=1e-14)
    angle, speed = found.y[:, -1]
    assert HEIGHT * np.sin(angle) < APART - THICK, "it has met the next one"
    return float(angle), float(speed)


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    if t >= REST:
        return {
            "load.table": np.array([0.0, 0.0, -COUNT * MASS * GRAVITY]),
            "p.d5": np.sqrt([0.5, 0.0, 0.5, 0.0]),
            "w.d5": np.zeros(3),
        }
    angle, speed = _turned(t)
    lean = angle - CORNER
    x, z = 0.5 * THICK + 0.5 * DIAGONAL * np.sin(lean), 0.5 * DIAGONAL * np.cos(lean)
    return {"r.d1": np.array([x, 0.0, z]), "w.d1": np.array([0.0, speed, 0.0])}
