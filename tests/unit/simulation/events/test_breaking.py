"""Joints that break or are let go, against closed forms.

At rtol 1e-12 a run of a second leaves less than 1e-12 of its coordinates; a bound of 1e-9 leaves
room for the slowest integrator.
"""

import numpy as np
import pytest
from scipy.special import ellipk, ellipkinc
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.result import open_result
from dap3d_core.simulation.events.breaking import Activity

TIGHT = {"rtol": 1e-12, "atol": 1e-13}
m, L, g, J = 2.0, 0.7, 9.81, 0.2
#: The rod breaks at this angle from the vertical; the square of its rate there.
ANGLE = np.deg2rad(50.0)
OMEGA_2 = m * g * L / (J + m * L**2)
RATE = np.sqrt(2.0 * OMEGA_2 * np.cos(ANGLE))
#: N: m g cos + m L w^2 along the rod, and across it what the inertia of the bob keeps from falling.
LIMIT = np.hypot(m * g * np.cos(ANGLE) + m * L * RATE**2, m * (g - L * OMEGA_2) * np.sin(ANGLE))
#: s, from the horizontal, where it starts at rest.
BREAK = (ellipk(0.5) - ellipkinc(np.arcsin(np.sin(ANGLE / 2.0) * np.sqrt(2.0)), 0.5)) / np.sqrt(
    OMEGA_2
)


def pendulum(breaks_at, **fields):
    scene = dap.Scene(name="pendulum")
    scene.add_body("bob", mass=m, Jp=(0.1, J, 0.25), r=(L, 0.0, 0.0))
    scene.add_point("hook", "bob", (-L, 0.0, 0.0))
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_joint("rev", "rod", P_i="hook", P_j="ground.O", a_i="bob.y", a_j="ground.y",
                    breaks_at=breaks_at, **fields)  # fmt: skip
    return scene


def parabola(t):
    """(k, 2) x and z of the bob t seconds after the rod has broken."""
    place, way = np.array([np.sin(ANGLE), -np.cos(ANGLE)]), np.array([np.cos(ANGLE), np.sin(ANGLE)])
    t = np.asarray(t)[:, None]
    return L * place - L * RATE * t * way - 0.5 * g * t**2 * np.array([0.0, 1.0])


@pytest.fixture(scope="module")
def compiled():
    return dap.compile(pendulum(LIMIT))


@pytest.mark.every(3)
@pytest.mark.parametrize("integrator", ["dop853", "adams", "radau"])
def test_a_pendulum_whose_rod_breaks_flies_on(compiled, integrator):
    result = dap.simulate(compiled, t_end=0.6, dt=0.1, integrator=integrator, **TIGHT)
    (event,) = result.events
    assert (event.kind, event.name) == ("break", "rod")
    assert event.t == pytest.approx(BREAK, abs=1e-12)
    after = result.t > event.t
    flown = parabola(result.t[after] - BREAK)
    assert np.abs(result.r[after, 0][:, [0, 2]] - flown).max() < 1e-9
    assert np.abs(result.w[after, 0] - [0.0, RATE, 0.0]).max() < 1e-9
    force = np.linalg.norm(result.reaction("rod")["i"].force, axis=1)
    assert not force[after].any()
    assert 0.0 < force[~after][1] < LIMIT
    assert all(entry.ok for entry in result.ledger.values())
    assert result.ledger["energy"].value < 1e-11


@pytest.mark.slow
def test_the_model_holds_again_afterwards(compiled, tmp_path):
    first = dap.simulate(compiled, t_end=0.6, dt=0.1, estimate_error=True)
    assert np.array_equal(dap.simulate(compiled, t_end=0.6, dt=0.1).u, first.u)
    first.save(tmp_path / "first.nc")
    stored = open_result(tmp_path / "first.nc")
    assert stored.events[0].words.endswith("joint rod ends")
    assert dap.rerun(stored).equal


def test_a_script_lets_go():
    def let_go(state):
        state.release("rod")

    event = dap.Event("t", above=BREAK, action=let_go)
    result = dap.simulate(pendulum(np.inf), t_end=1.0, dt=0.5, events=[event], **TIGHT)
    assert [event.kind for event in result.events] == ["change", "break"]
    assert np.abs(result.r[-1, 0, [0, 2]] - parabola([1.0 - BREAK])[0]).max() < 1e-9


def clutch(events, **settings):
    """Two wheels on an axis turn at 3 rad/s; a torque brakes the first one, of 0.5 kg m^2."""
    scene = dap.Scene(name="clutch")
    for name, J_z, z in (("first", 0.5, 0.0), ("second", 1.5, 1.0)):
        scene.add_body(name, mass=1.0, Jp=(1.0, 1.0, J_z), r=(0.0, 0.0, z), w=(0.0, 0.0, 3.0))
        scene.add_joint("rev", f"axle_{name}", P_i=f"{name}.O", P_j=f"{name}_seat",
                        a_i=f"{name}.z", a_j="ground.z")  # fmt: skip
        scene.add_point(f"{name}_seat", "ground", (0.0, 0.0, z))
    scene.add_force("n", "brake", body_i="first", n=(0.0, 0.0, -1.0))
    scene.add_joint("weld", "clutch", body_i="first", body_j="second", breaks_at=np.inf)
    return dap.simulate(scene, events=events, t_end=4.0, dt=0.5, **settings, **TIGHT)


