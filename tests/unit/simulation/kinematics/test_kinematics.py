"""Kinematics: what is found, located and refused; closed forms are in tests/verification."""

import numpy as np
import pytest
from support import one_freedom
from support.mechanisms import planar_four_bar
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.result import find

A, B, HEIGHT = 0.1, 0.35, 0.02


def pushed(coefficients, q=1.0):
    """A slider-crank whose slider is driven: to x(0) + f(t)."""
    scene = one_freedom.slider_crank_scene(q, (0.0, 1.0, 0.0))
    del scene.joints["motor"], scene.functions["turning"]
    scene.add_function("a", "way", coeff=coefficients)
    scene.add_joint("drive-tran", "ram", P_i="slider.O", P_j="guide", a_j="ground.x",
                    function="way")  # fmt: skip
    return scene


def x_of(q):
    """Place of the slider."""
    return A * np.cos(q) + np.sqrt(B**2 - (HEIGHT - A * np.sin(q)) ** 2)


#: Where the crank and the rod are in line.
REACH = np.sqrt((A + B) ** 2 - HEIGHT**2)


def turning_parallelogram():
    """A parallelogram of unit links, upright, whose crank turns by one rad/s."""
    scene = planar_four_bar()
    scene.add_function("a", "turning", coeff=(0.0, 1.0, 0.0))
    scene.add_joint("drive-rot", "motor", body_i="left", a_j="ground.z", function="turning")
    return scene


@long_in_plain_python
def test_a_driver_beyond_reach_ends_at_its_dead_point():
    """The instant is located to 1e-9 s, the driver named, what was found before kept."""
    scene = pushed((0.0, 1.0, 0.0))
    with pytest.raises(dap.SimulationError, match="dead point") as caught:
        dap.kinematics(scene, t_end=1.0, dt=0.001)
    words = str(caught.value)
    end = REACH - x_of(1.0)
    located = float(words.partition("t = ")[2].partition(" s")[0])
    assert abs(located - end) < 1e-9
    assert "ram" in words
    assert "crank turns" in words
    result = caught.value.result
    assert result.status == "stopped"
    assert 0.0 < end - result.t[-1] <= 0.001
    assert np.max(np.abs(result.r[:, 2, 0] - x_of(1.0) - result.t)) < 1e-14
    assert words in result.notes


def test_a_driver_that_turns_back_at_a_dead_point_passes_through_it():
    """The crank goes on in its way, and the note on the branch point has the instant."""
    gap = REACH - x_of(1.0)
    result = dap.kinematics(pushed((0.0, 2.0 * gap, -gap)), t_end=2.0, dt=0.25)
    note = next(note for note in result.notes if note.startswith("branch point"))
    assert abs(float(note.partition("t = ")[2].partition(" s")[0]) - 1.0) < 1e-9
    angle = np.arctan2(-result.p[:, 0, 2], result.p[:, 0, 0]) * 2.0
    assert np.all(np.diff(angle) < 0.0)
    dead = result.r[4, 0] / np.linalg.norm(result.r[4, 0])  # reported at the singular pose
    assert np.max(np.abs(dead - [REACH / (A + B), 0.0, HEIGHT / (A + B)])) < 1e-9
    assert result.ledger["position"].ok
    assert result.ledger["velocity"].ok


@long_in_plain_python
def test_branch_points_of_a_parallelogram_are_passed_smoothly():
    """Coupler parallel to the ground through both flat poses; accelerations at one, too."""
    half = np.pi / 2.0
    result = dap.kinematics(turning_parallelogram(), over={"motor.q": half * np.arange(5)})
    notes = [note for note in result.notes if note.startswith("branch point")]
    located = [float(note.partition("q = ")[2].partition(":")[0]) for note in notes]
    assert np.max(np.abs(np.array(located) - [half, 3.0 * half])) < 1e-9
    turned = half + half * np.arange(5)
    exact = np.stack([1.0 + np.cos(turned), np.sin(turned), 0.0 * turned], axis=-1)
    assert np.max(np.abs(result.r[:, 1] - exact)) < 1e-12
    assert np.max(np.abs(result.rdd[:, 1] + exact - [1.0, 0.0, 0.0])) < 1e-10
    assert any("reactions in these joints are not" in note for note in result.notes)


def test_over_a_coordinate_time_is_the_coordinate():
    """From a negative value, backwards, with unit rate; as a run with that function."""
    scene = one_freedom.slider_crank_scene(0.3, (0.0, 5.0, 0.0))
    values = np.linspace(0.5, -0.7, 4)
    result = dap.kinematics(scene, over={"motor.q": values})
    assert np.allclose(result.t, values[::-1], atol=0.0)
    assert np.max(np.abs(result.r[:, 2, 0] - x_of(0.3 + result.t))) < 1e-14
    assert np.allclose(result.w[:, 0, 1], -1.0, atol=1e-14)
    assert (find(result, "t").label, find(result, "t").unit) == ("motor.q", "rad")
    other = dap.kinematics(scene, over="motor.q=-0.7:0.5:4")
    assert np.allclose(result.u, other.u, atol=1e-13)


@pytest.mark.slow
@long_in_plain_python
def test_rows_of_the_velocity_level_are_integrated_to_rounding():
    """fourbar2 has a rate driver: after a turn both bodies are back."""
    result = dap.kinematics("fourbar2", t_end=1.0, dt=0.5)
    assert np.max(np.abs(result.r[-1] - result.r[0])) < 1e-11
    assert np.max(np.abs(result.r[1, 1] - [2.33416577, 1.66583423, 1.16333155])) < 1e-8
    assert max(result.arrays.position_residual) < 1e-13


