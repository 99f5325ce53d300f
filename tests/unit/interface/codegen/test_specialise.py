"""What types may do beyond named numbers: variants, functions of an argument, tables, angles."""

import math
import random
import warnings

import numpy as np
import pytest
import sympy
from support.internals import ANGLE, call_kinds
from support.own_types import registry_of
from support.plain import jit_is_on

import dap3d_core as dap
from dap3d_core.interface import (
    REQUIRED,
    Body,
    Force,
    Function,
    Joint,
    PluginError,
    Point,
    Vector,
    angle,
    body,
    choice,
    examine,
    function,
    number,
    point,
    table,
    vector,
)
from dap3d_core.kernels import dot, lookup, neg, row, scale, sqrt

ZERO = (0.0, 0.0, 0.0)

X = sympy.Symbol("x")
SWING = 0.3 + 2 * sympy.sin(3 * X + sympy.Rational(1, 4))
RAMP = 1 + 2 * X + X**2 / 2
FAST = sympy.sin(7 * X) / 2


class Pull(Force):
    """A spring from P_i to the origin, linear or by a function of the distance."""

    keyword = "pull"
    P_i: Point = point()
    k: float = number(default=1.0)
    function: str = function(argument="distance, m")

    def wrench(r_P_i, k):
        return scale(-k, r_P_i), ZERO

    def energy(r_P_i, k):
        return 0.5 * k * dot(r_P_i, r_P_i)


class PullByFunction(Pull, function=True):
    """The same by a function, called twice to see that it can be."""

    energy = None

    def wrench(r_P_i, k, f, f_dot):
        x = sqrt(dot(r_P_i, r_P_i))
        F = f(x) + 0.0 * f_dot(f(x))
        return scale(-F / x, r_P_i), (f_dot(x), 0.0, 0.0)


class Keep(Joint):
    """Keeps coordinates of the mass centre: which ones is a choice."""

    keyword = "keep"
    body_i: Body = body()
    what: str = choice(("x", "xy"), default="x", aliases={"yx": "xy"})


class KeepX(Keep, what="x"):
    """One row."""

    rows = 1

    def C(r_i):
        return r_i[0]

    def J():
        return row((1.0, 0.0, 0.0), ZERO)

    def gamma():
        return 0.0


class KeepXY(Keep, what="xy"):
    """Two rows."""

    rows = 2

    def C(r_i):
        return r_i[0], r_i[1]

    def J():
        return row((1.0, 0.0, 0.0), ZERO), row((0.0, 1.0, 0.0), ZERO)

    def gamma():
        return 0.0, 0.0


class Stairs(Function):
    """Piecewise constant; its table is made by prepare, and read by lookup."""

    keyword = "stairs"
    x: tuple = table(doc="where each step begins")
    y: tuple = table(doc="height of each step")
    steps: tuple = table(columns=2, given=False)

    def prepare(self, bodies):
        if max(self.y) > 100.0:
            warnings.warn("steep stairs", stacklevel=1)
        return {"steps": list(zip(self.x, self.y, strict=True))}

    def value(x, steps):
        begin, height = lookup(steps, x)
        return height, 0.0, 0.0, begin


class Twist(Force):
    """A torsion spring about an axis on either body."""

    keyword = "twist"
    u_i: Vector = vector()
    u_j: Vector = vector()
    axis: Vector = vector()
    k: float = number()
    theta: float = angle("u_i", "u_j", "axis")

    def wrench(axis, k, theta, theta_dot):
        T = k * theta + 0.0 * theta_dot
        return (ZERO, scale(T, axis)), (ZERO, scale(-T, axis))


class Level(Joint):
    """Holds a point at a height above ground along a vector of ground."""

    keyword, rows = "level", 1
    P_i: Point = point()
    a_j: Vector = vector(ground=True)

    def C(r_P_i, a_j):
        return dot(r_P_i, a_j)

    def J(s_P_i, a_j):
        return row(a_j, neg((a_j[1] * s_P_i[2] - a_j[2] * s_P_i[1],
                             a_j[2] * s_P_i[0] - a_j[0] * s_P_i[2],
                             a_j[0] * s_P_i[1] - a_j[1] * s_P_i[0])))  # fmt: skip

    def gamma():
        return 0.0


