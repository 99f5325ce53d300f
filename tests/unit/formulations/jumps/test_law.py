"""The law of jumps at one instant: balls on a line, several impacts at once, closed forms.
Balls of diameter 1 touch at the distance 1; velocities along x. Tolerances: some roundings."""

import numpy as np
import pytest
from support.jumping import JUMPING

import dap3d_core as dap
from dap3d_core.formulations.jumps import law as law_module
from dap3d_core.formulations.jumps.multipliers import find_impulses


def balls(masses, velocities, e, gaps=None):
    """A compiled model of balls on a line, and its state."""
    gaps = [0.0] * (len(masses) - 1) if gaps is None else gaps
    x = np.concatenate([[0.0], np.cumsum(1.0 + np.array(gaps))])
    scene = dap.Scene(name="balls")
    for k, (m, v) in enumerate(zip(masses, velocities, strict=True)):
        scene.add_body(f"b{k}", mass=m, Jp=(1.0, 1.0, 1.0), r=(x[k], 0.0, 0.0),
                       r_dot=(v, 0.0, 0.0))  # fmt: skip
    for k in range(len(masses) - 1):
        scene.add_force("ptp_stop", f"c{k}", P_i=f"b{k}.O", P_j=f"b{k + 1}.O", l_stop=1.0, e=e,
                        k=1e6, v_rest=0.0)  # fmt: skip
    return dap.compile(scene, registry=JUMPING)


def velocities_after(masses, velocities, e, **more):
    compiled = balls(masses, velocities, e, **more)
    none = np.zeros(len(masses) - 1)
    y = compiled.evaluator.integrated(compiled.model.u0)
    jump = law_module.JumpLaw(compiled.evaluator).jump(0.0, y, None, none, 1e-12)
    return np.array(velocities) + jump.dv.reshape(-1, 6)[:, 0], jump


def test_two_impacts_at_one_instant_are_solved_together():
    """A ball of mass M between two of mass m that hit it at u from the left, w from the right.
    Newton's law for both: v2 - v1 = e u, v3 - v2 = e w, with the momentum of all conserved."""
    m, M, u, w, e = 1.0, 3.0, 2.0, 1.0, 0.6
    after, jump = velocities_after([m, M, m], [u, 0.0, -w], e)
    total, relative = m * u - m * w, np.array([e * u, e * w])
    v2 = (total + m * relative[0] - m * relative[1]) / (2.0 * m + M)
    np.testing.assert_allclose(after, [v2 - relative[0], v2, v2 + relative[1]], atol=1e-14)
    assert jump.rounds == 1
    assert jump.work == pytest.approx(
        0.5 * (m * (after[0] ** 2 + after[2] ** 2) + M * v2**2 - m * (u**2 + w**2)), rel=1e-12
    )


@pytest.mark.parametrize(("most", "error"), [(None, 1e-11), (3, 1e-14)])
def test_inelastic_impacts_through_a_chain_come_to_an_end(most, error, monkeypatch):
    """e = 0: the balls go on as one, which takes rounds without end; momentum is kept. What still
    approaches after the last round is stopped by one solution for all that have been touched."""
    if most:
        monkeypatch.setattr(law_module, "ROUNDS", most)
    after, jump = velocities_after([1.0, 2.0, 3.0], [6.0, 0.0, 0.0], 0.0)
    np.testing.assert_allclose(after, 1.0, rtol=0.0, atol=error)
    assert jump.rounds == most + 1 if most else jump.rounds < 200


def test_balls_that_are_apart_do_not_take_part():
    after, jump = velocities_after([1.0, 1.0, 1.0], [1.0, 0.0, 0.0], 1.0, gaps=[0.0, 1e-3])
    np.testing.assert_allclose(after, [0.0, 1.0, 0.0], atol=1e-15)
    assert jump.elements == ("force c0",)


def row_impulses(A, b, pushes):
    """The impulses of rows, alone."""
    m, x = len(b), np.zeros((4, len(b)))
    x[0] = b
    of = np.array(pushes, dtype=np.int64)
    find_impulses(m, A, x, of, np.zeros(m, np.int64), np.zeros((2, m, m)))
    return x[1]


def test_contacts_do_not_pull():
    """b = (1, -5) with A = (2, -1; -1, 2): a negative second impulse is left out (Moreau)."""
    A, b = np.array([[2.0, -1.0], [-1.0, 2.0]]), np.array([1.0, -5.0])
    pushes = np.array([True, True])
    np.testing.assert_allclose(row_impulses(A, b, pushes), [0.5, 0.0], atol=1e-15)
    np.testing.assert_allclose(row_impulses(A, b, ~pushes), np.linalg.solve(A, b), atol=1e-15)


def test_a_row_that_pushes_beside_one_that_also_pulls():
    """The complementarity with one free row, against all its cases."""
    rng = np.random.default_rng(3)
    pushes = np.array([False, True, True])
    for _ in range(20):
        root = rng.normal(size=(3, 3))
        A, b = root @ root.T / 9.0, rng.normal(size=3)
        x = row_impulses(A, b, pushes)
        left = A @ x - b
        assert abs(left[0]) < 1e-9
        assert (x[1:] >= 0.0).all()
        assert (left[1:] > -1e-9).all()
        assert np.abs(x[1:] * left[1:]).max() < 1e-9


def test_dependent_rows_share_their_impulse():
    """A block on four legs, of which one is too many: equal shares, exact change."""
    A = np.full((4, 4), 0.25)
    np.testing.assert_allclose(row_impulses(A, np.ones(4), np.ones(4, bool)), 1.0, atol=1e-14)
