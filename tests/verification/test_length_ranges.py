"""Muscles without lengthrange against MuJoCo, which finds it by simulation."""

import numpy as np
import pytest

import dap3d_core as dap

MODEL = """<mujoco><compiler angle="radian"/><worldbody><site name="hook" pos="0.05 0 0.1"/>
<body pos="0 0 0"><joint name="p" axis="0 1 0" range="-0.6 0.9" limited="{limited}" damping="1"/>
<geom size="0.05" pos="0.3 0 0"/><geom name="ball" type="cylinder" size="0.04 0.1" euler="1.57 0 0"
contype="0"/><site name="mid" pos="0.2 0 0.06"/>
<body pos="0.4 0 0"><joint name="q" axis="0 1 0" range="-0.4 1.1" damping="1"/>
<geom size="0.04" pos="0.2 0 0"/><site name="end" pos="0.15 0 0.05"/></body></body></worldbody>
<tendon><spatial name="t" {tendon}><site site="hook"/><geom geom="ball"/><site site="mid"/>
<site site="end"/></spatial></tendon>
<actuator><muscle tendon="t" force="30" gear="{gear}"/></actuator></mujoco>"""


def muscle_of(path):
    """The muscle's fields in the scene, and what is left out of the motion."""
    scene, report = dap.import_model(path, contacts=True)
    left = [one.text for one in report.left_out if one.motion]
    return [f.fields for f in scene.forces.values() if f.fields.get("activation")], left


@pytest.mark.parametrize(("tendon", "gear"), [("", 1.0), ("", -2.0),
                                              ('range="0.45 0.55"', 1.0)])  # fmt: skip
def test_nearest_ends_are_those_of_a_simulation(tmp_path, tendon, gear):
    """Within the tolerance of MuJoCo, 5 % of the range; its limits yield."""
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "a.xml"
    path.write_text(MODEL.format(limited="true", tendon=tendon, gear=gear))
    ((muscle,), left) = muscle_of(path)
    assert not left
    low, high = mujoco.MjModel.from_xml_path(str(path)).actuator_lengthrange[0]
    optimum, sinew = gear * muscle["optimum"], gear * muscle["sinew"]
    found = sinew + 0.75 * optimum, sinew + 1.05 * optimum
    np.testing.assert_allclose(found, (low, high), rtol=0, atol=0.05 * (high - low))


def test_of_joints_without_limits_it_is_left_out(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(MODEL.format(limited="false", tendon="", gear=1.0))
    muscles, left = muscle_of(path)
    assert not muscles
    assert any("give lengthrange" in text for text in left)