REGISTRY = registry_of(Pull, Keep, Stairs, Twist, Level)


def scene_of(**body_fields):
    scene = dap.Scene(name="variants")
    scene.add_body("ball", **({"mass": 2.0, "r": (3.0, 0.0, 4.0)} | body_fields))
    return scene


def accelerations(scene, u=None):
    evaluator = dap.compile(scene, registry=REGISTRY).evaluator
    u = evaluator.model.u0 if u is None else u
    return evaluator, evaluator.report(0.0, u)[: 6 * evaluator.model.body_count].reshape(-1, 6)


def test_a_function_of_an_argument_is_called_with_it():
    """f = 1 + 2 x + 3 x^2 at the distance 5 m, and its derivative 2 + 6 x, closed form."""
    scene = scene_of()
    scene.add_function("a", "law", coeff=(1.0, 2.0, 3.0))
    scene.add_force("pull", P_i="ball.O", function="law")
    scene.add_force("pull", P_i="ball.O", k=7.0)
    _, a = accelerations(scene)
    by_law, linear = 1.0 + 10.0 + 75.0, 7.0 * 5.0
    assert a[0, :3] == pytest.approx(np.array([-0.6, 0.0, -0.8]) * (by_law + linear) / 2.0)
    assert a[0, 3] == pytest.approx(32.0)  # unit inertia


def test_each_type_of_function_gets_its_own_loop():
    """Springs by functions of two types are two groups, those without function a third."""
    scene = scene_of()
    scene.add_function("a", "law", coeff=(1.0, 0.0, 0.0))
    scene.add_function("harmonic", "wave", amplitude=1.0, frequency=1.0)
    scene.add_function("a", "other", coeff=(0.0, 1.0, 0.0))
    for name in ("law", "wave", "other", None):
        scene.add_force("pull", P_i="ball.O", **({"function": name} if name else {}))
    evaluator, a = accelerations(scene)
    assert [g.count for g in evaluator.model.forces] == [2, 1, 1]
    assert not evaluator.model.functions  # none of them is a function of time
    force = 1.0 + math.sin(5.0) + 5.0 + 5.0  # harmonic: amplitude sin(frequency x)
    assert a[0, :3] == pytest.approx(np.array([-0.6, 0.0, -0.8]) * force / 2.0)


def test_only_the_variant_for_the_word_is_used():
    """Rows and kernels are those of the variant; an alias means the same word."""
    for word, rows in (("x", 1), ("xy", 2), ("yx", 2)):
        scene = scene_of()
        scene.add_joint("keep", body_i="ball", what=word)
        model = dap.compile(scene, registry=REGISTRY, method="standard").model
        assert model.row_count == rows
    scene = scene_of()
    scene.add_joint("keep", body_i="ball", what="z")
    with pytest.raises(dap.SceneError, match='should be one of "x", "xy"'):
        dap.compile(scene, registry=REGISTRY)


def test_a_variant_is_for_a_word_that_its_type_knows():
    """A variant for a word that no choice can say could never be used."""

    class Lost(Keep, what="z"):
        """A variant for a word that the choice does not have."""

        rows = 1

    try:
        with pytest.raises(PluginError, match="Lost is the variant for what = 'z'"):
            examine(Keep)
    finally:
        Keep.variants = Keep.variants[:-1]


