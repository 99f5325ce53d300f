"""Result files are written whole or not at all; one that grows with a run keeps what it had."""

import os
import signal
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import numpy as np
import pytest
from support.internals import COLUMNS, arrays_of
from support.plain import in_another_process
from support.process import REPOSITORY, run
from support.results import circling, grown, model_of, noisy, same_bits

import dap3d_core as dap
from dap3d_core.result import ResultError, ResultWriter, RunMetadata, open_result
from dap3d_core.result.file.schema import write_rows

TESTS = str(REPOSITORY / "tests")


@pytest.mark.parametrize(
    ("name", "pieces"),
    [("pen1", (1,) * 9), ("pen2", (4, 5)), ("bodies2", (9,)), ("pen2", (0, 8, 1))],
)
def test_a_file_grown_in_pieces_is_that_of_the_whole(tmp_path, pieces, name):
    model = model_of(dap.load(name))
    rows = noisy(model)
    whole = dap.Result.of_run(model, rows, RunMetadata(scene_text="[scene]\n"), lambda: None)
    with closing(grown(tmp_path / "run.nc", whole, most=12)) as writer:
        first = 0
        for count in pieces:
            writer.append(arrays_of(rows[first : first + count], whole.summary))
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
        sys.path.insert(0, {TESTS!r})
        from support.results import circling, grown
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
    assert (
        run(textwrap.dedent(code), cwd=tmp_path).split("\n")[0]
        == "270 interrupted (270, 1, 3) circling"
    )


def test_rows_that_did_not_reach_the_file_whole_are_left_out(tmp_path):
    """As after a kill between two variables: the time of the last instants is not there yet."""
    result, _, _ = circling()
    with closing(grown(tmp_path / "run.nc", result)) as writer:
        writer.append(result.arrays.part(slice(20)))
        write_rows(writer._dataset, result.arrays.part(slice(20, None)), 20)
    found = open_result(tmp_path / "run.nc.part")
    assert len(found.t) == len(found.u) == len(found.Lam) == 20


@pytest.mark.parametrize("step", ["define", "write_rows"])
def test_a_write_that_fails_leaves_nothing_and_the_old_file(tmp_path, monkeypatch, step):
    path, (result, _, _) = tmp_path / "run.nc", circling()

    def fail(*_, **__):
        raise RuntimeError("NetCDF: HDF error")

    with monkeypatch.context() as failing:
        failing.setattr(f"dap3d_core.result.file.write.{step}", fail)
        with pytest.raises(ResultError, match="is the disk full"):
            result.save(path)
    assert os.listdir(tmp_path) == []
    result.save(path)
    before = path.read_bytes()
    monkeypatch.setattr(f"dap3d_core.result.file.write.{step}", fail)
    with pytest.raises(ResultError, match="is the disk full"):
        result.save(path, force=True)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["run.nc"]


@pytest.mark.parametrize("name", ["a.csv", "a.MAT"])
def test_a_name_that_promises_another_format_is_refused(tmp_path, name):
    """To save a result, and to write one during its run."""
    result = dap.simulate("pen1", t_end=0.1, dt=0.1)
    with pytest.raises(ResultError, match=r"such as a\.nc; dap3d post and dap3d export"):
        result.save(tmp_path / name)
    with pytest.raises(ResultError, match=r"such as a\.nc"):
        dap.simulate("pen1", t_end=0.1, dt=0.1, output=tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_kept_unless_forced(tmp_path):
    path = tmp_path / "run.nc"
    path.write_text("precious")
    result, _, _ = circling()
    with pytest.raises(ResultError, match=r"cannot write .*run\.nc: the file exists; force"):
        result.save(path)
    with pytest.raises(ResultError, match="the file exists"):
        ResultWriter(path, result.summary, result.record, len(result.t))
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
        "-": "not the standard output",
        "a\0b": "null (byte|character)",
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


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="no limits of file size here")
def test_a_full_disk(tmp_path):
    """The system refuses to write more than 50 kB to a file: the message names that of the user."""
    names = ["run.nc", "run.glb", "run.vtkhdf", "run.csv", "run.mat"]
    code = f"""
        import os, resource, signal, sys
        sys.path.insert(0, {TESTS!r})
        import dap3d_core as dap
        from support.results import circling
        from dap3d_core.result import ResultError
        result = circling(nt=400)[0]
        sys.dont_write_bytecode = True  # it would be cut off, and kept
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, resource.RLIM_INFINITY))
        for name in {names}:
            try:
                result.save(name) if name == "run.nc" else dap.export(result, name)
            except ResultError as error:
                print(error, flush=True)
        os._exit(0)  # older HDF5 libraries crash at exit where they could not close a file
    """
    said = run(textwrap.dedent(code), cwd=tmp_path).splitlines()
    assert [line.partition(": ")[0] for line in said] == [f"cannot write {name}" for name in names]
    assert os.listdir(tmp_path) == []


@pytest.mark.slow
def test_threads_may_write_and_read_at_once(tmp_path):
    """The NetCDF library is not made for threads: one at a time uses it."""
    result, _, _ = circling(nt=300)

    def there_and_back(k):
        result.save(tmp_path / f"{k}.nc")
        return same_bits(open_result(tmp_path / f"{k}.nc"), result)

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(there_and_back, range(16)))
