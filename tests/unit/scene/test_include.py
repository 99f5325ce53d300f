"""Sub-assemblies: names, places, parameters, and mistakes at their lines."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dap3d_core as dap
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
    (folder / "pair.toml").write_text(
        '[include.leg]\nfile = "parts/leg.toml"\nat = {r = [2.0, 0.0, 0.0]}\n'
    )
    (folder / "scene.toml").write_text(
        '[include.a]\nfile = "pair.toml"\nat = {rpy = [0.0, 0.0, "90 deg"]}\n'
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
