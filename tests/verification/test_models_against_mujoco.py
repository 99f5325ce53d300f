"""Imported models against MuJoCo, where it is installed: masses, kinematics, accelerations.

``benchmarks/imported_models.py FOLDER`` does the same for all models in a folder.
"""

import numpy as np
import pytest
from support.internals import rotation
from support.mujoco_models import Oracle
from support.process import REPOSITORY

import dap3d_core as dap

pytest.importorskip("mujoco")
DATA = REPOSITORY / "tests" / "data" / "formats"
FIXED = '<mujoco><compiler fusestatic="true" discardvisual="true"/></mujoco>'


@pytest.fixture(params=["arm.urdf", "hand.xml", "parallelogram.xml"])
def pair(request, tmp_path):
    """A model in MuJoCo, and the file."""
    text = (DATA / request.param).read_text()
    path = tmp_path / request.param
    path.write_text(text.replace("</robot>", f"{FIXED}</robot>"))
    return Oracle(path), DATA / request.param


def bodies_of(oracle, scene):
    """The bodies that both have, with their numbers in MuJoCo."""
    named = ((b, oracle.name("mjOBJ_BODY", b)) for b in range(1, oracle.model.nbody))
    return [(b, name) for b, name in named if name in scene.bodies]


def body_accelerations(scene):
    """Accelerations of the mass centre and angular accelerations, (bodies, 6), where it starts."""
    bodies = list(scene.bodies.values())
    pose = np.concatenate([[*b.r, *b.p] for b in bodies])
    rate = np.concatenate([[*b.r_dot, *b.w] for b in bodies])
    rhs = dap.compile(scene).rhs(0.0, np.concatenate([pose, rate]))
    return rhs[7 * len(bodies) :].reshape(-1, 6)


def test_masses_and_kinematics(pair):
    """100 random poses to 1e-12; MuJoCo finds principal axes to 1e-12."""
    oracle, path = pair
    rng = np.random.default_rng(1)
    for _ in range(100):
        positions, rates = oracle.randomise(rng)
        scene, _ = dap.import_model(path, positions=positions, rates=rates, limits="off")
        assert bodies_of(oracle, scene)
        for b, name in bodies_of(oracle, scene):
            body, (mass, com, J) = scene.bodies[name], oracle.group(b)
            given = np.diag(body.Jp) if np.ndim(body.Jp) == 1 else np.array(body.Jp)
            assert abs(body.mass - mass) <= 1e-12 * mass
            np.testing.assert_allclose(given, J, rtol=0, atol=1e-12 * np.abs(J).max())
            np.testing.assert_allclose(body.r, com, rtol=0, atol=1e-12)
            A = oracle.data.xmat[b].reshape(3, 3)
            np.testing.assert_allclose(rotation(np.array(body.p)), A, rtol=0, atol=1e-12)


def test_accelerations(pair):
    """At random states, with gravity, springs, dampers and armature; 1e-9 of the largest rate.

    The hand has a compound joint, whose link without mass has 1e-8 of what it carries.
    """
    oracle, path = pair
    rng = np.random.default_rng(2)
    for _ in range(5):
        positions, rates = oracle.randomise(rng)
        scene, _ = dap.import_model(path, positions=positions, rates=rates, limits="off")
        for name in [n for n, e in scene.joints.items() if e.type == "sph" and n == "close"]:
            del scene.joints[name]  # MuJoCo's equalities are soft
        v_dot = body_accelerations(scene)
        scale = max(1.0, np.abs(oracle.data.qacc).max())
        places = {name: k for k, name in enumerate(scene.bodies)}
        for b, name in bodies_of(oracle, scene):
            expected = oracle.acceleration(b, oracle.group(b)[1])
            np.testing.assert_allclose(v_dot[places[name]], expected, rtol=0, atol=1e-9 * scale)


FOLLOWING = """<mujoco><compiler angle="{angle}"/><worldbody>
  <body name="a"><joint name="p" axis="0 0 1" ref="{ref}"/><geom size="0.1" pos="1 0 0"/></body>
  <body name="b"><joint name="q" type="slide" axis="0 1 0" ref="0.2"/><geom size="0.1"/></body>
  <body name="c"><joint name="r" axis="1 0 0"/><geom size="0.1" pos="0 1 0"/></body>
  </worldbody><equality><joint joint1="q" joint2="p" polycoef="{a0} {a1} 0 0 0"/>
  <joint joint1="r" joint2="q" polycoef="0.1 -3 0 0 0"/></equality></mujoco>"""


