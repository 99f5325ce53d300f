"""Formulations for redundant rows against dense linear algebra, and what each of them compiles."""

import numpy as np
import pytest
from support import mechanisms, problems, redundant
from support.internals import Evaluator, correct_initial
from support.loops import spatial_four_bar
from support.own_types import registry_of
from support.plain import in_another_process, long_in_plain_python
from support.process import run
from support.results import model_of
from support.rotations import rotation

import dap3d_core as dap
from dap3d_core.formulations import PROJECT, RHS
from dap3d_core.interface import Joint, Point, Vector, number, point, vector
from dap3d_core.kernels import cross, dot, eye, hstack, neg, normals, row, scale, skew, sub

REDUNDANT = {
    "door": mechanisms.door,
    "planar four-bar": mechanisms.planar_four_bar,
    "A02": lambda: redundant.four_bars(2),
    "A04": redundant.bricard,
}
INDEPENDENT = {name: lambda name=name: dap.load(name) for name in ("pen2", "fourbar2", "fourbar3")}


def machines_of(scene, *methods, registry=None):
    model = model_of(scene, registry)
    return [Evaluator(model, method) for method in methods]


def moving(evaluator, seed=0):
    """The state given with random velocities that the constraints allow."""
    u, n = evaluator.model.u0.copy(), evaluator.model.body_count
    u[7 * n :] = np.random.default_rng(seed).normal(size=6 * n)
    return correct_initial(evaluator, u).u


