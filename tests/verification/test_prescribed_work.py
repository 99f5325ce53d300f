"""The work done where the motion is prescribed, which a few long steps follow exactly."""

import numpy as np
import pytest

import dap3d_core as dap


@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "adams"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-11])
def test_work_of_a_hoist_is_its_kinetic_energy(integrator, rtol):
    """A load is lifted by a smooth function, from rest to rest.
    Steps may be off by 100 rtol of the largest work each; over some ten of them, and between
    their ends, three times that is allowed. It was off by 1 percent, or by all, at any rtol."""
    scene = dap.Scene(name="hoist")
    scene.add_body("load", mass=100.0, Jp=[1.0, 1.0, 1.0])
    scene.add_function("b", "rise", x_start=0.0, x_end=3.0, f_start=0.0, f_end=2.0)
    scene.add_joint("tran", "guide", P_i="load.O", P_j="ground.O", a_j="ground.z")
    scene.add_joint("drive-tran", "winch", joint="guide", function="rise")
    scene.add_force("weight")
    result = dap.simulate(scene, t_end=3.5, dt=0.1, integrator=integrator, rtol=rtol)
    kinetic = 0.5 * 100.0 * result.quantity("load.rd.z").values ** 2
    off = np.max(np.abs(result.quantity("work").values - kinetic)) / np.max(kinetic)
    assert off < 300.0 * rtol
    assert result.record.stats.steps < 500
