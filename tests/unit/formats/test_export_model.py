"""Scenes as models of other programs, and back."""

import numpy as np
import pytest
from support.process import REPOSITORY

import dap3d_core as dap

DATA = REPOSITORY / "tests" / "data" / "formats"
SUFFIX = {"urdf": ".urdf", "mjcf": ".xml"}
GRAVITY = "gravity 0 0 0 m/s^2: URDF has none, and readers take 9.81 along -z"


def matrix(Jp):
    return np.diag(Jp) if np.ndim(Jp) == 1 else np.array(Jp)


def places(scene):
    """Points and vectors of all joints and forces in global axes, by element and field."""
    bodies = {"ground": (np.zeros(3), np.eye(3))}
    for name, body in scene.bodies.items():
        from support.rotations import rotation

        bodies[name] = np.array(body.r), rotation(np.array(body.p))
    found = {}
    for element in (*scene.joints.values(), *scene.forces.values()):
        for field, value in element.fields.items():
            point, vector = scene.points.get(value), scene.vectors.get(value)
            body, dot, tail = str(value).rpartition(".")
            if point is not None or (dot and tail == "O"):
                body, at = (point.body, point.sPp) if point else (body, (0, 0, 0))
                found[element.name, field] = body, bodies[body][0] + bodies[body][1] @ at
            elif vector is not None or (dot and tail in "xyz"):
                body, at = (
                    (vector.body, vector.sp) if vector else (body, np.eye(3)["xyz".index(tail)])
                )
                found[element.name, field] = body, bodies[body][1] @ np.array(at)
    return found


def assert_same(one, other):
    """Names, masses, inertias, poses, and all that elements name are equal but for rounding."""
    assert list(one.bodies) == list(other.bodies)
    for a, b in zip(one.bodies.values(), other.bodies.values(), strict=True):
        np.testing.assert_allclose(a.mass, b.mass, rtol=1e-13)
        if a.mass > 1e-9:  # links without mass have no mass centre to keep
            np.testing.assert_allclose(a.r, b.r, rtol=1e-14, atol=1e-14)
        np.testing.assert_allclose(matrix(a.Jp), matrix(b.Jp), rtol=1e-14, atol=1e-16)
        np.testing.assert_allclose(a.p, b.p, atol=1e-14)
    for table in ("joints", "forces", "functions"):
        a, b = getattr(one, table), getattr(other, table)
        assert {n: e.type for n, e in a.items()} == {n: e.type for n, e in b.items()}
        for name in a:
            first, second = a[name].fields, b[name].fields
            numbers = [k for k, v in first.items() if isinstance(v, float)]
            np.testing.assert_allclose([first[k] for k in numbers], [second[k] for k in numbers],
                                       rtol=1e-13, atol=1e-13)  # fmt: skip
    first, second = places(one), places(other)
    assert first.keys() == second.keys()
    for key in first:
        assert first[key][0] == second[key][0], key
        np.testing.assert_allclose(first[key][1], second[key][1], atol=1e-13, err_msg=str(key))


@pytest.mark.parametrize(
    ("file", "format"),
    [
        ("arm.urdf", "urdf"),
        ("arm.urdf", "mjcf"),
        ("parallelogram.urdf", "urdf"),
        ("parallelogram.xml", "mjcf"),
        ("parallelogram.sdf", "mjcf"),
        ("hand.xml", "mjcf"),
    ],
)
def test_what_is_written_reads_back_as_the_scene(tmp_path, file, format):
    """Loops, springs, stops, rotors, chains of joints and free bases."""
    scene, _ = dap.import_model(DATA / file)
    path = tmp_path / f"model{SUFFIX[format]}"
    report = dap.export_model(scene, path, format=format)
    assert not report.left_out
    back, of_import = dap.import_model(path)
    assert_same(scene, back)
    assert not [remark for remark in of_import.left_out if "contact" in str(remark)]


