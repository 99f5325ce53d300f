"""Bad folders of MATLAB models: clear mistakes with file and line, all at once, no traceback."""

import shutil

import pytest
from support.matlab import SMALL, write

import dap3d_core as dap
from dap3d_core.scene import MISSING
from dap3d_matlab.language.parse import LARGEST_FILE


def changed(name, old, new):
    """A file of the small model with some words replaced."""
    text = SMALL[f"{name}.m"]
    assert old in text
    return {name: text.replace(old, new)}


def test_folders_that_hold_no_model(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "main.m").write_text("x = 1;")
    (tmp_path / "file.m").write_text("x = 1;")
    for name, words in {
        "nowhere": "there is no such folder",
        "empty": "holds no MATLAB model: there is no inBodies.m",
        "other": "it holds main.m",
        "file.m": "is a file; a MATLAB model is a folder",
        "file.m/x": "there is no such folder",
        "a\0b": "there is no such folder",
        "n" * 300: "cannot be read",
    }.items():
        with pytest.raises(dap.SceneError) as caught:
            dap.import_matlab(tmp_path / name)
        assert words in str(caught.value), name
    with pytest.raises(TypeError, match="folder should be text or a path, not 3"):
        dap.import_matlab(3)


def test_the_file_of_the_bodies_is_needed(mistakes):
    assert mistakes(inBodies=None)[0].endswith("there is no inBodies.m, which every model needs")


def test_an_absent_file_explains_what_points_into_it(mistakes):
    found = mistakes(inPoints=None)
    joints = [m for m in found if m.startswith("inJoints.m:1: J1.iPindex = 1")]
    assert joints[0].endswith("there is no point 1, because there is no file inPoints.m")


def test_a_misspelt_file_is_no_absent_file(mistakes):
    """The manual itself has the misprint."""
    text = SMALL["inVectors2.m"]
    (found,) = mistakes(inVectors2=None, inVctors2=text)
    assert found.startswith("inVctors2.m: is no file of a model; inVectors2.m is one")
    assert "rename it to inVectors2.m" in found
    (found,) = mistakes(inVectors2=None, invectors2=text)
    assert "rename it to inVectors2.m" in found


def test_files_that_are_no_text(mistakes, tmp_path):
    (found,) = mistakes(inForces=b"% gravit\xe9\nForces = [];\n")
    assert found.startswith("inForces.m:1: is not UTF-8 text: byte 0xe9")
    (found,) = mistakes(inForces=b"Forces = [];\0")
    assert "NUL bytes" in found
    (found,) = mistakes(inForces=b" " * (LARGEST_FILE + 1))
    assert "at most 1 MiB" in found
    shutil.rmtree(tmp_path / "small")
    write(tmp_path / "small", inForces=None)
    (tmp_path / "small" / "inForces.m").mkdir()
    (found,) = mistakes(inForces=None)
    assert found == "inForces.m: is not a regular file"


def test_other_line_ends_and_a_mark_at_the_start_change_nothing(tmp_path):
    expected, _ = dap.import_matlab(write(tmp_path / "model"))
    files = {n.removesuffix(".m"): t for n, t in SMALL.items()}
    for mark, end in ((b"\xef\xbb\xbf", b"\r\n"), (b"", b"\r")):
        other = {n: mark + t.encode().replace(b"\n", end) for n, t in files.items()}
        found, _ = dap.import_matlab(write(tmp_path / "model", **other))
        assert found == expected


def test_all_mistakes_of_all_files_at_once(mistakes):
    found = mistakes(
        **changed("inBodies", "B1.mass = 2", "B1.masss = 2; system('ls')"),
        **changed("inPoints", "P3.Bindex = 2", "P3.Bindex = 7"),
        **changed("inJoints", "'sph'", "'shp'"),
        **changed("inForces", "'weight'", "‘weight’"),
        inFuncts="C1 = Funct_struct;\nFuncts = [C1; C2];\n",
    )
    starts = [m.split("\n")[0] for m in found]
    assert starts[0].startswith("inBodies.m:1: B1.masss: a Body_struct has no field masss; did you")
    assert starts[1].startswith("inBodies.m:1: system('ls'): the function system is outside")
    assert "inPoints.m:3: P3.Bindex = 7: there is no body 7; Bodies has 2" in starts
    assert any(m.startswith('inJoints.m:1: J1.type = "shp"') for m in starts)
    assert any("did you mean 'sph'?" in m for m in starts)
    assert any(m.startswith("inForces.m:1: not valid MATLAB") for m in starts)
    assert any(m.startswith("inFuncts.m:2: C2: C2 is not defined") for m in starts)


