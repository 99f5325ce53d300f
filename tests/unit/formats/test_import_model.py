"""Models of other programs as scenes: what is common to all formats."""

from itertools import combinations

import numpy as np
import pytest
from support.process import REPOSITORY
from support.rotations import rotation

import dap3d_core as dap

ARM = REPOSITORY / "tests" / "data" / "formats" / "arm.urdf"


def turned(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
    }[axis]


def steiner(mass, d):
    return mass * (d @ d * np.eye(3) - np.outer(d, d))


def test_links_of_a_fixed_joint_are_one_body_with_their_inertia():
    """By Steiner's theorem; the inertia of the lower link is turned by a quarter."""
    scene, report = dap.import_model(ARM)
    assert list(scene.bodies) == ["upper", "lower"]
    J = np.array([[0.02, -0.01, 0], [-0.01, 0.06, 0], [0, 0, 0.07]])
    A = turned("x", 0.3)
    J_tool = A @ np.diag([0.001, 0.002, 0.0025]) @ A.T
    com, tool = np.array([0.4, 0, 0]), np.array([0.8, 0, 0.1])
    middle = (com + 0.5 * tool) / 1.5
    expected = J + steiner(1.0, com - middle) + J_tool + steiner(0.5, tool - middle)
    assert scene.bodies["lower"].mass == 1.5
    np.testing.assert_allclose(scene.bodies["lower"].Jp, expected, rtol=0, atol=1e-16)
    assert any("merged" in remark.text for remark in report.translated)


def test_fixed_joints_may_be_kept():
    """The tool is a body of its own, and moves with the lower link: 6 rows of rank 6."""
    scene, _ = dap.import_model(ARM, keep_fixed=True)
    assert list(scene.bodies) == ["upper", "lower", "tool"]
    merged, _ = dap.import_model(ARM)
    results = [dap.simulate(one, t_end=0.2, dt=0.1, rtol=1e-11) for one in (scene, merged)]
    assert results[0].method == results[1].method == "standard"  # no row is redundant
    # both integrate the same motion, each to 1e-11
    np.testing.assert_allclose(results[0].r[:, 0], results[1].r[:, 0], rtol=0, atol=1e-9)


def test_a_model_starts_at_the_positions_given():
    """Against forward kinematics by hand."""
    scene, _ = dap.import_model(ARM, positions={"shoulder": 0.7, "elbow": -0.4})
    upper, lower = turned("y", 0.7), turned("y", 0.7 + 0.5 - 0.4)
    np.testing.assert_allclose(rotation(np.array(scene.bodies["lower"].p)), lower, atol=1e-15)
    elbow = [0, 0, 1] + upper @ [1, 0, 0]
    middle = (np.array([0.4, 0, 0]) + 0.5 * np.array([0.8, 0, 0.1])) / 1.5
    np.testing.assert_allclose(scene.bodies["lower"].r, elbow + lower @ middle, atol=1e-15)


def test_joint_coordinates_have_the_sign_of_the_file():
    """A rate of a joint becomes the angular velocities of the bodies, and the joint's rate."""
    scene, _ = dap.import_model(ARM, rates={"shoulder": 0.7, "elbow": -0.4})
    assert scene.bodies["upper"].w == (0.0, 0.7, 0.0)
    np.testing.assert_allclose(scene.bodies["lower"].w, (0.0, 0.3, 0.0), atol=1e-16)
    result = dap.simulate(scene, t_end=0.0)
    np.testing.assert_allclose(
        result.quantity("shoulder.angle_rate").values.ravel(), 0.7, rtol=1e-14
    )
    np.testing.assert_allclose(result.quantity("elbow.angle_rate").values.ravel(), -0.4, rtol=1e-14)


