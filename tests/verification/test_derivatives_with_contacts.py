"""Derivatives of runs over touches, bounces and changes of modes, against closed forms."""

import numpy as np
import pytest
from fuzz.contacts import scene_of
from scipy.integrate import solve_ivp
from verification.test_contacts import TIGHT, G, ball
from verification.test_derivatives_of_runs import derivative
from verification.test_sticking_under_load import wheel

import dap3d_core as dap

#: Closed forms are met to rounding of located instants and sixth-order differences of jumps.
TOLERANCE = 1e-8


@pytest.mark.slow
def test_slide_distance_by_friction_and_speed():
    """A point mass stops at v^2 / (2 mu g), at the time v / (mu g)."""
    v, mu = 3.0, 0.3
    scene = dap.Scene(name="puck")
    scene.add_body("puck", mass=2.0, Jp=[0.01] * 3, r_dot=[v, 0.0, 0.0])
    scene.add_force("weight", "g")
    scene.add_contact("ball_plane", "floor", P_i="puck.O", mu=mu)
    by = ["contacts.floor.mu", "bodies.puck.r_dot.x"]
    found = dap.sensitivities(scene, by, t_end=2.0, dt=0.5, **TIGHT)
    exact = [-(v**2) / (2.0 * mu**2 * G), v / (mu * G)]
    assert found.final("puck.r.x") == pytest.approx(exact, rel=TOLERANCE)
    stops = [e.kind for e in found.result.events].index("stick")
    assert found.event_times[stops] == pytest.approx([-v / (mu**2 * G), 1 / (mu * G)], rel=1e-8)


@pytest.mark.slow
def test_flight_and_bounce_by_restitution_and_height():
    """After the first bounce z = e v1 (t - t1) - g (t - t1)^2 / 2."""
    e, h, t_end, radius = 0.7, 1.0, 1.0, 0.1
    scene = ball(height=h, e=e, radius=radius)
    found = dap.sensitivities(
        scene, ["contacts.floor.e", "bodies.ball.r.z"], t_end=t_end, dt=0.25, **TIGHT
    )
    t1, v1 = np.sqrt(2.0 * h / G), np.sqrt(2.0 * G * h)
    left = t_end - t1
    by_height = e * G / v1 * left - (e * v1 - G * left) / v1  # v1' = g / v1, t1' = 1 / v1
    assert found.final("ball.r.z") == pytest.approx([v1 * left, by_height], rel=TOLERANCE)


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [{}, {"integrator": "radau"}, {"integrator": "radau", "method": "joint"}],
    ids=["dop853", "radau", "radau-joint"],
)
def test_a_ball_that_slides_then_rolls_by_friction(settings):
    """It rolls from 2 v / (7 mu g) on: x' = v t1' - ..., by hand.

    The iteration of radau stops at once, at the values of a uniform deceleration.
    """
    v, mu, t_end = 3.0, 0.3, 2.0
    settings = TIGHT | settings | {"t_end": t_end, "dt": 0.5}
    found = dap.sensitivities(ball(v=v, mu=mu), ["contacts.floor.mu"], **settings)
    t1 = 2.0 * v / (7.0 * mu * G)
    # x = v t1 - mu g t1^2 / 2 + 5/7 v (t_end - t1), with v - mu g t1 = 5/7 v at t1
    exact = -0.5 * G * t1**2
    assert found.final("ball.r.x") == pytest.approx([exact], rel=TOLERANCE)
    assert found.final("ball.rd.x") == pytest.approx([0.0], abs=TOLERANCE)


@pytest.mark.slow
def test_derivatives_are_those_of_differences_where_a_ball_bounces_with_friction():
    """Impacts within their cones, whose impulses are found by iteration."""
    scene = ball(height=0.5, v=2.0, e=0.5, mu=0.1)
    settings = TIGHT | {"t_end": 0.8, "dt": 0.2}
    names = ["contacts.floor.mu", "contacts.floor.e", "bodies.ball.r_dot.x"]
    found = dap.sensitivities(scene, names, **settings)
    for k, (name, h) in enumerate(zip(names, (1e-4, 1e-4, 1e-4), strict=True)):
        ends = []
        for sign in (1.0, -1.0):
            other = scene.copy()
            contact, body = other.contacts["floor"], other.bodies["ball"]
            if name.startswith("bodies"):
                body.r_dot = [2.0 + sign * h, 0.0, 0.0]
            else:
                field = name.rpartition(".")[2]
                contact.fields[field] = contact.fields[field] + sign * h
            ends.append(dap.simulate(other, **settings).r[-1, 0])
        slope = (ends[0] - ends[1]) / (2.0 * h)  # its error: 1e-8 of its third derivative
        for axis, c in ((0, "x"), (2, "z")):
            assert found.final(f"ball.r.{c}")[k] == pytest.approx(slope[axis], rel=1e-6, abs=1e-7)


