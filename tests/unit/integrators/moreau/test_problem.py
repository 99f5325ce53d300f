"""Groups of bodies that joints and contacts connect: each is solved as if it were alone."""

import numpy as np
import pytest
from support.plain import long_in_plain_python

import dap3d_core as dap

LINKS = 4
#: Height above the floor, m, from which a machine falls within the time of the run.
HIGH = 0.01


def machines(*lifts):
    """Chains of links at the same place, of which each meets the floor and itself alone.

    Hinges rub. lifts: m, of each.
    """
    scene = dap.Scene(name="machines")
    scene.add_material("surface", mu=0.5, e=0.2)
    scene.add_collisions(material="surface")
    scene.add_shape("plane", body="ground", collides=True, meets=2 ** len(lifts) - 1)
    scene.add_force("weight", "gravity")
    for m, lift in enumerate(lifts):
        for k in range(LINKS):
            name = f"m{m}_link{k}"
            scene.add_body(name, mass=1.0 + k, Jp=[0.004, 0.01, 0.01], r=[0.3 * k, 0, 0.05 + lift])
            scene.add_shape("box", body=name, size=[0.2, 0.1, 0.1], collides=True,
                            group=2**m, meets=2**m)  # fmt: skip
            scene.add_point(f"{name}_front", name, [0.15, 0.0, 0.0])
            scene.add_point(f"{name}_back", name, [-0.15, 0.0, 0.0])
        for k in range(LINKS - 1):
            i, j = f"m{m}_link{k}", f"m{m}_link{k + 1}"
            scene.add_joint("rev", f"m{m}_hinge{k}", P_i=f"{i}_front", P_j=f"{j}_back",
                            a_i=f"{i}.y", a_j=f"{j}.y")  # fmt: skip
            scene.add_force("rot_friction", f"m{m}_rubs{k}", joint=f"m{m}_hinge{k}", n_c=0.01)
    return scene


def motion(*lifts):
    """What each machine does, (machines, t, links, 13): places, turns, accelerations."""
    result = dap.simulate(machines(*lifts), t_end=0.1, dt=0.02, contact_step=2e-3)
    assert len(result.contacts.t) > 0
    rates = result.v_dot.reshape(len(result.t), -1, 6)
    found = np.concatenate([result.r, result.p, rates], axis=2)
    return found.reshape(len(result.t), len(lifts), LINKS, -1).swapaxes(0, 1)


@pytest.mark.slow
@long_in_plain_python
def test_copies_move_as_one_alone():
    """Bit by bit, through an impact."""
    alone = motion(HIGH)[0]
    for copy in motion(HIGH, HIGH, HIGH):
        assert np.array_equal(copy, alone)


@long_in_plain_python
def test_a_machine_does_not_feel_the_impact_of_another_one():
    """Limit: rounding of accelerations, which are velocities over 2 ms."""
    falls, rests = motion(HIGH, 0.0)
    assert np.abs(falls - motion(HIGH)[0]).max() < 1e-11
    assert np.abs(rests - motion(0.0)[0]).max() < 1e-11


def test_where_joints_let_nothing_press_rounding_is_no_residual():
    """A finger that a driver holds flush with the floor, and another moves along it."""
    scene = dap.Scene(name="finger")
    scene.add_body("hand", mass=1.0, Jp=[0.01] * 3, r=[0, 0, 0.3])
    scene.add_body("finger", mass=0.2, Jp=[1e-3] * 3, r=[-0.1, 0, 0.1])
    scene.add_point("rail", "hand", [0, 0, -0.2])
    scene.add_joint("tran", "slide", P_i="finger.O", P_j="rail", a_j="hand.x")
    scene.add_joint("tran", "lift", P_i="hand.O", P_j="ground.O", a_j="ground.z")
    scene.add_joint("motor", "holds", joint="lift", position=0.0)
    scene.add_force("motor", "close", joint="slide", force=20.0)
    scene.add_force("weight", "gravity")
    scene.add_shape("box", body="finger", size=[0.02, 0.06, 0.1], at=[0, 0, -0.05], collides=True)
    scene.add_shape("plane", body="ground", collides=True)
    scene.add_collisions()
    result = dap.simulate(scene, t_end=0.01, dt=0.01)
    assert result.ledger["residual"].value < 1e-12
    assert abs(result.quantity("holds.force.z").values - 1.2 * 9.81).max() < 1e-12
