"""Roll, pitch and yaw of Euler parameters: what a scene makes of them gives them back."""

import numpy as np
import pytest
from support.internals import euler_rates, roll_pitch_yaw, roll_pitch_yaw_rates, split

import dap3d_core as dap
from dap3d_core.model import build_model
from dap3d_core.scene import check


def turned_by(angles):
    """Euler parameters of bodies of a scene."""
    scene = dap.Scene(name="turned")
    for k, three in enumerate(angles):
        scene.add_body(f"b{k}", mass=1.0, Jp=(1.0, 1.0, 1.0), rpy=tuple(map(float, three)))
    return split(build_model(check(scene, dap.load_registry())).u0)[1]


def test_they_are_those_that_a_scene_is_given():
    """Within some roundings of half angles, divided by c - s, which is at least 0.05."""
    rng = np.random.default_rng(4)
    angles = rng.uniform(-1.0, 1.0, size=(50, 3)) * [np.pi, 1.5, np.pi]
    p = turned_by(angles)
    np.testing.assert_allclose(roll_pitch_yaw(p), angles, atol=1e-13)
    np.testing.assert_allclose(roll_pitch_yaw(-3.0 * p), angles, atol=1e-13)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_upright_only_a_sum_or_a_difference_is_defined(sign):
    """At a pitch of a quarter turn: yaw - roll upwards, yaw + roll downwards. Some roundings."""
    (p,) = turned_by([(0.3, sign * np.pi / 2, 0.7)])
    roll, pitch, yaw = map(float, roll_pitch_yaw(p))
    assert pitch == pytest.approx(sign * np.pi / 2, abs=1e-14)
    assert yaw - sign * roll == pytest.approx(0.7 - sign * 0.3, abs=1e-14)
    (again,) = turned_by([(roll, pitch, yaw)])
    assert abs(again @ p) == pytest.approx(1.0, abs=1e-14)


def test_their_rates_are_their_derivatives():
    """Central differences over 1e-6 rad; third derivatives of some 1e3 near a pitch of 1.2."""
    rng = np.random.default_rng(5)
    angles = rng.uniform(-1.0, 1.0, size=(50, 3)) * [np.pi, 1.2, np.pi]
    p = turned_by(angles)
    w = rng.uniform(-1.0, 1.0, size=(50, 3))
    ahead, behind = (roll_pitch_yaw(p + h * euler_rates(p, w)) for h in (1e-6, -1e-6))
    np.testing.assert_allclose(roll_pitch_yaw_rates(angles, w), (ahead - behind) / 2e-6, atol=1e-8)