def test_every_joint_that_mjcf_has_reads_back_as_itself(tmp_path):
    """A chain of all types of joints that move or hold two bodies."""
    scene = dap.Scene(name="chain")
    joints = [("sph", {}), ("cyl", {"a_i": "{i}.x", "a_j": "{j}.x"}),
              ("rev", {"a_i": "{i}.y", "a_j": "{j}.y"}), ("univ", {"a_i": "{i}.y", "n_j": "{j}.z"}),
              ("tran", {"a_j": "{j}.z"})]  # fmt: skip
    before = "ground"
    for k, (keyword, fields) in enumerate(joints):
        body = f"b{k}"
        scene.add_body(body, mass=1.0 + k, Jp=(0.1, 0.2, 0.25), r=(0.3 + 0.6 * k, 0.0, 0.1 * k))
        scene.add_point(f"P{k}", body, (-0.3, 0.0, 0.0))
        at = (0.0, 0.0, 0.0) if before == "ground" else (0.3, 0.0, 0.1)
        scene.add_point(f"Q{k}", before, at)
        ends = {key: value.format(i=body, j=before) for key, value in fields.items()}
        scene.add_joint(keyword, f"J{k}", P_i=f"P{k}", P_j=f"Q{k}", **ends)
        before = body
    scene.add_body("end", mass=1.0, Jp=(0.1, 0.2, 0.25), r=(3.0, 0.2, 0.5), p=(0.8, 0.0, 0.6, 0.0))
    scene.add_joint("weld", "end_fixed", body_i="end", body_j=before)
    dap.export_model(scene, tmp_path / "a.xml", format="mjcf")
    back, _ = dap.import_model(tmp_path / "a.xml", keep_fixed=True)
    assert_same(scene, back)


def test_a_scene_by_hand_keeps_its_mechanism(tmp_path):
    """Joints in any direction, a spring between unlike axes: accelerations are the same."""
    scene = dap.Scene(name="hand")
    scene.add_body("a", mass=2.0, Jp=(0.2, 0.3, 0.4), r=(0.5, 0, 0), w=(0, 0, 0))
    scene.add_body("b", mass=1.0, Jp=(0.1, 0.2, 0.25), r=(1.5, 0, 0.2), p=(0.8, 0, 0.6, 0))
    scene.add_point("A", "a", (-0.5, 0, 0))
    scene.add_point("B", "a", (0.5, 0.1, 0))
    scene.add_vector("u", "a", (0, 1, 1))
    scene.add_point("C", "b", tuple(np.array([[0.28, 0, -0.96], [0, 1, 0], [0.96, 0, 0.28]])
                                    @ [-0.5, 0.1, -0.2]))  # fmt: skip
    scene.add_vector("v", "b", tuple(np.array([[0.28, 0, -0.96], [0, 1, 0], [0.96, 0, 0.28]])
                                     @ [0, 1, 1]))  # fmt: skip
    scene.add_joint("rev", "J1", P_i="A", P_j="ground.O", a_i="a.z", a_j="ground.z")
    scene.add_joint("rev", "J2", P_i="B", P_j="C", a_i="u", a_j="v")
    scene.add_force("weight", "g", gravity=9.81, wgt=(0.0, 0.6, -0.8))
    scene.add_force("rot_sda", "S", v_i="a.x", v_j="ground.y", axis="ground.z", k=3.0, c=0.2,
                    theta_0=0.4)  # fmt: skip
    path = tmp_path / "model.xml"
    report = dap.export_model(scene, path, format="mjcf")
    assert not report.left_out
    back, _ = dap.import_model(path)
    results = [dap.simulate(one, t_end=0.5, dt=0.5, rtol=1e-11, atol=1e-12)
               for one in (scene, back)]  # fmt: skip
    # two runs of the same motion, each to 1e-11 a step
    np.testing.assert_allclose(results[0].r, results[1].r, rtol=0, atol=1e-8)


