"""Importers and exporters by their entry points, each in a guard of its own.

Plugins here are real distributions on sys.path: a module, and a dist-info with entry points.
"""

import pytest

import dap3d_core as dap
from dap3d_core.interface import PluginError
from dap3d_core.registry.extensions import extensions

GOOD = '''
from dap3d_core.interface.formats import Articulation, Importer, Inertial, Joint, Link, hookimpl

interface_version = 1


class Rod(Importer):
    """Reads a length."""

    keyword, title, suffixes = "rod", "Rod", (".rod",)

    def read(self, source):
        length = float(source.path.read_text())
        bob = Link("bob", Inertial(1.0, (0.0, 0.0, -length), [[1, 0, 0], [0, 1, 0], [0, 0, 1]]))
        hinge = Joint("hinge", "revolute", "world", "bob", axes=((0.0, 1.0, 0.0),))
        return Articulation("rod", {"bob": bob}, {"hinge": hinge}, fixed_base=True)


@hookimpl
def dap3d_importers():
    return [Rod]
'''
ROD = ("rod", "dap3d.importers")


def test_a_format_from_outside_takes_the_same_road(install, tmp_path):
    install("rods", GOOD, *ROD)
    (tmp_path / "a.rod").write_text("0.5")
    scene, report = dap.import_model(tmp_path / "a.rod")
    assert report.format == "rod"
    assert scene.bodies["bob"].r == (0.0, 0.0, -0.5)
    assert scene.joints["hinge"].type == "rev"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1/0", "ZeroDivisionError"),
        (
            GOOD.replace("interface_version = 1", "interface_version = 7"),
            "interface version 7, this dap3d has 1",
        ),
        (GOOD.replace("return [Rod]", "return [int]"), "should return a list of Importer"),
        (GOOD.replace('"rod", "Rod"', '"bar", "Rod"'), "none with the keyword 'rod'"),
    ],
)
def test_a_broken_format_is_told_and_hurts_no_other(install, tmp_path, text, words):
    install("rods", text, *ROD)
    with pytest.raises(PluginError, match=words) as caught:
        extensions("importer").load("rod")
    assert "distribution rods 1.2" in str(caught.value)
    urdf = '<robot name="a"><link name="b"><inertial><mass value="1"/>'
    urdf += '<inertia ixx="1" iyy="1" izz="1"/></inertial></link></robot>'
    (tmp_path / "a.urdf").write_text(urdf)
    assert dap.import_model(tmp_path / "a.urdf")[1].format == "urdf"


def test_two_packages_with_one_format_are_told(install):
    install("rods", GOOD, *ROD)
    install("bars", GOOD, *ROD)
    with pytest.raises(PluginError, match=r"brought by distribution bars .* and .* rods"):
        extensions("importer").load("rod")


def test_an_unknown_format_has_the_nearest(install):
    with pytest.raises(PluginError, match=r"no importer 'urfd'; did you mean 'urdf'"):
        extensions("importer").load("urfd")


def test_a_blocked_format_is_left_out(install, monkeypatch):
    install("rods", GOOD, *ROD)
    monkeypatch.setenv("DAP3D_BLOCK", "rods:rod")
    assert "rod" not in extensions("importer").keywords
