"""From a checked scene to arrays, groups and pointers; no names are looked up after that."""

import numpy as np
import pytest
from support.internals import join, rotation, split, to_body, to_global, u_from_y, y_from_u
from support.own_types import registry_of

import dap3d_core as dap
from dap3d_core.interface import Body, Force, Joint, Vector, body, number, vector
from dap3d_core.kernels import row
from dap3d_core.model import build_model
from dap3d_core.scene import AnimationPoint, check

ZERO = (0.0, 0.0, 0.0)


def scene():
    """Three bodies with all kinds of elements; two types of joints that alternate."""
    s = dap.Scene(name="model")
    s.add_body("a", mass=2.0, Jp=(1.0, 2.0, 2.5), r=(1, 2, 3), r_dot=(4, 5, 6), w=(7, 8, 9))
    s.add_body("b", mass=3.0, Jp=(1, 1, 1), r=(-1, -2, -3), p=(0.6, 0.0, 0.8, 0.0))
    s.add_body("c", mass=4.0, Jp=((3.0, 0.1, 0.2), (0.1, 2.5, 0.3), (0.2, 0.3, 2.0)))
    s.add_point("A", "a", (0.1, 0.2, 0.3))
    s.add_point("B", "b", (0.4, 0.5, 0.6))
    s.add_point("G", "ground", (0.7, 0.8, 0.9))
    s.add_function("a", "still", coeff=(1, 0, 0))
    s.add_function("a", "motor", coeff=(0, 2, 0))
    s.add_joint("sph", "J1", P_i="A", P_j="B")
    s.add_joint("rev", "J2", P_i="B", P_j="G", a_i="b.x", a_j="ground.x")
    s.add_joint("rel-rot", "J3", body_i="b", body_j="a", a_j="a.z", function="motor")
    s.add_joint("sph", "J4", P_i="c.O", P_j="A")
    s.add_joint("rel-rot", "J5", body_i="c", a_j="ground.z")
    s.add_force("weight", "gravity")
    s.add_force("ptp", "spring", P_i="A", P_j="c.O", k=5.0)
    s.add_force("weight", "wind", gravity=1.0, wgt=(1, 0, 0))
    s.animation.points.append(AnimationPoint("c", (1.0, 0.0, 0.0)))
    s.animation.points.append(AnimationPoint("ground", (2.0, 0.0, 0.0)))
    return s


@pytest.fixture(scope="module")
def model():
    return build_model(check(scene(), dap.load_registry()))


def test_pointers_of_bodies_are_those_of_the_manual(model):
    """irc, iru, irv: 7 coordinates and 6 velocities a body, coordinates of all bodies first."""
    assert model.body_names == ("a", "b", "c")
    assert model.irc.tolist() == [0, 7, 14]
    assert model.irv.tolist() == [0, 6, 12]
    assert model.iru.tolist() == [21, 27, 33]


def test_the_given_state_stands_in_the_order_of_the_manual(model):
    """u0 is r, p of all bodies, then r_dot, w; exact, for unit Euler parameters were given."""
    u = model.u0
    assert u.shape == (39,)
    for n, values in enumerate([(1, 2, 3, 1, 0, 0, 0), (-1, -2, -3, 0.6, 0, 0.8, 0)]):
        assert u[model.irc[n] : model.irc[n] + 7].tolist() == pytest.approx(values, abs=1e-16)
    assert u[model.iru[0] : model.iru[0] + 6].tolist() == [4, 5, 6, 7, 8, 9]
    assert not u[model.iru[1] :].any()


def test_rows_of_joints_follow_in_file_order(model):
    """joint_start counts 3, 5, 1, 3, 1 rows; each row has its owner, and rel-rot no position."""
    assert model.joint_names == ("J1", "J2", "J3", "J4", "J5")
    assert model.joint_rows.tolist() == [3, 5, 1, 3, 1]
    assert model.joint_start.tolist() == [0, 3, 8, 9, 12, 13]
    assert model.row_count == 13
    owners = [model.row_owner(k) for k in range(13)]
    assert owners == ["J1"] * 3 + ["J2"] * 5 + ["J3"] + ["J4"] * 3 + ["J5"]
    assert model.position_row.tolist() == [True] * 8 + [False] + [True] * 3 + [False]
    assert model.joint_slots == ((1, 2), (2, 0), (2, 1), (3, 1), (3, 0))


