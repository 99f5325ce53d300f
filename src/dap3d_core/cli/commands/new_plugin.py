"""``dap3d new-plugin``: writes a package with a type or an extension, to be changed."""

import importlib.util
import json
import keyword as python
import re
import shlex
from collections.abc import Collection
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from string import Template

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, Refused
from dap3d_core.cli.process.streams import prints_json
from dap3d_core.interface.hooks import EXTENSIONS, GROUPS

#: Keywords after which a distribution and a module can be named.
KEYWORD = re.compile(r"[A-Za-z0-9]([A-Za-z0-9._-]*[A-Za-z0-9])?", re.ASCII)
LONGEST = 60
#: Names that the modules import: a class of such a name is named after its kind too.
IMPORTED = ("Actuator", "Articulation", "Contact", "Counter", "Exporter", "Force", "FormatError",
            "Frame", "Function", "Importer", "Inertial", "Joint", "Link", "Path", "Place", "Point",
            "Remarks", "ShapeKind", "Vector")  # fmt: skip
#: Modules of dap3d itself.
OWN = "dap3d_core"


@command(
    "Write a package with a type of its own.",
    click.argument("name"),
    click.option("--kind", type=click.Choice([*GROUPS, *EXTENSIONS]), default="joint",
                 show_default=True, help="What the package brings."),
    options.output("Where to write; by default dap3d-NAME.", metavar="FOLDER"),
    click.option("--author", metavar="WORDS", help="Author, for pyproject.toml."),
    click.option("--force", is_flag=True,
                 help="Write into a folder that is not empty; use a keyword that is taken."),
    options.JSON,
    saves=True,
)  # fmt: skip
def new_plugin(name: str, *, kind: str, output: str | None, author: str | None, force: bool) -> int:
    """Write a package that brings a type of a joint, a force, a function or a contact.

    Or an integrator, an importer or exporter of models, a kind of shape: --kind says which.

    NAME is the keyword that scenes will have for the type (an importer or exporter: what --format
    names): letters, digits, and - _ . between them.

    The package is complete: a type that works, its tests, a scene that runs, a README, and a
    workflow that runs the checks at each push, on GitHub Actions. Make the type your own, and let
    dap3d check-plugin say whether its formulas are right.
    """
    from dap3d_core.cli.console.console import print_json, stdout

    names = _names(name, kind, author)
    _check_free(names, force=force)
    folder = _folder(output or names["distribution"], force=force)
    about = _about(names)
    texts = _texts(names | about)
    _write(folder, texts)
    commands = [f"cd {shlex.quote(str(folder))}", 'pip install -e ".[test]"',
                f"dap3d check-plugin {name}", about["command"], "pytest"]  # fmt: skip
    if prints_json():
        print_json({"keyword": name, "kind": kind, "folder": folder, "files": list(texts),
                    "module": names["module"], "next": commands})  # fmt: skip
        return DONE
    heading = f"{folder} holds a package with the {about['noun']} {name}:"
    for title, lines in ((heading, texts), ("What comes next:", commands)):
        stdout().say(title)
        for line in lines:
            stdout().say(line, indent=4, whole=True)
    return DONE


def _names(name: str, kind: str, author: str | None) -> dict[str, str]:
    """Names of the package, its module and its class."""
    if not KEYWORD.fullmatch(name) or len(name) > LONGEST:
        raise Refused(
            f"{name!r} is no keyword for a type; use letters, digits, and - _ . between them, "
            f"{LONGEST} at most"
        )
    if author and not author.isprintable():
        raise Refused(f"{author!r} is no name of an author; use one line of text")
    words = re.split(r"[-_.]+", name)
    class_name = "".join(w[0].upper() + w[1:] for w in words)
    if class_name in IMPORTED or python.iskeyword(class_name):
        class_name += kind.capitalize()
    if class_name[0].isdigit():
        class_name = kind.capitalize() + class_name
    quoted = json.dumps(author, ensure_ascii=False)  # a string of JSON is one of TOML
    return {
        "keyword": name,
        "kind": kind,
        "distribution": "dap3d-" + "-".join(words).lower(),
        "module": "dap3d_" + "_".join(words).lower(),
        "class_name": class_name,
        "suffix": words[-1].lower(),
        "authors": f"authors = [{{ name = {quoted} }}]\n" if author else "",
    }


