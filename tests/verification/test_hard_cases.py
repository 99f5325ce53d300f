"""Cases of docs/reference/hard-cases.md: what the page says passes does, and references are right.
The cases stand in benchmarks/hard, with their references and what limits their errors: 1000 times
rtol, and the reason where it is more. Details of many of them are tested elsewhere; the page says
where. What is not: contact, masses of 1 and 1e9 kg, other units, long runs."""

import json
import sys
from itertools import pairwise

import numpy as np
import pytest
from support import mechanisms, redundant
from support.internals import near_singular_rows, store_reference_pivots
from support.process import REPOSITORY
from verification.test_reference_problems import A01, G1

import dap3d_core as dap

sys.path.append(str(REPOSITORY / "benchmarks"))

from hard import CASES, long_time, page, references, scenes

EPS = long_time.EPS
FIRST = [
    pytest.param(
        case,
        case.tries[0],
        id=f"{case.name}-{case.tries[0].title}",
        marks=[pytest.mark.slow] if case.slow else [],
    )
    for case in CASES
]
OTHERS = [(case, a) for case in CASES for a in case.tries[1:] if not a.why]


def titles(pairs):
    return [f"{case.name}-{attempt.title}" for case, attempt in pairs]


@pytest.mark.parametrize(("case", "attempt"), FIRST)
def test_the_defaults_pass_every_case(case, attempt):
    """Error within the case's limit, and every entry of the ledger within its own."""
    result = case.simulate(attempt)
    assert case.error(result) <= case.limit(attempt)
    assert [name for name, entry in result.ledger.items() if entry.ok is False] == []


@pytest.mark.slow
@pytest.mark.parametrize(("case", "attempt"), OTHERS, ids=titles(OTHERS))
def test_what_passes_by_the_page_passes(case, attempt):
    """Error within the case's limit, for every other method, integrator and tolerance."""
    assert case.error(case.simulate(attempt)) <= case.limit(attempt)


@pytest.mark.slow
def test_a_step_over_the_contact_shows_in_the_ledger():
    """Steps of 1e-4 s, as long as the contact: the run ends, and its energy says it is wrong."""
    case = next(case for case in CASES if case.name == "stiff contact")
    attempt = next(a for a in case.tries if a.integrator == "rk4")
    result = case.simulate(attempt)
    assert case.error(result) > 1.0
    assert result.ledger["energy"].value > 0.1


@pytest.mark.parametrize("integrator", ["dop853", "dopri5"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10])
def test_a_ball_bounces_until_it_lies(integrator, rtol):
    """Zeno: all 79 touches and leavings of ever shorter flights, each located, and then the ball
    at rest, where its weight presses it 10 nm into the ground."""
    result = dap.simulate(
        scenes.bounces(), t_end=4.0, dt=0.01, integrator=integrator, rtol=rtol, atol=rtol / 100,
        allow_code=True,
    )  # fmt: skip
    expected = references.bounces(1.0, 1e9, scenes.damper(1e9, 0.8), 0.9)
    # of ever lower flights the error of the speed makes ever more of their time: rtol / 1e-8 of it
    off = max(1e-6, 20.0 * rtol)
    assert [event.t for event in result.events] == pytest.approx(expected, abs=off)
    assert result.r[-1, 0, 2] - 0.1 == pytest.approx(-9.81e-9, rel=2e-4)
    assert result.ledger["energy"].ok


def test_the_pendulum_by_elliptic_functions():
    """Published digits of A01 at 1, 10 and 100 s, which have 16 of them: 1e-13 at 50 periods."""
    found = references.pendulum(np.array([1.0, 10.0, 100.0]))
    expected = [
        *(digits[:4] for digits in A01.values()),
        [-0.18151335142703138, -0.98338848033405750, 4.3195367805346625, -0.79729792785536045],
    ]
    assert found == pytest.approx(np.array(expected), abs=1e-12)


def test_the_free_body_by_euler_s_equations():
    """Published digits of G1 at 10 s; the integration there is at 3e-14 a step."""
    found = references.free_body((1.0, 2.0, 3.0), (1.0, 2.0, 0.5), np.array([0.0, 10.0]))[-1]
    w, p = G1[10.0]
    assert found[:3] == pytest.approx(w, abs=1e-12)
    assert found[3:] * np.sign(found[3]) == pytest.approx(p, abs=1e-12)


