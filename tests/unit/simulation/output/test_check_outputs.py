"""Joints that hold only while an expression is positive, against closed forms.

At rtol 1e-12 a run of a second leaves less than 1e-12 of its coordinates; a bound of 1e-9 leaves
room for the slowest integrator.
"""

import numpy as np
import pytest
from scipy.special import ellipk, ellipkinc
from support.plain import long_in_plain_python

import dap3d_core as dap

TIGHT = {"rtol": 1e-12, "atol": 1e-13}
m, L, g, J = 2.0, 0.7, 9.81, 0.2
#: The swing is let go at this angle from the vertical; the square of its rate there.
ANGLE = np.deg2rad(50.0)
OMEGA_2 = m * g * L / (J + m * L**2)
RATE = np.sqrt(2.0 * OMEGA_2 * np.cos(ANGLE))
#: s, from the horizontal, where it starts at rest.
LET_GO = (ellipk(0.5) - ellipkinc(np.arcsin(np.sin(ANGLE / 2.0) * np.sqrt(2.0)), 0.5)) / np.sqrt(
    OMEGA_2
)


def swing(active="bob.r.x > far"):
    scene = dap.Scene(name="swing")
    scene.add_body("bob", mass=m, Jp=(0.1, J, 0.25), r=(L, 0.0, 0.0))
    scene.add_point("hook", "bob", (-L, 0.0, 0.0))
    scene.add_force("weight", "gravity", gravity=g)
    scene.parameters["far"] = float(L * np.sin(ANGLE))
    scene.add_joint("rev", "rod", P_i="hook", P_j="ground.O", a_i="bob.y", a_j="ground.y",
                    active=active)  # fmt: skip
    return scene


@pytest.mark.parametrize("integrator", ["dop853", "adams", "radau"])
def test_a_swing_that_lets_go_flies_a_parabola(integrator):
    result = dap.simulate(swing(), t_end=0.6, dt=0.1, integrator=integrator, **TIGHT)
    (event,) = result.events
    assert (event.kind, event.name) == ("break", "rod")
    assert event.t == pytest.approx(LET_GO, abs=1e-12)
    s = result.t[result.t > event.t] - LET_GO
    x = L * np.sin(ANGLE) - L * RATE * np.cos(ANGLE) * s
    z = -L * np.cos(ANGLE) - L * RATE * np.sin(ANGLE) * s - 0.5 * g * s**2
    assert np.abs(result.r[-len(s) :, 0][:, [0, 2]] - np.stack([x, z], axis=1)).max() < 1e-9
    assert result.ledger["energy"].value < 1e-11


def clutch(active, **fields):
    """Two wheels on an axis, of 0.5 and 1.5 kg m^2, at 8 and -2 rad/s; an input ``on``."""
    scene = dap.Scene(name="clutch")
    for name, inertia, z, rate in (("first", 0.5, 0.0, 8.0), ("second", 1.5, 1.0, -2.0)):
        scene.add_body(name, mass=1.0, Jp=(1.0, 1.0, inertia), r=(0.0, 0.0, z), w=(0, 0, rate))
        scene.add_point(f"{name}_seat", "ground", (0.0, 0.0, z))
        scene.add_joint("rev", f"axle_{name}", P_i=f"{name}.O", P_j=f"{name}_seat",
                        a_i=f"{name}.z", a_j="ground.z")  # fmt: skip
    scene.add_input("on", value=0.0)
    scene.add_joint("rel-rot", "clutch", body_i="first", body_j="second", a_j="second.z",
                    active=active, **fields)  # fmt: skip
    return scene


@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_a_clutch_brings_two_wheels_to_a_common_speed(integrator):
    """Momentum: 0.5 8 - 1.5 2 = 2.0 w; lost is half the reduced inertia times the square of 10."""
    scene = clutch("t > 0.7 and t < 1.3")
    result = dap.simulate(scene, t_end=2.0, dt=0.25, integrator=integrator, **TIGHT)
    engaged, ended = result.events
    assert (engaged.kind, engaged.t, ended.kind, ended.t) == ("engage", 0.7, "break", 1.3)
    assert engaged.work == pytest.approx(-0.5 * 0.375 * 10.0**2, abs=1e-12)
    after = result.t > 0.7
    assert np.abs(result.w[after, :, 2] - 0.5).max() < 1e-12
    assert np.abs(result.w[~after, :, 2] - [8.0, -2.0]).max() < 1e-12
    assert result.ledger["energy"].ok


@long_in_plain_python
def test_a_clutch_follows_an_input_and_the_model_starts_anew(tmp_path):
    compiled = dap.compile(clutch("on - 0.5"))

    def press(state):
        state.set("on", value=1.0)

    pressed = dap.Event("t", above=0.5, action=press)
    result = dap.simulate(compiled, t_end=1.0, dt=0.25, events=[pressed], **TIGHT)
    assert [event.kind for event in result.events] == ["change", "engage"]
    assert result.w[-1, :, 2] == pytest.approx([0.5, 0.5], abs=1e-12)
    result.save(tmp_path / "clutch.nc")
    assert dap.open(tmp_path / "clutch.nc").events[-1].work == result.events[-1].work
    open_ = dap.simulate(compiled, t_end=1.0, dt=0.25, **TIGHT)
    assert not open_.events
    assert open_.w[-1, :, 2] == pytest.approx([8.0, -2.0], abs=1e-12)


