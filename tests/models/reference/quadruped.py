"""Reference for the model `quadruped`: statics of its legs, whose servos have no moment."""

import numpy as np
from rigid import Array

GRAVITY, TRUNK, LEG, L, SLANT, FOOT = 9.81, 10.0, 1.0, 0.3, 0.25, 0.03


def quantities(_: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, when all is at rest."""
    up = (TRUNK + 4.0 * LEG) * GRAVITY / 4.0
    height = L * np.cos(SLANT) + FOOT
    # Moments about a hip: the floor's push and friction below the foot, half the leg's weight.
    inward = L * np.sin(SLANT) * (up - 0.5 * LEG * GRAVITY) / height
    feet = {"front_left": -1.0, "front_right": -1.0, "rear_left": 1.0, "rear_right": 1.0}
    return {
        "r.trunk": np.array([0.0, 0.0, height]),
        **{f"load.{name}_foot": np.array([s * inward, 0.0, up]) for name, s in feet.items()},
    }
