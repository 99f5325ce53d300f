"""A piece of a scene file that uses a type, made from its fields."""

from typing import Any

#: Body of each slot in the examples; points and vectors lie on it.
OWNERS = {"i": "crank", "j": "rod", "k": "slider"}
_NUMBERS = {
    "vec3": "[0.0, 0.0, 1.0]",
    "matrix": "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]",
    "table": "[0.0, 1.0]",
    "number": "1.0",
}


def example_of(type_: Any) -> str:
    """A table of a scene file for a type: what it requires, and its numbers with their defaults."""
    from dap3d_core.interface.fields import specs_of

    kind = type_.kind
    specs = specs_of(type_)
    owners = dict(OWNERS)
    for name, spec in specs.items():
        if spec.kind == "body" and not spec.required and spec.default:
            owners[name.rpartition("_")[2]] = spec.default
    lines = [f"[{kind}s.{_name(type_)}]", f'type = "{type_.keyword}"']
    for name, spec in specs.items():
        for field, value in _values(name, spec, owners):
            line = f"{field} = {value}"
            about = ", ".join(
                w for w in (spec.unit, "" if spec.required else "may be left out") if w
            )
            lines.append(f"{line:22s} # {about}" if about else line)
    return "\n".join(lines) + "\n"


def _name(type_: Any) -> str:
    """A name for the element: J1 for a joint, else the keyword made into one."""
    if type_.kind == "joint":
        return "J1"
    words = "".join(c if c.isalnum() or c in "_-" else "_" for c in type_.keyword)
    return f"{words}1"


def _values(name: str, spec: Any, owners: dict[str, str]) -> list[tuple[str, str]]:
    """What the scene may write for a field: names and values in TOML."""
    owner = owners.get(name.rpartition("_")[2], "crank")
    kind = spec.kind
    if kind == "vector2":
        return [("P_i", '"crank.O"'), ("P_j", '"rod.O"')]
    if kind == "point":
        return [(name, f'"{owner}.O"')]
    if kind == "vector":
        return [(name, f'"{owner}.x"')]
    if kind == "body":
        return [(name, f'"{owner}"')]
    if kind == "choice":
        return [(name, f'"{spec.choices[0] if spec.required else spec.default}"')]
    if kind == "function":
        return [(name, '"motor"')]
    if kind == "joint":
        return [(name, '"J1"')]
    default = spec.default
    if spec.required or default is None:
        return [(name, _NUMBERS[kind])] if spec.required else []
    return [(name, _toml(default))]


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_toml(v) for v in value)}]"
    return f'"{value}"' if isinstance(value, str) else repr(float(value))