def test_stops_push_back_and_dampers_brake():
    """The moments of a soft stop and a damper on the joint, by their laws, 0.1 rad beyond it."""
    scene, report = dap.import_model(ARM, positions={"shoulder": 2.1}, rates={"shoulder": 0.5})
    assert any("it is put at 2" in remark.text for remark in report.translated)
    stop = scene.forces["shoulder_max_stop"].fields
    assert stop["theta_stop"] == 2.0
    stop["theta_stop"] = 1.9
    result = dap.simulate(scene, t_end=0.0)
    moments = {name: result.force(name).on["i"].moment[0] for name in scene.forces if "sho" in name}
    assert set(moments) == {"shoulder_damper", "shoulder_min_stop", "shoulder_max_stop"}
    np.testing.assert_allclose(moments["shoulder_damper"], (0.0, -0.3 * 0.5, 0.0), atol=1e-15)
    moment = stop["k"] * 0.1 + 2.0 * np.sqrt(stop["k"] * stop["J_c"]) * 0.5
    np.testing.assert_allclose(moments["shoulder_max_stop"], (0.0, -moment, 0.0), rtol=1e-12)
    np.testing.assert_array_equal(moments["shoulder_min_stop"], 0.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<child link="lower"/>', '<child link="lowr"/>', r"no link 'lowr'; did you mean 'lower'"),
        ('type="continuous"', 'type="hinge"', r"39: joint elbow: type 'hinge' is unknown"),
        ('xyz="0 2 0"', 'xyz="0 0 0"', r"an axis needs a direction"),
        ('mass value="2"', 'mass value="two"', r":9: value of <mass> = 'two' should be a finite"),
        ('mass value="2"', 'mass value="nan"', r":9: value of <mass> = 'nan' should be a finite"),
        ('ixx="0.01"', 'ixx="-1"', r":6: link upper: no body has .*: none is negative"),
        ('parent link="base"', 'parent link="lower"', r"hangs from itself"),
        ('lower="-1"', 'lower="3"', r":36: joint shoulder: lower = 3 lies above upper = 2"),
        ('value="2"', 'value="-2"', r":9: value of <mass> = '-2' should be a finite number, 0 or"),
        ('damping="0.3"', 'damping="-3"', r":37: damping of <dynamics> = '-3' should be a finite"),
        ('damping="0.3"', 'friction="-3"', r":37: friction of <dynamics> = '-3' should be a fin"),
        ('damping="0.3"', 'damping="1_0"', r":37: damping of <dynamics> = '1_0' should be a fin"),
        ('damping="0.3"', 'damping="3 Ns"', r":37: damping of <dynamics> = '3 Ns' should be a f"),
        ('"0 0 1"', '"0 0 1" rotation_format="quat_wxyz"', r":34: rotation_format of <or"),
        ('"0 0 1"', '"0 0 1" quat_xyzw="0 0 0 1"', r":34: quat_xyzw of <origin> is of v"),
    ],
)
def test_mistakes_of_a_file_are_told_with_their_line(tmp_path, old, new, message):
    text = ARM.read_text()
    assert text.count(old) == 1
    (tmp_path / "arm.urdf").write_text(text.replace(old, new))
    with pytest.raises(dap.SceneError, match=message):
        dap.import_model(tmp_path / "arm.urdf")


def test_motors_become_inputs():
    """Gear times input about the axis, on the child, and its opposite on the parent."""
    scene, _ = dap.import_model(ARM.with_name("cart.xml"))
    assert list(scene.inputs) == ["slide_input", "turn", "push", "servo", "law"]
    for one, value in zip(scene.inputs.values(), (1.3, -0.7, 2.1, 0.0, 0.0), strict=True):
        one.value = value
    result = dap.simulate(scene, t_end=0.0)
    wrench = {name: result.force(name).on["i"] for name in scene.forces if name != "gravity"}
    np.testing.assert_allclose(wrench["slide_input_i"].force[0], (3.9, 0.0, 0.0), rtol=1e-15)
    np.testing.assert_allclose(wrench["turn_i"].moment[0], (0.0, -0.7, 0.0), rtol=1e-15)
    np.testing.assert_allclose(wrench["turn_j"].moment[0], (0.0, 0.7, 0.0), rtol=1e-15)
    pushed = np.array([0.0, -4.2, -4.2]) / np.sqrt(2.0)
    np.testing.assert_allclose(wrench["push_i"].force[0], pushed, rtol=1e-15)
    np.testing.assert_allclose(wrench["push_j"].force[0], -pushed, rtol=1e-15)


def test_a_position_has_as_many_numbers_as_its_joint_coordinates():
    with pytest.raises(dap.SceneError, match="joint elbow is revolute: it takes 1 numbers, not 2"):
        dap.import_model(ARM, positions={"elbow": (0.1, 0.2)})
    hand = ARM.with_name("hand.xml")
    with pytest.raises(dap.SceneError, match="joint loose is ball: it takes 4 numbers, not 1"):
        dap.import_model(hand, positions={"loose": 0.1})
    with pytest.raises(dap.SceneError, match="joint loose is ball: it takes 3 numbers, not 4"):
        dap.import_model(hand, rates={"loose": (1.0, 0.0, 0.0, 0.0)})
    dap.import_model(hand, rates={"loose": np.zeros(3)})


