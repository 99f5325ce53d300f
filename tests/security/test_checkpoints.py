"""A checkpoint from elsewhere: no number of it is an index of compiled code before it is checked.
Its checksums are right, as whoever wants to do harm would make them."""

import json
import math

import numpy as np
import pytest
from fuzz.numbers import PATIENCE, RUNS, check_change, folder, make
from fuzz.results import in_child
from support.ended import EndedError, ended_at, leave, shorten_chunks
from support.internals import (
    Checkpoint,
    IntegrationState,
    RadauState,
    adams,
    read_checkpoint,
    write_checkpoint,
)
from support.results import same_run

import dap3d_core as dap
from dap3d_core.cli import main
from dap3d_core.simulation import CheckpointError, CompiledModel


def crafted(run, what, where, value):
    """The end of ``dap3d resume`` of a checkpoint with one number changed, in words."""
    return check_change(json.dumps(["checkpoint", run, what, where, value]).encode())


INTEGERS = RadauState.indices("integer") | adams.AdamsState.indices("integer")
#: Integers that only count, and so hold any count.
COUNTS = {
    "step_count", "rejected_count", "rhs_count", "projection_count", "report_count",
    "near_singular_landings", "cut_attempts", "stiff_steps", "nonstiff_steps", "stalled_steps",
    "equal_steps", "failure_count", "attempt_count", "stall_start",
    "iteration_count", "last_iterations", "jacobian_count", "factorisation_count",
    "steps_at_order", "patience", "error_refusals", "iteration_refusals", "singular_refusals",
}  # fmt: skip


@pytest.mark.parametrize(
    ("run", "what", "where", "value"),
    [
        *(("pen1", "0.integer", INTEGERS[name], 10**7)
          for name in ("stage_count", "next_report", "row_count")),
        # an order that adams methods do not have
        *(("adams", "0.integer", INTEGERS[name], 14) for name in ("next_order", "last_order")),
        # row exchanges of an implicit integration stay in their blocks
        *(("radau", *place, value) for place in (("0.pivots", 0), ("0.matrix.body_first", 1))
          for value in (-1, 10**7)),
    ],
)  # fmt: skip
def test_an_index_out_of_its_array_is_refused(run, what, where, value):
    """They crashed, or let the file write where it liked."""
    assert crafted(run, what, where, value) == "checkpoint refused"


def test_the_command_refuses_it_as_any_damaged_file(tmp_path, capsys):
    path = make(["checkpoint", "pen1", "0.integer", INTEGERS["row_count"], 48], tmp_path)
    assert main(["resume", str(path)]) == 2
    words = "".join(capsys.readouterr().err.split())  # a long path is broken over lines
    expected = f"cannot resume from {path}: row_count is 48, which no run can have"
    assert "".join(expected.split()) in words


@pytest.mark.slow
@pytest.mark.parametrize(
    ("run", "state"),
    [("pen1", IntegrationState), ("adams", adams.AdamsState), ("radau", RadauState)],
)
def test_every_integer_that_is_no_count_is_limited(run, state, tmp_path):
    """In one process, which a file that is not refused would end, or make fail."""
    indices = state.indices("integer")
    size = read_checkpoint(folder() / run / "run.nc.checkpoint").arrays["0.integer"].size
    assert list(indices.values()) == list(range(size))
    paths = []
    for name, place in indices.items():
        value = -(10**7) if name in COUNTS else 10**7
        paths.append(make(["checkpoint", run, "0.integer", place, value], tmp_path / name))
    answer, ending = in_child(_refusals_of, paths, 60.0)
    assert not ending, ending
    assert answer[0], answer[1]


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (["settings", "t_end"], 0.5),
        (["settings", "t_end"], math.nan),
        (["settings", "rtol"], "x"),
        (["settings", "hold"], "ground"),
        (["integrations"], 10**9),
        (["rows"], -1),
        (["wall_time_s"], math.inf),
        (["notes"], [1]),
        (["types"], {"joint rev": 1}),
    ],
)  # fmt: skip
def test_settings_that_no_run_has_are_refused(path, value, tmp_path):
    """In words, at once: some never ended, others were called unexpected."""
    found = make(["checkpoint", "pen1", "header", ["t"], 1.0], tmp_path)
    before = read_checkpoint(found)
    header = json.loads(json.dumps(before.header))
    table = header if len(path) == 1 else header[path[0]]
    table[path[-1]] = value
    write_checkpoint(found, Checkpoint(header, before.arrays))
    answer, ending = in_child(_words_of_refusal, found, PATIENCE)
    assert not ending
    assert "cannot resume from" in answer[1], answer[1]


def _refusals_of(paths):
    for path in paths:
        assert str(path) in _words_of_refusal(path)


def _words_of_refusal(path):
    with pytest.raises(CheckpointError) as caught:
        dap.resume(path)
    return str(caught.value)


def test_state_of_zeros_is_refused(tmp_path):
    """All floats zero: step and tolerances too, so that it never came to an end."""
    found = make(["checkpoint", "pen1", "header", ["t"], 1.0], tmp_path)
    before = read_checkpoint(found)
    arrays = {n: a if a.dtype.kind == "i" else np.zeros_like(a) for n, a in before.arrays.items()}
    write_checkpoint(found, Checkpoint(before.header, arrays))
    with pytest.raises(CheckpointError, match="no run can have"):
        dap.resume(found)


def test_numbers_that_a_run_does_not_change_are_those_of_its_scene(tmp_path, monkeypatch):
    """Places of tables stand among the numbers of forces: those of the file are not looked at."""
    scene = dap.Scene(name="cam")
    scene.add_body("cam", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_joint("rev", "axle", P_i="cam.O", P_j="ground.O", a_i="cam.z", a_j="ground.z")
    scene.add_function("spline", "law", x=(0.0, 0.4, 1.0), y=(0.0, 1.0, 0.5))
    scene.add_joint("drive-rot", "motor", body_i="cam", a_j="ground.z", function="law")
    settings = {"t_end": 1.0, "dt": 0.05}
    whole = dap.simulate(scene, **settings)
    shorten_chunks(monkeypatch)
    found = leave(scene, tmp_path, 0.3, **settings)
    before = read_checkpoint(found)
    arrays, evaluator = dict(before.arrays), CompiledModel(scene).evaluator
    turns = [arrays["system.par"][place].copy() for place in evaluator.turn_places()]
    arrays["system.par"] = np.full_like(arrays["system.par"], 1e9)
    for place, kept in zip(evaluator.turn_places(), turns, strict=True):
        arrays["system.par"][place] = kept
    arrays["system.settings"] = np.zeros_like(arrays["system.settings"])
    arrays["0.real"] = arrays["0.real"].copy()
    arrays["0.real"][IntegrationState.indices("real")["rtol"]] = 0.0
    write_checkpoint(found, Checkpoint(before.header, arrays))
    assert same_run(dap.resume(found), whole)


@pytest.mark.slow
def test_every_run_of_the_fuzz_target_is_resumed_as_it_is(tmp_path):
    """The files that are changed are good ones: unchanged they go on."""
    for run in RUNS:
        path = make(["checkpoint", run, "header", ["compile_time_s"], 1.0], tmp_path / run)
        t = read_checkpoint(path).header["t"]
        with pytest.raises(EndedError) as caught:
            dap.resume(path, watch=ended_at(t))
        assert caught.value.result.t[-1] >= t - 0.2