def box(mu=0.3, v=2.0, w=5.0, **coefficients):
    """A box that slides on its four corners, spins, and comes to rest after 0.707 s."""
    scene = dap.Scene(name="box")
    motion = {"r": [0.0, 0.0, 0.05], "r_dot": [v, 0.15 * v, 0.0], "w": [0.0, 0.0, w]}
    scene.add_body("box", mass=1.0, Jp=[0.01, 0.012, 0.015], **motion)
    scene.add_force("weight", "g")
    scene.add_contact("box_plane", "floor", P_i="box.O", size=[0.4, 0.3, 0.1], mu=mu,
                      **coefficients)  # fmt: skip
    return scene


@pytest.mark.slow
def test_a_spinning_box_whose_corners_share_its_weight_until_it_rests():
    """Where they slide the motion depends on the share of each, which is decided in turns."""
    settings = TIGHT | {"t_end": 0.8, "dt": 0.2}
    by = ["contacts.floor.mu", "bodies.box.w.z"]
    found = dap.sensitivities(box(), by, **settings)
    assert found.result.events[-1].kind == "stick"
    names = "box.r.x", "box.r.y", "box.yaw"
    of = np.array([found.final(name) for name in names])
    for k, (value, name) in enumerate(((0.3, "mu"), (5.0, "w"))):

        def end(x, name=name):
            result = dap.simulate(box(**{name: x}), **settings)
            return np.array([result.quantity(quantity)[0][-1] for quantity in names])

        h = 1e-3 * value  # its fourth power, times derivatives of fifth order: below 1e-9
        ends = [end(value + i * h) for i in (-2, -1, 1, 2)]
        slope = (8.0 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12.0 * h)
        assert of[:, k] == pytest.approx(slope, rel=1e-7, abs=1e-8)


def pulled(mu=0.3, x=0.0, y=0.0, across=0.0, **coefficients):
    """A box that a force pulls ever more, 5 t, at a point, and another one across."""
    scene = box(mu=mu, v=0.0, w=0.0, **coefficients)
    scene.add_function("a", "ramp", coeff=[0.0, 5.0, 0.0])
    scene.add_point("hook", body="box", sPp=[x, y, 0.0])
    scene.add_force("f", "pull", body_i="box", P_i="hook", f=[1.0, 0.0, 0.0], function="ramp")
    scene.add_force("f", "across", body_i="box", f=[0.0, across, 0.0])
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["dop853", pytest.param("radau", marks=pytest.mark.long)])
def test_contacts_that_share_a_load_and_begin_to_slide_together(integrator):
    """From t0 = mu m g / 5 on, at which no share holds any more, m x'' = 5 (t - t0).

    Slip is slow at first, through which radau takes what dop853 began.
    """
    mu, m, t_end = 0.3, 1.0, 0.7
    settings = {"rtol": 1e-10, "atol": 1e-13, "t_end": t_end, "dt": 0.1, "integrator": integrator}
    found = dap.sensitivities(pulled(), ["contacts.floor.mu", "bodies.box.mass"], **settings)
    t0 = mu * m * G / 5.0
    x = 5.0 * (t_end - t0) ** 3 / 6.0 / m
    of_t0 = -5.0 * (t_end - t0) ** 2 / 2.0 / m
    exact = [of_t0 * m * G / 5.0, of_t0 * mu * G / 5.0 - x / m]
    assert found.final("box.r.x") == pytest.approx(exact, rel=1e-7)
    assert found.event_times[-1] == pytest.approx([m * G / 5.0, mu * G / 5.0], rel=1e-7)
    assert np.array_equal(found.result.u, dap.simulate(pulled(), **settings).u)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("settings", "more"),
    [
        ({"integrator": "radau"}, {}),  # through slow slip, of which explicit steps take thousands
        ({}, {"mu_s": 0.36}),
        pytest.param({"method": "joint"}, {"mu_s": 0.36}, marks=pytest.mark.long),
    ],
    ids=["slow", "lsq", "joint"],
)
def test_a_box_pulled_aside_turns_as_it_begins_to_slide(settings, more):
    """Its corners begin in directions of their own; against differences of runs."""
    given = {"mu": 0.3, "x": 0.05, "y": 0.03, "across": 1.0}
    settings = {"rtol": 1e-10, "atol": 1e-13, "t_end": 0.9, "dt": 0.1} | settings
    names = "box.r.x", "box.r.y", "box.yaw"
    by = {"mu": "contacts.floor.mu", "across": "forces.across.f.y"}
    found = dap.sensitivities(pulled(**given, **more), list(by.values()), **settings)
    assert not any("in turns" in note for note in found.result.notes)
    for k, key in enumerate(by):

        def end(x, key=key):
            result = dap.simulate(pulled(**given | {key: x}, **more), **settings)
            return np.array([result.quantity(name)[0][-1] for name in names])

        # of sixth order: what is left of a step of 1e-2 is below 1e-9
        slope = derivative(end, given[key], 1e-2 * given[key])
        assert [found.final(name)[k] for name in names] == pytest.approx(slope, rel=1e-6, abs=1e-8)


