"""The command line used wrongly: one message that says what is allowed, and the right exit code.
What a process of its own is not needed for runs in this one, with the streams of the process."""

import json
import os
import shutil
import subprocess
import sys
import threading
from functools import partial

import numpy as np
import pytest
from support.command_line import dap3d
from support.falling import SCENE
from support.process import REPOSITORY, together
from tests.e2e.conftest import COMMAND, environment

import dap3d_core as dap
from dap3d_core.cli import main
from dap3d_core.result.file.atomic_write import whole_file

ARM = REPOSITORY / "tests" / "data" / "formats" / "arm.urdf"
#: Width of the narrowest terminal that lines are made for.
COLUMNS = 60


@pytest.fixture(scope="module")
def falling(tmp_path_factory):
    """A folder with a scene, fall.toml, and its result, fall.nc."""
    folder = tmp_path_factory.mktemp("falling")
    (folder / "fall.toml").write_text(SCENE)
    dap.simulate(dap.load(folder / "fall.toml"), output=folder / "fall.nc")
    dap.sweep(folder / "fall.toml", {"bodies.stone.mass": [1.0]}, outputs="stone.r.z",
              output=folder / "swept.nc")  # fmt: skip
    return folder


@pytest.fixture
def folder(falling, tmp_path, monkeypatch):
    """The working folder: that scene and result, and things that are none."""
    for name in ("fall.toml", "fall.nc"):
        shutil.copy(falling / name, tmp_path / name)
    shutil.copy(ARM, tmp_path)
    shutil.copy(falling / "fall.nc", tmp_path / "single.nc.part")
    shutil.copy(falling / "swept.nc", tmp_path / "swept.nc.part")
    (tmp_path / "foreign.nc.part").write_text("words\n")
    (tmp_path / "foreign.checkpoint").write_text("words\n")
    (tmp_path / "words").write_text("words\n")
    (tmp_path / "words.png").write_text("words\n")
    (tmp_path / "empty.nc").write_bytes(b"")
    (tmp_path / "sub").mkdir()
    (tmp_path / "link.nc").symlink_to("fall.nc")
    (tmp_path / "leads-nowhere.nc").symlink_to("nowhere.nc")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", str(COLUMNS))
    return tmp_path


@pytest.fixture
def call(folder, capfd):
    """Run a command in this process; exit code, stdout and stderr, which hold no traceback."""

    def run(*words):
        code = main([str(word) for word in words])
        out, err = capfd.readouterr()
        assert "Traceback" not in err
        assert not err.startswith("unexpected")
        return code, out, err

    return run


