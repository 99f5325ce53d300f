"""Friction of joints that sticks, by the load of its joint, against closed forms.

Tolerances: at rtol 1e-12 a run leaves some 1e-12 of its coordinates, and instants are located where
a slip is below 1e-11 of its first speed.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from support.plain import long_in_plain_python

import dap3d_core as dap

TIGHT = {"rtol": 1e-12, "atol": 1e-14}
G = 9.81


def incline(angle, mu=0.4, **fields):
    scene = dap.Scene(name="incline")
    scene.add_body("block", mass=2.0, Jp=(0.1, 0.2, 0.3))
    scene.add_vector("down", "ground", (np.cos(angle), 0.0, -np.sin(angle)))
    scene.add_joint("tran", "guide", P_i="block.O", P_j="ground.O", a_j="down")
    scene.add_force("weight", "gravity")
    scene.add_force("friction", "rub", joint="guide", mu=mu, **fields)
    return scene


def wheel(spin=0.0, mu=0.3, radius=0.02, m=5.0, inertia=0.1, **fields):
    scene = dap.Scene(name="wheel")
    scene.add_body("wheel", mass=m, Jp=[inertia] * 3, w=(0.0, spin, 0.0))
    axis = {"P_i": "wheel.O", "P_j": "ground.O", "a_i": "wheel.y", "a_j": "ground.y"}
    scene.add_joint("rev", "pin", **axis, **fields)
    scene.add_force("weight")
    scene.add_force("friction", "rub", joint="pin", mu=mu, radius=radius)
    return scene, mu * radius * m * G, inertia


@pytest.mark.parametrize("part", [0.95, 0.999])
def test_a_block_on_a_slope_stays(part):
    """Within its cone it does not move by 1e-14 m in 1000 s; its friction is its weight's part."""
    angle = np.arctan(0.4 * part)
    result = dap.simulate(incline(angle), t_end=1000.0, dt=500.0, **TIGHT)
    assert np.abs(result.r).max() < 1e-14
    assert np.abs(result.rd).max() < 1e-15
    rub = result.contact("rub")
    assert list(rub.mode) == [2, 2, 2]
    assert rub.normal_force[-1] == pytest.approx(2.0 * G * np.cos(angle), rel=1e-12)
    held = np.linalg.norm(rub.friction[-1])
    assert held == pytest.approx(2.0 * G * np.sin(angle), rel=1e-12)


def test_a_block_beyond_its_cone_slides():
    """A = g (sin - mu cos) from the start on; mu_s holds it there."""
    angle = np.arctan(0.4 * 1.05)
    result = dap.simulate(incline(angle), t_end=1.0, dt=0.5, **TIGHT)
    a = G * (np.sin(angle) - 0.4 * np.cos(angle))
    assert np.linalg.norm(result.rdd[-1, 0]) == pytest.approx(a, rel=1e-12)
    assert np.linalg.norm(result.r[-1, 0]) == pytest.approx(0.5 * a, rel=1e-12)
    assert abs(result.ledger["energy"].value) < 1e-9
    held = dap.simulate(incline(angle, mu_s=0.43), t_end=1.0, dt=0.5, **TIGHT)
    assert np.abs(held.r).max() < 1e-14


@pytest.mark.parametrize("integrator", ["dop853", "adams", "radau"])
def test_a_loaded_pin_stops_its_wheel(integrator):
    """I w' = -mu R m g: at rest after I w / M, at I w^2 / (2 M)."""
    scene, moment, inertia = wheel(spin=2.0)
    result = dap.simulate(scene, t_end=8.0, dt=1.0, integrator=integrator, **TIGHT)
    (stick,) = result.events
    assert stick.t == pytest.approx(inertia * 2.0 / moment, rel=0, abs=1e-9)
    far = 0.5 * inertia * 2.0**2 / moment
    assert result.quantity("pin.angle").values[-1] == pytest.approx(far, abs=1e-11)
    assert not result.w[-1].any()
    assert result.work[-1] == pytest.approx(-0.5 * inertia * 2.0**2, abs=1e-11)


