"""Programs of scenes: every shipped model, formulation and integrator has the bits of general code.
Outside releases a model and a formulation have one integrator, by turns.
Elements with unknowns, states, friction and tables among them, as far as the scenes of the example
package have them. Rows are compared as numbers: 0.0 equals -0.0. Programs are optimised in the long
verification, and in unit/formulations/programs."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.internals import change_over, objects
from support.plain import jit_is_on
from support.process import REPOSITORY

import dap3d_core as dap
from dap3d_core.formulations import FORMULATIONS

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
#: the number of passes until forces on reactions settle, or until lsq solves where masses differ
#: much (A05).
BRANCHING = {"A02-1", "A02-2", "A04", "A05", "planetary"}
NAMES = ("r", "p", "rd", "w", "rdd", "wd", "Lam")


def unoptimised(text, results, path):
    return objects.compile_ir(text, objects.UNOPTIMISED)


#: Each model is of a kind of its own, but for those of engineers, whose elements others have too,
#: and the row of forty loops: they are run for releases, by optimised programs.
LONG = [path for path in MODELS if {"engineering", "A02-40"} & {path.parent.name, path.name}]


@pytest.fixture
def at_once(monkeypatch, model):
    """Programs are made at the first call, in this process."""
    if model not in LONG:
        monkeypatch.setattr(
            "dap3d_core.formulations.programs.scene_program.path_of", lambda name: None
        )
        monkeypatch.setattr(change_over, "objects", SimpleNamespace(optimised=unoptimised))
    monkeypatch.setattr(change_over, "MAKE_AFTER", 0.0)
    monkeypatch.setattr(change_over, "BESIDE", False)
    monkeypatch.setattr(change_over, "_records", {})
    monkeypatch.setattr(
        "dap3d_core.formulations.programs.scene_program.is_optimised", lambda evaluator: True
    )
    return monkeypatch


RUN = [
    *(pytest.param(path, False, id=path.stem + path.parent.name)
      for path in MODELS if path not in LONG),
    *(pytest.param(path, True, id=f"{path.stem}{path.parent.name}-all", marks=pytest.mark.long)
      for path in MODELS),
]  # fmt: skip


@pytest.mark.parametrize(("model", "with_all"), RUN)
def test_bits_are_those_of_general_code(model, with_all, at_once):
    """With each formulation, and each integrator or the first by turns that takes the scene."""
    scene, ran = dap.load(model), 0
    end = min(scene.simulation.t_end, 0.3)
    for turn, method in enumerate(FORMULATIONS, MODELS.index(model)):
        for k in range(len(INTEGRATORS)):
            integrator = list(INTEGRATORS)[(turn + k) % len(INTEGRATORS)]
            settings = INTEGRATORS[integrator] | {"method": method, "integrator": integrator}
            settings["allow_code"] = True
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
            if not with_all:
                break
    assert ran > (3 if with_all else 0)
    reasons = {record.reason for record in change_over._records.values()} - {""}
    known = model.stem in BRANCHING or model.name in BRANCHING or "A02-40" in str(model)
    assert known or not reasons, reasons
