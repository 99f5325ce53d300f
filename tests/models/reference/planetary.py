"""Reference for the model `planetary`: closed form, by Willis and Newton.
All wheels turn in fixed ratios, so the torque on the sun accelerates one inertia: the sum of
J ratio^2, and of m (d ratio)^2 for the planet, which the carrier takes along. The tooth force of
the ring is what accelerates the planet about its centre, beside that of the sun. At the pressure
angle each tooth presses besides: sun and planet apart, the planet from the ring towards the
axis."""

import numpy as np
from rigid import Array

TORQUE, R_SUN, R_PLANET, D = 0.05, 0.02, 0.04, 0.06
J_SUN, J_CARRIER, J_PLANET, M_PLANET = 2e-3, 2e-2, 5e-4, 0.4
OF_CARRIER = 20 / (20 + 100)
OF_PLANET = OF_CARRIER - 20 / 40 * (1.0 - OF_CARRIER)
INERTIA = J_SUN + OF_CARRIER**2 * (J_CARRIER + M_PLANET * D**2) + OF_PLANET**2 * J_PLANET
RATE = TORQUE / INERTIA  # of the sun, rad/s^2
#: Tooth forces on the planet along the direction in which its centre moves.
OF_SUN = (TORQUE - J_SUN * RATE) / R_SUN
OF_RING = OF_SUN + J_PLANET * OF_PLANET * RATE / R_PLANET
APART = np.tan(np.radians(20.0))


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    sun = RATE * t
    angle = 0.5 * OF_CARRIER * RATE * t * t
    out = np.array([np.cos(angle), np.sin(angle), 0.0])
    along = np.array([-out[1], out[0], 0.0])
    speeds = {"sun": sun, "carrier": OF_CARRIER * sun, "planet": OF_PLANET * sun}
    found = {f"w.{name}": np.array([0.0, 0.0, w]) for name, w in speeds.items()}
    acceleration = D * (OF_CARRIER * RATE * along - (OF_CARRIER * sun) ** 2 * out)
    pin = M_PLANET * acceleration - (OF_SUN + OF_RING) * along - APART * (OF_SUN - OF_RING) * out
    return found | {
        "r.planet": D * out,
        "reaction.bearing_of_planet.i.force": pin,
        "reaction.bearing_of_sun.i.force": OF_SUN * (along + APART * out),
    }
