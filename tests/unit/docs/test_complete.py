"""The documentation leaves nothing out: what is generated is read here, without a build."""

import inspect
import posixpath
import re
import sys
import tomllib
from functools import cached_property
from html import unescape
from importlib import import_module
from types import FunctionType, SimpleNamespace

import attrs
import click
import pytest
from support.command_line import dap3d
from support.internals import (
    HEADER_KEYS,
    INTEGRATORS,
    METHODS,
    NAMED,
    TABLES,
    Animation,
    BodyPose,
    described,
    hooks,
    sample_classes,
    sized_fields,
    specs_of,
)
from support.process import REPOSITORY

import dap3d_core as dap
from dap3d_core import interface, kernels
from dap3d_core.interface.codegen.instance_layout import layout_of
from dap3d_core.interface.codegen.kernel_arguments import (
    SLIP,
    VELOCITY_KERNELS,
    friction_names,
    namespace,
)
from dap3d_core.scene import Simulation
from dap3d_core.scene.coerce import keys_of

DOCS = REPOSITORY / "docs"
#: Members of a class that have docstrings of their own.
DOCUMENTED = (FunctionType, classmethod, staticmethod, property, cached_property)


@pytest.fixture(scope="module", autouse=True)
def site():
    """The extension of Sphinx that writes pages, importable."""
    sys.path.insert(0, str(DOCS / "_ext"))
    yield
    sys.path.remove(str(DOCS / "_ext"))


@pytest.fixture(scope="module")
def pages(site):
    """Path and text of every generated page."""
    from dap3d_site.pages import generated

    return generated()


@pytest.fixture(scope="module")
def source(site):
    """Path and text of every file that Sphinx reads, pictures left out."""
    from dap3d_site.staging import everything

    found = everything(REPOSITORY)
    pictures = (".png", ".gif")
    return {path: text.decode() for path, text in found.items() if not path.endswith(pictures)}


def shown(name, page):
    """Whether a page has the directive that shows something."""
    return re.search(rf"^\.\. auto\w+:: {re.escape(name)}$", page, flags=re.MULTILINE)


@pytest.mark.parametrize("kind", list(hooks.GROUPS))
def test_every_type_has_a_page_with_all_its_fields(pages, kind):
    """Docstring, fields, names for kernels, variants and an example, for each type of dap3d."""
    registry = dap.load_registry()
    own = [w for w in registry.keywords(kind)
           if registry.sources[kind, w][0].distribution == "dap3d"]  # fmt: skip
    assert own
    index = pages[f"reference/{kind}s/index.md"]
    for keyword in own:
        type_info = registry.get(kind, keyword)
        page = pages[f"reference/{kind}s/{keyword}.md"]
        assert f"[`{keyword}`]({keyword}.md)" in index
        assert inspect.cleandoc(type_info.type.__doc__) in page
        for name, spec in specs_of(type_info.type).items():
            if spec.given:
                assert f"| `{name}` | {spec.kind} |" in page, (keyword, name)
                assert spec.doc, f"{keyword}.{name} has no doc"
        for name in type_info.names:
            assert f"| `{name}` |" in page, (keyword, name)
        for _, variant in type_info.variants:
            assert variant.type.__doc__.partition("\n\n")[0].split()[0] in page
        assert "```toml\n" in page


def test_every_command_and_option_is_there_with_its_help(pages):
    """Each command has a section, each option a row."""
    page = pages["reference/command-line.md"]
    for name, command in dap3d.commands.items():
        section = page.partition(f"## dap3d {name}\n")[2].partition("\n## ")[0]
        assert section, name
        assert inspect.cleandoc(command.help).partition("\n")[0] in section
        for parameter in command.params:
            if isinstance(parameter, click.Option):
                for word in (*parameter.opts, *parameter.secondary_opts):
                    assert re.search(rf"`{word}[ `]", section), (name, word)
            else:
                assert parameter.human_readable_name.upper() in section, (name, parameter.name)


def test_every_hook_is_there(pages):
    """With its entry-point group."""
    page = pages["reference/hooks.md"]
    specified = [n for n, f in vars(hooks).items() if hasattr(f, "dap3d_spec")]
    assert set(specified) == {hook for _, hook in hooks.GROUPS.values()}
    for group, hook in hooks.GROUPS.values():
        assert f"`{group}` | `{hook}`" in page
        assert shown(f"dap3d_core.interface.hooks.{hook}", page)


