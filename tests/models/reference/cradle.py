"""Reference for the model `cradle`: five pendulums by SciPy, whose balls pass on what they have."""

from functools import cache

import numpy as np
from rigid import Array
from scipy.integrate import solve_ivp

L, RADIUS, APART, M, J, GRAVITY = 0.5, 0.05, 0.101, 1.0, 1e-3, 9.81
INERTIA = J + M * L**2
TOP = APART * np.arange(5)
START = np.array([0.5, 0.0, 0.0, 0.0, 0.0])


def _rate(_: float, y: Array) -> Array:
    return np.concatenate([y[5:], -M * GRAVITY * L / INERTIA * np.sin(y[:5])])


def _centres(q: Array) -> Array:
    """Return the centres (5, 2), x and z, at the angles about y."""
    return np.column_stack([TOP - L * np.sin(q), -L * np.cos(q)])


def _gap(k: int, y: Array) -> float:
    """Return how far balls k and k + 1 are apart."""
    centres = _centres(y[:5])
    return float(np.linalg.norm(centres[k + 1] - centres[k]) - 2.0 * RADIUS)


def _after(k: int, y: Array) -> Array:
    """Return the state after balls k and k + 1 have met without loss, along their centres."""
    centres = _centres(y[:5])
    n = (centres[k + 1] - centres[k]) / (2.0 * RADIUS)
    pair = slice(k, k + 2)
    arms = np.column_stack([-L * np.cos(y[pair]), L * np.sin(y[pair])]) @ n * [-1.0, 1.0]
    impulse = -2.0 * (arms @ y[5:][pair]) / (arms @ arms / INERTIA)
    y = y.copy()
    y[5:][pair] += impulse * arms / INERTIA
    return y


@cache
def _state(t: float) -> tuple[float, ...]:
    """Return angles and their rates at `t`."""
    y, now = np.concatenate([START, np.zeros(5)]), 0.0
    touches = [lambda _, y, k=k: _gap(k, y) for k in range(4)]
    for touch in touches:
        touch.terminal, touch.direction = True, -1.0
    while now < t:
        found = solve_ivp(_rate, (now, t), y, "DOP853", events=touches, rtol=1e-12, atol=1e-14)
        now, y = found.t[-1], found.y[:, -1]
        for k in (k for k in range(4) if len(found.t_events[k])):
            y = _after(k, y)
    return tuple(y)


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    y = np.array(_state(t))
    centres = _centres(y[:5])
    energy = 0.5 * INERTIA * y[5:] @ y[5:] + M * GRAVITY * centres[:, 1].sum()
    return {
        "energy.total": np.array([energy]),
        **{f"r.ball{k + 1}": np.array([x, 0.0, z]) for k, (x, z) in enumerate(centres)},
        **{f"w.ball{k + 1}": np.array([0.0, u, 0.0]) for k, u in enumerate(y[5:])},
    }
