"""Importers and exporters by their entry points, each in a guard of its own.
Plugins here are real distributions on sys.path: a module, and a dist-info with entry points."""

import pytest
from support.internals import extension_listing, extensions, packages

import dap3d_core as dap
from dap3d_core.interface import PluginError

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


def test_formats_that_two_packages_bring_unknown_and_blocked_ones(install, monkeypatch):
    install("rods", GOOD, *ROD)
    install("bars", GOOD, *ROD)
    with pytest.raises(PluginError, match=r"brought by distribution bars .* and .* rods"):
        extensions("importer").load("rod")
    with pytest.raises(PluginError, match=r"no importer 'urfd'; did you mean 'urdf'"):
        extensions("importer").load("urfd")
    monkeypatch.setenv("DAP3D_BLOCK", "rods:rod, bars:rod")
    assert "rod" not in extensions("importer").keywords


MIDPOINT = """
from dap3d_core.interface import hookimpl
from dap3d_core.interface.integrators import RungeKuttaMethod

interface_version = 1


@hookimpl
def dap3d_integrators():
    return [RungeKuttaMethod(keyword="midpoint", order=2, a=[[0.5]], b=[0.0, 1.0])]
"""
SOLID = '''
from dap3d_core.interface import hookimpl
from dap3d_core.interface.shapes import ShapeKind

interface_version = 1


@hookimpl
def dap3d_shapes():
    class Point(ShapeKind):
        """A triangle."""

        keyword = "dot"

        def mesh(self):
            return [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]

    return [Point]
'''
EXPORTER = '''
from dap3d_core.interface.formats import Exporter, hookimpl

interface_version = 1


class Rod(Exporter):
    """Writes a length."""

    keyword, title, suffixes = "rod", "Rod", (".rod",)

    def write(self, articulation, target):
        return []


@hookimpl
def dap3d_exporters():
    return [Rod]
'''
KINDS = {
    "importer": (GOOD, "rod"),
    "exporter": (EXPORTER, "rod"),
    "integrator": (MIDPOINT, "midpoint"),
    "shape": (SOLID, "dot"),
}


def listed(kind, limit_s=10.0):
    return {i.keyword: i for i in extension_listing(limit_s) if i.kind == kind}


@pytest.mark.parametrize("kind", KINDS)
def test_the_listing_has_every_kind_with_its_state(install, kind):
    text, keyword = KINDS[kind]
    module = install("parts", text, keyword, f"dap3d.{kind}s")
    info = listed(kind)[keyword]
    assert (info.state, info.reason) == ("ok", "")
    assert (info.distribution, info.version, info.module) == ("parts", "1.2", module)


#: What is done to the text of a module -> what the listing says of it.
CHANGES = [
    (lambda text: "x = = 1\n", "SyntaxError"),
    (lambda text: text.replace("dap3d_core.interface", "none.interface"), "ModuleNotFound"),
    (lambda text: text.replace("return [", "return 3 or ["), "'int' object is not iterable"),
    (lambda text: text.replace("    return [", "    return 0 and ["), "none with the keyword"),
    (lambda text: "raise SystemExit(3)\n", "SystemExit: 3"),
]
#: Keeps a core busy for the seconds that the listing allows, whatever the kind.
NEVER_LOADED = (lambda text: "while True: pass\n", "not loaded after 0.3 s")


@pytest.mark.parametrize(
    ("kind", "change", "words"),
    [
        *((kind, *change) for kind in KINDS for change in CHANGES),
        pytest.param("integrator", *NEVER_LOADED, marks=pytest.mark.slow),
    ],
)
def test_the_listing_says_what_is_wrong_with_one_and_lists_all_others(install, kind, change, words):
    text, keyword = KINDS[kind]
    install("parts", change(text), keyword, f"dap3d.{kind}s")
    found = listed(kind, 0.3 if "0.3 s" in words else 3.0)  # which others take on a busy machine
    assert found[keyword].state == "broken"
    assert words in found[keyword].reason
    assert f"{kind} '{keyword}' of distribution parts 1.2" in found[keyword].reason
    others = [i for i in extension_listing(limit_s=3.0) if i.distribution == "dap3d"]
    assert len(others) == 10  # four importers, six exporters
    assert {i.state for i in others} == {"ok"}


def test_the_listing_has_what_is_blocked_and_what_two_packages_bring(install, monkeypatch):
    install("parts", MIDPOINT, "midpoint", "dap3d.integrators")
    install("others", MIDPOINT, "midpoint", "dap3d.integrators")
    both = [i for i in extension_listing() if i.keyword == "midpoint"]
    assert [i.state for i in both] == ["duplicate", "duplicate"]
    assert "uninstall one of them" in both[0].reason
    monkeypatch.setenv("DAP3D_BLOCK", "parts:midpoint")
    states = {i.distribution: i.state for i in extension_listing() if i.keyword == "midpoint"}
    assert states == {"parts": "blocked", "others": "ok"}


@pytest.mark.parametrize(("text", "state"), [(MIDPOINT, "ok"), ("x = = 1\n", "failed")])
def test_the_checks_of_a_package_load_its_extensions(install, text, state):
    install("parts", text, "midpoint", "dap3d.integrators")
    registry = dap.load_registry()
    (source,) = [s for s in packages.active_sources(registry) if s.distribution == "parts"]
    report = packages.check_named(registry, source.kind, source.keyword)
    assert [outcome.state for outcome in report.outcomes] == [state]
