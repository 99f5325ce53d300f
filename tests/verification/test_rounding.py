"""What double precision leaves open: runs go on at rounding, and the ledger knows its size."""

import copy
import sys

import attrs
import numpy as np
import pytest
from support import redundant, singular
from support.process import REPOSITORY
from support.rotations import rotation
from support.stewart import stewart

import dap3d_core as dap

sys.path.append(str(REPOSITORY / "benchmarks"))

from hard import scenes
from hard.scales import SCALES


@pytest.fixture(scope="module")
def pressed():
    """1e8 N on a platform of 1 g: reactions of 2e9 N, accelerations of 3 m/s^2."""
    return dap.simulate(stewart(1e-3, 1.0, 1e8), t_end=0.1, dt=0.02, method="lsq")


def test_rounding_of_large_reactions_is_no_wrong_acceleration(pressed):
    """1e9 N known to 16 digits move 1 g by 1e-4 m/s^2. All motion is prescribed: accelerations are
    those under no load, which standard solves for to 1e-15."""
    entry = pressed.ledger["acceleration"]
    assert entry.ok, entry
    free = dap.simulate(stewart(1e-3, 1.0, 0.0), t_end=0.1, dt=0.02, method="standard")
    np.testing.assert_allclose(pressed.v_dot[:, :6], free.v_dot[:, :6], atol=1e-4)


@pytest.mark.parametrize("row", [0, 40, 71])
def test_a_multiplier_that_is_off_by_a_millionth_is_found(pressed, row):
    """Accelerations change by M^-1 D^T of the change; the ledger is given the residual of that."""
    summary, k = pressed.summary, 2
    D, change = pressed.Jac[k], np.zeros(summary.row_count)
    change[row] = 1e-6 * np.abs(pressed.arrays.Lam[k]).max()
    force = D.T @ change
    moved = np.zeros_like(force)
    for b, mass in enumerate(summary.mass):
        A = rotation(pressed.p[k, b])
        moved[6 * b : 6 * b + 3] = force[6 * b : 6 * b + 3] / mass
        moved[6 * b + 3 : 6 * b + 6] = np.linalg.solve(
            A @ summary.Jp[b] @ A.T, force[6 * b + 3 : 6 * b + 6]
        )
    residual = np.array(pressed.arrays.acceleration_residual)
    residual[k] = np.abs(D @ moved).max()
    changed = copy.copy(pressed)
    changed.arrays = attrs.evolve(pressed.arrays, acceleration_residual=residual)
    assert changed.ledger["acceleration"].ok is False


def test_lsq_solves_for_a_light_platform_on_heavy_legs():
    """Legs of 10 t move 1 g: three passes leave 1e-2 of the accelerations, which are prescribed."""
    heavy, light = (
        dap.simulate(stewart(1e-3, leg, 0.0), t_end=0.1, dt=0.02, method=method)
        for leg, method in ((1e4, "lsq"), (1.0, "standard"))
    )
    np.testing.assert_allclose(heavy.v_dot, light.v_dot, rtol=1e-6, atol=1e-6)
    assert heavy.ledger["acceleration"].ok


@pytest.mark.parametrize("rtol", [1e-9, 1e-10])
def test_radau_leaves_a_pose_that_is_singular_in_two_ways(rtol):
    """Pivots go to zero as the square of the way, and the iteration stalls at rounding behind."""
    result = dap.simulate(
        singular.dead_centre(), t_end=2.0, dt=0.02, integrator="radau", rtol=rtol, atol=rtol / 100
    )
    cosine = np.cos(redundant.dead_centre_angle(result.t))
    away = np.abs(result.t - 1.0) > 0.01
    assert 2.0 * result.r[away, 0, 0] == pytest.approx(cosine[away], abs=1e-9)


