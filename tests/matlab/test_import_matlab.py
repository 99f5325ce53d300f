"""From MATLAB structures to a scene: every type, every field, what is defaulted and left out."""

import numpy as np
import pytest
from support.matlab import write
from support.rotations import rotation

import dap3d_core as dap
from dap3d_core.interface import PluginError
from dap3d_matlab.importer import translate
from dap3d_matlab.translate.bodies import parameters_of


@pytest.fixture
def read(tmp_path):
    """The scene and the report of the small model with some files replaced; no mistakes."""

    def call(**files):
        scene, fields = translate(write(tmp_path / "small", **files))
        assert fields.model.mistakes == []
        return scene, fields.report

    return call


def told(remarks):
    return [str(r) for r in remarks]


def bodies(line, more=""):
    """Two bodies, the first with some lines of its own."""
    return f"B1 = Body_struct; {line}\nB2 = Body_struct;\n{more}Bodies = [B1; B2];\n"


# ---------------------------------------------------------------- bodies


def test_a_body_as_given(read):
    line = (
        "B1.mass = 2; B1.Jp = [3 0.1 0; 0.1 3 0; 0 0 4]; B1.r = [1 2 3]; B1.p = [0; 1; 0; 0];"
        "B1.r_dot = [4; 5; 6]; B1.w = [7; 8; 9]; B1.color = 'g';"
    )
    scene, report = read(inBodies=bodies(line))
    body = scene.bodies["body1"]
    assert (body.mass, body.r, body.p) == (2.0, (1.0, 2.0, 3.0), (0.0, 1.0, 0.0, 0.0))
    assert body.Jp == ((3.0, 0.1, 0.0), (0.1, 3.0, 0.0), (0.0, 0.0, 4.0))
    assert (body.r_dot, body.w, body.color) == ((4.0, 5.0, 6.0), (7.0, 8.0, 9.0), "g")
    assert "inBodies.m:2: B2: mass = 1, Jp = eye(3), r = [0;0;0]" in told(report.defaulted)
    other = scene.bodies["body2"]
    assert (other.mass, other.Jp, other.r) == (1.0, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
    assert (other.p, other.r_dot, other.w) == ((1.0, 0.0, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3)


def test_nine_numbers_in_line_are_a_matrix_by_rows(read):
    scene, report = read(inBodies=bodies("B1.Jp = [2 0.5 0 0.5 2 0 0 0 3];"))
    assert scene.bodies["body1"].Jp == ((2.0, 0.5, 0.0), (0.5, 2.0, 0.0), (0.0, 0.0, 3.0))
    assert any("row by row" in t for t in told(report.changed))


def test_a_rotation_matrix_in_place_of_euler_parameters(read):
    """A quarter turn about z: p = (cos 45, 0, 0, sin 45)."""
    scene, report = read(inBodies=bodies("B1.A = [0 -1 0; 1 0 0; 0 0 1];"))
    half = np.sqrt(0.5)
    np.testing.assert_allclose(scene.bodies["body1"].p, [half, 0, 0, half], atol=1e-15)
    assert any("B1.A gives the orientation" in t for t in told(report.changed))


def test_euler_parameters_of_rotation_matrices():
    """Random ones and half turns."""
    rng = np.random.default_rng(3)
    samples = [*rng.normal(size=(200, 4)), *np.eye(4)]
    for p in samples:
        p = p / np.linalg.norm(p)
        found = parameters_of(rotation(p))
        np.testing.assert_allclose(np.abs(found @ p), 1.0, atol=1e-14)


def test_rates_of_euler_parameters_in_place_of_an_angular_velocity(read):
    """p_dot = G^T w / 2 with G = [-e, e~ + e0 I] (docs/reference/notation.md), turned round."""
    p, w = np.array([0.5, 0.5, 0.5, 0.5]), np.array([1.0, -2.0, 3.0])
    e0, e = p[0], p[1:]
    skew = np.array([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])
    G = np.column_stack([-e, skew + e0 * np.eye(3)])
    p_dot = "; ".join(repr(x) for x in (0.5 * G.T @ w).tolist())
    line = f"B1.p = [0.5; 0.5; 0.5; 0.5]; B1.p_dot = [{p_dot}];"
    scene, _ = read(inBodies=bodies(line))
    np.testing.assert_allclose(scene.bodies["body1"].w, w, atol=1e-15)


def test_two_ways_to_say_one_thing_must_agree(read, mistakes):
    line = "B1.p = [1;0;0;0]; B1.A = eye(3); B1.w = [0;0;0]; B1.p_dot = [0;0;0;0];"
    _, report = read(inBodies=bodies(line))
    assert [t.partition(": ")[2] for t in told(report.unused)] == [
        "B1.A says what p says: p is read",
        "B1.p_dot says what w says: w is read",
    ]
    found = mistakes(inBodies=bodies("B1.p = [1;0;0;0]; B1.A = diag([1 -1 -1]);"))
    assert "B1.A" in found[0]
    assert "another orientation than p" in found[0]
    found = mistakes(inBodies=bodies("B1.w = [1;0;0]; B1.p_dot = [0;0;1;0];"))
    assert "another rotation than w" in found[0]
    found = mistakes(inBodies=bodies("B1.p_dot = [1;0;0;0];"))
    assert "right angles to p" in found[0]
    for matrix in ("[1 0 0; 0 2 0; 0 0 1]", "-eye(3)", "zeros(3)"):
        assert "should be a rotation matrix" in mistakes(inBodies=bodies(f"B1.A = {matrix};"))[0]


def test_colours(read, mistakes):
    scene, _ = read(inBodies=bodies("B1.color = [1 0.5 0];"))
    assert scene.bodies["body1"].color == "#ff8000"
    assert scene.bodies["body2"].color == ""
    assert "from 0 to 1" in mistakes(inBodies=bodies("B1.color = [1 2 0];"))[0]


def test_the_place_in_the_array_is_the_number(read):
    """The number of a body is its place in the array, whatever its variable is called."""
    text = "B1 = Body_struct; B1.mass = 2; B2 = Body_struct; B2.mass = 3; B3 = B1;\n"
    scene, report = read(inBodies=text + "Bodies = [B2; B1];\nB1.mass = 7;\n")
    assert [b.mass for b in scene.bodies.values()] == [3.0, 2.0]
    assert told(report.changed) == [
        "inBodies.m:1: B2 is number 1 of Bodies: body1 in the scene",
        "inBodies.m:1: B1 is number 2 of Bodies: body2 in the scene",
    ]
    assert [t.partition(": ")[2] for t in told(report.unused)] == [
        "B1 was changed after Bodies was made: without effect, as in MATLAB",
        "B3 is not in Bodies: left out",
    ]


# ---------------------------------------------------------------- elements

JOINTS = {
    "sph": ("iPindex = 1; E.jPindex = 2", {"P_i": "P1", "P_j": "P2"}),
    "rev": (
        "iPindex = 1; E.jPindex = 2; E.iVindex_a = 1; E.jVindex_a = 2",
        {"P_i": "P1", "P_j": "P2", "a_i": "V1", "a_j": "V2"},
    ),
    "sph-sph": ("V2index = 1; E.el = 2.5", {"d": "d1", "length": 2.5}),
    "cyl": ("iVindex_a = 3; E.jVindex_a = 1; E.V2index = 1", {"a_i": "V3", "a_j": "V1", "d": "d1"}),
    "tran": (
        "jVindex_a = 1; E.V2index = 1; E.Ac = [0 -1 0 1 0 0 0 0 1]",
        {"a_j": "V1", "d": "d1", "A_c": ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))},
    ),
    "univ": (
        "iPindex = 1; E.jPindex = 2; E.iVindex_a = 1; E.jVindex_n = 2",
        {"P_i": "P1", "P_j": "P2", "a_i": "V1", "n_j": "V2"},
    ),
    "rel-rot": (
        "iBindex = 2; E.jBindex = 1; E.jVindex_a = 1; E.iFunct = 1",
        {"body_i": "body2", "body_j": "body1", "a_j": "V1", "function": "f1"},
    ),
    "rel-tran": (
        "iBindex = 2; E.jVindex_a = 2",
        {"body_i": "body2", "body_j": "ground", "a_j": "V2"},
    ),
    "rP": (
        "iBindex = 2; E.jVindex_a = 2; E.el = 0.65; E.iFunct = 1",
        {"body_i": "body2", "a_j": "V2", "length": 0.65, "function": "f1"},
    ),
    "fix": ("iBindex = 2", {"body_i": "body2"}),
    "disk": (
        "disk = 'zn'; E.iBindex = 2; E.R = 0.2",
        {"body_i": "body2", "slip": "nz", "radius": 0.2},
    ),
}
FORCES = {
    "ptp": (
        "V2index = 1; E.k = 2; E.c = 3; E.el_0 = 4; E.f_a = 5",
        {"d": "d1", "k": 2.0, "c": 3.0, "l0": 4.0, "f_a": 5.0},
    ),
    "rot_sda": (
        "iVindex = 3; E.jVindex = 1; E.kVindex = 1; E.k = 2; E.c = 3; E.theta_0 = pi/8; E.n_a = 5",
        {"v_i": "V3", "v_j": "V1", "axis": "V1", "k": 2.0, "c": 3.0, "theta_0": np.pi / 8}
        | {"n_a": 5.0},
    ),
    "weight": ("gravity = 1.6; E.wgt = [0; -1; 0]", {"gravity": 1.6, "wgt": (0.0, -1.0, 0.0)}),
    "fp": ("iBindex = 2; E.fp = [1; 2; 3]", {"body_i": "body2", "fp": (1.0, 2.0, 3.0)}),
    "np": ("iBindex = 2; E.np = [1; 2; 3]", {"body_i": "body2", "np": (1.0, 2.0, 3.0)}),
    "f": ("iPindex = 3; E.f = [1; 2; 3]", {"P_i": "P3", "f": (1.0, 2.0, 3.0)}),
    "n": ("iBindex = 2; E.n = [1; 2; 3]", {"body_i": "body2", "n": (1.0, 2.0, 3.0)}),
}
ELEMENTS = {"Joint": JOINTS, "Force": FORCES}


