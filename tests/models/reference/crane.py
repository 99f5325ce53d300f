"""Reference for the model `crane`: a double pendulum on a rope of given length, by SciPy.
Angles of rope and load from the vertical are the coordinates. Complex numbers are points of the
y-z plane; a unit vector that hangs at an angle q is u = -i exp(i q), and u' = i u q'."""

from functools import cache

import numpy as np
from rigid import Array
from scipy.integrate import solve_ivp

HEIGHT, ROPE, LOWERED, EYE, MASS, INERTIA, WAY, LASTING = 10, 5, 3, 0.8, 2000, 800, 6, 3
GRAVITY = 9.81


def slow_period() -> float:
    """Return the period of the slower of the two small motions, at the upper length."""
    mass = [[ROPE**2, ROPE * EYE], [ROPE * EYE, EYE**2 + INERTIA / MASS]]
    stiffness = GRAVITY * np.diag([ROPE, EYE])
    return 2.0 * np.pi / np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).min())


DELAY = 0.5 * slow_period()
BREAKS = sorted([DELAY, LASTING, DELAY + LASTING, 6.0, 9.0])


def _step(t: float, start: float) -> Array:
    """Return the smooth step from 0 to 1 in `LASTING`, and its first two derivatives."""
    u = np.clip((t - start) / LASTING, 0.0, 1.0)
    v = u * (1.0 - u)
    value = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
    return np.array([value, 30.0 * v * v / LASTING, 60.0 * v * (1.0 - 2.0 * u) / LASTING**2])


def _given(t: float) -> tuple[Array, Array]:
    """Return place of the trolley and length of the rope, both with derivatives."""
    rope = LOWERED * _step(t, 6.0) + np.array([ROPE, 0.0, 0.0])
    return 0.5 * WAY * (_step(t, 0.0) + _step(t, DELAY)), rope


def _hanging(q: Array) -> tuple[complex, complex]:
    rope, load = -1j * np.exp(1j * q)
    return rope, load


def _motion(t: float, y: Array) -> tuple[Array, complex]:
    """Return the angular accelerations and the force on the load but for weight, over its mass."""
    (_, _, y_2), (l, l_1, l_2) = _given(t)
    rope, load = _hanging(y[:2])
    w, turn = y[2:]
    # the mass centre's acceleration is rest + l i rope w' + EYE i load turn'
    rest = y_2 + (l_2 - l * w * w) * rope + 2j * l_1 * w * rope - EYE * turn * turn * load
    rest += 1j * GRAVITY
    ways = np.array([1j * l * rope, 1j * EYE * load])
    matrix = (np.conj(ways)[:, None] * ways).real + np.diag([0.0, INERTIA / MASS])
    found = np.linalg.solve(matrix, -(np.conj(ways) * rest).real)
    return found, rest + ways @ found


def _rate(t: float, y: Array) -> Array:
    return np.concatenate([y[2:], _motion(t, y)[0]])


@cache
def _state(t: float) -> tuple[float, ...]:
    """Return angles and their rates at `t`; steps end where a motion begins or ends."""
    y, now = np.zeros(4), 0.0
    for end in [x for x in BREAKS if x < t] + [t]:
        run = solve_ivp(_rate, (now, end), y, "DOP853", rtol=1e-12, atol=1e-13)
        y, now = run.y[:, -1], end
    return tuple(y)


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    state = np.array(_state(t))
    (y, y_1, _), (l, l_1, _) = _given(t)
    rope, load = _hanging(state[:2])
    place = y + 1j * HEIGHT + l * rope + EYE * load
    speed = y_1 + (l_1 + 1j * l * state[2]) * rope + 1j * EYE * state[3] * load
    force = MASS * _motion(t, state)[1]
    return {
        "r.load": np.array([0.0, place.real, place.imag]),
        "rd.load": np.array([0.0, speed.real, speed.imag]),
        "w.load": np.array([state[3], 0.0, 0.0]),
        "lambda.rope": np.array([-(np.conj(rope) * force).real]),
    }
