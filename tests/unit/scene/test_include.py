"""Sub-assemblies: names, places, parameters, and mistakes at their lines."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from unit.scene.base import with_scenes

import dap3d_core as dap
from dap3d_core.scene import check as checked
from dap3d_core.scene import parse

LEG = """
[scene]
name = "leg"

[requires]
dap3d = ">=0.1"

[parameters]
L = 1.0
half = "= L / 2"

[bodies.rod]
mass = 1.0
Jp = [0.1, 0.1, 0.01]
r = [0.0, 0.0, "= -half"]
w = [0.0, 1.0, 0.0]

[bodies.bob]
mass = 0.5
Jp = [0.01, 0.01, 0.01]
r = [0.0, 0.3, "= -L"]
rpy = [0.2, 0.0, 0.1]
r_dot = [0.0, 0.4, 0.0]

[points.top]
body = "rod"
sPp = [0.0, 0.0, "= half"]

[points.tip]
body = "rod"
sPp = [0.0, 0.0, "= -half"]

[points.anchor]
body = "ground"
sPp = [0.1, 0.0, 0.0]

[vectors.slope]
body = "ground"
sp = [0.6, 0.0, 0.8]

[joints.hinge]
type = "rev"
P_i = "top"
P_j = "ground.O"
a_i = "rod.y"
a_j = "ground.y"

[inputs.u]
value = 0.5

[forces.weight]
type = "weight"

[forces.spring]
type = "ptp"
k = 10.0
l0 = 0.5
P_i = "bob.O"
P_j = "tip"

[forces.pull]
type = "ptp"
P_i = "bob.O"
P_j = "anchor"
k = 1.0
l0 = 0.2

[forces.push]
type = "f"
body_i = "bob"
f = [0.3, -0.2, 0.1]

[forces.turn]
type = "rot_sda"
v_i = "rod.x"
v_j = "slope"
axis = "rod.y"
k = 3.0
input = "u"

[shapes.floor]
type = "cylinder"
body = "ground"
radius = 0.1
length = 0.2

[outputs]
height = "rod.r.z + twice"
twice = "2 * tip.r.z"

[animation]
points = [{body = "ground", sPp = [1.0, 0.0, 0.0]}]
"""

WHOLE = """
[parameters]
d = 2.0

[include.left]
file = "parts/leg.toml"

[include.right]
file = "parts/leg.toml"
at = {r = [0.0, "= d", 0.3], rpy = [0.0, "20 deg", "90 deg"]}
parameters = {L = "= d / 4"}

[forces.weight]
type = "weight"
wgt = [0.0, 0.0, -1.0]

[simulation]
t_end = 1.0
dt = 0.05
rtol = 1e-10
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "leg.toml").write_text(LEG)
    (tmp_path / "scene.toml").write_text(WHOLE)
    return tmp_path


def test_a_turned_sub_assembly_moves_as_it_does_alone(folder):
    """Its motion is that of its own file in axes turned with it, weight included.
    Two runs at a relative tolerance of 1e-10."""
    result = dap.simulate(folder)
    turn = Rotation.from_euler("xyz", [0.0, np.radians(20.0), np.radians(90.0)])
    for name, length, R, origin in (
        ("left", 1.0, Rotation.identity(), np.zeros(3)),
        ("right", 0.5, turn, np.array([0.0, 2.0, 0.3])),
    ):
        alone = dap.load(folder / "parts" / "leg.toml")
        alone.parameters["L"] = length
        alone.forces["weight"].fields["wgt"] = tuple(R.inv().apply([0.0, 0.0, -1.0]))
        alone = dap.simulate(alone, t_end=1.0, dt=0.05, rtol=1e-10)
        for body in ("rod", "bob"):
            r, w = (alone.quantity(f"{body}.{q}").values for q in ("r", "w"))
            found, spin = (result.quantity(f"{name}/{body}.{q}").values for q in ("r", "w"))
            np.testing.assert_allclose(found, R.apply(r.copy()) + origin, atol=1e-8)
            np.testing.assert_allclose(spin, R.apply(w.copy()), atol=1e-7)
    height = result.quantity("left_height").values
    twice = 2.0 * result.quantity("left/tip.r.z").values
    np.testing.assert_allclose(height, result.quantity("left/rod.r.z").values + twice, atol=1e-14)