@pytest.mark.parametrize("value", [float("nan"), float("inf"), "0.1", [0.1, None], [1, [2]]])
def test_positions_are_finite_numbers_of_joints_of_the_file(value):
    with pytest.raises(dap.SceneError, match=r"rate of elbow = .* should be finite numbers"):
        dap.import_model(ARM, rates={"elbow": value})
    with pytest.raises(dap.SceneError, match="did you mean 'elbow'"):
        dap.import_model(ARM, positions={"elbw": value})
    with pytest.raises(dap.SceneError, match=r"it has .*shoulder"):
        dap.import_model(ARM, positions={"knee": value})


SPOKE = '<body name="b"><freejoint/><geom type="box" size="0.1 0.2 0.3" pos="1 0 0"/></body>'


def imported(tmp_path, text, **options):
    (tmp_path / "a.xml").write_text(f"<mujoco>{text}</mujoco>")
    return dap.import_model(tmp_path / "a.xml", **options)


def test_replicas_are_turned_and_moved_one_after_the_other(tmp_path):
    """Replica k has (offset, turn)^k: of three quarter turns with a step along x."""
    world = f'<replicate count="3" offset="2 0 0" euler="0 0 90" sep="-">{SPOKE}</replicate>'
    scene, _ = imported(tmp_path, f"<worldbody>{world}</worldbody>")
    assert list(scene.bodies) == ["b-0", "b-1", "b-2"]
    places = [(1.0, 0.0, 0.0), (2.0, 1.0, 0.0), (1.0, 2.0, 0.0)]
    for k, (body, place) in enumerate(zip(scene.bodies.values(), places, strict=True)):
        np.testing.assert_allclose(body.r, place, atol=1e-15)
        c, s = np.cos(k * np.pi / 2.0), np.sin(k * np.pi / 2.0)
        turned = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
        np.testing.assert_allclose(rotation(np.array(body.p)), turned, atol=1e-15)


def test_replicas_are_turned_by_multiples_of_their_euler_angles(tmp_path):
    """Places and quaternions as of MuJoCo 4.0.0 (body_pos, body_quat), to the digits printed."""
    turned = '<replicate count="3" offset="0.3 -0.01 0.26" euler="80 -50 65">' + SPOKE
    scene, _ = imported(tmp_path, f"<worldbody>{turned}</replicate></worldbody>")
    last = scene.bodies["b2"]
    A = rotation(np.array([0.7309, 0.1470, -0.6299, -0.2177]))
    place = np.array([0.1882, -0.2306, 0.5707])
    np.testing.assert_allclose(rotation(np.array(last.p)), A, atol=3e-4)
    np.testing.assert_allclose(last.r, place + A @ scene.bodies["b0"].r, atol=3e-4)


def test_a_box_between_two_points_is_square(tmp_path):
    """Other sizes than the first hold for neither edge: 8 * 0.1 * 0.1 * 0.5 * 1000 kg."""
    geom = '<geom type="box" fromto="0 0 0 0 0 1" size="0.1 0.3 0.7"/>'
    scene, _ = imported(tmp_path, f"<worldbody><body><joint/>{geom}</body></worldbody>")
    assert next(iter(scene.bodies.values())).mass == pytest.approx(40.0, rel=1e-14)


def test_a_ball_in_a_turned_frame_has_coordinates_in_the_axes_of_the_body(tmp_path):
    """A quarter turn about x of the body, whatever frame holds its joint."""
    body = '<body name="b"><frame euler="20 30 40"><joint type="ball"/></frame>'
    key = '<keyframe><key name="k" qpos="0.5 0.5 0 0"/></keyframe>'
    text = f'<worldbody>{body}<geom size="0.1" pos="0 1 0"/></body></worldbody>{key}'
    scene, _ = imported(tmp_path, text, key="k")
    np.testing.assert_allclose(scene.bodies["b"].r, (0.0, 0.0, 1.0), atol=1e-15)


def test_bodies_without_counted_geoms_keep_their_inertial(tmp_path):
    given = '<inertial pos="0 0 0" mass="1.5" diaginertia="1 1 1"/>'
    body = f'<body><joint/>{given}<geom size="0.1" group="4"/></body>'
    compiler = '<compiler inertiafromgeom="true" inertiagrouprange="0 3"/>'
    scene, _ = imported(tmp_path, f"{compiler}<worldbody>{body}</worldbody>")
    assert next(iter(scene.bodies.values())).mass == 1.5


