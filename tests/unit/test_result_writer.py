"""A file that grows with the run is that of the whole, and whatever happens keeps what it had."""

import os
import signal
import subprocess
import sys
import textwrap
from contextlib import closing

import numpy as np
import pytest
from support.plain import in_another_process
from unit.test_result import circling, model_of
from unit.test_result_files import noisy, run, same_bits

from dap3d_core.result import Record, Result, ResultError, ResultWriter, open_result
from dap3d_core.result.arrays import COLUMNS, arrays_of
from dap3d_core.result.file.schema import write_rows
from dap3d_core.scene import load


def grown(path, result, *, most=None, force=False):
    """A writer for as many rows as a result has."""
    most = len(result.t) if most is None else most
    return ResultWriter(path, result.subject, result.record, most, force=force)


@pytest.mark.parametrize("pieces", [(1,) * 9, (4, 5), (9,), (0, 8, 1)])
@pytest.mark.parametrize("name", ["pen1", "pen2", "bodies2"])
def test_a_file_grown_in_pieces_is_that_of_the_whole(tmp_path, pieces, name):
    model = model_of(load(name))
    rows = noisy(model)
    whole = Result.of_run(model, rows, Record(scene_text="[scene]\n"), lambda: None)
    with closing(grown(tmp_path / "run.nc", whole, most=12)) as writer:
        first = 0
        for count in pieces:
            writer.append(arrays_of(rows[first : first + count], whole.subject))
            first += count
        assert writer.count == 9
        assert os.listdir(tmp_path) == ["run.nc.part"]
    assert same_bits(open_result(tmp_path / "run.nc.part"), whole)


def test_a_writer_left_with_an_error_leaves_what_it_had(tmp_path):
    result, _, _ = circling()
    writer = grown(tmp_path / "run.nc", result)

    def interrupted():
        with closing(writer):
            writer.append(result.arrays.part(slice(7)))
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
        writer.append(result.arrays.part(slice(7, None)))


def test_a_writer_that_had_nothing_yet_leaves_no_instant(tmp_path):
    result, _, _ = circling()
    grown(tmp_path / "run.nc", result).close()
    found = open_result(tmp_path / "run.nc.part")
    assert (len(found.t), found.status) == (0, "interrupted")
    assert "nothing was reported" in found.notes[-1]


def test_an_unfinished_file_is_not_overwritten_by_the_next_run(tmp_path):
    result, _, _ = circling()
    for _ in range(2):
        with closing(grown(tmp_path / "run.nc", result)) as writer:
            writer.append(result.arrays)
    assert sorted(os.listdir(tmp_path)) == ["run.nc.part", "run.nc.part2"]


def test_after_a_failed_write_no_later_rows_follow(tmp_path, monkeypatch):
    result, _, _ = circling()
    writer = grown(tmp_path / "run.nc", result)
    writer.append(result.arrays.part(slice(5)))

    def fail(*_):
        raise RuntimeError("NetCDF: HDF error")

    with monkeypatch.context() as patch:
        patch.setattr("dap3d_core.result.file.write.write_rows", fail)
        with pytest.raises(ResultError, match="is the disk full"):
            writer.append(result.arrays.part(slice(5, 6)))
    with pytest.raises(ResultError, match="the writer is closed"):
        writer.append(result.arrays.part(slice(6, None)))
    np.testing.assert_array_equal(open_result(tmp_path / "run.nc.part").t, result.t[:5])


def test_adding_rows_changes_nothing_but_their_places(tmp_path):
    """So that a writer may be killed at any moment: what describes the file is never touched."""
    result, _, _ = circling(nt=200)
    path = tmp_path / "run.nc.part"
    with closing(grown(tmp_path / "run.nc", result)) as writer:
        writer.append(result.arrays.part(slice(1)))
        before = np.fromfile(path, dtype=np.uint8)
        writer.append(result.arrays.part(slice(1, 150)))
        after = np.fromfile(path, dtype=np.uint8)
    assert len(before) == len(after)
    stored = [getattr(result.arrays, column.name)[1:150] for column in COLUMNS]
    assert 0 < np.count_nonzero(before != after) <= sum(a.nbytes for a in stored)
    blank = b"\0" * 8
    for column, values in zip(COLUMNS, stored, strict=True):
        rows = values.tobytes()
        at = bytes(after).find(rows)
        if values.size and any(values.ravel()):
            assert at > 0, column.name
            after[at : at + len(rows)] = np.frombuffer(blank * values.size, dtype=np.uint8)
    assert bytes(after) == bytes(before)


@pytest.mark.slow
@in_another_process
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL here")
def test_a_killed_run_leaves_a_readable_file(tmp_path):
    """The writer is killed without a chance to close; a fresh process reads all it had reported."""
    code = f"""
        import os, signal, sys
        sys.path.insert(0, {os.path.dirname(os.path.dirname(__file__))!r})
        from unit.test_result import circling
        from unit.test_result_writer import grown
        result = circling(nt=300)[0]
        writer = grown("run.nc", result)
        for first in range(0, 270, 27):
            writer.append(result.arrays.part(slice(first, first + 27)))
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
    """As after a kill between two variables: the time of the last instants is not there yet."""
    result, _, _ = circling()
    with closing(grown(tmp_path / "run.nc", result)) as writer:
        writer.append(result.arrays.part(slice(20)))
        write_rows(writer._dataset, result.arrays.part(slice(20, None)), 20)
    found = open_result(tmp_path / "run.nc.part")
    assert len(found.t) == len(found.u) == len(found.Lam) == 20


def test_a_writer_that_cannot_begin_leaves_nothing(tmp_path, monkeypatch):
    result, _, _ = circling()

    def fail(*_):
        raise RuntimeError("NetCDF: HDF error")

    monkeypatch.setattr("dap3d_core.result.file.write.define", fail)
    with pytest.raises(ResultError, match="is the disk full"):
        grown(tmp_path / "run.nc", result)
    assert os.listdir(tmp_path) == []
