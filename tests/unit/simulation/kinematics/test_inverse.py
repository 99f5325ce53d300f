"""Inverse dynamics: motions as data, actuators, and what is refused."""

import re

import numpy as np
import pytest
from support import one_freedom
from support.plain import long_in_plain_python
from support.trees import mixed_chain

import dap3d_core as dap
from dap3d_core.result import find


@pytest.fixture(scope="module")
def scene():
    """A slider-crank with a driver."""
    return one_freedom.slider_crank_scene(0.3, (0.0, 5.0, 2.0))


@pytest.fixture(scope="module")
def motion(scene):
    """Its kinematics."""
    return dap.kinematics(scene, t_end=0.5, dt=0.01)


def crank_places(motion, **more):
    """The motion as data: both coordinates of the crank."""
    return {"t": motion.t, "crank.r.x": motion.r[:, 0, 0], "crank.r.z": motion.r[:, 0, 2]} | more


def undriven(scene):
    """The scene with a torque on the crank in place of its driver."""
    scene = scene.copy()
    del scene.joints["motor"], scene.functions["turning"]
    scene.add_force("np", "torque", body_i="crank", np=[0.0, -3.0, 0.0])
    return scene


def test_the_motion_of_a_driver_takes_the_force_of_the_driver(scene, motion):
    """All multipliers are those of kinematics."""
    result = dap.inverse(scene, motion, "motor")
    assert result.quantity("motor.actuation").unit == "N m"  # it holds an angle
    assert np.max(np.abs(result.Lam - motion.Lam)) < 1e-11 * np.max(np.abs(motion.Lam))
    assert np.array_equal(result.record.actuation["motor"], result.Lam[:, -1])


def test_a_force_element_takes_the_place_of_a_driver(scene, motion):
    """Its force is its quantity ``actuation``, and acts in its output, in a file too."""
    result = dap.inverse(undriven(scene), motion, ["torque"])
    moment = motion.reaction("motor")["i"].moment[:, 1]
    found = result.record.actuation["torque"]  # along (0, -1, 0)
    assert np.max(np.abs(moment + found)) < 1e-11 * np.max(np.abs(moment))
    assert np.max(np.abs(result.force("torque").on["i"].moment[:, 1] - moment)) < 1e-9


