"""Parameters of scenes: their expressions are numbers wherever a number may stand."""

import numpy as np
import pytest
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.scene import parse
from dap3d_core.study import names_under

ROD = """\
[scene]
name = "rod"

[parameters]
L = 1.2
half = "= L / 2"
mass = "= 2 * L"

[bodies.rod]
mass = "= mass"
Jp = ["= mass * L**2 / 12", 0.01, "= mass * L**2 / 12"]
r = [0.0, "= half", 0.0]

[points.A]
body = "rod"
sPp = [0.0, "=-half", 0.0]

[vectors.axis]
body = "rod"
sp = ["= cos(0)", 0.0, 0.0]

[joints.hinge]
type = "rev"
P_i = "A"
P_j = "ground.O"
a_i = "axis"
a_j = "ground.x"

[forces.gravity]
type = "weight"
gravity = "= 9.81"

[functions.table]
type = "spline"
x = [0.0, "= L", 2.0]
y = [0.0, "= half", "= sqrt(L)"]

[shapes.stick]
type = "line"
body = "rod"
points = [[0.0, "= -half", 0.0], [0.0, "= half", 0.0]]

[animation]
points = [{body = "rod", sPp = [0.0, "= half", 0.0]}]
limits = [[-1, 1], ["= -2 * L", 1], [-1, 1]]

[simulation]
t_end = 0.3
dt = 0.1
"""


def with_numbers(L):
    """The same scene, its numbers written out."""
    scene = parse(ROD)
    half, mass = L / 2, 2 * L
    scene.parameters.clear()
    scene.bodies["rod"].mass = mass
    scene.bodies["rod"].Jp = (mass * L**2 / 12, 0.01, mass * L**2 / 12)
    scene.bodies["rod"].r = (0.0, half, 0.0)
    scene.points["A"].sPp = (0.0, -half, 0.0)
    scene.vectors["axis"].sp = (1.0, 0.0, 0.0)
    scene.forces["gravity"].fields["gravity"] = 9.81
    scene.functions["table"].fields |= {"x": (0.0, L, 2.0), "y": (0.0, half, np.sqrt(L))}
    scene.shapes["stick"].fields["points"] = ((0.0, -half, 0.0), (0.0, half, 0.0))
    scene.animation.points[0].sPp = (0.0, half, 0.0)
    scene.animation.limits = ((-1, 1), (-2 * L, 1), (-1, 1))
    return scene


def test_a_scene_with_parameters_is_that_with_their_numbers():
    found, expected = parse(ROD).resolved(), with_numbers(1.2)
    assert found.parameters == {"L": 1.2, "half": 0.6, "mass": 2.4}
    found.parameters = {}
    assert found == expected
    result, same = dap.simulate(parse(ROD)), dap.simulate(expected)
    np.testing.assert_array_equal(result.u, same.u)


def test_a_scene_keeps_its_expressions(tmp_path):
    scene = parse(ROD)
    assert parse(scene.to_toml()) == scene
    assert scene.copy() == scene
    result = dap.simulate(scene, t_end=0.0)
    assert parse(result.scene_text).bodies["rod"].mass == "= mass"
    result.save(tmp_path / "a.nc")
    opened = dap.open(tmp_path / "a.nc")
    np.testing.assert_array_equal(
        opened.reaction("hinge")["i"].force, result.reaction("hinge")["i"].force
    )


@pytest.mark.parametrize(
    ("old", "new", "words", "at"),
    [
        *(("L = 1.2", new, words, at) for new, words, at in (
            ("L = '= half'", "in a circle: ", None),
            ("L = 'one'", "should be a number, not text", "L ="),
            ("L = '= 1 / 0'", "is not a finite number", "L ="),
            ("L = 1.0\nx = '= 1 / (L - 1)'", "has no finite value for L = 1", "x ="),
            ("L = 1.0\nx = '= Lenght'", "there is no parameter 'Lenght'", "x ="),
            ("L = 1.0\nx = '= 1 +'", "is no expression", "x ="),
            ("L = 1.0\nx = 1e200", "at most 1e+100", "x ="),
            ("L = 1.0\nsin = 1", "a function or a constant of this name", "sin ="),
            ("L = 1.0\n'a b' = 1", "a word of letters, digits and _", "'a b' ="))),
        *((old, new, words, new) for old, new, words in (
            ('mass = "= mass"', 'mass = "= 2 * lenght"', "bodies.rod.mass"),
            ('sPp = [0.0, "=-half", 0.0]', 'sPp = [0.0, "=-hlaf", 0.0]', "did you mean 'half'"),
            ('gravity = "= 9.81"', 'gravity = "= L.x"', "there is no parameter 'L.x'"),
            ('gravity = "= 9.81"', 'gravity = "= norm(L)"', "has no finite value"),
            ("t_end = 0.3", 't_end = "= L"', "is in no [simulation]"))),
    ],
)  # fmt: skip
def test_a_wrong_parameter_or_expression_is_named_with_its_line(tmp_path, old, new, words, at):
    assert old in ROD
    text = ROD.replace(old, new)
    path = tmp_path / "scene.toml"
    path.write_text(text)
    with pytest.raises(dap.SceneError) as refused:
        dap.compile(path)
    (mistake,) = refused.value.mistakes
    assert words in str(mistake)
    assert mistake.key.startswith("parameters.") is (old == "L = 1.2")
    if at:
        assert text.splitlines()[mistake.line - 1].startswith(at)


