"""Group loop of jumps: rows of an element, their rates before, and the impulses it asks for.

An instance appends, behind those of other instances and groups: the numbers that ``impulse``
returns, then the rows of ``J`` by body slots. out1 takes them; out2 counts numbers and switches;
out3 has, for each switch, +1 or -1 where it has just changed its sign to that side, else 0.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from dap3d_core.interface.codegen.kernel_arguments import KernelArgument, parameters
from dap3d_core.interface.codegen.type_info import TypeInfo

#: Further names of the kernel ``impulse``.
IMPULSE_NAMES = ("Jv", "crossing")


def impulse_names(
    kind: str, outputs: Mapping[str, Sequence[str]], slots: int
) -> dict[str, KernelArgument]:
    """Further names of the kernel ``impulse`` of a type with these kernels.

    kind: of the type; forces with rows of their own have Jv.
    """
    rows = row_count(outputs, slots) if kind == "force" else 0
    switches = len(outputs.get("switch", ()))
    doc = "1 or -1 where a switch has just changed its sign to that side, else 0"
    names = {"crossing": KernelArgument("crossing", _shape(switches), True, "", doc=doc)}
    if rows:
        doc = "J v of each row before the jump"
        names["Jv"] = KernelArgument("Jv", _shape(rows), True, "", doc=doc)
    return names


def row_count(outputs: Mapping[str, Sequence[str]], slots: int) -> int:
    """Number of rows of ``J`` of a force, given the numbers that its kernels return."""
    return len(outputs["J"]) // (6 * slots) if "J" in outputs else 0


def _shape(count: int) -> tuple[int, ...]:
    return () if count == 1 else (count,)


def impulse_lines(type_info: TypeInfo, kernels: Mapping[str, Callable[..., Any]]) -> Sequence[str]:
    """Lines of the loop for an instance, its quantities being known."""
    outputs, slots = type_info.outputs, type_info.layout.slots
    impulses, switches = outputs["impulse"], len(outputs["switch"])
    lines = ["place = whole(out2[0])", "seen = whole(out2[1])"]
    lines.append(f"x_crossing = {_tuple([f'out3[seen + {k}]' for k in range(switches)])}")
    entries: Sequence[str] = ()
    if "J" in kernels:
        entries = outputs["J"]
        rows = row_count(outputs, len(slots))
        lines.append(_call("J", kernels["J"]))
        first = len(impulses)
        lines += [f"out1[place + {first + k}] = {path}" for k, path in enumerate(entries)]
        rates = []
        velocity = [f"{part} + {k}" for part in "VW" for k in range(3)]
        for row in range(rows):
            terms = [
                f"{entries[6 * (rows * n + row) + c]} * body[b_{s}, {velocity[c]}]"
                for n, s in enumerate(slots)
                for c in range(6)
            ]
            rates.append(" + ".join(terms))
        lines.append(f"x_Jv = {_tuple(rates)}")
    lines.append(_call("impulse", kernels["impulse"]))
    lines += [f"out1[place + {k}] = {path}" for k, path in enumerate(impulses)]
    lines += [f"out2[0] += {len(impulses) + len(entries)}.0", f"out2[1] += {switches}.0"]
    return lines


def _call(name: str, kernel: Callable[..., Any]) -> str:
    arguments = ", ".join(f"x_{n}" for n in parameters(kernel))
    return f"out = kernel_{name}({arguments})"


def _tuple(values: Sequence[str]) -> str:
    return values[0] if len(values) == 1 else f"({', '.join(values)})"
