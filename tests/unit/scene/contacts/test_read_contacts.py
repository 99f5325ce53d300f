"""Limits of joints and rigid stops as contacts: what is read, what is refused."""

import pytest

import dap3d_core as dap
from dap3d_core.scene import check


def hinge(**limits):
    scene = dap.Scene(name="hinge")
    scene.add_body("wheel", mass=2.0, Jp=(0.5, 0.5, 0.3))
    scene.add_joint("rev", "axle", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z",
                    **limits)  # fmt: skip
    return scene


def read(scene):
    return check(scene, dap.load_registry())


def test_each_limit_is_a_contact():
    found = read(hinge(lower="-30 deg", upper=1.0, e=0.2)).contacts
    assert [contact.name for contact in found] == ["axle_lower", "axle_upper"]
    assert [contact.values["bound"] for contact in found] == pytest.approx([-0.5235988, 1.0])
    assert {contact.values["e"] for contact in found} == {0.2}


def test_a_stop_is_a_contact_where_it_has_no_stiffness():
    scene = hinge()
    scene.add_force("rot_stop", "soft", joint="axle", theta_stop=-1.0, k=1e4)
    scene.add_force("rot_stop", "rigid", joint="axle", theta_stop=-2.0, e=0.4)
    found = read(scene)
    assert [force.name for force in found.forces] == ["soft"]
    assert [contact.name for contact in found.contacts] == ["rigid"]


def of_a_ball(scene):
    scene.joints["axle"].type = "sph"
    scene.joints["axle"].fields = {"P_i": "wheel.O", "P_j": "ground.O", "lower": 1.0}


def stop(name, **fields):
    return lambda scene: scene.add_force("rot_stop", name, joint="axle", theta_stop=-1.0, **fields)


@pytest.mark.parametrize(
    ("limits", "change", "words"),
    [
        ({"lower": 1.0, "upper": 0.5}, None, "joints.axle.upper = 0.5: is not above lower = 1"),
        ({"e": 0.5}, None, "joints.axle.e = 0.5: is of limits"),
        ({"lower": "low"}, None, 'joints.axle.lower = "low": should be a number'),
        ({"lower": 0.0}, lambda scene: scene.add_contact("ball_plane", "axle_lower", P_i="wheel.O"),
         "is the name of the lower limit of joint axle"),
        ({}, stop("stop", zeta=0.5), r"forces\.stop\.zeta = 0.5.*rigid without k\s+give k"),
        ({}, stop("axle"), r"its name is one of \[joints\] as well"),
        ({}, of_a_ball, r"joints\.axle\.lower"),  # a joint without a coordinate
    ],
)  # fmt: skip
def test_what_is_no_limit_is_refused(limits, change, words):
    scene = hinge(**limits)
    if change:
        change(scene)
    with pytest.raises(dap.SceneError, match=words):
        read(scene)
