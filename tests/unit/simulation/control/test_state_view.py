"""The state in the course of a run against the quantities of its result."""

import numpy as np
import pytest
from support.arm import AXES, JOINTS, NAMES, arm_scene
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.result import UnknownNameError

NAMED = [
    "link3.r", "link3.r.x", "link6.p", "link2.rd.z", "link5.w", "link5.w.y", "upper4.v",
    "hinge2.force.norm", "energy.kinetic", *(f"{joint}.angle" for joint in JOINTS),
    *(f"{joint}.angle_rate" for joint in JOINTS), "motor1", "t",
]  # fmt: skip


@long_in_plain_python
@pytest.mark.parametrize("method", ["standard", "joint"])
def test_quantities_are_those_of_the_result(method):
    """Read where they stand or evaluated, in body and in joint coordinates, beyond a turn."""
    run = dap.start(arm_scene(method), rtol=1e-6)
    seen = []
    for k in range(60):
        run.step(0.02, {NAMES[0]: 30.0, NAMES[5]: 0.1} if k == 0 else None)
        seen.append([np.copy(run.state[name]) for name in NAMED])
        assert run.state.u.shape == (78,)
    result = run.result()
    for name, *values in zip(NAMED, *seen, strict=True):
        wanted = result.quantity(name).values[1:]
        scale = 1.0 + np.max(np.abs(wanted))
        assert np.array(values) == pytest.approx(wanted, abs=1e-11 * scale), name
    assert np.max(result.quantity("hinge1.angle").values) > 2.0 * np.pi
    assert run.state.r == pytest.approx(result.r[-1])
    assert run.state.u == pytest.approx(result.u[-1])
    assert AXES.shape == (6, 3)


def test_coordinates_of_sliding_joints():
    """On a body that turns itself, off the origin, from a start that is not zero."""
    scene = dap.Scene(name="slider")
    scene.add_body("arm", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(0.3, 0.1, 0.0))
    scene.add_body("slide", mass=0.5, Jp=(0.1, 0.1, 0.1), r=(0.8, 0.1, 0.0), r_dot=(0.4, 0.0, 0.0))
    scene.add_point("pin", "arm", (-0.3, -0.1, 0.0))
    scene.add_joint("rev", "hinge", P_i="pin", P_j="ground.O", a_i="arm.z", a_j="ground.z")
    scene.add_joint("tran", "rail", P_i="slide.O", P_j="arm.O", a_j="arm.x")
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    run = dap.start(scene)
    names = ("rail.length", "rail.length_rate", "hinge.q1", "hinge.q1_dot")
    seen = [[run.state[name] for name in names]]
    for _ in range(30):
        run.step(0.05)
        seen.append([run.state[name] for name in names])
    result = run.result()
    for name, values in zip(names, np.array(seen).T, strict=True):
        assert values == pytest.approx(result.quantity(name).values, abs=1e-12), name


def test_views_cannot_be_written_and_names_are_checked():
    """An unknown name says what there is."""
    state = dap.start(arm_scene()).state
    with pytest.raises(ValueError, match="read-only"):
        state["link1.r"][0] = 1.0
    with pytest.raises(UnknownNameError, match=r"did you mean 'hinge1\.angle'"):
        state["hinge1.angel"]
    with pytest.raises(TypeError, match="named by text"):
        state[3]
