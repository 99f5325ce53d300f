"""Joint coordinates are quantities: of runs with known motions, of any type, from files too."""

import numpy as np
import pytest
from support.internals import columns_of, dataset_to_write
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.result import ResultError, UnknownNameError, names_of, open_result

RATE, SPEED, TILT = 100.0, 0.7, 0.4
#: Cosine and sine of half a turn by TILT about z.
TURNED = (np.cos(TILT / 2), 0.0, 0.0, np.sin(TILT / 2))


def spinning(kind):
    """A body without loads on a joint along z to ground, that turns and advances uniformly."""
    scene = dap.Scene(name="spinning")
    along = SPEED if kind == "cyl" else 0.0
    scene.add_body("disc", mass=2.0, Jp=[0.1, 0.1, 0.2], r=[0.3, -0.2, 0.5], p=TURNED,
                   r_dot=[0, 0, along], w=[0, 0, RATE])  # fmt: skip
    scene.add_point("centre", "ground", [0.3, -0.2, 0.5])
    axes = dict(a_i="disc.z", a_j="ground.z")
    scene.add_joint(kind, "hinge", P_i="disc.O", P_j="centre", **axes)
    return scene


@pytest.fixture(scope="module")
def turning():
    """Five radians from one reported instant to the next: more than half a turn."""
    return dap.simulate(spinning("rev"), t_end=1.0, dt=0.05)


def test_a_screw_has_coordinates():
    """It turns by its advance over its pitch."""
    scene = dap.Scene(name="screw")
    scene.add_body("nut", mass=0.5, Jp=(2e-4, 2e-4, 2e-4))
    scene.add_joint("screw", "thread", P_i="nut.O", P_j="ground.O", a_i="nut.z", a_j="ground.z",
                    pitch=0.01)  # fmt: skip
    scene.add_force("weight")
    result = dap.simulate(scene, t_end=0.5, dt=0.05, rtol=1e-10, atol=1e-12)
    angle, z = result.quantity("thread.angle").values, result.quantity("nut.r.z").values
    pitch = 0.01 / (2 * np.pi)
    np.testing.assert_allclose(pitch * angle, z, atol=1e-12)
    assert np.ptp(z) > 0.0


def test_a_file_gives_the_same(turning, tmp_path):
    turning.save(tmp_path / "a.nc")
    for name in ("hinge.angle", "hinge.q1_dot"):
        found = dap.open(tmp_path / "a.nc").quantity(name)
        np.testing.assert_array_equal(found.values, turning.quantity(name).values)
    bare = open_result(tmp_path / "a.nc")
    with pytest.raises(ResultError, match="the model of"):
        bare.quantity("hinge.angle")
    assert names_of(bare, "hinge.l") == ["hinge.lambda"]


@long_in_plain_python
def test_a_few_of_the_instants_have_the_turns_of_all():
    """A page shows some instants only: between these a body may turn several times."""
    scene = spinning("rev")
    scene.add_force("n", "brake", body_i="disc", n=[0.0, 0.0, -20.0])
    result = dap.simulate(scene, t_end=2.0, dt=0.01)
    index = np.array([0, 70, 200])
    few = result.at(index)
    np.testing.assert_array_equal(few.t, result.t[index])
    for name in ("hinge.angle", "hinge.angle_rate"):
        values = result.quantity(name).values
        np.testing.assert_array_equal(few.quantity(name).values, values[index])
    np.testing.assert_allclose(  # moment over inertia: -20 / 0.2 rad/s^2
        few.quantity("hinge.angle").values, RATE * few.t - 50.0 * few.t**2, atol=1e-7
    )


def test_names_that_a_joint_has_and_those_it_has_not(turning):
    assert [n for n in names_of(turning, "hinge.") if n.startswith(("hinge.q", "hinge.a"))] == [
        "hinge.q1", "hinge.angle", "hinge.q1_dot", "hinge.angle_rate",
    ]  # fmt: skip
    for name, words in {
        "hinge.q2": "has force, .*, q1, angle, q1_dot, angle_rate, not 'q2'",
        "hinge.length": "not 'length'",
        "hinge.angel": "did you mean 'hinge.angle'",
        "hinge.angle.z": "hinge.angle has no components",
        "hinge.i.angle": "not 'angle'",
    }.items():
        with pytest.raises(UnknownNameError, match=words):
            turning.quantity(name)


def test_a_joint_without_coordinates_says_why():
    result = dap.simulate("tri", t_end=0.0)
    for name, words in {"J6.q1": "rows of the velocity level", "J8.angle": "1 row"}.items():
        with pytest.raises(UnknownNameError, match=words):
            result.quantity(name)
    scene = dap.Scene(name="fixed")
    scene.add_body("block")
    scene.add_joint("fix", "weld", body_i="block")
    with pytest.raises(UnknownNameError, match="it leaves no freedom"):
        dap.simulate(scene, t_end=0.0).coordinates("weld")
    with pytest.raises(UnknownNameError, match="there is no joint 'weld'"):
        result.coordinates("weld")


def test_a_force_keeps_its_length_beside_a_joint_of_its_name():
    scene = spinning("rev")
    scene.add_force("ptp", "hinge", P_i="disc.O", P_j="ground.O", k=0.0, l0=0.0)
    result = dap.simulate(scene, t_end=0.0)
    reach = np.linalg.norm([0.3, -0.2, 0.5])
    np.testing.assert_allclose(result.quantity("hinge.length").values, reach, rtol=1e-15)
    assert result.quantity("hinge.angle").unit == "rad"


def test_tables_hold_coordinates(turning):
    columns = {column.name: column for column in columns_of(turning)}
    np.testing.assert_array_equal(
        columns["hinge.q1"].values, turning.quantity("hinge.angle").values
    )
    dataset = dataset_to_write(turning)
    np.testing.assert_array_equal(dataset["joint_q"].values[:, 0], columns["hinge.q1"].values)
    assert dataset["coordinate"].values.tolist() == ["hinge.q1"]
    assert dataset["coordinate_unit"].values.tolist() == ["rad"]