def test_numbers_of_replicas_are_of_one_length(tmp_path):
    world = f'<replicate count="10" offset="2 0 0">{SPOKE}</replicate>'
    scene, _ = imported(tmp_path, f"<worldbody>{world}</worldbody>")
    assert list(scene.bodies)[::9] == ["b00", "b09"]


@pytest.mark.parametrize(
    ("world", "said"),
    [
        ('<replicate count="1000000000"><body/></replicate>', "more than 100000 elements"),
        ('<replicate count="400">' * 2 + "<body/>" + "</replicate>" * 2, "more than 100000"),
        ('<replicate count="0.5"><body/></replicate>', "an integer above 0"),
        ("<replicate><body/></replicate>", "has no count; it is required"),
    ],
)
def test_replicas_have_a_bound(tmp_path, world, said):
    """Nested ones multiply; none is made before the number is known."""
    with pytest.raises(dap.SceneError, match=said):
        imported(tmp_path, f"<worldbody>{world}</worldbody>")


@pytest.mark.parametrize("face", ["", 'face="0 2 1  0 1 3  0 3 2  1 2 3"'])
def test_a_mesh_without_a_file_has_mass(tmp_path, face):
    """A tetrahedron of edges 0.6, of its hull without faces: volume 0.036, centre a quarter up."""
    mesh = f'<mesh name="m" vertex="0 0 0 0.6 0 0 0 0.6 0 0 0 0.6" {face}/>'
    body = '<body name="b"><freejoint/><geom type="mesh" mesh="m" density="500"/></body>'
    scene, _ = imported(tmp_path, f"<asset>{mesh}</asset><worldbody>{body}</worldbody>")
    assert scene.bodies["b"].mass == pytest.approx(18.0, rel=1e-13)
    np.testing.assert_allclose(scene.bodies["b"].r, 0.15, rtol=1e-13)


def test_shapes_of_the_world_are_drawn_on_ground(tmp_path):
    world = '<geom type="box" size="1 1 0.1" pos="0 0 -0.1"/><geom type="plane" size="1 1 1"/>'
    scene, report = imported(tmp_path, f"<worldbody>{world}{SPOKE}</worldbody>")
    assert [shape.fields["body"] for shape in scene.shapes.values()] == ["ground", "b"]
    assert any("plane is not drawn" in one.text for one in report.left_out)


CONTACTS = """
<worldbody><geom type="plane" size="1 1 1" friction="0.2"/>
<body name="a" pos="0 0 0.1"><freejoint/><geom type="box" size="0.2 0.1 0.1" friction="0.4"/></body>
<body name="b" pos="2 0 0.1"><freejoint/><geom size="0.1" condim="1" contype="2"/>
<body name="c" pos="0 0 1"><joint type="hinge"/><joint type="hinge" axis="0 1 0"/>
<geom type="capsule" size="0.1 0.2" conaffinity="0" contype="0"/>
<geom type="ellipsoid" size="0.1 0.2 0.3" density="0"/></body>
<body name="neck"><body name="head" pos="0 0 0.2">
<geom size="0.1"/></body></body></body></worldbody>
<contact><exclude body1="a" body2="b"/><exclude body1="a" body2="head"/></contact>"""


def test_geoms_meet_as_in_the_file(tmp_path):
    """The larger friction of a pair holds, as in MuJoCo; geoms of joints in a row do not meet.

    Nor do those with what is fixed to the ends of the row, the head.
    """
    scene, report = imported(tmp_path, CONTACTS, contacts=True)
    meeting = {n: s.fields for n, s in scene.shapes.items() if s.fields.get("collides")}
    names = ["world_shapes_plane", "a_box", "b_sphere", "head_sphere", "c_ellipsoid"]
    assert list(meeting) == names
    assert meeting["b_sphere"]["group"] == 2
    assert scene.shapes["c_cylinder"].fields["length"] == 0.4  # drawn alone
    assert {("a", "b"), ("b", "c")} <= set(scene.collisions.exclude)
    named = {name: shape["material"] for name, shape in meeting.items()}
    pairs = scene.materials[named["world_shapes_plane"]].with_
    assert pairs[named["a_box"]]["mu"] == 0.4
    assert pairs[named["b_sphere"]]["mu"] == 1.0
    assert scene.materials[named["b_sphere"]].mu == 0.0
    assert not any("do not touch" in one.text for one in report.left_out)
    first = report.translated[0]
    assert first.motion
    assert "1e-06 of the mass that it carries" in first.text