@pytest.mark.parametrize("x", [-1.0, 0.0, 0.5, 1.0, 2.9, 3.0, 9.0])
def test_lookup_finds_the_last_row_that_begins_before(x):
    """Against numpy's search; before the first row the first one."""
    scene = scene_of()
    begin, height = (0.0, 1.0, 3.0, 3.5), (5.0, 6.0, 7.0, 8.0)
    scene.add_function("stairs", "stairs", x=begin, y=height)
    scene.add_function("stairs", "more", x=begin[:2], y=height[:2])
    for name in ("stairs", "more"):
        scene.add_joint("rel-rot", body_i="ball", a_j="ground.z", function=name)
    evaluator = dap.compile(scene, registry=REGISTRY, method="standard").evaluator
    evaluator.rows(x, evaluator.model.u0)
    for count, F in zip((4, 2), evaluator.system.F[1:], strict=True):
        k = max(0, int(np.searchsorted(begin[:count], x, side="right")) - 1)
        assert F[:4].tolist() == [height[k], 0.0, 0.0, begin[k]]


def test_what_prepare_warns_about_is_a_note():
    """With the element's name, once."""
    scene = scene_of()
    scene.add_function("stairs", "high", x=(0.0, 1.0), y=(0.0, 200.0))
    scene.add_joint("rel-rot", body_i="ball", a_j="ground.z", function="high")
    notes = dap.compile(scene, registry=REGISTRY, method="standard").notes
    assert notes.count("function high (stairs): steep stairs") == 1


@pytest.mark.parametrize("owner", ["ball", "ground"])
def test_an_angle_is_unwound_by_the_last_accepted_one(owner):
    """From 170 degrees on to 190; the loop of accepted steps keeps it, whole turns included."""
    scene = scene_of()
    half = math.radians(170.0) / 2.0
    scene.bodies["ball"].p = (math.cos(half), 0.0, 0.0, math.sin(half))
    scene.add_force("twist", u_i="ball.x", u_j="ground.x", axis=f"{owner}.z", k=-3.0)
    evaluator, a = accelerations(scene)
    assert a[0, 5] == pytest.approx(3.0 * math.radians(170.0))  # theta is -170 degrees

    def turn_to(degrees):
        u = evaluator.model.u0.copy()
        half = math.radians(degrees) / 2.0
        u[3:7] = math.cos(half), 0.0, 0.0, math.sin(half)
        return evaluator.report(0.0, u)[5]

    def keep():
        s = evaluator.system
        call_kinds(ANGLE, ANGLE, 0.0, s, evaluator.loops, s.force, np.ones(1), s.force)

    for degrees in (170.0, 190.0, 350.0, 370.0, 530.0):
        assert turn_to(degrees) == pytest.approx(3.0 * math.radians(degrees))
        keep()
    assert turn_to(370.0) == pytest.approx(3.0 * math.radians(370.0))


def test_a_vector_of_no_slot_is_on_a_body_of_the_element():
    """One on a third body is refused by name."""
    scene = scene_of()
    scene.add_body("other")
    scene.add_force("twist", "T", u_i="ball.x", u_j="ground.x", axis="other.z", k=1.0)
    with pytest.raises(dap.SceneError, match="is on other; it is to be a vector of ball or ground"):
        dap.compile(scene, registry=REGISTRY)


def test_a_vector_of_ground_makes_no_slot():
    """One body, one block; a vector of a body is refused."""
    scene = scene_of()
    scene.add_joint("level", P_i="ball.O", a_j="ground.x")
    evaluator = dap.compile(scene, registry=REGISTRY, method="standard").evaluator
    assert evaluator.model.joint_slots == ((1,),)
    assert evaluator.rows(0.0, evaluator.model.u0).C.tolist() == [3.0]
    scene.joints.clear()
    scene.add_joint("level", P_i="ball.O", a_j="ball.x")
    with pytest.raises(dap.SceneError, match="is on ball; it is to be a vector of ground"):
        dap.compile(scene, registry=REGISTRY)


class Passes(Force):
    """Passes a function on, as any other value."""

    keyword = "passes"
    P_i: Point = point()
    function: str = function(argument="distance, m")


class PassesOn(Passes, function=True):
    """Calls it under other names."""

    def wrench(r_P_i, f, f_dot):
        laws = {"F": f, "k": f_dot}
        twice = [law(r_P_i[0]) for law in laws.values()]
        return (*twice, 0.0), ZERO


