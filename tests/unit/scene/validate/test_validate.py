"""The check of a scene finds every mistake, with key, line and what is wrong."""

import textwrap
from importlib.metadata import version

import numpy as np
import pytest
from support.internals import SYSTEM
from unit.scene.base import BASE, mistakes_of, scene_of
from unit.scene.mistakes import ALL

import dap3d_core as dap
from dap3d_core.scene import MISSING, check, parse

SPRING = '[forces.spring]\ntype = "ptp"'


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
    assert str(mistake).startswith(f"{scene.path}:6: bodies.crank.mass = 3.98e+6020: ")  # 16^5000
    assert len(str(mistake).splitlines()[0]) < 300
    with pytest.raises(dap.SceneError, match="cannot hold so large a number"):
        scene.to_toml()


def test_a_setting_that_is_missing_is_reported_where_its_table_begins(scene_of, registry):
    """[simulation] has no names below it, as [bodies.NAME] has."""
    scene = scene_of(BASE.replace('"dop853"', '"rk4"'))
    (mistake,) = mistakes_of(scene, registry)
    assert mistake.key == "simulation.step"
    assert mistake.line == BASE.split("\n").index("[simulation]") + 1


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


def block_pushed(**fields):
    """A body that a force pushes, and a harmonic function."""
    scene = dap.Scene(name="pushed")
    scene.add_body("block", mass=2.0, Jp=(1.0, 1.0, 1.0))
    scene.add_function("harmonic", "swing", frequency=3.0)
    scene.add_force("f", "push", body_i="block", f=(1.0, 0.0, 0.0), **fields)
    return scene


def scene_with(**combinations):
    """A body that a force pushes by the function ``all``; combinations: name -> (type, terms)."""
    scene = block_pushed(function="all")
    scene.add_function("a", "ramp", coeff=(0.0, 1.0, 0.0))
    for name, (type_, terms) in combinations.items():
        scene.add_function(type_, name, functions=terms)
    return scene


def test_terms_are_found_whatever_their_order_in_the_file():
    """A sum may name a product that comes after it; what a combination uses is used."""
    scene = scene_with(all=("sum", ["both", "swing"]), both=("product", ["swing", "ramp"]))
    checked = check(scene, dap.load_registry())
    (total,) = (f for f in checked.functions if f.name == "all")
    assert [term.name for term in total.terms] == ["both", "swing"]
    assert [term.name for term in total.terms[0].terms] == ["swing", "ramp"]
    assert not any("functions." in note for note in checked.notes)


@pytest.mark.parametrize(
    ("combinations", "words"),
    [
        ({"all": ("sum", ["all"])}, "functions.all.* in a circle: all -> all"),
        (
            {"all": ("sum", ["swing", "both"]), "both": ("product", ["ramp", "all"])},
            "in a circle: (all -> both -> all|both -> all -> both)",
        ),
        ({"all": ("sum", ["swung"])}, "there is no function 'swung'; did you mean 'swing'"),
        ({"all": ("sum", [])}, "functions.all.functions.*should be a list of names of functions"),
        ({"all": ("sum", "swing")}, r'a list of names of functions.*write functions = \["swing"\]'),
        ({"all": ("sum", [1])}, "should be the name of a function"),
        ({"all": ("sum", None)}, "functions.all.functions: is required .names: names of the"),
    ],
)
def test_what_cannot_be_combined_is_refused(combinations, words):
    """A circle, an unknown function, no list of names: each is one clear mistake."""
    with pytest.raises(dap.SceneError, match=f"(?s){words}") as caught:
        check(scene_with(**combinations), dap.load_registry())
    assert len(caught.value.mistakes) == 1


