"""Contacts and joints at curves of a parameter against closed forms, to 1e-9 at rtol 1e-12."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipk

import dap3d_core as dap

G = 9.81
TIGHT = {"rtol": 1e-12, "atol": 1e-14, "dt": 0.1, "integrator": "dop853"}
TOLERANCE = 1e-9
TURN = 2.0 * np.pi
#: The cam: a circle of radius A about (E, 0), and a roller of radius R on it.
A, E, R, RATE = 0.2, 0.05, 0.06, 3.0


def first(result, kind):
    """The first event of a kind."""
    return next(event for event in result.events if event.kind == kind)


def add_harmonics(scene, **functions):
    """Functions offset + amplitude sin(s + phase), by name."""
    for name, (offset, amplitude, phase) in functions.items():
        fields = {"offset": offset, "amplitude": amplitude, "phase": phase, "frequency": 1.0}
        scene.add_function("harmonic", name, **fields)


def add_circle(scene, backwards=False):
    """The cam by x and y over the angle of its radius."""
    start = -1.0 if backwards else 1.0
    add_harmonics(scene, x=(E, start * A, start * 0.5 * np.pi), y=(0.0, A, 0.0))


def add_spline(scene, count=48):
    """The same through points of a table, as of a measured cam."""
    s = np.linspace(0.0, TURN, count + 1)
    x, y = E + A * np.cos(s), A * np.sin(s)
    y[-1], x[-1] = y[0], x[0]
    scene.add_function("spline", "x", x=list(s), y=list(x), periodic=True)
    scene.add_function("spline", "y", x=list(s), y=list(y), periodic=True)


def height(t, rate=RATE):
    """The roller's centre is A + R from that of the circle; and its two rates."""
    a, far = rate * t, A + R
    root = np.sqrt(far**2 - (E * np.cos(a)) ** 2)
    slope = E * E * np.sin(a) * np.cos(a) / root
    bend = (E * E * np.cos(2.0 * a) - slope**2) / root
    return (
        E * np.sin(a) + root,
        rate * (E * np.cos(a) + slope),
        rate**2 * (bend - E * np.sin(a)),
    )


def cam(add_curve, rate=RATE, **contact):
    """A roller that slides along y on a cam about the origin, which turns at a rate."""
    scene = dap.Scene(name="cam")
    scene.add_body("cam", mass=1.0, Jp=[1.0] * 3, w=[0.0, 0.0, rate])
    axle = {"P_i": "cam.O", "P_j": "ground.O", "a_i": "cam.z", "a_j": "ground.z"}
    scene.add_joint("rev", "axle", **axle)
    scene.add_function("a", "turn", coeff=[0.0, rate, 0.0])
    scene.add_joint("drive-rot", "drive", joint="axle", function="turn")
    y, y_dot, _ = height(0.0, rate)
    scene.add_body("roller", mass=0.5, Jp=[1.0] * 3, r=[0.0, y, 0.0], r_dot=[0.0, y_dot, 0.0])
    scene.add_joint("tran", "guide", P_i="roller.O", P_j="ground.O", a_j="ground.y")
    scene.add_force("weight", "g", wgt=[0.0, -1.0, 0.0])
    add_curve(scene)
    curve = {"x": "x", "y": "y", "s_max": TURN, "closed": True}
    scene.add_contact("point_curve", "contact", P_i="roller.O", P_j="cam.O",
                      **({"radius": R} | curve | contact))  # fmt: skip
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("backwards", [False, True])
def test_a_roller_follows_an_eccentric(backwards):
    """Whichever way round the curve is given."""
    result = dap.simulate(cam(lambda scene: add_circle(scene, backwards)), t_end=2.0, **TIGHT)
    y, y_dot, y_ddot = height(result.t)
    assert result.r[:, 1, 1] == pytest.approx(y, abs=TOLERANCE)
    assert result.rd[:, 1, 1] == pytest.approx(y_dot, abs=TOLERANCE)
    assert result.rdd[:, 1, 1] == pytest.approx(y_ddot, abs=1e-8)
    assert set(result.contact("contact").mode) == {1}
    at = result.contact("contact").at[:, :2]
    centre = E * np.stack([np.cos(RATE * result.t), np.sin(RATE * result.t)], axis=1)
    assert np.linalg.norm(at - centre, axis=1) == pytest.approx(A, abs=TOLERANCE)


