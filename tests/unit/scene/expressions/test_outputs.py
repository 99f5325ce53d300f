"""Outputs of scenes: what is refused says where, and scenes keep them."""

import pytest
from support.falling import SCENE

import dap3d_core as dap
from dap3d_core.scene import parse

#: Of a chain of outputs.
LONGEST = 50
FALLING = SCENE.partition("[simulation]")[0] + "[outputs]\n"


def mistake_of(tmp_path, outputs):
    """What a scene file with these outputs is refused for: the only mistake."""
    path = tmp_path / "scene.toml"
    path.write_text(FALLING + outputs)
    with pytest.raises(dap.SceneError) as refused:
        dap.compile(path)
    (mistake,) = refused.value.mistakes
    assert mistake.file == str(path)
    return mistake


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("a = 'stone.r.z +'", "is no expression"),
        ("a = 'stine(t)'", "did you mean 'sin'"),
        ("a = 3", "an expression in quotes"),
        ("a = 'stone.q'", "the body 'stone' has r, p"),
        ("a = 'stoen.r'", "did you mean 'stone.r'"),
        ("a = 'enrgy.kinetic'", "there is no body, point, joint, contact or force 'enrgy'"),
        ("a = 'stone.r + stone.p'", "vectors of 3 and 4 components"),
        ("a = 'a + 1'", "in a circle: a -> a"),
        ("stone = 't'", "one of this name in bodies already"),
        ("gravity = 't'", "one of this name in forces already"),
        ("work = 't'", "every result has a quantity of this name"),
        ("energy = 't'", "every result has a quantity of this name"),
        ("time = 't'", "a dimension or a variable of this name"),
        ("sin = 't'", "a function or a constant of this name"),
        ("pi = 't'", "a function or a constant of this name"),
        ("'two words' = 't'", "a word of letters, digits and _"),
        ("lambda = 't'", "a word of letters, digits and _"),
    ],
)
def test_a_wrong_output_is_named_with_its_line(tmp_path, line, words):
    mistake = mistake_of(tmp_path, f"good = 't'\n{line}\n")
    assert words in str(mistake)
    assert mistake.line == FALLING.count("\n") + 2
    assert mistake.key.startswith("outputs.")


def test_outputs_of_nothing_are_told_with_other_mistakes(tmp_path):
    """Names of bodies that are wrong themselves, of points of contacts and of limits are known."""
    path = tmp_path / "scene.toml"
    names = ("stoen.r.z", "tt", "stone.r.z", "energy.total", "gravity_lower.gap", "gravity#1.gap")
    lines = "".join(f"q{k} = '{name}'\n" for k, name in enumerate(names))
    path.write_text(FALLING.replace("mass = ", "mass = -") + lines)
    with pytest.raises(dap.SceneError) as refused:
        dap.compile(path)
    found = {one.key: one for one in refused.value.mistakes}
    assert set(found) == {"bodies.stone.mass", "outputs.q0", "outputs.q1"}
    assert found["outputs.q0"].nearest == "stone"


def test_the_name_of_a_body_is_one_mistake():
    """What it names is the body, and no circle."""
    scene = dap.Scene()
    scene.add_body("a", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.outputs["a"] = "a.r.x"
    with pytest.raises(dap.SceneError, match="there is one of this name in bodies") as caught:
        dap.simulate(scene, t_end=1.0)
    assert len(caught.value.mistakes) == 1


def test_a_circle_of_several_is_told_in_its_order(tmp_path):
    mistake = mistake_of(tmp_path, "a = 'b + 1'\nb = 'c.x'\nc = 'a * stone.r'\n")
    assert any(circle in mistake.what for circle in ("a -> b -> c -> a", "b -> c -> a -> b",
                                                     "c -> a -> b -> c"))  # fmt: skip


def test_chains_are_bounded_and_evaluated_once():
    """Two names in each of many would be 2**50 evaluations."""
    scene = parse(FALLING)
    scene.add_output("a0", "stone.r.z")
    for k in range(1, LONGEST):
        scene.add_output(f"a{k}", f"a{k - 1} - 0.5 * a{max(k - 2, 0)}")
    result = dap.simulate(scene, t_end=0.1, dt=0.1)
    assert result.quantity(f"a{LONGEST - 1}").unit == "m"
    scene.add_output("last", f"a{LONGEST - 1}")
    with pytest.raises(dap.SceneError, match="a chain of more than"):
        dap.compile(scene)


def test_outputs_survive_copies_and_files(tmp_path):
    scene = parse(FALLING + "height = \"stone.r.z - 'gravity.odd name' # m\"\n")
    assert scene.copy() == scene
    scene.copy().add_output("other", "t")
    assert list(scene.outputs) == ["height"]
    scene.save(tmp_path)
    assert dap.load(tmp_path).outputs == scene.outputs


def test_add_output_refuses_a_name_twice():
    scene = dap.Scene()
    assert scene.add_output("camber", "t") == "camber"
    with pytest.raises(dap.SceneError, match="one of this name in outputs already"):
        scene.add_output("camber", "t")
    with pytest.raises(dap.SceneError, match="not a name"):
        scene.add_output("", "t")


def test_outputs_come_behind_those_that_they_name_and_name_what_there_is():
    result = dap.simulate(
        falling_by(c="2 * a + b.z / stone.r.z", b="a * stone.r", a="t"), t_end=0.1, dt=0.1
    )
    assert result.quantity("c").values[-1] == pytest.approx(0.3)
    with pytest.raises(dap.SceneError, match="twise"):
        dap.compile(falling_by(fallen="stone.r.z / twise"))


def falling_by(g=9.81, **outputs):
    """A stone, its weight by a parameter that is expressed by another, and outputs."""
    scene = parse(FALLING.replace("[outputs]", "")).copy()
    scene.add_parameter("g", g)
    scene.add_parameter("twice", "= 2 * g")
    scene.forces["gravity"].fields["gravity"] = "= g"
    for name, text in outputs.items():
        scene.add_output(name, text)
    return scene


def test_outputs_read_parameters(tmp_path):
    """Expressed ones, too; an output of that name comes first; a sweep has those of each point."""
    scene = falling_by(fallen="-2 * stone.r.z / twice")
    result = dap.simulate(scene, t_end=1.0, dt=0.5)
    result.save(tmp_path / "fall.nc")
    for one in (result, dap.open(tmp_path / "fall.nc")):
        assert one.quantity("fallen").values == pytest.approx([0.0, 0.125, 0.5], abs=1e-9)
    vary = {"parameters.g": [2.0, 5.0]}
    found = dap.sweep(scene, vary, outputs="fallen", t_end=1.0, dt=0.5)
    assert found["fallen"].values == pytest.approx([0.5, 0.5], abs=1e-9)
    scene.add_output("g", "stone.r.z + 7 * twice")
    scene.add_output("by_output", "g / stone.r.z")
    values = dap.simulate(scene, t_end=1.0, dt=0.5).quantity("by_output").values
    assert values[-1] == pytest.approx(1.0 - 28.0, abs=1e-6)
