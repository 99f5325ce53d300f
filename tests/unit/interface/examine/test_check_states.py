"""Mistakes in the declaration of states: each is one clear error."""

import pytest
from support.state_types import ZERO

from dap3d_core.interface import Body, Force, Joint, PluginError, body, examine, number, vec3
from dap3d_core.kernels import eye


def force(states, rate=lambda r_i: 0.0, **members):
    """A force on one body that declares states."""
    space = {"keyword": "mine", "__module__": __name__, "body_i": body(), "states": states}
    space["__annotations__"] = {"body_i": Body, **members.pop("annotations", {})}
    space |= {"wrench": lambda r_i: (r_i, ZERO), **members}
    if rate is not None:
        space["rate"] = rate
    return type("Mine", (Force,), space)


def vector(r_i):
    return r_i


@pytest.mark.parametrize(
    ("type_", "words"),
    [
        (force(("z",), rate=None), ["declares the states z", "no rate"]),
        (force(()), ["defines rate, but no states"]),
        (force(("energy",)), ["the state energy would hide the quantity"]),
        (force(("q1_dot",)), ["the state q1_dot would hide the quantity"]),
        (force(("lam",)), ["the state lam would hide"]),
        (force(("r_i",)), ["the state r_i would hide what its bodies"]),
        (force(("t",)), ["the state t would hide what"]),
        (
            force(("k",), k=number(1.0), annotations={"k": float}),
            ["the state k would hide its field of this name"],
        ),
        (
            force(("h",), prepare=lambda self, bodies: {"h": 1.0}),
            ["the state h would hide what prepare returns"],
        ),
        (force(("not one",)), ["'not one' in states is no name"]),
        (force({"z": 0}), ["states['z'] is its length", "not 0"]),
        (force({"z": "two"}), ["states['z'] is its length", "not 'two'"]),
        (force({"z": 3}), ["Mine.rate", "3 numbers, the derivatives of its states"]),
        (force(("a", "b")), ["Mine.rate", "2 derivatives, one for each state; it returned 1"]),
        (force(("a", "b"), rate=vector), ["it returned 3"]),
        (force({"a": 1, "b": 3}, rate=lambda r_i: (r_i, 0.0)), ["Mine.rate", "shape"]),
        (force(("z",), rate=lambda r_i: float("nan")), ["Mine.rate returned nan"]),
        (force(("z",), rate=lambda r_i, y: y), ["Mine.rate asks for y"]),
        (
            force(("z",), z_0=vec3(ZERO), annotations={"z_0": float}),
            ["z_0 is the initial value of z, of 1 numbers; it is vec3"],
        ),
        (force(("z",), each_body=True), ["acts on each body, and declares states"]),
    ],
)  # fmt: skip
def test_what_is_wrong_with_states_is_said(type_, words):
    """A PluginError names file, class and state, and what is wrong."""
    with pytest.raises(PluginError) as caught:
        examine(type_)
    for word in (__file__.rpartition("/")[2], *words):
        assert word in str(caught.value)


def test_position_level_kernels_may_name_a_state():
    """A state is no velocity: C may depend on it."""

    class Fed(Joint):
        keyword, rows, states = "fed", 1, ("z",)
        body_i: Body = body()

        def rate(t):
            return t

        def C(r_i, z):
            return r_i[0] - z

        def J():
            return (eye(1.0)[0] + ZERO,)

        def nu(t):
            return t

        def gamma():
            return 1.0

    examined = examine(Fed)
    assert not examined.names["z"].velocity
