"""Exported models: their runs have the bits of runs in Python."""

import shutil
import subprocess
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import attrs
import numpy as np
import pytest
from support.bouncing import bouncing
from support.internals import contact_jumps, placed_shapes
from support.own_types import registry_of
from verification.test_rolling_resistance import Wheel, scene_on_wheel

import dap3d_core as dap
from dap3d_core.integrators.moreau import arrays
from dap3d_core.native import export
from dap3d_core.native.build import own_platform
from dap3d_core.native.fmu import description_of

SPRING = """
[scene]
name = "cart"
schema = 1

[inputs.push]
value = 0.0

[parameters]
stiffness = 40.0

[bodies.cart]
mass = 2.0
r = [0.1, 0.0, 0.0]

[joints.track]
type = "tran"
P_i = "cart.O"
P_j = "ground.O"
a_j = "ground.x"

[forces.spring]
type = "tran_sda"
joint = "track"
k = "= stiffness"
c = 0.3

[forces.motor]
type = "f"
body_i = "cart"
f = [1.0, 0.0, 0.0]
input = "push"

[outputs]
double = "2 * cart.r.x + where(t < 1, 0, cart.rd.x)"
reach = "norm(cart.r) - track.length"

[simulation]
t_end = 2.0
"""


def exported(scene, folder, **options):
    made = dap.export_model(scene, folder / "out", format="c", force=True, **options)
    return made, dap.load_native(made.path)


def states_of(scene):
    return [f"{body}.{q}" for body in scene.bodies for q in ("r", "p", "rd")]


def course(run, result, made, names):
    """Outputs of a run of an exported model at the instants of a result, and those of that."""
    rows = []
    for t in result.t:
        assert run.step_to(t)
        rows.append(run.values(made.outputs))
    return np.array(rows), np.hstack([result.quantity(name).values for name in names])


def differences(scene, folder, t_end, count=20, more=(), **settings):
    """Whether states, and more, at communication points are those of a run, bit for bit."""
    names = [*states_of(scene), *more]
    made, library = exported(scene, folder, outputs=names, **settings)
    result = dap.simulate(scene, t_end=t_end, dt=t_end / count, **settings)
    return np.array_equal(*course(library.start(t_end), result, made, names))


@pytest.mark.every(5)
@pytest.mark.parametrize(
    ("model", "t_end", "settings"),
    [
        # break points, angles, no joints
        ("tri", 3.5, {"integrator": "dop853"}),
        ("pen1", 0.5, {"integrator": "dop853"}),
        ("fourbar2", 0.5, {"integrator": "dop853"}),
        ("pen1", 0.5, {"integrator": "rk4", "step": 1e-3}),
        ("bodies2", 0.5, {"integrator": "dop853"}),
        *(("pen1", 0.5, {"integrator": name}) for name in ("dopri5", "adams", "radau", "auto")),
    ],
)
def test_a_run_has_the_bits_of_simulate(tmp_path, model, t_end, settings):
    assert differences(dap.load(model), tmp_path, t_end, **settings)


@pytest.mark.slow
def test_so_have_runs_in_joint_coordinates(tmp_path):
    scene = dap.load("pen2")
    names = states_of(scene)
    made, library = exported(scene, tmp_path, method="joint", outputs=names)
    result = dap.simulate(scene, t_end=0.5, dt=0.05, method="joint")
    # poses follow from coordinates by other code here: the same but for the last bits
    np.testing.assert_allclose(*course(library.start(0.5), result, made, names), rtol=0, atol=2e-15)


@pytest.mark.slow
def test_auto_continues_with_radau_where_a_scene_is_stiff(tmp_path):
    scene = _written(SPRING, tmp_path)
    scene.forces["spring"].fields |= {"c": 2e5}
    scene.inputs.clear()
    del scene.forces["motor"]
    result = dap.simulate(scene, integrator="auto")
    assert any("then radau" in note for note in result.notes)
    assert differences(scene, tmp_path, 2.0, integrator="auto")


def _written(text, folder):
    (folder / "cart.toml").write_text(text)
    return dap.load(folder / "cart.toml")


def braced(folder):
    """The cart, with a spring to a point beside its track."""
    scene = _written(SPRING, folder)
    scene.add_point("post", body="ground", sPp=(0.1, 1.0, 0.0))
    scene.add_force("ptp", "brace", P_i="post", P_j="cart.O", k=20.0, l0=0.5)
    return scene


