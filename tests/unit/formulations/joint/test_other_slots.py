"""Joints in trees whose bodies have other letters than i and j."""

import numpy as np
import pytest
from support.own_types import registry_of
from unit.formulations.joint.test_equations import ACCELERATIONS, MULTIPLIERS, closed

import dap3d_core as dap
from dap3d_core.interface import Joint, Point, Vector, point, vector
from dap3d_core.kernels import add, cross, dot, eye, hstack, neg, row, skew, sub
from dap3d_core.simulation import CompiledModel

ZERO = (0.0, 0.0, 0.0)


class Cross(Joint):
    """A universal joint between bodies i and k."""

    keyword, rows = "cross", 4
    P_i: Point = point()
    P_k: Point = point()
    a_i: Vector = vector()
    n_k: Vector = vector()

    def C(r_P_i, r_P_k, a_i, n_k):
        return (*sub(r_P_k, r_P_i), dot(a_i, n_k))

    def J(s_P_i, s_P_k, a_i, n_k):
        n = cross(a_i, n_k)
        return (
            (*hstack(eye(-1.0), skew(s_P_i)), row(ZERO, n)),
            (*hstack(eye(1.0), skew(neg(s_P_k))), row(ZERO, neg(n))),
        )

    def gamma(s_P_i, s_P_k, a_i, n_k, a_i_dot, n_k_dot, w_i, w_k):
        rows = sub(cross(w_i, cross(w_i, s_P_i)), cross(w_k, cross(w_k, s_P_k)))
        return (*rows, dot(add(cross(a_i_dot, n_k), cross(a_i, n_k_dot)), sub(w_k, w_i)))


@pytest.mark.parametrize("child", ["i", "k"])
def test_a_joint_between_bodies_i_and_k_moves_as_in_standard(child):
    """Away from the poses of the scene, where axes that are constant in the child do not turn."""
    scene = dap.Scene(name="cross")
    for name, x in (("arm", 0.5), ("bob", 1.5)):
        scene.add_body(name, mass=1.0, Jp=(0.1, 0.2, 0.3), r=(x, 0.0, 0.0))
        scene.add_point(f"{name}_in", name, (-0.5, 0.0, 0.0))
    end = scene.add_point("arm_out", "arm", (0.5, 0.0, 0.0))
    scene.add_joint("rev", "hinge", P_i="arm_in", P_j="ground.O", a_i="arm.y", a_j="ground.y")
    if child == "k":
        scene.add_joint("cross", "joint", P_i=end, P_k="bob_in", a_i="arm.y", n_k="bob.z")
    else:
        scene.add_joint("cross", "joint", P_i="bob_in", P_k=end, a_i="bob.z", n_k="arm.y")
    scene.add_force("weight", "gravity", wgt=(0.0, 0.6, 0.8))
    standard, joint = (
        CompiledModel(scene, method=method, registry=registry_of(Cross))
        for method in ("standard", "joint")
    )
    motion = dap.simulate(standard, t_end=0.6, dt=0.6)
    u, size = closed(standard.evaluator, motion.u[-1]), 6 * 2
    right, found = (model.evaluator.report(0.0, u) for model in (standard, joint))
    difference = np.abs(found - right)
    assert np.max(difference[:size]) < ACCELERATIONS * np.max(np.abs(right[:size]))
    rows = slice(size, size + 9)
    assert np.max(difference[rows]) < 10.0 * MULTIPLIERS * np.max(np.abs(right[rows]))