@pytest.mark.parametrize(("a0", "a1"), [(0.0, 1.0), (0.05, -0.4), (-0.3, 2.0)])
@pytest.mark.parametrize(("angle", "ref"), [("degree", 40.0), ("radian", -0.7)])
@pytest.mark.parametrize(("joint", "value"), [("p", 0.9), ("q", -0.35), ("r", 1.2)])
def test_a_start_by_qpos_fulfils_the_equalities(tmp_path, a0, a1, angle, ref, joint, value):
    """MuJoCo finds its equalities fulfilled where the scene starts, with the qpos that is given."""
    import mujoco

    path = tmp_path / "a.xml"
    path.write_text(FOLLOWING.format(a0=a0, a1=a1, angle=angle, ref=ref))
    scene, _ = dap.import_model(path, positions={joint: value})
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    turned = [rotation(np.array(scene.bodies[name].p)) for name in "ac"]
    data.qpos[0] = model.qpos0[0] + np.arctan2(turned[0][1, 0], turned[0][0, 0])
    data.qpos[1] = model.qpos0[1] + scene.bodies["b"].r[1]
    data.qpos[2] = np.arctan2(turned[1][2, 1], turned[1][1, 1])
    # angles are known but for whole turns
    assert np.exp(1j * data.qpos["pqr".index(joint)]) == pytest.approx(
        np.exp(1j * value), abs=1e-12
    )
    q = data.qpos[1] - 0.2
    p = (q - a0) / a1
    assert np.exp(1j * (data.qpos[0] - model.qpos0[0])) == pytest.approx(np.exp(1j * p), abs=1e-12)
    data.qpos[:] = model.qpos0[0] + p, 0.2 + q, 0.1 - 3.0 * q
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.efc_pos[: model.neq], 0.0, rtol=0, atol=1e-14)
    for name in "abc":
        at = data.xipos[model.body(name).id]
        np.testing.assert_allclose(scene.bodies[name].r, at, rtol=0, atol=1e-12)


