"""Runs made again from their results: equal bit for bit, or with what differs."""

import attrs
import numpy as np
import pytest
from support import problems
from support.ended import shorten_chunks
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.result import ResultError

SHORT = {"t_end": 0.6, "dt": 0.02}


@pytest.mark.parametrize(
    "settings",
    [
        {},
        pytest.param({"method": "lsq", "rtol": 1e-6}, marks=long_in_plain_python),
        {"integrator": "rk4", "step": 0.01, "project": False},
        pytest.param({"integrator": "adams", "correct_metric": "mass"}, marks=long_in_plain_python),
        {"correct": False, "t_end": 0.1, "dt": None},
    ],
)
def test_a_run_made_again_is_equal(settings, tmp_path):
    """From its file, which is all that is needed; settings of the run, not of the scene."""
    dap.simulate(problems.four_bar(), output=tmp_path / "run.nc", **SHORT | settings)
    found = dap.rerun(tmp_path / "run.nc")
    assert found.equal
    assert found.differences == {}
    assert found.versions == {}
    assert found.instants == len(dap.open(tmp_path / "run.nc").t)
    assert [f.name for f in tmp_path.iterdir()] == ["run.nc"]


def test_zeros_are_equal_whatever_their_signs():
    """Programs of a scene leave out products with zero, which others add: signs of zeros differ."""
    result = dap.simulate(problems.pendulum(), **SHORT)
    Lam = result.arrays.Lam
    Lam.setflags(write=True)
    assert np.any(Lam == 0.0)
    Lam[Lam == 0.0] = -np.copysign(0.0, Lam[Lam == 0.0])
    assert dap.rerun(result).equal
    Lam[-1, np.argmax(np.abs(Lam[-1]))] *= 1.5
    assert list(dap.rerun(result).differences) == ["Lam"]


@long_in_plain_python
def test_a_run_is_made_again_by_the_method_that_auto_chose_then(monkeypatch):
    """As the choice was before it looked for joint coordinates."""
    first = dap.simulate(problems.chain(3), **SHORT)
    monkeypatch.setattr("dap3d_core.simulation.compiled_model.MANY_BODIES", 1)
    assert dap.simulate(problems.chain(3), t_end=0.0).method == "joint"
    found = dap.rerun(first)
    assert found.equal
    assert found.again.method == "standard"


def test_of_a_run_that_was_ended_the_part_that_is_there_is_compared(monkeypatch):
    shorten_chunks(monkeypatch)

    def watch(standing):
        if standing.t > 0.3:
            raise RuntimeError

    with pytest.raises(RuntimeError) as caught:
        dap.simulate(problems.pendulum(), watch=watch, **SHORT)
    found = dap.rerun(caught.value.result)
    assert found.equal
    assert found.instants == len(caught.value.result.t) < 31
    assert len(found.again.t) < 31  # it does not go on to the end


def test_a_run_that_failed_fails_again_at_the_same_place():
    scene = dap.Scene(name="falling")
    scene.add_body("a", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(1.0, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="a.O", P_j="ground.O", k=-1e99, l0=0.5)
    with pytest.raises(dap.SimulationError) as caught:
        dap.simulate(scene, **SHORT)
    assert dap.rerun(caught.value.result).equal


def test_what_cannot_be_made_again_is_refused():
    stopped = dap.simulate(
        problems.pendulum(), events=[dap.Event("bob.r.x", above=-0.9, action="stop")], **SHORT
    )
    with pytest.raises(ResultError, match="events of a script"):
        dap.rerun(stopped)
    first = dap.simulate(problems.pendulum(), **SHORT)
    first.record = attrs.evolve(first.record, settings={"t_end": 1.0})
    with pytest.raises(ResultError, match="lacks the settings dt, "):
        dap.rerun(first)


def test_other_versions_are_told():
    first = dap.simulate(problems.pendulum(), **SHORT)
    versions = first.versions | {"llvmlite": "0.1"}
    first.record = attrs.evolve(first.record, known_versions=versions)
    found = dap.rerun(first)
    assert found.equal
    assert list(found.versions) == ["llvmlite"]
    assert found.versions["llvmlite"][0] == "0.1"