def test_instances_of_a_type_stand_together(model):
    """Groups in the order in which types first appear, with the bodies and numbers of each."""
    assert [g.keyword for g in model.joints] == ["sph", "rev", "rel-rot"]
    sph, rev, rel = model.joints
    assert sph.members.tolist() == [0, 3]
    assert sph.bodies.tolist() == [[1, 2], [3, 1]]
    assert sph.count == 2
    offset, shape = sph.type_info.layout.numbers["P_j"]
    assert shape == (3,)
    assert sph.numbers[:, offset : offset + 3].tolist() == [[0.4, 0.5, 0.6], [0.1, 0.2, 0.3]]
    assert rel.members.tolist() == [2, 4]
    assert rel.functions.tolist() == [[2], [0]]  # motor is the second; absent is row 0
    assert {"n_j", "m_j"} <= set(rev.type_info.layout.numbers)  # what prepare returned
    assert model.function_names == ("still", "motor")
    assert model.function_count == 2
    (functions,) = model.functions
    assert functions.members.tolist() == [1]  # still is used by nothing, so it is not evaluated
    assert functions.bodies.shape == (1, 0)


def test_an_element_on_each_body_is_there_once_for_each(model):
    """Two weights on three bodies: six instances of two elements, each with its numbers."""
    assert model.force_names == ("gravity", "spring", "wind")
    weight, spring = model.forces
    assert weight.members.tolist() == [0, 0, 0, 2, 2, 2]
    assert weight.bodies.tolist() == [[1], [2], [3], [1], [2], [3]]
    column = weight.type_info.layout.numbers["gravity"][0]
    assert weight.numbers[:, column].tolist() == [9.81] * 3 + [1.0] * 3
    assert spring.members.tolist() == [1]
    assert spring.bodies.tolist() == [[1, 3]]


def test_points_keep_their_order_and_animation_points_come_last(model):
    """Declared points in file order, then those of the animation, each with body and place."""
    assert model.point_names == ("A", "B", "G", "animation.1", "animation.2")
    assert model.point_body.tolist() == [1, 2, 0, 3, 0]
    assert model.point_local[2:].tolist() == [[0.7, 0.8, 0.9], [1, 0, 0], [2, 0, 0]]


def test_masses_and_inertias(model):
    """A list of three is the diagonal; a full matrix stays as it is."""
    assert model.mass.tolist() == [2.0, 3.0, 4.0]
    assert np.array_equal(model.Jp[0], np.diag([1.0, 2.0, 2.5]))
    assert model.Jp[2, 0].tolist() == [3.0, 0.1, 0.2]


def test_a_scene_without_elements_has_empty_groups():
    """Nothing is allocated for what is not there."""
    s = dap.Scene(name="bare")
    s.add_body("a", mass=1.0, Jp=(1, 1, 1))
    model = build_model(check(s, dap.load_registry()))
    assert model.joints == model.forces == model.functions == ()
    assert model.row_count == model.function_count == 0
    assert model.joint_start.tolist() == [0]
    assert model.position_row.shape == (0,)


class Fussy(Force):
    """Its constants depend on a number of the scene; some it cannot have."""

    keyword = "fussy"
    body_i: Body = body()
    a_i: Vector = vector(default="a.x")
    k: float = number(default=1.0)
    l0: float = number(default=None)

    def prepare(self, bodies):
        if self.k < 0.0:
            raise ValueError(f"k = {self.k:g} is below zero, take a positive one")
        if self.k > 1e90:
            return {"c": self.k * self.k * self.k * self.k, "l0": 1.0}
        if self.k == 0.25:
            return {"l0": 1.0}
        if self.k == 0.125:
            return {"c": (1.0, 2.0), "l0": 1.0}
        if self.k == 0.0625:
            raise LookupError("no table for it")
        return {"c": bodies["i"].r[0], "l0": 1.0 if self.l0 is None else self.l0}

    def wrench(c, l0, a_i):
        return a_i, (c, l0, 0.0)


class Bare(Force):
    """No constants; a number and a vector that the scene may leave out, and must not."""

    keyword = "bare"
    body_i: Body = body()
    a_i: Vector = vector(default=None)
    k: float = number(default=None)

    def wrench(a_i, k):
        return a_i, (k, 0.0, 0.0)


class Fixed(Joint):
    """A joint whose prepare refuses its body's place."""

    keyword, rows = "fixed", 1
    body_i: Body = body()

    def prepare(self, bodies):
        if bodies["i"].r[2] == 3.0:
            raise ValueError("body i stands too high")
        return {"start": bodies["i"].r[2]}

    def C(r_i, start):
        return r_i[2] - start

    def J():
        return row((0.0, 0.0, 1.0), ZERO)

    def gamma(t):
        return 0.0


REGISTRY = registry_of(Fussy, Bare, Fixed)
TEXT = """\
[bodies.a]
mass = 1.0
Jp = [1.0, 1.0, 1.0]
r = [1.0, 2.0, 3.0]

[forces.first]
type = "fussy"
body_i = "a"

[{table}.second]
type = "{keyword}"
body_i = "a"
{more}
"""