def test_a_function_is_a_value_like_any_other():
    """f = 1 + 2 x at x = 3, and its derivative, on a mass of 2 kg."""
    scene = scene_of()
    scene.add_function("a", "law", coeff=(1.0, 2.0, 0.0))
    scene.add_force("passes", P_i="ball.O", function="law")
    compiled = dap.compile(scene, registry=registry_of(Passes))
    a = compiled.rhs(0.0, compiled.model.u0)[7:10]
    assert a == pytest.approx([3.5, 1.0, 0.0], rel=1e-15)


NOTEBOOK = """
class Pressed(Force):
    keyword = "pressed"
    P_i: Point = point()
    function: str = function(REQUIRED, argument="distance, m")

    def wrench(r_P_i, f):
        return (f(r_P_i[0]) + {more}, 0.0, 0.0), ZERO
"""


def of_notebook(more):
    """A scene with a type that no file holds, and its registry: f = 1 + 2 x at x = 3."""
    names = dict(globals(), random=random)
    exec(compile(NOTEBOOK.format(more=more), "<cell 3>", "exec"), names)
    scene = scene_of()
    scene.add_function("a", "law", coeff=(1.0, 2.0, 0.0))
    scene.add_force("pressed", P_i="ball.O", function="law")
    return scene, registry_of(names["Pressed"])


def test_a_type_of_a_notebook_may_call_a_function():
    scene, registry = of_notebook("0.0")
    compiled = dap.compile(scene, registry=registry)
    assert compiled.rhs(0.0, compiled.model.u0)[7] == pytest.approx(3.5, rel=1e-15)


@pytest.mark.skipif(not jit_is_on(), reason="plain Python runs it as it stands")
def test_what_a_kernel_that_calls_a_function_reaches_is_examined():
    scene, registry = of_notebook("random.random()")
    with pytest.raises(PluginError, match="random"):
        dap.compile(scene, registry=registry)


class Bowl(Function):
    """f alone: all its derivatives are derived."""

    keyword, arguments = "bowl", 2
    a: float = number(default=0.5)

    def value(x, y, a):
        return a * x * x * y + sqrt(1.0 + y * y)


class OnBowl(Force):
    """Names a function of two arguments, value and all derivatives, in one kernel."""

    keyword, ground_axes = "on-bowl", True
    P_i: Point = point()
    hill: str = function(REQUIRED, argument=("x, m,", "z, m"))

    def wrench(r_P_i, hill, hill_x, hill_y, hill_xx, hill_xy, hill_yy):
        x, z = r_P_i[0], r_P_i[2]
        first = hill(x, z), hill_x(x, z), hill_y(x, z)
        return first, (hill_xx(x, z), hill_xy(x, z), hill_yy(x, z))


def test_a_function_of_two_arguments_is_called_with_both():
    """At x = 3, z = 4: f = 18 + sqrt(17), and its partial derivatives by hand."""
    scene = scene_of(Jp=(1.0, 1.0, 1.0))
    scene.add_function("bowl", "shape", a=0.5)
    scene.add_force("on-bowl", "push", P_i="ball.O", hill="shape")
    compiled = dap.compile(scene, registry=registry_of(OnBowl, Bowl))
    root = np.sqrt(17.0)
    first = np.array([18.0 + root, 12.0, 4.5 + 4.0 / root])
    second = [4.0, 3.0, 1.0 / root**3]
    a = compiled.rhs(0.0, compiled.model.u0)[7:]
    assert a[:3] == pytest.approx(first / 2.0, rel=1e-14)
    assert a[3:] == pytest.approx(second, rel=1e-14)


class ByOne(Force):
    """A mistake: one argument for a function of two."""

    keyword = "by-one"
    P_i: Point = point()
    hill: str = function(REQUIRED, argument=("x, m,", "z, m"))

    def wrench(r_P_i, hill):
        return (hill(r_P_i[0], 1.0), hill(r_P_i[0]), 0.0), ZERO