def test_every_name_of_the_interface_is_there(pages):
    """Makers of fields, classes, annotations, the marker, the version."""
    found = "".join(pages[f"reference/{name}.md"] for name in ("interface", "fields", "hooks"))
    for name in interface.__all__:
        assert shown(f"dap3d_core.interface.{name}", found) or f"`{name}`" in found, name
        value = getattr(interface, name)
        if inspect.isfunction(value) or inspect.isclass(value):
            assert inspect.getdoc(value), name
            assert shown(f"dap3d_core.interface.{name}", found), name


def test_every_word_of_kernels_is_there(pages):
    """With its docstring."""
    for name in kernels.__all__:
        assert shown(f"dap3d_core.kernels.{name}", pages["reference/kernel-words.md"]), name
        assert inspect.getdoc(getattr(kernels, name)), name


def rows_of(page, head):
    """The rows of a table, by its head: first cell -> the names in each of the others."""
    table = page.partition(f"| {head} |")[2].partition("\n\n")[0].splitlines()[2:]
    cells = [re.split(r"\s*\|\s*", line.strip())[1:-1] for line in table]
    return {first: [set(re.findall(r"`([^`]+)`", c)) for c in others] for first, *others in cells}


class Three(interface.Force):
    """A force on three bodies, to which the fields of the page are added one by one."""

    keyword = "three"
    b_i: interface.Vector = interface.vector()
    b_j: interface.Vector = interface.vector()
    b_k: interface.Vector = interface.vector()


def names_of(line="", constants=()):
    """The names of the position and of the velocity level with one more field, or constants."""
    members = {"__module__": __name__}
    exec(line, vars(interface) | {}, members)
    type_ = type("Added", (Three,), members)
    if sized_fields(type_):
        type_ = sample_classes(type_)[0]
    found = namespace(type_, layout_of(type_, dict(constants)))
    if hasattr(type_, "shape_of_lists"):
        found |= described(SimpleNamespace(type=type_, names=found))
    found = [q for q in found.values() if not re.search(r"_\d_[i-p]", q.name)]
    return [{q.name for q in found if q.velocity == level} for level in (False, True)]


def test_the_names_of_each_field_are_those_of_the_sources():
    """Each row of the page is a line of a class: its names are those that the line adds."""
    page = (DOCS / "reference" / "names.md").read_text()
    rows = rows_of(page, "field | position level | velocity level")
    bodies, three = rows.pop(next(iter(rows))), names_of()
    own = {"b_i", "b_i_dot"}
    assert [{n for n in level if n.endswith("_i")} - own for level in three] == bodies
    for line, levels in rows.items():
        added = [a - b for a, b in zip(names_of(line.strip("`")), three, strict=True)]
        assert added == levels, line
    makers = {n for n in interface.__all__ if n[0].islower() and n not in ("examine", "hookimpl")}
    assert {line.partition("= ")[2].partition("(")[0] for line in rows} == makers


def test_the_names_besides_those_of_fields_are_those_of_the_sources():
    """Of time, of a function's argument, of friction, of what prepare returns; of its bodies."""
    page = (DOCS / "reference" / "names.md").read_text()
    besides = rows_of(page, "where | names")
    jumps = [[{"crossing"}], [{"Jv"}]]
    rubs = [[set(friction_names(3))], [set(SLIP)]]
    assert list(besides.values()) == [[{"t"}], [{"x"}], *rubs, *jumps]
    for line, levels in rows_of(page, "returned | position level | velocity level").items():
        (constant,) = re.findall(r"`(\"\w+\": .*)`", line)
        found = names_of(constants=eval(f"{{{constant}}}"))
        assert [a - b for a, b in zip(found, names_of(), strict=True)] == levels
    velocity = ", ".join(f"`{name}`" for name in VELOCITY_KERNELS)
    assert f"may be used by {velocity}." in " ".join(page.split())
    methods = {f"{n}(s)" for n, v in vars(BodyPose).items() if callable(v) and n[0] != "_"}
    rows = rows_of(page, '`bodies["i"]` has | which is')
    fields = {field.name for field in attrs.fields(BodyPose)}
    assert {first.strip("`") for first in rows} == methods | fields


def test_every_extra_is_on_the_page_about_installing():
    page = (DOCS / "start" / "install.md").read_text()
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    for extra in project["optional-dependencies"]:
        assert re.search(rf"^\|.*`{extra}`.* \|", page, flags=re.MULTILINE), extra


