"""Motions of joints from C and J alone, against C of the whole model at random coordinates."""

import numpy as np
import pytest
from support.joint_pairs import STANDARD, pair

from dap3d_core.assembly.motion.classify import classify
from dap3d_core.model.rigid_motion import Pose, compose
from dap3d_core.simulation import CompiledModel

#: C of lengths of 1 m to 3 m: some hundred operations of relative error 1e-16.
ROUNDING = 1e-13
PARTS = {
    "sph": [("ball", "j", "P_j")],
    "rev": [("rotation", "j", "a_j")],
    "univ": [("rotation", "j", "n_j"), ("rotation", "i", "a_i")],
    "cyl": [("translation", "j", "a_j"), ("rotation", "j", "a_j")],
    "tran": [("translation", "j", "a_j")],
}


def residual(compiled, motion, q, base):
    """The largest C of a model of one joint with body i placed by coordinates q, body j by base."""
    n = compiled.model.body_count
    j = Pose(*(np.asarray(x)[None] for x in base))
    there = compose(j, motion.pose(np.asarray(q, dtype=float)[None]))
    u = np.zeros(13 * n)
    placed = {int(motion.body_i[0]): there, int(motion.body_j[0]): j}
    u[: 7 * n] = np.hstack([np.hstack(placed[b + 1]) for b in range(n)]).ravel()
    return float(np.max(np.abs(compiled.evaluator.rows(0.0, u).C), initial=0.0))


@pytest.mark.parametrize("on_ground", [False, True], ids=["between bodies", "on ground"])
@pytest.mark.parametrize("keyword", STANDARD)
def test_motion_keeps_the_constraints(keyword, on_ground):
    """C = 0 at random coordinates of the motion found, wherever body j is; named axes are right."""
    scene = pair(3, on_ground=on_ground)
    scene.add_joint(keyword, "J", **STANDARD[keyword])
    compiled = CompiledModel(scene)
    motions = classify(compiled.model)
    assert not motions.refused
    motion = motions.of(0)
    found = [(part.kind, part.constant_in, part.name) for part in motion.parts]
    assert found == PARTS[keyword]
    assert motion.size == 6 - compiled.model.row_count
    rng = np.random.default_rng(5)
    for _ in range(5):
        p = rng.normal(size=4)
        base = rng.normal(size=3), p / np.linalg.norm(p)
        if on_ground:
            base = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        q = rng.normal(size=motion.size) * 2.0
        assert residual(compiled, motion, q, base) < ROUNDING