@pytest.mark.parametrize("format", ["urdf", "mjcf"])
def test_dry_friction_and_a_spring_of_a_slider_read_back(tmp_path, format):
    """Of a slider and a hinge on it, in axes and points of its own: accelerations are the same."""
    scene = dap.Scene(name="rubbing")
    scene.add_body("block", mass=2.0, Jp=(0.2, 0.3, 0.4), r=(0.5, 0.0, 0.0), r_dot=(0.3, 0, 0))
    scene.add_body("wheel", mass=1.0, Jp=(0.1, 0.2, 0.25), r=(0.5, 0.0, 0.2), r_dot=(0.3, 0, 0),
                   w=(0.0, -0.7, 0.0))  # fmt: skip
    scene.add_point("P", "block", (0.0, 0.0, 0.2))
    scene.add_point("Q", "ground", (0.1, 0.0, 0.0))
    scene.add_vector("back", "ground", (-1.0, 0.0, 0.0))
    scene.add_joint("tran", "way", P_i="block.O", P_j="ground.O", a_j="ground.x")
    scene.add_joint("rev", "pin", P_i="wheel.O", P_j="P", a_i="wheel.y", a_j="block.y")
    k = 0.0 if format == "urdf" else 30.0
    scene.add_force("tran_sda", "spring", P_i="block.O", P_j="Q", a_j="back", k=k, c=0.5, x_0=-0.3)
    scene.add_force("tran_friction", "rub", P_i="P", a_j="back", f_c=0.8,
                    v_tol=1e-3)  # fmt: skip
    scene.add_force("rot_friction", "drag", body_i="block", body_j="wheel", axis="wheel.y", n_c=0.6,
                    w_tol=1e-3)  # fmt: skip
    report = dap.export_model(scene, tmp_path / f"a{SUFFIX[format]}", format=format)
    assert {one.text for one in report.left_out} <= {"initial velocities", GRAVITY}
    back, _ = dap.import_model(tmp_path / f"a{SUFFIX[format]}")
    back.forces.pop("gravity", None)
    for name, body in back.bodies.items():
        body.r_dot, body.w = scene.bodies[name].r_dot, scene.bodies[name].w
    ends = [dap.simulate(one, t_end=0.0).v_dot for one in (scene, back)]
    assert np.abs(ends[0]).max() > 0.5
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("keyword", "fields"), [("cyl", {"a_i": "bolt.y"}), ("tran", {})])
def test_joints_that_slide_may_start_anywhere_on_their_axis(tmp_path, keyword, fields):
    """Points apart along the axis: accelerations are the same; apart beside it they are open."""
    scene = dap.Scene(name="bolt")
    scene.add_body("bolt", mass=2.0, Jp=(0.2, 0.3, 0.4), r=(0.5, 0.2, 0.7))
    scene.add_body("bob", mass=1.0, Jp=(0.1, 0.2, 0.25), r=(0.8, 0.2, 0.7))
    for point, body, sPp in (("Q", "ground", (0.5, -0.4, 0.7)), ("end", "bob", (-0.3, 0, 0))):
        scene.add_point(point, body, sPp)
    scene.add_joint(keyword, "way", P_i="bolt.O", P_j="Q", a_j="ground.y", **fields)
    scene.add_joint("sph", "ball", P_i="end", P_j="bolt.O")
    scene.add_force("weight", "g", wgt=(0.0, 0.6, -0.8))
    dap.export_model(scene, tmp_path / "a.xml", format="mjcf")
    back, _ = dap.import_model(tmp_path / "a.xml")
    ends = [dap.simulate(one, t_end=0.0).rdd for one in (scene, back)]
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-12)
    scene.points["Q"].sPp = (0.5, -0.4, 0.9)
    with pytest.raises(dap.SceneError, match=r"joint way is open by 0\.2 m"):
        dap.export_model(scene, format="mjcf")


