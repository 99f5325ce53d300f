"""Friction in joints that fades below v_tol: closed forms, energy, and its limits.

Tolerances: the multipliers settle to 1e-10 of their size; rtol 1e-9 over a second leaves less than
1e-8.
"""

import numpy as np
import pytest

import dap3d_core as dap

G = 9.81
SLOPE = np.radians(30.0)
METHODS = ["standard", "lsq"]


def incline(mu, v_tol=1e-3):
    """A block on a straight guide that falls at 30 degrees, from rest."""
    scene = dap.Scene(name="incline")
    scene.add_body("block", mass=2.0, Jp=(0.1, 0.2, 0.3))
    scene.add_vector("down", "ground", (np.cos(SLOPE), 0.0, -np.sin(SLOPE)))
    scene.add_joint("tran", "guide", P_i="block.O", P_j="ground.O", a_j="down")
    scene.add_force("weight", "gravity")
    scene.add_force("friction", "rub", joint="guide", mu=mu, v_tol=v_tol)
    return scene


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("mu", [0.0, 0.2, 0.5])
def test_a_block_slides_down_an_incline(method, mu):
    """a = g (sin - mu cos), 3.205858158 m/s^2 for mu 0.2 (spec 6.1), once tanh(v / v_tol) = 1."""
    result = dap.simulate(incline(mu), t_end=1.0, dt=0.5, method=method)
    wanted = G * (np.sin(SLOPE) - mu * np.cos(SLOPE))
    assert np.linalg.norm(result.rdd[-1, 0]) == pytest.approx(wanted, rel=1e-9)
    assert np.linalg.norm(result.Lam[-1, 3:]) == pytest.approx(2.0 * G * np.cos(SLOPE), rel=1e-9)


def test_a_block_that_should_stick_creeps():
    """Where mu > tan(30 deg) the block ends at the speed at which friction carries it."""
    mu, v_tol = 0.8, 1e-3
    result = dap.simulate(incline(mu, v_tol=v_tol), t_end=0.1, dt=0.05, rtol=1e-6)
    creep = v_tol * np.arctanh(np.tan(SLOPE) / mu)
    assert np.linalg.norm(result.rd[-1, 0]) == pytest.approx(creep, rel=1e-6)


def test_a_loaded_pin_stops_its_wheel():
    """rev: a balanced wheel, load m g on a pin of radius r: w' = -mu r m g / J until it rests."""
    mu, radius, mass, J, spin = 0.3, 0.02, 5.0, 0.1, 20.0
    scene = dap.Scene(name="wheel")
    scene.add_body("wheel", mass=mass, Jp=(J, J, J), w=(0.0, spin, 0.0))
    scene.add_joint("rev", "pin", P_i="wheel.O", P_j="ground.O", a_i="wheel.y", a_j="ground.y")
    scene.add_force("weight")
    scene.add_force("friction", joint="pin", mu=mu, radius=radius, v_tol=1e-3)
    result = dap.simulate(scene, t_end=2.0, dt=1.0)
    slowing = mu * radius * mass * G / J
    wanted = spin - slowing * result.t
    assert result.w[:, 0, 1] == pytest.approx(wanted, rel=1e-9)
    assert result.ledger["energy"].ok


def test_a_sliding_disk_is_braked_by_the_ground():
    """disk z: a disk upright and not turning, sliding sideways: a = -mu g; its load is m g."""
    mu, radius, mass = 0.2, 0.5, 3.0
    scene = dap.Scene(name="sliding disk")
    scene.add_body("disk", mass=mass, Jp=(1e3, 1e3, 1e3), r=(0.0, 0.0, radius),
                   r_dot=(2.0, 0.0, 0.0))  # fmt: skip
    scene.add_joint("disk", "contact", body_i="disk", slip="z", radius=radius)
    scene.add_force("weight")
    scene.add_force("friction", joint="contact", mu=mu, v_tol=1e-3)
    result = dap.simulate(scene, t_end=0.5, dt=0.5)
    # the rim also turns back: F R / J = 2e-3 of the acceleration's size is left out of neither side
    turn = mu * mass * G * radius / 1e3
    assert result.rd[-1, 0, 0] == pytest.approx(2.0 - mu * G * 0.5, rel=1e-9)
    assert result.w[-1, 0, 1] == pytest.approx(turn * 0.5, rel=1e-6)
    assert result.Lam[-1, 0] == pytest.approx(mass * G, rel=1e-9)


@pytest.mark.parametrize(("direction", "settles"), [(-1.0, True), (1.0, False)])
def test_multipliers_that_do_not_settle_are_reported(direction, settles):
    """Painleve's paradox: a light leaning disk slides towards its contact, at s = R (c, -sigma).

    Friction presses it down by mu sigma c R^2 / J for each newton of load, which carries
    1 / m + c^2 R^2 / J: above mu = 1.04 here no load is in balance. Sliding the other way is plain.
    """
    lean, radius, mass, J = np.pi / 4, 0.5, 1.0, 1e-2 / 2
    scene = dap.Scene(name="paradox")
    p = (np.cos(lean / 2), np.sin(lean / 2), 0.0, 0.0)  # the disk's axis to (0, 1, 1) / sqrt 2
    scene.add_body("disk", mass=mass, Jp=(J, J, J), p=p, r=(0.0, 0.0, radius * np.cos(lean)),
                   r_dot=(0.0, direction, 0.0))  # fmt: skip
    scene.add_joint("disk", "contact", body_i="disk", slip="z", radius=radius)
    scene.add_force("weight")
    scene.add_force("friction", joint="contact", mu=3.0, v_tol=1e-3)
    notes = " ".join(dap.simulate(scene, t_end=0.0).notes)
    assert ("did not settle" in notes) is not settles


def test_a_scene_without_friction_compiles_and_keeps_nothing_of_it():
    """No loop, no memory: the arrays are empty."""
    scene = incline(0.0)
    del scene.forces["rub"]
    system = dap.compile(scene).evaluator.system
    assert system.friction.size == 0
    assert "friction" not in {kind for kind, _ in dap.compile(scene).evaluator.loop_groups}


def test_a_joint_without_friction_is_named():
    """sph-sph does not rub: the scene is refused, and says which joint."""
    scene = dap.Scene(name="link")
    scene.add_body("ball", r=(0.0, 0.0, -1.0))
    scene.add_joint("sph-sph", "rod", P_i="ball.O", P_j="ground.O", length=1.0)
    scene.add_force("friction", "rub", joint="rod")
    with pytest.raises(
        dap.SceneError, match=r"forces.rub.*joint rod: type sph-sph has no friction"
    ):
        dap.compile(scene)