class Breaking(Function):
    """A mistake: nothing reads breaks of two arguments."""

    keyword, arguments = "breaking", 2

    def breaks(self):
        return (0.0,)

    def value(x, y):
        return x * y


class OfThree(Function):
    """A mistake."""

    keyword, arguments = "of-three", 3

    def value(x, y):
        return x * y


class Short(Function):
    """A mistake: as a function of one argument returns them."""

    keyword, arguments = "short", 2

    def value(x, y):
        return x * y, y, 0.0, 0.0


@pytest.mark.parametrize(
    ("type_", "words"),
    [
        (ByOne, r"wrench failed on a random input: TypeError.*missing 1 required positional"),
        (Breaking, "defines breaks, which nothing calls"),
        (OfThree, "arguments = 3; a function takes 1 or 2"),
        (Short, r"should return \(f, f_x, f_y, f_xx, f_xy, f_yy\), shape \(6,\)"),
    ],
)
def test_mistakes_with_two_arguments_are_named(type_, words):
    """By file, type and function, before any scene."""
    with pytest.raises(PluginError, match=words):
        examine(type_)


class TwoLaws(Force):
    """Two functions of an argument, of which one may be left out."""

    keyword = "two-laws"
    P_i: Point = point()
    across: str = function(argument="x, m")
    along: str = function(argument="z, m")


class AlongAlone(TwoLaws, across=False, along=True):
    """Along z."""

    def wrench(r_P_i, along):
        return (0.0, 0.0, along(r_P_i[2])), ZERO


class Both(TwoLaws, across=True, along=True):
    """Along both."""

    def wrench(r_P_i, across, along):
        return (across(r_P_i[0]), 0.0, along(r_P_i[2])), ZERO


class AcrossAlone(TwoLaws, across=True, along=False):
    """A mistake: it calls what is not given."""

    def wrench(r_P_i, across, along):
        return (across(r_P_i[0]), 0.0, along(r_P_i[2])), ZERO


def test_one_of_two_functions_may_be_left_out():
    """Each variant gets the functions that are given; one that calls another is refused in words.
    x = 3 and z = 4: across = 1 + 2 x = 7, along = 5 z^2 = 80."""
    laws = {"line": (1.0, 2.0, 0.0), "square": (0.0, 0.0, 5.0)}
    for given, wanted in (({"along": "square"}, (0.0, 40.0)),
                          ({"along": "square", "across": "line"}, (3.5, 40.0))):  # fmt: skip
        scene = scene_of()
        for name, coeff in laws.items():
            scene.add_function("a", name, coeff=coeff)
        scene.add_force("two-laws", "push", P_i="ball.O", **given)
        evaluator = dap.compile(scene, registry=registry_of(TwoLaws)).evaluator
        a = evaluator.report(0.0, evaluator.model.u0)[:3]
        assert (a[0], a[2]) == pytest.approx(wanted)
    scene.forces.clear()
    scene.add_force("two-laws", "push", P_i="ball.O", across="line")
    with pytest.raises(
        dap.SceneError, match=r"forces.push.*along is missing, which this type calls"
    ):
        dap.compile(scene, registry=registry_of(TwoLaws))


def scene_with(*combinations):
    """A body pushed by the last of some combinations: (type, name, terms)."""
    scene = dap.Scene(name="combined")
    scene.add_body("block", mass=2.0, Jp=(1.0, 1.0, 1.0))
    scene.add_function("harmonic", "swing", frequency=3.0, amplitude=2.0, phase=0.25, offset=0.3)
    scene.add_function("a", "ramp", coeff=(1.0, 2.0, 0.5))
    scene.add_function("harmonic", "fast", frequency=7.0, amplitude=0.5)
    scene.add_function("spline", "curve", x=[-1.0, 0.0, 1.0, 2.0], y=[0.0, 1.0, 0.0, 0.5])
    for type_, name, terms in combinations:
        scene.add_function(type_, name, functions=terms)
    return scene


