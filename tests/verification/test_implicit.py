"""Radau IIA against closed forms and published digits: stiff scenes, observed orders."""

import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import problems
from support.process import REPOSITORY
from verification.test_reference_problems import A01

import dap3d_core as dap
from dap3d_core.integrators import INTEGRATORS, Status

sys.path.append(str(REPOSITORY / "benchmarks"))

from hard import references

G = 9.81


def radau(scene, t, **settings):
    return dap.simulate(scene, t_end=t, integrator="radau", **({"dt": t} | settings))


#: A05: height of the slider (benchmarks, section 1).
GOVERNOR = {0.05: 0.506100897244, 0.1: 0.5238364755696, 0.5: 0.7432494247863}


@pytest.fixture(scope="module")
def governor():
    return dap.compile("models/benchmarks/A05")


@pytest.mark.parametrize("t", GOVERNOR)
def test_governor(governor, t):
    """A05 at rtol 1e-9: the digits to 1e-10, for the slider moves slowly; every ledger holds."""
    result = radau(governor, t, rtol=1e-9, atol=1e-11)
    slider = list(result.model.body_names).index("slider")
    assert result.r[-1, slider, 2] == pytest.approx(GOVERNOR[t], abs=1e-10)
    assert all(entry.ok for entry in result.ledger.values())


@pytest.mark.slow
def test_governor_in_a_fiftieth_of_the_steps(governor):
    """A05 over 10 s at e = 1e-3 (benchmarks, section 0): 50 times fewer steps than rk4 needs.
    rk4 is unstable above 3.4e-4 s (its interval 2.785 over the eigenvalue -8117 1/s), so it takes
    29 400 steps. The reference is this method at 1e-9, which the test above holds to the digits."""
    t, dt = 10.0, 0.1
    fine = radau(governor, t, dt=dt, rtol=1e-9, atol=1e-11)
    coarse = radau(governor, t, dt=dt, rtol=1e-2, atol=1e-4)
    scale = np.maximum(np.abs(fine.u), 1e-3)
    assert np.sqrt(np.mean((np.abs(coarse.u - fine.u) / scale) ** 2)) < 1e-3
    assert coarse.stats.steps < t / (2.785 / 8117.0) / 50.0


