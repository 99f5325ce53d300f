"""Example of a type: a complete scene, made from the fields of the type, that runs."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dap3d_core.interface.codegen.type_info import TypeInfo
    from dap3d_core.registry import Registry

#: Body of each slot; points and vectors lie on it.
OWNERS = {"i": "crank", "j": "rod", "k": "slider"}
#: Coordinates of the bodies along x.
PLACES = {"crank": 0.0, "rod": 1.0, "slider": 2.0, "ground": 0.0}
#: Common x of all points of an element, so that joints fit, and height of a disk of radius 1.
MEETING, HEIGHT = 0.5, 1.0
#: A number without a default. Of lengths it is no simple part of the distance of two bodies, which
#: would put strokes at their ends.
NUMBER = 0.6
_LISTS = {
    "vec3": "[0.0, 0.0, 1.0]",
    "matrix": "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]",
    "table": "[0.0, 1.0]",
    "rows": "[[0.0, 1.0], [1.0, 2.0]]",
}
#: Vectors along x, from body to body: axes a and those of no slot. All others are along y.
ALONG = ("a", "")


def example_of(type_info: "TypeInfo", registry: "Registry") -> str:
    """The text of a scene file with one element of a type and all that it needs.

    It has the required fields of the type, and its numbers with their defaults. Other elements that
    it needs are of the first suitable types in the registry.
    """
    scene = _Example(registry)
    type_: Any = type_info.type
    name = (
        "J1"
        if type_.kind == "joint"
        else "".join(c if c.isalnum() or c in "_-" else "_" for c in f"{type_.keyword}1")
    )
    scene.add(type_info, name)
    if type_.kind == "function" and type_.arguments == 1:
        scene.add(scene.first("joint", _is_driver), "J1", name)
    return scene.text()


def _is_driver(joint: "TypeInfo") -> bool:
    """True for a joint that a function of time moves, and that takes no lists, as cables do."""
    from dap3d_core.interface.fields import specs_of

    has_list = any(field.size for field in specs_of(joint.type).values())
    return bool(joint.layout.functions) and not has_list


def _has_friction(type_info: "TypeInfo") -> bool:
    """True for a joint with friction that needs no optional field."""
    from dap3d_core.interface.codegen.kernel_arguments import parameters

    kernel = type_info.kernels.get("friction")
    own = type_info.layout.numbers
    return kernel is not None and ("radius" in own or "radius" not in parameters(kernel))


def _is_joint_for(spec: Any, fields: Mapping[str, Any], joint: "TypeInfo") -> bool:
    """True for a joint with as many rows as a field takes, and the points and axes of its type."""
    from dap3d_core.interface.fields import specs_of

    if spec.rows is None:
        return _has_friction(joint)
    places = {name for name, other in fields.items() if other.kind in ("point", "vector")}
    own = specs_of(joint.type)
    is_sized = any(field.size for field in own.values())
    return not is_sized and joint.row_count == spec.rows and places <= own.keys()


class _Example:
    """The tables of a scene file, added as elements need them."""

    def __init__(self, registry: "Registry") -> None:
        self.registry = registry
        self.bodies: dict[str, str] = {}
        self.points: dict[str, str] = {}
        self.elements: dict[str, str] = {}

    def text(self) -> str:
        """The scene file."""
        order = [b for b in PLACES if b in self.bodies] or ["crank"]
        tables = [self.bodies.get(b) or _body(b) for b in order]
        settings = "[simulation]\nt_end = 0.2\ndt = 0.1\n"
        return "\n".join([*tables, *self.points.values(), *self.elements.values(), settings])

    def first(self, kind: str, is_suitable: Callable[["TypeInfo"], bool]) -> "TypeInfo":
        """The first suitable type of a kind, by keyword."""
        from dap3d_core.interface import PluginError
        from dap3d_core.registry import LOAD_LIMIT

        for keyword in self.registry.keywords(kind):
            try:
                type_info = self.registry.get(kind, keyword, limit_s=LOAD_LIMIT)
            except PluginError:
                continue
            if is_suitable(type_info):
                return type_info
        raise PluginError(f"an example needs a {kind} that no installed package brings")

    def add(self, type_info: "TypeInfo", name: str, motor: str = "motor") -> None:
        """Add an element of a type and all that it refers to; ``motor`` names its function."""
        from dap3d_core.interface.fields import specs_of

        type_: Any = type_info.type
        owners = dict(OWNERS)
        specs = {n: s for n, s in specs_of(type_).items() if s.given}
        for field, spec in specs.items():
            if spec.kind == "body" and not spec.required and spec.default:
                owners[field.rpartition("_")[2]] = spec.default
        kind = "contact" if type_.is_contact else type_.kind
        lines = [f"[{kind}s.{name}]", f'type = "{type_.keyword}"']
        for field, spec in specs.items():
            own = type_.example.get(field)
            for body in PLACES if own else ():
                if own.startswith(f'"{body}.'):
                    self._body_named(body)
            if spec.kind == "joint":
                self.add(self.first("joint", partial(_is_joint_for, spec, specs)), "J1")
            if own is not None and spec.kind == "function":
                self._function_named(motor, spec)
            values = self._values(field, spec, owners, motor) if own is None else [(field, own)]
            for key, value in values:
                line = f"{key} = {value}"
                remarks = (spec.unit if spec.kind == "number" else "",
                           "" if spec.required else "may be left out")  # fmt: skip
                comment = ", ".join(filter(None, remarks))
                lines.append(f"{line:22s} # {comment}" if comment else line)
        self.elements[f"{type_.kind}.{name}"] = "\n".join(lines) + "\n"

    def _function_named(self, name: str, spec: Any) -> None:
        """Add a function for a field, unless there is one of the name."""
        if f"function.{name}" not in self.elements:
            count = spec.arguments
            self.add(
                self.first("function", lambda f: getattr(f.type, "arguments", 1) == count), name
            )

    def _values(
        self, name: str, spec: Any, owners: dict[str, str], motor: str
    ) -> Iterator[tuple[str, str]]:
        """Keys and values in TOML that a scene may write for a field."""
        head, _, slot = name.rpartition("_")
        owner = owners.get(slot, "crank")
        if spec.size:
            if spec.required:
                yield name, self._list(spec)
        elif spec.kind == "vector2":
            for end in ("i", "j"):
                yield f"P_{end}", f'"{self._body_named(owners[end])}.O"'
        elif spec.kind == "point":
            yield name, f'"{self._point(name, owner)}"'
        elif spec.kind == "vector":
            body = "ground" if spec.ground else self._body_named(owner)
            yield name, f'"{body}.{"x" if head in ALONG else "y"}"'
        elif spec.kind == "body":
            yield name, f'"{self._body_named(owner)}"'
        elif spec.kind == "function":
            if spec.required or not spec.argument:  # it would replace other fields
                self._function_named(motor, spec)
                yield name, f'"{motor}"'
        elif spec.kind == "functions":
            self.add(self.first("function", lambda other: other.layout.numbers != {}), "first")
            yield name, '["first"]'
        elif spec.kind == "input" and spec.required:
            self.elements["input.command"] = "[inputs.command]\nvalue = 1.0\n"
            yield name, '"command"'
        elif spec.kind == "joint":
            yield name, '"J1"'
        elif spec.kind == "choice" and spec.required:
            yield name, _toml(spec.choices[0])
        elif spec.required:
            yield (
                name,
                _LISTS.get("rows" if spec.by_rows else spec.kind)
                or _toml(max(NUMBER, spec.minimum or NUMBER)),
            )
        elif spec.default is not None:
            yield name, _toml(spec.default)

    def _list(self, spec: Any) -> str:
        """A list of as many entries as it must have, two or more, on the first bodies."""
        names = [self._body_named(b) for b in list(OWNERS.values())[: max(spec.least, 2)]]
        ends = {"points": ".O", "vectors": ".y", "bodies": ""}
        if spec.kind in ends:
            return _toml([name + ends[spec.kind] for name in names])
        return _toml([NUMBER] * len(names))

    def _body_named(self, body: str) -> str:
        if body != "ground":
            self.bodies[body] = _body(body)
        return body

    def _point(self, name: str, owner: str) -> str:
        height = HEIGHT if owner == "ground" else 0.0
        place = _toml((MEETING - PLACES[self._body_named(owner)], 0.0, height))
        self.points[name] = f'[points.{name}]\nbody = "{owner}"\nsPp = {place}\n'
        return name


def _body(body: str) -> str:
    place = _toml((PLACES[body], 0.0, HEIGHT))
    return f"[bodies.{body}]\nmass = 1.0\nJp = [0.1, 0.1, 0.1]\nr = {place}\n"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_toml(v) for v in value)}]"
    return f'"{value}"' if isinstance(value, str) else repr(float(value))