def pushed(folder):
    """The cart, with a force that takes other forms at 0.4 s and 0.7 s."""
    scene = _written(SPRING, folder)
    scene.add_function("step", "push", x_start=0.4, x_end=0.7, f_start=6.0, f_end=0.0)
    scene.add_force("f", "pushed", body_i="cart", f=(1.0, 0.0, 0.0), function="push")
    return scene


def test_inputs_are_held_as_in_a_run_step_by_step(tmp_path):
    scene = _written(SPRING, tmp_path)
    made, library = exported(scene, tmp_path, outputs=["cart.r", "cart.rd", "push"])
    assert made.inputs == ("push",)
    here, there = dap.start(scene, t_end=2.0), library.start(2.0)
    for k in range(20):
        push = float(np.sin(0.7 * k))
        here.step(0.1, inputs={"push": push})
        there["push"] = push
        there.step_to(here.t)
        found = there.values(["cart.r.x", "cart.rd.x", "push"])
        assert found.tolist() == [here.state["cart.r.x"], here.state["cart.rd.x"], push]


@pytest.mark.slow
def test_outputs_are_those_of_a_result(tmp_path):
    scene = _written(SPRING, tmp_path)
    names = ["track.length", "track.length_rate", "energy.kinetic", "energy.total", "cart.rdd",
             "cart.w", "work", "t", "track.lambda", "constraint.position", "double",
             "reach", "cart.r.norm"]  # fmt: skip
    made, library = exported(scene, tmp_path, outputs=names)
    result = dap.start(scene, t_end=2.0)
    run = library.start(2.0)
    for _ in range(12):
        result.step(0.15)
        run.step_to(result.t)
    found = result.result()
    expected = np.concatenate([np.atleast_1d(found.quantity(n).values[-1]) for n in names])
    # sums in another order, of numbers of the order of 10: some units in their last places
    np.testing.assert_allclose(run.values(made.outputs), expected, rtol=1e-14, atol=1e-14)


def test_a_parameter_is_set_before_a_run_or_in_its_course(tmp_path):
    scene = _written(SPRING, tmp_path)
    made, library = exported(scene, tmp_path, parameters=["forces.spring.k", "forces.spring.c"])
    assert made.parameters == ("forces.spring.k", "forces.spring.c")
    run, other = library.start(2.0), scene.copy()
    run["forces.spring.k"] = 55.0
    other.forces["spring"].fields["k"] = 55.0
    result = dap.start(other, t_end=2.0)
    for _ in range(4):
        result.step(0.1)
        run.step_to(result.t)
    assert run["state.cart.r.x"] == result.state["cart.r.x"]
    run["forces.spring.k"] = 10.0
    assert run["forces.spring.k"] == 10.0
    # m r'' = -k r - c r' with the new k: its rate at once
    y, v = run["state.cart.r.x"], run["state.cart.rd.x"]
    assert run["der(state.cart.rd.x)"] == pytest.approx((-10.0 * y - 0.3 * v) / 2.0, rel=1e-14)


@pytest.mark.slow
def test_values_that_a_scene_refuses_are_refused(tmp_path):
    """By name, value and limit, and nothing is set; values at the limits are taken."""
    scene = braced(tmp_path)
    inertias = [f"bodies.cart.Jp.{axis}" for axis in "xyz"]
    names = ["forces.brace.l0", "bodies.cart.mass", *inertias]
    made, library = exported(scene, tmp_path, parameters=names)
    assert "l0 [m]; should be at least 0 */" in (made.path / "variables.h").read_text()
    run = library.start(1.0)
    for name, value, said in (
        ("forces.brace.l0", -8.0, "forces.brace.l0 = -8: should be at least 0"),
        ("bodies.cart.mass", 0.0, "bodies.cart.mass = 0: should be at least 1e-100"),
        ("bodies.cart.mass", np.nan, "finite"),
    ):
        before = run[name]
        with pytest.raises(ValueError, match=said):
            run[name] = value
        assert run[name] == before
    run["forces.brace.l0"] = 0.0
    for name in inertias:  # on the way the first two are no inertias
        run[name] = 5.0
    assert run.step_to(0.1)
    for value in (-1.0, 10.1, 0.0):
        run = library.start(1.0)
        run[inertias[2]] = value
        with pytest.raises(dap.SimulationError, match="inertias of a body should be positive"):
            run.step_to(0.1)


