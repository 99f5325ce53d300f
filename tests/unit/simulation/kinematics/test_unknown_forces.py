"""Inverse dynamics with contacts, against runs and against the balance of forces.

What a run has found is found again from its motion to rounding of its accelerations. Positions that
are polynomials of degree 5 at most are followed by splines to rounding; second derivatives of that
are good to 1e-8 or so.
"""

import numpy as np
import pytest
from support.plain import long_in_plain_python

import dap3d_core as dap

g = 9.81
TIGHT = {"rtol": 1e-12, "atol": 1e-13}


def ball():
    """It slides, then rolls."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=2.0, Jp=(0.008,) * 3, r=(0, 0, 0.1), r_dot=(3, 0.5, 0), w=(0, 0, 4))
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1, mu=0.3, e=0.2)
    return scene


def box(**motion):
    scene = dap.Scene(name="box")
    scene.add_body("box", mass=2.0, Jp=(0.02, 0.03, 0.04), r=(0, 0, 0.1), **motion)
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_contact("box_plane", "floor", P_i="box.O", size=(0.4, 0.3, 0.2), mu=0.3)
    return scene


@long_in_plain_python
@pytest.mark.parametrize(
    "scene", [ball(), box(r_dot=(1.5, 0.3, 0), w=(0, 0, 2.0))], ids=["rolls", "slides"]
)
def test_the_forces_of_a_run_are_found_from_its_motion(scene):
    run = dap.simulate(scene, t_end=0.5, dt=0.05, **TIGHT)
    found = dap.inverse(scene, run, actuators=[])
    one, other = run.contact("floor"), found.contact("floor")
    assert np.array_equal(one.mode, other.mode)
    assert np.abs(one.normal_force - other.normal_force).max() < 1e-9
    assert np.abs(one.friction - other.friction).max() < 1e-9
    assert len(found.contacts) == len(run.contacts)


def pendulum(motor=0.0, **friction):
    """A rod on a hinge that rubs by its load, from the horizontal; motor: N m that push it up."""
    scene = dap.Scene(name="pendulum")
    scene.add_body("rod", mass=1.0, Jp=(0.01, 0.01, 0.01), r=(0.5, 0.0, 0.0))
    scene.add_point("top", "rod", (-0.5, 0.0, 0.0))
    axis = {"P_i": "top", "P_j": "ground.O", "a_i": "rod.y", "a_j": "ground.y"}
    scene.add_joint("rev", "pin", **axis)
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_force("friction", "rub", joint="pin", mu=0.5, radius=0.15, **friction)
    scene.add_force("n", "push", body_i="rod", n=(0.0, -motor, 0.0))
    return scene


@long_in_plain_python
@pytest.mark.parametrize(
    ("scene", "first"),
    [(pendulum(), 1), (pendulum(4.8), 0)],
    ids=["slides and sticks", "sticks"],
)
def test_friction_of_a_loaded_hinge_is_found_from_its_motion(scene, first):
    """Its load depends on it. Where it starts from rest it counts as holding, whatever follows."""
    run = dap.simulate(scene, t_end=4.0, dt=0.25, **TIGHT)
    found = dap.inverse(scene, run, actuators=[])
    held, same = (result.reaction("pin")["i"].force for result in (run, found))
    assert held == pytest.approx(same, abs=1e-9)
    assert not any("cannot" in note for note in found.notes)
    for name in run.contact_names:
        one, other = run.contact(name), found.contact(name)
        assert np.array_equal(one.mode[first:], other.mode[first:])
        assert one.normal_force == pytest.approx(other.normal_force, abs=1e-9)
        assert one.friction == pytest.approx(other.friction, abs=1e-9)


def test_a_hinge_that_would_have_to_hold_more_than_its_friction_is_named():
    """Of m g L = 4.905 N m a load of 9.81 N holds 0.5 * 0.15 * 9.81 = 0.736."""
    t = np.linspace(0.0, 1.0, 11)
    still = {"r.x": 0.5, "r.y": 0.0, "r.z": 0.0, "p.e1": 0.0, "p.e2": 0.0, "p.e3": 0.0}
    motion = {"t": t} | {f"rod.{name}": value + 0.0 * t for name, value in still.items()}
    found = dap.inverse(pendulum(), motion, actuators=[])
    (note,) = [note for note in found.notes if "cannot do its part" in note]
    assert note.startswith("contact rub")
    assert "by 4.17 N" in note


def test_a_limit_that_a_hinge_rests_at():
    """Moment of the weight about the hinge: 2 g 0.5 cos(a)."""
    scene = dap.Scene(name="limit")
    scene.add_body("rod", mass=2.0, Jp=(0.01, 0.1, 0.1), r=(0.5, 0.0, 0.0))
    scene.add_point("end", "rod", (-0.5, 0.0, 0.0))
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_joint("rev", "hinge", P_i="end", P_j="ground.O", a_i="rod.y", a_j="ground.y",
                    upper=0.0)  # fmt: skip
    run = dap.simulate(scene, t_end=0.2, dt=0.1)
    found = dap.inverse(scene, run, actuators=[])
    assert found.contact("hinge_upper").normal_force == pytest.approx(g, abs=1e-9)
    held = found.reaction("hinge")["i"].force
    assert np.abs(held - [0.0, 0.0, 2.0 * g]).max() < 1e-9


@pytest.mark.slow
def test_an_actuator_pulls_a_block_over_the_floor():
    """F = m x'' + mu m g, with x = t + 0.3 t^3."""
    scene = dap.Scene(name="pulled")
    scene.add_body("block", mass=2.0, Jp=(0.1, 0.1, 0.1))
    scene.add_point("peg", "ground", (10.0, 0.0, 0.0))
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_force("ptp", "rope", P_i="block.O", P_j="peg")
    scene.add_contact("ball_plane", "floor", P_i="block.O", mu=0.4)
    t = np.linspace(0.0, 1.0, 101)
    motion = {"t": t, "block.r.x": t + 0.3 * t**3} | {
        f"block.{n}": 0.0 * t for n in ("r.y", "r.z", "p.e1", "p.e2", "p.e3")
    }
    found = dap.inverse(scene, motion, actuators=["rope"])
    pulls = 2.0 * 1.8 * t + 0.4 * 2.0 * g
    assert found.record.actuation["rope"] == pytest.approx(pulls, abs=1e-6)
    assert found.contact("floor").normal_force == pytest.approx(2.0 * g, abs=1e-6)
    assert found.contact("floor").mode.tolist() == [1] * 101


def test_a_lifted_contact_has_no_force():
    run = dap.simulate(box(r_dot=(0, 0, 1.0)), t_end=0.1, dt=0.05, **TIGHT)
    found = dap.inverse(box(), run, actuators=[])
    assert not found.contact("floor").normal_force[1:].any()
    assert not any("cannot produce" in note for note in found.notes)


def table(offset):
    """A table of 2 m by 2 m whose mass centre lies ``offset`` from its middle, at rest."""
    scene = dap.Scene(name="table")
    scene.add_body("table", mass=10.0, Jp=(1.0, 1.0, 1.0), r=(*offset, 0.5))
    scene.add_point("middle", "table", (-offset[0], -offset[1], 0.0))
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_contact("box_plane", "feet", P_i="middle", size=(2.0, 2.0, 1.0), mu=0.5)
    t = np.linspace(0.0, 1.0, 11)
    still = {"r.x": offset[0], "r.y": offset[1], "r.z": 0.5, "p.e1": 0.0, "p.e2": 0.0, "p.e3": 0.0}
    return scene, {"t": t} | {f"table.{name}": value + 0.0 * t for name, value in still.items()}


@pytest.mark.parametrize(
    ("offset", "parts"),
    [((0.2, 0.3), [0.125, 0.225, 0.275, 0.375]), ((0.7, 0.7), [0.0, 0.15, 0.15, 0.7])],
)
def test_feet_that_share_a_load_have_the_least_forces_that_push(offset, parts):
    """Linear over the feet where all of them push; else three feet carry, which determines it."""
    scene, motion = table(offset)
    found = dap.inverse(scene, motion, actuators=[])
    feet = found.contact("feet")
    carried = np.sort(feet.normal_force[5][feet.mode[5] > 0])
    assert carried == pytest.approx(10.0 * g * np.array(parts), abs=1e-5)
    assert np.abs(feet.friction).max() < 1e-5
    assert any("not unique; reported are those of least norm" in note for note in found.notes)


def test_a_contact_that_would_have_to_pull_is_named():
    scene = dap.Scene(name="under the ceiling")
    scene.add_body("ball", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, -0.1))
    scene.add_vector("down", "ground", (0.0, 0.0, -1.0))
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_contact("ball_plane", "ceiling", P_i="ball.O", radius=0.1, a_j="down", mu=0.0)
    t = np.linspace(0.0, 1.0, 11)
    still = {"r.x": 0.0, "r.y": 0.0, "r.z": -0.1, "p.e1": 0.0, "p.e2": 0.0, "p.e3": 0.0}
    motion = {"t": t} | {f"ball.{name}": value + 0.0 * t for name, value in still.items()}
    found = dap.inverse(scene, motion, actuators=[])
    (note,) = [note for note in found.notes if "cannot do its part" in note]
    assert note.startswith("contact ceiling")
    assert "by 19.6 N" in note


@pytest.mark.slow
def test_feet_that_cannot_hold_are_refused():
    scene, motion = table((1.5, 0.0))
    with pytest.raises(dap.SimulationError, match="none within their cones was found"):
        dap.inverse(scene, motion, actuators=[])