@pytest.mark.parametrize("part", [0.99, 1.01])
def test_a_loaded_hinge_holds_up_to_its_friction(part):
    scene, moment, inertia = wheel()
    scene.add_force("motor", "push", joint="pin", torque=part * moment)
    result = dap.simulate(scene, t_end=10.0, dt=5.0, **TIGHT)
    angle = result.quantity("pin.angle").values[-1]
    turned = 0.5 * max(part - 1.0, 0.0) * moment / inertia * 100.0
    assert angle == pytest.approx(turned, rel=1e-10, abs=1e-14)


def test_a_door_with_a_loaded_hinge_strikes_its_limit():
    """From 4 rad/s to 1 rad by friction, back with e of its speed, and to rest by friction."""
    scene, moment, inertia = wheel(spin=4.0, upper=1.0, e=0.5)
    result = dap.simulate(scene, t_end=6.0, dt=0.5, **TIGHT)
    a = moment / inertia
    at_limit = np.sqrt(16.0 - 2.0 * a)
    assert [event.kind for event in result.events] == ["impact", "stick"]
    ends = (4.0 - at_limit) / a + 0.5 * at_limit / a
    assert result.events[1].t == pytest.approx(ends, rel=0, abs=1e-9)
    back = (0.5 * at_limit) ** 2 / (2.0 * a)
    assert result.quantity("pin.angle").values[-1] == pytest.approx(1.0 - back, abs=1e-11)


def test_a_block_on_a_belt_sticks_and_slips():
    """On a belt at V, held by a spring; d = (mu_s - mu) m g / k, w^2 = k / m.

    It slips for 2 (pi - atan(d w / V)) / w, and sticks while the belt moves on by 2 d.
    """
    m, k, V, mu, mu_s = 2.0, 50.0, 0.3, 0.15, 0.25
    scene = dap.Scene(name="belt")
    scene.add_body("block", mass=m, Jp=(0.1, 0.1, 0.1), r_dot=(V, 0.0, 0.0))
    scene.add_body("belt", mass=100.0, r_dot=(V, 0.0, 0.0))
    scene.add_function("a", "ramp", coeff=(0.0, V, 0.0))
    along = {"P_j": "ground.O", "a_j": "ground.x"}
    scene.add_joint("tran", "way", P_i="belt.O", **along)
    scene.add_joint("drive-tran", "drive", P_i="belt.O", **along, function="ramp")
    scene.add_joint("tran", "top", P_i="block.O", P_j="belt.O", a_j="belt.x")
    scene.add_force("weight")
    scene.add_force("friction", "rub", joint="top", mu=mu, mu_s=mu_s)
    scene.add_force("tran_sda", "spring", P_i="block.O", **along, k=k)
    result = dap.simulate(scene, t_end=4.0, dt=0.25, **TIGHT)
    d, w = (mu_s - mu) * m * G / k, np.sqrt(k / m)
    slips, sticks = 2.0 * (np.pi - np.arctan(d * w / V)) / w, 2.0 * d / V
    first = mu_s * m * G / (k * V)
    expected = [first, first + slips, first + slips + sticks, first + 2.0 * slips + sticks]
    assert [event.kind for event in result.events][:4] == ["slip", "stick"] * 2
    instants = [event.t for event in result.events[:4]]
    assert instants == pytest.approx(expected, rel=0, abs=1e-9)
    assert abs(result.ledger["energy"].value) < 1e-9


