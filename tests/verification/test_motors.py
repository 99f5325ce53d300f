"""Motors in the coordinate of a joint against closed forms."""

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.result import UnknownNameError

J, M = 0.2, 2.0


def machine(kind="rev", swapped=False):
    """A rotor on a hinge, or a block on a slider or sleeve, along x of ground."""
    scene = dap.Scene(name="machine")
    scene.add_body("part", mass=M, Jp=[J, 0.1, 0.1], r=[0.0, 1.0, 0.0])
    scene.add_point("P", body="ground", sPp=[0.5, 1.0, 0.0])
    scene.add_point("Q", body="part", sPp=[0.5 if kind == "rev" else 0.0, 0.0, 0.0])
    ends = [("Q", "part.x"), ("P", "ground.x")]
    (P_i, a_i), (P_j, a_j) = reversed(ends) if swapped else ends
    axes = {"a_j": a_j} if kind == "tran" else {"a_i": a_i, "a_j": a_j}
    scene.add_joint(kind, "guide", P_i=P_i, P_j=P_j, **axes)
    scene.add_function("a", "ramp", coeff=[0.0, 2.0, 0.0])
    scene.add_function("a", "course", coeff=[0.3, 0.5, 2.0])
    scene.add_input("signal", value=1.5)
    return scene


def coordinate(result, name="angle"):
    return (result.quantity(f"guide.{name}").values, result.quantity(f"guide.{name}_rate").values)


WAYS = {
    "number": (3.0, lambda t: 3.0 * t),
    "function": ("ramp", lambda t: t**2),
    "input": ("signal", lambda t: 1.5 * t),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("kind", "field", "name", "inertia"),
    [
        ("rev", "torque", "angle", J),
        ("tran", "force", "length", M),
        ("cyl", "torque", "angle", J),
        ("cyl", "force", "length", M),
    ],
)
def test_a_given_moment_or_force(way, kind, field, name, inertia):
    """Inertia times rate is the integral of the moment over time; steps leave 1e-9. Without a limit
    a law has no branches, of which a note would tell."""
    value, impulse = WAYS[way]
    scene = machine(kind)
    scene.add_force("motor", "motor", joint="guide", **{field: value})
    result = dap.simulate(scene, t_end=1.0, dt=0.25, rtol=1e-9, atol=1e-11)
    rate = coordinate(result, name)[1]
    np.testing.assert_allclose(rate, impulse(result.t) / inertia, atol=1e-7)
    assert not any("branches" in note for note in result.notes)


PLACES = {"number": (13.0, 0.0), "function": ("ramp", 2.0), "input": ("signal", 0.0)}


@pytest.mark.parametrize("way", PLACES)
@pytest.mark.parametrize(("kind", "name", "inertia"), [("rev", "angle", J), ("tran", "length", M)])
def test_a_position_is_sought(way, kind, name, inertia):
    """The error e obeys I e.. + c e. + k e = 0, here critically damped, also over two turns."""
    value, rate = PLACES[way]
    scene = machine(kind)
    k, c = 25.0 * inertia, 10.0 * inertia  # (s + 5)^2
    scene.add_force("motor", "motor", joint="guide", position=value, k=k, c=c)
    result = dap.simulate(scene, t_end=2.0, dt=0.25, rtol=1e-9, atol=1e-11)
    place = {"number": 13.0, "function": 0.0, "input": 1.5}[way]
    t = result.t
    error = (place + (rate + 5.0 * place) * t) * np.exp(-5.0 * t)  # at rest at the start
    np.testing.assert_allclose(coordinate(result, name)[0], place + rate * t - error, atol=1e-7)
    assert not any("branches" in note for note in result.notes)


@pytest.mark.parametrize(("kind", "name"), [("rev", "angle"), ("tran", "length")])
def test_a_position_that_is_set_is_reached_whatever_it_takes(kind, name):
    """e = e_0 (1 + t / lag) exp(-t / lag) after each setting, over turns, under any load."""
    scene, lag = machine(kind), 0.1
    scene.inputs["signal"].value = 9.0
    scene.add_joint("motor", "motor", joint="guide", position="signal", lag=lag)
    load = scene.add_force
    load("n", "load", body_i="part", n=(0.0, 0.0, 5.0)) if kind == "rev" else load(
        "f", "load", body_i="part", f=(5.0, 5.0, 5.0))  # fmt: skip
    back = dap.Controller(every=2.0, update=lambda t, state: {"signal": 9.0 if t < 1.0 else 2.0})
    result = dap.simulate(scene, t_end=4.0, dt=0.25, rtol=1e-9, atol=1e-11, controllers=[back])
    t = result.t
    fading = [(1.0 + s / lag) * np.exp(-s / lag) for s in (t, np.maximum(t - 2.0, 0.0))]
    left = 9.0 * fading[0][8] * fading[1]  # and its rate, below the tolerance after 20 lag
    expected = np.where(t < 2.0, 9.0 * (1.0 - fading[0]), 2.0 + 7.0 * fading[1] - left)
    np.testing.assert_allclose(coordinate(result, name)[0], expected, atol=1e-6)
    assert result.ledger["energy"].ok