def test_stiff_spring_is_a_rod():
    """A spring of 1e9 N/m instead of the rod of A01: the pendulum's closed form to its stretch.
    The stretch is tension / stiffness, below 3e-8 m; with the tension it changes the period by as
    much. The spring's own frequency is 3.2e4 1/s, for which rk4 (2.785 over it) takes 11 350
    steps."""
    scene = dap.Scene(name="spring pendulum")
    scene.add_body("bob", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(-1.0, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="bob.O", P_j="ground.O", k=1e9, l0=1.0)
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    result = radau(scene, 1.0, rtol=1e-8, atol=1e-10)
    assert result.r[-1, 0, :2] == pytest.approx(A01[1.0][:2], abs=3e-7)
    assert result.stats.steps < np.sqrt(1e9) / 2.785 / 20.0
    # the radial velocity is the rate of the stretch, 1e-7 m/s, with no oscillation on top
    radial = np.sum(result.r[-1, 0] * result.rd[-1, 0])
    assert abs(radial) < 1e-6


def order_of(errors, ratio=2.0):
    return np.log(errors[:-1] / errors[1:]) / np.log(ratio)


def test_order_on_the_pendulum():
    """A01 with fixed steps: order 5 within 0.2 in position, velocity and reported tension.
    Index-3 codes lose an order in each of them in turn."""
    found = []
    for n in (20, 40, 80):
        result = radau(
            problems.pendulum(), 1.0, step=1.0 / n, rtol=1e-13, atol=1e-14, project=False
        )
        now = [*result.r[-1, 0, :2], *result.rd[-1, 0, :2], -result.Lam[-1, 0]]
        difference = np.abs(now - np.array(A01[1.0]))
        found.append([max(difference[:2]), max(difference[2:4]), difference[4]])
    assert order_of(np.array(found)) == pytest.approx(5.0, abs=0.2)


@pytest.mark.parametrize(("rtol", "steps"), [(1e-10, 400), (1e-12, 500)])
def test_the_order_rises_where_the_error_limits_the_steps(rtol, steps):
    """A01 over 10 s at 100 instants, nearly all within steps, by Jacobi's functions. Three stages
    alone take 1774 and 8400 steps: a hundredth of the tolerance is 10^(4/3 / 4) = 3.2 to 4.6 times
    the steps of order 5, and 1.8 times those of order 13."""
    result = radau(problems.pendulum(), 10.0, dt=0.1, rtol=rtol, atol=rtol / 100)
    x, y, vx, vy = references.pendulum(result.t).T
    found = np.column_stack([result.r[:, 0, :2], result.rd[:, 0, :2]])
    # a tenth of the tolerance a step, and velocities of up to 4 m/s
    assert np.max(np.abs(found - np.column_stack([x, y, vx, vy]))) < 20.0 * rtol
    assert result.stats.steps < steps


@pytest.mark.parametrize(
    ("model", "t"),
    [("A03", 0.03), ("A05", 0.3), pytest.param("fourbar3", 0.5, marks=pytest.mark.slow)],
)
def test_joint_coordinates_have_the_motion_of_others(model, t):
    """Closed loops, kept rows and a stiff scene, against dop853 at 1e-12."""
    ours = radau(dap.load(model), t, dt=t / 10, method="joint", rtol=1e-9, atol=1e-11)
    theirs = dap.simulate(dap.load(model), t_end=t, dt=t / 10, rtol=1e-12, atol=1e-14)
    assert ours.method == "joint"
    assert np.max(np.abs(ours.u - theirs.u)) < 1e-7 * np.max(np.abs(theirs.u))
    assert all(entry.ok for entry in ours.ledger.values())


def test_fixed_steps_are_of_order_five():
    """The order of steps of a given length is the caller's to know, whatever the tolerances."""
    compiled = dap.compile(problems.pendulum())
    u = compiled.start(True, ()).u
    evaluator = compiled.evaluator
    evaluator.start(0.0, u)
    run = INTEGRATORS["radau"].make(
        evaluator, evaluator.integrated(u), [0.0, 1.0], step=0.01, report_size=evaluator.report_size
    )
    while run.status is Status.RUNNING:
        run.advance(10**9)
        run.rows()
    assert run.work.stages == 3
    assert run.work.Z.shape[0] == 3


def test_order_of_the_multipliers_of_the_stages():
    """A01: lambda of the last stage converges with the stage order 3, mu vanishes (HW VII.4)."""
    compiled = dap.compile(problems.pendulum())
    evaluator, u = compiled.evaluator, compiled.start(True, ()).u
    errors, held = [], []
    for n in (20, 40, 80):
        evaluator.start(0.0, u)
        run = INTEGRATORS["radau"].make(
            evaluator, evaluator.integrated(u), [0.0, 1.0], step=1.0 / n, rtol=1e-13, atol=1e-14,
            report_size=evaluator.report_size,
        )  # fmt: skip
        while run.advance(10**9) is Status.RUNNING:
            pass
        mu, lam = run.work.last_multipliers[run.work.last_stages - 1, :, evaluator.system.row].T
        errors.append(abs(-lam[0] - A01[1.0][4]))
        held.append(abs(mu[0]))
    assert order_of(np.array(errors)) == pytest.approx(3.0, abs=0.4)
    assert np.all(order_of(np.array(held)) > 2.6)


def test_multipliers_of_the_heavy_top_do_not_oscillate():
    """G4, fast precession: the force at the pivot at every step against the closed form, order 5.
    In steady precession the centre goes round at radius l sin(theta): F = m (r_ddot + g z). An
    oscillation from step to step would not fall with h^5, for its sum does not."""
    theta, W = np.radians(30.0), 56.7367666236016186
    found = []
    for n in (100, 200):
        t = 0.1
        result = radau(problems.heavy_top(theta, 200.0, W), t, dt=t / n, step=t / n, rtol=1e-12,
                       atol=1e-13, project=False)  # fmt: skip
        heading = W * result.t
        out = 0.1 * np.sin(theta)
        centre = np.column_stack([-out * np.sin(heading), out * np.cos(heading), 0.0 * heading])
        force = -W * W * centre + [0.0, 0.0, G]
        error = result.reaction("pivot")["i"].force - force
        found.append([np.max(np.abs(error)), np.max(np.abs(np.diff(error, axis=0)))])
    found = np.array(found)
    assert order_of(found)[0, 0] == pytest.approx(5.0, abs=0.3)
    # neighbouring steps differ by far less than the error itself: it drifts, and does not jump
    assert found[1, 1] < 0.2 * found[1, 0]


def test_reporting_times_cost_no_steps_and_no_order():
    """A01: dense output at 37 instants has order 5, and as many steps as with one report."""
    times = {"dt": 1.0 / 37.0}
    fine = radau(problems.pendulum(), 1.0, rtol=1e-12, atol=1e-13, step=1e-3, **times)
    errors = []
    for n in (20, 40, 80):
        settings = {"step": 1.0 / n, "rtol": 1e-12, "atol": 1e-13, "project": False}
        result = radau(problems.pendulum(), 1.0, **settings, **times)
        assert result.stats.steps == n
        errors.append(np.max(np.abs(result.u[3:] - fine.u[3:])))
    assert order_of(np.array(errors)) == pytest.approx(5.0, abs=0.4)


def test_reports_in_the_first_step_behind_an_impact():
    """A ball on a spring of zero free length bounces off a floor: sines between its impacts.
    The first step behind one is 9 ms long, of order 5, and reports in it had order 3: with an error
    of 5e-7 m/s at 1e-8 of 10 m/s, which is 1e-7. That is the tolerance; found is a tenth of it."""
    w, speed, rtol = 10.0, 10.0, 1e-8
    scene = dap.Scene(name="bouncing on a spring")
    scene.add_body("b", mass=2.0, Jp=(1.0, 1.0, 1.0), r=(0.0, 0.0, 1.0), r_dot=(speed, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="b.O", P_j="ground.O", k=2.0 * w**2, l0=0.0)
    scene.add_contact("ball_plane", "floor", P_i="b.O", radius=0.5, e=1.0)
    result = radau(scene, 0.3, dt=5e-4, rtol=rtol, atol=rtol / 100)
    fall = np.arccos(0.5) / w  # from the height 1 to 0.5, and back
    since_top = result.t - 2.0 * fall * np.round(result.t / (2.0 * fall))
    expected = [speed * np.cos(w * result.t), -w * np.sin(w * since_top)]
    assert np.any(np.abs(result.t - fall) < 5e-4)
    assert np.max(np.abs(result.rd[:, 0, [0, 2]].T - expected)) < rtol * speed


@pytest.mark.slow
@pytest.mark.parametrize("w", [30.0, 300.0])
@pytest.mark.parametrize("rtol", [1e-10, 1e-12])
def test_components_at_zero_do_not_loosen_the_iteration(w, rtol):
    """A rod that turns 24 times about a hinge, against SciPy: components that stay zero have the
    absolute tolerance, below the rounding of the large ones. The iteration for all of them ended at
    a tenth of the tolerance for that, with an error of 5e-6 at 1e-10. A step adds up to rtol, some
    6000 do, and 24 turns make of it an angle 150 times as large: 150 rtol is a tenth of it."""
    scene = dap.Scene(name="spun")
    c, s = np.cos(1.0), np.sin(1.0)
    scene.add_body("b", mass=1.0, Jp=(1 / 12, 1 / 12, 1 / 12), r=(s, 0.0, -c),
                   r_dot=(w * c, 0.0, w * s), p=(np.cos(0.5), 0.0, -np.sin(0.5), 0.0),
                   w=(0.0, -w, 0.0))  # fmt: skip
    scene.add_point("P", "b", (0.0, 0.0, 1.0))
    scene.add_joint("rev", "hinge", P_i="P", P_j="ground.O", a_i="b.y", a_j="ground.y")
    scene.add_force("weight")
    result = dap.simulate(
        scene, t_end=150.0 / w, dt=15.0 / w, integrator="radau", rtol=rtol, atol=rtol / 100
    )

    def rates(_, y):
        return [y[1], -9.81 * np.sin(y[0]) / (13.0 / 12.0)]

    expected = solve_ivp(rates, (0.0, 150.0 / w), [1.0, w], "DOP853", rtol=1e-13, atol=1e-13)
    found = -result.w[-1, 0, 1]
    assert abs(found - expected.y[1, -1]) < 150.0 * rtol * w
    assert result.ledger["energy"].ok
