"""Velocities that jump, and contacts, in exported models: the bits of runs in Python."""

import numpy as np
import pytest
from support.bouncing import bouncing, swinging
from support.jumping import JUMPING
from tests.unit.native.test_export import differences, exported

import dap3d_core as dap
from dap3d_core.native.run.prepared import PreparedRun


@pytest.mark.slow
@pytest.mark.every(6)
@pytest.mark.parametrize(
    ("make", "settings"),
    [
        *((bouncing, {"integrator": name}) for name in ("dop853", "adams", "radau")),
        (bouncing, {"integrator": "rk4", "step": 1e-2}),
        *((swinging, {"method": method}) for method in ("standard", "lsq")),
    ],
)
def test_jumps_have_the_bits_of_simulate(tmp_path, make, settings):
    assert differences(make(), tmp_path, 2.0, **settings)


@pytest.mark.slow
def test_what_touches_at_the_start_jumps_there_and_once(tmp_path):
    """At z = 0 with 1 m/s downwards and e = 0.8: 0.8 m/s upwards at once."""
    scene = bouncing()
    scene.bodies["ball"].r, scene.bodies["ball"].r_dot = (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)
    assert differences(scene, tmp_path, 0.3)
    _, library = exported(scene, tmp_path, outputs=["ball.rd.z"], parameters=["forces.floor.e"])
    run = library.start(1.0)
    assert run["ball.rd.z"] == pytest.approx(0.8, rel=1e-14)
    run = library.start(1.0)
    run["forces.floor.e"] = 0.5
    assert run["ball.rd.z"] == pytest.approx(0.5, rel=1e-14)


@pytest.mark.slow
def test_jumps_between_steps_with_inputs(tmp_path):
    scene = bouncing()
    scene.add_input("wind", value=0.0)
    scene.add_force("f", "blow", body_i="ball", f=(1.0, 0.0, 0.0), input="wind")
    _, library = exported(scene, tmp_path, outputs=["ball.r", "ball.rd"])
    here, there = dap.start(scene, t_end=2.0), library.start(2.0)
    for k in range(20):
        wind = float(np.sin(k))
        here.step(0.1, inputs={"wind": wind})
        there["wind"] = wind
        there.step_to(here.t)
        for name in ("ball.r.x", "ball.r.z", "ball.rd.z"):
            assert there[name] == here.state[name]


@pytest.mark.slow
def test_a_saved_state_continues_behind_a_jump(tmp_path):
    _, library = exported(bouncing(), tmp_path, outputs=["ball.r.z"])
    run, other = library.start(2.0), library.start(2.0)
    run.step_to(0.6)
    other.load(run.save())
    run.step_to(1.9)
    other.step_to(1.9)
    assert run["ball.r.z"] == other["ball.r.z"]


def test_what_nothing_carries_is_refused_by_name(tmp_path):
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 1.0))
    scene.add_force("test-bounce", "floor", P_i="ball.O", e=0.5)
    with pytest.raises(dap.SceneError, match="jump at floor, whose type carries nothing"):
        exported(scene, tmp_path, registry=JUMPING)


def test_a_method_in_coordinates_of_joints_is_refused(tmp_path):
    for make, what in ((swinging, "velocities jump"), (door, "contacts change at events")):
        with pytest.raises(dap.SceneError, match=what) as refused:
            exported(make(), tmp_path, method="joint")
        assert 'set method = "lsq" in [simulation]' in str(refused.value)


@pytest.mark.slow
def test_a_driver_that_an_input_sets_does_work(tmp_path):
    """A disk of 1.08 kg m^2 about its hub is given speeds at once: its work is its energy, in J."""
    scene = dap.Scene(name="turntable")
    scene.add_body("disk", mass=2.0, Jp=(0.5, 0.5, 0.9), r=(0.3, 0, 0))
    scene.add_input("speed", value=0.0)
    scene.add_point("hub", "disk", (-0.3, 0, 0))
    scene.add_joint("rev", "axle", P_i="hub", P_j="ground.O", a_i="disk.z", a_j="ground.z")
    scene.add_joint("motor", "drive", joint="axle", speed="speed")
    _, library = exported(scene, tmp_path, outputs=["work"])
    here, there = dap.start(scene, t_end=1.0), library.start(1.0)
    for speed in (2.0, -1.0):
        here.step(0.1, inputs={"speed": speed})
        there["speed"] = speed
        there.step_to(here.t)
        assert there["work"] == pytest.approx(0.5 * 1.08 * speed**2, rel=1e-13)
        assert there["work"] == pytest.approx(here.state["work"], rel=1e-14)


