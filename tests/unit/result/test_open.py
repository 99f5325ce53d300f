"""A result survives its file bit for bit, and no file is misread.

Results that are too large for memory stay in their file, and answer as others do.
"""

import os
import pickle
import textwrap
import tomllib
import tracemalloc

import attrs
import netCDF4
import numpy as np
import pytest
import xarray
from support import problems
from support.ended import shorten_chunks
from support.internals import Evaluator, scene_of
from support.plain import long_in_plain_python
from support.process import run
from support.results import (
    CONTROLLED,
    circling,
    circling_scene,
    drifting,
    model_of,
    noisy,
    same_bits,
)

import dap3d_core as dap
from dap3d_core.result import ResultError, RunMetadata, RunStatistics, open_result

ABOUT = dict(
    status="interrupted",
    notes=["Newton's note: Δ|C| = 1e-9", 'a "second"'],
    stats=RunStatistics(steps=3, rejected=1, rhs=40, projections=4, wall_time_s=0.25),
    known_versions={"dap3d": "0.1", "numpy": "2", "llvmlite": "0", "python": "3"},
)
SHORT = {"t_end": 0.6, "dt": 0.01}


def rebuild(text):
    model = model_of(scene_of(tomllib.loads(text)))
    return model, lambda: Evaluator(model, "standard")


# ---------------------------------------------------------------------------- round trip


@pytest.mark.parametrize("name", ["pen1", "bodies2", "fourbar3"])
def test_round_trip_is_bit_for_bit(tmp_path, name):
    scene = dap.load(name)
    model = model_of(scene)
    record = RunMetadata(scene_text=scene.to_toml(), settings=CONTROLLED, **ABOUT)
    result = dap.Result.of_run(model, noisy(model), record, lambda: None)
    result.save(tmp_path / "run.nc")
    found = open_result(tmp_path / "run.nc")
    assert same_bits(found, result)
    assert found.record == result.record
    for constant in attrs.fields(type(result.summary)):
        np.testing.assert_array_equal(
            getattr(found.summary, constant.name), getattr(result.summary, constant.name)
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
    result = dap.Result.of_run(model, rows, RunMetadata(scene_text="[scene]\n"), lambda: None)
    result.save(tmp_path / "run.nc")
    assert same_bits(open_result(tmp_path / "run.nc"), result)


def test_text_of_a_large_scene_and_odd_names(tmp_path):
    """An attribute beyond the 64 KiB of old HDF5 files; names in any script."""
    scene = circling_scene()
    scene.description = "ä€😀" * 60_000
    scene.add_body("Kurbel ä 手", mass=1.0, Jp=[1, 1, 1], r=[9, 9, 9])
    model = model_of(scene)
    record = RunMetadata(scene_text=scene.to_toml())
    result = dap.Result.of_run(model, noisy(model), record, lambda: None)
    result.save(tmp_path / "räder.nc")
    found = open_result(tmp_path / "räder.nc")
    assert found.scene_text == result.scene_text
    assert found.summary.body_names == ("bob", "Kurbel ä 手")


# ---------------------------------------------------------------------------- what others read


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


def changed(path, change):
    with netCDF4.Dataset(path, "a") as file:
        change(file)
    return path


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f: f.setncattr("format", np.int32(2)), r"in format 2.*install a newer dap3d"),
        (lambda f: f.renameVariable("u", "v"), "it is damaged"),
        (lambda f: f.renameVariable("body", "bodies"), "it is damaged"),
        (lambda f: f.delncattr("scene"), "it is damaged"),
        (lambda f: f.setncattr("settings", "{"), "it is damaged"),
        (lambda f: f.setncattr("status", "fine"), "it is damaged"),
    ],
)
def test_a_file_that_lacks_something_or_is_of_a_newer_program_is_refused(tmp_path, change, words):
    circling()[0].save(tmp_path / "run.nc")
    with pytest.raises(ResultError, match=words):
        open_result(changed(tmp_path / "run.nc", change))


@pytest.fixture
def small_limits(monkeypatch):
    """Everything is large, and a block has few rows."""
    monkeypatch.setattr("dap3d_core.simulation.run_state.LARGE", 200)
    monkeypatch.setattr("dap3d_core.result.open.LARGE", 200)
    monkeypatch.setattr("dap3d_core.result.arrays.BLOCK", 300)


@pytest.fixture
def both(tmp_path, monkeypatch, small_limits):
    """The same run in memory, and in its file."""
    shorten_chunks(monkeypatch)
    whole = dap.simulate(problems.four_bar(), **SHORT)
    large = dap.simulate(problems.four_bar(), output=tmp_path / "run.nc", **SHORT)
    assert type(whole.arrays) is not type(large.arrays)
    return whole, large