@pytest.mark.parametrize(
    ("joint", "keyword", "fields"),
    [
        ("axle", "rot_sda", {"k": 3.0, "c": 0.1, "theta_0": "-20 deg"}),
        ("axle", "rot_friction", {"n_c": 0.3, "w_tol": 1e-3}),
        ("way", "tran_sda", {"k": 30.0, "c": 0.1, "x_0": 0.2}),
        ("way", "tran_friction", {"f_c": 0.3, "v_tol": 1e-3}),
    ],
)
def test_angles_in_degrees_and_forces_that_name_a_joint_read_back(tmp_path, joint, keyword, fields):
    """A wheel whose orientation is given by roll, pitch and yaw: accelerations are the same."""
    yaw, roll = np.radians(30.0), np.radians(20.0)
    lean = np.array([np.sin(yaw) * np.sin(roll), -np.cos(yaw) * np.sin(roll), np.cos(roll)])
    scene = dap.Scene(name="short")
    scene.add_body("block", mass=2.0, Jp=(0.2, 0.3, 0.4), r=(0.3, 0.0, 0.0), r_dot=(0.2, 0, 0))
    scene.add_body("wheel", mass=1.0, Jp=(0.2, 0.3, 0.4), r=(0.3, 0.0, 1.0), r_dot=(0.2, 0, 0),
                   rpy=("20 deg", 0.0, "30 deg"), w=0.7 * lean)  # fmt: skip
    scene.add_point("P", "block", (0.0, 0.0, 1.0))
    scene.add_vector("lean", "block", lean)
    scene.add_joint("tran", "way", P_i="block.O", P_j="ground.O", a_j="ground.x")
    axes = {"a_i": "wheel.z", "a_j": "lean"} if joint == "axle" else {}
    scene.add_joint("rev" if axes else "sph", "axle", P_i="wheel.O", P_j="P", **axes)
    scene.add_force(keyword, "force", joint=joint, **fields)
    report = dap.export_model(scene, tmp_path / "a.xml", format="mjcf")
    assert {one.text for one in report.left_out} <= {"initial velocities"}
    back, _ = dap.import_model(tmp_path / "a.xml")
    back.forces.pop("gravity", None)
    for name, body in back.bodies.items():
        body.r_dot, body.w = scene.bodies[name].r_dot, scene.bodies[name].w
    starts = [dap.simulate(one, t_end=0.0) for one in (scene, back)]
    for part in ("r", "p"):
        np.testing.assert_allclose(*(getattr(one, part) for one in starts), rtol=0, atol=1e-14)
    ends = [one.v_dot for one in starts]
    assert np.abs(ends[0]).max() > 0.05
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("format", ["urdf", "mjcf"])
def test_limits_of_joints_read_back(tmp_path, format):
    """Rigid ones, with a slider whose bodies are exchanged in the file: the same scene again."""
    scene = dap.Scene(name="limited")
    scene.add_body("arm", mass=2.0, Jp=(0.2, 0.3, 0.4))
    scene.add_body("block", mass=1.0, Jp=(0.1, 0.2, 0.25), r=(0.2, 0.0, 0.0))
    scene.add_joint("rev", "pin", P_i="arm.O", P_j="ground.O", a_i="arm.y", a_j="ground.y",
                    lower="-30 deg", upper=1.2)  # fmt: skip
    scene.add_joint("tran", "way", P_i="arm.O", P_j="block.O", a_j="block.x", lower=-0.1, upper=0.3,
                    e=0.5)  # fmt: skip
    report = dap.export_model(scene, tmp_path / f"a{SUFFIX[format]}", format=format)
    assert any("e of the limits of a joint" in one.text for one in report.left_out)
    back, _ = dap.import_model(tmp_path / f"a{SUFFIX[format]}", limits="hard")
    ends = {name: [joint.fields[key] for key in ("lower", "upper")]
            for name, joint in back.joints.items()}  # fmt: skip
    assert ends["pin"] == pytest.approx([-np.pi / 6.0, 1.2], rel=1e-14)
    assert ends["way"] == pytest.approx([-0.1, 0.3], rel=1e-14)
    ways = []
    for one in (scene, back):  # the sense of the length is the same
        one.bodies["block"].r_dot = (-1.0, 0.0, 0.0)
        one.forces.clear()
        ways.append(dap.simulate(one, t_end=0.2, dt=0.2).quantity("way.length").values[-1])
    assert ways[0] == pytest.approx(ways[1], abs=1e-9) != 0.0