@long_in_plain_python
@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_a_clutch_that_is_engaged_again_takes_energy(integrator):
    """From the start on the first wheel is braked alone, until it is a turn behind."""
    turn = np.sqrt(2.0 * 2.0 * np.pi * 0.5)
    events = [
        dap.Event("t", above=1e-300, action=lambda state: state.release("clutch")),
        dap.Event("t", above=turn, action=lambda state: state.engage("clutch")),
    ]
    result = clutch(events, integrator=integrator)
    lag = turn / 0.5
    common = 3.0 - 0.5 * lag / 2.0
    assert result.events[-1].work == pytest.approx(-0.5 * 0.5 * 1.5 / 2.0 * lag**2, abs=1e-9)
    assert [event.kind for event in result.events] == ["change", "break", "change", "engage"]
    assert result.events[-1].words.endswith(": joint clutch holds: work -4.71239 J")
    ends = np.full(2, common - (4.0 - turn) / 2.0)
    assert result.w[-1, :, 2] == pytest.approx(ends, abs=1e-9)
    assert result.ledger["energy"].ok
    held = result.reaction("clutch")["i"].moment[-1]
    assert held == pytest.approx([0.0, 0.0, 0.75], abs=1e-9)  # of the brake, for the second wheel


def test_a_joint_is_not_engaged_where_it_is_open():
    events = [
        dap.Event("t", above=0.1, action=lambda state: state.release("clutch")),
        dap.Event("t", above=0.5, action=lambda state: state.engage("clutch")),
    ]
    with pytest.raises(dap.SimulationError, match=r"joint clutch is engaged where it is open by"):
        clutch(events)


def test_a_joint_that_carries_too_much_from_the_start_breaks_at_once():
    result = dap.simulate(pendulum(0.1 * m * g), t_end=0.5, dt=0.5)
    assert [event.t for event in result.events] == [0.0]
    assert result.r[-1, 0] == pytest.approx([L, 0.0, -0.125 * g], abs=1e-12)


@long_in_plain_python
def test_the_link_of_a_chain_that_carries_most_breaks():
    """Of two links under a load that grows, the lower one; the upper one then carries its body."""
    scene = dap.Scene(name="chain")
    scene.add_function("a", "pull", coeff=(0.0, 10.0, 0.0))
    for name, mass, z in (("upper", 1.0, -1.0), ("lower", 2.0, -2.0)):
        scene.add_body(name, mass=mass, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, z))
        scene.add_point(f"{name}_eye", name, (0.0, 0.0, 1.0))
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_force("f", "load", body_i="lower", f=(0.0, 0.0, -1.0), function="pull")
    scene.add_joint("sph", "hook", P_i="upper_eye", P_j="ground.O", breaks_at=40.0)
    scene.add_joint("sph", "link", P_i="lower_eye", P_j="upper.O", breaks_at=25.0)
    result = dap.simulate(scene, t_end=1.0, dt=0.1, **TIGHT)
    (event,) = result.events
    assert event.name == "link"
    assert event.t == pytest.approx((25.0 - 2.0 * g) / 10.0, abs=1e-12)
    held = np.linalg.norm(result.reaction("hook")["i"].force, axis=1)
    assert held[result.t > event.t] == pytest.approx(1.0 * g, abs=1e-9)
    fallen = 1.0 - event.t
    down = 0.5 * (g + 5.0 * event.t) * fallen**2 + 5.0 * fallen**3 / 6.0
    assert result.r[-1, 1, 2] == pytest.approx(-2.0 - down, abs=1e-9)


@long_in_plain_python
def test_joints_that_share_their_load_break_one_after_the_other():
    """Each carries 14.715 N at first; a note says that this is a choice."""
    scene = dap.Scene(name="beam")
    scene.add_body("beam", mass=3.0, Jp=(0.1, 0.4, 0.4))
    scene.add_force("weight", "gravity", gravity=g)
    for name, x, limit in (("left", -1.0, 14.8), ("right", 1.0, 14.0)):
        scene.add_point(f"{name}_eye", "beam", (x, 0.0, 0.0))
        scene.add_point(f"{name}_hook", "ground", (x, 0.0, 0.0))
        scene.add_joint("sph", name, P_i=f"{name}_eye", P_j=f"{name}_hook", breaks_at=limit)
    result = dap.simulate(scene, t_end=1.0, dt=0.5)
    assert [event.name for event in result.events] == ["right", "left"]
    assert result.events[0].t == 0.0 < result.events[1].t
    assert any("left, right: their forces are not unique" in note for note in result.notes)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"breaks_at": -1.0}, "should be a positive force in N"),
        ({"breaks_at": True}, "should be a positive force in N"),
        ({"breaks_at": 5.0, "lower": -1.0}, "cannot be beside lower"),
    ],
)
def test_values_that_are_none(fields, words):
    with pytest.raises(dap.SceneError, match=words):
        dap.compile(pendulum(**fields))