def tall(mass):
    """A tall box that a force pulls ever more, askew, and whose friction drops as it slides."""
    scene = dap.Scene(name="tall")
    scene.add_body("box", mass=mass, Jp=[0.043, 0.019, 0.028], r=[0.0, 0.0, 0.17])
    scene.add_force("weight", "g")
    scene.add_contact("box_plane", P_i="box.O", size=[0.11, 0.42, 0.34], mu=0.32, mu_s=0.386)
    scene.add_function("a", "ramp", coeff=[0.0, 7.4, 0.0])
    scene.add_point("hook", body="box", sPp=[-0.02, -0.028, -0.016])
    scene.add_force("f", "pull", body_i="box", P_i="hook", f=[0.45, 0.89, 0.0], function="ramp")
    return scene


@pytest.mark.slow
def test_instants_of_shares_have_slopes_of_their_own_down_to_rounding():
    """With those of the first one within 1e-7 of the slip 7e-8 were missing, elsewhere 1e-5."""
    settings = {"rtol": 1e-9, "atol": 1e-12, "t_end": 1.4, "dt": 0.2, "integrator": "radau"}
    found = dap.sensitivities(tall(1.77), ["bodies.box.mass"], **settings)
    slope = derivative(lambda m: dap.simulate(tall(m), **settings).r[-1, 0, :2], 1.77, 1e-3)
    # differences by steps of 1e-3 and 5e-3 agree to 2e-10
    assert found.final("box.r").ravel()[:2] == pytest.approx(slope, rel=1e-8)


def falling(e, x, z, p, end, slope=0.0):
    """A rod of attitude p that falls on one of its ends, a ball, with friction.

    Args:
        e: of restitution.
        x, z: place of the mass centre, m.
        p: Euler parameters, normalised here.
        end: place of that end, m from the mass centre.
        slope: of the floor, rad.
    """
    scene, p = dap.Scene(name="rod"), np.array(p) / np.linalg.norm(p)
    scene.add_body("rod", mass=1.6, Jp=[0.002, 0.01, 0.01], r=[x, 0.0, z], p=p,
                   r_dot=[0.0, 0.2, -0.13])  # fmt: skip
    scene.add_force("weight", "g")
    scene.add_point("end", "rod", (end, 0.0, 0.0))
    scene.add_vector("up", "ground", (-np.sin(slope), 0.0, np.cos(slope)))
    contact = {"P_i": "end", "a_j": "up", "radius": 0.05, "mu": 0.1, "e": e}
    scene.add_contact("ball_plane", "tip", **contact)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "t_end", "tolerance"),
    [
        # slip that all but stops in an impact: wide differences were off by 6e-7
        ((0.0, 0.16, (0.969, 0.0, 0.247, 0.0), 0.15), 0.145, 1e-8),
        # bounces to rest, the last ones slower than what the end turns in the time of the
        # differences of rates: off by 1e-2; rounding of their instants leaves 1e-6
        ((-0.12, 0.22, (0.48, -0.17, -0.835, 0.208), -0.2, 0.5), 0.3, 1e-5),
    ],
    ids=["slip", "bounces"],
)
def test_a_rod_that_bounces_and_turns(place, t_end, tolerance):
    settings = {"rtol": 1e-11, "atol": 1e-13, "t_end": t_end, "dt": t_end}

    def last(e):
        result = dap.simulate(falling(e, *place), **settings)
        return np.append(result.rd[-1, 0], result.w[-1, 0])

    found = dap.sensitivities(falling(0.3, *place), ["contacts.tip.e"], **settings)
    slopes = np.append(found.final("rod.rd")[:, 0], found.final("rod.w")[:, 0])
    exact = derivative(last, 0.3, 3e-5)
    assert slopes == pytest.approx(exact, rel=tolerance, abs=tolerance * np.max(np.abs(exact)))


