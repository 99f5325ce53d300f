"""Notes on what time stepping of contacts left unsolved."""

from types import SimpleNamespace

import pytest

from dap3d_core.simulation.failure.stepping import stepping_notes


def ran(residual, overlap=0.0):
    return SimpleNamespace(name="moreau", largest_residual=residual, deepest=1e-12,
                           friction_work=-2.0, overlap_at_start=overlap)  # fmt: skip


@pytest.mark.parametrize(("residual", "severity"), [(1e-4, "information"), (1e-2, "warning")])
def test_what_is_not_solved_is_a_warning(residual, severity):
    (note,) = stepping_notes([ran(residual)], 1.0)
    assert (getattr(note, "severity", "warning"), "2 J" in note) == (severity, True)
    assert ("shorter contact_step" in note) == (severity == "warning")


def test_overlaps_are_parts_of_the_length_of_the_scene():
    assert len(stepping_notes([ran(0.0, 1e-6)], 1.0)) == 2
    assert len(stepping_notes([ran(0.0, 1e-6)], 1e3)) == 1
    assert stepping_notes([SimpleNamespace(name="dop853")], 1.0) == []
