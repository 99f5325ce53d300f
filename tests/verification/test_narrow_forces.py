"""Functions of an argument that act over less than a step goes by: no step passes over them.
References are integrals over the way: a body that is braked by F(x) leaves with v^2 = 1 - 2 W /
m."""

import numpy as np
import pytest
from scipy.integrate import quad
from support.contact import contact_registry
from support.own_types import registry_of

import dap3d_core as dap
from dap3d_core.interface import Body, Force, Function, body, number
from dap3d_core.kernels import where

TIGHT = {"rtol": 1e-10, "atol": 1e-12}
START, WIDTH, DEPTH = 5.0, 0.1, -0.6


def bump(x):
    """f (N) of the functions of type b below: up at START, down again a WIDTH later."""
    u = np.clip((x - START) / (0.5 * WIDTH), 0.0, 1.0)
    v = np.clip((x - START - 0.5 * WIDTH) / (0.5 * WIDTH), 0.0, 1.0)
    step = [10.0 * w**3 - 15.0 * w**4 + 6.0 * w**5 for w in (u, v)]
    return DEPTH * (step[0] - step[1])


def two_steps(scene):
    """The bump as functions up and down."""
    half = 0.5 * WIDTH
    scene.add_function("b", "up", x_start=START, x_end=START + half, f_end=DEPTH)
    scene.add_function("b", "down", x_start=START + half, x_end=START + WIDTH, f_end=-DEPTH)


def passing():
    """Speed behind the bump, and the time that a unit mass at unit speed takes to pass it."""
    work, _ = quad(bump, START, START + WIDTH, points=[START + 0.5 * WIDTH], epsabs=1e-15)

    def slowness(x):
        done, _ = quad(bump, x, START + WIDTH, points=[START + 0.5 * WIDTH], epsabs=1e-15)
        return 1.0 / np.sqrt(1.0 + 2.0 * done)

    time, _ = quad(slowness, START, START + WIDTH, points=[START + 0.5 * WIDTH], epsabs=1e-13)
    return np.sqrt(1.0 + 2.0 * work), time


def flight():
    """A body that flies at 1 m/s from 10 m towards the place of a force, and past it."""
    scene = dap.Scene(name="flight")
    scene.add_body("m", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(10.0, 0.0, 0.0), r_dot=(-1.0, 0.0, 0.0))
    two_steps(scene)
    for name in ("up", "down"):
        scene.add_force("ptp", name, P_i="m.O", P_j="ground.O", l0=0.0, function=name)
    return scene


@pytest.mark.parametrize(
    ("settings", "tolerance"),
    [
        ({"integrator": "dop853", **TIGHT}, 1e-9),
        ({"integrator": "dopri5", **TIGHT}, 1e-9),
        ({"integrator": "auto", **TIGHT}, 1e-9),
        pytest.param({"integrator": "adams", **TIGHT}, 1e-8, marks=pytest.mark.slow),
        pytest.param({"integrator": "radau", **TIGHT}, 1e-8, marks=pytest.mark.slow),
        # as long as the bump, cut at its knots: one step of 0.05 m each, error of order h^8
        ({"integrator": "dop853", "step": 0.1}, 1e-4),
        # five steps of order 4 over each half
        ({"integrator": "rk4", "step": 0.01}, 1e-4),
    ],
)
def test_a_force_in_a_narrow_place_is_not_stepped_over(settings, tolerance):
    """Steps of free flight are some metres long, the force acts over 0.1 m."""
    speed, time = passing()
    result = dap.simulate(flight(), t_end=9.0, dt=0.5, **settings)
    assert result.rd[-1, 0, 0] == pytest.approx(-speed, abs=tolerance)
    x = START - speed * (9.0 - (5.0 - WIDTH) - time)
    assert result.r[-1, 0, 0] == pytest.approx(x, abs=5.0 * tolerance)
    assert not result.events  # nobody asked for these instants


def test_the_estimated_error_sees_the_force():
    speed, _ = passing()
    result = dap.simulate(flight(), t_end=9.0, dt=0.5, rtol=1e-6, atol=1e-8, estimate_error=True)
    error = abs(result.rd[-1, 0, 0] + speed)
    assert 0.1 * error <= result.error.rd[-1, 0, 0] <= 100.0 * max(error, 1e-9)


