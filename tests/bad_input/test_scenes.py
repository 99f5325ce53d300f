"""Scenes that are valid and yet wrong: refused, noted or allowed, with clear messages.
Mistakes that the check of a scene finds are in tests/unit/scene/mistakes.py."""

from itertools import groupby

import numpy as np
import pytest
from bad_input import bodies_and_numbers, elements

import dap3d_core as dap
from dap3d_core.result import Note, information

CASES = [*bodies_and_numbers.CASES, *elements.CASES]


def names(cases):
    """The titles as names of tests, numbered where there are several."""
    numbered = [
        f"{title}-{k}"
        for title, group in groupby(c.title for c in cases)
        for k, _ in enumerate(group, 1)
    ]
    assert len(set(numbered)) == len(numbered), "cases of a title stand together"
    return numbered


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
    usual = (information("method "), information("initial velocities corrected"))
    if case.comes == "allowed":
        assert [n for n in result.notes if not n.startswith(usual)] == []
        return
    found = [n for n in result.notes if all(word in n for word in case.words)]
    assert found, result.notes
    told = not Note(found[0]).is_warning
    assert told == (case.comes == "told")


def check_finite(result):
    """States, accelerations, multipliers, reactions and energies."""
    arrays = [result.u, result.v_dot, result.Lam, result.energy.total, result.energy.kinetic]
    assert all(np.all(np.isfinite(array)) for array in arrays)
