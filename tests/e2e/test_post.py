"""``dap3d post`` and ``dap3d export`` as a user meets them: files that other programs read."""

import csv
import json

import numpy as np
import pytest
import xarray

import dap3d_core as dap


def table_of(file):
    """Columns of a CSV file by heading, as Python reads them."""
    with file.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


@pytest.mark.slow
def test_a_table_reads_back_bit_for_bit(dap3d, pen1):
    dap3d.succeed("post", "pen1.nc", "-o", "all.csv", "--jac")
    column = table_of(dap3d.folder / "all.csv")
    for name, values in (
        ("t [s]", pen1.t),
        ("cone.r.z [m]", pen1.r[:, 0, 2]),
        ("cone.p.e0 [1]", pen1.p[:, 0, 0]),
        ("cone.wpd.y [rad/s^2]", pen1.wpd[:, 0, 1]),
        ("P1.r.x [m]", pen1.rP[:, 0, 0]),
        ("animation.4.v.z [m/s]", pen1.rPd[:, 5, 2]),
        ("animation.1.a.x [m/s^2]", pen1.rPdd[:, 2, 0]),
        ("J1.lambda.3 [SI]", pen1.Lam[:, 2]),
        ("J1.i.force_body.y [N]", pen1.reaction("J1")["i"].force_body[:, 1]),
        ("J1.j.moment.z [N m]", pen1.reaction("J1")["j"].moment[:, 2]),
        ("energy.total [J]", pen1.energy.total),
        ("constraint.position [SI]", pen1.arrays.position_residual),
        ("J1.Jac.1.cone.rd.x [SI]", pen1.Jac[:, 0, 0]),
        ("J1.Jac.3.cone.w.z [SI]", pen1.Jac[:, 2, 5]),
    ):
        assert column[name].tolist() == values.tolist(), name
    for heading in column:  # what the table calls it, plots understand
        name, unit = heading[:-1].split(" [")
        if ".Jac." not in name:
            quantity = pen1.quantity(name)
            assert quantity.values.tolist() == column[heading].tolist()
            assert quantity.unit == unit


@pytest.mark.slow
def test_what_was_written_as_json(dap3d, pen1):
    done = dap3d("post", "pen1.nc", "--json")
    found = json.loads(done.stdout)
    assert found["file"] == "pen1-post.nc"
    assert (found["format"], found["instants"], found["notes"]) == ("nc", 6, [])
    arrays = {a["name"]: a for a in found["arrays"]}
    assert arrays["rP"]["shape"] == [6, 6, 3]
    assert arrays["rP"]["dimensions"] == ["time", "point", "axis"]
    assert arrays["wd"]["unit"] == "rad/s^2"
    assert "Jac" not in arrays
    with xarray.open_dataset(dap3d.folder / "pen1-post.nc") as data:
        assert set(arrays) == set(data.variables)
    columns = json.loads(dap3d("post", "pen1.nc", "--format", "csv", "--json").stdout)
    assert columns["file"] == "pen1-post.csv"
    headings = [f"{a['name']} [{a['unit']}]" for a in columns["arrays"]]
    assert headings == list(table_of(dap3d.folder / "pen1-post.csv"))


@pytest.mark.slow
def test_types_of_the_model_itself_are_loaded_only_when_allowed(dap3d, refuse):
    """A result does not say where they stand; the message says what to do."""
    dap.simulate("ball1", t_end=0.1, allow_code=True).save(dap3d.folder / "ball1.nc")
    words = refuse("post", "ball1.nc", "contact.force", "-o", "a.csv")
    for part in ("ball-contact", "--model FOLDER --allow-code", "model=FOLDER, allow_code=True"):
        assert part in words
    words = refuse("post", "ball1.nc", "contact.force", "-o", "a.csv", "--model", "ball1")
    assert "not run unless it is allowed" in words
    refuse("post", "ball1.nc", "-o", "a.csv", "--model", "ball9", "--allow-code")
    dap3d.succeed("post", "ball1.nc", "contact.force", "-o", "a.csv", "--model", "ball1",
                 "--allow-code")  # fmt: skip
    column = table_of(dap3d.folder / "a.csv")
    assert set(column["contact.force.z [N]"]) == {0.0}  # it has not reached the ground


@pytest.mark.slow
def test_reactions_that_cannot_be_had_are_left_out_and_told(dap3d, pen1):
    """The types of the joints are blocked, as if the package that brought them were gone."""
    done = dap3d.succeed("post", "pen1.nc", "-o", "a.nc", DAP3D_BLOCK="dap3d")
    assert "reactions are left out: the model of pen1.nc cannot be made again" in done.stderr
    with xarray.open_dataset(dap3d.folder / "a.nc") as data:
        assert "reaction_force" not in data
        assert data["Lam"].values.tolist() == pen1.Lam.tolist()
    told = json.loads(dap3d("post", "pen1.nc", "-o", "b.csv", "--json", DAP3D_BLOCK="dap3d").stdout)
    assert told["notes"][0].startswith("reactions are left out")
    assert dap3d("post", "pen1.nc", "--jac", "-o", "c.nc", DAP3D_BLOCK="dap3d").returncode == 2
    assert not (dap3d.folder / "c.nc").exists()


def test_each_format_has_its_file(dap3d, refuse, pen1):
    for kind, suffix in (("vtk", "vtkhdf"), ("gltf", "glb"), ("mat", "mat"), ("csv", "csv")):
        done = dap3d.succeed("export", "pen1.nc", "--format", kind)
        assert f"pen1.{suffix} written" in done.stdout
        assert "6 instants" in done.stdout
        assert f"pen1.{suffix} exists" in refuse("export", "pen1.nc", "--format", kind)
    told = dap3d("export", "pen1.nc", "-o", "a.glb", "--fps", "20", "--json")
    found = json.loads(told.stdout)
    assert (found["file"], found["format"], found["instants"]) == ("a.glb", "gltf", 3)
    assert found["size_bytes"] == (dap3d.folder / "a.glb").stat().st_size
    silent = dap3d("export", "pen1.nc", "-o", "a.glb", "--force", "-q")
    assert (silent.returncode, silent.stdout, silent.stderr) == (0, "", "")
