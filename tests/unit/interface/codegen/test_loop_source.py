"""Every name that a kernel may ask for holds what it says, computed by the written loops.
Types made for these tests return the named quantities as forces and moments, eighteen numbers from
three bodies; numpy computes them anew from the state. Tolerance: two rotations and some sums, 1e-13
of numbers of order one."""

import numpy as np
import pytest
from support.internals import ENERGY, VALUE, WRENCH, call_kinds, place_bodies, split
from support.motions import Motion
from support.own_types import registry_of

import dap3d_core as dap
from dap3d_core.interface import (
    Body,
    Force,
    Function,
    Joint,
    Point,
    Vector,
    Vector2,
    body,
    choice,
    function,
    matrix,
    number,
    point,
    vec3,
    vector,
    vector2,
)
from dap3d_core.kernels import row

ZERO = (0.0, 0.0, 0.0)
CLOSE = {"rtol": 1e-13, "atol": 1e-13}


class Named(Force):
    """Three bodies and a field of every kind."""

    d: Vector2 = vector2()
    Q_k: Point = point()
    a_j: Vector = vector()
    body_k: Body = body()
    c: float = number()
    e: tuple = vec3()
    M: tuple = matrix()
    word: str = choice(["low", "high"], default="high")
    g: str = function()
    function: str = function()

    def prepare(self, bodies):
        n = bodies["k"].to_local(bodies["j"].to_global(self.a_j))
        middle = [0.5 * (a + b) for a, b in zip(bodies["i"].r, bodies["k"].r, strict=True)]
        return {
            "n_k": n,
            "scalar": np.float64(2.5),
            "five": [1, 2.0, 3, 4, 5],
            "table": ((1.0, 2.0, 3.0, 4.0), (5.0, 6.0, 7.0, 8.0)),
            "R": np.arange(9.0).reshape(3, 3) + self.c,
            "deep": (
                ((1.0, 2.0), (3.0, 4.0)),
                ((5.0, 6.0), (7.0, 8.0)),
                ((9.0, 10.0), (11.0, 12.0)),
            ),
            "middle": middle,
        }


class Points(Named):
    keyword = "points"

    def wrench(s_P_i, r_P_i, s_P_j, r_P_j, s_Q_k, r_Q_k):
        return (s_P_i, r_P_i), (s_P_j, r_P_j), (s_Q_k, r_Q_k)


class Vectors(Named):
    keyword = "vectors"

    def wrench(d, a_j, n_k, middle, r_i, r_j):
        return (d, a_j), (n_k, middle), (r_i, r_j)


class Bodies(Named):
    keyword = "bodies"

    def wrench(A_i, p_j, mass_k, Jp_k, t, r_k):
        return (A_i[0], A_i[2]), (p_j[1:], (p_j[0], mass_k, t)), (Jp_k[1], r_k)


class Constants(Named):
    keyword = "constants"

    def wrench(c, e, M, scalar, five, table, R, deep):
        a, b = (scalar, five[0], five[4]), (table[0][3], table[1][0], deep[2][0][1])
        return (e, M[0]), (M[1], M[2]), (a, (b[0] + c, b[1] + R[2][0], b[2] + R[1][2]))


class Rates(Named):
    keyword = "rates"

    def wrench(s_P_i_dot, v_P_i, v_P_j, d_dot, a_j_dot, n_k_dot):
        return (s_P_i_dot, v_P_i), (v_P_j, d_dot), (a_j_dot, n_k_dot)


class Velocities(Named):
    keyword = "velocities"

    def wrench(v_i, w_i, v_j, w_k, s_Q_k_dot, v_Q_k):
        return (v_i, w_i), (v_j, w_k), (s_Q_k_dot, v_Q_k)


class Functions(Named):
    keyword = "functions"

    def wrench(f, f_dot, f_ddot, g, g_dot, g_ddot):
        return ((f, f_dot, f_ddot), (g, g_dot, g_ddot)), (ZERO, ZERO), (ZERO, ZERO)


class Cubic(Function):
    keyword = "cubic"
    scale: float = number(default=1.0)

    def prepare(self, bodies):
        return {"twice": 2.0 * self.scale}

    def value(x, scale, twice):
        return scale * x**3, 3.0 * scale * x * x, 3.0 * twice * x, 3.0 * twice


