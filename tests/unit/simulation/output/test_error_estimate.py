"""Estimates of the error that nobody asked for are made where they take less than a second."""

import attrs
import pytest

import dap3d_core as dap
from dap3d_core.result import ResultError

MOTION = dict(t_end=0.2, dt=0.1)


def quick(**options):
    return dap.simulate("pen1", **MOTION, estimate_error="quick", **options)


def reasons(result):
    return [note for note in result.notes if "its error was not estimated" in note]


def test_a_quick_estimate_is_that_of_a_second_run():
    asked = dap.simulate("pen1", **MOTION, estimate_error=True)
    assert quick().error.largest == asked.error.largest
    assert reasons(quick()) == []


def test_a_first_run_that_took_long_has_none(monkeypatch):
    """Nothing is begun that is sure to take longer; the note is for information."""
    monkeypatch.setattr("dap3d_core.simulation.output.error_estimate.SLOWER", 1e9)
    result = quick()
    assert result.error is None
    assert len(reasons(result)) == 1
    assert "longer than 1 s" in reasons(result)[0]
    assert reasons(result)[0].startswith("for information: ")


def test_a_second_run_that_takes_longer_is_ended(monkeypatch):
    monkeypatch.setattr("dap3d_core.simulation.output.error_estimate.SLOWER", 0.0)
    monkeypatch.setattr("dap3d_core.simulation.output.error_estimate.QUICK_SECONDS", 1e-9)
    result = quick()
    assert result.status == "done"
    assert result.error is None
    assert len(reasons(result)) == 1


def test_tolerances_that_cannot_be_tightened_are_for_information():
    result = quick(rtol=1e-14)
    assert reasons(result)[0].startswith("for information: ")
    asked = dap.simulate("pen1", **MOTION, rtol=1e-14, estimate_error=True)
    assert reasons(asked)[0].startswith("its error")


def test_a_callback_that_ends_the_first_run_ends_it_with_an_estimate_in_view():
    """``watch`` of the caller is called by both runs: Ctrl-C ends either."""
    calls = []
    quick(watch=calls.append)
    once = []
    dap.simulate("pen1", **MOTION, watch=once.append)
    assert len(calls) > len(once)
    assert all(attrs.has(type(progress)) for progress in calls)


def test_an_exception_of_a_callback_is_no_lack_of_time():
    def stop(progress):
        raise ArithmeticError("no")

    with pytest.raises(ArithmeticError):
        quick(watch=stop)


def test_a_disk_without_room_for_the_estimate_keeps_the_run(tmp_path, monkeypatch):
    """The file is written anew with the estimate: the message says what the first one holds."""

    save, saved = dap.Result.save, []

    def save_once(self, path, force):
        if saved:
            raise ResultError(f"cannot write {path}: No space left on device")
        saved.append(save(self, path, force=force))

    monkeypatch.setattr(dap.Result, "save", save_once)
    with pytest.raises(ResultError, match=r"No space left .*; it holds the whole run"):
        quick(output=tmp_path / "run.nc")
    assert dap.open(tmp_path / "run.nc").status == "done"
