"""``dap3d new-plugin``: a package with a type of its own, ready to be installed and changed."""

import importlib.util
import json
import keyword as python
import re
import shlex
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.process.exit_codes import DONE, Refused

#: What a keyword may be, so that a distribution and a module can be named after it.
KEYWORD = re.compile(r"[A-Za-z0-9]([A-Za-z0-9._-]*[A-Za-z0-9])?", re.ASCII)
LONGEST = 60
#: Names that the modules import: a class of such a name gets that of its kind behind it.
IMPORTED = ("Force", "Function", "Joint", "Point", "Vector")
#: Modules of dap3d itself.
OWN = "dap3d_core"


@click.command(
    "new-plugin", cls=Command, saves=True, short_help="Write a package with a type of its own."
)
@click.argument("name")
@click.option("--kind", type=click.Choice(("joint", "force", "function")), default="joint",
              show_default=True, help="What the type is.")  # fmt: skip
@click.option("-o", "--output", metavar="FOLDER", help="Where to write; by default dap3d-NAME.")
@click.option("--author", metavar="WORDS", help="Who wrote it, for pyproject.toml.")
@click.option("--force", is_flag=True,
              help="Write among what a folder holds; take a keyword that is taken.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
def new_plugin(
    name: str, *, kind: str, output: str | None, author: str | None, force: bool, as_json: bool
) -> int:
    """Write a package that brings a type of a joint, a force or a function.

    NAME is the keyword that scenes will have for the type: letters, digits, and - _ . between them.

    The package is complete: a type that works, its tests, a scene that runs, a README. Make the
    type your own, and let dap3d check-plugin say whether its formulas are right.
    """
    from dap3d_core.cli.console.console import output as console
    from dap3d_core.cli.console.console import print_json, say

    names = _names(name, kind, author)
    _check_free(names, force=force)
    folder = _folder(output or names["distribution"], force=force)
    texts = _texts(names)
    _write(folder, texts)
    then = [f"cd {shlex.quote(str(folder))}", 'pip install -e ".[test]"',
            f"dap3d check-plugin {name}", "dap3d run scene.toml", "pytest"]  # fmt: skip
    if as_json:
        print_json({"keyword": name, "kind": kind, "folder": folder, "files": list(texts),
                    "module": names["module"], "next": then})  # fmt: skip
        return DONE
    out = console()
    say(out, f"{folder} holds a package with the {kind} type {name}:")
    for file in texts:
        say(out, file, indent=4, whole=True)
    say(out, "What comes next:")
    for command in then:
        say(out, command, indent=4, whole=True)
    return DONE


def _names(name: str, kind: str, author: str | None) -> dict[str, str]:
    """What the package, its module and its class are called."""
    if not KEYWORD.fullmatch(name) or len(name) > LONGEST:
        raise Refused(
            f"{name!r} is no keyword for a type; take letters, digits, and - _ . between them, "
            f"{LONGEST} at most"
        )
    if author and not author.isprintable():
        raise Refused(f"{author!r} is no name of an author; take one line of text")
    words = re.split(r"[-_.]+", name)
    class_name = "".join(w[0].upper() + w[1:] for w in words)
    if class_name in IMPORTED or python.iskeyword(class_name):
        class_name += kind.capitalize()
    if class_name[0].isdigit():
        class_name = kind.capitalize() + class_name
    return {
        "keyword": name,
        "kind": kind,
        "distribution": "dap3d-" + "-".join(words).lower(),
        "module": "dap3d_" + "_".join(words).lower(),
        "class_name": class_name,
        # a string of JSON is one of TOML
        "authors": f"authors = [{{ name = {json.dumps(author, ensure_ascii=False)} }}]\n"
        if author
        else "",
    }


def _check_free(names: dict[str, str], *, force: bool) -> None:
    """Refuse a keyword that a scene could not tell from another type's, or a module that is there.

    The same keyword for another kind is allowed: scenes have them in different tables. The modules
    of dap3d itself are never replaced.
    """
    import dap3d_core as dap

    sources, module = dap.load_registry().sources, names["module"]
    everywhere = [s for found in sources.values() for s in found]
    own = {OWN} | {s.module.partition(".")[0] for s in everywhere if s.distribution == "dap3d"}
    if module in own:
        raise Refused(f"the module {module} would stand in the way of dap3d's own; take another "
                      "name")  # fmt: skip
    if force:
        return
    key = (names["kind"], names["keyword"])
    if rivals := sources.get(key):
        raise Refused(
            f"there is a {key[0]} type {key[1]!r} already, from {rivals[0]}: with both installed "
            "no scene could use either. Take another name, or --force if one of them is to go"
        )
    if importlib.util.find_spec(module) is not None:
        raise Refused(
            f"there is a module {module} already, which is installed; take another name, or "
            "--force if it is to go"
        )


def _folder(output: str, *, force: bool) -> Path:
    """The folder to write into; refused where it holds something already."""
    folder = Path(output)
    try:
        if folder.exists() and not folder.is_dir():
            raise Refused(f"{folder} is a file; name a folder with -o")
        if folder.is_dir() and any(folder.iterdir()) and not force:
            raise Refused(
                f"{folder} holds files; --force writes among them, -o names another folder"
            )
    except OSError as error:
        raise Refused(f"cannot read {folder}: {error.strerror or error}") from error
    return folder


def _texts(names: dict[str, str]) -> dict[str, str]:
    """The files of the package, by their paths in it."""
    kind, module = names["kind"], names["module"]
    bound = ".".join(version("dap3d").split(".")[:2])
    about = dict(line.split(" = ", 1) for line in _template(kind, "about").splitlines())
    values: dict[str, Any] = names | about
    values["dependency"] = Template(about["dependency"]).substitute(bound=bound)
    derives = "derive" in values["dependency"]
    values["about_dependencies"] = (
        '# What the type leaves out is derived when it is first used; "derive" brings sympy for it.'
        if derives
        else "# Where formulas are left out, to be derived, this is dap3d[derive]."
    )
    places = {
        "pyproject.toml": ("every", "pyproject.toml"),
        "README.md": ("every", "README.md"),
        "scene.toml": (kind, "scene"),
        f"src/{module}/__init__.py": (kind, "type"),
        f"tests/test_{module.removeprefix('dap3d_')}.py": (kind, "test"),
    }
    return {path: Template(_template(*place)).substitute(values) for path, place in places.items()}


def _template(folder: str, name: str) -> str:
    return (files("dap3d_core.cli") / "templates" / folder / f"{name}.txt").read_text("utf-8")


def _write(folder: Path, texts: dict[str, str]) -> None:
    from dap3d_core.cli.framework.paths import write_text

    for name, text in texts.items():
        path = folder / name
        try:
            if not path.parent.resolve().is_relative_to(folder.resolve()):
                raise Refused(f"cannot write {path}: {path.parent} is a link out of the folder")
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise Refused(f"cannot write {path}: {error.strerror or error}") from error
        write_text(path, text)
