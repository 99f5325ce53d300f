"""Redundant constraints: who shares what, where, whether they agree, what stays unique."""

import numpy as np
import pytest
from support.internals import correct_initial
from support.mechanisms import (
    bent_chain,
    bricard,
    door,
    four_bar_row,
    planar_four_bar,
    torn,
    two_motors,
)
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.simulation.redundancy.other_poses import redundancy_elsewhere


def two_doors(gap=0.0):
    """Two doors, each on two hinges of its own; the upper hinge of the second set off along it."""
    scene = dap.Scene(name="two doors")
    for name, y in (("first", 0.0), ("second", 5.0)):
        scene.add_body(name, mass=1.0, Jp=(1.0, 1.0, 1.0), r=(0.5, y, 0.0))
        for word, z in (("low", -1.0), ("high", 1.0)):
            leaf, post = f"{name}_{word}_leaf", f"{name}_{word}_post"
            scene.add_point(leaf, name, (-0.5, 0.0, z))
            off = gap if (name, word) == ("second", "high") else 0.0
            scene.add_point(post, "ground", (0.0, y, z + off))
            scene.add_joint("rev", f"{name}_{word}", P_i=leaf, P_j=post, a_i=f"{name}.z",
                            a_j="ground.z")  # fmt: skip
    return scene


def elsewhere_of(scene):
    """Redundancy at the corrected start and at other poses."""
    compiled = dap.compile(scene)
    u = correct_initial(compiled.evaluator, compiled.model.u0).u
    found = compiled.redundancy(u)
    return found, redundancy_elsewhere(compiled.evaluator, u, found)


def test_separate_loops_are_separate_groups():
    """Each door has 10 rows, and a hinge allows one freedom of its six: rank 5, 5 too many."""
    found = dap.compile(two_doors()).redundancy()
    assert (found.rank.rows, found.rank.rank, found.rank.dof) == (20, 10, 2)
    groups = [(group.joints, group.redundant) for group in found.groups]
    assert groups == [(("first_low", "first_high"), 5), (("second_low", "second_high"), 5)]
    assert "2 groups: first_low, first_high (5 rows); second_low" in found.describe()


def test_loops_that_share_a_joint_are_one_group():
    """In a row of four-bars each pair of neighbours has a crank's joint in common."""
    found = dap.compile(four_bar_row(3)).redundancy()
    assert len(found.groups) == 1
    assert found.groups[0].redundant == found.rank.redundant == 9
    assert found.groups[0].joints == found.joints
    assert len(found.joints) == 10


@pytest.mark.parametrize("way", ["svd of parts", "elimination", "inverse iteration"])
def test_a_row_of_four_bars_has_three_redundant_rows_a_loop(way, monkeypatch):
    """N loops: 2N+1 bodies and 3N+1 revolutes, 12N+6 columns and 15N+5 rows. In the plane a joint
    has two rows, 6N+2 in all, and every one counts: 6N+3 freedoms of the plane less that is 1. Out
    of the plane nothing moves: rank 3 (2N+1). So rank 12N+5 and 3N rows too many."""
    N = 8
    monkeypatch.setattr("dap3d_core.simulation.redundancy.redundancy.FEW_ROWS", 0)
    if way != "svd of parts":
        monkeypatch.setattr("dap3d_core.linear.rank.PART_ROWS", 0)
    if way == "inverse iteration":
        monkeypatch.setattr("dap3d_core.linear.rank.by_elimination", lambda problem, K: None)
    found = dap.compile(four_bar_row(N, 0.3)).redundancy()
    assert found.rank.method == way
    counts = (found.rank.rows, found.rank.rank, found.rank.redundant, found.rank.dof)
    assert counts == (15 * N + 5, 12 * N + 5, 3 * N, 1)
    (group,) = found.groups
    assert (group.redundant, len(group.joints)) == (3 * N, 3 * N + 1)
    # in the plane every reaction is unique; out of it none is
    assert {(r.force, r.moment) for r in found.reactions()} == {("xy", "z")}


@pytest.mark.parametrize(("n", "way"), [(4, "svd"), (12, "leaves")])
def test_trees_need_no_singular_values(n, way):
    """Only where there are so few rows that to look for leaves takes as long."""
    found = dap.compile(bent_chain(n)).redundancy()
    assert (found.rank.method, found.rank.redundant) == (way, 0)


def test_what_hangs_on_a_loop_takes_no_part(monkeypatch):
    """A pendulum on each coupler of a row of four-bars adds five independent rows and a freedom
    each; elimination still is a proof, and the pendulums' reactions are unique."""
    monkeypatch.setattr("dap3d_core.simulation.redundancy.redundancy.FEW_ROWS", 0)
    monkeypatch.setattr("dap3d_core.linear.rank.PART_ROWS", 0)
    scene = four_bar_row(4, 0.3)
    for k in range(1, 5):
        r = np.add(scene.bodies[f"coupler{k}"].r, (0.0, -0.5, 0.0))
        scene.add_body(f"bob{k}", mass=1.0, Jp=(0.1, 0.1, 0.1), r=r)
        scene.add_point(f"hook{k}", f"bob{k}", (0.0, 0.5, 0.0))
        scene.add_joint("rev", f"bob{k}", P_i=f"hook{k}", P_j=f"coupler{k}.O", a_i=f"bob{k}.z",
                        a_j=f"coupler{k}.z")  # fmt: skip
    found = dap.compile(scene).redundancy()
    assert found.rank.method == "elimination"
    assert (found.rank.redundant, found.rank.dof) == (12, 5)
    assert found.unique_joints == ("bob1", "bob2", "bob3", "bob4")


