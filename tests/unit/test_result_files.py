"""A result survives its file bit for bit, and no file is lost, half written or misread."""

import os
import signal
import subprocess
import sys
import textwrap
import tomllib
from concurrent.futures import ThreadPoolExecutor

import attrs
import netCDF4
import numpy as np
import pytest
import xarray
from unit.test_result import CONTROLLED, circling, circling_scene, drifting, model_of

from dap3d_core.formulations.evaluator import Machine
from dap3d_core.model.state_layout import split
from dap3d_core.result import (
    Record,
    Result,
    ResultError,
    ResultWriter,
    Statistics,
    open_result,
)
from dap3d_core.result.arrays import COLUMNS, row_width
from dap3d_core.scene import load
from dap3d_core.scene.files.read_toml import scene_of

ABOUT = dict(
    status="interrupted",
    notes=["Newton's note: Δ|C| = 1e-9", 'a "second"'],
    stats=Statistics(steps=3, rejected=1, rhs=40, projections=4, wall_time_s=0.25),
    known_versions={"dap3d": "0.1", "numpy": "2", "llvmlite": "0", "python": "3"},
)


def same_bits(left, right):
    for column in COLUMNS:
        a, b = (getattr(side.arrays, column.name) for side in (left, right))
        assert a.shape == b.shape
        assert a.dtype == b.dtype
        assert a.tobytes() == b.tobytes(), column.name
    return True


def rebuild(text):
    model = model_of(scene_of(tomllib.loads(text)))
    return model, lambda: Machine(model, "standard")


# ---------------------------------------------------------------------------- round trip


def noisy(model, nt=9, seed=3):
    """Rows of random bits, as large as a run may leave; Euler parameters and times are plain."""
    rng = np.random.default_rng(seed)
    n = model.body_count
    width = 1 + 13 * n + 1 + 6 * n + model.row_count + 4
    rows = rng.normal(size=(nt, width)) * 10.0 ** rng.integers(-200, 99, size=(nt, width))
    rows[:, 0] = np.cumsum(rng.random(nt))
    rows[:, 1 : 1 + 13 * n] = rng.normal(size=(nt, 13 * n))
    rows[0, -1] = -0.0
    rows[1, -1] = 5e-324
    return rows


@pytest.mark.parametrize("name", ["pen1", "bodies2", "fourbar3"])
def test_round_trip_is_bit_for_bit(tmp_path, name):
    scene = load(name)
    model = model_of(scene)
    record = Record(scene_text=scene.to_toml(), settings=CONTROLLED, **ABOUT)
    result = Result.of_run(model, noisy(model), record, lambda: None)
    result.save(tmp_path / "run.nc")
    found = open_result(tmp_path / "run.nc")
    assert same_bits(found, result)
    assert found.record == result.record
    for constant in attrs.fields(type(result.subject)):
        np.testing.assert_array_equal(
            getattr(found.subject, constant.name), getattr(result.subject, constant.name)
        )
    for array in ("r", "p", "rd", "w", "wp", "rdd", "wd", "wpd", "rP", "rPd", "rPdd"):
        np.testing.assert_array_equal(getattr(found, array), getattr(result, array))
    np.testing.assert_array_equal(found.energy.total, result.energy.total)
    assert found.ledger.keys() == result.ledger.keys()
    assert os.listdir(tmp_path) == ["run.nc"]  # nothing temporary is left


def test_jacobian_and_reactions_of_a_file_need_a_way_to_the_model(tmp_path):
    result, _, _ = circling()
    result.save(tmp_path / "run.nc")
    bare = open_result(tmp_path / "run.nc")
    for ask in (lambda r: r.Jac, lambda r: r.reaction("J1"), lambda r: r.model):
        with pytest.raises(ResultError, match=r"the model of .*run\.nc is needed"):
            ask(bare)
    found = open_result(tmp_path / "run.nc", rebuild)
    np.testing.assert_array_equal(found.Jac, result.Jac)
    np.testing.assert_array_equal(
        found.reaction("J1")["j"].moment, result.reaction("J1")["j"].moment
    )
    assert found.model.body_names == ("bob",)


def test_another_model_than_was_run_is_refused(tmp_path):
    circling()[0].save(tmp_path / "run.nc")
    other = drifting().model
    found = open_result(tmp_path / "run.nc", lambda text: (other, lambda: None))
    with pytest.raises(ResultError, match="gives another model"):
        _ = found.Jac


