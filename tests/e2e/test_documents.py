"""What the documents show works as it stands there: every block of code is run."""

import io
import re
import shlex
import subprocess
import sys
import tomllib
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import pytest
from support.pages import follow, steps
from support.process import REPOSITORY, environment

import dap3d_core as dap
from dap3d_core.cli import main

#: Pages with tests of their own, here and in test_import_matlab.py.
ON_THEIR_OWN = ("new-plugin", "check-plugin", "import-matlab")
#: Pages of figures and symbols, without anything to follow.
WITHOUT_STEPS = ("hard-cases", "notation", "peers", "performance", "security")
#: Pages that are followed from the first step to the last, in an empty folder.
FOLLOWED = [
    REPOSITORY / "docs" / "index.md",
    *(
        page
        for folder in ("start", "tutorials", "how-to", "concepts", "reference")
        for page in sorted((REPOSITORY / "docs" / folder).glob("*.md"))
        if page.stem not in (*ON_THEIR_OWN, *WITHOUT_STEPS)
        and page.name != "your-own-joint.md"  # it installs a package: test_from_outside.py
        and page.name != "look-at-sweeps.md"  # its pictures are compared: test_look_at_sweeps.py
    ),
]
#: Of what pages do many times less: poses, speeds, frames. Speeds enclose what is asserted.
SHORTER = {
    "how-to/what-a-type-can-say.md": [("examine(type_))\n", "examine(type_), poses=1)\n")],
    "how-to/equilibrium-paths.md": [
        ("f.z=60:-60:13", "f.z=60:30:2"),
        ("60:-60:13", "60:-60:4"),
        ('0:120:13")\nassert np', '0:120:3")\nassert np'),
    ],
    "how-to/plots-and-animations.md": [("--speed 0.2", "--speed 2")],
    "how-to/report.md": [("report fourbar3 --quick", "report fourbar3 --quick --t-end 0.5")],
    "tutorials/modes-and-stability.md": [
        ("np.linspace(0.05, 10.0, 200)", "np.array([0.05, 4.28, 4.3, 5.0, 6.02, 6.03, 10.0])"),
        ("2.0 * critical, 80)", "2.0 * critical, 6)"),
        ("-4:120:63", "-4:120:5"),
    ],
    "tutorials/inverse-dynamics.md": [("0.0, 2.0, 401)", "0.0, 2.0, 121)")],
}


