"""Reference for the model `sphere_box`: balls in the hollows of those below, and their weight."""

import numpy as np
from rigid import Array

GRAVITY, R, COUNT, LAYERS = 9.81, 0.05, 500, 5


def quantities(_: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, when all is at rest."""
    # A ball touches four below it, whose centres make a square of edge 2 R: the densest packing.
    top = R + (LAYERS - 1) * np.sqrt(4.0 * R**2 - 2.0 * R**2)
    return {
        "r.layer5/row1/b1/ball": np.array([R, R, top]),
        "r.layer5/row9/b12/ball": np.array([23.0 * R, 17.0 * R, top]),
        "load.floor": np.array([0.0, 0.0, -COUNT * GRAVITY]),
    }
