"""``dap3d describe``: a type of joint, force or function, its fields and its equations."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.process.exit_codes import DONE, Refused

if TYPE_CHECKING:
    from dap3d_core.interface.codegen.examined import Examined
    from dap3d_core.registry import Registry


@click.command(cls=Command, short_help="Explain a type: equations, fields, an example.")
@click.argument("keyword")
@click.option("--names", is_flag=True, help="Also list the names that its kernels may use.")
@click.option("--source", is_flag=True, help="Also show its kernels, written or derived.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
def describe(keyword: str, *, names: bool, source: bool, as_json: bool) -> int:
    """Explain the type with a KEYWORD: equations, fields, units, defaults, an example.

    A keyword may belong to a joint, a force and a function; all of them are shown.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.console import output, print_json

    registry = dap.load_registry()
    found = [type_facts(registry, kind, keyword) for kind in _kinds(registry, keyword)]
    if as_json:
        print_json({"types": found})
        return DONE
    console = output()
    for k, facts in enumerate(found):
        if k:
            console.print()
        _show(console, facts, names=names)
        if source:
            _show_source(console, facts)
    return DONE


def _kinds(registry: "Registry", keyword: str) -> list[str]:
    """The kinds that have this keyword."""
    from dap3d_core.interface.hooks import GROUPS
    from dap3d_core.registry.declared_types import not_yet_installed
    from dap3d_core.registry.suggestions import nearest

    known = {kind: registry.keywords(kind) for kind in GROUPS}
    found = [kind for kind, words in known.items() if keyword in words]
    if not found:
        near = nearest(keyword, sorted({w for words in known.values() for w in words}))
        lists = "; ".join(f"{kind}s: {', '.join(words) or 'none'}" for kind, words in known.items())
        hint = not_yet_installed(keyword) or (f"did you mean {near!r}?" if near else "")
        hint = f"; {hint}" if hint else ""
        raise Refused(f"there is no type {keyword!r}{hint} ({lists})")
    return found


def type_facts(registry: "Registry", kind: str, keyword: str) -> dict[str, Any]:
    """What there is to say of a type.

    Raises:
        PluginError: it cannot be loaded; says why.
    """
    import inspect

    from dap3d_core.cli.commands.describe_example import example_of
    from dap3d_core.interface.errors import where_is
    from dap3d_core.interface.fields import specs_of

    examined = registry.get(kind, keyword)
    type_: Any = examined.type
    slots = examined.layout.slots
    source = registry.sources[kind, keyword][0]
    facts: dict[str, Any] = {
        "kind": kind,
        "keyword": keyword,
        "class": type_.__name__,
        "distribution": source.distribution,
        "version": source.version,
        "module": source.module,
        "file": where_is(type_).removesuffix(f": {type_.__name__}"),
        "doc": inspect.cleandoc(type_.__doc__ or ""),
        "bodies": list(slots),
        "kernels": _kernels(examined),
        "derived": list(examined.derived),
        "source": _sources(examined),
        "fields": [_field(name, spec) for name, spec in specs_of(type_).items() if spec.given],
        "names": [
            {
                "name": q.name,
                "shape": list(q.shape),
                "level": "velocity" if q.velocity else "position",
                "doc": q.doc,
            }
            for q in examined.names.values()
        ],
        "variants": [_variant(conditions, e) for conditions, e in examined.variants],
        "example": example_of(examined, registry),
    }
    if kind == "joint":
        facts |= _counts(examined)
    if kind == "force":
        facts["each_body"] = bool(type_.each_body)
    return facts


def _kernels(examined: "Examined") -> list[str]:
    return [n for n in examined.type.kernel_names if n in examined.kernels]


def _sources(examined: "Examined") -> dict[str, str]:
    """The text of each kernel, as its author wrote it or as it was derived."""
    import inspect
    import textwrap

    found = {}
    for name in _kernels(examined):
        try:
            text = inspect.getsource(examined.kernels[name])
        except (OSError, TypeError):  # typed at a prompt
            text = "# its source cannot be read"
        found[name] = textwrap.dedent(text).rstrip()
    return found


def _counts(examined: "Examined") -> dict[str, Any]:
    """Rows of a joint, how many of them are there at position level, and the freedoms it leaves."""
    type_: Any = examined.type
    return {
        "rows": type_.rows,
        "position_rows": len(type_.position_rows()),
        "freedoms": 6 * max(len(examined.layout.slots) - 1, 1) - type_.rows,
    }


def _variant(conditions: Mapping[str, Any], examined: "Examined") -> dict[str, Any]:
    """What stands for the type where fields have certain values."""
    import inspect

    type_: Any = examined.type
    facts = {
        "with": dict(conditions),
        "class": type_.__name__,
        "doc": inspect.cleandoc(type_.__doc__ or ""),
        "kernels": _kernels(examined),
        "derived": list(examined.derived),
        "source": _sources(examined),
    }
    return facts | _counts(examined) if type_.kind == "joint" else facts


def _field(name: str, spec: Any) -> dict[str, Any]:
    return {
        "name": name,
        "kind": spec.kind,
        "required": spec.required,
        "default": None if spec.required else spec.default,
        "unit": spec.unit,
        "doc": spec.doc,
        "allowed": _allowed(spec),
    }