def thrown(**more):
    """A ball that bounces, slides and rolls; e and mu."""
    scene = dap.Scene(name="thrown")
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=[0, 0, 0.3], r_dot=[3.0, 0, 0])
    scene.add_force("weight", "g")
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1, mu=0.3, e=0.5, **more)
    return scene


def sled():
    """A box that slides on four of its corners, which share what they carry, and stops."""
    scene = dap.Scene(name="sled")
    scene.add_body("box", mass=1.0, Jp=[0.01, 0.015, 0.02], r=[0, 0, 0.05], r_dot=[1.0, 0.2, 0])
    scene.add_force("weight", "g")
    scene.add_contact("box_plane", "floor", P_i="box.O", size=[0.4, 0.3, 0.1], mu=0.3, mu_s=0.4)
    return scene


def door():
    """A pendulum between limits, with friction of its hinge by a moment, and by its load."""
    scene = dap.Scene(name="door")
    scene.add_body("door", mass=1.0, Jp=[0.01, 0.02, 0.02], r=[0.5, 0, 0], w=[0, -4.0, 0])
    scene.bodies["door"].r_dot = [0.0, 0.0, 2.0]
    scene.add_point("pin", "door", [-0.5, 0, 0])
    hinge = {"P_i": "pin", "P_j": "ground.O", "a_i": "door.y", "a_j": "ground.y"}
    scene.add_joint("rev", "hinge", **hinge, lower=-0.6, upper=0.6, e=0.5)
    scene.add_force("weight", "g")
    scene.add_force("rot_friction", "rubs", joint="hinge", n_c=0.1)
    scene.add_force("friction", "presses", joint="hinge", mu=0.1, radius=0.02)
    return scene


@pytest.mark.slow
@pytest.mark.every(8)
@pytest.mark.parametrize(
    ("make", "settings"),
    [
        (sled, {}),
        *((thrown, {"integrator": name}) for name in ("dop853", "adams", "radau", "auto")),
        (thrown, {"integrator": "rk4", "step": 1e-3}),
        *((door, {"method": method}) for method in ("lsq", "auto")),
    ],
)
def test_contacts_that_events_follow_have_the_bits_of_simulate(tmp_path, make, settings):
    settings = {name: value for name, value in settings.items() if value != "auto"} | (
        {"integrator": "auto"} if settings.get("integrator") == "auto" else {}
    )
    assert any(e.kind for e in dap.simulate(make(), t_end=1.5, **settings).events)
    assert differences(make(), tmp_path, 1.5, **settings)


