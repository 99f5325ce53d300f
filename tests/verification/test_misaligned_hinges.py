"""A door on hinges that do not quite agree: it swings, is refused in words, or stands still.
Strictly it is locked by any misalignment, with reactions that grow as its inverse. Joints are put
together to 1e-8 and no more, so that below this hinges count as redundant and the door swings as
the one with hinges in line does."""

import sys

import numpy as np
import pytest
from support import redundant
from support.process import REPOSITORY

import dap3d_core as dap
from dap3d_core.result import Note

sys.path.append(str(REPOSITORY / "benchmarks"))

from hard import hinges


@pytest.mark.parametrize("kind", hinges.KINDS)
@pytest.mark.parametrize("count", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_a_misalignment_of_a_billionth_changes_nothing(kind, count):
    """Rank 5 as of hinges in line; the motion is theirs to 1e-6 (errors of the run are 1e-8, the
    misfit turns the axis by some 1e-9), and so are the reactions, to 1e-3 of themselves."""
    aligned, off = hinges.outcome(kind, 0.0, count), hinges.outcome(kind, 1e-9, count)
    assert aligned["outcome"] == hinges.RUNS
    assert off["outcome"] in (hinges.RUNS, hinges.OPEN)
    assert off["rank"] == aligned["rank"] == 5
    assert off["off"] < 1e-6
    for name in ("force", "moment"):
        assert off[name] == pytest.approx(aligned[name], rel=1e-3)


@pytest.mark.parametrize("kind", ["tilt, fitted", "offset, fitted"])
def test_too_much_to_be_redundant_and_too_little_to_hold_is_refused(kind):
    """The message names the hinges, how far they are off, and what to do."""
    with pytest.raises(dap.SimulationError, match=r"H0, H1 bind: .*agree to 1e-08") as caught:
        dap.simulate(hinges.door(kind, 1e-6), t_end=0.1)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("size", [1e-3, 1e-2])
def test_a_locked_door_stands_still(size):
    """Rank 6, no motion. The reactions carry it: forces add up to the weight and moments to none,
    to 1e-6 of the largest, which is some m g l over the misalignment."""
    result = dap.simulate(hinges.door("tilt, fitted", size), t_end=0.5, dt=0.1)
    assert dap.compile(hinges.door("tilt, fitted", size)).redundancy().rank.rank == 6
    assert np.max(np.abs(result.r - result.r[0])) < 1e-8
    reactions = [result.reaction(name)["i"] for name in ("H0", "H1")]
    jam = max(np.max(np.abs(reaction.moment)) for reaction in reactions)
    weight = 12.0 * redundant.G
    assert jam > 0.1 * 0.5 * weight / size
    force = sum(reaction.force for reaction in reactions)
    assert force == pytest.approx(np.tile([0.0, 0.0, weight], (len(force), 1)), abs=1e-6 * jam)
    assert sum(reaction.moment for reaction in reactions) == pytest.approx(0.0, abs=1e-6 * jam)


def test_a_door_that_does_not_fit_is_left_open_and_says_so():
    """Hinges in line on posts 1e-9 rad off: no pose closes both; a note says how far they gape."""
    result = dap.simulate(hinges.door("tilt", 1e-9), t_end=0.2)
    (note,) = [note for note in result.notes if "do not fit together" in note]
    assert Note(note).is_warning
    assert result.ledger["position"].ok is False
    with pytest.raises(dap.SimulationError, match="cannot be assembled"):
        dap.simulate(hinges.door("tilt", 1e-6), t_end=0.2)


@pytest.mark.parametrize("angle", [1e-7, 1e-6, 1e-5])
def test_a_start_close_to_a_singular_pose_does_not_bind(angle):
    """A parallelogram on revolutes, nearly in line: as nearly dependent rows as those of hinges
    that bind, but they let it move away. It runs."""
    scene = redundant.four_bars(1, np.pi / 2 - angle)
    assert not dap.compile(scene).redundancy().bindings
    flat = dap.compile(redundant.four_bars(1))
    assert not flat.redundancy().bindings


@pytest.mark.slow
def test_no_door_is_wrong_without_a_word():
    """Every kind, of sizes from 1e-16 to 1e-2: it swings as it should, or says that it gapes, or is
    refused, or stands still. And in this order, as the size grows."""
    order = [hinges.RUNS, hinges.OPEN, hinges.REFUSED, hinges.STANDS]
    for kind in hinges.KINDS:
        rows = [hinges.outcome(kind, size) for size in hinges.SIZES[::3]]
        places = [order.index(row["outcome"]) for row in rows]
        assert places == sorted(places), kind
        assert all(row["off"] < 1e-6 for row in rows if row["outcome"] in order[:2]), kind