def test_every_kernel_of_a_joint_is_on_the_page_about_levels():
    page = (DOCS / "concepts" / "levels.md").read_text()
    for name in interface.Joint.kernel_names:
        assert f"`{name}`" in page, name


def test_everything_that_a_type_may_say_has_an_example():
    """Kernels, declarations and fields of types appear in the examples of the page about them."""
    page = (DOCS / "how-to" / "what-a-type-can-say.md").read_text()
    examples = "\n".join(re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL))
    for base in (interface.Joint, interface.Force, interface.Function):
        for kernel in base.kernel_names:
            assert kernel == "nu" or f"    def {kernel}(" in examples, kernel
    declared = {
        n for base in (interface.Joint, interface.Force) for n in inspect.get_annotations(base)
    }
    for name in declared - {"rows", "energy_where", "switch_words", "grips"}:  # grips: by of=
        assert re.search(rf"\b{name}\b.* = ", examples), name
    for maker in ("angle", "choice", "function", "functions", "input_", "number", "point", "table"):
        assert f"= {maker}(" in examples, maker


def test_every_public_name_is_there(pages):
    """All of ``dap3d_core``, with docstrings; so have the members of its classes."""
    for name in dap.__all__:
        assert shown(f"dap3d_core.{name}", pages["reference/python.md"]), name
        value = getattr(dap, name)
        assert inspect.getdoc(value), name
        if inspect.isclass(value):
            own = [c for c in value.__mro__ if c.__module__.startswith("dap3d_core")]
            for member, what in (pair for c in own for pair in vars(c).items()):
                if not member.startswith("_") and isinstance(what, DOCUMENTED):
                    assert inspect.getdoc(what), f"{name}.{member}"


def test_what_public_names_hand_out_exists(site):
    """The classes that the page on Python shows besides."""
    from dap3d_site.python import SECTIONS

    for _, others in SECTIONS.values():
        for path in others:
            floor, _, name = path.rpartition(".")
            assert inspect.getdoc(
                getattr(import_module(floor if "dap3d_" in floor else f"dap3d_core.{floor}"), name)
            ), path


def test_every_setting_formulation_and_integrator_is_there(pages):
    """Each setting with what it is, each method and integrator with its text."""
    page = pages["reference/settings.md"]
    for field in attrs.fields(Simulation):
        row = re.search(rf"^\| `{field.name}` \|.*\| (.*) \|$", page, flags=re.MULTILINE)
        assert row, field.name
        assert len(row[1]) > 5, field.name
    for name in (*METHODS, *INTEGRATORS):
        section = re.search(rf"^### `{name}`\n\n(.*)$", page, flags=re.MULTILINE)
        assert section, name
        assert len(section[1]) > 20, name
    integrators = (DOCS / "concepts" / "integrators.md").read_text()
    assert all(f"| `{name}` |" in integrators for name in INTEGRATORS)
    formulations = (DOCS / "concepts" / "formulations.md").read_text()
    assert all(f"**`{name}`**" in formulations for name in METHODS)


def test_every_environment_variable_is_there(pages):
    """Those that the sources read and that have our name."""
    text = "".join(f.read_text() for f in (REPOSITORY / "src").rglob("*.py"))
    variables = set(re.findall(r"\bDAP3D_[A-Z]+(?:_[A-Z]+)*\b", text))
    assert variables >= {"DAP3D_CACHE_DIR"}
    for name in variables:
        assert f"| `{name}` |" in pages["reference/settings.md"], name


def test_every_key_of_the_scene_file_is_there():
    """Tables and their keys; fields of types have pages of their own."""
    page = (DOCS / "reference" / "scene-file.md").read_text()
    for table in TABLES:
        assert re.search(rf"^## .*\[{table}[\].]", page, flags=re.MULTILINE), table
    keys = set(HEADER_KEYS) | keys_of(Animation) | keys_of(Simulation)
    for class_ in NAMED.values():
        keys |= keys_of(class_) - {"fields"}
    for key in keys:
        assert f"`{key}`" in page, key


@pytest.mark.slow
def test_every_page_is_reached(source):
    """From the index, by lists of pages; models are listed by sphinx-gallery."""
    lists = {page: toctrees(page, text, source) for page, text in source.items()}
    reached, todo = set(), ["index.md"]
    while todo:
        page = todo.pop()
        if page not in reached:
            reached.add(page)
            todo += lists[page]
    pages = {path for path in source if path.endswith(".md") and not path.startswith("_")}
    assert pages == reached


