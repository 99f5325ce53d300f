"""``dap3d report`` and ``dap3d run --error`` as a user has them."""

import csv
import json
import re
import shlex
import signal

import pytest

import dap3d_core as dap

QUICK = ("--quick", "--t-end", "0.2", "--dt", "0.05")


@pytest.mark.slow
def test_a_report_with_table_files_and_a_setting_that_can_be_run(dap3d):
    done = dap3d.succeed("report", "pen1", *QUICK, "--target-error", "1e-6", "--plot", "a.svg",
                 "--csv", "a.csv", "-o", "a.json")  # fmt: skip
    assert "standard, dop853" in done.stdout
    assert "uncertainty" in done.stdout
    assert "method unconstrained does not fit" in done.stdout
    assert "* no faster run has a smaller error" in done.stdout
    assert (dap3d.folder / "a.svg").read_text().startswith("<?xml")
    found = json.loads((dap3d.folder / "a.json").read_text())
    rows = list(csv.DictReader((dap3d.folder / "a.csv").read_text().splitlines()))
    assert [float(row["error"]) for row in rows] == [run["error"] for run in found["runs"]]
    (line,) = [ln for ln in done.stdout.splitlines() if ln.strip().startswith("dap3d run pen1")]
    assert found["recommended"]["flags"] in line
    again = dap3d.succeed(*shlex.split(line)[1:], "--json", "-o", "best.nc")
    assert json.loads(again.stdout)["rhs"] == found["recommended"]["run"]["rhs"]


@pytest.mark.slow
def test_tables_fit_the_width(dap3d):
    done = dap3d.succeed("report", "pen1", *QUICK, "--method", "standard", COLUMNS=60)
    lines = done.stdout.splitlines()
    assert max(map(len, lines)) <= 60
    rows = [line for line in lines if "rtol 1e-07" in line and "ms" in line]
    assert rows
    assert all(len(row.split()) >= 6 for row in rows)  # no column is folded away


@pytest.mark.long
@pytest.mark.slow
def test_a_signal_keeps_what_was_measured(dap3d):
    process = dap3d.start("report", "pen1", *QUICK, "--repeat", "1000", "--method", "standard",
                          "--csv", "a.csv")  # fmt: skip
    for line in process.stderr:  # until all runs of the first tolerance are measured
        if re.match(r"\w+, \w+, rtol 1e-(0[4-9]|1)", line):
            break
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert "interrupted" in out
    assert "ended early" in err
    assert len((dap3d.folder / "a.csv").read_text().splitlines()) > 2


@pytest.mark.slow
def test_the_error_of_a_run_is_estimated_shown_and_stored(dap3d):
    done = dap3d.succeed("run", "pen1", "--t-end", "0.2", "--error")
    assert "no bound" in done.stdout
    assert "second run at rtol 1e-09" in done.stdout
    error = dap.open(dap3d.folder / "pen1.nc").error
    assert 0.0 < error.largest["r"] < 1e-6
    info = dap3d("info", "pen1.nc", "--json")
    assert json.loads(info.stdout)["error_estimate"]["r"] == error.largest["r"]
    plain = dap3d("run", "pen1", "--t-end", "0.2", "--force", "--json", "--no-estimate", "--strict")
    assert json.loads(plain.stdout)["error_estimate"] is None


def test_a_short_run_estimates_its_error_unasked(dap3d):
    """A second run that takes less than a second; scripts do so on request alone."""
    done = dap3d("run", "pen1", "--t-end", "0.2", "--json", "--strict")
    assert 0.0 < json.loads(done.stdout)["error_estimate"]["r"] < 1e-6
    assert dap.simulate("pen1", t_end=0.2).error is None
