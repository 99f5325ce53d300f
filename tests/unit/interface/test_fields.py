"""Forces that name joints: by a wrench of their own, or by the friction of the joint."""

import numpy as np
import pytest
from support.own_types import registry_of

import dap3d_core as dap
from dap3d_core.interface import (
    Body,
    Force,
    PluginError,
    Vector,
    body,
    examine,
    joint,
    number,
    vector,
)
from dap3d_core.kernels import dot, neg, scale, sub
from dap3d_core.testing import check_type

ZERO = (0.0, 0.0, 0.0)


class Brake(Force):
    """A moment -c w about the axis between two bodies, on the pin that is named."""

    keyword = "brake"
    body_i: Body = body()
    a_j: Vector = vector()
    joint: str = joint(doc="the pin that it brakes")
    mu: float = number(positive=True)
    v_tol: float = number(0.001)
    radius: float = number(0.02)

    def wrench(w_i, w_j, a_j, mu):
        M = scale(-mu * dot(a_j, sub(w_i, w_j)), a_j)
        return (ZERO, M), (ZERO, neg(M))


class Rub(Force):
    """Friction of a joint under another name."""

    keyword = "rub"
    seat: str = joint(doc="the joint that rubs")
    mu: float = number(0.5)
    v_tol: float = number(0.001)
    radius: float = number(0.02)


def spin_rate(type, **fields):
    """The angular acceleration of a rotor of Jp = 0.1 about its pin, at 10 rad/s."""
    scene = dap.Scene(name="rotor")
    scene.add_body("rotor", mass=1.0, Jp=(0.1, 0.1, 0.1), w=(0.0, 0.0, 10.0))
    pin = {"P_i": "rotor.O", "P_j": "ground.O", "a_i": "rotor.z", "a_j": "ground.z"}
    scene.add_joint("rev", "pin", **pin)
    scene.add_force("weight", wgt=(1.0, 0.0, 0.0))
    scene.add_force(type, "brake", mu=0.5, radius=0.02, **fields)
    compiled = dap.compile(scene, registry=registry_of(Brake, Rub))
    return compiled.rhs(0.0, compiled.model.u0)[-1]


def test_a_force_that_names_a_joint_acts_by_its_wrench_alone():
    """The moment is -mu w = -5 N m; friction of the pin, 0.5 x 9.81 N x 0.02 m, is not added."""
    rate = spin_rate("brake", body_i="rotor", a_j="ground.z", joint="pin")
    assert rate == pytest.approx(-5.0 / 0.1, rel=1e-12)


def test_the_field_of_a_joint_that_rubs_has_any_name():
    """mu N radius of the weight, tanh(10 rad/s x 0.02 m / 1 mm/s) being 1."""
    rate = spin_rate("rub", seat="pin")
    assert rate == pytest.approx(-0.5 * 9.81 * 0.02 / 0.1, rel=1e-12)
    np.testing.assert_equal(rate, spin_rate("friction", joint="pin", v_tol=1e-3))


def test_a_wrench_of_a_force_that_names_a_joint_is_checked():
    """As that of any other force; what acts by a joint's friction has nothing to be checked."""
    checks = {o.check: o.state for o in check_type(Brake, poses=2).outcomes}
    assert checks.keys() >= {"frame", "action and reaction", "purity"}
    assert "failed" not in checks.values()
    assert [o.state for o in check_type(Rub).outcomes] == ["not applicable"]


def test_by_the_friction_of_two_joints_at_once_no_force_acts():
    class Both(Rub):
        keyword = "both"
        other: str = joint()

    with pytest.raises(PluginError, match=r"several joints: seat, other; declare one, or define"):
        examine(Both)
