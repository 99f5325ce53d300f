"""Source of the group loops of a type: compute quantities, call the kernels, store numbers.

The integers of an instance are in ``idx`` from ``b0``: the bodies of its slots, the rows of F of
its functions, the bodies of its vectors of no slot, the index of its first state where it has
states of its own, then for a joint the index of its first row in the row vectors and for each slot
that of its block in D, of its friction then the first row of the joint, of what resists rolling
that of its contact and the first state of the share of that, and for a force those of the joints
whose reactions it reads; its numbers are in ``par`` from ``p1``.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from dap3d_core.interface.codegen.kernel_arguments import KernelArgument, in_order, parameters
from dap3d_core.interface.codegen.reactions import integers_of_joints, reaction_lines
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.element_states import state_shape
from dap3d_core.interface.types import Joint

#: Kinds of loops, with the kernels that each calls.
LOOP_KINDS = {
    "acceleration": ("J", "gamma", "nu"),
    "position": ("C",),
    "velocity": ("C_dot",),
    "gradient": ("G",),
    "wrench": ("wrench",),
    "energy": ("energy",),
    "value": ("value",),
    "friction": ("friction",),
    "switch": ("switch",),
    "impulse": ("J", "impulse"),
    "angle": (),  # the angles of the type's fields, at the end of a step
    "turned": (),  # the same angles, for reports
    "rate": ("rate",),
    "bound": (),  # as switches; of unknowns
    "reset": ("reset",),
    "tension": ("tension",),  # of results (result/post/force_output.py)
    "knot": ("knot",),  # as switches; of functions of an argument (specialise.py)
}

#: The loops, and further names of their kernels.
JUMP_KINDS = ("impulse", "reset")
JUMP_NAMES = ("Jv", "crossing")


def stride(type_info: TypeInfo) -> int:
    """Number of integers of an instance in ``idx``."""
    n = type_info.layout.integers
    if type_info.type.kind == "joint":
        type_: Any = type_info.type
        of_load = (bool(type_.load) + bool(type_.resists)) if type_.is_contact else 0
        return n + 1 + len(type_info.layout.slots) + of_load
    if type_info.type.kind == "function":
        return n + 1
    return n + integers_of_joints(type_info)


def kernels_of(kind: str, what: str) -> tuple[str, ...]:
    """The kernels that a loop (a key of LOOP_KINDS) of a type calls; kind: of the type."""
    has_rows = (kind == "force") == (what == "impulse")  # those of a force are for its jumps
    return tuple(name for name in LOOP_KINDS[what] if has_rows or name != "J")


def computes_rate(type_info: TypeInfo) -> bool:
    """True if the loop of ``wrench`` computes the rates of states as well, of the same quantities.

    Those of joints have a loop of their own, called when the multipliers are known.
    """
    return type_info.type.kind == "force" and {"wrench", "rate"} <= type_info.kernels.keys()


def gathering_lines(
    type_info: TypeInfo, wanted: Sequence[str], *, reactions: bool = False
) -> Iterable[str]:
    """Places of an instance, and the quantities that its kernels name."""
    layout = type_info.layout
    instance, numbers = f"i0 + q * {stride(type_info)}", f"p0 + q * {layout.par_width}"
    if reactions:
        yield from reaction_lines(type_info, wanted, instance, numbers)
    yield from (f"b0 = {instance}", f"p1 = {numbers}")
    yield from (f"b_{s} = idx[b0 + {n}]" for n, s in enumerate(layout.slots))
    first = len(layout.slots) + len(layout.functions)
    yield from (f"b_{name} = idx[b0 + {first + n}]" for n, name in enumerate(layout.others))
    if layout.states:
        yield f"z0 = idx[b0 + {layout.integers - 1}]"
        yield "states, rates = arrays.states, arrays.rates"
    if type_info.type.kind == "joint":
        yield f"row = idx[b0 + {layout.integers}]"
    yield from (f"x_{q.name} = {q.code}" for q in in_order(type_info.names, wanted) if q.code)


def called_with(type_info: TypeInfo, kernel: str) -> str:
    """The call of a kernel with the quantities that it names."""
    return f"kernel_{kernel}({', '.join(f'x_{n}' for n in parameters(type_info.kernels[kernel]))})"


def store_angle(name: str, offset: int) -> Iterable[str]:
    """Store an angle, its rate and the time; count in out1 where its turns are in doubt."""
    angle, before, time = (f"par[p1 + {offset + k}]" for k in range(3))
    step = f"x_{name} - {angle}, {before}, x_{name}_dot, t - {time}"
    yield f"out1[0] += doubtful({step}, out2[0])"
    yield from keep(offset, f"x_{name}", f"x_{name}_dot")


def keep(offset: int, value: str, rate: str) -> Iterable[str]:
    """Store a value, its rate and the time of an instance where a step is accepted."""
    for k, number in enumerate((value, rate, "t")):
        yield kept(f"par[p1 + {offset + k}]", number)


def kept(place: str, value: str) -> str:
    """Store a value where a step is accepted, and not only judged: out2[0] > 0."""
    return f"{place} = where(out2[0] > 0.0, {value}, {place})"


def append(values: Sequence[str]) -> Iterable[str]:
    """Append values to those of other instances and groups; out2 is their number."""
    yield "place = whole(out2[0])"
    for k, value in enumerate(values):
        yield f"out1[place + {k}] = {value}"
    yield f"out2[0] += {len(values)}.0"


def store(type_info: TypeInfo, kernel: str) -> Iterable[str]:
    """Store the numbers that a kernel returned."""
    paths, layout, type_ = type_info.outputs[kernel], type_info.layout, type_info.type
    if kernel == "energy":
        yield f"out1[0] += {paths[0]}"
    elif kernel == "value":
        yield "row = idx[b0]"
        yield from (f"F[row, {k}] = {path}" for k, path in enumerate(paths[:4]))
        # of two arguments, for tests alone: behind y
        yield from (f"F[row + 1, {k}] = {path}" for k, path in enumerate(paths[4:], 1))
    elif kernel in ("switch", "knot", "tension"):
        yield from append(paths)
    elif kernel == "G":
        yield from (f"out1[{k}] = {path}" for k, path in enumerate(paths))
    elif kernel == "rate":
        yield from (f"rates[z0 + {k}] = {path}" for k, path in enumerate(paths))
    elif kernel in ("wrench", "friction"):
        for n, s in enumerate(layout.slots):
            yield f"d = 6 * b_{s}"
            yield from (f"out1[d + {k}] += {paths[6 * n + k]}" for k in range(6))
    elif issubclass(type_, Joint) and kernel == "J":
        size = 6 * type_.rows
        for n in range(len(layout.slots)):
            yield f"d = idx[b0 + {layout.integers + 1 + n}]"
            yield from (f"out1[d + {k}] = {paths[size * n + k]}" for k in range(size))
    elif issubclass(type_, Joint):
        every = range(type_.rows)
        array, rows = {
            "C": ("out1", type_.position_rows()),
            "C_dot": ("out1", type_.velocity_rows()),
            "gamma": ("out2", every),
            "nu": ("out3", every),
        }[kernel]
        for path, k in zip(paths, rows, strict=True):
            yield f"{array}[row + {k}] = {path}"


def jump_names(
    kind: str, kernel: str, outputs: Mapping[str, Sequence[str]], slots: int
) -> dict[str, KernelArgument]:
    """Further names of a kernel of jumps, of a type with these kernels.

    kind: of the type; ``impulse`` of forces with rows of their own has Jv.
    """
    rows = row_count(outputs, slots) if (kind, kernel) == ("force", "impulse") else 0
    switches = len(outputs.get("switch", ()))
    doc = "1 or -1 where a switch has just changed its sign to that side, else 0"
    names = {"crossing": KernelArgument("crossing", state_shape(switches), True, "", doc=doc)}
    if rows:
        doc = "J v of each row before the jump"
        names["Jv"] = KernelArgument("Jv", state_shape(rows), True, "", doc=doc)
    return names


def row_count(outputs: Mapping[str, Sequence[str]], slots: int) -> int:
    """Number of rows of ``J`` of a force, given the numbers that its kernels return."""
    return len(outputs["J"]) // (6 * slots) if "J" in outputs else 0


def jump_lines(type_info: TypeInfo, what: str, *, has_rows: bool) -> Sequence[str]:
    """Lines of a loop for an instance, its quantities being known."""
    switches = len(type_info.outputs["switch"])
    lines = ["seen = whole(out2[1])"]
    lines.append(f"x_crossing = {_tuple([f'out3[seen + {k}]' for k in range(switches)])}")
    if what == "impulse":
        lines += _impulse_lines(type_info, has_rows=has_rows)
    else:
        lines.append(f"out = {called_with(type_info, 'reset')}")
        states = type_info.outputs["reset"]
        lines += [f"out1[z0 + {k}] = {path}" for k, path in enumerate(states)]
    return [*lines, f"out2[1] += {switches}.0"]


def _impulse_lines(type_info: TypeInfo, *, has_rows: bool) -> Sequence[str]:
    outputs, slots = type_info.outputs, type_info.layout.slots
    impulses, lines = outputs["impulse"], ["place = whole(out2[0])"]
    entries: Sequence[str] = ()
    if has_rows:
        entries = outputs["J"]
        rows = row_count(outputs, len(slots))
        lines.append(f"out = {called_with(type_info, 'J')}")
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
    lines.append(f"out = {called_with(type_info, 'impulse')}")
    lines += [f"out1[place + {k}] = {path}" for k, path in enumerate(impulses)]
    return [*lines, f"out2[0] += {len(impulses) + len(entries)}.0"]


def _tuple(values: Sequence[str]) -> str:
    return values[0] if len(values) == 1 else f"({', '.join(values)})"