@pytest.mark.slow
def test_a_roller_follows_a_table():
    """Cubic splines of the circle are off by 5/384 h^4 A at most, twice that with both."""
    result = dap.simulate(cam(add_spline), t_end=2.0, **(TIGHT | {"rtol": 1e-9, "atol": 1e-11}))
    bound = 2.0 * 5.0 / 384.0 * (TURN / 48) ** 4 * A
    assert result.r[:, 1, 1] == pytest.approx(height(result.t)[0], abs=bound)
    assert set(result.contact("contact").mode[1:]) == {1}  # a gap of the splines' error at first


def test_a_spring_loses_its_cam():
    """The roller lifts where m y'' = -m g - k (y - y_0 + f), falls back, and stays."""
    rate, k, f = 30.0, 100.0, 0.02
    scene = cam(add_circle, rate)
    scene.add_point("seat", body="ground", sPp=[0.0, 0.6, 0.0])
    free = 0.6 - height(0.0)[0] + f
    scene.add_force("ptp", "spring", P_i="roller.O", P_j="seat", k=k, l0=free)
    result = dap.simulate(scene, t_end=0.25, **TIGHT)

    def load(t):
        y, _, y_ddot = height(t, rate)
        return 0.5 * (y_ddot + G) + k * (free - 0.6 + y)

    lifts = brentq(load, 0.0, 0.5 * np.pi / rate, xtol=1e-15)
    assert first(result, "lift").t == pytest.approx(lifts, abs=TOLERANCE)
    # m y'' = -m g - k (y - s), about its own place of rest
    rest, omega = 0.6 - free - 0.5 * G / k, np.sqrt(k / 0.5)
    y, y_dot, _ = height(lifts, rate)

    def gap(t):
        a = omega * (t - lifts)
        return rest + (y - rest) * np.cos(a) + y_dot / omega * np.sin(a) - height(t, rate)[0]

    lands = brentq(gap, lifts + 0.01, lifts + 0.25, xtol=1e-15)
    assert first(result, "impact").t == pytest.approx(lands, abs=TOLERANCE)


@pytest.mark.slow
def test_the_nearest_point_of_all_counts():
    """A point flies through an ellipse, where up to four feet of perpendiculars compete."""
    scene = dap.Scene(name="ellipse")
    start, speed = np.array([-1.7, 0.21, 0.0]), np.array([3.4, 0.13, 0.0])
    scene.add_body("p", mass=1.0, Jp=[1.0] * 3, r=list(start), r_dot=list(speed))
    add_harmonics(scene, x=(0.0, 2.0, 0.5 * np.pi), y=(0.0, 1.0, 0.0))
    scene.add_contact("point_curve", "wall", P_i="p.O", x="x", y="y", s_max=TURN, closed=True,
                      side="below")  # fmt: skip
    result = dap.simulate(scene, t_end=1.0, **(TIGHT | {"dt": 0.01}))
    s = np.linspace(0.0, TURN, 200_001)
    x, y = 2.0 * np.cos(s), np.sin(s)
    place = start + result.t[:, None] * speed
    # of a least distance the points are within h / 2 = 3e-5 m: an error of its square
    least = [np.min(np.hypot(x - p[0], y - p[1])) for p in place]
    assert result.contact("wall").gap == pytest.approx(least, abs=1e-8)


