"""Static equilibria against closed forms and equations of one coordinate.
Poses are exact to rounding: some units in the last place of the largest coordinate, through the
condition of the equations, which is below 100 in all these scenes (``ULP`` has both)."""

import math

import numpy as np
import pytest
from scipy.linalg import eigvals
from scipy.optimize import brentq
from support import at_rest
from support.at_rest import G

import dap3d_core as dap

#: Relative error of a pose: 100 times the spacing of floating-point numbers.
ULP = 100 * np.finfo(float).eps


def rods_of_catenary(n, span):
    """Mass centres (n, 2) and the horizontal force of n rods of 1 m and 1 kg over a span.
    A rod's middle carries V = (n - 1) / 2 - k weights, so tan(angle) = V / H with H in weights;
    the cosines add up to the span. One equation for H."""
    V = 0.5 * (n - 1) - np.arange(n)
    H = brentq(lambda H: np.sum(1 / np.hypot(1.0, V / H)) - span, 1e-3, 1e3, xtol=1e-15, rtol=1e-15)
    c, s = 1 / np.hypot(1.0, V / H), (V / H) / np.hypot(1.0, V / H)
    return np.stack([np.cumsum(c) - c / 2, -(np.cumsum(s) - s / 2)], axis=1), H * G


@pytest.mark.parametrize("n", [10, pytest.param(24, marks=pytest.mark.slow)])
def test_a_chain_hangs_as_a_catenary(n):
    """Positions and the horizontal force; 1e-12 of the span is 1000 units in the last place."""
    found = dap.equilibrium(at_rest.catenary(n, 0.8))
    expected, H = rods_of_catenary(n, 0.8 * n)
    assert np.max(np.abs(found.r[:, [0, 2]] - expected)) < 1e-12 * n
    assert abs(found.reaction("J0")["i"].force[0]) == pytest.approx(H, rel=1e-12)
    assert found.stable
    assert found.residual < 1e-13
    assert found.violation < n * ULP


@pytest.mark.parametrize(("angle", "side"), [(1.2, 1), (0.04, 1), (0.02, -1), (-1.2, -1)])
def test_a_bistable_linkage_settles_on_the_side_that_it_starts_on(angle, side):
    """The top between both valleys is at 0.0307 rad, by the weight."""
    crank = brentq(at_rest.toggle_moment, side * 0.5, side * 1.4, xtol=1e-15, rtol=1e-15)
    found = dap.equilibrium(at_rest.toggle(angle))
    assert found.r[0] == pytest.approx([math.cos(crank) / 2, 0, math.sin(crank) / 2], abs=ULP)
    assert found.stable
    assert found.residual < 1e-14


def test_the_top_between_both_valleys_is_an_unstable_equilibrium():
    """Started there; the other rods of the linkage have it exactly."""
    top = brentq(at_rest.toggle_moment, -0.3, 0.5, xtol=1e-15, rtol=1e-15)
    found = dap.equilibrium(at_rest.toggle(top))
    assert found.r[0] == pytest.approx([math.cos(top) / 2, 0, math.sin(top) / 2], abs=ULP)
    assert not found.stable
    assert "unstable" in found.notes[0]
    assert "rod" in found.notes[0]


@pytest.mark.parametrize(
    ("angle", "is_inverted"),
    [(0.0, False), (1e-6, False), (2.0, False), (math.pi - 1e-7, False), (math.pi, True),
     (math.pi - 1e-11, True)],
)  # fmt: skip
def test_a_pendulum_comes_to_hang_unless_it_starts_upright(angle, is_inverted):
    """There it stays, and is unstable."""
    found = dap.equilibrium(at_rest.pendulum(angle))
    assert found.r[0] == pytest.approx([0.0, 0.0, 1.0 if is_inverted else -1.0], abs=1e-15)
    assert found.stable is not is_inverted
    assert found.reaction("J1")["i"].force == pytest.approx([0.0, 0.0, 2 * G], abs=1e-13)
    assert ("unstable" in "".join(found.notes)) is is_inverted


def test_a_door_on_three_hinges_and_what_of_its_hinges_is_unique():
    """2 N m turn it by 0.4 rad; only the sum of the hinges' forces is known."""
    found = dap.equilibrium(at_rest.door())
    turn = 2 * math.atan2(found.p[0, 3], found.p[0, 0])
    assert turn == pytest.approx(0.4, rel=1e-14)
    total = sum(found.reaction(f"H{k}")["i"].force for k in range(3))
    assert total == pytest.approx([0, 0, 20 * G], abs=1e-12)
    assert found.redundancy.joints == ("H0", "H1", "H2")
    assert any("not unique" in note for note in found.notes)
    assert found.stable


@pytest.mark.parametrize("angle", [0.0, 1.0])
def test_a_parallelogram_falls_from_its_singular_pose(angle):
    """Flat, with all links in line, the rows lose rank there; it hangs straight down."""
    scene = dap.Scene(name="parallelogram")
    c, s = math.cos(angle), math.sin(angle)
    p = (math.cos(angle / 2), 0.0, -math.sin(angle / 2), 0.0)
    for name, x in (("left", 0.0), ("right", 2.0)):
        scene.add_body(name, mass=1.0, Jp=(0.01, 0.1, 0.1), r=(x + c / 2, 0, s / 2), p=p)
        scene.add_point(f"{name}_a", name, (-0.5, 0, 0))
        scene.add_point(f"{name}_b", name, (0.5, 0, 0))
    scene.add_body("top", mass=1.0, Jp=(0.01, 0.1, 0.1), r=(1 + c, 0, s))
    for name, x in (("left", -1.0), ("right", 1.0)):
        scene.add_point(f"{name}_top", "top", (x, 0, 0))
        scene.add_point(f"{name}_ground", "ground", (x + 1.0, 0, 0))
        for end, other, body in (("a", "ground", "ground"), ("b", "top", "top")):
            scene.add_joint("rev", P_i=f"{name}_{end}", P_j=f"{name}_{other}",
                            a_i=f"{name}.y", a_j=f"{body}.y")  # fmt: skip
    scene.add_force("weight")
    found = dap.equilibrium(scene)
    expected = [[0, 0, -0.5], [2, 0, -0.5], [1, 0, -1]]
    assert found.r == pytest.approx(np.array(expected), abs=ULP)
    assert found.stable


