"""Reference of the types: a page for each, from its fields, its docstring and its kernels."""

import re
from collections.abc import Iterator
from typing import Any

from dap3d_core.cli.commands import describe
from dap3d_core.interface.hooks import GROUPS
from dap3d_core.registry import Registry, load_registry
from dap3d_site.markdown import code, fenced, page, table, toctree

#: What the index of a kind says before its table.
ABOUT = {
    "joint": "A joint takes freedoms away, or drives them: `[joints.NAME]` in a scene, "
    "`scene.add_joint(KEYWORD, NAME, ...)` in a script.",
    "force": "What acts on bodies: `[forces.NAME]` in a scene, "
    "`scene.add_force(KEYWORD, NAME, ...)` in a script.",
    "function": "A function of one variable, for drivers and springs: `[functions.NAME]` in a "
    "scene, `scene.add_function(KEYWORD, NAME, ...)` in a script.",
    "contact": "Surfaces that may touch: `[contacts.NAME]` in a scene, "
    "`scene.add_contact(KEYWORD, NAME, ...)` in a script.",
}
DESCRIBED = "The same in a terminal: `dap3d describe KEYWORD`."


def pages() -> Iterator[tuple[str, str]]:
    """The pages of all types that come with dap3d: (path, text)."""
    registry = load_registry()
    for kind in GROUPS:
        found = [describe.type_data(registry, kind, keyword) for keyword in shipped(registry, kind)]
        yield f"reference/{kind}s/index.md", _index(kind, found)
        for facts in found:
            yield f"reference/{kind}s/{facts['keyword']}.md", type_page(facts)


def shipped(registry: Registry, kind: str) -> list[str]:
    """Keywords of the types that dap3d itself brings; others have pages of their own."""
    return [
        keyword
        for keyword in registry.keywords(kind)
        if registry.sources[kind, keyword][0].distribution == "dap3d"
    ]


def _index(kind: str, found: list[dict[str, Any]]) -> str:
    rows = [
        [f"[`{facts['keyword']}`]({facts['keyword']}.md)", _first(facts["doc"])]
        + ([_counts(facts, "rows"), _counts(facts, "freedoms")] if kind == "joint" else [])
        for facts in found
    ]
    columns = [kind, "is"] + (["rows", "leaves"] if kind == "joint" else [])
    below = toctree(*(facts["keyword"] for facts in found), hidden=True)
    return page(f"{kind.capitalize()}s", ABOUT[kind], DESCRIBED, table(columns, rows), below)


def type_page(facts: dict[str, Any]) -> str:
    """The page of a type: equations, fields, variants, names for kernels, a scene that runs."""
    about = [f"acts on: {describe.bodies_text(facts)}", f"class: {_home(facts)}"]
    if facts["kind"] == "joint":
        about.insert(0, f"rows: {describe.rows_text(facts)}")
    if facts["kernels"]:
        about.append(f"kernels: {', '.join(code(name) for name in facts['kernels'])}")
    listed = "\n".join(f"- {line}" for line in about)
    parts = [facts["doc"], listed, "## Fields", _fields(facts)]
    if facts["variants"]:
        columns, rows = describe.variants_table(facts)
        parts += ["## Variants", "Where fields have certain values, another class stands for it.",
                  table(columns, [[code(where), *rest] for where, *rest in rows])]  # fmt: skip
    parts += ["## Example", "A scene that runs as it stands:", fenced(facts["example"], "toml")]
    parts += ["## Names for its kernels", table(("name", "shape", "level", "is"), _names(facts))]
    return page(f"`{facts['keyword']}`: {words_of(facts['class'])}", *parts)


def words_of(name: str) -> str:
    """The name of a class in words, PointOnPlane as point on plane."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()


def _fields(facts: dict[str, Any]) -> str:
    rows = [
        (code(f["name"]), f["kind"], _default(f), f["unit"], describe.meaning_text(f))
        for f in facts["fields"]
    ]
    return table(("field", "kind", "default", "unit", "meaning"), rows) if rows else "None."


def _default(field: dict[str, Any]) -> str:
    word = describe.default_text(field)
    return word if word in ("required", "-") else code(word)


def _names(facts: dict[str, Any]) -> list[tuple[str, ...]]:
    return [
        (code(n["name"]), describe.shape_text(n["shape"]), n["level"], n["doc"])
        for n in facts["names"]
    ]


def _home(facts: dict[str, Any]) -> str:
    return f"{code(facts['class'])} in {code(facts['module'])}"


def _first(doc: str) -> str:
    return doc.partition("\n\n")[0]


def _counts(facts: dict[str, Any], what: str) -> str:
    """A number of a joint, or those of its variants."""
    counts = [facts[what], *(variant[what] for variant in facts["variants"])]
    return ", ".join(str(n) for n in dict.fromkeys(sorted(counts))) if None not in counts else ""
