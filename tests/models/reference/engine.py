"""Reference for the model `engine`: the slider-crank in closed form, bearing loads by Newton.
The crank angle is counted from top dead centre. The rod is loaded by the piston at its small end,
which with its own inertia gives the load of the crank pin; the crankshaft is balanced."""

import numpy as np
from rigid import Array
from scipy.interpolate import CubicSpline

SPEED = 3000 * 2.0 * np.pi / 60.0
CRANK, ROD, TO_PIN = 0.04, 0.13, 0.04
M_SHAFT, M_ROD, J_ROD, M_PISTON = 8.0, 0.5, 1.5e-3, 0.4
GRAVITY = np.array([0.0, 9.81])
DEGREES = [0, 15, 30, 60, 90, 120, 140, 180, 220, 360, 440, 540, 600, 640, 680, 700, 720]
NEWTONS = [
    9000,
    14000,
    10500,
    4200,
    2100,
    1200,
    800,
    300,
    50,
    0,
    -50,
    0,
    300,
    900,
    3000,
    5800,
    9000,
]
GAS = CubicSpline(np.radians(DEGREES) / SPEED, NEWTONS, bc_type="periodic")


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`; plane vectors are (y, z)."""
    phi = SPEED * t
    out = np.array([-np.sin(phi), np.cos(phi)])
    pin, pin_2 = CRANK * out, -(SPEED**2) * CRANK * out
    # the rod leans by beta: ROD sin(beta) = CRANK sin(phi)
    sine = CRANK / ROD * np.sin(phi)
    cosine = np.sqrt(1.0 - sine**2)
    rate = CRANK / ROD * SPEED * np.cos(phi) / cosine
    second = (rate**2 * sine - CRANK / ROD * SPEED**2 * np.sin(phi)) / cosine
    along = np.array([sine, cosine])
    along_2 = second * np.array([cosine, -sine]) - rate**2 * along
    piston, piston_2 = pin + ROD * along, pin_2 + ROD * along_2
    centre_2 = pin_2 + TO_PIN * along_2
    # Forces on the rod: small at the piston, which the cylinder holds sideways, big at the pin.
    small_z = -M_PISTON * (piston_2[1] + GRAVITY[1]) - GAS(t)
    # moments about the pin: J acts against beta, which turns the rod about -x
    inertia = TO_PIN * _cross(along, M_ROD * (centre_2 + GRAVITY)) - J_ROD * second
    small = np.array([(ROD * along[0] * small_z - inertia) / (ROD * along[1]), small_z])
    big = M_ROD * (centre_2 + GRAVITY) - small
    main = big + M_SHAFT * GRAVITY
    side = small[0]
    return {
        "r.piston": _space(piston),
        "rd.piston": np.array([0.0, 0.0, -CRANK * SPEED * np.sin(phi) - ROD * rate * sine]),
        "reaction.crank_pin.i.force": _space(big),
        "reaction.main_bearing.i.force": _space(main),
        "reaction.wrist_pin.i.force": _space(small),
        "reaction.cylinder.i.force": np.array([0.0, side, 0.0]),
        "reaction.flywheel.i.moment": np.array([_cross(pin, big), 0.0, 0.0]),
    }


def _cross(a: Array, b: Array) -> float:
    """Return the x component of the cross product of vectors in the y-z plane."""
    return float(a[0] * b[1] - a[1] * b[0])


def _space(a: Array) -> Array:
    """Return a vector of the y-z plane in space."""
    return np.array([0.0, a[0], a[1]])