def test_geoms_resist_spinning_and_rolling_by_their_condim(tmp_path):
    """As MuJoCo: the larger condim and the larger coefficients of a pair, or those of a pair."""
    geom = '<body pos="0 0 {z}"><freejoint/><geom name="{name}" size="0.1" {more}/></body>'
    given = {"rolls": 'condim="6" friction="0.8 0.02 0.003"', "spins": 'condim="4"', "usual": ""}
    bodies = "".join(geom.format(z=z, name=name, more=more)
                     for z, (name, more) in enumerate(given.items()))  # fmt: skip
    pair = '<contact><pair geom1="rolls" geom2="spins" condim="4" friction="1 1 0.1"/></contact>'
    scene, _ = imported(tmp_path, f"<worldbody>{bodies}</worldbody>{pair}", contacts=True)
    rolls, spins, usual = (scene.materials[s.fields["material"]] for s in scene.shapes.values())
    assert (rolls.mu_spin, rolls.mu_roll) == (0.02, 0.003)
    assert (spins.mu_spin, spins.mu_roll, usual.mu_spin) == (0.005, None, None)
    pairs = {**rolls.with_, **spins.with_}
    assert rolls.with_[spins.name] == {"mu": 1.0, "mu_spin": 0.1, "mu_roll": 0.0}
    assert rolls.with_[usual.name] == {"mu": 1.0, "mu_spin": 0.02, "mu_roll": 0.003}
    assert pairs[usual.name] == {"mu": 1.0, "mu_spin": 0.005}


PAIRS = """<worldbody><geom name="floor" type="plane" size="5 5 0.1" contype="0" conaffinity="0"/>
<body name="a" pos="0 0 3"><freejoint/><geom name="a" size="1" contype="0" conaffinity="0"/></body>
<body name="b" pos="0 0 2"><freejoint/><geom name="b" size="0.1" contype="2"/></body>
<body name="c" pos="0 0 1"><freejoint/><geom name="c" size="0.1" friction="2"/></body></worldbody>
<default><pair friction="0.3 0.3"/></default><contact><pair geom1="a" geom2="floor"/>
<pair geom1="c" geom2="a" condim="1"/><pair geom1="b" geom2="floor" friction="0.2"/></contact>"""


def test_pairs_of_geoms_meet_beside_those_of_bits(tmp_path):
    """With their own friction: three pairs, and b and c by their bits."""
    scene, report = imported(tmp_path, PAIRS, contacts=True)
    shapes, meeting = [(s.fields["body"], s.fields) for s in scene.shapes.values()], {}
    for (one, f), (other, g) in combinations(shapes, 2):
        bits = [
            s.get(key, 1) for s, key in ((f, "group"), (g, "meets"), (g, "group"), (f, "meets"))
        ]
        if bits[0] & bits[1] or bits[2] & bits[3]:
            with_ = scene.materials[f["material"]].with_ or {}
            with_ = with_ | {n: m.with_[f["material"]] for n, m in scene.materials.items()
                             if f["material"] in (m.with_ or {})}  # fmt: skip
            meeting[one, other] = with_[g["material"]]["mu"]
    expected = {("ground", "a"): 0.3, ("ground", "b"): 0.2, ("a", "c"): 0.0, ("b", "c"): 2.0}
    assert {tuple(sorted(k)): v for k, v in meeting.items()} == {
        tuple(sorted(k)): v for k, v in expected.items()
    }
    assert not report.left_out


@pytest.mark.slow
def test_limits_beside_contacts_are_rigid(tmp_path):
    """An arm falls on its limit and stays there; its friction sticks.

    What overlaps is moved apart step by step, to 1e-9 of a turn at least.
    """
    text = """<compiler angle="radian"/><worldbody><geom type="plane" size="1 1 1" pos="0 0 -5"/>
      <body name="b">
      <joint name="j" axis="0 1 0" range="-9 0.3" frictionloss="0.1"/>
      <geom size="0.1" pos="1 0 0" mass="1"/></body></worldbody>"""
    scene, report = imported(tmp_path, text, contacts=True, limits="hard")
    assert scene.forces["j_friction"].fields.get("w_tol") is None
    assert "limits of a joint are rigid" in " ".join(one.text for one in report.translated)
    result = dap.simulate(scene, t_end=1.0, dt=0.5)
    assert result.quantity("j.angle").values[-1] == pytest.approx(0.3, abs=1e-9)