def _allowed(spec: Any) -> str:
    """What a value must satisfy beyond its kind."""
    words = [f"of {spec.argument}"] if spec.argument else []
    if spec.choices:
        words.append(", ".join(map(_word, spec.choices)))
        words += [f"{word} is {other}" for word, other in spec.aliases.items()]
    if spec.positive:
        words.append("> 0")
    if spec.minimum is not None:
        words.append(f">= {spec.minimum:g}")
    if spec.maximum is not None:
        words.append(f"<= {spec.maximum:g}")
    if spec.whole:
        words.append("a whole number")
    low, high = spec.usual
    if low is not None or high is not None:
        least = "" if low is None else f" >= {low:g}"
        words.append(f"usually{least}" + ("" if high is None else f" <= {high:g}"))
    if spec.direction:
        words.append("of unit length" if spec.kind == "vec3" else "not of zero length")
    if spec.across:
        words.append(f"not along {spec.across}")
    return ", ".join(words)


def _show(console: Any, found: dict[str, Any], *, names: bool) -> None:
    from dap3d_core.cli.console.console import facts, prose, say, show, table, title

    title(console, f"{found['keyword']}, a {found['kind']}")
    prose(console, found["doc"].replace("``", ""))
    if not console.wraps:
        console.print()
    origin = f"{found['distribution']} {found['version']}".strip() or "the model's own file"
    pairs = [("acts on", _acts_on(found)), ("from", f"{origin}, {found['module']}")]
    if found["kind"] == "joint":
        pairs[:1] = [("rows", _rows(found)), ("bodies", _acts_on(found))]
    facts(console, pairs)
    title(console, "fields")
    if found["fields"]:
        rows = [(f["name"], f["kind"], _default(f), f["unit"] or "-", _about(f))
                for f in found["fields"]]  # fmt: skip
        columns = ("field", "kind", "default", "unit", "meaning")
        show(console, table(columns, rows, fixed=(0, 1, 3)))
    else:
        say(console, "none", indent=2)
    if found["variants"]:
        title(console, "variants")
        show(console, table(*_variants(found), fixed=(0,)))
    if names:
        title(console, f"names for its kernels ({', '.join(found['kernels'])})")
        offered = [(n["name"], _shape(n["shape"]), n["level"], n["doc"]) for n in found["names"]]
        show(console, table(("name", "shape", "level", "meaning"), offered, fixed=(0, 1, 2)))
    title(console, "example")
    say(console, found["example"].rstrip(), indent=2)


def _show_source(console: Any, found: dict[str, Any]) -> None:
    """The kernels of a type and of its variants, to be read and copied: nothing is folded."""
    from dap3d_core.cli.console.console import title

    for facts in (found, *found["variants"]):
        for name, text in facts["source"].items():
            how = "derived" if name in facts["derived"] else "as written"
            title(console, f"{name} of {facts['class']}, {how}")
            console.print(text, markup=False, highlight=False, soft_wrap=True)


def _acts_on(found: dict[str, Any]) -> str:
    if found["kind"] == "function":
        return "its argument x, time where a force or joint does not say otherwise"
    if found.get("each_body"):
        return "every body of the scene"
    if not found["bodies"]:
        return "the bodies of its joint"
    return f"{', '.join(found['bodies'])}; a field's last letter says whose it is"


def _rows(found: dict[str, Any]) -> str:
    rows, freedoms, bodies = found["rows"], found["freedoms"], len(found["bodies"])
    words = f"{rows} constraint equation{'s' if rows > 1 else ''}"
    if found["position_rows"] < rows:
        words += f", {found['position_rows'] or 'none'} of them at position level"
    if bodies < 3:
        between = "between two bodies" if bodies == 2 else "of the body"
        words += f"; leaves {freedoms} of 6 freedoms {between}"
    return words + ("; see the variants" if found["variants"] else "")


def _variants(found: dict[str, Any]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Columns and rows of the table of variants; the last row is the type itself."""
    is_joint = found["kind"] == "joint"
    columns = ("where", "rows", "leaves", "is") if is_joint else ("where", "is")
    rows = []
    for facts in found["variants"]:
        where = ", ".join(f"{n} = {_word(v)}" for n, v in facts["with"].items())
        rows.append((where, facts, facts["doc"].partition("\n\n")[0].replace("\n", " ")))
    if found["kernels"]:
        rows.append(("otherwise", found, "as above"))
    return columns, [
        (where, str(facts["rows"]), str(facts["freedoms"]), words) if is_joint else (where, words)
        for where, facts, words in rows
    ]


def _word(value: Any) -> str:
    """A word of a choice as a scene has it; whether a function is given."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _default(field: dict[str, Any]) -> str:
    if field["required"]:
        return "required"
    default = field["default"]
    if isinstance(default, (tuple, list)):
        return _list(default)
    if isinstance(default, float):
        return f"{default:g}"
    return "-" if default is None else _word(default)


def _list(values: Any) -> str:
    words = [_list(x) if isinstance(x, (tuple, list)) else f"{x:g}" for x in values]
    return f"[{', '.join(words)}]"


def _about(field: dict[str, Any]) -> str:
    return "; ".join(w for w in (field["doc"], field["allowed"]) if w)


def _shape(shape: list[int]) -> str:
    return " x ".join(map(str, shape)) if shape else "number"
