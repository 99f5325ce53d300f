"""All shipped models as C libraries: with every integrator the bits of runs in Python.

The long verification has optimised code; so have slow tests of unit/native.
"""

import shutil

import pytest
from tests.unit.native.test_export import differences

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