@pytest.mark.slow
def test_contacts_between_steps_with_inputs_and_saved_states(tmp_path):
    scene = thrown()
    scene.add_input("wind", value=0.0)
    scene.add_force("f", "blow", body_i="ball", f=(1.0, 0.0, 0.0), input="wind")
    _, library = exported(scene, tmp_path, outputs=["ball.r", "ball.w"])
    here, there, other = dap.start(scene, t_end=1.0), library.start(1.0), library.start(1.0)
    for k in range(20):
        wind = 5.0 * float(np.sin(k // 2))
        here.step(0.05, inputs={"wind": wind})
        other.load(there.save())
        for run in (there, other):
            run["wind"] = 7.0  # what no step holds changes nothing
            run["wind"] = wind
            run.step_to(here.t)
            for name in ("ball.r.x", "ball.r.z", "ball.w.y"):
                assert run[name] == here.state[name]


@pytest.mark.slow
def test_drivers_beside_contacts_read_inputs(tmp_path):
    """A ball on a plate that an input moves: it slips, sticks and rolls."""
    scene = dap.Scene(name="plate")
    scene.add_body("plate", mass=3.0, Jp=[0.1, 0.2, 0.2])
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=[0, 0, 0.1])
    scene.add_input("speed", value=0.0)
    scene.add_joint("tran", "track", P_i="plate.O", P_j="ground.O", a_j="ground.x")
    scene.add_joint("motor", "drive", joint="track", speed="speed")
    scene.add_force("weight", "g")
    ends = {"P_i": "ball.O", "P_j": "plate.O", "a_j": "plate.z"}
    scene.add_contact("ball_plane", "touch", **ends, radius=0.1, mu=0.2)
    names = ["plate.rd.x", "ball.r.x", "ball.rd.x", "ball.w.y", "work"]
    _, library = exported(scene, tmp_path, outputs=names)
    here, there = dap.start(scene, t_end=1.0), library.start(1.0)
    for k in range(10):
        speed = float(np.sin(0.8 * (k // 2)))
        here.step(0.1, inputs={"speed": speed})
        there["speed"] = 7.0  # what no step holds changes nothing
        there["speed"] = speed
        there.step_to(here.t)
        assert there.values(names).tolist() == [here.state[name] for name in names]
    assert any(event.kind == "stick" for event in here.result().events)


@pytest.mark.slow
def test_friction_and_restitution_are_parameters(tmp_path):
    names = ["contacts.floor.mu", "contacts.floor.e"]
    made, library = exported(thrown(), tmp_path, outputs=["ball.r", "ball.rd"], parameters=names)
    run = library.start(1.0)
    run["contacts.floor.mu"], run["contacts.floor.e"] = 0.1, 0.8
    run.step_to(1.0)
    scene = thrown()
    scene.contacts["floor"].fields |= {"mu": 0.1, "e": 0.8}
    result = dap.simulate(scene, t_end=1.0, dt=1.0)
    expected = np.hstack([result.r[-1, 0], result.rd[-1, 0]])
    assert np.array_equal(run.values(made.outputs), expected)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "there", "value"), [("e", 0.0, 0.5), ("mu_s", 0.3, 0.4)])
def test_a_parameter_may_be_at_its_limit_in_the_scene(tmp_path, name, there, value):
    """Values on one side of it are not accepted, with restitution 0 and mu_s as great as mu."""
    scene, path = thrown(), f"contacts.floor.{name}"
    scene.contacts["floor"].fields[name] = there
    made, library = exported(scene, tmp_path, outputs=["ball.r", "ball.rd"], parameters=[path])
    run = library.start(1.0)
    run[path] = value
    run.step_to(1.0)
    scene.contacts["floor"].fields[name] = value
    result = dap.simulate(scene, t_end=1.0, dt=1.0)
    expected = np.hstack([result.r[-1, 0], result.rd[-1, 0]])
    assert np.array_equal(run.values(made.outputs), expected)


@pytest.mark.slow
def test_what_contacts_cannot_do_ends_the_run_with_their_name(tmp_path):
    scene = door()
    scene.bodies["door"].w, scene.bodies["door"].r_dot = (0, -1.0, 0), (0, 0, 0.5)
    scene.add_function("a", "turn", coeff=(0.0, 1.0, 0.0))
    scene.add_joint("drive-rot", "drive", joint="hinge", function="turn")
    for name in ("rubs", "presses"):
        del scene.forces[name]
    _, library = exported(scene, tmp_path, outputs=["door.r"], method="lsq")
    run = library.start(1.0)
    for t in (1.0, 1.0):
        with pytest.raises(dap.SimulationError, match=r"t = 0\.6 s: contact hinge_.* closes, and"):
            run.step_to(t)


def test_equal_models_have_equal_memory():
    """Wherever the arrays of the run are: an export gives the same files every time."""
    one, other = (PreparedRun(dap.load("gripper")).image for _ in range(2))
    assert np.array_equal(one.words, other.words)
    assert one.addresses == other.addresses
