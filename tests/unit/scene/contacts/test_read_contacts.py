"""Limits of joints and rigid stops as contacts: what is read, what is refused.

[materials.NAME]: all are checked, used or not, each mistake once and in its place.

[collisions], shapes that collide, and materials of pairs: what is read, what is refused.
"""

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.scene import check, parse


def hinge(**limits):
    scene = dap.Scene(name="hinge")
    scene.add_body("wheel", mass=2.0, Jp=(0.5, 0.5, 0.3))
    scene.add_joint("rev", "axle", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z",
                    **limits)  # fmt: skip
    return scene


def read(scene):
    return check(scene, dap.load_registry())


def test_each_limit_is_a_contact():
    found = read(hinge(lower="-30 deg", upper=1.0, e=0.2)).contacts
    assert [contact.name for contact in found] == ["axle_lower", "axle_upper"]
    assert [contact.values["bound"] for contact in found] == pytest.approx([-0.5235988, 1.0])
    assert {contact.values["e"] for contact in found} == {0.2}


def test_a_stop_is_a_contact_where_it_has_no_stiffness():
    scene = hinge()
    scene.add_force("rot_stop", "soft", joint="axle", theta_stop=-1.0, k=1e4)
    scene.add_force("rot_stop", "rigid", joint="axle", theta_stop=-2.0, e=0.4)
    found = read(scene)
    assert [force.name for force in found.forces] == ["soft"]
    assert [contact.name for contact in found.contacts] == ["rigid"]


def of_a_ball(scene):
    scene.joints["axle"].type = "sph"
    scene.joints["axle"].fields = {"P_i": "wheel.O", "P_j": "ground.O", "lower": 1.0}


def stop(name, **fields):
    return lambda scene: scene.add_force("rot_stop", name, joint="axle", theta_stop=-1.0, **fields)


@pytest.mark.parametrize(
    ("limits", "change", "words"),
    [
        ({"lower": 1.0, "upper": 0.5}, None, "joints.axle.upper = 0.5: is not above lower = 1"),
        ({"e": 0.5}, None, "joints.axle.e = 0.5: is of limits"),
        ({"lower": "low"}, None, 'joints.axle.lower = "low": should be a number'),
        ({"lower": 0.0}, lambda scene: scene.add_contact("ball_plane", "axle_lower", P_i="wheel.O"),
         "is the name of the lower limit of joint axle"),
        ({}, stop("stop", zeta=0.5), r"forces\.stop\.zeta = 0.5.*rigid without k\s+give k"),
        ({}, stop("axle"), r"its name is one of \[joints\] as well"),
        ({}, of_a_ball, r"joints\.axle\.lower"),  # a joint without a coordinate
    ],
)  # fmt: skip
def test_what_is_no_limit_is_refused(limits, change, words):
    scene = hinge(**limits)
    if change:
        change(scene)
    with pytest.raises(dap.SceneError, match=words):
        read(scene)


BODY = "[bodies.ball]\nmass = 1.0\nJp = [1.0, 1.0, 1.0]\n"
CONTACT = '[contacts.c]\ntype = "ball_plane"\nP_i = "ball.O"\nradius = 0.1\nmaterial = "m"\n'
SHAPES = (
    '[shapes.ball]\ntype = "sphere"\nbody = "ball"\nradius = 0.1\ncollides = true\n'
    'material = "m"\n[shapes.floor]\ntype = "plane"\nbody = "ground"\ncollides = true\n'
    'material = "n"\n'
)


def mistakes(text):
    with pytest.raises(dap.SceneError) as caught:
        check(parse(BODY + text), dap.load_registry())
    return [(m.key, m.what) for m in caught.value.mistakes]


