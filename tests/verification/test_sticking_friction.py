"""Dry friction of hinges and sliders that sticks, against closed forms.

Tolerances: at rtol 1e-12 a run leaves some 1e-12 of its coordinates, and instants are located where
a slip is below 1e-11 of its first speed.
"""

import numpy as np
import pytest

import dap3d_core as dap

TIGHT = {"rtol": 1e-12, "atol": 1e-14}


def hinge(spin=2.0, **limits):
    scene = dap.Scene(name="hinge")
    scene.add_body("wheel", mass=2.0, Jp=(0.5, 0.5, 0.3), w=(0.0, 0.0, spin))
    scene.add_joint("rev", "axle", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z",
                    **limits)  # fmt: skip
    return scene


def slider(m=2.0, x=0.0):
    scene = dap.Scene(name="slider")
    scene.add_body("block", mass=m, Jp=(0.1, 0.1, 0.1), r=(x, 0.0, 0.0))
    scene.add_joint("tran", "way", P_i="block.O", P_j="ground.O", a_j="ground.x")
    return scene


@pytest.mark.parametrize("integrator", ["dop853", "adams", "radau"])
def test_a_hinge_stops_and_stays(integrator):
    """I w' = -n: at rest after I w / n, at I w^2 / (2 n); all of its energy is lost."""
    scene, inertia, spin, n = hinge(), 0.3, 2.0, 0.4
    scene.add_force("rot_friction", "rub", joint="axle", n_c=n)
    result = dap.simulate(scene, t_end=3.0, dt=0.25, integrator=integrator, **TIGHT)
    (stick,) = result.events
    assert stick.kind == "stick"
    assert stick.t == pytest.approx(inertia * spin / n, rel=0, abs=1e-10)
    far = 0.5 * inertia * spin**2 / n
    assert result.quantity("axle.angle").values[-1] == pytest.approx(far, abs=1e-12)
    assert not result.w[-1].any()
    assert result.work[-1] == pytest.approx(-0.5 * inertia * spin**2, abs=1e-12)


def test_a_block_on_a_spring_swings_to_rest():
    """The Coulomb oscillator: each half swing is 2 F / k shorter, until the spring is too weak."""
    m, k, F = 2.0, 50.0, 3.0
    scene = slider(m, 1.0)
    scene.add_force("tran_sda", "spring", P_i="block.O", P_j="ground.O", a_j="ground.x", k=k)
    scene.add_force("tran_friction", "rub", joint="way", f_c=F)
    result = dap.simulate(scene, t_end=8.0, dt=0.25, **TIGHT)
    swings, x = 0, 1.0
    while abs(x) > F / k:
        x = -np.sign(x) * (abs(x) - 2.0 * F / k)
        swings += 1
    (stick,) = result.events
    assert stick.t == pytest.approx(swings * np.pi * np.sqrt(m / k), rel=0, abs=1e-9)
    assert result.r[-1, 0, 0] == pytest.approx(x, abs=1e-12)
    assert result.contact("rub").friction[-1, 0] == pytest.approx(k * x, abs=1e-11)


def test_a_block_that_is_pulled_sticks_and_slips():
    """By a spring whose end moves at V, with f_s above f_c; d = (f_s - f_c) / k, w^2 = k / m.

    It slips for 2 (pi - atan(d w / V)) / w, and sticks while the end moves on by 2 d.
    """
    m, k, V, f_c, f_s = 2.0, 50.0, 0.3, 3.0, 4.5
    scene = slider(m)
    scene.add_function("a", "ramp", coeff=(0.0, V, 0.0))
    scene.add_force("motor", "pull", joint="way", position="ramp", k=k)
    scene.add_force("tran_friction", "rub", joint="way", f_c=f_c, f_s=f_s)
    result = dap.simulate(scene, t_end=3.0, dt=0.25, **TIGHT)
    d, w = (f_s - f_c) / k, np.sqrt(k / m)
    slips, sticks = 2.0 * (np.pi - np.arctan(d * w / V)) / w, 2.0 * d / V
    first = f_s / (k * V)
    expected = [first, first + slips, first + slips + sticks, first + 2.0 * slips + sticks]
    assert [event.kind for event in result.events][:4] == ["slip", "stick"] * 2
    instants = [event.t for event in result.events[:4]]
    assert instants == pytest.approx(expected, rel=0, abs=1e-9)


