"""How a run starts: positions and velocities corrected, constraints independent."""

import numpy as np
import pytest
from support.internals import split
from support.mechanisms import bent_chain, door, planar_four_bar, rough_four_bar, torn, two_motors
from support.own_types import registry_of

import dap3d_core as dap
from dap3d_core.interface import Function, Joint, Vector2, number, vector2
from dap3d_core.kernels import cross, dot, neg, row, scale, sqrt, where
from dap3d_core.result import Note
from dap3d_core.simulation.initial import assemble


def corrected(scene, **options):
    """A scene's machine and its corrected start."""
    evaluator = dap.compile(scene).evaluator
    return evaluator, assemble.correct_initial(evaluator, evaluator.model.u0, **options)


@pytest.fixture
def many_rows(monkeypatch):
    """Every scene is treated as one of many rows."""
    monkeypatch.setattr("dap3d_core.simulation.initial.least_change.DENSE_ROWS", 0)
    monkeypatch.setattr("dap3d_core.simulation.redundancy.redundancy.FEW_ROWS", 0)


def turn_of(u, v, n):
    """Angles (n,) between the poses of two states, rad."""
    cosine = np.abs(np.sum(split(u)[1] * split(v)[1], axis=1))
    return 2.0 * np.arccos(np.minimum(cosine, 1.0))


# ------------------------------------------------------------------ positions


def test_rough_four_bar_converges_quadratically(monkeypatch):
    """max |C| before each pass is 1.2e-3, 1.6e-6, 1.3e-12, to the digits printed."""
    residuals = []
    for tolerance in (1.0, 1e-4, 1e-10):
        monkeypatch.setattr(assemble, "TOLERANCE", tolerance)
        found = corrected(rough_four_bar())[1]
        residuals.append(found.residual[0])
        assert found.passes == len(residuals) - 1
        assert found.violation[0] == pytest.approx(residuals[0], rel=1e-12)
    assert residuals == pytest.approx([1.2e-3, 1.6e-6, 1.3e-12], rel=0.05)


def test_the_first_pass_is_the_least_change(monkeypatch):
    """A pass moves by -pinv(D) C of the position rows: r in metres, rotations in rad, to the second
    order of a rotation of 1e-3."""
    monkeypatch.setattr(assemble, "TOLERANCE", 1e-5)
    evaluator, found = corrected(rough_four_bar())
    assert found.passes == 1
    u0, n = evaluator.model.u0, 3
    rows, keep = evaluator.rows(0.0, u0), evaluator.model.position_row
    change = -np.linalg.pinv(rows.dense()[keep]) @ rows.C[keep]
    shift, turn = change.reshape(n, 6)[:, :3], change.reshape(n, 6)[:, 3:]
    assert split(found.u)[0] - split(u0)[0] == pytest.approx(shift, abs=1e-15)
    assert turn_of(u0, found.u, n) == pytest.approx(np.linalg.norm(turn, axis=1), abs=1e-7)
    assert found.moved == pytest.approx(np.max(np.linalg.norm(shift, axis=1)), rel=1e-9)
    assert found.turned == pytest.approx(np.max(np.linalg.norm(turn, axis=1)), rel=1e-3)


def test_a_velocity_row_holds_nothing():
    """The crank of the rough four-bar leaves the vertical by 0.08 degrees: its driver does
    not take part in the correction of positions."""
    evaluator, found = corrected(rough_four_bar())
    assert np.degrees(turn_of(evaluator.model.u0, found.u, 3)[0]) == pytest.approx(0.08, abs=0.005)


