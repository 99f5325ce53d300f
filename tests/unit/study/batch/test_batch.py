"""The points of a study are the runs that ``simulate`` makes of the changed scenes, bit for bit."""

import numpy as np
import pytest
from support import mechanisms, problems, redundant, trees
from support.on_axles import driven, stone, wheel
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.model.model import ReferencePoses
from dap3d_core.study import Ensemble, PointStatus, Study, outputs_of, with_values
from dap3d_core.study.batch.parameter_map import ParameterMap, dependence_of

DONE, STOPPED, FAILED = PointStatus.DONE, PointStatus.STOPPED, PointStatus.FAILED


def ensemble(scene, names, outputs, **settings):
    """An ensemble of a scene with other settings."""
    if isinstance(scene, str):
        scene = dap.load(scene)
    for name, value in settings.items():
        setattr(scene.simulation, name, value)
    return Ensemble(Study(scene, tuple(names), outputs_of(outputs)))


def path_of(of):
    """How an ensemble runs its points: "copied", "rebuilt", or "alone"."""
    runner = of._runner()
    if runner is None:
        return "alone"
    return "rebuilt" if runner.parameter_map is None else "copied"


def singly(of, points):
    """The outputs of points by ``simulate``, of the scene with these numbers."""
    found = {output.name: [] for output in of.outputs}
    for point in points:
        result = dap.simulate(with_values(of.study.scene, of.parameters, point))
        for output in of.outputs:
            found[output.name].append(output.value(result))
    return {name: np.array(values) for name, values in found.items()}


@long_in_plain_python
@pytest.mark.parametrize(
    ("name", "method"), [("bodies.b3.mass", "joint"), ("points.out3.sPp.x", "standard")]
)
def test_auto_takes_joint_coordinates_where_points_share_a_tree(name, method, monkeypatch):
    """What moves joints has them placed anew, which would take longer than a point."""
    monkeypatch.setattr("dap3d_core.simulation.compiled_model.MANY_BODIES", 16)
    of = ensemble(problems.chain(16), [name], ["b9.r"], t_end=0.1, dt=0.1)
    assert (of.compiled.method, path_of(of)) == (method, "copied")
    batch = of.run([[0.5], [0.6]])
    for k, value in enumerate((0.5, 0.6)):
        single = of.result([value])
        assert single.method == method
        for output in of.outputs:
            found = batch.values[output.name][k]  # of a start that is corrected: to rounding
            assert found == pytest.approx(output.value(single), rel=1e-13)


def pendulum():
    """A bob below its pivot, swinging and spinning."""
    scene = dap.Scene(name="pendulum")
    motion = {"w": (1.0, 2.0, 3.0), "r_dot": (3.0, 0.0, -1.0)}
    scene.add_body("bob", mass=2.0, Jp=(0.1, 0.2, 0.15), r=(0.0, -1.0, 0.0), **motion)
    scene.add_point("A", "bob", (0.0, 1.0, 0.0))
    scene.add_joint("sph", "pivot", P_i="A", P_j="ground.O")
    scene.add_force("weight", "gravity", gravity=9.81, wgt=(0.0, -1.0, 0.0))
    scene.simulation.t_end, scene.simulation.dt = 0.5, 0.1
    return scene


def skew():
    """The bob off its pivot: how far it moves and how far it turns is a matter of its mass."""
    scene = pendulum()
    scene.bodies["bob"].r = (0.2, -1.1, 0.0)
    return scene


def falling_linkage():
    """A parallelogram with three rows too many, which gravity along x sets in motion."""
    scene = mechanisms.planar_four_bar()
    scene.add_force("weight", "gravity", gravity=9.81, wgt=(1.0, 0.0, 0.0))
    return scene


