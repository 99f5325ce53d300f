"""Units of outputs: carried where they are known, declared, refused where unlike ones are added."""

import csv
import json

import netCDF4
import numpy as np
import pytest
from support.command_line import output_of
from support.internals import OPERATORS, WORDS

import dap3d_core as dap
from dap3d_core.scene import parse
from dap3d_core.scene.expressions.units import COMPARISONS, PURE, text_of, unit_of, unit_of_call

ANGLES = ("asin", "acos", "atan", "atan2")

PENDULUM = """\
[scene]
name = "swing"

[bodies.rod]
mass = 1.0
Jp = [0.1, 0.1, 0.1]
r = [0.5, 0.0, 0.0]

[points.e]
body = "rod"
sPp = [-0.5, 0.0, 0.0]

[joints.h]
type = "rev"
P_i = "e"
P_j = "ground.O"
a_i = "rod.y"
a_j = "ground.y"

[forces.w]
type = "weight"

[inputs.u]
value = 2.0

"""


def _parsed(outputs):
    return parse(PENDULUM + outputs)


@pytest.fixture(scope="module")
def probe():
    """Units of expressions of a pendulum, by name of the output."""

    def unit(*expressions):
        scene = _parsed("")
        for k, expression in enumerate(expressions):
            scene.add_output(f"o{k}", expression)
        result = dap.simulate(scene, t_end=0.1, dt=0.1)
        return [result.quantity(f"o{k}").unit for k in range(len(expressions))]

    return unit


#: A product with a bare number that may be a conversion has no known unit.
CONVERSIONS = [
    "h.angle * 180 / pi", "h.angle / (2 * pi)", "h.angle * 57.29577951308232", "h.angle / 6.2832",
    "180 / pi * h.angle", "h.angle_rate * 60 / (2 * pi)", "h.angle_rate * 9.549296585513721",
    "rod.r.x * 1000", "rod.r.x * 1e3", "1e3 * rod.r.x", "rod.r.x / 0.001", "rod.r * 100",
    "rod.rd.x * 3.6", "norm(h.force) / 9.81", "t / 60", "-(h.angle - 0.5) * 180 / pi",
    "rod.r.x * 5 * 2", "abs(h.angle) * (180 / pi)", "rod.r.x * 1000 + rod.r.z * 1000",
    "maximum(h.angle * 180 / pi, 0)", "rod.r.x + 0.2 * rod.rd.x", "energy.kinetic / 4.184",
]  # fmt: skip
#: Known units: means, differences with bare numbers, dimensionless ratios, constants.
KNOWN = {
    "0.5 * (e.r.x + rod.r.x)": "m", "(rod.r.x + rod.r.z + e.r.x) / 3": "m",
    "0.25 * e.r.x + 0.75 * rod.r.x": "m", "rod.r.x - 0.3": "m", "0.3 - rod.r.x": "m",
    "2 * rod.r.x": "m", "maximum(rod.r.x, 0)": "m", "where(t < 1, rod.r.x, 0)": "m",
    "rod.r.x - 30 * mm": "m", "h.angle - 90 * deg": "rad", "minimum(h.angle_rate, 300 * rpm)":
    "rad/s", "rod.rdd.z + g0": "m/s^2", "90 * deg": "rad", "h.angle / deg": "1",
    "rod.r.x / mm": "1", "h.angle_rate / rpm": "1", "rod.rdd.z / g0": "1", "rod.r.x / e.v.x": "s",
    "rod.r.x * 1000 / 1000": "m", "h.angle * 180 / pi * pi / 180": "rad",
    "sqrt(rod.r.x**2 + rod.r.z**2)": "m", "sqrt(rod.r.x)": "m^(1/2)", "rod.r.x**2": "m^2",
    "hypot(rod.r.x, rod.r.z)": "m", "atan2(rod.r.z, rod.r.x)": "rad", "1 / t": "1/s",
    "asin(rod.r.x / norm(rod.r))": "rad", "sin(h.angle)": "1", "cos(h.angle) * rod.r.x": "m",
    "h.force.x * rod.r.x": "N m", "energy.kinetic + h.force.x * rod.r.x": "J",
    "dot(h.force, rod.rd)": "N m/s", "cross(rod.r, h.force)": "N m", "rod.r.x % 0.5": "m",
    "h.angle_rate**2 * rod.r.x + rod.rdd.x": "m/s^2", "h.angle_rate * 0.5": "rad/s",
    "rod.r.x < 0.3": "1", "rod.rd.x / rod.rd.z": "1", "-h.angle": "rad", "floor(t)": "s",
    "'h.lambda.2'": "SI", "-'h.lambda.2' / 2": "SI", "pi": "1",
    "rod.p.e1 + 0.5 * h.angle": "", "sin(rod.r.x)": "", "rod.r.x - sin(t)": "", "u - h.angle_rate":
    "", "u * h.angle_rate": "", "'h.lambda.2' * rod.r.x": "", "rod.r.x - 1000 * e.r.x": "",
}  # fmt: skip
#: Sums and comparisons of unlike units, with both of them.
UNLIKE = {
    "rod.r.x + t": ("m", "s"), "rod.r.x - rod.rd.x": ("m", "m/s"),
    "h.angle + rod.r.x": ("rad", "m"),
    "norm(h.force) + norm(h.moment)": ("N", "N m"), "energy.kinetic - h.force.x": ("J", "N"),
    "rod.r + rod.rd": ("m", "m/s"), "hypot(rod.r.x, t)": ("m", "s"),
    "maximum(rod.r.x, h.angle)": ("m", "rad"), "atan2(rod.r.x, rod.rd.x)": ("m", "m/s"),
    "where(t < 1, rod.r.x, rod.rd.x)": ("m", "m/s"), "where(t < rod.r.x, 1, 0)": ("s", "m"),
    "rod.r.x == h.angle": ("m", "rad"), "rod.r.x % t": ("m", "s"),
    "h.angle - 30 * mm": ("rad", "m"),
    "rod.r.x - 90 * deg": ("m", "rad"), "rod.rdd.x + 3 * rpm": ("m/s^2", "rad/s"),
    "(rod.r.x + 0.3) * (rod.r.z + t)": ("m", "s"), "rod.r.x / e.r.x + t": ("1", "s"),
    "rod.r.x**2 + rod.r.x": ("m^2", "m"), "2 * deg + 3 * mm": ("rad", "m"),
}  # fmt: skip