@pytest.mark.slow
def test_a_ball_leaves_a_wire():
    """On a ring of radius a it leaves at cos = 2/3 + v^2 / (3 g L), L = a + radius + radius_j."""
    a, radius, thick, v = 0.5, 0.08, 0.02, 0.4
    far = a + radius + thick
    scene = dap.Scene(name="ring")
    scene.add_body("ball", mass=0.7, Jp=[1e-3] * 3, r=[0.0, 0.0, far], r_dot=[v, 0.0, 0.0])
    scene.add_force("weight", "g")
    add_harmonics(scene, x=(0.0, a, 0.5 * np.pi), z=(0.0, a, 0.0))
    scene.add_function("a", "y", coeff=[0.0, 0.0, 0.0])
    scene.add_contact("point_curve", "wire", P_i="ball.O", x="x", y="y", z="z", s_max=TURN,
                      closed=True, radius=radius, radius_j=thick)  # fmt: skip
    result = dap.simulate(scene, t_end=1.0, **TIGHT)
    lift = first(result, "lift")
    c = 2.0 / 3.0 + v * v / (3.0 * G * far)
    assert lift.u[:3] == pytest.approx([far * np.sqrt(1.0 - c * c), 0.0, far * c], abs=TOLERANCE)
    assert result.ledger["energy"].value < TOLERANCE


@pytest.mark.slow
def test_a_ball_swings_in_a_pipe():
    """Let go level in a ring of pipe it is at the bottom at K(1/2) sqrt(L/g), pressed by 3 m g.

    A pendulum from a quarter turn; L = a + radius_j - radius to the outer wall.
    """
    a, pipe, radius, mass = 0.5, 0.1, 0.04, 0.7
    far = a + pipe - radius
    scene = dap.Scene(name="pipe")
    scene.add_body("ball", mass=mass, Jp=[1e-3] * 3, r=[far, 0.0, 0.0])
    scene.add_force("weight", "g")
    add_harmonics(scene, x=(0.0, a, 0.5 * np.pi), z=(0.0, a, 0.0))
    scene.add_function("a", "flat", coeff=[0.0, 0.0, 0.0])
    scene.add_function("sum", "y", functions=["flat", "flat"])
    scene.add_contact("point_curve", "pipe", P_i="ball.O", x="x", y="y", z="z", s_max=TURN,
                      closed=True, radius=radius, radius_j=pipe, side="below")  # fmt: skip
    t = ellipk(0.5) * np.sqrt(far / G)
    result = dap.simulate(scene, t_end=t, **(TIGHT | {"dt": t}))
    assert result.r[-1, 0] == pytest.approx([0.0, 0.0, -far], abs=TOLERANCE)
    assert result.rd[-1, 0] == pytest.approx([-np.sqrt(2.0 * G * far), 0.0, 0.0], abs=TOLERANCE)
    contact = result.contact("pipe")
    assert contact.normal_force[-1] == pytest.approx(3.0 * mass * G, abs=1e-8)
    assert contact.at[-1] == pytest.approx([0.0, 0.0, -a - pipe], abs=TOLERANCE)


@pytest.mark.slow
def test_a_ball_rests_on_two_parts_of_a_hollow():
    """In y = k x^2, where 1 + y'^2 = (2 k R)^2: each pushes m g k R; none beyond its end."""
    k, radius, mass = 40.0, 0.1, 0.5
    slope = np.sqrt((2.0 * k * radius) ** 2 - 1.0)
    scene = dap.Scene(name="hollow")
    scene.add_body("ball", mass=mass, Jp=[1e-3] * 3, r=[0.0, 1.0, 0.0])
    scene.add_body("past", mass=mass, Jp=[1e-3] * 3, r=[1.2, 50.0, 0.0])
    scene.add_force("weight", "g", wgt=[0.0, -1.0, 0.0])
    scene.add_function("a", "x", coeff=[0.0, 1.0, 0.0])
    scene.add_function("a", "y", coeff=[0.0, 0.0, k])
    for body, name, ends in (("ball", "left", (-1.0, -0.03)), ("ball", "right", (0.03, 1.0)),
                             ("past", "past", (0.03, 1.0))):  # fmt: skip
        ends = {"s_min": ends[0], "s_max": ends[1]}
        scene.add_contact("point_curve", name, P_i=f"{body}.O", x="x", y="y", radius=radius,
                          **ends)  # fmt: skip
    result = dap.simulate(scene, t_end=1.0, **TIGHT)
    height = slope**2 / (4.0 * k) + 1.0 / (2.0 * k)  # of the point of contact, and of R / (2 k R)
    assert result.r[-1, 0] == pytest.approx([0.0, height, 0.0], abs=TOLERANCE)
    for name in ("left", "right"):
        assert result.contact(name).normal_force[-1] == pytest.approx(mass * G * k * radius)
    assert result.r[-1, 1, 1] == pytest.approx(50.0 - 0.5 * G, abs=TOLERANCE)