@pytest.mark.slow
def test_an_overhung_shaft_in_two_bearings():
    """Bearings at 0 and L, the mass c before them: loads m g (1 + c / L) and m g c / L."""
    m, inertia, spin, c, L, mu, R = 3.0, 0.02, 30.0, 0.1, 0.4, 0.2, 0.01
    scene = dap.Scene(name="shaft")
    scene.add_body("shaft", mass=m, Jp=(inertia, 0.1, 0.1), r=(-c, 0, 0), w=(spin, 0.0, 0.0))
    scene.add_body("sleeve", mass=0.1, r=(L, 0.0, 0.0))
    scene.add_point("fixed", "shaft", (c, 0.0, 0.0))
    scene.add_point("floating", "shaft", (c + L, 0.0, 0.0))
    scene.add_joint("sph", "first", P_i="fixed", P_j="ground.O")
    scene.add_joint("sph", "second", P_i="floating", P_j="sleeve.O")
    scene.add_joint("tran", "guide", P_i="sleeve.O", P_j="ground.O", a_j="ground.x")
    scene.add_force("weight")
    for name in ("first", "second"):
        scene.add_force("friction", f"rub_{name}", joint=name, mu=mu, radius=R)
    stops = inertia * spin / (mu * R * m * G * (1.0 + 2.0 * c / L))
    result = dap.simulate(scene, t_end=1.2 * stops, dt=0.2 * stops, **TIGHT)
    assert [event.kind for event in result.events] == ["stick", "stick"]
    assert result.events[0].t == pytest.approx(stops, rel=0, abs=1e-9)
    assert np.abs(result.w[-1]).max() < 1e-14  # 30 rad/s has a rounding of 7e-15
    load = result.contact("rub_second").normal_force
    assert load[:-2] == pytest.approx(m * G * c / L, rel=1e-9)


def socket(w=(0.0, 0.0, 0.0), m=2.0, inertia=0.05, mu=0.3, radius=0.04):
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=m, Jp=[inertia] * 3, w=tuple(w))
    scene.add_joint("sph", "socket", P_i="ball.O", P_j="ground.O")
    scene.add_force("weight")
    scene.add_force("friction", "rub", joint="socket", mu=mu, radius=radius)
    return scene, mu * radius * m * G, inertia


def test_a_ball_joint_stops_about_any_axis():
    """A ball of inertia J about its centre: w' = -mu R m g / J along w, which keeps its way."""
    w = np.array([1.0, -2.0, 2.0])
    scene, moment, inertia = socket(w)
    result = dap.simulate(scene, t_end=1.0, dt=0.125, **TIGHT)
    a = moment / inertia
    (stick,) = result.events
    assert stick.t == pytest.approx(3.0 / a, rel=0, abs=1e-9)
    wanted = np.maximum(1.0 - a * result.t / 3.0, 0.0)[:, None] * w
    assert result.w[:, 0] == pytest.approx(wanted, abs=1e-11)


@pytest.mark.parametrize("part", [0.99, 1.01])
def test_a_ball_joint_holds_in_all_directions(part):
    """A moment about an oblique axis, against mu R m g."""
    about = np.array([1.0, -2.0, 2.0]) / 3.0
    scene, moment, inertia = socket()
    scene.add_force("n", "push", body_i="ball", n=tuple(part * moment * about))
    result = dap.simulate(scene, t_end=1.0, dt=0.5, **TIGHT)
    a = max(part - 1.0, 0.0) * moment / inertia
    assert result.w[-1, 0] == pytest.approx(a * about, rel=1e-9, abs=1e-15)


def test_a_sleeve_sticks_along_and_about_its_rod():
    """Each has its own limit: it slides for v / (mu g), and turns for J w / (mu R m g)."""
    m, inertia, mu, R, v, w = 2.0, 0.05, 0.3, 0.04, 1.5, 4.0
    scene = dap.Scene(name="sleeve")
    scene.add_body("sleeve", mass=m, Jp=[inertia] * 3, r_dot=(v, 0, 0), w=(w, 0, 0))
    scene.add_joint("cyl", "rod", P_i="sleeve.O", P_j="ground.O", a_i="sleeve.x", a_j="ground.x")
    scene.add_force("weight")
    scene.add_force("friction", "rub", joint="rod", mu=mu, radius=R)
    result = dap.simulate(scene, t_end=1.5, dt=0.25, **TIGHT)
    found = {event.name: event.t for event in result.events}
    wanted = {"rub#1": v / (mu * G), "rub#2": inertia * w / (mu * R * m * G)}
    assert found == pytest.approx(wanted, rel=0, abs=1e-9)
    assert result.r[-1, 0, 0] == pytest.approx(0.5 * v**2 / (mu * G), abs=1e-11)
    assert result.contact("rub").mode[-1].tolist() == [2, 2]


