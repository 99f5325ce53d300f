"""The balance of forces at a pose: closing, stiffness, displacements."""

import numpy as np
import pytest
from scipy.optimize import brentq
from support import at_rest
from support.mechanisms import rough_four_bar
from support.own_types import registry_of
from support.plain import long_in_plain_python
from support.state_types import ZERO

import dap3d_core as dap
from dap3d_core.interface import Body, Force, body, number
from dap3d_core.model import state_layout
from dap3d_core.simulation.equilibrium import statics as module


def statics_of(scene):
    evaluator = dap.compile(scene).evaluator
    evaluator.start(0.0, evaluator.model.u0)
    return module.Statics(evaluator), state_layout.at_rest(evaluator.model.u0)


def test_positions_are_closed_to_rounding():
    statics, u = statics_of(rough_four_bar())
    closed = statics.closed(u)
    C = statics.evaluator.rows(0.0, closed).C
    assert np.max(np.abs(C)) < 1e-15 * 20  # coordinates up to 4 m


def test_the_residual_is_what_no_reaction_carries():
    """Of a pendulum at 1 rad the moment m g l sin(1) about its hinge, in one freedom."""
    statics, u = statics_of(at_rest.pendulum(1.0))
    pose = statics.at(u)
    # the freedom turns the rod by a part a, and moves its mass centre by a l: a^2 (1 + l^2/L^2) = 1
    a = 1 / np.sqrt(1 + 1 / statics.length**2)
    moment = 2.0 * at_rest.G * np.sin(1.0)
    assert np.abs(pose.unbalanced) == pytest.approx([moment * a], rel=1e-13)


def test_stiffness_is_the_derivative_of_what_is_unbalanced():
    """By central differences; h = 1e-5 leaves 1e-10 of truncation and of rounding errors."""
    statics, u = statics_of(at_rest.toggle(0.7))
    pose, h = statics.at(statics.closed(u)), 1e-5
    x = pose.free[:, 0]
    ahead, behind = (statics.balance(statics.moved(pose.u, k * h * x), pose) for k in (1, -1))
    slope = pose.free.T @ (behind - ahead) / (2 * h)
    assert statics.stiffness(pose)[:, 0] == pytest.approx(slope, rel=1e-8)


def test_displacements_are_found_back():
    """Of a retraction p + L^T dtheta / 2 the rotation is 2 atan(|dtheta| / 2)."""
    statics, u = statics_of(at_rest.toggle(0.7))
    x = np.random.default_rng(1).normal(size=18).reshape(3, 6)
    shift, turn = module.displacement(u, statics.moved(u, x.ravel()))
    angle = np.linalg.norm(x[:, 3:], axis=1, keepdims=True)
    assert shift == pytest.approx(statics.length * x[:, :3], rel=1e-12)
    assert turn == pytest.approx(x[:, 3:] / angle * 2 * np.arctan(angle / 2), rel=1e-12)


#: A mass of 2 kg hangs below a solid of stiffness 100 N/m, or is held at a height.
WEIGHT = 2.0 * 9.81


class Held(Force):
    """f = gain e + integral z - damping v, z_dot = e, e = target - height of body i."""

    keyword, states = "test-held", ("z",)
    body_i: Body = body()
    gain: float = number()
    integral: float = number()
    damping: float = number(20.0)
    target: float = number(0.3)

    def rate(r_i, target):
        return target - r_i[2]

    def wrench(r_i, v_i, z, gain, integral, damping, target):
        return (0.0, 0.0, gain * (target - r_i[2]) + integral * z - damping * v_i[2]), ZERO


class Growing(Held):
    """A state that grows without end."""

    keyword = "test-growing"

    def rate():
        return 1.0


REGISTRY = registry_of(Held, Growing)


def hanging(**fields):
    scene = dap.Scene(name="hanging")
    scene.add_body("bob", mass=2.0, Jp=(1.0, 1.0, 1.0), r=(0.1, 0.0, -1.0))
    scene.add_force("weight", "gravity")
    scene.add_force("maxwell", "solid", P_i="bob.O", P_j="ground.O", k=50.0, c=3.0, k_p=100.0,
                    l0=1.0, z_0=0.3, **fields)  # fmt: skip
    return scene