@pytest.mark.slow
def test_a_bead_slides_down_a_helix():
    """Along it by g sin(pitch) t^2 / 2, for several turns; the wire turned and moved on a body."""
    radius, rise = 0.3, 0.05
    size = np.hypot(radius, rise)
    scene = dap.Scene(name="helix")
    scene.add_body("bead", mass=0.2, Jp=[1e-4] * 3, r=[radius, 0.1, 0.0])
    scene.add_force("weight", "g")
    add_harmonics(scene, x=(0.0, radius, 0.5 * np.pi), y=(0.0, radius, 0.0))
    scene.add_function("a", "z", coeff=[0.0, rise, 0.0])
    scene.add_point("foot", body="ground", sPp=[0.0, 0.1, 0.0])
    scene.add_joint("oncurve", "wire", P_i="bead.O", P_j="foot", x="x", y="y", z="z")
    result = dap.simulate(scene, t_end=3.0, **TIGHT)
    s = -0.5 * G * rise / size**2 * result.t**2  # along it: size s
    assert s[-1] < -2.0 * TURN
    assert result.quantity("wire.s").values == pytest.approx(s, abs=TOLERANCE / radius)
    place = [radius * np.cos(s), 0.1 + radius * np.sin(s), rise * s]
    assert result.r[:, 0] == pytest.approx(np.transpose(place), abs=TOLERANCE)
    assert result.ledger["energy"].value < TOLERANCE


def test_a_pin_in_a_cycloid_keeps_its_period():
    """The arc from the bottom is S_0 cos(t sqrt(g / (4 a))), whatever S_0; along z it is free.

    x = a (s + sin(s)), y = a (1 - cos(s)), S = 4 a sin(s / 2).
    """
    a, s_0, drift = 0.25, 2.0, 0.3
    scene = dap.Scene(name="cycloid")
    place = [a * (s_0 + np.sin(s_0)), a * (1.0 - np.cos(s_0)), 0.0]
    scene.add_body("pin", mass=0.2, Jp=[1e-4] * 3, r=place, r_dot=[0.0, 0.0, drift])
    scene.add_force("weight", "g", wgt=[0.0, -1.0, 0.0])
    add_harmonics(scene, wave=(0.0, a, 0.0), y=(a, -a, 0.5 * np.pi))
    scene.add_function("a", "line", coeff=[0.0, a, 0.0])
    scene.add_function("sum", "x", functions=["wave", "line"])
    scene.add_joint("oncurve", "slot", P_i="pin.O", x="x", y="y", s_0=s_0)
    result = dap.simulate(scene, t_end=2.0, **TIGHT)
    s = 2.0 * np.arcsin(np.sin(0.5 * s_0) * np.cos(np.sqrt(G / (4.0 * a)) * result.t))
    expected = [a * (s + np.sin(s)), a * (1.0 - np.cos(s)), drift * result.t]
    assert result.r[:, 0] == pytest.approx(np.transpose(expected), abs=TOLERANCE)


def refused(words, add_curve=add_circle, **contact):
    """A cam with other fields is refused, in these words."""
    with pytest.raises(dap.SceneError, match=words):
        dap.compile(cam(add_curve, **contact))


