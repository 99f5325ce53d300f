"""Errors that grow: exponentially in a chaotic motion, with a power of time in one that repeats.
The double pendulum is known to 30 digits from its own equations (support/double_pendulum.py), the
flips of a free body by Jacobi's elliptic functions (benchmarks/hard/flips.py)."""

import sys
from decimal import Decimal, localcontext

import numpy as np
import pytest
from support import double_pendulum, problems
from support.process import REPOSITORY

import dap3d_core as dap
from dap3d_core.result import Note

sys.path.append(str(REPOSITORY / "benchmarks"))

from hard import flips, references

DIGITS, NEAR = 30, Decimal(10) ** -24


@pytest.fixture(scope="module")
def motion():
    """Every 0.1 s for 22 s: places of the outer rod's centre, and how far apart two motions get
    that begin 1e-24 rad/s apart."""
    t = np.round(np.arange(221) * 0.1, 1)
    s1, c1, w1, s2, c2, w2 = double_pendulum.LEVEL
    one = double_pendulum.states(t, digits=DIGITS)
    other = double_pendulum.states(t, (s1, c1, w1 + NEAR, s2, c2, w2), DIGITS)
    apart = [
        max(abs(a - b) for a, b in zip(x, y, strict=True)) for x, y in zip(one, other, strict=True)
    ]
    s1, c1, _, s2, c2, _ = np.array(one, dtype=float).T
    return t, np.column_stack([s1 + 0.5 * s2, -c1 - 0.5 * c2]), np.array(apart, dtype=float)


def simulated(t_end, rtol):
    return dap.simulate(
        problems.chain(2), t_end=t_end, dt=0.1, rtol=rtol, atol=rtol / 100.0, estimate_error=True
    )


@pytest.mark.slow
def test_the_double_pendulum_by_taylor_series():
    """Published digits of its tip at 0.5 and 1 s, which have twelve, from another program; and its
    energy, which no series knows of, to all but the last digits of 30."""
    found = double_pendulum.states((0.5, 1.0), digits=DIGITS)
    tips = [(float(s1 + s2), -float(c1 + c2)) for s1, c1, _, s2, c2, _ in found]
    expected = [(1.296688536227, -1.405779923191), (-1.662115135816, -1.041466637193)]
    assert np.array(tips) == pytest.approx(np.array(expected), abs=1e-12)
    with localcontext() as context:
        context.prec = DIGITS
        assert max(abs(double_pendulum.energy(state)) for state in found) < Decimal("1e-26")


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-8, 1e-10])
def test_it_says_from_when_on_a_chaotic_motion_is_lost(motion, rtol):
    """Not after it is (but for one instant), and not more than four seconds, two decades, before;
    until then the estimate is at least a third of the true error, and the error grows as two
    neighbouring motions part: their tenfold time is an average over these 20 s, so within 40 %."""
    t, places, apart = motion
    result = simulated(22.0, rtol)
    true = np.linalg.norm(result.r[:, 1, :2] - places, axis=1)
    estimate = np.linalg.norm(result.error.r[:, 1], axis=1)
    lost = float(t[np.argmax(true > 1e-3 * result.error.size["r"])])
    when = result.error.meaningless_from
    assert lost - 4.0 < when <= lost + 0.1
    until = (t > 0.0) & (t < when)
    assert np.all(estimate[until] > true[until] / 3.0)
    own = 1.0 / np.polyfit(t[until], np.log10(apart[until]), 1)[0]
    assert result.error.tenfold == pytest.approx(own, rel=0.4)
    assert result.ledger["energy"].ok  # it keeps its energy all the same: that says nothing


def test_the_note_on_a_lost_motion_is_a_warning():
    """With the time, in the notes that --strict does not let pass; the field says the same."""
    result = simulated(12.0, 1e-6)
    (note,) = [note for note in result.notes if "beyond 0.001 of the size" in note]
    assert Note(note).is_warning
    assert f"from t = {result.error.meaningless_from:.6g} s on" in note


def test_no_note_where_digits_remain():
    assert not any("beyond 0.001" in note for note in simulated(2.0, 1e-8).notes)


@pytest.mark.slow
def test_the_instants_of_the_flips():
    """Where omega_2 of Euler's equations, integrated at 3e-14, passes zero within 11 s."""
    expected = flips.instants(11.0)
    assert len(expected) == 2
    for t in expected:
        near = np.array([0.0, t])
        w = references.free_body(tuple(flips.J), tuple(flips.W), near)[-1]
        # three flips multiply rounding by 1e9; w_2 passes zero at -5^2 / 2 rad/s^2 or so
        assert abs(w[1]) < 1e-6


@pytest.mark.slow
@pytest.mark.long
def test_flips_over_four_hundred_seconds():
    """None of 60 is missed, at rtol 1e-6 or at the default. Each flip is late by some share of the
    error of the steps within it, and so are all after it: with time to a power between that of a
    sum (1, or 1/2 where signs are mixed) and that of a drift of the period (2), never
    exponentially; a hundredth of rtol makes that ten times less or better."""
    t_end = 400.0
    t = flips.instants(t_end)
    late = {rtol: flips.late(flips.simulate("dop853", rtol, t_end), t_end) for rtol in (1e-6, 1e-8)}
    assert len(t) == 60
    for found in late.values():
        assert 0.4 < flips.power(t, found) < 2.5
    assert np.max(np.abs(late[1e-8])) < 1e-4
    assert np.max(np.abs(late[1e-8])) < np.max(np.abs(late[1e-6])) / 10.0
