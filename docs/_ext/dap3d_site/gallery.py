"""The gallery: for each shipped model a script that sphinx-gallery runs, from the model's folder.

The script's text is the model's own page; what it simulates and draws are the commands that the
page shows. ``VIEWS`` lists the ways in which a model is shown.
"""

import os
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import click

from dap3d_core.cli.app import dap3d
from dap3d_core.cli.commands.plot import ENERGIES
from dap3d_core.scene import load
from dap3d_core.scene.tables import PLUGIN_FILE
from dap3d_site.markdown import doc_of

#: Folders of the source folder of Sphinx: scripts and what they include; pages made from them.
SCRIPTS, INCLUDED, GALLERY = "_scripts", "_models", "models"
#: Pictures a second of the films; a build that only checks the pages draws fewer.
FILM_FPS = float(os.environ.get("DAP3D_SITE_FPS", "12.5"))
#: Scenes longer than this are not shown; they were written by a script.
LONGEST = 400

HEADERS = {
    "": ("Models", "The models that come with dap3d, run and drawn when these pages were made. "
         "``dap3d run NAME`` runs one, ``dap3d models`` lists them; what they must give is told "
         "in :doc:`/reference/shipped-models`."),
    "benchmarks": ("Reference problems", "Problems known from the literature on multibody "
                   "programs; :doc:`/reference/reference-problems` says what each is hard for."),
    "contact": ("Contact", "Bodies that touch; :doc:`/how-to/contact-gallery` says what each "
                "shows."),
    "engineering": ("Engineering", "Mechanisms that engineers know; "
                    ":doc:`/how-to/engineering-gallery` says what each shows."),
}  # fmt: skip


class Model(NamedTuple):
    """A shipped model: its folder, its group ("" or a folder of models/), its page."""

    folder: Path
    group: str
    page: str

    @property
    def name(self) -> str:
        """The name that ``dap3d run`` takes."""
        return self.folder.name

    @property
    def document(self) -> str:
        """The document of the site that shows it."""
        return "/".join(part for part in (GALLERY, self.group, self.name) if part)


def models(repository: Path) -> list[Model]:
    """The shipped models, by group and name."""
    root = repository / "models"
    folders = sorted(scene.parent for scene in root.rglob("scene.toml"))
    found = [Model(f, f.parent.relative_to(root).as_posix().strip("."),
                   (f / "README.md").read_text(encoding="utf-8")) for f in folders]  # fmt: skip
    return sorted(found, key=lambda model: (model.group, model.name.lower()))


def pages(repository: Path) -> Iterator[tuple[str, str]]:
    """Everything the gallery is made from: (path, text)."""
    for group, (title, words) in HEADERS.items():
        path = "/".join(part for part in (SCRIPTS, group, "GALLERY_HEADER.rst") if part)
        yield path, f"{_heading(title, '=')}\n{words}\n"
    for model in models(repository):
        yield f"{model.document.replace(GALLERY, SCRIPTS, 1)}.py", script(model)
        for file in _files(model.folder):
            yield f"{INCLUDED}/{model.name}-{file.name}", file.read_text(encoding="utf-8")


def script(model: Model) -> str:
    """The script of a model: its page as text, then its views, then its files."""
    title = model.page.partition("\n")[0].removeprefix("# ")
    words = load(model.folder).description
    include = f".. include:: /{INCLUDED}/{model.name}-page.md\n   :parser: myst_parser.sphinx_\n"
    docstring = f'"""\n{_heading(title, "=")}\n{words}\n\n{include}"""\n'
    views = [f"{_text(doc_of(view))}\n{view(model)}" for view in VIEWS]
    files = [_shown(model, file) for file in _files(model.folder)]
    return "\n\n".join([docstring, *views, *files]) + "\n"


def curves(model: Model) -> str:
    """Run and drawn in Python."""
    arguments = _asked(_command(model, "run"))
    asked = _asked(_command(model, "plot") or ["plot", "result", *ENERGIES])
    quantities = ", ".join(repr(name) for name in asked.pop("quantities"))
    return (
        "import dap3d_core as dap\n\n"
        f"result = dap.simulate({_call(repr(model.name), arguments, drop=('model', 'output'))})\n"
        f"dap.plot({_call(f'result, {quantities}', asked, drop=('result', 'output'))})"
    )


def motion(model: Model) -> str:
    """The motion as a stick figure, as `dap3d animate` draws it."""
    return f'dap.animate(result, "{model.name}.gif", fps={FILM_FPS}, size=(480, 0), force=True)'


def scene(model: Model) -> str:
    """The moving scene, to be turned and stepped through, as `dap3d view` shows it."""
    return "dap.view(result, fps=25)"


#: How a model is shown: functions that return the code of a cell; their docstring stands above it.
#: Below it stand the figures that it drew and, where its last line has one, that value's HTML.
VIEWS: tuple[Callable[[Model], str], ...] = (curves, motion, scene)


def _command(model: Model, name: str) -> list[str]:
    """The words of the first command of this name on a model's page."""
    lines = (line.split(maxsplit=1)[1] for line in model.page.splitlines()
             if line.startswith(f"    dap3d {name} "))  # fmt: skip
    return shlex.split(next(lines, ""), comments=True)


def _asked(words: list[str]) -> dict[str, Any]:
    """What a command was given beyond its defaults, as the command line itself reads it."""
    context = dap3d.commands[words[0]].make_context(words[0], words[1:])
    source = click.core.ParameterSource.COMMANDLINE
    return {n: v for n, v in context.params.items() if context.get_parameter_source(n) == source}


def _call(first: str, arguments: dict[str, Any], drop: tuple[str, ...]) -> str:
    given = [f"{name}={value!r}" for name, value in arguments.items() if name not in drop]
    return ", ".join([first, *given])


def _files(folder: Path) -> list[Path]:
    files = [folder / "scene.toml", folder / PLUGIN_FILE]
    return [f for f in files if f.exists() and len(f.read_text().splitlines()) <= LONGEST]


def _shown(model: Model, file: Path) -> str:
    language = {".toml": "toml", ".py": "python"}[file.suffix]
    shown = f".. literalinclude:: /{INCLUDED}/{model.name}-{file.name}\n   :language: {language}"
    return _text(f"{_heading(file.name, '-')}\n{shown}")


def _text(words: str) -> str:
    """A block of text of a script of sphinx-gallery."""
    return "\n".join(["# %%", *(f"# {line}".rstrip() for line in words.splitlines())])


def _heading(title: str, line: str) -> str:
    return f"{title}\n{line * len(title)}\n"