def test_a_disk_slides_in_the_plane_and_then_rolls():
    """Upright, sliding sideways: its rim is at rest after v / (mu m g (1 / m + R^2 / J))."""
    mu, R, m, J, v = 0.2, 0.5, 3.0, 5.0, 2.0
    scene = dap.Scene(name="disk")
    scene.add_body("disk", mass=m, Jp=(J, J, J), r=(0.0, 0.0, R), r_dot=(v, 0.0, 0.0))
    scene.add_joint("disk", "plane", body_i="disk", slip="z", radius=R)
    scene.add_force("weight")
    scene.add_force("friction", "rub", joint="plane", mu=mu)
    stops = v / (mu * m * G * (1.0 / m + R * R / J))
    result = dap.simulate(scene, t_end=1.5 * stops, dt=0.5 * stops, **TIGHT)
    assert result.events[0].kind == "stick"
    assert result.events[0].t == pytest.approx(stops, rel=0, abs=1e-9)
    assert result.rd[-1, 0, 0] == pytest.approx(v - mu * G * stops, abs=1e-9)
    assert result.w[-1, 0, 1] == pytest.approx(mu * m * G * R / J * stops, abs=1e-9)


M, L, J, MU, R = 1.0, 0.5, 0.01, 0.5, 0.15  # of the pendulum


def pendulum():
    scene = dap.Scene(name="pendulum")
    scene.add_body("bob", mass=M, Jp=(J, J, J), r=(L, 0.0, 0.0))
    scene.add_point("top", "bob", (-L, 0.0, 0.0))
    axis = {"P_i": "top", "P_j": "ground.O", "a_i": "bob.y", "a_j": "ground.y"}
    scene.add_joint("rev", "pin", **axis)
    scene.add_force("weight")
    scene.add_force("friction", "rub", joint="pin", mu=MU, radius=R)
    return scene


def deceleration(angle, rate):
    """t'' of an independent solution: the load N of the pin has t'' in it, and so itself.

    I t'' = -m g L sin t - mu R |N| sign t';  N = m (g cos t + L t'^2, g sin t + L t'').
    """

    def over(N):
        a = (-M * G * L * np.sin(angle) - MU * R * N * np.sign(rate)) / (J + M * L * L)
        radial = G * np.cos(angle) + L * rate**2
        return M * np.hypot(radial, G * np.sin(angle) + L * a) - N, a

    return over(brentq(lambda N: over(N)[0], 0.0, 1e3, xtol=1e-14, rtol=1e-14))[1]


def test_a_pendulum_whose_load_depends_on_its_friction():
    """Against an integration by scipy; it comes to rest, and has lost what friction took."""
    result = dap.simulate(pendulum(), t_end=20.0, dt=0.05, **TIGHT)
    times = result.t[(result.t > 0.0) & (result.t < 0.55)]  # before it turns back
    start = [-0.5 * np.pi, 1e-300]
    own = solve_ivp(lambda t, y: [y[1], deceleration(*y)], (0.0, times[-1]), start, "DOP853",
                    times, rtol=1e-12, atol=1e-13)  # fmt: skip
    x, z = L * np.sin(own.y[0]), -L * np.cos(own.y[0])
    k = len(times) + 1
    found = np.hypot(result.r[1:k, 0, 0] + x, result.r[1:k, 0, 2] - z)
    assert found.max() < 1e-10
    assert result.events[-1].kind == "stick"
    assert np.abs(result.w[-1]).max() < 1e-15
    assert abs(result.ledger["energy"].value) < 1e-9


