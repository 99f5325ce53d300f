"""Closed loops in three formats: one mechanism, and its motion."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.process import REPOSITORY

import dap3d_core as dap

DATA = REPOSITORY / "tests" / "data" / "formats"
SUFFIXES = ("urdf", "sdf", "xml")
G = 9.81


def reference(t, theta, rate):
    """The angle of a parallelogram: its coupler never turns, so one pendulum holds all masses."""
    inertia = 0.09 + 1.0 * 0.25 + 3.0 + 0.2 + 2.0 * 0.16
    moment = (1.0 * 0.5 + 3.0 + 2.0 * 0.4) * G
    rates = lambda t, y: (y[1], -moment / inertia * np.sin(y[0]))  # noqa: E731
    return solve_ivp(rates, (0, t[-1]), (theta, rate), "DOP853", t, rtol=1e-12, atol=1e-12).y[0]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_closed_loop_moves_as_its_minimal_coordinate(suffix):
    """Over 1 s from 0.8 rad; both integrations hold 1e-10, summed errors stay below 1e-7."""
    start = {"left": 0.8, "right": 0.8, "pin": -0.8}
    scene, report = dap.import_model(DATA / f"parallelogram.{suffix}", positions=start)
    assert len(scene.joints) == 4 and not report.left_out
    result = dap.simulate(scene, t_end=1.0, dt=0.1, rtol=1e-10, atol=1e-12)
    theta = np.arctan2(-result.r[:, 0, 0], 2.0 - result.r[:, 0, 2])
    np.testing.assert_allclose(theta, reference(result.t, 0.8, 0.0), rtol=0, atol=1e-7)


def test_the_formats_say_the_same_mechanism():
    """Bodies are equal to the last bit but for rounding of frames."""
    scenes = [dap.import_model(DATA / f"parallelogram.{suffix}")[0] for suffix in SUFFIXES]
    for scene in scenes[1:]:
        assert scene.joints.keys() == scenes[0].joints.keys()
        for one, other in zip(sorted(scene.bodies), sorted(scenes[0].bodies), strict=True):
            a, b = scene.bodies[one], scenes[0].bodies[other]
            assert (a.mass, a.Jp) == (b.mass, b.Jp)
            np.testing.assert_allclose([*a.r, *a.p], [*b.r, *b.p], atol=1e-15)