def test_a_position_is_sought_within_a_limit():
    """Far from it the motor gives its limit: q = limit t^2 / (2 I) while k (position - q) is more;
    then about it, sqrt(k / I), from where it is."""
    scene, k, limit = machine(), 2.0, 1.0
    scene.add_force("motor", "motor", joint="guide", position=1.5, k=k, limit=limit)
    result = dap.simulate(scene, t_end=0.9, dt=0.1, rtol=1e-9, atol=1e-11)
    leaves = np.sqrt(2.0 * J * 1.0 / limit)  # q = 1 there: 0.5 rad are left, k times 0.5 = limit
    rate, omega = limit / J * leaves, np.sqrt(k / J)
    s = result.t - leaves
    after = 1.5 - 0.5 * np.cos(omega * s) + rate / omega * np.sin(omega * s)
    expected = np.where(s < 0.0, limit / J * result.t**2 / 2.0, after)
    np.testing.assert_allclose(coordinate(result)[0], expected, atol=1e-6)  # a corner in a step
    assert any("branches" in note for note in result.notes)


def test_the_position_of_a_motor_is_an_input_of_a_linear_model():
    """k / I at the input, at rest."""
    scene = machine()
    scene.inputs["signal"].value = 0.0
    scene.add_force("motor", "motor", joint="guide", position="signal", k=3.0, c=0.1)
    lin = dap.linearize(scene, inputs=["signal"], outputs=["guide.angle"])
    s = 2j * np.pi * 0.5
    found = lin.frequency_response(0.5)[0, 0, 0]
    assert found == pytest.approx(3.0 / (J * s**2 + 0.1 * s + 3.0), rel=1e-9)


@pytest.mark.parametrize(("kind", "field", "name"), [("rev", "torque", "angle"),
                                                     ("tran", "force", "length")])  # fmt: skip
def test_a_motor_saturates(kind, field, name):
    """A ramp 2 t saturates at 1: the impulse is t^2, from 0.5 s on t - 0.25; down as well."""
    for sign in (1.0, -1.0):
        scene = machine(kind)
        scene.functions["ramp"].fields["coeff"] = (0.0, 2.0 * sign, 0.0)
        scene.add_force("motor", "motor", joint="guide", limit=1.0, **{field: "ramp"})
        result = dap.simulate(scene, t_end=1.0, dt=0.125, rtol=1e-9, atol=1e-11)
        t = result.t
        impulse = sign * np.where(t < 0.5, t**2, t - 0.25)
        inertia = J if kind == "rev" else M
        np.testing.assert_allclose(coordinate(result, name)[1], impulse / inertia, atol=1e-6)


