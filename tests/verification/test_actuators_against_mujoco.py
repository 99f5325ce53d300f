"""Actuators of MJCF within their bounds, against MuJoCo, where it is installed.

Accelerations at random states with controls in and beyond their ranges: to 1e-10 of the largest, as
the mass matrix has a condition of 1e3 and both round to 1e-16 of its terms.
"""

import numpy as np
import pytest
from support.mujoco_models import Oracle

import dap3d_core as dap

pytest.importorskip("mujoco")

MODEL = """<mujoco><compiler angle="radian"/><default><motor ctrlrange="-0.5 0.8"/></default>
<worldbody><body name="a" gravcomp="1"><joint name="p" axis="0 1 0.3" range="-1.5 2" {limit}/>
  <geom size="0.1" pos="0.4 0 0"/><body name="b" pos="0.8 0 0"><joint name="q" axis="0 1 0"
  ref="0.3" damping="0.2" stiffness="1.5"/><geom size="0.08" pos="0.2 0.1 0"/><geom size="0.05"
  pos="0 0.2 0"/><site name="jet" pos="0.3 0.1 0" euler="0.4 0.2 0.7"/>
  <body name="c" pos="0.4 0 0" gravcomp="0.4"><joint name="s" type="slide" axis="1 0 0.2"
  ref="-0.1"/><geom size="0.06" pos="0.1 0 0.1"/></body></body></body>
<body name="f" pos="3 0 0"><freejoint name="fly"/><geom size="0.1 0.2 0.1"
  type="box"/><site name="rotor" pos="0.1 0 0.1" euler="0 0.3 0"/></body></worldbody>
<tendon><fixed name="both"><joint joint="p" coef="0.7"/><joint joint="q" coef="-1.2"/></fixed>
  <fixed name="one"><joint joint="q" coef="0.6"/></fixed></tendon>
<actuator>{actuators}</actuator></mujoco>"""
ACTUATORS = {
    "motor": '<motor joint="p" gear="-3"/><motor joint="s" gear="2" forcerange="-0.3 0.6"/>',
    "servo": '<position joint="q" kp="7" kv="0.4" gear="1.5" ctrlrange="-0.2 0.6"/>',
    "servo of bounded force": '<position joint="q" kp="7" kv="0.4" gear="-1.5"'
    ' forcerange="-1.2 0.9"/><velocity joint="s" kv="3" forcerange="-0.7 1"/>',
    "general": '<general joint="p" gear="2" gainprm="3" biastype="affine" biasprm="0.4 -5 -0.2"'
    ' ctrlrange="-0.1 0.1"/><general joint="s" biastype="affine" biasprm="0.6 0 -1"/>',
    "lag": '<general joint="p" dyntype="filter" dynprm="0.3" gainprm="4" actrange="-0.2 0.5"/>'
    '<position joint="s" kp="9" timeconst="0.1" forcerange="-2 1"/>'
    '<cylinder joint="q" timeconst="0.2" area="3" bias="0.1 -0.2 -0.3"/>',
    "integral": '<general joint="p" dyntype="integrator" gainprm="4" ctrlrange="-0.3 0.3"/>'
    '<intvelocity joint="s" kp="5" kv="0.3" actrange="-0.4 0.4"/>',
    "inherited": '<position joint="p" kp="3" inheritrange="0.2"/>',
    "tendon": '<motor tendon="both" gear="2"/><position tendon="one" kp="6" kv="0.2" gear="1.4"'
    ' ctrlrange="-0.1 0.2"/>',
    "site": '<motor site="jet" gear="1 2 -0.5 0.3 -0.2 0.4" ctrlrange="0 0.4"/>'
    '<motor site="rotor" gear="0 0 3 0 0 0.1" ctrllimited="false"/>',
    "joint": '<motor joint="p" gear="-3" ctrllimited="false"/>',
}


@pytest.mark.parametrize("which", ACTUATORS)
def test_forces_within_bounds(tmp_path, which):
    """Accelerations, and the rates of activations."""
    limit = 'actuatorfrcrange="-1 0.7"' if which == "joint" else ""
    path = tmp_path / "a.xml"
    path.write_text(MODEL.format(actuators=ACTUATORS[which], limit=limit))
    oracle, rng = Oracle(path), np.random.default_rng(5)
    model, data = oracle.model, oracle.data
    for scale in (0.1, 1.0, 3.0):
        data.ctrl[:] = scale * rng.uniform(-1.0, 1.0, model.nu)
        ranges = np.where(model.actuator_actlimited[:, None], model.actuator_actrange, 0.3)
        data.act[:] = rng.uniform(-1.0, 1.0, model.na) * ranges[model.actuator_actadr >= 0][:, 1]
        scene = oracle.scene(path, rng)
        oracle.check_accelerations(scene, "abcf", 1e-10 * max(1.0, np.abs(data.qacc).max()))


