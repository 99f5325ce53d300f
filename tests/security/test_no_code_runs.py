"""What a process does while it loads, checks, describes, imports and shows what is not trusted.
The interpreter tells an audit hook of all that is opened, imported, compiled and run."""

import ast
import json
import re
import sys
from pathlib import Path

import pytest
from support import hostile, matlab
from support.process import REPOSITORY, environment, run

import dap3d_core as dap
from dap3d_core.interface import PluginError
from dap3d_core.scene import check

#: Runs a job under an audit hook and prints the events.
WATCHED = """
import json, os, sys
events = []
WATCH = ("open", "import", "exec", "compile", "subprocess.Popen", "os.system", "os.exec",
         "os.posix_spawn", "os.fork", "ctypes.dlopen", "webbrowser.open", "pickle.find_class")
def hook(event, args):
    if event.startswith(("socket.", "urllib.", "http.", "ftplib.", "smtplib.")):
        events.append([event, repr(args)])
    elif event == "open":
        mode = args[1] if isinstance(args[1], str) else ("w" if (args[2] or 0) & 3 else "r")
        events.append([event, os.fsdecode(args[0]) if isinstance(args[0], (str, bytes)) else "",
                       mode])
    elif event == "exec":
        code = args[0]
        events.append([event, code.co_filename, repr(code.co_names) + repr(code.co_consts)])
    elif event == "compile":
        text = args[0]
        text = text.decode("utf-8", "replace") if isinstance(text, bytes) else text
        events.append([event, str(args[1]), text if isinstance(text, str) else ""])
    elif event in WATCH:
        events.append([event, str(args[0])])
import dap3d_core as dap
sys.addaudithook(hook)
from dap3d_core.cli import main
for words in json.loads(sys.argv[1] if len(sys.argv) > 1 else os.environ["JOBS"]):
    sys.stdout, kept = open(os.devnull, "w"), sys.stdout
    code = main(words)
    sys.stdout = kept
    events.append(["job", words[0], code])
told = list(events)
print(json.dumps(told))
"""
#: A Python file that shows that it was run.
TRAP = "with open({!r}, 'w') as f:\n    f.write('run')\nraise SystemExit('trap')\n"


@pytest.fixture
def folder(tmp_path):
    """A hostile scene, with files around it that must not be run, or even be opened."""
    mesh = '[shapes.part]\ntype = "mesh"\nbody = "ground"\nfile = "part.obj"\n'
    model = hostile.write(tmp_path / "model", hostile.text_of_scene() + mesh)
    faces = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n"
    (model / "part.obj").write_text("mtllib part.mtl\nmtllib /etc/passwd\n" + faces)
    (model / "part.mtl").write_text("newmtl a\nmap_Kd /etc/passwd\n")
    trap = TRAP.format(str(tmp_path / "trapped"))
    names = ("plugin", "numpy", "attr", "trimesh", "sitecustomize", "scene", "conftest", "rich")
    for name in names:
        (model / f"{name}.py").write_text(trap)
    old = matlab.write(tmp_path / "matlab")
    (old / "user_force.m").write_text("system('touch trapped'); !touch trapped\n")
    (old / "startup.m").write_text("system('touch trapped')\n")
    return tmp_path


def watched(folder, jobs):
    """The events of jobs of the command line, run in the folder of the scene."""
    told = run(
        WATCHED,
        folder / "cache",
        cwd=folder / "model",
        JOBS=json.dumps(jobs),
        DAP3D_PLAIN=1,
        MPLBACKEND="Agg",
        PYTHONDONTWRITEBYTECODE=1,
        PYTHONSAFEPATH=1,  # as for the installed program: no modules from the present folder
    )
    return json.loads(told.splitlines()[-1])


@pytest.mark.slow
def test_nothing_of_a_scene_a_result_or_a_matlab_folder_is_run(folder):
    jobs = [
        ["check", "."],
        ["run", ".", "-o", "../run.nc"],
        ["info", "../run.nc"],
        ["plot", "../run.nc", "energy.kinetic", "-o", "../run.png"],
        ["view", "../run.nc", "-o", "../run.html", "--model", "."],
        ["post", "../run.nc", "-o", "../run.csv"],
        ["describe", "sph"],
        ["import-matlab", "../matlab", "-o", "../imported.toml"],
    ]
    events = watched(folder, jobs)
    assert [(e[1], e[2]) for e in events if e[0] == "job"] == [(words[0], 0) for words in jobs]
    assert not (folder / "trapped").exists()
    kinds = {e[0] for e in events}
    assert {"open", "import", "exec"} <= kinds  # the hook sees
    quiet = {"open", "import", "exec", "compile", "job", "ctypes.dlopen", "pickle.find_class"}
    assert kinds <= quiet, kinds - quiet

    model = (folder / "model").resolve()
    opened = {Path(e[1]) if Path(e[1]).is_absolute() else model / e[1]
              for e in events if e[0] == "open" and e[1]}  # fmt: skip
    inside = {path.resolve().relative_to(model).as_posix() for path in opened
              if path.resolve().is_relative_to(model)}  # fmt: skip
    assert inside == {"scene.toml", "part.obj"}
    assert not {Path("/etc/passwd"), folder / "matlab" / "startup.m"} & opened
    ran = [e for e in events if e[0] in ("exec", "compile")]
    assert not [e[1] for e in ran if Path(e[1]).is_relative_to(folder)]
    assert not [e[:2] for e in ran if hostile.MARK in e[2]]