def element_of(kind, word):
    """The file of one joint or force, by its name: its text."""
    given = ELEMENTS[kind][word][0]
    return {f"in{kind}s": f"E = {kind}_struct; E.type = '{word}'; E.{given};\n{kind}s = [E];\n"}


@pytest.mark.parametrize(
    ("kind", "word"), [(kind, word) for kind, words in ELEMENTS.items() for word in words]
)
def test_joints_and_forces(read, tmp_path, kind, word):
    """Numbers become names, fields those of the scene, which their types accept."""
    files = element_of(kind, word)
    scene, report = read(**files)
    element = scene.joints["J1"] if kind == "Joint" else scene.forces["F1"]
    assert element.type == word
    assert element.fields == ELEMENTS[kind][word][1]
    assert report.unused == []
    files = {name: text.replace("[0 -1 0 1 0 0 0 0 1]", "eye(3)") for name, text in files.items()}
    scene, _ = dap.import_matlab(write(tmp_path / "again", **files))
    assert {**scene.joints, **scene.forces}[element.name].type == word


FUNCTIONS = {
    "a": ("coeff = [0 2*pi 0]", {"coeff": (0.0, 2 * np.pi, 0.0)}),
    "b": (
        "x_start = 0.5; C.x_end = 0.8; C.f_start = 1; C.f_end = 2",
        {"x_start": 0.5, "x_end": 0.8, "f_start": 1.0, "f_end": 2.0},
    ),
    "c": (
        "f_end = 0.8; C.x_max = 0.5; C.f_max = 1",
        {"x_start": 0.0, "x_end": 1.0, "f_start": 0.0, "f_end": 0.8, "x_max": 0.5, "f_max": 1.0},
    ),
    "d": (
        "x_start = 0.5; C.x_end = 2; C.f_start = 0; C.fp_end = 2*pi",
        {"x_start": 0.5, "x_end": 2.0, "f_start": 0.0, "fp_end": 2 * np.pi},
    ),
}