@pytest.mark.slow
def test_a_wheel_that_its_loaded_pin_stops_by_friction_and_radius():
    """It turns by I w^2 / (2 mu R m g), and stops at I w / (mu R m g)."""
    mu, radius, w = 0.3, 0.02, 2.0
    scene, moment, inertia = wheel(w, mu, radius)
    by = ["forces.rub.mu", "forces.rub.radius"]
    found = dap.sensitivities(scene, by, t_end=2.0, dt=0.5, **TIGHT)
    far, stops = 0.5 * inertia * w**2 / moment, inertia * w / moment
    assert found.final("pin.angle") == pytest.approx([-far / mu, -far / radius], rel=TOLERANCE)
    assert found.event_times[0] == pytest.approx([-stops / mu, -stops / radius], rel=TOLERANCE)


@pytest.mark.slow
def test_a_ball_that_bounces_to_rest_on_a_slope_by_its_tilt():
    """Without friction bounces leave what is along the slope alone, and it slides on from rest.

    Where the last ones approach more slowly than the floor of a neighbour turns, derivatives were
    off by 1e-4 of themselves.
    """
    h, v, t_end = 0.35, 0.5, 0.9
    scene = ball(height=h, v=v, e=0.5, radius=0.1)
    scene.bodies["ball"].r = (0.0, 0.0, h)
    scene.add_vector("slope", "ground", (0.3, 0.0, 1.0))
    scene.contacts["floor"].fields["a_j"] = "slope"
    found = dap.sensitivities(scene, ["vectors.slope.sp.x"], t_end=t_end, dt=0.3, **TIGHT)
    assert found.result.events[-1].kind == "rest"

    def place(x):
        n = np.array([x, 0.0, 1.0]) / np.hypot(x, 1.0)
        free = np.array([v * t_end, 0.0, h - 0.5 * G * t_end**2])
        return free - (free @ n - 0.1) * n

    assert found.result.r[-1, 0] == pytest.approx(place(0.3), abs=1e-9)
    assert found.final("ball.r")[:, 0] == pytest.approx(derivative(place, 0.3), rel=TOLERANCE)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["dop853", "radau", "adams"])
def test_a_ball_that_slides_over_an_edge_by_its_speed(integrator):
    """It leaves the edge, x away, at t1 = x / v, and falls: z' = -g (t_end - t1) x / v^2.

    The force ends there with a jump, at no zero of what decides it.
    """
    x, v, t_end = 0.15, 2.0, 0.2
    scene = dap.Scene(name="edge")
    scene.add_body("ball", mass=2.0, Jp=[0.01] * 3, r=[0.2 - x, 0.02, 0.15], r_dot=[v, 0.0, 0.0])
    scene.add_force("weight", "g")
    scene.add_contact("ball_box", "table", P_i="ball.O", P_j="ground.O", radius=0.1,
                      size=[0.4, 0.4, 0.1])  # fmt: skip
    settings = TIGHT | {"integrator": integrator, "t_end": t_end, "dt": 0.05}
    found = dap.sensitivities(scene, ["bodies.ball.r_dot.x", "bodies.ball.mass"], **settings)
    t1, by_v = x / v, -x / v**2
    assert [event.kind for event in found.result.events] == ["touch", "lift"]
    assert found.event_times[1] == pytest.approx([by_v, 0.0], rel=TOLERANCE)
    assert found.final("ball.r.z") == pytest.approx([G * (t_end - t1) * by_v, 0.0], rel=TOLERANCE)


