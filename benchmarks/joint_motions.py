"""Time to find the motions of joints from their C and J: chains of 10 000 joints.

Points, axes and orientations are drawn at random; every joint is closed, as in an assembled scene.
The mark is 50 us a joint, CPU time of the thread, least of some runs.
"""

import time

import numpy as np

import dap3d_core as dap
from dap3d_core.assembly.motion.classify import classify
from dap3d_core.model.rotations import rotation
from dap3d_core.simulation import CompiledModel

JOINTS, RUNS, MARK = 10_000, 5, 50.0
#: Of each joint, its fields beside P_i and P_j.
AXES = {
    "rev": ("a_i", "a_j"),
    "sph": (),
    "cyl": ("a_i", "a_j"),
    "tran": ("a_j",),
    "univ": ("a_i", "n_j"),
}


def unit(rng, size=3):
    x = rng.normal(size=size)
    return x / np.linalg.norm(x)


def chain(keyword, n):
    """n bodies in a chain from ground, joined by general closed joints of one type."""
    rng = np.random.default_rng(1)
    scene = dap.Scene(name=f"{n} {keyword}")
    r, A, outer = np.zeros(3), np.eye(3), "ground"
    for k in range(n):
        name, P_j, a_j = f"b{k}", rng.uniform(-1.0, 1.0, size=3), unit(rng)
        p = np.array([1.0, 0.0, 0.0, 0.0]) if keyword == "tran" else unit(rng, 4)
        a = A @ a_j
        across = np.cross(a, A @ unit(rng))
        a_i = across / np.linalg.norm(across) if keyword == "univ" else a
        place, A_next = r + A @ P_j, rotation(p)
        P_i = rng.uniform(-1.0, 1.0, size=3)
        if keyword in ("cyl", "tran"):  # apart along the axis
            place = place - 0.4 * a
        scene.add_point(f"o{k}", outer, tuple(P_j))
        scene.add_vector(f"u{k}", outer, tuple(a_j))
        r, A, outer = place - A_next @ P_i, A_next, name
        scene.add_body(name, mass=1.0, Jp=(0.1, 0.2, 0.2), r=tuple(r), p=tuple(p))
        scene.add_point(f"i{k}", name, tuple(P_i))
        scene.add_vector(f"v{k}", name, tuple(A.T @ a_i))
        names = {"P_i": f"i{k}", "P_j": f"o{k}", "a_i": f"v{k}", "a_j": f"u{k}", "n_j": f"u{k}"}
        fields = {field: names[field] for field in ("P_i", "P_j", *AXES[keyword])}
        scene.add_joint(keyword, f"J{k}", **fields)
    return scene


def measure():
    """Rows of the table: joint, how many have a motion, microseconds each."""
    rows = []
    for keyword in AXES:
        model = CompiledModel(chain(keyword, JOINTS)).model
        least = np.inf
        for _ in range(RUNS):
            start = time.thread_time()
            motions = classify(model)
            least = min(least, time.thread_time() - start)
        known = sum(len(group.joints) for group in motions.motions)
        each = least / JOINTS * 1e6
        rows.append({"joint": keyword, "known": known, "us_each": each,
                     "in_mark": "yes" if each <= MARK else "no"})  # fmt: skip
    return rows
