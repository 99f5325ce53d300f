"""``dap3d describe`` for every registered type."""

import json
import tomllib

import pytest
from support.command_line import output_of
from support.derived_types import Cam
from support.internals import specs_of
from support.own_types import registry_of
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.cli.commands.describe_example import example_of

TYPES = sorted(dap.load_registry().sources)
each = pytest.mark.parametrize(("kind", "keyword"), TYPES, ids=["-".join(t) for t in TYPES])


def described(keyword, *options, width=80):
    return output_of("describe", keyword, *options, columns=width)


@pytest.mark.every(6)
@long_in_plain_python
@each
def test_the_example_of_every_type_runs(kind, keyword, tmp_path):
    """Written to a file as it is shown, it is simulated to its end; its element is of the type."""
    registry = dap.load_registry()
    text = example_of(registry.get(kind, keyword), registry)
    path = tmp_path / "example.toml"
    path.write_text(text)
    result = dap.simulate(path)
    assert result.t[-1] == 0.2
    used = tomllib.loads(text)[f"{kind}s"].values()
    assert keyword in {element["type"] for element in used}


@pytest.mark.every(6)
@each
def test_every_type_is_described(kind, keyword):
    """Fields with unit, default and meaning, in 60 columns; the docstring; where it is; in JSON."""
    types = json.loads(described(keyword, "--json"))["types"]
    (found,) = (t for t in types if t["kind"] == kind)
    type_info = dap.load_registry().get(kind, keyword)
    specs = {n: s for n, s in specs_of(type_info.type).items() if s.given}
    assert [f["name"] for f in found["fields"]] == list(specs)
    for field in found["fields"]:
        spec = specs[field["name"]]
        assert field["unit"] == spec.unit
        assert field["doc"], field["name"]
        assert field["required"] == spec.required
    assert len(found["doc"].splitlines()) >= 1
    assert [v["class"] for v in found["variants"]] == [
        e.type.__name__ for _, e in type_info.variants
    ]
    assert all(v["doc"] for v in found["variants"])
    text = described(keyword, "--names", width=60)
    assert [line for line in text.splitlines() if len(line) > 60] == []
    for name, spec in specs.items():
        assert f"\n  {name} " in text
        if spec.unit:
            assert spec.unit in text


def test_rows_that_find_an_unknown_constrain_no_body():
    """A slot in a plate has two rows, of which one finds the place on its curve."""
    assert "1 constraint equation; leaves 5 of 6 freedoms" in described("oncurve")


def test_the_freedoms_that_joints_leave():
    """6 less the rows, for each variant."""
    left = {"sph": 3, "rev": 1, "sph-sph": 5, "cyl": 2, "tran": 1, "univ": 2, "fix": 0, "rP": 5}
    left |= {"rel-rot": 5, "rel-tran": 5, "drive-rot": 5, "drive-tran": 5, "disk": 3}
    joints = [keyword for kind, keyword in TYPES if kind == "joint"]
    found = {k: json.loads(described(k, "--json"))["types"][0] for k in joints}
    assert {k: found[k]["freedoms"] for k in left} == left
    variants = {v["with"]["slip"]: v["freedoms"] for v in found["disk"]["variants"]}
    assert variants == {"z": 5, "nz": 4, "tz": 4}
    text = described("disk", width=200)
    assert "leaves 3 of 6 freedoms of the body" in text
    assert "slip = nz  2     4" in text
    assert "otherwise  3     3" in text
    assert "leaves 1 of 6 freedoms between two bodies" in described("rev", width=200)


@pytest.mark.parametrize(
    ("keyword", "words"),
    [
        ("disk", ["zn is nz"]),  # allowed words with their aliases
        ("rot_sda", ["false, true", "of theta - theta_0"]),  # what a function is of
        ("friction", ["the bodies of its joint"]),
        ("cable", ["the bodies of points"]),
        ("rev", ["called revolute, hinge, pin elsewhere"]),
        ("rev", ["also takes lower, upper, e, breaks_at, active"]),
        ("sph", ["also takes breaks_at, active"]),
        # states by name, with the fields that come with them
        ("maxwell", ["states z; initial values by fields in _0, tolerances by fields in _atol",
                     "z_atol"]),
    ],
)  # fmt: skip
def test_what_a_type_is_told_to_take(keyword, words):
    text = " ".join(described(keyword, width=200).split())
    assert not [word for word in words if word not in text]


def test_the_kernels_of_a_type_can_be_read():
    """As they are written, those of variants, too; in JSON by name."""
    text = described("disk", "--source")
    assert "gamma of NoLateralSlip, as written" in text
    assert "def C(r_i, A_i, radius):\n    return r_i[2] - radius * axis(A_i)[1]" in text
    (facts,) = json.loads(described("sph", "--json"))["types"]
    assert facts["derived"] == []
    assert facts["source"]["C"] == "def C(r_P_i, r_P_j):\n    return sub(r_P_j, r_P_i)"


