"""Kinematics against closed forms of mechanisms, differentiated in 40 digits (support)."""

import mpmath as mp
import numpy as np
import pytest
from support import one_freedom

import dap3d_core as dap

#: Coefficients of the driver.
FAST, SLOW = (0.0, 3.0, 1.5), (0.0, 0.4, 0.3)
SLIDER, FOURBAR, WISHBONE = "slider-crank", "four-bar", "double wishbone"


def case(name):
    """A mechanism, its scene, the angle at the start, and its motion q = q_0 + c2 t + c3 t^2."""
    if name == SLIDER:
        return one_freedom.slider_crank(), one_freedom.slider_crank_scene(0.3, FAST), 0.3, FAST
    if name == FOURBAR:
        return one_freedom.four_bar(), one_freedom.four_bar_scene(0.7, FAST), 0.7, FAST
    return one_freedom.double_wishbone(), one_freedom.double_wishbone_scene(SLOW), 0.0, SLOW


@pytest.mark.slow
@pytest.mark.parametrize("name", [SLIDER, FOURBAR, WISHBONE])
def test_motion_and_driving_moment_are_those_of_the_closed_form(name):
    """Positions, velocities, accelerations and the driver's multiplier, to 1e-12.
    Rounding alone is left: eps times the condition of the rows, of order ten here, and for
    accelerations and moments times the squared rate, below 50."""
    mechanism, scene, q_0, (_, c2, c3) = case(name)
    t_end = 0.5 if name == WISHBONE else 2.0
    result = dap.kinematics(scene, t_end=t_end, dt=t_end)  # each closed form takes a second
    assert max(result.arrays.position_residual) < 1e-14
    moments, expected = [], []
    for k, t in enumerate(result.t):
        t = mp.mpf(float(t))
        q, rate, rise = q_0 + c2 * t + c3 * t * t, c2 + 2 * c3 * t, 2 * mp.mpf(c3)
        for body in range(3):
            r, R, v, w, a, alpha = mechanism.motion(body, q, rate, rise)
            p = one_freedom.quaternion(R)
            found = result.p[k, body]
            cosine = abs(p @ found)
            assert np.max(np.abs(result.r[k, body] - r)) < 1e-12
            assert np.linalg.norm(p - np.sign(p @ found) * found) < 1e-12, cosine
            for values, exact in ((result.rd, v), (result.w, w), (result.rdd, a),
                                  (result.wd, alpha)):  # fmt: skip
                error = np.max(np.abs(values[k, body] - exact))
                assert error < 1e-12 * max(1.0, np.max(np.abs(exact)))
        moments.append(result.Lam[k, -1])
        expected.append(mechanism.moment(q, rate, rise))
    scale = np.max(np.abs(expected))
    assert np.max(np.abs(np.array(moments) - expected)) < 1e-12 * max(1.0, scale)
