"""Angles that count whole turns: between reports, in files, sweeps and checkpoints; long steps.
The wheel is wound up by 100 rad/s: x = 100 sin t, 16 turns and back, 1.6 turns between two
reports."""

import attrs
import numpy as np
import pytest

import dap3d_core as dap

SPEED, STIFFNESS = 100.0, 1.0


def winding(speed=SPEED, **simulation):
    """A wheel of 1 kg m^2 on a spring of 1 N m/rad that counts turns."""
    scene = dap.Scene(name="winding")
    scene.add_body("wheel", mass=1.0, Jp=(1.0, 1.0, 1.0), w=(0.0, 0.0, speed))
    scene.add_joint("rev", "pin", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z")
    scene.add_force("rot_sda", "spring", v_i="wheel.x", v_j="ground.x", axis="ground.z",
                    k=STIFFNESS, turns=True)  # fmt: skip
    scene.simulation = attrs.evolve(scene.simulation, t_end=3.0, dt=0.1, **simulation)
    return scene


def check(result, tolerance=1e-4):
    """Energy and moment of the spring are those of the wheel wound up by 100 sin t."""
    wound = SPEED * np.sin(result.t)
    spring = result.force("spring")
    np.testing.assert_allclose(spring.energy, 0.5 * STIFFNESS * wound**2, atol=100.0 * tolerance)
    np.testing.assert_allclose(spring.energy, result.energy.potential, atol=1e-9)
    np.testing.assert_allclose(spring.on["i"].moment[:, 2], -STIFFNESS * wound, atol=tolerance)


@pytest.mark.slow
def test_a_spring_between_two_reports_winds_up(tmp_path):
    """Also from a file, and from the arrays that a data set has."""
    result = dap.simulate(winding())
    check(result)
    result.save(tmp_path / "run.nc")
    check(dap.open(tmp_path / "run.nc"))
    angles = result.to_xarray()["angles"]
    assert angles.dims == ("time", "angle")
    assert angles.attrs["units"] == "rad"
    np.testing.assert_allclose(angles[:, 0], -SPEED * np.sin(result.t), atol=1e-4)


def test_the_points_of_a_sweep_keep_their_turns():
    def moment(result):
        return float(result.force("spring").on["i"].moment[-1, 2])

    stiffness = np.array([0.5, 1.0, 1.5, 2.0])
    found = dap.sweep(winding(), {"forces.spring.k": stiffness}, outputs={"last": moment})
    w = np.sqrt(stiffness)
    np.testing.assert_allclose(found["last"], -SPEED * w * np.sin(3.0 * w), atol=1e-3)


@pytest.mark.parametrize("rtol", [1e-3, 1e-4])
def test_long_steps_do_not_lose_turns(rtol):
    """At loose tolerances a step turns the wheel by more than half a turn.
    A turn that is lost changes the speed by 2 pi k / J for the time of a step, some 1 rad/s
    each."""
    result = dap.simulate(winding(), integrator="dop853", rtol=rtol, atol=rtol / 100.0)
    assert 3.0 * 2.0 / np.pi * SPEED / result.stats.steps > np.pi / 2.0
    np.testing.assert_allclose(result.w[:, 0, 2], SPEED * np.cos(result.t), atol=SPEED * 100 * rtol)


def test_given_steps_in_which_turns_would_be_lost_are_shortened():
    """Steps of 100 rad: then of up to half a turn, in which dop853 errs by some 1e-6."""
    result = dap.simulate(winding(1000.0), integrator="dop853", step=0.1)
    assert result.stats.steps > 3000.0 * 2.0 / np.pi / np.pi
    np.testing.assert_allclose(result.w[:, 0, 2], 1000.0 * np.cos(result.t), atol=0.1)
    long = dap.simulate(winding(1.0), integrator="dop853", step=0.1)
    assert (long.stats.steps, long.stats.rejected) == (30, 0)