@pytest.mark.parametrize(
    ("table", "keyword", "more", "words"),
    [
        ("forces", "fussy", "k = -1.0", ["k = -1 is below zero, take a positive one"]),
        ("forces", "fussy", "k = 1e99", ["c comes out as inf", "not finite"]),
        ("forces", "fussy", "k = 0.25", ["c is not among what prepare returned"]),
        ("forces", "fussy", "k = 0.125", ["c of shape (2,)", "names and shapes must stay"]),
        ("forces", "bare", "k = 1.0", ["a_i is missing"]),
        ("forces", "bare", 'a_i = "a.x"', ["k is missing"]),
        ("joints", "fixed", "", ["body i stands too high"]),
    ],
)
def test_what_a_type_refuses_is_a_mistake_at_its_element(tmp_path, table, keyword, more, words):
    """A SceneError with file, line of the element and the type's own words; never a NaN inside."""
    (tmp_path / "scene.toml").write_text(TEXT.format(table=table, keyword=keyword, more=more))
    with pytest.raises(dap.SceneError) as caught:
        dap.compile(dap.load(tmp_path), registry=REGISTRY)
    (mistake,) = caught.value.mistakes
    assert mistake.key == f"{table}.second"
    assert (mistake.file, mistake.line) == (str(tmp_path / "scene.toml"), 10)
    for word in words:
        assert word in mistake.what


def test_a_prepare_that_fails_is_the_plugins_fault(tmp_path):
    """Any other exception is a PluginError that names file, class and exception."""
    (tmp_path / "scene.toml").write_text(
        TEXT.format(table="forces", keyword="fussy", more="k = 0.0625")
    )
    with pytest.raises(dap.PluginError, match=r"Fussy.prepare failed: LookupError.*no table"):
        dap.compile(dap.load(tmp_path), registry=REGISTRY)


def test_a_number_left_out_is_found_by_prepare_or_kept_where_given():
    """l0 is 1 where left out, what the scene says where given."""
    s = dap.Scene(name="left out")
    s.add_body("a", mass=1.0, Jp=(1, 1, 1))
    s.add_force("fussy", body_i="a")
    s.add_force("fussy", body_i="a", l0=7.0, k=2.0)
    (group,) = build_model(check(s, REGISTRY)).forces
    assert group.numbers[:, group.type_info.layout.numbers["l0"][0]].tolist() == [1.0, 7.0]


RNG = np.random.default_rng(3)
MANY = RNG.normal(size=(5, 4, 4)), RNG.normal(size=(5, 4, 3))


def test_rotation_matrices_are_right_handed_and_turn_about_their_axis():
    """A^T A = 1, det A = 1, and A turns by phi about the axis for p = (cos, sin) of phi / 2 (spec
    1), whatever the length of p; to rounding."""
    p, a = MANY
    A = rotation(p)
    assert np.allclose(A @ np.swapaxes(A, -1, -2), np.eye(3), atol=1e-14)
    assert np.allclose(np.linalg.det(A), 1.0, atol=1e-14)
    assert np.allclose(rotation(3.0 * p), A, atol=1e-15)
    phi = 0.7
    turned = to_global([5 * np.cos(phi / 2), 0, 0, 5 * np.sin(phi / 2)], [2.0, 0.0, 1.0])
    assert turned == pytest.approx([2 * np.cos(phi), 2 * np.sin(phi), 1.0], abs=1e-15)
    assert np.allclose(to_body(p, to_global(p, a)), a, atol=1e-14)
    assert np.array_equal(to_global(p, a)[2, 3], to_global(p[2, 3], a[2, 3]))  # the same bits


def test_states_are_split_and_joined_without_loss():
    """join(split(u)) is u bit for bit, for one state and for many; split gives views."""
    u = RNG.normal(size=(6, 39))
    assert np.array_equal(join(*split(u)), u)
    assert np.array_equal(join(*split(u[0])), u[0])
    split(u)[3][2, 1] = 5.0
    assert u[2, 21 + 6 + 3 : 21 + 12].tolist() == [5.0] * 3


def test_the_integrated_state_has_body_components_and_work():
    """y is u with w' = A^T w and the work last; back again to rounding of two rotations."""
    u = RNG.normal(size=(6, 26))
    y = y_from_u(u, work=2.5)
    assert y.shape == (6, 27)
    assert np.array_equal(y[:, -1], np.full(6, 2.5))
    _, p, _, w = split(u)
    assert np.allclose(split(y)[3], np.einsum("...rc,...r->...c", rotation(p), w), atol=1e-14)
    assert np.allclose(u_from_y(y), u, atol=1e-14)
