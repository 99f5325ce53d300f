"""``dap3d describe``: a type, its fields and its equations; a model, its parts and quantities."""

import inspect
import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, Refused
from dap3d_core.cli.process.streams import prints_json

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal
    from dap3d_core.interface.codegen.kernel_arguments import KernelArgument
    from dap3d_core.interface.codegen.type_info import TypeInfo
    from dap3d_core.registry import Registry


@command(
    "Explain a type or a model: equations, fields, quantities.",
    click.argument("keyword", metavar="KEYWORD | MODEL"),
    click.option("--names", is_flag=True, help="Also list the names that its kernels may use."),
    click.option(
        "--source",
        is_flag=True,
        help="Also show the kernels of a type, written or derived; of a model "
        "the operations of its own program (decision 92).",
    ),
    options.ALLOW_CODE,
    options.JSON,
)
def describe(keyword: str, *, names: bool, source: bool, allow_code: bool) -> int:
    """Explain the type with a KEYWORD: equations, fields, units, defaults, an example.

    A keyword may belong to a joint, a force and a function; all of them are shown. Names of other
    programs, such as hinge or prismatic, lead to the type. Of a MODEL, what its results have:
    bodies, coordinates of its joints, outputs; and its parameters.
    """
    import dap3d_core as dap
    from dap3d_core.cli.commands.describe_model import is_model, model_data, show_model
    from dap3d_core.cli.console.console import print_json, show_data, stdout

    registry = dap.load_registry()
    if not _is_type(registry, keyword) and is_model(keyword):
        if names:
            raise Refused(f"--names is of types, and {keyword} is a model; give a keyword")
        model = model_data(keyword, allow_code=allow_code, source=source)
        show_data({"model": model}, lambda console: show_model(console, model))
        return DONE
    types = [type_data(registry, kind, word) for kind, word in _types(registry, keyword)]
    if prints_json():
        print_json({"types": types})
        return DONE
    console = stdout()
    if not _is_type(registry, keyword):
        here = sorted({data["keyword"] for data in types})
        console.say(f"{keyword} is called {' or '.join(here)} here.", whole=True)
        console.print()
    for k, data in enumerate(types):
        if k:
            console.print()
        _show(console, data, names=names)
        if source:
            _show_source(console, data)
    return DONE


def _is_type(registry: "Registry", keyword: str) -> bool:
    from dap3d_core.interface.hooks import GROUPS

    return any(registry.sources_of(kind, keyword) for kind in GROUPS)


def _types(registry: "Registry", word: str) -> list[tuple[str, str]]:
    """Kind and keyword of the types of a keyword, or of those with this other name."""
    from dap3d_core.cli.framework.error_messages import type_hint
    from dap3d_core.interface.hooks import GROUPS

    known = {kind: registry.keywords(kind) for kind in GROUPS}
    found = [(kind, word) for kind in known if registry.sources_of(kind, word)]
    if not found:
        same = {kind: registry.keyword_of_synonym(kind, word) for kind in known}
        found = [(kind, keyword) for kind, keyword in same.items() if keyword]
    if not found:
        hint = type_hint(word, sorted({k for keywords in known.values() for k in keywords}))
        lists = "; ".join(f"{kind}s: {', '.join(all_) or 'none'}" for kind, all_ in known.items())
        raise Refused(f"there is no type {word!r}{hint} ({lists})")
    return found


# ---------------------------------------------------------------------------- data


def type_data(registry: "Registry", kind: str, keyword: str) -> dict[str, Any]:
    """The description of a type as data.

    Raises:
        PluginError: it cannot be loaded; says why.
    """
    from dap3d_core.cli.commands.describe_example import example_of
    from dap3d_core.interface.errors import where_is
    from dap3d_core.interface.fields import specs_of
    from dap3d_core.scene.validate.joint_fields import keys_beside_fields

    type_info = registry.get(kind, keyword)
    type_: Any = type_info.type
    source = registry.sources_of(kind, keyword)[0]
    specs = specs_of(type_)
    return {
        "kind": kind,
        "keyword": keyword,
        "class": type_.__name__,
        "distribution": source.distribution,
        "version": source.version,
        "module": source.module,
        "file": where_is(type_).removesuffix(f": {type_.__name__}"),
        "bodies": list(type_info.layout.slots),
        "states": type_.state_lengths(),
        "synonyms": list(type_.synonyms),
        "also": list(keys_beside_fields(type_)),
        **_class_data(type_info),
        "fields": [
            {
                "name": name,
                "kind": spec.kind,
                "required": spec.required,
                "default": None if spec.required else spec.default,
                "unit": spec.unit,
                "doc": spec.doc,
                "allowed": _allowed(spec, specs),
            }
            for name, spec in specs.items()
            if spec.given
        ],
        "names": list(map(_name_data, type_info.names.values())),
        "variants": [
            {"with": dict(conditions), "class": e.type.__name__, **_class_data(e)}
            for conditions, e in type_info.variants
        ],
        "example": example_of(type_info, registry),
        **({"motions": _motions(type_info)} if kind == "joint" else {}),
        **(
            {"each_body": bool(type_.each_body), "each_pair": bool(type_.each_pair)}
            if kind == "force"
            else {}
        ),
        **({"arguments": type_.arguments} if kind == "function" else {}),
    }