def test_freedoms_left_are_named_by_their_motions():
    """The idle spin of a coupler; a scene without a driver."""
    with pytest.raises(dap.SimulationError, match=r"leave 1 degree.*\n.*coupler turns about"):
        dap.kinematics("fourbar3")
    with pytest.raises(dap.SimulationError, match=r"(?s)no driver.*3 degrees.*cone turns about"):
        dap.kinematics("pen1")


def test_a_coordinate_that_begins_beyond_reach_is_refused():
    """Where the way from the pose as given to its first value ends, nothing is kept."""
    with pytest.raises(dap.SimulationError, match=r"dead point at ram\.q = 0\.05145367") as caught:
        dap.kinematics(pushed((0.0, 1.0, 0.0)), over="ram.q=0.5:0.4:3")
    assert caught.value.result is None


def test_a_scene_is_solved_once_where_it_ends_at_zero():
    """As a run does with t_end = 0; without joints all freedoms are left."""
    result = dap.kinematics(one_freedom.slider_crank_scene(0.3, (0.0, 5.0, 2.0)), t_end=0.0)
    assert result.t.tolist() == [0.0]
    with pytest.raises(dap.SimulationError, match="12 degrees of freedom are left"):
        dap.kinematics("bodies2", t_end=1.0)


def test_a_start_at_a_singular_pose_is_refused():
    """With what leads away from there."""
    scene = turning_parallelogram()
    for name, r, turn in (("left", (0.5, 0, 0), -90), ("top", (2, 0, 0), 0),
                          ("right", (2.5, 0, 0), -90)):  # fmt: skip
        half = np.radians(turn) / 2.0
        scene.bodies[name].r = r
        scene.bodies[name].p = (np.cos(half), 0.0, 0.0, np.sin(half))
    for analyse in (dap.kinematics, dap.simulate):
        with pytest.raises(dap.SimulationError, match="singular pose"):
            analyse(scene, t_end=1.0)


@pytest.mark.parametrize(
    ("over", "words"),
    [
        ("moter.q=0:1:3", "did you mean 'motor.q'"),
        ("bearing.q=0:1:3", "motor drives its bodies; did you mean 'motor.q'"),
        ("wrist.q=0:1:3", "no driver\n    drivers: motor"),
        ("motor.angle=0:1:3", "did you mean 'motor.q'"),
        ("motor.q=0:1", "from:to:count"),
        ("motor.q=0:0:3", "rise, or that fall"),
        ({"motor.q": [0.0, "x"]}, "rise, or that fall"),
        (3.0, "should be"),
    ],
)
def test_a_wrong_coordinate_is_refused(over, words):
    """With the nearest name, or the form."""
    scene = one_freedom.slider_crank_scene(0.3, (0.0, 5.0, 0.0))
    with pytest.raises(dap.SceneError) as caught:
        dap.kinematics(scene, over=over)
    assert words in str(caught.value)


def test_a_coordinate_and_times_exclude_each_other():
    """And a scene without a final time is refused as by a run."""
    scene = one_freedom.slider_crank_scene(0.3, (0.0, 5.0, 0.0))
    with pytest.raises(dap.SceneError, match="leave t_end and dt out"):
        dap.kinematics(scene, over="motor.q=0:1:3", t_end=1.0)
    with pytest.raises(dap.SceneError, match="t_end"):
        dap.kinematics(scene)


def test_an_interrupt_keeps_what_was_found(tmp_path):
    """In memory and in the output."""
    scene = one_freedom.slider_crank_scene(0.3, (0.0, 5.0, 0.0))

    def stop(t, t_end):
        if t > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        dap.kinematics(scene, t_end=1.0, dt=0.1, progress=stop, output=tmp_path / "a.nc")
    assert caught.value.result.status == "interrupted"
    stored = dap.open(tmp_path / "a.nc")
    assert stored.status == "interrupted"
    assert len(stored.t) >= 5


def test_a_result_has_all_its_quantities_and_files(tmp_path):
    """Reactions of the file are those in memory; the moment of the driver does the work."""
    scene = one_freedom.slider_crank_scene(0.3, (0.0, 5.0, 2.0))
    result = dap.kinematics(scene, t_end=1.0, dt=0.25, output=tmp_path / "a.nc")
    stored = dap.open(tmp_path / "a.nc")
    assert np.array_equal(stored.reaction("wrist")["i"].force, result.reaction("wrist")["i"].force)
    assert stored.integrator == "kinematics"
    assert all(entry.ok in (True, None) for entry in stored.ledger.values())
    assert "energy" not in stored.ledger  # work is the change of the kinetic energy, no measure


def test_states_of_elements_stay_and_that_is_said():
    """Nothing is integrated: their forces are those of the initial values."""
    scene = pushed((0.0, 0.01, 0.0))
    scene.add_force("maxwell", "late", P_i="slider.O", P_j="guide", k=10.0, c=1.0, z_0=0.02)
    result = dap.kinematics(scene, t_end=1.0, dt=0.5)
    assert result.quantity("late.z").values.tolist() == [0.02] * 3
    assert any("states of elements keep their initial values (late.z)" in n for n in result.notes)