def test_a_linearisation_while_it_slides_has_the_friction():
    """The derivative of t'' by t', by differences of the independent solution."""
    scene = pendulum()
    result = dap.simulate(scene, t_end=0.4, dt=0.2, **TIGHT)
    lin = dap.linearize(scene, at=result, t=0.2)
    angle = result.quantity("pin.angle").values[1] - 0.5 * np.pi
    rate, h = result.w[1, 0, 1], 1e-5
    slope = (deceleration(angle, rate + h) - deceleration(angle, rate - h)) / (2.0 * h)
    assert lin.A[1, 1] == pytest.approx(slope, rel=1e-7)  # of differences: h^2, and rounding / h


@pytest.mark.parametrize("push", [1.0, 1e3, 1e6])
def test_a_wedge_beyond_the_angle_of_friction_jams(push):
    """Pushed at an angle to the normal with tan < mu nothing moves, however large the force."""
    for tangent, moves in ((0.39, False), (0.41, True)):
        scene = dap.Scene(name="wedge")
        scene.add_body("block", mass=2.0, Jp=(0.1, 0.2, 0.3))
        scene.add_joint("tran", "guide", P_i="block.O", P_j="ground.O", a_j="ground.x")
        scene.add_force("f", "push", body_i="block", f=(tangent * push, 0.0, -push))
        scene.add_force("friction", "rub", joint="guide", mu=0.4)
        result = dap.simulate(scene, t_end=1.0, dt=0.5, **TIGHT)
        a = (tangent - 0.4) * push / 2.0 if moves else 0.0
        assert result.r[-1, 0, 0] == pytest.approx(0.5 * a, rel=1e-9, abs=1e-14)
        assert not moves or abs(result.ledger["energy"].value) < 1e-9


def leaning_disk(direction, **friction):
    """A disk of 1 kg, 0.5 m and 5e-3 kg m^2 that leans by 45 degrees and slides along y."""
    lean = np.pi / 4
    scene = dap.Scene(name="paradox")
    p = (np.cos(lean / 2), np.sin(lean / 2), 0.0, 0.0)  # the disk's axis to (0, 1, 1) / sqrt 2
    scene.add_body("disk", mass=1.0, Jp=[5e-3] * 3, p=p, r=(0.0, 0.0, 0.5 * np.cos(lean)),
                   r_dot=(0.0, direction, 0.0))  # fmt: skip
    scene.add_joint("disk", "plane", body_i="disk", slip="z", radius=0.5)
    scene.add_force("weight")
    scene.add_force("friction", "rub", joint="plane", **friction)
    return scene


@pytest.mark.parametrize(("mu", "direction"), [(3.0, -1.0), (1.0, 1.0), (3.0, 1.0)])
def test_a_leaning_disk_and_its_paradox(mu, direction):
    """Painleve: N (1 / m + c^2 R^2 / J -+ mu sigma c R^2 / J) = g, and none where that is negative.

    A jam is named; before it N is right to 1e-9, however near.
    """
    scene = leaning_disk(direction, mu=mu)
    part = 0.5 * 0.5**2 / 5e-3
    carries = 1.0 + part - direction * mu * part
    if carries < 0.0:
        with pytest.raises(dap.SimulationError, match="contact rub jams: its friction presses"):
            dap.simulate(scene, t_end=0.0)
    else:
        result = dap.simulate(scene, t_end=0.0)
        assert result.Lam[0, 0] == pytest.approx(G / carries, rel=1e-9)


