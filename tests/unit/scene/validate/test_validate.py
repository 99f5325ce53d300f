"""The check of a scene finds every mistake, with key, line and what is wrong."""

import textwrap

import numpy as np
import pytest
from unit.scene.base import BASE, mistakes_of
from unit.scene.mistakes import ALL

import dap3d_core as dap
from dap3d_core.scene import MISSING, check


def test_a_good_scene_becomes_arrays_and_instances(scene_of, registry):
    scene = scene_of(BASE)
    checked = check(scene, registry)
    assert checked.notes == []
    assert checked.scene is scene
    assert checked.body_names == ("crank", "rocker")
    assert checked.body_index == {"ground": 0, "crank": 1, "rocker": 2}
    np.testing.assert_array_equal(checked.mass, [1.0, 2.0])
    np.testing.assert_array_equal(checked.Jp[0], np.diag([0.5, 0.5, 0.1]))
    np.testing.assert_array_equal(checked.Jp[1], [[0.5, 0, 0], [0, 0.5, 0.1], [0, 0.1, 0.5]])
    np.testing.assert_array_equal(checked.r, [[0, 0, 1], [0, 0, 0]])
    np.testing.assert_array_equal(checked.p, [[1, 0, 0, 0], [1, 0, 0, 0]])
    for array in (checked.mass, checked.Jp, checked.r, checked.p, checked.r_dot, checked.w):
        assert array.dtype == np.float64
        assert array.flags.c_contiguous
    assert checked.point_names == ("A", "B", "C", "animation.1", "animation.2")
    assert checked.animation_count == 2
    np.testing.assert_array_equal(checked.point_body, [1, 2, 0, 1, 0])
    assert checked.point_body.dtype == np.int64
    np.testing.assert_array_equal(checked.point_local[1], [1, 2, 3])
    np.testing.assert_array_equal(checked.point_local[4], [0, 0, 2])


def test_instances_hold_what_types_need(scene_of, registry):
    checked = check(scene_of(BASE), registry)
    J1, J2, J3, J4 = checked.joints
    assert [j.name for j in checked.joints] == ["J1", "J2", "J3", "J4"]
    assert (J1.bodies, J2.bodies, J3.bodies, J4.bodies) == ((1, 0), (2, 1), (1, 0), (1, 0))
    assert J1.values == {
        "P_i": (0.0, 0.0, -1.0),
        "P_j": (0.0, 0.0, 0.0),
        "a_i": (1.0, 0.0, 0.0),
        "a_j": (1.0, 0.0, 0.0),
    }
    assert J2.values["P_i"] == (1.0, 2.0, 3.0)
    assert all(type(x) is float for x in J2.values["P_i"]), "integers became floats"
    assert J3.functions == (1,)
    assert (J3.values["body_i"], J3.values["body_j"]) == ("crank", "ground")
    assert J4.values == {
        "P_i": (0.0, 0.0, -1.0),
        "P_j": (0.0, 4.0, 0.0),
        "length": 8.0,
        "function": None,
        "input": None,
    }
    g, spring = checked.forces
    assert g.bodies == ()
    assert g.values == {"gravity": 9.81, "wgt": (0.0, 0.0, -1.0)}
    assert spring.bodies == (1, 2)
    assert (spring.values["k"], spring.values["c"], spring.values["l0"]) == (10.0, 0.0, 0.5)
    assert spring.values["P_j"] == (0.0, 0.0, 0.0)
    assert checked.functions[0].values["coeff"] == (0.0, 6.28, 0.0)
    assert J1.type_info.type.keyword == "rev"


def test_a_function_that_is_absent_is_zero_and_a_number_left_out_is_none(scene_of, registry):
    text = BASE.replace('function = "motor"\n', "").replace("length = 8.0\n", "")
    checked = check(scene_of(text), registry)
    assert checked.joints[2].functions == (0,)
    assert checked.joints[3].values["length"] is None
    assert any("functions.motor" in note for note in checked.notes)


@pytest.mark.parametrize(
    ("old", "new", "key", "words"), ALL, ids=[f"{c[2]}: {c[1][:30]!r}" for c in ALL]
)
def test_one_mistake_is_reported_with_key_line_and_words(
    scene_of, registry, tmp_path, old, new, key, words
):
    assert BASE.count(old) == 1 or old in ('P_i = "A"\nP_j = "C"',), "the case is unambiguous"
    text = BASE.replace(old, new, 1)
    mistakes = [m for m in mistakes_of(scene_of(text), registry) if m.key.startswith(key)]
    assert mistakes, "the key is named"
    mistake = mistakes[0]
    said = str(mistake)
    for word in words:
        assert word in said
    assert mistake.file == str(tmp_path / "scene.toml")
    # The line of what was put there; where something was taken away, that of its table's header.
    first = text[: text.index(new)].count("\n") + 1 if new else 0
    last = first + new.count("\n")
    if mistake.value is MISSING and not (first <= mistake.line <= last):
        table = key.rpartition(".")[0]
        assert text.splitlines()[mistake.line - 1].startswith(f"[{table}")
    else:
        assert first <= mistake.line <= last
    assert f"scene.toml:{mistake.line}: {mistake.key}" in said