@pytest.mark.slow
def test_parameters_of_which_one_is_under_the_other_are_set_one_by_one(tmp_path):
    """In any order; where a run goes on they have to be in theirs."""
    scene = _written(SPRING, tmp_path)
    scene.add_force("tran_friction", "rub", joint="track", f_c=0.3, f_s=0.4)
    names = ["forces.rub.f_c", "forces.rub.f_s"]
    made, library = exported(scene, tmp_path, parameters=names)
    assert "at most forces.rub.f_s" in (made.path / "variables.h").read_text()
    run = library.start(1.0)
    run[names[0]] = 0.8
    y = run.values([name for name, kind in library.kinds.items() if kind == "state"])
    said = r"f_c = 0\.8: should be at most forces\.rub\.f_s = 0\.4"
    for go_on in (lambda: run.step_to(0.5), lambda: run.derivatives(0.0, y)):
        with pytest.raises(dap.SimulationError, match=said):
            go_on()
    run[names[1]] = 0.9
    run.step_to(0.5)
    scene.forces["rub"].fields |= {"f_c": 0.8, "f_s": 0.9}
    here = dap.start(scene, t_end=1.0)
    here.step(0.5)
    assert run["state.cart.r.x"] == here.state["cart.r.x"]


def two_floors():
    """Balls on floors with one coefficient where they slide, and two where they stick."""
    scene = dap.Scene(name="two")
    scene.parameters["mu"] = 0.2
    for k, name in enumerate("ab"):
        scene.add_body(name, mass=1.0, Jp=[0.01] * 3, r=[2.0 * k, 0, 0.1], r_dot=[1.0, 0, 0])
        ends = {"P_i": f"{name}.O", "radius": 0.1}
        scene.add_contact("ball_plane", f"floor_{name}", **ends, mu="= mu", mu_s=0.3 + 0.1 * k)
    scene.add_force("weight", "g")
    return scene


@pytest.mark.slow
def test_a_parameter_is_under_two_others(tmp_path):
    shared, *others = "parameters.mu", "contacts.floor_a.mu_s", "contacts.floor_b.mu_s"
    options = {"outputs": ["a.r.x", "b.r.x"], "parameters": [shared, *others]}
    made, library = exported(two_floors(), tmp_path, **options)
    run = library.start(0.2)
    run[shared] = 0.5
    for name in others:
        with pytest.raises(dap.SimulationError, match=f"should be at most {name} ="):
            run.step_to(0.2)
        run[name] = 0.6
    run.step_to(0.2)
    scene = two_floors()
    scene.parameters["mu"] = 0.5
    for name in "ab":
        scene.contacts[f"floor_{name}"].fields["mu_s"] = 0.6
    result = dap.simulate(scene, t_end=0.2)
    assert [run[n] for n in made.outputs] == [result.quantity(n).values[-1] for n in made.outputs]


def test_names_and_descriptions_end_no_comment_and_are_legal_xml(tmp_path):
    scene = _written(SPRING, tmp_path)
    scene.name, scene.description = "n" * 300, "an end */ int x; what ??/ /* \x01 \ufffe ]]> <b>"
    scene.add_body("größe/*", mass=1.0)
    model = export.model_of(scene, ["größe/*.r"])
    assert model.name == "n" * export.LONGEST
    header = export.variables_header(model.prepared, model.variables)
    head, *lines = header.splitlines()
    assert head.endswith("an end * / int x; what ? ?/ / * \x01 \ufffe ]]> <b>")
    assert any("V_GR_E_R_X = " in line and line.count("/*") == 1 for line in lines)
    for fmi in (2, 3):
        root = ElementTree.fromstring(description_of(model, "{}", fmi))
        assert root.get("description") == scene.description.translate({1: " ", 0xFFFE: " "})


@pytest.mark.slow
def test_a_parameter_of_a_table_is_one_as_well(tmp_path):
    scene = _written(SPRING, tmp_path)
    made, _ = exported(scene, tmp_path, parameters=["parameters.stiffness"])
    assert made.parameters == ("parameters.stiffness",)


