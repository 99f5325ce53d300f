"""Tendons and muscles of MJCF against MuJoCo, where it is installed.

Accelerations at random states: to 1e-10 of the largest, as the mass matrix has a condition of 1e3
and both round to 1e-16 of its terms. Inside wraps to 1e-6: MuJoCo ends its search at that angle.
Armature of sums to 1e-6, the inertia of wheels that add them up, beside that of what they move.
"""

import numpy as np
import pytest
from support.mujoco_models import Oracle

import dap3d_core as dap

pytest.importorskip("mujoco")

MODEL = """<mujoco><compiler angle="radian"/><worldbody><site name="hook" pos="-0.3 0.1 0.4"/>
<geom name="post" type="cylinder" size="0.08 0.3" pos="0 0.3 0.3" euler="0.4 0.2 0"/>
<body name="a"><joint name="p" axis="0 1 0.3" range="-1.5 2" ref="0.1"/>
  <geom name="ball" size="0.15" pos="0.4 0 0"/><site name="one" pos="0.1 0.3 0.3"/>
  <site name="out" pos="0.4 0.2 0.1"/><site name="in" pos="0.45 0 0"/>
  <body name="b" pos="0.8 0 0"><joint name="q" axis="0 1 0"/>
    <geom name="drum" type="cylinder" size="0.1 0.2" euler="1.5 0.2 0"/>
    <geom size="0.08" pos="0.3 0.1 0"/><site name="two" pos="0.2 0.1 0.25"/>
    <site name="round" pos="0 0.05 0.3"/>
    <body name="c" pos="0.4 0 0"><joint name="s" type="slide" axis="1 0 0.2" ref="-0.1"/>
      <geom size="0.06" pos="0.1 0 0.1"/><site name="end" pos="0.1 0.1 -0.2"/></body></body></body>
</worldbody><tendon>{tendons}</tendon><actuator>{actuators}</actuator></mujoco>"""
PATH = """<site site="hook"/><geom geom="post"/><site site="one"/><geom geom="ball"{side}/>
<site site="two"/><geom geom="drum"{other}/><site site="end"/>"""
SHORT = PATH.format(side="", other="")
ROUND = PATH.format(side=' sidesite="out"', other=' sidesite="round"')
INSIDE = PATH.format(side=' sidesite="in"', other="")
FIXED = '<joint joint="p" coef="0.7"/><joint joint="q" coef="-1.2"/><joint joint="s" coef="2"/>'
ONE = f'<spatial name="t">{SHORT}</spatial>'
BOTH = f'{ONE}<fixed name="f">{FIXED}</fixed>'
MUSCLE = 'lengthrange="0.8 2.6" force="30" timeconst="0.02 0.05"'
PRM = "0.7 1.1 40 200 0.5 1.6 1.5 1.3 1.2"
CASES = {
    "short": (f'<spatial stiffness="40" damping="2" springlength="0.9">{SHORT}</spatial>', ""),
    "round": (f'<spatial stiffness="40" damping="2" springlength="0 1.2">{ROUND}</spatial>', ""),
    "inside": (f'<spatial stiffness="40" damping="2" springlength="0.9">{INSIDE}</spatial>', ""),
    "pulleys": ('<spatial stiffness="40" damping="2" springlength="0.3"><site site="hook"/><geom '
                'geom="post"/><site site="one"/><pulley divisor="2"/><site site="one"/><geom '
                'geom="ball"/><site site="two"/><pulley divisor="4"/><site site="one"/>'
                '<site site="end"/></spatial>', ""),
    "fixed": (f'<fixed stiffness="9" damping="2">{FIXED}</fixed><fixed stiffness="5" springlength='
              f'"-0.1 0.2">{FIXED}</fixed>', ""),
    "mass": ('<spatial armature="0.7" stiffness="3" springlength="0.9"><site site="hook"/><site '
             'site="one"/><site site="two"/><pulley divisor="2"/><site site="one"/>'
             '<site site="end"/></spatial><spatial armature="0.2"><site site="hook"/>'
             '<site site="two"/></spatial>', ""),
    "mass of a sum": (f'<fixed armature="0.4">{FIXED}</fixed><fixed armature="0.1"><joint '
                      'joint="q" coef="-2"/></fixed>', ""),
    "motor": (BOTH, '<motor tendon="t" gear="-3" ctrlrange="-0.5 0.5"/><motor tendon="f" gear="2" '
              'forcerange="-0.3 0.6"/>'),
    "servo": (BOTH, '<position tendon="t" kp="7" kv="0.4" gear="1.5"/><position tendon="f" kp="7" '
              'kv="0.4" gear="-1.5" forcerange="-1.2 0.9"/><velocity tendon="t" kv="2"/>'),
    "lag": (BOTH, '<general tendon="t" dyntype="filter" dynprm="0.3" gainprm="4" actrange="-0.2 '
            '0.5"/><intvelocity tendon="f" kp="5" kv="0.3" actrange="-0.4 0.4"/>'),
    "muscle": (BOTH, f'<muscle tendon="t" {MUSCLE} tausmooth="0.3"/><muscle tendon="f" gear="-2" '
               f'{MUSCLE} lmin="0.6" lmax="1.5"/><general joint="p" dyntype="muscle" gaintype='
               f'"muscle" biastype="muscle" gainprm="{PRM}" biasprm="{PRM}" gear="-1" '
               'lengthrange="-2 1.5" dynprm="0.03 0.06"/>'),
}  # fmt: skip