@pytest.mark.parametrize("word", FUNCTIONS)
def test_functions(tmp_path, word):
    given, expected = FUNCTIONS[word]
    text = f"C = Funct_struct; C.type = '{word}'; C.{given};\nFuncts = [C];\n"
    scene, report = dap.import_matlab(write(tmp_path, inFuncts=text))
    assert scene.functions["f1"].type == word
    assert scene.functions["f1"].fields == expected
    if word == "c":
        assert "inFuncts.m:1: C: x_start = 0, x_end = 1, f_start = 0" in told(report.defaulted)


def joint(line):
    return f"J1 = Joint_struct; {line}\nJoints = [J1];\n"


def test_two_points_stand_for_a_vector_of_type_2(read, mistakes):
    scene, _ = read(
        inJoints=joint("J1.type = 'sph-sph'; J1.iPindex = 3; J1.jPindex = 1; J1.el = 2;")
    )
    assert scene.joints["J1"].fields == {"P_i": "P3", "P_j": "P1", "length": 2.0}
    both = "J1.type = 'sph-sph'; J1.V2index = 1; J1.el = 2; J1.iPindex = 3; J1.jPindex = {j};"
    scene, _ = read(inJoints=joint(both.format(j=1)))
    assert scene.joints["J1"].fields == {"d": "d1", "length": 2.0}
    found = mistakes(inJoints=joint(both.format(j=2)))
    assert "J1.jPindex = 2: is another point than that of vector 1" in found[0]


