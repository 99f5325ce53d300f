"""Kernels of every contact: what ends a mode."""

import dap3d_core as dap


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
