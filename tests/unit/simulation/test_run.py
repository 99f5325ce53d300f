"""Notes of one run.

Notes on what time stepping of contacts left unsolved.
"""

from types import SimpleNamespace

import pytest
from support import problems

import dap3d_core as dap
from dap3d_core.integrators.moreau.contact_set import POINTS
from dap3d_core.integrators.moreau.integration import MoreauIntegration
from dap3d_core.simulation import run


@pytest.mark.parametrize(
    ("method", "work", "is_noted"),
    [("auto", 1, True), ("auto", run.MUCH_WORK, False), ("standard", 1, False)],
)
def test_a_long_run_whose_method_was_left_open_says_that_joint_is_quicker(
    method, work, is_noted, monkeypatch
):
    """A chain of ten rods; neither a short run nor one whose method was chosen has the note."""
    monkeypatch.setattr(run, "MUCH_WORK", work)
    result = dap.simulate(problems.chain(10), t_end=0.01, dt=0.01, method=method)
    assert any("method joint would take some 0." in note for note in result.notes) == is_noted


def ran(residual):
    work = SimpleNamespace(largest_residual=residual, deepest=1e-12)
    return SimpleNamespace(name="moreau", work=work, overlapping="", shortened="")


def test_what_is_not_solved_is_a_warning():
    (note,) = run.stepping_notes([ran(1e-2)], 1.0)
    assert "shorter contact_step" in note
    assert not run.stepping_notes([ran(1e-4)], 1.0)


def test_what_is_driven_into_another_is_a_warning():
    scene = dap.Scene(name="press")
    scene.add_body("b", mass=1.0, r=(0.0, 0.0, 0.5), r_dot=(0.0, 0.0, -1.0))
    scene.add_joint("tran", "guide", P_i="b.O", P_j="ground.O", a_j="ground.z")
    scene.add_function("a", "down", coeff=(0.5, -1.0, 0.0))
    scene.add_joint("drive-tran", joint="guide", function="down")
    scene.add_shape("sphere", body="b", radius=0.5, collides=True)
    scene.add_shape("plane", body="ground", collides=True)
    result = dap.simulate(scene, t_end=0.02, dt=0.02, contact_step=5e-3)
    assert result.r[-1, 0, 2] == pytest.approx(0.48, abs=1e-6)
    assert result.ledger["overlap"].ok is False
    (note,) = (note for note in result.notes if "overlap by" in note)
    assert "drivers hold them" in note
    assert getattr(note, "severity", "warning") == "warning"


@pytest.mark.parametrize(("length", "words"), [(1.0, "shapes b and c"), (1e3, "")])
def test_overlaps_are_parts_of_the_length_of_the_scene(length, words):
    shapes = SimpleNamespace(names=("a", "b", "c"))
    one = SimpleNamespace(
        _evaluator=SimpleNamespace(model=SimpleNamespace(collisions=shapes, length=length)),
        work=SimpleNamespace(overlap_at_start=1e-6, overlap_key=POINTS * 5.0),
    )
    found = MoreauIntegration.overlapping.fget(one)
    assert (words in found, bool(found)) == (True, bool(words))
    assert run.stepping_notes([SimpleNamespace(name="dop853")], 1.0) == []
