"""Modes of contacts, and which of their forces are a choice."""

import numpy as np
import pytest
from support.internals import ContactTable

import dap3d_core as dap
from dap3d_core.formulations.contacts.decide import find_modes_at_rest
from dap3d_core.simulation import CompiledModel

MASS, HEIGHT, MU, G = 3.0, 0.2, 0.3, 9.81
FEET = np.array([(0.3, 0.1), (-0.3, 0.1), (0.0, -0.2)])


@pytest.mark.parametrize("slides", [True, False])
def test_feet_share_their_load_where_more_forces_hold_than_the_motion_needs(slides):
    """A sled on three feet: where it slides three normal forces are found by its balance, with
    friction against the slip; where it rests nine forces hold six freedoms."""
    v = np.array([1.0, 0.2, 0.0]) * slides
    scene = dap.Scene(name="sled")
    scene.add_force("weight", "gravity")
    scene.add_body("sled", mass=MASS, Jp=(0.1, 0.1, 0.1), r=(0, 0, HEIGHT), r_dot=v.tolist())
    for k, (x, y) in enumerate(FEET):
        scene.add_point(f"foot{k}", "sled", (x, y, -HEIGHT))
        scene.add_contact("ball_plane", f"floor{k}", P_i=f"foot{k}", mu=MU)
    model = CompiledModel(scene)
    evaluator = model.evaluator
    table = ContactTable(evaluator)
    found = table.arrays()
    found.in_touch[:], found.in_touch_count = [0, 1, 2], 3
    given = evaluator.system, evaluator.loops, evaluator.functions, table.tensions
    assert find_modes_at_rest(0.0, found, *given)
    assert (found.mode == (1.0 if slides else 2.0)).all()
    assert found.near.any() != slides
    arms = np.column_stack([FEET, np.full(3, -HEIGHT)])
    pushes = np.array([0.0, 0.0, 1.0]) - (MU * v / np.linalg.norm(v) if slides else 0.0)
    balance = np.vstack([np.ones(3), np.cross(arms, pushes)[:, :2].T])
    assert found.force[:, 0] == pytest.approx(np.linalg.solve(balance, [MASS * G, 0, 0]), rel=1e-12)
