"""Reference for the model `ball1`: a bouncing ball, in closed form from piece to piece.
Off the ground the ball falls freely; in contact m z'' = -k (z - R) - c z' - m g is a damped
oscillator. A piece ends where z = R, found by bracketing to the last bit; nothing is integrated."""

from functools import cache
from typing import NamedTuple

import numpy as np
from rigid import GRAVITY, Array
from scipy.optimize import brentq

MASS, RADIUS, K, DAMPING, Z0 = 1.0, 0.1, 2000.0, 5.0, 1.0
DECAY = DAMPING / (2 * MASS)
FREQUENCY = np.sqrt(K / MASS - DECAY**2)
SAG = -MASS * GRAVITY / K  # rest position of z - R in contact


class Piece(NamedTuple):
    """A stretch of the motion from `start` on: height above R and speed there."""

    start: float
    height: float
    speed: float
    touching: bool


def motion(piece: Piece, t: float) -> tuple[float, float]:
    """Return z - R and its rate at the absolute time `t`."""
    s = t - piece.start
    if not piece.touching:
        return piece.height + piece.speed * s - GRAVITY * s * s / 2, piece.speed - GRAVITY * s
    a = piece.height - SAG
    b = (piece.speed + DECAY * a) / FREQUENCY
    cosine, sine, fade = np.cos(FREQUENCY * s), np.sin(FREQUENCY * s), np.exp(-DECAY * s)
    rate = (FREQUENCY * b - DECAY * a) * cosine - (FREQUENCY * a + DECAY * b) * sine
    return SAG + fade * (a * cosine + b * sine), fade * rate


def end(piece: Piece) -> float:
    """Return the absolute time at which the piece ends, infinity if never."""
    if not piece.touching:
        reach = piece.speed + np.sqrt(piece.speed**2 + 2 * GRAVITY * piece.height)
        return piece.start + reach / GRAVITY
    # z - R rises through zero within the first turn of the oscillator or never again
    grid = piece.start + np.linspace(0.0, 2 * np.pi / FREQUENCY, 2001)[1:]
    height = np.array([motion(piece, t)[0] for t in grid])
    above = np.flatnonzero(height > 0.0)
    if not len(above):
        return np.inf
    first = above[0]
    return brentq(lambda t: motion(piece, t)[0], grid[first - 1], grid[first], xtol=1e-16)


@cache
def pieces() -> tuple[Piece, ...]:
    """Return all pieces of the motion until the ball stays on the ground."""
    found = [Piece(0.0, Z0 - RADIUS, 0.0, touching=False)]
    while np.isfinite(stop := end(found[-1])):
        speed = motion(found[-1], stop)[1]
        found.append(Piece(stop, 0.0, speed, touching=not found[-1].touching))
    return tuple(found)


def crossing(of: str, component: int, level: float, direction: str, number: int) -> float:
    """Return when z passes `level`, or its rate zero, for the `number`-th time in `direction`."""
    if component != 2 or (of, level) not in {("r.ball", RADIUS), ("rd.ball", 0.0)}:
        raise ValueError(f"no closed form for {of}[{component}] = {level}")
    if of == "r.ball":
        return [p.start for p in pieces()[1:] if p.touching == (direction == "down")][number - 1]
    touching = direction == "up"  # lowest points lie in contact, highest points in flight
    piece = [p for p in pieces()[1:] if p.touching == touching][number - 1]
    if not touching:
        return piece.start + piece.speed / GRAVITY
    return brentq(lambda t: motion(piece, t)[1], piece.start, end(piece), xtol=1e-16)


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    piece = [p for p in pieces() if p.start <= t][-1]
    height, speed = motion(piece, t)
    force = -K * height - DAMPING * speed if piece.touching else 0.0
    stretch = height if piece.touching else 0.0
    kinetic = 0.5 * MASS * speed**2
    potential = MASS * GRAVITY * (height + RADIUS) + 0.5 * K * stretch**2
    v_dot = np.array([0.0, 0.0, force / MASS - GRAVITY, 0.0, 0.0, 0.0])
    return {
        "r.ball": np.array([0.0, 0.0, height + RADIUS]),
        "p.ball": np.array([1.0, 0.0, 0.0, 0.0]),
        "rd.ball": np.array([0.0, 0.0, speed]),
        "w.ball": np.zeros(3),
        "v": np.array([0.0, 0.0, speed, 0.0, 0.0, 0.0]),
        "v_dot": v_dot,
        "rdd.ball": v_dot[:3],
        "energy.kinetic": np.array([kinetic]),
        "energy.potential": np.array([potential]),
        "energy.total": np.array([kinetic + potential]),
    }
