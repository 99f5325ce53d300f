"""MATLAB folders that somebody made to run, to take time, or to be given other files."""

import json
import os

import pytest
from support.matlab import SMALL, write

import dap3d_core as dap
from dap3d_core.cli import main

pytest.importorskip("tree_sitter_matlab")

#: What acts, as a statement of MATLAB.
ACTS = [
    "system('touch pwned');", "eval('system(''touch pwned'')');", "!touch pwned", "addpath /tmp",
    "feval('system', 'x');", "x = fopen('/etc/passwd');", "load('/etc/passwd')", "cd /",
    "java.lang.Runtime.getRuntime();", "import java.io.*", "f = @system;", "x = zeros(1e9);",
    "while true, x = 1; end", "for k = 1:1e12, x = k; end", "x = 1:1e12;",
    "function f(), f(); end", "x = inBodies;", "x = 1e400;", "x(1e12) = 1;", "Bodies(1e12) = B1;",
]  # fmt: skip


@pytest.mark.parametrize("line", ACTS)
def test_what_acts_is_reported_and_not_done(tmp_path, monkeypatch, line):
    """With file and line; the rest of the folder is read."""
    monkeypatch.chdir(tmp_path)
    folder = write(tmp_path / "model", inBodies=f"{SMALL['inBodies.m']}{line}\n")
    with pytest.raises(dap.SceneError) as caught:
        dap.import_matlab(folder)
    assert any("inBodies.m:4" in str(m) for m in caught.value.mistakes), str(caught.value)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["model"]


#: What an honest reader would be busy with for minutes or hours.
LONG = {
    "products": "x = zeros(100);\n" + "x = x*x;\n" * 60_000,
    "comments": "%{\n" * 100_000,
    "brackets": "x = " + "(" * 20_000 + "1" + ")" * 20_000 + ";\n",
    "nested": "x = [" * 100_000 + "]" * 100_000 + ";\n",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["brackets", "nested"])
def test_a_file_that_takes_for_ever(tmp_path, name):
    with pytest.raises(dap.SceneError):
        dap.import_matlab(write(tmp_path / "model", inBodies=LONG[name]))


@pytest.mark.parametrize(("name", "said"), [("products", "1000000"), ("comments", "comments of")])
def test_a_file_that_takes_for_ever_is_refused_at_once(tmp_path, name, said):
    folder = write(tmp_path / "model", inBodies=LONG[name][: 4 * 1024].rpartition("\n")[0])
    with pytest.raises(dap.SceneError, match=said):
        dap.import_matlab(folder)


@pytest.mark.skipif(os.name != "posix", reason="no links")
@pytest.mark.parametrize("name", ["inBodies.m", "inForces.m", "user_force.m"])
def test_a_link_out_of_the_folder_is_not_followed(tmp_path, capfd, monkeypatch, name):
    """Above all user_force.m, whose text would stand in a plugin.py."""
    secret = tmp_path / "secret"
    secret.write_text("TOPSECRET = 1;\n")
    user = SMALL["inForces.m"].replace("Forces =", "F = Force_struct; F.type = 'user';\nForces =")
    folder = write(tmp_path / "model", inForces=user.replace("[S1]", "[S1; F]"))
    (folder / name).unlink(missing_ok=True)
    (folder / name).symlink_to(secret)
    monkeypatch.chdir(tmp_path)
    assert main(["import-matlab", "model", "--stub"]) == 2
    out, err = capfd.readouterr()
    assert "is a link out of the folder" in err
    assert "TOPSECRET" not in out + err
    assert not (tmp_path / "plugin.py").exists()


def test_very_many_files(tmp_path, capfd, monkeypatch):
    folder = write(tmp_path / "model")
    for k in range(300):
        (folder / f"x{k}.m").write_text("system('x')")
    monkeypatch.chdir(tmp_path)
    assert main(["import-matlab", "model", "--json"]) == 0
    assert len(json.loads(capfd.readouterr().out)["files"]) < 100


HIDDEN = "'''\n\"\"\"\n\rimport os; os.system('touch pwned')\x0b\x0c\u2028\u2029\x85import os\\\n"


def test_the_force_of_the_user_stays_a_comment(tmp_path, monkeypatch):
    """Whatever user_force.m holds, the stub is a module that does nothing but define a type."""
    import ast

    user = SMALL["inForces.m"].replace("Forces =", "F = Force_struct; F.type = 'user';\nForces =")
    folder = write(tmp_path / "model", inForces=user.replace("[S1]", "[S1; F]"))
    text = HIDDEN + "% {text} {0} %s\n# -*- coding: rot13 -*-\nBodies(1)\n"
    (folder / "user_force.m").write_text(text, encoding="utf-8")
    _, report = dap.import_matlab(folder)
    tree = ast.parse(report.stub)
    kinds = {type(node) for node in tree.body}
    assert kinds == {ast.Expr, ast.ImportFrom, ast.Assign, ast.ClassDef, ast.FunctionDef}
    modules = {n.module for n in tree.body if isinstance(n, ast.ImportFrom)}
    assert modules == {"dap3d_core.interface", "dap3d_core.kernels"}
    assert not [n for n in ast.walk(tree) if isinstance(n, ast.Import)]