def test_a_saved_state_continues_with_the_same_bits(tmp_path):
    scene = dap.load("pen1")
    _, library = exported(scene, tmp_path)
    run, other = library.start(1.0), library.start(1.0)
    run.step_to(0.3)
    state = run.save()
    run.step_to(0.7)
    other.step_to(0.9)
    other.load(state)
    assert other.t == 0.3
    other.step_to(0.7)
    names = list(library.references)
    assert other.values(names).tolist() == run.values(names).tolist()
    with pytest.raises(ValueError, match="not one of this model"):
        other.load(state[:8])
    with pytest.raises(ValueError, match="not one of this model"):
        other.load(b"x" * len(state))


def test_derivatives_are_those_of_the_equations(tmp_path):
    scene = dap.load("pen1")
    _, library = exported(scene, tmp_path)
    run, compiled = library.start(1.0), dap.compile(scene)
    names = [name for name, kind in library.kinds.items() if kind == "state"]
    y = run.values(names)
    evaluator = compiled.evaluator
    out = np.zeros_like(y)
    evaluator.functions[0](0.0, y, out, evaluator.system, evaluator.loops)
    assert run.derivatives(0.0, y).tolist() == out.tolist()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"outputs": ["cart.roll"]}, "cart.roll is computed by Python alone"),
        ({"outputs": ["cart.q"]}, "cart"),
        ({"parameters": ["bodies.cart.p.e0"]}, "cannot be set in an exported model"),
        ({"parameters": ["bodies.cat.mass"]}, "did you mean"),
        ({"platforms": ["plan9"]}, "platforms: linux, windows, macos"),
        ({"fmi": 1}, "FMI 3 and 2"),
    ],
)
def test_what_cannot_be_exported_is_refused_by_name(tmp_path, options, said):
    with pytest.raises(dap.SceneError, match=said):
        exported(_written(SPRING, tmp_path), tmp_path, **options)


@pytest.mark.slow
def test_steps_that_make_no_sense_are_refused(tmp_path):
    _, library = exported(dap.load("pen1"), tmp_path)
    run = library.start(1.0)
    with pytest.raises(dap.SimulationError, match="beyond the end"):
        run.step_to(2.0)
    for t in (np.inf, np.nan):
        with pytest.raises(dap.SimulationError):
            run.step_to(t)
    assert run.t == 0.0
    run.step_to(1.0)
    with pytest.raises(dap.SimulationError, match="goes forward"):
        run.step_to(0.5)
    assert not run.step_to(1.5)
    with pytest.raises(ValueError, match="inputs and parameters"):
        run["state.cone.r.x"] = 1.0
    with pytest.raises(KeyError, match=r"'state\.con\.r\.x'; did you mean 'state\.cone"):
        run["state.con.r.x"]


@pytest.mark.slow
def test_steps_go_on_from_a_state_that_is_set_behind_the_end(tmp_path):
    _, library = exported(dap.load("pen1"), tmp_path)
    states = [name for name, kind in library.kinds.items() if kind == "state"]
    run = library.start(0.2)
    start = run.values(states)
    assert run.step_to(0.2)
    expected = run.values(states)
    assert not library.functions.dap3d_set_states(run._model, 0.0, start.ctypes.data)
    assert run.step_to(0.2)
    assert np.array_equal(run.values(states), expected)


def test_rates_before_a_run_begins_are_those_of_the_mass_that_was_set(tmp_path):
    _, library = exported(dap.load("pen1"), tmp_path, parameters=["bodies.cone.mass"])
    states = [name for name, kind in library.kinds.items() if kind == "state"]
    y = library.start(1.0).values(states)
    run = library.start(1.0)
    run["bodies.cone.mass"] *= 1.5
    before = run.derivatives(0.0, y)
    run.values(states)  # which begins the run
    assert np.array_equal(before, run.derivatives(0.0, y))


@pytest.mark.slow
def test_a_run_that_fails_is_where_it_stopped(tmp_path):
    _, library = exported(dap.load("A05"), tmp_path, integrator="rk4", step=1e-3)
    states = [name for name, kind in library.kinds.items() if kind == "state"]
    run, other = library.start(1.0), library.start(1.0)
    with pytest.raises(dap.SimulationError, match=r"stopped at t = 0\.004 s"):
        run.step_to(1.0)
    assert run.t == pytest.approx(3e-3, rel=1e-12)  # the last step that has an end
    other.step_to(run.t)
    assert np.array_equal(run.values(states), other.values(states))