def _name_data(argument: "KernelArgument") -> dict[str, Any]:
    """A name that kernels may use."""
    return {
        "name": argument.name,
        "shape": list(argument.shape),
        "level": "velocity" if argument.velocity else "position",
        "doc": argument.doc,
    }


def _class_data(type_info: "TypeInfo") -> dict[str, Any]:
    """Docstring, kernels and, of a joint, numbers of rows: what variants of a type have, too."""
    type_: Any = type_info.type
    kernels = [name for name in type_.kernel_names if name in type_info.kernels]
    data: dict[str, Any] = {
        "doc": inspect.cleandoc(type_.__doc__ or ""),
        "kernels": kernels,
        "derived": list(type_info.derived),
        "source": {name: _source(type_info.kernels[name]) for name in kernels},
    }
    if type_.kind == "joint" and isinstance(type_.rows, str):  # by the size of a list
        rows = type_.rows
        data |= {"rows": rows, "position_rows": rows if type_.holonomic else 0, "freedoms": None}
    elif type_.kind == "joint":
        data |= {
            "rows": type_info.row_count,
            "position_rows": sum(type_.constraint_mask()),
            "freedoms": 6 * max(len(type_info.layout.slots) - 1, 1) - type_info.row_count,
        }
    return data


def _motions(type_info: "TypeInfo") -> list[dict[str, Any]]:
    """The motions that a joint and its variants leave free."""
    import attrs

    from dap3d_core.testing.kit import type_motions

    return [attrs.asdict(motion) for motion in type_motions(type_info)]


def _source(kernel: Any) -> str:
    """The source of a kernel, as its author wrote it or as it was derived."""
    try:
        text = inspect.getsource(kernel)
    except (OSError, TypeError):  # typed at a prompt
        text = "# its source cannot be read"
    return textwrap.dedent(text).rstrip()


def _allowed(spec: Any, specs: Mapping[str, Any]) -> str:
    """The conditions on a value besides its kind, or what stands in its place."""
    bounds = {">": 0.0 if spec.positive else None, ">=": spec.minimum, "<=": spec.maximum}
    usual = _bounds({">=": spec.usual[0], "<=": spec.usual[1]})
    words = [f"of {spec.argument}"] if spec.argument else []
    words += [f"a number, or the name of a {' or '.join(spec.by_name)}"] * bool(spec.by_name)
    words += ["rows of equal length"] * bool(spec.by_rows)
    if spec.choices:
        words.append(", ".join(map(_word, spec.choices)))
        words += [f"{word} is {other}" for word, other in spec.aliases.items()]
    words += _bounds(bounds)
    words += ["a whole number"] * bool(spec.whole)
    words += [f"usually {' '.join(usual)}"] * bool(usual)
    if spec.direction:
        words.append("of unit length" if spec.kind == "vec3" else "not of zero length")
        if isinstance(spec.direction, tuple):
            words[-1] += f" at the start, where one of {', '.join(spec.direction)} is given"
    words += [f"not along {spec.across}"] * bool(spec.across)
    words += ["or P_i and P_j in its place"] * (spec.kind == "vector2" and "P_i" not in specs)
    return ", ".join(words)


def _bounds(bounds: Mapping[str, float | None]) -> list[str]:
    return [f"{sign} {value:g}" for sign, value in bounds.items() if value is not None]


# ---------------------------------------------------------------------------- text