@long_in_plain_python
def test_many_four_bars_are_counted_beyond_a_thousand_rows():
    """The same closed form with N = 80, as a run meets it: 1205 rows, 240 too many."""
    found = dap.compile(four_bar_row(80, 0.3)).redundancy()
    assert found.rank.method == "elimination"
    assert (found.rank.rows, found.rank.redundant, found.rank.dof) == (1205, 240, 1)


@pytest.mark.parametrize(
    ("scene", "rows", "found_rank", "dof"),
    [
        (door(), 15, 10, 2),  # a hinge says five things; its twin says nothing new
        (planar_four_bar(), 20, 17, 1),  # 3 bodies in the plane: 9 - 8 = 1; 9 rows lock the rest
        (four_bar_row(2), 35, 29, 1),  # benchmarks A02
        (bricard(), 30, 29, 1),  # benchmarks A04: count says no freedom, there is one
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_what_is_redundant_everywhere(scene, rows, found_rank, dof):
    """The rank is the same at three other poses that the joints allow."""
    found, elsewhere = elsewhere_of(scene)
    assert (found.rank.rows, found.rank.rank, found.rank.dof) == (rows, found_rank, dof)
    assert elsewhere.everywhere is True
    assert elsewhere.poses == (found_rank,) * 3
    assert elsewhere.redundant == rows - found_rank
    assert "not this pose alone" in elsewhere.describe(found)


@pytest.mark.parametrize("rows", ["few", "many"])
def test_what_is_redundant_at_one_pose_alone(rows, monkeypatch):
    """A02 with all links in line: rank 27 of 35 rows, 29 elsewhere (benchmarks A02). Two of the
    eight rows are redundant there alone, six everywhere."""
    if rows == "many":
        monkeypatch.setattr("dap3d_core.simulation.initial.least_change.DENSE_ROWS", 0)
        monkeypatch.setattr("dap3d_core.simulation.redundancy.redundancy.FEW_ROWS", 0)
    found, elsewhere = elsewhere_of(four_bar_row(2, np.pi / 2))
    assert (found.rank.rank, found.rank.redundant, found.rank.dof) == (27, 8, 3)
    assert elsewhere.everywhere is False
    assert elsewhere.poses == (29, 29, 29)
    assert elsewhere.redundant == 6
    assert "2 of the 8 are redundant only at this pose, 6 at 3" in elsewhere.describe(found)


def test_other_poses_are_the_same_each_time():
    """Directions are seeded: two calls agree, and the state that was asked about is left alone."""
    compiled = dap.compile(bricard())
    u = compiled.model.u0.copy()
    found = compiled.redundancy(u)
    first = redundancy_elsewhere(compiled.evaluator, u, found)
    assert first == redundancy_elsewhere(compiled.evaluator, u, found)
    assert np.array_equal(u, compiled.model.u0)


def test_what_cannot_be_moved_cannot_be_told():
    """A welded body with one joint more, of three rows: no other pose."""
    scene = dap.Scene(name="welded")
    scene.add_body("block", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_joint("fix", "weld", body_i="block")
    scene.add_joint("sph", "more", P_i="block.O", P_j="ground.O")
    found, elsewhere = elsewhere_of(scene)
    assert (found.rank.redundant, found.rank.dof) == (3, 0)
    assert (elsewhere.poses, elsewhere.redundant, elsewhere.everywhere) == ((), None, None)
    assert "cannot be told" in elsewhere.describe(found)


def test_the_count_does_not_depend_on_how_well_the_start_was_closed():
    """Newton stops with up to 1e-10 open, and tilts the axes by as much: they still are parallel.
    Without allowing for it one in ten of these starts would have all of its rows independent."""
    compiled = dap.compile(planar_four_bar())
    rng = np.random.default_rng(0)
    left_open = []
    for _ in range(30):
        u = compiled.model.u0.copy()
        u[:21] += 10.0 ** rng.uniform(-5, -1) * rng.normal(size=21)
        for b in range(3):
            u[7 * b + 3 : 7 * b + 7] /= np.linalg.norm(u[7 * b + 3 : 7 * b + 7])
        found = correct_initial(compiled.evaluator, u)
        left_open.append(found.residual[0])
        assert compiled.redundancy(found.u).rank.redundant == 3
    assert max(left_open) > 1e-12  # some of them are far above rounding


def test_drivers_that_contradict_each_other_are_named():
    """Rates 1 and 2 for one angle: the unit combination of the two rows misses by 1 / sqrt(2)."""
    found = dap.compile(two_motors()).redundancy()
    (contradiction,) = found.contradictions
    assert (contradiction.level, contradiction.joints) == ("velocity", ("slow", "fast"))
    assert contradiction.size == pytest.approx(1 / np.sqrt(2), rel=1e-12)
    assert "slow, fast contradict each other: their prescribed velocities" in found.describe()


def test_drivers_that_part_later_contradict_each_other_in_acceleration():
    """Equal rates, but angular accelerations 0 and 3: (3 - 0) / sqrt(2), seen where the wheel turns
    at the rate that both prescribe, and nowhere else."""
    scene = two_motors()
    scene.functions["slow_angle"].fields["coeff"] = (0.0, 2.0, 0.0)
    scene.functions["fast_angle"].fields["coeff"] = (0.0, 2.0, 1.5)
    compiled = dap.compile(scene)
    assert compiled.redundancy().contradictions == ()  # at rest nothing can be said of gamma
    start = correct_initial(compiled.evaluator, compiled.model.u0)
    (contradiction,) = compiled.redundancy(start.u).contradictions
    assert (contradiction.level, contradiction.joints) == ("acceleration", ("slow", "fast"))
    assert contradiction.size == pytest.approx(3 / np.sqrt(2), rel=1e-12)
    with pytest.raises(dap.SimulationError, match="of the accelerations disagrees"):
        dap.simulate(compiled, t_end=0.1)


def test_joints_that_cannot_be_closed_are_named_and_the_others_are_not():
    """torn: 2 m between two joints of one body, 2 / sqrt(2) for the unit combination. The second of
    two doors, its upper hinge set off by 0.1 m: its five redundant rows miss by 0.1 / sqrt(2)."""
    (contradiction,) = dap.compile(torn()).redundancy().contradictions
    assert (contradiction.level, contradiction.joints) == ("position", ("first", "second"))
    assert contradiction.size == pytest.approx(np.sqrt(2), rel=1e-12)
    (contradiction,) = dap.compile(two_doors(gap=0.1)).redundancy().contradictions
    assert contradiction.joints == ("second_low", "second_high")
    assert contradiction.size == pytest.approx(0.1 / np.sqrt(2), rel=1e-12)


@pytest.mark.parametrize("scene", [door(0.02), planar_four_bar(0.02)], ids=lambda s: s.name)
def test_joints_that_are_merely_open_contradict_nothing(scene):
    """A start that a correction closes is no contradiction, neither before nor after it."""
    compiled = dap.compile(scene)
    start = correct_initial(compiled.evaluator, compiled.model.u0)
    assert compiled.redundancy().contradictions == ()
    assert compiled.redundancy(start.u).contradictions == ()


def test_reactions_in_the_plane_of_a_four_bar_are_unique():
    """Axes along z: three planar bodies in equilibrium fix forces x, y and moments z; force z and
    moments x, y are shared. The rows along x and y of a revolute have unique multipliers."""
    found = dap.compile(planar_four_bar()).redundancy()
    reactions = found.reactions()
    assert [r.joint for r in reactions] == ["J1", "J2", "J3", "J4"]
    assert {(r.rows, r.unique_rows, r.force, r.moment) for r in reactions} == {
        (5, (1, 2), "xy", "z")
    }
    assert found.unique_joints == ()
    assert found.describe_reactions() == ["force x, y and moment z alone unique: J1, J2, J3, J4"]


def test_reactions_outside_of_a_group_are_unique():
    """The hinges of a door share everything; the leaf folded onto it has one hinge: unique."""
    found = dap.compile(door()).redundancy()
    assert found.unique_joints == ("fold",)
    assert found.describe_reactions() == ["not unique: lower, upper", "unique: fold"]


def test_what_is_said_to_be_unique_does_not_change_with_the_multipliers():
    """Multipliers moved along every combination that vanishes: reactions said to be unique stay,
    each of the others moves; by the dense Jacobian."""
    compiled = dap.compile(four_bar_row(2, np.pi / 2))
    found = compiled.redundancy()
    D = compiled.evaluator.rows(0.0, compiled.model.u0).dense()
    left, _, _ = np.linalg.svd(D)
    null = left[:, found.rank.rank :]
    start = compiled.model.joint_start
    for reaction in found.reactions():
        k = compiled.model.joint_names.index(reaction.joint)
        rows, body = slice(start[k], start[k + 1]), compiled.model.joint_slots[k][0] - 1
        moved = np.abs(D[rows, 6 * body : 6 * body + 6].T @ null[rows]).max(axis=1)
        unique = [axis in part for part in (reaction.force, reaction.moment) for axis in "xyz"]
        assert (moved < 1e-12).tolist() == unique
        alone = (np.abs(null[rows]).max(axis=1) < 1e-12).nonzero()[0] + 1
        assert tuple(alone) == reaction.unique_rows


def test_explain_tells_all_of_it():
    """Rows, reactions and poses have a line each; without redundancy there is nothing to tell."""
    words = dap.compile(door()).explain()
    for piece in (
        "5 of 15 constraint rows",
        "reactions  not unique: lower, upper",
        "3 other poses",
    ):
        assert piece in words
    calm = dap.compile(dap.load("fourbar3")).explain()
    assert "all independent" in calm
    assert "poses" not in calm