@pytest.mark.parametrize(("kind", "name"), [("rev", "angle"), ("tran", "length")])
def test_a_speed_within_a_limit(kind, name):
    """I e' = -L tanh(e / c) of the error e: sinh(e / c) falls by exp(-L t / (I c)).
    Under a load it is missed by c artanh(load / L)."""
    limit, tolerance, speed = 4.0, 0.5, 3.0
    inertia = J if kind == "rev" else M
    scene = machine(kind)
    scene.add_force("motor", "motor", joint="guide", speed=speed, limit=limit, tolerance=tolerance)
    t_end = 0.3 if kind == "rev" else 3.0
    result = dap.simulate(scene, t_end=t_end, dt=t_end / 10, rtol=1e-9, atol=1e-11)
    falls = np.sinh(speed / tolerance) * np.exp(-limit * result.t / (inertia * tolerance))
    error = speed - coordinate(result, name)[1]
    np.testing.assert_allclose(error, tolerance * np.arcsinh(falls), atol=1e-6)
    load = {"torque": -2.0} if kind == "rev" else {"force": -2.0}
    scene.add_force("motor", "load", joint="guide", **load)
    result = dap.simulate(scene, t_end=20.0, dt=10.0)
    missed = tolerance * np.arctanh(2.0 / limit)
    np.testing.assert_allclose(coordinate(result, name)[1][-1], speed - missed, rtol=1e-6)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(
    ("kind", "name"), [("rev", "angle"), ("tran", "length"), ("cyl", "angle"), ("cyl", "length")]
)
def test_a_prescribed_speed(way, swapped, kind, name):
    """The rate is the speed, whichever body is i; the multiplier is inertia times acceleration.
    Rows are kept to 1e-10."""
    value, _ = WAYS[way]
    scene = machine(kind, swapped)
    which = {"coordinate": name} if (kind, name) == ("cyl", "length") else {}
    scene.add_joint("motor", "motor", joint="guide", speed=value, **which)
    result = dap.simulate(scene, t_end=1.0, dt=0.25, rtol=1e-9, atol=1e-11)
    q, rate = coordinate(result, name)
    t = result.t
    wanted, moved = {
        "number": (3.0 + 0.0 * t, 3.0 * t),
        "function": (2.0 * t, t**2),
        "input": (1.5 + 0.0 * t, 1.5 * t),
    }[way]
    np.testing.assert_allclose(rate, wanted, atol=1e-9)
    np.testing.assert_allclose(q, moved, atol=1e-7)
    inertia = J if name == "angle" else M
    acceleration = 2.0 if way == "function" else 0.0
    lam = result.quantity("motor.lambda").values.ravel()
    np.testing.assert_allclose(np.abs(lam), inertia * acceleration, atol=1e-9)


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(("kind", "name"), [("rev", "angle"), ("tran", "length")])
def test_a_prescribed_position(swapped, kind, name):
    """The coordinate is the position, from where the scene has the bodies; exact to rounding."""
    scene = machine(kind, swapped)
    scene.add_joint("motor", "motor", joint="guide", position="course")
    result = dap.simulate(scene, t_end=1.0, dt=0.25)
    q, rate = coordinate(result, name)
    np.testing.assert_allclose(q, 0.3 + 0.5 * result.t + 2.0 * result.t**2, atol=1e-9)
    np.testing.assert_allclose(rate, 0.5 + 4.0 * result.t, atol=1e-9)
    scene = machine(kind, swapped)
    scene.add_joint("motor", "motor", joint="guide", position=0.4)
    result = dap.simulate(scene, t_end=1.0, dt=0.5)
    np.testing.assert_allclose(coordinate(result, name), [[0.4] * 3, [0.0] * 3], atol=1e-12)


def test_a_motor_on_a_body_that_turns():
    """The angle of the second joint is prescribed against the first body, which turns itself."""
    scene = machine()
    scene.add_body("second", mass=1.0, Jp=[0.1] * 3, r=[1.0, 1.0, 0.0])
    scene.add_joint("rev", "other", P_i="second.O", P_j="Q", a_i="second.x", a_j="part.x")
    scene.add_point("R", body="part", sPp=[1.0, 0.0, 0.0])
    scene.joints["other"].fields["P_j"] = "R"
    scene.add_joint("motor", "one", joint="guide", speed="1500 rpm")
    scene.add_joint("motor", "two", joint="other", position="course")
    result = dap.simulate(scene, t_end=0.5, dt=0.1)
    np.testing.assert_allclose(result.w[:, 0, 0], 50.0 * np.pi, rtol=1e-9)
    turned = 0.5 + 4.0 * result.t
    np.testing.assert_allclose(result.w[:, 1, 0], 50.0 * np.pi + turned, rtol=1e-9)


def test_an_input_is_set_in_a_run():
    """A speed follows the input at once, and a moment from then on."""
    scene = machine()
    scene.add_joint("motor", "motor", joint="guide", speed="signal")
    other = machine()
    other.add_force("motor", "motor", joint="guide", torque="signal")
    for model, rate in ((scene, -2.0), (other, (1.5 - 2.0) * 0.5 / J)):
        run = dap.start(model)
        run.step(0.5)
        run.step(0.5, inputs={"signal": -2.0})
        assert run.state["guide.angle_rate"] == pytest.approx(rate, abs=1e-9)


@pytest.mark.parametrize(("kind", "name"), [("rev", "angle"), ("tran", "length")])
def test_a_position_that_is_set_is_an_input_of_a_linear_model(kind, name):
    """G = 1 / (lag s + 1)^2 of the coordinate, s^2 times the inertia of what moves it; a speed that
    is set is none."""
    scene, lag = machine(kind), 0.1
    scene.inputs["signal"].value = 0.0
    scene.add_joint("motor", "motor", joint="guide", position="signal", lag=lag)
    moved = {"rev": "motor.moment.x", "tran": "motor.force.x"}[kind]
    outputs = (f"guide.{name}", moved, "signal")
    found = dap.linearize(scene, inputs=("signal",), outputs=outputs)
    s, states = 3.0j, len(found.A)
    G = found.C @ np.linalg.solve(s * np.eye(states) - found.A, found.B) + found.D
    follows = 1.0 / (lag * s + 1.0) ** 2
    inertia = {"rev": J, "tran": M}[kind]
    np.testing.assert_allclose(G[:, 0], [follows, inertia * s**2 * follows, 1.0], atol=1e-8)
    scene.joints["motor"].fields = {"joint": "guide", "speed": "signal"}
    with pytest.raises(UnknownNameError, match="Drive motor by a function of time in its place"):
        dap.linearize(scene, inputs=("signal",), outputs=outputs)


