"""Points in the lanes of a vector are the runs that ``simulate`` makes, bit for bit."""

import numpy as np
import pytest
from support import mechanisms, trees
from support.internals import JP, METRIC_CONSTANTS, change_over
from support.on_axles import driven, stone, wheel
from support.plain import jit_is_on
from support.state_types import stated
from support.studies import pendulum
from unit.study.batch.test_batch import DONE, ensemble, path_of, singly
from unit.study.batch.test_batch import pendulum as ball_pendulum

import dap3d_core as dap
from dap3d_core.study import Ensemble
from dap3d_core.study.batch import lanes as study_lanes
from dap3d_core.study.batch.compiled_batch import Starts

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="plain Python has no vectors")

#: Points of each call that was run in lanes.
RUN: list[int] = []


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    """Lanes for any number of points, also before their code is optimised, which has its bits."""
    run = study_lanes.LaneBatch.run

    def counted(lanes, points, budget):
        RUN.append(len(points.table))
        run(lanes, points, budget)

    RUN.clear()
    monkeypatch.setattr(change_over, "BESIDE", False)
    for name in ("LOAD_AFTER", "MAKE_AFTER"):
        monkeypatch.setattr(change_over, name, 0.0)
    monkeypatch.setattr(
        "dap3d_core.formulations.programs.scene_program.is_optimised", lambda evaluator: True
    )
    monkeypatch.setattr("dap3d_core.study.batch.compiled_batch.BEFORE_LANES", 1)
    monkeypatch.setattr(study_lanes, "LEAST_COMPONENTS", 1)
    monkeypatch.setattr(study_lanes.LaneBatch, "is_ready", True)
    monkeypatch.setattr(study_lanes.LaneBatch, "run", counted)


def branched():
    """A tree of all standard joints with one degree of freedom or more, and a free body.
    A spring, and a force and a spring's length that follow functions of time."""
    scene = trees.random_tree(5, seed=3, free=0.3)
    scene.add_function("harmonic", "waves", amplitude=0.2, frequency=3.0, phase=0.5, offset=1.0)
    scene.add_force("ptp", "spring", P_i="b4.O", P_j="ground.O", k=20.0, c=0.5, l0=1.0)
    scene.add_force("ptp", "pushed", P_i="b2.O", P_j="ground.O", k=5.0, c=0.1, function="waves")
    return scene


def lanes_of(of):
    return of._runner().compiled_batch.lanes


def check(make, points):
    """Compare points in lanes with points one by one, which are single runs (test_batch.py)."""
    of, other = make(), make()
    other._runner().compiled_batch.takes_lanes = False
    batch, alone = of.run(points), other.run(points)
    assert sum(RUN) == len(points)
    assert batch.status.tolist() == [DONE] * len(points)
    for name, values in alone.values.items():
        assert np.array_equal(batch.values[name], values)
    # else it would not matter whose numbers a point was given
    assert any(np.ptp(v, axis=0).max() > 1e-3 * np.max(np.abs(v)) for v in alone.values.values())
    return of, batch


@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("integrator", "step"), [("dop853", None), ("dopri5", None), ("rk4", 0.01), ("auto", None)]
)
def test_points_have_the_bits_of_single_runs(integrator, step):
    """Two more points than lanes; a mass, a stiffness, a damper; what is reported of all kinds."""
    names = ("bodies.b1.mass", "forces.spring.k", "forces.pushed.c")
    outputs = ("b4.r:series", "b4.w:max", "b3.rdd", "J0.lambda:series")
    of = ensemble(branched(), names, outputs, method="joint", t_end=0.1, dt=0.02, step=step,
                  integrator=integrator)  # fmt: skip
    given = np.array([parameter.value for parameter in of.parameters])
    points = np.random.default_rng(1).uniform(0.8, 1.2, size=(10, 3)) * given
    of, batch = check(lambda: Ensemble(of.requested), points)
    again = of.run(points[::-1])  # whichever points run beside them
    for name, values in batch.values.items():
        assert np.array_equal(again.values[name][::-1], values)
    for name, values in singly(of, points[:1]).items():
        assert np.array_equal(batch.values[name][:1], values)


def test_a_lane_takes_the_next_point_when_its_run_has_ended():
    """Runs of 10 to some 200 steps, which end at any time."""
    points = np.geomspace(1.0, 1e5, 25)[:, None]
    of, _ = check(lambda: swinging("forces.spring.k"), points)
    assert len(points) > 2 * lanes_of(of).count


@pytest.mark.slow
def test_projections_take_the_ways_of_a_run():
    """How many passes they need at the start of the first run says little of its course."""
    settings = {"t_end": 0.5, "dt": 0.5}
    of, _ = check(
        lambda: ensemble(dap.load("tri"), ("bodies.frame.mass",), ("frame.r:series",), **settings),
        np.linspace(18.0, 22.0, 8)[:, None],
    )
    assert np.all(lanes_of(of)._lanes.bound < 1.0)