def blocks(text, language):
    """Fenced blocks of code in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def commands(text, program):
    """Indented lines of a document that call a program, as the words behind it."""
    lines = re.findall(rf"^    {re.escape(program)} (.*)$", text, flags=re.MULTILINE)
    return [shlex.split(line, comments=True) for line in lines]


class Done(NamedTuple):
    """How a command ended."""

    returncode: int
    stdout: str
    stderr: str


def dap3d(words, folder):
    """Run a command, here: a process for each would take most of its time to begin."""
    out, err = io.StringIO(), io.StringIO()
    with chdir(folder), redirect_stdout(out), redirect_stderr(err):
        code = main(words)
    return Done(code, out.getvalue(), err.getvalue())


def process(words, folder):
    """Run a command as a user does."""
    program = [sys.executable, "-m", "dap3d_core.cli", *words]
    return subprocess.run(
        program, cwd=folder, env=environment(), capture_output=True, text=True, timeout=300
    )


def readme_steps(text):
    """The blocks of the README in their order: scene, commands, scripts, as (kind, content)."""
    pattern = r"^```(toml|python)\n(.*?)^```|^    (?:\.venv/bin/)?dap3d ([^\n]*)$"
    for found in re.finditer(pattern, text, flags=re.MULTILINE | re.DOTALL):
        language, block, line = found.groups()
        yield (language, block) if language else ("dap3d", shlex.split(line, comments=True))


@pytest.mark.slow
def test_the_readme_runs_in_sequence_and_once_more(tmp_path):
    """Each block of the README as printed, one after another, in one folder that begins empty.
    Those that write files do so once more."""
    sequence = list(readme_steps((REPOSITORY / "README.md").read_text()))
    words = ["check", "run", "view", "plot", "sweep", "plot", "equilibrium", "modes"]
    words += ["check-plugin"]
    assert [content[0] for kind, content in sequence if kind == "dap3d"] == words
    assert [kind for kind, _ in sequence if kind != "dap3d"] == ["toml", "python", "python"]
    for kind, content in [*sequence, *(step for step in sequence if "--force" in step[1])]:
        if kind == "toml":
            (tmp_path / "cone.toml").write_text(content)
        elif kind == "dap3d":
            done = dap3d(content, tmp_path)
            assert done.returncode == 0, (content, done.stderr)
        elif "interface_version" in content:
            (tmp_path / "plugin.py").write_text(content)
        else:
            done = subprocess.run(
                [sys.executable, "-c", content], cwd=tmp_path, capture_output=True, text=True
            )
            assert done.returncode == 0, done.stderr
    assert (tmp_path / "cone.png").stat().st_size > 1000
    assert (tmp_path / "sweep.png").stat().st_size > 1000
    assert (tmp_path / "cone.nc").exists()


@pytest.mark.slow
def test_the_page_on_new_plugins(tmp_path):
    """Its commands, in an empty folder; what the command says comes next is what the page says."""
    text = (REPOSITORY / "docs" / "how-to" / "new-plugin.md").read_text()
    first, *others = commands(text, "dap3d")
    done = dap3d(first, tmp_path)
    assert done.returncode == 0, done.stderr
    (next_steps,) = blocks(text, "sh")
    assert [line for line in next_steps.splitlines() if line not in done.stdout] == []
    folder = tmp_path / "dap3d-on-cylinder"
    for file in re.findall(r"^\| `([^`(]+\.[^`(]+)` \|", text, flags=re.MULTILINE):
        assert (folder / file).is_file(), file
    readme = (folder / "README.md").read_text()
    assert all(line in readme for line in next_steps.splitlines())
    for words in others:
        assert dap3d(words, tmp_path).returncode == 0


def test_the_pages_of_the_example_package():
    """Each type has its page, its scene and a line in the README; their commands name the scene."""
    package = REPOSITORY / "plugins" / "dap3d-example"
    groups = tomllib.loads((package / "pyproject.toml").read_text())["project"]["entry-points"]
    kinds = ("joints", "forces", "functions")
    for keyword in (k for kind in kinds for k in groups[f"dap3d.{kind}"]):
        page = (package / "docs" / f"{keyword}.md").read_text()
        assert page.startswith(f"# {keyword}\n")
        assert f"(docs/{keyword}.md)" in (package / "README.md").read_text()
        run, plot, *_ = commands(page, "dap3d")
        assert run == ["run", f"scenes/{keyword}.toml"]
        assert plot[:2] == ["plot", f"{keyword}.nc"]
        assert (package / "scenes" / f"{keyword}.toml").is_file()


@pytest.mark.slow
def test_the_page_on_checking_types(tmp_path):
    """Its joint passes, as a file and by its test; with the error it speaks of, it says just that.
    The test runs without compiling, which is the command's part."""
    text = (REPOSITORY / "docs" / "how-to" / "check-plugin.md").read_text()
    joint, test = blocks(text, "python")
    (tmp_path / "plane.py").write_text(joint)
    (tmp_path / "test_plane.py").write_text(test)
    ((command, *words),) = commands(text, "dap3d")
    done = dap3d([command, *words], tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_plane.py"],
        cwd=tmp_path, env=environment(DAP3D_PLAIN=1), capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    (tmp_path / "plane.py").write_text(joint.replace("2.0 * dot(a_j_dot", "dot(a_j_dot"))
    done = dap3d([command, *words, "--quiet"], tmp_path)
    assert done.returncode == 1
    said = re.search(r"row 1 of gamma is wrong.*?\(seed 1, pose 3", text, re.DOTALL).group()
    assert " ".join(said.split()) in " ".join(done.stdout.split())


def takes_long(page):
    """Commands compile, simulate and draw; clusters are processes; tutorials run many scenes."""
    text = page.read_text()
    found = list(steps(text))
    commands = any(step.kind == "command" for step in found)
    return commands or "LocalCluster(" in text or len(found) > 3


@pytest.mark.every(4)
@pytest.mark.parametrize(
    "page",
    [
        pytest.param(
            page,
            marks=[pytest.mark.slow] if takes_long(page) else [],
            id=page.relative_to(REPOSITORY / "docs").as_posix(),
        )
        for page in FOLLOWED
    ],
)
def test_the_steps_of_a_page(page, tmp_path, monkeypatch, quick_libraries):
    """Files, scripts and commands of a page, in their order; scripts hold assertions."""
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setattr(sys, "path", [*sys.path])
    name = page.relative_to(REPOSITORY / "docs").as_posix()
    assert follow(page, tmp_path, SHORTER.get(name, ()))


def test_the_first_commands_of_the_readme_are_targets():
    """The two commands at the top exist in the Makefile."""
    text = (REPOSITORY / "README.md").read_text()
    targets = [words[0] for words in commands(text, "make")]
    assert targets[:2] == ["run", "test"]
    makefile = (REPOSITORY / "Makefile").read_text()
    for target in targets:
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), target


def test_every_decision_and_document_that_is_named_exists():
    """Relative links and paths of documents lead somewhere."""
    for document in [
        REPOSITORY / "README.md",
        REPOSITORY / "CONTRIBUTING.md",
        *(REPOSITORY / "docs").rglob("*.md"),
    ]:
        text = re.sub(r"`[^`\n]+`", "", document.read_text())
        for link in re.findall(r"\]\((?!https?:|#)([^)#]+)", text):
            assert (document.parent / link).exists() or Path(link).is_absolute(), (
                f"{document.name}: {link}"
            )


@pytest.mark.slow
def test_the_commands_on_the_pages_of_the_models_are_there():
    """Every ``dap3d`` command that a model's page shows exists and takes the options shown."""
    for page in (scene.with_name("README.md") for scene in REPOSITORY.glob("models/**/scene.toml")):
        found = commands(page.read_text(), "dap3d")
        assert found, page
        for words in found:
            done = dap3d([words[0], "--help"], REPOSITORY)
            assert done.returncode == 0, f"{page}: {words}"
            for option in (w for w in words if w.startswith("--")):
                assert option in done.stdout, f"{page}: {words}"


@pytest.mark.slow
def test_what_the_pages_of_the_models_plot_is_there():
    """The quantities of each ``dap3d plot``, in a result of the model."""
    for scene in REPOSITORY.glob("models/**/scene.toml"):
        page = scene.with_name("README.md").read_text()
        asked = [words for words in commands(page, "dap3d") if words[0] == "plot"]
        plotted = {q for _, file, *words in asked if "-sweep" not in file for q in words}
        result = dap.simulate(scene.parent, t_end=1e-3, dt=1e-3, allow_code=True)
        for quantity in plotted - {"--x"}:
            result.quantity(quantity)
