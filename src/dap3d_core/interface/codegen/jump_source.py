"""Group loops of jumps: impulses that elements ask for, with rows and rates; states after them.

An instance of the loop "impulse" appends, behind those of other instances and groups: the numbers
that ``impulse`` returns, then the rows of ``J`` by body slots. out1 takes them; out2 counts numbers
and switches. Of the loop "reset" out1 takes the new states at their places. out3 has, for each
switch of the elements of a loop, +1 or -1 where it has just changed its sign to that side, else 0.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from dap3d_core.interface.codegen.kernel_arguments import KernelArgument, parameters
from dap3d_core.interface.codegen.type_info import TypeInfo

#: The loops, and further names of their kernels.
JUMP_KINDS = ("impulse", "reset")
JUMP_NAMES = ("Jv", "crossing")


def jump_names(
    kind: str, kernel: str, outputs: Mapping[str, Sequence[str]], slots: int
) -> dict[str, KernelArgument]:
    """Further names of a kernel of jumps, of a type with these kernels.

    kind: of the type; ``impulse`` of forces with rows of their own has Jv.
    """
    rows = row_count(outputs, slots) if (kind, kernel) == ("force", "impulse") else 0
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


def jump_lines(
    type_info: TypeInfo, what: str, kernels: Mapping[str, Callable[..., Any]]
) -> Sequence[str]:
    """Lines of a loop for an instance, its quantities being known."""
    switches = len(type_info.outputs["switch"])
    lines = ["seen = whole(out2[1])"]
    lines.append(f"x_crossing = {_tuple([f'out3[seen + {k}]' for k in range(switches)])}")
    if what == "impulse":
        lines += _impulse_lines(type_info, kernels)
    else:
        lines.append(_call("reset", kernels["reset"]))
        states = type_info.outputs["reset"]
        lines += [f"out1[z0 + {k}] = {path}" for k, path in enumerate(states)]
    return [*lines, f"out2[1] += {switches}.0"]


def _impulse_lines(type_info: TypeInfo, kernels: Mapping[str, Callable[..., Any]]) -> Sequence[str]:
    outputs, slots = type_info.outputs, type_info.layout.slots
    impulses, lines = outputs["impulse"], ["place = whole(out2[0])"]
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
    return [*lines, f"out2[0] += {len(impulses) + len(entries)}.0"]


def _call(name: str, kernel: Callable[..., Any]) -> str:
    arguments = ", ".join(f"x_{n}" for n in parameters(kernel))
    return f"out = kernel_{name}({arguments})"


def _tuple(values: Sequence[str]) -> str:
    return values[0] if len(values) == 1 else f"({', '.join(values)})"
