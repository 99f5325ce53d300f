"""From a type to its group loops: gather the named quantities, call the kernels, store numbers.

An instance's integers stand in ``idx`` from ``b0``: the bodies of its slots, the rows of F of its
functions, the bodies of its vectors of no slot, then for a joint the place of its first row in the
row vectors and for each slot the place of its block in D; its numbers stand in ``par`` from ``p1``.
"""

from collections.abc import Iterable, Sequence

from dap3d_core.interface.codegen.examined import Examined
from dap3d_core.interface.codegen.kernel_arguments import in_order, parameters
from dap3d_core.interface.types import Joint
from dap3d_core.kernels.runtime.loop_modules import Loop

#: What can be computed, and from which kernels; each is one loop.
LOOP_KINDS = {
    "acceleration": ("J", "gamma", "nu"),
    "position": ("C",),
    "velocity": ("C_dot",),
    "wrench": ("wrench",),
    "energy": ("energy",),
    "value": ("value",),
    "friction": ("friction",),
    "switch": ("switch",),
    "angle": (),  # the angles of the type's fields, as they stand at an accepted step
    "turned": (),  # the same angles, to be reported
    "knot": ("knot",),  # as switches; of functions of an argument (specialise.py)
}


def stride(examined: Examined) -> int:
    """Integers that an instance takes in ``idx``."""
    n = examined.layout.integers
    if examined.type.kind == "joint":
        return n + 1 + len(examined.layout.slots)
    return n + 1 if examined.type.kind == "function" else n


def write(examined: Examined, what: str) -> Loop | None:
    """The loop that computes ``what`` (a key of LOOP_KINDS); None where there is no such kernel."""
    kernels = {n: k for n, k in examined.kernels.items() if n in LOOP_KINDS[what]}
    layout = examined.layout
    wanted = [name for kernel in kernels.values() for name in parameters(kernel)]
    if what in ("angle", "turned"):
        wanted += [one for name in layout.angles for one in (name, f"{name}_dot")]
    if not kernels and not wanted:
        return None
    lines = [f"b0 = i0 + q * {stride(examined)}"]
    lines += [f"p1 = p0 + q * {layout.par_width}"]
    lines += [f"b_{s} = idx[b0 + {n}]" for n, s in enumerate(layout.slots)]
    first = len(layout.slots) + len(layout.functions)
    lines += [f"b_{name} = idx[b0 + {first + n}]" for n, name in enumerate(layout.others)]
    if examined.type.kind == "joint":
        lines.append(f"row = idx[b0 + {layout.integers}]")
    lines += [f"x_{q.name} = {q.code}" for q in in_order(examined.names, wanted) if q.code]
    if what == "angle":
        for name, at in layout.angles.items():
            lines += _remember(name, at)
    elif what == "turned":
        lines += _one_behind_the_other([f"x_{name}" for name in layout.angles])
    for name, kernel in kernels.items():
        arguments = ", ".join(f"x_{n}" for n in parameters(kernel))
        lines.append(f"out = kernel_{name}({arguments})")
        lines += _store(examined, name)
    title = f"{examined.type.keyword}{examined.given}: {', '.join(kernels) or what}"
    return Loop(title, {f"kernel_{n}": k for n, k in kernels.items()}, lines)


def _remember(name: str, at: int) -> Iterable[str]:
    """Keep an angle, its rate and the time; count in out1 where its turns are in doubt."""
    change = f"x_{name}_dot - par[p1 + {at + 1}]"
    yield f"out1[0] += doubtful({change}, t - par[p1 + {at + 2}])"
    for k, value in enumerate((f"x_{name}", f"x_{name}_dot", "t")):
        yield f"par[p1 + {at + k}] = {value}"


def _one_behind_the_other(values: Sequence[str]) -> Iterable[str]:
    """Values of all instances and groups, in their order; out2 counts the place."""
    yield "place = whole(out2[0])"
    for k, value in enumerate(values):
        yield f"out1[place + {k}] = {value}"
    yield f"out2[0] += {len(values)}.0"


def _store(examined: Examined, kernel: str) -> Iterable[str]:
    paths, layout, type_ = examined.outputs[kernel], examined.layout, examined.type
    first_block = layout.integers + 1
    if kernel == "J":
        assert issubclass(type_, Joint)
        for n in range(len(layout.slots)):
            yield f"d = idx[b0 + {first_block + n}]"
            for k in range(6 * type_.rows):
                yield f"out1[d + {k}] = {paths[6 * type_.rows * n + k]}"
    elif kernel == "C":
        assert issubclass(type_, Joint)
        for path, k in zip(paths, type_.position_rows(), strict=True):
            yield f"out1[row + {k}] = {path}"
    elif kernel == "C_dot":
        assert issubclass(type_, Joint)
        for path, k in zip(paths, type_.velocity_rows(), strict=True):
            yield f"out1[row + {k}] = {path}"
    elif kernel in ("gamma", "nu"):
        for k, path in enumerate(paths):
            yield f"{'out2' if kernel == 'gamma' else 'out3'}[row + {k}] = {path}"
    elif kernel in ("wrench", "friction"):
        for n, s in enumerate(layout.slots):
            yield f"d = 6 * b_{s}"
            for k in range(6):
                yield f"out1[d + {k}] += {paths[6 * n + k]}"
    elif kernel == "energy":
        yield f"out1[0] += {paths[0]}"
    elif kernel in ("switch", "knot"):
        yield from _one_behind_the_other(paths)
    else:
        yield "row = idx[b0]"
        for k, path in enumerate(paths):
            yield f"F[row, {k}] = {path}"