def driven_parallelogram():
    """Cranks of 1 m, 2 m apart, on spatial revolutes; the first is turned by 1 rad/s."""
    scene = dap.Scene(name="driven parallelogram")
    for name, at, half in (
        ("c0", [0.0, 0.5], 0.5),
        ("c1", [2.0, 0.5], 0.5),
        ("k", [1.0, 1.0], 1.0),
    ):
        crank = half == 0.5
        p = [-0.5, 0.5, 0.5, -0.5] if crank else [np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]
        inertia, speed = half**2 / 3.0, 0.5 if crank else 1.0
        scene.add_body(name, mass=1.0, Jp=[1e-3, inertia, inertia], r=[*at, 0.0], p=p,
                       r_dot=[speed, 0.0, 0.0], w=[0.0, 0.0, -1.0 * crank])  # fmt: skip
        scene.add_point(f"{name}_P", name, (-half, 0.0, 0.0))
        scene.add_point(f"{name}_Q", name, (half, 0.0, 0.0))
        scene.add_vector(f"z_{name}", body=name, sp=[0.0, -1.0 if crank else 1.0, 0.0])
    scene.add_point("foot", "ground", (2.0, 0.0, 0.0))
    for name, i, j, a_j in (
        ("p0", "c0_P", "ground.O", "ground.z"),
        ("p1", "c1_P", "foot", "ground.z"),
        ("l", "k_P", "c0_Q", "z_c0"),
        ("r", "k_Q", "c1_Q", "z_c1"),
    ):
        scene.add_joint("rev", name, P_i=i, P_j=j, a_i=f"z_{i[:-2]}", a_j=a_j)
    scene.add_function("a", "turn", coeff=[0.0, -1.0, 0.0])
    scene.add_joint(
        "drive-rot", "motor", body_i="c0", body_j="ground", a_j="ground.z", function="turn"
    )
    scene.add_force("weight", "weight", wgt=[0.0, -1.0, 0.0])
    return scene


@pytest.mark.slow
def test_radau_is_not_held_up_by_multipliers_that_have_yet_to_settle():
    """Behind a crossing those of redundant rows change by much, the motion hardly: with the norm of
    states alone steps were halved until ten times as many were taken as at ten times the tolerance.
    The crank turns by 1 rad/s, and the other link with it."""

    wide, close = (
        dap.simulate(driven_parallelogram(), t_end=6.0, dt=0.1, integrator="radau", rtol=rtol,
                     atol=rtol / 100, estimate_error=False)
        for rtol in (1e-8, 1e-9)
    )  # fmt: skip
    assert close.stats.steps < 2.5 * wide.stats.steps
    expected = 0.5 * np.column_stack([np.sin(close.t), np.cos(close.t)])
    np.testing.assert_allclose(close.r[:, 1, :2] - [2.0, 0.0], expected, atol=1e-8)


@pytest.mark.slow
def test_radau_takes_multipliers_as_known_to_their_last_digits():
    """Steps of 1e9 kg on a rod of 1 kg are those of 100 kg, whatever rounding 1e10 N have, but for
    the higher orders, which need more digits of multipliers than there are; the motion is that of
    the closed pendulum, within what the case allows."""
    heavy, light = (
        dap.simulate(scenes.heavy_bob(ratio), t_end=5.0, dt=0.05, integrator="radau")
        for ratio in (1e9, 1e2)
    )
    assert heavy.stats.steps < 3.0 * light.stats.steps
    case = next(case for case in SCALES if case.name == "heavy on light")
    assert case.error(heavy) < 1e-5


@pytest.mark.parametrize(("integrator", "rtol"), [("dop853", 1e-3), ("dopri5", 1e-2)])
def test_what_a_projection_moves_is_no_rounding(integrator, rtol):
    """A free wheel at a loose tolerance: projection moves its Euler parameters by as much, which
    was taken for the rounding of their rates. Smaller tolerances do change its accuracy."""
    scene = dap.Scene(name="wheel")
    scene.add_body("b", mass=1.0, Jp=(0.01, 0.01, 0.02), w=(0.0, 0.0, 10.0))
    result = dap.simulate(scene, t_end=50.0, dt=2.5, integrator=integrator, rtol=rtol, atol=rtol)
    assert not [note for note in result.notes if "rounding" in note]