def _check_free(names: dict[str, str], *, force: bool) -> None:
    """Refuse a keyword that its kind has already, and a module that exists.

    The modules of dap3d itself are never replaced.
    """
    from dap3d_core.registry.discovery import discover
    from dap3d_core.registry.guard import noun_of

    kind, keyword, module = names["kind"], names["keyword"], names["module"]
    sources = discover([group for group, _ in (GROUPS | EXTENSIONS).values()])
    own = {s.module.partition(".")[0] for s in sources if s.distribution == "dap3d"}
    if module in {OWN, *own}:
        raise Refused(f"the module {module} would hide dap3d's own; use another name")
    if keyword in _built_in(kind):
        raise Refused(f"dap3d itself has the {noun_of(kind)} {keyword!r}; use another name")
    if force:
        return
    for rival in sources:
        if (rival.kind, rival.keyword) == (kind, keyword):
            both = (
                "only one of them can be installed"
                if kind in EXTENSIONS
                else "with both installed scenes must say which, "
                f'type = "{names["distribution"]}:{keyword}"'
            )
            article = "an" if kind[0] in "aeiou" else "a"
            raise Refused(
                f"there is {article} {noun_of(kind)} {keyword!r} already, from {rival}: "
                f"{both}. Use another name, or --force"
            )
    if importlib.util.find_spec(module) is not None:
        raise Refused(
            f"a module {module} is installed already; use another name, or --force if it will be "
            "removed"
        )


def _built_in(kind: str) -> Collection[str]:
    """Words that scenes and commands take for dap3d's own, whatever packages bring."""
    from dap3d_core.scene.validate.shapes import SHAPES
    from dap3d_core.settings import INTEGRATORS

    return {"integrator": INTEGRATORS, "shape": SHAPES}.get(kind, ())


def _folder(output: str, *, force: bool) -> Path:
    """The folder to write into; refused if it is not empty."""
    folder = Path(output)
    try:
        is_empty = not folder.exists() or not any(folder.iterdir())
    except NotADirectoryError as error:
        raise Refused(f"{folder} is a file; name a folder with -o") from error
    except OSError as error:
        raise Refused(f"cannot read {folder}: {error.strerror or error}") from error
    if not (is_empty or force):
        raise Refused(f"{folder} holds files; --force writes among them, -o names another folder")
    return folder


def _about(names: dict[str, str]) -> dict[str, str]:
    """What the texts say of the kind, by the names of their places."""
    bound = ".".join(version("dap3d").split(".")[:2])
    text = Template(_template(names["kind"], "about")).substitute(names, bound=bound)
    about = dict(line.split(" = ", 1) for line in text.splitlines())
    about["about_dependencies"] = ""
    if names["kind"] in GROUPS:
        about["about_dependencies"] = (
            "# What the type leaves out is derived when it is first used; "
            '"derive" brings sympy for it.\n'
            if "derive" in about["dependency"]
            else "# Where formulas are left out, to be derived, this is dap3d[derive].\n"
        )
    return about


def _texts(values: dict[str, str]) -> dict[str, str]:
    """The files of the package, by their paths in it."""
    kind, module = values["kind"], values["module"]
    inside = _template("every" if kind in GROUPS else kind, "inside")
    values = values | {"inside": Template(inside).substitute(values)}
    places = {
        "pyproject.toml": ("every", "pyproject.toml"),
        "README.md": ("every", "README.md"),
        values["sample"]: (kind, "scene"),
        ".github/workflows/tests.yml": ("every", "tests.yml"),
        ".github/badge.py": ("every", "badge.py"),
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
