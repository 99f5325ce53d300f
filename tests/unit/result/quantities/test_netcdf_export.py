"""NetCDF exports of a result: units, large Jacobians, full disks, odd names."""

import errno

import netCDF4
import numpy as np
import pytest
import xarray
from support.internals import columns_of, dataset_to_write, selection_of, write_csv, write_netcdf
from support.results import circling, model_of, result_of

import dap3d_core as dap
from dap3d_core.result import ResultError


def test_a_jacobian_of_many_rows_is_written_by_its_entries(tmp_path, monkeypatch):
    monkeypatch.setattr("dap3d_core.result.quantities.netcdf_export.DENSE_ROWS", 2)
    result, _, _ = circling(nt=4)
    file = tmp_path / "all.nc"
    arrays = write_netcdf(result, file, dataset_to_write(result), jacobian=True, force=False)
    assert {a["name"] for a in arrays} >= {"Jac_row", "Jac_column", "Jac_value"}
    with xarray.open_dataset(file) as data:
        D = np.zeros((4, 3, 6))
        D[:, data["Jac_row"].values, data["Jac_column"].values] = data["Jac_value"].values
    np.testing.assert_array_equal(D, result.Jac)


def test_a_slash_in_a_name_is_no_group_of_netcdf():
    scene = dap.Scene(name="odd")
    scene.add_body("a/b", mass=1.0, Jp=[1, 1, 1])
    rows = np.zeros((1, 25))
    rows[0, 4] = 1.0
    result = result_of(scene, rows, model_of(scene), "unconstrained")
    with pytest.raises(ResultError, match=r"write a \.csv file"):
        selection_of(result, ["a/b.r"])


def test_a_file_that_cannot_be_finished_leaves_nothing(tmp_path, monkeypatch):
    result, _, _ = circling()
    dataset = dataset_to_write(result)

    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("dap3d_core.result.quantities.netcdf_export._add_jacobian", full)
    with pytest.raises(ResultError, match=r"cannot write .*all\.nc: No space left"):
        write_netcdf(result, tmp_path / "all.nc", dataset, jacobian=True, force=False)
    monkeypatch.setattr("dap3d_core.result.quantities.csv_table._write", full)
    with pytest.raises(ResultError, match=r"cannot write .*all\.csv: No space left"):
        write_csv(result, tmp_path / "all.csv", columns_of(result))
    assert list(tmp_path.iterdir()) == []


def test_every_variable_has_a_unit(tmp_path):
    result, _, _ = circling()
    write_netcdf(result, tmp_path / "a.nc", dataset_to_write(result), jacobian=True, force=False)
    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        for name, variable in file.variables.items():
            assert variable.units, name
            assert variable.long_name, name
        assert file.getncattr("Conventions") == "dap3d-post"
