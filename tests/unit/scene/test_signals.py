"""Functions that combine others, and inputs: what is accepted, noted and refused."""

import pytest

import dap3d_core as dap
from dap3d_core.result.quantities.catalogue import SYSTEM
from dap3d_core.scene import check
from dap3d_core.scene.signals import MOST_TERMS, SYSTEM_NAMES


def scene_with(**combinations):
    """A body that a force pushes by the function ``all``; combinations: name -> (type, terms)."""
    scene = dap.Scene(name="combined")
    scene.add_body("block", mass=2.0, Jp=(1.0, 1.0, 1.0))
    scene.add_function("harmonic", "swing", frequency=3.0)
    scene.add_function("a", "ramp", coeff=(0.0, 1.0, 0.0))
    for name, (type_, terms) in combinations.items():
        scene.add_function(type_, name, functions=terms)
    scene.add_force("f", "push", body_i="block", f=(1.0, 0.0, 0.0), function="all")
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
    """Each doubles the one before it: all terms together would be one kernel."""
    count = MOST_TERMS.bit_length()
    pairs = {f"s{k}": ("sum", [f"s{k - 1}", f"s{k - 1}"] if k else ["swing"]) for k in range(count)}
    pairs["all"] = ("sum", [f"s{count - 1}", f"s{count - 1}"])
    with pytest.raises(dap.SceneError, match=f"combines {2**count} functions"):
        check(scene_with(**pairs), dap.load_registry())


def scene_pushed(value=0.0, name="motor", **fields):
    """A body that a force pushes by an input, or by other fields."""
    scene = dap.Scene(name="pushed")
    scene.add_body("block", mass=2.0, Jp=(1.0, 1.0, 1.0))
    scene.add_function("harmonic", "swing", frequency=3.0)
    scene.add_input(name, value)
    scene.add_force("f", "push", body_i="block", f=(1.0, 0.0, 0.0), **(fields or {"input": name}))
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
    """The list that inputs are checked against is that of the quantities."""
    assert set(SYSTEM_NAMES) == {name.partition(".")[0] for name in SYSTEM}


def test_keys_of_an_input_are_known():
    """In Python as in a file."""
    with pytest.raises(dap.SceneError, match=r"motor\.start"):
        dap.Scene().add_input("motor", start=1.0)
    with pytest.raises(dap.SceneError, match="there is one of this name in inputs"):
        scene_pushed().add_input("motor")
