"""Rows kept on trees: against methods standard and lsq, and against a dense solution of its own."""

from itertools import pairwise

import numpy as np
import pytest
from support import loops, problems, redundant, singular, trees
from support.internals import matrices, split
from support.plain import long_in_plain_python
from unit.formulations.joint.test_equations import ACCELERATIONS, MULTIPLIERS, closed

import dap3d_core as dap
from dap3d_core.simulation import CompiledModel

#: Singular values of the scaled Jacobian below this part of the largest belong to dependent rows:
#: those of these scenes are below 1e-12 or above 1e-4.
DEPENDENT = 1e-8
#: Loops have condition numbers of up to 1e4, ten times those of trees.
LOOPS = 10.0


def dense_solution(evaluator, u):
    """Accelerations and least multipliers of a state by singular values of the whole Jacobian.
    Of all accelerations that the rows permit those nearest to free motion in the metric of the
    masses (Gauss); then the least lambda with D^T lambda = M v_dot - g."""
    rows, forces, model = evaluator.rows(0.0, u), evaluator.applied_forces(0.0, u), evaluator.model
    _, p, _, w = split(u)
    A, n = matrices(p), model.body_count
    M, g = np.zeros((6 * n, 6 * n)), forces.copy()
    for b in range(n):
        J = A[b] @ model.Jp[b] @ A[b].T
        M[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = model.mass[b] * np.eye(3)
        M[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = J
        g[b, 3:] -= np.cross(w[b], J @ w[b])
    scale, D = np.linalg.inv(np.linalg.cholesky(M)).T, rows.dense()
    free = scale.T @ g.ravel()
    U, size, V = np.linalg.svd(D @ scale, full_matrices=False)
    rank = int(np.sum(size > DEPENDENT * size[0]))
    lacking = rows.gamma - D @ scale @ free
    v_dot = scale @ (free + V[:rank].T @ (U[:, :rank].T @ lacking / size[:rank]))
    return v_dot, np.linalg.lstsq(D.T, M @ v_dot - g.ravel(), rcond=DEPENDENT)[0]


def differences(scene):
    """Relative differences of accelerations and multipliers from the dense solution."""
    evaluator = CompiledModel(scene, method="joint").evaluator
    u = closed(CompiledModel(scene, method="lsq").evaluator)
    v_dot, multipliers = dense_solution(evaluator, u)
    found = evaluator.report(0.0, u)
    rest = found[len(v_dot) : len(v_dot) + len(multipliers)]
    # a scene that cannot move has rounding alone: of accelerations of 1 m/s^2
    a = np.max(np.abs(found[: len(v_dot)] - v_dot)) / max(1.0, np.max(np.abs(v_dot)))
    return a, np.max(np.abs(rest - multipliers)) / np.max(np.abs(multipliers))


def is_redundant(scene):
    return CompiledModel(scene, method="joint").redundancy().rank.redundant > 0


def with_loops(seed):
    """A random tree with spherical, universal, revolute joints and rods that close loops."""
    return loops.add_loops(trees.random_tree(3 + 2 * seed, seed), seed, 1 + seed // 3)


def with_twins(seed):
    """Hinges that are there twice: five of the ten rows of a door hold already."""
    scene = loops.add_twins(trees.random_tree(8, seed, joints=("rev", "sph")), seed, 2)
    assert is_redundant(scene)
    return scene


@pytest.mark.parametrize(
    ("make", "of"),
    [
        *((with_loops, k) if k % 4 == 0 else pytest.param(with_loops, k, marks=pytest.mark.slow)
          for k in range(8)),
        *((with_twins, k) for k in range(3)),
        # rods, drivers, rows of velocities, wheels that roll, seven bodies, redundant rows
        *((dap.load, name) for name in ("fourbar2", "fourbar3", "fourbar4", "tri", "bicycle",
                                        "A02-2", "A03", "A04", "N1")),
    ],
)  # fmt: skip
def test_loops_have_the_accelerations_and_least_multipliers_of_a_dense_solution(make, of):
    a, multipliers = differences(make(of))
    assert a < LOOPS * ACCELERATIONS
    assert multipliers < LOOPS * MULTIPLIERS


@pytest.mark.parametrize("name", ["fourbar3", "bicycle", "A04"])
def test_a_run_is_that_of_standard(name):
    """Motion, multipliers and the ledger: a driver, rows of velocities, a Bricard mechanism."""
    settings = {"t_end": 0.5, "dt": 0.1, "rtol": 1e-9, "atol": 1e-11, "integrator": "dop853"}
    right = dap.simulate(name, **settings)
    found = dap.simulate(name, method="joint", **settings)
    assert found.method == "joint"
    assert right.method != "joint"
    assert found.u == pytest.approx(right.u, abs=1e-8 * np.max(np.abs(right.u)))
    assert found.Lam == pytest.approx(right.Lam, abs=1e-7 * np.max(np.abs(right.Lam)))
    assert all(entry.ok for entry in found.ledger.values())


@long_in_plain_python
def test_friction_in_kept_joints_is_that_of_standard():
    """A spatial four-bar in which every joint rubs, the one that is cut as well."""
    scene, smooth = loops.spatial_four_bar(), loops.spatial_four_bar()
    for name in scene.joints:
        scene.add_force("friction", joint=name, mu=0.2, radius=0.05, v_tol=0.1)
    settings = {"t_end": 0.4, "dt": 0.1, "rtol": 1e-9, "atol": 1e-11}
    right = dap.simulate(scene, method="standard", **settings)
    found = dap.simulate(scene, method="joint", **settings)
    assert found.u == pytest.approx(right.u, abs=1e-8 * np.max(np.abs(right.u)))
    assert found.Lam == pytest.approx(right.Lam, abs=1e-7 * np.max(np.abs(right.Lam)))
    assert all(entry.ok for entry in found.ledger.values())
    smooth = dap.simulate(smooth, method="joint", **settings)
    assert np.max(np.abs(smooth.u - right.u)) > 1e-3  # it does something


def four_bar(lift=0.0):
    """A planar four-bar on ground: hinges, a universal joint, a ball; lift: of its pivot, m."""
    scene = dap.Scene(name="four-bar")
    ends = [(0.0, 0.0), (0.0, 1.0), (2.0, 1.5), (2.0, 0.0)]
    outer = "ground.O"
    for k, ((x0, z0), (x1, z1)) in enumerate(pairwise(ends)):
        half = np.array([x1 - x0, 0.0, z1 - z0]) / 2.0
        scene.add_body(f"rod{k}", mass=1.0, Jp=(0.3, 0.3, 0.3), r=(x0 + half[0], 0.0, z0 + half[2]))
        begin = scene.add_point(f"A{k}", f"rod{k}", tuple((-half).tolist()))
        if k == 1:
            keyword, axes = "univ", {"a_i": "rod1.y", "n_j": "rod0.z"}
        else:
            keyword, axes = "rev", {"a_i": f"rod{k}.y", "a_j": "rod1.y" if k else "ground.y"}
        scene.add_joint(keyword, f"J{k}", P_i=begin, P_j=outer, **axes)
        outer = scene.add_point(f"B{k}", f"rod{k}", tuple(half.tolist()))
    pivot = scene.add_point("pivot", "ground", (2.0, 0.0, lift))
    scene.add_joint("sph", "J3", P_i=outer, P_j=pivot)
    scene.add_force("weight", "gravity", wgt=(0.3, 0.0, -1.0))
    return scene


def test_a_start_off_the_constraints_is_corrected_first():
    """The last pivot is 1 cm away: the loop is closed at the start, and stays so."""
    found = dap.simulate(four_bar(lift=0.01), method="joint", t_end=0.5, dt=0.1)
    right = dap.simulate(four_bar(lift=0.01), method="standard", t_end=0.5, dt=0.1)
    assert found.u == pytest.approx(right.u, abs=1e-5)
    assert found.ledger["position"].ok
    assert "initial positions corrected" in " ".join(found.notes)


@long_in_plain_python
@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "adams"])
def test_projection_holds_the_kept_rows(integrator):
    """Rows of position and velocity at a tolerance of 1e-4: they stay at rounding."""
    found = dap.simulate(four_bar(), method="joint", t_end=2.0, dt=0.5, rtol=1e-4, atol=1e-4,
                         integrator=integrator)  # fmt: skip
    assert found.stats.projections > 0
    assert found.ledger["position"].value < 1e-13
    assert found.ledger["velocity"].value < 1e-12
    free = dap.simulate(four_bar(), method="joint", t_end=2.0, dt=0.5, rtol=1e-4, atol=1e-4,
                        integrator=integrator, project=False)  # fmt: skip
    assert free.ledger["position"].value > 1e-9  # it does something


def test_a_loop_without_freedom_stands_still():
    """A triangle of rods on ground: reactions as of lsq, no motion."""
    scene = triangle()
    settings = {"t_end": 0.5, "dt": 0.25}
    found = dap.simulate(scene, method="joint", **settings)
    right = dap.simulate(scene, method="lsq", **settings)
    assert found.u == pytest.approx(np.tile(found.u[0], (len(found.t), 1)), abs=1e-12)
    assert found.Lam == pytest.approx(right.Lam, abs=1e-9)


def triangle():
    """Two hinged rods that lean on each other: of ten rows five are one too many."""
    scene = dap.Scene(name="triangle")
    for k, (x, way) in enumerate(((0.0, 1.0), (2.0, -1.0))):
        scene.add_body(f"rod{k}", mass=1.0, Jp=(0.3, 0.3, 0.3), r=(x + 0.5 * way, 0.0, 0.5))
        foot = scene.add_point(f"foot{k}", f"rod{k}", (-0.5 * way, 0.0, -0.5))
        scene.add_point(f"top{k}", f"rod{k}", (0.5 * way, 0.0, 0.5))
        pivot = scene.add_point(f"pivot{k}", "ground", (x, 0.0, 0.0))
        scene.add_joint("rev", f"J{k}", P_i=foot, P_j=pivot, a_i=f"rod{k}.y", a_j="ground.y")
    scene.add_joint("rev", "top", P_i="top0", P_j="top1", a_i="rod0.y", a_j="rod1.y")
    scene.add_force("weight", "gravity")
    return scene


def test_kept_joints_are_named_with_their_reasons():
    """In the notes of a run and in the explanation."""
    compiled = dap.compile("fourbar3", method="joint")
    words = "4 rows kept, of J3 (it closes a loop with J2, J1, J4), J5 (its rows depend on time)"
    assert any(f"method joint: {words}" in note for note in compiled.notes)
    assert words in compiled.explain()
    assert not any("kept" in note for note in dap.compile("pen2", method="joint").notes)
    scene = trees.mixed_chain(2)
    scene.add_joint("rel-rot", "lock", body_i="b0", a_j="ground.y")
    explained = dap.compile(scene, method="joint").explain()
    assert "2 nodes: 1 angle, 1 ball; 1 row kept, of lock (" in explained


def test_a_screw_is_kept_by_name():
    """A motion that is known, of a kind that the recursion does not have."""
    scene = dap.Scene(name="screw")
    scene.add_body("nut", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_joint("screw", "thread", P_i="nut.O", P_j="ground.O", a_i="nut.z", a_j="ground.z",
                    pitch=0.1)  # fmt: skip
    scene.add_force("weight", "gravity")
    settings = {"t_end": 1.0, "dt": 0.5, "rtol": 1e-9, "atol": 1e-11}
    found = dap.simulate(scene, method="joint", **settings)
    assert any("thread (its motion is a screw)" in note for note in found.notes)
    right = dap.simulate(scene, method="standard", **settings)
    assert found.u == pytest.approx(right.u, abs=1e-8 * np.max(np.abs(right.u)))


@long_in_plain_python
def test_a_net_runs_and_notes_its_cost():
    """A ladder on two chains of spherical joints: all rows meet in a matrix without zeros."""
    found = dap.simulate(ladder(12), method="joint", t_end=0.02, dt=0.02)
    assert any("times as long as standard" in note for note in found.notes)
    right = dap.simulate(ladder(12), method="standard", t_end=0.02, dt=0.02)
    assert found.u == pytest.approx(right.u, abs=1e-7)
    assert not any("times as long" in note for note in dap.compile(ladder(1), method="joint").notes)


def ladder(rungs):
    """Rods along x from two points of ground, and a rung between their ends; spherical joints."""
    scene = dap.Scene(name="ladder")
    last = ["ground.O", scene.add_point("foot", "ground", (0.0, 1.0, 0.0))]
    for k in range(rungs):
        for side in range(2):
            name = f"rod{side}_{k}"
            scene.add_body(name, mass=1.0, Jp=(0.1, 0.1, 0.1), r=(k + 0.5, float(side), 0.0))
            begin = scene.add_point(f"{name}a", name, (-0.5, 0.0, 0.0))
            scene.add_joint("sph", f"J{name}", P_i=begin, P_j=last[side])
            last[side] = scene.add_point(f"{name}b", name, (0.5, 0.0, 0.0))
        rung = f"rung{k}"
        scene.add_body(rung, mass=1.0, Jp=(0.1, 0.1, 0.1), r=(k + 1.0, 0.5, 0.0))
        for side in range(2):
            end = scene.add_point(f"{rung}{side}", rung, (0.0, side - 0.5, 0.0))
            scene.add_joint("sph", f"J{rung}{side}", P_i=end, P_j=last[side])
    scene.add_force("weight", "gravity")
    return scene


def test_rows_of_too_many_meetings_are_refused(monkeypatch):
    """Where their arrays would take gigabytes; here from a hundred numbers on."""
    monkeypatch.setattr("dap3d_core.formulations.joint_loops.tables.MOST_NUMBERS", 100)
    with pytest.raises(
        dap.SimulationError, match=r"kept rows would take .* GB. Use method standard"
    ):
        dap.compile(ladder(3), method="joint")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        # front wheels that are steered by equal angles contradict each other
        pytest.param(singular.car, "have come to hold a motion that they left free",
                     marks=long_in_plain_python),
        # rows depend on each other at this pose alone; joint does not find the rates there
        (singular.flat_parallelogram, "singular pose, from which method joint"),
    ],
)  # fmt: skip
def test_motions_that_joint_does_not_find_are_refused(make, words):
    with pytest.raises(dap.SimulationError, match=words):
        dap.simulate(make(), method="joint", t_end=0.01, dt=0.005, rtol=1e-8)