def reduced_ziegler(load, c):
    """M, C, K of the two angles of Ziegler's column about upright, both from the vertical.
    Rods of mass 1, length 1, J = 0.1 about their middles; springs 10, dampers c; a load along the
    upper rod does the virtual work load (angle 0 - angle 1) d(angle 0)."""
    M = np.array([[0.1 + 0.25 + 1.0, 0.5], [0.5, 0.1 + 0.25]])
    pair = np.array([[2.0, -1.0], [-1.0, 1.0]])
    K = 10.0 * pair - load * np.array([[1.0, -1.0], [0.0, 0.0]])
    return M, c * pair, K


@pytest.mark.parametrize("c", [0.0, 0.5])
@pytest.mark.parametrize(
    "load",
    [10.0, 22.0, *(pytest.param(x, marks=pytest.mark.slow) for x in (1.0, 16.0, 30.0, 60.0))],
)
def test_a_column_under_a_following_load_flutters(load, c):
    """Without a potential the growth rates of small motions decide (Ziegler 1952): dampers, too."""
    M, C, K = reduced_ziegler(load, c)
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, np.hstack([K, C]))]])
    growth = np.max(eigvals(A).real)
    found = dap.equilibrium(at_rest.ziegler(load, c))
    assert found.stable == (growth < 1e-6)
    assert any("without a potential" in note for note in found.notes)


def test_a_ball_between_pushing_springs_leaves_the_top_that_it_comes_to():
    """Started on the line of both it slides to their middle, which is a ridge, and off it.
    Springs of 3 m at +-2 m: rest is on the circle of radius sqrt(5) m about the line."""
    found = dap.equilibrium(at_rest.two_springs((0.3, 0.0, 0.0), 3.0))
    assert found.r[0, 0] == pytest.approx(0.0, abs=1e-14)
    assert math.hypot(*found.r[0, 1:]) == pytest.approx(math.sqrt(5), rel=1e-14)
    assert found.stable
    assert found.indifferent == 4  # along the circle, and three rotations
    assert any("one of two sides" in note for note in found.notes)


def test_springs_that_hold_each_other_are_at_rest():
    """No force but theirs, which cancel where the ball is: the size of forces is that nearby."""
    found = dap.equilibrium(at_rest.two_springs((0.0, 0.0, 0.0), 1.0))
    assert found.steps == 0
    assert found.stable
    moved = dap.equilibrium(at_rest.two_springs((0.3, 0.2, 0.1), 1.0))
    assert moved.r[0] == pytest.approx([0, 0, 0], abs=1e-15)


def test_a_soft_spring_lets_a_ball_sink_far():
    """9810 m of a scene of 1 m: not taken for a fall."""
    scene = at_rest.ball()
    scene.add_point("top", "ground", (0.0, 0.0, 1.0))
    scene.add_force("ptp", P_i="ball.O", P_j="top", k=1e-3, l0=1.0)
    assert dap.equilibrium(scene).r[0] == pytest.approx([0, 0, -9810.0], abs=9810 * ULP)


def across_a_spring():
    """A bead on a line across an unstretched spring: V is of fourth order."""
    scene = at_rest.ball(weight=False)
    scene.add_joint("tran", P_i="ball.O", P_j="ground.O", a_j="ground.z")
    scene.add_point("wall", "ground", (1.0, 0.0, 0.0))
    scene.add_force("ptp", P_i="ball.O", P_j="wall", k=100.0, l0=1.0)
    return scene


def balanced_lamp():
    """A spring of free length zero carries the rod at every angle: k h = m g (Carwardine 1932)."""
    scene = at_rest.pendulum(1.0)
    scene.add_point("hook", "ground", (0.0, 0.0, 0.5))
    scene.add_force("ptp", P_i="rod.O", P_j="hook", k=2 * G / 0.5, l0=0.0)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize(("make", "indifferent"), [(across_a_spring, 0), (balanced_lamp, 1)])
def test_without_first_order_stiffness_it_holds_or_is_indifferent(make, indifferent):
    found = dap.equilibrium(make())
    assert (found.stable, found.indifferent, found.steps) == (True, indifferent, 0)


@pytest.mark.slow
def test_a_spiral_spring_winds_up_over_turns_and_the_run_goes_on_with_them():
    """50 N m over 1 N m/rad; the run that starts there stays."""
    found = dap.equilibrium(at_rest.spiral())
    angle = found.state.angles["forces.spring.theta"]
    assert abs(angle) == pytest.approx(50.0, rel=1e-14)
    result = dap.simulate(at_rest.spiral(), start=found, t_end=0.5)
    assert np.max(np.abs(result.w)) < 1e-12
    assert result.arrays.angles[-1, 0] == pytest.approx(angle, rel=1e-14)
    assert any("turns" in note for note in found.scene().notes)
