"""Names of functions and inputs in place of numbers, and what functions take."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.fields import FieldSpec, specs_of
from dap3d_core.scene.validate.coerce_values import Fault
from dap3d_core.scene.validate.geometry import missing_words
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.validated_scene import Instance


def named_row(
    report: Collector,
    spec: FieldSpec,
    text: str,
    rows: Mapping[str, Mapping[str, int]],
    read: Callable[[Any], Any],
) -> int | Fault | None:
    """The row of F that a text in place of a number names; None where it is a number, "1500 rpm".

    Args:
        report: knows names that are near.
        spec: of the field.
        text: as written.
        rows: function, input -> rows of F by name.
        read: reads a number.
    """
    found = [kind for kind in rows if text in rows[kind]]
    if len(found) > 1:
        return Fault("is a function and an input; rename one of them")
    if found and found[0] in spec.by_name:
        return rows[found[0]][text]
    if found:
        remedy = f"give a number or a {spec.by_name[0]}"
        return Fault(f"is an {found[0]}, which steps from value to value", remedy)
    if not isinstance(read(text), Fault):
        return None
    known = [name for kind in spec.by_name for name in rows[kind]]
    words, near, _ = missing_words(report, " or ".join(spec.by_name), text, known)
    return Fault(f"should be a number or a name; {words}", "", near)


def counted(count: int) -> str:
    """A number of arguments, in words."""
    return "one argument" if count == 1 else "two arguments"


def arguments_of(functions: Iterable[Instance]) -> dict[str, int]:
    """How many arguments each function takes."""
    return {f.name: f.type_info.type.arguments for f in functions}  # type: ignore[attr-defined]


def combines(type_info: TypeInfo) -> bool:
    """True if a type of function combines other functions."""
    return any(spec.kind == "functions" for spec in specs_of(type_info.type).values())
