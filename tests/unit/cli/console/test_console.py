"""Text, numbers and JSON of the console."""

import numpy as np

from dap3d_core.cli.console.console import (
    clean,
    count,
    json_value,
    seconds,
    shell_word,
    size,
    stdout,
)


def test_control_characters_do_not_reach_the_terminal():
    assert clean("a\x1b[31mb\tc\r\nd") == "a\\x1b[31mb c \nd"


def test_json_data_have_only_types_of_json():
    data = {"a": np.array([1.0, np.nan]), 2: (float("inf"), np.int64(3)), "p": {1}}
    assert json_value(data) == {"a": [1.0, None], "2": [None, 3], "p": [1]}
    too_long_in_decimal = 16**5000 - 1
    assert json_value(too_long_in_decimal) == "0x" + "f" * 5000


def test_numbers_for_people():
    durations = [seconds(s) for s in (0.0123, 1.234, 119.0, 125.0, 7300.0)]
    assert durations == ["12.3 ms", "1.23 s", "119 s", "2 min 5 s", "2 h 1 min"]
    sizes = [size(n) for n in (999, 1500, 2_345_000, 5e9)]
    assert sizes == ["999 bytes", "1.5 kB", "2.35 MB", "5 GB"]
    counts = [count(n, "body", "bodies") for n in (0, 1, 2000)]
    assert counts == ["no bodies", "1 body", "2,000 bodies"]


def test_a_path_is_one_word_of_a_shell_and_no_option():
    words = [shell_word(path) for path in ("run.nc", "my run.nc", "-x.nc", "a/-x.nc")]
    assert words == ["run.nc", "'my run.nc'", "./-x.nc", "a/-x.nc"]


def test_an_empty_column_breaks_no_other(capsys):
    stdout().table(("a", "", ""), [("1", "stable", ""), ("-2", "stable", "")], right=(0,))
    assert [line.rstrip() for line in capsys.readouterr().out.splitlines()] == [
        "   a", "   1  stable", "  -2  stable",
    ]  # fmt: skip


def test_a_table_without_room_for_its_words_is_a_list_of_facts_for_each_row(monkeypatch, capsys):
    """Numbers and words stay whole; a blank line divides the rows, what is empty is left out."""
    rows = [("parameters.stiffness", "0.18095", "soft"), ("mass", "-10.4", "")]
    for columns, wanted in [
        ("37", ["  by                      slope", "  parameters.stiffness  0.18095  soft",
                "  mass                    -10.4"]),
        ("36", ["  by     parameters.stiffness", "  slope  0.18095", "         soft", "",
                "  by     mass", "  slope  -10.4"]),
    ]:  # fmt: skip
        monkeypatch.setenv("COLUMNS", columns)
        stdout().table(("by", "slope", ""), rows, right=(1,))
        assert [line.rstrip() for line in capsys.readouterr().out.splitlines()] == wanted


def test_lists_of_a_docstring_are_lists(monkeypatch, capsys):
    """Items keep their lines, wrapped below their text; equations and paragraphs as before."""
    monkeypatch.setenv("COLUMNS", "30")
    stdout().prose(
        "A curve of\nbody j:\n\n* y = f(x), by ``function``, over\n  its abscissa;\n* in space.\n\n"
        "As it is:\n    y = f(x)\nThe end."
    )
    assert capsys.readouterr().out.splitlines() == [
        "A curve of body j:", "", "  - y = f(x), by ``function``,", "    over its abscissa;",
        "  - in space.", "", "As it is:", "    y = f(x)", "The end.", "",
    ]  # fmt: skip
