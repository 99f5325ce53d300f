"""Outputs of joints and forces: those of a result, which other code computes, to rounding."""

import numpy as np
import pytest
from tests.unit.native.run.test_prepared import door, sled
from tests.unit.native.test_export import (
    RESISTING,
    SPRING,
    _written,
    declared_ball,
    exported,
    two_floors,
)

import dap3d_core as dap
from dap3d_core.result import ResultError, UnknownNameError

PARTS = ("force", "moment", "force_body", "moment_body", "moment_at_point")


def elements_of(result, scene):
    """Quantities of all joints and forces that a result has."""
    names = [f"{j}.{part}" for j in scene.joints for part in PARTS]
    names += [f"{j}.j.{part}" for j in scene.joints for part in PARTS[:2]]
    more = ("length", "length_rate", "tension", "energy", "j.force", "force", "moment_at_point")
    names += [f"{f}.{part}" for f in scene.forces for part in more]
    found = []
    for name in names:
        try:
            result.quantity(name)
        except (ResultError, UnknownNameError):
            continue
        found.append(name)
    return found


@pytest.mark.slow
@pytest.mark.every(5)
@pytest.mark.parametrize("model", ["fourbar3", "quarter_car", "crane", "planetary", "A03"])
def test_reactions_and_forces_are_those_of_a_result(tmp_path, model):
    scene = dap.load(model)
    t_end = 0.2
    result = dap.simulate(scene, t_end=t_end, dt=0.1)
    names = elements_of(result, scene)
    made, library = exported(scene, tmp_path, outputs=names)
    run = library.start(t_end)
    for k, t in enumerate(result.t):
        run.step_to(t)
        expected = np.concatenate([np.atleast_1d(result.quantity(n).values[k]) for n in names])
        # sums in another order: of numbers as large as the largest of all
        size = np.abs(expected).max()
        np.testing.assert_allclose(run.values(made.outputs), expected, rtol=0, atol=1e-11 * size)


STEPPED = {"contact": "stepping", "contact_step": 2e-3}


@pytest.mark.slow
@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("make", "settings"),
    [(sled, {}), (door, {}), (RESISTING, {}), (door, STEPPED), (declared_ball, STEPPED)],
)
def test_contacts_are_those_of_a_result(tmp_path, make, settings):
    """Bits but for what reads angular velocities, which results keep along other axes."""
    scene, t_end = make(), 0.6
    result = dap.simulate(scene, t_end=t_end, dt=t_end / 20, **settings)
    points = [point for of in result.summary.contacts.values() for point in of]
    exact = [f"{of}.{part}" for of in result.contact_names for part in ("gap", "normal", "mode")]
    others = [f"{point}.{part}" for point in points for part in ("friction", "slip")]
    made, library = exported(scene, tmp_path, outputs=exact + others, **settings)
    assert len(made.outputs) == 9 * len(points)
    run, found = library.start(t_end), []
    for t in result.t:
        run.step_to(t)
        found.append(run.values(made.outputs))
    expected = np.column_stack([result.quantity(name).values for name in made.outputs])
    changing = [name.endswith((".normal", ".mode")) for name in made.outputs]
    assert np.ptp(expected[:, changing], axis=0).max() > 0.1
    count = 3 * len(points)
    assert np.array_equal(np.array(found)[:, :count], expected[:, :count])
    size = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, rtol=0, atol=4e-15 * size)


def test_a_state_of_an_element_has_the_bits_of_a_result(tmp_path):
    scene = dap.Scene(name="damped")
    scene.add_body("ball", mass=1.0, Jp=[0.01] * 3, r=[0, 0, -1.0])
    ends = {"P_i": "ball.O", "P_j": "ground.O"}
    scene.add_force("maxwell", "damper", **ends, k=100.0, c=10.0, l0=0.9)
    scene.add_force("weight", "g")
    _, library = exported(scene, tmp_path, outputs=["damper.z"])
    run = library.start(1.0)
    run.step_to(1.0)
    expected = dap.simulate(scene, t_end=1.0).quantity("damper.z").values[-1]
    assert run["damper.z"] == expected > 0.1


@pytest.mark.slow
def test_contacts_have_derivatives_of_what_the_state_gives(tmp_path):
    """The gap of a ball above a plane is its height, and slip at its foot that of its centre."""
    outputs = ["floor_a.gap", "floor_b.gap", "floor_b.slip.x", "floor_b.mode"]
    _, library = exported(two_floors(), tmp_path, outputs=outputs)
    run = library.start(1.0)
    run.step_to(0.05)
    along = {"state.b.r.z": 2.0, "state.b.rd.x": 3.0}
    assert run.directional(outputs, along).tolist() == pytest.approx(
        [0.0, 2.0, 3.0, 0.0], abs=1e-15
    )


@pytest.mark.slow
def test_outputs_of_the_scene_may_be_reactions(tmp_path):
    scene = _written(SPRING.replace('reach = "', 'held = "norm(track.force)"\nreach = "'), tmp_path)
    made, library = exported(scene, tmp_path)
    assert made.left_out == ()
    run, here = library.start(2.0), dap.start(scene, t_end=2.0)
    here.step(0.5)
    run.step_to(0.5)
    assert run["held"] == pytest.approx(here.result().quantity("held").values[-1], rel=1e-12)


def test_a_point_that_outputs_read_is_no_parameter(tmp_path):
    scene = dap.load("fourbar3")
    options = {"parameters": ["points.P3.sPp.z"], "outputs": ["P3.v"]}
    with pytest.raises(dap.SceneError, match="outputs depend on it"):
        exported(scene, tmp_path, **options)
