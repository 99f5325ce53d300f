"""Inputs of a scene: what is accepted, noted and refused."""

import pytest

import dap3d_core as dap
from dap3d_core.result.quantities.catalogue import SYSTEM
from dap3d_core.scene import check
from dap3d_core.scene.signals.inputs import SYSTEM_NAMES


def scene_with(value=0.0, name="motor", **fields):
    """A body that a force pushes by an input, or by other fields."""
    scene = dap.Scene(name="pushed")
    scene.add_body("block", mass=2.0, Jp=(1.0, 1.0, 1.0))
    scene.add_function("harmonic", "swing", frequency=3.0)
    scene.add_input(name, value)
    scene.add_force("f", "push", body_i="block", f=(1.0, 0.0, 0.0), **(fields or {"input": name}))
    return scene


def test_an_input_is_written_and_read(tmp_path):
    """A table of its own; its value is an expression where there are parameters."""
    scene = scene_with(0.25)
    assert dap.load(scene.save(tmp_path / "scene.toml")) == scene
    assert dict(check(scene, dap.load_registry()).inputs) == {"motor": 0.25}
    scene.add_parameter("L", 3.0)
    scene.inputs["motor"].value = "= 2 * L"
    assert dict(check(scene, dap.load_registry()).inputs) == {"motor": 6.0}


def test_an_input_that_nothing_reads_is_noted():
    """As a function that nothing uses."""
    notes = check(scene_with(function="swing"), dap.load_registry()).notes
    assert "inputs.motor: no joint and no force reads it" in notes
    assert not any("inputs" in note for note in check(scene_with(), dap.load_registry()).notes)


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (scene_with(input="moter"), "push.input.*no input 'moter'; did you mean 'motor'"),
        (scene_with(input="swing"), "no input 'swing'.*swing is a function, not one of"),
        (scene_with(input="motor", function="swing"), "give function or input, not both"),
        (scene_with(float("nan")), "inputs.motor.value.*should be a finite number"),
        (scene_with("fast"), "inputs.motor.value.*should be a number, not text"),
        (scene_with(name="block"), "not a name for an input: there is one of this name in bodies"),
        (scene_with(name="two words"), "inputs.two words.*not a name for an input"),
        (scene_with(name="energy"), "every result has a quantity of this name"),
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
        scene_with().add_input("motor")
