"""Events and switches that are passed twice within a step, and fixed steps across switches.
Closed forms of free flight; the pendulum by elliptic integrals (SciPy). Instants are compared with
what a height known to rounding, or to the tolerance of the run, over the speed of passing
leaves."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk
from support.levels import quickly

import dap3d_core as dap
from dap3d_core.simulation.events.sampling import FRACTIONS, Sampler, turning_points

G = 9.81
EPS = np.finfo(float).eps
TIGHT = {"rtol": 1e-9, "atol": 1e-11}
# Release angle and moment of inertia, kg m^2, about the hinge of a pendulum of 1 kg, 1 m.
RELEASE, INERTIA = 1.0, 1.1


@pytest.fixture(scope="module")
def flight():
    """A stone thrown up at 10 m/s: its apex is at 5.097 m, within a step of about a second."""
    scene = dap.Scene(name="flight")
    scene.add_body("b", mass=1.0, Jp=(1.0, 1.0, 1.0), r_dot=(1.0, 0.0, 10.0))
    scene.add_force("weight")
    return dap.compile(scene)


def pendulum(angle, stop=None):
    """A rod on a hinge, at rest at an angle; a stop that its end meets at another."""
    scene = dap.Scene(name="pendulum")
    p = (np.cos(angle / 2), 0.0, -np.sin(angle / 2), 0.0)
    r = (np.sin(angle), 0.0, -np.cos(angle))
    scene.add_body("b", mass=1.0, Jp=(0.1, 0.1, 0.1), r=r, p=p)
    scene.add_point("P", body="b", sPp=(0.0, 0.0, 1.0))
    scene.add_joint("rev", "J", P_i="P", P_j="ground.O", a_i="b.y", a_j="ground.y")
    scene.add_force("weight")
    if stop is not None:
        scene.add_point("W", body="ground", sPp=(np.sin(stop), 0.0, 0.0))
        scene.add_vector("n", body="ground", sp=(-1.0, 0.0, 0.0))
        scene.add_force("plane_stop", "stop", P_i="b.O", P_j="W", a_j="n", e=0.8, k=1e5)
    return scene


def period():
    return 4.0 * ellipk(np.sin(RELEASE / 2.0) ** 2) / np.sqrt(G / INERTIA)


def time_near_turn(d):
    """The time from the turning point to an angle by d less."""

    def reached(t, y):
        return y[0] - (RELEASE - d)

    found = solve_ivp(
        lambda t, y: [y[1], -G * np.sin(y[0]) / INERTIA], (0.0, 1.0), [RELEASE, 0.0],
        rtol=1e-13, atol=1e-15, events=reached, first_step=1e-4, method="DOP853",
    )  # fmt: skip
    return found.t_events[0][0]


@pytest.mark.parametrize("d", [1e-2, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("every", [None, 0.005, 0.3])
def test_a_level_below_an_apex_is_passed_twice(flight, d, every):
    apex = 50.0 / G
    result = dap.simulate(
        flight, t_end=2.0, dt=0.5, events=[dap.Event("b.r.z", at=apex * (1.0 - d), every=every)]
    )
    half = np.sqrt(2.0 * apex * d / G)
    # some roundings of the height, of the level as well, over the speed of passing
    known = 20.0 * EPS * apex / (G * half)
    assert [e.direction for e in result.events] == [1, -1]
    times = [10.0 / G - half, 10.0 / G + half]
    assert [e.t for e in result.events] == pytest.approx(times, abs=1e-13 + known)
    assert result.stats.steps < 20


@pytest.mark.slow
@pytest.mark.parametrize("integrator", quickly(["dop853", "dopri5", "adams", "radau"]))
@pytest.mark.parametrize("method", ["standard", "joint"])
def test_turning_points_of_a_pendulum(integrator, method):
    """Five passages, in pairs about three turning points; of some the upward ones alone."""
    if (integrator, method) == ("radau", "joint"):
        pytest.skip("radau integrates body coordinates")
    d = 1e-6
    level, near = np.sin(RELEASE - d), time_near_turn(d)
    events = [dap.Event("b.r.x", at=level), dap.Event("b.r.x", above=level, name="up")]
    result = dap.simulate(
        pendulum(RELEASE), t_end=5.0, dt=1.0, method=method, integrator=integrator, events=events,
        **TIGHT,
    )  # fmt: skip
    T = period()
    times = [near, T - near, T + near, 2.0 * T - near, 2.0 * T + near]
    # an error of 1e-8 m, which these runs have, over the speed near the turning point, 4e-3 m/s
    known = 1e-8 / 4e-3
    assert [e.t for e in result.events if e.name != "up"] == pytest.approx(times, abs=known)
    assert [e.t for e in result.events if e.name == "up"] == pytest.approx(times[1::2], abs=known)


@pytest.mark.parametrize(
    ("function", "times"),
    [
        (lambda t: abs(t - 0.37) - 1e-9, [0.37 - 1e-9, 0.37 + 1e-9]),
        (lambda t: np.hypot(100.0 * (t - 0.37), 1e-4) - 1.5e-4, None),
        (lambda t: (t - 0.37) ** 3, [0.37]),
        (lambda t: (t - 0.37) ** 2 - 1e-12, [0.37 - 1e-6, 0.37 + 1e-6]),
        (lambda t: (t - 0.37) ** 4 - 1e-10, [0.37 - 10.0**-2.5, 0.37 + 10.0**-2.5]),
        (lambda t: (t - 0.2) * (t - 0.2001) * (t - 0.7) * (t - 0.70001),
         [0.2, 0.2001, 0.7, 0.70001]),
        # three passages between two samples: its turning points are 4e-4 apart
        (lambda t: (t - 0.5) * (t - 0.5003) * (t - 0.5007), [0.5, 0.5003, 0.5007]),
        (lambda t: (t - 0.1) * (t - 0.6) * (t - 0.602) * (t - 0.6035), [0.1, 0.6, 0.602, 0.6035]),
        (lambda t: np.floor(10.0 * t) - 4.5, [0.5]),
        (lambda t: 1e300 * (t - 0.5), [0.5]),
        (lambda t: 1e-300 * (t - 0.5), [0.5]),
        (lambda t: max(0.0, t - 0.4), []),
        (lambda t: 0.0, []),
        pytest.param(lambda t: 1.02 + np.sin(2.0e3 * np.pi * t), [], marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_functions_with_close_roots_kinks_and_jumps(flight, function, times):
    """Roots in closed form; those of a sharp dip are 1e-6 sqrt(1.5^2 - 1) from its lowest point."""
    if times is None:
        half = 1e-6 * np.sqrt(1.25)
        times = [0.37 - half, 0.37 + half]
    result = dap.simulate(
        flight, t_end=1.0, dt=0.5, events=[dap.Event(lambda t, state: float(function(t)))]
    )
    assert [e.t for e in result.events] == pytest.approx(times, abs=1e-10)
    assert not any("too fast" in note for note in result.notes)


@pytest.mark.slow
def test_all_swings_of_a_fast_function(flight):
    """sin(1e3 t) has 318 roots in a second of free flight, which is five steps."""
    event = dap.Event(lambda t, state: np.sin(1e3 * t))
    times = np.array([e.t for e in dap.simulate(flight, t_end=1.0, dt=1.0, events=[event]).events])
    roots = np.pi * np.arange(1, int(1e3 / np.pi) + 1) / 1e3
    assert times == pytest.approx(roots, abs=1e-14)


def test_a_touch_within_rounding_is_mentioned(flight):
    """At a double root rounding decides: no event, one where it is reached, or two; and a note."""
    event = dap.Event(lambda t, state: (t - 0.37) ** 2, name="touch")
    result = dap.simulate(flight, t_end=1.0, dt=1.0, events=[event])
    assert len(result.events) <= 2
    assert any("event touch: at t = 0.37 s it turned within rounding" in n for n in result.notes)


def test_several_events_in_one_step_in_order(flight):
    levels = [5.0, 5.09, 5.09, 5.0968]
    events = [dap.Event("b.r.z", at=z, name=f"{k}") for k, z in enumerate(levels)]
    result = dap.simulate(flight, t_end=2.0, dt=2.0, events=events)
    expected = []
    for k, z in enumerate(levels):
        half = np.sqrt(2.0 * (50.0 / G - z) / G)
        expected += [(10.0 / G - half, f"{k}"), (10.0 / G + half, f"{k}")]
    assert [e.t for e in result.events] == pytest.approx(
        [t for t, _ in sorted(expected)], abs=1e-12
    )
    assert sorted(e.name for e in result.events) == sorted(2 * "0123")


@pytest.mark.slow
def test_a_resumed_run_finds_the_same_events(flight, tmp_path):
    """Bit for bit, after an interruption between the two passages."""
    apex = 50.0 / G
    event = dap.Event("b.r.z", at=apex * (1.0 - 1e-4))
    whole = dap.simulate(flight, t_end=2.0, dt=0.005, events=[event])

    class StopError(Exception):
        pass

    def interrupt(t, t_end):
        if t >= 1.0091:
            raise StopError

    with pytest.raises(StopError):
        dap.simulate(flight, t_end=2.0, dt=0.005, events=[event], output=tmp_path / "a.nc",
                     checkpoint=np.inf, progress=interrupt)  # fmt: skip
    resumed = dap.resume(tmp_path / "a.nc.checkpoint", events=[event])
    assert resumed.events == whole.events
    np.testing.assert_array_equal(resumed.u, whole.u)


@pytest.mark.parametrize("every", [1e-300, 1e-9, 1.9e-6])
def test_an_every_without_end_is_refused(flight, every):
    with pytest.raises(ValueError, match=r"every should be at least 2e-06 s"):
        dap.simulate(flight, t_end=2.0, events=[dap.Event("b.r.z", at=5.0, every=every)])


@pytest.mark.slow
@pytest.mark.parametrize("every", [2e-3, 1.0, 1e300])
def test_every_changes_no_event(flight, every):
    result = dap.simulate(
        flight, t_end=2.0, dt=1.0, events=[dap.Event("b.r.z", at=5.0, every=every)]
    )
    half = np.sqrt(2.0 * (50.0 / G - 5.0) / G)
    assert [e.t for e in result.events] == pytest.approx(
        [10.0 / G - half, 10.0 / G + half], abs=1e-13
    )


@pytest.mark.slow
def test_windows_are_narrowed_to_what_cannot_hide_a_crossing():
    """A sampler finds a dip of any place and width; unseen ones would show at some place."""
    for place in np.linspace(0.01, 0.99, 50):
        for width in (1e-3, 1e-6, 1e-9):

            def dip(t, place=place, width=width):
                return abs(t - place) - width

            samples = Sampler(None).samples(dip, dip, 0.0, dip(0.0), 1.0)
            assert any(value <= 0.0 for _, value in samples), (place, width)


@pytest.mark.parametrize("rise", [1.0, -1.0])
def test_turning_points_close_to_each_other(rise):
    """Of a quintic: its slope is rise * 5 (x - a)(x - a - d) (x^2 + 1)."""
    for a in (*np.linspace(0.01, 0.98, 40), 0.5, 0.25):
        for d in (1e-2, 1e-4, 1e-6):
            slope = np.polynomial.Polynomial.fromroots([a, a + d, 1j, -1j]) * 5.0 * rise
            found = turning_points(np.real(slope.integ()(FRACTIONS)))
            # the slope there is d^2, of values to rounding: 1e-15 / (d 1) of a place, and a margin
            assert [x for x, _ in found] == pytest.approx([a, a + d], abs=1e-2 * d + 1e-13 / d)


@pytest.mark.parametrize(
    ("integrator", "settings"),
    [("dop853", TIGHT), ("dopri5", TIGHT), ("adams", TIGHT), ("radau", TIGHT),
     ("rk4", {"step": 0.02}), ("dop853", {"step": 0.2})],
)  # fmt: skip
@pytest.mark.parametrize("method", ["standard", "joint"])
@pytest.mark.parametrize("d", [1e-3, 1e-6])
def test_a_stop_just_before_a_turning_point(integrator, settings, method, d):
    """The stop would be passed twice within a step; the pendulum meets it half a period on."""
    if (integrator, method) == ("radau", "joint"):
        pytest.skip("radau integrates body coordinates")
    result = dap.simulate(
        pendulum(-RELEASE, stop=RELEASE - d), t_end=1.5, dt=1.5, method=method,
        integrator=integrator, **settings,
    )  # fmt: skip
    first = next(e for e in result.events if e.kind == "jump")
    near = time_near_turn(d)
    # of the speed near the turning point, 7.65 near: errors of 1e-9, of fixed steps 1e-7
    known = (1e-7 if "step" in settings else 1e-9) / (7.65 * near)
    assert first.t == pytest.approx(0.5 * period() - near, abs=known)


@pytest.mark.parametrize(
    ("integrator", "settings"),
    [("rk4", {"step": h}) for h in (0.0125, 0.01, 0.0133, 1e-3)]
    + [(name, {"step": 0.0125}) for name in ("dopri5", "dop853", "radau")]
    + [(name, {}) for name in ("dopri5", "dop853", "adams", "radau")],
)
def test_no_step_samples_the_law_behind_a_stop(integrator, settings):
    """A bouncing ball, in closed form: no stage lies in contact before the ball touches.
    Its damper would take 2800 m/s^2 at once. Instants are known to some roundings of 1 m over
    4 m/s, which bounces add up."""
    scene = dap.Scene(name="drop")
    scene.add_body("b", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(0.0, 0.0, 1.0))
    scene.add_force("weight")
    scene.add_force("plane_stop", "stop", P_i="b.O", e=0.8, k=1e5)
    result = dap.simulate(scene, t_end=2.9, dt=0.05, integrator=integrator, **settings)
    fall = np.sqrt(2.0 / G)
    times, speed = [fall], G * fall
    for _ in range(5):
        speed *= 0.8
        times.append(times[-1] + 2.0 * speed / G)
    found = [e for e in result.events if e.kind == "jump"]
    assert [e.t for e in found[:6]] == pytest.approx(times, abs=1e-13)
    assert found[0].u_after[9] == pytest.approx(0.8 * G * fall, abs=1e-13)


@pytest.mark.slow
def test_rk4_keeps_its_order_with_an_event():
    """The instant of an event converges as h^4: the ratio for half the step is about 16."""
    scene = pendulum(RELEASE)
    event = dap.Event("b.r.x", below=0.0, action="stop")
    errors = []
    for step in (0.04, 0.02, 0.01):
        result = dap.simulate(
            scene, t_end=1.0, dt=1.0, integrator="rk4", step=step, method="joint", events=[event]
        )
        errors.append(abs(result.t[-1] - 0.25 * period()))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 3.5), (orders, errors)
