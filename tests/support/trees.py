"""Trees of bodies for tests and benchmarks."""

import numpy as np

import dap3d_core as dap
from support.problems import chain

#: Joints of random trees, with their fields by the sides of child (c) and parent (p).
JOINTS = ("rev", "sph", "cyl", "tran", "univ")


def mixed_chain(n):
    """A chain of n rods with revolute and spherical joints in turn."""
    return chain(n, ("rev", "sph"), (0.0, 0.0, -1.0))


def random_tree(n, seed=0, joints=JOINTS, free=0.0, lag=5):
    """A tree of n bodies on joints drawn from some types, closed where it is given, and weight.
    Every body hangs on one of the ``lag`` before it, or is free with a probability; of half of the
    joints the child is body i, of the others body j."""
    rng = np.random.default_rng(seed)
    scene = dap.Scene(name=f"random tree {seed} of {n}")
    r, A = [np.zeros(3)], [np.eye(3)]
    for k in range(n):
        parent = int(rng.integers(max(0, k - lag), k + 1))
        p = _unit(rng.normal(size=4))
        r.append(r[parent] + rng.normal(size=3))
        A.append(_rotation(p))
        J = np.diag(rng.uniform(0.05, 0.1, size=3))
        Q = _rotation(_unit(rng.normal(size=4)))
        mass, v, w = float(rng.uniform(0.5, 2.0)), rng.normal(size=3), rng.normal(size=3)
        scene.add_body(f"b{k}", mass=mass, Jp=Q @ J @ Q.T, r=tuple(r[-1]), p=tuple(p),
                       r_dot=tuple(v), w=tuple(w))  # fmt: skip
        if rng.uniform() < free:
            r[-1] = np.zeros(3)
            continue
        _add_joint(scene, k, parent, r, A, str(rng.choice(joints)), rng)
    scene.add_force("weight", "gravity")
    return scene


def _add_joint(scene, k, parent, r, A, keyword, rng):
    """A joint of body k with a parent (0 is ground, m is b{m - 1}), closed as it stands."""
    child, at = k + 1, r[k + 1] + 0.5 * rng.normal(size=3)
    names = {child: f"b{k}", parent: "ground" if parent == 0 else f"b{parent - 1}"}
    axis = _unit(rng.normal(size=3))
    other = _unit(np.cross(axis, rng.normal(size=3)))
    i, j = (child, parent) if parent == 0 or rng.uniform() < 0.5 else (parent, child)

    def local(body, x):
        return tuple(float(c) for c in A[body].T @ x)

    def point(side, body, where):
        return scene.add_point(f"P{side}{k}", names[body], local(body, where - r[body]))

    def vector(side, body, direction):
        return scene.add_vector(f"a{side}{k}", names[body], local(body, direction))

    if keyword in ("cyl", "tran"):
        way = at + rng.uniform(0.3, 0.6) * axis
        d = scene.add_vector2(f"d{k}", point("i", i, way), point("j", j, at))
        fields = {"d": d, "a_j": vector("j", j, axis)}
        if keyword == "cyl":
            fields["a_i"] = vector("i", i, axis)
        else:
            fields["A_c"] = A[i].T @ A[j]
    else:
        fields = {"P_i": point("i", i, at), "P_j": point("j", j, at)}
        if keyword == "rev":
            fields |= {"a_i": vector("i", i, axis), "a_j": vector("j", j, axis)}
        elif keyword == "univ":
            fields |= {"a_i": vector("i", i, axis), "n_j": vector("j", j, other)}
    scene.add_joint(keyword, f"J{k}", **fields)


def _unit(x):
    return x / np.linalg.norm(x)


def _rotation(p):
    from support.rotations import rotation

    return rotation(np.asarray(p))