def test_a_large_result_is_the_same(both, tmp_path):
    whole, large = both
    assert [f.name for f in tmp_path.iterdir()] == ["run.nc"]
    assert same_bits(large, whole)
    assert large.ledger == whole.ledger
    again = dap.open(tmp_path / "run.nc")
    assert type(again.arrays) is type(large.arrays)
    assert same_bits(again, whole)
    assert same_bits(pickle.loads(pickle.dumps(again)), whole)
    assert again.reaction("A0")["i"].force.tobytes() == whole.reaction("A0")["i"].force.tobytes()
    assert large.error is None


def test_parts_and_blocks_are_those_of_the_whole(both):
    whole, large = both
    for rows in (slice(1), slice(3, 9), slice(-2, None), slice(0, 20, 3), slice(7, 7)):
        one, other = large.arrays.part(rows), whole.arrays.part(rows)
        assert one.u.tobytes() == other.u.tobytes()
        assert one.t.tobytes() == other.t.tobytes()
    places = np.array([0, 2, 3, 30, 60])
    assert large.arrays.at(places).Lam.tobytes() == whole.arrays.at(places).Lam.tobytes()
    blocks = list(large.arrays.blocks())
    assert len(blocks) > 5
    assert sum(len(block) for block in blocks) == len(large.arrays) == 61
    assert len(dap.view(large).html) > 1000


@pytest.mark.slow
def test_a_file_may_be_opened_and_dropped_in_threads(tmp_path):
    """HDF5 crashed where some of several handles of one file were closed, or closed meanwhile."""
    dap.simulate(problems.pendulum(), output=tmp_path / "run.nc", **SHORT)
    code = """
        from concurrent.futures import ThreadPoolExecutor
        from importlib import import_module

        import dap3d_core as dap

        import_module("dap3d_core.result.open").LARGE = 0

        def open_and_drop(_):
            for _ in range(20):
                result = dap.open("run.nc")
                result.itself = result  # only the garbage collector drops it
                assert result.u.shape == (61, 13)

        with ThreadPoolExecutor(4) as pool:
            print(len(list(pool.map(open_and_drop, range(8)))))
    """
    assert run(textwrap.dedent(code), cwd=tmp_path) == "8"


@long_in_plain_python
def test_a_file_that_takes_its_name_changes_nothing(both, tmp_path):
    whole, large = both
    dap.simulate(problems.pendulum(), output=tmp_path / "run.nc", force=True, **SHORT)
    assert same_bits(large, whole)


@long_in_plain_python
def test_a_large_result_is_saved_again_over_itself(both, tmp_path):
    whole, large = both
    large.save(tmp_path / "run.nc", force=True)
    assert same_bits(dap.open(tmp_path / "run.nc"), whole)
    large.arrays = large.arrays.with_error(np.abs(large.u))
    large.save(tmp_path / "run.nc", force=True)
    assert dap.open(tmp_path / "run.nc").error.u.tobytes() == np.abs(whole.u).tobytes()


@pytest.mark.slow
def test_the_ledger_of_a_large_result_takes_little_memory(monkeypatch, tmp_path):
    """A hundredth of the arrays, but for the numbers of each instant that it compares."""
    monkeypatch.setattr("dap3d_core.result.open.LARGE", 200)
    monkeypatch.setattr("dap3d_core.result.arrays.BLOCK", 2**12)
    scene = problems.chain(40)
    dap.simulate(scene, t_end=0.1, dt=1e-4, rtol=1e-4, output=tmp_path / "run.nc")
    result = dap.open(tmp_path / "run.nc")
    tracemalloc.start()
    assert result.ledger["position"].ok
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 8 * len(result.arrays) * result.arrays.width > 5e6
    assert peak < 1e6


LONG = """
import resource
from importlib import import_module
import dap3d_core as dap
for name in ("result.open", "simulation.run_state"):
    import_module(f"dap3d_core.{name}").LARGE = 2**24
scene = dap.Scene(name="ten")
for k in range(10):
    scene.add_body(f"b{k}", mass=1.0, Jp=[0.1, 0.1, 0.1], r=[0.5 + k, 0, 0])
    scene.add_point(f"in{k}", body=f"b{k}", sPp=[-0.5, 0, 0])
    scene.add_point(f"out{k}", body=f"b{k}", sPp=[0.5, 0, 0])
    before = f"out{k - 1}" if k else "ground.O"
    scene.add_joint("sph", f"J{k}", P_i=f"in{k}", P_j=before)
scene.add_force("weight", "gravity")
peaks = []
for count in (1_000, 50_000):
    settings = dict(t_end=count * 1e-4, dt=1e-4, rtol=1e-5, output="run.nc", force=True)
    result = dap.simulate(scene, **settings)
    assert result.ledger["position"].ok, len(result.t) == count + 1
    peaks.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
print(peaks[1] - peaks[0], result.arrays.width * 8 * count / 2**20)
"""


@pytest.mark.slow
def test_a_long_run_takes_little_memory(tmp_path):
    """Of 50 000 instants, 87 MiB, memory holds 16 MiB (LARGE) for a moment, and some to work."""
    more, rows = map(float, run(LONG, cwd=tmp_path).split())
    assert rows > 80.0
    assert more < 48.0