#: Scene, varied number, two values, output, settings, how the points are run.
CASES = {
    "mass": (pendulum, "bodies.bob.mass", (1.0, 3.0), "bob.r:series", {}, "copied"),
    "inertia": (pendulum, "bodies.bob.Jp.x", (0.1, 0.2), "bob.w:max", {}, "copied"),
    "component of a vector": (
        pendulum, "forces.gravity.wgt.x", (0.0, 0.5), "energy.total:mean", {}, "copied"),
    "reaction": (pendulum, "forces.gravity.gravity", (1.6, 9.81), "pivot.force:max", {}, "copied"),
    "spring": (stone, "forces.spring.k", (3.0, 5.0), "stone.r:min", {"t_end": 0.4}, "copied"),
    "tension": (
        stone, "forces.spring.k", (3.0, 5.0), "spring.tension:series", {"t_end": 0.4}, "copied"),
    "start in free flight": (
        stone, "bodies.stone.r.z", (2.0, 2.5), "stone.r.z", {"t_end": 0.4}, "copied"),
    "turns": (wheel, "forces.spring.k", (2.0, 2.5), "wheel.w.z:series", {"t_end": 1.5}, "copied"),
    "friction": (wheel, "forces.rubbing.mu", (0.1, 0.3), "wheel.w.z", {"t_end": 0.5}, "copied"),
    "breaks of a function": (
        driven, "bodies.crank.mass", (1.0, 2.0), "crank.w.z:series", {"t_end": 1.0}, "copied"),
    "function with breaks": (
        driven, "functions.turn.f_end", (1.0, 2.0), "crank.w.z:max", {"t_end": 1.0}, "rebuilt"),
    "mass, by which starts are corrected": (
        skew, "bodies.bob.mass", (1.0, 3.0), "bob.r.x", {"correct_metric": "mass"}, "rebuilt"),
    "redundant joints": (
        falling_linkage, "bodies.left.mass", (1.0, 2.0), "left.w.z:min", {"t_end": 0.1}, "copied"),
    "not corrected": (
        pendulum, "points.A.sPp.y", (1.0, 1.0 + 1e-9), "bob.r.x", {"correct": False}, "rebuilt"),
    "other steps": (
        pendulum, "bodies.bob.mass", (1.0, 2.0), "bob.r:series",
        {"integrator": "rk4", "step": 0.01}, "copied"),
    "implicit": (
        pendulum, "bodies.bob.mass", (1.0, 2.0), "bob.r.x", {"integrator": "radau"}, "alone"),
    "until it is stiff": (
        pendulum, "bodies.bob.mass", (1.0, 2.0), "bob.r.x", {"integrator": "auto"}, "copied"),
    "tolerance": (pendulum, "simulation.rtol", (1e-6, 1e-9), "bob.r.x", {}, "alone"),
}  # fmt: skip


@pytest.mark.every(4)
@long_in_plain_python
@pytest.mark.parametrize("case", CASES)
def test_points_are_single_runs_bit_for_bit(case):
    make, name, values, output, settings, expected = CASES[case]
    of = ensemble(make(), [name], [output], **{"dt": 0.05, **settings})
    points = np.array(values)[:, None]
    batch = of.run(points)
    assert path_of(of) == expected
    assert batch.status.tolist() == [DONE, DONE]
    for output_name, single in singly(of, points).items():
        assert np.array_equal(batch.values[output_name], single)
        assert np.all(np.isfinite(single))


@long_in_plain_python
@pytest.mark.parametrize("path", ["copied", "rebuilt"])
def test_points_whose_masses_differ_much_more_have_the_passes_of_single_runs(path):
    """A thin door on two hinges beside a thick one, whose rows need fewer passes."""
    scene = redundant.hinged_door()
    scene.bodies["door"].Jp = (4.0, 4.0, 4.0)
    metric = "mass" if path == "rebuilt" else "unit"
    of = ensemble(scene, ["bodies.door.Jp.y"], ["door.w", "H0.force"], method="lsq", t_end=0.1,
                  dt=0.05, correct_metric=metric)  # fmt: skip
    points = np.array([[4.0], [1e-7], [2.0]])
    assert path_of(of) == path
    batch = of.run(points)
    for name, single in singly(of, points).items():
        assert np.array_equal(batch.values[name], single)