def test_defaults_of_joints_are_told(read):
    lines = (
        "J1 = Joint_struct; J1.iPindex = 1; J1.jPindex = 2;\n"
        "J2 = Joint_struct; J2.type = 'disk'; J2.iBindex = 2;\n"
        "J3 = Joint_struct; J3.type = 'rel-rot'; J3.iBindex = 1; J3.jVindex_a = 2;\n"
        "J4 = Joint_struct; J4.type = 'tran'; J4.jVindex_a = 1; J4.V2index = 1;\n"
        "Joints = [J1; J2; J3; J4];\n"
    )
    scene, report = read(inJoints=lines)
    assert scene.joints["J2"].fields == {"body_i": "body2", "slip": "xyz", "radius": 1.0}
    assert [t for t in told(report.defaulted) if t.startswith("inJoints")] == [
        "inJoints.m:1: J1: type = 'sph'",
        "inJoints.m:2: J2: disk = 'xyz', R = 1",
        "inJoints.m:3: J3: jBindex = 0, the ground, iFunct = 0, no motion: a lock",
        "inJoints.m:4: J4: Ac = eye(3)",
    ]


def test_a_joint_may_name_a_disk(read, mistakes):
    disk = "D1 = Disk_struct; D1.iBindex = 2; D1.type = 'z'; D1.R = 0.3;\nDisks = [D1];\n"
    line = "J1.type = 'disk'; J1.iDisk = 1;"
    scene, report = read(inJoints=disk + joint(line))
    assert scene.joints["J1"].fields == {"body_i": "body2", "slip": "z", "radius": 0.3}
    assert any("names D1" in t for t in told(report.changed))
    found = mistakes(inJoints=disk + joint(line + " J1.R = 0.2;"))
    assert "J1.R = 0.2: is another value than that of disk 1" in found[0]
    found = mistakes(inJoints=joint("J1.type = 'disk'; J1.iDisk = 2; J1.iBindex = 1;"))
    assert "there is no disk 2" in found[0]
    assert "only a joint of type disk" in mistakes(inJoints=disk + joint("J1.iDisk = 1;"))[0]