def test_activation_follows_its_control(tmp_path):
    """A lag of 0.3 s and an integral, within bounds, over a second of a constant control.

    MuJoCo by its own step of 1e-4 s, of first order in the integral: to 1e-4 of the forces.
    """
    path = tmp_path / "a.xml"
    path.write_text(MODEL.format(limit="", actuators=ACTUATORS["lag"] + ACTUATORS["integral"]))
    oracle = Oracle(path)
    scene, _ = dap.import_model(path, limits="off")
    controls = (0.7, 0.3, -0.4, 0.6, 0.9)
    for value, one in zip(controls, scene.inputs.values(), strict=True):
        one.value = value
    oracle.model.opt.timestep = 1e-4
    oracle.data.ctrl[:] = controls
    for _ in range(10_000):
        oracle.mujoco.mj_step(oracle.model, oracle.data)
    result = dap.simulate(scene, t_end=1.0, dt=0.5)
    names = [n for n, f in scene.forces.items() if f.fields.get("activation")]
    states = [result.quantity(f"{name}.z").values[-1] for name in names]
    np.testing.assert_allclose(states, oracle.data.act, rtol=0, atol=1e-4)


TENDON = """<mujoco><default><tendon stiffness="40"/></default><worldbody>
  <site name="hook" pos="0.2 0 2"/><body name="a" pos="0 0 1"><freejoint name="fly"/>
  <geom type="box" size="0.1 0.2 0.15" pos="0.05 0 0"/><site name="eye" pos="0.1 0.1 0.1"/></body>
  <body name="b" pos="1 0 1"><joint name="b" axis="0 1 0" springref="40"/>
  <geom name="ball" size="0.1" pos="0.3 0 0"/><site name="end" pos="0.4 0 0.1"/>
  <site name="at" pos="0.4 0 0.1"/><site name="there" pos="0.4 0 0.1"/></body></worldbody>
  <tendon>
  <spatial damping="2"><site site="hook"/><site site="eye"/></spatial>
  <spatial stiffness="15" springlength="0.3"><site site="end"/><site site="eye"/></spatial>
  <spatial name="bent" stiffness="9" damping="3"><site site="hook"/><site site="end"/>
  <site site="eye"/></spatial>
  <spatial><site site="hook"/><site site="end"/><geom geom="ball"/><site site="at"/>
  <site site="there"/><site site="eye"/></spatial>
  </tendon></mujoco>"""


def test_tendons_over_sites_are_springs_and_dampers(tmp_path):
    """Of their class, at rest where springs of joints are or at a length.

    Between two sites in the same place one passes nothing, as in MuJoCo.
    """
    path, rng = tmp_path / "a.xml", np.random.default_rng(6)
    path.write_text(TENDON)
    oracle = Oracle(path)
    for _ in range(3):
        scene = oracle.scene(path, rng)
        oracle.check_accelerations(scene, "ab", 1e-10 * np.abs(oracle.data.qacc).max())


@pytest.mark.parametrize("engine", ["events", "stepping"])
def test_a_tendon_at_its_limit_holds(tmp_path, engine):
    """A body hangs by a point beside its centre: accelerations as of MuJoCo's hard limit.

    Extrapolated from impedances of 2e-4 and 1e-4 to 1e-7; a step of 1e-6 s is off by its length.
    """
    from support.hard_mujoco import HardOracle

    path = tmp_path / "a.xml"
    path.write_text("""<mujoco><worldbody><site name="hook" pos="0 0 2"/>
      <body name="a" pos="0 0 1.5"><freejoint/>
      <geom type="box" size="0.1 0.2 0.15" pos="0.3 0 0"/><site name="eye"/></body></worldbody>
      <tendon><spatial name="rope" range="0 0.5"><site site="hook"/><site site="eye"/></spatial>
      </tendon></mujoco>""")
    oracle = HardOracle(path)
    oracle.data.qpos[2] -= 1e-9  # touches from where it is beyond its limit
    oracle.settle(0.0, None)
    ((_, (_, expected)),) = oracle.accelerations()
    scene, report = dap.import_model(path, contacts=engine == "stepping")
    assert scene.forces["rope_max_stop"].type == "ptp_stop"
    assert not [one for one in report.left_out if one.motion]
    k = list(scene.bodies).index("a")
    result = dap.simulate(scene, t_end=1e-6, dt=1e-6, contact_step=1e-6, contact=engine)
    found = np.hstack([result.rd[-1] - result.rd[0], result.w[-1] - result.w[0]])[k] / 1e-6
    assert abs(expected[2]) > 1.0
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-5)


FREE = """<mujoco><worldbody><body name="a"><joint name="fly" type="free" damping="0.7"
  armature="0.3"/><geom type="box" size="0.1 0.2 0.15" pos="0.2 0.1 0"/></body></worldbody></mujoco>
"""


def test_damping_and_armature_of_a_free_joint(tmp_path):
    """A damper against the motion of its frame; mass and inertia there, without weight."""
    path, rng = tmp_path / "a.xml", np.random.default_rng(2)
    path.write_text(FREE)
    oracle = Oracle(path)
    for _ in range(3):
        positions, rates = oracle.randomise(rng)
        scene, report = dap.import_model(path, positions=positions, rates=rates)
        result = dap.simulate(scene, t_end=0.0)
        found = np.concatenate([result.rdd[0, 0], result.wd[0, 0]])
        expected = oracle.acceleration(1, result.r[0, 0])
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
        assert not report.left_out
