"""Radau on the equations of motion: tangent, chunks, motions, refusals."""

import numpy as np
import pytest
from support import mechanisms, problems
from support.internals import compiled, store_reference_pivots
from support.plain import jit_is_on, long_in_plain_python

import dap3d_core as dap
from dap3d_core.formulations.stabilized_index2.stage_equations import evaluate_stage, keep_frames
from dap3d_core.integrators import Status
from dap3d_core.integrators.radau.integration import RadauIntegration, estimate_tolerances
from dap3d_core.integrators.radau.newton import factorise_both, find_tangent, solve_first


@compiled
def evaluate(t, y, multipliers, held, out, rows, system, loops):
    evaluate_stage(t, y, multipliers, held, out, rows, system, loops)


@compiled
def solve_at(t, h, y, multipliers, work, system, loops, tangent, matrix):
    """The change that belongs to the residual in R[0], G[0], in the axes of y."""
    evaluate_stage(t, y, multipliers, matrix.held, work.R[1], work.G[1], system, loops)
    keep_frames(system.body, work.frames[0])
    solve_first(h, work, (system, loops, tangent, matrix))


def sprung():
    """A moving chain with damped springs between its bodies and to ground, one of them rubbing."""
    scene = mechanisms.bent_chain(4)
    scene.add_force("weight", "gravity")
    scene.add_point("post", "ground", (0.5, 2.0, 0.3))
    for k, (i, j) in enumerate([("b0.O", "b2.O"), ("b3.O", "post"), ("b1.O", "b2.O")]):
        scene.add_force("ptp", f"spring{k}", P_i=i, P_j=j, k=50.0 + k, c=3.0, l0=0.4)
    scene.add_force("friction", "rub", joint="J1", mu=0.3, v_tol=0.5, radius=0.1)
    return scene


def disk():
    scene = dap.Scene(name="disk")
    p = (np.cos(0.04), np.sin(0.04), 0.0, 0.0)
    scene.add_body("disk", mass=0.3, Jp=(2e-4, 4e-4, 2e-4), r=(0.0, 0.0, 0.0498), p=p,
                   r_dot=(0.5, 0.0, 0.0), w=(0.1, 10.0, 0.3))  # fmt: skip
    scene.add_joint("disk", "contact", body_i="disk", slip="xyz", radius=0.05)
    scene.add_force("weight", "gravity")
    return scene


def integration(scene, times=(0.0, 1.0), method=None, **settings):
    compiled = dap.compile(scene, method=method)
    evaluator = compiled.evaluator
    u = compiled.start(True, ()).u
    store_reference_pivots(evaluator, 0.0, u)
    evaluator.start(0.0, u)
    return RadauIntegration(evaluator, evaluator.integrated(u), times,
                            report_size=evaluator.report_size, **settings)  # fmt: skip


@pytest.mark.every(4)
@pytest.mark.parametrize("scene", [sprung, disk, problems.pendulum], ids=lambda f: f.__name__)
@pytest.mark.parametrize("h", [1.0, 1e-2])
def test_tangent_is_that_of_all_equations(scene, h):
    """s z - J z = r for the solution z, J by central differences of all equations in all unknowns.
    Both kinds of differences err by some 1e-9 of the largest term."""
    run = integration(scene())
    evaluator, work, matrix = run.evaluator, run.work, run.matrix
    system, rows = evaluator.system, evaluator.plan.row_size
    rng = np.random.default_rng(7)
    there = np.zeros((2, rows))
    there[:, system.row] = 1.0
    base = np.zeros((2, rows))
    base[1] = 5.0 * rng.normal(size=rows) * there[1]
    work.last_multipliers[2] = base
    work.multipliers[2] = base
    work.tangent_step = h
    find_tangent(work, (system, run.own_loops, run.tangent, matrix))
    assert work.tangent_is_current
    assert factorise_both(0.0, h, work, (system, evaluator.loops, run.tangent, matrix)) == 0.0
    y0 = run.y
    residual = rng.normal(size=y0.size)
    residual[-1] = 0.0
    of_rows = rng.normal(size=(2, rows)) * there
    of_rows[0] *= matrix.held  # mu of a row without position level is zero from the start
    work.R[0], work.G[0] = residual, of_rows
    solve_at(0.0, h, y0, base, work, system, evaluator.loops, run.tangent, matrix)
    change, multipliers = work.R[0].copy(), work.G[0].copy()

    def equations(y, m):
        out, levels = np.zeros_like(y), np.zeros((2, rows))
        evaluate(0.0, y, m, matrix.held, out, levels, system, evaluator.loops)
        out[-1] = 0.0
        return np.concatenate([out, levels.ravel()])

    def along(dy, dm):
        size = max(np.max(np.abs(dy)), np.max(np.abs(dm)), 1e-300)
        e = 1e-5 / size
        return (equations(y0 + e * dy, base + e * dm) - equations(y0 - e * dy, base - e * dm)) / (
            2.0 * e
        )

    nothing, none = np.zeros_like(change), np.zeros_like(multipliers)
    terms = [along(change, none), along(nothing, multipliers)]
    s = run.work.method.poles[0, 0] / h
    left = np.concatenate([s * change, np.zeros(2 * rows)]) - terms[0] - terms[1]
    expected = np.concatenate([residual, of_rows.ravel()])
    size = max(np.max(np.abs(term)) for term in (s * change, *terms, expected))
    assert np.max(np.abs(left - expected)) < 2e-8 * size