def slider_crank(torque, mu, kind="friction"):
    """Crank, rod and slider, with friction in all joints."""
    scene, L1, L2, turned = dap.Scene(name="slider-crank"), 0.2, 0.5, 0.3
    lean = -np.arcsin(L1 * np.sin(turned) / L2)
    B = L1 * np.array([np.cos(turned), 0.0, -np.sin(turned)])
    C = np.array([B[0] + L2 * np.cos(lean), 0.0, 0.0])
    for name, J, r, angle in (("crank", 0.01, B / 2, turned), ("rod", 0.02, (B + C) / 2, lean),
                              ("slider", 0.02, C, 0.0)):  # fmt: skip
        p = (np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0)
        scene.add_body(name, mass=1.0, Jp=(J, J, J), r=tuple(r), p=p)
    for name, body, x in (("A", "crank", -L1), ("B", "crank", L1), ("B2", "rod", -L2),
                          ("C", "rod", L2)):  # fmt: skip
        scene.add_point(name, body, (x / 2, 0.0, 0.0))
    axis = {"a_i": "crank.y", "a_j": "ground.y"}
    scene.add_joint("rev", "main", P_i="A", P_j="ground.O", **axis)
    scene.add_joint("sph", "big_end", P_i="B", P_j="B2")
    scene.add_joint("sph", "small_end", P_i="C", P_j="slider.O")
    scene.add_joint("tran", "guide", P_i="slider.O", P_j="ground.O", a_j="ground.x")
    scene.add_force("weight")
    scene.add_force("n", "push", body_i="crank", n=(0.0, torque, 0.0))
    if kind == "friction":
        for name in scene.joints:
            radius = {} if name == "guide" else {"radius": 0.02}
            scene.add_force("friction", f"rub_{name}", joint=name, mu=mu, **radius)
    else:
        scene.add_force("rot_friction", "rub_main", joint="main", n_c=0.3)
        scene.add_force("tran_friction", "rub_guide", joint="guide", f_c=3.0)
        ends = {"body_i": "rod", "body_j": "slider", "axis": "slider.y"}
        scene.add_force("rot_friction", "rub_end", **ends, n_c=0.2)
    return scene


def chain(n):
    """A chain of rods that falls from where it lies level, with friction in each of its hinges."""
    scene, L, m, last, axis = dap.Scene(name="chain"), 0.3, 0.5, "ground.O", "ground.y"
    J = m * L * L / 12
    for k in range(n):
        scene.add_body(f"b{k}", mass=m, Jp=(0.0005, J, J), r=((k + 0.5) * L, 0.0, 0.0))
        scene.add_point(f"a{k}", f"b{k}", (-L / 2, 0.0, 0.0))
        scene.add_point(f"e{k}", f"b{k}", (L / 2, 0.0, 0.0))
        ends = {"P_i": f"a{k}", "P_j": last, "a_i": f"b{k}.y", "a_j": axis}
        scene.add_joint("rev", f"j{k}", **ends)
        scene.add_force("friction", f"rub{k}", joint=f"j{k}", mu=0.2, radius=0.01)
        last, axis = f"e{k}", f"b{k}.y"
    scene.add_force("weight")
    return scene


@pytest.mark.parametrize(("mu", "kind"), [(0.3, "friction"), (0.8, "friction"), (0.0, "constant")])
def test_a_mechanism_comes_to_rest_in_all_its_joints(mu, kind):
    """All of them stick at one instant, share what they hold, and stay: nothing moves from then on.

    Two freedoms, and eight rows of friction: shares that the joints' cones allow are found.
    """
    result = dap.simulate(slider_crank(0.0, mu, kind), t_end=5.0, dt=0.5, rtol=1e-11, atol=1e-13)
    kinds = [event.kind for event in result.events]
    assert kinds == ["stick"] * len(result.contact_names)
    assert len({round(event.t, 9) for event in result.events}) == 1
    after = result.t > result.events[0].t
    still = result.r[after]
    assert np.abs(still - still[0]).max() < 1e-13
    assert abs(result.ledger["energy"].value) < 1e-9
    for name in result.contact_names:
        rub = result.contact(name)
        if kind == "friction":
            limit = mu * (1.0 if name == "rub_guide" else 0.02) * rub.normal_force
            assert np.all(np.linalg.norm(rub.friction, axis=-1) <= limit * (1.0 + 1e-9))


