"""The cone problem against what the complementarity conditions say, and a closed form."""

import numpy as np
import pytest
from support.plain import long_in_plain_python

from dap3d_core.formulations.contacts import cone


def solve_cone(A, b, mu):
    """The solution of a problem, and its residual."""
    problem = cone.cone_of(len(mu))
    problem.count = len(mu)
    problem.A[:], problem.b[:], problem.mu[:] = A, b, mu
    left = cone.solve_cone(problem)
    return problem.x, left


@pytest.mark.parametrize("seed", range(20))
def test_a_solution_fulfils_the_law_of_coulomb(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 5))
    G = rng.normal(size=(3 * count, 3 * count + 2))
    A, b, mu = G @ G.T, rng.normal(size=3 * count), rng.uniform(0.0, 0.8, count)
    x, left = solve_cone(A, b, mu)
    assert left < 1e-10
    u, X = (A @ x + b).reshape(-1, 3), x.reshape(-1, 3)
    size = np.abs(b).max() * 1e-8
    assert np.all(X[:, 0] >= -size)
    assert np.all(u[:, 0] >= -size)
    assert np.abs(X[:, 0] * u[:, 0]).max() < size * max(1.0, np.abs(X).max())
    friction, limit = np.hypot(X[:, 1], X[:, 2]), mu * X[:, 0]
    assert np.all(friction <= limit + size)
    inside = friction < limit - 1e-6
    assert np.all(np.abs(u[inside, 1:]) < size)
    power = np.sum(X[:, 1:] * u[:, 1:], axis=1)  # opposite where it slides
    speed = np.hypot(u[:, 1], u[:, 2])
    assert power == pytest.approx(-friction * speed, abs=size * max(1.0, np.abs(X).max()))


def test_a_block_slides_by_what_friction_leaves():
    mass, mu, pull, weight = 2.0, 0.3, 10.0, 19.62
    b = np.array([-weight, pull, 0.0]) / mass
    x, _ = solve_cone(np.eye(3) / mass, b, [mu])
    assert x == pytest.approx([weight, -mu * weight, 0.0], rel=1e-14)
    x, _ = solve_cone(np.eye(3) / mass, b, [0.6])
    assert x == pytest.approx([weight, -pull, 0.0], rel=1e-14)


@long_in_plain_python
def test_rounding_of_the_rates_is_no_residual():
    """Of a box that comes down on four corners at 1e-5 m/s, while it slides at 1 m/s."""
    corners = [[x, y, -0.05] for x in (-0.2, 0.2) for y in (-0.15, 0.15)]
    axes = np.eye(3)[[2, 0, 1]]
    J = np.array([[*e, *np.cross(r, e)] for r in corners for e in axes])
    weights = np.array([1.0, 1.0, 1.0, 100.0, 60.0, 50.0])
    b = J @ [0.0, 0.0, -1e-5, 1e-5, 2e-5, 0.0] + 1e-15 * np.cos(np.arange(12.0))
    problem = cone.cone_of(4)
    problem.count, problem.A[:], problem.b[:], problem.mu[:] = 4, J * weights @ J.T, b, 1.0
    assert cone.solve_cone(problem) > cone.SOLVED
    problem.x[:], problem.noise[:] = 0.0, 2e-15
    assert cone.solve_cone(problem) <= cone.SOLVED
    assert np.abs(problem.A @ problem.x + b).max() < 1e-14


def test_a_row_that_moves_nothing_says_nothing_of_the_size_of_a_solution():
    """Of friction that holds a slider beside a rope without friction, at a right angle to a joint.

    What that row changes of itself is rounding, of either sign, as is its rate.
    """
    G = np.array([[0.9, 0.0], [-0.4, 1.7], [-0.2, 1.8]])
    A, b, problem = np.zeros((6, 6)), np.zeros(6), cone.cone_of(2)
    rows = [1, 3, 4]
    A[np.ix_(rows, rows)], b[rows] = G @ G.T, [0.5, -1.9, -1.8]
    A[5, 5], b[5] = -2e-15, -1e-17
    problem.count, problem.A[:], problem.b[:] = 2, A, b
    problem.mu[:], problem.more[:] = [5.0, 0.0], [1.0, 0.0]
    assert cone.solve_cone(problem) < 1e-12
    held = np.linalg.solve(A[np.ix_([1, 3], [1, 3])], [-0.5, 1.9])
    assert problem.x == pytest.approx([0.0, held[0], 0.0, held[1], 0.0, 0.0], rel=1e-13)


def test_contacts_that_jam_each_other_have_no_solution():
    """Neither both forces (-161, -67), nor one alone (the other would accelerate by -52, -15)."""
    A = np.kron([[0.06037, -0.29260], [-0.26205, 0.48465]], np.diag([1.0, 0.0, 0.0]))
    A += np.kron(np.eye(2), np.diag([0.0, 1.0, 1.0]))
    with np.errstate(all="ignore"):  # forces grow without end
        _, left = solve_cone(A, np.array([-9.81, 0.0, 0.0] * 2), [0.0, 0.0])
    assert left > 1e-6


@long_in_plain_python
@pytest.mark.parametrize("seed", [17, 125, 152, 752, 1335, 1675])
def test_four_feet_that_share_a_load_are_solved_where_newton_alone_stalls(seed):
    """A trunk of 10 kg on hinged legs, in rates as of landing; a residual of zero is the law."""
    rng, G, scale = np.random.default_rng(seed), np.zeros((12, 10)), [10, 10, 10, 0.1, 0.3, 0.35]
    for c, p in enumerate([x, y, -0.4] for x in (-0.3, 0.3) for y in (-0.15, 0.15)):
        axes, a = np.eye(3)[[2, 0, 1]], 0.1 * rng.normal()
        G[3 * c : 3 * c + 3, :6] = np.hstack([axes, np.cross(p, axes)]) / np.sqrt(scale)
        G[3 * c : 3 * c + 3, 6 + c] = 2.0 * np.sin(a), 2.0 * np.cos(a), 0.0
    rates = rng.normal(size=10) * ([1.0] * 6 + [5.0] * 4)
    rates[2] -= 9.81 * np.sqrt(10.0)
    assert solve_cone(G @ G.T, G @ rates, np.full(4, 0.6))[1] < 1e-12
