"""What the three formats have in common: tables of their elements, and closed loops."""

import re
import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.internals import FormatError, Remarks, parse_xml
from support.plain import long_in_plain_python
from support.process import REPOSITORY

import dap3d_core as dap
from dap3d_formats.element_table import MOVES, NOTED, REFUSED, note_elements
from dap3d_formats.mjcf.elements import MJCF, further
from dap3d_formats.sdf.elements import SDF
from dap3d_formats.urdf.elements import URDF

DATA = REPOSITORY / "tests" / "data" / "formats"
SUFFIXES = ("urdf", "sdf", "xml")
G = 9.81
NAMES = DATA / "names"
TABLES = {"urdf": URDF, "sdf": SDF, "mjcf": MJCF}


def listed(name):
    """Parent and name of each element of the schema of a format, with its attributes."""
    lines = (NAMES / f"{name}.txt").read_text().splitlines()
    for line in lines:
        if not line.startswith("#"):
            key, _, attributes = line.partition(":")
            yield *key.split("/"), attributes.split()


def row_of(table, parent, name):
    return table.get(f"{parent}/{name}") or table.get(name)


@pytest.mark.parametrize("name", TABLES)
def test_every_element_and_attribute_of_the_schema_has_a_row(name):
    """Below an element that is left out nothing is looked for."""
    table, missing = TABLES[name], []
    reached, growing = {""}, True
    while growing:
        before = len(reached)
        for parent, child, _ in listed(name):
            row = row_of(table, parent, child) or {}
            if parent in reached and row.get("", ("taken",))[0] not in (NOTED, MOVES, REFUSED):
                reached.add(child)
        growing = len(reached) > before
    for parent, child, attributes in listed(name):
        row = row_of(table, parent, child)
        if parent not in reached:
            continue
        if row is None:
            missing.append(f"{parent}/{child}")
        elif row.get("", ("taken",))[0] not in (NOTED, MOVES, REFUSED):
            missing += [f"{parent}/{child} {word}" for word in attributes if word not in row]
    assert not missing


@pytest.mark.parametrize("name", TABLES)
def test_the_reference_shows_each_row(name):
    sys.path.insert(0, str(REPOSITORY / "docs" / "_ext"))
    try:
        from dap3d_site.formats import pages
    finally:
        sys.path.remove(str(REPOSITORY / "docs" / "_ext"))
    ((_, text),) = pages()
    section = text.partition(f"## {name.upper()}\n")[2].partition("\n## ")[0]
    for element, row in TABLES[name].items():
        lines = re.findall(rf"^\| `{re.escape(element)}` \|.*$", section, flags=re.MULTILINE)
        for attribute, (state, words) in row.items():
            cell = f"`{attribute}`" if attribute else "|  |"
            assert any(cell in x and f"| {state} | {words}" in x for x in lines), (
                element,
                attribute,
            )


def test_the_tables_do_what_they_say():
    """An unknown or noted element or attribute is remarked, a refused one ends the import."""
    text = '<mujoco><a/><sensor><b/></sensor><worldbody><body name="x" c="1"/></worldbody></mujoco>'
    remarks = Remarks()
    note_elements(parse_xml(text, "x.xml"), MJCF, remarks, further)
    assert [one.text for one in remarks.left_out] == [
        "<a>: an unknown element", "<sensor>: sensors", "c of <body>: an unknown attribute",
    ]  # fmt: skip
    with pytest.raises(FormatError, match="composites are not expanded"):
        note_elements(parse_xml("<mujoco><composite/></mujoco>", "x.xml"), MJCF, remarks, further)


def reference(t, theta, rate):
    """The angle of a parallelogram: its coupler never turns, so one pendulum holds all masses."""
    inertia = 0.09 + 1.0 * 0.25 + 3.0 + 0.2 + 2.0 * 0.16
    moment = (1.0 * 0.5 + 3.0 + 2.0 * 0.4) * G
    rates = lambda t, y: (y[1], -moment / inertia * np.sin(y[0]))  # noqa: E731
    return solve_ivp(rates, (0, t[-1]), (theta, rate), "DOP853", t, rtol=1e-12, atol=1e-12).y[0]


@long_in_plain_python
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_closed_loop_moves_as_its_minimal_coordinate(suffix):
    """Over 1 s from 0.8 rad; both integrations hold 1e-10, summed errors stay below 1e-7."""
    start = {"left": 0.8, "right": 0.8, "pin": -0.8}
    scene, report = dap.import_model(DATA / f"parallelogram.{suffix}", positions=start)
    assert len(scene.joints) == 4
    assert not report.left_out
    result = dap.simulate(scene, t_end=1.0, dt=0.1, rtol=1e-10, atol=1e-12)
    theta = np.arctan2(-result.r[:, 0, 0], 2.0 - result.r[:, 0, 2])
    np.testing.assert_allclose(theta, reference(result.t, 0.8, 0.0), rtol=0, atol=1e-7)


def test_a_position_of_a_joint_that_closes_a_loop_is_not_taken_in_silence():
    start = {"left": 0.8, "right": 0.8, "pin": -0.8, "close": (1.0, 0.0, 0.0, 0.0)}
    _, report = dap.import_model(DATA / "parallelogram.urdf", positions=start)
    [remark] = report.translated
    assert str(remark) == (
        "parallelogram.urdf:25: position or rate of close: the joint closes a loop, the others "
        "place it"
    )


def test_the_formats_say_the_same_mechanism():
    """Bodies are equal to the last bit but for rounding of frames."""
    scenes = [dap.import_model(DATA / f"parallelogram.{suffix}")[0] for suffix in SUFFIXES]
    for scene in scenes[1:]:
        assert scene.joints.keys() == scenes[0].joints.keys()
        for one, other in zip(sorted(scene.bodies), sorted(scenes[0].bodies), strict=True):
            a, b = scene.bodies[one], scenes[0].bodies[other]
            assert (a.mass, a.Jp) == (b.mass, b.Jp)
            np.testing.assert_allclose([*a.r, *a.p], [*b.r, *b.p], atol=1e-15)