EXCLUDED = """<worldbody><geom name="floor" type="plane" size="1 1 1"/>
<body name="post"><geom type="box" size="0.1 0.1 0.1"/></body>
<body name="a"><freejoint/><geom size="0.1"/></body>
<body name="b"><freejoint/><geom size="0.1"/><body name="c"><geom size="0.1"/></body></body>
</worldbody><contact><exclude body1="post" body2="a"/><exclude body1="c" body2="a"/>{}</contact>"""
ALL = {("a", "b"), ("a", "world_shapes"), ("b", "post"), ("b", "world_shapes"), ("c", "post"),
       ("c", "world_shapes")}  # fmt: skip


@pytest.mark.parametrize(
    ("more", "fewer"),
    [
        ("", set()),
        ('<exclude body1="a" body2="b"/>', {("a", "b")}),
        ('<exclude body1="world" body2="b"/>', {("b", "world_shapes")}),
    ],
)
def test_links_stay_apart_from_those_that_the_file_names_alone(tmp_path, more, fewer):
    """And meet what else is fixed to these: the floor beside a post, one link of a body of two."""
    scene, _ = imported(tmp_path, EXCLUDED.format(more), contacts=True)
    apart, meeting = {frozenset(pair) for pair in scene.collisions.exclude}, set()
    for (a, one), (b, other) in combinations(scene.shapes.items(), 2):
        one, other = one.fields, other.fields
        bits = one.get("group", 1) & other.get("meets", 1) | other.get("group", 1) & one.get(
            "meets", 1
        )
        bodies = frozenset((one["body"], other["body"]))
        if len(bodies) == 2 and bodies not in apart and bits:
            meeting.add(tuple(sorted(name.rpartition("_")[0] for name in (a, b))))
    assert meeting == ALL - fewer


@pytest.mark.parametrize("flag", ["contact", "constraint", "limit", "frictionloss", "equality"])
def test_flags_that_disable_something_are_heeded(tmp_path, flag):
    text = f"""<option><flag {flag}="disable"/></option><worldbody><geom type="plane" size="1 1 1"/>
      <body name="b"><joint name="j" range="-1 1" frictionloss="1"/><geom size="0.1"/></body>
      <body name="c"><joint name="k"/><geom size="0.1" pos="1 0 0"/></body></worldbody>
      <equality><joint joint1="j" joint2="k"/></equality>"""
    scene, _ = imported(tmp_path, text, contacts=True, limits="hard")
    there = {
        "contact": any(shape.fields.get("collides") for shape in scene.shapes.values()),
        "limit": "lower" in scene.joints["j"].fields,
        "frictionloss": any(one.type == "rot_friction" for one in scene.forces.values()),
        "equality": any(one.type == "follow" for one in scene.joints.values()),
    }
    off = set(there) if flag == "constraint" else {flag}
    assert {name for name, found in there.items() if not found} == off


def test_friction_of_a_pair_is_that_of_the_one_with_priority(tmp_path):
    text = CONTACTS.replace('friction="0.2"', 'friction="0.2" priority="1"')
    scene, _ = imported(tmp_path, text, contacts=True)
    floor, box = (scene.shapes[n].fields["material"] for n in ("world_shapes_plane", "a_box"))
    assert scene.materials[floor].with_[box]["mu"] == 0.2


@pytest.mark.slow
def test_a_box_of_a_file_slides_by_the_friction_of_its_pair(tmp_path):
    """mu = 0.4 of the box and 0.2 of the floor: it ends after v^2 / (2 mu g)."""
    scene, _ = imported(tmp_path, CONTACTS, contacts=True)
    scene.bodies["a"].r_dot = (1.0, 0.0, 0.0)
    result = dap.simulate(scene, t_end=0.3, dt=0.3, contact_step=5e-3)
    assert result.r[-1, 0, 0] == pytest.approx(1.0 / (2 * 0.4 * 9.81), abs=1e-4)


def test_actuators_of_a_group_that_is_disabled_are_left_out(tmp_path):
    """A servo would otherwise hold the joint by a spring."""
    hinge = '<body><joint name="j"/><geom size="1"/></body>'
    motors = '<motor name="m" joint="j"/><position name="p" joint="j" kp="5" group="2"/>'
    text = f'<option actuatorgroupdisable="1 2"/><worldbody>{hinge}</worldbody>'
    scene, report = imported(tmp_path, f"{text}<actuator>{motors}</actuator>")
    assert list(scene.inputs) == ["m"]
    assert not any(force.type == "rot_sda" for force in scene.forces.values())
    assert any("group that is disabled" in one.text for one in report.left_out)


