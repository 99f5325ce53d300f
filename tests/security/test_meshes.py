"""Mesh files that claim, lie, or name other files."""

import struct
import sys

import pytest

import dap3d_core as dap
from dap3d_core.view import shapes

pytest.importorskip("trimesh")

TRIANGLE = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
CORNERS = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"
HEAD = b"\0" * 80


def test_good_ones_are_read(tmp_path):
    (tmp_path / "a.stl").write_bytes(HEAD + struct.pack("<I", 1) + TRIANGLE)
    (tmp_path / "a.obj").write_bytes(CORNERS + b"f 1 2 3\n")
    for name in ("a.stl", "a.obj"):
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
    ],
)
def test_bad_ones_are_told(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    assert isinstance(shapes._mesh(tmp_path, name), str)


def test_large_ones_are_not_read(tmp_path):
    with (tmp_path / "large.stl").open("wb") as file:
        file.truncate(shapes.LARGEST_MESH + 1)
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


def test_all_meshes_of_a_page_together_are_bounded(tmp_path, monkeypatch):
    """A thousand shapes may name one large file."""
    monkeypatch.setattr(shapes, "MOST_IN_ALL", 5)
    (tmp_path / "a.obj").write_bytes(CORNERS + b"f 1 2 3\n" * 2)
    scene = dap.Scene(name="many", path=tmp_path / "scene.toml")
    for k in range(10):
        scene.add_shape("mesh", f"m{k}", body="ground", file="a.obj")
    found = shapes.drawn(scene, [], [])
    assert sum(mesh["count"] for mesh in found.meshes) == 6
    assert len(found.notes) == 7
