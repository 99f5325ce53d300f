"""Results cut at jumps of velocities: of a ball that bounces with e = 0.8."""

import numpy as np
import pytest
from support.internals import smooth_parts
from support.jumping import JUMPING

import dap3d_core as dap
from dap3d_core.plot import plot

G, V0 = 9.81, np.sqrt(2.0 * 9.81)


@pytest.fixture(scope="module")
def result():
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 1.0))
    scene.add_force("weight", "gravity", gravity=G)
    scene.add_force("test-bounce", "floor", P_i="ball.O", e=0.8)
    return dap.simulate(dap.compile(scene, registry=JUMPING), t_end=2.0, dt=0.1)


def test_parts_end_before_jumps_and_begin_after_them(result):
    """All reports are in them once; speeds at the ends are those of the impacts."""
    parts = smooth_parts(result)
    times = np.array([event.t for event in result.events if event.u_after is not None])
    assert len(parts) == len(times) + 1 == 4
    inner = np.concatenate([part.t for part in parts])
    np.testing.assert_array_equal(np.sort(np.concatenate([result.t, times, times])), inner)
    assert [part.rd[-1, 0, 2] for part in parts[:2]] == pytest.approx([-V0, -0.8 * V0], abs=1e-9)
    assert parts[1].rd[0, 0, 2] == pytest.approx(0.8 * V0, abs=1e-9)
    assert (np.diff(parts[1].t) > 0.0).all()


def test_a_result_without_jumps_stays_whole():
    whole = dap.simulate("pen1", t_end=0.1)
    assert smooth_parts(whole) == [whole]


def test_curves_are_interrupted_where_velocities_jump(result):
    """On each piece of the drawn line the slope is -g; there are gaps, and no steep line."""
    ax = plot(result, "ball.rd.z")
    t, v = ax.lines[0].get_data()
    gaps = np.isnan(v)
    assert gaps.sum() == 3
    slopes = np.diff(v) / np.diff(t)
    np.testing.assert_allclose(slopes[np.isfinite(slopes)], -G, atol=1e-6)
    assert np.nanmin(v) == pytest.approx(-V0, abs=1e-9)  # the lines reach the impacts


def test_heights_are_drawn_down_to_the_floor(result):
    """Between the reports, too: z = r0 + v t - g t^2 / 2 on each piece."""
    t, z = plot(result, "ball.r.z").lines[0].get_data()
    assert np.nanmin(z) == pytest.approx(0.0, abs=1e-12)
    before = t < V0 / G
    np.testing.assert_allclose(z[before], 1.0 - 0.5 * G * t[before] ** 2, atol=1e-9)


def test_a_start_between_instants_with_a_jump_between_them_is_refused(result):
    """At an instant itself a run may start."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=1.0, Jp=(0.1, 0.1, 0.1))
    with pytest.raises(dap.SceneError, match=r"velocities jumped at t = 0.4515"):
        dap.simulate(scene, t_end=0.1, start=(result, 0.47))
    again = dap.simulate(scene, t_end=0.1, start=(result, 0.5))
    np.testing.assert_array_equal(again.rd[0], result.rd[5])