def toctrees(page, text, source):
    """The pages that the lists of a page name; those of the gallery are not made yet."""
    folder = page.rpartition("/")[0]
    found = []
    for body in re.findall(r"^```\{toctree\}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL):
        for line in body.splitlines():
            entry = re.sub(r".*<(.*)>$", r"\1", line.strip())
            if not entry or entry.startswith((":", "models/")):
                continue
            path = "/".join(part for part in (folder, f"{entry}.md") if part)
            if "*" in entry:
                pattern = re.escape(path).replace(r"\*", "[^/]*")
                matching = [other for other in source if re.fullmatch(pattern, other)]
                assert matching, entry
                found += matching
            else:
                assert path in source, f"{page} lists {entry}"
                found.append(path)
    return found


@pytest.mark.slow
def test_every_model_is_in_the_gallery(source):
    """With what its page says and the quantities that it draws."""
    from dap3d_site.gallery import models

    found = models(REPOSITORY)
    scenes = list((REPOSITORY / "models").rglob("scene.toml"))
    assert {m.name for m in found} == {s.parent.name for s in scenes} == set(dap_models())
    for model in found:
        script = source[f"{model.document.replace('models', '_scripts', 1)}.py"]
        compile(script, model.name, "exec")
        assert f"dap.simulate({model.name!r}" in script
        assert source[f"_models/{model.name}-page.md"].strip()
    assert "'frame.r.x', 'frame.r.y'" in source["_scripts/tri.py"]
    assert "allow_code=True" in source["_scripts/ball1.py"]


def dap_models():
    """Names of the shipped models, without those given by their group."""
    return [name.rpartition("/")[2] for name in dap.shipped_models()]


@pytest.mark.slow
def test_links_lead_to_pages_of_the_site(source):
    """Also those that lead out of docs, and those between models, which are included elsewhere."""
    from dap3d_site.gallery import models

    made = {f"{model.document}.rst" for model in models(REPOSITORY)}
    for path, text in source.items():
        if path.startswith("_models/") and path.endswith("-page.md"):
            folder = next(m for m in made if m.endswith(f"/{path[8:-8]}.rst")).rpartition("/")[0]
        elif path.endswith(".md") and not path.startswith("_"):
            folder = path.rpartition("/")[0]
        else:
            continue
        for link in re.findall(r"(?<!!)\]\((?![a-z]+:|#)([^)#\s]+)", text):
            target = posixpath.normpath(f"{folder}/{link}").lstrip("/")
            is_picture = link.endswith(".png") or (DOCS / target).is_file()
            assert target in source or target in made or is_picture, (path, link)


def test_formulas():
    """Letters are those that browsers draw; what is not understood is an error."""
    pytest.importorskip("latex2mathml", reason="the extra docs is not installed")
    from dap3d_site.formulas import mathml

    found = unescape(mathml(r"\tfrac12 \mathbf{G}^T \boldsymbol\omega", "inline"))
    assert "\N{MATHEMATICAL BOLD CAPITAL G}" in found
    assert "\N{MATHEMATICAL BOLD ITALIC SMALL OMEGA}" in found
    assert "mathvariant" not in found
    with pytest.raises(ValueError, match="not understood"):
        mathml(r"a \unheardof b", "inline")


def test_what_is_missing_is_named_by_distributions_that_an_extra_brings():
    """An extra of dap3d itself may not be had where dap3d is installed from its repository."""
    extras = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    brought = {re.split(r"[\[<>=;]", text)[0] for group in extras["optional-dependencies"].values()
               for text in group}  # fmt: skip
    command = re.compile(r"pip install (['\"]?[\w.\[\] -]*)")
    ours = "dap3d[", "'dap3d[", '"dap3d['
    for folder in ("src", "plugins", "docs/how-to", "docs/tutorials"):
        for path in (REPOSITORY / folder).rglob("*"):
            if path.suffix not in (".py", ".md"):
                continue
            for words in command.findall(path.read_text(encoding="utf-8")):
                assert not words.startswith(ours), f"{path}: pip install {words}"
    for words in ("sympy", "trimesh", "control", "xacrodoc", "ziglang", "tree-sitter",
                  "tree-sitter-matlab", "cloudpickle", "dask", "distributed"):  # fmt: skip
        assert words in brought
