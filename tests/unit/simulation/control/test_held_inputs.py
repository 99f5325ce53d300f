"""Inputs of a run, set by name."""

import numpy as np
import pytest
from support.own_types import registry_of
from support.pushed import pushed_block

import dap3d_core as dap
from dap3d_core.interface import (
    REQUIRED,
    Force,
    Function,
    Vector,
    functions,
    input_,
    number,
    vector,
)
from dap3d_core.kernels import scale
from dap3d_core.simulation.control.held_inputs import HeldInputs
from dap3d_core.testing import check_type


def test_changes_are_told_and_stand_in_the_arrays():
    """An equal value is no change; all is refused before anything of it is wrong."""
    evaluator = dap.compile(pushed_block(0.25)).evaluator
    inputs = HeldInputs(evaluator)
    assert not inputs.set({"push": 0.25})
    assert inputs.set({"push": 1})
    assert evaluator.inputs.tolist() == [1.0] == inputs.values
    with pytest.raises(ValueError, match="should be a finite number"):
        inputs.set({"push": float("inf")})
    assert evaluator.inputs.tolist() == [1.0]
    assert not inputs.drives


class Thruster(Force):
    """Thrust along an axis of a body, throttled, by a valve that opens with the square."""

    keyword = "thruster"
    a_i: Vector = vector(doc="direction")
    thrust: float = number(unit="N", doc="at full throttle")
    throttle: str = input_(REQUIRED, doc="opening")

    def wrench(a_i, thrust, throttle):
        return ((scale(thrust * throttle * throttle, a_i), (0.0, 0.0, 0.0)),)


class Mean(Function):
    """The mean of other functions."""

    keyword = "mean"
    parts: tuple = functions(doc="names of the functions")

    def value(x, parts):
        return tuple(
            sum(numbers) / len(parts) for numbers in zip(*(f(x) for f in parts), strict=True)
        )


def test_types_of_others_read_inputs_and_combine_functions():
    """By fields of any name; they pass the checks of the kit, and linearise."""
    for type_ in (Thruster, Mean):
        assert check_type(type_).ok
    scene = dap.Scene(name="rocket")
    scene.add_body("rocket", mass=2.0, Jp=(1.0, 1.0, 1.0))
    scene.add_function("a", "one", coeff=(1.0, 0.0, 0.0))
    scene.add_function("a", "two", coeff=(3.0, 2.0, 0.0))
    scene.add_function("mean", "push", parts=["one", "two"])
    scene.add_force("f", "wind", body_i="rocket", f=(1.0, 0.0, 0.0), function="push")
    scene.add_force("thruster", a_i="rocket.z", thrust=8.0, throttle="valve")
    registry = registry_of(Thruster, Mean)
    with pytest.raises(dap.SceneError, match=r"throttle.*there is no input 'valve'"):
        dap.compile(scene, registry=registry)
    scene.add_input("valve", 0.5)
    compiled = dap.compile(scene, registry=registry)
    result = dap.simulate(compiled, t_end=1.0, dt=1.0, rtol=1e-11)
    assert result.rd[-1, 0] == pytest.approx([(2.0 + 0.5) / 2.0, 0.0, 1.0], abs=1e-12)
    lin = dap.linearize(compiled, inputs=["valve"], outputs=["rocket.rdd.z"])
    assert pytest.approx(np.array([[2.0 * 8.0 * 0.5 / 2.0]]), abs=1e-12) == lin.D
