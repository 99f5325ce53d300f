"""Words of any length are read in a time that grows with their length alone, and never hang.
Patterns that look again from each letter take the square: hours for these. The tests hold by coming
to their end."""

import pytest
from support.falling import SCENE
from support.matlab import SMALL
from support.matlab import write as write_matlab

import dap3d_core as dap
from dap3d_core.scene import parse

LENGTH = 900_000


@pytest.mark.parametrize(
    "word", ["1" * LENGTH + "x", "1." + "1" * LENGTH + "x", "1e" + "1" * LENGTH]
)
def test_a_text_of_digits_in_place_of_a_number(word):
    text = SCENE.replace("mass = 2.0", f'mass = "{word}"')
    assert text != SCENE
    with pytest.raises(dap.SceneError) as caught:
        dap.compile(parse(text))
    (mistake,) = caught.value.mistakes
    assert (mistake.key, mistake.what) == ("bodies.stone.mass", "should be a number, not text")
    assert mistake.remedy == ""
    assert len(str(mistake)) < 300


def test_a_comment_of_one_word_in_a_matlab_file(tmp_path):
    scene, _ = dap.import_matlab(write_matlab(tmp_path / "plain"))
    folder = write_matlab(tmp_path / "long", inBodies=f"%{'x' * LENGTH}\n{SMALL['inBodies.m']}")
    assert dap.import_matlab(folder)[0].bodies == scene.bodies


def test_a_chain_of_names_is_refused_wherever_it_begins(tmp_path):
    """Also behind a digit, and behind a long word."""
    for before in ("", "1", "x" * 1000 + " ", "y."):
        text = f"{SMALL['inBodies.m']}\nz = {before}{'a.' * 120}b;\n"
        folder = write_matlab(tmp_path / f"chain{len(before)}", inBodies=text)
        with pytest.raises(dap.SceneError, match="joins more than 100 names by dots"):
            dap.import_matlab(folder)