def test_a_linear_model_has_the_moment_as_an_input():
    """sqrt(J) theta_ddot = u / sqrt(J), in coordinates of unit mass."""
    scene = machine()
    scene.add_force("motor", "motor", joint="guide", torque="signal", limit=10.0)
    linear = dap.linearize(scene, inputs=("signal",))
    assert np.max(np.abs(linear.B)) == pytest.approx(J**-0.5, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "field", "name", "inertia"),
    [("rev", "torque", "angle", J), ("tran", "force", "length", M)],
)
def test_inverse_dynamics_finds_what_a_motor_gives(kind, field, name, inertia):
    """Inertia times acceleration, of 0.5 sin 2 t; what a function gives is not found."""
    scene, t = machine(kind), np.linspace(0.0, 0.5, 51)
    scene.add_force("motor", "motor", joint="guide", **{field: 3.0})
    motion = {"t": t, f"guide.{name}": 0.5 * np.sin(2.0 * t)}
    found = dap.inverse(scene, motion, "motor").record.actuation["motor"]
    np.testing.assert_allclose(found, -2.0 * inertia * np.sin(2.0 * t), atol=1e-6)  # a spline's
    scene.forces["motor"].fields[field] = "ramp"
    with pytest.raises(dap.SceneError, match=f"its {field} is that of ramp"):
        dap.inverse(scene, motion, "motor")


def test_the_ledger_has_the_work_of_a_motor():
    """A speed that is a number does work against gravity: the energy is no constant."""
    scene = machine()
    scene.add_force("weight", "gravity")
    scene.points["P"].sPp = (0.5, 1.0, 0.3)
    scene.points["Q"].sPp = (0.5, 0.0, 0.3)
    scene.add_joint("motor", "motor", joint="guide", speed=3.0)
    result = dap.simulate(scene, t_end=1.0, dt=0.05)
    assert result.ledger["energy"].ok
    assert "total energy" not in result.ledger
    assert not dap.compile(scene).is_conservative


@pytest.mark.slow
def test_kinematics_over_the_coordinate_of_a_motor():
    """Its own coordinate takes the place of a speed."""
    scene = machine()
    scene.add_joint("motor", "motor", joint="guide", speed=3.0)
    result = dap.kinematics(scene, over="motor.q=0:6:7")
    np.testing.assert_allclose(coordinate(result)[0], np.arange(7.0), atol=1e-9)
    scene = machine()
    scene.add_joint("motor", "motor", joint="guide", position="course")
    inverse = dap.inverse(scene, dap.simulate(scene, t_end=1.0, dt=0.25))
    np.testing.assert_allclose(np.abs(inverse.quantity("motor.actuation").values), 4.0 * J,
                               rtol=1e-6)  # fmt: skip


@pytest.mark.parametrize(
    ("table", "fields", "words"),
    [
        ("joint", {}, "give position or speed; a motor of a given torque is a force motor"),
        ("joint", {"position": 1.0, "speed": 1.0}, "give position or speed, not both"),
        ("joint", {"speed": "rampe"}, "no function or input 'rampe'.*'ramp'"),
        ("joint", {"speed": "12"}, "no function or input '12'.*write 12 without quotes"),
        ("joint", {"speed": True}, "should be a number, not a truth value"),
        ("joint", {"speed": 1.0, "limit": 2.0}, r"the force motor has it: \[forces.NAME\]"),
        ("joint", {"speed": 1.0, "a_j": "ground.x"}, "give joint or a_j, not both"),
        ("force", {}, "give torque, force, speed or position"),
        ("force", {"position": 1.0},
         "a position needs k here; one that is held exactly is a joint"),
        ("force", {"speed": 1.0}, "a speed needs a limit here; without one it is a joint motor"),
        ("force", {"torque": 1.0, "force": 1.0}, "give torque or force, not both"),
        ("force", {"position": 1.0, "speed": 1.0}, "give speed or position, not both"),
        ("force", {"force": 1.0}, "the coordinate is an angle, which a torque changes"),
        ("force", {"torque": 1.0, "limit": -1.0}, "limit = -1.0: should be greater than 0"),
    ],
)  # fmt: skip
def test_a_wrong_motor_is_refused(table, fields, words):
    scene = machine()
    add = scene.add_joint if table == "joint" else scene.add_force
    add("motor", "motor", joint="guide", **fields)
    with pytest.raises(dap.SceneError, match=f"(?s){words}"):
        dap.compile(scene)


def test_a_name_of_two_things_is_refused():
    scene = machine()
    scene.add_input("ramp", value=1.0)
    scene.add_joint("motor", "motor", joint="guide", speed="ramp")
    with pytest.raises(dap.SceneError, match="is a function and an input; rename one of them"):
        dap.compile(scene)
