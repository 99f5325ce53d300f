"""A four-bar linkage, a leg like Cassie's, a delta robot and a Stewart platform.
Each is a function that returns its motion in minimal coordinates and its joints, in global axes."""

import numpy as np

from support.minimal_motion import Body, MinimalMotion, cross, meeting, rod_axes, turned, unit
from support.model_files import Link

X, Y, Z = np.eye(3)


def along(a, b, normal=Y):
    """The pose of a planar rod from a to b, with its origin in the middle."""
    d = unit(b - a)
    return 0.5 * (a + b), np.stack([d, normal + 0 * d, cross(d, normal)], axis=1)


def rod(mass, length):
    """A rod along x."""
    J = mass * length**2 / 12.0
    return Body(mass, (0.02 * J, J, 1.01 * J))


def four_bar():
    """A crank of 0.3 m that turns a rocker of 0.6 m."""
    A, D = np.zeros(3), np.array([0.9, 0.0, 0.1])
    bodies = {"crank": rod(0.8, 0.3), "coupler": rod(1.5, 0.8), "rocker": rod(1.1, 0.6)}

    def points(s):
        B = 0.3 * (np.cos(s[0]) * X + np.sin(s[0]) * Z)
        return B, meeting(B, 0.8, D, 0.6, -Y)

    def poses(s):
        B, C = points(s)
        return {"crank": along(A, B), "coupler": along(B, C), "rocker": along(D, C)}

    start = np.array([0.9])
    B, C = points(start)
    joints = {
        "a": Link("revolute", "world", "crank", tuple(A), (Y,)),
        "b": Link("revolute", "crank", "coupler", tuple(B), (Y,)),
        "d": Link("revolute", "world", "rocker", tuple(D), (Y,)),
        "c": Link("revolute", "coupler", "rocker", tuple(C), (Y,), closes=True),
    }
    return MinimalMotion(bodies, poses, start), joints