def latch(height=0.5, active="bar.r.x >= 1", **fields):
    """A bar slides by at 3 m/s, and is caught by its end: J = 0.4, d = 0.5."""
    scene = dap.Scene(name="latch")
    scene.add_body("bar", mass=2.0, Jp=(0.3, 0.3, 0.4), r_dot=(3.0, 0.0, 0.0))
    scene.add_point("end", "bar", (0.0, 0.5, 0.0))
    scene.add_point("hook", "ground", (1.0, height, 0.0))
    scene.add_joint("sph", "latch", P_i="end", P_j="hook", active=active, **fields)
    return scene


def test_a_latch_catches_a_bar():
    """Angular momentum about the hook: 2 3 0.5 = (0.4 + 2 0.5^2) w."""
    result = dap.simulate(latch(), t_end=1.0, dt=0.5, **TIGHT)
    (event,) = result.events
    rate = 3.0 / 0.9
    assert event.t == pytest.approx(1.0 / 3.0, abs=1e-14)
    assert event.work == pytest.approx(0.5 * 0.9 * rate**2 - 0.5 * 2.0 * 9.0, abs=1e-12)
    turned = rate * (1.0 - 1.0 / 3.0)
    place = [1.0 + 0.5 * np.sin(turned), 0.5 - 0.5 * np.cos(turned), 0.0]
    assert result.r[-1, 0] == pytest.approx(place, abs=1e-9)
    assert result.w[-1, 0, 2] == pytest.approx(rate, abs=1e-9)
    assert any(
        "6 degrees of freedom" in line for line in dap.compile(latch()).explain().split("\n")
    )


def test_a_latch_that_does_not_meet_its_hook_is_refused():
    with pytest.raises(
        dap.SimulationError, match=r"joint latch is engaged where it is open by 0.02"
    ):
        dap.simulate(latch(0.52), t_end=1.0)


def test_a_joint_that_breaks_stays_broken():
    """Caught it would carry 2 0.5 w^2 = 11.1 N."""
    result = dap.simulate(latch(breaks_at=5.0), t_end=1.0, dt=0.5, **TIGHT)
    assert [event.kind for event in result.events] == ["engage", "break"]
    assert result.r[-1, 0, 0] == pytest.approx(1.0 + 0.5 * 10.0 / 3.0 * 2.0 / 3.0, abs=1e-9)


@long_in_plain_python
def test_one_joint_takes_over_from_another():
    """At one instant: what ends does so before the other holds, so the swing keeps its rate."""
    scene = swing("t < 0.2")
    scene.add_joint("sph", "ball", P_i="hook", P_j="ground.O", active="t >= 0.2")
    result = dap.simulate(scene, t_end=0.6, dt=0.1, **TIGHT)
    whole = dap.simulate(swing("t < 1"), t_end=0.6, dt=0.1, **TIGHT)
    assert [(event.kind, event.t) for event in result.events] == [("break", 0.2), ("engage", 0.2)]
    assert np.abs(result.r - whole.r).max() < 1e-9
    assert abs(result.events[1].work) < 1e-12


@pytest.mark.parametrize(
    ("active", "words"),
    [
        ("t == 1", "compares by ==, which changes for an instant alone"),
        ("rod.force.x < 1", "names rod.force.x, which is not there while the joint is not"),
        ("load < 1", "names rod.force.x, which is not there while the joint is not"),
        ("bob.yaw < 1", "names bob.yaw, which steps by a turn at pi"),
        ("bob.r < 1", "is a vector, and should be one number"),
        ("bob.r.x < t", "unlike units"),
        ("bop.r.x < 1", "there is no body, point, joint, contact or force 'bop'"),
        (True, "should be an expression in quotes"),
    ],
)
def test_expressions_that_are_refused(active, words):
    scene = swing(active)
    scene.add_output("load", "rod.force.x")
    with pytest.raises(dap.SceneError, match=words):
        dap.compile(scene)


def test_what_changes_back_as_the_joint_ends_is_refused():
    """The bob falls at 9.81 m/s^2, which engages the rod, and at 8.14 where that holds it."""
    with pytest.raises(dap.SimulationError, match="joints rod ended and held again 50 times"):
        dap.simulate(swing("bob.rdd.z < -9"), t_end=1.0)


@long_in_plain_python
def test_a_script_leaves_joints_alone_that_are_active_by_an_expression():
    event = dap.Event("t", above=0.1, action=lambda state: state.release("rod"))
    with pytest.raises(ValueError, match=r"joint rod is active by 'bob\.r\.x > far'"):
        dap.simulate(swing(), t_end=0.2, events=[event])


def test_a_sub_assembly_names_its_own_parts():
    whole = dap.Scene(name="whole")
    dap.include(whole, "left", swing("bob.r.x > 0.5"))
    assert whole.joints["left/rod"].fields["active"] == "'left/bob.r.x' > 0.5"