TOLERANCES = {"inside": 1e-6, "mass of a sum": 1e-6}


@pytest.mark.parametrize("which", CASES)
def test_accelerations(tmp_path, which):
    """Of springs, dampers, actuators and muscles of tendons; the least share of touching ways."""
    path = tmp_path / "a.xml"
    tendons, actuators = CASES[which]
    path.write_text(MODEL.format(tendons=tendons, actuators=actuators))
    oracle, rng = Oracle(path), np.random.default_rng(5)
    model, data = oracle.model, oracle.data
    rtol, moved, touched = TOLERANCES.get(which, 1e-10), 0.0, 0
    for _ in range(8):
        data.ctrl[:] = rng.uniform(-1.0, 1.0, model.nu)
        data.act[:] = rng.uniform(0.0, 0.4, model.na)
        scene = oracle.scene(path, rng)
        touched += (data.wrap_obj[: data.ten_wrapnum.sum()] >= 0).sum() // 2
        largest = max(1.0, np.abs(data.qacc).max())
        oracle.check_accelerations(scene, "abc", rtol * largest)
        moved = max(moved, largest)
    assert moved > 1.0
    assert touched > 4 or "geom" not in tendons


def test_a_muscle_without_lengthrange(tmp_path):
    """Of a sum of joints by their limits; MuJoCo finds it within 5 % of the range (tolrange)."""
    import mujoco

    path = tmp_path / "a.xml"
    joints = MODEL.replace('axis="0 1 0"', 'axis="0 1 0" range="0.1 0.9" damping="1"')
    path.write_text(joints.format(
        tendons='<fixed name="f"><joint joint="p" coef="0.7"/>'
        '<joint joint="q" coef="-1.2"/></fixed>',
        actuators='<muscle tendon="f" gear="2" force="30"/>',
    ))  # fmt: skip
    scene, report = dap.import_model(path)
    assert not [one for one in report.left_out if one.motion]
    low, high = mujoco.MjModel.from_xml_path(str(path)).actuator_lengthrange[0]
    (muscle,) = (f.fields for f in scene.forces.values() if f.fields.get("activation") == "muscle")
    optimum, sinew = 2.0 * muscle["optimum"], 2.0 * muscle["sinew"]
    found = sinew + 0.75 * optimum, sinew + 1.05 * optimum
    np.testing.assert_allclose(found, (low, high), rtol=0, atol=0.05 * (high - low))
    ends = 0.7 * -1.5 - 1.2 * 0.9, 0.7 * 2.0 - 1.2 * 0.1
    np.testing.assert_allclose(found, 2.0 * np.array(ends), rtol=0, atol=1e-12)