def swinging(name, **settings):
    return ensemble(pendulum(), (name,), ("bob.r:series",),
                    **{"method": "joint", "t_end": 0.5, "dt": 0.25} | settings)  # fmt: skip


def test_velocities_differ_from_lane_to_lane():
    """Their starts are corrected."""
    check(lambda: swinging("bodies.bob.w.y"), np.linspace(0.0, 2.0, 9)[:, None])


def test_points_that_have_a_model_each():
    """The joint is elsewhere in the body: its motion is found anew."""
    of, _ = check(lambda: swinging("points.end.sPp.x"), np.linspace(-0.6, -0.4, 9)[:, None])
    assert path_of(of) == "rebuilt"


@pytest.mark.slow
def test_rates_whose_angles_leave_the_range_of_lanes_are_evaluated_alone(monkeypatch):
    """Beyond 2e5 rad half angles are reduced in another way: steps of 0.1 s at 1e7 rad/s."""
    scene = pendulum()
    del scene.forces["spring"]
    scene.bodies["bob"].w = (0.0, 1e7, 0.0)
    scene.bodies["bob"].r_dot = (0.0, 0.0, -5e6)
    settings = {"method": "joint", "t_end": 0.3, "dt": 0.1, "integrator": "rk4", "step": 0.1}
    of = ensemble(scene, ("forces.gravity.gravity",), ("bob.r:series",), **settings)
    points = np.linspace(1.0, 1e6, 5)[:, None]
    check(lambda: Ensemble(of.requested), points)
    RUN.clear()
    monkeypatch.setattr(study_lanes, "MOST_BODIES_OF_PROGRAM", 0)  # as larger trees are run
    check(lambda: Ensemble(of.requested), points)


def turning():
    """The wheel without what rubs."""
    scene = wheel()
    del scene.forces["rubbing"]
    return scene


def four_bar():
    return dap.load("fourbar3")


def tricycle():
    return dap.load("tri")


#: Scene, varied numbers with their ranges, outputs.
CASES = {
    "masses": (
        ball_pendulum,
        {"bodies.bob.mass": (1.0, 3.0), "bodies.bob.Jp.x": (0.1, 0.3)},
        "bob.w",
    ),
    "gravity, each its own": (ball_pendulum, {"forces.gravity.gravity": (1.0, 20.0)}, "bob.r:max"),
    "starts that are corrected": (ball_pendulum, {"points.A.sPp.y": (0.9, 1.1)}, "bob.r:series"),
    "springs in free flight": (stone, {"forces.spring.k": (1.0, 9.0)}, "stone.r"),
    "multipliers": (ball_pendulum, {"forces.gravity.gravity": (1.0, 20.0)}, "pivot.lambda"),
    "turns": (turning, {"forces.spring.k": (1.0, 3.0)}, "wheel.w.z:series"),
    "states of elements": (
        stated,
        {"forces.spring.z_0": (0.0, 0.3), "forces.loop.beta": (1.0, 3.0)},
        "loop.z:series",
    ),
    "functions and their breaks": (driven, {"bodies.crank.Jp.z": (0.5, 1.5)}, "motor.lambda:max"),
    "a closed chain": (four_bar, {"bodies.coupler.mass": (0.5, 1.0)}, "J1.lambda:max"),
    "switches that no stage may cross": (tricycle, {"bodies.frame.mass": (9.0, 20.0)}, "frame.r"),
}


@pytest.mark.slow
@pytest.mark.every(7)
@pytest.mark.parametrize("case", CASES)
def test_points_of_all_kinds_have_the_bits_of_points_alone(case):
    make, vary, output = CASES[case]
    of = ensemble(make(), vary, [output], t_end=1.0, dt=0.1)
    fractions = np.random.default_rng(1).random((11, len(vary)))
    low, high = np.array(list(vary.values())).T
    check(lambda: Ensemble(of.requested), low + fractions * (high - low))


def with_table(scene):
    scene.add_function("spline", "path", x=[0.0, 1.0, 2.0], y=[0.0, 1.0, 0.0], periodic=True)
    scene.forces["spring"].fields["function"] = "path"


def with_bend(scene):
    scene.add_function("b", "rise", x_start=0.1, x_end=0.15, f_start=0.0, f_end=1.0)
    scene.forces["spring"].fields["function"] = "rise"


def with_turns(scene):
    axes = {"v_i": "bob.x", "v_j": "ground.x", "axis": "ground.y"}
    scene.add_force("rot_sda", "coil", k=1.0, turns=True, **axes)


def with_friction(scene):
    scene.add_force("friction", "rubbing", joint="hinge", mu=0.1, radius=0.05, v_tol=0.1)


@pytest.mark.every(3)
@pytest.mark.parametrize("change", [with_table, with_bend, with_turns])
def test_trees_with_more_have_the_bits_of_points_alone(change):
    """What decides by a number is a guard; where it fails, rates are evaluated alone."""
    scene = pendulum()
    change(scene)
    settings = {"method": "joint", "t_end": 0.4, "dt": 0.1}
    of = ensemble(scene, ("bodies.bob.mass",), ("bob.r:series",), **settings)
    check(lambda: Ensemble(of.requested), np.linspace(0.5, 2.0, 11)[:, None])