def test_the_bounce_is_a_motion_under_its_force():
    """Its energy is that of the start, in flight and in contact, and its slope is its velocity."""
    k, drop, h = 1e4, 0.9, 1e-6
    t = np.linspace(0.0, 5.0, 20001)
    y, v = references.bounce(1.0, k, drop, t).T
    energy = 0.5 * v * v + 9.81 * y + 0.5 * k * np.minimum(y, 0.0) ** 2
    assert np.any(y < 0.0)
    assert energy == pytest.approx(9.81 * drop, abs=1e-12)
    slope = np.diff(references.bounce(1.0, k, drop, np.add.outer(t, (-h, h)).ravel())[:, 0])[::2]
    # central differences: h^2 k v / (6 m) within a phase, h k v / (4 m) ... across a touch
    assert slope / (2.0 * h) == pytest.approx(v, abs=h * 100.0)


def test_the_cart_keeps_momentum_and_energy():
    """Of 1 kg on 3 kg: x of the common centre stays, and so does the energy."""
    ratio = 3.0
    x, _, cart, rate = references.on_a_cart(ratio, np.linspace(0.0, 5.0, 200)).T
    cart, rate = cart / (1.0 + ratio), rate / (1.0 + ratio)
    assert (ratio * cart + (cart + x)) == pytest.approx(-1.0, abs=1e-12)
    s, y = x, references.on_a_cart(ratio, np.linspace(0.0, 5.0, 200))[:, 1]
    # the angle's rate from the cart's: rate = -cos(phi) phi_dot / (1 + ratio), cos(phi) = -y
    turning = np.where(np.abs(y) > 0.1, (1.0 + ratio) * rate / np.where(y == 0.0, 1.0, y), np.nan)
    bob = (rate - y * turning) ** 2 + (s * turning) ** 2
    energy = 0.5 * ratio * rate**2 + 0.5 * bob + 9.81 * y
    assert energy[~np.isnan(energy)] == pytest.approx(0.0, abs=1e-11)


@pytest.mark.parametrize("ratio", [1e2, 1e4, 1e6, 1e7, 3e7, 1e8, 1e9])
def test_different_masses_are_no_singular_pose(ratio):
    """1 to 1e9 kg hang on a rod of 1 kg: steps as for 1e2 kg, though a pivot is 1/ratio of another
    and the small one wanders from row to row as the rod turns. e < 1e3 rtol, and ratio roundings.
    """
    result = dap.simulate(scenes.heavy_bob(ratio), t_end=2.0, dt=0.05)
    rate = 9.81 * (0.5 + ratio) / (1.0 / 3.0 + ratio)
    phi = references.swing(rate, (np.pi / 2, 0.0), result.t)[:, 0]
    found = result.r[:, 1, :2]
    expected = np.column_stack([-np.sin(phi), np.cos(phi)])
    assert redundant.error_of(found[1:], expected[1:]) < 1e-5 + 1e3 * ratio * EPS
    assert result.stats.steps < 50


def test_poor_rows_are_those_of_a_singular_pose_alone():
    """None where the rod of very different masses has turned; some where links are in line."""
    compiled = dap.compile(scenes.heavy_bob(1e6))
    swung = dap.simulate(compiled, t_end=0.4, dt=0.2)
    assert abs(swung.r[-1, 1, 1]) > 0.5
    store_reference_pivots(compiled.evaluator, 0.0, swung.u[0])
    compiled.evaluator.place(0.0, swung.u[-1])
    assert len(near_singular_rows(compiled.evaluator, 0.0)) == 0

    upright, flat = (mechanisms.four_bar_row(1, angle) for angle in (0.0, np.pi / 2 - 1e-3))
    compiled = dap.compile(upright)
    store_reference_pivots(compiled.evaluator, 0.0, compiled.model.u0)
    compiled.evaluator.place(0.0, dap.compile(flat).model.u0)
    assert len(near_singular_rows(compiled.evaluator, 0.0)) > 0