def test_the_scene_that_is_written_has_all_parts(folder):
    """Its file gives the same scene without the others; forces on whole scenes stay out."""
    scene = dap.load(folder)
    again = folder / "again.toml"
    scene.save(again)
    assert dap.load(again) == scene
    assert scene.parameters["right_L"] == "= d / 4"
    forces = ("spring", "pull", "push", "turn")
    names = [f"{name}/{force}" for name in ("left", "right") for force in forces]
    assert list(scene.forces) == ["weight", *names]
    assert "left: weight left out" in scene.notes[0]
    assert scene.forces["left/turn"].fields["input"] == "left_u"
    assert scene.joints["left/hinge"].fields["P_j"] == "ground.O"
    assert scene.points[scene.joints["right/hinge"].fields["P_j"]].sPp == (0.0, "= d", 0.3)
    axis = scene.shapes["right/floor"].fields["axis"]
    np.testing.assert_allclose(axis, [0.0, np.sin(np.radians(20.0)), np.cos(np.radians(20.0))])
    assert scene.shapes["right/floor"].fields["at"] == (0.0, "= d", 0.3)
    assert scene.animation.points[1].body == "ground"
    assert scene.requires == {"dap3d": ">=0.1"}


def test_scripts_include_scenes(folder):
    scene = dap.Scene(name="made by a script")
    part = dap.load(folder / "parts" / "leg.toml")
    dap.include(scene, "left", part, at={"r": [1.0, 0.0, 0.0]})
    dap.include(scene, "right", part, at={"axis_angle": [0, 0, 1, 0.5]}, parameters={"L": 2.0})
    assert scene.parameters["right_L"] == 2.0
    assert part == dap.load(folder / "parts" / "leg.toml")
    with pytest.raises(dap.SceneError, match="left has one of this name"):
        dap.include(scene, "left", part)
    for arguments, words in (
        ({"name": "a b"}, "a word of letters"),
        ({"name": "x", "at": {"R": [0, 0, 0]}}, "unknown key.*did you mean 'r'"),
        ({"name": "x", "at": {"r": [0, 0]}}, "3 numbers"),
        ({"name": "x", "at": {"p": [1, 0, 0, 0], "rpy": [0, 0, 0]}}, "give one of p and rpy"),
        ({"name": "x", "at": {"p": [1, 1, 0, 0]}}, "unit length"),
        ({"name": "x", "parameters": {"LL": 1.0}}, "no such parameter; it has L, half"),
    ):
        with pytest.raises(dap.SceneError, match=words):
            dap.include(scene, part=part, **arguments)


def test_sub_assemblies_within_one_another(folder):
    """Places add up: 2 m along the axis x of a part that is turned to y."""
    with_scenes(
        folder,
        pair='[include.leg]\nfile = "parts/leg.toml"\nat = {r = [2.0, 0.0, 0.0]}\n',
        scene='[include.a]\nfile = "pair.toml"\nat = {rpy = [0.0, 0.0, "90 deg"]}\n',
    )
    scene = dap.load(folder).resolved()
    np.testing.assert_allclose(scene.bodies["a/leg/rod"].r, [0.0, 2.0, -0.5], atol=1e-15)
    leg = folder / "parts" / "leg.toml"
    leg.write_text(LEG.replace('P_i = "top"', 'P_i = "topp"'))
    line = leg.read_text().splitlines().index("[joints.hinge]") + 3
    with pytest.raises(dap.SceneError, match=f"{re.escape(str(leg))}:{line}: .*no point 'topp'"):
        dap.compile(folder)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[include.a]\n", r"scene.toml:1: include.a.file: is required"),
        ('[include.a]\nfile = "parts/log.toml"\n', r":2: include.a.file.*did you mean.*leg.toml"),
        ('[include.a]\nfile = "scene.toml"\n', r"in a circle: scene.toml -> scene.toml"),
        ('[include.a]\nfile = "parts/leg.toml"\nplace = 1\n', r":3: include.a.place.*unknown key"),
        ('[include.a]\nfile = "parts/leg.toml"\nat = 1\n', r":3: include.a.at.*a table"),
        ("[include]\na = 1\n", r"\[include.a\]"),
        (
            '[include.a]\nfile = "parts/leg.toml"\n[outputs]\nx = "a/rod.r.x"\n',
            r":4: outputs.x.*sub-assembly 'a' .*in quotes: 'a/rod.r.x'",
        ),
    ],
)
def test_mistakes_are_located(folder, text, words):
    (folder / "scene.toml").write_text(text)
    with pytest.raises(dap.SceneError, match=words):
        dap.compile(folder)


