"""Parameters that are set before a run begins: the start is found as for a scene with them."""

from functools import partial

import numpy as np
import pytest
from support.bouncing import bouncing
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


def chain(second):
    """A needle, whose moments products of inertia tell alone, and a body of a mass, in a chain."""
    scene = dap.Scene(name="chain")
    axis = np.array([0.6, 0.0, 0.8])
    needle = 0.1 * np.eye(3) - (0.1 - 5e-7) * np.outer(axis, axis)
    for k, (mass, Jp) in enumerate([(1.0, needle), (second, second * np.diag([0.1, 0.2, 0.25]))]):
        scene.add_body(f"b{k}", mass=mass, Jp=Jp.tolist(), r=(0.5 + k, 0.0, 0.0))
        scene.add_point(f"L{k}", f"b{k}", (-0.5, 0.0, 0.0))
        scene.add_point(f"R{k}", f"b{k}", (0.5, 0.0, 0.0))
    scene.add_joint("sph", "upper", P_i="L0", P_j="ground.O")
    scene.add_joint("sph", "lower", P_i="L1", P_j="R0")
    scene.add_force("weight", "gravity")
    return scene


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "name", "factor", "settings"),
    [
        # at a ratio from which on equations are solved in another way
        *((partial(chain, 1e3), "b1", factor, {"method": "standard"}) for factor in (0.01, 1e4)),
        *((partial(chain, 2.0), "b1", factor, {"method": "lsq"}) for factor in (0.01, 1e4)),
        (partial(dap.load, "walker"), "rear_right/shin", 1e-4, {}),  # light under what it carries
    ],
)
def test_masses_may_differ_far_more_or_less_than_in_the_scene(
    tmp_path, make, name, factor, settings
):
    """Rows are solved, and contacts stepped, as masses ask for that are set."""
    found, expected = compared(make(), [f"bodies.{name}.mass"], [factor], tmp_path, **settings)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.slow
def test_what_is_read_before_a_run_matters_not(tmp_path):
    """A ball thrown at the floor that it lies on bounces with what is set."""
    scene = bouncing()
    scene.bodies["ball"].r, scene.bodies["ball"].r_dot = (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)
    _, library = exported(
        scene, tmp_path, outputs=["ball.rd.z"], parameters=["forces.floor.e", "bodies.ball.mass"]
    )
    run = library.start(1.0)
    assert run["ball.rd.z"] == pytest.approx(0.8, rel=1e-14)
    run["forces.floor.e"] = 0.5
    assert run["ball.rd.z"] == pytest.approx(0.5, rel=1e-14)
    run["bodies.ball.mass"] = 3.0
    assert run["ball.rd.z"] == pytest.approx(0.5, rel=1e-14)
    y = run.values([name for name, kind in library.kinds.items() if kind == "state"])
    library.functions.dap3d_set_states(run._model, 0.0, y.ctypes.data)
    with pytest.raises(ValueError, match="before its states are"):
        run["bodies.ball.mass"] = 4.0


@pytest.mark.slow
def test_inputs_and_parameters_are_set_in_any_order(tmp_path):
    """A disk of 1.17 kg m^2 about its hub is given 2 rad/s at once: its work is its energy."""
    scene = dap.Scene(name="turntable")
    scene.add_body("disk", mass=2.0, Jp=(0.5, 0.5, 0.9), r=(0.3, 0, 0))
    scene.add_input("speed", value=0.0)
    scene.add_point("hub", "disk", (-0.3, 0, 0))
    scene.add_joint("rev", "axle", P_i="hub", P_j="ground.O", a_i="disk.z", a_j="ground.z")
    scene.add_joint("motor", "drive", joint="axle", speed="speed")
    _, library = exported(scene, tmp_path, outputs=["work"], parameters=["bodies.disk.mass"])
    for names in (("speed", "bodies.disk.mass"), ("bodies.disk.mass", "speed")):
        run = library.start(1.0)
        for name in names:
            run[name] = {"speed": 2.0, "bodies.disk.mass": 3.0}[name]
        run.step_to(0.1)
        assert run["work"] == pytest.approx(0.5 * (0.9 + 3.0 * 0.3**2) * 2.0**2, rel=1e-13)


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