def test_friction_of_a_joint_becomes_a_force(read, mistakes):
    line = "J1.iPindex = 1; J1.jPindex = 2; J1.mu = 0.2; J1.R = 0.05;"
    scene, report = read(inJoints=joint(line))
    assert list(scene.forces) == ["F1", "friction_J1"]
    assert scene.forces["friction_J1"].type == "friction"
    assert scene.forces["friction_J1"].fields == {"joint": "J1", "mu": 0.2, "radius": 0.05}
    assert any("became the force friction_J1" in t for t in told(report.changed))
    scene, report = read(inJoints=joint(line.replace("J1.R = 0.05;", "")))
    assert scene.forces["friction_J1"].fields["radius"] == 1.0
    assert "inJoints.m:1: J1: R = 1, the radius of its friction" in told(report.defaulted)
    disk = "J1.type = 'disk'; J1.iBindex = 2; J1.R = 0.2; J1.disk = 'z'; J1.mu = 0.1;"
    scene, _ = read(inJoints=joint(disk))
    assert scene.forces["friction_J1"].fields == {"joint": "J1", "mu": 0.1}
    fix = "J1.type = 'fix'; J1.iBindex = 2; J1.mu = 0.1;"
    assert "no law of friction for a joint of type fix" in mistakes(inJoints=joint(fix))[0]


@pytest.mark.parametrize("word", ["sph", "rev", "cyl", "tran", "disk"])
def test_friction_of_joints_is_accepted_by_its_type(tmp_path, word):
    given = JOINTS[word][0].replace("[0 -1 0 1 0 0 0 0 1]", "eye(3)")
    line = f"E = Joint_struct; E.type = '{word}'; E.{given}; E.mu = 0.2;\nJoints = [E];\n"
    scene, _ = dap.import_matlab(write(tmp_path, inJoints=line))
    assert scene.forces["friction_J1"].fields["mu"] == 0.2


def test_a_friction_force_of_the_file(read, mistakes):
    line = "J1.iPindex = 1; J1.jPindex = 2; J1.R = 0.05;"
    force = "S1 = Force_struct; S1.type = 'friction'; S1.v_tol = 1e-2;\nForces = [S1];\n"
    scene, report = read(inJoints=joint(line), inForces=force)
    expected = {"joint": "J1", "mu": 0.5, "v_tol": 0.01, "radius": 0.05}
    assert scene.forces["F1"].fields == expected
    assert "inForces.m:1: S1: joint = 1, mu = 0.5" in told(report.defaulted)
    found = mistakes(inJoints=joint(line + " J1.mu = 0.2;"), inForces=force)
    assert "has a mu of its own" in found[0]


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({"inBodies": bodies("B1.m_inv = 3; B1.irc = 1;")},
         ["B1.m_inv is worked out by the program", "B1.irc is worked out by the program"]),
        ({"inJoints": joint("J1.iPindex = 1; J1.jPindex = 2; J1.el = 3; J1.mrows = 3; "
                            "J1.disk = 'xyz';")},
         ["J1.el has no meaning for the type sph", "J1.mrows is worked out by the program"]),
    ],
    ids=["body", "joint"],
)  # fmt: skip
def test_what_is_not_taken_is_left_out_with_a_word(read, files, words):
    _, report = read(**files)
    assert [t.partition(": ")[2] for t in told(report.unused)] == [f"{w}: not read" for w in words]


def test_animation(read, mistakes):
    points = "P1 = Point_struct; P1.Bindex = 1; P1.sPp = [1; 2; 3]; Points_anim = P1;\n"
    limits = "xmin = -1; xmax = 1; ymin = -2; ymax = 2; zmin = -3; zmax = 3;\n"
    scene, _ = read(inAnimate=points + limits)
    assert [(p.body, p.sPp) for p in scene.animation.points] == [("body1", (1.0, 2.0, 3.0))]
    assert scene.animation.limits == ((-1.0, 1.0), (-2.0, 2.0), (-3.0, 3.0))
    scene, report = read(inAnimate=points + "xmin = -1; xmax = 1;")
    assert scene.animation.limits is None
    assert any("no ymin, ymax, zmin, zmax" in t for t in told(report.unused))
    found = mistakes(inAnimate=points + limits.replace("-1", "'a'"))
    assert found == ['inAnimate.m:2: xmin = "a": should be a number']


