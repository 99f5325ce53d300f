"""Inertia of links whose file says too little."""

import numpy as np

import dap3d_core as dap

LINK = '<link name="{}"><inertial><mass value="{}"/><inertia ixx="{}" iyy="{}" izz="{}"/>{}'
JOINT = (
    '</inertial></link><joint name="{0}" type="continuous"><parent link="{1}"/><child link="{0}"/>'
    '<axis xyz="0 1 0"/></joint>'
)


def test_a_moment_of_zero_is_a_part_of_the_others_also_before_a_link_without_inertia(tmp_path):
    """1e-11 of the largest of the link: far above rounding, below what can be seen."""
    arm = LINK.format("arm", 1, 0, 3e-3, 3e-3, JOINT.format("arm", "base"))
    tip = LINK.format("tip", 0.1, 0, 0, 0, JOINT.format("tip", "arm"))
    (tmp_path / "a.urdf").write_text(f'<robot name="r"><link name="base"/>{arm}{tip}</robot>')
    scene, report = dap.import_model(tmp_path / "a.urdf")
    np.testing.assert_allclose(scene.bodies["arm"].Jp, (3e-14, 3e-3, 3e-3), rtol=1e-9)
    assert any("moment of inertia of 0" in one.text for one in report.translated)
    assert dap.simulate(scene, t_end=0.01).r.shape[1] == 2
