"""Reference for the model `A03`, Andrews' squeezing mechanism: planar, in complex numbers.
The coordinates are the angles of the seven bodies against x, so a place is a sum of terms
c exp(i angle) and its derivatives are exact. The three loops that close at E leave one freedom:
the accelerations are a particular solution of the closure plus the one motion that it allows, whose
amount follows from virtual power. No multiplier, no Jacobian of a joint in body coordinates.
`simulated` is the spatial mechanism once more in the generic simulator `kkt`."""

from functools import cache

import numpy as np
from kkt import GROUND, Body, Fixed, Joint, Moment, Spring, System, rev, sph
from kkt_joints import cyl
from rigid import Array, Trajectory, Z, turn

NAMES = ("K1", "K2", "K3", "K4", "K5", "K6", "K7")
MASS = (0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498)
INERTIA = (2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)
A, B, C = -0.06934 - 0.00227j, -0.03635 + 0.03273j, 0.014 + 0.072j
STIFFNESS, LENGTH, TORQUE = 4530.0, 0.07785, 0.033
BETA, GAMMA, PHI = -0.0617138900142764496, 0.455279819163070380, 0.222668390165885885
DELTA, OMEGA, EPSILON = 0.487364979543842550, -0.222668390165885885, 1.23054744454982119

# The x axis of a body points: K1 O to F, K2 E to F, K3 as given, K4 G to E, K5 A to G, K6 H to E,
# K7 A to H. Theta is zero at the start.
ANGLES = np.array(
    [BETA, BETA, GAMMA, PHI + DELTA - np.pi / 2, DELTA, OMEGA + EPSILON, EPSILON - np.pi / 2]
)
# A place on a body: the fixed point its chain starts from, and c for each angle.
F = (0j, {0: 0.007})
G, H = (A, {4: 0.04}), (A, {6: 0.04})
E = [(0j, {0: 0.007, 1: -0.028}), (B, {2: -0.035j}), (A, {4: 0.04, 3: 0.02})]
E.append((A, {6: 0.04, 5: 0.02}))
CENTRES = (
    (0j, {0: 0.00092}),
    (0j, {0: 0.007, 1: -0.0115}),
    (B, {2: 0.01043 - 0.01874j}),
    (A, {4: 0.04, 3: 0.00579}),
    (A, {4: 0.02308 + 0.00916j}),
    (A, {6: 0.04, 5: 0.00579}),
    (A, {6: 0.01228 - 0.00449j}),
)
D = (B, {2: 0.02 - 0.018j})

Place = tuple[complex, dict[int, complex]]


def place(of: Place, angles: Array) -> complex:
    """Return where a point is."""
    return of[0] + sum(c * np.exp(1j * angles[k]) for k, c in of[1].items())


def rates(of: Place, angles: Array) -> Array:
    """Return the derivative of a place by each of the seven angles."""
    out = np.zeros(7, complex)
    for k, c in of[1].items():
        out[k] = 1j * c * np.exp(1j * angles[k])
    return out


def centripetal(of: Place, angles: Array, speeds: Array) -> complex:
    """Return the acceleration of a place whose angles turn at constant speeds."""
    return -sum(c * np.exp(1j * angles[k]) * speeds[k] ** 2 for k, c in of[1].items())


def both(x: Array) -> Array:
    """Return real and imaginary parts, one under the other."""
    return np.concatenate([x.real, x.imag])


def closure(angles: Array) -> tuple[Array, Array]:
    """Return the gaps at E, and their derivative by the angles."""
    gaps = np.array([place(x, angles) - place(E[1], angles) for x in (E[0], E[2], E[3])])
    slopes = np.array([rates(x, angles) - rates(E[1], angles) for x in (E[0], E[2], E[3])])
    return both(gaps), both(slopes)


