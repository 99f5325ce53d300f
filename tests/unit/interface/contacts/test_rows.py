"""Kernels of every contact: what ends a mode."""

import pytest
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.interface.contacts.rows import STRAYED, before_straying


def lift(mass):
    """A run of a ball that leaves a table, moved down by a driver ever faster."""
    scene = dap.Scene(name="lift")
    scene.add_force("weight")
    scene.add_body("table", mass=1.0, Jp=[1.0] * 3)
    scene.add_body("ball", mass=mass, Jp=[0.004 * mass] * 3, r=[0.0, 0.0, 0.1])
    at = {"P_i": "table.O", "P_j": "ground.O", "a_j": "ground.z"}
    scene.add_joint("tran", **at)
    scene.add_function("harmonic", "moved", amplitude=0.1, frequency=11.0)
    scene.add_joint("drive-tran", function="moved", **at)
    scene.add_contact("ball_plane", P_i="ball.O", P_j="table.O", a_j="table.z", radius=0.1)
    return dap.simulate(scene, t_end=0.15, dt=0.15, rtol=1e-9)


def test_a_heavy_ball_lifts_off_in_no_more_steps_than_a_light_one():
    # bounded by another quantity, such as a length, its normal force would show no slope
    light, heavy = lift(1.0), lift(1e6)
    assert heavy.events[-1].kind == "lift"
    assert abs(heavy.events[-1].t - light.events[-1].t) < 1e-12
    assert heavy.stats.steps <= light.stats.steps + 1


@pytest.mark.parametrize("rest", [5.0, 0.5, -2.0])
def test_at_rest_the_rest_of_a_cone_is_itself_and_slip_of_rows_that_do_not_hold_ends_it(rest):
    still, fast, way = (0.0, 0.0, 0.0), (0.0, 1.1 * STRAYED, 0.0), (0.0, 1.0, 0.0)
    assert before_straying(rest, still, way) == rest
    assert before_straying(rest, fast, way) < 0.0
    assert before_straying(rest, fast, still) == rest


@long_in_plain_python
@pytest.mark.parametrize(("mass", "beside"), [(1e-9, 1e-9), (1e-6, 10.0)])
def test_a_light_box_slips_when_a_heavy_one_does(mass, beside):
    # pulled by 2 N/s for each kg, it slips at 0.4 of its weight
    scene = dap.Scene(name="slip")
    scene.add_force("weight")
    scene.add_body("box", mass=mass, Jp=[0.01 * mass] * 3, r=[0.0, 0.0, 0.05])
    scene.add_body("sled", mass=beside, Jp=[1.0 * beside] * 3, r=[1.0, 0.0, 0.05],
                   r_dot=[0.1, 0.0, 0.0])  # fmt: skip
    scene.add_point("far", "ground", [1.0, 0.0, 0.05])
    at = {"P_i": "sled.O", "P_j": "far", "a_j": "ground.x"}
    scene.add_joint("tran", **at)
    scene.add_function("a", "moved", coeff=[0.0, 0.1, 0.0])
    scene.add_joint("drive-tran", function="moved", **at)
    scene.add_force("ptp", P_i="sled.O", P_j="box.O", k=20.0 * mass, l0=1.0)
    size = [0.4, 0.3, 0.1]
    scene.add_contact("box_plane", "floor", P_i="box.O", size=size, mu=0.3, mu_s=0.4)
    result = dap.simulate(scene, t_end=2.0, dt=2.0, rtol=1e-11)
    assert next(e.t for e in result.events if e.kind == "slip") == pytest.approx(1.962, abs=1e-9)
