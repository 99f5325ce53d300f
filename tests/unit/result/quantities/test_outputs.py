"""Outputs of a scene are quantities of its results, everywhere."""

import csv

import attrs
import numpy as np
import pytest
from support.internals import columns_of, dataset_to_write, selected, write_csv
from support.results import ARM, MASS, RATE, circling

import dap3d_core as dap
from dap3d_core.result import ResultError, UnknownNameError, find, names_of, open_result

OUTPUTS = {
    "angle": "atan2(arm.y, arm.x)",
    "arm": "bob.r - Q.r",
    "reach": "norm(arm)",
    "pull": "norm(J1.force) / 2",
    "row": "-'J1.lambda.2'",
    "late": "log(t)",
    "turns": "angle / (2 * pi)",
    "share": "bob.r.x / reach",
    "mixed": "bob.rd.x * bob.rd.y",
    "fixed": "2 * pi",
    "drift": "bob.p * t",
}
UNITS = {"angle": "rad", "arm": "m", "reach": "m", "pull": "N", "row": "SI", "late": "1",
         "turns": "", "share": "1", "mixed": "m^2/s^2", "fixed": "1", "drift": "s"}  # fmt: skip


@pytest.fixture(scope="module")
def bob():
    """A bob that circles, with outputs of it, and the direction of its arm."""
    return circling(outputs=OUTPUTS)[:2]


@pytest.fixture(scope="module")
def result(bob):
    return bob[0]


