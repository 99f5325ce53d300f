"""Mechanisms that start at, go through or end at poses where their constraints lose rank."""

import numpy as np

import dap3d_core as dap


def flat_parallelogram(w=(0.0, 0.0, 0.0), size=1.0, far=2.0):
    """Cranks a, c of 1 m on a frame of 2 m, coupler b, all in line; a moment of 1 N m turns a.

    Args:
        w: of a, b, c about y, rad/s.
        size: length of a crank, in other units than m.
        far: length of frame and coupler, in cranks.
    """
    scene = dap.Scene(name="flat parallelogram")
    tips = -size * np.array([w[0], w[0] + far * w[1], w[2]])  # r_dot_z of a1, b1, c1
    ends = {"a": (0.0, 1.0), "b": (1.0, 1.0 + far), "c": (far, far + 1.0)}
    rates = (0.5 * tips[0], 0.5 * (tips[0] + tips[1]), 0.5 * tips[2])
    for (name, (low, high)), rate, turn in zip(ends.items(), rates, w, strict=True):
        scene.add_body(name, mass=1.0, Jp=(0.1 * size**2,) * 3, w=(0.0, turn, 0.0),
                       r=(0.5 * size * (low + high), 0.0, 0.0), r_dot=(0.0, 0.0, rate))  # fmt: skip
        for k, sign in enumerate((-0.5, 0.5)):
            scene.add_point(f"{name}{k}", name, (sign * size * (high - low), 0.0, 0.0))
    scene.add_point("post", "ground", (far * size, 0.0, 0.0))
    for name, i, j in (("j1", "a0", "ground.O"), ("j2", "b0", "a1"),
                       ("j3", "b1", "c1"), ("j4", "c0", "post")):  # fmt: skip
        bodies = [p.split(".")[0] if "." in p else p[0] for p in (i, j)]
        axis = "ground.y" if bodies[1] in ("ground", "p") else f"{bodies[1]}.y"
        scene.add_joint("rev", name, P_i=i, P_j=j, a_i=f"{bodies[0]}.y", a_j=axis)
    scene.add_force("n", "motor", body_i="a", n=(0.0, size**2, 0.0))
    return scene


def strut():
    """Two rods in line between two posts as far apart as they are long, under their weight."""
    scene = dap.Scene(name="strut")
    for name, x in (("left", 0.5), ("right", 1.5)):
        scene.add_body(name, mass=1.0, Jp=(0.1, 0.1, 0.1), r=(x, 0.0, 0.0))
        for end, at in (("0", -0.5), ("1", 0.5)):
            scene.add_point(name + end, name, (at, 0.0, 0.0))
    scene.add_point("post", "ground", (2.0, 0.0, 0.0))
    scene.add_joint("rev", "A", P_i="left0", P_j="ground.O", a_i="left.y", a_j="ground.y")
    scene.add_joint("rev", "B", P_i="left1", P_j="right0", a_i="left.y", a_j="right.y")
    scene.add_joint("rev", "C", P_i="right1", P_j="post", a_i="right.y", a_j="ground.y")
    scene.add_force("weight", "gravity")
    return scene


def arm(rate=1.0 / 3.7):
    """Two links of 1 m whose hand is driven along x: 1 m + rate t, out of reach from 2 m on."""
    scene = dap.Scene(name="arm")
    for name, x, lean in (("upper", 0.25, 1.0), ("fore", 0.75, -1.0)):
        p = (np.cos(np.pi / 6), 0.0, 0.0, lean * np.sin(np.pi / 6))
        scene.add_body(name, mass=1.0, Jp=(0.001, 1 / 12, 1 / 12), r=(x, 3**0.5 / 4, 0.0), p=p)
        for end, at in (("0", -0.5), ("1", 0.5)):
            scene.add_point(name + end, name, (at, 0.0, 0.0))
    scene.add_function("a", "pull", coeff=(1.0, rate, 0.0))
    scene.add_joint("rev", "A", P_i="upper0", P_j="ground.O", a_i="upper.z", a_j="ground.z")
    scene.add_joint("rev", "B", P_i="fore0", P_j="upper1", a_i="fore.z", a_j="upper.z")
    scene.add_joint("rP", "hand_x", P_i="fore1", a_j="ground.x", length=0.0, function="pull")
    scene.add_joint("rP", "hand_y", P_i="fore1", a_j="ground.y", length=0.0)
    return scene


def car():
    """A car of four wheels without lateral slip, the two in front steered by equal angles."""
    scene, radius, speed = dap.Scene(name="car"), 0.3, 5.0
    scene.add_body("chassis", mass=800.0, Jp=(200.0, 800.0, 900.0), r=(0, 0, 0.5),
                   r_dot=(speed, 0, 0))  # fmt: skip
    scene.add_function("harmonic", "steer", amplitude=-0.3, frequency=0.5)
    for name, x, y in (("fl", 1.2, 0.7), ("fr", 1.2, -0.7), ("rl", -1.2, 0.7), ("rr", -1.2, -0.7)):
        wheel, centre, holder = f"w{name}", f"c{name}", "chassis"
        scene.add_body(wheel, mass=20.0, Jp=(0.6, 1.0, 0.6), r=(x, y, radius),
                       r_dot=(speed, 0, 0), w=(0, speed / radius, 0))  # fmt: skip
        scene.add_point(centre, "chassis", (x, y, radius - 0.5))
        if name[0] == "f":
            holder, knuckle = f"k{name}", f"k{name}"
            scene.add_body(knuckle, mass=10.0, Jp=(0.2,) * 3, r=(x, y, radius),
                           r_dot=(speed, 0, 0))  # fmt: skip
            scene.add_joint("rev", f"steer_{name}", P_i=f"{knuckle}.O", P_j=centre,
                            a_i=f"{knuckle}.z", a_j="chassis.z")  # fmt: skip
            scene.add_joint("drive-rot", f"motor_{name}", body_i=knuckle, body_j="chassis",
                            a_j="chassis.z", function="steer")  # fmt: skip
        place = centre if holder == "chassis" else f"{holder}.O"
        scene.add_joint("rev", f"axle_{name}", P_i=f"{wheel}.O", P_j=place,
                        a_i=f"{wheel}.y", a_j=f"{holder}.y")  # fmt: skip
        scene.add_joint("disk", f"tyre_{name}", body_i=wheel, slip="nz", radius=radius)
    scene.add_force("weight", "gravity")
    return scene
