"""Radau in joint coordinates: what its tangent has columns for."""

import numpy as np

import dap3d_core as dap
from dap3d_core.integrators.radau.joint_integration import JointRadauIntegration


def test_modes_of_contacts_have_no_columns():
    """They are constant between events: of a ball on a floor the motion alone is left."""
    scene = dap.Scene(name="ball")
    scene.add_force("weight", "g")
    scene.add_body("b", mass=1.0, Jp=[0.004] * 3, r=[0.0, 0.0, 0.1], r_dot=[1.0, 0.0, 0.0])
    scene.add_contact("ball_plane", "floor", P_i="b.O", radius=0.1, mu=0.3)
    evaluator = dap.compile(scene, method="joint").evaluator
    y = evaluator.integrated(evaluator.model.u0)
    integration = JointRadauIntegration(evaluator, y, np.array([0.0, 1.0]),
                                        report_size=evaluator.report_size)  # fmt: skip
    motion = evaluator.coordinates.nodes.layout["states"].start
    assert evaluator.model.state_count > 0
    assert integration.tangent.J.shape == (motion, motion)