@pytest.mark.slow
def test_a_mechanism_that_is_driven_keeps_its_energy():
    """Loads of four joints that depend on each other: what is lost is what friction took."""
    scene = slider_crank(5.0, 0.3)
    result = dap.simulate(scene, t_end=1.0, dt=0.1, **TIGHT)
    assert np.linalg.norm(result.w[-1, 0]) > 5.0
    assert abs(result.ledger["energy"].value) < 1e-9


@pytest.mark.slow
@long_in_plain_python
@pytest.mark.parametrize(
    ("scene", "t_end"),
    [(slider_crank(0.0, 0.3), 2.0), (slider_crank(5.0, 0.3), 0.3), (chain(8), 0.12)],
    ids=["to rest", "driven", "chain"],
)
def test_joint_coordinates_give_the_same(scene, t_end):
    """Loads of joints of the tree, and of the one that closes the loop; some stick, some slide."""
    given = {"t_end": t_end, "dt": t_end / 4} | TIGHT
    result, other = (dap.simulate(scene, method=method, **given) for method in ("joint", "lsq"))
    assert result.method == "joint"
    events = [[(event.kind, event.name) for event in run.events] for run in (result, other)]
    assert events[0] == events[1]
    assert np.abs(result.r - other.r).max() < 1e-10
    for name in result.contact_names:
        one, two = result.contact(name), other.contact(name)
        assert np.array_equal(one.mode, two.mode)
        assert one.normal_force == pytest.approx(two.normal_force, rel=1e-9)
        assert one.friction == pytest.approx(two.friction, rel=1e-9, abs=1e-9)


@pytest.mark.long
@pytest.mark.slow
def test_modes_of_many_hinges_end_at_rounding():
    """What twenty hinges hold is found to 1e-9 of it, which is no jam; it stays in their cones."""
    result = dap.simulate(chain(20), t_end=0.015, dt=0.005)
    assert len(result.events) > 10
    for name in result.contact_names:
        rub = result.contact(name)
        limit = 0.2 * 0.01 * rub.normal_force
        assert np.all(np.linalg.norm(rub.friction, axis=-1) <= limit * (1.0 + 1e-6) + 1e-9)


def test_a_joint_without_load_has_no_friction():
    """It neither slows what moves nor stops the run where load and friction are both zero."""
    scene = dap.Scene(name="free")
    scene.add_body("block", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(1.0, 0.0, 0.0))
    scene.add_joint("tran", "way", P_i="block.O", P_j="ground.O", a_j="ground.x")
    scene.add_force("friction", "rub", joint="way", mu=0.3)
    assert dap.simulate(scene, t_end=1.0, dt=0.5).r[-1, 0, 0] == 1.0
    ends = {"P_i": "block.O", "P_j": "ground.O", "a_j": "ground.x"}
    scene.add_force("tran_sda", "spring", **ends, k=50.0)
    result = dap.simulate(scene, t_end=5.0, dt=0.5, **TIGHT)
    assert result.r[-1, 0, 0] == pytest.approx(np.cos(25.0), abs=1e-10)


def test_what_sticks_holds_no_less_than_what_slides():
    with pytest.raises(dap.SceneError, match=r"forces\.rub\.mu_s = 0\.3.*is less than mu = 0\.4"):
        dap.simulate(incline(0.1, mu_s=0.3), t_end=0.1)


def test_a_pin_without_a_radius_is_named():
    scene, *_ = wheel()
    del scene.forces["rub"].fields["radius"]
    with pytest.raises(dap.SceneError, match=r"forces\.rub\.radius.*which friction in rev needs"):
        dap.compile(scene)


def test_what_takes_no_contacts_says_so():
    with pytest.raises((dap.SceneError, dap.SimulationError), match=r"v_tol|contacts"):
        dap.simulate(incline(0.1), t_end=0.1, method="standard")
