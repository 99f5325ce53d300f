"""Outputs as scripts give them, and functions of results."""

import pytest

import dap3d_core as dap
from dap3d_core.study import Output, outputs_of


def last_height(result):
    return result.r[-1, 0, 2]


def test_forms_of_outputs():
    assert outputs_of("rod.r.z") == (Output("rod.r.z", "rod.r.z", "end"),)
    assert outputs_of("rod.r.z:max") == (Output("rod.r.z:max", "rod.r.z", "max"),)
    assert outputs_of(last_height) == (Output("last_height", last_height, ""),)
    found = outputs_of({"peak": "rod.r.z:max", "own": last_height})
    assert found == (Output("peak", "rod.r.z", "max"), Output("own", last_height, ""))
    assert outputs_of(["a:b.r.z"]) == (Output("a:b.r.z", "a:b.r.z", "end"),)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([], "at least one"),
        ({}, "at least one"),
        (3, "an output is text"),
        ([3], "an output is text"),
        ("rod.r.z:maximum", "did you mean 'rod.r.z:max'"),
        ("rod.r.z:", "the reduction after the colon is one of end, final, min, max, mean, rms"),
        (":max", "an output is text"),
        (["rod.r.z", "rod.r.z"], "named once only"),
        ([lambda result: 0.0], "needs a label"),
        ({"": "rod.r.z"}, "text of one line"),
        ({"a\nb": "rod.r.z"}, "text of one line"),
        ({3: "rod.r.z"}, "text of one line"),
        ({"status": "rod.r.z"}, "reserved in every study"),
    ],
)
def test_invalid_outputs(given, words):
    with pytest.raises(dap.SceneError) as refused:
        outputs_of(given)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda result: 1 / 0, "'own' raises ZeroDivisionError: division by zero"),
        (lambda result: "much", "'own' should return one number, not \"much\""),
        (lambda result: None, "should return one number, not None"),
        (lambda result: result.r, "should return one number"),
    ],
)
def test_a_function_that_returns_no_number_is_named(function, words):
    result = dap.simulate(falling(), t_end=0.1)
    (output,) = outputs_of({"own": function})
    with pytest.raises(dap.SimulationError, match=words):
        output.value(result)


def falling():
    scene = dap.Scene(name="fall")
    scene.add_body("stone", mass=1.0, Jp=(1.0, 1.0, 1.0))
    return scene


@pytest.mark.parametrize(("field", "turn"), [("rpy.y", 0.4), ("r_0.x", None)])
def test_coordinates_of_joints_follow_the_poses_they_count_from(field, turn):
    """A joint counts from the pose of its scene, or from the reference pose; it starts at rest."""
    scene = dap.Scene(name="slide")
    scene.add_body("b", mass=1.0, Jp=(0.1, 0.1, 0.1), rpy=(0.0, 0.0, 0.0), r_0=(0.1, 0.0, 0.0))
    scene.add_joint("tran", "T", P_i="b.O", P_j="ground.O", a_j="ground.x")
    scene.add_body("c", mass=1.0, Jp=(0.1, 0.1, 0.1), rpy=(0.0, 0.0, 0.0))
    scene.add_joint("rev", "h", P_i="c.O", P_j="ground.O", a_i="c.y", a_j="ground.y")
    name, quantity = ("c", "h.angle") if turn else ("b", "T.length")
    swept = dap.sweep(scene, {f"bodies.{name}.{field}": [0.2, 0.4]}, outputs=[f"{quantity}:end"],
                      t_end=0.1, dt=0.1)  # fmt: skip
    wanted = [0.0, 0.0] if turn else [-0.2, -0.4]
    assert swept[f"{quantity}:end"].values == pytest.approx(wanted, abs=1e-12)
