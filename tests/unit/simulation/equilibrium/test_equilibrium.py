"""``dap.equilibrium``: what it returns, what it says, and what it refuses."""

import math

import numpy as np
import pytest
from support import at_rest
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.result import UnknownNameError

pytestmark = long_in_plain_python


def test_free_fall_names_the_bodies_that_fall():
    scene = at_rest.ball()
    scene.add_body("moon", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(1.0, 0.0, 0.0))
    scene.add_force("ptp", P_i="ball.O", P_j="moon.O", k=10.0, l0=1.0)
    with pytest.raises(dap.SimulationError, match=r"bodies ball, moon, .* moves along -z") as error:
        dap.equilibrium(scene)
    assert "no equilibrium" in str(error.value)


@pytest.mark.parametrize("moment", [-10.0, pytest.param(-30.0, marks=pytest.mark.slow)])
def test_a_motor_holds_a_pendulum_or_turns_it_without_end(moment):
    """m g l = 19.62 N m."""
    scene = at_rest.pendulum(0.0)
    scene.add_force("n", body_i="rod", n=(0.0, moment, 0.0))
    if moment == -30.0:
        with pytest.raises(dap.SimulationError, match="body rod, which turns about -y"):
            dap.equilibrium(scene)
    else:
        angle = math.asin(10.0 / (2.0 * at_rest.G))
        found = dap.equilibrium(scene)
        assert found.r[0] == pytest.approx([math.sin(angle), 0, -math.cos(angle)], abs=1e-15)


def referring():
    """An arm, a slider in it and a ball whose elements count from the poses of the scene."""
    scene = at_rest.pendulum(1.2, "referring")
    scene.joints["J1"].fields |= {"lower": -0.5, "upper": 0.5}
    scene.add_force("rot_sda", "coil", joint="J1", k=60.0, c=0.4)
    scene.add_body("block", mass=0.5, Jp=(0.01, 0.01, 0.01), r=scene.bodies["rod"].r,
                   p=scene.bodies["rod"].p)  # fmt: skip
    scene.add_joint("tran", "J2", P_i="block.O", P_j="rod.O", a_j="rod.z")
    scene.add_input("u", 0.5)
    scene.add_force("actuator", "servo", joint="J2", control="u", k=40.0, c=0.2)
    scene.add_body("ball", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(3.0, 0.0, 0.0))
    scene.add_point("P", "ball", (0.1, 0.0, 0.0))
    scene.add_point("Q", "ground", (3.1, 0.0, 0.0))
    scene.add_force("bushing", "mount", P_i="P", P_j="Q", k=(1e3, 1e3, 1e3, 10.0, 10.0, 10.0))
    return scene


@pytest.mark.slow
def test_references_stay_those_of_the_scene(tmp_path):
    """Coordinates of joints at rest, modes and motion are those of the scene, from its state."""
    scene = referring()
    found = dap.equilibrium(scene)
    rest = found.scene().save(tmp_path / "rest.toml")
    again = dap.equilibrium(rest)
    assert again.steps <= 1  # of last digits
    assert again.r == pytest.approx(found.r, abs=1e-12)
    modes, wanted = (dap.linearize(s, at=found).eigenvalues for s in (rest, scene))
    assert np.sort_complex(modes) == pytest.approx(np.sort_complex(wanted), abs=1e-9)
    runs = (
        dap.simulate(rest, t_end=0.1, dt=0.1),
        dap.simulate(scene, start=found, t_end=0.1, dt=0.1),
    )
    for name in ("J1.angle", "J2.length", "energy.total"):
        first, second = (run.quantity(name).values for run in runs)
        assert first == pytest.approx(second, abs=1e-9)
        assert np.ptp(first) < 1e-9
    assert runs[0].quantity("J1.angle").values[0] > 0.1

    whole = dap.Scene(name="whole")  # and turned about the vertical, as a part of another
    dap.include(whole, "part", dap.load(rest), at={"r": (1.0, 2.0, 0.0), "rpy": (0.0, 0.0, 0.7)})
    whole.add_force("weight")
    assert dap.equilibrium(whole).steps <= 1


def test_a_reaction_is_that_of_one_instant():
    found = dap.equilibrium(at_rest.pendulum(0.5))
    on_rod = found.reaction("J1")["i"]
    assert on_rod.force.shape == on_rod.moment.shape == (3,)
    assert on_rod.moment_at_point == pytest.approx([0, 0, 0], abs=1e-13)
    assert found.reaction("J1")["j"].force == pytest.approx(-on_rod.force, abs=1e-13)
    with pytest.raises(UnknownNameError, match="J1"):
        found.reaction("J2")


def test_it_searches_from_a_result_and_from_an_equilibrium():
    """The other side of the toggle, reached by hand."""
    other = dap.equilibrium(at_rest.toggle(-1.2))
    found = dap.equilibrium(at_rest.toggle(1.2), start=other)
    assert found.steps == 0
    assert found.r[0, 2] < 0.0
    result = dap.simulate(at_rest.toggle(-0.9), t_end=0.01, dt=0.01)
    assert dap.equilibrium(at_rest.toggle(1.2), start=result).r == pytest.approx(other.r, abs=1e-14)


def test_what_statics_leaves_out_is_noted():
    scene = at_rest.pendulum(0.3)
    scene.bodies["rod"].w = (0.0, 1.0, 0.0)
    scene.add_function("a", "turning", coeff=(0.0, 0.1, 0.0))
    scene.add_force("position-servo", "drive", body_i="rod", a_j="ground.y", gain=1.0,
                    torque_max=5.0, function="turning")  # fmt: skip
    scene.add_input("u")
    scene.add_force("f", "push", body_i="rod", f=(1.0, 0.0, 0.0), input="u")  # held, not of time
    notes = " ".join(dap.equilibrium(scene).notes)
    assert "velocities of the start are left out" in notes
    assert "push" not in notes
    assert "depend on time are those at t = 0: drive" in notes


def test_drivers_and_rolling_joints_are_held_where_they_are():
    """The rates of both are rows of velocities alone; the crank of fourbar2 stays."""
    found = dap.equilibrium("fourbar2")
    start = dap.compile("fourbar2")
    start = start.start(True, ()).u
    assert np.max(np.abs(found.u[:14] - start[:14])) < 1e-12
    assert any("drivers are at rest" in note for note in found.notes)


def test_friction_is_noted():
    scene = at_rest.pendulum(0.3)
    scene.add_force("friction", joint="J1", mu=0.2, v_tol=1e-3, radius=0.05)
    found = dap.equilibrium(scene)
    assert any("friction is left out" in note for note in found.notes)
    assert found.r[0] == pytest.approx([0, 0, -1], abs=1e-15)
