"""Runs against closed forms and published digits (IFToMM library; benchmark collections).
Each reference is good to about 1e-11. A tolerance is stated with its reason: at rtol 1e-11 the
global error of these runs is some 10 to 100 times the tolerance over their length."""

from itertools import pairwise

import numpy as np
import pytest
from support import problems

import dap3d_core as dap

TIGHT = {"rtol": 1e-11, "atol": 1e-13}


def last(scene, t, **settings):
    """The result that ends at t, reached by a step."""
    return dap.simulate(scene, t_end=t, dt=t, **(TIGHT | settings))


A01 = {
    1.0: (0.98629175113187532, -0.16501085312554117,
          0.29690551591631582, 1.7746436411126556, 4.8562694074846766),
    10.0: (-0.27508746257611686, -0.96141920509912506,
           4.1755981009517288, -1.1947490545604753, 28.294567206067251),
}  # fmt: skip


@pytest.mark.parametrize("t", A01)
@pytest.mark.parametrize("integrator", ["dop853", "dopri5"])
def test_pendulum(t, integrator):
    """A01: position, velocity, tension by elliptic functions; 4 periods amplify 1e-11 by 100."""
    result = last(problems.pendulum(), t, integrator=integrator)
    x, y, vx, vy, tension = A01[t]
    assert result.r[-1, 0, :2] == pytest.approx([x, y], abs=2e-9)
    assert result.rd[-1, 0, :2] == pytest.approx([vx, vy], abs=5e-9)
    # lambda |d| with |d| = 1 m, negative in tension
    assert -result.Lam[-1, 0] * 1.0 == pytest.approx(tension, abs=1e-8)


G1 = {
    1.0: ((0.50197928606713736, 2.1789944461516021, 0.025711240346541824),
          (0.43481556121841506, 0.22861801825632731, 0.86026649603480991, 0.13642135188765252)),
    10.0: ((0.50265356170148996, 2.1788390020625219, 0.029780323991933385),
           (0.83115221222978652, 0.23085437425632904, 0.50373164735113231, 0.046332336970685525)),
}  # fmt: skip


@pytest.mark.parametrize("t", G1)
@pytest.mark.parametrize("integrator", ["dop853", "dopri5"])
def test_asymmetric_body(t, integrator):
    """G1: angular velocity in body axes and Euler parameters against elliptic functions."""
    result = last(problems.free_body((1.0, 2.0, 3.0), (1.0, 2.0, 0.5)), t, integrator=integrator)
    w, p = G1[t]
    assert result.wp[-1, 0] == pytest.approx(w, abs=1e-9)
    assert np.abs(result.p[-1, 0] @ np.array(p)) == pytest.approx(1.0, abs=1e-15 + 1e-9)
    assert result.p[-1, 0] * np.sign(result.p[-1, 0] @ np.array(p)) == pytest.approx(p, abs=1e-9)


def test_flip_of_the_asymmetric_body():
    """J = 1, 2, 3 turning about the middle axis flips; at rtol 1e-8 it errs < 1e-6 after 10 s."""
    scene = problems.free_body((1.0, 2.0, 3.0), (0.001, 5.0, 0.001))
    coarse = last(scene, 10.0, rtol=1e-8, atol=1e-10)
    fine = last(scene, 10.0, rtol=1e-13, atol=1e-15)
    assert np.max(np.abs(coarse.w[-1] - fine.w[-1])) < 1e-6
    assert np.max(np.abs(coarse.p[-1] - fine.p[-1])) < 1e-6
    # it has left the unstable axis
    assert fine.wp[:, 0, 1].min() < 0.0 or abs(fine.wp[-1, 0, 0]) > 0.01


