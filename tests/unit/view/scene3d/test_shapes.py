"""Mesh files that claim, lie, or name other files."""

import os
import struct
import sys
from io import BytesIO

import pytest

import dap3d_core as dap
from dap3d_core.scene.files import read_mesh
from dap3d_core.view.scene3d import shapes

pytest.importorskip("trimesh")

TRIANGLE = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
CORNERS = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"
HEAD = b"\0" * 80
COUNTED = struct.pack("<4i9f3f2f3i", 3, 1, 1, 1, *(0, 0, 0, 1, 0, 0, 0, 1, 0), *[0] * 5, 0, 1, 2)


def test_good_ones_are_read(tmp_path):
    (tmp_path / "a.stl").write_bytes(HEAD + struct.pack("<I", 1) + TRIANGLE)
    (tmp_path / "a.obj").write_bytes(CORNERS + b"f 1 2 3\n")
    (tmp_path / "a.msh").write_bytes(COUNTED)
    for name in ("a.stl", "a.obj", "a.msh"):
        vertices, triangles = shapes._mesh(tmp_path, name)
        assert (len(vertices), len(triangles)) == (3, 1)


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("claims.stl", HEAD + struct.pack("<I", 0xFFFFFFFF) + TRIANGLE),
        ("ascii.stl", b"solid x" + HEAD[7:] + struct.pack("<I", 0xFFFFFFFF) + TRIANGLE),
        ("empty.stl", b""),
        ("zip.stl", b"PK\x03\x04" + b"\0" * 1000),
        ("gz.obj", b"\x1f\x8b\x08" + b"\0" * 1000),
        ("gltf.obj", b'{"asset": {"version": "2.0"}, "buffers": [{"uri": "file:///etc/passwd"}]}'),
        ("pickle.stl", b"\x80\x04cos\nsystem\n(S'touch pwned'\ntR."),
        ("far.obj", CORNERS + b"f 1 2 4000000000\n"),
        ("back.obj", CORNERS + b"f -1 -2 -4000000000\n"),
        ("nan.obj", b"v nan inf 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("many.obj", CORNERS + b"f 1 2 3\n" * (shapes.MOST_TRIANGLES + 1)),
        ("bytes.obj", bytes(range(256)) * 100),
        ("words.obj", b"v " * 100_000),
        ("short.msh", COUNTED[:-4]),
        ("claims.msh", b"\xff" * 16 + COUNTED[16:]),
        ("far.msh", COUNTED[:-1] + b"\1"),
    ],
)
def test_bad_ones_are_told(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    assert isinstance(shapes._mesh(tmp_path, name), str)


@pytest.mark.slow
def test_large_ones_are_not_read(tmp_path):
    with (tmp_path / "large.stl").open("wb") as file:
        file.truncate(read_mesh.LARGEST_MESH + 1)
    assert "MiB" in shapes._mesh(tmp_path, "large.stl")


def test_materials_are_other_files_and_are_not_read(tmp_path):
    """An OBJ names files of materials, these name pictures."""
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd /etc/passwd\n")
    lines = b"mtllib a.mtl\nmtllib /etc/passwd\nmtllib ../../etc/passwd\nusemtl a\n"
    (tmp_path / "a.obj").write_bytes(lines + CORNERS + b"f 1 2 3\n")
    shapes._mesh(tmp_path, "a.obj")  # trimesh is loaded
    opened = []
    sys.addaudithook(lambda e, a: opened.append(str(a[0])) if e == "open" else None)
    assert not isinstance(shapes._mesh(tmp_path, "a.obj"), str)
    assert [name for name in opened if "encodings" not in name] == [str(tmp_path / "a.obj")]


GROUPS = "".join(f"g g{k}\no o{k}\nusemtl m{k}\nf 1 2 3 # usemtl n\n" for k in range(400)).encode()
FACET = (
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet"
)
SOLIDS = "".join(f"solid s{k}\n{FACET}\nendsolid s{k}\n" for k in range(400)).encode()


@pytest.mark.parametrize(
    ("name", "data", "joined"),
    [("a.obj", CORNERS + GROUPS, "_without_groups"), ("a.stl", SOLIDS, "_one_solid")],
)
def test_groups_are_read_as_one_mesh(tmp_path, name, data, joined):
    """To join meshes takes a time that grows with the square of their number."""
    import trimesh

    (tmp_path / name).write_bytes(data)
    vertices, triangles = shapes._mesh(tmp_path, name)
    assert (len(vertices), len(triangles)) == (3, 400)
    whole = BytesIO(getattr(read_mesh, joined)(data))
    found = trimesh.load_scene(whole, file_type=name[-3:], skip_materials=True)
    assert len(found.geometry) == 1


def test_lines_of_an_obj_may_be_continued(tmp_path):
    text = b"# v 9 9 9\n" + CORNERS + b"v 1 1 \\\r\n 0\r\nvt 0 0\nf 1/1 2/1 \\\n3/1\nf 2 4 3\n"
    (tmp_path / "a.obj").write_bytes(text)
    vertices, triangles = shapes._mesh(tmp_path, "a.obj")
    corners = vertices[triangles].reshape(-1, 3).tolist()
    expected = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert corners == expected


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("mesh", {"file": "a.obj"}),
        ("mesh", {"file": "b.obj", "scale": 1e100}),
        ("line", {"points": [[0, 0, 0], [1e99, 0, 0]]}),
        ("box", {"size": [1e99, 1.0, 1.0]}),
        ("sphere", {"radius": 1e16}),
    ],
)
def test_what_no_graphics_can_show_is_told_and_left_out(tmp_path, kind, fields):
    """A vertex of 1e300 m is a number, but not in single precision."""
    (tmp_path / "a.obj").write_bytes(b"v 1e300 0 0\nv 1 0 0\nv 0 -1e300 0\nf 1 2 3\n")
    (tmp_path / "b.obj").write_bytes(CORNERS.replace(b"1 0 0", b"1e250 0 0") + b"f 1 2 3\n")
    scene = dap.Scene(name="far", path=tmp_path / "scene.toml")
    scene.add_shape(kind, "far", body="ground", **fields)
    scene.add_shape("sphere", "near", body="ground", radius=1.0)
    found = shapes.scene_shapes(scene, [], [])
    assert [note.partition(":")[0] for note in found.notes] == ["shape far is not drawn"]
    assert [mark.owner for mark in found.marks] == ["near"]
    assert len(found.meshes) + len(found.lines) == 0