@pytest.mark.parametrize("use", ["", CONTACT, SHAPES], ids=["unused", "contact", "shapes"])
@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("[materials.m]\nmu = -1.0\n", "materials.m.mu", "at least 0"),
        ("[materials.m]\ne = 1.5\n", "materials.m.e", "at most 1"),
        ('[materials.m]\nmu_s = "x"\n', "materials.m.mu_s", "a number, not text"),
        ("[materials.m]\nmu = 0.5\nmu_s = 0.1\n", "materials.m.mu_s", "less than mu = 0.5"),
        ('[materials.m]\nlaw = "hertz"\n', "materials.m.law", '"poisson", "newton"'),
        ("[materials.m.with.m]\nmuu = 0.1\n", "materials.m.with.m.muu", "unknown key"),
        ("[materials.m.with.n]\nmu = -0.1\n", "materials.m.with.n.mu", "at least 0"),
        ("[materials.m.with]\nn = 0.1\n", "materials.m.with.n", "a table of the pair"),
        ("[materials.m]\nwith = 0.1\n", "materials.m.with", "tables by name"),
        ("[materials.m.with.steel]\nmu = 0.1\n", "materials.m.with.steel", "no material 'steel'"),
        ("[materials.m.with.n]\nmu = 0.1\n[materials.n.with.m]\nmu = 0.2\n",
         "materials.n.with.m.mu", "is 0.1 in [materials.m.with.n]"),
    ],
)  # fmt: skip
def test_mistakes(text, key, words, use):
    text = text if "[materials.n" in text else f"{text}[materials.n]\n"
    ((found, what),) = mistakes(text + use)
    assert found == key
    assert words in what


def test_both_tables_of_a_pair_may_stand_where_they_agree():
    """What one leaves out the other may say; expressions of parameters are numbers."""
    text = (
        '[parameters]\nsmooth = 0.1\n[materials.m]\nmu = "= 4 * smooth"\n[materials.n]\n'
        '[materials.m.with.n]\nmu = "= smooth"\n[materials.n.with.m]\nmu = 0.1\ne = 0.5\n'
    )
    found = check(parse(BODY + text + SHAPES), dap.load_registry()).collisions
    assert found.mu.tolist() == [[0.4, 0.1], [0.1, 0.0]]
    assert found.e.tolist() == [[0.0, 0.5], [0.5, 0.0]]


def test_sticking_friction_of_shapes_is_noted():
    """Shapes that collide stick by mu; a declared contact of the material takes its mu_s."""
    text = "[materials.m]\nmu = 0.2\nmu_s = 0.3\n[materials.n]\nmu = 0.2\n"
    valid = check(parse(BODY + text + SHAPES + CONTACT), dap.load_registry())
    (note,) = [note for note in valid.notes if "mu_s" in note]
    assert note.startswith("materials.m.mu_s is of declared contacts alone")
    assert valid.contacts[0].values["mu_s"] == 0.3
    assert not any("no joint and no force" in note for note in valid.notes)


def two_boxes():
    """Two boxes above a floor, of rubber and steel."""
    scene = dap.Scene(name="two boxes")
    scene.add_material("rubber", mu=0.8, e=0.5, with_={"steel": {"mu": 0.6}})
    scene.add_material("steel", mu=0.2)
    for name, material in (("a", "rubber"), ("b", "steel")):
        scene.add_body(name, mass=1.0, Jp=[1.0, 1.0, 1.0])
        scene.add_shape("box", name, body=name, size=[1.0, 1.0, 1.0], collides=True,
                        material=material)  # fmt: skip
    scene.add_shape("plane", "floor", body="ground", collides=True)
    scene.add_force("weight", "gravity")
    return scene


def collisions_of(scene):
    return check(scene, dap.load_registry()).collisions


def test_pairs_have_declared_coefficients_or_geometric_means():
    scene = two_boxes()
    scene.add_collisions(material="steel")
    found = collisions_of(scene)
    assert found.names == ("a", "b", "floor")
    assert found.mu.ravel() == pytest.approx([0.8, 0.6, 0.6, 0.2])
    assert found.e[0, 0] == 0.5
    assert found.e[0, 1] == 0.0  # steel has none
    assert list(found.material) == [0, 1, 1]