def test_conversions_by_bare_numbers_have_no_known_unit(probe):
    assert probe(*CONVERSIONS) == [""] * len(CONVERSIONS)


def test_units_that_are_known(probe):
    assert dict(zip(KNOWN, probe(*KNOWN), strict=True)) == KNOWN


def test_every_word_and_operator_has_a_rule_of_units():
    """Of lengths alone: none falls through to the rule of products."""
    ruled = {"*": "m^2", "/": "1", "**": "", "sqrt": "m^(1/2)", "dot": "m^2", "cross": "m^2"}
    ruled |= dict.fromkeys(("sin", "cos", "tan"), "") | dict.fromkeys(ANGLES, "rad")
    ruled |= dict.fromkeys((*PURE, *COMPARISONS), "1")
    length = unit_of("m")
    arities = {sign: 1 if sign in ("neg", "not") else 2 for sign, _ in OPERATORS.values()}
    for word, arity in (arities | {name: word.arity for name, word in WORDS.items()}).items():
        assert text_of(unit_of_call(word, *[length] * arity)) == ruled.get(word, "m"), word


def test_constants_have_their_values():
    """deg = pi/180 rad, rpm = 2 pi/60 rad/s, mm = 1e-3 m, g0 = 9.80665 m/s^2 (CGPM 1901)."""
    scene = _parsed("")
    for name in ("deg", "rpm", "mm", "g0"):
        scene.add_output(f"of_{name}", name)
    scene.add_output("in_deg", "h.angle / deg")
    result = dap.simulate(scene, t_end=0.5, dt=0.1)
    found = {name: result.quantity(f"of_{name}") for name in ("deg", "rpm", "mm", "g0")}
    values = {"deg": np.pi / 180, "rpm": 2 * np.pi / 60, "mm": 1e-3, "g0": 9.80665}
    assert {name: q.values[0] for name, q in found.items()} == pytest.approx(values, rel=1e-15)
    units = {"deg": "rad", "rpm": "rad/s", "mm": "m", "g0": "m/s^2"}
    assert {name: q.unit for name, q in found.items()} == units
    degrees = np.degrees(result.quantity("h.angle").values)
    assert result.quantity("in_deg").values == pytest.approx(degrees, rel=1e-14)


