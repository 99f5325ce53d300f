"""[collisions], shapes that collide, and materials of pairs: what is read, what is refused."""

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.scene import check


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


def read(scene):
    return check(scene, dap.load_registry()).collisions


def test_pairs_have_declared_coefficients_or_geometric_means():
    scene = two_boxes()
    scene.add_collisions(material="steel")
    found = read(scene)
    assert found.names == ("a", "b", "floor")
    assert found.mu.ravel() == pytest.approx([0.8, 0.6, 0.6, 0.2])
    assert found.e[0, 0] == 0.5
    assert found.e[0, 1] == 0.0  # steel has none
    assert list(found.material) == [0, 1, 1]


def test_bodies_of_joints_and_excluded_ones_do_not_meet():
    scene = two_boxes()
    assert list(read(scene).apart) == []
    scene.add_joint("sph", P_i="a.O", P_j="b.O")
    scene.add_joint("sph", P_i="a.O", P_j="ground.O")
    scene.add_collisions(exclude=[["b", "ground"]])
    assert list(read(scene).apart) == [2, 5]  # (0, 2) and (1, 2) of three bodies


def test_a_scene_file_says_the_same(tmp_path):
    scene = two_boxes()
    scene.add_collisions(bodies=["a", "ground"], material="rubber")
    path = scene.save(tmp_path / "scene.toml")
    assert "[collisions]" in path.read_text()
    again = dap.load(path)
    assert again.collisions == scene.collisions
    assert again.materials == scene.materials
    assert read(again).names == ("a", "floor")


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
        read(scene)
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
    found = read(dap.load(scene.save(tmp_path / "scene.toml")))
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
        read(scene)