def small_pendulum(size):
    """A bob on a ball joint, and a spring from it to a post."""
    scene = dap.Scene(name="small")
    motion = {"w": (1.0, 2.0, 3.0), "r_dot": (3.0 * size, 0.0, -size)}
    Jp = [k * size**2 for k in (0.1, 0.2, 0.14)]
    scene.add_body("bob", mass=2.0, Jp=Jp, r=(0.0, -size, 0.0), **motion)
    scene.add_point("A", "bob", (0.0, size, 0.0))
    scene.add_point("post", "ground", (size, size, 0.0))
    scene.add_joint("sph", "pivot", P_i="A", P_j="ground.O")
    scene.add_force("weight", "gravity", gravity=9.81 * size, wgt=(0.0, -1.0, 0.0))
    scene.add_force("ptp", "spring", P_i="bob.O", P_j="post", k=20.0, c=0.2, l0=size)
    scene.simulation.method = "standard"
    return scene


#: Size, varied number, values: some leave the size of the scene, its tolerances or its weights.
SIZES = {
    "arm": (0.05, "points.A.sPp.y", (0.05, 0.0005, 0.06)),
    "mass": (0.02, "bodies.bob.mass", (2.0, 1e-4, 2.1)),
    "time": (1e-3, "forces.gravity.gravity", (9.81e-3, 98.1, 9.9e-3)),
    "speed": (1e-3, "bodies.bob.w.z", (3.0, 3000.0, 3.1)),
}


@long_in_plain_python
@pytest.mark.parametrize("method", ["standard", "lsq"])
@pytest.mark.parametrize("case", SIZES)
def test_points_of_other_sizes_have_the_tolerances_of_single_runs(case, method):
    size, name, values = SIZES[case]
    of = ensemble(small_pendulum(size), [name], ["bob.r:series", "energy.total:series"],
                  method=method, t_end=0.1, dt=0.05)  # fmt: skip
    points = np.array([values[:2], values[1:]]).reshape(-1, 1)  # also behind one that is other
    batch = of.run(points)
    for output, single in singly(of, points).items():
        scale = np.max(np.abs(single))
        np.testing.assert_allclose(batch.values[output], single, atol=1e-13 * scale, rtol=0.0)


@long_in_plain_python
def test_points_in_joint_coordinates_slide_from_the_sizes_of_their_own_scenes():
    """The coordinate of a slider begins at the size of the parts, and its tolerance with it."""
    scene = dap.Scene(name="hanging from a slider")
    scene.add_body(
        "slider", mass=1.0, Jp=(0.05, 0.1, 0.1), r=(0.5, 0.0, 0.0), r_dot=(0.6, 0.0, 0.0)
    )
    scene.add_body("bob", mass=1.0, Jp=(0.05, 0.1, 0.1), r=(0.5, -0.3, 0.0), w=(0.0, 0.0, 2.0),
                   r_dot=(1.2, 0.0, 0.0))  # fmt: skip
    scene.add_point("rail", "ground", (2.0, 0.0, 0.0))
    scene.add_point("eye", "bob", (0.0, 0.3, 0.0))
    scene.add_joint("tran", "track", P_i="slider.O", P_j="rail", a_j="ground.x")
    scene.add_joint("rev", "pin", P_i="eye", P_j="slider.O", a_i="bob.z", a_j="slider.z")
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    scene.add_force("ptp", "spring", P_i="slider.O", P_j="rail", k=50.0, l0=1.0)
    of = ensemble(
        scene, ["bodies.bob.mass"], ["slider.r:series"], method="joint", t_end=0.3, dt=0.1
    )
    assert path_of(of) == "copied"
    points = np.array([[1.0], [0.01], [1.1]])
    batch = of.run(points)
    for output, single in singly(of, points).items():
        assert np.array_equal(batch.values[output], single)


@long_in_plain_python
def test_starts_are_corrected_within_the_size_of_their_points():
    """A pass moves bodies by a part of the size: where it ends depends on that."""
    of = ensemble(small_pendulum(0.05), ["points.A.sPp.z"], ["bob.r:series"], t_end=0.1, dt=0.05)
    assert path_of(of) == "copied"
    points = np.array([[0.0], [0.1], [-0.5]])
    batch = of.run(points)
    for output, single in singly(of, points).items():
        np.testing.assert_allclose(batch.values[output], single, atol=1e-12)


