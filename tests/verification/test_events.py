"""Switches against closed forms: contact, grazing, a disk that lies down, chatter.
Tolerances: rtol 1e-12 leaves some 1e-11 of the largest coordinate after a few pieces of motion."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from support.contact import contact_registry
from support.internals import LOGGED, integration_options
from verification.test_disk import ACROSS, MASS, RADIUS, disk

import dap3d_core as dap
from dap3d_core.integrators import INTEGRATORS, Status

TIGHT = {"rtol": 1e-12, "atol": 1e-14}
G = 9.81
# N3 of the reference problems: m 1, k 1e4, c 20, dropped from 1 m above the floor
FIRST, TOUCH_SPEED = 0.4515236409857309, -4.42944691807
DEEPEST, CONTACT = -0.039029566624278, 0.032102079572781
LEAVE_SPEED, APEX = 3.1955266621704, 0.52045823897256


@pytest.fixture(scope="module")
def registry():
    return contact_registry()


def drop(*heights, mass=1.0, **motion):
    """Balls above the floor, side by side."""
    scene = dap.Scene(name="drop")
    for k, height in enumerate(heights):
        scene.add_body(f"ball{k}", mass=mass, Jp=(1.0, 1.0, 1.0), r=(k, 0.0, height), **motion)
    scene.add_force("weight", "gravity", gravity=G)
    return scene


def run(scene, registry, **settings):
    return dap.simulate(dap.compile(scene, registry=registry), **settings)


def bouncing(registry):
    scene = drop(1.0)
    scene.add_force("test-floor", "floor", body_i="ball0", k=1e4, c=20.0)
    return dap.compile(scene, registry=registry)


@pytest.mark.parametrize(
    ("integrator", "settings", "tolerance"),
    [
        ("dop853", TIGHT, 1e-12),
        ("dopri5", TIGHT, 1e-11),
        ("radau", {"rtol": 1e-11, "atol": 1e-13}, 1e-10),
        pytest.param("dop853", {"step": 2e-3}, 1e-12, marks=pytest.mark.slow),
        # (100 / s h)^4 / 120 of an oscillation of some 0.05 m; without location h itself shows
        pytest.param("rk4", {"step": 2e-3}, 1e-5, marks=pytest.mark.slow),
    ],
)
def test_the_first_bounce(registry, integrator, settings, tolerance):
    """N3: touch, deepest point, leave, apex. Without location errors are of first order."""
    compiled = bouncing(registry)
    speed = {"action": "record", "name": "turn"}
    watched = dap.Event("ball0.rd.z", **speed)
    result = dap.simulate(compiled, t_end=0.85, dt=0.05, integrator=integrator, events=[watched],
                          **settings)  # fmt: skip
    touch, deepest, leave, apex = result.events[:4]
    assert [e.name for e in (touch, deepest, leave, apex)] == ["force floor", "turn"] * 2
    assert (touch.direction, leave.direction) == (-1, 1)
    assert touch.t == pytest.approx(FIRST, abs=tolerance)
    assert leave.t - touch.t == pytest.approx(CONTACT, abs=tolerance)
    assert deepest.u[2] == pytest.approx(DEEPEST, abs=tolerance)
    assert apex.u[2] == pytest.approx(APEX, abs=10.0 * tolerance)


@pytest.mark.slow
def test_speeds_at_the_touch_and_after(registry):
    """N3: the speed where the ball touches, and where it leaves."""
    speeds = []
    events = [dap.Event("ball0.r.z", action=lambda state: speeds.append(state["ball0.rd.z"]))]
    dap.simulate(bouncing(registry), t_end=0.6, events=events, **TIGHT)
    assert speeds == pytest.approx([TOUCH_SPEED, LEAVE_SPEED], abs=1e-11)


@pytest.mark.parametrize("integrator", ["dop853", "dopri5"])
def test_a_run_is_the_same_however_it_is_cut(registry, integrator):
    """Bit for bit: all that decides where a step ends lies in the arrays of the integration."""
    ends = []
    for budget in (1, 7, 10**9):
        compiled = bouncing(registry)
        evaluator, u0 = compiled.evaluator, compiled.model.u0
        evaluator.start(0.0, u0)
        integration = INTEGRATORS[integrator].make(
            evaluator, evaluator.integrated(u0), np.linspace(0.0, 2.0, 21),
            **integration_options(evaluator, compiled.scene.simulation),
        )  # fmt: skip
        while integration.status is Status.RUNNING:
            integration.advance(budget)
        ends.append([integration.rows(), integration.crossings, *integration.state_arrays()])
    assert len(ends[0][1]) >= 6
    for other in ends[1:]:
        for one, two in zip(ends[0], other, strict=True):
            np.testing.assert_array_equal(one, two)


def test_sixty_bounces_are_no_chatter(registry):
    """An elastic ball returns to its height, 60 times; each period in closed form."""
    scene = drop(0.1)
    scene.add_force("test-floor", "floor", body_i="ball0", k=1e4)
    fall = np.sqrt(0.2 / G)
    speed, w = G * fall, 100.0
    sag = G / w**2
    contact = brentq(lambda t: sag * np.cos(w * t) - speed / w * np.sin(w * t) - sag, 0.015, 0.045)
    period = 2.0 * fall + contact
    result = run(scene, registry, t_end=60.0 * period, dt=period, **TIGHT)
    assert len(result.events) == 120
    assert result.events[0].t == pytest.approx(fall, abs=1e-14)
    assert result.r[:, 0, 2] == pytest.approx(0.1, abs=1e-12)


@pytest.mark.parametrize("over", [1e-2, 1e-6, 1e-9])
@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_a_short_touch_within_a_long_step_is_found(registry, over, integrator):
    """A ball thrown up reaches a lid for a moment only; the push there is a jump of the force."""
    rise, push = 1.0, 10.0
    speed = np.sqrt(2.0 * G * rise)
    scene = drop(0.0, r_dot=(0.0, 0.0, speed))
    scene.add_force("test-lid", "lid", body_i="ball0", height=rise - over, push=push)
    result = run(scene, registry, t_end=1.0, dt=1.0, integrator=integrator)
    entry, within = np.sqrt(2.0 * G * over), np.sqrt(2.0 * G * over) / (G + push)
    up = (speed - entry) / G
    down = 1.0 - up - 2.0 * within
    assert [e.direction for e in result.events] == [-1, 1]
    # an instant is known to a rounding of the height, of 1 m, a step over the speed of passing
    known = 1e-13 + result.stats.steps * np.finfo(float).eps / entry
    assert [e.t for e in result.events] == pytest.approx([up, up + 2.0 * within], abs=known)
    height = rise - over - entry * down - 0.5 * G * down**2
    assert result.r[-1, 0, 2] == pytest.approx(height, abs=1e-12 + 10.0 * known)


def test_balls_that_touch_at_once_and_almost_at_once(registry):
    """Each switch is on its own: the balls move as each of them does alone."""
    heights = (1.0, 1.0, 1.0 + 1e-12, 0.7)
    scene = drop(*heights)
    for k in range(len(heights)):
        scene.add_force("test-floor", f"floor{k}", body_i=f"ball{k}", k=1e4, c=20.0)
    result = run(scene, registry, t_end=0.7, dt=0.1, **TIGHT)
    for k, height in enumerate(heights):
        alone = drop(height)
        alone.add_force("test-floor", "floor", body_i="ball0", k=1e4, c=20.0)
        expected = run(alone, registry, t_end=0.7, dt=0.1, **TIGHT)
        assert result.r[:, k, 2] == pytest.approx(expected.r[:, 0, 2], abs=1e-11)
        times = [e.t for e in result.events if e.name == f"force floor{k}"]
        assert times == pytest.approx([e.t for e in expected.events], abs=1e-12)


def test_a_switch_of_two_numbers(registry):
    """Pushed by 1 N between two walls; each wall is a switch of its own."""
    scene = dap.Scene(name="band")
    scene.add_body("cart", mass=1.0, Jp=(1.0, 1.0, 1.0), r_dot=(1.0, 0.0, 0.0))
    scene.add_force("test-band", "band", body_i="cart", low=1.0, high=2.5)
    result = run(scene, registry, t_end=4.0, dt=0.5, **TIGHT)
    within = np.sqrt(1.0 + 2.0 * 1.5) - 1.0  # t + t^2 / 2 = 1.5
    assert [e.name for e in result.events] == ["force band [1]", "force band [2]"]
    assert [e.t for e in result.events] == pytest.approx([1.0, 1.0 + within], abs=1e-13)
    assert result.r[-1, 0, 0] == pytest.approx(2.5 + 2.0 * (3.0 - within), abs=1e-12)


def test_dry_friction_without_a_transition_chatters(registry):
    """The cart comes to rest, where its friction pushes it either way: the run says so."""
    scene = dap.Scene(name="dry")
    scene.add_body("cart", mass=1.0, Jp=(1.0, 1.0, 1.0), r_dot=(1.0, 0.0, 0.0))
    scene.add_force("test-dry", "rubbing", body_i="cart", load=2.0)
    with pytest.raises(dap.SimulationError) as caught:
        run(scene, registry, t_end=2.0, dt=0.1)
    words = str(caught.value)
    for part in ("force rubbing (test-dry) chatters", "t = 0.5", "101 times", "tanh"):
        assert part in words
    result = caught.value.result
    assert result.status == "stopped"
    assert result.t[-1] == pytest.approx(0.5, abs=1e-5)  # within the millionth of the run
    assert result.r[-1, 0, 0] == pytest.approx(0.25, abs=1e-10)


@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_a_switch_with_words_ends_the_run_at_its_limit(registry, integrator):
    """The state at the limit is the last one that is reported, and no state beyond it is."""
    scene = drop(1.0)
    scene.add_force("test-fuse", "fuse", body_i="ball0", height=0.25)
    with pytest.raises(dap.SimulationError, match=r"force fuse \(test-fuse\): .*too low") as caught:
        run(scene, registry, t_end=2.0, dt=0.1, integrator=integrator)
    result = caught.value.result
    assert result.t[-1] == pytest.approx(np.sqrt(1.5 / G), abs=1e-12)
    assert 0.0 <= result.r[-1, 0, 2] - 0.25 <= 1e-14
    assert [e.kind for e in result.events] == ["end"]


def test_a_run_that_starts_beyond_the_limit_ends_at_once(registry):
    """Its start is reported."""
    scene = drop(0.1)
    scene.add_force("test-fuse", "fuse", body_i="ball0", height=0.25)
    with pytest.raises(dap.SimulationError, match="stopped at t = 0 s") as caught:
        run(scene, registry, t_end=2.0)
    assert list(caught.value.result.t) == [0.0]


def test_the_first_crossings_are_kept(registry):
    """A ball that bounces a millimetre high: more crossings than are kept."""
    scene = drop(1e-3)
    scene.add_force("test-floor", "floor", body_i="ball0", k=1e4)
    result = run(scene, registry, t_end=40.0, dt=40.0)
    assert len(result.events) == LOGGED
    assert any(f"the first {LOGGED} are kept" in note for note in result.notes)


@pytest.mark.parametrize(("integrator", "tolerance"), [("dop853", 1e-11), ("radau", 1e-8)])
def test_a_disk_that_lies_down(integrator, tolerance):
    """On smooth ground the centre falls straight; theta is the angle to the ground.
    (J + m R^2 c^2) theta'' = m R^2 s c theta'^2 - m g R c, integrated by scipy."""
    lean = 0.8
    with pytest.raises(dap.SimulationError, match="the disk lies down") as caught:
        dap.simulate(
            disk("z", lean=lean), t_end=2.0, dt=0.02, integrator=integrator, rtol=1e-11, atol=1e-13
        )
    result = caught.value.result

    def falling(_, x):
        s, c = np.sin(x[0]), np.cos(x[0])
        torque = MASS * RADIUS**2 * s * c * x[1] ** 2 - MASS * G * RADIUS * c
        return [x[1], torque / (ACROSS + MASS * RADIUS**2 * c * c)]

    def lies(_, x):
        return np.sin(x[0]) - 0.02

    lies.terminal = True
    expected = solve_ivp(falling, (0.0, 2.0), [lean, 0.0], events=lies, method="DOP853",
                         rtol=1e-13, atol=1e-14)  # fmt: skip
    p = result.p[-1, 0]
    cosine = 2.0 * (p[2] * p[3] + p[0] * p[1])  # z component of the body's y axis
    assert np.sqrt(1.0 - cosine**2) == pytest.approx(0.02, abs=1e-12)
    assert result.t[-1] == pytest.approx(expected.t_events[0][0], abs=tolerance)
    assert np.linalg.norm(result.w[-1, 0]) == pytest.approx(
        abs(expected.y_events[0][0][1]), abs=10.0 * tolerance
    )