@pytest.mark.parametrize("nt", [0, 1])
def test_results_of_no_or_one_instant(tmp_path, nt):
    model = model_of(circling_scene())
    rows = noisy(model, 2)[:nt]
    result = Result.of_run(model, rows, Record(scene_text="[scene]\n"), lambda: None)
    result.save(tmp_path / "run.nc")
    assert same_bits(open_result(tmp_path / "run.nc"), result)


def test_text_of_a_large_scene_and_odd_names(tmp_path):
    """An attribute beyond the 64 KiB of old HDF5 files; names in any script."""
    scene = circling_scene()
    scene.description = "ä€😀" * 60_000
    scene.add_body("Kurbel ä 手", mass=1.0, Jp=[1, 1, 1], r=[9, 9, 9])
    model = model_of(scene)
    record = Record(scene_text=scene.to_toml())
    result = Result.of_run(model, noisy(model), record, lambda: None)
    result.save(tmp_path / "räder.nc")
    found = open_result(tmp_path / "räder.nc")
    assert found.scene_text == result.scene_text
    assert found.subject.body_names == ("bob", "Kurbel ä 手")


# ---------------------------------------------------------------------------- what others read


def test_the_file_names_its_dimensions_and_gives_units(tmp_path):
    result, _, _ = circling(**ABOUT)
    result.save(tmp_path / "run.nc")
    with netCDF4.Dataset(tmp_path / "run.nc") as file:
        sizes = {name: len(d) for name, d in file.dimensions.items()}
        assert sizes == {
            "time": 21, "body": 1, "axis": 3, "axis_2": 3, "euler": 4, "state": 13, "velocity": 6,
            "row": 3, "joint": 1, "point": 3,
        }  # fmt: skip
        for variable in file.variables.values():
            assert variable.units
            assert variable.long_name
        assert file["t"].units == "s"
        assert file["work"].units == "J"
        assert file["u"].dimensions == ("time", "state")
        assert list(file["point"][:]) == ["Q", "H", "P"]
        assert file.title == "circling"
        assert file.scene == result.scene_text
        assert file.status == "interrupted"
        assert '"rtol": 1e-08' in file.settings


def test_xarray_opens_the_file_with_names_and_units(tmp_path):
    result, _, _ = circling()
    result.save(tmp_path / "run.nc")
    with xarray.open_dataset(tmp_path / "run.nc") as found:
        assert found["work"].attrs["units"] == "J"
        assert "t" in found.coords
        assert found["body"].values.tolist() == ["bob"]
        np.testing.assert_array_equal(found["u"].values, result.u)


def test_to_xarray_has_every_array_with_units():
    result, _, _ = circling()
    found = result.to_xarray()
    for name in ("u", "v_dot", "Lam", "r", "p", "rd", "w", "wp", "rdd", "wd", "wpd", "rP", "rPd",
                 "rPdd", "work"):  # fmt: skip
        np.testing.assert_array_equal(found[name].values, getattr(result, name))
    np.testing.assert_array_equal(found["total_energy"], result.energy.total)
    for name, variable in found.data_vars.items():
        assert variable.attrs["units"], name
        assert variable.attrs["long_name"], name
    one = found["r"].sel(body="bob", axis="z")
    assert one.dims == ("time",)
    assert one.attrs["units"] == "m"
    assert found["time"].attrs["units"] == "s"
    assert found["row_joint"].values.tolist() == ["J1"] * 3
    assert found.attrs["scene"] == result.scene_text
    assert drifting().to_xarray().sizes["row"] == 0


# ---------------------------------------------------------------------------- writing safely


def test_an_existing_file_is_kept_unless_forced(tmp_path):
    path = tmp_path / "run.nc"
    path.write_text("precious")
    result, _, _ = circling()
    with pytest.raises(ResultError, match=r"cannot write .*run\.nc: the file exists; force"):
        result.save(path)
    with pytest.raises(ResultError, match="the file exists"):
        ResultWriter(path, result.subject, result.record, len(result.t))
    assert path.read_text() == "precious"
    assert os.listdir(tmp_path) == ["run.nc"]
    result.save(path, force=True)
    assert same_bits(open_result(path), result)


def test_places_that_cannot_be_written_are_refused_in_a_sentence(tmp_path):
    result, _, _ = circling()
    (tmp_path / "file").touch()
    for path, words in {
        tmp_path / "nowhere" / "run.nc": "there is no folder .*nowhere",
        tmp_path / "file" / "run.nc": "there is no folder|Not a directory",
        tmp_path: "it is a folder",
        "/dev/null": "it is no regular file",
        "a\0b": "null byte",
    }.items():
        with pytest.raises(ResultError, match=words):
            result.save(path, force=True)
    assert issubclass(ResultError, OSError)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write all")
