"""Fields with names that a body's quantities have, and the field of a joint."""

import numpy as np
import pytest
from support.internals import LoopArrays, build, call_loop, loop_list, specs_of, write

from dap3d_core.interface import (
    Body,
    Force,
    PluginError,
    Point,
    Vector,
    body,
    choice,
    examine,
    joint,
    number,
    point,
    vector,
)
from dap3d_core.kernels import add
from dap3d_core.kernels.runtime import loop_support

ZERO = (0.0, 0.0, 0.0)


class Named(Force):
    """A vector called v_i beside a point whose velocity is asked for."""

    keyword = "named"
    P_i: Point = point()
    v_i: Vector = vector()

    def wrench(v_i, v_i_dot, v_P_i):
        return ((v_P_i, add(v_i, v_i_dot)),)

    def energy(v_i):
        return v_i[0]


def test_a_vector_may_be_called_v_i():
    """It takes the place of the velocity of that name; the velocity of a point stays one.
    All of it by numpy: v_P = v + w x A s, the vector A a and its rate w x A a."""
    type_info = examine(Named)
    assert not type_info.names["v_i"].velocity
    assert type_info.names["v_i_dot"].velocity
    rng = np.random.default_rng(4)
    A = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    v, w, s, a = rng.normal(size=(4, 3))
    one = np.zeros((2, loop_support.BODY_WIDTH))
    one[1, loop_support.A : loop_support.A + 9] = A.ravel()
    one[1, loop_support.V : loop_support.V + 3], one[1, loop_support.W : loop_support.W + 3] = v, w
    par = np.zeros(type_info.layout.par_width)
    for name, values in (("P_i", s), ("v_i", a)):
        at = type_info.layout.numbers[name][0]
        par[at : at + 3] = values
    out = np.zeros(12)
    loop = build(write(type_info, "wrench"))
    nothing = np.zeros(1)
    arrays = LoopArrays(body=one, F=np.zeros((1, 5)), idx=np.array([1]), par=par)
    call_loop(loop_list([loop]), 0, 0.0, arrays, np.array([0, 0, 1]), out, nothing, nothing)
    assert out[6:9] == pytest.approx(v + np.cross(w, A @ s), abs=1e-14)
    assert out[9:12] == pytest.approx(A @ a + np.cross(w, A @ a), abs=1e-14)


@pytest.mark.parametrize("name", ["w_i", "r_i", "mass_i"])
def test_other_names_of_a_body_are_taken(name):
    """A field of such a name would hide what points and vectors are made of: it is refused."""
    members = {
        "keyword": "taken",
        "body_i": body(),
        name: number() if name == "mass_i" else vector(),
        "wrench": lambda t: ((ZERO, (t, t, t)),),
    }
    with pytest.raises(PluginError, match=rf"Taken has a field {name}, which is the body's"):
        examine(type("Taken", (Force,), members))


def test_a_joint_field_is_required():
    """A force that acts by the friction of a joint names that joint."""

    class Rubbing(Force):
        """Friction."""

        keyword = "rubbing"
        joint: str = joint(doc="the joint")
        mu: float = number(default=0.5)

    examine(Rubbing)
    assert specs_of(Rubbing)["joint"].required
    assert specs_of(Rubbing)["joint"].kind == "joint"


def test_a_field_x_of_a_function_is_its_argument():
    """The table x of a spline stays a field; kernels mean the argument by x."""
    from dap3d_core.registry import load_registry

    spline = load_registry().get("function", "spline")
    assert specs_of(spline.type)["x"].kind == "table"
    assert spline.names["x"].doc == "the argument of the function"


class Push(Force):
    """Two variants that differ in a kernel alone, in one file, with the same names."""

    keyword = "push"
    body_i: Body = body()
    way: str = choice(("up", "down"), default="up")

    def wrench(t):
        return ((ZERO, (t, 0.0, 0.0)),)


class Down(Push, way="down"):
    """The other way."""

    def wrench(t):
        return ((ZERO, (-t, 0.0, 0.0)),)


def test_variants_in_one_file_have_loops_of_their_own():
    """The code of one is not taken for that of another, in this process or from the cache."""
    type_info = examine(Push)
    ((_, other),) = type_info.variants
    for one, sign in ((type_info, 1.0), (other, -1.0)):
        out, nothing = np.zeros(12), np.zeros(1)
        body_array = np.zeros((2, loop_support.BODY_WIDTH))
        loop = build(write(one, "wrench"))
        arrays = LoopArrays(body=body_array, F=np.zeros((1, 5)), idx=np.array([1]), par=nothing)
        group = np.array([0, 0, 1])
        call_loop(loop_list([loop]), 0, 2.5, arrays, group, out, nothing, nothing)
        assert out[9] == sign * 2.5
