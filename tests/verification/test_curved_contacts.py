"""Contacts of curves and surfaces against closed forms and integrals, to 1e-9 at rtol 1e-12."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from support.own_types import registry_of

import dap3d_core as dap
from dap3d_core.interface import Function, number
from dap3d_core.kernels import cos, sin, sqrt

G = 9.81
TIGHT = {"rtol": 1e-12, "atol": 1e-14, "dt": 0.1, "integrator": "dop853"}
TOLERANCE = 1e-9


class Bowl(Function):
    """k (x^2 + y^2)."""

    keyword, arguments, smooth = "test-bowl", 2, True
    k: float = number()

    def value(x, y, k):
        return k * (x * x + y * y)


class Wave(Function):
    """c + h cos(x)."""

    keyword, smooth = "test-wave", True
    c: float = number(0.0)
    h: float = number()

    def value(x, c, h):
        return c + h * cos(x)


class Eccentric(Function):
    """The distance of a circle of radius a about (e, 0), over the angle."""

    keyword, smooth = "test-eccentric", True
    a: float = number()
    e: float = number()

    def value(x, a, e):
        return e * cos(x) + sqrt(a * a - e * e * sin(x) ** 2)


REGISTRY = registry_of(Bowl, Wave, Eccentric)


def run(scene, t_end, **settings):
    """Simulate with the functions of this file."""
    compiled = dap.compile(scene, registry=REGISTRY)
    return dap.simulate(compiled, t_end=t_end, **(TIGHT | settings))


def first(result, kind):
    """The first event of a kind."""
    return next(e for e in result.events if e.kind == kind)


def ball(r, k, radius, **contact):
    """A solid ball in a bowl z = k (x^2 + y^2)."""
    scene = dap.Scene(name="bowl")
    scene.add_body("ball", mass=1.0, Jp=[0.4 * radius**2] * 3, r=list(r))
    scene.add_force("weight", "g")
    scene.add_function("test-bowl", "bowl", k=k)
    fields = {"P_i": "ball.O", "radius": radius, "function": "bowl"}
    scene.add_contact("ball_surface", "floor", **fields, **contact)
    return scene


def centre(x, k, radius):
    """Place (x, z) of the centre of a ball that touches at x."""
    size = np.hypot(1.0, 2.0 * k * x)
    return x - radius * 2.0 * k * x / size, k * x * x + radius / size


@pytest.mark.slow
def test_a_ball_rolls_through_a_bowl():
    """Let go at rest it is at the bottom after the integral of its path over its speed.

    Its centre goes (1 - R kappa) ds, kappa = 2 k / w^3, ds = w dx, w^2 = 1 + (2 k x)^2, and rolls:
    7/10 v^2 = g h. With x = x_0 sin(a) the integral has no pole.
    """
    k, radius, x_0 = 0.8, 0.1, 0.5
    top = centre(x_0, k, radius)

    def slowness(a):
        x = x_0 * np.sin(a)
        w = np.hypot(1.0, 2.0 * k * x)
        path = w - radius * 2.0 * k / w**2
        fall = top[1] - centre(x, k, radius)[1]
        # fall / cos(a)^2, without its pole
        square = k * x_0**2 - radius * (2.0 * k * x_0) ** 2 / (
            np.hypot(1.0, 2.0 * k * x_0) * w * (w + np.hypot(1.0, 2.0 * k * x_0))
        )
        assert abs(square * np.cos(a) ** 2 - fall) < 1e-14
        return x_0 * path / np.sqrt(10.0 / 7.0 * G * square)

    t = quad(slowness, 0.0, 0.5 * np.pi, epsabs=1e-13, epsrel=1e-13)[0]
    result = run(ball((top[0], 0.0, top[1]), k, radius, mu=2.0), 2.0 * t, dt=t)
    speed = np.sqrt(10.0 / 7.0 * G * (top[1] - radius))
    assert result.r[1, 0] == pytest.approx([0.0, 0.0, radius], abs=TOLERANCE)
    assert result.rd[1, 0] == pytest.approx([-speed, 0.0, 0.0], abs=TOLERANCE)
    assert result.w[1, 0] == pytest.approx([0.0, -speed / radius, 0.0], abs=1e-8)
    assert result.r[2, 0] == pytest.approx([-top[0], 0.0, top[1]], abs=TOLERANCE)
    assert result.ledger["energy"].value < TOLERANCE


@pytest.mark.slow
def test_a_ball_slides_round_in_a_bowl():
    """Without friction, on a level circle of its centre: Omega^2 rho = g tan(slope)."""
    k, radius, x = 0.8, 0.1, 0.5
    rho, z = centre(x, k, radius)
    rate = np.sqrt(G * 2.0 * k * x / rho)
    scene = ball((rho, 0.0, z), k, radius)
    scene.bodies["ball"].r_dot = [0.0, rate * rho, 0.0]
    result = run(scene, 1.0)
    angle = rate * result.t
    circle = np.stack([rho * np.cos(angle), rho * np.sin(angle), np.full_like(angle, z)], 1)
    assert result.r[:, 0] == pytest.approx(circle, abs=TOLERANCE)
    at = result.contact("floor").at
    assert np.hypot(at[:, 0], at[:, 1]) == pytest.approx(x, abs=TOLERANCE)
    assert result.contact("floor").normal_force == pytest.approx(
        G * np.hypot(1.0, 2.0 * k * x), abs=1e-8
    )


@pytest.mark.slow
def test_a_surface_may_move_and_be_below():
    """A ball falls on a rising dome: both seen from the dome, it falls by g t^2 / 2 + v t."""
    radius, v, gap = 0.1, 0.7, 0.3
    scene = ball((0.0, 0.0, 0.0), -0.8, radius)
    scene.bodies["ball"].r = [0.0, 0.0, radius + gap]
    scene.add_body("dome", mass=1.0, Jp=[1.0] * 3, rpy=[0.0, 0.0, 0.4], r_dot=[0.0, 0.0, v])
    scene.add_joint("tran", "lift", P_i="dome.O", P_j="ground.O", a_j="ground.z")
    scene.add_function("a", "up", coeff=[0.0, v, 0.0])
    up = {"body_i": "dome", "body_j": "ground", "a_j": "ground.z", "function": "up"}
    scene.add_joint("drive-tran", "drive", **up)
    scene.contacts["floor"].fields["P_j"] = "dome.O"
    result = run(scene, 0.3)
    t = (-v + np.sqrt(v * v + 2.0 * G * gap)) / G
    assert first(result, "impact").t == pytest.approx(t, abs=TOLERANCE)


@pytest.mark.slow
def test_a_skier_takes_off_before_the_top():
    """On y = h cos(x), without friction: v^2 = v_0^2 + 2 g h (1 - cos(x)), v_0 at the top.

    It leaves where f'' v^2 = -g (1 + f'^2); the instant is the integral of ds / v.
    """
    h, v, start = 1.0, np.sqrt(12.0), -1.2

    def speed(x):
        return np.sqrt(v * v + 2.0 * G * h * (1.0 - np.cos(x)))

    def load(x):
        return G * (1.0 + (h * np.sin(x)) ** 2) - h * np.cos(x) * speed(x) ** 2

    def path(x):
        return np.hypot(1.0, h * np.sin(x))

    scene = dap.Scene(name="hill")
    along = speed(start) / path(start) * np.array([1.0, -h * np.sin(start), 0.0])
    place = [start, h * np.cos(start), 0.0]
    scene.add_body("skier", mass=2.0, Jp=[0.1] * 3, r=place, r_dot=list(along))
    scene.add_force("weight", "g", wgt=[0.0, -1.0, 0.0])
    scene.add_function("test-wave", "hill", h=h)
    scene.add_contact("point_curve", "slope", P_i="skier.O", function="hill")
    result = run(scene, 0.4)
    lift, x = first(result, "lift"), brentq(load, start, 0.0, xtol=1e-15)
    assert lift.u[:2] == pytest.approx([x, h * np.cos(x)], abs=TOLERANCE)
    t = quad(lambda x: path(x) / speed(x), start, x, epsabs=1e-13, epsrel=1e-13)[0]
    assert lift.t == pytest.approx(t, abs=TOLERANCE)
    assert result.ledger["energy"].value < TOLERANCE


def cam(function, rate, start, radius=0.0, **fields):
    """A follower that slides along y on a cam about the origin, which turns at a rate."""
    scene = dap.Scene(name="cam")
    scene.add_body("cam", mass=1.0, Jp=[1.0] * 3, w=[0.0, 0.0, rate])
    axle = {"P_i": "cam.O", "P_j": "ground.O", "a_i": "cam.z", "a_j": "ground.z"}
    scene.add_joint("rev", "axle", **axle)
    scene.add_function("a", "turn", coeff=[0.0, rate, 0.0])
    scene.add_joint("drive-rot", "drive", joint="axle", function="turn")
    y, y_dot = start
    scene.add_body("follower", mass=0.5, Jp=[1.0] * 3, r=[0.0, y, 0.0], r_dot=[0.0, y_dot, 0.0])
    scene.add_joint("tran", "guide", P_i="follower.O", P_j="ground.O", a_j="ground.y")
    scene.add_force("weight", "g", wgt=[0.0, -1.0, 0.0])
    scene.add_function(function, "shape", **fields)
    contact = {"P_i": "follower.O", "P_j": "cam.O", "function": "shape", "radius": radius}
    scene.add_contact("point_curve", "contact", polar=True, **contact)
    return scene


@pytest.mark.slow
def test_a_follower_lifts_off_its_cam():
    """y = c + h sin(w t) while it is carried: it lifts where h w^2 sin(w t) = g, and falls back."""
    c, h, w = 0.3, 0.05, 16.0
    result = run(cam("test-wave", w, (c, h * w), c=c, h=h), 0.4)
    lifts = np.arcsin(G / (h * w * w)) / w
    assert first(result, "lift").t == pytest.approx(lifts, abs=TOLERANCE)
    y, y_dot = c + h * np.sin(w * lifts), h * w * np.cos(w * lifts)

    def gap(t):
        s = t - lifts
        return y + y_dot * s - 0.5 * G * s * s - c - h * np.sin(w * t)

    lands = brentq(gap, lifts + 0.05, lifts + 0.25, xtol=1e-14)
    assert first(result, "impact").t == pytest.approx(lands, abs=TOLERANCE)
    slow = cam("test-wave", 0.99 * np.sqrt(G / h), (c, h * 0.99 * np.sqrt(G / h)), c=c, h=h)
    assert not any(e.kind == "lift" for e in run(slow, 0.5).events)


@pytest.mark.slow
def test_a_roller_follows_an_eccentric():
    """The centres are a + R apart: y = e sin(w t) + sqrt((a + R)^2 - (e cos(w t))^2)."""
    a, e, w, radius = 0.2, 0.05, 3.0, 0.06
    far = a + radius
    start = np.sqrt(far**2 - e**2), e * w
    result = run(cam("test-eccentric", w, start, radius, a=a, e=e), 2.0)
    angle = w * result.t
    y = e * np.sin(angle) + np.sqrt(far**2 - (e * np.cos(angle)) ** 2)
    assert result.r[:, 1, 1] == pytest.approx(y, abs=TOLERANCE)
    assert set(result.contact("contact").mode) == {1}