@pytest.mark.slow
def test_contacts_begin_anew_where_states_are_set(tmp_path, monkeypatch):
    """A limit of 6 bounces within 0.5 s, where a course has one in 1 s, and the seventh at 3 s."""
    monkeypatch.setattr(contact_jumps, "MOST_CHANGES", 6)
    monkeypatch.setattr(contact_jumps, "WITHIN", 0.05)
    _, library = exported(bouncing_contact(), tmp_path)
    states = [name for name, kind in library.kinds.items() if kind == "state"]
    run = library.start(10.0)
    start = run.values(states)
    for _ in range(8):  # bounces of courses before do not count
        assert run.step_to(0.6)
        assert not library.functions.dap3d_set_states(run._model, 0.0, start.ctypes.data)
    with pytest.raises(dap.SimulationError, match="change ever faster"):
        run.step_to(9.0)
    assert not library.functions.dap3d_set_states(run._model, 0.0, start.ctypes.data)
    assert run.step_to(0.6)  # through a bounce at 0.45 s


def bouncing_contact():
    scene = bouncing()
    del scene.forces["floor"]
    scene.add_contact("ball_plane", "floor", P_i="ball.O", e=0.8)
    return scene


@pytest.mark.slow
def test_the_example_compiles_without_a_warning_and_runs(tmp_path):
    made, library = exported(dap.load("pen1"), tmp_path, outputs=["cone.r.x", "energy.total"])
    archive = made.path / own_platform() / "libpen1.a"
    command = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-DDAP3D_STATIC",
               made.path / "example.c", archive, "-lm", "-o", tmp_path / "example"]  # fmt: skip
    subprocess.run(command, check=True)
    done = subprocess.run([tmp_path / "example", "0.5", "10"], capture_output=True, text=True,
                          check=True)  # fmt: skip
    head, *rows = done.stdout.splitlines()
    assert head == "time,cone.r.x,energy.total"
    run = library.start(0.5)
    for k in range(11):
        run.step_to(0.05 * k)
    last = [float(word) for word in rows[-1].split(",")]
    assert len(rows) == 11
    assert last == [0.5, *run.values(["cone.r.x", "energy.total"])]


@pytest.mark.slow
def test_the_example_in_rust_gives_the_same(tmp_path):
    if shutil.which("rustc") is None:
        pytest.skip("there is no rustc")
    made, library = exported(dap.load("pen1"), tmp_path, outputs=["cone.r.x"], t_end=0.5)
    subprocess.run(["rustc", "-L", own_platform(), "example.rs", "-o", "example"], check=True,
                   cwd=made.path)  # fmt: skip
    done = subprocess.run([made.path / "example"], capture_output=True, text=True, check=True)
    run = library.start(0.5)
    for line in done.stdout.splitlines():
        t, name, value = line.split()
        run.step_to(float(t))
        assert (name, float(value)) == ("cone.r.x", run["cone.r.x"])
    assert run.t == 0.5


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"parameters": ["forces.spring.k", "forces.spring.k"]}, "only once"),
        ({"parameters": ["forces.spring.kk"]}, 'parameters = "forces.spring.kk"'),
        ({"parameters": ["parameters.stiffness", "forces.spring.k"]}, "set the same number"),
        ({"parameters": ["inputs.push.value"]}, "set push in its place"),
        ({"parameters": ["functions.push.x_end"]}, "moves a break point"),
        ({"t_end": 0.0}, "no time to run"),
        ({"t_end": -1.0}, "no time to run"),
    ],
)
def test_what_would_be_said_wrongly_is_refused(tmp_path, given, said):
    with pytest.raises(dap.SceneError, match=said):
        dap.export_model(pushed(tmp_path), tmp_path / "out", format="c", **given)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_an_output_that_is_named_twice_is_one(tmp_path):
    made = dap.export_model(
        _written(SPRING, tmp_path), tmp_path / "out", format="c", outputs=["cart.r", "cart.r.x"]
    )
    assert made.outputs == ("cart.r.x", "cart.r.y", "cart.r.z")


