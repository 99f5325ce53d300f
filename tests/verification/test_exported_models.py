"""All shipped models as C libraries: with every integrator the bits of runs in Python.

The long verification has optimised code; so have slow tests of unit/native.
"""

import shutil

import numpy as np
import pytest
from tests.unit.native.test_export import differences, states_of

import dap3d_core as dap

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not any(map(shutil.which, ("cc", "gcc"))), reason="there is no C compiler"),
]
INTEGRATORS = ["dop853", "dopri5", "rk4", "adams", "radau", "auto"]
#: A model with a type of its own, and a group that is tested below.
WITHOUT = {"ball1", "contact"}
MODELS = sorted(
    name for name, at in dap.shipped_models().items() if WITHOUT.isdisjoint({name, at.parent.name})
)
#: Every third model with one integrator; the long verification has all pairs.
SOME = {(model, INTEGRATORS[k % 6]) for k, model in enumerate(MODELS[::3])}
PAIRS = [
    pytest.param(*pair, marks=() if pair in SOME else pytest.mark.long)
    for pair in ((model, integrator) for model in MODELS for integrator in INTEGRATORS)
]


@pytest.mark.parametrize(("model", "integrator"), PAIRS)
def test_a_shipped_model_has_the_bits_of_simulate(tmp_path, request, model, integrator):
    if not request.node.get_closest_marker("long"):
        request.getfixturevalue("quick_libraries")
    scene = dap.load(model)
    t_end = min(1.0, float(scene.simulation.t_end or 1.0))
    step = 1e-3 if integrator == "rk4" else None
    try:
        notes = dap.simulate(scene, t_end=t_end, integrator=integrator, step=step).notes
    except dap.SimulationError:
        pytest.skip("the run stops")
    if any("radau met a singular pose" in note for note in notes):  # Python alone crosses it
        with pytest.raises(dap.SimulationError, match="the run stopped at"):
            differences(scene, tmp_path, t_end, integrator=integrator, step=step)
        return
    assert differences(scene, tmp_path, t_end, integrator=integrator, step=step)


@pytest.mark.parametrize("model", ["cradle", "domino_row", "gripper", "marble_run", "quadruped"])
def test_a_shipped_model_of_contacts_has_the_bits_of_simulate(tmp_path, quick_libraries, model):
    """By steps of contacts, or by events (the cradle), as these models take them."""
    scene = dap.load(model)
    assert differences(scene, tmp_path, float(scene.simulation.t_end))


@pytest.mark.long
@pytest.mark.parametrize("fmi", [3, 2])
@pytest.mark.parametrize("model", sorted(set(dap.shipped_models()) - {"A02-40", "sphere_box"}))
def test_a_shipped_model_is_a_valid_fmu_with_the_bits_of_simulate(tmp_path, model, fmi):
    """But for the two with 81 and 500 bodies, which take long to compile."""
    fmpy = pytest.importorskip("fmpy")
    validate_fmu = pytest.importorskip("fmpy.validation").validate_fmu
    scene, path = dap.load(model), tmp_path / f"{model}.fmu"
    t_end, names = min(1.0, float(scene.simulation.t_end)), states_of(scene)
    made = dap.export_model(scene, path, fmi=fmi, outputs=names, allow_code=True)
    assert validate_fmu(str(path)) == []
    result = dap.simulate(scene, t_end=t_end, dt=t_end / 20, allow_code=True)
    rows = fmpy.simulate_fmu(str(path), stop_time=t_end, output_interval=t_end / 20,
                             fmi_type="CoSimulation", output=made.outputs)  # fmt: skip
    expected = np.hstack([result.quantity(name).values for name in names])
    assert np.array_equal([[*row][1:] for row in rows], expected)
