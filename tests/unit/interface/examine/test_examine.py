"""What is asked of a type when it is registered: what is wrong is refused, in words that help."""

import math

import numpy as np
import pytest

from dap3d_core.interface import (
    Body,
    Contact,
    Force,
    Function,
    Joint,
    PluginError,
    Point,
    Vector,
    Vector2,
    body,
    examine,
    number,
    point,
    vector,
    vector2,
)
from dap3d_core.kernels import minimum, neg, row, scale, sqrt, sub, where

ZERO = (0.0, 0.0, 0.0)
X = (1.0, 0.0, 0.0)
ENDS = {"P_i": (Point, point()), "P_j": (Point, point())}


def type_of(base, **members):
    """A class of this base as an author would write it, with two points if it has no fields."""
    fields = members.pop("fields", ENDS)
    space = {"keyword": "mine", "__module__": __name__, **members}
    space |= {name: maker for name, (_, maker) in fields.items()}
    space["__annotations__"] = {name: kind for name, (kind, _) in fields.items()}
    return type("Mine", (base,), space)


GOOD_JOINT = {
    "rows": 1,
    "C": lambda r_P_i, r_P_j: r_P_j[0] - r_P_i[0],
    "J": lambda s_P_i, s_P_j: (row(neg(X), s_P_i), row(X, s_P_j)),
    "gamma": lambda w_i, s_P_i: w_i[0] * s_P_i[0],
}
GOOD_FORCE = {"wrench": lambda v_i, v_j: ((v_i, ZERO), (v_j, ZERO))}


def joint(**members):
    """A joint of one row that is good but for what is given; None takes a member out."""
    space = GOOD_JOINT | members
    return type_of(Joint, **{n: v for n, v in space.items() if v is not None})


def force(**members):
    """A force between two bodies that is good but for what is given."""
    return type_of(Force, **(GOOD_FORCE | members))


def function(**members):
    """A function that is good but for what is given."""
    return type_of(Function, **({"value": lambda x: (x, 1.0, 0.0, 0.0), "fields": {}} | members))


def refusal(type_):
    """The words with which a type is refused; they always name file and class."""
    with pytest.raises(PluginError) as caught:
        examine(type_)
    words = str(caught.value)
    assert words.startswith(f"{__file__}: Mine")
    return words


@pytest.mark.parametrize(
    "type_", [joint(), force(), function()], ids=["joint", "force", "function"]
)
def test_good_types_pass(type_):
    """What the others are spoiled from is not refused: a refusal is for the spoiled part."""
    assert examine(type_).type is type_


def broken(x):
    raise RuntimeError("it is " + "broken")


def prepare(constants):
    """A type's ``prepare`` that returns these constants."""
    return lambda self, bodies: constants