@long_in_plain_python
def test_a_loop_goes_through_its_singular_poses():
    """A parallelogram whose links lie in one line eight times in ten seconds, as in standard."""
    found = dap.simulate(problems.four_bar(), method="joint", t_end=10.0, dt=0.5, rtol=1e-9,
                         atol=1e-11)  # fmt: skip
    tip = 2.0 * np.hstack([found.r[:, 0, :2], found.rd[:, 0, :2]])
    expected = redundant.four_bars_tip(1, found.t)
    assert redundant.error_of(tip[1:], expected[1:]) < 500 * 1e-9


def test_rows_that_contradict_each_other_are_refused():
    """Two drivers of one crank at different speeds."""
    scene = dap.load("fourbar3")
    scene.add_function("a", "other", coeff=(0.0, 1.0, 0.0))
    driver = scene.joints["J5"]
    scene.add_joint(driver.type, "J6", **driver.fields | {"function": "other"})
    with pytest.raises(dap.SimulationError, match="No motion satisfies them all"):
        dap.simulate(scene, method="joint", t_end=0.1, dt=0.1)


def test_a_report_elsewhere_leaves_the_reference_of_a_run():
    """Constants of the tree, what is known of its kept rows: those of the start stay."""
    model = CompiledModel(four_bar(), method="joint")
    elsewhere = dap.simulate(four_bar(), method="standard", t_end=0.5, dt=0.5).u[-1]
    tree = model.evaluator.system.tree
    model.evaluator.coordinates.start(model.model.u0)
    arrays = tree.constants, tree.kept.smallest, tree.kept.settings
    before = [array.copy() for array in arrays]
    model.evaluator.report(0.0, elsewhere)
    assert all(map(np.array_equal, arrays, before))


def test_another_model_of_the_structure_has_its_own_tree():
    """As in a sweep: another pivot, to which the tree and its kept rows have other numbers."""
    scenes = [four_bar(), four_bar(lift=0.3)]
    evaluator, other = (CompiledModel(scene, method="joint").evaluator for scene in scenes)
    u = other.model.u0
    before = evaluator.report(0.0, u)
    evaluator.load(other.model)
    assert np.array_equal(evaluator.report(0.0, u), other.report(0.0, u))
    assert not np.array_equal(evaluator.report(0.0, u), before)
