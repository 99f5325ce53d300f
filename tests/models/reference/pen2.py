"""Reference for the model `pen2`: a rod on a spherical joint, a spinning cylinder on a revolute.
The motion comes from the generic simulator `kkt`; `closed_form` gives positions, velocities and
accelerations once more from elliptic functions (`heavy_top`)."""

import numpy as np
from heavy_top import HeavyTop
from kkt import GROUND, Body, Fixed, System, rev, sph
from rigid import GRAVITY, Array

ROD, CYLINDER = 0, 1
MASS, DISTANCE, SPIN = (0.5, 10.0), (0.5, 1.3), (0.0, 25.0)
JP = ((0.0417, 0.001, 0.0417), (0.2333, 0.2, 0.2333))

SYSTEM = System(
    bodies=[
        Body("rod", MASS[0], JP[0], (0.0, DISTANCE[0], 0.0)),
        Body("cylinder", MASS[1], JP[1], (0.0, DISTANCE[1], 0.0), w=(0.0, SPIN[1], 0.0)),
    ],
    joints=[
        sph("J1", Fixed(ROD, (0.0, -0.5, 0.0)), Fixed(GROUND, (0.0, 0.0, 0.0))),
        rev(
            "J2",
            Fixed(CYLINDER, (0.0, -0.3, 0.0)),
            Fixed(ROD, (0.0, 0.5, 0.0)),
            Fixed(CYLINDER, (0.0, 1.0, 0.0)),
            Fixed(ROD, (0.0, 1.0, 0.0)),
        ),
    ],
)
TOP = HeavyTop(
    G=sum(m * GRAVITY * a for m, a in zip(MASS, DISTANCE, strict=True)),
    inertia=sum(J[0] + m * a * a for m, a, J in zip(MASS, DISTANCE, JP, strict=True)),
    L=sum(J[1] * s for J, s in zip(JP, SPIN, strict=True)),
)
SIMULATED = SYSTEM.simulator()


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    return SYSTEM.counts | SIMULATED(t)


def closed_form(t: float) -> dict[str, Array]:
    """Return the same quantities, as far as the closed form gives them."""
    rod, cylinder = (TOP.body(t, DISTANCE[i], SPIN[i]) for i in (0, 1))
    return {
        "r.rod": rod[0],
        "r.cylinder": cylinder[0],
        "v": np.concatenate([rod[1], rod[2], cylinder[1], cylinder[2]]),
        "v_dot": np.concatenate([rod[3], rod[4], cylinder[3], cylinder[4]]),
    }