def test_friction_of_a_joint_that_may_break_is_refused():
    scene = pendulum(5.0)
    scene.add_force("friction", "rub", joint="rod", mu=0.1, v_tol=1e-3)
    with pytest.raises(dap.SceneError, match="the force rub acts on its reaction"):
        dap.compile(scene)


@pytest.mark.parametrize(
    ("use", "words"),
    [
        (dap.linearize, "linearisation does not take joints that may break"),
        (dap.equilibrium, "equilibrium does not take joints that may break"),
        (lambda c: dap.sensitivities(c, "bodies.bob.mass", t_end=1.0), "with derivatives does not"),
        (lambda c: dap.simulate(c, t_end=1.0, method="standard"), "use lsq or auto"),
    ],
)
def test_what_does_not_know_that_joints_break_says_so(compiled, use, words):
    with pytest.raises(dap.SimulationError, match=words):
        use(compiled)


@pytest.mark.slow
@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("scene", "settings", "stops"),
    [
        (pendulum(LIMIT), {}, (0.3, 0.5)),
        (pendulum(LIMIT), {"integrator": "moreau", "step": 5e-3}, (0.5,)),
        (pendulum(None, active="t < 0.3"), {}, (0.2, 0.4)),
    ],
)
def test_a_checkpoint_has_the_joints_that_have_ended(scene, settings, stops, tmp_path):
    """Stopped before and after one ends, a run goes on with the bits of one that was not."""
    given = {"t_end": 0.6, "dt": 0.05, **settings}
    whole = dap.simulate(scene, **given)
    assert whole.events

    def stop(progress):
        if progress.t >= until:
            raise KeyboardInterrupt

    for until in stops:
        out = tmp_path / f"{until}.nc"
        with pytest.raises(KeyboardInterrupt) as stopped:
            dap.simulate(scene, output=out, checkpoint=1e-9, watch=stop, **given)
        result = dap.resume(stopped.value.checkpoint)
        assert (result.u == whole.u).all()
        assert [(e.kind, e.t) for e in result.events] == [(e.kind, e.t) for e in whole.events]


@pytest.mark.slow
@pytest.mark.every(2)
@pytest.mark.parametrize("settings", [{}, {"integrator": "moreau", "step": 5e-3}])
def test_joints_end_in_a_run_step_by_step(compiled, settings):
    """As in a run as a whole, again after a reset, and reported with their forces before."""
    given = settings or TIGHT
    whole = dap.simulate(compiled, t_end=0.6, dt=0.1, **given)
    run = dap.start(compiled, **given)
    for _ in range(2):
        run.reset()
        while run.t < 0.55:
            run.step(0.1)
        result = run.result()
        assert result.u == pytest.approx(whole.u, abs=1e-9 if not settings else 1e-4)
        held = np.linalg.norm(result.reaction("rod")["i"].force, axis=1) > 0.0
        assert list(held) == list(result.t < BREAK)
        assert [event.name for event in result.events] == ["rod"]


@long_in_plain_python
def test_only_joints_that_may_break_are_released(compiled):
    event = dap.Event("t", above=0.1, action=lambda state: state.release("hinge"))
    with pytest.raises(ValueError, match="'hinge' is no joint that may be released: there are rod"):
        dap.simulate(compiled, t_end=0.2, events=[event])


@pytest.mark.parametrize("by", ["controller", "event"])
def test_what_depends_on_inputs_alone_is_not_searched_for_within_steps(by, monkeypatch):
    """An input changes between steps; a hundred evaluations in each step of 1 ms took minutes."""
    calls = []
    evaluate = Activity.__call__
    monkeypatch.setattr(Activity, "__call__", lambda *given: calls.append(1) or evaluate(*given))
    scene = dap.Scene(name="gearbox")
    for name, inertia, rate in (("engine", 0.5, 8.0), ("load", 1.5, -2.0)):
        scene.add_body(name, mass=1.0, Jp=(1.0, 1.0, inertia), w=(0.0, 0.0, rate))
        axle = {"P_i": f"{name}.O", "P_j": "ground.O", "a_i": f"{name}.z", "a_j": "ground.z"}
        scene.add_joint("rev", f"axle_{name}", **axle)
    scene.add_input("pedal")
    pair = {"body_i": "engine", "body_j": "load", "a_j": "load.z"}
    scene.add_joint("rel-rot", "clutch", active="pedal > 0.5", **pair)
    if by == "event":
        action = dap.Event("t", above=0.4, action=lambda state: state.set("pedal", value=1.0))
        given = {"events": [action]}
    else:
        pedal = dap.Controller(every=0.01, update=lambda t, state: {"pedal": float(t > 0.395)})
        given = {"controllers": [pedal]}
    result = dap.simulate(scene, t_end=1.0, dt=0.5, **given)
    engaged = [event for event in result.events if event.kind == "engage"]
    assert [event.t for event in engaged] == pytest.approx([0.4], abs=1e-14)
    assert result.w[-1, :, 2] == pytest.approx([0.5, 0.5], abs=1e-12)
    assert len(calls) < 3 * result.stats.steps + 10
