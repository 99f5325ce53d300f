"""Regularised friction does not stick: what creeps has a note with the speed and the way."""

import re

import numpy as np
import pytest

import dap3d_core as dap

G = 9.81


def slope(degrees, kind, *, v=0.0, mu=0.5, **fields):
    """A block of 1 kg on a slope, at rest or sliding down at v m/s."""
    angle = np.radians(degrees)
    down = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    scene = dap.Scene(name="slope")
    scene.add_vector("down", "ground", tuple(down))
    scene.add_body("block", mass=1.0, Jp=(1.0, 1.0, 1.0), r_dot=tuple(v * down))
    scene.add_joint("tran", "slide", P_i="block.O", P_j="ground.O", a_j="down")
    scene.add_force("weight", "weight", gravity=G)
    if kind == "friction":
        scene.add_force("friction", "rubs", joint="slide", mu=mu, **fields)
    else:
        f_c = mu * G * np.cos(angle)
        scene.add_force("tran_friction", "rubs", P_i="block.O", a_j="down", f_c=f_c, **fields)
    return scene


def creep_of(result):
    """(speed, way) in the note, None without one."""
    notes = [note for note in result.notes if "does not stick" in note]
    assert len(notes) <= 1
    if not notes:
        return None
    found = re.search(r"creeps, at up to (\S+) \S+, by (\S+) ", notes[0])
    return float(found[1]), float(found[2])


@pytest.mark.parametrize("v_tol", [1e-3, 1e-5])
@pytest.mark.parametrize("degrees", [5.0, 15.0, 25.0])
@pytest.mark.parametrize("kind", ["friction", "tran_friction"])
def test_a_block_that_should_stick_has_a_note(kind, degrees, v_tol):
    """tanh(v / v_tol) = tan(angle) / mu; over 19 of 20 s at least, in three digits."""
    result = dap.simulate(slope(degrees, kind, v_tol=v_tol), t_end=20.0, dt=0.5, integrator="auto")
    expected = v_tol * np.arctanh(np.tan(np.radians(degrees)) / 0.5)
    speed, way = creep_of(result)
    assert speed == pytest.approx(expected, rel=6e-3)
    assert 19.0 * expected < way < 20.05 * expected


@pytest.mark.parametrize("v_tol", [1e-2])
def test_a_hinge_that_should_stick_has_a_note(v_tol):
    """tanh(w / w_tol) = 1 / 2 of the friction moment."""
    scene = dap.Scene(name="hinge")
    scene.add_body("disc", mass=1.0, Jp=(1.0, 1.0, 1.0))
    ends = dict(P_i="disc.O", P_j="ground.O", a_i="disc.z", a_j="ground.z")
    scene.add_joint("rev", "hinge", **ends)
    scene.add_force("n", "load", body_i="disc", n=(0.0, 0.0, 1.0))
    scene.add_force(
        "rot_friction", "rubs", body_i="disc", body_j="ground", axis="ground.z", n_c=2.0,
        w_tol=v_tol,
    )  # fmt: skip
    result = dap.simulate(scene, t_end=10.0, dt=0.1, integrator="auto")
    assert creep_of(result)[0] == pytest.approx(v_tol * np.arctanh(0.5), rel=6e-3)
    assert "rad/s" in next(note for note in result.notes if "does not stick" in note)


@pytest.mark.parametrize(
    ("degrees", "v"),
    [(30.0, 0.0), (40.0, 1.0), (0.0, 0.0), (0.0, 1.0)],
    ids=["slips", "slides", "rests without load", "comes to rest without load"],
)
@pytest.mark.parametrize("kind", ["friction", "tran_friction"])
def test_what_slides_or_carries_nothing_has_none(kind, degrees, v):
    result = dap.simulate(slope(degrees, kind, v=v), t_end=5.0, dt=0.05, integrator="auto")
    assert creep_of(result) is None


def test_a_swing_that_turns_back_has_none():
    """An oscillator passes v_tol quickly, twice in a period: it does not rest there."""
    scene = slope(0.0, "tran_friction", mu=0.01, v=1.0)
    scene.add_force("tran_sda", "spring", P_i="block.O", P_j="ground.O", a_j="ground.x", k=40.0)
    result = dap.simulate(scene, t_end=5.0, dt=0.02)
    assert creep_of(result) is None