def leg():
    """Thigh, shin and tarsus with a spring in the shin; rods in space and to the foot."""
    hip, knee, spring, ankle = (
        np.array([0, 0, 1.0]),
        (0.12, 0, -0.3),
        (0.0, 0, -0.08),
        (0.05, 0, -0.36),
    )
    foot, crank = (0.02, 0.0, -0.4), (0.06, 0.0, -0.05)
    heel, lug, side = 0.12, np.array([-0.05, 0.0, -0.02]), 0.06
    bodies = {
        "thigh": Body(3.0, (0.05, 0.06, 0.02), (0.05, 0, -0.14)),
        "shin": Body(0.6, (0.002, 0.003, 0.0015), (0, 0, -0.04)),
        "lower": Body(0.9, (0.01, 0.011, 0.002), (0.02, 0, -0.17)),
        "tarsus": Body(0.8, (0.012, 0.013, 0.002), (0, 0, -0.2)),
        "achilles": rod(0.2, 0.5),
        "crank": Body(0.1, (2e-4, 3e-4, 2e-4), (0.02, 0, 0)),
        "plantar": rod(0.1, 0.35),
        "foot": Body(0.15, (3e-4, 5e-4, 4e-4), (0.03, 0, 0)),
    }
    reach = 0.62, 0.36  # of the rods, in the plane

    def chain(s):
        """Poses of all bodies but rods, tarsus and foot, and the points that these need."""
        A = turned(Y, s[0])
        at_knee = hip + A @ knee
        B = A @ turned(Y, s[1])
        at_spring = at_knee + B @ spring
        C = B @ turned(Y, s[2])
        return A, at_knee, B, at_spring, C, at_spring + C @ ankle, hip + A @ lug

    def poses(s):
        A, at_knee, B, at_spring, C, at_ankle, top = chain(s)
        back = meeting(at_ankle, heel, top, reach[0], Y)
        x = unit(at_ankle - back)  # the tarsus points away from its heel
        T = np.stack([x, Y + 0 * x, cross(x, Y)], axis=1)
        at_crank, at_foot = at_ankle + T @ crank, at_ankle + T @ foot
        K = T @ turned(Y, s[3])
        end = at_crank + K @ (0.05, 0.0, 0.0)
        toe = meeting(at_foot, 0.06, end, reach[1], -Y)
        f = unit(toe - at_foot)
        lifted = top + side * Y
        d = unit(back - lifted)
        return {
            "thigh": (hip + 0 * top, A), "shin": (at_knee, B), "lower": (at_spring, C),
            "tarsus": (at_ankle, T), "achilles": (lifted + 0.25 * d, rod_axes(d, Y)),
            "crank": (at_crank, K), "plantar": along(end, toe),
            "foot": (at_foot, np.stack([f, Y + 0 * f, cross(f, Y)], axis=1)),
        }  # fmt: skip

    start = np.array([-0.2, 0.9, 0.0, 0.3])
    here = poses(start)
    _, at_knee, _, at_spring, _, at_ankle, top = chain(start)
    T = here["tarsus"][1]
    back = at_ankle - heel * T[:, 0]
    end = here["crank"][0] + here["crank"][1] @ (0.05, 0.0, 0.0)
    at_foot, F = here["foot"]
    w = here["achilles"][1][:, 2]
    joints = {
        "hip": Link("revolute", "world", "thigh", tuple(hip), (Y,), 40.0, 1.0),
        "knee": Link("revolute", "thigh", "shin", tuple(at_knee), (Y,), 60.0, 1.0),
        "spring": Link("revolute", "shin", "lower", tuple(at_spring), (Y,), 100.0, 0.5),
        "ankle": Link("revolute", "lower", "tarsus", tuple(at_ankle), (Y,)),
        "turn": Link("revolute", "tarsus", "crank", tuple(here["crank"][0]), (Y,), 0.5, 0.01),
        "rod_pin": Link("revolute", "crank", "plantar", tuple(end), (Y,)),
        "toe_pin": Link("revolute", "tarsus", "foot", tuple(at_foot), (Y,)),
        "top": Link("universal", "thigh", "achilles", tuple(top + side * Y), (Y, w)),
        "heel": Link("ball", "achilles", "tarsus", tuple(back), closes=True),
        "toe": Link("ball", "plantar", "foot", tuple(at_foot + 0.06 * F[:, 0]), closes=True),
    }
    springs = [(40.0, 1.0), (60.0, 1.0), (100.0, 0.5), (0.5, 0.01)]
    return MinimalMotion(bodies, poses, start, springs, lambda s: s), joints


