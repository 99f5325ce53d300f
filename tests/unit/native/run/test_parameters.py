"""Parameters that are set before a run begins: the start is found as for a scene with them."""

import numpy as np
import pytest
from tests.unit.native.test_export import course, exported, states_of

import dap3d_core as dap


def compared(model, names, factors, folder, t_end=0.3, **settings):
    """States of a run with other parameters in an exported model, and in Python."""
    scene = dap.load(model) if isinstance(model, str) else model
    outputs = states_of(scene)
    made, library = exported(scene, folder, outputs=outputs, parameters=names, **settings)
    run, other = library.start(t_end), scene.copy()
    from dap3d_core.study import parameters_named, with_values

    found = parameters_named(dap.compile(scene).checked, names)
    values = [p.value * factor for p, factor in zip(found, factors, strict=True)]
    for name, value in zip(names, values, strict=True):
        run[name] = value
        assert run[name] == value
    other = with_values(scene, found, values)
    result = dap.simulate(other, t_end=t_end, dt=t_end / 5.0, **settings)
    both = course(run, result, made, outputs)
    with pytest.raises(ValueError, match="before a run begins"):
        run[names[0]] = 2.0 * values[0]
    return both


@pytest.mark.slow
@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("model", "names"),
    [
        ("pen1", ["bodies.cone.mass", "bodies.cone.Jp.y"]),
        ("quarter_car", ["bodies.chassis.mass", "bodies.upright.Jp.x"]),
        ("bodies2", None),
        ("cradle", ["bodies.ball1.mass", "bodies.ball5.mass"]),  # contacts that events follow
    ],
)
def test_masses_and_inertias_give_the_bits_of_simulate(tmp_path, model, names):
    names = names or [f"bodies.{next(iter(dap.load(model).bodies))}.mass"]
    found, expected = compared(model, names, [1.3, 1.1][: len(names)], tmp_path)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.slow
def test_the_shape_of_a_polar_cam_is_a_parameter(tmp_path):
    """Nothing is found from its function before a run: neither starts, nor what pictures draw."""
    scene = dap.Scene(name="cam")
    scene.add_body("roller", mass=1.0, Jp=[0.1] * 3, r=[1.0, 0.0, 0.0])
    scene.add_function("harmonic", "lobe", offset=0.5, amplitude=0.1, frequency=1.0)
    scene.add_contact("point_curve", "cam", P_i="roller.O", function="lobe", polar=True)
    made, _ = exported(scene, tmp_path, parameters=["functions.lobe.amplitude"])
    assert tuple(made.parameters) == ("functions.lobe.amplitude",)


@pytest.mark.slow
def test_points_of_joints_move_the_start(tmp_path):
    """It is brought onto the constraints by other code than in Python: equal to rounding."""
    found, expected = compared("fourbar3", ["points.P3.sPp.z"], [1.01], tmp_path)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_initial_velocities(tmp_path):
    scene = dap.Scene(name="stone")
    scene.add_body("stone", mass=2.0, Jp=(0.1, 0.2, 0.25), r=(0.0, 0.0, 1.0), w=(1.0, 2.0, 3.0),
                   r_dot=(1.0, 0.0, 2.0))  # fmt: skip
    scene.add_force("weight", "gravity", gravity=9.81)
    names = ["bodies.stone.r_dot.z", "bodies.stone.w.y"]
    found, expected = compared(scene, names, [1.5, 0.5], tmp_path)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