R, MASS = "fall.nc", "bodies.stone.mass"
#: The file of a sweep.
S = "swept.nc.part"
#: Commands that read a result.
OF_RESULTS = ("info", "post", "export", "plot", "animate", "view")
#: A sweep without mistakes, in parts.
SWEEP = ("sweep", "fall.toml")
VARY, KEEP = ("--vary", "bodies.stone.mass=1,2"), ("--keep", "stone.r.z")
QUIET = ("-o", "new.nc")
RESPONSE = ("response", "fall.toml", "--input", "gravity.gravity", "--output", "stone.r.x")
#: Words of a command -> what its message says. All are refused with 2 and change no file.
REFUSED = [
    # settings
    (("run", "fall.toml", "--t-end", "-1"), "--t-end = -1.0: should be at least 0"),
    (("run", "fall.toml", "--t-end", "soon"), "'soon' is not a valid number in s"),
    (("run", "fall.toml", "--t-end", "1e12", "--dt", "1"), "9.69e+04 GiB"),
    (("run", "fall.toml", "--integrator", "rk4"), "rk4 does not choose its step"),
    (("run", "fall.toml", "--checkpoint", "0"), "'0' is no time; write 90, 90s, 5min or 2h"),
    # going on, and again
    (("resume",), "Missing argument 'CHECKPOINT'"),
    (("resume", "."), "it is a folder"),
    (("resume", "fall.toml"), "it is no checkpoint of dap3d"),
    (("info", "foreign.checkpoint"), "dap3d resume foreign.checkpoint"),
    (("rerun",), "Missing argument 'RESULT'"),
    (("rerun", "fall.toml"), "it is not a NetCDF-4 file"),
    # analyses
    (("equilibrium", "pne1"), "did you mean 'pen1'"),
    (("equilibrium", "fall.toml", "--over", "bodies.stone.mass"), "write PARAMETER=FROM:TO:N"),
    (("equilibrium", "fall.toml", "--over", "bodies.stone.mass=1:2"), "add how many, 1:2:9"),
    (("equilibrium", "fall.toml", "--over", "bodies.stone.mass=1:2:3", "-o", "rest.toml"),
     "a figure is one of"),
    (("equilibrium", "fall.toml", "--of", "stone.r.z"), "give --over PARAMETER=FROM:TO:N"),
    (("modes", "fall.toml", "--locus"), "give --over and --plot FILE.png"),
    (("kinematics", "pne1"), "did you mean 'pen1'"),
    (("inverse", "pne1"), "Missing argument 'MOTION'"),
    (("modes", "fall.toml", "-n", "0"), "is not in the range x>=1"),
    (("response", "fall.toml", "--input", "a"), "Missing option '--output'"),
    (("check-plugin", "."), "pip install -e .,"),
    (("import", "fall.toml"), "dap3d run fall.toml"),
    (("response", "fall.toml", "--input", "a", "--output", "stone.r.z"), "input, force or driver"),
    # sensitivities
    (("sensitivities", "fall.toml"), "Missing option '--by'"),
    (("sensitivities", "fall.toml", "--by", "bodies.stone.mass", "-o", "x.docx"), ".nc"),
    # sweeps
    (("sweep",), "Missing argument 'MODEL'"),
    (SWEEP, "--vary: nothing varies"),
    ((*SWEEP, *VARY), "--keep: name at least one output"),
    ((*SWEEP, "--vary", "bodies.stone.mass", *KEEP), "what varies is NAME=FORM"),
    ((*SWEEP, "--vary", "bodies.stnoe.mass=1,2", *KEEP), "did you mean 'bodies.stone.mass'"),
    ((*SWEEP, *VARY, *KEEP, "--sample", "two"), "'two' is not a valid integer"),
    ((*SWEEP, *VARY, *KEEP, "--seed", "3"), "--seed is of samples"),
    ((*SWEEP, *VARY, *KEEP, "--resume"), "there is no fall-sweep.nc.part"),
    ((*SWEEP, *VARY, *KEEP, "-o", R), "--force overwrites it"),
    ((*SWEEP, *VARY, *KEEP, "-o", "fall.toml", "--force"), "is the input file"),
    ((*SWEEP, *VARY, *KEEP, "-o", "swept.nc"), "resume goes on with it"),
    ((*SWEEP, *VARY, *KEEP, "-o", "foreign.nc", "--resume"), "not a NetCDF-4 file"),
    ((*SWEEP, *VARY, *KEEP, "-o", "foreign.nc", "--force"), "move it away"),
    (("animate", "swept.nc.part"), "the points of a sweep"),
    (("plot", S, "stone.r.zz"), "did you mean 'stone.r.z'"),
    (("plot", R, "--at", "bodies.stone.mass=1"), "chooses points of a sweep"),
    (("view", S, "--quantity", "stnoe.r.z"), "did you mean 'stone.r.z'"),
    # options and arguments
    (("run", "fall.toml", "--bogus"), "No such option '--bogus'"),
    (("run", "fall.toml", "--t-ned", "1"), "'--t-end'"),
    (("run", "fall.toml", "--t-end", "1", "--t-end", "2"), "--t-end is given more than once"),
    (("run", "fall.toml", "--t-end"), "requires an argument"),
    (("run", "--", "fall.toml", "--t-end", "1"), "unexpected extra arguments (--t-end 1)"),
    (("run", "fall.toml", "--", "-o", "x.nc"), "unexpected extra arguments (-o x.nc)"),
    (("run", ""), "'MODEL' is empty"),
    (("run", "fall.toml", "-o", ""), "'--output' is empty"),
    (("rnu", "fall.toml"), "did you mean 'run'"),
    (("--bogus",), "No such option '--bogus'"),
    # files of scenes
    (("run", "pne1"), "did you mean 'pen1'"),
    (("run", "sub"), "the folder has no scene.toml"),
    (("check", "fall.toml", "--methd", "lsq"), "'--method'"),
    (("report", "fall.toml", "--target-error", "-1"), "positive number"),
    (("report", "fall.toml", "--csv", "x", "-o", "x"), "name one file twice"),
    # outputs
    (("run", "fall.toml", "-o", R), "--force overwrites it"),
    (("run", "fall.toml", "-o", "fall.toml", "--force"), "is the input file"),
    (("run", "fall.toml", "-o", "x" * 300), "File name too long"),
    *(((c, "fall.toml", "-o", "x.csv"), "name a .nc file with -o; dap3d post")
      for c in ("run", "kinematics")),
    ((*SWEEP, *VARY, *KEEP, "-o", "x"), "name a .nc file"),
    (("equilibrium", "fall.toml", "-o", "x.csv"), "name a .toml file"),
    # analyses
    (("modes", "fall.toml", "--at", f"{R}@0.044"), "no instant at t = 0.044 s; the nearest is"),
    (("modes", "fall.toml", "--at", f"{R}@soon"), "'soon' is no time in s"),
    (("modes", "fall.toml", "--at", R, "--t", "1"), "--t does not go with --at"),
    (("modes", "fall.toml", "--mode", "1"), "--mode chooses the motion that -o writes"),
    (("modes", "fall.toml", "--mode", "7", "-o", "m.nc"), "the modes are 1 to 6"),
    (("modes", "fall.toml", "--plot", "e.txt"), "cannot write e.txt"),
    (("modes", "fall.toml", "--over", "bodies.stone.mas=1:2:3"), f"did you mean '{MASS}'"),
    (("modes", "fall.toml", "--over", f"{MASS}=1:2:3", "-o", "m.nc"), "--over does not go with"),
    *((("modes", "pen1", "--t", t), "--t") for t in ("inf", "nan", "x")),
    ((*RESPONSE, "--from", "3", "--to", "1"), "give --from below --to"),
    ((*RESPONSE, "-o", "bode.docx"), ".png"),
    ((*RESPONSE, "-n", "1"), "is not in the range"),
    # starts
    (("run", "fall.toml", "--from", f"{R}@9"), "the result reaches from t = 0 s to 0.1 s"),
    (("run", "fall.toml", "--from", "fall.toml"), "fall.toml"),
    (("run", "fall.toml", "--from", R, "--start", "equilibrium"), "give one"),
    (("run", "fall.toml", "--start", "rest"), "'scene', 'equilibrium'"),
    (("run", "fall.toml", "--from", ""), "is empty"),
    (("run", "pen1", "--from", R), "it is of another scene: it has no body cone"),
    (("equilibrium", "fall.toml", "--from", R, "-o", R, "--force"), "is the input file"),
    # results
    *(((c, "nothing.nc"), "there is no such file") for c in ("info", "post", "plot", "view")),
    *(((c, "empty.nc"), "the file is empty") for c in OF_RESULTS),
    *(((c,), "Missing argument") for c in OF_RESULTS),
    (("post", R, "-o", "x.txt"), "name a .nc or a .csv file"),
    (("post", R, "-o", "x.csv", "--format", "nc"), "leave one out"),
    (("post", R, "-o", R, "--force"), "is the input file"),
    (("export", R, "-o", "x.txt"), ".csv, .glb, .mat, .vtkhdf"),
    (("export", R, "-o", "x.csv", "--format", "mat"), "its name says csv"),
    (("export", R, "--fps", "0"), "a number above 0"),
    (("export", R, "-o", "sub"), "or a format"),
    (("export", R, "--platform", "linux"), "--platform is of formats c and fmu"),
    (("export", "pne1", "--format", "c"), "did you mean 'pen1'"),
    (("export", "fall.toml", "--format", "fmu", "--platform", "plan9"), "platforms: linux"),
    (("export", "fall.toml", "--format", "c", "--quantity", "stnoe.r"), "did you mean 'stone.r'"),
    (("plot", R, "--width", "0"), "--width is from 13 to 2540 mm, not 0"),
    (("animate", R, "--size", "big"), "such as 640x480"),
    (("animate", R, "--fps", "nan"), "from 1 to 50"),
    (("animate", R, "--view", "q"), "AZIMUTH,ELEVATION"),
    (("view", R, "--fps", "0"), "greater than 0"),
    # types and packages
    (("plugins", "x"), "unexpected extra argument (x)"),
    (("models", "--jsn"), "'--json'"),
    (("describe",), "Missing argument"),
    (("describe", "pen1", "--names"), "--names is of types, and pen1 is a model"),
    (("check-plugin", "shp"), "did you mean 'sph'"),
    (("check-plugin", "nothing.py"), "there is no file nothing.py"),
    (("check-plugin",), "give --all"),
    (("new-plugin",), "Missing argument"),
    (("new-plugin", "mine", "--kind", "wheel"), "'wheel' is not one of"),
    (("new-plugin", "rev"), "there is a joint type 'rev' already"),
    (("new-plugin", "mine", "--author", "a\nb"), "one line"),
    *((("new-plugin", name, "--force"), "would hide dap3d's own")
      for name in ("core", "joints", "formats")),
    *((("new-plugin", n, "--kind", k), f"there is an {k} '{n}' already, from distribution dap3d")
      for k, n in (("importer", "urdf"), ("exporter", "vtk"))),
    # a built-in one would never be reached, forced or not
    *((("new-plugin", n, "--kind", k, *force), f"dap3d itself has the {k} '{n}'")
      for k, n in (("integrator", "auto"), ("shape", "box")) for force in ((), ("--force",))),
    *((("plugins", "--no-compile", "--limit", n), "--limit") for n in ("nan", "inf", "0", "-1")),
    (("import", "nothing.urdf"), "nothing.urdf: there is no such file"),
    (("import", "sub"), "sub: is a folder"),
    (("import", "amr.urdf"), "did you mean 'arm.urdf'"),
    (("import", "arm.urdf", "--strict"), "effort"),
    (("import", "arm.urdf", "--root", "nowhere"), "nowhere is no folder"),
    (("import", "arm.urdf", "--position", "elbw=1"), "no such joint"),
    (("import", "arm.urdf", "--position", "elbow"), "write NAME=VALUE"),
    (("import", "arm.urdf", "--position", "a=1", "--position", "a=2"), "more than once"),
    (("import", "arm.urdf", "--position", "elbow=1,x"), "is no number"),
    (("import", "arm.urdf", "--package", "a=nowhere"), "nowhere is no folder"),
    (("import", "arm.urdf", "--limits", "softly"), "'off', 'soft', 'hard'"),
    (("import", "arm.urdf", "--arg", "L=2"), "write NAME:=VALUE"),
    (("import", "arm.urdf", "--arg", "L:=2"), "takes no argument 'L'"),
    (("run", "arm.urdf"), "dap3d import arm.urdf"),
    (("import", "words", "--format", "urfd", "-o", "made"), "did you mean 'urdf'"),
    (("import-matlab", "nothing"), "there is no such folder"),
    (("import-matlab", "sub"), "there is no inBodies.m"),
]  # fmt: skip