@pytest.mark.parametrize(
    "precession", [0.998260295360957858, 56.7367666236016186], ids=["slow", "fast"]
)
def test_heavy_top_precesses_steadily(precession):
    """G4: lean, spin and precession stay those of the closed form.
    Slow precession makes a turn, fast precession nine."""
    theta, t = np.radians(30.0), 1.0
    result = dap.simulate(problems.heavy_top(theta, 200.0, precession), t_end=t, dt=0.1, **TIGHT)
    heading = precession * result.t
    axis = result.r[:, 0] / 0.1
    expected = np.column_stack([-np.sin(theta) * np.sin(heading), np.sin(theta) * np.cos(heading),
                                np.full(len(heading), np.cos(theta))])  # fmt: skip
    # 200 rad of spin at 1e-11 a step, read at a tenth of a metre
    assert axis == pytest.approx(expected, abs=1e-7)
    assert result.wp[:, 0, 2] == pytest.approx(200.0, abs=1e-7)


CHAINS = {
    (2, 0.5): (1.296688536227, -1.405779923191), (2, 1.0): (-1.662115135816, -1.041466637193),
    (5, 0.5): (4.562046198086, -1.232748571441), (5, 1.0): (0.533569475142, -4.919709597571),
    (20, 0.5): (19.741914718208, -1.226250000716), (20, 1.0): (18.219892679355, -4.904997135910),
}  # fmt: skip


@pytest.mark.parametrize(("n", "t"), CHAINS)
def test_chain(n, t):
    """The free end of a falling chain; digits good to 1e-11, the run to some 1e-9 of its length."""
    result = last(problems.chain(n), t)
    tip = result.rP[-1, list(result.model.point_names).index(f"out{n - 1}"), :2]
    assert tip == pytest.approx(CHAINS[n, t], abs=1e-9 * n)
    assert np.max(np.abs(result.r[-1, :, 2])) < 1e-9  # it stays in its plane


ORDERS = {
    ("A01", "rk4"): (4, 200, 400), ("A01", "dopri5"): (5, 200, 400), ("A01", "dop853"): (8, 16, 24),
    ("G1", "rk4"): (4, 50, 100), ("G1", "dopri5"): (5, 12, 25), ("G1", "dop853"): (8, 6, 8),
}  # fmt: skip


@pytest.mark.parametrize(("problem", "integrator"), ORDERS)
def test_observed_order(problem, integrator):
    """Fixed steps: the error falls with the step to the method's order, within 0.2 (closed forms).
    The steps are those where the leading term rules: errors from 1e-7 to 1e-13."""
    order, *steps = ORDERS[problem, integrator]
    scenes = {"A01": problems.pendulum(), "G1": problems.free_body((1, 2, 3), (1, 2, 0.5))}
    scene, t = scenes[problem], 1.0

    def error(n):
        result = last(scene, t, integrator=integrator, step=t / n, project=False)
        if problem == "A01":
            return np.linalg.norm(result.r[-1, 0, :2] - A01[t][:2])
        return np.linalg.norm(result.wp[-1, 0] - G1[t][0])

    coarse, fine = (error(n) for n in steps)
    assert fine > 5e-14, "the error is at rounding: take larger steps"
    assert np.log(coarse / fine) / np.log(steps[1] / steps[0]) == pytest.approx(order, abs=0.2)


@pytest.mark.slow
def test_long_run_keeps_energy_and_constraints():
    """pen1 over 100 s at rtol 1e-10, projected: energy drift below 1e-8, |C| below 1e-11."""
    result = dap.simulate("pen1", t_end=100.0, dt=0.02, rtol=1e-10, atol=1e-12, project=True)
    assert np.max(np.abs(result.energy.total - result.energy.total[0])) < 1e-8
    assert result.ledger["position"].value < 1e-11


@pytest.mark.parametrize("integrator", ["dop853", "dopri5"])
def test_error_follows_tolerance(integrator):
    """Tightening rtol by 100 lowers the true error by at least 10 (A01 against its closed form)."""

    def error(rtol):
        result = last(problems.pendulum(), 1.0, integrator=integrator, rtol=rtol, atol=rtol)
        return np.linalg.norm(result.r[-1, 0, :2] - A01[1.0][:2])

    errors = [error(rtol) for rtol in (1e-4, 1e-6, 1e-8, 1e-10)]
    assert all(b < a / 10 for a, b in pairwise(errors)), errors