def test_values_of_a_known_motion(bob):
    result, out = bob
    value = {name: result.quantity(name).values for name in OUTPUTS}
    wrapped = (RATE * result.t + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(value["angle"], wrapped, atol=1e-14)
    np.testing.assert_allclose(value["arm"], ARM * out, atol=1e-15)
    np.testing.assert_allclose(value["reach"], ARM, rtol=1e-15)
    np.testing.assert_allclose(value["pull"], 0.5 * MASS * RATE**2 * ARM, rtol=1e-14)
    np.testing.assert_array_equal(value["row"], -result.Lam[:, 1])
    np.testing.assert_array_equal(value["fixed"], np.full(len(result.t), 2 * np.pi))
    assert value["drift"].shape == (len(result.t), 4)


def test_units_of_sums_and_simple_products(result):
    assert {name: result.quantity(name).unit for name in OUTPUTS} == UNITS


def test_components_of_vectors(result):
    arm = result.quantity("arm").values
    np.testing.assert_array_equal(result.quantity("arm.y").values, arm[:, 1])
    np.testing.assert_allclose(result.quantity("arm.norm").values, ARM, rtol=1e-15)
    np.testing.assert_array_equal(
        result.quantity("drift.e3").values, result.quantity("drift").values[:, 3]
    )
    with pytest.raises(UnknownNameError, match="the output arm has x, y, z, norm"):
        result.quantity("arm.e0")
    with pytest.raises(UnknownNameError, match="the output reach has no components"):
        result.quantity("reach.x")


def test_a_wrong_name_is_answered_with_that_of_an_output(result):
    with pytest.raises(UnknownNameError, match="did you mean 'reach'"):
        result.quantity("raech")


def test_names_are_completed(result):
    assert {*OUTPUTS} <= {*names_of(result)}
    assert names_of(result, "ar") == ["arm"]
    assert names_of(result, "arm.") == ["arm.x", "arm.y", "arm.z", "arm.norm"]


def test_an_undefined_value_is_nan_and_noted():
    result, _, _ = circling(outputs=OUTPUTS)
    assert np.isnan(result.quantity("late").values[0])
    assert np.isfinite(result.quantity("late").values[1:]).all()
    (note,) = result.notes
    assert "output late has no finite value at 1 of 21 instants, first at t = 0 s" in note
    result.quantity("late")
    assert len(result.notes) == 1


def test_tables_and_data_sets_hold_outputs(result, tmp_path):
    columns = {column.name: column for column in columns_of(result)}
    np.testing.assert_array_equal(columns["arm.z"].values, result.quantity("arm.z").values)
    write_csv(result, tmp_path / "some.csv", selected(result, ["reach", "arm"]))
    with (tmp_path / "some.csv").open() as file:
        head, *rows = csv.reader(file)
    assert head == ["t [s]", "reach [m]", "arm.x [m]", "arm.y [m]", "arm.z [m]"]
    np.testing.assert_array_equal([float(row[2]) for row in rows], columns["arm.x"].values)
    dataset = result.to_xarray()
    np.testing.assert_array_equal(dataset["arm"].sel(axis="y"), columns["arm.y"].values)
    assert dataset["arm"].attrs == {"units": "m", "long_name": "output arm = bob.r - Q.r"}
    assert dataset["drift"].dims == ("time", "euler")


def test_an_output_named_like_an_array_does_not_hide_it():
    names = ("r", "mass", "joint_q", "state", "Jac", "reaction_force")
    result, _, _ = circling(outputs=dict.fromkeys(names, "bob.r.x"))
    dataset = dataset_to_write(result)
    np.testing.assert_array_equal(dataset["r"], result.r)
    np.testing.assert_array_equal(dataset["r_output"], result.quantity("r").values)
    assert dataset["mass"].dims == ("body",)
    assert dataset["reaction_force"].dims == ("time", "reaction", "axis")
    assert {f"{name}_output" for name in names} <= {*dataset.variables}
    assert "reaction_force" in result.to_xarray()  # which has no array of this name


def test_outputs_of_a_result_without_instants():
    whole, _, _ = circling(outputs={"late": "1 / t", "arm": "bob.r - Q.r"})
    arrays = whole.arrays.part(slice(0, 0))
    result = dap.Result(whole.summary, arrays, whole.record, lambda: whole._origin)
    assert result.quantity("late").values.shape == (0,)
    assert result.quantity("arm").values.shape == (0, 3)
    assert result.coordinates("J1").q.shape == (0, 3)


def test_a_file_gives_the_same_and_reactions_only_with_a_model(result, tmp_path):
    result.save(tmp_path / "a.nc")
    opened = dap.open(tmp_path / "a.nc")
    for name in OUTPUTS:
        np.testing.assert_array_equal(
            opened.quantity(name).values, result.quantity(name).values, err_msg=name
        )
    bare = open_result(tmp_path / "a.nc")
    assert np.all(bare.quantity("reach").values > 0.0)
    with pytest.raises(ResultError, match="the model of"):
        bare.quantity("pull")
    assert "reach" in bare.to_xarray()
    assert "pull" not in bare.to_xarray()


def test_outputs_of_a_damaged_file_are_refused_in_words():
    result, _, _ = circling()
    text = f'{result.scene_text}\n[outputs]\na = "b"\nb = "a"\n'
    result.record = attrs.evolve(result.record, scene_text=text)
    with pytest.raises(ResultError, match="in a circle"):
        result.quantity("a")
    with pytest.raises(ResultError, match="in a circle"):
        find(result, "nothing")
    np.testing.assert_array_equal(result.quantity("bob.r").values, result.r[:, 0])


def test_sweeps_reduce_outputs_as_single_runs_do(tmp_path):
    """With a mass that varies, in what is computed from rows and in what is not."""
    scene = dap.Scene(name="fall")
    scene.add_body("stone", mass=1.0, Jp=[1.0, 1.0, 1.0], r_dot=[1.0, 0.0, 2.0])
    scene.add_force("weight", "gravity")
    scene.add_output("height", "stone.r.z - 0.1")
    scene.add_output("twice", "2 * height")
    scene.add_output("energy_per_speed", "energy.kinetic / stone.rd.norm")
    scene.add_output("masked", "where(t > 100, work, 1)")
    names = ["twice:max", "energy_per_speed:end", "masked:end", "height:series"]
    masses = [1.0, 2.0, 3.0]
    sweep = dap.sweep(scene, vary={"bodies.stone.mass": masses}, outputs=names, t_end=0.5, dt=0.1)
    for k, mass in enumerate(masses):
        scene.bodies["stone"].mass = mass
        result = dap.simulate(scene, t_end=0.5, dt=0.1)
        value = {name: result.quantity(name).values for name in scene.outputs}
        np.testing.assert_array_equal(sweep["twice:max"][k], value["twice"].max())
        np.testing.assert_array_equal(
            sweep["energy_per_speed:end"][k], value["energy_per_speed"][-1]
        )
        np.testing.assert_array_equal(sweep["masked:end"][k], 1.0)
        np.testing.assert_array_equal(sweep["height:series"][k], value["height"])