def test_a_models_own_file_is_named_and_not_run(folder):
    text = hostile.text_of_scene() + '[forces.own]\ntype = "trap"\n'
    scene = dap.load(hostile.write(folder / "model", text))
    with pytest.raises(dap.SceneError, match=r"plugin\.py.*not run unless it is allowed") as caught:
        check(scene, dap.load_registry())
    assert "--allow-code" in str(caught.value)
    assert not (folder / "trapped").exists()
    with pytest.raises((dap.SceneError, PluginError), match="trap"):
        check(scene, dap.load_registry(), allow_code=True)
    assert (folder / "trapped").exists()  # the trap works


def test_no_text_of_a_scene_is_in_code_that_is_written(tmp_path):
    """Two scenes that differ in all their texts are run by the very same modules."""
    from dap3d_core.kernels.runtime import loop_modules

    plain = [f"b{k}" for k in range(len(hostile.NAMES))]
    dap.compile(dap.load(hostile.write(tmp_path / "a", hostile.text_of_scene(plain, "plain"))))
    before = set(loop_modules._built)
    dap.compile(dap.load(hostile.write(tmp_path / "b")))
    assert before
    assert set(loop_modules._built) == before


def test_what_derives_formulas_has_no_functions_of_python():
    """What is evaluated over symbols is text of the program, without Python's own functions."""
    pytest.importorskip("sympy")
    from dap3d_core.interface.derive import symbolic

    symbols = symbolic.Symbols({}, ())
    assert symbols._evaluated("dot((1, 2, 3), (1, 2, 3))") == [14]
    for text in ("__import__('os')", "open('x')", hostile.NAMES[-1]):
        with pytest.raises((NameError, SyntaxError)):
            symbols._evaluated(text)


#: The one place of each, and why it is right.
ALLOWED = {
    ("interface/codegen/specialise.py", "exec"): "calls of kernels, made of names of arguments",
    ("interface/derive/symbolic.py", "eval"): "expressions of namespace.py",
    ("kernels/runtime/generated_modules.py", "exec"): "loop modules",
    ("registry/loading.py", "exec"): "plugin.py, once it is allowed",
    ("testing/samples/random_element.py", "exec"): "loop modules",
    ("kernels/compiler/units.py", "eval"): "calls of compiled functions, by their types",
    ("kernels/compiler/background.py", "subprocess"): "Python itself, to compile beside",
    ("kernels/compiler/objects.py", "subprocess"): "Python itself, to try a named processor",
    ("model/groups.py", "eval"): "places of numbers in the loops of functions",
    ("registry/arguments.py", "eval"): "annotations of public functions",
    ("testing/packages.py", "subprocess"): "pytest, on the tests of packages, when it is asked for",
    ("plot/film/animation.py", "subprocess"): "ffmpeg, without a shell",
    ("native/build.py", "subprocess"): "a C compiler, on C that is written here, without a shell",
    ("native/beside.py", "subprocess"): "Python itself, to compile half of an export",
    ("simulation/checkpoint/save.py", "allow_pickle"): "switched off",
    (
        "study/workers/dask_cluster.py",
        "cloudpickle",
    ): "a study, by its user, to the workers that he names",
}
DANGEROUS = {"cloudpickle", "pickle", "marshal", "shelve", "dill", "subprocess", "socket",
             "urllib", "http", "ftplib", "xmlrpc", "runpy", "code", "codeop", "pty"}  # fmt: skip


def test_dangerous_words_of_python_stand_in_known_places_alone():
    """No pickle but to a cluster, no network, no shell; eval and exec where they are listed."""
    root = REPOSITORY / "src" / "dap3d_core"
    imports = rf"^\s*(?:import|from)\b.*\b(?:{'|'.join(DANGEROUS)})\b"
    calls = r"\b(?:eval|exec|system|popen)\(|\b(?:allow_pickle|shell)="
    words = re.compile(f"{calls}|{imports}", re.M)
    found = set()
    for file in [*root.rglob("*.py"), *(REPOSITORY / "plugins").rglob("dap3d_*/*.py")]:
        name = file.relative_to(root if file.is_relative_to(root) else REPOSITORY).as_posix()
        text = file.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)) if words.search(text) else ():
            if isinstance(node, ast.Import | ast.ImportFrom):
                modules = [a.name for a in node.names]
                modules = modules if isinstance(node, ast.Import) else [node.module or ""]
                modules = [m for m in modules if m != "urllib.parse"]  # texts alone, no network
                found |= {(name, m) for m in modules if m.split(".")[0] in DANGEROUS}
            elif isinstance(node, ast.Call):
                if isinstance(node.func, ast.Name) and node.func.id in ("eval", "exec"):
                    found.add((name, node.func.id))
                elif isinstance(node.func, ast.Attribute) and node.func.attr in ("system", "popen"):
                    found.add((name, node.func.attr))
                for keyword in node.keywords:
                    if keyword.arg in ("allow_pickle", "shell"):
                        found.add((name, keyword.arg))
    assert found == set(ALLOWED)


@pytest.mark.slow
def test_a_folder_of_ours_is_never_searched_for_modules(folder):
    """``dap3d`` in a folder with a numpy.py takes the installed one."""
    command = str(Path(sys.executable).with_name("dap3d"))
    import subprocess

    done = subprocess.run([command, "check", "."], cwd=folder / "model", capture_output=True,
                          text=True, env=environment(DAP3D_PLAIN=1), timeout=120)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert not (folder / "trapped").exists()
