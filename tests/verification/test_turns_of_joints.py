"""Angles of joints do not depend on reports, methods, integrators, or on how a run was started.
A wheel with a damper turns by (w0 / k)(1 - exp(-k t)) with k = c / J, a wheel under a harmonic
moment A sin(f t) by A (t / f - sin(f t) / f^2): turn by turn, closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.levels import quickly
from support.results import without_turns

import dap3d_core as dap

SPEED, DECAY = 100.0, 0.8
AMPLITUDE, FREQUENCY = 300.0, 5.0
#: Integrators that fit each method, with their settings.
PAIRS = [
    (method, integrator)
    for method in ("standard", "lsq", "penalty", "joint")
    for integrator in ("dop853", "dopri5", "rk4", "adams", "radau")
    if not (integrator == "radau" and method == "joint")  # of body coordinates alone
    and not (integrator in ("adams", "radau") and method == "penalty")  # exact formulations alone
]


def wheel(speed=SPEED, decay=DECAY, *, seen_from_wheel=False):
    """A wheel of 1 kg m^2 on a hinge with a damper; perhaps the wheel is body j of the hinge."""
    scene = dap.Scene(name="wheel")
    scene.add_body("wheel", mass=1.0, Jp=(1.0, 1.0, 1.0), w=(0.0, 0.0, speed))
    ends = ("wheel", "ground")
    if seen_from_wheel:
        scene.add_body("post", mass=1.0, Jp=(1.0, 1.0, 1.0))
        scene.add_joint("fix", "foot", body_i="post")
        ends = ("post", "wheel")
    scene.add_joint("rev", "pin", P_i=f"{ends[0]}.O", P_j=f"{ends[1]}.O", a_i=f"{ends[0]}.z",
                    a_j=f"{ends[1]}.z")  # fmt: skip
    if decay:
        scene.add_force("rot_sda", "damper", v_i="wheel.x", v_j="ground.x", axis="ground.z",
                        c=decay)  # fmt: skip
    return scene


def decaying(t):
    return SPEED / DECAY * (1.0 - np.exp(-DECAY * np.asarray(t)))


def pushed(**options):
    """The wheel at rest, under a moment that goes to and fro."""
    scene = wheel(0.0, 0.0, **options)
    scene.add_function("harmonic", "swing", amplitude=AMPLITUDE, frequency=FREQUENCY)
    scene.add_force("np", "push", body_i="wheel", np=(0.0, 0.0, 1.0), function="swing")
    return scene


def swung(t):
    t = np.asarray(t)
    return AMPLITUDE * (t / FREQUENCY - np.sin(FREQUENCY * t) / FREQUENCY**2)


def settings(integrator):
    return {"integrator": integrator} | ({"step": 0.01} if integrator == "rk4" else {})


@pytest.mark.parametrize("dt", [0.05, 1.0, 6.0])
@pytest.mark.parametrize(("method", "integrator"), PAIRS)
def test_the_reporting_step_does_not_matter(method, integrator, dt):
    """All instants: rk4 turns by up to 1 rad a step, whose phase errs by 0.01 rad in all."""
    result = dap.simulate(wheel(), t_end=6.0, dt=dt, method=method, **settings(integrator))
    angle = result.quantity("pin.angle").values
    # 1e-6 of 124 rad at rtol = 1e-8; penalty leaves its rows by some 1e-5
    tolerance = {"rk4": 0.05}.get(integrator, 1e-4)
    np.testing.assert_allclose(angle, decaying(result.t), atol=tolerance)
    np.testing.assert_allclose(angle, result.quantity("pin.q1").values, atol=0.0)


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("dt", [0.1, 4.0])
@pytest.mark.parametrize(
    ("method", "integrator"),
    [("standard", "dop853"), ("standard", "radau"), ("joint", "dop853"), ("joint", "adams")],
)
def test_a_motion_that_comes_to_rest_again_and_again(method, integrator, dt, reverse):
    """38 turns, 60 rad a period; seen from the other body with the other sign."""
    scene = pushed(seen_from_wheel=reverse)
    result = dap.simulate(scene, t_end=4.0, dt=dt, method=method, integrator=integrator)
    sign = -1.0 if reverse else 1.0
    np.testing.assert_allclose(
        sign * result.quantity("pin.angle").values, swung(result.t), atol=1e-4
    )


@pytest.mark.slow
@pytest.mark.parametrize("method", ["standard", "joint"])
@pytest.mark.parametrize(
    ("speed", "integrator"),
    [(1e4, integrator) for integrator in ("dop853", "dopri5", "adams")]
    + [(half_turns * np.pi, "dop853") for half_turns in (1, -1, 2, 3, 17)],
)
def test_constant_speeds(speed, integrator, method):
    """1591.5 turns between two reports; rotations by exactly pi, or whole numbers of it."""
    result = dap.simulate(wheel(speed, 0.0), t_end=3.0, dt=1.0, method=method,
                          integrator=integrator)  # fmt: skip
    # rtol = 1e-8 of the rotation in each of some 1e4 steps, or some ten
    error = 1e-3 if speed == 1e4 else 1e-6
    np.testing.assert_allclose(result.quantity("pin.angle").values, speed * result.t, atol=error)


@pytest.mark.parametrize("rtol", [1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "radau"])
def test_loose_tolerances_lose_no_turn(integrator, rtol):
    """The error is that of the phase; a turn would be 6.3 rad more."""
    result = dap.simulate(pushed(), t_end=4.0, dt=4.0, method="standard", integrator=integrator,
                          rtol=rtol, atol=rtol / 100.0)  # fmt: skip
    np.testing.assert_allclose(result.quantity("pin.angle").values, swung(result.t), atol=1.0)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["standard", "joint"])
@pytest.mark.parametrize("dt", [0.05, 2.5])
def test_both_angles_of_a_universal_joint(method, dt):
    """A rotor in a gimbal of no mass: (J1 cos^2 q2 + J3 sin^2 q2) q1_dot is constant, and q2
    follows Lagrange's equation, by SciPy; both angles go through ten turns and more."""
    J1, J2, J3 = 1.0, 2.0, 1.3
    w1, w2 = 17.0, 23.0
    scene = dap.Scene(name="gimbal")
    scene.add_body("rotor", mass=1.0, Jp=(J1, J2, J3), w=(w1, w2, 0.0))
    scene.add_joint("univ", "cross", P_i="rotor.O", P_j="ground.O", a_i="rotor.y", n_j="ground.x")

    def rates(t, y):
        _, q2, w2 = y
        s, c = np.sin(q2), np.cos(q2)
        q1_dot = J1 * w1 / (J1 * c * c + J3 * s * s)
        return [q1_dot, w2, (J3 - J1) * s * c * q1_dot**2 / J2]

    result = dap.simulate(scene, t_end=5.0, dt=dt, method=method, rtol=1e-10, atol=1e-12)
    exact = solve_ivp(rates, (0.0, 5.0), [0.0, 0.0, w2], t_eval=result.t, rtol=1e-12, atol=1e-12)
    assert np.all(exact.y[:2, -1] > 60.0)
    for k in (1, 2):  # rtol = 1e-10 of 100 rad, a hundred times
        found = result.quantity(f"cross.q{k}").values
        np.testing.assert_allclose(found, exact.y[k - 1], atol=1e-6)


