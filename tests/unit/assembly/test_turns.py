"""Angles of joints as the driver measures them: against joint coordinates from poses."""

import numpy as np
import pytest
from support.internals import Pose, compose, join, relative, rotation_vector
from support.joint_pairs import BETWEEN, STANDARD, compiled_pair
from support.rotations import to_global

from dap3d_core.assembly.motion.coordinates import angle_columns
from dap3d_core.assembly.turns import RATE, STATE

#: Joints with one rotation and with two, axes parallel and not.
JOINTS = {name: STANDARD[name] for name in ("rev", "univ", "cyl")}
JOINTS |= dict.fromkeys(("planar", "pin-in-slot", "two-hinges", "sleeve"), BETWEEN)
JOINTS["screw"] = BETWEEN | {"pitch": -0.4}


def bodies_at(motion, base, q):
    """Poses (2,) of bodies i and j where body j is at ``base``."""
    pose = compose(base, motion.pose(q[None]))
    return Pose(*(np.concatenate([a, b]) for a, b in zip(pose, base, strict=True)))


def state_of(motion, evaluator, rng, q, q_dot):
    """A state (26,) at coordinates q and rates q_dot, while body j moves at random."""
    p = rng.normal(size=(1, 4))
    base = Pose(rng.normal(size=(1, 3)), p / np.linalg.norm(p))
    v, w = rng.normal(size=(2, 3))
    h, ends = 1e-6, []
    for t in (-h, h):
        turn = np.concatenate([[1.0], 0.5 * t * w])[None]
        moved = Pose(base.r + t * v, compose(Pose(0.0 * base.r, turn), base).p)
        ends.append(bodies_at(motion, moved, q + t * q_dot))
    here = bodies_at(motion, base, q)
    rate = (ends[1].r - ends[0].r) / (2.0 * h)
    spin = to_global(here.p, rotation_vector(relative(*ends).p)) / (2.0 * h)
    order = [evaluator.model.body_names.index(name) for name in ("body", "base")]
    arrays = np.empty((4,), dtype=object)
    arrays[:] = here.r, here.p, rate, spin
    return join(*(array[np.argsort(order)] for array in arrays))


@pytest.mark.parametrize("keyword", JOINTS)
def test_angles_and_rates_are_those_of_the_joint(keyword):
    """Within half a turn of the angles given they are q; rates are q_dot, to 1e-8 as h^2 and
    rounding over h give for differences of poses."""
    compiled = compiled_pair(keyword, JOINTS[keyword], 2)
    evaluator, motion = compiled.evaluator, compiled.model.motions.of(0)
    columns = angle_columns(motion)
    assert compiled.model.joint_angle_count == len(columns)
    rng = np.random.default_rng(5)
    for _ in range(5):
        q = rng.uniform(-1.5, 1.5, size=motion.size)
        q[columns] *= 20.0
        q_dot = rng.uniform(-1.0, 1.0, size=motion.size)
        u = state_of(motion, evaluator, rng, q, q_dot)
        near = q[columns] + rng.uniform(-2.5, 2.5, size=len(columns))
        evaluator.start(0.0, u, near)
        own = evaluator.counted_angles(0.0, u)
        np.testing.assert_allclose(own, q[columns], atol=1e-12)
        later = evaluator.counted_angles(0.01, u) - own  # near a(0) + rate t: the same turns
        np.testing.assert_allclose(later, 0.0, atol=1e-12)
        rates = evaluator.system.par[evaluator.system.turns[:, STATE] + RATE]
        np.testing.assert_allclose(rates, q_dot[columns], atol=2e-8)
