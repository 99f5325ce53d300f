"""``dap3d new-plugin``: what it writes works, and what it cannot write is refused with a reason."""

import json
import os
import subprocess
import sys
import tomllib
from xml.etree import ElementTree

import pytest
from support.command_line import output_of
from support.internals import hooks
from support.outside import isolated, pip
from support.process import environment

import dap3d_core as dap

#: Kind -> the file that the package brings to try it.
SAMPLES = dict.fromkeys((*hooks.GROUPS, *hooks.EXTENSIONS), "scene.toml") | {
    "importer": "model.type"
}


def new_plugin(folder, *words):
    """Run the command, not in a process of its own, which would take longer; what it says."""
    return output_of("new-plugin", *words, "-o", folder)


@pytest.mark.parametrize("kind", SAMPLES)
def test_the_package_is_complete(kind, tmp_path):
    """An entry point that names a module of this keyword, what tries it, a README, tests."""
    folder = tmp_path / "here"
    words = ("My.own-Type", "--kind", kind, "--author", 'A "B" Ç')
    said = new_plugin(folder, *words)
    files = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}
    module = "dap3d_my_own_type"
    assert files == {"pyproject.toml", "README.md", SAMPLES[kind], f"src/{module}/__init__.py",
                     "tests/test_my_own_type.py", ".github/badge.py",
                     ".github/workflows/tests.yml"}  # fmt: skip
    assert all(name in said for name in files)
    project = tomllib.loads((folder / "pyproject.toml").read_text())
    assert project["project"]["name"] == "dap3d-my-own-type"
    assert project["project"]["authors"] == [{"name": 'A "B" Ç'}]
    assert project["project"]["entry-points"] == {f"dap3d.{kind}s": {"My.own-Type": module}}
    (dependency,) = project["project"]["dependencies"]
    source = folder / "src" / module / "__init__.py"
    if kind in hooks.GROUPS:
        type_info = dap.load_registry().with_file(source).get(kind, "My.own-Type")
        assert bool(type_info.derived) == dependency.startswith("dap3d[derive]>=")
        assert type_info.type.__name__ == "MyOwnType"
        assert "My.own-Type" in (folder / "scene.toml").read_text()
    else:  # of the installed package, below
        assert dependency.startswith("dap3d>=")
        compile(source.read_text(), source, "exec")
    for name in files:
        assert "$" not in (folder / name).read_text(), name


@pytest.mark.slow
def test_the_badge_shows_what_check_plugin_says(tmp_path):
    """Its words and its colour are those of the JSON: right, wrong, and a check that broke off."""
    new_plugin(tmp_path, "mine", "--kind", "force")
    script = tmp_path / ".github" / "badge.py"
    right = output_of("check-plugin", "weight", "fix", "--json")
    wrong = json.loads(right)
    wrong["types"][0]["ok"] = False
    texts = (right, json.dumps(wrong), right[:100])
    shown = ("2 of 2 types right", "1 of 2 types right", "not checked")
    colors = set()
    for text, words in zip(texts, shown, strict=True):
        (tmp_path / "check.json").write_text(text)
        drawn = subprocess.run(
            [sys.executable, script, tmp_path / "check.json"], capture_output=True, text=True
        ).stdout
        picture = ElementTree.fromstring(drawn)
        assert words in [one.text for one in picture.iter() if one.tag.endswith("text")]
        colors |= {one.get("fill") for one in picture.iter() if one.get("x") and one.get("rx")}
    assert len(colors) == 3