@pytest.mark.slow
def test_a_hinge_under_load_does_not_creep():
    """At 0.999 of its friction over 1000 s, to 1e-14; at 1.001 it turns from the start on."""
    n = 0.4
    for part, turned in ((0.999, 0.0), (1.001, 0.5 * 0.001 * n / 0.3 * 1e6)):
        scene = hinge(spin=0.0)
        scene.add_force("rot_friction", "rub", joint="axle", n_c=n)
        scene.add_force("motor", "push", joint="axle", torque=part * n)
        result = dap.simulate(scene, t_end=1000.0, dt=500.0, **TIGHT)
        angle = result.quantity("axle.angle").values[-1]
        assert angle == pytest.approx(turned, rel=1e-10, abs=1e-14)


def test_a_door_rubs_and_strikes_its_limit():
    """From 2 rad/s to 1 rad by friction n, back with e of its speed, and to rest by friction."""
    n, inertia, e = 0.3, 0.3, 0.5
    scene = hinge(upper=1.0, e=e)
    scene.add_force("rot_friction", "rub", joint="axle", n_c=n)
    result = dap.simulate(scene, t_end=3.0, dt=0.5, **TIGHT)
    a = n / inertia
    at_limit = np.sqrt(4.0 - 2.0 * a)
    back = (e * at_limit) ** 2 / (2.0 * a)
    assert [event.kind for event in result.events] == ["impact", "stick"]
    strikes = (2.0 - at_limit) / a
    assert result.events[0].t == pytest.approx(strikes, rel=0, abs=1e-10)
    assert result.events[1].t == pytest.approx(strikes + e * at_limit / a, rel=0, abs=1e-9)
    assert result.quantity("axle.angle").values[-1] == pytest.approx(1.0 - back, abs=1e-12)


def test_two_frictions_of_one_hinge_share_what_they_hold():
    """Each of them less than the moment, together more: it stays; then both slide."""
    scene = hinge(spin=0.0)
    scene.add_force("rot_friction", "seal", joint="axle", n_c=0.3)
    scene.add_force("rot_friction", "gear", joint="axle", n_c=0.5)
    scene.add_function("a", "ramp", coeff=(0.0, 1.0, 0.0))
    scene.add_force("motor", "push", joint="axle", torque="ramp")
    result = dap.simulate(scene, t_end=1.0, dt=0.25, **TIGHT)
    slips = [event.t for event in result.events if event.kind == "slip"]
    assert slips == pytest.approx([0.8, 0.8], rel=0, abs=1e-8)
    assert result.w[-1, 0, 2] == pytest.approx(0.5 * 0.2**2 / 0.3, abs=1e-8)


def test_friction_that_fades_has_no_part_that_sticks():
    scene = hinge()
    scene.add_force("rot_friction", "rub", joint="axle", n_c=0.4, n_s=0.5, w_tol=1e-3)
    result = dap.simulate(scene, t_end=0.1, dt=0.1)
    assert any("n_s is of friction that sticks" in note for note in result.notes)


def test_what_sticks_holds_no_less_than_what_slides():
    scene = hinge()
    scene.add_force("rot_friction", "rub", joint="axle", n_c=0.4, n_s=0.3)
    with pytest.raises(dap.SceneError, match=r"forces\.rub: n_s = 0\.3 is less than n_c = 0\.4"):
        dap.simulate(scene, t_end=0.1)


@pytest.mark.parametrize(("first", "second"), [(1.0, 0.02), (0.1, 0.3), (0.02, 1.0)])
def test_gears_on_hinges_that_rub_come_to_rest(first, second):
    """I w_dot = -n of the first, from 8 rad/s: 0.02 + 0.02 / 4 kg m^2, first + second / 2 N m.

    Both stop at once. What they had then, 1e-46 rad/s^2 that no friction of gears in mesh could
    give, had no solution, and runs ended as a jam.
    """
    scene = dap.Scene(name="gears")
    for k, (x, w) in enumerate(((0.0, 8.0), (0.3, -4.0))):
        scene.add_body(f"g{k}", mass=1.0, Jp=[0.01, 0.02, 0.01], r=[x, 0.0, 0.0], w=[0.0, w, 0.0])
        scene.add_point(f"p{k}", "ground", [x, 0.0, 0.0])
        scene.add_joint("rev", f"h{k}", P_i=f"g{k}.O", P_j=f"p{k}", a_i=f"g{k}.y", a_j="ground.y")
        scene.add_force("rot_friction", f"rub{k}", joint=f"h{k}", n_c=(first, second)[k])
    scene.add_joint("gear", "mesh", joint_i="h0", joint_j="h1", radius_i=0.1, radius_j=0.2)
    result = dap.simulate(scene, t_end=1.0, dt=0.5)
    stops = 8.0 * 0.025 / (first + 0.5 * second)
    assert [event.kind for event in result.events] == ["stick", "stick"]
    assert [event.t for event in result.events] == pytest.approx([stops] * 2, rel=0, abs=1e-9)
    assert np.abs(result.w[-1]).max() < 1e-12