def held(keyword="test-held", **fields):
    scene = dap.Scene(name="held")
    scene.add_body("bob", mass=2.0, Jp=(1.0, 1.0, 1.0), r=(0.0, 0.0, -1.0))
    scene.add_force("weight", "gravity")
    scene.add_force(keyword, "servo", body_i="bob", gain=50.0, integral=10.0, **fields)
    return dap.compile(scene, registry=REGISTRY)


@pytest.mark.slow
@long_in_plain_python
def test_a_solid_has_its_slow_stiffness():
    """The damper has crept: x = z = m g / k_p; a run from there stays."""
    eq = dap.equilibrium(hanging())
    assert eq.r[0] == pytest.approx((0.0, 0.0, -1.0 - WEIGHT / 100.0), abs=1e-12)
    assert eq.states == pytest.approx([WEIGHT / 100.0], abs=1e-12)
    assert eq.stable
    result = dap.simulate(hanging(), start=eq, t_end=0.5, dt=0.1)
    assert np.ptp(result.quantity("bob.r.z").values) < 1e-12
    assert eq.scene().forces["solid"].fields["z_0"] == pytest.approx(WEIGHT / 100.0)
    assert result.quantity("solid.z").values == pytest.approx(WEIGHT / 100.0, abs=1e-12)


@pytest.mark.slow
@long_in_plain_python
def test_what_integrates_its_error_finds_the_pose():
    """e = 0 and integral z = m g; slow enough it is stable, with a negative damper it is not."""
    eq = dap.equilibrium(held())
    assert eq.r[0] == pytest.approx((0.0, 0.0, 0.3), abs=1e-12)
    assert eq.states == pytest.approx([WEIGHT / 10.0], rel=1e-12)
    assert eq.stable
    assert not dap.equilibrium(held(damping=-0.1)).stable