def add_lines(x, y, **fields):
    """A table of points."""

    def add(scene):
        s = list(np.linspace(0.0, TURN, len(x)))
        scene.add_function("spline", "x", x=s, y=x, **fields)
        scene.add_function("spline", "y", x=s, y=y, **fields)

    return add


@pytest.mark.slow
@pytest.mark.parametrize("depth", [{"depth": 0.05}, {}])
def test_a_pin_passes_behind_a_wall_with_a_depth(depth):
    """And another one bounces off its front; without it all behind a wall is in the way."""
    scene = dap.Scene(name="wall")
    for name, coeff in (("x", [0.0, 1.0, 0.0]), ("y", [0.0, 0.0, 0.0])):
        scene.add_function("a", name, coeff=coeff)
    for name, r, v in (("behind", [-0.5, -0.1, 0.0], [2.0, 0.0, 0.0]),
                       ("front", [0.5, 0.3, 0.0], [0.0, -1.0, 0.0])):  # fmt: skip
        scene.add_body(name, mass=1.0, Jp=[1.0] * 3, r=r, r_dot=v)
        scene.add_contact("point_curve", f"of_{name}", P_i=f"{name}.O", radius=0.02, e=1.0,
                          x="x", y="y", s_max=1.0, **depth)  # fmt: skip
    if not depth:
        with pytest.raises(dap.SimulationError, match=r"t = 0\.25 s: contact of_behind.*0\.12 m"):
            dap.simulate(scene, t_end=1.0)
        return
    result = dap.simulate(scene, t_end=1.0, **TIGHT)
    assert [event.name for event in result.events if event.kind == "impact"] == ["of_front"]
    assert first(result, "impact").t == pytest.approx(0.28, abs=TOLERANCE)
    assert result.r[-1, :, :2] == pytest.approx(np.array([[1.5, -0.1], [0.5, 0.74]]))


@pytest.mark.slow
def test_curves_that_are_none_are_refused():
    """With what is wrong, where, and what to do."""
    corners = [0.2, 0.0, -0.2, 0.0, 0.2], [0.0, 0.2, 0.0, -0.2, 0.0]
    refused(r"not closed: its direction at s = 6.28.*periodic = true", add_lines(*corners))
    spiral = [0.2, 0.0, -0.2, 0.0, 0.21], corners[1]
    refused("not closed: its place at s = 6.28", add_lines(*spiral, periodic=True))
    refused("not closed: its place at s = 5", s_max=5.0)
    to_and_fro = [0.2, -0.2, 0.2], [0.0, 0.0, 0.0]
    refused(r"no direction at s = 0.* give points apart", add_lines(*to_and_fro, periodic=True))
    refused("two points or more", add_lines([0.2], [0.0]))

    def add_eight(scene):
        scene.add_function("harmonic", "x", amplitude=0.2, frequency=2.0)
        scene.add_function("harmonic", "y", amplitude=0.2, frequency=1.0)

    refused("crosses itself, near s = .* has no outside", add_eight)
    refused(r"0.3 m .* at s = .*, a hollow of radius 0.2 m: .* two", side="below", radius=0.3)
    s = np.linspace(0.0, TURN, 121)
    lobes = 1.0 + 0.7 * np.cos(2.0 * s)  # 0.6 wide in the middle
    waist = [*(lobes * np.cos(s))[:-1], 1.7], [*(lobes * np.sin(s))[:-1], 0.0]
    refused("0.31 m .* between s = .* and", add_lines(*waist, periodic=True), side="below",
            radius=0.31)  # fmt: skip
    dap.compile(cam(add_lines(*waist, periodic=True), side="below", radius=0.29))
    refused("s_max = -1 is not beyond s_min = 0", s_max=-1.0)
    refused("takes s_max, its end", s_max=None)
    refused("by x and y, or by x, y and z; this one has x", y=None)
    refused("radius_j is that of a wire or pipe", radius_j=0.1)
    refused(
        "depth is that behind a plane curve",
        x=None,
        y=None,
        function="x",
        s_max=None,
        closed=False,
        depth=0.1,
    )