LIGHT = """<mujoco><worldbody><body name="cup"><joint name="x" type="slide" axis="1 0 0" {x}/>
  <joint name="y" axis="0 1 1" pos="0.1 0.2 0"/><joint name="z" type="slide" axis="0 0 1"/>
  <geom size=".02" mass="{mass}" pos="0.3 0 0"/><body name="in"><joint name="w" axis="1 1 0"/>
  <geom size=".01" mass="{mass}" pos="0 0.1 0"/></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize("mass", [0.05, 1e-9, 3.0])
@pytest.mark.parametrize("x", ["", 'range="-1 2" damping="0.3"'])
def test_exported_light_links_are_read(tmp_path, mass, x):
    """Links without mass between joints are joints of one body; accelerations are the same."""
    import mujoco

    (tmp_path / "a.xml").write_text(LIGHT.format(mass=mass, x=x))
    scene, _ = dap.import_model(tmp_path / "a.xml")
    dap.export_model(scene, tmp_path / "b.xml", format="mjcf")
    found = []
    for name in ("a.xml", "b.xml"):
        model = mujoco.MjModel.from_xml_path(str(tmp_path / name))
        data = mujoco.MjData(model)
        data.qvel[:] = 0.3, -0.2, 0.1, 0.7
        mujoco.mj_forward(model, data)
        assert model.nbody == 3
        found.append(data.qacc.copy())
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9)


def test_exported_meshes_are_found_at_the_default_place(tmp_path, monkeypatch):
    """Next to the folder of the scene, in it, and elsewhere; also a flat one."""
    import mujoco

    (tmp_path / "part.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n")
    shapes = "".join(
        f'<visual><geometry><mesh filename="{name}.obj"/></geometry></visual>'
        for name in ("part", "flat")
    )
    (tmp_path / "r.urdf").write_text(f"""<robot name="r"><link name="base"/><link name="a">{shapes}
      <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
      <joint name="j" type="continuous"><parent link="base"/><child link="a"/></joint></robot>""")
    monkeypatch.chdir(tmp_path)
    scene, report = dap.import_model("r.urdf")
    report.save(scene, "m")
    (tmp_path / "x" / "y").mkdir(parents=True)
    for target in ("m.xml", "m/in.xml", "x/y/out.xml", str(tmp_path / "x" / "abs.xml")):
        dap.export_model("m", target, format="mjcf")
        assert mujoco.MjModel.from_xml_path(target).nmesh == 2


KEYED = """<mujoco><compiler angle="radian"/><worldbody>
  <body name="hand" mocap="true" pos="1 0 0"><geom size="0.1"/></body>
  <body name="a" pos="0 0 1"><freejoint/><geom type="box" size="0.1 0.2 0.3" pos="0.1 0 0"/>
    <body name="b"><joint name="b" type="ball"/><geom type="box" size="0.3 0.2 0.1" pos="0 0 0.2"/>
    </body><frame pos="0.2 0 0" euler="0 0 0.3"><body name="c"><joint name="c" ref="0.4"/>
    <joint name="s" type="slide" axis="1 0 0"/><geom size="0.1" pos="0 0.1 0"/></body></frame>
    </body></worldbody><actuator><position joint="c" kp="3"/><general joint="s" dyntype="filter"/>
  <motor joint="c"/></actuator><keyframe><key name="low" qpos="0 0 0.5 1 0 0 0 1 0 0 0 0 0"/>
  <key name="high" qpos="0.3 -0.2 2 0.6 0 0.8 0 0.8 0.6 0 0 -0.7 0.2" mpos="0 0 3" mquat="0 1 0 0"
  qvel="0.1 0.2 0.3 -0.4 0.5 0.6 1 -1 0.5 0.3 -0.2" act="0.6" ctrl="0.1 0.2 0.3"/></keyframe>
  </mujoco>"""


@pytest.mark.parametrize("key", ["low", "high"])
def test_a_keyframe_is_where_the_scene_starts(tmp_path, key):
    """Poses, velocities, controls and activations, and the accelerations with these."""
    path = tmp_path / "a.xml"
    path.write_text(KEYED)
    oracle = Oracle(path)
    oracle.mujoco.mj_resetDataKeyframe(oracle.model, oracle.data, oracle.model.key(key).id)
    oracle.mujoco.mj_forward(oracle.model, oracle.data)
    scene, report = dap.import_model(path, key=key)
    assert not report.left_out
    assert [one.value for one in scene.inputs.values()] == oracle.data.ctrl.tolist()
    result = dap.simulate(scene, t_end=0.0)
    for name in "abc":
        b, k = oracle.model.body(name).id, list(scene.bodies).index(name)
        velocity = np.zeros(6)
        oracle.mujoco.mj_objectVelocity(
            oracle.model, oracle.data, oracle.mujoco.mjtObj.mjOBJ_BODY, b, velocity, 0
        )
        np.testing.assert_allclose(result.r[0, k], oracle.data.xipos[b], rtol=0, atol=1e-14)
        np.testing.assert_allclose(result.w[0, k], velocity[:3], rtol=0, atol=1e-14)
        # the link between the two joints of c has 1e-11 of its mass
        size = np.abs(oracle.acceleration(b, oracle.group(b)[1])).max()
        oracle.check_accelerations(scene, name, 1e-9 * size)
    (hand,) = [one.fields["at"] for one in scene.shapes.values() if one.fields["body"] == "ground"]
    np.testing.assert_allclose(hand, oracle.data.xpos[oracle.model.body("hand").id], atol=1e-15)


@pytest.mark.parametrize(("key", "said"), [("middle", "it has low, high"), ("", "no keyframe ''")])
def test_a_keyframe_that_is_not_there_is_refused(tmp_path, key, said):
    (tmp_path / "a.xml").write_text(KEYED)
    with pytest.raises(dap.SceneError, match=said):
        dap.import_model(tmp_path / "a.xml", key=key)
    with pytest.raises(dap.SceneError, match="has no keyframes"):
        dap.import_model(DATA / "arm.urdf", key=key)


def test_motors_and_servos():
    """Inputs through gears, on sliders and a hinge with a spring; servos with gains and biases."""
    oracle = Oracle(DATA / "cart.xml")
    inputs = (1.3, -0.7, 2.1, 0.4, -0.9)
    positions, rates = oracle.randomise(np.random.default_rng(3))
    oracle.data.ctrl[:] = inputs
    oracle.mujoco.mj_forward(oracle.model, oracle.data)
    scene, _ = dap.import_model(DATA / "cart.xml", positions=positions, rates=rates)
    for value, one in zip(inputs, scene.inputs.values(), strict=True):
        one.value = value
    v_dot = body_accelerations(scene)
    for k, (b, _) in enumerate(bodies_of(oracle, scene)):
        expected = oracle.acceleration(b, oracle.group(b)[1])
        np.testing.assert_allclose(v_dot[k], expected, rtol=0, atol=1e-12)


def test_accelerations_with_torques_against_pinocchio():
    """The articulated-body algorithm, an implementation of its own; to 1e-9 of the largest."""
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromUrdf(str(DATA / "arm.urdf"))
    data, rng = model.createData(), np.random.default_rng(4)
    for _ in range(20):
        angles, rates, torques = rng.uniform(-2.0, 2.0, (3, 2))
        q = np.array([angles[0], np.cos(angles[1]), np.sin(angles[1])])  # continuous: cosine, sine
        damped = torques - [0.3 * rates[0], 0.0]
        a = pin.aba(model, data, q, rates, damped)
        pin.forwardKinematics(model, data, q, rates, a)
        names = ("shoulder", "elbow")
        scene, _ = dap.import_model(
            DATA / "arm.urdf", positions=dict(zip(names, angles.tolist(), strict=True)),
            rates=dict(zip(names, rates.tolist(), strict=True)), limits="off",
        )  # fmt: skip
        scene.add_force("np", "m0", body_i="upper", np=(0.0, torques[0], 0.0))
        scene.add_force("np", "m1", body_i="lower", np=(0.0, torques[1], 0.0))
        scene.add_force("np", "m2", body_i="upper", np=(0.0, -torques[1], 0.0))
        v_dot, scale = body_accelerations(scene), max(1.0, np.abs(a).max())
        for k, joint in enumerate((1, 2)):
            place, motion, rate = data.oMi[joint], data.a[joint], data.v[joint]
            alpha, w = place.rotation @ motion.angular, place.rotation @ rate.angular
            arm = place.rotation @ model.inertias[joint].lever
            origin = place.rotation @ (motion.linear + np.cross(rate.angular, rate.linear))
            linear = origin + np.cross(alpha, arm) + np.cross(w, np.cross(w, arm))
            np.testing.assert_allclose(v_dot[k], [*linear, *alpha], rtol=0, atol=1e-9 * scale)
