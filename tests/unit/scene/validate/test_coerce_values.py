"""What the check changes, assumes or finds odd is noted, and nothing else is."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from unit.scene.base import BASE

import dap3d_core as dap
from dap3d_core.scene import check


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("p = [1.0, 0.0", "p = [0.9999999, 0.0", ["bodies.crank.p", "normalised"]),
        ("sp = [1.0, 0.0, 0.0]", "sp = [2.0, 0.0, 0.0]", ["vectors.axis.sp", "length 2"]),
        ("mass = 1.0\n", "", ["bodies.crank.mass", "1.0 kg"]),
        ("Jp = [0.5, 0.5, 0.1]\n", "", ["bodies.crank.Jp", "kg m^2"]),
        ("rtol = 1e-8", "atol = 0", ["atol"]),
        ("[forces.g]", '[forces.g2]\ntype = "weight"\n[forces.g]', ["forces.g is the same"]),
        ("[forces.g]", '[joints.J5]\ntype = "sph-sph"\nd = "d1"\nlength = 7.0\n[forces.g]',
         ["joints.J5", "differs only in its numbers", "joints.J4"]),
    ],
)  # fmt: skip
def test_what_is_changed_or_assumed_is_noted(scene_of, registry, old, new, words):
    assert old in BASE
    notes = check(scene_of(BASE.replace(old, new)), registry).notes
    assert any(all(w in note for w in words) for note in notes), notes


def test_what_is_noted_is_done(scene_of, registry):
    text = BASE.replace(
        "\np = [1.0, 0.0", "\np_0 = [0, 0, 0, 0.9999999]\np = [0.9999999, 0.0"
    ).replace("sp = [1.0, 0.0, 0.0]", "sp = [2.0, 0.0, 0.0]")
    checked = check(scene_of(text), registry)
    np.testing.assert_array_equal(checked.p[0], [1, 0, 0, 0])
    np.testing.assert_array_equal(checked.p_0[0], [0, 0, 0, 1])
    assert checked.joints[0].values["a_i"] == (1.0, 0.0, 0.0)


def test_rounding_of_unit_lengths_is_not_noted(scene_of, registry):
    text = BASE.replace("p = [1.0, 0.0, 0.0, 0.0]", "p = [0.7071067811865, 0.7071067811865, 0, 0]")
    assert check(scene_of(text), registry).notes == []


def test_functions_of_time_and_of_other_arguments_are_used(registry):
    """A motor's, of time, and a spring's, of its elongation; the third is not."""
    scene = dap.Scene()
    scene.add_body("a", mass=1.0, Jp=[1.0, 1.0, 1.0])
    for name in ("motor", "curve", "spare"):
        scene.add_function("a", name, coeff=[0.0, 1.0, 0.0])
    scene.add_joint("rel-rot", body_i="a", a_j="ground.z", function="motor")
    scene.add_force("ptp", P_i="a.O", P_j="ground.O", function="curve")
    notes = check(scene, registry).notes
    assert notes == ["functions.spare: no joint and no force uses it"]


def test_a_body_without_joint_or_force_is_noted(registry):
    scene = dap.Scene()
    scene.add_body("free", mass=1.0, Jp=[1.0, 1.0, 1.0])
    assert check(scene, registry).notes == ["bodies.free: no joint and no force acts on it"]
    scene.add_force("weight")
    assert check(scene, registry).notes == []


def test_many_notes_of_a_kind_are_counted(registry):
    scene = dap.Scene()
    for k in range(50):
        scene.add_body(f"b{k}", mass=1.0, Jp=[1.0, 1.0, 1.0])
    notes = check(scene, registry).notes
    assert len(notes) == 11
    assert notes[-1] == "... and 40 more: bodies left alone"


def test_many_mistakes_are_all_kept_and_partly_printed(registry):
    scene = dap.Scene()
    for k in range(1500):
        scene.add_body(f"b{k}", mass=-1.0, Jp=[1.0, 1.0, 1.0])
    with pytest.raises(dap.SceneError) as caught:
        check(scene, registry)
    assert len(caught.value.mistakes) == 1500
    assert str(caught.value).endswith("... and 500 more mistakes")


def test_the_triangle_inequality_has_room_for_rounding(registry):
    scene = dap.Scene()
    scene.add_body("plate", mass=1.0, Jp=[0.1, 0.2, 0.1 + 0.2])
    scene.add_body("disc", mass=1.0, Jp=[0.01, 0.02, 0.01])
    check(scene, registry)


TURNED = [
    ({"rpy": (0.3, -0.7, 2.0)}, Rotation.from_euler("xyz", (0.3, -0.7, 2.0))),
    ({"rpy": ("30 deg", 0.1, "-1.5e1deg")},
     Rotation.from_euler("xyz", (30, 5.729577951, -15), True)),
    ({"axis_angle": (1, 2, 2, "90 deg")},
     Rotation.from_rotvec(np.array([1, 2, 2]) / 3 * np.pi / 2)),
]  # fmt: skip


@pytest.mark.parametrize(("given", "wanted"), TURNED)
def test_orientations_are_those_of_scipy(given, wanted):
    """Roll, pitch, yaw are turns about fixed axes; an axis may have any length."""
    scene = dap.Scene(name="turned")
    scene.add_body("b", mass=1.0, Jp=(1.0, 1.0, 1.0), **given)
    x, y, z, e0 = wanted.as_quat()
    found = check(scene, dap.load_registry()).p[0]
    assert abs(found @ (e0, x, y, z)) == pytest.approx(1.0, abs=1e-10)
    assert np.linalg.norm(found) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"rpy": (1, 2)}, "3 numbers: roll, pitch and yaw"),
        ({"rpy": ("30 degs", 0, 0)}, "one of deg, rad"),
        ({"rpy": "30 deg"}, "3 numbers: roll, pitch and yaw"),
        ({"axis_angle": (0, 0, 0, 1)}, "an axis of zero length"),
        ({"axis_angle": (0, 1, "30 deg")}, "an axis, 3 numbers, and an angle"),
        ({"rpy": (0, 0, 1), "p": (0, 1, 0, 0)}, "give one of rpy and p"),
        ({"rpy": (0, 0, 1), "axis_angle": (0, 1, 0, 0)}, "give one of rpy and axis_angle"),
    ],
)
def test_orientations_that_mean_nothing_are_refused(given, words):
    """With what is allowed."""
    scene = dap.Scene(name="turned")
    scene.add_body("b", mass=1.0, Jp=(1.0, 1.0, 1.0), **given)
    with pytest.raises(dap.SceneError, match=words):
        check(scene, dap.load_registry())


def test_angles_of_types_may_be_given_in_degrees_and_rates_in_turns():
    """Numbers whose unit is rad or rad/s; no others."""
    scene = dap.Scene(name="turned")
    for name in ("a", "b"):
        scene.add_body(name, mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_force("rot_sda", "coil", v_i="a.x", v_j="b.x", axis="b.z", k=1.0, theta_0="90 deg")
    assert check(scene, dap.load_registry()).forces[0].values["theta_0"] == pytest.approx(
        np.pi / 2, rel=1e-15
    )
    scene.forces["coil"].fields["k"] = "3 deg"
    words = r'k = "3 deg": should be a number, not text\n +write a number .* or "= 3 \* deg"'
    with pytest.raises(dap.SceneError, match=words):
        check(scene, dap.load_registry())


def test_orientations_in_degrees_are_noted():
    """Only numbers beyond a turn; texts, and the length of an axis, are what they say."""
    scene = dap.Scene()
    given = {"a": {"rpy": (0, 0, 90)}, "b": {"rpy": (0, 0, "900 deg")},
             "c": {"axis_angle": (0, 90, 0, 1)}, "d": {"axis_angle": [0, 1, 0, -30.0]}}  # fmt: skip
    for name, turn in given.items():
        scene.add_body(name, mass=1.0, Jp=(1.0, 1.0, 1.0), **turn)
    assert [note for note in check(scene, dap.load_registry()).notes if "turn" in note] == [
        "bodies.a.rpy = [0, 0, 90]: an angle is more than a full turn; angles are in rad",
        "bodies.d.axis_angle = [0, 1, 0, -30.0]: an angle is more than a full turn; "
        "angles are in rad",
    ]


def test_the_name_of_a_parameter_gets_its_sign():
    scene = dap.Scene()
    scene.parameters["m"] = 2.0
    scene.add_body("a", mass="m", Jp=(1.0, 1.0, 1.0))
    with pytest.raises(dap.SceneError, match='write "= m" for a parameter'):
        check(scene, dap.load_registry())