@pytest.mark.parametrize("turns", [False, True])
def test_a_moment_at_a_narrow_angle_is_not_stepped_over(turns):
    """A wheel at 1 rad/s passes the angle 2 rad; with whole turns counted also 5 rad."""
    place = START if turns else 2.0
    scene = dap.Scene(name="wheel")
    scene.add_body("wheel", mass=1.0, Jp=(1.0, 1.0, 1.0), w=(0.0, 0.0, -1.0))
    for name, x, end in (("up", 0.0, DEPTH), ("down", 0.5 * WIDTH, -DEPTH)):
        span = {"x_start": place + x, "x_end": place + x + 0.5 * WIDTH}
        scene.add_function("b", name, f_end=end, **span)
        scene.add_force("rot_sda", name, v_i="wheel.x", v_j="ground.x", axis="ground.z",
                        function=name, turns=turns)  # fmt: skip
    speed, _ = passing()  # here f drives, with the work that it takes above
    result = dap.simulate(scene, t_end=place + 1.0, **TIGHT)
    work = 0.5 * (1.0 - speed**2)
    assert result.w[-1, 0, 2] == pytest.approx(-np.sqrt(1.0 + 2.0 * work), abs=1e-9)


def test_rest_on_a_knot_is_no_chatter():
    """A mass circles at the very length at which a function begins: to rounding it is there."""
    steps = []
    for function in (None, "f"):
        scene = dap.Scene(name="circle")
        scene.add_body("m", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(1.0, 0.0, 0.0), r_dot=(0.0, 2.0, 0.0))
        scene.add_force("ptp", "spring", P_i="m.O", P_j="ground.O", k=40.0, l0=0.9)
        if function:
            scene.add_function("b", "f", x_start=0.0, x_end=0.1, f_end=1.0)
            scene.add_force("ptp", "rope", P_i="m.O", P_j="ground.O", l0=1.0, function="f")
        result = dap.simulate(scene, t_end=30.0)
        steps.append(result.stats.steps)
        np.testing.assert_allclose(np.linalg.norm(result.r[:, 0], axis=1), 1.0, atol=1e-6)
    assert steps[1] <= 1.2 * steps[0]


def test_scenes_without_such_functions_watch_nothing():
    for function in (
        None,
        dict(type="a", coeff=(0.0, 1.0, 0.0)),
        dict(type="harmonic", frequency=2),
    ):
        scene = dap.Scene(name="plain")
        scene.add_body("m", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(1.0, 0.0, 0.0))
        given = {}
        if function:
            scene.add_function(function.pop("type"), "f", **function)
            given = {"function": "f"}
        scene.add_force("ptp", "spring", P_i="m.O", P_j="ground.O", k=1.0, l0=0.5, **given)
        evaluator = dap.compile(scene).evaluator
        assert evaluator.switches == ()
        assert not any(kind == "knot" for kind, _ in evaluator.loop_groups)


class Untold(Function):
    """A bump that its author has not told of."""

    keyword = "test-untold"
    centre: float = number(default=0.0)

    def value(x, centre):
        u = (x - centre) * (x - centre)
        return 1.0 / (1.0 + 1e6 * u), 0.0, 0.0, 0.0


class Told(Untold):
    keyword = "test-told"

    def breaks(self):
        return self.centre - 0.01, self.centre + 0.01


class Wall(Force):
    """A push behind a wall, whose author has not told where the law changes."""

    keyword = "test-wall"
    body_i: Body = body()

    def wrench(r_i):
        return (((where(r_i[0] < 0.0, 1.0, 0.0), 0.0, 0.0), (0.0, 0.0, 0.0)),)


def test_what_types_do_not_tell_is_noted():
    """Of functions of an argument without breaks, and of laws with branches without a switch."""
    registry = registry_of(Untold, Told, Wall)
    for keyword, noted in (("test-untold", True), ("test-told", False)):
        scene = dap.Scene(name="untold")
        scene.add_body("m", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(1.0, 0.0, 0.0))
        scene.add_function(keyword, "f", centre=0.2)
        scene.add_force("ptp", "spring", P_i="m.O", P_j="ground.O", function="f")
        notes = dap.compile(scene, registry=registry).notes
        assert [note for note in notes if f"functions.f ({keyword})" in note] == notes[:noted]
    scene = dap.Scene(name="walls")
    scene.add_body("m", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(1.0, 0.0, 0.0))
    scene.add_force("test-wall", "a", body_i="m")
    scene.add_force("test-wall", "b", body_i="m")
    notes = dap.compile(scene, registry=registry).notes
    assert sum("forces.a and 1 more (test-wall)" in note for note in notes) == 1
    scene = dap.Scene(name="floor")
    scene.add_body("m", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 1.0))
    scene.add_force("test-floor", "floor", body_i="m")
    notes = dap.compile(scene, registry=contact_registry()).notes
    assert not any("test-floor" in note for note in notes)