class Pull(Force):
    """On each body by itself, with a constant that differs from body to body."""

    keyword, each_body = "pull", True
    k: float = number(default=3.0)

    def prepare(self, bodies):
        return {"start": bodies["i"].r}

    def wrench(mass_i, k, start, w_i):
        return (k * mass_i * start[0], start[1], start[2]), w_i

    def energy(r_i, k):
        return k * r_i[2]


TYPES = (Points, Vectors, Bodies, Constants, Rates, Velocities, Functions)
REGISTRY = registry_of(*TYPES, Cubic, Pull)
SPOTS = {"P_i": (0.3, -0.2, 0.5), "P_j": (-0.4, 0.1, 0.6), "Q_k": (0.7, 0.8, -0.9)}
AXIS, OFFSET, TURN = (
    (0.6, 0.0, -0.8),
    (1.5, -2.5, 3.5),
    ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
)


def inertia(rng):
    """A full inertia matrix, of three unequal moments that fulfil the triangle rule."""
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return turn @ np.diag([1.0, 1.3, 1.6]) @ turn.T


def scene_of(*keywords, k="three", t_shift=0.0):
    """Three bodies as the motion has them at the start, and an element of each keyword twice."""
    rng = np.random.default_rng(5)
    r, p, _, _ = split(MOTION.u(t_shift))
    scene = dap.Scene(name="names")
    for n, name in enumerate(("one", "two", "three")):
        scene.add_body(name, mass=1.0 + n, Jp=inertia(rng), r=r[n], p=p[n])
    scene.add_vector("axis", "two", AXIS)
    for spot, where in SPOTS.items():
        scene.add_point(spot, {"i": "one", "j": "two", "k": k}[spot[-1]], where)
    scene.add_function("a", "unused", coeff=(9.0, 9.0, 9.0))
    scene.add_function("cubic", "cube", scale=0.5)
    scene.add_function("a", "line", coeff=(1.0, 2.0, 3.0))
    fields = dict(P_i="P_i", P_j="P_j", Q_k="Q_k", a_j="axis", body_k=k, e=OFFSET, M=TURN)
    for keyword in keywords:
        for c in (4.0, 5.0):
            scene.add_force(keyword, c=c, function="line", g="cube", **fields)
    return scene


MOTION = Motion(3, np.random.default_rng(11))


def wrenches(scene, t, u):
    """(3, 6) sums of forces and moments that the loops of a scene store at a state."""
    evaluator = dap.compile(scene, registry=REGISTRY).evaluator
    s = evaluator.system
    place_bodies(evaluator.integrated(u), s.body, s.metric)
    s.force[:] = 0.0
    for kind in (VALUE, WRENCH):
        call_kinds(kind, kind, t, s, evaluator.loops, s.force, s.force, s.force)
    assert np.array_equal(s.force[:6], np.zeros(6)) or scene.points["Q_k"].body == "ground"
    return s.force[6:].reshape(3, 6), evaluator


class Truth:
    """The quantities at a state, by numpy and the definition of rotation matrices, A = G L^T."""

    def __init__(self, u):
        r, p, v, w = split(u)
        self.r, self.p, self.v, self.w = (dict(zip("ijk", x, strict=True)) for x in (r, p, v, w))
        self.A = {s: attitude(q) for s, q in self.p.items()}
        self.s = {spot: self.A[spot[-1]] @ np.array(x) for spot, x in SPOTS.items()}
        self.a_j = self.A["j"] @ np.array(AXIS)

    def place(self, spot):
        return self.r[spot[-1]] + self.s[spot]

    def arm_rate(self, spot):
        return np.cross(self.w[spot[-1]], self.s[spot])

    def speed(self, spot):
        return self.v[spot[-1]] + self.arm_rate(spot)


def attitude(p):
    """A = G L^T of Euler parameters."""
    e0, e = p[0], p[1:]
    tilde = np.array([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])
    G = np.column_stack([-e, tilde + e0 * np.eye(3)])
    L = np.column_stack([-e, -tilde + e0 * np.eye(3)])
    return G @ L.T


