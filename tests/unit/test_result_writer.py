"""A file that grows with the run is that of the whole, and whatever happens keeps what it had."""

import os
import signal
import subprocess
import sys
import textwrap

import attrs
import netCDF4
import numpy as np
import pytest
from unit.test_result import CONTROLLED, circling, model_of
from unit.test_result_files import ABOUT, noisy, run, same_bits

from dap3d_core.model.kinematics import to_integrated
from dap3d_core.result import Record, Result, ResultError, ResultWriter, open_result
from dap3d_core.result.arrays import COLUMNS
from dap3d_core.scene import load


def rows_of_result(result):
    last = [getattr(result.arrays, c.name) for c in COLUMNS[5:]]
    y = to_integrated(result.u, result.subject.body_count, result.work)
    return np.column_stack([result.t, y, result.v_dot, result.Lam, *last])


@pytest.mark.parametrize("pieces", [(1,) * 9, (4, 5), (9,), (0, 8, 1)])
@pytest.mark.parametrize("name", ["pen1", "pen2", "bodies2"])
def test_a_file_grown_in_pieces_is_that_of_the_whole(tmp_path, pieces, name):
    model = model_of(load(name))
    rows = noisy(model)
    record = Record(scene_text="[scene]\n", settings=CONTROLLED, notes=["as it starts"])
    with ResultWriter(tmp_path / "run.nc", model, record) as writer:
        first = 0
        for count in pieces:
            writer.append(rows[first : first + count])
            first += count
        assert writer.count == 9
        assert os.listdir(tmp_path) == ["run.nc.part"]
        final = attrs.evolve(record, notes=["as it ended"], stats=ABOUT["stats"])
        assert writer.close(final) == tmp_path / "run.nc"
    assert os.listdir(tmp_path) == ["run.nc"]
    whole = Result(model=model, machine_of=lambda: None, rows=rows, scene_text="[scene]\n")
    found = open_result(tmp_path / "run.nc")
    assert same_bits(found, whole)
    assert found.record == final


def test_a_writer_left_with_an_error_leaves_what_it_had(tmp_path):
    result, _, _ = circling()
    rows = rows_of_result(result)
    writer = ResultWriter(tmp_path / "run.nc", result.model, result.record)

    def interrupted():
        with writer:
            writer.append(rows[:7])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    found = open_result(tmp_path / "run.nc.part")
    assert found.status == "interrupted"
    assert found.notes == [
        f"the run was killed, or is still being written: the last instant is t = {result.t[6]:g} s"
    ]
    np.testing.assert_array_equal(found.t, result.t[:7])
    with pytest.raises(ResultError, match="the writer is closed"):
        writer.append(rows[7:])


def test_an_unfinished_file_is_not_overwritten_by_the_next_run(tmp_path):
    result, _, _ = circling()
    for _ in range(2):
        with ResultWriter(tmp_path / "run.nc", result.model, result.record) as writer:
            writer.append(rows_of_result(result))
    assert sorted(os.listdir(tmp_path)) == ["run.nc.part", "run.nc.part2"]


def test_after_a_failed_write_no_later_rows_follow(tmp_path, monkeypatch):
    result, _, _ = circling()
    rows = rows_of_result(result)
    writer = ResultWriter(tmp_path / "run.nc", result.model, result.record)
    writer.append(rows[:5])

    def fail(*_):
        raise RuntimeError("NetCDF: HDF error")

    with monkeypatch.context() as patch:
        patch.setattr("dap3d_core.result.writing.write_rows", fail)
        with pytest.raises(ResultError, match="is the disk full"):
            writer.append(rows[5:6])
    with pytest.raises(ResultError, match="the writer is closed"):
        writer.append(rows[6:])
    np.testing.assert_array_equal(open_result(tmp_path / "run.nc.part").t, result.t[:5])


def test_rows_of_another_width_are_refused_and_the_writer_goes_on(tmp_path):
    result, _, _ = circling()
    with ResultWriter(tmp_path / "run.nc", result.model, result.record) as writer:
        with pytest.raises(ValueError, match="shape"):
            writer.append(np.zeros((3, 5)))
        writer.append(rows_of_result(result))
        writer.close(result.record)
    assert len(open_result(tmp_path / "run.nc").t) == 21


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL here")
def test_a_killed_run_leaves_a_readable_file(tmp_path):
    """The writer is killed without a chance to close; a fresh process reads all it had reported."""
    code = f"""
        import os, signal, sys
        sys.path.insert(0, {os.path.dirname(os.path.dirname(__file__))!r})
        from unit.test_result import circling
        from unit.test_result_writer import rows_of_result
        from dap3d_core.result import ResultWriter
        result = circling(nt=300)[0]
        rows = rows_of_result(result)
        writer = ResultWriter("run.nc", result.model, result.record)
        for first in range(0, 270, 27):
            writer.append(rows[first : first + 27])
        print("written", flush=True)
        os.kill(os.getpid(), signal.SIGKILL)
    """
    killed = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], cwd=tmp_path, capture_output=True, text=True
    )
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    assert os.listdir(tmp_path) == ["run.nc.part"]
    code = """
        from dap3d_core.result import open_result
        found = open_result("run.nc.part")
        print(len(found.t), found.status, found.r.shape, found.record.title)
    """
    assert run(code, tmp_path).split("\n")[0] == "270 interrupted (270, 1, 3) circling"


def test_rows_that_did_not_reach_the_file_whole_are_left_out(tmp_path):
    """As after a kill between two variables: the last instant lacks its multipliers."""
    result, _, _ = circling()
    with ResultWriter(tmp_path / "run.nc", result.model, result.record) as writer:
        writer.append(rows_of_result(result))
    with netCDF4.Dataset(tmp_path / "run.nc.part", "a") as file:
        file["Lam"][20, 1] = np.nan
    found = open_result(tmp_path / "run.nc.part")
    assert len(found.t) == len(found.u) == len(found.Lam) == 20


def test_a_writer_that_cannot_begin_leaves_nothing(tmp_path, monkeypatch):
    result, _, _ = circling()

    def fail(*_):
        raise RuntimeError("NetCDF: HDF error")

    monkeypatch.setattr("dap3d_core.result.writing.define", fail)
    with pytest.raises(ResultError, match="is the disk full"):
        ResultWriter(tmp_path / "run.nc", result.model, result.record)
    assert os.listdir(tmp_path) == []


def test_a_file_that_appears_meanwhile_is_kept(tmp_path):
    result, _, _ = circling()
    writer = ResultWriter(tmp_path / "run.nc", result.model, result.record)
    writer.append(rows_of_result(result))
    (tmp_path / "run.nc").write_text("precious")
    with pytest.raises(ResultError, match="the file exists"):
        writer.close(result.record)
    assert (tmp_path / "run.nc").read_text() == "precious"
    assert same_bits(open_result(tmp_path / "run.nc.part"), result)
