"""What the checks of types stand on: states and their rates, poses on the manifold, reports."""

import random

import numpy as np
import pytest
from support.internals import sampled_types
from support.plain import jit_is_on

from dap3d_core.interface import examine
from dap3d_core.testing import check_type, checks_for
from dap3d_core.testing.samples.random_state import BODIES, Direction, random_state
from dap3d_forces.weight import Weight
from dap3d_functions.polynomial import Polynomial
from dap3d_joints.spherical import Spherical
from dap3d_joints.universal import Universal


def some_state(seed=3):
    return random_state(random.Random(seed), [True, False], grounded=True)


def test_rates_are_those_of_finite_moves():
    """Bodies and functions of time, along a direction with turns; central differences, h = 1e-5.
    They leave some h^2 = 1e-10 of truncation and 1e-16 / h of rounding."""
    state, rng = some_state(), np.random.default_rng(0)
    along = Direction(rng.normal(size=(BODIES, 3)), rng.normal(size=(BODIES, 3)), 0.7)
    ahead, back = state.moved(along, 1e-5), state.moved(along, -1e-5)
    rate = (ahead.body() - back.body()) / 2e-5
    assert state.body_rate(along) == pytest.approx(rate, abs=1e-9)
    rate = (ahead.table() - back.table()) / 2e-5
    assert state.table_rate(along)[:, :3] == pytest.approx(rate[:, :3], abs=1e-8)


def test_samples_on_the_manifold():
    """C = 0 and J v = nu there; the last pose has body j on ground, at rest."""
    (subject,) = sampled_types(examine(Universal), seed=1, poses=3)
    assert len(subject.assembled) == 3
    for sample in subject.assembled:
        assert np.max(np.abs(sample.value("C"))) < 1e-11
        v = np.hstack([sample.state.v, sample.state.w])[1:3]
        assert np.einsum("srk,sk->r", sample.value("J"), v) == pytest.approx(0.0, abs=1e-12)
    assert [sample.grounded for sample in subject.assembled] == [False, False, True]
    assert not subject.assembled[-1].state.w[2].any()


@pytest.mark.parametrize("type_", [Spherical, Weight, Polynomial])
def test_one_type_of_each_kind(type_):
    """Nothing is wrong; where nothing is compiled, the one check that needs it says so."""
    report = check_type(type_, poses=2)
    assert report.ok, str(report)
    states = {outcome.check: outcome.state for outcome in report.outcomes}
    assert states["compiled"] == ("ok" if jit_is_on() else "not applicable")
    assert report.keyword in str(report)


def test_checks_are_named_and_called():
    """Names are ids of tests; a check that does not apply is left out."""
    names = [str(check) for check in checks_for(Weight)]
    assert names == ["energy", "branches", "rest", "purity", "plain", "compiled"]
    for check in checks_for(Weight, poses=1):
        check()
    with pytest.raises(ValueError, match="poses is 0"):
        checks_for(Weight, poses=0)