def over_an_edge(speed, mu, inertia, t_end, ahead=0.15, radius=0.1):
    """x, z of a ball that goes to the edge of a table and turns about it: slides on, or rolls.

    On the table x'' = -mu g, about the edge r th'' = g sin th - mu (g cos th - r th'^2).
    """
    a, sticks = mu * G, inertia == 0.008
    a, mu, share = (0.0, 0.0, 1.4) if sticks else (a, mu, 1.0)
    at_edge = np.sqrt(speed**2 - 2.0 * a * ahead)
    t1 = 2.0 * ahead / (speed + at_edge)

    def slope(_, y):
        load = G * np.cos(y[0]) - radius * y[1] ** 2
        return y[1], (G * np.sin(y[0]) - mu * load) / (share * radius)

    y = solve_ivp(slope, (t1, t_end), (0.0, at_edge / radius), "DOP853", rtol=3e-14, atol=1e-15).y
    return 0.2 + radius * np.sin(y[0, -1]), 0.05 + radius * np.cos(y[0, -1])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("solid", "speed", "mu", "inertia", "integrator"),
    [("box", 0.5, 0.0, 1.0, "dop853"), ("cylinder", 0.52, 0.8, 0.008, "dop853"),
     *(("box", 0.7, 0.1, 1.0, name) for name in ("dop853", "radau", "adams", "rk4"))],
    ids=["smooth", "rolls", *(f"slides-{name}" for name in ("dop853", "radau", "adams", "rk4"))],
)  # fmt: skip
def test_a_ball_that_goes_on_over_an_edge_by_its_speed(solid, speed, mu, inertia, integrator):
    """The force jumps there, and no mode ends. The smooth one is at the edge as it is reported.

    Without the instant slopes of what slides were off by 0.012. To 1e-9, as these settings leave
    some 1e-12 of a state and slopes are up to a hundred times as sensitive.
    """
    scene = dap.Scene(name="edge")
    spin = speed / 0.1 if inertia == 0.008 else 0.0
    scene.add_body("ball", mass=2.0, Jp=[inertia] * 3, r=[0.05, 0.02, 0.15],
                   r_dot=[speed, 0.0, 0.0], w=[0.0, spin, 0.0])  # fmt: skip
    scene.add_force("weight", "g", gravity=G)
    given = {"P_i": "ball.O", "P_j": "ground.O", "mu": mu}
    if solid == "box":
        scene.add_contact("ball_box", "table", radius=0.1, size=[0.4, 0.4, 0.1], **given)
    else:
        scene.bodies["ball"].r = [0.05, 0.0, 0.15]
        scene.add_contact("ball_cylinder", "table", a_j="ground.z", radius_i=0.1, radius_j=0.2,
                          length=0.1, **given)  # fmt: skip
    t_end = 0.41 if mu == 0.0 else 0.36
    settings = TIGHT | {"integrator": integrator, "t_end": t_end, "dt": 0.05}
    settings |= {"step": 1e-3} if integrator == "rk4" else {}
    found = dap.sensitivities(scene, ["bodies.ball.r_dot.x", "bodies.ball.w.y"], **settings)
    slopes = found.final("ball.r")[::2] @ [1.0, spin / speed]  # what rolls spins as fast
    exact = over_an_edge(speed, mu, inertia, t_end)
    by_speed = derivative(lambda v: np.array(over_an_edge(v, mu, inertia, t_end)), speed)
    assert [event.kind for event in found.result.events] == ["touch"]
    assert found.result.r[-1, 0, ::2] == pytest.approx(exact, abs=1e-10)
    assert slopes == pytest.approx(by_speed, abs=1e-9)


@pytest.mark.slow
def test_a_hinged_rod_that_lifts_off_by_radau():
    """Its rates at the end of a step are a polynomial's: derivatives of the instant were so, too.

    They were off by 5e-6 of themselves.
    """
    scene, name = scene_of(12_850_238), "bodies.b2.mass"
    settings = {"t_end": 0.265, "dt": 0.265, "rtol": 1e-11, "atol": 1e-13}
    found = [dap.sensitivities(scene, [name], integrator=integrator, contact="events", **settings)
             for integrator in ("radau", "dop853")]  # fmt: skip
    one, other = (s.event_times[-1] for s in found)
    assert found[0].result.events[-1].kind == "lift"
    assert one == pytest.approx(other, rel=TOLERANCE)


