"""Notes: lines of text that know their severity and what they are of."""

import copy
import pickle

import dap3d_core as dap
from dap3d_core.result import Note, information, warnings_of


def test_a_note_is_its_line_with_parts():
    note = information("joints.J1: no other joint connects its bodies")
    assert note == "for information: joints.J1: no other joint connects its bodies"
    assert (note.severity, note.where) == ("information", "joints.J1")
    assert note.text == "no other joint connects its bodies"
    plain = Note("method standard: the scene has joints")
    assert (plain.severity, plain.where, plain.text) == ("warning", "", str(plain))
    for same in (copy.deepcopy(note), pickle.loads(pickle.dumps(note))):
        assert (same, same.severity) == (note, "information")


def test_warnings_are_what_is_not_for_information():
    lines = [information("a"), "bodies.b: no mass is given", "for information: c"]
    assert [note.where for note in warnings_of(lines)] == ["bodies.b"]


def test_notes_of_a_result_and_of_its_file_have_their_parts(tmp_path):
    result = dap.simulate("pen1", t_end=0.02, dt=0.01, estimate_error=True)
    result.save(tmp_path / "a.nc")
    opened = dap.open(tmp_path / "a.nc")
    assert opened.notes == result.notes
    assert [note.severity for note in opened.notes] == [note.severity for note in result.notes]
    assert "information" in {note.severity for note in result.notes}