@pytest.mark.parametrize(
    ("type_", "words"),
    [
        # the level rule
        (joint(C=lambda v_i: v_i[0]), ["Mine.C", "v_i", "velocity level", "gamma or wrench"]),
        (joint(C=lambda s_P_i_dot: 0.0), ["Mine.C", "s_P_i_dot", "velocity level"]),
        (joint(J=lambda w_i: (row(X, w_i),) * 2), ["Mine.J", "w_i", "velocity level"]),
        (joint(nu=lambda v_P_j: 0.0), ["Mine.nu", "v_P_j", "velocity level"]),
        (force(energy=lambda v_P_i: 0.0), ["Mine.energy", "v_P_i", "velocity level"]),
        # names
        (joint(C=lambda r_Pi: 0.0), ["Mine.C", "asks for r_Pi", "did you mean r_P_i?", "s_P_j"]),
        (joint(gamma=lambda omega: 0.0), ["Mine.gamma", "asks for omega", "they offer t, r_i"]),
        (joint(C=lambda r_k: 0.0), ["asks for r_k", "did you mean"]),
        (force(wrench=lambda self, v_i: 0.0), ["Mine.wrench", "asks for self"]),
        (function(value=lambda t_0: 0.0), ["Mine.value", "asks for t_0", "they offer t, x"]),
        # shapes
        (joint(C=lambda r_i: r_i), ["Mine.C", "1 number, one for each row", "shape (3,)"]),
        (joint(rows=2, holonomic=(True, False)), ["Mine.J", "2 x 6 for each of 2", "(2, 6)"]),
        (joint(J=lambda s_P_i: row(X, s_P_i)), ["Mine.J", "1 x 6 for each of 2", "shape (6,)"]),
        (joint(gamma=lambda w_i: w_i), ["Mine.gamma", "1 number", "shape (3,)"]),
        (joint(nu=lambda t: (t, t)), ["Mine.nu", "1 number", "shape (2,)"]),
        (joint(J=lambda: ((1.0,) * 6, (1.0,) * 5)), ["Mine.J", "rows differ in length"]),
        (force(wrench=lambda v_i: (v_i, v_i)), ["Mine.wrench", "(force, moment) for each of 2"]),
        (force(energy=lambda r_i: r_i), ["Mine.energy", "one number", "shape (3,)"]),
        (function(value=lambda x: (x, 1.0, 0.0)), ["Mine.value", "(f, f', f'', f''')", "(3,)"]),
        # what comes out
        (joint(C=lambda r_i: r_i[7]), ["Mine.C failed", "IndexError", "out of range"]),
        (force(wrench=lambda r_i: broken(r_i)),
         ["Mine.wrench failed", "RuntimeError: it is broken"]),
        (joint(C=lambda t: math.nan), ["Mine.C returned nan", "finite number"]),
        (joint(gamma=lambda t: t / 1e-320), ["Mine.gamma returned inf", "finite number"]),
        (joint(C=lambda t: None), ["Mine.C returned None", "finite number"]),
        (joint(C=lambda t: "1.0"), ["Mine.C returned '1.0'", "finite number"]),
        (joint(C=lambda t: True), ["Mine.C returned True", "finite number"]),
        (joint(C=lambda t: 1j), ["Mine.C returned 1j", "finite number"]),
        (joint(C=lambda r_i: np.array(r_i)), ["Mine.C returned array(", "finite number"]),
        # the class
        (joint(gamma=None, gama=lambda w_i: 0.0), ["defines gama", "did you mean gamma?"]),
        (joint(gama=lambda w_i: 0.0), ["defines gama", "nothing calls", "did you mean gamma?"]),
        (
            joint(helper=lambda w_i: 0.0),
            [
                "defines helper",
                "C, C_dot, G, J, gamma, nu, friction, switch, rate, impulse, reset, prepare",
            ],
        ),
        (force(energie=lambda r_i: 0.0), ["defines energie", "did you mean energy?"]),
        (joint(gamma=None, C=None, holonomic=False), ["does not define gamma"]),
        (joint(J=None, C=None, holonomic=False), ["does not define J"]),
        (joint(C=None), ["does not define C"]),
        (type_of(Force), ["does not define wrench"]),
        (function(value=None), ["does not define value"]),
        (joint(keyword=""), ["has no keyword", 'keyword = "mine"']),
        *((joint(keyword=word), [repr(word), "which is no word"])
          for word in ("my rope", "-rope", "dist:rope", "rope\n")),
        (joint(rows=0), ["declares rows = 0", "one row or more"]),
        (joint(rows=-3), ["declares rows = -3"]),
        (joint(rows="3"), ["declares rows = '3'"]),
        (joint(rows=1.0), ["declares rows = 1.0"]),
        (joint(holonomic=(True, False)), ["holonomic", "one truth value for each of its 1 rows"]),
        (joint(fields={"k": (float, number())}), ["acts on no body", "P_i: Point = point()"]),
        (joint(fields={"P": (Point, point())}), ["acts on no body"]),
        (joint(fields={"d": (Vector2, vector2()), "e": (Vector2, vector2())}),
         ["more than one vector2", "ends P_i and P_j", "sub(r_Q_j, r_Q_i)"]),
        (joint(fields={"a_i": (Vector, vector(across="b_j"))}),
         ["a_i is across b_j, which is no vector field"]),
        (joint(fields=ENDS | {"k": (float, number("100"))}),
         ["default '100', which is no finite number"]),
        (joint(fields=ENDS | {"k": (float, number(-1.0, positive=True))}),
         ["Mine.k has the default -1.0, and is to be positive"]),
        (joint(fields=ENDS | {"k": (float, number(3, maximum=2.0))}),
         ["which is out of its bounds"]),
        # prepare
        (joint(prepare=prepare(None)), ["Mine.prepare should return a dict", "None"]),
        (joint(prepare=prepare([1.0])), ["Mine.prepare should return a dict", "[1.0]"]),
        (joint(prepare=prepare({"n": "up"})), ["Mine.prepare", "numbers and tuples", "n is 'up'"]),
        (joint(prepare=prepare({"n": None})), ["Mine.prepare", "n is None"]),
        (joint(prepare=prepare({"n": ()})), ["Mine.prepare", "n is ()"]),
        (joint(prepare=prepare({"n": 10**400})), ["Mine.prepare", "n is 1000"]),
        (joint(prepare=prepare({"n": ((1.0, 2.0), (3.0,))})), ["Mine.prepare", "of one length"]),
        (joint(prepare=prepare({"n": math.nan})), ["Mine.prepare", "n comes out as nan"]),
        (joint(prepare=prepare({"n": (1.0, -math.inf)})), ["Mine.prepare", "not finite"]),
        (joint(prepare=prepare({"n m": 1.0})), ["Mine.prepare returned 'n m'", "parameter"]),
        (joint(prepare=prepare({"lambda": 1.0})), ["Mine.prepare returned 'lambda'"]),
        (joint(prepare=prepare({3: 1.0})), ["Mine.prepare returned 3"]),
        (joint(prepare=lambda self: {}), ["Mine.prepare failed", "TypeError"]),
        (joint(prepare=lambda self, bodies: bodies["k"]), ["Mine.prepare failed: KeyError: 'k'"]),
        (joint(prepare=lambda self, bodies: self.Q_i), ["Mine.prepare failed: AttributeError"]),
    ],
    ids=lambda v: " ".join(v)[:40] if isinstance(v, list) else "",
)  # fmt: skip
def test_what_is_wrong_with_a_type_is_said(type_, words):
    """A PluginError names file, class, function, what is wrong and what to do."""
    said = refusal(type_)
    for word in words:
        assert word in said