def _show(console: "Terminal", data: dict[str, Any], *, names: bool) -> None:
    console.title(f"{data['keyword']}, a {data['kind']}")
    console.prose(data["doc"].replace("``", ""))
    if not console.wraps:
        console.print()
    origin = f"{data['distribution']} {data['version']}".strip() or "the model's own file"
    pairs = [("acts on", bodies_text(data)), ("from", f"{origin}, {data['module']}")]
    if data["kind"] == "joint":
        pairs[:1] = [("rows", rows_text(data)), ("bodies", bodies_text(data))]
        words = (f"with {m['variant']}: {m['words']}" if m["variant"] else m["words"]
                 for m in data["motions"])  # fmt: skip
        pairs[2:2] = [("method joint", one) for one in dict.fromkeys(words)]
    if data["synonyms"]:
        pairs.append(("called", ", ".join(data["synonyms"]) + " elsewhere"))
    if data["states"]:
        states = (name if n == 1 else f"{name} ({n} numbers)" for name, n in data["states"].items())
        initial = "initial values by fields in _0, tolerances by fields in _atol"
        pairs.append(("states", f"{', '.join(states)}; {initial}"))
    if data["also"]:
        pairs.append(("also takes", f"{', '.join(data['also'])} (docs/reference/scene-file.md)"))
    console.facts(pairs)
    console.title("fields")
    if data["fields"]:
        rows = [(f["name"], f["kind"], default_text(f), f["unit"] or "-",
                 "; ".join(filter(None, (f["doc"], f["allowed"]))))
                for f in data["fields"]]  # fmt: skip
        console.table(("field", "kind", "default", "unit", "meaning"), rows, fixed=(0, 1, 3))
    else:
        console.say("none", indent=2)
    if data["variants"]:
        console.title("variants")
        console.table(*variants_table(data), fixed=(0,))
    if names:
        console.title(f"names for its kernels ({', '.join(data['kernels'])})")
        rows_ = [(n["name"], " x ".join(map(str, n["shape"])) or "number", n["level"], n["doc"])
                 for n in data["names"]]  # fmt: skip
        console.table(("name", "shape", "level", "meaning"), rows_, fixed=(0, 1, 2))
    console.title("example")
    console.say(data["example"].rstrip(), indent=2)


def _show_source(console: "Terminal", data: dict[str, Any]) -> None:
    """Print the kernels of a type and of its variants, unfolded so that they can be copied."""
    for each in (data, *data["variants"]):
        for name, text in each["source"].items():
            how = "derived" if name in each["derived"] else "as written"
            console.title(f"{name} of {each['class']}, {how}")
            console.print(text, markup=False, highlight=False, soft_wrap=True)


def bodies_text(data: dict[str, Any]) -> str:
    """The bodies on which a type acts, in words."""
    if data["kind"] == "function" and data["arguments"] > 1:
        return "its arguments x and y, which a force or joint gives it"
    if data["kind"] == "function":
        return "its argument x, time where a force or joint does not say otherwise"
    if data.get("each_body"):
        return "every body of the scene"
    if data.get("each_pair"):
        return "every two bodies of the scene"
    lists = [field["name"] for field in data["fields"] if field["kind"] in ("points", "bodies")]
    if lists:
        return f"the bodies of {', '.join(lists)}"
    if not data["bodies"]:
        return "the bodies of its joint"
    return f"{', '.join(data['bodies'])}; the last letter of a field is the body's"


def rows_text(data: dict[str, Any]) -> str:
    """The constraint equations of a joint, in words."""
    rows, freedoms, bodies = data["rows"], data["freedoms"], len(data["bodies"])
    text = f"{rows} constraint equation{'' if rows == 1 else 's'}"
    if data["position_rows"] != rows:
        text += f", {data['position_rows'] or 'none'} of them at position level"
    if freedoms is not None and bodies < 3:
        between = "between two bodies" if bodies == 2 else "of the body"
        text += f"; leaves {freedoms} of 6 freedoms {between}"
    return text + ("; see the variants" if data["variants"] else "")


def variants_table(data: dict[str, Any]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Columns and rows of the table of variants; the last row is the type itself."""
    is_joint = data["kind"] == "joint"
    columns = ("where", "rows", "leaves", "is") if is_joint else ("where", "is")
    rows = []
    for variant in data["variants"]:
        where = ", ".join(f"{n} = {_word(v)}" for n, v in variant["with"].items())
        rows.append((where, variant, variant["doc"].partition("\n\n")[0].replace("\n", " ")))
    if data["kernels"]:
        rows.append(("otherwise", data, "as above"))
    return columns, [
        (where, str(each["rows"]), str(each["freedoms"]), text) if is_joint else (where, text)
        for where, each, text in rows
    ]


def default_text(field: Mapping[str, Any]) -> str:
    """The default of a field."""
    if field["required"]:
        return "required"
    default = field["default"]
    if isinstance(default, (tuple, list)):
        return _list(default)
    if isinstance(default, float):
        return f"{default:g}"
    return "-" if default is None else _word(default)


def _word(value: Any) -> str:
    """A value of a choice as a scene file writes it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _list(values: Any) -> str:
    words = [_list(x) if isinstance(x, (tuple, list)) else f"{x:g}" for x in values]
    return f"[{', '.join(words)}]"
