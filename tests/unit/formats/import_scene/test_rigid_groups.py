"""Inertia of links whose file says too little."""

import numpy as np
import pytest

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


@pytest.mark.parametrize(
    ("compiler", "options", "expected"),
    [
        ("", {}, (0.3, 0.4, 0.7)),
        ("", {"balance_inertia": True}, (0.4, 0.4, 0.4)),
        ('<mujoco><compiler balanceinertia="true"/></mujoco>', {}, (0.4, 0.4, 0.4)),
    ],
)
def test_moments_that_no_body_has(tmp_path, compiler, options, expected):
    """0.3 + 0.4 = 0.7: half of the lack of 0.2 each; or the mean, as asked for or in the file."""
    arm = LINK.format("arm", 1, 0.2, 0.3, 0.7, JOINT.format("arm", "base"))
    (tmp_path / "a.urdf").write_text(f'<robot name="r">{compiler}<link name="base"/>{arm}</robot>')
    scene, report = dap.import_model(tmp_path / "a.urdf", **options)
    np.testing.assert_allclose(scene.bodies["arm"].Jp, expected, rtol=1e-15)
    loud = [one.motion for one in report.translated if "principal moments" in one.text]
    assert loud == [True] * (not compiler)