def delta():
    """Three arms on springs; each carries the platform by two parallel rods."""
    R, r, L1, L2, half = 0.2, 0.06, 0.25, 0.5, 0.05
    bodies = {"platform": Body(0.5, (5e-4, 6e-4, 9e-4))}
    radial = [np.array([np.cos(a), np.sin(a), 0.0]) for a in 2.0 * np.pi * np.arange(3) / 3.0]
    tangent = [cross(Z, e) for e in radial]
    for i in range(3):
        bodies[f"arm{i}"] = rod(0.3, L1)
        bodies |= {f"rod{i}{k}": rod(0.05, L2) for k in range(2)}

    def elbow(s, i):
        e, t = radial[i], tangent[i]
        offset = s @ t
        centre = s + r * e - offset * t
        return meeting(R * e, L1, centre, np.sqrt(L2**2 - offset**2), -t)

    def poses(s):
        found = {"platform": (s, np.eye(3) + 0 * s[0])}
        for i, (e, t) in enumerate(zip(radial, tangent, strict=True)):
            E = elbow(s, i)
            found[f"arm{i}"] = along(R * e + 0 * s, E, t)
            for k, side in enumerate((-half, half)):
                d = unit(s + r * e - E)
                found[f"rod{i}{k}"] = (E + side * t + 0.5 * L2 * d, rod_axes(d, t))
        return found

    def angles(s):
        arms = (elbow(s, i) - R * e for i, e in enumerate(radial))
        return np.array([-np.arctan(a @ Z / (a @ e)) for a, e in zip(arms, radial, strict=True)])

    start = np.array([0.05, 0.03, -0.45])
    here, joints = poses(start), {}
    for i, (e, t) in enumerate(zip(radial, tangent, strict=True)):
        E = elbow(start, i)
        joints[f"hip{i}"] = Link("revolute", "world", f"arm{i}", tuple(R * e), (t,), 5.0, 0.05)
        for k, side in enumerate((-half, half)):
            w = here[f"rod{i}{k}"][1][:, 2]
            joints[f"elbow{i}{k}"] = Link("universal", f"arm{i}", f"rod{i}{k}",
                                          tuple(E + side * t), (t, w))  # fmt: skip
    for i, (e, t) in enumerate(zip(radial, tangent, strict=True)):
        for k, side in enumerate((-half, half)):
            joints[f"wrist{i}{k}"] = Link("ball", f"rod{i}{k}", "platform",
                                          tuple(start + r * e + side * t), closes=True)  # fmt: skip
    return MinimalMotion(bodies, poses, start, [(5.0, 0.05)] * 3, angles), joints


def stewart():
    """A platform of 2 kg on six legs that are springs."""
    feet = [0.5 * np.array([np.cos(a), np.sin(a), 0.0])
            for third in range(3) for a in (2.1 * third - 0.2, 2.1 * third + 0.2)]  # fmt: skip
    heads = [0.3 * np.array([np.cos(a), np.sin(a), -0.05])
             for third in range(3) for a in (2.1 * third - 0.8, 2.1 * third + 0.8)]  # fmt: skip
    arms = [unit(cross(Z, foot)) for foot in feet]
    bodies = {"top": Body(2.0, (0.04, 0.05, 0.08), (0.01, 0.02, 0.03))}
    for i in range(6):
        bodies |= {f"low{i}": rod(0.3, 0.4), f"up{i}": rod(0.2, 0.4)}

    def top(s):
        return s[:3], turned(Z, s[5]) @ turned(Y, s[4]) @ turned(X, s[3])

    def legs(s):
        o, A = top(s)
        return [o + A @ head - foot for head, foot in zip(heads, feet, strict=True)]

    def poses(s):
        found = {"top": top(s)}
        for i, (leg_, foot) in enumerate(zip(legs(s), feet, strict=True)):
            d = unit(leg_)
            axes = rod_axes(d, arms[i])
            found |= {f"low{i}": (foot + 0.2 * d, axes), f"up{i}": (foot + leg_ - 0.2 * d, axes)}
        return found

    def lengths(s):
        return np.array([np.sqrt(leg_ @ leg_) for leg_ in legs(s)])

    start = np.array([0.04, -0.03, 0.6, 0.1, -0.15, 0.2])
    here, joints = poses(start), {}
    o, A = top(start)
    for i in range(6):
        axes = here[f"low{i}"][1]
        joints[f"foot{i}"] = Link("universal", "world", f"low{i}", tuple(feet[i]),
                                  (arms[i], axes[:, 2]))  # fmt: skip
        joints[f"slide{i}"] = Link("prismatic", f"low{i}", f"up{i}", tuple(here[f"up{i}"][0]),
                                   (axes[:, 0],), 400.0, 4.0)  # fmt: skip
    for i in range(6):
        joints[f"head{i}"] = Link("ball", f"up{i}", "top", tuple(o + A @ heads[i]), closes=True)
    return MinimalMotion(bodies, poses, start, [(400.0, 4.0)] * 6, lengths), joints


CHAINS = {"four-bar": four_bar, "leg": leg, "delta": delta, "stewart": stewart}