@long_in_plain_python
def test_an_actuator_whose_input_is_zero_moves_nothing(scene, motion):
    """A note says so, and no more that the actuation is redundant; with a value it is one."""
    free = undriven(scene)
    free.add_input("u")
    free.forces["torque"].fields["input"] = "u"
    notes = "\n".join(dap.inverse(free, motion, ["torque"]).notes)
    assert "torque moves nothing at any instant: an input" in notes
    assert "redundant" not in notes
    free.inputs["u"].value = 2.0
    found = dap.inverse(free, motion, ["torque"]).record.actuation["torque"]
    plain = dap.inverse(undriven(scene), motion, ["torque"]).record.actuation["torque"]
    np.testing.assert_allclose(2.0 * np.array(found), plain, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_actuation_is_stored(scene, motion, tmp_path):
    """The file gives the same numbers, also as a quantity."""
    result = dap.inverse(undriven(scene), motion, ["torque"], output=tmp_path / "a.nc")
    stored = dap.open(tmp_path / "a.nc")
    assert stored.record.actuation == result.record.actuation
    quantity = find(stored, "torque.actuation")
    assert np.array_equal(quantity.values, result.record.actuation["torque"])
    assert quantity.unit == "N m"
    assert np.array_equal(stored.force("torque").on["i"].moment,
                          result.force("torque").on["i"].moment)  # fmt: skip


@pytest.mark.slow
@long_in_plain_python
def test_positions_as_data_are_differentiated_by_splines(scene, motion, tmp_path):
    """Of two columns, one more than freedoms, from a CSV file; the error is of order dt^4."""
    names = ["t", "crank.r.x", "crank.r.z"]
    columns = crank_places(motion)
    path = tmp_path / "motion.csv"
    table = np.column_stack([columns[name] for name in names])
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.17g")
    errors = []
    for step in (1, 2):
        data = columns if step == 2 else None
        given = path if data is None else {name: data[name][::step] for name in names}
        result = dap.inverse(scene, given, "motor")
        errors.append(np.max(np.abs(result.Lam - motion.Lam[::step])[4:-4]))
        assert result.ledger["position"].ok
    assert errors[0] < 1e-5
    assert errors[1] > 8.0 * errors[0]


@pytest.mark.slow
@long_in_plain_python
def test_angles_of_joints_are_data_over_many_turns(scene):
    """One column for one freedom; the angle of the crank counts its turns, poses do not."""
    turning = dap.kinematics(scene, t_end=1.0, dt=0.125)
    angle = find(turning, "bearing.angle").values
    assert np.ptp(angle) > 2.0 * np.pi
    result = dap.inverse(scene, {"t": turning.t, "bearing.angle": angle}, "motor")
    assert np.max(np.abs(result.r - turning.r)) < 1e-12


@pytest.mark.slow
@long_in_plain_python
def test_data_that_contradict_the_joints_are_met_halfway(scene, motion):
    """The crank's place is too far out by 1 mm: the note says by how much it is missed."""
    data = crank_places(motion)
    data = {name: v if name == "t" else 1.02 * v for name, v in data.items()}
    result = dap.inverse(scene, data, "motor")
    assert np.max(np.abs(result.u - motion.u)[:, :21]) < 1e-9
    assert any("misses crank.r" in note for note in result.notes)


def test_redundant_actuation_is_of_least_norm(scene, motion):
    """A second equal torque halves the force, and a note says that the actuation is redundant."""
    two = undriven(scene)
    two.add_force("np", "second", body_i="crank", np=[0.0, -1.0, 0.0])
    one = dap.inverse(undriven(scene), motion, ["torque"])
    both = dap.inverse(two, motion, ["torque", "second"])
    alone = np.array(one.record.actuation["torque"])
    for name in ("torque", "second"):
        assert np.allclose(both.record.actuation[name], alone / 2.0, rtol=1e-10, atol=1e-12)
    assert any("redundant" in note for note in both.notes)


def test_forces_that_no_actuator_produces_are_told(scene, motion):
    """A force across the plane of the mechanism moves nothing: its share is zero."""
    across = undriven(scene)
    across.add_force("f", "across", body_i="slider", f=[0.0, 1.0, 0.0])
    result = dap.inverse(across, motion, ["across"])
    assert np.max(np.abs(result.record.actuation["across"])) == 0.0
    assert any("cannot produce" in note and "crank turns" in note for note in result.notes)


@pytest.mark.slow
@long_in_plain_python
def test_turns_of_an_angle_are_counted(scene, motion):
    """A spring wound up over whole turns acts with them."""
    wound = undriven(scene)
    wound.add_force("rot_sda", "spring", v_i="crank.x", v_j="ground.x", axis="ground.y", k=2.0,
                    turns=True)  # fmt: skip
    turning = dap.kinematics(scene, t_end=2.0, dt=0.05)  # some two turns
    with_spring = dap.inverse(wound, turning, ["torque"]).record.actuation["torque"]
    without = dap.inverse(undriven(scene), turning, ["torque"]).record.actuation["torque"]
    turned = 5.0 * turning.t + 2.0 * turning.t**2
    difference = np.array(with_spring) - np.array(without)
    assert np.max(np.abs(np.abs(difference) - 2.0 * (0.3 + turned))) < 1e-9


@pytest.mark.parametrize(
    ("columns", "actuators", "words"),
    [
        ({}, "moter", "did you mean 'motor'"),
        ({}, "wrist", "no driver: what it bears is found as its reaction"),
        ({}, "gravity", "nothing that an actuator sets"),
        ({}, ["motor", "motor"], "named twice"),
        ({}, [], "name the actuators"),
        ({"rod.w.y": 0.0}, "motor", "positions do not change this quantity"),
        ({"rood.r.x": 0.0}, "motor", "did you mean 'rod.r.x'"),
        ({"rod.r": 0.0}, "motor", "one of its components: rod.r.x, rod.r.y, rod.r.z"),
        ({"t": 1.0}, "motor", "times must increase"),
    ],
)
def test_wrong_requests_are_refused(scene, motion, columns, actuators, words):
    """With what there is, or the nearest name."""
    data = crank_places(motion)
    data |= {name: np.full(len(motion.t), value) for name, value in columns.items()}
    with pytest.raises(dap.SceneError) as caught:
        dap.inverse(scene, data, actuators)
    assert words in str(caught.value)


def test_a_motion_in_other_units_is_refused(scene, tmp_path):
    path = tmp_path / "motion.csv"
    path.write_text("t [s],crank.pitch [deg]\n" + "".join(f"{0.1 * k},{k}\n" for k in range(5)))
    with pytest.raises(dap.SceneError, match=r"motion.crank.pitch: .* in deg, and it is in rad"):
        dap.inverse(scene, path, "motor")


def test_a_motion_that_leaves_a_freedom_open_is_refused(scene, motion):
    """The slider does not tell which way the crank turns at a dead centre."""
    with pytest.raises(dap.SimulationError, match=r"leaves 1 of 1 degrees.*give \w+\.angle as"):
        dap.inverse(scene, {"t": motion.t, "crank.r.y": motion.t}, "motor")
    with pytest.raises(dap.SceneError, match="no body 'follower'"):
        dap.inverse("fourbar2", motion)
    with pytest.raises(dap.SceneError, match="a column called t"):
        dap.inverse(scene, {"crank.r.x": motion.t})
    with pytest.raises(dap.SceneError, match="4 instants or more"):
        dap.inverse(scene, {n: v[:3] for n, v in crank_places(motion).items()})


@pytest.mark.slow
def test_what_is_to_be_given_is_named_once():
    """Two rods below a first one that is given, on a ball joint and a hinge: four positions."""
    scene = mixed_chain(3)
    scene.add_force("np", "torque", body_i="b0", np=[0.0, 1.0, 0.0])
    motion = dap.simulate(scene, t_end=0.1, dt=0.01)
    columns = {"t": motion.t, "b0.r.x": motion.r[:, 0, 0], "b0.r.z": motion.r[:, 0, 2]}
    with pytest.raises(dap.SimulationError, match="leaves 4 of 5 degrees") as caught:
        dap.inverse(scene, columns, "torque")
    names = re.search("give (.*) as well", str(caught.value))[1].split(", ")
    assert len(set(names)) == 4
    assert {name[:3] for name in names} == {"J1.", "J2."}
    found = dap.inverse(scene, columns | {n: motion.quantity(n).values for n in names}, "torque")
    np.testing.assert_allclose(found.p, motion.p, atol=1e-8)
