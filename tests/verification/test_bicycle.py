"""The shipped bicycle against the linear equations of the benchmark paper (2007)."""

import numpy as np
import pytest
from scipy.linalg import expm
from support.whipple import matrices, system

import dap3d_core as dap

#: Eigenvalues that the paper prints in its table 2, by the forward speed, m/s.
PRINTED = {
    0.0: [-5.530943717653930, -3.131643247906560, 3.131643247906560, 5.530943717653930],
    5.0: [-14.0783896927982, -0.322866429004087,
          -0.775341882195845 - 4.46486771378823j, -0.775341882195845 + 4.46486771378823j],
}  # fmt: skip
#: Lean rate at the start, rad/s: what is left out of linear equations is its third power.
SMALL = 1e-4


def leaning(speed):
    """The bicycle upright at a speed, with a small lean rate about the line of its contacts."""
    scene = dap.load("bicycle")
    scene.parameters |= {"v": speed, "lean_rate": SMALL}
    scene.add_output("steer_rate", "-steering.angle_rate")
    return dap.simulate(scene, t_end=2.0, dt=0.1, rtol=1e-12, atol=1e-15)


def test_published_matrices():
    """Those of the formulas are the numbers that the paper prints (its section 5)."""
    M, C1, K0, K2 = matrices()
    printed = [
        [[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]],
        [[0.0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]],
        [[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]],
        [[0.0, 76.59734589573222], [0.0, 2.65431523794604]],
    ]
    for matrix, numbers in zip((M, C1, K0, K2), printed, strict=True):
        np.testing.assert_allclose(matrix, numbers, rtol=0.0, atol=1e-14 * np.abs(numbers).max())


@pytest.mark.parametrize("speed", [float(v) for v in range(11)])
def test_eigenvalues(speed):
    """Weave, capsize and castering at every speed; all other eigenvalues are exactly zero.
    They are the place (x, y), heading, both wheels' angles, and the speed."""
    scene = dap.load("bicycle")
    scene.parameters |= {"v": speed, "lean_rate": 0.0}
    lin = dap.linearize(scene)
    assert np.sum(lin.eigenvalues == 0.0) == 6
    own = lin.eigenvalues[6:]
    for value in (*np.linalg.eigvals(system(speed)), *PRINTED.get(speed, ())):
        nearest = own[np.argmin(np.abs(own - value))]
        # the capsize eigenvalue near its zero at 6.02 m/s is the small difference of large terms
        assert abs(nearest - value) <= 1e-12 * max(abs(value), 1.0)
    assert lin.is_steady
    assert lin.stable == (4.3 < speed < 6.02)  # table 2: self-stable from 4.29 to 6.02 m/s


@pytest.mark.slow
@pytest.mark.parametrize("speed", [3.0, 5.0, 8.0])
def test_small_motions_follow_the_linear_equations(speed):
    """Lean and steer of a run; at 3 m/s they grow 30-fold, and their third power with them."""
    result = leaning(speed)
    start = np.array([0.0, 0.0, SMALL, 0.0])
    linear = np.array([expm(system(speed) * t) @ start for t in result.t])
    for k, name in enumerate(("lean", "steer")):
        values = result.quantity(name).values
        size = np.abs(linear[:, k]).max()
        np.testing.assert_allclose(values, linear[:, k], rtol=0.0, atol=10.0 * max(size, SMALL) ** 3
                                   + 1e-8 * size)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "grows"), [(3.0, True), (5.0, False)])
def test_growth_of_the_weave(speed, grows):
    """The rate of a run, seen along the left eigenvector of the weave, is its eigenvalue.
    Unstable below 4.29 m/s, stable up to 6.02 m/s."""
    result = leaning(speed)
    values, left = np.linalg.eig(system(speed).T)
    weave = int(np.argmax(np.where(values.imag > 0.0, values.real, -np.inf)))
    names = ("lean", "steer", "frame.w.x", "steer_rate")
    state = np.array([result.quantity(name).values for name in names])
    amplitude = left[:, weave] @ state
    found = np.log(amplitude[10] / amplitude[0]) / result.t[10]
    expected = values[weave]
    turns = np.round((expected.imag * result.t[10] - found.imag) / (2 * np.pi))
    found += 2j * np.pi * turns / result.t[10]
    assert abs(found - expected) < 1e-7 * abs(expected)  # of terms beside SMALL^2
    assert (found.real > 0.0) == grows
    assert np.all(np.linalg.eigvals(system(speed)).real < 0.0) == (not grows)
