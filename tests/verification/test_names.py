"""Names are what is written: no letter stands for another, composed or not.
Python's parser takes identifiers in Unicode's form NFKC, in which a micro sign is a Greek mu, a
ligature its letters, a full-width letter an ASCII one. Scenes do not: such names are different, and
each must give its own number. What is the same text by Unicode (form NFC: an e with an accent as
one character or as two) is one name. The expected numbers are those that the scenes give."""

import unicodedata

import numpy as np
import pytest
from support.internals import ExpressionError, parse_expression

import dap3d_core as dap
from dap3d_core.cli import main

#: Different characters that the form NFKC makes one.
ALIKE = {
    "micro sign and mu": ("\u00b5", "\u03bc"),
    "ligature": ("\ufb01", "fi"),
    "full width": ("\uff4d", "m"),
    "long s": ("\u017f", "s"),
    "double-struck": ("\u211d", "R"),
    "script l": ("\u2113", "l"),
    "ordinal": ("\u00aa", "a"),
    "bold": ("\U0001d41a", "a"),
    "within a word": ("k_\u00b5", "k_\u03bc"),
}
#: One text in two forms.
SAME = {
    "acute": ("\u00e9", "e\u0301"),
    "ohm": ("\u03a9", "\u2126"),
    "angstrom": ("\u00c5", "A\u030a"),
    "Hangul": ("\uac00", "\u1100\u1161"),
}

alike = pytest.mark.parametrize(("one", "other"), ALIKE.values(), ids=ALIKE)
same = pytest.mark.parametrize(("one", "other"), SAME.values(), ids=SAME)
TAIL = "[simulation]\nt_end = 0.1\ndt = 0.1\n"


def body(name, mass="1.0", z=0.0):
    return f'[bodies."{name}"]\nmass = {mass}\nJp = [1, 1, 1]\nr = [0, 0, {z}]\n'


def run(text, tmp_path, name="scene.toml"):
    (tmp_path / name).write_text(text, encoding="utf-8")
    return dap.simulate(tmp_path / name)


def test_the_cases_are_what_they_are_for():
    for one, other in ALIKE.values():
        assert unicodedata.normalize("NFKC", one) == unicodedata.normalize("NFKC", other)
        assert unicodedata.normalize("NFC", one) != unicodedata.normalize("NFC", other)
    for one, other in SAME.values():
        assert one != other
        assert unicodedata.normalize("NFC", other) == one


@alike
def test_parameters_that_look_alike_have_their_own_numbers(one, other, tmp_path):
    text = f'[parameters]\n"{one}" = 2.0\n"{other}" = 7.0\n'
    bodies = body("A", f'"={one}"') + body("B", f'"= 3 * {other} - {one}"')
    assert np.array_equal(run(text + bodies + TAIL, tmp_path).model.mass, [2.0, 19.0])


@alike
def test_outputs_and_quantities_of_bodies_that_look_alike(one, other, tmp_path):
    outputs = f'[outputs]\nfirst = "{one}.r.z"\nboth = "{other}.r.z + 2 * ({one}.r.z)"\n'
    result = run(body(one, z=5) + body(other, z=-7) + outputs + TAIL, tmp_path)
    assert result.quantity("first").values[0] == 5.0
    assert result.quantity("both").values[0] == 3.0
    assert result.quantity(f"{one}.r.z").values[0] == 5.0
    assert result.quantity(f"{other}.r.z").values[0] == -7.0


@alike
def test_inputs_and_outputs_that_look_alike(one, other):
    scene = dap.Scene()
    scene.add_body("A", mass=1.0, Jp=(1, 1, 1))
    scene.add_input(one, 3.0)
    scene.add_input(other, 4.0)
    scene.add_output("both", f"10 * {one} + {other}")
    run = dap.start(scene, t_end=1.0)
    run.step(0.5, {one: 5.0})
    run.step(0.5)
    assert run.result().quantity("both").values[-1] == 54.0


@alike
def test_points_and_joints_that_look_alike(one, other):
    """Two pendulums, of 1 kg and 3 kg: at rest their pivots carry m g, g = 9.81 m/s^2."""
    scene = dap.Scene()
    for name, mass in ((one, 1.0), (other, 3.0)):
        scene.add_body(name, mass=mass, Jp=(1, 1, 1), r=(0, 0, -1))
        scene.add_point(name, name, (0.0, 0.0, 1.0))
        scene.add_joint("sph", name, P_i=name, P_j="ground.O")
    scene.add_force("weight")
    scene.add_output("share", f"'{one}.force.z' / '{other}.force.z'")
    result = dap.simulate(scene, t_end=0.0)
    g = result.reaction(one)["i"].force[0, 2]
    assert result.reaction(other)["i"].force[0, 2] == pytest.approx(3.0 * g, rel=1e-12)
    # rounding of one quotient
    assert result.quantity("share").values[0] == pytest.approx(1.0 / 3.0, rel=1e-12)


