"""Places of sub-assemblies: what follows them, and what is refused there."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from unit.scene.base import with_scenes

import dap3d_core as dap
from dap3d_core.scene import parse

FIRST, SECOND = (Rotation.from_euler("xyz", a) for a in ([0.4, -0.2, 0.9], [-0.3, 0.5, 0.2]))

BOX = """
[bodies.box]
mass = 1.0
Jp = [0.1, 0.1, 0.1]
r = [0.0, 0.0, 0.4]
w = [0.3, 0.2, 0.1]

[contacts.floor]
type = "box_plane"
P_i = "box.O"
size = [0.2, 0.3, 0.4]
mu = 0.3
e = 0.2

[outputs]
gap = "'floor#1.gap'"

[simulation]
t_end = 0.5
dt = 0.1
rtol = 1e-9
"""


def test_a_floor_that_is_left_out_is_that_of_the_part(tmp_path):
    """In a part of a part, turned twice, a box falls on a floor, tips and bounces as in its own
    file. Two runs at a relative tolerance of 1e-9, of six impacts."""
    g = SECOND.apply(FIRST.apply([0.0, 0.0, -1.0])).tolist()
    with_scenes(
        tmp_path,
        part=BOX,
        mid='[include.p]\nfile = "part.toml"\nat = {r = [0.1, 0.2, 0.3], rpy = [0.4, -0.2, 0.9]}\n',
        scene='[include.m]\nfile = "mid.toml"\nat = {r = [1, 0, -1], rpy = [-0.3, 0.5, 0.2]}\n'
        f'[forces.weight]\ntype = "weight"\nwgt = {g}\n{BOX[BOX.index("[simulation]") :]}',
    )
    alone = dap.simulate(parse(f'{BOX}[forces.weight]\ntype = "weight"\n'))
    whole = dap.simulate(tmp_path)
    assert len(alone.events) == len(whole.events) > 2
    inner = FIRST.apply(alone.r[:, 0].copy()) + np.array([0.1, 0.2, 0.3])
    r = SECOND.apply(inner) + np.array([1.0, 0.0, -1.0])
    np.testing.assert_allclose(whole.r[:, 0], r, atol=1e-8)
    gap = alone.quantity("gap").values
    np.testing.assert_allclose(whole.quantity("m_p_gap").values, gap, atol=1e-8)


CURVE = '[functions.f]\ntype = "a"\ncoeff = [0, 0, 1.0]\n'
GRID = '[functions.f]\ntype = "grid"\nx = [-1, 1]\ny = [-1, 1]\nz = [[0, 0], [0, 0]]\n'
FALLS = "[bodies.b]\nmass = 1.0\nJp = [0.1, 0.2, 0.1]\nr = [0.5, 0.6, 0.0]\n"
TURNED, MOVED = {"rpy": [0.0, 0.0, "90 deg"]}, {"r": [1.0, 2.0, 3.0]}
ON_PLANE = {"r": [1.0, 2.0, 0.0], "rpy": [0.0, 0.0, "40 deg"]}


@pytest.mark.parametrize(
    ("element", "stays", "goes"),
    [
        (CURVE + '[contacts.c]\ntype = "point_curve"\nP_i = "b.O"\nfunction = "f"', TURNED, MOVED),
        (GRID + '[contacts.c]\ntype = "ball_surface"\nP_i = "b.O"\nradius = 0.1\nfunction = "f"',
         TURNED, MOVED),
        ('[contacts.c]\ntype = "ball_box"\nP_i = "b.O"\nradius = 0.1\nP_j = "ground.O"\n'
         "size = [1, 2, 3]", TURNED, MOVED),
        ('[forces.c]\ntype = "bushing"\nP_i = "ground.O"\nP_j = "b.O"\nk = [1, 2, 3, 1, 2, 3]',
         TURNED, MOVED),
        ('[joints.c]\ntype = "disk"\nbody_i = "b"\nradius = 0.5', MOVED, ON_PLANE),
        ('[joints.c]\ntype = "rP"\nbody_i = "b"\na_j = "ground.z"\nlength = 0.0', MOVED, ON_PLANE),
        ('[vectors.a]\nbody = "ground"\nsp = [0, 3, 4]\n[joints.c]\ntype = "rP"\nbody_i = "b"\n'
         'a_j = "a"\nlength = 0.0', ON_PLANE, {"r": [1.0, -4.0, 3.0]}),
    ],
    ids=["point_curve", "ball_surface", "ball_box", "bushing", "disk", "rP", "rP-slope"],
)  # fmt: skip
def test_what_lies_by_ground_itself_is_refused_where_that_moves(element, stays, goes):
    """What has its axes from ground follows a part that is moved, and not one that is turned."""
    part, words = parse(FALLS + element), r"\.a/c: (lies by the axes|measures from the) .*ground"
    with pytest.raises(dap.SceneError, match=words) as caught:
        dap.include(dap.Scene(), "a", part, stays)
    assert "joint weld" in str(caught.value) or "point of ground" in str(caught.value)
    whole = dap.Scene()
    dap.include(whole, "a", part, goes)
    dap.compile(whole)


def test_a_body_welded_to_ground_turns_with_the_part():
    """The remedy that the refusal names."""
    held = '[bodies.base]\nmass = 1.0\nJp = [1.0, 1.0, 1.0]\n[joints.w]\ntype = "weld"\n' \
           'body_i = "base"\nbody_j = "ground"\n'  # fmt: skip
    part, whole = parse(FALLS.replace("[0.5, ", "[0.2, ") + held), dap.Scene()
    size = [1.0, 0.6, 3.0]
    part.add_contact("ball_box", "c", P_i="b.O", radius=0.1, P_j="base.O", size=size, e=0.5)
    part.add_force("f", body_i="b", f=[0.0, -5.0, 0.0])
    dap.include(whole, "a", part, {"r": [1.0, 2.0, 3.0], "rpy": [0.4, -0.2, 0.9]})
    alone, there = (dap.simulate(s, t_end=1.0, dt=0.1, rtol=1e-10) for s in (part, whole))
    assert alone.events
    r = FIRST.apply(alone.r[:, 0].copy()) + np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(there.r[:, 0], r, atol=1e-8)


def test_orientations_with_expressions_are_turned(tmp_path):
    """Euler parameters of a body and of its reference pose; points that are drawn move along."""
    with_scenes(
        tmp_path,
        part='[parameters]\na = 0.4\n[bodies.b]\nmass = 1.0\nJp = [1.0, 1.0, 1.0]\n'
        'p = ["= cos(a / 2)", "= sin(a / 2)", 0, 0]\np_0 = ["= cos(a)", "= sin(a)", 0, 0]\n'
        '[animation]\npoints = [{body = "ground", sPp = ["= a", 0, 0]}]\n',
        scene='[include.x]\nfile = "part.toml"\nat = {r = [1, 0, 0], rpy = [0, 0, "90 deg"]}\n',
    )  # fmt: skip
    scene, turn = dap.load(tmp_path).resolved(), Rotation.from_euler("z", 90, degrees=True)
    for p, a in ((scene.bodies["x/b"].p, 0.4), (scene.bodies["x/b"].p_0, 0.8)):
        expected = (turn * Rotation.from_euler("x", a)).as_quat(scalar_first=True)
        np.testing.assert_allclose(p, expected, atol=1e-15)
    np.testing.assert_allclose(scene.animation.points[0].sPp, [1.0, 0.4, 0.0], atol=1e-15)
    part = parse('[bodies.b]\naxis_angle = [0, 0, 1, "= a"]\n')
    with pytest.raises(dap.SceneError, match=r"x/b.axis_angle.*has expressions\n.*give p or rpy"):
        dap.include(dap.Scene(), "x", part, {"rpy": [0.0, 0.0, 1.0]})


def test_a_wrong_orientation_is_reported_once():
    """By the check of the scene, at its own key."""
    part, scene = parse('[bodies.b]\np = "x"\np_0 = [1]\n'), dap.Scene()
    dap.include(scene, "x", part, {"rpy": [0.0, 0.0, 1.0]})
    with pytest.raises(dap.SceneError) as caught:
        dap.compile(scene)
    assert {m.key for m in caught.value.mistakes} == {"bodies.x/b.p", "bodies.x/b.p_0"}


@pytest.mark.parametrize("r", ["[0, 0, nan]", "[0, 0, 1e200]", '[0, 0, "1"]', "[0, 0]", "1"])
def test_a_wrong_place_is_reported_as_such(tmp_path, r):
    with_scenes(tmp_path, part=FALLS, scene=f'[include.a]\nfile = "part.toml"\nat = {{r = {r}}}\n')
    with pytest.raises(dap.SceneError, match=r"scene.toml:3: include.a.at.r = .*3 numbers") as it:
        dap.compile(tmp_path)
    assert len(it.value.mistakes) == 1
