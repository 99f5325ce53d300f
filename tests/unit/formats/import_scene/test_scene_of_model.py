"""What acts on coordinates of joints: friction, springs, dampers, by closed forms."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dap3d_core as dap

#: Mass or moment of inertia, friction, rate at the start.
INERTIA, FRICTION, RATE = 0.3, 0.4, 2.0

URDF = """<robot name="one"><link name="world"/>
  <link name="a"><inertial><mass value="0.3"/>
    <inertia ixx="1" iyy="1" izz="0.3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="q" type="{type}"><parent link="world"/><child link="a"/><axis xyz="0 0 1"/>
    <limit lower="-9" upper="9" effort="1" velocity="1"/>
    <dynamics friction="0.4"/></joint></robot>"""
SDF = """<sdf version="1.9"><model name="one"><link name="a"><inertial><mass>0.3</mass>
  <inertia><izz>0.3</izz></inertia></inertial></link>
  <joint name="q" type="{type}"><parent>world</parent><child>a</child><axis><xyz>0 0 1</xyz>
    <dynamics><friction>0.4</friction></dynamics></axis></joint></model></sdf>"""
MJCF = """<mujoco><worldbody><body name="a"><inertial pos="0 0 0" mass="0.3" diaginertia="1 1 0.3"/>
  <joint name="q" type="{type}" frictionloss="0.4"/></body></worldbody></mujoco>"""
TURNED = [("urdf", URDF, "continuous"), ("sdf", SDF, "revolute"), ("xml", MJCF, "hinge")]
SLID = [("urdf", URDF, "prismatic"), ("sdf", SDF, "prismatic"), ("xml", MJCF, "slide")]


def imported(tmp_path, text, suffix="xml", **options):
    path = tmp_path / f"one.{suffix}"
    path.write_text(text)
    return dap.import_model(path, **options)


@pytest.mark.parametrize(("suffix", "text", "type"), TURNED + SLID)
def test_dry_friction_stops_a_joint(tmp_path, suffix, text, type):
    """At t = I w / n, after I w^2 / (2 n), where it sticks: to the tolerance of the run."""
    scene, report = imported(tmp_path, text.format(type=type), suffix, rates={"q": RATE})
    assert not [one for one in report.left_out if "friction" in one.text]
    assert not any("friction" in one.text for one in report.translated)
    scene.forces.pop("gravity", None)
    result = dap.simulate(scene, t_end=2.0, dt=0.5, rtol=1e-10, atol=1e-12)
    turned = 2.0 * np.arctan2(result.p[:, 0, 3], result.p[:, 0, 0])
    q = result.r[:, 0, 2] if type in ("prismatic", "slide") else turned
    assert q[1] == pytest.approx(0.5 * (RATE - 0.25 * FRICTION / INERTIA), abs=1e-9)
    assert q[-1] == pytest.approx(0.5 * INERTIA * RATE**2 / FRICTION, abs=1e-9)


BALL = """<mujoco><option gravity="0 0 0"/><worldbody><body name="a" quat="0.8 0 0.6 0">
  <inertial pos="0 0 0" mass="1" diaginertia="0.3 0.3 0.3"/>
  <joint name="q" type="ball" stiffness="3" damping="0.4" {more}/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("text", "left_out"),
    [
        (MJCF.format(type="hinge").replace('frictionloss="0.4"', 'frictionloss="-0.4"'),
         {"friction below 0, which would drive"}),
        (BALL.format(more='frictionloss="1" armature="2" range="0 1" limited="true"'),
         {f"{what} of a ball joint" for what in ("friction", "armature")}),
        (BALL.replace("ball", "free").replace("stiffness", "frictionloss").format(more=""),
         {"friction of a free joint"}),
    ],
    ids=["hinge", "ball", "free"],
)  # fmt: skip
def test_what_a_joint_cannot_have_is_left_out_by_name(tmp_path, text, left_out):
    scene, report = imported(tmp_path, text)
    assert {one.text for one in report.left_out} == left_out
    assert not any("friction" in force.type for force in scene.forces.values())


def test_the_spring_of_a_ball_is_at_rest_where_the_file_draws_it(tmp_path):
    """J phi'' + c phi' + k phi = 0 about an axis in the axes of the file."""
    turn, axis = 0.7, np.array([1.0, 2.0, -2.0]) / 3.0
    start = (np.cos(turn / 2), *(np.sin(turn / 2) * axis))
    scene, report = imported(tmp_path, BALL.format(more=""), positions={"q": start})
    assert not report.left_out
    result = dap.simulate(scene, t_end=0.5, dt=0.5, rtol=1e-10, atol=1e-12)
    decay = 0.4 / 0.6
    w = np.sqrt(10.0 - decay**2)
    rate = -turn * np.exp(-decay * 0.5) * 10.0 / w * np.sin(w * 0.5)
    drawn = np.array([[0.28, 0, 0.96], [0, 1, 0], [-0.96, 0, 0.28]])
    np.testing.assert_allclose(result.w[-1, 0], rate * drawn @ axis, rtol=0, atol=1e-9)


UNIVERSAL = """<sdf version="1.9"><model name="u"><link name="a"><inertial><mass>1</mass>
  <inertia><ixx>0.3</ixx><iyy>0.3</iyy><izz>0.3</izz></inertia></inertial></link>
  <joint name="q" type="universal"><parent>{parent}</parent><child>{child}</child>
    <axis><xyz>0 0.6 0.8</xyz><dynamics><damping>0.2</damping><friction>0.7</friction>
      <spring_stiffness>3</spring_stiffness><spring_reference>0.1</spring_reference></dynamics></axis>
    <axis2><xyz>1 0 0</xyz><dynamics><damping>0.5</damping><friction>0.4</friction>
      <spring_stiffness>2</spring_stiffness><spring_reference>-0.3</spring_reference></dynamics></axis2>
  </joint></model></sdf>"""


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_both_angles_of_a_universal_joint_have_springs_and_friction(tmp_path, way):
    """J w_dot . u_k = -k (q_k - rest) - c q_k' - n sign(q_k') on the axes, of three equal moments.
    The reaction of the joint is across both axes. With the link as the parent the angles are those
    of ground against it."""
    q, rate = np.array([0.9, -0.6]), np.array([1.3, -0.8])
    first, second = np.array([0.0, 0.6, 0.8]), np.array([1.0, 0.0, 0.0])
    parent, child = ("world", "a") if way > 0.0 else ("a", "world")
    scene, report = imported(tmp_path, UNIVERSAL.format(parent=parent, child=child), "sdf")
    assert not report.left_out
    scene.forces.pop("gravity", None)
    turn = Rotation.from_rotvec(q[0] * first) * Rotation.from_rotvec(q[1] * second)
    axes = np.array([first, Rotation.from_rotvec(q[0] * first).apply(second)])  # in the parent
    A = turn if way > 0.0 else turn.inv()
    axes = axes if way > 0.0 else A.apply(axes)  # in global axes
    p, w = A.as_quat()[[3, 0, 1, 2]], way * rate @ axes
    body = scene.bodies["a"]
    body.p, body.w = tuple(p), tuple(w)
    w_dot = dap.simulate(scene, t_end=0.0).wd[0, 0]
    force = -np.array([3.0, 2.0]) * (q - [0.1, -0.3]) - [0.2, 0.5] * rate
    force -= [0.7, 0.4] * np.sign(rate)
    np.testing.assert_allclose(way * 0.3 * axes @ w_dot, force, rtol=0, atol=1e-12)