def _name(words):
    return " ".join(word if len(word) < 30 else f"{word[:9]}..." for word in words) or "-"


@pytest.mark.parametrize(("words", "said"), REFUSED, ids=[_name(words) for words, _ in REFUSED])
def test_a_mistake_is_told_and_changes_nothing(call, folder, words, said):
    """Exit code 2, nothing on stdout, lines that fit the terminal; with --json one object."""
    before = sorted(path.name for path in folder.iterdir())
    if words[0] == "run" and "-o" not in words and words[-1] not in ("--t-end", ""):
        words = (words[0], *QUIET, *words[1:])
    code, out, err = call(*words)
    told = " ".join(err.split())
    assert code == 2, err
    assert out == ""
    assert said in told or said in told.replace(" ", ""), err
    assert all(len(line) <= COLUMNS for line in err.splitlines()), err
    if words[0] in main_commands():
        code, out, again = call(words[0], "--json", *words[1:])
        assert (code, again) == (2, err)
        found = json.loads(out)
        assert found["exit_code"] == 2
        assert found["error"]
    assert sorted(path.name for path in folder.iterdir()) == before


def main_commands():
    """The commands that take --json."""
    return {
        name for name, command in dap3d.commands.items()
        if any("--json" in p.opts for p in command.params)
    }  # fmt: skip


