"""Every bad input in a scene is refused, noted or allowed, as its nature asks, in clear words."""

import re
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest
from bad_input import bodies_and_numbers, elements

import dap3d_core as dap
from dap3d_core.result import INFORMATION

CASES = [*bodies_and_numbers.CASES, *elements.CASES]
HERE = Path(__file__).parent
#: Titles that the tests of the scene floor cover: file, test or row of a table there.
ELSEWHERE = {
    "file missing": ("test_scene_reading.py", "no/such/file.toml"),
    "is a directory": ("test_scene_reading.py", "test_a_folder_without_a_scene_names_what_it"),
    "empty file": ("test_scene_check.py", "test_empty_and_bodiless_scenes_are_refused"),
    "binary or image renamed .toml": ("test_scene_reading.py", '"image": (b"'),
    "no read permission": ("test_scene_reading.py", "test_a_file_that_may_not_be_read_is_refused"),
    "CRLF or mixed ends": ("test_scene_reading.py", "mixed_line_ends_are_read"),
    "truncated file": ("test_scene_reading.py", '"truncated list"'),
    "NUL bytes": ("test_scene_reading.py", '"NUL": ('),
    "1 GB file": ("test_scene_reading.py", "test_a_huge_file_is_refused_before_it_is_read"),
    "duplicate keys": ("test_scene_reading.py", '"key twice"'),
    "unknown or misspelt key": ("scene_data/mistakes.py", '"mas = 1.0"'),
    "wrong case key": ("scene_data/mistakes.py", '"MASS = 1.0"'),
    "unknown or newer schema version": ("scene_data/mistakes.py", '"schema = 2"'),
    "missing required section": ("test_scene_check.py", "[scene]\\nname = 'a'"),
    "URL where a path is expected": ("test_scene_reading.py", "https://example.com"),
    "odd file name": ("test_scene_reading.py", "test_odd_file_names_are_read"),
    "MATLAB file with code to run": ("test_scene_reading.py", "system('true')"),
    "missing body, point or vector": ("scene_data/mistakes.py", '"grund.O"'),
    "index off by one, or 0 where not ground": ("scene_data/mistakes.py", "number 3"),
    "body i = body j": ("scene_data/mistakes.py", "body i and body j are both crank"),
    "ground as body i": ("scene_data/mistakes.py", "body i is ground"),
    "nearly zero axis": ("scene_data/mistakes.py", "1e-14"),
}  # fmt: skip


def titles():
    """The lines of the list."""
    return re.findall(r"^- (.+)$", (HERE / "titles.md").read_text(), flags=re.MULTILINE)


def names(cases):
    """The titles as names of tests, numbered where there are several."""
    numbered = [
        f"{title}-{k}"
        for title, group in groupby(c.title for c in cases)
        for k, _ in enumerate(group, 1)
    ]
    assert len(set(numbered)) == len(numbered), "cases of a title stand together"
    return numbered


def test_every_title_has_a_case():
    """And every case a title; those of other files are there."""
    covered = {case.title for case in CASES}
    assert covered | set(ELSEWHERE) == set(titles())
    for file, words in ELSEWHERE.values():
        text = (HERE.parent / "unit" / file).read_text()
        assert words.replace('\\"', '"') in text.replace('\\"', '"'), (file, words)


@pytest.mark.parametrize("case", CASES, ids=names(CASES))
def test_what_comes_of_it(case, tmp_path):
    """One clear message with its place, or a note; and no number of a result that is none."""
    file = tmp_path / "scene.toml"
    file.write_text(case.text)
    if case.comes == "refused":
        check_refused(case, file)
    elif case.comes == "failed":
        check_failed(case, file)
    else:
        check_run(case, dap.simulate(dap.load(file)))


def check_refused(case, file):
    """One mistake, with file, line, key and words."""
    with pytest.raises(dap.SceneError) as caught:
        dap.compile(dap.load(file)).start(correct=True, hold=())
    mistakes = [m for m in caught.value.mistakes if m.key == case.key]
    assert len(mistakes) == len(caught.value.mistakes) == 1, str(caught.value)
    said = str(mistakes[0])
    assert said.startswith(f"{file}:")
    for word in case.words:
        assert word in said
    if case.line:
        assert case.line in case.text.splitlines()[mistakes[0].line - 1]


def check_failed(case, file):
    """No motion exists, or numbers get too large: a run says so, and keeps finite numbers alone."""
    with pytest.raises(dap.SimulationError) as caught:
        dap.simulate(dap.load(file))
    said = str(caught.value)
    for word in case.words:
        assert word in said
    if caught.value.result is not None:
        check_finite(caught.value.result)


def check_run(case, result):
    """A run to its end, with a note that has all words, or without any."""
    assert result.status == "done"
    check_finite(result)
    usual = ("method ", f"{INFORMATION}initial velocities corrected")
    if case.comes == "allowed":
        assert [n for n in result.notes if not n.startswith(usual)] == []
        return
    found = [n for n in result.notes if all(word in n for word in case.words)]
    assert found, result.notes
    told = found[0].startswith(INFORMATION)
    assert told == (case.comes == "told")


def check_finite(result):
    """States, accelerations, multipliers, reactions and energies."""
    arrays = [result.u, result.v_dot, result.Lam, result.energy.total, result.energy.kinetic]
    assert all(np.all(np.isfinite(array)) for array in arrays)