def test_wrong_expressions_and_unknown_keys_hide_no_other_mistake(tmp_path):
    """Each is named once, and nothing that only follows from it: all of ROD stands on L."""
    text = ROD
    for old, new in {
        "L = 1.2": "L = '= 1 / 0'",
        'mass = "= mass"': "mass = -1.0\nmas = 1.0",
        'sPp = [0.0, "=-half", 0.0]': 'sPp = [0.0, "= -hlaf", 0.0]',
        'P_j = "ground.O"': 'P_j = "grund.O"',
        'gravity = "= 9.81"': 'gravity = "= norm(1)"',
        "t_end = 0.3": "t_end = -0.3",
    }.items():
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "scene.toml"
    path.write_text(text)
    with pytest.raises(dap.SceneError) as refused:
        dap.compile(path)
    assert [mistake.key for mistake in refused.value.mistakes] == [
        "parameters.L", "bodies.rod.mass", "bodies.rod.mas", "points.A.sPp.2",
        "joints.hinge.P_j", "forces.gravity.gravity", "simulation.t_end",
    ]  # fmt: skip


def test_an_expression_without_parameters_says_what_it_needs():
    scene = dap.Scene()
    scene.add_body("b", mass="= 2")
    with pytest.raises(dap.SceneError, match=r"needs \[parameters\]"):
        dap.compile(scene)
    assert scene.add_parameter("m", "= 2") == "m"
    assert dap.compile(scene).model.mass[0] == 2.0
    with pytest.raises(dap.SceneError, match="one of this name in parameters already"):
        scene.add_parameter("m", 1.0)


def test_sweeps_vary_parameters_and_all_that_they_stand_for():
    """As scenes with these numbers written out, for outputs of every kind."""
    lengths = [0.9, 1.2, 1.5]
    outputs = ["rod.r.z:end", "hinge.angle:end", "A.r.y:end", "energy.total:end",
               "hinge.force.norm:max", "animation.1.r.z:end"]  # fmt: skip
    sweep = dap.sweep(parse(ROD), vary={"parameters.L": lengths}, outputs=outputs)
    for k, length in enumerate(lengths):
        result = dap.simulate(with_numbers(length))
        for output in outputs:
            values = result.quantity(output.partition(":")[0]).values
            expected = values.max() if output.endswith("max") else values[-1]
            np.testing.assert_array_equal(sweep[output][k], expected, err_msg=output)


@pytest.mark.slow
@long_in_plain_python
def test_fits_find_parameters():
    """From an angle that an output of the scene gives in degrees."""
    scene = parse(ROD)
    scene.add_output("degrees", "hinge.angle * 180 / pi")
    truth = dap.simulate(with_numbers(1.35), t_end=1.0, dt=0.05)
    data = {"t": truth.t, "degrees": np.degrees(truth.quantity("hinge.angle").values)}
    fit = dap.fit(scene, {"parameters.L": (1.1, 0.5, 3.0)}, data)
    assert fit.values["parameters.L"] == pytest.approx(1.35, rel=1e-6)
    assert fit.scene.parameters["L"] == fit.values["parameters.L"]


def test_names_of_parameters_are_completed_and_corrected():
    compiled = dap.compile(parse(ROD))
    assert names_under(compiled.checked, "param") == ["parameters."]
    assert names_under(compiled.checked, "parameters.") == [
        "parameters.L", "parameters.half", "parameters.mass",
    ]  # fmt: skip
    with pytest.raises(dap.SceneError, match="parameters has no number 'lenght'"):
        dap.sweep(parse(ROD), vary={"parameters.lenght": [1.0]}, outputs="rod.r.z")