def test_mistakes_carry_file_line_key_and_value(tmp_path):
    folder = write(tmp_path, **changed("inPoints", "P3.Bindex = 2", "P3.Bindex = 7"))
    with pytest.raises(dap.SceneError) as caught:
        dap.import_matlab(folder)
    (mistake,) = caught.value.mistakes
    assert (mistake.file, mistake.line) == (str(folder / "inPoints.m"), 3)
    assert (mistake.key, mistake.value) == ("P3.Bindex", 7)
    folder = write(tmp_path, **changed("inJoints", "J1.iPindex = 1; ", ""))
    with pytest.raises(dap.SceneError) as caught:
        dap.import_matlab(folder)
    assert caught.value.mistakes[0].value is MISSING


def test_numbers_that_lead_nowhere(mistakes):
    for old, new, words in (
        ("iPindex = 1", "iPindex = 4", "J1.iPindex = 4: there is no point 4; Points has 3"),
        ("iPindex = 1", "iPindex = 0", "J1.iPindex = 0: is required: the number of a point"),
        ("iPindex = 1", "iPindex = 1.5", "J1.iPindex = 1.5: should be the number of a point"),
        ("iPindex = 1", "iPindex = -1", "should be the number of a point, from 1"),
        ("iPindex = 1", "iPindex = [1 2]", "should be a number; it is a matrix of 1x2"),
        ("iPindex = 1", "iPindex = 'P1'", "should be a number; it is text"),
        ("iPindex = 1", "iPindex = []", "should be a number; it is empty"),
        ("'sph'", "3", "J1.type = 3: should be text in quotes; it is a number"),
    ):
        (found,) = mistakes(**changed("inJoints", old, new))
        assert found.startswith("inJoints.m:1: ")
        assert words in found


def test_values_of_wrong_size(mistakes):
    (found,) = mistakes(**changed("inPoints", "[1; 0; 0]", "[1; 0]"))
    assert found == "inPoints.m:3: P3.sPp = [1, 0]: should be 3 numbers; it is a matrix of 2x1"
    (found,) = mistakes(**changed("inBodies", "diag([1 2 2.5])", "[1 2 2.5]"))
    assert "B1.Jp = [1, 2, 2.5]: should be 3x3 numbers" in found
    assert "diag([...])" in found


def test_what_the_scene_refuses_has_the_line_of_the_matlab_file(mistakes):
    """The rules of a scene: masses, two different bodies, lengths."""
    (found,) = mistakes(**changed("inBodies", "B1.mass = 2", "B1.mass = -2"))
    assert found == "inBodies.m:1: bodies.body1.mass = -2.0: should be greater than 0"
    (found,) = mistakes(**changed("inBodies", "B2.Jp = eye(3)", "B2.Jp = diag([1 1 5])"))
    assert found.startswith("inBodies.m:2: bodies.body2.Jp")
    text = SMALL["inJoints.m"].replace("iPindex = 1", "iPindex = 2")
    (found,) = mistakes(inJoints=text)
    assert found.startswith("inJoints.m:1: joints.J1.P_j")
    assert "body i and body j are both ground" in found
    line = "J1 = Joint_struct; J1.type = 'sph-sph'; J1.V2index = 1; J1.el = 0;\nJoints = [J1];\n"
    assert mistakes(inJoints=line)[0].startswith("inJoints.m:1: joints.J1.length = 0.0")


def test_a_body_that_contradicts_the_points(mistakes):
    (found,) = mistakes(**changed("inJoints", "iPindex = 1", "iPindex = 1; J1.iBindex = 2"))
    assert "J1.iBindex = 2: is another body than that of iPindex, body 1" in found


def test_arrays_that_are_not_there_or_of_another_kind(mistakes):
    (found,) = mistakes(inForces="S1 = Force_struct;\n")
    assert found.startswith("inForces.m: does not make the array Forces")
    (found,) = mistakes(inForces="Forces = 3;\n")
    assert found == "inForces.m:1: Forces: should be an array of Force_struct, not a number"
    (found,) = mistakes(inForces="P = Point_struct;\nForces = [P];\n")
    assert "not an array of Point_struct" in found
    text = SMALL["inVectors1.m"] + "Vectors = Vectors1;\n"
    (found,) = mistakes(inVectors1=text)
    assert "makes both Vectors1 and Vectors" in found


@pytest.mark.parametrize(
    "words",
    ["1e308 + 1e308", "-1e308 - 1e308", "[1e200 1e200] * [1e200; 1e200]", "1e308 * 10", "1e9 ^ 99"],
)
def test_arithmetic_that_overflows_is_refused(mistakes, words):
    """numpy's warning of it is no message to a user."""
    (found,) = mistakes(**changed("inBodies", "B1.mass = 2", f"B1.mass = {words}"))
    assert "not a finite real number" in found
