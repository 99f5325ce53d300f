"""Rows that are certainly independent are so by their pivots, too."""

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.assembly.arrays import ACCELERATION
from dap3d_core.assembly.evaluate import call_kinds, place
from dap3d_core.formulations.common import independent_rows
from dap3d_core.formulations.common.constraints import factorise
from dap3d_core.formulations.contacts.contact_table import ContactTable
from dap3d_core.linear.ldlt.factor import scale_blocks
from dap3d_core.simulation import CompiledModel


@pytest.mark.parametrize("mode", [1.0, 2.0])
def test_one_contact_whose_moments_are_small_has_no_small_pivot(mode):
    """Balls of many radii of inertia, at many attitudes, at a wall."""
    rng, found = np.random.default_rng(2), []
    for length in np.geomspace(0.02, 2.0, 20):
        scene = dap.Scene(name="ball")
        p = rng.normal(size=4)
        Jp = 3.0 * length**2 * np.array([1.0, rng.uniform(0.6, 1.0), rng.uniform(0.6, 1.0)])
        scene.add_body("ball", mass=3.0, Jp=Jp, r=[0.1, 0.0, 0.0], p=p / np.linalg.norm(p))
        scene.add_contact("ball_plane", "wall", P_i="ball.O", radius=0.1, a_j="ground.x", mu=0.5)
        evaluator = CompiledModel(scene, joint=False).evaluator
        states = evaluator.model.initial_states.copy()
        table = ContactTable(evaluator)
        states[table.mode] = mode
        evaluator.states = states
        system, loops = evaluator.system, evaluator.loops
        y = evaluator.integrated(evaluator.model.u0)
        place(0.0, y, system, loops)
        D, gamma, nu = system.D, system.gamma, system.nu
        call_kinds(ACCELERATION, ACCELERATION, 0.0, system, loops, D, gamma, nu)
        is_sure = independent_rows.turns_little(system)
        scale_blocks(system.blocks, D, system.metric)
        factorise(system, independent_rows.PART_OF_INDEPENDENT)
        found.append((is_sure, independent_rows.are_independent(system)))
    assert (True, False) not in found
    assert {is_sure for is_sure, _ in found} == ({True, False} if mode == 2.0 else {True})
