"""Joints that close loops in trees, and joints whose rows are kept, for tests and benchmarks."""

import numpy as np

import dap3d_core as dap
from support.rotations import rotation

#: Joints that close a loop, in the order in which they are drawn.
CLOSING = ("sph", "sph-sph", "univ", "rev")


def add_loops(scene, seed, count, keywords=CLOSING):
    """Add joints between bodies drawn at random, or a body and ground, closed as these stand.
    Whether rows of theirs depend on others is left to chance."""
    rng = np.random.default_rng(seed)
    bodies = ["ground", *scene.bodies]
    for n in range(count):
        i, j = sorted(rng.choice(len(bodies), size=2, replace=False), reverse=True)
        close(scene, f"loop{n}", bodies[i], bodies[j], str(rng.choice(keywords)), rng)
    return scene


def add_twins(scene, seed, count):
    """Repeat hinges of a scene further along their axes: five rows each that hold already."""
    rng = np.random.default_rng(seed)
    hinges = [name for name, joint in scene.joints.items() if joint.type == "rev"]
    for n, name in enumerate(rng.permutation(hinges)[:count]):
        fields = dict(scene.joints[name].fields)
        for side in "ij":
            point, axis = scene.points[fields[f"P_{side}"]], scene.vectors[fields[f"a_{side}"]]
            along = np.array(point.sPp) + 0.7 * np.array(axis.sp)
            fields[f"P_{side}"] = scene.add_point(
                f"twin{n}{side}", point.body, tuple(along.tolist())
            )
        scene.add_joint("rev", f"twin{n}", **fields)
    return scene


def spatial_four_bar(seed=0):
    """Three bodies in a loop with ground on one hinge and three cylindrical joints; one freedom."""
    rng = np.random.default_rng(seed)
    scene = dap.Scene(name="RCCC")
    for k in range(3):
        r, p = rng.normal(size=3), rng.normal(size=4)
        p /= np.linalg.norm(p)
        place = {"r": tuple(r.tolist()), "p": tuple(p.tolist())}
        scene.add_body(f"b{k}", mass=1.0 + k, Jp=(0.3, 0.4, 0.5), **place)
    bodies = ["b0", "b1", "b2", "ground"]
    close(scene, "J0", "b0", "ground", "rev", rng)
    for k in range(3):
        close(scene, f"J{k + 1}", bodies[k], bodies[k + 1], "cyl", rng)
    scene.add_force("weight", "gravity")
    return scene


def close(scene, name, i, j, keyword, rng):
    """Add a joint between two bodies at a random point, closed as they stand."""
    at, axis, other = rng.normal(size=(3, 3))
    axis /= np.linalg.norm(axis)
    normal = np.cross(axis, other) / np.linalg.norm(np.cross(axis, other))

    def local(body, x, is_point):
        if body == "ground":
            return tuple(x.tolist())
        made = scene.bodies[body]
        x = x - np.array(made.r) if is_point else x
        return tuple((rotation(np.array(made.p)).T @ x).tolist())

    def point(body, side, x):
        return scene.add_point(f"{name}{side}", body, local(body, x, True))

    def vector(body, side, x):
        return scene.add_vector(f"{name}a{side}", body, local(body, x, False))

    if keyword == "sph-sph":
        way = rng.normal(size=3)
        fields = {"P_i": point(i, "i", at), "P_j": point(j, "j", at + way),
                  "length": float(np.linalg.norm(way))}  # fmt: skip
    elif keyword == "cyl":
        d = scene.add_vector2(f"{name}d", point(i, "i", at + 0.5 * axis), point(j, "j", at))
        fields = {"d": d, "a_i": vector(i, "i", axis), "a_j": vector(j, "j", axis)}
    else:
        fields = {"P_i": point(i, "i", at), "P_j": point(j, "j", at)}
        if keyword == "rev":
            fields |= {"a_i": vector(i, "i", axis), "a_j": vector(j, "j", axis)}
        elif keyword == "univ":
            fields |= {"a_i": vector(i, "i", axis), "n_j": vector(j, "j", normal)}
    scene.add_joint(keyword, name, **fields)