@pytest.mark.slow
def test_the_workflow_publishes_the_badge(tmp_path):
    """Its steps leave a branch "badges" with the picture alone, again and again."""
    yaml = pytest.importorskip("yaml")
    folder, origin = tmp_path / "mine", tmp_path / "origin"
    new_plugin(folder, "mine", "--kind", "force")
    steps = yaml.safe_load((folder / ".github/workflows/tests.yml").read_text())
    runs = {s["name"]: s["run"] for s in steps["jobs"]["tests"]["steps"] if "run" in s}
    assert runs["Check the force type"].startswith("dap3d check-plugin mine --json")

    def shell(words, where):
        done = subprocess.run(
            ["bash", "-e", "-c", words], cwd=where, capture_output=True, text=True,
            env=environment(HOME=str(tmp_path), PATH=os.environ["PATH"]),
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    shell("git init --quiet --bare origin", tmp_path)
    first = "git init --quiet && git add . && git -c user.name=a -c user.email=a@b commit -qm one"
    shell(f"{first} && git remote add origin {origin} && git push --quiet origin HEAD:main", folder)
    for n in range(2):
        clone = tmp_path / f"clone{n}"
        shell(f"git clone --quiet --branch main {origin} {clone}", tmp_path)
        (clone / "check-plugin.json").write_text('{"types": [{"ok": true}]}')
        shell(runs["Draw the badge"].replace("python", sys.executable), clone)
        shell(runs["Publish the badge"], clone)
    assert shell("git ls-tree --name-only badges", origin).split() == ["check-plugin.svg"]
    assert shell("git log --format=%s badges", origin).count("\n") == 1


@pytest.mark.slow
def test_the_packages_install_and_their_tests_pass(tmp_path):
    """Those that they bring: formulas by the kit, scenes and files against closed forms."""
    for kind in SAMPLES:
        new_plugin(tmp_path / kind, f"my-{kind}", "--kind", kind)
    site = tmp_path / "site"
    pip("install", "--quiet", "--no-deps", *isolated(), "--target", site,
        *(tmp_path / kind for kind in SAMPLES))  # fmt: skip
    paths = environment(PYTHONPATH=os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")]))
    tests = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *SAMPLES]
    checks = [sys.executable, "-m", "dap3d_core.cli", "check-plugin", "-q"]
    for words in (tests, [*checks, *(f"my-{kind}" for kind in hooks.EXTENSIONS)]):
        done = subprocess.run(words, cwd=tmp_path, env=paths, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("name", "class_name"),
    [("3bar", "Joint3bar"), ("joint", "JointJoint"), ("sphere_2", "Sphere2")],
)
def test_every_keyword_makes_a_class(name, class_name, tmp_path):
    """Also those that start with a digit, or whose class would hide a name."""
    new_plugin(tmp_path / "p", name)
    file = tmp_path / "p" / "src" / f"dap3d_{name}" / "__init__.py"
    assert dap.load_registry().with_file(file).get("joint", name).type.__name__ == class_name


def test_a_keyword_that_is_taken_is_refused_and_may_be_forced(refuse, dap3d):
    said = refuse("new-plugin", "sph")
    for words in ("joint type 'sph'", "distribution dap3d", "--force"):
        assert words in said
    new_plugin(dap3d.folder / "forced", "sph", "--force")
    new_plugin(dap3d.folder / "other", "sph", "--kind", "force")  # scenes tell them apart


def test_a_folder_that_holds_files_is_refused_and_kept(refuse, dap3d):
    folder = dap3d.folder / "dap3d-mine"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    assert "--force" in refuse("new-plugin", "mine")
    assert "-o" in refuse("new-plugin", "mine", "-o", folder / "notes.txt")
    new_plugin(folder, "mine", "--force")
    assert (folder / "notes.txt").read_text() == "mine"
    new_plugin(dap3d.folder / "a" / "b", "mine")


def test_json(tmp_path):
    found = json.loads(new_plugin(tmp_path / "p", "mine", "--kind", "function", "--json"))
    assert found["keyword"] == "mine"
    assert found["kind"] == "function"
    assert found["folder"] == str(tmp_path / "p")
    assert found["module"] == "dap3d_mine"
    assert set(found["files"]) >= {"pyproject.toml", "scene.toml"}
    assert found["next"][2] == "dap3d check-plugin mine"
    found = json.loads(new_plugin(tmp_path / "i", "mine", "--kind", "importer", "--json"))
    assert "model.mine" in found["files"]
    assert found["next"][3] == "dap3d import model.mine"


def test_what_it_says_fits_60_columns(tmp_path, monkeypatch):
    """But for the folder, which has a line of its own."""
    monkeypatch.chdir(tmp_path)
    said = output_of("new-plugin", "mine", columns=60)
    assert max(map(len, said.splitlines())) <= 60
