"""Derivatives of runs against closed forms, to 1e-9 of the largest at rtol 1e-12."""

from functools import partial

import numpy as np
import pytest
from scipy.special import airy, ellipj, ellipk
from support import redundant
from support.bouncing import bouncing
from support.plain import jit_is_on

import dap3d_core as dap

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="derivatives are of compiled code")
TIGHT = {"rtol": 1e-12, "atol": 1e-14}


def close(found, expected, part=1e-9):
    """Compare, to a part of the largest of each column."""
    found, expected = np.broadcast_arrays(found, expected)
    scale = np.max(np.abs(expected), axis=0)
    error = np.max(np.abs(found - expected), axis=0) / np.where(scale > 0.0, scale, 1.0)
    assert np.all(error <= part), error


def derivative(function, x, h=1e-3):
    """Of a closed form, by differences of sixth order: errors some 1e-13."""
    pairs = zip((1, 2, 3), (45.0, -9.0, 1.0), strict=True)
    return sum(w * (function(x + k * h) - function(x - k * h)) for k, w in pairs) / (60.0 * h)


def by_each(function, values):
    """The derivatives of a closed form by each of its arguments, in turn."""
    for j, value in enumerate(values):
        yield derivative(lambda x, j=j: function(*np.where(np.arange(len(values)) == j, x, values)),
                         value)  # fmt: skip


def oscillator():
    scene = dap.Scene(name="oscillator")
    scene.add_body("mass", mass=2.0, Jp=(1.0, 1.0, 1.0), r=(1.5, 0.0, 0.0), r_dot=(0.2, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="mass.O", P_j="ground.O", k=40.0, l0=1.0, c=0.8)
    return scene


def oscillation(t, m, k, c, l0, x0, v0):
    delta, omega = c / (2.0 * m), np.sqrt(k / m - (c / (2.0 * m)) ** 2)
    a, b = x0 - l0, (v0 + delta * (x0 - l0)) / omega
    return l0 + np.exp(-delta * t) * (a * np.cos(omega * t) + b * np.sin(omega * t))


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "adams"])
def test_an_oscillator(integrator):
    by = ["bodies.mass.mass", "forces.spring.k", "forces.spring.c", "forces.spring.l0",
          "bodies.mass.r.x", "bodies.mass.r_dot.x"]  # fmt: skip
    values = (2.0, 40.0, 0.8, 1.0, 1.5, 0.2)
    # dopri5 and adams err by some 1e-10 themselves at this tolerance
    part = 1e-9 if integrator == "dop853" else 1e-8
    s = dap.sensitivities(oscillator(), by, t_end=2.0, dt=0.1, integrator=integrator, **TIGHT)
    plain = dap.simulate(oscillator(), t_end=2.0, dt=0.1, integrator=integrator, **TIGHT)
    assert plain.u.tobytes() == s.result.u.tobytes()
    assert plain.v_dot.tobytes() == s.result.v_dot.tobytes()
    assert plain.stats.steps == s.result.stats.steps
    for j, expected in enumerate(by_each(partial(oscillation, s.result.t), values)):
        close(s.of("mass.r.x")[:, j], expected, part)
    np.testing.assert_array_equal(s.final("mass.r.x"), s.of("mass.r.x")[-1])
    assert s.names == tuple(by)


@pytest.mark.parametrize("keyword", ["cable", "tendon"])
def test_by_a_point_in_a_list(keyword):
    """Where a spring of points ends: x = q + oscillation(x_0 - q), as sweeps have it, too. Such a
    point was taken for one that nothing reads: derivatives were zero, and sweeps of one value."""
    scene = oscillator()
    scene.forces.clear()
    scene.add_point("end", "ground", (0.0, 0.0, 0.0))
    fields = {"k": 40.0, "length": 1.0, "c": 0.8, "slack": False}
    scene.add_force(keyword, "spring", points=["mass.O", "end"], **fields)
    values = (2.0, 40.0, 0.8, 1.0)

    def motion(t, q):
        return q + oscillation(t, *values, 1.5 - q, 0.2)

    s = dap.sensitivities(scene, ["points.end.sPp.x"], t_end=0.5, dt=0.05, **TIGHT)
    close(s.of("mass.r.x")[:, 0], derivative(lambda q: motion(s.result.t, q), 0.0))
    swept = dap.sweep(scene, {"points.end.sPp.x": [0.0, 0.1]}, outputs=["mass.r.x"], t_end=0.5,
                      dt=0.05, **TIGHT)  # fmt: skip
    expected = [motion(0.5, 0.0), motion(0.5, 0.1)]
    assert next(iter(swept.data_vars.values())).values == pytest.approx(expected, abs=1e-9)