def test_all_mistakes_are_reported_at_once_in_the_order_of_the_file(scene_of, registry):
    text = BASE
    for old, new in [
        ("mass = 1.0", "mas = 1.0"),
        ("sPp = [1, 2, 3]", "sPp = [1, 2]"),
        ('a_i = "axis"', 'a_i = "axes"'),
        ("k = 10.0", 'k = "10"'),
        ("dt = 0.05", "dt = -1"),
        ("coeff = [0.0, 6.28, 0.0]", "coef = [0.0, 6.28, 0.0]"),
    ]:
        text = text.replace(old, new)
    mistakes = mistakes_of(scene_of(text), registry)
    assert [m.key for m in mistakes] == [
        "bodies.crank.mas",
        "points.B.sPp",
        "joints.J1.a_i",
        "forces.spring.k",
        "functions.motor.coeff",
        "functions.motor.coef",
        "simulation.dt",
    ]
    assert [m.line for m in mistakes] == sorted(m.line for m in mistakes)
    error = dap.SceneError(mistakes)
    assert str(error).count("scene.toml:") == 7


def test_a_mistake_is_reported_once_and_not_again_where_it_is_used(scene_of, registry):
    text = BASE.replace('body = "rocker"', 'body = "roker"')
    assert [m.key for m in mistakes_of(scene_of(text), registry)] == ["points.B.body"]
    text = BASE.replace('P_i = "A"\nP_j = "C"', 'P_i = "C"\nP_j = "ground.O"')
    assert [m.key for m in mistakes_of(scene_of(text), registry)] == ["vectors2.d1.P_j"]


def test_empty_and_bodiless_scenes_are_refused(scene_of, registry):
    for text in ("", "[bodies]\n", "[scene]\nname = 'a'\n"):
        assert any("no bodies" in str(m) for m in mistakes_of(scene_of(text), registry))


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("bodies = 3\n", "bodies", "should be a table"),
        ("[[bodies]]\nmass = 1\n", "bodies", "single brackets"),
        ("[bodies]\ncrank = 3\n", "bodies.crank", "should be a table"),
        ("[joints]\nJ1 = 'sph'\n", "joints.J1", "should be a table"),
        ("scene = 'x'\n", "scene", "should be a table"),
        ("[animation]\npoints = 3\n", "animation.points", "list of tables"),
        ("[animation]\npoints = [[0, 0, 1]]\n", "animation.points.1", "should be a table"),
        ("simulation = []\n", "simulation", "should be a table"),
    ],
)
def test_what_is_no_table_is_reported(scene_of, registry, text, key, words):
    found = {m.key: str(m) for m in mistakes_of(scene_of(text), registry)}
    assert words in found[key]


def test_crlf_files_are_read_and_lines_counted_and_a_missing_schema_is_version_1(
    tmp_path, scene_of, registry
):
    assert check(scene_of(BASE.replace("schema = 1\n", "")), registry).notes == []
    text = BASE.replace("dt = 0.05", "dt = -1").replace("\n", "\r\n")
    (tmp_path / "scene.toml").write_bytes(text.encode())
    (mistake,) = mistakes_of(dap.load(tmp_path), registry)
    assert (mistake.key, mistake.line) == ("simulation.dt", text.split("\r\n").index("dt = -1") + 1)


def test_an_inline_table_and_dotted_keys_have_lines(scene_of, registry):
    text = textwrap.dedent("""\
    bodies.a.mass = 1.0
    bodies.a.Jp = [1.0, 1.0, 1.0]
    bodies.b = {mass = 1.0, Jp = [1.0, 1.0, 1.0], rr = 3}
    points."P 1".body = "c"
    points."P 1".sPp = [0, 0, 0]
    """)
    found = {m.key: m.line for m in mistakes_of(scene_of(text), registry)}
    assert found == {"bodies.b.rr": 3, "points.P 1.body": 4}


def test_a_scene_that_was_changed_after_loading_reports_the_new_value(scene_of, registry):
    scene = scene_of(BASE)
    scene.bodies["crank"].mass = -3.0
    scene.add_joint("sph", "extra", P_i="A", P_j="nowhere")
    first, second = mistakes_of(scene, registry)
    assert (first.key, first.value, first.line) == ("bodies.crank.mass", -3.0, 6)
    assert (second.key, second.line) == ("joints.extra.P_j", None)


def test_a_number_that_python_will_not_write_is_shown(scene_of, registry):
    """Hexadecimal integers may have any length; their decimal digits are refused beyond 4300."""
    huge = "0x" + "f" * 5000
    scene = scene_of(BASE.replace("mass = 1.0", f"mass = {huge}"))
    (mistake,) = mistakes_of(scene, registry)
    assert str(mistake).startswith(f"{scene.path}:6: bodies.crank.mass = 0xffff")
    assert len(str(mistake).splitlines()[0]) < 300
    with pytest.raises(dap.SceneError, match="cannot hold so large a number"):
        scene.to_toml()


def test_a_setting_that_is_missing_is_reported_where_its_table_begins(scene_of, registry):
    """[simulation] has no names below it, as [bodies.NAME] has."""
    scene = scene_of(BASE.replace('"dop853"', '"rk4"'))
    (mistake,) = mistakes_of(scene, registry)
    assert mistake.key == "simulation.step"
    assert mistake.line == BASE.split("\n").index("[simulation]") + 1
