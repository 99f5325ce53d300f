"""Reference for the model `pen1`: a spinning cone on a spherical joint.
The motion comes from the generic simulator `kkt`; `closed_form` gives position, velocities and
accelerations once more from elliptic functions (`heavy_top`)."""

import numpy as np
from heavy_top import HeavyTop
from kkt import GROUND, Body, Fixed, System, sph
from rigid import GRAVITY, Array

MASS, TRANSVERSE, AXIAL, ARM, SPIN = 4.0, 0.0375, 0.0270, 0.3, -10.0

SYSTEM = System(
    bodies=[
        Body("cone", MASS, (TRANSVERSE, AXIAL, TRANSVERSE), (0.0, ARM, 0.0), w=(0.0, SPIN, 0.0))
    ],
    joints=[sph("J1", Fixed(0, (0.0, -ARM, 0.0)), Fixed(GROUND, (0.0, 0.0, 0.0)))],
)
TOP = HeavyTop(MASS * GRAVITY * ARM, TRANSVERSE + MASS * ARM**2, AXIAL * SPIN)
SIMULATED = SYSTEM.simulator()


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    return SYSTEM.counts | SIMULATED(t)


def closed_form(t: float) -> dict[str, Array]:
    """Return the same quantities, as far as the closed form gives them."""
    r, v, w, v_dot, w_dot = TOP.body(t, ARM, SPIN)
    return {"r.cone": r, "v": np.concatenate([v, w]), "v_dot": np.concatenate([v_dot, w_dot])}
