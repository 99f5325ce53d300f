"""Contacts in joint coordinates, against closed forms and against the coordinates of bodies.

Both see the same equations: at rtol 1e-12 runs of half a second differ by less than 1e-10. Corners
of a box share their load alike; feet that legs press apart do not: what each of them takes is not
unique, and least multipliers with those of other joints are another choice.
"""

import numpy as np
import pytest
from support.plain import long_in_plain_python

import dap3d_core as dap

TIGHT = {"rtol": 1e-12, "atol": 1e-13}
g = 9.81


def arm(mass=2.0, length=0.8, **joint):
    """A uniform rod on a hinge 0.5 m above the floor, horizontal, at rest."""
    scene = dap.Scene(name="arm")
    scene.add_body("rod", mass=mass, Jp=(0.01, mass * length**2 / 12, mass * length**2 / 12),
                   r=(0.5 * length, 0.0, 0.5))  # fmt: skip
    scene.add_point("end", "rod", (-0.5 * length, 0.0, 0.0))
    scene.add_point("tip", "rod", (0.5 * length, 0.0, 0.0))
    scene.add_point("eye", "ground", (0.0, 0.0, 0.5))
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_joint("rev", "hinge", P_i="end", P_j="eye", a_i="rod.y", a_j="ground.y", **joint)
    return scene


def both(scene, t_end=0.5, **settings):
    """The runs by joint coordinates and by those of bodies."""
    given = {"t_end": t_end, "dt": 0.05} | TIGHT | settings
    return [dap.simulate(scene, method=method, **given) for method in ("joint", "lsq")]


@pytest.mark.slow
@pytest.mark.every(3)
@pytest.mark.parametrize("integrator", ["dop853", "adams", "radau"])
def test_an_arm_falls_onto_the_floor_and_lies_there(integrator):
    """The ball at its tip touches where 0.8 sin(a) = 0.45, at w^2 = 3 g sin(a) / 0.8.

    Lying there it carries half the weight, where friction across the floor is none.
    """
    scene = arm()
    scene.add_contact("ball_plane", "floor", P_i="tip", radius=0.05, mu=0.0, e=0.0)
    result = dap.simulate(scene, method="joint", integrator=integrator, t_end=1.0, dt=0.25, **TIGHT)
    assert result.method == "joint"
    impact = next(event for event in result.events if event.kind == "impact")
    sine = 0.45 / 0.8
    rate = np.sqrt(3.0 * g * sine / 0.8)
    assert impact.u[-2] == pytest.approx(rate, abs=1e-9)
    assert impact.work == pytest.approx(-2.0 * g * 0.4 * sine, abs=1e-9)
    assert result.r[-1, 0, 2] == pytest.approx(0.5 - 0.4 * sine, abs=1e-12)
    assert result.contact("floor").normal_force[-1] == pytest.approx(g, abs=1e-9)
    held = result.reaction("hinge")["i"].force[-1]
    assert held == pytest.approx([0.0, 0.0, g], abs=1e-9)
    assert result.ledger["energy"].ok


def test_a_pendulum_bounces_between_its_limits():
    """It falls to 1.2 rad, and rises to where sin(a) has lost a part 1 - e^2 of that."""
    result, other = both(arm(lower=-0.3, upper=1.2, e=0.6), t_end=1.2)
    fell = next(event for event in result.events if event.kind == "impact")
    assert fell.u[-2] ** 2 == pytest.approx(3.0 * g * np.sin(1.2) / 0.8, abs=1e-9)
    assert fell.u_after[-2] == pytest.approx(-0.6 * fell.u[-2], abs=1e-12)
    assert np.abs(result.r - other.r).max() < 1e-10
    held, same = (run.reaction("hinge")["i"].force for run in (result, other))
    assert np.abs(held - same).max() < 1e-7


def test_friction_of_a_hinge_holds_a_rod_and_lets_it_go():
    """m g L / 2 = 7.848 N m: 8 hold it; 2 do not, so that the work of friction is 2 N m rad."""
    held = arm()
    held.add_force("rot_friction", "rub", joint="hinge", n_c=8.0)
    result = dap.simulate(held, method="joint", t_end=100.0, dt=50.0)
    assert not result.rd.any()
    assert np.abs(result.r[-1] - result.r[0]).max() < 1e-14
    falling = arm()
    falling.add_force("rot_friction", "rub", joint="hinge", n_c=2.0)
    result, other = both(falling, t_end=0.4)
    angle = result.quantity("hinge.angle").values[-1]
    energy = 2.0 * g * 0.4 * np.sin(angle) - 2.0 * angle
    assert result.w[-1, 0, 1] ** 2 == pytest.approx(6.0 * energy / (2.0 * 0.8**2), abs=1e-9)
    assert np.abs(result.r - other.r).max() < 1e-10