@long_in_plain_python
def test_a_start_far_away_whose_joints_move_otherwise_is_run_alone():
    """A hinge whose ends are 20 times its arms apart has no angle; energies need its model."""
    scene = dap.Scene(name="two rods")
    previous, axis = "ground.O", "ground.z"
    for k, name in enumerate(("a", "b")):
        scene.add_body(name, mass=1.0, Jp=(0.05, 0.1, 0.1), r=(0.5 + k, 0.0, 0.0))
        start, end = (scene.add_point(f"{name}{x}", name, (0.5 * x, 0.0, 0.0)) for x in (-1, 1))
        scene.add_joint("rev", f"hinge {name}", P_i=start, P_j=previous, a_i=f"{name}.z",
                        a_j=axis)  # fmt: skip
        previous, axis = end, f"{name}.z"
    of = ensemble(scene, ["bodies.a.r.y"], ["energy.total"], method="standard", t_end=0.02, dt=0.01)
    assert path_of(of) == "copied"
    points = np.array([[0.0], [20.0]])
    batch = of.run(points)
    assert batch.status.tolist() == [DONE, DONE]
    np.testing.assert_allclose(batch.values["energy.total"], singly(of, points)["energy.total"])


@long_in_plain_python
def test_a_point_does_not_depend_on_those_before_it():
    of = ensemble(wheel(), ["forces.spring.k", "forces.rubbing.mu"], ["wheel.w.z"], t_end=0.5)
    points = np.array([[2.0, 0.1], [3.0, 0.3], [2.5, 0.2]])
    all_at_once = of.run(points).values["wheel.w.z"]
    assert len(set(all_at_once.tolist())) == 3
    assert np.array_equal(of.run(points[::-1]).values["wheel.w.z"][::-1], all_at_once)
    one_by_one = [of.run(point).values["wheel.w.z"][0] for point in points]
    assert np.array_equal(one_by_one, all_at_once)


@long_in_plain_python
@pytest.mark.parametrize("name", ["points.A.sPp.y", "bodies.bob.r_dot.x", "bodies.bob.r.z"])
def test_starts_are_corrected_as_those_of_single_runs(name):
    """Compiled Newton passes on the block factors, against numpy's least squares: rounding.
    One radian of swing multiplies it by some ten; 1e-13 leaves another ten."""
    of = ensemble(pendulum(), [name], ["bob.r:series", "bob.w"], dt=0.1, t_end=0.5)
    points = np.array([[0.3], [0.9], [1.1]])
    batch = of.run(points)
    assert path_of(of) == "copied"
    assert batch.status.tolist() == [DONE] * 3
    for output, single in singly(of, points).items():
        np.testing.assert_allclose(batch.values[output], single, rtol=0.0, atol=1e-13 * 10.0)
    moved = [("initial positions corrected" in note) for note in batch.notes]
    assert moved == [name != "bodies.bob.r_dot.x"] * 3


@long_in_plain_python
def test_a_driver_without_position_level_is_left_out_of_the_correction_of_positions():
    of = ensemble("fourbar3", ["points.P2.sPp.z"], ["crank.r:series"])
    nominal = of.parameters[0].value
    points = np.array([[nominal], [1.01 * nominal + 0.01]])
    batch = of.run(points)
    assert path_of(of) == "copied"
    single = singly(of, points)
    for output in of.outputs:
        found = batch.values[output.name]
        np.testing.assert_allclose(found, single[output.name], rtol=0.0, atol=1e-11)


SERIES = ["bob.r:series", "bob.w"]


@long_in_plain_python
@pytest.mark.parametrize(
    ("make", "name", "outputs", "points", "settings", "error"),
    [
        # a drive counts from its function's value at the start, which moves no start here
        (lambda: "wiper", "functions.turning.coeff.x", ["rod_end.lambda:max"], [0.0, 0.06, -0.03],
         {"t_end": 0.05, "dt": 0.05}, dict(rtol=1e-9, atol=1e-9)),
        # rates of joints are those of body velocities, corrected in compiled code: rounding
        (pendulum, "bodies.bob.r_dot.x", SERIES, [0.3, 0.9, 1.1], {"method": "joint"},
         dict(rtol=0.0, atol=1e-13 * 10.0)),
    ],
    ids=["drive", "joint"],
)  # fmt: skip
def test_points_start_as_single_runs(make, name, outputs, points, settings, error):
    of, points = ensemble(make(), [name], outputs, **settings), np.array(points)[:, None]
    batch = of.run(points)
    assert path_of(of) == "copied"
    assert batch.status.tolist() == [DONE] * 3
    assert batch.notes == [""] * 3 or name.startswith("bodies")
    for output, single in singly(of, points).items():
        np.testing.assert_allclose(batch.values[output], single, **error)