def block(tilt, mu, across, height=0.0):
    """A point mass that goes at 3 m/s down a slope (up, where tilt is negative), m above it."""
    scene, along = dap.Scene(name="block"), 3.0 * np.array([-np.cos(tilt), 0.0, -np.sin(tilt)])
    along[1], up = across, np.array([-np.sin(tilt), 0.0, np.cos(tilt)])
    scene.add_body("block", mass=2.0, Jp=[0.01] * 3, r=height * up, r_dot=along)
    scene.add_force("weight", "g", gravity=G)
    scene.add_vector("up", "ground", up)
    scene.add_contact("ball_plane", "slope", P_i="block.O", a_j="up", mu=mu)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [0.3, -0.3])
@pytest.mark.parametrize(
    ("settings", "tolerance"),
    [
        ({}, 1e-9),
        ({"method": "joint"}, 1e-9),
        ({"integrator": "radau"}, 1e-8),
        # dense output and first steps of low order, which suit the motion alone
        ({"integrator": "dopri5"}, 1e-5),
        ({"integrator": "adams"}, 3e-5),
    ],
)
def test_a_block_that_stops_on_a_slope_by_its_speed_across(tilt, settings, tolerance):
    """With mu N / m = k a, of the deceleration a, speed across falls as (1 - t / t_1)^k.

    The motion itself is straight and uniformly decelerated: any step is exact, so that one reaches
    the end, where the direction of slip changes at a rate of k / (t_1 - t).
    """
    mu, v = 0.5, 3.0
    across = mu * G * np.cos(tilt)
    a = across - G * np.sin(tilt)
    k, t_1 = across / a, v / a
    by = ["bodies.block.r_dot.y", "contacts.slope.mu"]
    found = dap.sensitivities(block(tilt, mu, 0.0), by, t_end=3.0, dt=0.25, **settings)
    left = 1.0 - np.minimum(found.result.t, t_1) / t_1
    slopes = [found.derivative(lambda result, i=i: result.r[i, 0, 1])[0] for i in range(len(left))]
    assert slopes == pytest.approx(t_1 / (k + 1.0) * (1.0 - left ** (k + 1.0)), abs=tolerance)
    assert slopes[-1] == pytest.approx(t_1 / (k + 1.0), rel=1e-6)
    kinds = [event.kind for event in found.result.events]
    stop = found.event_times[kinds.index("stick")]
    assert stop == pytest.approx([0.0, -v * G * np.cos(tilt) / a**2], abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize(("tilt", "height"), [(0.3, 0.0), (-0.3, 0.0), (0.3, 0.01)])
@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_slip_that_turns_as_it_ends(tilt, height, integrator):
    """Off by up to a tenth where derivatives were those of the steps of the motion.

    Where it falls first, it slides from an instant on that parameters move.
    """
    by, across, mu = ["bodies.block.r_dot.y", "contacts.slope.mu"], 1.0, 0.5
    scene = block(tilt, mu, across, height)
    found = dap.sensitivities(scene, by, t_end=3.0, integrator=integrator)
    settings = {"t_end": 3.0, "dt": 3.0, "rtol": 1e-12, "atol": 1e-14}

    def last(across, mu):
        return dap.simulate(block(tilt, mu, across, height), **settings).r[-1, 0]

    for k, of in enumerate((lambda x: last(x, mu), lambda x: last(across, x))):
        exact = derivative(of, (across, mu)[k], 1e-3)
        assert found.final("block.r")[:, k] == pytest.approx(exact, rel=1e-6, abs=1e-7)


@pytest.mark.slow
def test_slip_from_rest_has_no_derivative():
    """A block that begins to slide goes where the least slip does; by its mass there is one."""
    scene = ball(mu=0.1, radius=0.1)
    scene.add_force("f", "pull", body_i="ball", f=[20.0, 0.0, 0.0])
    settings = TIGHT | {"t_end": 0.2, "dt": 0.1}
    found = dap.sensitivities(scene, ["bodies.ball.mass"], **settings)
    assert np.array_equal(found.result.u, dap.simulate(scene, **settings).u)
    with pytest.raises(dap.SimulationError, match=r"r_dot\.y: contact floor begins to slide"):
        dap.sensitivities(scene, ["bodies.ball.r_dot.y"], **settings)
