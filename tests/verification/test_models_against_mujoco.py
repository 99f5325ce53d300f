"""Imported models against MuJoCo, where it is installed: masses, kinematics, accelerations.

``benchmarks/imported_models.py FOLDER`` does the same for all models in a folder.
"""

import numpy as np
import pytest
from support.mujoco_models import Oracle
from support.process import REPOSITORY

import dap3d_core as dap
from dap3d_core.model.rotations import rotation

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
        scene, _ = dap.import_model(path, positions=positions, rates=rates)
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
        scene, _ = dap.import_model(path, positions=positions, rates=rates)
        for name in [n for n, e in scene.forces.items() if "function" in e.fields]:
            del scene.forces[name]  # stops
        scene.functions.clear()
        for name in [n for n, e in scene.joints.items() if e.type == "sph" and n == "close"]:
            del scene.joints[name]  # MuJoCo's equalities are soft
        v_dot = body_accelerations(scene)
        scale = max(1.0, np.abs(oracle.data.qacc).max())
        places = {name: k for k, name in enumerate(scene.bodies)}
        for b, name in bodies_of(oracle, scene):
            expected = oracle.acceleration(b, oracle.group(b)[1])
            np.testing.assert_allclose(v_dot[places[name]], expected, rtol=0, atol=1e-9 * scale)


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
            rates=dict(zip(names, rates.tolist(), strict=True)),
        )  # fmt: skip
        for name in [n for n, e in scene.forces.items() if "function" in e.fields]:
            del scene.forces[name]
        scene.functions.clear()
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