def test_absent_files_and_others_are_told(read, tmp_path):
    write(tmp_path / "small", notes="x = 1;")
    none = dict.fromkeys(("inForces", "inFuncts", "inAnimate"))
    for name in none:
        (tmp_path / "small" / f"{name}.m").unlink()
    scene, report = read(**none)
    assert scene.forces == {}
    found = {f.name: (f.state, f.holds) for f in report.files}
    assert found["inForces.m"] == ("absent", "no forces")
    assert found["notes.m"] == ("not read", "no file of a model")
    assert found["inPoints.m"] == ("read", "3 points")


def test_notes_of_the_check_are_part_of_the_report(tmp_path):
    text = "V1 = Vector1_struct; V1.Bindex = 1; V1.sp = [0; 2; 0];\nVectors = [V1];\n"
    scene, report = dap.import_matlab(write(tmp_path, inVectors1=text))
    assert list(scene.vectors) == ["V1"]
    assert any("V1" in note for note in report.notes)


# ---------------------------------------------------------------- the user's force

USER = "S1 = Force_struct; S1.type = 'user';\nForces = [S1];\n"


def test_a_stub_for_the_force_of_the_user(tmp_path):
    """It names the bodies, shows the text, and is refused as long as it is not filled in."""
    text = 'f = Bodies(2).r; % Bodies(9)\nBodies(1).f = """quotes""" + f; \\\n'
    folder = write(tmp_path / "m", inForces=USER, user_force=text)
    scene, report = dap.import_matlab(folder)
    assert scene.forces["F1"].fields == {"body_i": "body1", "body_j": "body2"}
    assert report.user_force == text
    (tmp_path / "plugin.py").write_text(report.stub)
    with pytest.raises(PluginError, match="write it here"):
        dap.load_registry().with_file(tmp_path / "plugin.py").get("force", "user")
    filled = report.stub.replace('        raise NotImplementedError("write it here")\n', "")
    (tmp_path / "plugin.py").write_text(filled)
    type_info = dap.load_registry().with_file(tmp_path / "plugin.py").get("force", "user")
    assert type_info.layout.slots == ("i", "j")


def test_what_the_stub_cannot_hold_is_told(tmp_path):
    for text in ("Bodies(k).f = 1;", "Bodies(1).f + Bodies(2).f", "x = 1;"):
        folder = write(tmp_path / "m", inForces=USER, user_force=text)
        scene, report = dap.import_matlab(folder)
        assert scene.forces["F1"].fields["body_i"] == "body1"
        is_told = any("it speaks of bodies" in t for t in told(report.unused))
        assert is_told == ("Bodies(2)" not in text), text


def test_a_force_of_the_user_needs_its_file_and_its_bodies(mistakes, read):
    assert mistakes(inForces=USER) == [
        "inForces.m:1: F1: a force of type user needs the file user_force.m, which is not there"
    ]
    found = mistakes(inForces=USER, user_force="Bodies(7).f = 1;")
    assert found == ["user_force.m: Bodies(7): there is no body 7; Bodies has 2"]
    _, report = read(user_force="x = 1;")
    assert told(report.unused) == ["user_force.m: no force is of type user: not used"]


# ---------------------------------------------------------------- among the other formats


def test_import_model_knows_the_folder_by_its_file(tmp_path):
    folder = write(tmp_path / "model")
    scene, report = dap.import_model(folder)
    assert (scene, report) == dap.import_matlab(folder)
    assert dap.import_model(folder, format="matlab") == (scene, report)
    with pytest.raises(dap.SceneError, match="takes no options of packages, links, joints"):
        dap.import_model(folder, positions={"J1": 1.0})
    more = write(tmp_path / "more", user_force="x = 1;")
    with pytest.raises(dap.SceneError, match=r"user_force\.m.*would be left out"):
        dap.import_model(more, strict=True)
    with pytest.raises(dap.SceneError, match="is a file; a MATLAB model is a folder"):
        dap.import_model(folder / "inBodies.m", format="matlab")
    (folder / "inBodies.m").unlink()
    with pytest.raises(dap.SceneError, match="is a folder"):
        dap.import_model(folder)
