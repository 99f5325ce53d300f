"""Reference of what authors of types import: classes, fields, hooks, functions of kernels."""

from collections.abc import Iterator

from dap3d_core import interface, kernels
from dap3d_core.interface import hooks
from dap3d_core.interface.fields import FieldSpec
from dap3d_site.markdown import code, directive, page, table

#: Makers of fields, in the order in which one meets them.
MAKERS = ("body", "point", "vector", "vector2", "number", "numbers", "vec3", "matrix", "function",
          "functions", "input_", "angle", "table", "square", "choice", "joint", "joint_fields",
          "points", "vectors", "bodies")  # fmt: skip
#: Annotations of fields: the class of what a scene names there is not seen by the author.
ANNOTATIONS = ("Body", "Point", "Vector", "Vector2")
CLASSES = ("Joint", "Force", "Function", "Contact")
#: Functions of kernels by subject.
WORDS = {
    "Vectors": ("add", "sub", "neg", "scale", "dot", "cross", "norm2", "rotate"),
    "Matrices and rows": ("skew", "eye", "row", "hstack", "matmul", "transpose"),
    "Rotations": (
        "rotation_vector",
        "rotation_matrix",
        "euler_parameters",
        "quaternion_product",
        "conjugate",
    ),
    "Mathematics": (
        "sqrt",
        "sin",
        "cos",
        "tan",
        "asin",
        "acos",
        "atan",
        "atan2",
        "sinh",
        "cosh",
        "tanh",
        "exp",
        "log",
        "hypot",
    ),
    "Parts of numbers": ("abs", "sign", "floor", "mod", "minimum", "maximum"),
    "Branches, tables, lists": ("where", "lookup", "item", "root", "by_body"),
    "Cables over points, drums and pulleys": (
        "cable_spans",
        "cable_length",
        "cable_rate",
        "cable_pulls",
        "cable_bending",
        "wrapped",
    ),
    "For `prepare`": ("normals",),
}


def pages() -> Iterator[tuple[str, str]]:
    """The pages of the interface of types: (path, text)."""
    yield "reference/interface.md", page("Joint, Force, Function, Contact", *_classes())
    yield "reference/fields.md", page("Fields and names", *_fields())
    yield "reference/hooks.md", page("Hooks and entry points", *_hooks())
    yield "reference/kernel-words.md", page("Functions of kernels", *_words())


def _classes() -> Iterator[str]:
    yield (
        "A type is a class derived from one of these, with fields and kernels. All names here are "
        "imported from `dap3d_core.interface`; a module of types says `interface_version = "
        f"{interface.INTERFACE_VERSION}` (`INTERFACE_VERSION`)."
    )
    for name in CLASSES:
        kernel_names = ", ".join(code(kernel) for kernel in getattr(interface, name).kernel_names)
        yield f"## {name}"
        yield f"Kernels: {kernel_names}."
        more = {"Joint": "position_rows, velocity_rows, prepare", "Function": "prepare, breaks"}
        members = more.get(name, "prepare")
        yield directive("autoclass", f"dap3d_core.interface.{name}", f":members: {members}")
    yield "## What is refused"
    yield directive("autofunction", "dap3d_core.interface.examine")
    yield directive("autoexception", "dap3d_core.interface.PluginError", ":no-index:")


def _fields() -> Iterator[str]:
    yield (
        'A field is one line of a type\'s class, `P_i: Point = point(doc="...")`. Its maker says '
        "what the scene writes there, the last letter of its name whose it is, and both which "
        "names the kernels may use. A field without a default is required; where a maker has a "
        "default of its own, `REQUIRED` in its place says so."
    )
    annotations = ", ".join(code(name) for name in ANNOTATIONS)
    yield f"Annotations are {annotations} for names of parts of a scene, else plain types."
    yield "[Names in kernels](names.md) lists by field which names kernels may use."
    yield "## Makers"
    for name in MAKERS:
        yield f"### {name}"
        yield directive("autofunction", f"dap3d_core.interface.{name}")
    yield "## What a field knows"
    yield directive("autoclass", "dap3d_core.interface.fields.FieldSpec", ":no-index:")
    assert FieldSpec.__doc__


def _hooks() -> Iterator[str]:
    yield (
        "A package makes its types known by an entry point, whose name is the keyword and whose "
        "value is the module; the module answers one hook with its classes. `hookimpl` marks the "
        "answer. Nothing is loaded before a scene names the keyword."
    )
    rows = [(kind, code(group), code(hook)) for kind, (group, hook) in hooks.GROUPS.items()]
    yield table(("kind", "entry-point group", "hook"), rows)
    for _, hook in hooks.GROUPS.values():
        yield f"## {hook}"
        yield directive("autofunction", f"dap3d_core.interface.hooks.{hook}")
    yield "## Formats, integrators, shapes"
    yield (
        "Importers and exporters of files of models have entry points of their own "
        "([how](../how-to/formats-of-your-own.md)); `hookimpl`, and all else that they "
        "need, is in `dap3d_core.interface.formats`. Integrators and shapes: "
        "`dap3d_core.interface.integrators` and `dap3d_core.interface.shapes`."
    )
    rows = [(kind, code(group), code(hook)) for kind, (group, hook) in hooks.EXTENSIONS.items()]
    yield table(("kind", "entry-point group", "hook"), rows)
    yield "## hookimpl"
    yield (
        "`@hookimpl` before a function of the name of a hook, without arguments. "
        "A module may answer several hooks. A file `plugin.py` in the folder of a model answers "
        "in the same way; it is loaded with `--allow-code` alone."
    )


def _words() -> Iterator[str]:
    yield (
        "Kernels take and return numbers and tuples, and are written with these words alone, "
        "imported from `dap3d_core.kernels`: then the same lines run compiled, in plain Python, "
        "with complex numbers and with symbols."
    )
    rows = [
        (subject, code(name), (getattr(kernels, name).__doc__ or "").partition("\n")[0])
        for subject, names in WORDS.items()
        for name in names
    ]
    yield table(("subject", "word", "what it is"), rows)
    for subject, names in WORDS.items():
        yield f"## {subject}"
        for name in names:
            assert name in kernels.__all__, name
            yield directive("autofunction", f"dap3d_core.kernels.{name}")