@alike
def test_sweeps_vary_the_one_that_is_named(one, other, tmp_path):
    scene = dap.Scene()
    scene.add_parameter(one, 2.0)
    scene.add_parameter(other, 7.0)
    scene.add_body("A", mass=1.0, Jp=(1, 1, 1), r=(f"= {one}", f"= {other}", 0.0))
    found = dap.sweep(
        scene, {f"parameters.{one}": [3.0, 4.0]}, outputs=["A.r.x", "A.r.y"], t_end=0.1
    )
    assert np.array_equal(found["A.r.x"], [3.0, 4.0])
    assert np.array_equal(found["A.r.y"], [7.0, 7.0])


@same
def test_one_text_in_two_forms_is_one_name(one, other, tmp_path):
    parameter = f'[parameters]\n"{one}" = 2.0\n'
    text = parameter + body(other, f'"= {other}"', z=4) + f'[outputs]\n"o" = "{one}.r.z"\n' + TAIL
    result = run(text, tmp_path)
    assert result.model.mass[0] == 2.0
    for name in (f"{one}.r.z", f"{other}.r.z", "o"):
        assert result.quantity(name).values[0] == 4.0
    scene = dap.load(tmp_path / "scene.toml")
    with pytest.raises(dap.SceneError, match="already"):
        scene.add_body(other)


@same
def test_names_on_the_command_line(one, other, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(body(one, z=4) + TAIL, encoding="utf-8")
    vary = ["--vary", f"bodies.{other}.mass=1:2:2", "--keep", f"{other}.r.z:max"]
    assert main(["sweep", "scene.toml", *vary, "-q", "-o", "sweep.nc"]) == 0


@same
def test_two_forms_of_one_name_are_refused(one, other, tmp_path):
    (tmp_path / "scene.toml").write_text(body(one) + body(other) + TAIL, encoding="utf-8")
    with pytest.raises(dap.SceneError, match=r"scene.toml:\d+"):
        dap.load(tmp_path / "scene.toml")


@alike
def test_advice_never_repeats_what_was_written(one, other, tmp_path):
    """The parameter that looks alike is named; the one that was written is not."""
    text = f'[parameters]\n"{other}" = 2.0\n' + body("A", f'"={one}"')
    with pytest.raises(dap.SceneError) as caught:
        run(text + TAIL, tmp_path)
    assert f"there is no parameter {one!r}; parameters: {other}" in str(caught.value)


def test_functions_and_constants_are_ascii():
    assert parse_expression("\uff50\uff49").names == ("\uff50\uff49",)
    with pytest.raises(ExpressionError, match="there is no function"):
        parse_expression("\uff53in(1)")


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("(\u00b5) . \ufb01 + \u03bc", ("\u00b5.\ufb01", "\u03bc")),
        ("\u00b5.a\n  .\u00b5", ("\u00b5.a.\u00b5",)),
        ("'\ufb01.r' * \u00b5 # \u03bc", ("\ufb01.r", "\u00b5")),
        ("\u00e9.r + e\u0301.r", ("\u00e9.r",)),
    ],
)
def test_names_of_expressions_are_those_of_their_text(text, names):
    assert parse_expression(text).names == names


def test_fields_of_types_have_the_names_that_python_gives_them(tmp_path):
    """A class whose field is written with a micro sign has it as mu; so may the scene write it."""
    (tmp_path / "plugin.py").write_text(
        '''
from dap3d_core.interface import Body, Force, body, hookimpl, number

interface_version = 1


class Push(Force):
    """A force along z."""

    keyword = "push"
    body_i: Body = body()
    \u00b5: float = number()

    def wrench(\u00b5):
        return (((0.0, 0.0, \u00b5), (0.0, 0.0, 0.0)),)


@hookimpl
def dap3d_forces():
    return [Push]
''',
        encoding="utf-8",
    )
    for sign in ("\u00b5", "\u03bc"):
        force = f'[forces.push]\ntype = "push"\nbody_i = "A"\n"{sign}" = 3.0\n'
        (tmp_path / "scene.toml").write_text(body("A", 2.0) + force + TAIL, encoding="utf-8")
        result = dap.simulate(tmp_path, allow_code=True)
        assert result.rdd[0, 0, 2] == pytest.approx(1.5, rel=1e-15)  # f / m, f times 1 / m
    both = force + '"\u00b5" = 4.0\n'
    (tmp_path / "scene.toml").write_text(body("A", 2.0) + both + TAIL, encoding="utf-8")
    with pytest.raises(dap.SceneError, match="unknown key"):
        dap.simulate(tmp_path, allow_code=True)
