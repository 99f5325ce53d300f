"""The ledger says no to nonsense, and yes to motions that are as exact as was requested.
Its limits stay within a hundredth of the scene's scales, whatever the tolerances and however far a
run has blown up."""

import numpy as np
import pytest
from support.results import CONTROLLED, circling, circling_scene, drifting, result_of, rows_of

import dap3d_core as dap

RELATIVE = ("energy", "total energy", "momentum", "quaternion")


def oscillator(k=4.0, amplitude=1.3, mass=1.0, far=10.0):
    """A mass on a spring along x, whose anchor is far away: x = amplitude cos(w t)."""
    scene = dap.Scene(name="oscillator")
    scene.add_body("m", mass=mass, Jp=(1.0, 1.0, 1.0), r=(amplitude, 0.0, 0.0))
    scene.add_point("far", "ground", (-far, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="m.O", P_j="far", k=k, l0=far)
    return scene


def twisted():
    """A flywheel on a torsion spring: theta = 0.5 cos(5 t)."""
    scene = dap.Scene(name="twisted")
    p = (np.cos(0.25), 0.0, 0.0, np.sin(0.25))
    scene.add_body("wheel", mass=1.0, Jp=(0.2, 0.2, 0.2), p=p)
    hinge = dict(P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z")
    scene.add_joint("rev", "axle", **hinge)
    scene.add_force("rot_sda", "spring", v_i="wheel.x", v_j="ground.x", axis="ground.z", k=5.0)
    return scene


def pendulum(length=1.0, mass=1.0, angle=1.0):
    """A bar on a hinge under its weight."""
    arm = length * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    inertia = (0.1 * mass * length**2,) * 3
    scene = dap.Scene(name="pendulum")
    scene.add_body("bar", mass=mass, Jp=inertia, r=tuple(arm))
    scene.add_point("end", "bar", tuple(-arm))
    scene.add_joint("rev", "hinge", P_i="end", P_j="ground.O", a_i="bar.y", a_j="ground.y")
    scene.add_force("weight", "g")
    return scene


def two_bodies():
    """Two bodies in flight that a spring holds together: nothing acts from outside."""
    scene = dap.Scene(name="two bodies")
    scene.add_body("a", mass=1.0, Jp=(1.0, 2.0, 3.0), w=(0.1, 2.0, 0.1), r_dot=(1.0, 0.0, 0.0))
    scene.add_body("b", mass=2.0, Jp=(1.0, 2.0, 3.0), r=(3.0, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="a.O", P_j="b.O", k=10.0, l0=2.0)
    return scene


RIGHT = {
    "oscillator": oscillator,
    "small": lambda: oscillator(amplitude=1e-3),
    "light": lambda: oscillator(k=4.0, mass=1e-2, amplitude=0.3),
    "torsion": twisted,
    "pendulum": pendulum,
    "pendulum of 1 mm": lambda: pendulum(1e-3, 1e-6),
    "two bodies": two_bodies,
}


@pytest.mark.parametrize(
    "rtol",
    [1e-8, *(pytest.param(x, marks=pytest.mark.slow) for x in (1e-9, 1e-10, 1e-11, 1e-12)), 1e-13],
)
@pytest.mark.parametrize("integrator", ["radau", "dop853", "adams"])
@pytest.mark.parametrize("name", RIGHT)
def test_no_alarm_where_a_motion_is_as_exact_as_requested(name, integrator, rtol):
    """Errors of some hundred steps are below a thousand times those of one, of the work, too."""
    result = dap.simulate(
        RIGHT[name](), t_end=3.0, dt=0.1, rtol=rtol, atol=rtol / 100, integrator=integrator
    )
    for line, entry in result.ledger.items():
        assert entry.ok is True, (line, entry)


def test_the_work_of_radau_is_as_exact_as_its_motion():
    """x = 1.3 cos 2 t; the work of the spring is 2 (1.3^2 - x^2), in J.
    Its rate, 4 x x_dot, changes twice as fast as the motion: a method of order 13 has 2^13 times
    the relative error of it. Powers at stages that the iteration had not found yet gave 2e-9."""
    result = dap.simulate(
        oscillator(), t_end=20.0, dt=0.05, rtol=1e-12, atol=1e-14, integrator="radau"
    )
    x = 1.3 * np.cos(2.0 * result.t)
    motion = np.max(np.abs(result.r[:, 0, 0] - x)) / 1.3
    work = np.max(np.abs(result.work - 2.0 * (1.3**2 - x**2))) / (2.0 * 1.3**2)
    assert motion < 1e-13  # 41 rad of a method of order 13; the tolerance is 1e-12
    assert work < min(2.0**13 * motion, 1e-10)


def test_radau_uses_factors_of_another_step_no_further_than_they_go():
    """A weight on a spring: z = -1 - 2 z0 + z0 cos 5 t about its rest. The iteration with the
    factors of a step that differs by 1e-3 converges by 1e-3, and was believed to by far more: at
    rtol 1e-13 the motion was off by 5e-11 of its amplitude."""
    scene = dap.Scene(name="hanging")
    scene.add_body("b", mass=2.0, Jp=(1.0, 1.0, 1.0), r=(0.0, 0.0, -1.0))
    scene.add_force("weight", "g", gravity=9.81)
    scene.add_force("ptp", "spring", P_i="b.O", P_j="ground.O", k=50.0, l0=1.0)
    result = dap.simulate(scene, t_end=3.0, dt=0.1, rtol=1e-13, atol=1e-15, integrator="radau")
    depth = 2.0 * 9.81 / 50.0
    exact = -1.0 - depth + depth * np.cos(5.0 * result.t)
    # a tenth of the tolerance for each of some 1200 steps would be 1.2e-11
    assert np.max(np.abs(result.r[:, 0, 2] - exact)) < 5e-12 * depth


#: Runs that are nonsense: w h of fixed steps beyond the limit of stability of rk4 (2.8), or near
#: it; tolerances of the size of the motion.
NONSENSE = {
    "unstable": (lambda: oscillator(k=1e6), dict(integrator="rk4", step=3e-3)),
    "damped away": (lambda: oscillator(k=1e4), dict(integrator="rk4", step=1e-2)),
    "tolerance of the motion": (
        lambda: oscillator(k=100.0), dict(integrator="dop853", rtol=0.1, atol=10.0)
    ),
    "coarse pendulum": (pendulum, dict(integrator="rk4", step=0.5, dt=0.5)),
    "coarse pendulum, open": (pendulum, dict(integrator="rk4", step=0.4, dt=0.4, project=False)),
    "coarse torsion": (twisted, dict(integrator="rk4", step=0.5, dt=0.5)),
    "coarse bodies": (two_bodies, dict(integrator="rk4", step=0.7, dt=0.7)),
}  # fmt: skip


def finished(scene, **options):
    """The result of a run, whether it came to its end or not."""
    try:
        return dap.simulate(scene, **options)
    except dap.SimulationError as error:
        return error.result


@pytest.mark.parametrize("name", NONSENSE)
def test_nonsense_fails_and_no_limit_is_above_a_hundredth(name):
    make, options = NONSENSE[name]
    result = finished(make(), **{"t_end": 2.0, "dt": 0.1} | options)
    assert any(entry.ok is False for entry in result.ledger.values()), result.ledger
    for line in set(RELATIVE) & set(result.ledger):
        assert result.ledger[line].limit <= 1e-2


@pytest.mark.parametrize("rtol", [1e-2, 0.5])
@pytest.mark.parametrize("atol", [1e-2, 1e3, 1e6])
def test_limits_of_loose_runs_stay_below_a_hundredth_of_the_scene(rtol, atol):
    """A pendulum of 1 m from rest at 1 rad has speeds below sqrt(2 9.81 (1 - cos 1)) m/s, of
    rotation below that over 1 m, and accelerations below 2 (1 - cos 1) 9.81 + 9.81 m/s^2."""
    result = finished(
        pendulum(), t_end=2.0, dt=0.1, rtol=rtol, atol=atol, integrator="dop853", project=False
    )
    ledger = result.ledger
    fast = np.sqrt(2.0 * 9.81 * (1.0 - np.cos(1.0)))
    assert ledger["energy"].limit <= 1e-2
    assert ledger["quaternion"].limit <= 1e-2
    assert ledger["position"].limit <= 1e-2 * np.sqrt(2.0)  # the box about hinge and bar
    assert ledger["velocity"].limit <= 1e-2 * fast * 1.01
    assert ledger["acceleration"].limit <= 1e-2 * (fast**2 + 9.81) * 1.01


def blown_up(factor, from_=10):
    """Rows of the bob on its ball joint; its speed is multiplied by a factor from an instant on."""
    result, _, _ = circling()
    wrong = np.array(result.u)
    wrong[from_:, 7:] *= factor
    wrong[from_:, :3] *= factor
    residuals = (1e-3 * factor, 1e-3 * factor, 1e-3 * factor)
    rows = rows_of(
        result.model, result.t, wrong, result.v_dot * factor**2, result.Lam * factor**2,
        residuals=residuals,
    )  # fmt: skip
    return rows, result.model


@pytest.mark.parametrize("factor", [10.0, 1e3, 1e6, 1e9])
@pytest.mark.parametrize(
    "more",
    [
        {},
        {"project": False, "rtol": 1e-2},
        {"project": False, "rtol": 0.5, "atol": 1e4},
        {"rate_noise": {"v": 1e3, "w": 1e3}},
        {"step": 0.1, "rtol": None},
    ],
    ids=["", "loose", "looser", "noise", "fixed"],
)
def test_a_run_that_blew_up_has_the_limits_of_its_scene(factor, more):
    """A bob of 3 kg at 1 m/s and 2.5 rad/s on an arm of 0.4 m, 2.75 J: no limit grows beyond a
    hundredth of that as the run does, and every line that was made wrong says so."""
    rows, model = blown_up(factor)
    settings = CONTROLLED | {"extent": model.extent} | more
    ledger = result_of(circling_scene(), rows, model, settings=settings).ledger
    assert ledger["energy"].limit <= 1e-2
    assert ledger["position"].limit <= 1e-2 * model.extent
    assert ledger["velocity"].limit <= 1e-2 * 2.5 * 1.001
    assert ledger["acceleration"].limit <= 1e-2 * 2.5 * 1.001  # 2.5^2 0.4 m/s^2
    assert ledger["energy"].ok is False
    assert "2.75 J" in ledger["energy"].text
    if factor >= 1e3:
        assert not any(ledger[n].ok for n in ("position", "velocity", "acceleration"))


def test_momentum_of_a_run_that_blew_up_is_that_of_its_scene():
    """Two free bodies; one of them gains a thousand times its speed from nowhere."""
    result = drifting()
    wrong = np.array(result.u)
    n = result.summary.body_count
    wrong[5:, 7 * n : 7 * n + 3] *= 1e3
    rows = rows_of(result.model, result.t, wrong, result.v_dot, result.Lam)
    for more in ({}, {"rtol": 0.5, "atol": 1e6}):
        entry = result_of(
            dap.Scene(), rows, result.model, "unconstrained", settings=CONTROLLED | more
        ).ledger["momentum"]
        assert entry.ok is False
        assert entry.limit <= 1e-2