def test_failing_points_are_noted_and_the_others_run():
    of = ensemble(pendulum(), ["bodies.bob.mass"], ["bob.r.y"], t_end=0.02, dt=0.01)
    batch = of.run([[1.0], [-1.0], [np.nan], [2.0]])
    assert batch.status.tolist() == [DONE, FAILED, FAILED, DONE]
    assert "bodies.bob.mass = -1.0: should be greater than 0" in batch.notes[1]
    assert batch.notes[0] == batch.notes[3] == ""
    assert np.isnan(batch.values["bob.r.y"]).tolist() == [False, True, True, False]


@long_in_plain_python
def test_points_that_stop_early_keep_what_was_computed():
    """A spring that pushes flings the stone beyond all bounds: exp(sqrt(k) t)."""
    of = ensemble(stone(), ["forces.spring.k"], ["stone.r.z:series"], t_end=2.0, dt=0.5)
    batch = of.run([[1.0], [-1e5]])
    assert batch.status.tolist() == [DONE, STOPPED]
    assert "beyond 1e+100" in batch.notes[1]
    series = batch.values["stone.r.z:series"]
    assert np.all(np.isfinite(series[0]))
    assert np.isfinite(series[1, 0])
    assert np.isnan(series[1, -1])


@pytest.mark.parametrize(
    ("z", "points", "path", "status"),
    [
        (1.0, [[1.0], [0.5]], "copied", [DONE, DONE]),
        (1.0, [[0.0]], "copied", [FAILED]),
        (0.0, [[0.0], [2.0]], "alone", [FAILED, DONE]),  # as given it lies on the end of its spring
    ],
)
def test_a_direction_that_a_point_leaves_undefined_is_refused(z, points, path, status):
    scene = stone()
    scene.bodies["stone"].r = (0.0, 0.0, z)
    of = ensemble(scene, ["bodies.stone.r.z"], ["stone.r.z"], t_end=0.01, dt=0.01)
    batch = of.run(points)
    assert path_of(of) == path
    assert batch.status.tolist() == status
    assert ("coincide at the start" in batch.notes[0]) is (status[0] == FAILED)


def test_numbers_that_are_copied_need_no_check_and_no_model(monkeypatch):
    of = ensemble(pendulum(), ["bodies.bob.mass"], ["bob.r.y"], t_end=0.02, dt=0.01)
    of.run([[1.0]])

    def refuse(*args):
        raise AssertionError("a model was made")

    monkeypatch.setattr("dap3d_core.study.batch.batch.ModelRebuilder.load", refuse)
    monkeypatch.setattr(Ensemble, "result", refuse)
    assert of.run([[1.5], [2.0]]).status.tolist() == [DONE, DONE]


def test_a_number_that_prepare_reads_is_not_copied():
    """The axis of a revolute joint makes its normals; its points do not."""
    compiled = dap.compile("fourbar3")
    poses = dict.fromkeys(range(4))
    joint = next(j for j in compiled.checked.joints if j.name == "J1")
    found = dependence_of(joint, ReferencePoses(compiled.checked), len(poses) - 1)
    assert found.fields == {"a_j"}
    assert found.constants == {"n_j", "m_j"}
    assert not found.poses


def test_poses_that_prepare_reads():
    """``fix`` keeps the relative pose that the bodies are given in."""
    compiled = dap.compile("fourbar4")
    joint = next(j for j in compiled.checked.joints if j.type_info.type.keyword == "fix")
    found = dependence_of(joint, ReferencePoses(compiled.checked), len(compiled.checked.body_names))
    assert {part for _, part in found.poses} == {"r", "p"}


def test_masses_beyond_what_a_scene_may_have_are_left_to_its_check():
    of = ensemble(pendulum(), ["bodies.bob.Jp.x", "bodies.bob.mass"], ["bob.r.y"])
    parameter_map = ParameterMap(of.compiled.checked, of.compiled.evaluator, of.parameters)
    values = np.array(
        [[0.1, 1.0], [0.1, 0.0], [0.5, 1.0], [-0.1, 1.0], [0.1, np.inf], [0.1, 1e-300]]
    )
    assert parameter_map.table(values)[1].tolist() == [True, False, False, False, False, False]


