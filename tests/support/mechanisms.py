"""Small mechanisms for tests: off their constraints, redundant or contradictory."""

import numpy as np

import dap3d_core as dap


def rough_four_bar():
    """fourbar3 as its figure has it: follower upright, coupler along (0, 4, 5): too long for it."""
    scene = dap.load("fourbar3")
    lean = np.arctan2(4.0, 5.0) / 2.0
    scene.bodies["coupler"].r = (0.0, 2.0, 4.5)
    scene.bodies["coupler"].p = (np.cos(lean), -np.sin(lean), 0.0, 0.0)
    scene.bodies["follower"].r = (0.0, 4.0, 3.5)
    scene.bodies["follower"].p = (1.0, 0.0, 0.0, 0.0)
    return scene


def door(shift=0.0):
    """A door on two hinges, of which one has five rows too many, with a second leaf on a third."""
    scene = dap.Scene(name="door")
    scene.add_body("door", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(0.5 + shift, 0.0, 0.0))
    scene.add_body("leaf", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(1.5, shift, 0.0))
    for word, z in (("lower", -1.0), ("upper", 1.0)):
        scene.add_point(f"{word}_door", "door", (-0.5, 0.0, z))
        scene.add_point(f"{word}_post", "ground", (0.0, 0.0, z))
        scene.add_joint("rev", word, P_i=f"{word}_door", P_j=f"{word}_post",
                        a_i="door.z", a_j="ground.z")  # fmt: skip
    scene.add_point("edge", "door", (0.5, 0.0, 0.0))
    scene.add_point("side", "leaf", (-0.5, 0.0, 0.0))
    scene.add_joint("rev", "fold", P_i="side", P_j="edge", a_i="leaf.z", a_j="door.z")
    scene.add_force("weight", "gravity")
    return scene


def planar_four_bar(shift=0.0):
    """A parallelogram on four revolutes with parallel axes: three rows too many."""
    scene = dap.Scene(name="planar four-bar")
    for name, r in (("left", (0, 0.5, 0)), ("top", (1, 1 + shift, 0)), ("right", (2, 0.5, shift))):
        scene.add_body(name, mass=1.0, Jp=(1.0, 1.0, 1.0), r=r)
    for name, body, where in [
        ("left_low", "left", (0, -0.5, 0)),
        ("left_high", "left", (0, 0.5, 0)),
        ("top_left", "top", (-1, 0, 0)),
        ("top_right", "top", (1, 0, 0)),
        ("right_low", "right", (0, -0.5, 0)),
        ("right_high", "right", (0, 0.5, 0)),
        ("post", "ground", (2, 0, 0)),
    ]:
        scene.add_point(name, body, where)
    for name, i, j, a_i, a_j in [
        ("J1", "left_low", "ground.O", "left.z", "ground.z"),
        ("J2", "top_left", "left_high", "top.z", "left.z"),
        ("J3", "top_right", "right_high", "top.z", "right.z"),
        ("J4", "right_low", "post", "right.z", "ground.z"),
    ]:
        scene.add_joint("rev", name, P_i=i, P_j=j, a_i=a_i, a_j=a_j)
    return scene


def torn():
    """A body that two spherical joints want in two places, 2 m apart, and one that is content."""
    scene = dap.Scene(name="torn")
    scene.add_body("a", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_body("b", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(0.0, 5.0, 0.0))
    scene.add_point("near", "a", (1.0, 0.0, 0.0))
    scene.add_point("far", "ground", (3.0, 0.0, 0.0))
    scene.add_point("hook", "ground", (0.0, 5.0, 0.0))
    scene.add_joint("sph", "first", P_i="a.O", P_j="ground.O")
    scene.add_joint("sph", "second", P_i="near", P_j="far")
    scene.add_joint("sph", "content", P_i="b.O", P_j="hook")
    return scene


def two_motors():
    """A wheel that two drivers turn, one twice as fast as the other."""
    scene = dap.Scene(name="two motors")
    scene.add_body("wheel", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_joint("rev", "axle", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z")
    for name, rate in (("slow", 1.0), ("fast", 2.0)):
        scene.add_function("a", f"{name}_angle", coeff=(0.0, rate, 0.0))
        scene.add_joint("rel-rot", name, body_i="wheel", a_j="ground.z", function=f"{name}_angle")
    return scene


def bent_chain(n):
    """A chain on revolutes and spherical joints, its joints open by some centimetres, moving."""
    rng = np.random.default_rng(n)
    scene = dap.Scene(name="bent chain")
    outer, axis = "ground.O", "ground.y"
    for k in range(n):
        name, r = f"b{k}", np.array([k + 0.5, 0.0, 0.0]) + 0.03 * rng.uniform(-1, 1, 3)
        p = np.array([1.0, *(0.05 * rng.uniform(-1, 1, 3))])
        p, (v, w) = p / np.linalg.norm(p), rng.normal(size=(2, 3))
        scene.add_body(name, mass=1.0 + k, Jp=(0.1, 0.2, 0.25), r=r, p=p, r_dot=v, w=w)
        inner = scene.add_point(f"in{k}", name, (-0.5, 0.0, 0.0))
        if k % 2:
            scene.add_joint("sph", f"J{k}", P_i=inner, P_j=outer)
        else:
            scene.add_joint("rev", f"J{k}", P_i=inner, P_j=outer, a_i=f"{name}.y", a_j=axis)
        outer, axis = scene.add_point(f"out{k}", name, (0.5, 0.0, 0.0)), f"{name}.y"
    return scene
