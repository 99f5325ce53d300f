"""What the check changes, assumes or finds odd is noted, and nothing else is."""

import numpy as np
import pytest
from unit.scene.base import BASE

from dap3d_core.scene import Scene, SceneError, check


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("p = [1.0, 0.0", "p = [0.9999999, 0.0", ["bodies.crank.p", "normalised"]),
        ("sp = [1.0, 0.0, 0.0]", "sp = [2.0, 0.0, 0.0]", ["vectors.axis.sp", "length 2"]),
        ("mass = 1.0\n", "", ["bodies.crank.mass", "1.0 kg"]),
        ("Jp = [0.5, 0.5, 0.1]\n", "", ["bodies.crank.Jp", "kg m^2"]),
        ("rtol = 1e-8", "atol = 0", ["atol"]),
        ("[forces.g]", '[forces.g2]\ntype = "weight"\n[forces.g]', ["forces.g is the same"]),
        (
            "[forces.g]",
            '[joints.J5]\ntype = "sph-sph"\nd = "d1"\nlength = 7.0\n[forces.g]',
            ["joints.J5", "differs only in its numbers", "joints.J4"],
        ),
    ],
)
def test_what_is_changed_or_assumed_is_noted(scene_of, registry, old, new, words):
    assert old in BASE
    notes = check(scene_of(BASE.replace(old, new)), registry).notes
    assert any(all(w in note for w in words) for note in notes), notes


def test_what_is_noted_is_done(scene_of, registry):
    text = BASE.replace("p = [1.0, 0.0", "p = [0.9999999, 0.0").replace(
        "sp = [1.0, 0.0, 0.0]", "sp = [2.0, 0.0, 0.0]"
    )
    checked = check(scene_of(text), registry)
    np.testing.assert_array_equal(checked.p[0], [1, 0, 0, 0])
    assert checked.joints[0].values["a_i"] == (1.0, 0.0, 0.0)


def test_rounding_of_unit_lengths_is_not_noted(scene_of, registry):
    text = BASE.replace("p = [1.0, 0.0, 0.0, 0.0]", "p = [0.7071067811865, 0.7071067811865, 0, 0]")
    assert check(scene_of(text), registry).notes == []


def test_functions_of_time_and_of_other_arguments_are_used(registry):
    """A motor's, of time, and a spring's, of its elongation; the third is not."""
    scene = Scene()
    scene.add_body("a", mass=1.0, Jp=[1.0, 1.0, 1.0])
    for name in ("motor", "curve", "spare"):
        scene.add_function("a", name, coeff=[0.0, 1.0, 0.0])
    scene.add_joint("rel-rot", body_i="a", a_j="ground.z", function="motor")
    scene.add_force("ptp", P_i="a.O", P_j="ground.O", function="curve")
    notes = check(scene, registry).notes
    assert notes == ["functions.spare: no joint and no force uses it"]


def test_a_body_without_joint_or_force_is_noted(registry):
    scene = Scene()
    scene.add_body("free", mass=1.0, Jp=[1.0, 1.0, 1.0])
    assert check(scene, registry).notes == ["bodies.free: no joint and no force acts on it"]
    scene.add_force("weight")
    assert check(scene, registry).notes == []


def test_many_notes_of_a_kind_are_counted(registry):
    scene = Scene()
    for k in range(50):
        scene.add_body(f"b{k}", mass=1.0, Jp=[1.0, 1.0, 1.0])
    notes = check(scene, registry).notes
    assert len(notes) == 11
    assert notes[-1] == "... and 40 more: bodies left alone"


def test_many_mistakes_are_all_kept_and_partly_printed(registry):
    scene = Scene()
    for k in range(1500):
        scene.add_body(f"b{k}", mass=-1.0, Jp=[1.0, 1.0, 1.0])
    with pytest.raises(SceneError) as caught:
        check(scene, registry)
    assert len(caught.value.mistakes) == 1500
    assert str(caught.value).endswith("... and 500 more mistakes")


def test_the_triangle_inequality_has_room_for_rounding(registry):
    scene = Scene()
    scene.add_body("plate", mass=1.0, Jp=[0.1, 0.2, 0.1 + 0.2])
    scene.add_body("disc", mass=1.0, Jp=[0.01, 0.02, 0.01])
    check(scene, registry)