def test_what_acts_in_a_closed_loop_is_listed():
    """An equality of MJCF, and a <constraint> of URDF, have no damper."""
    scene, _ = dap.import_model(DATA / "parallelogram.sdf")
    ends = [scene.points[scene.joints["close"].fields[end]].body for end in ("P_i", "P_j")]
    scene.add_force("sph_sd", "drag", body_i=ends[0], body_j=ends[1], c=0.1)
    for format in ("mjcf", "urdf"):
        report = dap.export_model(scene, format=format)
        assert "damping of joint close" in {one.text for one in report.left_out}


def test_a_body_that_is_fixed_to_ground_is_said_to_become_ground():
    scene = dap.Scene(name="held")
    for name in ("held", "free"):
        scene.add_body(name, mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_joint("fix", "clamp", body_i="held")
    report = dap.export_model(scene, format="mjcf")
    text = "clamp holds held on ground: read back, held is a part of ground"
    assert text in {one.text for one in report.translated}


def test_a_joint_without_a_counterpart_is_refused_by_name():
    with pytest.raises(dap.SceneError, match=r"joint J5: no joint of a model is of type 'rel-rot'"):
        dap.export_model("fourbar4", format="mjcf")
    scene, _ = dap.import_model(DATA / "hand.xml")
    with pytest.raises(dap.SceneError, match=r"joint loose is ball, which URDF does not have"):
        dap.export_model(scene, format="urdf")


def test_a_force_without_a_counterpart_is_listed_and_strict_refuses_it():
    scene, _ = dap.import_model(DATA / "arm.urdf")
    scene.add_force("f", "push", body_i="upper", f=(1.0, 0.0, 0.0))
    report = dap.export_model(scene, format="mjcf")
    assert [one.text for one in report.left_out] == [
        "push of type f: no force on the coordinate of a joint"
    ]
    with pytest.raises(dap.SceneError, match="push of type f"):
        dap.export_model(scene, format="mjcf", strict=True)


def test_names_are_written_as_data(tmp_path):
    """A name with marks of XML reads back as it is."""
    scene = dap.Scene(name='"x" & <y>')
    scene.add_body("a<&'b>", mass=1.0, Jp=(1.0, 1.0, 1.0))
    path = tmp_path / "model.xml"
    dap.export_model(scene, path, format="mjcf")
    back, _ = dap.import_model(path)
    assert (back.name, list(back.bodies)) == (scene.name, list(scene.bodies))


#: A motor between two links, one on a slider between two, a servo on ground, with gears.
DRIVEN = """<mujoco model="driven"><option gravity="0 0 0"/><compiler angle="radian"/><worldbody>
  <body name="a" euler="0.3 0.2 0.1"><joint name="p" axis="0 1 1"/>
    <inertial pos="0.1 0 0" mass="1" diaginertia="0.1 0.2 0.25"/>
    <body name="b" pos="0.3 0 0" euler="0 0.4 0.5"><joint name="q" axis="1 2 0" pos="0 0 0.1"/>
      <inertial pos="0.1 0 0" mass="1" diaginertia="0.1 0.2 0.25"/>
      <body name="c" pos="0.2 0 0.1" euler="0.5 0 0"><joint name="s" type="slide" axis="1 0 2"/>
        <inertial pos="0.1 0.2 0" mass="1" diaginertia="0.1 0.2 0.25"/></body></body></body>
  </worldbody><actuator><position name="servo" joint="p" kp="5" kv="0.5"/>
  <motor name="turn" joint="q" gear="-3"/><motor name="push" joint="s" gear="2"/></actuator>
</mujoco>"""


def test_actuators_read_back(tmp_path):
    """An input that acts in a joint, equal and opposite on its bodies, is a motor of MJCF."""
    (tmp_path / "a.xml").write_text(DRIVEN)
    scene, _ = dap.import_model(tmp_path / "a.xml")
    assert list(scene.inputs) == ["servo", "turn", "push"]
    report = dap.export_model(scene, tmp_path / "b.xml", format="mjcf")
    assert not report.left_out
    back, _ = dap.import_model(tmp_path / "b.xml")
    assert_same(scene, back)
    for name, force in scene.forces.items():
        assert force.fields.get("input") == back.forces[name].fields.get("input")
        for key in {"np", "fp"} & force.fields.keys():
            other = back.forces[name].fields[key]
            np.testing.assert_allclose(force.fields[key], other, rtol=0, atol=1e-14)
    left = dap.export_model(scene, format="urdf").left_out
    assert sum("actuator" in str(one) for one in left) == 3


BOUNDED = """<motor name="turn" joint="q" gear="-3" ctrlrange="-1 2" forcerange="-2 3"/>
  <position name="servo" joint="p" kp="5" kv="0.5" forcerange="-1 4" ctrlrange="-9 0.3"/>
  <general name="push" joint="s" dyntype="filter" dynprm="0.2" gainprm="4" actrange="0 1"/>
  <intvelocity name="on" joint="p" kp="3" actrange="-1 1"/></actuator>"""


def test_bounds_and_activations_of_actuators_read_back(tmp_path):
    text = DRIVEN.partition("<position")[0] + BOUNDED + "</mujoco>"
    (tmp_path / "a.xml").write_text(text)
    scene, _ = dap.import_model(tmp_path / "a.xml", positions={"p": 0.3})
    assert not dap.export_model(scene, tmp_path / "b.xml", format="mjcf").left_out
    back, _ = dap.import_model(tmp_path / "b.xml")
    assert_same(scene, back)
    made = [one for one in scene.forces.values() if one.type == "actuator"]
    assert len(made) == 4
    for force in made:
        other = back.forces[force.name].fields
        for key, value in force.fields.items():
            assert other[key] == (
                pytest.approx(value, rel=1e-14) if type(value) is float else value
            )


def test_a_joint_that_closes_a_loop_has_no_actuator(tmp_path):
    """It is an equality in MJCF, on which nothing acts."""
    scene, _ = dap.import_model(DATA / "parallelogram.sdf")
    ball = scene.joints.pop("close")
    ends = {f"a_{e}": f"{scene.points[ball.fields[f'P_{e}']].body}.y" for e in "ij"}
    scene.add_joint("rev", "close", **ball.fields, **ends)
    for name, joint in scene.joints.items():
        scene.add_input(f"turn_{name}", 0.0)
        for end, sign in (("a_i", 1.0), ("a_j", -1.0)):
            body = joint.fields[end].removesuffix(".y")
            if body != "ground":
                scene.add_force("np", f"{name}_{body}", body_i=body, np=(0.0, sign, 0.0),
                                input=f"turn_{name}")  # fmt: skip
    report = dap.export_model(scene, tmp_path / "a.xml", format="mjcf")
    back, _ = dap.import_model(tmp_path / "a.xml")
    assert set(back.inputs) == {"turn_left", "turn_right", "turn_pin"}
    assert sum("of type np" in str(one) for one in report.left_out) == 2


@pytest.mark.parametrize(
    "change",
    [
        lambda forces, inputs: forces.pop("turn_j"),
        lambda forces, inputs: forces["turn_j"].fields.update(np=(0.0, 1.0, 0.0)),
        lambda forces, inputs: forces["push_j"].fields.update(P_i="b.O"),
        lambda forces, inputs: inputs["turn"].__setattr__("value", 1.0),
    ],
    ids=["on one body", "not opposite", "on another line", "held"],
)
def test_inputs_that_are_no_actuators_are_left_out(tmp_path, change):
    (tmp_path / "a.xml").write_text(DRIVEN)
    scene, _ = dap.import_model(tmp_path / "a.xml")
    change(scene.forces, scene.inputs)
    assert dap.export_model(scene, format="mjcf").left_out