LINE = """<worldbody><body name="a"><joint name="p" axis="0 0 1" {first}/>
  <inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.05"/>
  <body name="b" pos="0.5 0 0"><joint name="q" axis="0 0 1" armature="0.005" {second}/>
    <inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.01 0.005"/></body></body></worldbody>"""
#: Inertias of its joints while the other is free, of the mass matrix ((0.415, 0.065), (.., 0.02)).
FREE = 0.415 - 0.065**2 / 0.02, 0.02 - 0.065**2 / 0.415


def test_springs_may_be_given_by_a_time_constant_and_a_damping_ratio(tmp_path):
    """k = I / (time ratio)^2 and c = 2 I / time, as in MuJoCo's compiler."""
    text = LINE.format(first='springdamper="0.1 0.5"', second='springdamper="0.2 1"')
    scene, report = imported(tmp_path, text)
    assert not report.left_out
    for name, inertia, time, ratio in zip("pq", FREE, (0.1, 0.2), (0.5, 1.0), strict=True):
        fields = scene.forces[f"{name}_spring"].fields
        assert fields["k"] == pytest.approx(inertia / (time * ratio) ** 2, rel=1e-12)
        assert fields["c"] == pytest.approx(2.0 * inertia / time, rel=1e-12)


def test_a_servo_may_have_a_damping_ratio(tmp_path):
    """Of the joint c = 2 ratio gear sqrt(kp I): it moves I / gear^2, and the joint feels gear^2."""
    servos = """<actuator><position joint="p" kp="50" dampratio="1"/>
      <general joint="q" gear="3" gainprm="8" biastype="affine" biasprm="0 -8 0.7"/></actuator>"""
    scene, report = imported(tmp_path, LINE.format(first="", second="") + servos)
    assert not report.left_out
    damping = [scene.forces[f"{name}_spring"].fields["c"] for name in "pq"]
    expected = 2.0 * np.sqrt(50.0 * FREE[0]), 2.0 * 0.7 * 3.0 * np.sqrt(8.0 * FREE[1])
    np.testing.assert_allclose(damping, expected, rtol=1e-12)


def test_kv_and_dampratio_replace_each_other_down_the_classes(tmp_path):
    """A servo has one of the two; that of the lower class, or of the element, is in force."""
    text = """<default><position kv="3"/><default class="low"><position dampratio="1"/></default>
      </default><actuator><position class="low" joint="p" kp="50"/>
      <position class="low" joint="q" kp="50" kv="2"/></actuator>"""
    scene, _ = imported(tmp_path, LINE.format(first="", second="") + text)
    damping = [scene.forces[f"{name}_spring"].fields["c"] for name in "pq"]
    np.testing.assert_allclose(damping, (2.0 * np.sqrt(50.0 * FREE[0]), 2.0), rtol=1e-12)
    both = text.replace('kp="50" kv', 'kp="50" dampratio="1" kv')
    with pytest.raises(dap.SceneError, match="kv or dampratio, not both"):
        imported(tmp_path, LINE.format(first="", second="") + both)


def test_a_spring_by_a_time_constant_needs_a_mass(tmp_path):
    text = LINE.format(first="", second='springdamper="0.2 1"').replace('mass="1"', 'mass="0"')
    text = text.replace("0.01 0.01 0.005", "0 0 0").replace('armature="0.005"', "")
    _, report = imported(tmp_path, text)
    assert any("springdamper: links without mass" in one.text for one in report.left_out)
    with pytest.raises(dap.SceneError, match="both numbers of springdamper are above 0"):
        imported(tmp_path, LINE.format(first='springdamper="0.1 0"', second=""))


SOLID = "<inertial><mass>1</mass></inertial>"
SDF = f"""<sdf version="1.9"><world name="w">
<model name="floor"><static>true</static><link name="l">
<collision name="c"><geometry><plane><normal>0 0 1</normal></plane></geometry>
<surface><friction><ode><mu>0.4</mu></ode></friction></surface></collision></link></model>
<model name="ball"><link name="l">{SOLID}
<visual name="v"><geometry><sphere><radius>2</radius></sphere></geometry></visual>
<collision name="c"><geometry><sphere><radius>1</radius></sphere></geometry></collision>
</link></model></world></sdf>"""