def test_mistakes_of_a_part_stand_in_its_file(folder):
    leg = folder / "parts" / "leg.toml"
    for old, new, key in (
        ("mass = 0.5", "mas = 0.5", "bodies.left/bob.mas"),
        ("k = 3.0", 'k = "three"', "forces.right/turn.k"),
    ):
        leg.write_text(LEG.replace(old, new))
        with pytest.raises(dap.SceneError) as caught:
            dap.compile(folder)
        found = {(m.file, m.line, m.key) for m in caught.value.mistakes}
        assert (str(leg), leg.read_text().splitlines().index(new) + 1, key) in found


def test_a_text_includes_nothing_and_an_expression_turns_nothing():
    scene = parse('[include.a]\nfile = "x.toml"\n')
    with pytest.raises(dap.SceneError, match="a text has no folder"):
        dap.compile(scene)
    scene = dap.Scene(parameters={"a": 1.0})
    with pytest.raises(dap.SceneError, match="expressions may move a sub-assembly, not turn it"):
        dap.include(scene, "b", dap.load("pen1"), {"rpy": [0.0, 0.0, "= a"]})


SLIDER = """
[parameters]
lean = 0.3

[bodies.wheel]
mass = 1.0
Jp = [0.1, 0.2, 0.3]
r = [0.0, 0.0, 0.5]
rpy = ["= lean", "= -lean", "40 deg"]
w = [0.0, 0.0, 0.0]

[bodies.block]
mass = 2.0
Jp = [0.1, 0.2, 0.3]
r = [0.2, 0.0, 0.0]
r_dot = [0.4, 0.0, 0.0]

[bodies.sun]
mass = 1.0
Jp = [0.1, 0.1, 0.1]
r = [0.5, 0.0, 0.0]
w = [0.0, 0.0, 2.0]

[points.centre]
body = "ground"
sPp = [0.5, 0.0, 0.0]

[points.rim]
body = "ground"
sPp = [0.2, 0.0, 0.0]

[joints.pin]
type = "sph"
P_i = "wheel.O"
P_j = "ground.O"

[joints.bearing]
type = "rev"
P_i = "sun.O"
P_j = "centre"
a_i = "sun.z"
a_j = "ground.z"

[joints.planet]
type = "rev"
P_i = "planet.O"
P_j = "rim"
a_i = "planet.z"
a_j = "ground.z"

[bodies.planet]
mass = 1.0
Jp = [0.1, 0.1, 0.1]
r = [0.2, 0.0, 0.0]

[joints.rail]
type = "tran"
SIDES
a_j = "AXIS"

[forces.pull]
type = "motor"
joint = "bearing"
torque = 0.3
"""


@pytest.mark.parametrize(
    ("sides", "axis"),
    [
        ('P_i = "block.O"\nP_j = "ground.O"', "ground.x"),
        ('P_i = "ground.O"\nP_j = "block.O"', "block.x"),
        ('d = "line"', "ground.x"),
        ('P_i = "block.O"\nP_j = "ground.O"\nA_c = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]', "ground.x"),
    ],
)
def test_what_is_taken_from_ground_unwritten_is_turned_too(sides, axis):
    """A slider keeps its orientation to the axes of ground, from either side: it starts where its
    own file has it. Euler parameters are correct to rounding, as is the correction of the start."""
    text = SLIDER.replace("SIDES", sides).replace("AXIS", axis)
    if "line" in sides:
        text += '\n[vectors2.line]\nP_i = "block.O"\nP_j = "ground.O"\n'
    if "A_c" in sides:
        text = text.replace("\nr_dot", '\nrpy = [0, 0, "90 deg"]\nr_dot')
    scene, part = dap.Scene(), parse(text)
    dap.include(scene, "a", part, {"r": [1.0, 2.0, 3.0], "rpy": [0.3, -0.7, 1.1]})
    R = Rotation.from_euler("xyz", [0.3, -0.7, 1.1])
    alone, result = (dap.simulate(s, t_end=0.1, dt=0.1, rtol=1e-10) for s in (part, scene))
    np.testing.assert_allclose(alone.r[0, 1], [0.2, 0.0, 0.0], atol=1e-12)
    for k in range(4):
        r = result.r[:, k] - np.array([1.0, 2.0, 3.0])
        np.testing.assert_allclose(r, R.apply(alone.r[:, k].copy()), atol=1e-9)
        turned = R * Rotation.from_quat(alone.p[:, k], scalar_first=True)
        found = Rotation.from_quat(result.p[:, k], scalar_first=True)
        assert (turned.inv() * found).magnitude().max() < 1e-9


