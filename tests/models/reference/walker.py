"""Reference for the model `walker`: what a periodic walk gives, whatever happens in a period."""

import numpy as np
from rigid import Array

GRAVITY, TRUNK, THIGH, SHIN = 9.81, 10.0, 0.6, 0.4
LENGTHS, BENT, FOOT = 0.16 + 0.16, 0.9, 0.03


def quantities(_: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, after whole periods."""
    # Momentum is what it was a period ago: the loads have carried the weight, and nothing sideways.
    weight = (TRUNK + 4.0 * (THIGH + SHIN)) * GRAVITY
    return {
        "mean_load.floor": np.array([0.0, 0.0, -weight]),
        "r.trunk": np.array([0.0, 0.0, LENGTHS * np.cos(BENT) + FOOT]),
        "p.trunk": np.array([1.0, 0.0, 0.0, 0.0]),
    }