def box():
    scene = dap.Scene(name="box")
    scene.add_body("box", mass=2.0, Jp=(0.02, 0.03, 0.04), r=(0, 0, 0.1), r_dot=(1.5, 0.3, 0),
                   w=(0, 0, 2.0))  # fmt: skip
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_contact("box_plane", "floor", P_i="box.O", size=(0.4, 0.3, 0.2), mu=0.3)
    return scene


def legged():
    """A trunk on four legs with springs in its hips falls onto its feet."""
    scene = dap.Scene(name="legs")
    scene.add_body("trunk", mass=6.0, Jp=(0.1, 0.2, 0.25), r=(0.0, 0.0, 0.45))
    scene.add_force("weight", "gravity", gravity=g)
    for k, (x, y) in enumerate(((0.3, 0.2), (0.3, -0.2), (-0.3, 0.2), (-0.3, -0.2))):
        scene.add_body(f"leg{k}", mass=0.5, Jp=(0.004, 0.004, 0.001), r=(x, y, 0.25))
        scene.add_point(f"hip{k}", f"leg{k}", (0.0, 0.0, 0.2))
        scene.add_point(f"foot{k}", f"leg{k}", (0.0, 0.0, -0.2))
        scene.add_point(f"seat{k}", "trunk", (x, y, 0.0))
        scene.add_joint("rev", f"joint{k}", P_i=f"hip{k}", P_j=f"seat{k}", a_i=f"leg{k}.y",
                        a_j="trunk.y")  # fmt: skip
        scene.add_force("rot_sda", f"spring{k}", joint=f"joint{k}", k=60.0 + k, c=1.5)
        scene.add_contact("ball_plane", f"ball{k}", P_i=f"foot{k}", radius=0.03, mu=0.6, e=0.0)
    return scene


@long_in_plain_python
@pytest.mark.parametrize("scene", [box(), legged()], ids=["box", "legged"])
def test_what_slides_and_shares_is_the_same_in_coordinates_of_bodies(scene):
    result, other = both(scene)
    assert [event.kind for event in result.events] == [event.kind for event in other.events]
    assert np.abs(result.r - other.r).max() < 1e-10
    assert np.abs(result.rd - other.rd).max() < 1e-9
    contacts = [[run.contact(name) for name in run.contact_names] for run in (result, other)]
    assert all(np.array_equal(one.mode, two.mode) for one, two in zip(*contacts, strict=True))
    forces = [np.stack([one.force for one in some], axis=-2) for some in contacts]
    if scene.name == "legs":
        forces = [force.sum(axis=-2) for force in forces]
    assert np.abs(forces[0] - forces[1]).max() < 1e-6
    assert result.ledger["energy"].ok


def test_joints_that_end_beside_contacts_keep_body_coordinates():
    scene = arm(active="t < 0.2")
    scene.add_contact("ball_plane", "floor", P_i="tip", radius=0.05, mu=0.2)
    with pytest.raises(dap.SimulationError, match="use lsq or auto"):
        dap.simulate(scene, t_end=0.5, method="joint")


@pytest.mark.parametrize("ratio", [1e-4, 1e-6, 1e-8])
def test_a_load_hangs_on_a_stop_by_a_light_slider(ratio):
    """A rod to a slider of that part of its mass, which a limit holds: nothing moves.

    Rows of the slider alone have 1/ratio in common, of which joint coordinates see the rounding.
    """
    scene = dap.Scene(name="hoist")
    scene.add_body("load", mass=0.5, Jp=(0.001,) * 3, r=(0.0, 0.0, -0.4))
    scene.add_body("slider", mass=0.5 * ratio, Jp=(0.001 * ratio,) * 3, r=(0.3, 0.0, 0.0))
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_joint("tran", "rail", P_i="load.O", P_j="ground.O", a_j="ground.z")
    scene.add_joint("tran", "way", P_i="slider.O", P_j="ground.O", a_j="ground.x", lower=0.0)
    scene.add_joint("sph-sph", "rod", P_i="load.O", P_j="slider.O", length=0.5)
    for result in both(scene, t_end=1e-3, dt=1e-3, rtol=1e-8, atol=1e-10):
        pulls = result.reaction("rod")["i"].force[:, 2]
        assert pulls == pytest.approx(0.5 * g, rel=max(1e-12, 1e-15 / ratio))
        assert np.abs(result.rdd).max() < 2.0 * g * max(1e-12, 1e-15 / ratio)