@pytest.mark.parametrize("method", ["standard", "joint"])
def test_a_cylindrical_joint_turns_and_slides(method):
    scene = wheel()
    del scene.joints["pin"]
    scene.bodies["wheel"].r_dot = (0.0, 0.0, 2.0)
    scene.add_joint("cyl", "pin", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z")
    result = dap.simulate(scene, t_end=6.0, dt=3.0, method=method)
    np.testing.assert_allclose(result.quantity("pin.angle").values, decaying(result.t), atol=1e-4)
    np.testing.assert_allclose(result.quantity("pin.length").values, 2.0 * result.t, atol=1e-6)


def driven(function="b", joint="drive-rot", **fields):
    """A wheel whose turning a driver prescribes, of 20 rad in 3 s by default."""
    scene = wheel(0.0, 0.0)
    scene.add_vector("down", "ground", (0.0, 0.0, -1.0))
    fields = fields or {"x_start": 0.0, "x_end": 3.0, "f_start": 0.0, "f_end": 20.0}
    scene.add_function(function, "course", **fields)
    axis = "down" if joint == "rel-rot" else "ground.z"  # the former has the sign of the manual
    scene.add_joint(joint, "motor", body_i="wheel", a_j=axis, function="course")
    scene.outputs["turns"] = "pin.angle / (2 * pi)"
    return scene


@pytest.mark.parametrize(
    "dt", [*(pytest.param(x, marks=pytest.mark.slow) for x in (0.1, 2.0)), 4.0]
)
@pytest.mark.parametrize("joint", quickly(["drive-rot", "rel-rot"]))
@pytest.mark.parametrize("analysis", [dap.simulate, dap.kinematics])
def test_a_driven_wheel_follows_its_driver(analysis, joint, dt):
    """At the end 20 rad, as the function says; outputs are made of it."""
    result = analysis(driven(joint=joint), t_end=4.0, dt=dt)
    assert result.quantity("pin.angle").values[-1] == pytest.approx(20.0, abs=1e-5)
    assert result.quantity("turns").values[-1] == pytest.approx(20.0 / (2.0 * np.pi), abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("dt", [0.05, 1.3])
def test_kinematics_of_a_driver_that_turns_back(dt):
    scene = driven("harmonic", amplitude=40.0, frequency=3.0)
    result = dap.kinematics(scene, t_end=1.3, dt=dt)
    wanted = 40.0 * np.sin(3.0 * result.t)
    np.testing.assert_allclose(result.quantity("pin.angle").values, wanted, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["standard", "joint"])
def test_sweeps_keep_turns_whatever_else_they_keep(method):
    points = {"bodies.wheel.w.z": np.array([-90.0, 20.0, 100.0, 333.0])}
    outputs = {"last": "pin.angle:end", "fastest": "pin.angle_rate:max"}
    wanted = points["bodies.wheel.w.z"] / SPEED * decaying(6.0)
    for kept in (outputs, {"last": outputs["last"]}, {"last": lambda r: r["pin.angle"][-1]}):
        if callable(kept["last"]):
            kept = {"last": lambda r: float(r.quantity("pin.angle").values[-1])}
        found = dap.sweep(wheel(), points, outputs=kept, t_end=6.0, method=method)
        np.testing.assert_allclose(found["last"], wanted, atol=1e-3)


def test_sweeps_over_the_axis_and_the_pose_of_a_joint():
    """The axis of a joint, and what its angle is counted from, may differ from point to point."""
    scene = wheel()
    scene.add_vector("axle", "wheel", (0.0, 0.0, 1.0))
    scene.joints["pin"].fields["a_i"] = "axle"
    found = dap.sweep(scene, {"vectors.axle.sp.z": np.array([1.0, 2.0, 0.5])},
                      outputs={"last": "pin.angle:end"}, t_end=6.0)  # fmt: skip
    np.testing.assert_allclose(found["last"], decaying(6.0), atol=1e-3)


@pytest.mark.parametrize("method", ["standard", "joint"])
def test_states_of_a_stepped_run_that_are_read_late(method):
    run = dap.start(wheel(), method=method)
    while run.t < 3.0 - 1e-9:
        run.step(0.05)
    assert run.state["pin.angle"] == pytest.approx(float(decaying(run.t)), abs=1e-4)
    rows = run.result()
    np.testing.assert_allclose(rows.quantity("pin.angle").values, decaying(rows.t), atol=1e-4)
    run.reset()
    assert run.state["pin.angle"] == pytest.approx(0.0, abs=1e-12)
    run.step(2.0)
    assert run.state["pin.angle"] == pytest.approx(float(decaying(2.0)), abs=1e-4)


@pytest.mark.parametrize("method", ["standard", "joint"])
def test_a_controller_that_reads_for_the_first_time(method):
    seen = []

    def law(t, state):
        if t > 2.0:
            seen.append((t, state["pin.angle"]))
        return {"brake": 1.0}

    scene = wheel()
    scene.add_input("brake", value=1.0)
    scene.forces["damper"].fields["input"] = "brake"
    controllers = [dap.Controller(every=0.1, update=law)]
    dap.simulate(scene, t_end=3.0, dt=1.0, method=method, controllers=controllers)
    t, angles = np.array(seen).T
    np.testing.assert_allclose(angles, decaying(t), atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("methods", [("standard", "standard"), ("standard", "joint"),
                                     ("joint", "standard"), ("joint", "joint")])  # fmt: skip
def test_a_run_from_a_result_goes_on_with_its_turns(methods, tmp_path):
    """From its end, from a file, and once more: the same wheel turns on."""
    result = dap.simulate(wheel(), t_end=2.0, dt=1.0, method=methods[0])
    result.save(tmp_path / "run.nc")
    for first in (result, dap.open(tmp_path / "run.nc")):
        second = dap.simulate(wheel(), t_end=2.0, dt=2.0, method=methods[1], start=first)
        third = dap.simulate(wheel(), t_end=1.0, dt=1.0, method=methods[0], start=second)
        for run, since in ((second, 2.0), (third, 4.0)):
            angle = run.quantity("pin.angle").values
            np.testing.assert_allclose(angle, decaying(since + run.t), atol=1e-4)


@pytest.mark.parametrize("method", ["joint", "standard"])
@pytest.mark.parametrize("integrator", ["dop853", pytest.param("adams", marks=pytest.mark.slow)])
def test_an_event_at_an_angle(method, integrator):
    """The wheel passes 77.5 rad once, within steps of several turns in joint coordinates."""
    events = [dap.Event("pin.angle", at=77.5)]
    result = dap.simulate(wheel(), t_end=2.0, dt=2.0, method=method, integrator=integrator,
                          events=events)  # fmt: skip
    when = -np.log(1.0 - 77.5 * DECAY / SPEED) / DECAY
    assert [event.t for event in result.events] == [pytest.approx(when, abs=1e-6)]


class EnoughError(Exception):
    pass


@pytest.mark.slow
@pytest.mark.parametrize("method", ["standard", "joint"])
def test_resumed_saved_and_opened_runs_have_their_turns(method, tmp_path):
    def stop(t, t_end):
        if t > 2.0:
            raise EnoughError

    path = tmp_path / "run.nc"
    with pytest.raises(EnoughError):
        dap.simulate(wheel(), t_end=6.0, dt=0.001, output=path, checkpoint=np.inf, progress=stop,
                     method=method)  # fmt: skip
    resumed = dap.resume(tmp_path / "run.nc.checkpoint")
    for result in (resumed, dap.open(path), dap.rerun(path).again):
        np.testing.assert_allclose(
            result.quantity("pin.angle").values, decaying(result.t), atol=1e-4
        )
    angles = dap.open(path).to_xarray()["angles"]
    assert angles["angle"].values.tolist() == ["motions.pin.q1"]


def test_a_file_without_counts_is_opened_and_its_guess_is_named(tmp_path):
    """As an older program wrote it: right where reports are near, with a note in any case."""
    result = dap.simulate(wheel(), t_end=6.0, dt=0.01)
    without_turns(result).save(tmp_path / "older.nc")
    read = dap.open(tmp_path / "older.nc")
    np.testing.assert_allclose(read.quantity("pin.angle").values, decaying(read.t), atol=1e-4)
    assert sum("holds no turns" in note for note in read.notes) == 1
    assert not any("holds no turns" in note for note in result.notes)
    dap.simulate(wheel(), t_end=0.1, start=read)


@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "rk4"])
def test_given_steps_are_shortened_where_they_are_too_long_to_count_in(integrator):
    """Steps of up to 50 rad; then of up to half a turn: no turn is lost but by the phase of rk4,
    which errs by 2 (pi/2)^5 / 120 = 0.16 rad in each of some 400 steps."""
    scene = wheel(0.0, 0.0)
    scene.add_force("np", "push", body_i="wheel", np=(0.0, 0.0, 1e4))
    result = dap.simulate(scene, t_end=0.5, dt=0.5, integrator=integrator, step=0.01,
                          method="standard")  # fmt: skip
    assert result.stats.rejected > 0
    tolerance = {"dop853": 0.01, "dopri5": 6.0, "rk4": 64.0}[integrator]
    assert result.quantity("pin.angle").values[-1] == pytest.approx(1250.0, abs=tolerance)
    assert not any("turns" in note for note in result.notes)


def test_inverse_dynamics_take_turns_from_the_motion():
    """What a moment must be for the motion of a run, reported every 2 s; its angle is the run's."""
    run = dap.simulate(wheel(), t_end=6.0, dt=2.0)
    scene = wheel()
    scene.add_input("signal", value=0.0)
    scene.add_force("np", "motor", body_i="wheel", np=(0.0, 0.0, 1.0), input="signal")
    found = dap.inverse(scene, run, ["motor"])
    np.testing.assert_allclose(found.quantity("pin.angle").values, decaying(run.t), atol=1e-4)


def test_a_start_between_reports_that_are_far_apart_is_refused():
    """100 rad/s, reported every second: half a second later the pose is not known."""
    run = dap.simulate(wheel(), t_end=2.0, dt=1.0)
    with pytest.raises(dap.SceneError, match="more than half a turn between the reported instants"):
        dap.simulate(wheel(), t_end=0.1, start=(run, 0.5))
    near = dap.simulate(wheel(), t_end=2.0, dt=0.01)
    begun = dap.simulate(wheel(), t_end=0.1, start=(near, 1.003)).quantity("pin.angle").values[0]
    assert begun == pytest.approx(float(decaying(1.003)), abs=1e-4)


def test_a_start_between_reports_at_rest_with_turns_between_them_is_refused():
    """By -40 rad from rest to rest between two reports: angles tell, speeds do not."""
    scene = wheel(0.0, 0.0)
    scene.add_function("b", "turning", x_start=0.0, x_end=3.0, f_start=0.0, f_end=-40.0)
    scene.add_joint("drive-rot", "motor", body_i="wheel", a_j="ground.z", function="turning")
    run = dap.simulate(scene, t_end=4.0, dt=4.0)
    with pytest.raises(dap.SceneError, match="changes by 40 rad, by more than half a turn"):
        dap.simulate(wheel(0.0, 0.0), t_end=0.1, start=(run, 2.0))