def test_bodies_of_joints_and_excluded_ones_do_not_meet():
    scene = two_boxes()
    assert list(collisions_of(scene).apart) == []
    scene.add_joint("sph", P_i="a.O", P_j="b.O")
    scene.add_joint("sph", P_i="a.O", P_j="ground.O")
    scene.add_collisions(exclude=[["b", "ground"]])
    assert list(collisions_of(scene).apart) == [2, 5]  # (0, 2) and (1, 2) of three bodies


def test_a_scene_file_says_the_same(tmp_path):
    scene = two_boxes()
    scene.add_collisions(bodies=["a", "ground"], material="rubber")
    path = scene.save(tmp_path / "scene.toml")
    assert "[collisions]" in path.read_text()
    again = dap.load(path)
    assert again.collisions == scene.collisions
    assert again.materials == scene.materials
    assert collisions_of(again).names == ("a", "floor")


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        (lambda s: s.add_collisions(bodies=["c"]), "collisions.bodies", "there is no body 'c'"),
        (lambda s: s.add_collisions(exclude=["a"]), "collisions.exclude", "pairs of bodies"),
        (lambda s: s.add_collisions(material="wood"), "collisions.material", "no material 'wood'"),
        (lambda s: s.add_shape("mesh", "c", body="b", file="no.stl", collides=True),
         "shapes.c.file", "a mesh that collides is read with the scene"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_with_its_key(change, key, words):
    scene = two_boxes()
    change(scene)
    with pytest.raises(dap.SceneError) as error:
        collisions_of(scene)
    mistake = error.value.mistakes[0]
    assert mistake.key.startswith(key)
    assert words in str(mistake)


def test_a_material_that_there_is_not_is_told_once():
    """[collisions] names it for both shapes that have none of their own."""
    scene = two_boxes()
    for shape in scene.shapes.values():
        shape.fields.pop("material", None)
    scene.add_collisions(material="rubbr")
    with pytest.raises(dap.SceneError, match="did you mean 'rubber'") as caught:
        dap.compile(scene)
    assert len(caught.value.mistakes) == 1


def test_a_mesh_collides_as_its_hull(tmp_path):
    """A tetrahedron, and a point within it that the hull leaves out, of millimetres, mirrored."""
    corners = [(0, 0, 0), (60, 0, 0), (0, 60, 0), (0, 0, 60), (10, 10, 10)]
    lines = ["v {} {} {}".format(*v) for v in corners]
    lines += ["f {} {} {}".format(*f) for f in ((1, 2, 3), (1, 2, 4), (1, 3, 4), (2, 3, 5))]
    (tmp_path / "t.obj").write_text("\n".join(lines))
    scene = two_boxes()
    scene.add_shape("mesh", "t", body="a", file="t.obj", scale=[1e-3, 2e-3, -1e-3],
                    at=[0.1, 0, 0], collides=True)  # fmt: skip
    found = collisions_of(dap.load(scene.save(tmp_path / "scene.toml")))
    k = found.names.index("t")
    first, count = found.corners[k]
    hull = found.vertices[first : first + count] + found.at[k]
    expected = [[0.1, 0, -0.06], [0.1, 0, 0], [0.1, 0.12, 0], [0.16, 0, 0]]
    assert np.array(sorted(hull.round(9).tolist())) == pytest.approx(np.array(expected), abs=1e-15)
    assert found.size[k] == pytest.approx([0.03, 0.06, 0.03], abs=1e-15)


@pytest.mark.parametrize("exclude", ["ab", 3, ["a", "b"]])
def test_what_is_no_list_of_pairs_is_refused(exclude):
    scene = two_boxes()
    scene.add_collisions(exclude=exclude)
    with pytest.raises(dap.SceneError, match=r"collisions.exclude.1 = .*a list of pairs of bodies"):
        collisions_of(scene)