def test_every_command_tries_wrong_words():
    tried = {words[0] for words, _ in REFUSED}
    assert set(dap3d.commands) <= tried
    assert set(dap3d.commands) == main_commands()


def test_all_that_is_wrong_with_a_plot_is_told_at_once(call):
    code, _, err = call("plot", R, "mispelt", "stnoe.r.z", "--x", "nor-this", "--width", "0",
                        "-o", "words.png")  # fmt: skip
    assert code == 2
    told = " ".join(err.split())
    for words in ("--width is from", "words.png exists", "'mispelt'", "'stone.r.z'", "'nor-this'"):
        assert words in told, err


@pytest.mark.parametrize("command", ["post", "view"])
def test_all_that_is_wrong_with_an_export_is_told_at_once(call, folder, command):
    target = folder / ("taken.nc" if command == "post" else "taken.html")
    target.write_text("taken")
    option = "--select" if command == "post" else "--quantity"
    code, _, err = call(command, R, "-o", target.name, option, "stnoe.r", option, "neither.r")
    assert code == 2
    told = " ".join(err.split())
    for words in (f"{target.name} exists", "'stnoe'", "'neither'"):
        assert words in told, err
    assert target.read_text() == "taken"


def test_an_absolute_tolerance_of_zero_is_noted(call):
    code, out, _ = call("run", "fall.toml", *QUIET, "--atol", "0", "--json")
    assert code == 0
    assert any("atol = 0" in note for note in json.loads(out)["notes"])