T = 0.3
U = MOTION.u(T)
NOW, START = Truth(U), Truth(MOTION.u(0.0))
N_K = NOW.A["k"] @ START.A["k"].T @ START.a_j
LINE, CUBE = (1 + 2 * T + 3 * T * T, 2 + 6 * T, 6.0), (0.5 * T**3, 1.5 * T * T, 3 * T)
R = np.arange(9.0).reshape(3, 3)
JP = {s: inertia(rng) for rng in [np.random.default_rng(5)] for s in "ijk"}

#: What each type returns, twice: c is 4 in one element and 5 in the other.
EXPECTED = {
    "points": [2 * x for q in SPOTS for x in (NOW.s[q], NOW.place(q))],
    "vectors": [
        2 * (NOW.place("P_j") - NOW.place("P_i")),
        2 * NOW.a_j,
        2 * N_K,
        START.r["i"] + START.r["k"],
        2 * NOW.r["i"],
        2 * NOW.r["j"],
    ],
    "bodies": [
        2 * NOW.A["i"][0],
        2 * NOW.A["i"][2],
        2 * NOW.p["j"][1:],
        [2 * NOW.p["j"][0], 2 * 3.0, 2 * T],
        2 * JP["k"][1],
        2 * NOW.r["k"],
    ],
    "constants": [
        2 * np.array(OFFSET),
        *(2 * np.array(TURN)),
        [5.0, 2.0, 10.0],
        [2 * 4.0 + 9.0, 2 * (5.0 + R[2, 0]) + 9.0, 2 * (10.0 + R[1, 2]) + 9.0],
    ],
    "rates": [
        2 * NOW.arm_rate("P_i"),
        2 * NOW.speed("P_i"),
        2 * NOW.speed("P_j"),
        2 * (NOW.speed("P_j") - NOW.speed("P_i")),
        2 * np.cross(NOW.w["j"], NOW.a_j),
        2 * np.cross(NOW.w["k"], N_K),
    ],
    "velocities": [
        2 * NOW.v["i"],
        2 * NOW.w["i"],
        2 * NOW.v["j"],
        2 * NOW.w["k"],
        2 * NOW.arm_rate("Q_k"),
        2 * NOW.speed("Q_k"),
    ],
    "functions": [2 * np.array(LINE), 2 * np.array(CUBE), *np.zeros((4, 3))],
}


@pytest.mark.parametrize("keyword", EXPECTED)
def test_named_quantities_are_those_of_an_independent_computation(keyword):
    """Each name holds what the manual means by it, at a state taken at random."""
    found, _ = wrenches(scene_of(keyword), T, U)
    assert np.allclose(found.reshape(6, 3), EXPECTED[keyword], **CLOSE)


def test_elements_of_several_types_add_up():
    """All types in one scene: their numbers stand side by side and do not mix."""
    found, _ = wrenches(scene_of(*EXPECTED), T, U)
    assert np.allclose(found.reshape(6, 3), sum(map(np.array, EXPECTED.values())), **CLOSE)


def test_ground_has_the_identity_pose_and_no_velocity():
    """With slot k on ground the arm is the point itself and its velocity zero; ground's forces are
    kept apart."""
    scene = scene_of("points", "velocities", k="ground")
    _, evaluator = wrenches(scene, T, U)
    on_ground = evaluator.system.force[:6]
    assert np.allclose(on_ground[:3], 2 * np.array(SPOTS["Q_k"]), **CLOSE)
    assert np.allclose(on_ground[3:], 2 * np.array(SPOTS["Q_k"]), **CLOSE)


def test_an_element_on_each_body_has_its_own_constants():
    """``each_body``: wrench and energy for each body in turn, with what ``prepare`` found there."""
    scene = scene_of()
    scene.add_force("pull", k=2.0)
    found, evaluator = wrenches(scene, T, U)
    r = np.array(list(START.r.values()))
    wanted = np.column_stack([2.0 * np.array([1.0, 2.0, 3.0]) * r[:, 0], r[:, 1:]])
    assert np.allclose(found[:, :3], wanted, **CLOSE)
    assert np.allclose(found[:, 3:], list(NOW.w.values()), **CLOSE)
    s, energy = evaluator.system, np.zeros(1)
    call_kinds(ENERGY, ENERGY, T, s, evaluator.loops, energy, energy, energy)
    assert energy[0] == pytest.approx(2.0 * sum(x[2] for x in NOW.r.values()), rel=1e-13)