def test_a_capsule_ends_in_halves_of_balls():
    scene = dap.Scene(name="capsule")
    scene.add_shape("capsule", "leg", body="ground", radius=0.1, length=2.0)
    marks = shapes.scene_shapes(scene, [], []).marks
    ball = ("sphere", (0.1, 0.1, 0.1))
    assert [(mark.kind, mark.size) for mark in marks] == [("cylinder", (0.1, 0.1, 2.0)), ball, ball]
    assert [mark.at[2] for mark in marks] == [0.0, -1.0, 1.0]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="links and FIFOs of POSIX")
def test_links_in_a_circle_and_fifos_are_mistakes_of_the_scene(tmp_path):
    (tmp_path / "loop.obj").symlink_to("loop.obj")
    os.mkfifo(tmp_path / "fifo.stl")
    scene = dap.Scene(name="bad", path=tmp_path / "scene.toml")
    scene.add_body("a", mass=1.0, Jp=[1.0, 1.0, 1.0])
    for name in ("loop.obj", "fifo.stl"):
        scene.add_shape("mesh", name.partition(".")[0], body="a", file=name)
    with pytest.raises(dap.SceneError) as caught:
        dap.compile(scene)
    words = str(caught.value)
    for told in ("shapes.loop.file", "leads back to itself", "shapes.fifo.file", "no regular file"):
        assert told in words


def test_all_meshes_of_a_page_together_are_bounded(tmp_path, monkeypatch):
    """A thousand shapes may name one large file."""
    monkeypatch.setattr(shapes, "MOST_IN_ALL", 5)
    (tmp_path / "a.obj").write_bytes(CORNERS + b"f 1 2 3\n" * 2)
    scene = dap.Scene(name="many", path=tmp_path / "scene.toml")
    for k in range(10):
        scene.add_shape("mesh", f"m{k}", body="ground", file="a.obj")
    found = shapes.scene_shapes(scene, [], [])
    assert sum(len(mesh.triangles) for mesh in found.meshes) == 6
    assert len(found.notes) == 7