@pytest.mark.slow
def test_the_program_of_a_model_is_counted():
    """By the functions that its operations come from; a scene of too many bodies has none."""
    text = described("pen1", "--source", width=60)
    assert "right-hand side, by method standard" in text
    assert "factor.factor_pivot" in text
    (rates, _) = json.loads(described("pen1", "--source", "--json"))["model"]["programs"]
    parts = rates["parts"].values()
    assert rates["total"] == {k: sum(part[k] for part in parts) for k in rates["total"]}
    assert "scenes of up to 64 bodies have programs" in described("A02-40", "--source")


def test_a_required_function_is_in_the_example():
    """Of an argument as well; it is left out only where other fields can take its place."""
    registry = registry_of(Cam)
    text = example_of(registry.get("joint", "cam"), registry)
    scene = tomllib.loads(text)
    assert scene["joints"]["J1"]["function"] in scene["functions"]
    registry = dap.load_registry()
    text = example_of(registry.get("function", "step"), registry)
    assert tomllib.loads(text)["joints"]["J1"]["type"] == "drive-rot"
    text = example_of(registry.get("force", "ptp"), registry)
    assert "function" not in next(iter(tomllib.loads(text)["forces"].values()))


@pytest.mark.parametrize(
    ("keyword", "field", "allowed"),
    [
        ("ptp", "k", "usually >= 0"),
        (
            "ptp", "d", "not of zero length at the start, where one of l0, f_a, function is given, "
            "or P_i and P_j in its place",
        ),
        ("tran", "d", "or P_i and P_j in its place"),
        ("friction", "mu", ">= 0, usually <= 10"),
        ("rot_sda", "v_i", "not along axis"),
        ("weight", "wgt", "of unit length"),
    ],
)  # fmt: skip
def test_what_a_field_asks_for(keyword, field, allowed):
    (type_,) = json.loads(described(keyword, "--json"))["types"]
    fields = {f["name"]: f for f in type_["fields"]}
    assert fields[field]["allowed"] == allowed


def test_the_motion_of_a_joint_is_described():
    """In words, variant by variant, and as data for programs; other kinds have none."""
    assert "method joint  1 rotation about a_j, constant in body j" in described("rev")
    assert "method joint  with slip = z: rows stay: its 1 row costs" in described("disk", width=120)
    (univ,) = json.loads(described("univ", "--json"))["types"]
    (motion,) = univ["motions"]
    assert motion["parts"] == [
        {"kind": "rotation", "constant_in": "j", "name": "n_j"},
        {"kind": "rotation", "constant_in": "i", "name": "a_i"},
    ]
    (weight,) = json.loads(described("weight", "--json"))["types"]
    assert "motions" not in weight


def test_a_model_is_described_by_what_its_results_have(tmp_path):
    """Coordinates of joints with their aliases, outputs with units, parameters with values."""
    scene = dap.load("bicycle")
    scene.parameters, scene.outputs = scene.resolved().parameters, {}
    scene.add_parameter("m", "= 2 * 40")
    scene.bodies["frame"].mass = "= m + 5"
    scene.add_output("steer", "-steering.angle")
    scene.add_output("base", "front_hub.r - rear_hub.r")
    path = str(scene.save(tmp_path))
    model = json.loads(described(path, "--json"))["model"]
    joints = {joint["name"]: joint for joint in model["joints"]}
    assert joints["steering"]["coordinates"] == [
        {"name": "steering.q1", "alias": "angle", "unit": "rad"}
    ]
    assert joints["rear_contact"]["coordinates"] == []
    assert "velocity level" in joints["rear_contact"]["reason"]
    assert model["parameters"][-1] == {"name": "m", "value": 80.0, "given": "= 2 * 40"}
    assert model["parameters"][0] == {"name": "v", "value": 4.6, "given": 4.6}
    assert model["outputs"] == [
        {"name": "steer", "expression": "-steering.angle", "unit": "rad", "components": []},
        {"name": "base", "expression": "front_hub.r - rear_hub.r", "unit": "m",
         "components": ["x", "y", "z"]},
    ]  # fmt: skip
    text = described(path, width=200)
    assert "steering.angle [rad]" in text
    assert "-steering.angle" in text
    assert "= 2 * 40" in text


def test_a_type_goes_before_a_model_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rev").mkdir()
    assert "types" in json.loads(described("rev", "--json"))


@pytest.mark.parametrize(
    ("word", "keyword"),
    [
        ("hinge", "rev"), ("RevoluteJoint", "rev"), ("Ball joint", "sph"), ("prismatic", "tran"),
        ("gravity", "weight"), ("lead-screw", "screw"), ("u-joint", "univ"),
    ],
)  # fmt: skip
def test_a_name_of_another_program_describes_the_type(word, keyword):
    text = described(word)
    assert text.startswith(f"{word} is called {keyword} here.\n\n{keyword}, a ")
    assert text.endswith(described(keyword))
    assert {one["keyword"] for one in json.loads(described(word, "--json"))["types"]} == {keyword}
