"""Joints that turn together: couplings and rotors, by closed forms."""

import numpy as np
import pytest
from support.plain import long_in_plain_python
from support.process import REPOSITORY

import dap3d_core as dap

#: Moments of inertia of two wheels, the armature of the second, and the moment on the first.
I_1, I_2, ARMATURE, MOMENT = 0.3, 0.5, 0.2, 1.5

URDF = """
<robot name="two"><link name="world"/>
  <link name="a"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="0.3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="b"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="0.5" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="one" type="continuous"><parent link="world"/><child link="a"/><axis xyz="0 0 1"/>
    <mimic joint="two" multiplier="2"/></joint>
  <joint name="two" type="continuous"><parent link="world"/><child link="b"/>
    <origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>
</robot>
"""
SDF = """
<sdf version="1.9"><model name="two">
  <link name="a"><inertial><mass>1</mass><inertia><izz>0.3</izz></inertia></inertial></link>
  <link name="b"><pose>1 0 0 0 0 0</pose>
    <inertial><mass>1</mass><inertia><izz>0.5</izz></inertia></inertial></link>
  <joint name="one" type="revolute"><parent>world</parent><child>a</child>
    <axis><xyz>0 0 1</xyz>{mimic}</axis></joint>
  <joint name="two" type="revolute"><parent>world</parent><child>b</child>
    <axis><xyz>0 0 {sign}1</xyz></axis></joint>
  {gearbox}
</model></sdf>
"""
MIMIC = '<mimic joint="two" axis="axis"><multiplier>2</multiplier></mimic>'
# theta of the child about axis2 = -ratio theta of the parent about axis, each against the reference
# body (sdformat.org/spec, joint, gearbox_ratio)
GEARBOX = """<joint name="g" type="gearbox"><parent>b</parent><child>a</child>
  <gearbox_ratio>2</gearbox_ratio><gearbox_reference_body>world</gearbox_reference_body>
  <axis><xyz>0 0 1</xyz></axis><axis2><xyz>0 0 -1</xyz></axis2></joint>"""
MJCF = """
<mujoco model="two"><worldbody>
  <body name="a"><joint name="one" axis="0 0 1"/>
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 0.3"/></body>
  <body name="b" pos="1 0 0"><joint name="two" axis="0 0 1" armature="{armature}"/>
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 0.5"/></body>
</worldbody>{more}</mujoco>
"""
EQUALITY = '<equality><joint joint1="one" joint2="two" polycoef="0 2 0 0 0"/></equality>'
TENDON = """<tendon><fixed name="t">
  <joint joint="one" coef="-1"/><joint joint="two" coef="2"/></fixed></tendon>
<equality><tendon tendon1="t"/></equality>"""


@long_in_plain_python
@pytest.mark.parametrize(
    ("suffix", "text", "armature"),
    [
        (".urdf", URDF, 0.0),
        (".sdf", SDF.format(mimic=MIMIC, sign="", gearbox=""), 0.0),
        (".sdf", SDF.format(mimic="", sign="", gearbox=GEARBOX), 0.0),
        (".xml", MJCF.format(armature=0.0, more=EQUALITY), 0.0),
        (".xml", MJCF.format(armature=ARMATURE, more=EQUALITY), ARMATURE),
        (".xml", MJCF.format(armature=0.0, more=TENDON), 0.0),
    ],
    ids=["mimic", "sdf-mimic", "gearbox", "equality", "armature", "tendon"],
)
def test_coupled_joints_share_their_inertia(tmp_path, suffix, text, armature):
    """q_1 = 2 q_2, a moment on the first: (4 I_1 + I_2 + wheel) q_2'' = 2 moment.
    The wheel between them has the armature, or a millionth of the least inertia."""
    path = tmp_path / f"two{suffix}"
    path.write_text(text)
    scene, report = dap.import_model(path)
    assert not [one for one in report.left_out if "coupl" in one.text or "tendon" in one.text]
    scene.add_force("n", "push", body_i="a", n=(0.0, 0.0, MOMENT))
    result = dap.simulate(scene, t_end=1.0, dt=0.5, rtol=1e-10, atol=1e-12)
    expected = MOMENT / (4.0 * I_1 + I_2 + (armature or 1e-6 * I_1)) * result.t**2
    for name, ratio in (("a", 2.0), ("b", 1.0)):
        angle = 2.0 * np.arctan2(*result.p[:, list(scene.bodies).index(name), [3, 0]].T)
        np.testing.assert_allclose(angle, ratio * expected, rtol=1e-8, atol=1e-9)


@pytest.mark.slow
def test_all_methods_find_the_reactions_of_coupled_joints():
    """The wheel is not so light that rows of both followers are taken for one."""
    scene, _ = dap.import_model(REPOSITORY / "models" / "robots" / "gripper.urdf")
    forces = [
        dap.simulate(scene, method=method, t_end=0.0).reaction("close")["i"].force
        for method in ("standard", "lsq", "joint")
    ]
    assert np.linalg.norm(forces[0]) > 0.9
    np.testing.assert_allclose(forces[1:], forces[:1] * 2, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize(
    ("leader", "said"), [("twoo", r"'twoo'.*\n.*mean 'two'"), ("one", "'one'")]
)
def test_a_joint_follows_another_one_of_the_file(tmp_path, leader, said):
    path = tmp_path / "two.urdf"
    path.write_text(URDF.replace('mimic joint="two"', f'mimic joint="{leader}"'))
    with pytest.raises(dap.SceneError, match=f":8: 'one' follows {said}"):
        dap.import_model(path)


def test_a_screw_is_imported(tmp_path):
    text = SDF.format(mimic="", sign="", gearbox="").replace(
        '"one" type="revolute"', '"one" type="screw"'
    )
    path = tmp_path / "a.sdf"
    path.write_text(text)
    assert dap.import_model(path)[0].joints["one"].type == "screw"
