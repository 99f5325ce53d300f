"""Points with derivatives: values of the batch, derivatives of the run with all of its set-up."""

import attrs
import numpy as np
import pytest
from support.plain import jit_is_on

import dap3d_core as dap
from dap3d_core.study import Ensemble, Study, outputs_of

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="derivatives are of compiled code")
SETTINGS = {"t_end": 0.2, "dt": 0.05, "rtol": 1e-11, "atol": 1e-13}


def ensemble_of(scene, names, quantities, **settings):
    scene = scene.copy()
    scene.simulation = attrs.evolve(scene.simulation, **SETTINGS, **settings)
    outputs = outputs_of({name: f"{name}:series" for name in quantities})
    return Ensemble(Study(scene, tuple(names), outputs, allow_code=False))


def pendulum():
    scene = dap.Scene(name="pendulum")
    scene.parameters["length"] = 0.7
    scene.add_body("bob", mass=1.0, Jp=(0.02, 0.02, 0.02), r=("= length", 0.0, 0.0))
    scene.add_point("pin", body="bob", sPp=("= -length", 0.0, 0.0))
    scene.add_joint("rev", "hinge", P_i="pin", P_j="ground.O", a_i="bob.y", a_j="ground.y")
    scene.add_force("weight", "gravity")
    return scene


@pytest.mark.slow
@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("scene", "names", "settings", "part"),
    [
        # copied numbers: the floor is that of differences at the start of the run beside it
        ("bodies2", ["forces.spring1.k", "points.A.sPp.x", "bodies.upper.mass"], {}, 1e-10),
        # a start that is corrected in compiled code, which passes on derivatives
        ("pen2", ["points.P3.sPp.y", "bodies.rod.w.y"], {"correct": True}, 1e-9),
        # joint coordinates
        ("pen2", ["bodies.rod.mass", "bodies.rod.Jp.x"], {"method": "joint"}, 1e-9),
        # models made anew: differences of second order with a step of 1e-4
        (pendulum(), ["parameters.length", "bodies.bob.mass"], {}, 1e-7),
    ],
    ids=["copied", "corrected", "tree", "rebuilt"],
)
def test_one_run_has_the_values_of_the_batch_and_derivatives(scene, names, settings, part):
    scene = dap.load(scene) if isinstance(scene, str) else scene
    body = next(iter(scene.bodies))
    quantities = [f"{body}.r.z", f"{body}.w.y"]
    ensemble = ensemble_of(scene, names, quantities, **settings)
    x = np.array([parameter.value for parameter in ensemble.parameters])
    found = ensemble.series_with_slopes(x, np.abs(x) + 0.1)
    again = ensemble.series_with_slopes(x, np.abs(x) + 0.1)
    batch = ensemble.run(x)
    s = dap.sensitivities(ensemble.study.scene, names)
    for name in quantities:
        values, slopes = found[name]
        assert values.tobytes() == batch.values[name][0].tobytes()
        assert slopes.tobytes() == again[name][1].tobytes()
        expected = s.of(name)
        assert np.max(np.abs(slopes - expected)) <= part * max(np.max(np.abs(expected)), 1e-3)
        assert np.any(expected)


def test_outputs_that_are_computed_from_more_than_rows_have_derivatives():
    ensemble = ensemble_of(dap.load("pen2"), ["bodies.rod.mass"], ["energy.kinetic"])
    x = np.array([parameter.value for parameter in ensemble.parameters])
    values, slopes = ensemble.series_with_slopes(x, np.ones(1))["energy.kinetic"]
    ends = [ensemble.run(x + h).values["energy.kinetic"][0] for h in (1e-3, -1e-3)]
    # the difference errs by h^2
    np.testing.assert_allclose(slopes[:, 0], (ends[0] - ends[1]) / 2e-3, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(values, 0.5 * np.add(*ends), rtol=1e-6, atol=1e-9)


def test_none_where_a_point_cannot_be_run():
    ensemble = ensemble_of(dap.load("pen2"), ["bodies.rod.mass"], ["rod.r.z"])
    assert ensemble.series_with_slopes(np.array([-1.0]), np.ones(1)) is None