def falling_ball(**material):
    """A ball that falls onto a floor, by time stepping."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=[0, 0, 0.15], r_dot=[3.0, 0, 0])
    scene.add_shape("sphere", body="ball", radius=0.1, collides=True)
    scene.add_shape("plane", body="ground", collides=True)
    scene.add_material("surface", mu=0.3, **material)
    scene.add_collisions(material="surface")
    scene.add_force("weight", "gravity")
    scene.simulation = attrs.evolve(scene.simulation, contact_step=4e-3)
    return scene


def declared_ball(speed=3.0, **resistance):
    """A ball that slides on a plane, then rolls; a declared contact."""
    scene = dap.Scene(name="declared")
    motion = {"r_dot": [speed, 0, 0], "w": [0, 0, 3.0]}
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=[0, 0, 0.1], **motion)
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1, mu=0.3, **resistance)
    scene.add_force("weight", "gravity")
    return scene


#: It slides until 0.09 s, rolls, spins until 0.24 s, and rests at 0.26 s.
RESISTING = partial(declared_ball, 0.5, mu_roll=0.02, mu_spin=0.005)


def dropped_capsule():
    """Of the rates of what touches, a little is left by impacts, which is stopped."""
    scene = dap.Scene(name="dropped")
    motion = {"r_dot": [0.3, 0.2, 0.0], "w": [0.0, 1.0, 0.5]}
    scene.add_body("bar", mass=1.0, Jp=[0.002, 0.01, 0.01], r=[0.0, 0.0, 0.07], **motion)
    ends = {
        side: scene.add_point(side, "bar", [x, 0.0, 0.0])
        for side, x in (("P_i", 0.2), ("Q_i", -0.2))
    }
    scene.add_contact("capsule_plane", "floor", radius=0.05, mu=0.4, **ends)
    scene.add_force("weight", "gravity")
    return scene


@pytest.mark.every(3)
@pytest.mark.parametrize(("make", "more", "settings"), [
    (falling_ball, ["ball.rdd"], {}),
    (partial(falling_ball, mu_roll=0.01, mu_spin=0.01), ["ball.rdd"], {}),
    (declared_ball, ["ball.rdd"], {"contact": "stepping", "contact_step": 2e-3}),
    (RESISTING, ["ball.rdd"], {"contact": "events", "integrator": "dop853"}),
    (dropped_capsule, [], {"contact": "events", "integrator": "dop853"}),
    (lambda: dap.load("quadruped"), ["trunk.rdd", "front_left_hinge.i.force"], {}),
])  # fmt: skip
@pytest.mark.slow
def test_contacts_have_the_bits_of_simulate(tmp_path, make, more, settings):
    """Accelerations and loads of joints are means of the step here, too."""
    assert differences(make(), tmp_path, 0.3, 10, more, **settings)


@pytest.mark.slow
def test_friction_masses_and_places_are_parameters_of_stepped_contacts(tmp_path):
    """A mass and inertias, of which steps have inverses, a place and a speed at the start."""
    names = ["materials.surface.mu", "bodies.ball.mass", "bodies.ball.Jp.y", "bodies.ball.r.z",
             "bodies.ball.r_dot.x"]  # fmt: skip
    scene = falling_ball()
    made, library = exported(scene, tmp_path, outputs=["ball.r"], parameters=names)
    run = library.start(0.3)
    for name, value in zip(names, (0.1, 3.0, 0.009, 0.17, 2.5), strict=True):
        run[name] = value
    run.step_to(0.3)
    scene.materials["surface"].mu = 0.1
    ball = scene.bodies["ball"]
    ball.mass, ball.Jp = 3.0, (0.008, 0.009, 0.008)
    ball.r, ball.r_dot = (0.0, 0.0, 0.17), (2.5, 0.0, 0.0)
    expected = dap.simulate(scene, t_end=0.3, dt=0.3).r[-1, 0]
    assert np.array_equal(run.values(made.outputs), expected)
    ball.Jp = ((0.008, 1e-4, 0.0), (1e-4, 0.008, 0.0), (0.0, 0.0, 0.008))
    with pytest.raises(dap.SceneError, match=r"parameter bodies\.ball\.Jp\.1\.1 cannot be set"):
        exported(scene, tmp_path, parameters=["bodies.ball.Jp.1.1"])


@pytest.mark.slow
def test_a_mass_beside_joints_is_a_parameter_of_stepped_contacts(tmp_path):
    scene, name = dap.load("quadruped"), "bodies.trunk.mass"
    made, library = exported(scene, tmp_path, outputs=["trunk.r"], parameters=[name])
    run = library.start(0.1)
    run[name] = 11.0
    run.step_to(0.1)
    scene.bodies["trunk"].mass = 11.0
    expected = dap.simulate(scene, t_end=0.1, dt=0.1).r[-1, 0]
    assert np.array_equal(run.values(made.outputs), expected)


@pytest.mark.slow
def test_a_run_ends_where_contacts_have_no_room(tmp_path, monkeypatch):
    """The ball has one point, and there is room for none."""
    for module, name in ((placed_shapes, "ROOM"), (arrays, "MOST_POINTS")):
        monkeypatch.setattr(module, name, 0)
    _, library = exported(falling_ball(), tmp_path, outputs=["ball.r"])
    run = library.start(1.0)
    said = r"t = 0\.0[6-9]\d* s: more contacts came near"  # it falls by 0.05 m within 0.1 s
    for t in (1.0, 2.0):  # it stays an error
        with pytest.raises(dap.SimulationError, match=said):
            run.step_to(t)


@pytest.mark.slow
def test_a_folder_of_another_model(tmp_path):
    """Its libraries go; what a user has put there stays. A folder of others is left alone."""
    first, second = dap.load("fourbar2"), dap.load("pen1")
    made = dap.export_model(first, tmp_path / "out", format="c", outputs=["crank.r"])
    (made.path / "main.c").write_text("int main() {}")
    with pytest.raises(FileExistsError):
        dap.export_model(second, tmp_path / "out", format="c")
    dap.export_model(second, tmp_path / "out", format="c", outputs=["cone.r"], force=True)
    assert "cone.r.x" in dap.load_native(made.path).references
    assert (made.path / "main.c").exists()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "README.md").write_text("mine")
    with pytest.raises(dap.SceneError, match="files of others"):
        dap.export_model(second, tmp_path / "mine", format="c", force=True)
    assert (tmp_path / "mine" / "README.md").read_text() == "mine"


@pytest.mark.slow
def test_a_name_that_is_no_identifier(tmp_path):
    scene = _written(SPRING, tmp_path)
    scene.name = "4 größen"
    made = dap.export_model(scene, tmp_path / "out", format="c")
    (library,) = (made.path / own_platform()).glob("*.a")
    assert library.name == "lib_4_gr_en.a"


@pytest.mark.slow
@pytest.mark.parametrize("contact", ["events", "stepping"])
def test_a_run_where_friction_would_drive_says_so(tmp_path, contact):
    given = {"t_end": 1.0, "contact": contact, "registry": registry_of(Wheel)}
    made = dap.export_model(scene_on_wheel(Wheel, part_lost=-0.1), tmp_path / "c", **given)
    with pytest.raises(dap.SimulationError, match=r"friction .*is negative"):
        dap.load_native(made.path).start(1.0).step_to(1.0)


@pytest.mark.slow
@pytest.mark.every(2)
@pytest.mark.parametrize(("limits", "said"), [
    ({"MOST_CHANGES": 1, "RATTLING": 9.0, "MOST_JAMS": -1}, "rattle: slip jams again and again"),
    ({"MOST_CHANGES": 1, "WITHIN": 9.0, "MOST_JAMS": 99}, "change ever faster"),
    ({"MOST_STEPS": 5, "SLOW": 1.0}, "as slow slip does. Export with integrator radau"),
])  # fmt: skip
def test_a_run_whose_contacts_come_to_no_end_says_why(tmp_path, monkeypatch, limits, said):
    """With limits that the first steps, or the first change of a mode, exceed."""
    for name, value in limits.items():
        monkeypatch.setattr(contact_jumps, name, value)
    made = dap.export_model("cradle", tmp_path / "c", format="c", t_end=5.0)
    with pytest.raises(dap.SimulationError, match=said):
        dap.load_native(made.path).start(5.0).step_to(5.0)


def test_a_folder_that_the_disk_has_no_room_for_is_not_left(tmp_path, monkeypatch):
    made, out = tmp_path / "made", tmp_path / "out"
    (made / "linux").mkdir(parents=True)
    for name in ("a.h", "linux/lib.so"):
        (made / name).write_text("text")

    def full(source, target):
        Path(target).touch()
        raise OSError(28, "No space left on device", str(target))

    with monkeypatch.context() as patch:
        patch.setattr(shutil, "copy", full)
        with pytest.raises(OSError, match="No space left on device"):
            export._copy(made, out)
    assert not out.exists()
    export._copy(made, out)
    assert (out / "linux" / "lib.so").read_text() == "text"