def second(angles: Array, speeds: Array) -> Array:
    """Return the angular accelerations of the seven bodies."""
    slopes = closure(angles)[1]
    ahead = [centripetal(x, angles, speeds) for x in (E[0], E[1], E[2], E[3])]
    gaps = np.array([ahead[0] - ahead[1], ahead[2] - ahead[1], ahead[3] - ahead[1]])
    base = np.linalg.lstsq(slopes, -both(gaps), rcond=None)[0]
    way = np.linalg.svd(slopes)[2][-1]
    inertia, power = 0.0, TORQUE * way[0]
    for k in range(7):
        by_angle = rates(CENTRES[k], angles)
        along = by_angle @ way
        rest = by_angle @ base + centripetal(CENTRES[k], angles, speeds)
        inertia += MASS[k] * abs(along) ** 2 + INERTIA[k] * way[k] ** 2
        power -= MASS[k] * (along.conjugate() * rest).real + INERTIA[k] * way[k] * base[k]
    d = C - place(D, angles)
    pull = STIFFNESS * (abs(d) - LENGTH) * d / abs(d)
    power += (pull.conjugate() * (rates(D, angles) @ way)).real
    return base + power / inertia * way


@cache
def trajectory() -> Trajectory:
    """Return the motion of (angles, angular velocities)."""
    y0 = np.concatenate([ANGLES, np.zeros(7)])
    return Trajectory(lambda _, y: np.concatenate([y[7:], second(y[:7], y[7:])]), y0)


def flat(x: complex) -> tuple[float, float, float]:
    """Return a complex number as a vector in the plane."""
    return (float(np.real(x)), float(np.imag(x)), 0.0)


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`.
    The reactions are those that Newton's law needs for this motion: 41 unknowns, 42 equations."""
    y = trajectory().at(t)
    angles, speeds = y[:7], y[7:]
    turning = second(angles, speeds)
    r = np.array([flat(place(x, angles)) for x in CENTRES])
    p = np.array([turn(Z, x) for x in angles])
    v, v_dot = np.zeros((7, 6)), np.zeros((7, 6))
    v[:, 5], v_dot[:, 5] = speeds, turning
    for k, centre in enumerate(CENTRES):
        by_angle = rates(centre, angles)
        v[k, :3] = flat(by_angle @ speeds)
        v_dot[k, :3] = flat(by_angle @ turning + centripetal(centre, angles, speeds))
    out = SYSTEM.counts | SYSTEM.quantities(r, p, v.ravel(), v_dot.ravel())
    for name, point in (("F1", F), ("E3", E[1]), ("D", D)):
        out[f"rP.{name}"] = np.array(flat(place(point, angles)))
        out[f"rPd.{name}"] = np.array(flat(rates(point, angles) @ speeds))
    return out


def on(body: int, point: Place) -> Fixed:
    """Return a place as a point fixed in a body, in its axes, mass centre at the origin."""
    local = (place(point, ANGLES) - place(CENTRES[body], ANGLES)) * np.exp(-1j * ANGLES[body])
    return Fixed(body, flat(local))


def system() -> System:
    """Return the mechanism in space: revolutes at the ground, one ball, one cylinder a coupler."""
    bodies = [
        Body(name, MASS[k], (INERTIA[k],) * 3, flat(place(CENTRES[k], ANGLES)),
             tuple(turn(Z, ANGLES[k])))
        for k, name in enumerate(NAMES)
    ]  # fmt: skip
    axis = [Fixed(k, (0.0, 0.0, 1.0)) for k in range(7)]
    up = Fixed(GROUND, (0.0, 0.0, 1.0))

    def to_ground(name: str, body: int, point: complex) -> Joint:
        foot = Fixed(GROUND, flat(point))
        return rev(name, on(body, (point, {})), foot, axis[body], up)

    joints = [to_ground("O", 0, 0j), to_ground("B", 2, B)]
    joints += [to_ground("A5", 4, A), to_ground("A7", 6, A)]
    joints += [sph("F", on(1, F), on(0, F)), sph("G", on(3, G), on(4, G))]
    joints += [sph("H", on(5, H), on(6, H))]
    for name, body in (("E2", 1), ("E4", 3), ("E6", 5)):
        joints.append(cyl(name, on(body, E[1]), on(2, E[1]), axis[body], axis[2]))
    springs = [Spring(on(2, D), Fixed(GROUND, flat(C)), STIFFNESS, LENGTH)]
    moments = [Moment(0, (0.0, 0.0, TORQUE))]
    return System(bodies, joints, springs=springs, moments=moments, weight=False)


SYSTEM = system()

#: The quantities once more, from the generic simulator.
simulated = SYSTEM.simulator(1e-12, 1e-13)
