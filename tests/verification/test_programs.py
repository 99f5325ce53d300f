"""Programs of scenes: every shipped model, formulation and integrator has the bits of general code.
Elements with unknowns, states, friction and tables among them, as far as the scenes of the example
package have them. Rows are compared as numbers: 0.0 equals -0.0. Programs are optimised in the long
verification, and in unit/formulations/programs."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.plain import jit_is_on
from support.process import REPOSITORY

import dap3d_core as dap
from dap3d_core.formulations import FORMULATIONS
from dap3d_core.formulations.programs import change_over, scene_program
from dap3d_core.kernels.compiler import objects

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")]
#: Scenes with contacts have other loops of steps.
MODELS = sorted(
    [
        scene.parent
        for scene in (REPOSITORY / "models").rglob("scene.toml")
        if scene.parents[1].name != "contact"
    ]
    + list((REPOSITORY / "plugins/dap3d-example/scenes").glob("*.toml"))
)
INTEGRATORS = {"dop853": {}, "dopri5": {}, "adams": {}, "rk4": {"step": 1e-3}}
#: Scenes whose programs branch with the motion: pivots among kept rows that depend on each other,
#: the number of passes until forces on reactions settle.
BRANCHING = {"A02-1", "A02-2", "A04", "planetary"}
NAMES = ("r", "p", "rd", "w", "rdd", "wd", "Lam")


def unoptimised(text, results, path):
    return objects.compile_ir(text, objects.UNOPTIMISED)


@pytest.fixture(autouse=True)
def at_once(monkeypatch, request):
    """Programs are made at the first call, in this process."""
    if not request.node.get_closest_marker("long"):
        monkeypatch.setattr(scene_program, "path_of", lambda name: None)
        monkeypatch.setattr(change_over, "objects", SimpleNamespace(optimised=unoptimised))
    monkeypatch.setattr(change_over, "MAKE_AFTER", 0.0)
    monkeypatch.setattr(change_over, "BESIDE", False)
    monkeypatch.setattr(change_over, "_records", {})
    monkeypatch.setattr(scene_program, "is_optimised", lambda evaluator: True)
    return monkeypatch


#: Each model is of a kind of its own, but for those of engineers, whose elements others have too,
#: and the row of forty loops.
LONG = {"engineering", "A02-40"}
RUN = [
    pytest.param(
        path,
        id=path.stem + path.parent.name,
        marks=[pytest.mark.long] if LONG & {path.parent.name, path.name} else [],
    )
    for path in MODELS
]


@pytest.mark.parametrize("model", RUN)
def test_bits_are_those_of_general_code(model, at_once):
    """With each formulation and integrator that takes the scene."""
    scene, ran = dap.load(model), 0
    end = min(scene.simulation.t_end, 0.3)
    for method in FORMULATIONS:
        for integrator, settings in INTEGRATORS.items():
            settings = settings | {"method": method, "integrator": integrator, "allow_code": True}
            at_once.setattr(change_over, "LOAD_AFTER", np.inf)
            try:
                general = dap.simulate(scene, t_end=end, dt=end / 5, **settings)
            except dap.SimulationError:  # it does not take the scene
                continue
            at_once.setattr(change_over, "LOAD_AFTER", 0.0)
            result = dap.simulate(scene, t_end=end, dt=end / 5, **settings)
            for name in NAMES:
                one, other = getattr(general, name), getattr(result, name)
                assert np.array_equal(one, other, equal_nan=True), (method, integrator, name)
            ran += 1
    assert ran > 3
    reasons = {record.reason for record in change_over._records.values()} - {""}
    known = model.stem in BRANCHING or model.name in BRANCHING or "A02-40" in str(model)
    assert known or not reasons, reasons