def rail(direction):
    """A body that falls down a rail."""
    scene = dap.Scene(name="rail")
    scene.add_body("block", mass=2.0, Jp=(1.0, 1.0, 1.0))
    scene.add_vector("rail", "ground", direction)
    scene.add_joint("tran", "guide", P_i="block.O", P_j="ground.O", a_j="rail")
    scene.add_force("weight", "gravity", gravity=9.81)
    return scene


@pytest.mark.parametrize("aside", ["x", "y"])
def test_by_the_direction_of_an_axis_along_another(aside):
    """A body falls down a rail along z: -a (a . g) t^2 / 2 along its axis a, by what tilts it. The
    normals that complete an axis jumped where two components of it are equal, as zeros are."""
    s = dap.sensitivities(
        rail((0.0, 0.0, 1.0)), [f"vectors.rail.sp.{aside}"], t_end=1.0, dt=0.1, **TIGHT
    )
    fallen = -0.5 * 9.81 * s.result.t**2
    expected = np.zeros((len(fallen), 3))
    expected[:, "xyz".index(aside)] = fallen
    assert s.of("block.r")[..., 0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.slow
def test_by_the_direction_of_an_axis_whose_normals_jump():
    """Where one component of an axis is above the least by a fiftieth, its normals are others on
    either side: the derivative is taken on one."""
    sp = np.array([0.32, np.sqrt(1.0 - 0.32**2 - 0.3**2), 0.3])
    s = dap.sensitivities(
        rail(tuple(sp.tolist())), ["vectors.rail.sp.x"], t_end=1.0, dt=0.1, **TIGHT
    )

    def place(x):
        a = np.array([x, sp[1], sp[2]])
        return -0.5 * 9.81 * s.result.t[:, None] ** 2 * a[2] * a / (a @ a)

    assert s.of("block.r")[..., 0] == pytest.approx(derivative(place, 0.32), abs=1e-9)


def test_radau_takes_over_where_a_strong_damper_makes_it_stiff():
    """x - l0 decays by the two roots of m s^2 + c s + k."""
    m, t_end = 2.0, 5.0
    scene = dap.Scene(name="damped")
    scene.add_body("mass", mass=m, Jp=(1.0, 1.0, 1.0), r=(1.5, 0.0, 0.0))
    scene.add_force("ptp", "f", P_i="mass.O", P_j="ground.O", k=400.0, l0=1.0, c=2000.0)
    settings = TIGHT | {"integrator": "auto", "t_end": t_end, "dt": 1.0}
    found = dap.sensitivities(scene, ["forces.f.c", "forces.f.k"], **settings)
    assert any("then radau" in note for note in found.result.notes)

    def place(c, k):
        a, b = np.roots([m, c, k])
        return 1.0 + 0.5 * (a * np.exp(b * t_end) - b * np.exp(a * t_end)) / (a - b)

    assert found.final("mass.r.x") == pytest.approx([*by_each(place, (2000.0, 400.0))], rel=1e-8)


@pytest.mark.slow
def test_dop853_takes_radau_across_a_singular_pose():
    """And leaves it to radau behind: derivatives are those of dop853 alone."""
    scene, by = redundant.four_bars(1), ["bodies.crank0.mass", "bodies.crank0.w.z"]
    settings = {"t_end": 2.0, "dt": 0.25, "rtol": 1e-10, "atol": 1e-12}
    runs = [
        dap.sensitivities(scene, by, integrator=name, **settings) for name in ("radau", "dop853")
    ]
    assert any("radau met a singular pose 2 times" in note for note in runs[0].result.notes)
    close(*(run.of("crank0.r.x") for run in runs), part=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["standard", "joint"])
def test_a_pendulum_at_rest_that_is_pulled_ever_more(method):
    """By its rate at the start: q'' = -(a + b t) q, whose solutions are Airy's functions. Values of
    radau's stages are right at once; their derivatives take passes of their own."""
    scene = dap.Scene(name="pulled")
    scene.parameters["rate"] = 0.0
    scene.add_body("bob", mass=2.0, Jp=(0.02, 0.02, 0.02), r=(0.0, 0.0, -0.5),
                   r_dot=("= -0.5 * rate", 0.0, 0.0), w=(0.0, "= rate", 0.0))  # fmt: skip
    scene.add_point("pin", body="bob", sPp=(0.0, 0.0, 0.5))
    scene.add_joint("rev", "hinge", P_i="pin", P_j="ground.O", a_i="bob.y", a_j="ground.y")
    scene.add_function("a", "ramp", coeff=(20.0, 40.0, 0.0))
    scene.add_force("f", "pull", body_i="bob", f=(0.0, 0.0, -1.0), function="ramp")
    # what sets the steps
    scene.add_body("mass", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(1.5, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="mass.O", P_j="ground.O", k=400.0, l0=1.0)
    settings = {"method": method, "integrator": "radau", "rtol": 1e-6, "atol": 1e-8}
    s = dap.sensitivities(scene, ["parameters.rate"], t_end=1.0, dt=0.1, **settings)
    a, b = 20.0 * 0.5 / 0.52, 40.0 * 0.5 / 0.52
    per = -(b ** (1.0 / 3.0))
    ai, ai_slope, bi, bi_slope = airy(per * a / b)
    of_start = np.linalg.solve([[ai, bi], [per * ai_slope, per * bi_slope]], [0.0, 1.0])
    ai, _, bi, _ = airy(per * (a / b + s.result.t))
    # radau errs by 4e-12 in these steps; without the passes it did by 9e-10
    close(s.of("bob.r.x")[:, 0], -0.5 * of_start @ [ai, bi], 2e-11)


def pendulum(length=0.7):
    """A weight on a rod of this length, released from 2 rad: all by one parameter."""
    scene = dap.Scene(name="pendulum")
    scene.parameters["length"] = length
    place = ("= length * sin(2.0)", 0.0, "= -length * cos(2.0)")
    scene.add_body("bob", mass=1.0, Jp=(0.02, 0.02, 0.02), r=place)
    scene.add_point("pin", body="bob", sPp=("= -length * sin(2.0)", 0.0, "= length * cos(2.0)"))
    scene.add_joint("rev", "hinge", P_i="pin", P_j="ground.O", a_i="bob.y", a_j="ground.y")
    scene.add_force("weight", "gravity", gravity=9.81)
    return scene


def swing(t, length, start=2.0):
    """sin of half the angle of the pendulum."""
    k = np.sin(0.5 * start)
    rate = np.sqrt(9.81 * length / (length * length + 0.02))
    return k * ellipj(ellipk(k * k) - rate * t, k * k)[0]


@pytest.mark.parametrize("method", ["standard", "lsq", "joint"])
def test_a_pendulum_by_its_length(method):
    """Its period depends on it; points and the start follow it through expressions."""
    settings = {"t_end": 2.0, "dt": 0.1, "method": method, **TIGHT}
    s = dap.sensitivities(pendulum(), "parameters.length", **settings)
    assert dap.simulate(pendulum(), **settings).u.tobytes() == s.result.u.tobytes()

    def height(length):
        half = swing(s.result.t, length)
        return -length * (1.0 - 2.0 * half * half)

    close(s.of("bob.r.z")[:, 0], derivative(height, 0.7))


@pytest.mark.parametrize("method", ["standard", "joint"])
def test_what_python_computes_at_the_start(method):
    """Mass metrics, points, a pose: first accelerations, to 1e-13 of theirs by a part of each."""
    by = ["parameters.length", "bodies.bob.mass", "bodies.bob.Jp.y"]
    s = dap.sensitivities(pendulum(), by, t_end=0.1, dt=0.1, method=method)
    values = np.array([0.7, 1.0, 0.02])

    def acceleration(length, m, J):
        across = -m * 9.81 * length**2 * np.sin(2.0) / (m * length**2 + J)
        return across * np.array([np.cos(2.0), 0.0, np.sin(2.0)])

    imaginary = 1e-30j * np.eye(3)
    expected = np.stack([acceleration(*(values + e)).imag / 1e-30 for e in imaginary], axis=-1)
    error = np.abs(s.of("bob.rdd")[0] - expected) * values
    assert error.max() < 1e-13 * np.abs(acceleration(*values)).max()


def test_a_free_symmetric_top():
    """Angular velocity in body axes precesses at (C - A) / A times the spin."""
    scene = dap.Scene(name="top")
    scene.add_body("top", mass=1.0, Jp=(2.0, 2.0, 3.0), w=(0.5, 0.0, 4.0))
    by = ["bodies.top.Jp.z", "bodies.top.w.z", "bodies.top.w.x"]
    s = dap.sensitivities(scene, by, t_end=3.0, dt=0.1, **TIGHT)
    found = s.derivative(lambda result: result.wp[:, 0, :2])
    t = s.result.t

    def precession(C, spin, across):
        angle = (C - 2.0) / 2.0 * spin * t
        return across * np.stack([np.cos(angle), np.sin(angle)], axis=1)

    for j, expected in enumerate(by_each(precession, (3.0, 4.0, 0.5))):
        close(found[..., j], expected)


@pytest.mark.parametrize("method", ["standard", "joint"])
def test_large_reactions_beside_a_top(method):
    """What holds a heavy body says nothing of a top that turns beside it."""

    def turning(mass):
        scene = dap.Scene(name="beside")
        scene.add_body("top", mass=1.0, Jp=(2.0, 2.0, 3.0), r=(0.0, 0.0, 3.0), w=(0.5, 0.0, 4.0))
        scene.add_body("block", mass=mass, Jp=(2.0, 2.0, 3.0))
        scene.add_joint("sph", "hold", P_i="block.O", P_j="ground.O")
        scene.add_force("weight", "gravity")
        settings = {"t_end": 3.0, "dt": 0.5, "method": method, **TIGHT}
        return dap.sensitivities(scene, ["bodies.top.w.z"], **settings).of("top.w")[..., 0]

    close(turning(1e6), turning(1.0), 1e-11)


@pytest.mark.slow
def test_a_bouncing_ball():
    """Height, and the instant of the bounce, by e, g, height and speed at the start."""
    scene = bouncing()
    by = ["forces.floor.e", "forces.gravity.gravity", "bodies.ball.r.z", "bodies.ball.r_dot.z"]
    scene.bodies["ball"].r_dot = (0.5, 0.0, 1.5)
    s = dap.sensitivities(scene, by, t_end=1.3, dt=0.05, **TIGHT)
    plain = dap.simulate(scene, t_end=1.3, dt=0.05, **TIGHT)
    assert plain.u.tobytes() == s.result.u.tobytes()
    t = s.result.t

    def bounce(e, g, z0, v0):
        return (v0 + np.sqrt(v0 * v0 + 2.0 * g * z0)) / g

    def height(e, g, z0, v0):
        first, speed = bounce(e, g, z0, v0), np.sqrt(v0 * v0 + 2.0 * g * z0)
        after = e * speed * (t - first) - 0.5 * g * (t - first) ** 2
        return np.where(t < t_bounce, z0 + v0 * t - 0.5 * g * t * t, after)

    values = (0.8, 9.81, 1.0, 1.5)
    t_bounce = bounce(*values)
    for j, expected in enumerate(by_each(height, values)):
        close(s.of("ball.r.z")[:, j], expected)
    assert s.event_times[0] == pytest.approx(list(by_each(bounce, values)), rel=1e-9, abs=1e-12)