def test_points_that_are_left_out_are_those_of_the_part():
    """A ring without P_j has its centre in the origin of ground, wherever that comes to lie."""
    part = dap.load("planetary")
    del part.joints["planet_and_ring"].fields["P_j"]
    part.forces["torque"] = type(part.forces["torque"])(
        "torque", "motor", {"joint": "bearing_of_sun", "torque": 0.05}
    )
    scene = dap.Scene()
    dap.include(scene, "a", part, {"r": [1.0, 2.0, 3.0], "rpy": [0.3, -0.7, 1.1]})
    alone, result = (dap.simulate(s, t_end=1.0, dt=0.5, rtol=1e-10) for s in (part, scene))
    w = Rotation.from_euler("xyz", [0.3, -0.7, 1.1]).apply(alone.w[-1].copy())
    np.testing.assert_allclose(result.w[-1], w, rtol=1e-8)
    fields = scene.joints["a/planet_and_ring"].fields
    assert fields["P_j"] == "a/ground O"
    assert "P_i" not in fields, "that is the hinge's"


ARM = """
[parameters]
L = 0.5
T = 0.2

[inputs.u]
value = 0.0

[bodies.rod]
mass = 1.0
Jp = [0.1, 0.1, 0.01]
r = [0.0, 0.0, "= -L"]

[points.top]
body = "rod"
sPp = [0.0, 0.0, "= L"]

[joints.hinge]
type = "rev"
P_i = "top"
P_j = "ground.O"
a_i = "rod.y"
a_j = "ground.y"
upper = 0.3

[joints.hold]
type = "weld"
body_i = "rod"
body_j = "ground"
active = "t < T"

[forces.push]
type = "n"
body_i = "rod"
n = [0.0, 2.0, 0.0]
input = "u"

[outputs]
height = "L * rod.r.z + mod(t, 1) * 0"
gap = "hinge_upper.gap"
turn = {value = "hinge.angle / L", unit = "rad"}
"""


def test_words_of_expressions_are_those_of_the_part(tmp_path):
    """Its parameters in outputs and conditions, though the whole has others of the same names."""
    with_scenes(
        tmp_path,
        arm=ARM,
        scene='[parameters]\nL = 7.0\nT = 9.0\n[include.a]\nfile = "arm.toml"\n'
        "[simulation]\nt_end = 0.4\ndt = 0.1\n",
    )
    run = dap.start(tmp_path)
    run.step(0.4, inputs={"a_u": 1.0})
    result = run.result()
    angle = result.quantity("a/hinge.angle").values
    np.testing.assert_allclose(result.quantity("a_height").values, 0.5 * result.r[:, 0, 2])
    np.testing.assert_allclose(result.quantity("a_turn").values, 2.0 * angle)
    np.testing.assert_allclose(result.quantity("a_gap").values, 0.3 - angle)
    assert angle[-1] > 0.0
    (event,) = result.events
    assert (event.name, event.kind) == ("a/hold", "break")
    assert event.t == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("L = 0.5", 'L = "= M"', r"arm.toml:3: parameters.a_L.*no parameter 'a_M'"),
        ("L * rod.r.z", "M * rod.r.z", r"arm.toml:39: outputs.a_height.*no quantity 'a_M'"),
        ("value = 0.0", 'value = "no"', r"arm.toml:7: inputs.a_u.value"),
        ("t < T", "t < M", r"arm.toml:30: joints.a/hold.active.*no quantity 'a_M'"),
    ],
)
def test_a_part_knows_no_words_of_the_whole(tmp_path, old, new, place):
    """They are mistakes, at their lines in the file of the part."""
    whole = '[parameters]\nM = 1.0\n[include.a]\nfile = "arm.toml"\n'
    with_scenes(tmp_path, arm=ARM.replace(old, new), scene=whole)
    with pytest.raises(dap.SceneError, match=place):
        dap.compile(tmp_path)


def test_wrong_parameters_are_reported_where_they_are_given(tmp_path):
    with_scenes(
        tmp_path, arm=ARM, scene='[include.a]\nfile = "arm.toml"\nparameters = {L = "long"}\n'
    )
    with pytest.raises(dap.SceneError, match=r"scene.toml:3: parameters.a_L"):
        dap.compile(tmp_path)


