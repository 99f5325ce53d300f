"""Starts at poses where constraints lose rank, against closed forms of each branch."""

import numpy as np
import pytest
from support import redundant, singular

import dap3d_core as dap

#: Moments of inertia, kg m^2, about the posts and of the coupler; its mass is 1 kg.
CRANK, COUPLER = 0.1 + 0.25, 0.1


def crossed(alpha):
    """(gamma, d gamma / d alpha) of the crossed parallelogram, crank 1, frame 2:
    tan(gamma / 2) = -3 tan(alpha / 2), with (2 + 1) / (2 - 1) = 3."""
    tangent = np.tan(alpha / 2)
    return -2 * np.arctan(3 * tangent), -3 * (1 + tangent**2) / (1 + 9 * tangent**2)


def crossed_inertia(alpha):
    """2 T / alpha_dot^2 of the crossed parallelogram."""
    gamma, rate = crossed(alpha)
    P, Q = np.exp(1j * alpha), 2 + np.exp(1j * gamma)
    P_dot, Q_dot = 1j * np.exp(1j * alpha), 1j * np.exp(1j * gamma) * rate
    turn = np.imag((Q_dot - P_dot) / (Q - P))
    return CRANK * (1 + rate**2) + abs((P_dot + Q_dot) / 2) ** 2 + COUPLER * turn**2


def angle(result, body):
    """Angle about y of a crank, rad: its centre is half a metre from its post."""
    place = 2.0 * (result.r[:, body] - (0.0 if body == 0 else np.array([2.0, 0.0, 0.0])))
    return np.arctan2(-place[:, 2], place[:, 0])


@pytest.mark.parametrize("rtol", [1e-5, 1e-8, 1e-10])
@pytest.mark.parametrize("start", [0.0, 1.0])
def test_a_flat_parallelogram_stays_one(start, rtol):
    """At rest, or with the cranks' velocities: w = w0 + t / (2 J + m l^2), from the first instant.
    Errors of a step are rtol of a part of the motion; rounding over the square of the distance,
    some 1e-16 / 1e-6, is what the first step leaves at tighter ones."""
    scene = singular.flat_parallelogram((start, 0.0, start))
    result = dap.simulate(scene, t_end=1.0, dt=0.05, rtol=rtol, atol=rtol / 100)
    rise = 1.0 / (2 * CRANK + 1.0)
    expected = np.column_stack([start + rise * result.t, 0 * result.t, start + rise * result.t])
    assert result.w[:, :, 1] == pytest.approx(expected, abs=max(10 * rtol, 2e-9))
    assert result.wd[0, :, 1] == pytest.approx([rise, 0.0, rise], abs=1e-9)
    assert all(entry.ok is not False for entry in result.ledger.values())


def test_at_rest_both_branches_are_named():
    """The note says that the pose is singular, why this branch is taken, and gives both."""
    result = dap.simulate(singular.flat_parallelogram(), t_end=0.5)
    (note,) = (n for n in result.notes if "singular pose" in n)
    assert "least (Gauss)" in note
    assert "(1) a r_dot = [0, 0, -0.5], w = [0, 1, 0]; b r_dot = [0, 0, -1]" in note
    assert "(2) a r_dot = [0, 0, 0.166667], w = [0, -0.333333, 0]" in note


@pytest.mark.parametrize("speed", [1.0, 1e-6])
def test_velocities_choose_the_other_branch(speed):
    """The crossed parallelogram, also where they are as small as to choose and no more: its
    angles, and w^2 J(alpha) = 2 M alpha + w0^2 J(0)."""
    scene = singular.flat_parallelogram((speed, -2 * speed, -3 * speed))
    result = dap.simulate(scene, t_end=0.8, dt=0.05)
    alpha, gamma = angle(result, 0), angle(result, 2)
    assert gamma == pytest.approx(crossed(alpha)[0], abs=1e-7)
    expected = (2 * alpha + speed**2 * crossed_inertia(0.0)) / crossed_inertia(alpha)
    assert result.w[:, 0, 1] ** 2 == pytest.approx(expected, abs=1e-6)
    assert result.wd[0, 0, 1] == pytest.approx(1 / crossed_inertia(0.0), rel=1e-7)


