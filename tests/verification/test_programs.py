"""Programs of scenes: every shipped model, formulation and integrator has the bits of general code.

Elements with unknowns, states, friction and tables among them, as far as the scenes of the example
package have them. Rows are compared as numbers: 0.0 equals -0.0.
"""

import numpy as np
import pytest
from support.process import REPOSITORY

import dap3d_core as dap
from dap3d_core.formulations import FORMULATIONS
from dap3d_core.formulations.programs import change_over, scene_program
from dap3d_core.kernels.runtime.cache import jit_is_on
from dap3d_core.simulation import SimulationError

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled"),
]
MODELS = sorted(
    [p.parent for p in (REPOSITORY / "models").rglob("scene.toml")]
    + list((REPOSITORY / "plugins/dap3d-example/scenes").glob("*.toml"))
)
INTEGRATORS = {"dop853": {}, "dopri5": {}, "adams": {}, "rk4": {"step": 1e-3}}
#: Scenes whose programs branch with the motion: pivots among kept rows that depend on each other.
BRANCHING = {"A02-1", "A02-2", "A04"}
NAMES = ("r", "p", "rd", "w", "rdd", "wd", "Lam")


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    """Programs are made at the first call, in this process."""
    monkeypatch.setattr(change_over, "MAKE_AFTER", 0.0)
    monkeypatch.setattr(change_over, "BESIDE", False)
    monkeypatch.setattr(change_over, "_records", {})
    monkeypatch.setattr(scene_program, "is_optimised", lambda evaluator: True)
    return monkeypatch


#: Each model is of a kind of its own, but for those of engineers, whose elements others have too.
RUN = [
    pytest.param(
        path,
        id=path.stem + path.parent.name,
        marks=[pytest.mark.long] if path.parent.name == "engineering" else [],
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
            except SimulationError:  # it does not take the scene
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