def test_constants_stand_in_parameters():
    scene = _parsed("")
    scene.add_parameter("lean", "= 30 * deg")
    scene.add_parameter("long", "= 20 * mm")
    resolved = scene.resolved().parameters
    assert resolved["lean"] == pytest.approx(np.pi / 6, rel=1e-15)
    assert resolved["long"] == pytest.approx(0.02, rel=1e-15)
    clash = _parsed("")
    clash.add_parameter("mm", 1.0)
    with pytest.raises(dap.SceneError, match="a function or a constant of this name"):
        dap.compile(clash)


@pytest.mark.parametrize("expression", UNLIKE)
def test_sums_of_unlike_units_are_refused(expression, tmp_path):
    """With file, line, key, both units and the remedy; before the run."""
    path = tmp_path / "scene.toml"
    path.write_text(PENDULUM + f'[outputs]\ngood = "h.angle"\nwrong = "{expression}"\n')
    with pytest.raises(dap.SceneError) as refused:
        dap.compile(path)
    (mistake,) = refused.value.mistakes
    text = str(mistake)
    one, other = UNLIKE[expression]
    assert f"{path}:{PENDULUM.count(chr(10)) + 3}: outputs.wrong" in text
    assert f"of {one} and {other}, which are unlike units" in text or (
        f"of {other} and {one}, which are unlike units" in text
    )
    assert "convert one of them" in text


def test_outputs_of_outputs_carry_units():
    """Also that a bare number takes part: what could be right is not refused."""
    scene = _parsed("")
    for name, text in {
        "half": "0.5 * rod.r.x", "wave": "sin(2 * t)", "degrees": "h.angle * 180 / pi",
        "sum": "half + rod.r.z", "off": "rod.r.x - wave", "mixed": "degrees - h.angle",
    }.items():  # fmt: skip
        scene.add_output(name, text)
    scene.add_output("heading", "h.angle * 180 / pi", unit="deg")
    scene.add_output("doubled", "2 * heading")
    result = dap.simulate(scene, t_end=0.1, dt=0.1)
    units = {"sum": "m", "off": "", "mixed": "", "heading": "deg", "doubled": "deg"}
    assert {name: result.quantity(name).unit for name in units} == units
    scene.add_output("wrong", "heading + h.angle")
    with pytest.raises(dap.SceneError, match="of deg and rad, which are unlike units"):
        dap.compile(scene)


# ---------------------------------------------------------------------------- declared units

DECLARED = """\
[outputs]
lean = "h.angle"
turns = "h.angle / (2 * pi)"

[outputs.heading]
value = "h.angle * 180 / pi"
unit = "deg"
"""