def test_runs_report_only_their_end_where_nothing_else_is_needed():
    of = ensemble(pendulum(), ["bodies.bob.mass"], ["bob.r.y"])
    assert of.times.tolist() == [0.0, 0.5]
    assert len(ensemble(pendulum(), ["bodies.bob.mass"], ["bob.r.y:max"]).times) == 6


def test_a_function_of_the_user_that_raises_fails_its_point():
    def of_small_masses(result):
        return 1.0 / (float(result.summary.mass[0]) - 2.0)

    of = ensemble(
        pendulum(), ["bodies.bob.mass"], [of_small_masses, "bob.r.x"], t_end=0.02, dt=0.01
    )
    batch = of.run([[1.0], [2.0], [3.0]])
    assert batch.status.tolist() == [DONE, FAILED, DONE]
    assert "output 'of_small_masses' raises ZeroDivisionError" in batch.notes[1]
    assert np.isnan(batch.values["bob.r.x"]).tolist() == [False, True, False]
    assert batch.values["of_small_masses"][[0, 2]].tolist() == [-1.0, 1.0]


def branched():
    """A tree of all standard joints with one degree of freedom or more, and a free body."""
    scene = trees.random_tree(7, seed=3, free=0.3)
    scene.simulation.t_end, scene.simulation.dt = 0.2, 0.05
    return scene


#: Scene, varied numbers, outputs, how the points are run; in joint coordinates.
TREES = {
    "masses": (branched, ("bodies.b1.mass", "bodies.b4.mass"), ("b1.w:series", "b4.w"), "copied"),
    "inertia": (pendulum, ("bodies.bob.Jp.x",), ("bob.w:series", "energy.total:mean"), "copied"),
    "turns, friction": (
        wheel, ("forces.spring.k", "forces.rubbing.mu"), ("wheel.w.z:series",), "copied"),
    "reaction": (pendulum, ("forces.gravity.gravity",), ("pivot.force:max",), "copied"),
    "constants of a joint": (
        pendulum, ("bodies.bob.mass", "points.A.sPp.y"), ("bob.r.z", "pivot.lambda"), "rebuilt"),
    "pose": (pendulum, ("bodies.bob.r.z",), ("bob.r:series",), "rebuilt"),
    "given to a function": (
        pendulum, ("bodies.bob.mass",), (lambda result: float(result.r[-1, 0, 0]),), "copied"),
}  # fmt: skip


@pytest.mark.every(4)
@long_in_plain_python
@pytest.mark.parametrize("case", TREES)
def test_points_in_joint_coordinates_are_single_runs_bit_for_bit(case):
    make, names, outputs, expected = TREES[case]
    named = {getattr(of, "__name__", of).replace("<lambda>", "of"): of for of in outputs}
    of = ensemble(make(), names, named, method="joint", t_end=0.3, dt=0.1)
    given = np.array([parameter.value or 1.0 for parameter in of.parameters])
    points = np.array([1.0, 1.2, 0.9])[:, None] * given
    batch, alone = of.run(points), singly(of, points)
    assert path_of(of) == expected
    assert batch.status.tolist() == [DONE] * 3
    for name, values in alone.items():
        assert np.array_equal(batch.values[name], values)
    assert any(np.ptp(values, axis=0).max() > 0.0 for values in alone.values())
    again = of.run(points[::-1])  # whichever points were run before
    for name, values in alone.items():
        assert np.array_equal(again.values[name][::-1], values)


def test_points_whose_bodies_start_elsewhere_are_left_open():
    """A correction that leads to other poses than those of the scene, to which the tree refers."""
    of = ensemble(pendulum(), ["bodies.bob.w.y"], ["bob.r"], method="joint", t_end=0.1)
    points = np.array([[0.3], [0.3]])
    of.run(points)
    runner = of._runner()
    start, _ = runner._mapped_starts(runner.parameter_map, points)
    start.y0[1, :3] += (0.1, 0.0, 0.0)
    rows = runner._runs.run(start)
    assert rows.done.tolist() == [True, False]