def mass_matrix(model, u):
    """M (6 n, 6 n), global axes."""
    n = model.body_count
    A = rotation(u[: 7 * n].reshape(n, 7)[:, 3:])
    M = np.zeros((6 * n, 6 * n))
    for b in range(n):
        M[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = model.mass[b] * np.eye(3)
        M[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = A[b] @ model.Jp[b] @ A[b].T
    return M


def parts(evaluator, free, u):
    """M, M^-1 g, and the rows, each found without the formulation's factors."""
    n = evaluator.model.body_count
    return mass_matrix(evaluator.model, u), free.rhs(0.0, u)[7 * n :], evaluator.rows(0.0, u)


def report_of(evaluator, u):
    found, n = evaluator.report(0.0, u), evaluator.model.body_count
    return found[: 6 * n], found[6 * n :][: evaluator.model.row_count]


@pytest.mark.parametrize("moment", [1e-4, 1e-7, 1e-10])
def test_lsq_holds_a_needle_on_two_hinges(moment):
    """A door falls about its hinges by m g l / (J + m l^2), however easily it turns about an axis
    across them. To rounding: the rows lose no digits of the fall, which they all share. Without
    smaller parts for weak rows it is off by 1e-5 of itself at 1e-7 kg m^2, by all at 1e-10."""
    scene = redundant.hinged_door()
    scene.bodies["door"].Jp = (4.0, moment, 4.0)
    (evaluator,) = machines_of(scene, "lsq")
    fall = evaluator.rhs(0.0, evaluator.model.u0)[9:11]
    exact = 9.81 * 12.0 * 0.5 / (4.0 + 12.0 * 0.25)
    assert fall == pytest.approx([-0.5 * exact, exact], rel=1e-12)


@pytest.mark.parametrize("method", ["lsq", "joint"])
def test_needles_in_a_loop_take_no_short_steps(method):
    """Rounding of reactions on needles is no noise that steps follow."""
    scene = spatial_four_bar(3)
    for body in scene.bodies.values():
        body.Jp = (1e-6, 0.05, 0.05)
    result = dap.simulate(scene, t_end=0.2, rtol=1e-10, atol=1e-12, method=method)
    assert result.stats.steps + result.stats.rejected < 40


@pytest.mark.parametrize("name", REDUNDANT | INDEPENDENT)
def test_lsq_gives_the_accelerations_and_the_least_multipliers(name):
    """Against S lambda = gamma - D M^-1 g by numpy's pinv: the least |lambda|.
    Accelerations to 1e-11 of those without joints, out of which they come by subtraction; condition
    numbers of S are up to 1e4. Multipliers to rounding over LEAST_PART = 1e-5, some passes of
    it."""
    evaluator, free = machines_of((REDUNDANT | INDEPENDENT)[name](), "lsq", "unconstrained")
    u = moving(evaluator)
    M, a_free, rows = parts(evaluator, free, u)
    D = rows.dense()
    S = D @ np.linalg.solve(M, D.T)
    least = np.linalg.pinv(S, rcond=1e-10, hermitian=True) @ (rows.gamma - D @ a_free)
    expected = a_free + np.linalg.solve(M, D.T @ least)
    a, multipliers = report_of(evaluator, u)
    size = max(np.max(np.abs(expected)), np.max(np.abs(a_free)))
    assert a == pytest.approx(expected, abs=1e-11 * size)
    assert multipliers == pytest.approx(least, abs=1e-8 * max(size, np.max(np.abs(least))))
    assert D @ a == pytest.approx(rows.gamma, abs=1e-11 * (1.0 + np.max(np.abs(expected))))


@pytest.mark.parametrize("name", ["door", "fourbar3"])
@pytest.mark.parametrize("numbers", [(1e7, 10.0, 1.0), (3e4, 4.0, 0.7)], ids=str)
def test_penalty_is_that_of_the_manual(name, numbers):
    """Spec 9, dense, off the constraints: every term shows. The dense sum M + alpha D^T D loses
    alpha times the rounding of the masses, 1e-9."""
    evaluator, free = machines_of((REDUNDANT | INDEPENDENT)[name](), "penalty", "unconstrained")
    evaluator.set_penalty(*numbers)
    alpha, Omega, mu = numbers
    rng = np.random.default_rng(5)
    u, n = evaluator.model.u0.copy(), evaluator.model.body_count
    u[: 7 * n] += 0.02 * rng.normal(size=7 * n)
    u[: 7 * n].reshape(n, 7)[:, 3:] /= np.linalg.norm(
        u[: 7 * n].reshape(n, 7)[:, 3:], axis=1, keepdims=True
    )
    u[7 * n :] = rng.normal(size=6 * n)
    M, a_free, rows = parts(evaluator, free, u)
    D = rows.dense()
    C = np.where(evaluator.model.position_row, rows.C, 0.0)
    assert np.max(np.abs(C)) > 1e-3
    target = rows.gamma - 2 * mu * Omega * (D @ u[7 * n :] - rows.nu) - Omega**2 * C
    expected = np.linalg.solve(M + alpha * D.T @ D, M @ a_free + alpha * D.T @ target)
    a, multipliers = report_of(evaluator, u)
    assert a == pytest.approx(expected, abs=1e-8 * np.max(np.abs(expected)))
    # lambda = -alpha (D a - gamma') by its definition, of the accelerations found
    reaction = -alpha * (D @ a - target)
    assert multipliers == pytest.approx(reaction, abs=1e-6 * np.max(np.abs(multipliers)))


def test_penalty_agrees_with_standard_on_the_four_bar():
    """Spec 9, measured there for the four-bar: v_dot to some 1e-5 relative, lambda to 3e-2 of 1.3e3
    (this random motion has multipliers of the same size)."""
    standard, penalty = machines_of(dap.load("fourbar3"), "standard", "penalty")
    u = moving(standard)
    (a, multipliers), (a_p, multipliers_p) = report_of(standard, u), report_of(penalty, u)
    assert np.max(np.abs(a_p - a)) < 1e-4 * np.max(np.abs(a))
    assert np.max(np.abs(multipliers_p - multipliers)) < 1e-4 * np.max(np.abs(multipliers))


@pytest.mark.parametrize("name", INDEPENDENT)
def test_lsq_and_standard_agree_where_rows_are_independent(name):
    """The proximal passes stand at rounding: the same equations, 1e-11 of the largest."""
    standard, lsq = machines_of(INDEPENDENT[name](), "standard", "lsq")
    u = moving(standard)
    for one, other in zip(report_of(standard, u), report_of(lsq, u), strict=True):
        assert other == pytest.approx(one, abs=1e-11 * np.max(np.abs(one)))


class Sized(Joint):
    """A revolute joint whose rows are all multiplied by ``size``."""

    keyword, rows = "sized", 5
    P_i: Point = point()
    P_j: Point = point()
    a_i: Vector = vector()
    a_j: Vector = vector()
    size: float = number(default=1.0)

    def prepare(self, bodies):
        n, m = normals(self.a_j)
        return {"n_j": n, "m_j": m}

    def C(r_P_i, r_P_j, a_i, n_j, m_j, size):
        return (*scale(size, sub(r_P_j, r_P_i)), size * dot(a_i, n_j), size * dot(a_i, m_j))

    def J(s_P_i, s_P_j, a_i, n_j, m_j, size):
        n, m, none = scale(size, cross(a_i, n_j)), scale(size, cross(a_i, m_j)), (0.0, 0.0, 0.0)
        return (
            (*hstack(eye(-size), skew(scale(size, s_P_i))), row(none, n), row(none, m)),
            (*hstack(eye(size), skew(scale(-size, s_P_j))), row(none, neg(n)), row(none, neg(m))),
        )

    def gamma(s_P_i, s_P_j, a_i, n_j, m_j, a_i_dot, n_j_dot, m_j_dot, w_i, w_j, size):
        w = sub(w_j, w_i)
        points = sub(cross(w_i, cross(w_i, s_P_i)), cross(w_j, cross(w_j, s_P_j)))
        n = dot(cross(a_i_dot, n_j), w) + dot(cross(a_i, n_j_dot), w)
        m = dot(cross(a_i_dot, m_j), w) + dot(cross(a_i, m_j_dot), w)
        return (*scale(size, points), size * n, size * m)


@long_in_plain_python
@pytest.mark.parametrize("size", [1e6, 1e-6])
def test_the_motion_does_not_depend_on_the_size_of_rows(size):
    """lsq, a door on two hinges of which one has its rows multiplied: the same swing after 2 s, to
    the 1e-10 that rounding of rows of 1e6 may come to; and the same start, to rounding."""
    registry, found = registry_of(Sized), {}
    for factor in (1.0, size):
        scene = redundant.hinged_door()
        hinge = scene.joints.pop("H1").fields
        scene.add_joint("sized", "H1", size=factor, **hinge)
        compiled = dap.compile(scene, method="lsq", registry=registry)
        found[factor] = dap.simulate(compiled, t_end=2.0, dt=0.5, rtol=1e-9)
    plain, sized = found[1.0], found[size]
    assert abs(plain.r[-1, 0, 1] + 0.5) > 0.1  # it has swung
    assert sized.r == pytest.approx(plain.r, abs=1e-10)
    assert sized.rdd[0] == pytest.approx(plain.rdd[0], abs=1e-12)


@pytest.mark.parametrize("method", ["lsq", "joint", "standard"])
@pytest.mark.parametrize("size", [1.0, 1e-3, 1e-5, 1e4])
def test_rows_of_squares_beside_those_of_directions(size, method):
    """A mass of one kg circles at 1 rad/s on a massless rod, beside a hinge: its pull is m r w^2.

    A row of a squared length is as short as the rod, one of a direction is of length one.
    """
    scene = dap.Scene(name="small")
    scene.add_body("b", mass=1.0, Jp=(size**2,) * 3, r=(size, 0.0, 0.0), r_dot=(0.0, size, 0.0))
    scene.add_vector2("d", "b.O", "ground.O")
    scene.add_joint("sph-sph", "rod", d="d")
    scene.add_body("c", mass=1.0, Jp=(size**2,) * 3, r=(0.0, size, 0.0), w=(0.0, 0.0, 1.0))
    scene.add_point("C", "ground", (0.0, size, 0.0))
    scene.add_joint("rev", "hinge", P_i="c.O", P_j="C", a_i="c.z", a_j="ground.z")
    scene.simulation.method = method
    pull = dap.simulate(scene, t_end=0.0).quantity("rod.force").values[0]
    np.testing.assert_allclose(np.abs(pull) / size, [1.0, 0.0, 0.0], rtol=0.0, atol=1e-9)


def test_auto_takes_lsq_where_rows_are_redundant():
    """Already compiled for it, with the reason; the run says which joints, and goes."""
    compiled = dap.compile(mechanisms.door(0.02))
    assert (compiled.method, compiled.reason) == ("lsq", "5 of 15 rows are redundant")
    result = dap.simulate(compiled, t_end=0.1)
    assert result.method == "lsq"
    assert any("lower, upper" in note and "least |lambda|" in note for note in result.notes)
    assert dap.compile(dap.load("fourbar3")).method == "standard"


def test_what_cannot_be_assembled_is_told_by_the_run():
    """compile leaves it at the standard method; simulate says what is open."""
    compiled = dap.compile(mechanisms.torn())
    assert compiled.method == "standard"
    with pytest.raises(dap.AssemblyError, match="second"):
        dap.simulate(compiled, t_end=1.0)


@pytest.mark.parametrize("method", ["auto", "lsq", "penalty"])
def test_rows_that_contradict_each_other_are_refused(method):
    """Two drivers of one wheel at different rates: no motion satisfies both."""
    with pytest.raises(dap.RedundantError, match=r"slow, fast.*No motion"):
        dap.simulate(mechanisms.two_motors(), t_end=1.0, method=method)


IMPORTED = """
import sys
import dap3d_core as dap
result = dap.simulate({name!r}, t_end=0.01, dt=0.01, method={method!r})
print(*(m.rpartition(".")[2] for m in sys.modules if m.startswith("dap3d_core.formulations.")))
"""


@in_another_process
@pytest.mark.slow
@pytest.mark.parametrize("method", ["standard", "penalty", "lsq"])
def test_only_the_chosen_formulation_is_imported(method):
    """What is not imported is not compiled; tests/e2e/test_run.py looks at what was."""
    said = run(IMPORTED.format(name="pen1", method=method)).split()
    assert {"standard", "penalty", "lsq"} & set(said) == {method}


@pytest.mark.parametrize("method", ["standard", "lsq", "penalty"])
def test_projection_after_a_right_hand_side_is_the_same(method):
    """It takes over what rhs has left at this state; soft springs of penalty are not among that.
    The state is 1e-4 off; rounding of the same arithmetic on numbers of 1 to 10."""
    evaluator = dap.compile(problems.chain(3), method=method).evaluator
    evaluator.set_penalty(10.0, 10.0, 1.0)
    u = evaluator.model.u0 + 1e-4 * np.random.default_rng(5).normal(size=evaluator.model.u0.size)
    states = []
    for here in (0.0, 1.0):
        y = evaluator.integrated(u)
        out = np.zeros(4 + evaluator.length_count)
        evaluator.functions[RHS](0.0, y, np.zeros_like(y), evaluator.system, evaluator.loops)
        out[0] = here
        evaluator.functions[PROJECT](0.0, y, out, evaluator.system, evaluator.loops)
        assert out[0] == 1.0, "the state was moved"
        assert out[1] == 0.0
        assert out[2] < 1e-14
        states.append(y)
    assert states[0] == pytest.approx(states[1], rel=0.0, abs=1e-13)
