"""Reference for the model `gripper`: statics of a box held by friction, after the lift."""

import numpy as np
from rigid import Array

GRAVITY, PRESS, LIFTED, BOX, FINGER, HAND = 9.81, 20.0, 0.1, 1.0, 0.1, 1.0


def quantities(_: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, when all is at rest."""
    half = 0.5 * BOX * GRAVITY
    return {
        "r.box": np.array([0.0, 0.0, 0.05 + LIFTED]),
        "load.box": np.array([0.0, 0.0, BOX * GRAVITY]),
        "load.left": np.array([-PRESS, 0.0, -half]),
        "load.right": np.array([PRESS, 0.0, -half]),
        "lambda.lift_motor": np.array([(BOX + 2.0 * FINGER + HAND) * GRAVITY]),
    }