def test_collisions_of_sdf_meet_beside_what_is_seen(tmp_path):
    """The smaller friction of a pair holds, as in Gazebo's ODE and in DART."""
    (tmp_path / "a.sdf").write_text(SDF)
    scene, _ = dap.import_model(tmp_path / "a.sdf", contacts=True)
    floor, seen, ball = (shape.fields for shape in scene.shapes.values())
    assert (seen["radius"], seen.get("collides")) == (2.0, None)
    assert (ball["radius"], ball["collides"], floor["collides"]) == (1.0, True, True)
    (pair,) = (m.with_ for m in scene.materials.values() if m.with_)
    assert [one["mu"] for one in pair.values()] == [0.4]
    scene, _ = dap.import_model(tmp_path / "a.sdf")
    assert [shape.fields["radius"] for shape in scene.shapes.values()] == [2.0]


@pytest.mark.parametrize(("threshold", "e"), [("", None), ("<threshold>0.01</threshold>", 0.5)])
def test_restitution_of_sdf_acts_above_its_threshold(tmp_path, threshold, e):
    """Which is 1e5 m/s by default, as in Gazebo; the smaller one of a pair holds."""
    bounce = f"<bounce><restitution_coefficient>{{}}</restitution_coefficient>{threshold}</bounce>"
    text = SDF.replace("<friction>", bounce.format(0.8) + "<friction>")
    surface = f"<surface>{bounce.format(0.5)}</surface>"
    text = text.replace(
        "1</radius></sphere></geometry>", f"1</radius></sphere></geometry>{surface}"
    )
    (tmp_path / "a.sdf").write_text(text)
    scene, report = dap.import_model(tmp_path / "a.sdf", contacts=True)
    (pair,) = (m.with_ for m in scene.materials.values() if m.with_)
    assert [one.get("e") for one in pair.values()] == [e]
    assert any("bounces below that speed" in one.text for one in report.translated) == bool(e)


BALL = "<collision name='c'><geometry><sphere><radius>1</radius></sphere></geometry></collision>"
CHAIN = f"""<sdf version="1.9"><world name="w">
<model name="floor"><static>true</static><link name="l">{BALL}</link></model>
<model name="m"><joint name="f" type="fixed"><parent>world</parent><child>base</child></joint>
<link name="base">{BALL}</link><link name="arm">{SOLID}{BALL}</link>
<link name="tip">{SOLID}{BALL}</link>
<joint name="j" type="ball"><parent>base</parent><child>arm</child></joint>
<joint name="k" type="ball"><parent>arm</parent><child>tip</child></joint>
%s</model></world></sdf>"""
#: Links of a model by itself, and with links that collide: which pairs of shapes meet.
MEET = {
    "": {("floor", "arm"), ("floor", "tip")},
    "<self_collide>true</self_collide>": {("floor", "arm"), ("floor", "tip"), ("base", "tip")},
}


@pytest.mark.parametrize("self_collide", MEET)
def test_links_stay_apart_from_a_base_that_does_not_move(tmp_path, self_collide):
    """They meet what else is of ground; joined links never meet, nor any of a model by itself."""
    (tmp_path / "a.sdf").write_text(CHAIN % self_collide)
    scene, _ = dap.import_model(tmp_path / "a.sdf", contacts=True)
    shapes = {name.split("::")[0 if "floor" in name else 1].removesuffix("_sphere"): shape.fields
              for name, shape in scene.shapes.items()}  # fmt: skip
    apart = {frozenset(pair) for pair in scene.collisions.exclude} | {
        frozenset(("m::arm", "m::tip"))
    }
    meeting = set()
    for (a, one), (b, other) in combinations(shapes.items(), 2):
        (group, meets), (group_2, meets_2) = (
            (s.get("group", 1), s.get("meets", 1)) for s in (one, other)
        )
        bodies = frozenset((one["body"], other["body"]))
        if len(bodies) == 2 and bodies not in apart and group & meets_2 | group_2 & meets:
            meeting.add((a, b))
    assert meeting == MEET[self_collide]


def test_a_mesh_of_mjcf_is_moved_and_turned_before_it_is_scaled(tmp_path):
    """A tetrahedron: its centroid (1, 1, 1) / 4 less refpos, turned back by a quarter, scaled."""
    path = tmp_path / "mesh.xml"
    path.write_text("""<mujoco><asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"
      refpos="0.05 0.15 0.25" refquat="1 0 0 1" scale="2 3 4"/></asset><worldbody>
      <body><freejoint/><geom type="mesh" mesh="m" density="1"/></body></worldbody></mujoco>""")
    scene, _ = dap.import_model(path)
    (body,) = scene.bodies.values()
    assert body.mass == pytest.approx(2.0 * 3.0 * 4.0 / 6.0, rel=1e-12)
    np.testing.assert_allclose(body.r, [2.0 * 0.1, 3.0 * -0.2, 0.0], atol=1e-12)
