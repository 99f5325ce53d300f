"""Kernels of the friction of joints: declarations, and what ``check-plugin`` finds in them."""

import pytest

import dap3d_core as dap
from dap3d_core.interface import Contact, Joint, Point, point
from dap3d_core.testing import check_type
from dap3d_joints import cylindrical, disk, revolute, spherical, translational

GRIPS = {
    revolute.HingeFriction: ((False, True, False), False),
    translational.SliderFriction: ((False, True, False), False),
    cylindrical.SleeveTurning: ((False, True, False), False),
    spherical.BallFriction: ((True, True, True), False),
    disk.SlidingFriction: ((False, True, True), True),
    disk.LateralFriction: ((False, True, False), True),
}


@pytest.mark.parametrize("grip", GRIPS, ids=lambda grip: grip.__name__)
def test_which_rows_hold_and_whether_the_load_only_pushes(grip):
    """Along one direction one row, in a plane two, of a ball all three; ground does not pull."""
    holds, pushes = GRIPS[grip]
    assert (grip.holds, grip.pushes) == (holds, pushes)
    assert grip.is_friction_alone()


@pytest.mark.slow
@pytest.mark.every(3)
@pytest.mark.parametrize("grip", GRIPS, ids=lambda grip: grip.__name__)
def test_rows_and_forces_agree(grip):
    """Rows, right-hand sides and wrenches by differences, their balance and their frame."""
    report = check_type(grip)
    assert report.ok, str(report)


def test_a_joint_has_the_friction_that_it_declares():
    class Slide(Joint):
        """P_i stays on the plane z = 0."""

        keyword, rows, ground_axes = "slide", 1, True
        P_i: Point = point()

        def C(r_P_i):
            return r_P_i[2]

    assert Slide.grips == ()

    class OfSlide(Contact, of=Slide):
        """In the plane."""

        keyword, load = "friction", (0,)

        def at(r_P_i):
            return r_P_i

        def normal():
            return (0.0, 0.0, 1.0)

    assert Slide.grips == (OfSlide,)
    assert not Joint.grips


def test_friction_without_v_tol_needs_a_joint_that_sticks():
    """sph-sph does not rub."""
    scene = dap.Scene(name="link")
    scene.add_body("ball", r=(0.0, 0.0, -1.0))
    scene.add_joint("sph-sph", "rod", P_i="ball.O", P_j="ground.O", length=1.0)
    scene.add_force("friction", "rub", joint="rod")
    with pytest.raises(dap.SceneError, match=r"joint rod: type sph-sph has no friction"):
        dap.compile(scene)