@pytest.mark.parametrize("rows", ["few", "many"])
def test_held_bodies_stay_where_they_are(rows, request):
    """With ``hold`` the crank keeps its pose bit for bit, and the others are assembled to it."""
    if rows == "many":
        request.getfixturevalue("many_rows")
    scene = rough_four_bar()
    scene.simulation.hold = ("crank",)
    result = dap.simulate(scene, t_end=0.0)
    assert result.r[0, 0].tolist() == [0.0, 0.0, 1.0]
    assert result.p[0, 0].tolist() == [1.0, 0.0, 0.0, 0.0]
    assert result.ledger["position"].value < 1e-10
    assert result.w[0, 0] == pytest.approx([-2 * np.pi, 0, 0], abs=1e-10)  # velocities are not held


def test_holding_too_much_is_an_error_that_says_so():
    """With all bodies held nothing can be assembled: the held ones are named."""
    scene = rough_four_bar()
    scene.simulation.hold = ("crank", "coupler", "follower")
    with pytest.raises(dap.AssemblyError, match="held where they are: crank, coupler, follower"):
        dap.simulate(scene, t_end=0.0)


@pytest.mark.parametrize("angle", [0.3, 2.0, 3.0])
def test_a_large_turn_is_made_in_limited_passes(angle):
    """A wheel whose axis lies off by up to 3 rad is turned by at most 0.5 rad a pass until it fits:
    it ends on the constraints, its axis along that of ground."""
    scene = dap.Scene(name="wheel")
    p = (np.cos(angle / 2), np.sin(angle / 2), 0.0, 0.0)
    scene.add_body("wheel", mass=1.0, Jp=(1, 1, 1), r=(7.0, 0.0, 0.0), p=p)
    scene.add_joint("rev", "axle", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z")
    _, found = corrected(scene)
    assert found.residual[0] <= 1e-10
    limit = min(angle, np.pi - angle) / assemble.MOST_TURN
    assert max(limit, 2.0) <= found.passes < 15
    assert found.turned == pytest.approx(min(angle, np.pi - angle), abs=1e-9)
    assert found.moved == pytest.approx(7.0, abs=1e-9)


def test_contradictory_joints_are_named_with_their_residuals():
    """Two joints that want a body in places 2 m apart share the gap; the third is not accused."""
    with pytest.raises(dap.AssemblyError) as caught:
        dap.simulate(torn(), t_end=1.0)
    words = str(caught.value)
    assert "after 25 passes" in words
    table = [line.split() for line in words.splitlines() if line.startswith("  ")]
    assert table[0] == ["joint", "type", "residual", "rows"]
    assert sorted(table[1:]) == [["first", "sph", "1", "1"], ["second", "sph", "1", "1"]]
    assert isinstance(caught.value, dap.SimulationError)
    assert caught.value.result is None


@pytest.mark.slow
def test_a_long_list_of_open_joints_is_cut():
    """Twelve bodies torn apart by two joints each: ten joints in the table, the other fourteen as a
    count; names of any length, and no line beyond 80 columns."""
    scene = dap.Scene(name="many torn")
    scene.add_point("far", "ground", (1.0, 0.0, 0.0))
    for k in range(12):
        scene.add_body(f"b{k}", mass=1.0, Jp=(1.0, 1.0, 1.0))
        for word, point in (("here", "ground.O"), ("there", "far")):
            scene.add_joint("sph", f"{word}_{k}_{'long' * 20}", P_i=f"b{k}.O", P_j=point)
    with pytest.raises(dap.AssemblyError) as caught:
        dap.simulate(scene, t_end=0.0)
    lines = str(caught.value).splitlines()
    assert sum("long" in line for line in lines) == 10
    assert "  and 14 joints more" in lines
    assert max(map(len, lines)) <= 80


class Rod(Joint):
    """A distance by its root, which has no derivative where the points coincide."""

    keyword, rows = "rod", 1
    d: Vector2 = vector2()
    length: float = number(default=0.0)

    def C(d, length):
        return sqrt(dot(d, d)) - length

    def J(d, s_P_i, s_P_j):
        u = scale(1.0 / sqrt(dot(d, d)), d)
        return row(neg(u), cross(u, s_P_i)), row(u, cross(s_P_j, u))

    def gamma(t):
        return 0.0


class Late(Function):
    """A function that has no value before t = 0.1."""

    keyword = "late"

    def value(x):
        f = where(x < 0.1, sqrt(-1.0 - x), x)
        return f, f, 0.0, 0.0


@pytest.mark.parametrize("correct", [True, False])
def test_a_joint_without_finite_rows_is_named(correct):
    """Neither a crash of the linear algebra nor a NaN: the joint, or the function behind it."""
    scene = dap.Scene(name="point")
    scene.add_body("a", mass=1.0, Jp=(1, 1, 1))
    scene.add_joint("rod", "short", P_i="a.O", P_j="ground.O")
    compiled = dap.compile(scene, registry=registry_of(Rod))
    with pytest.raises(dap.SimulationError, match=r"joint short \(type rod\) is not finite"):
        dap.simulate(compiled, t_end=1.0, correct=correct)
    scene = two_motors()
    scene.functions["fast_angle"].type = "late"
    scene.functions["fast_angle"].fields.clear()
    compiled = dap.compile(scene, registry=registry_of(Late))
    with pytest.raises(dap.SimulationError, match=r"function fast_angle .* is not finite"):
        dap.simulate(compiled, t_end=1.0, correct=correct)


def dumb_bell(gap):
    """A light and a heavy body, 1 kg and 3 kg, whose mass centres a joint wants in one place."""
    scene = dap.Scene(name="dumb-bell")
    scene.add_body("light", mass=1.0, Jp=(1, 1, 1), r=(gap, 0, 0), r_dot=(0, 4, 0))
    scene.add_body("heavy", mass=3.0, Jp=(1, 1, 1))
    scene.add_joint("sph", "J", P_i="light.O", P_j="heavy.O")
    return scene


@pytest.mark.parametrize("rows", ["few", "many"])
@pytest.mark.parametrize(("metric", "share"), [("unit", 1 / 2), ("mass", 3 / 4)])
def test_the_metric_shares_a_gap_by_mass(rows, metric, share, request):
    """The light body takes its share of the gap, that of the other mass; and the velocities are
    those after a perfectly inelastic impact, (1 * 4 + 3 * 0) / 4, where masses count."""
    if rows == "many":
        request.getfixturevalue("many_rows")
    scene = dumb_bell(1.0)
    scene.simulation.correct_metric = metric
    result = dap.simulate(scene, t_end=0.0)
    assert result.r[0, :, 0] == pytest.approx([1 - share] * 2, abs=1e-12)
    assert result.rd[0, :, 1] == pytest.approx([4 * (1 - share)] * 2, abs=1e-12)
    assert result.settings["correct_metric"] == metric


@pytest.mark.parametrize("rows", ["few", "many"])
def test_the_metric_of_masses_weighs_rotations_by_inertia(rows, request):
    """A bar of mass m, inertia J about z, held at an arm L: of a small gap g across it the centre
    takes g (1/m) / (1/m + L^2/J), the rotation g (L/J) / (1/m + L^2/J); to the second order of g.
    The bar is turned about y, so that its inertia about its own x is the one that counts."""
    if rows == "many":
        request.getfixturevalue("many_rows")
    m, J, L, g = 2.0, 0.3, 0.7, 1e-5
    scene = dap.Scene(name="bar")
    turned = (np.cos(0.25 * np.pi), 0.0, np.sin(0.25 * np.pi), 0.0)
    scene.add_body("bar", mass=m, Jp=(J, 0.2, 0.25), r=(-L, -g, 0.0), p=turned)
    scene.add_point("tip", "bar", (0.0, 0.0, L))  # along x: the bar is turned by a right angle
    scene.add_joint("sph", "J", P_i="tip", P_j="ground.O")
    _, found = corrected(scene, metric="mass")
    share = 1 / m + L**2 / J
    assert found.moved == pytest.approx(g / m / share, rel=1e-4)
    assert found.turned == pytest.approx(g * L / J / share, rel=1e-4)


# ------------------------------------------------------------------ velocities


def test_corrected_velocities_are_the_least_change():
    """v - pinv(D) (D v - nu) by numpy, and v = D v - nu = 0 after it; from rest and from others."""
    scene = dap.load("fourbar3")
    for seed in (None, 1, 2):
        evaluator = dap.compile(scene).evaluator
        u = evaluator.model.u0.copy()
        if seed is not None:
            u[21:] = np.random.default_rng(seed).normal(size=18)
        found = assemble.correct_initial(evaluator, u)
        rows = evaluator.rows(0.0, found.u)
        D, v = rows.dense(), u[21:]
        wanted = v - np.linalg.pinv(D) @ (D @ v - rows.nu)
        assert found.u[21:] == pytest.approx(wanted, abs=1e-12)
        assert found.residual[1] == pytest.approx(np.max(np.abs(D @ found.u[21:] - rows.nu)))
        assert found.residual[1] < 1e-12


def test_a_good_start_is_left_alone():
    """pen2 is assembled: its state is used bit for bit, and nothing is noted."""
    scene = dap.load("pen2")
    evaluator, found = corrected(scene)
    assert np.array_equal(found.u, evaluator.model.u0)
    assert (found.passes, found.moved, found.turned) == (0, 0.0, 0.0)
    result = dap.simulate(scene, t_end=0.0, correct=True)
    assert not any("corrected" in note for note in result.notes)


def test_what_was_corrected_is_noted():
    """Passes, residuals before and after, and how far bodies went (promise: no silent change)."""
    result = dap.simulate(rough_four_bar(), t_end=0.0)
    (positions,) = [n for n in result.notes if "initial positions corrected" in n]
    (velocities,) = [n for n in result.notes if "initial velocities corrected" in n]
    assert "in 2 passes: |C| 0.0012 -> 1.3e-12" in positions
    assert "|D v - nu| 6.3 -> " in velocities


@pytest.mark.parametrize(("gap", "small"), [(1e-8, True), (1e-3, False)])
def test_what_is_no_more_than_rounding_is_for_information(gap, small):
    """A gap of 1e-8 of a model of 1 m is one of rounding; one of a millimetre is a change."""
    scene = dap.load("pen2")
    body = next(iter(scene.bodies.values()))
    body.r = tuple(np.add(body.r, (0.0, gap, 0.0)))
    result = dap.simulate(scene, t_end=0.0, correct=True)
    (note,) = [n for n in result.notes if "initial positions" in n]
    assert Note(note).is_warning != small


def test_velocities_that_the_scene_leaves_open_are_for_information():
    """fourbar3 gives none: its motor does. Rest that is given is a number that was replaced."""
    scene = dap.load("fourbar3")
    (note,) = [n for n in dap.simulate(scene, t_end=0.0).notes if "initial velocities" in n]
    assert not Note(note).is_warning
    scene.bodies["crank"].w = [0.0, 0.0, 0.0]
    (note,) = [n for n in dap.simulate(scene, t_end=0.0).notes if "initial velocities" in n]
    assert Note(note).is_warning


def test_without_correction_the_state_is_left_and_noted():
    """correct=False: the run starts from the state as given, and says how far off it is."""
    scene = rough_four_bar()
    result = dap.simulate(scene, t_end=0.0, correct=False)
    assert np.array_equal(result.u[0], dap.compile(scene).model.u0)
    (note,) = [n for n in result.notes if "not corrected" in n]
    assert "position 0.0012, velocity 6.3" in note


def test_a_scene_without_joints_needs_no_correction():
    """Nothing is evaluated: no violation, no passes."""
    evaluator, found = corrected(dap.load("bodies2"))
    assert assemble.violation(evaluator, evaluator.model.u0) == (0.0, 0.0)
    assert np.array_equal(found.u, evaluator.model.u0)


# ------------------------------------------------------------------ many rows


@pytest.mark.parametrize(
    "scene",
    [rough_four_bar(), bent_chain(5), door(0.02), planar_four_bar(0.02)],
    ids=lambda scene: scene.name,
)
def test_the_correction_of_many_rows_is_that_of_few(scene, monkeypatch):
    """The block factorisation finds the least change that numpy finds, redundant rows or not: both
    end within 1e-10 of the constraints, after passes that agree to rounding times the condition."""
    _, few = corrected(scene)
    monkeypatch.setattr("dap3d_core.simulation.initial.least_change.DENSE_ROWS", 0)
    monkeypatch.setattr("dap3d_core.simulation.redundancy.redundancy.FEW_ROWS", 0)
    evaluator, many = corrected(scene)
    metric = evaluator.system.metric.copy()
    assert many.passes == few.passes > 0
    assert many.u == pytest.approx(few.u, abs=1e-10)
    assert max(many.residual) < 1e-9
    dap.compile(scene).redundancy()
    assert np.array_equal(evaluator.system.metric, metric)  # masses are those of the model again


def test_trees_of_many_rows_are_corrected_by_blocks(monkeypatch):
    """A dense matrix of a row for each row would cost more than the run."""

    def dense(*_, **__):
        raise AssertionError("a dense least change")

    monkeypatch.setattr(np.linalg, "lstsq", dense)
    _, found = corrected(bent_chain(12))
    assert found.passes > 0
    assert max(found.residual) < 1e-9


def test_contradictory_joints_of_many_rows_are_named(many_rows):
    """The row left out as dependent keeps its gap, and is named; no NaN comes of it."""
    with pytest.raises(dap.AssemblyError, match=r"second +sph +2  1\n"):
        dap.simulate(torn(), t_end=1.0)


# ------------------------------------------------------------------ redundancy

REDUNDANT = [
    (door(), 15, 5, 2, ("lower", "upper")),
    (planar_four_bar(), 20, 3, 1, ("J1", "J2", "J3", "J4")),
    (two_motors(), 7, 1, 0, ("slow", "fast")),
    (dap.load("fourbar3"), 17, 0, 1, ()),
    (dap.load("pen1"), 3, 0, 3, ()),
    (dap.load("bodies2"), 0, 0, 12, ()),
]


@pytest.mark.parametrize("count", ["few", "many"])
@pytest.mark.parametrize(
    ("scene", "rows", "redundant", "dof", "joints"), REDUNDANT, ids=lambda s: getattr(s, "name", "")
)
def test_redundancy_is_counted_and_the_joints_named(
    scene, rows, redundant, dof, joints, count, request
):
    """Exact counts at the state as given: rows, rank, degrees of freedom, joints that share one.
    By parts, where there are many rows, the same."""
    if count == "many":
        request.getfixturevalue("many_rows")
    found = dap.compile(scene).redundancy()
    assert (found.rank.rows, found.rank.redundant, found.rank.dof) == (rows, redundant, dof)
    assert found.joints == joints
    verb = "is" if redundant == 1 else "are"
    words = f"{redundant} of {rows} constraint rows {verb} redundant"
    assert (words if redundant else "independent") in found.describe()


@pytest.mark.parametrize("shift", [0.0, 0.02])
@pytest.mark.parametrize("rows", ["few", "many"])
def test_a_redundant_scene_is_refused_with_the_joints(shift, rows, request):
    """The standard method cannot solve it; nothing is computed, also where the start had to be
    corrected first."""
    if rows == "many":
        request.getfixturevalue("many_rows")
    with pytest.raises(dap.RedundantError, match=r"5 of 15 .* upper.*independent rows") as caught:
        dap.simulate(door(shift), t_end=1.0, method="standard")
    assert isinstance(caught.value, dap.SimulationError)
    assert caught.value.result is None
    with pytest.raises(dap.RedundantError, match=r"3 of 20 .* J4.*independent rows"):
        dap.simulate(planar_four_bar(shift), t_end=1.0, method="standard")