@pytest.mark.slow
def test_a_declared_unit_is_everywhere(tmp_path, monkeypatch):
    """Table, JSON, NetCDF, MATLAB, data set, plot, sweep and saved scene have it, or none."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(PENDULUM + DECLARED)
    output_of("run", "s.toml", "--t-end", "0.5", "--dt", "0.1", "-o", "s.nc")
    names = ("lean", "turns", "heading")
    report = json.loads(output_of("post", "s.nc", "--select", *names, "-o", "s.csv", "--json"))
    with open("s.csv") as file:
        head, *rows = csv.reader(file)
    assert head == ["t [s]", "lean [rad]", "turns", "heading [deg]"]
    assert float(rows[-1][3]) == pytest.approx(np.degrees(float(rows[-1][1])), rel=1e-14)
    assert '"unit": "deg"' in json.dumps(report)
    output_of("post", "s.nc", "-o", "post.nc")
    with netCDF4.Dataset("post.nc") as file:
        assert file["heading"].units == "deg"
        assert file["lean"].units == "rad"
        assert "units" not in file["turns"].ncattrs()
    output_of("export", "s.nc", "--format", "mat", "-o", "s.mat")
    from scipy.io import loadmat

    units = loadmat("s.mat", simplify_cells=True)["units"]
    assert (units["heading"], units["lean"]) == ("deg", "rad")
    assert not len(units["turns"])
    result = dap.open("s.nc")
    dataset = result.to_xarray()
    assert dataset["heading"].attrs["units"] == "deg"
    assert "units" not in dataset["turns"].attrs
    labels = [ax.get_ylabel() for ax in dap.plot(result, "heading", "turns").figure.axes]
    assert [label for label in labels if "[deg]" in label]
    assert not [label for label in labels if "rad" in label]
    outputs = ["heading:max", "turns:max"]
    swept = dap.sweep("s.toml", {"bodies.rod.mass": [1.0, 2.0]}, outputs=outputs, t_end=0.2)
    assert swept["heading:max"].attrs["units"] == "deg"
    assert "units" not in swept["turns:max"].attrs
    described = json.loads(output_of("describe", "s.toml", "--json"))["model"]["outputs"]
    assert {o["name"]: o["unit"] for o in described} == {"lean": "rad", "turns": "",
                                                        "heading": "deg"}  # fmt: skip
    assert {o["name"]: o["expression"] for o in described}["heading"] == "h.angle * 180 / pi"


def test_declared_units_survive_copies_and_files(tmp_path):
    scene = _parsed(DECLARED)
    assert scene.copy() == scene
    scene.copy().outputs["heading"]["unit"] = "rad"
    assert scene.outputs["heading"] == {"value": "h.angle * 180 / pi", "unit": "deg"}
    scene.save(tmp_path)
    assert dap.load(tmp_path).outputs == scene.outputs
    made = _parsed("")
    assert made.add_output("heading", "h.angle * 180 / pi", unit="deg") == "heading"
    assert made.outputs["heading"] == scene.outputs["heading"]
    result = dap.simulate(made, t_end=0.1, dt=0.1)
    result.save(tmp_path / "r.nc")
    assert dap.open(tmp_path / "r.nc").quantity("heading").unit == "deg"


@pytest.mark.parametrize(
    ("value", "unit"),
    [("h.angle", "deg"), ("rod.r.x", "mm"), ("h.angle_rate", "rpm"), ("h.angle", "m"),
     ("h.angle_rate", "Hz"),
     ("norm(h.force)", "kN"), ("energy.kinetic", "N"), ("rod.rd.x", "km/h"), ("t", "min")],
)  # fmt: skip
def test_a_declared_unit_that_the_value_does_not_have_is_refused(value, unit):
    """A number in rad that is called deg is wrong by 57, one in rad/s called Hz by 2 pi."""
    scene = _parsed("")
    scene.add_output("wrong", value, unit=unit)
    with pytest.raises(dap.SceneError, match=rf"outputs\.wrong.*is declared in {unit}, and its"):
        dap.compile(scene)


@pytest.mark.parametrize(
    ("value", "unit"),
    [("h.angle / deg", "deg"), ("h.angle_rate / deg", "deg/s"), ("rod.r.x / mm", "mm"),
     ("rod.r.x / mm / t", "mm/s"), ("h.force.x * rod.r.x", "J"), ("h.angle_rate", "1/s"),
     ("h.angle", "1"), ("rod.r.x / e.r.x", "%"), ("0.5 * 2.0 * rod.rd.x**2", "J"),
     ("norm(h.force) / 1000", "kN"), ("u", "rad/s"), ("sin(t)", "m"), ("rod.r.x", "m"),
     ("h.force.x / rod.r.x", "kg/s^2"), ("energy.kinetic / t", "W"), ("t / 60", "min")],
)  # fmt: skip
def test_a_declared_unit_that_may_be_right_is_taken(value, unit):
    scene = _parsed("")
    scene.add_output("right", value, unit=unit)
    assert dap.simulate(scene, t_end=0.1, dt=0.1).quantity("right").unit == unit


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('[outputs.a]\nvalue = "t"\nunits = "s"\n', "outputs.a.units.*did you mean 'unit'"),
        ('[outputs.a]\nunit = "s"\n', "outputs.a.value: is required"),
        ('[outputs.a]\nvalue = "t"\nunit = 3\n', "outputs.a.unit = 3: should be a unit in quotes"),
        ('[outputs.a]\nvalue = "t"\nunit = ""\n', "outputs.a.unit.*should be a unit in quotes"),
        ('[outputs.a]\nvalue = "t +"\n', "outputs.a.value.*is no expression"),
    ],
)
def test_mistakes_in_tables_of_outputs_are_located(table, words, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(PENDULUM + table)
    with pytest.raises(dap.SceneError, match=f"{path}:\\d+: {words}"):
        dap.compile(path)