def test_bristles_at_rest_stay_bent():
    """A rate that is zero at rest leaves the state as it was, and its force with it; a pose that
    only a slide leads to is refused, for the slide would bend them."""
    scene = dap.Scene(name="stuck")
    scene.add_body("block", mass=2.0, Jp=(1.0, 1.0, 1.0), r=(1e4 * 1e-4 / 100.0, 0.0, 0.0))
    law = {"f_n": 20.0, "mu_c": 0.3, "mu_s": 0.5, "v_s": 0.05, "sigma_0": 1e4}
    scene.add_force("lugre", "floor", P_i="block.O", a_j="ground.x", z_0=-1e-4, **law)
    scene.add_point("wall", "ground", (-1.0, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="block.O", P_j="wall", k=100.0, l0=1.0)
    eq = dap.equilibrium(scene)
    assert eq.states == pytest.approx([-1e-4])
    assert eq.r[0, 0] == pytest.approx(1e4 * 1e-4 / 100.0, abs=1e-12)
    scene.bodies["block"].r = (0.02, 0.0, 0.0)
    statics, u = statics_of(scene)  # the stiffness of the search is that of the spring alone
    K = statics.stiffness(statics.at(u))
    assert np.max(np.abs(np.linalg.eigvals(K))) == pytest.approx(100.0 * statics.length**2)
    with pytest.raises(dap.SimulationError, match=r"floor\.z .* keeps the way of the motion"):
        dap.equilibrium(scene)


def rod(**fields):
    """A rod of 2 kg on a hinge about y, level at first, held by a tendon with an arm of 0.3 m."""
    scene = dap.Scene(name="rod")
    scene.add_body("rod", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(0.5, 0.0, 0.0), **fields)
    scene.add_point("pin", "rod", (-0.5, 0.0, 0.0))
    scene.add_joint("rev", "hinge", P_i="pin", P_j="ground.O", a_i="rod.y", a_j="ground.y")
    scene.add_force("weight", "gravity")
    scene.add_force("joint_tendon", "tendon", movers=["rod"], holders=["ground"],
                    axes=["ground.y"], coefs=[0.3], k=200.0, c=30.0)  # fmt: skip
    return scene


@pytest.mark.slow
@long_in_plain_python
def test_what_keeps_the_way_of_a_motion_is_refused():
    """The length of a tendon on joints is a state. Held as at the start it pulled nowhere, and the
    rod hung straight down, "stable". From the end of a damped run the pose is that of
    m g / 2 cos(q) = k c^2 q, and the tendon's stiffness counts; along a path it is refused, too."""
    with pytest.raises(dap.SimulationError, match=r"does not know tendon\.x where forces balance"):
        dap.equilibrium(rod())
    end = dap.simulate(rod(), t_end=60.0, dt=60.0)
    eq = dap.equilibrium(rod(), start=end)
    q = brentq(lambda q: WEIGHT / 2.0 * np.cos(q) - 200.0 * 0.3**2 * q, 0.0, 1.0)
    assert eq.r[0] == pytest.approx((np.cos(q) / 2.0, 0.0, -np.sin(q) / 2.0), abs=1e-9)
    assert eq.stable
    with pytest.raises(dap.SimulationError, match=r"does not know tendon\.x where forces balance"):
        dap.equilibrium_path(eq.scene(), "bodies.rod.mass", [2.0, 3.0])


@long_in_plain_python
def test_tendons_hold_what_would_fall():
    """Two that pull against each other hold a rod upright, at rest as it is, where their stiffness
    2 k c^2 is above m g / 2."""
    for k, stable in ((70.0, True), (50.0, False)):
        scene = rod()
        scene.bodies["rod"].r, scene.bodies["rod"].p = (0, 0, 0.5), (0.5**0.5, 0, -(0.5**0.5), 0)
        del scene.forces["tendon"]
        for sign in (1.0, -1.0):
            scene.add_force("joint_tendon", movers=["rod"], holders=["ground"], axes=["ground.y"],
                            coefs=[sign * 0.3], k=k, length=-0.1)  # fmt: skip
        assert dap.equilibrium(scene).stable is stable


def test_a_motor_on_its_way_is_refused():
    """A position that is set is not where the scene stands: its pace was given as one at rest."""
    scene = rod()
    del scene.forces["tendon"]
    scene.add_input("angle", 0.5)
    scene.add_joint("motor", "motor", joint="hinge", position="angle", lag=0.1)
    with pytest.raises(dap.SimulationError, match="motor moves bodies to another position"):
        dap.equilibrium(scene)
    scene.inputs["angle"].value = 0.0
    eq = dap.equilibrium(scene)
    assert eq.reaction("motor")["i"].moment == pytest.approx((0.0, -WEIGHT / 2.0, 0.0), abs=1e-9)


@pytest.mark.slow
def test_a_state_that_never_rests_is_refused():
    """By its name."""
    with pytest.raises(dap.SimulationError, match=r"the rate of servo\.z vanishes neither"):
        dap.equilibrium(held("test-growing"))


@long_in_plain_python
def test_a_run_may_begin_at_rest():
    """The setting start = "equilibrium" has the states, too."""
    scene = hanging()
    scene.simulation.start = "equilibrium"
    result = dap.simulate(scene, t_end=0.2, dt=0.1)
    assert result.quantity("solid.z").values == pytest.approx(WEIGHT / 100.0, abs=1e-12)


def test_runs_start_from_the_states_of_results():
    """At a reported instant exactly; between two by a cubic."""
    first = dap.simulate(hanging(), t_end=1.0, dt=0.01, rtol=1e-10)
    later = dap.simulate(hanging(), start=(first, 0.5), t_end=0.5, dt=0.1, rtol=1e-10)
    want = first.quantity("solid.z").values[50::10]
    assert later.quantity("solid.z").values[0] == want[0]
    assert later.quantity("solid.z").values == pytest.approx(want, abs=1e-8)
    between = dap.simulate(hanging(), start=(first, 0.505), t_end=0.1, dt=0.1)
    near = first.quantity("solid.z").values[49:53]
    assert between.quantity("solid.z").values[0] == pytest.approx(
        (-near[0] + 9.0 * near[1] + 9.0 * near[2] - near[3]) / 16.0, abs=1e-12
    )
