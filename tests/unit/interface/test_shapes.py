"""Kinds of shapes of other packages: found by entry points, read as others, drawn as meshes."""

import numpy as np
import pytest
from support.internals import extensions

import dap3d_core as dap
from dap3d_core.interface import PluginError
from dap3d_core.scene import check
from dap3d_core.view.scene3d.shapes import scene_shapes

KINDS = """
from dap3d_core.interface import choice, hookimpl, number, point
from dap3d_core.interface.shapes import ShapeKind

interface_version = 1


class Wedge(ShapeKind):
    keyword = "wedge"
    width: float = number(unit="m", positive=True, doc="across")
    side: str = choice(("left", "right"), "left")

    def mesh(self):
        if self.width > 5.0:
            raise ValueError("a wedge is at most 5 m wide")
        x = self.width if self.side == "right" else -self.width
        corners = [(0, 0, 0), (x, 0, 0), (0, 1, 0), (0, 0, 1)]
        return corners, [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]


class Broken(ShapeKind):
    keyword = "broken"
    which: str = choice(("error", "far", "flat"))

    def mesh(self):
        if self.which == "error":
            return self.height
        return [(0, 0, 0)] if self.which == "far" else [0.0, 1.0], [(0, 0, 7)]


class Named(ShapeKind):
    keyword = "named"
    color: float = number()


class Pinned(ShapeKind):
    keyword = "pinned"
    pin: str = point()


@hookimpl
def dap3d_shapes():
    return [Wedge, Broken, Named, Pinned]
"""
KEYWORDS = ("wedge", "broken", "named", "pinned", "missing")


@pytest.fixture(autouse=True)
def package(install):
    """A distribution with these kinds on sys.path."""
    entries = "\n".join(f"{name} = my_shapes_module" for name in KEYWORDS)
    install("my-shapes", KINDS, entry_points=f"[dap3d.shapes]\n{entries}\n")


def scene_with(type_, **fields):
    scene = dap.Scene(name="shown")
    scene.add_body("a", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_shape(type_, "s", body="a", **fields)
    return scene


def drawn(scene):
    check(scene, dap.load_registry())
    return scene_shapes(scene, ["a"], ["#000000"])


def test_a_kind_is_drawn_where_its_scene_has_it():
    """Its fields with their defaults make the mesh, at, p and color place it as any other."""
    found = drawn(scene_with("wedge", width=2.0, at=(1.0, 0.0, 0.0), color="#ff0000"))
    (mesh,) = found.meshes
    assert mesh.vertices[1].tolist() == [-2.0, 0.0, 0.0]
    assert (mesh.at, mesh.color, mesh.triangles.shape) == ((1.0, 0.0, 0.0), "#ff0000", (4, 3))
    assert np.max([corner[1][0] for corner in found.corners]) == 1.0


@pytest.mark.parametrize(
    ("type_", "fields", "words"),
    [
        ("wedge", {}, r"shapes.s.width: is required \(across, m\)"),
        ("wedge", {"width": -1.0}, "shapes.s.width = -1.*should be greater than 0"),
        ("wedge", {"width": 1.0, "side": "lft"}, "should be one of .*left.*right"),
        ("wedge", {"width": 1.0, "depth": 1.0}, "shapes.s.depth"),
        ("wegde", {"width": 1.0}, "unknown shape; one of box.*wedge.*did you mean 'wedge'"),
        ("named", {}, "Named has a field color, which every shape has"),
        ("pinned", {}, "Pinned.pin is a field point; a shape has number"),
        ("missing", {}, "returns none with the keyword 'missing'"),
    ],
)
def test_mistakes_are_named(type_, fields, words):
    """In a scene, and in the package, where a scene uses its kind."""
    with pytest.raises(dap.SceneError, match=f"(?s){words}"):
        check(scene_with(type_, **fields), dap.load_registry())


@pytest.mark.parametrize(
    ("type_", "fields", "words"),
    [
        ("wedge", {"width": 6.0}, "shape s is not drawn: a wedge is at most 5 m wide"),
        ("broken", {"which": "error"}, "Broken.mesh failed: AttributeError"),
        ("broken", {"which": "far"}, "Broken.mesh returns a triangle of a vertex that is not"),
        ("broken", {"which": "flat"}, r"Broken.mesh should return finite vertices \(k, 3\)"),
    ],
)
def test_what_cannot_be_drawn_is_noted(type_, fields, words):
    """The picture is made without it."""
    found = drawn(scene_with(type_, **fields))
    assert not found.meshes
    (note,) = found.notes
    assert words.replace("\\", "") in note


def test_another_package_with_the_keyword_or_none_is_refused(tmp_path):
    """Both are named."""
    with pytest.raises(PluginError, match="there is no shape 'prism'"):
        extensions("shape").load("prism")
    info = tmp_path / "other_shapes-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: other-shapes\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[dap3d.shapes]\nwedge = my_shapes_module\n")
    with pytest.raises(PluginError, match=r"brought by .*my-shapes.* and .*other-shapes"):
        extensions("shape").load("wedge")


def test_no_kind_is_looked_for_without_one(monkeypatch):
    """Shapes of dap3d itself read no entry point."""
    monkeypatch.setattr("dap3d_core.registry.extensions.discover", None)
    assert len(drawn(scene_with("sphere", radius=1.0)).marks) == 1