#: Axes of the joints of an arm, one after the other; amplitudes, rad, and frequencies, Hz, of their
#: motors: slow motions, and a tool that vibrates; length of a link, m.
ARM = (("z", 0.3, 0.4), ("y", 0.3, 0.4), ("y", 0.3, 0.4), ("z", 0.3, 0.4), ("y", 0.3, 0.4),
       ("z", 0.02, 500.0))  # fmt: skip
LINK = 0.3


def arm():
    """Six links along x, on hinges that motors turn."""
    scene = dap.Scene(name="arm")
    outer, before = "ground.O", "ground"
    for k, (axis, amplitude, frequency) in enumerate(ARM):
        link = f"link{k}"
        scene.add_body(
            link, mass=2.0 - 0.3 * k, Jp=(0.004, 0.02, 0.02), r=(LINK * (k + 0.5), 0.0, 0.0)
        )
        inner = scene.add_point(f"in{k}", link, (-0.5 * LINK, 0.0, 0.0))
        along = {"a_i": f"{link}.{axis}", "a_j": f"{before}.{axis}"}
        scene.add_joint("rev", f"hinge{k}", P_i=inner, P_j=outer, **along)
        scene.add_function(
            "harmonic", f"turn{k}", amplitude=amplitude, frequency=2.0 * np.pi * frequency
        )
        motor = {"body_i": link, "body_j": before, "a_j": f"{before}.{axis}"}
        scene.add_joint("drive-rot", f"motor{k}", **motor, function=f"turn{k}")
        outer, before = scene.add_point(f"out{k}", link, (0.5 * LINK, 0.0, 0.0)), link
    scene.add_force("weight", "gravity")
    return scene