def test_velocities_on_no_branch_are_refused():
    """With those of both to choose from."""
    with pytest.raises(dap.SimulationError, match="along none of the motions") as caught:
        dap.simulate(singular.flat_parallelogram((1.0, 0.0, 0.0)), t_end=1.0)
    assert "(1) a r_dot" in str(caught.value)
    assert "(2) a r_dot" in str(caught.value)


FLAT = singular.flat_parallelogram


@pytest.mark.parametrize(
    ("make", "settings", "words"),
    [
        # methods that use rates close to the pose; a run that ends within a first step
        *((FLAT, settings, r"starts at a singular pose, .* dop853 alone|t_end of") for settings in (
            {"integrator": "radau"}, {"step": 0.01}, {"project": False}, {"t_end": 0.01})),
        # rods in line between posts: nothing moves, and no finite force holds the weight
        (singular.strut, {}, "no motion leads from there"),
        # turned by equal angles the axles of two wheels do not meet in one point
        (singular.car, {"t_end": 2.0}, r"tyre_fl.*tyre_fr contradict each other"),
    ],
)  # fmt: skip
def test_what_cannot_leave_a_singular_pose_says_so(make, settings, words):
    with pytest.raises(dap.SimulationError, match=words):
        dap.simulate(make(), **{"t_end": 1.0} | settings)


@pytest.mark.parametrize("size", [1e-3, 1.0])
def test_units_do_not_decide_what_is_singular(size):
    """A crank of 1 m, in km too."""
    assert dap.compile(singular.flat_parallelogram(size=size)).redundancy().singular is not None


@pytest.mark.parametrize(
    "scene",
    [redundant.bricard, redundant.hinged_door, lambda: redundant.four_bars(2), singular.car],
)
def test_redundant_rows_alone_are_not_singular(scene):
    """Rows that depend on each other everywhere, those of velocities among them."""
    redundancy = dap.compile(scene()).redundancy()
    assert redundancy.rank.redundant > 0
    assert redundancy.singular is None


@pytest.mark.parametrize("rtol", [1e-5, 1e-6, 1e-7, 1e-8, 1e-9])
def test_a_slider_goes_through_its_dead_centre(rtol):
    """Also where that instant is reported: cos phi = (x^2 - 3) / (2 x), phi changes its sign.
    All places are prescribed, so that projection leaves rounding over the distance; at the instant
    itself, where rows say nothing of phi, it is known to the root of it or of rtol."""
    result = dap.simulate(singular.dead_centre(), t_end=2.0, dt=0.02, rtol=rtol, atol=rtol / 100)
    angle = redundant.dead_centre_angle(result.t)
    expected = np.column_stack([np.cos(angle), np.sin(angle)])
    found = 2.0 * result.r[:, 0, :2]
    away = np.abs(result.t - 1.0) > 0.01
    assert found[away] == pytest.approx(expected[away], abs=1e-9)
    assert found[~away] == pytest.approx(expected[~away], abs=1e-3)


@pytest.mark.slow
def test_a_hand_that_is_pulled_too_far_is_named():
    """At 2 m: the driver, its function, the value and the time, and who cannot follow."""
    with pytest.raises(dap.SimulationError) as caught:
        dap.simulate(singular.arm(), t_end=5.0)
    words = str(caught.value)
    assert "from t = 3.7 s on joints A, B cannot follow" in words
    assert "what joint hand_x (function pull: 2) asks for is out of reach" in words
    assert caught.value.result.t[-1] == pytest.approx(3.7, abs=0.06)


@pytest.mark.slow
def test_drivers_that_come_to_disagree_are_named():
    """Both turn one crank, by t and by sin t: as fast and as little accelerated at the start."""
    scene = dap.Scene(name="two drivers")
    scene.add_body("crank", mass=1.0, Jp=(0.1, 0.1, 0.1))
    scene.add_joint("rev", "pin", P_i="crank.O", P_j="ground.O", a_i="crank.z", a_j="ground.z")
    scene.add_function("a", "even", coeff=(0.0, 1.0, 0.0))
    scene.add_function("harmonic", "wave", amplitude=1.0, frequency=1.0)
    for name in ("even", "wave"):
        scene.add_joint("drive-rot", f"drive_{name}", body_i="crank", a_j="ground.z",
                        function=name)  # fmt: skip
    with pytest.raises(
        dap.SimulationError,
        match=r"no motion has both: what joint drive_even .* and joint drive_wave .* ask for",
    ):
        dap.simulate(scene, t_end=2.0)
