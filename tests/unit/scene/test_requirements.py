"""[requires]: what lacks is named with the command that installs it, also at a missing keyword."""

from importlib.metadata import version

import pytest
from unit.scene.base import BASE, mistakes_of, scene_of

import dap3d_core as dap
from dap3d_core.scene import check, parse

SPRING = '[forces.spring]\ntype = "ptp"'


@pytest.fixture(scope="module")
def registry():
    return dap.load_registry()


def test_a_missing_keyword_says_what_to_install(tmp_path, registry):
    """The mistake of the type has the command of all that lacks, with the range of versions."""
    lacking = '[requires]\ndap3d-tyres-xy = ">=0.2, <1"\ndap3d = ">=0.1"\n'
    text = lacking + BASE.replace(SPRING, '[forces.spring]\ntype = "magic-tyre"')
    first, second = mistakes_of(scene_of(tmp_path, text), registry)
    assert (first.key, first.line) == ("requires.dap3d-tyres-xy", 2)
    assert "is not installed" in first.what
    assert second.key == "forces.spring.type"
    for one in (first, second):
        assert 'pip install "dap3d-tyres-xy<1,>=0.2"' in one.remedy


def test_versions(tmp_path, registry):
    """One in the range is taken, pre-releases included; another is named with the installed one."""
    here = version("dap3d")
    for good in (f"=={here}", "*", "", ">=0.0.1.dev0"):
        check(scene_of(tmp_path, f'[requires]\nDap3D = "{good}"\n{BASE}'), registry)
    (mistake,) = mistakes_of(scene_of(tmp_path, f'[requires]\ndap3d = ">99"\n{BASE}'), registry)
    assert mistake.what == f"dap3d {here} is installed, which is not of this range"
    assert mistake.remedy == 'pip install "dap3d>99"'


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("dap3d = 1", "should be text"),
        ('dap3d = "1.2"', "range of versions"),
        ('dap3d = ">=one"', "range of versions"),
        ('"a b" = "*"', "not the name of a distribution"),
        ('"-e." = "*"', "not the name of a distribution"),
        ('"" = "*"', "not the name of a distribution"),
    ],
)
def test_what_is_no_requirement_is_refused(line, words, tmp_path, registry):
    (mistake,) = mistakes_of(scene_of(tmp_path, f"[requires]\n{line}\n{BASE}"), registry)
    assert words in mistake.what
    assert mistake.line == 2
    assert "pip" not in mistake.remedy


def test_the_nearest_package_is_suggested(tmp_path, registry):
    (mistake,) = mistakes_of(scene_of(tmp_path, f'[requires]\ndap3dd = "*"\n{BASE}'), registry)
    assert mistake.nearest == "dap3d"


def test_they_are_written_and_copied():
    scene = parse(BASE)
    scene.add_requirement("dap3d-example", ">=0.1")
    scene.add_requirement("dap3d")
    copy = parse(scene.copy().to_toml())
    assert copy.requires == {"dap3d-example": ">=0.1", "dap3d": "*"}
