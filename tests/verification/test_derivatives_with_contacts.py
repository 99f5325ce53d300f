"""Derivatives of runs over touches, bounces and changes of modes, against closed forms."""

import numpy as np
import pytest
from verification.test_contacts import TIGHT, G, ball
from verification.test_derivatives_of_runs import derivative

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


@pytest.mark.slow
def test_contacts_that_share_a_load_and_slide_are_refused_by_name():
    scene = dap.Scene(name="box")
    motion = {"r_dot": [2.0, 0.3, 0.0], "w": [0.0, 0.0, 5.0]}
    scene.add_body("box", mass=1.0, Jp=[0.01, 0.012, 0.015], r=[0.0, 0.0, 0.05], **motion)
    scene.add_force("weight", "g")
    scene.add_contact("box_plane", "floor", P_i="box.O", size=[0.4, 0.3, 0.1], mu=0.3)
    with pytest.raises(dap.SimulationError, match=r"floor#.*share what they carry, and slide"):
        dap.sensitivities(scene, ["contacts.floor.mu"], t_end=0.1, dt=0.1)


@pytest.mark.slow
def test_a_wheel_that_its_loaded_pin_stops_by_friction_and_radius():
    """It turns by I w^2 / (2 mu R m g), and stops at I w / (mu R m g)."""
    mu, radius, inertia, w = 0.3, 0.02, 0.1, 2.0
    scene = dap.Scene(name="wheel")
    scene.add_body("wheel", mass=5.0, Jp=[inertia] * 3, w=(0.0, w, 0.0))
    axis = {"P_i": "wheel.O", "P_j": "ground.O", "a_i": "wheel.y", "a_j": "ground.y"}
    scene.add_joint("rev", "pin", **axis)
    scene.add_force("weight")
    scene.add_force("friction", "rub", joint="pin", mu=mu, radius=radius)
    by = ["forces.rub.mu", "forces.rub.radius"]
    found = dap.sensitivities(scene, by, t_end=2.0, dt=0.5, **TIGHT)
    moment = mu * radius * 5.0 * G
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