@pytest.mark.parametrize(
    ("combinations", "expression"),
    [
        ([("sum", "s", ["swing", "ramp", "fast"])], SWING + RAMP + FAST),
        ([("product", "p", ["swing", "ramp", "fast"])], SWING * RAMP * FAST),
        (
            [("product", "p", ["swing", "s"]), ("sum", "s", ["ramp", "fast", "ramp"])],
            SWING * (2 * RAMP + FAST),
        ),
        ([("sum", "one", ["fast"])], FAST),
    ],
)
def test_values_and_derivatives_are_those_of_the_whole_expression(combinations, expression):
    """f to f''' of sums, products and both, against sympy; only rounding is left."""
    scene = scene_with(*combinations)
    name = combinations[0][1]
    scene.add_force("f", "push", body_i="block", f=(1.0, 0.0, 0.0), function=name)
    compiled = dap.compile(scene)
    row = compiled.model.function_names.index(name)
    for x in (-0.7, 0.0, 0.4, 1.9):
        values = compiled.evaluator.function_values(x)[row]
        wanted = [float(sympy.diff(expression, X, k).subs(X, x)) for k in range(4)]
        assert values == pytest.approx(wanted, rel=1e-13, abs=1e-13)


def test_a_combination_of_an_argument_takes_tables_too():
    """A spring curve that is a product of a spline and a polynomial, each with its own numbers."""
    from scipy.interpolate import CubicSpline

    scene = scene_with(("product", "stiff", ["curve", "ramp"]))
    scene.bodies["block"].r = (2.3, 0.0, 0.0)
    scene.add_force("ptp", "spring", P_i="block.O", P_j="ground.O", l0=2.0, function="stiff")
    scene.add_force("ptp", "other", P_i="block.O", P_j="ground.O", l0=1.5, function="ramp")
    result = dap.simulate(scene, t_end=0.0)
    curve = CubicSpline([-1.0, 0.0, 1.0, 2.0], [0.0, 1.0, 0.0, 0.5], bc_type="natural")
    ramp = lambda x: 1.0 + 2.0 * x + 0.5 * x * x  # noqa: E731
    assert result.force("spring").tension[0] == pytest.approx(curve(0.3) * ramp(0.3), rel=1e-14)
    assert result.force("other").tension[0] == pytest.approx(ramp(0.8), rel=1e-14)


def test_steps_end_where_a_term_changes_its_form():
    """The breaks of a combination are those of all its terms, once each in the run."""
    scene = scene_with(("sum", "inner", ["late", "swing"]), ("product", "all", ["early", "inner"]))
    scene.add_function("step", "early", x_start=0.2, x_end=0.3)
    scene.add_function("step", "late", x_start=0.25, x_end=0.75)
    scene.add_force("f", "push", body_i="block", f=(1.0, 0.0, 0.0), function="all")
    stops = dap.compile(scene).breakpoints(1.0).stops
    assert [t for t, jumps in stops if jumps] == [0.2, 0.25, 0.3, 0.75]


def test_combinations_of_other_types_are_other_code():
    """Two sums of different types of functions, and two of equal types, in one scene."""
    names = ("swing", "fast"), ("ramp", "swing"), ("fast", "fast")
    scene = scene_with(*[("sum", f"s{k}", list(terms)) for k, terms in enumerate(names)])
    for k in range(3):
        scene.add_force("f", f"push{k}", body_i="block", f=(1.0, 0.0, 0.0), function=f"s{k}")
    compiled = dap.compile(scene)
    assert sorted(group.count for group in compiled.model.functions) == [1, 2]
    values = compiled.evaluator.function_values(0.6)[-3:, 0]
    each = {"swing": SWING, "ramp": RAMP, "fast": FAST}
    wanted = [float(sum(each[n] for n in terms).subs(X, 0.6)) for terms in names]
    assert np.max(np.abs(values - wanted)) < 1e-14
