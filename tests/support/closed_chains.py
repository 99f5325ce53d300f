"""A Stewart platform as a file would say it: its joints, and its motion in minimal coordinates."""

import numpy as np

from support.minimal_motion import Body, MinimalMotion, cross, rod_axes, turned, unit
from support.model_files import Link

X, Y, Z = np.eye(3)


def rod(mass, length):
    """A rod along x."""
    J = mass * length**2 / 12.0
    return Body(mass, (0.02 * J, J, 1.01 * J))


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