def test_a_folder_without_permission(tmp_path):
    result, _, _ = circling()
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(ResultError, match="no permission"):
            result.save(tmp_path / "run.nc")
    finally:
        tmp_path.chmod(0o700)


def test_a_write_that_fails_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "run.nc"
    result, _, _ = circling()
    result.save(path)
    before = path.read_bytes()

    def fail(*_):
        raise RuntimeError("NetCDF: HDF error")

    monkeypatch.setattr("dap3d_core.result.file.write.write_rows", fail)
    with pytest.raises(ResultError, match=r"run\.nc: .*is the disk full"):
        result.save(path, force=True)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["run.nc"]


@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="no limits of file size here")
def test_a_full_disk(tmp_path):
    """The system refuses to write more than 50 kB to a file."""
    code = f"""
        import resource, signal, sys
        sys.path.insert(0, {os.path.dirname(os.path.dirname(__file__))!r})
        from unit.test_result import circling
        from dap3d_core.result import ResultError
        result = circling(nt=5000)[0]
        sys.dont_write_bytecode = True  # it would be cut off, and kept
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, resource.RLIM_INFINITY))
        try:
            result.save("run.nc")
        except ResultError as error:
            print(error)
    """
    out = run(code, tmp_path)
    assert "cannot write run.nc" in out
    assert os.listdir(tmp_path) == []


def run(code, folder):
    found = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], cwd=folder, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    return found.stdout


def test_threads_may_write_and_read_at_once(tmp_path):
    """The NetCDF library is not made for threads: one at a time uses it."""
    result, _, _ = circling(nt=300)

    def there_and_back(k):
        result.save(tmp_path / f"{k}.nc")
        return same_bits(open_result(tmp_path / f"{k}.nc"), result)

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(there_and_back, range(40)))


# ---------------------------------------------------------------------------- reading safely


def test_files_that_are_no_results(tmp_path):
    (tmp_path / "text.nc").write_text("t, x\n0, 1\n")
    (tmp_path / "empty.nc").touch()
    with netCDF4.Dataset(tmp_path / "other.nc", "w") as file:
        file.createDimension("time", 3)
    for name, words in {
        "missing.nc": "there is no such file",
        ".": "it is a folder",
        "text.nc": "it is not a NetCDF-4 file",
        "empty.nc": "the file is empty",
        "other.nc": "a NetCDF-4 file, but no result of dap3d",
        "a\0b": "null byte",
    }.items():
        with pytest.raises(ResultError, match=words):
            open_result(tmp_path / name)


@pytest.mark.parametrize("kept", [8, 100, 3000, 0.5, 0.9, -1])
def test_a_file_cut_off_anywhere_is_refused(tmp_path, kept):
    circling(nt=200)[0].save(tmp_path / "run.nc")
    data = (tmp_path / "run.nc").read_bytes()
    size = int(kept * len(data)) if isinstance(kept, float) else kept
    (tmp_path / "cut.nc").write_bytes(data[:size])
    with pytest.raises(
        ResultError, match=r"cannot read .*cut\.nc: it is cut off.* bytes are there"
    ):
        open_result(tmp_path / "cut.nc")


def changed(path, change):
    with netCDF4.Dataset(path, "a") as file:
        change(file)
    return path


def test_a_file_of_a_newer_program_is_refused_with_the_remedy(tmp_path):
    circling()[0].save(tmp_path / "run.nc")
    path = changed(tmp_path / "run.nc", lambda f: f.setncattr("format", np.int32(2)))
    with pytest.raises(ResultError, match=r"in format 2.*install a newer dap3d"):
        open_result(path)


@pytest.mark.parametrize(
    "change",
    [
        lambda f: f.renameVariable("u", "v"),
        lambda f: f.renameVariable("body", "bodies"),
        lambda f: f.delncattr("scene"),
        lambda f: f.setncattr("settings", "{"),
        lambda f: f.setncattr("status", "fine"),
    ],
)
def test_a_file_that_lacks_something_is_damaged(tmp_path, change):
    circling()[0].save(tmp_path / "run.nc")
    with pytest.raises(ResultError, match="it is damaged"):
        open_result(changed(tmp_path / "run.nc", change))


def test_width_of_rows_is_that_of_the_integrator():
    model = model_of(load("fourbar3"))
    result = Result.of_run(model, noisy(model), Record(scene_text=""), lambda: None)
    size = Machine(model, "standard").report_size
    assert row_width(result.subject) == 1 + 13 * model.body_count + 1 + size
    assert split(result.u)[0].shape == result.r.shape