def test_a_contact_written_with_math_is_told_its_own_line():
    """What fails is derived from it; what derivation needs of it is said."""

    class Mine(Contact):
        keyword = "mine"
        P_i: Point = point()

        def gap(r_P_i):
            return r_P_i[2]

        def at(r_P_i):
            return r_P_i

        def normal(r_P_i):
            return (math.sin(r_P_i[0]), 0.0, math.cos(r_P_i[0]))

    said, line = refusal(Mine), Mine.normal.__code__.co_firstlineno + 1
    assert f"[{__file__}:{line}]" in said
    assert "from dap3d_core.kernels, not from math or numpy" in said


def test_what_looks_like_a_field_and_is_none_is_said():
    """Numbers, three of them, parts of a scene, yes or no; class constants are let be."""

    class Mine(Force):
        keyword = "mine"
        body_i: Body = body()
        k: float = 5.0
        F: tuple = (0.0, 0.0, 1.0)
        way: bool = True
        steel: float = 7850.0

        def prepare(self, bodies):
            return {"mass": self.steel}

        def wrench(mass):
            return (mass, 0.0, 0.0), ZERO

    assert examine(Mine).layout.numbers.keys() == {"mass"}
    for name, remedy in [
        ("k", "k: float = 5.0 is no field; write k: float = number(5.0)"),
        ("F", "write F: tuple = vec3((0.0, 0.0, 1.0))"),
        ("way", "write way: bool = choice((False, True), True)"),
    ]:
        kernel = eval(f"lambda {name}: (ZERO, ZERO)", {"ZERO": ZERO})
        assert remedy in refusal(type("Mine", (Mine,), {"wrench": kernel, "__module__": __name__}))


def test_a_field_without_a_maker_is_refused():
    class Mine(Force):
        keyword = "mine"
        P_i: Point

        def wrench(r_P_i):
            return r_P_i, ZERO

    assert "P_i: Point is no field; write P_i: Point = point()" in refusal(Mine)


def test_a_type_that_refuses_every_instance_is_refused():
    """``prepare`` says in its own words that it cannot; for random values that is a mistake."""

    def prepare(self, bodies):
        raise ValueError("the axis points nowhere")

    assert "the axis points nowhere" in refusal(joint(prepare=prepare))


def test_a_type_may_refuse_some_instances():
    """A type that refuses three in four of the random values is examined on another."""

    def prepare(self, bodies):
        if self.a_i[0] < 0.0 or self.a_i[1] < 0.0:
            raise ValueError("the axis points the wrong way")
        return {"c": 2.0}

    fields = {"P_i": (Point, point()), "P_j": (Point, point()), "a_i": (Vector, vector())}
    found = examine(joint(fields=fields, prepare=prepare))
    assert found.names["c"].shape == ()


def test_a_kernel_may_be_undefined_for_some_numbers():
    """What has a value for one in two of the random inputs is good enough: the run names what is
    not finite where it happens."""
    assert "energy" in examine(force(energy=lambda t: sqrt(t - 1.0))).outputs
    assert "C" in examine(joint(C=lambda r_i: where(r_i[0] < 0.0, math.nan, 1.0))).outputs
    # 1/0 on the side that is not taken, where Python raises and IEEE numbers do not
    divided = force(energy=lambda t: where(t < 1.0, 1.0 / sqrt(1.0 - minimum(t, 1.0)), 0.0))
    assert "energy" in examine(divided).outputs