PILE = """
[shapes.floor]
type = "plane"
body = "ground"
collides = true

[materials.ice]
mu = 0.4

[materials.ice.with.steel]
mu = "= m"

[materials.steel]
mu = 0.4

[parameters]
m = 0.1

[collisions]
bodies = ["a", "b", "ground"]
exclude = [["a", "b"]]
material = "ice"
"""


def test_collisions_of_parts_hold_in_the_whole():
    """Pairs that do not meet, bodies that do, the material of shapes, tables of pairs."""
    part = parse(PILE)
    for k, name in enumerate("abc"):
        part.add_body(name, mass=1.0, Jp=[1.0, 1.0, 1.0], r=[5.0 * k, 0.0, 1.0])
        part.add_shape("sphere", name, body=name, radius=0.1, collides=True)
    part.shapes["b"].fields["material"] = "steel"
    scene = dap.Scene()
    dap.include(scene, "x", part)
    scene.add_collisions(exclude=[["x/a", "ground"]])
    dap.include(scene, "y", part)
    found = checked(scene, dap.load_registry()).collisions
    assert found.names == ("x/floor", "x/a", "x/b", "y/floor", "y/a", "y/b")
    x, y = ({name: k for k, name in enumerate("0abc", 3 * n)} for n in (0, 1))
    width = 1 + len(scene.bodies)
    pairs = {(0, x["a"]), (x["a"], x["b"]), (y["a"], y["b"])}
    assert set(found.apart.tolist()) == {i * width + j for i, j in pairs}
    pair = found.mu[found.material[1], found.material[2]]
    assert pair == found.mu[found.material[4], found.material[5]] == 0.1
    assert parse(scene.to_toml()) == scene


def test_words_that_are_no_names_stay():
    """Choices, colours and files that have the name of a body of the part."""
    part = parse(
        '[bodies.wheel]\ncolor = "z"\n[bodies.z]\n[bodies.newton]\n'
        '[joints.roll]\ntype = "disk"\nbody_i = "wheel"\nslip = "z"\n'
        '[contacts.c]\ntype = "ball_plane"\nP_i = "newton.O"\nradius = 0.1\nlaw = "newton"\n'
        '[shapes.s]\ntype = "mesh"\nbody = "z"\nfile = "wheel.stl"\n'
        '[shapes.t]\ntype = "mesh"\nbody = "z"\nfile = "made.stl"\n'
    )
    part.files["made.stl"] = Path("elsewhere.stl")
    scene = dap.Scene()
    dap.include(scene, "x", part, {"r": [1.0, 0.0, 0.0]})
    assert scene.bodies["x/wheel"].color == "z"
    assert scene.joints["x/roll"].fields == {"body_i": "x/wheel", "slip": "z"}
    assert scene.contacts["x/c"].fields["law"] == "newton"
    assert scene.shapes["x/s"].fields == {"body": "x/z", "file": "wheel.stl"}
    assert scene.files == {scene.shapes["x/t"].fields["file"]: Path("elsewhere.stl")}


def test_forces_on_all_bodies_stay_out_whatever_they_name():
    """By what their type does; a type that is not installed is named in the note."""
    part = parse("[bodies.b]\n[functions.b]\n")
    part.add_force("weight", "g", of="b")
    part.add_force("wieght", "w")
    part.add_force("drag", "x", body_i="b")
    scene = dap.Scene()
    dap.include(scene, "a", part)
    assert list(scene.forces) == ["a/x"]
    assert scene.notes[0].startswith("a: g, w (its type 'wieght' is not installed) left out")


def test_bodies_of_two_parts_touch():
    """A ball of one part is pushed into that of another: by equal masses and e = 1 it stops.
    Both contacts with the floors are those of the parts; exact but for rounding of the event."""
    ball, scene = dap.Scene(), dap.Scene()
    ball.add_body("ball", mass=1.0, Jp=[0.01, 0.01, 0.01], r=[0.0, 0.0, 0.1])
    ball.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1)
    for name, x in (("a", 0.0), ("b", 0.5)):
        dap.include(scene, name, ball, {"r": [x, 0.0, 0.3]})
    scene.bodies["a/ball"].r_dot = (1.0, 0.0, 0.0)
    scene.add_contact("ball_ball", "both", P_i="a/ball.O", radius_i=0.1, P_j="b/ball.O",
                      radius_j=0.1, e=1.0)  # fmt: skip
    scene.add_force("weight")
    result = dap.simulate(scene, t_end=0.5, dt=0.1)
    np.testing.assert_allclose(result.r[-1], [[0.3, 0.0, 0.4], [0.7, 0.0, 0.4]], atol=1e-9)
