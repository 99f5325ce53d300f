"""Names of files that a scene cannot have."""

import numpy as np

import dap3d_core as dap

LINK = """<link name="{}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
<visual><geometry><box size="1 1 1"/></geometry></visual></link>"""


def test_names_with_control_characters_and_dots_are_replaced(tmp_path):
    """Of bodies, joints and shapes; two that become the same are numbered."""
    joint = '<joint name="a.b" type="floating"><parent link="x.&#x97;"/><child link="x._"/></joint>'
    text = f'<robot name="r">{LINK.format("x.&#x97;")}{LINK.format("x._")}{joint}</robot>'
    (tmp_path / "a.urdf").write_text(text)
    scene, report = dap.import_model(tmp_path / "a.urdf", free_base=True)
    assert list(scene.bodies) == ["x__", "x___2"]
    assert list(scene.shapes) == ["x___box", "x___box_2"]
    assert any("'x.\\x97' is called 'x__'" in one.text for one in report.translated)


def test_inputs_are_words_of_expressions(tmp_path):
    """Names of actuators that begin with a digit, or hold other characters."""
    (tmp_path / "a.xml").write_text(
        '<mujoco><worldbody><body><joint name="1a-b"/><geom size="1"/></body></worldbody>'
        '<actuator><motor name="1a-b" joint="1a-b"/></actuator></mujoco>'
    )
    scene, _ = dap.import_model(tmp_path / "a.xml")
    assert list(scene.inputs) == ["input_1a_b_input"]


def test_joints_without_a_name_take_none_of_the_file(tmp_path):
    """A name that comes later in the file, and that of an equality, which are other things."""
    (tmp_path / "a.xml").write_text(
        '<mujoco><worldbody><body><joint axis="1 0 0"/><geom size="1"/>'
        '<body pos="0 0 1"><joint name="joint1" axis="0 1 0"/><geom size="1"/></body></body>'
        '</worldbody><equality><connect name="joint1" body1="body1" anchor="0 0 -1"/></equality>'
        "</mujoco>"
    )
    scene, _ = dap.import_model(tmp_path / "a.xml")
    assert [joint.type for joint in scene.joints.values()] == ["rev", "rev", "sph"]
    later = scene.joints["joint1"].fields["a_i"]
    np.testing.assert_array_equal(np.eye(3)["xyz".index(later[-1])], [0, 1, 0])