# ------------------------------------------------------------------ a package that is not there


@pytest.mark.parametrize("package", ["tree_sitter", "tree_sitter_matlab"])
def test_a_missing_package_is_told_with_its_extra(call, folder, monkeypatch, package):
    (folder / "sub" / "inBodies.m").write_text("B1 = Body_struct;\n")
    for name in [n for n in sys.modules if n.startswith((package, "dap3d_matlab"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    code, _, err = call("import-matlab", "sub")
    assert code == 2
    assert "pip install tree-sitter tree-sitter-matlab" in err
    assert not (folder / "scene.toml").exists()


# ------------------------------------------------------------------ disks and races


@pytest.mark.slow
@pytest.mark.skipif(not (shutil.which("setpriv") or os.getuid()), reason="root may write all")
def test_a_folder_that_is_read_only_is_refused(folder):
    """Where the test is run by root, without root's right to ignore permissions."""
    (folder / "sub").chmod(0o555)
    words = [] if os.getuid() else ["setpriv", "--bounding-set", "-dac_override"]
    done = subprocess.run([*words, *COMMAND, "run", "fall.toml", "-o", "sub/x.nc"], cwd=folder,
                          env=environment(), capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert "no permission to write in its folder" in " ".join(done.stderr.split())


def test_of_two_that_write_one_file_at_once_one_wins_whole(tmp_path):
    """Many times, for it is a race: the file is that of one of them, the other is told."""
    from dap3d_core.result import ResultError

    told, texts = [], ["a" * 5000, "b" * 5000]

    def write(target, text, barrier):
        try:
            with whole_file(target) as part:
                part.write_text(text)
                barrier.wait()
        except ResultError as error:
            told.append(str(error))

    for k in range(50):
        target, barrier = tmp_path / f"{k}.nc", threading.Barrier(2)
        together(*(partial(write, target, text, barrier) for text in texts))
        assert target.read_text() in texts
    assert len(told) == 50
    assert all("exists" in words for words in told)
    assert len(list(tmp_path.iterdir())) == 50


@pytest.mark.slow
def test_of_several_that_overwrite_one_file_at_once_none_disturbs_another(tmp_path):
    """With force each of them succeeds, and the file is always that of one of them, whole."""
    target, texts = tmp_path / "run.nc", [letter * 5000 for letter in "abcd"]

    def write(text):
        for _ in range(100):
            with whole_file(target, force=True) as part:
                part.write_text(text)
            assert target.read_text() in texts

    together(*(partial(write, text) for text in texts))
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.slow
def test_a_reader_that_leaves_does_not_spoil_the_run(folder):
    script = f"set -o pipefail; {COMMAND[0]} run fall.toml -o piped.nc --json | true"
    done = subprocess.run(["bash", "-c", script], cwd=folder, env=environment(),
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert dap.open(folder / "piped.nc").status == "done"


# ------------------------------------------------------------------ what other programs do quietly

EXPLODING = """
[bodies.rocket]
mass = 1.0
Jp = [1.0, 1.0, 1.0]
r = [1.0, 0.0, 0.0]

[points.tip]
body = "ground"
sPp = [0.0, 0.0, 0.0]

[forces.repelling]
type = "ptp"
P_i = "rocket.O"
P_j = "tip"
k = -1e8
l0 = 0.0

[simulation]
t_end = 1.0
dt = 0.01
integrator = "{}"
{}
"""


@pytest.mark.parametrize(
    ("integrator", "step"), [("dopri5", ""), ("dop853", "step = 0.005")], ids=["adaptive", "fixed"]
)
def test_an_exploding_run_ends_with_3_and_names_the_first_offender(call, folder, integrator, step):
    """x grows as exp(10^4 t), beyond all numbers at 0.07 s. SciPy's LSODA and Exudyn's explicit
    solvers report success with a NaN state; MuJoCo puts the state back and exits with 0."""
    (folder / "exploding.toml").write_text(EXPLODING.format(integrator, step))
    code, out, err = call("run", "exploding.toml", *QUIET, "--json")
    assert code == 3, err
    found = json.loads(out)
    assert (found["status"], found["exit_code"]) == ("stopped", 3)
    assert "repelling" in found["reason"] or "rocket" in found["reason"], found["reason"]
    result = dap.open(folder / "new.nc")
    assert result.status == "stopped"
    assert all(np.all(np.isfinite(a)) for a in (result.u, result.v_dot, result.work))
    assert result.t[-1] < 0.08


@pytest.mark.parametrize(
    "words",
    [("run", "fall.toml"), ("post", R), ("post", R, "--format", "csv"), ("plot", R, "stone.r.z"),
     ("export", R, "--format", "mat"), ("export", "fall.toml", "--format", "urdf"), ("view", R),
     ("export", "fall.toml", "--format", "fmu"), ("export", "fall.toml", "--format", "c"),
     ("animate", R), (*SWEEP, *VARY, *KEEP), ("report", "fall.toml"),
     ("modes", "fall.toml", "--mode", "1"), ("sensitivities", "fall.toml", *VARY, "stone.r.z")],
    ids=lambda words: "-".join(words[:1]),
)  # fmt: skip
def test_no_output_takes_the_place_of_a_scene(call, folder, words):
    """Not with --force either: a command overwrites files of the kind that it writes."""
    shutil.copy(folder / "fall.toml", folder / "other.toml")
    code, _, err = call(*words, "-o", "other.toml", "--force")
    assert code == 2, err
    assert (folder / "other.toml").read_text() == SCENE
