"""Shapes of a scene: every mistake at once, nothing lost in writing, no file of elsewhere."""

import pytest
from support.internals import Collector

import dap3d_core as dap
from dap3d_core.scene import check, parse
from dap3d_core.scene.validate.shapes import SHAPES, mesh_file, read_shapes

GOOD = """\
[bodies.crank]
mass = 1.0
Jp = [0.5, 0.5, 0.1]
[forces.g]
type = "weight"
[shapes.arm]
type = "box"
body = "crank"
size = [0.1, 0.2, 2]
at = [0.0, 0.0, 0.5]
color = "tab:blue"
[shapes.floor]
type = "disk"
body = "ground"
radius = 3.0
"""

BAD = """\
[bodies.crank]
mass = 1.0
Jp = [0.5, 0.5, 0.1]
[shapes.a]
type = "bix"
body = "crnk"
[shapes.b]
body = "crank"
[shapes.c]
type = "sphere"
radius = 0.0
colour = "red"
[shapes.d]
type = "box"
body = "crank"
size = [1.0, -1.0, 1.0]
p = [1.0, 1.0, 0.0, 0.0]
[shapes.e]
type = "cylinder"
body = "crank"
length = 1.0
axis = [0, 0, 0]
at = [0, 0]
[shapes.f]
type = "line"
body = "crank"
points = [[0, 0, 0], [0, 1]]
[shapes.g]
type = "mesh"
body = "crank"
file = "../crank.stl"
scale = "2"
"""

#: Key, line, words that are said.
MISTAKES = [
    ("shapes.a.body", 6, ["there is no body 'crnk'", "did you mean 'crank'?"]),
    ("shapes.a.type", 5, ["unknown shape; one of box", "did you mean 'box'?"]),
    ("shapes.b.type", 7, ["is required; one of box, ellipsoid"]),
    ("shapes.c.body", 9, ["is required: the name of a body"]),
    ("shapes.c.radius", 11, ["greater than 0"]),
    ("shapes.c.colour", 12, ["unknown key", "did you mean 'color'?"]),
    ("shapes.d.size", 16, ["three edges, greater than 0"]),
    ("shapes.d.p", 17, ["unit length"]),
    ("shapes.e.radius", 18, ["is required (m, greater than 0)"]),
    ("shapes.e.axis", 22, ["direction"]),
    ("shapes.e.at", 23, ["3 numbers; it has 2"]),
    ("shapes.f.points", 27, ["point 2", "it has 2"]),
    ("shapes.g.file", 31, ["inside the folder of the scene", "copy the file there"]),
    ("shapes.g.scale", 32, ["write 2 without quotes"]),
]


def written(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text(text)
    return dap.load(path)


def test_every_mistake_is_told_with_its_line(tmp_path):
    with pytest.raises(dap.SceneError) as caught:
        check(written(tmp_path, BAD), dap.load_registry())
    found = {m.key: m for m in caught.value.mistakes}
    assert sorted(found) == sorted(key for key, *_ in MISTAKES)
    for key, line, words in MISTAKES:
        assert found[key].line == line, found[key]
        assert found[key].file.endswith("scene.toml")
        for word in words:
            assert word in str(found[key])


def test_good_shapes_are_read_with_their_defaults(tmp_path):
    scene = written(tmp_path, GOOD)
    checked = check(scene, dap.load_registry())
    assert checked.notes == []
    arm, floor = read_shapes(Collector(scene), checked.body_index)
    assert (arm.name, arm.type, arm.body) == ("arm", "box", 1)
    assert arm.values == {
        "size": (0.1, 0.2, 2.0),
        "at": (0.0, 0.0, 0.5),
        "p": (1.0, 0.0, 0.0, 0.0),
        "color": "tab:blue",
        "collides": False,
        "material": "",
        "group": 1,
        "meets": 1,
    }
    assert (floor.body, floor.values["axis"]) == (0, (0.0, 0.0, 1.0))


def test_a_scene_with_every_shape_reads_back_as_it_was_written():
    scene = dap.Scene(name="all")
    scene.add_body("b")
    fields = {
        "box": {"size": (1.0, 2.0, 3.0), "p": (0.6, 0.8, 0.0, 0.0)},
        "sphere": {"radius": 0.1, "at": (0.1, 0.2, 1 / 3)},
        "ellipsoid": {"size": (1.0, 2.0, 3.0)},
        "height_field": {"heights": ((0.0, 1.0), (0.5, 0.0)), "size": (1.0, 2.0)},
        "cylinder": {"radius": 0.1, "length": 1.0, "axis": (0.0, 1.0, 0.0)},
        "capsule": {"radius": 0.1, "length": 1.0, "collides": True},
        "plane": {"normal": (0.0, 1.0, 0.0), "extent": 5.0},
        "cone": {"radius": 0.1, "length": 1.0},
        "disk": {"radius": 0.5, "color": "tab:red"},
        "line": {"points": ((0.0, 0.0, 0.0), (1.0, 0.0, 0.1))},
        "mesh": {"file": "meshes/crank.stl", "scale": 0.001},
    }
    assert fields.keys() == SHAPES.keys()
    names = [scene.add_shape(type_, body="b", **given) for type_, given in fields.items()]
    assert names == [f"{type_}1" for type_ in fields]
    check(scene, dap.load_registry())
    assert parse(scene.to_toml()) == scene
    with pytest.raises(dap.SceneError, match="one of this name in shapes already"):
        scene.add_shape("box", "box1", body="b", size=(1, 1, 1))


@pytest.mark.parametrize(
    "name", ["/etc/x.stl", "../x.stl", "a/../../x.stl", "C:\\x.stl", "a\\..\\x.stl", "x\0.stl"]
)
@pytest.mark.parametrize("known", [True, False])
def test_a_mesh_does_not_leave_the_folder(tmp_path, name, known):
    assert "inside the folder" in mesh_file(tmp_path if known else None, name).what


def test_a_mesh_does_not_leave_the_folder_by_a_link(tmp_path):
    (tmp_path / "secret.stl").write_text("solid")
    folder = tmp_path / "model"
    folder.mkdir()
    (folder / "x.stl").symlink_to(tmp_path / "secret.stl")
    (folder / "down").symlink_to(tmp_path)
    for name in ("x.stl", "down/secret.stl"):
        assert "leads out of the folder" in mesh_file(folder, name).what


def test_a_mesh_is_read_by_its_name(tmp_path):
    """The folder may differ where the shape is drawn: with a result, the scene has none."""
    (tmp_path / "crank.stl").write_text("solid")
    mesh = '[shapes.m]\ntype = "mesh"\nbody = "crank"\nfile = "crank.stl"\n'
    (shape,) = read_shapes(Collector(written(tmp_path, mesh)), {"ground": 0, "crank": 1})
    assert shape.values["file"] == "crank.stl"


def test_a_mesh_that_is_not_there_is_told_with_the_nearest_name(tmp_path):
    (tmp_path / "crank.stl").write_text("solid")
    assert mesh_file(tmp_path, "crank.stl") == tmp_path / "crank.stl"
    fault = mesh_file(tmp_path, "crnk.stl")
    assert "there is no file" in fault.what
    assert fault.nearest == "crank.stl"
    assert "*.obj, *.stl" in mesh_file(tmp_path, "crank.step").what