def test_velocities_are_projected_though_old_factors_do_not_serve():
    """1e8 kg on 1 kg with steps of 0.01 s: the pose changes more from step to step than factors of
    the pose before can bear; the velocities come to rounding of 10 m/s all the same."""
    result = dap.simulate(scenes.heavy_bob(1e8), t_end=2.0, dt=0.1, step=0.01)
    assert result.ledger["velocity"].value < 1e-13
    assert result.ledger["position"].value < 1e-14


@pytest.mark.slow
def test_other_units_give_the_same_motion():
    """A03 in mm, g and ms and in SI, the same 500 steps of dop853: to 1e-11 of its size.
    Factors of 1000 are no powers of two, so every number is rounded, and the motion multiplies that
    by some 1e3."""
    si = dap.simulate(dap.load("A03"), t_end=0.05, dt=0.005, step=1e-4)
    mm = dap.simulate(scenes.squeezer_in_mm(), t_end=50.0, dt=5.0, step=0.1)
    assert mm.r / 1e3 == pytest.approx(si.r, abs=1e-11 * np.max(np.abs(si.r)))
    assert mm.w * 1e3 == pytest.approx(si.w, abs=1e-11 * np.max(np.abs(si.w)))
    assert mm.p == pytest.approx(si.p, abs=1e-11)


def held(result):
    """|p| to the last digit of 1; residuals below what the projection calls zero.
    That is 1e-15 times 1 + the largest coordinate or speed, here below 6: and a few roundings."""
    found = long_time.drifts(result)
    assert np.max(found["p"]) <= EPS
    if "C" in found:
        assert np.max(found["C"]) < 4e-15
        assert np.max(found["Cv"]) < 2e-14
    return found


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "radau"])
def test_a_thousand_seconds_of_the_pendulum(integrator):
    """|p| and |C| do not grow; energy drifts in proportion to time (power 1) and to the tolerance:
    below rtol times a hundred a second."""
    run = long_time.LONG[0]
    result = long_time.simulate(run, integrator, {"rtol": 1e-8, "atol": 1e-10})
    found = held(result)
    assert long_time.power_of_time(result.t, found["energy"]) == pytest.approx(1.0, abs=0.1)
    assert np.max(found["energy"]) < 100.0 * 1e-8 * 1000.0 / 60.0


@pytest.mark.slow
def test_tolerances_set_the_drift_of_energy():
    """A01, 1000 s: a hundredth of rtol, less than a thirtieth of the drift, above rounding."""
    run = long_time.LONG[0]
    drift = [
        np.max(held(long_time.simulate(run, "dop853", {"rtol": r, "atol": r / 100}))["energy"])
        for r in (1e-8, 1e-10, 1e-12)
    ]
    assert all(fine < coarse / 30.0 for coarse, fine in pairwise(drift))


@pytest.mark.parametrize(
    ("run", "step"), [(1, 0.02), (1, 0.005), pytest.param(0, 0.01, marks=pytest.mark.slow)]
)
def test_at_rounding_drifts_grow_with_the_root_of_the_steps(run, step):
    """dop853 with steps so short that rounding is all: energy, and angular momentum of the free
    body, within 8 eps √steps (a random walk of some eps a step, and its largest excursion)."""
    result = long_time.simulate(long_time.LONG[run], "dop853", {"step": step})
    found = held(result)
    limit = 8.0 * EPS * np.sqrt(result.stats.steps)
    assert np.max(found["energy"]) < limit
    assert "L" not in found or np.max(found["L"]) < limit


def test_the_page_shows_its_figures():
    """Its tables are those of docs/reference/hard-cases.json, with a row for each case."""
    figures = json.loads(page.FIGURES.read_text())
    text = page.PAGE.read_text()
    assert page.renewed(text, figures) == text, "python benchmarks/run.py --only hard_cases --docs"
    assert all(f"| **{case.name}**" in text for case in CASES)


def test_every_failure_has_a_reason_and_every_try_a_figure():
    """The figures are those of the tries as they stand in benchmarks/hard, and no others."""
    figures = json.loads(page.FIGURES.read_text())
    rows = {(row["case"], row["run"]): row for row in figures if "passes" in row}
    tries = {(case.name, a.title): a for case in CASES for a in case.tries}
    assert rows.keys() == tries.keys()
    for key, attempt in tries.items():
        assert rows[key]["passes"] == (not attempt.why), key
        assert rows[key].get("why", "") == attempt.why, key