def test_tolerances_of_the_estimate_keep_their_ratio():
    rtol, limit, atol = estimate_tolerances(1e-6, 1e-8, 3)
    assert (rtol, atol / rtol, limit) == pytest.approx((1e-5, 1e-2, 1e-5**0.5))
    assert estimate_tolerances(0.0, 1e-6, 3) == pytest.approx((0.0, 1e-5**0.5, 1e-5))
    for stages in (5, 7):  # three times the tolerance; the iteration ends at the same change
        more, less, _ = estimate_tolerances(1e-9, 1e-11, stages)
        rtol, limit, _ = estimate_tolerances(1e-9, 1e-11, 3)
        assert (more, less * more) == pytest.approx((3e-9, limit * rtol))


def rows_of(run, budget):
    taken = []
    while run.status is Status.RUNNING:
        run.advance(budget)
        taken.append(run.rows())
    assert run.status is Status.FINISHED
    return np.concatenate(taken)


@pytest.mark.slow
@long_in_plain_python
def test_chunks_change_no_bit():
    """Everything that decides what comes next lies in arrays."""
    times = np.linspace(0.0, 0.5 if jit_is_on() else 0.04, 23)
    options = dict(rtol=1e-6, atol=1e-8, project_on=True, buffer_rows=5)
    whole, cut = (rows_of(integration(sprung(), times, **options), n) for n in (10**9, 1))
    assert np.array_equal(whole, cut)


@long_in_plain_python
@pytest.mark.parametrize("scene", [sprung, disk, mechanisms.bricard], ids=lambda f: f.__name__)
def test_motion_is_that_of_an_explicit_method(scene):
    """Friction, rows without position level, redundant rows: within 1e-6 of dop853 at 1e-11."""
    made = scene()
    if not made.forces:
        made.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    times = {"t_end": 0.2, "dt": 0.05} if jit_is_on() else {"t_end": 0.02, "dt": 0.01}
    ours = dap.simulate(made, **times, integrator="radau", rtol=1e-9, atol=1e-11)
    theirs = dap.simulate(made, **times, rtol=1e-11, atol=1e-13)
    assert ours.method == theirs.method
    assert np.max(np.abs(ours.u - theirs.u)) < 1e-6
    # multipliers of redundant rows too: both report the least ones
    assert np.max(np.abs(ours.Lam - theirs.Lam)) < 1e-4 * max(1.0, np.max(np.abs(theirs.Lam)))
    assert all(entry.ok for entry in ours.ledger.values())


def test_body_without_joints():
    """G1 (elliptic functions, benchmarks): the method is an ordinary one where nothing is held."""
    scene = problems.free_body((1.0, 2.0, 3.0), (1.0, 2.0, 0.5))
    result = dap.simulate(scene, t_end=1.0, dt=1.0, integrator="radau", rtol=1e-10, atol=1e-12)
    w = (0.50197928606713736, 2.1789944461516021, 0.025711240346541824)
    assert result.wp[-1, 0] == pytest.approx(w, abs=1e-8)


@pytest.mark.parametrize("part", [2e-4, 1e-3, 1e-2])
def test_dense_output_behind_a_short_step_has_none_of_its_rounding(part):
    """x'' = -100 x from x = 1, with a step of a part of the next one before it, of order 5.
    Its rounding came in divided by the square of the part: off by 2e-7 and 4e-9 at the first two.
    The bounds are rtol, 1e-10, of the largest x and rate."""
    scene = dap.Scene(name="oscillator")
    scene.add_body("b", mass=2.0, Jp=(1.0, 1.0, 1.0), r=(1.0, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="b.O", P_j="ground.O", k=200.0, l0=0.0)
    run = integration(scene, rtol=1e-10, atol=1e-12)
    run.work.follows_steps = 1
    for _ in range(3):
        run.advance(0)
    run.advance_to(run.t + part * run.work.h)
    start = run.t
    while run.t == start:
        run.advance(0)
    t = np.linspace(start, run.t, 12)[1:-1]
    found = np.array([run.state_within(one) for one in t])
    assert np.max(np.abs(found[:, 0] - np.cos(10.0 * t))) < 1e-10
    assert np.max(np.abs(found[:, 7] + 10.0 * np.sin(10.0 * t))) < 1e-9