def test_velocity_level_kernels_may_name_velocities():
    """The level rule is for C, J, nu and energy; gamma and wrench name what they like."""
    fields = {"d": (Vector2, vector2()), "a_j": (Vector, vector())}
    kernel = {"gamma": lambda v_i, w_j, s_P_i_dot, v_P_j, d_dot, a_j_dot, r_i, t: 0.0}
    examine(joint(fields=fields, **kernel))
    examine(
        force(fields=fields, wrench=lambda v_i, w_i, d_dot, a_j_dot: ((v_i, w_i), (d_dot, a_j_dot)))
    )


# ------------------------------------------------------------------ brackets may be left out


@pytest.mark.parametrize(
    ("type_", "kernel", "paths"),
    [
        (joint(), "C", ("out",)),
        (joint(C=lambda r_i: (r_i[0],)), "C", ("out[0]",)),
        (joint(C=lambda r_i: ((r_i[0],),)), "C", ("out[0][0]",)),
        (joint(), "J", tuple(f"out[{b}][{c}]" for b in range(2) for c in range(6))),
        (joint(J=lambda: (((1.0,) * 6,), ((2.0,) * 6,))), "J",
         tuple(f"out[{b}][0][{c}]" for b in range(2) for c in range(6))),
        (function(), "value", ("out[0]", "out[1]", "out[2]", "out[3]")),
    ],
)  # fmt: skip
def test_brackets_around_one_thing_may_be_left_out(type_, kernel, paths):
    """A joint of one row returns a number, a tuple of one, or a block with or without its bracket;
    each number is found where it stands."""
    assert examine(type_).outputs[kernel] == paths


def test_a_force_on_one_body_may_return_its_pair_bare():
    """(force, moment) and ((force, moment),) are the same; a joint on one body likewise."""
    fields = {"body_i": (Body, body())}
    bare = force(fields=fields, wrench=lambda v_i, w_i: (v_i, w_i))
    full = force(fields=fields, wrench=lambda v_i, w_i: ((v_i, w_i),))
    assert examine(bare).outputs["wrench"][4] == "out[1][1]"
    assert examine(full).outputs["wrench"][4] == "out[0][1][1]"
    members = {"C": lambda r_i: r_i[2], "J": lambda: row(X, ZERO), "gamma": lambda t: 0.0}
    assert examine(joint(fields=fields, **members)).outputs["J"] == tuple(
        f"out[{c}]" for c in range(6)
    )


def test_a_mask_leaves_rows_out_of_the_position_level():
    """With holonomic = (True, False, True) C returns two numbers, for rows 0 and 2."""
    members = {
        "rows": 3,
        "holonomic": (True, False, True),
        "C": lambda r_i, r_j: (r_i[0], r_j[0]),
        "J": lambda s_P_i: ((row(X, s_P_i),) * 3,) * 2,
        "gamma": lambda w_i: w_i,
    }
    type_ = joint(**members)
    assert type_.position_rows() == (0, 2)
    assert len(examine(type_).outputs["C"]) == 2
    assert "2 numbers" in refusal(joint(**(members | {"C": lambda r_i: r_i})))


def test_rows_of_the_velocity_level_alone_need_no_position_kernel():
    """holonomic = False: no row has a position level, and C may be missing."""
    type_ = joint(holonomic=False, C=None)
    assert type_.position_rows() == ()
    assert "C" not in examine(type_).outputs


def test_a_type_inherits_kernels_and_fields():
    """A subclass changes one kernel and keeps the rest; each class has its own keyword."""

    class Spring(Force):
        keyword = "spring"
        d: Vector2 = vector2()
        k: float = number(default=1.0)

        def wrench(d, k):
            return (scale(k, d), ZERO), (scale(-k, d), ZERO)

    class Preloaded(Spring):
        keyword = "preloaded"
        F: float = number(default=2.0)

        def energy(d, k, F):
            return sub(d, ZERO)[0] * k * F

    found = examine(Preloaded)
    assert set(found.outputs) == {"wrench", "energy"}
    assert {"k", "F", "d", "d_dot", "r_P_j"} <= set(found.names)
    assert set(examine(Spring).outputs) == {"wrench"}


def test_examination_is_the_same_each_time():
    """A type is examined with random numbers from a fixed seed: no luck is involved."""
    first, second = examine(joint()), examine(joint())
    assert first.outputs == second.outputs
    assert first.names == second.names


def test_a_function_of_kernels_that_is_not_imported_is_named_with_its_import():
    def wrench(r_P_i):
        return (cross(r_P_i, X), ZERO), (ZERO, ZERO)  # noqa: F821

    with pytest.raises(PluginError, match=r"from dap3d_core\.kernels import cross"):
        examine(type_of(Force, wrench=wrench))