def test_places_in_place_of_names_are_told_where_they_are_declared():
    scene = dap.Scene()
    scene.add_body("a", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_joint("rev", P_i=(1, 0, 0), P_j="ground.O", a_i=(0, 0, 1), a_j="ground.z")
    with pytest.raises(dap.SceneError) as caught:
        check(scene, dap.load_registry())
    assert [m.remedy for m in caught.value.mistakes] == [
        "declare one, [points.NAME] with body and sPp, and give its name",
        "declare one, [vectors.NAME] with body and sp, and give its name",
    ]


def test_functions_are_given_as_many_arguments_as_they_take():
    """A map over two arguments is no function of time, no spring curve and no term of a sum."""
    scene = scene_with(all=("sum", ["map", "swing"]))
    scene.add_function("grid", "map", x=[0.0, 1.0], y=[0.0, 1.0], z=[[0.0, 1.0], [1.0, 3.0]])
    with pytest.raises(dap.SceneError, match=r"functions.all.* of one argument; map takes two"):
        check(scene, dap.load_registry())
    scene.functions["all"].fields["functions"] = ("swing",)
    scene.forces["push"].fields["function"] = "map"
    ends = {"P_i": "block.O", "P_j": "ground.O"}
    scene.add_point("away", "block", (1.0, 0.0, 0.0))
    scene.add_force("ptp", "curve", **(ends | {"P_i": "away"}), l0=0.0, function="map")
    with pytest.raises(dap.SceneError) as caught:
        check(scene, dap.load_registry())
    time, length = caught.value.mistakes
    scene.forces["push"].fields["function"] = {"x": 1.0}
    with pytest.raises(dap.SceneError, match=r"push.function.*should be the name of a function"):
        check(scene, dap.load_registry())
    assert "push.function" in str(time)
    assert "a function of time" in str(time)
    assert "takes two arguments, and is to be a function of" in str(length)


def test_combinations_that_multiply_are_refused():
    """Each doubles the one before it: all terms together would be one kernel, of 200 at most."""
    count = 8
    pairs = {f"s{k}": ("sum", [f"s{k - 1}", f"s{k - 1}"] if k else ["swing"]) for k in range(count)}
    pairs["all"] = ("sum", [f"s{count - 1}", f"s{count - 1}"])
    with pytest.raises(dap.SceneError, match=f"combines {2**count} functions"):
        check(scene_with(**pairs), dap.load_registry())


def scene_pushed(value=0.0, name="motor", **fields):
    """A body that a force pushes by an input, or by other fields."""
    scene = block_pushed(**(fields or {"input": name}))
    scene.add_input(name, value)
    return scene


def test_an_input_is_written_and_read(tmp_path):
    """A table of its own; its value is an expression where there are parameters."""
    scene = scene_pushed(0.25)
    assert dap.load(scene.save(tmp_path / "scene.toml")) == scene
    assert dict(check(scene, dap.load_registry()).inputs) == {"motor": 0.25}
    scene.add_parameter("L", 3.0)
    scene.inputs["motor"].value = "= 2 * L"
    assert dict(check(scene, dap.load_registry()).inputs) == {"motor": 6.0}


def test_an_input_that_nothing_reads_is_noted():
    """As a function that nothing uses."""
    notes = check(scene_pushed(function="swing"), dap.load_registry()).notes
    assert "inputs.motor: no joint and no force reads it" in notes
    assert not any("inputs" in note for note in check(scene_pushed(), dap.load_registry()).notes)


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (scene_pushed(input="moter"), "push.input.*no input 'moter'; did you mean 'motor'"),
        (scene_pushed(input="swing"), "no input 'swing'.*swing is a function, not one of"),
        (scene_pushed(input="motor", function="swing"), "give function or input, not both"),
        (scene_pushed(float("nan")), "inputs.motor.value.*should be a finite number"),
        (scene_pushed("fast"), "inputs.motor.value.*should be a number, not text"),
        (
            scene_pushed(name="block"),
            "not a name for an input: there is one of this name in bodies",
        ),
        (scene_pushed(name="two words"), "inputs.two words.*not a name for an input"),
        (scene_pushed(name="energy"), "every result has a quantity of this name"),
    ],
)
def test_inputs_that_make_no_sense_are_refused(scene, words):
    """Each is one mistake that names the key."""
    with pytest.raises(dap.SceneError, match=f"(?s){words}") as caught:
        check(scene, dap.load_registry())
    assert len(caught.value.mistakes) == 1


def test_names_of_the_quantities_of_every_result_are_known():
    """No input has the name of one."""
    for name in {name.partition(".")[0] for name in SYSTEM}:
        with pytest.raises(dap.SceneError, match="every result has a quantity of this name"):
            check(scene_pushed(name=name), dap.load_registry())


def test_keys_of_an_input_are_known():
    """In Python as in a file."""
    with pytest.raises(dap.SceneError, match=r"motor\.start"):
        dap.Scene().add_input("motor", start=1.0)
    with pytest.raises(dap.SceneError, match="there is one of this name in inputs"):
        scene_pushed().add_input("motor")
