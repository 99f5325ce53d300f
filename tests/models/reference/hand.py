"""Reference for the model `hand`: statics of an egg that three fingers hold, after the lift."""

import numpy as np
from rigid import Array

GRAVITY, EGG, FINGER, PALM, LIFTED = 9.81, 0.06, 0.04, 0.4, 0.1
MOMENT, WAIST, HALF, TIP, OUT, LENGTH = 0.2, 0.022, 0.028, 0.008, 0.07, 0.08


def quantities(_: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, when all is at rest."""
    share = EGG * GRAVITY / 3.0
    # Moments about a knuckle: the egg's push at its waist, its weight there, half way the finger's.
    lost = (OUT - WAIST) * share + 0.5 * (OUT - WAIST - TIP) * FINGER * GRAVITY
    push = (MOMENT - lost) / LENGTH
    outward = {"first": 0.0, "second": 2.0 * np.pi / 3.0, "third": 4.0 * np.pi / 3.0}
    return {
        "r.egg": np.array([0.0, 0.0, HALF + LIFTED]),
        "load.egg": np.array([0.0, 0.0, EGG * GRAVITY]),
        **{f"load.{name}": np.array([push * np.cos(a), push * np.sin(a), -share])
           for name, a in outward.items()},
        "lambda.lift_motor": np.array([(EGG + 3.0 * FINGER + PALM) * GRAVITY]),
    }  # fmt: skip