def tool_velocity(t):
    """(3, nt) of the last link's centre: its position as a product of rotations, at t + i h."""
    t = t + 1e-30j  # the imaginary part is h times the derivative, without a difference
    r = np.zeros((3, len(t)), complex)
    A = np.broadcast_to(np.eye(3, dtype=complex)[:, :, None], (3, 3, len(t)))
    for axis, amplitude, frequency in ARM:
        angle = amplitude * np.sin(2.0 * np.pi * frequency * t)
        c, s, o, z = np.cos(angle), np.sin(angle), np.ones_like(t), np.zeros_like(t)
        about_z = np.array([[c, -s, z], [s, c, z], [z, z, o]])
        about_y = np.array([[c, z, s], [z, o, z], [-s, z, c]])
        A = np.einsum("ijt,jkt->ikt", A, about_z if axis == "z" else about_y)
        middle, r = r + 0.5 * LINK * A[:, 0], r + LINK * A[:, 0]
    return middle.imag / 1e-30


@pytest.mark.slow
@pytest.mark.parametrize(
    ("integrator", "settings"), [("dop853", {}), ("radau", {}), ("rk4", {"step": 2e-4})]
)
def test_an_arm_whose_tool_vibrates_at_500_hz(integrator, settings):
    """All changes of sign are found: of a velocity of the tool, and of a clock, at long steps too.
    Independently: products of rotations at 10 000 instants, 1000 in a period. Velocities there are
    off by what the run is, 1e-5 m/s of 9 m/s at most; accelerations are 3e4 m/s^2."""
    t_end = 0.02
    events = [
        dap.Event("link5.rd.y", name="tool"),
        dap.Event(lambda t, _: np.sin(2.0 * np.pi * 500.0 * t + 0.1), name="clock"),
    ]
    result = dap.simulate(
        arm(), t_end=t_end, dt=t_end / 2, integrator=integrator, events=events, **settings
    )
    assert not any("too fast" in note for note in result.notes)
    t = np.linspace(0.0, t_end, 10_001)
    signs = np.sign(tool_velocity(t)[1])
    expected = int(np.sum(signs[1:] * signs[:-1] < 0.0))
    assert expected > 17
    tool = np.array([event.t for event in result.events if event.name == "tool"])
    assert len(tool) == expected
    assert np.abs(tool_velocity(tool)[1]).max() < 1e-5
    clock = [event.t for event in result.events if event.name == "clock"]
    assert clock == pytest.approx((np.pi * np.arange(1, 21) - 0.1) / (1000.0 * np.pi), abs=1e-14)