def test_functions_stand_in_their_rows():
    """F has a row for each function in file order, after that of the absent one; what no element
    uses is not evaluated and stays zero; the columns are f, f', f'', f''', and f at t = 0."""
    _, evaluator = wrenches(scene_of("functions"), T, U)
    wanted = [np.zeros(4), np.zeros(4), [*CUBE, 3.0], [*LINE, 0.0]]
    assert np.allclose(evaluator.system.F[:, :4], wanted, **CLOSE)
    assert np.allclose(evaluator.system.F[:, 4], machine_at_zero(), **CLOSE)


def machine_at_zero():
    """f(0) of the absent function and of the three of the scene."""
    _, evaluator = wrenches(scene_of("functions"), 0.0, U)
    return evaluator.system.F[:, 0]


# ------------------------------------------------------------------ rows of joints


class Lift(Joint):
    """Three bodies, three rows of which the second is of the velocity level, and a driver."""

    keyword, rows, holonomic = "lift", 3, (True, False, True)
    P_i: Point = point()
    body_j: Body = body()
    P_k: Point = point()
    function: str = function()

    def C(r_P_i, r_j, r_P_k, f):
        return r_P_i[2] - f, r_j[2] + r_P_k[2]

    def J(s_P_i, s_P_k):
        up, nothing = (0.0, 0.0, 1.0), row(ZERO, ZERO)
        i, k = row(up, (s_P_i[1], -s_P_i[0], 0.0)), row(up, (s_P_k[1], -s_P_k[0], 0.0))
        return (i, row(up, ZERO), nothing), (nothing, row(ZERO, up), row(up, ZERO)), (i, k, k)

    def gamma(w_i, w_j, v_P_k):
        return w_i[0], w_j[1], v_P_k[2]

    def nu(f_dot, t):
        return f_dot, 7.0, t


def test_rows_of_a_joint_stand_in_their_places():
    """C, J, gamma and nu of two joints of three bodies, the last row of C after the masked one, and
    ground's block left out (exact sums of numbers that the tests above have checked)."""
    scene = scene_of()
    scene.add_point("P_g", "ground", (0.1, 0.2, 0.3))
    fields = {"P_i": "P_i", "body_j": "two", "function": "line"}
    scene.add_joint("lift", "first", **fields, P_k="Q_k")
    scene.add_joint("lift", "second", **fields, P_k="P_g")
    evaluator = dap.compile(scene, registry=registry_of(Lift, Cubic)).evaluator
    rows, D = evaluator.rows(T, U), evaluator.rows(T, U).dense()
    height, speed = NOW.place("Q_k")[2], NOW.speed("Q_k")[2]
    first = [NOW.place("P_i")[2] - LINE[0], 0.0, NOW.r["j"][2] + height]
    assert np.allclose(rows.C, [*first, *first[:2], NOW.r["j"][2] + 0.3], **CLOSE)
    assert np.allclose(rows.nu, [LINE[1], 7.0, T] * 2, **CLOSE)
    shared = [NOW.w["i"][0], NOW.w["j"][1]]
    assert np.allclose(rows.gamma, [*shared, speed, *shared, 0.0], **CLOSE)
    i = [0, 0, 1, NOW.s["P_i"][1], -NOW.s["P_i"][0], 0]
    k = [0, 0, 1, NOW.s["Q_k"][1], -NOW.s["Q_k"][0], 0]
    up, turn, none = [0, 0, 1, 0, 0, 0], [0, 0, 0, 0, 0, 1], [0] * 6
    assert np.allclose(D[:3], [i + none + i, up + turn + k, none + up + k], **CLOSE)
    assert np.allclose(D[3:], [i + none + none, up + turn + none, none + up + none], **CLOSE)
    assert np.array_equal(evaluator.rows(T, U).sparse().toarray(), D)
