"""Cubics between reported instants, through values and rates at both ends (Hermite)."""

import numpy as np

from dap3d_core.model.groups import Floats

#: A curve of fewer instants is drawn by some so many places.
PLACES = 600


def cubic(a: float, h: "float | Floats", x: Floats, x_dot: Floats) -> Floats:
    """The cubic through both ends, a part of the way along: x, x_dot (2, ...), step h, s."""
    s, b = a * a * (3.0 - 2.0 * a), a * (1.0 - a)
    found: Floats = (1.0 - s) * x[0] + s * x[1] + b * h * ((1.0 - a) * x_dot[0] - a * x_dot[1])
    return found


def cubics(t: Floats, x: Floats, x_dot: Floats) -> Floats:
    """A curve x (nt,) with derivative x_dot, at its instants and at even parts between them."""
    if not 1 < len(t) < PLACES:
        return x
    between = -(-PLACES // len(t))
    h, ends, rates = np.diff(t), np.stack([x[:-1], x[1:]]), np.stack([x_dot[:-1], x_dot[1:]])
    pieces = [cubic(k / between, h, ends, rates) for k in range(between)]
    return np.append(np.stack(pieces, axis=1).reshape(-1), x[-1])