@pytest.mark.parametrize(
    ("change", "reason"), [(with_friction, "forces depend on multipliers"), (None, "less than")]
)
def test_what_lanes_do_not_take_runs_point_by_point(change, reason, monkeypatch):
    scene = pendulum()
    if change:
        change(scene)
    else:
        monkeypatch.setattr(study_lanes, "LEAST_COMPONENTS", 6)
    settings = {"method": "joint", "t_end": 0.2, "dt": 0.1}
    of = ensemble(scene, ("bodies.bob.mass",), ("bob.r:series",), **settings)
    assert of.notes == ("points are run one by one: they are few",)
    assert of.run([[1.0], [2.0], [3.0], [4.0]]).status.tolist() == [DONE] * 4
    [note] = of.notes
    assert note.startswith("points are run one by one: ")
    assert reason in note


def test_notes_say_how_points_are_run():
    of = swinging("bodies.bob.mass", method="standard")
    of.run(np.linspace(1.0, 2.0, 5)[:, None])
    assert of.notes == (f"points are run in {lanes_of(of).count} lanes of a vector",)


@pytest.mark.slow
def test_turns_are_counted_in_steps_near_singular_poses():
    """A crank turns by 1.6 rad a step through poses in line, to which each run steps by itself.
    Of two such steps whose turns were not counted, the second one would be cut."""
    scene, speed = mechanisms.planar_four_bar(), -40.0
    for name, joint in (("J2", scene.joints.pop("J2")), ("J4", scene.joints.pop("J4"))):
        scene.add_joint("sph", name, P_i=joint.fields["P_i"], P_j=joint.fields["P_j"])
    for name, arm in (("left", 0.5), ("top", 1.0), ("right", 0.5)):
        scene.bodies[name].r_dot = (-arm * speed, 0.0, 0.0)
        scene.bodies[name].w = (0.0, 0.0, 0.0 if name == "top" else speed)
        scene.bodies[name].Jp = (0.1, 0.1, 0.1)
    axes = {"v_i": "left.x", "v_j": "ground.x", "axis": "ground.z"}
    scene.add_force("rot_sda", "coil", k=1.0, turns=True, **axes)
    settings = {"t_end": 0.2, "dt": 0.2, "integrator": "rk4", "step": 0.04}
    of = ensemble(scene, ["forces.coil.k"], ["left.w.z:series"], method="standard", **settings)
    check(lambda: Ensemble(of.requested), np.linspace(0.2, 1.0, 9)[:, None])


@pytest.mark.slow
def test_a_start_that_fails_beside_one_that_does_not_leaves_it_its_numbers():
    """The first lane alone has a run; the frame of the others is too long for their rods."""
    scene = four_bar()
    scene.simulation.t_end, scene.simulation.dt = 0.5, 0.1
    make = ensemble(scene, ["points.P7.sPp.y"], ["follower.r:series"]).requested
    points = [[4.05], [40.0], [41.0], [42.0]]
    of, other = Ensemble(make), Ensemble(make)
    other._runner().compiled_batch.takes_lanes = False
    batch, alone = of.run(points), other.run(points)
    assert sum(RUN) == len(points)
    assert (batch.status == DONE).tolist() == [True, False, False, False]
    for name, values in alone.values.items():
        assert np.array_equal(batch.values[name][0], values[0])


def test_lanes_made_between_points_leave_the_numbers_of_the_scene():
    """A start that is corrected is not that of the model, to which a tree would refer."""
    of = swinging("bodies.bob.mass")
    runner = of._runner()
    evaluator = runner.compiled_batch.evaluator
    u = of.compiled.model.u0.copy()
    u[2] += 0.1
    y0 = evaluator.coordinates.start(u)
    before = evaluator.system.tree.constants.copy()
    point = Starts(np.zeros((1, 0)), np.zeros(0, dtype=np.int64), y0[None])
    assert isinstance(runner.compiled_batch._lanes_for(point), study_lanes.LaneBatch)
    assert np.array_equal(evaluator.system.tree.constants, before)


def test_numbers_that_another_point_left_are_no_constants():
    """Inertias are, of a body whose mass differs alone: those of the points that are run."""
    points = np.linspace(1.0, 2.0, 9)[:, None]
    of, other = (swinging("bodies.bob.mass", method="standard") for _ in range(2))
    batch = of._runner().compiled_batch
    batch.evaluator.system.body[1, JP : JP + 9] *= 3.0
    batch.evaluator.system.metric[1, :METRIC_CONSTANTS] *= 3.0
    found, expected = of.run(points), other.run(points)
    assert sum(RUN) == 2 * len(points)
    assert len(batch._varied) < METRIC_CONSTANTS
    for name, values in expected.values.items():
        assert np.array_equal(found.values[name], values)
