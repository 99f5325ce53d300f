"""The contract of every registered type: each check of the kit is a test.
The standard types pass through the door that is there for everyone (``dap3d_core.testing``). The
tests run over the registry: a new type is covered without a new test, and so are its variants.
That the checks find errors is the subject of tests/unit/testing/checks."""

import numpy as np
import pytest
from support.internals import Evaluator
from support.motions import Motion, derivative
from support.scenes import case_names, cases, scene_for

import dap3d_core as dap
from dap3d_core.model import build_model
from dap3d_core.scene import check as checked
from dap3d_core.testing import checks_for

REGISTRY = dap.load_registry()
INSTALLED = {(t.kind, t.keyword): t.distribution for t in REGISTRY.listing() if t.state == "ok"}
#: At one pose; plugins/dap3d-example checks its types at more.
CHECKS = {key: checks_for(REGISTRY.get(*key), poses=1) for key in INSTALLED}
#: Those of another package are run by its own tests.
OWN = [key for key, distribution in INSTALLED.items() if distribution == "dap3d"]
JOINTS = cases(REGISTRY, "joint")


@pytest.mark.parametrize("others", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("key", OWN, ids="-".join)
def test_type(key, others):
    """A ninth of the checks of a type and its variants, and the others."""
    chosen = (check for k, check in enumerate(CHECKS[key]) if bool(k % 9) is others)
    assert not [str(outcome) for check in chosen if not (outcome := check.run()).ok]


def test_every_kind_of_check_is_there():
    """No check is lost for all types: each applies to one at least."""
    assert {check.name for checks in CHECKS.values() for check in checks} == {
        "J", "nu", "gamma", "virtual power", "assembly", "rank", "frame", "action and reaction",
        "friction power", "friction frame", "friction balance", "energy", "derivatives", "purity",
        "plain", "compiled", "rate", "rate frame", "unilateral", "G",
        "impulse and reaction", "restitution", "round", "jump rows", "jump frame",
        "branches", "rest", "impulse energy", "velocity form", "unloaded", "normal",
    }  # fmt: skip


def test_standard_types_derive_nothing():
    """They run where sympy, which the extra ``derive`` installs, is not there."""
    for kind in ("joint", "force", "function"):
        for listing in REGISTRY.listing():
            if listing.kind == kind and listing.distribution == "dap3d":
                type_info = REGISTRY.get(kind, listing.keyword)
                assert not any(t.derived for t in (type_info, *(v for _, v in type_info.variants)))


@pytest.mark.every(5)
@pytest.mark.parametrize("case", JOINTS, ids=case_names(JOINTS))
@pytest.mark.parametrize("ground", [None, "j"], ids=["body-body", "body-ground"])
def test_rows_of_a_scene(case, ground):
    """In a scene, too, d/dt C = D v - nu and d/dt (D v - nu) = D v_dot - gamma.
    Here the numbers go through scene, model and driver. Sixth-order differences with h = 3e-3 of
    functions whose seventh derivatives are of order 1e3 leave about 1e3 h^6 / 140 = 5e-15 of
    truncation (a driver's angle near the pose where it is undefined has derivatives a million times
    as large) and eps / h = 1e-13 of rounding; 1e-8 of the largest term is asked for."""
    keyword, values = case
    rng = np.random.default_rng(0)
    scene = scene_for(REGISTRY.get("joint", keyword), rng, ground=ground, values=values)
    evaluator = Evaluator(build_model(checked(scene, REGISTRY)), "standard")
    motion, mask = Motion(3, np.random.default_rng(100)), evaluator.model.position_row

    def velocity_form(t):
        rows = evaluator.rows(t, motion.u(t))
        return rows.dense() @ motion.u(t)[-18:] - rows.nu

    rate = derivative(lambda t: evaluator.rows(t, motion.u(t)).C, 0.1, 3e-3)
    assert close(rate[mask], velocity_form(0.1)[mask])
    rows = evaluator.rows(0.1, motion.u(0.1))
    acceleration_form = rows.dense() @ motion.v_dot(0.1) - rows.gamma
    assert close(derivative(velocity_form, 0.1, 3e-3), acceleration_form)


def close(a, b):
    return np.max(np.abs(a - b), initial=0.0) <= 1e-8 * (1.0 + np.max(np.abs(b), initial=0.0))
