"""A short scene that uses a type, complete: made from the type's fields, it runs as it stands."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dap3d_core.interface.codegen.examined import Examined
    from dap3d_core.registry import Registry

#: Body of each slot, a metre apart along x; points and vectors lie on it.
OWNERS = {"i": "crank", "j": "rod", "k": "slider"}
PLACES = {"crank": 0.0, "rod": 1.0, "slider": 2.0, "ground": 0.0}
#: All points of an element are in one place: joints fit together. The height is a unit disk's.
MEETING, HEIGHT = 0.5, 1.0
_LISTS = {
    "vec3": "[0.0, 0.0, 1.0]",
    "matrix": "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]",
    "table": "[0.0, 1.0]",
}
#: Axes a and vectors of no slot point along x, from body to body; all others across.
ALONG = ("a", "")


def example_of(examined: "Examined", registry: "Registry") -> str:
    """A scene, as the text of a file, with one element of a type and all that it needs.

    It gives what the type requires, and its numbers with their defaults. Functions of time, the
    element that a function drives and the joint that a force acts through are of the first types
    in the registry that can be that.
    """
    scene = _Example(registry)
    type_: Any = examined.type
    name = "J1" if type_.kind == "joint" else f"{_word(type_.keyword)}1"
    scene.element(examined, name)
    if type_.kind == "function":
        scene.element(scene.first("joint", _is_driven), "J1", motor=name)
    return scene.text()


def _is_driven(examined: "Examined") -> bool:
    return bool(examined.layout.functions)


def _rubs(examined: "Examined") -> bool:
    """Whether a joint has a friction that needs nothing a scene might leave out."""
    from dap3d_core.interface.codegen.kernel_arguments import parameters

    kernel = examined.kernels.get("friction")
    own = examined.layout.numbers
    return kernel is not None and ("radius" in own or "radius" not in parameters(kernel))


class _Example:
    """The tables of a scene file, as they are found to be needed."""

    def __init__(self, registry: "Registry") -> None:
        self.registry = registry
        self.bodies: dict[str, str] = {}
        self.points: dict[str, str] = {}
        self.elements: dict[str, str] = {}

    def text(self) -> str:
        """The file."""
        order = [b for b in PLACES if b in self.bodies] or ["crank"]
        tables = [self.bodies.get(b) or self._body(b) for b in order]
        settings = "[simulation]\nt_end = 0.2\ndt = 0.1\n"
        return "\n".join([*tables, *self.points.values(), *self.elements.values(), settings])

    def first(self, kind: str, is_good: Callable[["Examined"], bool]) -> "Examined":
        """The first usable type of a kind, by keyword, that is good for something."""
        from dap3d_core.interface.errors import PluginError
        from dap3d_core.registry import LOAD_LIMIT

        for keyword in self.registry.keywords(kind):
            try:
                examined = self.registry.get(kind, keyword, limit_s=LOAD_LIMIT)
            except PluginError:
                continue
            if is_good(examined):
                return examined
        raise PluginError(f"an example needs a {kind} that no installed package brings")

    def element(self, examined: "Examined", name: str, motor: str = "motor") -> None:
        """Write the table of an element, and of all it refers to."""
        from dap3d_core.interface.fields import specs_of

        type_: Any = examined.type
        owners = dict(OWNERS)
        specs = {n: s for n, s in specs_of(type_).items() if s.given}
        for field, spec in specs.items():
            if spec.kind == "body" and not spec.required and spec.default:
                owners[field.rpartition("_")[2]] = spec.default
        lines = [f"[{type_.kind}s.{name}]", f'type = "{type_.keyword}"']
        for field, spec in specs.items():
            for key, value in self._values(field, spec, owners, motor):
                line, about = f"{key} = {value}", [spec.unit] if spec.kind == "number" else []
                about += [] if spec.required else ["may be left out"]
                lines.append(f"{line:22s} # {', '.join(w for w in about if w)}" if any(about)
                             else line)  # fmt: skip
        self.elements[f"{type_.kind}.{name}"] = "\n".join(lines) + "\n"

    def _values(
        self, name: str, spec: Any, owners: dict[str, str], motor: str
    ) -> Iterator[tuple[str, str]]:
        """What the scene may write for a field: keys and values in TOML."""
        head, _, slot = name.rpartition("_")
        owner = owners.get(slot, "crank")
        if spec.kind == "vector2":
            for end in ("i", "j"):
                yield f"P_{end}", f'"{self._on(owners[end])}.O"'
        elif spec.kind == "point":
            yield name, f'"{self._point(name, owner)}"'
        elif spec.kind == "vector":
            body = "ground" if spec.ground else self._on(owner)
            yield name, f'"{body}.{"x" if head in ALONG else "y"}"'
        elif spec.kind == "body":
            yield name, f'"{self._on(owner)}"'
        elif spec.kind == "function":
            if spec.required or not spec.argument:  # it would take the place of other fields
                yield name, f'"{self._motor(motor)}"'
        elif spec.kind == "joint":
            self.element(self.first("joint", _rubs), "J1")
            yield name, '"J1"'
        elif spec.kind == "choice" and spec.required:
            yield name, _toml(spec.choices[0])
        elif spec.required:
            yield name, _LISTS.get(spec.kind) or _toml(max(0.5, spec.minimum or 0.5))
        elif spec.default is not None:
            yield name, _toml(spec.default)

    def _on(self, body: str) -> str:
        if body != "ground":
            self.bodies[body] = self._body(body)
        return body

    def _body(self, body: str) -> str:
        place = _toml((PLACES[body], 0.0, HEIGHT))
        return f"[bodies.{body}]\nmass = 1.0\nJp = [0.1, 0.1, 0.1]\nr = {place}\n"

    def _point(self, name: str, owner: str) -> str:
        height = HEIGHT if owner == "ground" else 0.0
        place = _toml((MEETING - PLACES[self._on(owner)], 0.0, height))
        self.points[name] = f'[points.{name}]\nbody = "{owner}"\nsPp = {place}\n'
        return name

    def _motor(self, name: str) -> str:
        if f"function.{name}" not in self.elements:
            self.element(self.first("function", lambda _: True), name)
        return name


def _word(keyword: str) -> str:
    """A keyword as the name of an element."""
    return "".join(c if c.isalnum() or c in "_-" else "_" for c in keyword)


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_toml(v) for v in value)}]"
    return f'"{value}"' if isinstance(value, str) else repr(float(value))
