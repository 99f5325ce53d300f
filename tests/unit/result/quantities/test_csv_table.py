"""Tables of a result: blocks, digits, odd names, large Jacobians."""

import numpy as np
import pytest
from support.internals import columns_of, jacobian_columns, selected, write_csv
from support.results import circling, model_of, result_of

import dap3d_core as dap
from dap3d_core.result import ResultError


def test_a_jacobian_of_many_rows_does_not_go_into_a_table(monkeypatch):
    monkeypatch.setattr("dap3d_core.result.quantities.csv_table.DENSE_ROWS", 2)
    with pytest.raises(ResultError, match=r"write a \.nc file"):
        jacobian_columns(circling(nt=4)[0])


def test_a_table_is_written_in_blocks(tmp_path, monkeypatch):
    """The same bytes, whatever the size of a block."""
    result, _, _ = circling()
    for name, size in (("one", 1), ("all", 10**6)):
        monkeypatch.setattr("dap3d_core.result.quantities.csv_table._BLOCK", size)
        write_csv(result, tmp_path / name, columns_of(result), jacobian_columns(result))
    assert (tmp_path / "one").read_bytes() == (tmp_path / "all").read_bytes()
    assert (tmp_path / "all").read_text().count("\n") == 22


def test_numbers_keep_all_their_digits(tmp_path):
    result, _, _ = circling()
    write_csv(result, tmp_path / "a.csv", selected(result, ["bob.r.x"]))
    lines = (tmp_path / "a.csv").read_text().splitlines()[1:]
    assert [float(line.split(",")[1]) for line in lines] == result.r[:, 0, 0].tolist()
    assert max(len(line.split(",")[1].lstrip("-0.").replace(".", "")) for line in lines) >= 16


def test_names_with_commas_and_quotes_survive_a_table(tmp_path):
    import csv

    scene = dap.Scene(name="odd")
    scene.add_body('a "b", c', mass=1.0, Jp=[1, 1, 1])
    rows = np.zeros((1, 25))
    rows[0, 4] = 1.0
    result = result_of(scene, rows, model_of(scene), "unconstrained")
    write_csv(result, tmp_path / "a.csv", columns_of(result))
    with (tmp_path / "a.csv").open(newline="") as file:
        heading = next(csv.reader(file))
    assert heading[1] == 'a "b", c.r.x [m]'
