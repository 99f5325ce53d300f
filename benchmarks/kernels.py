"""What one call of each kernel of each registered type costs, with gathering and storing.

Each kernel stands alone in its loop here. In a run J, gamma and nu of a joint share one loop, and
what they gather: that one is in the table too. The mark is 40 ns a kernel.
"""

import random
from functools import partial

import attrs
import numpy as np
from timing import median_seconds

from dap3d_core.interface.codegen.compile_loops import write
from dap3d_core.interface.codegen.loop_source import LOOP_KINDS, stride
from dap3d_core.interface.codegen.specialise import bind_friction, bind_functions
from dap3d_core.interface.examine.random_values import random_pose, random_value
from dap3d_core.kernels.runtime import loop_support
from dap3d_core.kernels.runtime.function_lists import LoopArrays, call_loop, loop_list
from dap3d_core.kernels.runtime.loop_modules import build
from dap3d_core.registry import load_registry

#: As many instances as a cache of 256 kB holds, so that other programs cannot slow them down.
INSTANCES, CALLS, RUNS, MARK = 200, 50, 30, 40.0
#: Rows of a table, such as the pieces of a spline.
TABLE_ROWS = 20


def types(registry):
    """(title, type) of all registered types and variants that have kernels."""
    line = registry.get("function", "a")
    for row in registry.listing():
        if row.state != "ok":
            continue
        type_info = registry.get(row.kind, row.keyword)
        for conditions, e in (({}, type_info), *type_info.variants):
            words = ", ".join(f"{n} = {v}" for n, v in conditions.items())
            if any(conditions.get(n) for n in e.argument_functions):
                e = bind_functions(e, dict.fromkeys(e.argument_functions, line))
            if e.kernels:
                yield f"{row.keyword}{f' ({words})' if words else ''}", e


def single(type_info):
    """(title of the kernel, kind of loop, type with this kernel alone), and J, gamma, nu at once.

    What friction takes besides is put behind the joint's numbers.
    """
    for kind, names in LOOP_KINDS.items():
        there = [n for n in names if n in type_info.kernels]
        for name in there:
            if name == "friction":
                yield name, kind, bind_friction(type_info)
            else:
                yield name, kind, attrs.evolve(type_info, kernels={name: type_info.kernels[name]})
        if len(there) > 1:
            yield " + ".join(there), kind, type_info


def numbers(layout, rng):
    """The numbers of all instances, at random; tables stand behind them."""
    width = layout.par_width
    par = np.array([random_value((), rng) for _ in range(INSTANCES * width)])
    tables = []
    for offset, columns in layout.tables.values():
        start = len(par) + sum(t.size for t in tables)
        rows = np.cumsum([[random_value((), rng)] * columns for _ in range(TABLE_ROWS)], axis=0)
        par[offset : INSTANCES * width : width] = start
        par[offset + 1 : INSTANCES * width : width] = TABLE_ROWS
        tables.append(rows.ravel())
    for offset, shape in layout.numbers.values():
        if shape in ((3, 3), (4,)):  # rotation matrices, Euler parameters
            for q in range(INSTANCES):
                at = q * width + offset
                values = np.ravel(random_value(shape, rng))
                par[at : at + len(values)] = values
    return np.concatenate([par, *tables])


def integers(type_info):
    """A chain of bodies, one function for all, places of rows and blocks one after the other."""
    layout, n = type_info.layout, stride(type_info)
    idx = np.zeros((INSTANCES, n), dtype=np.int64)
    q = np.arange(INSTANCES)
    slots = len(layout.slots)
    for k in range(slots):
        idx[:, k] = 1 + (q + k) % INSTANCES
    idx[:, slots : slots + len(layout.functions)] = 1
    idx[:, slots + len(layout.functions) : layout.integers] = 1 + q[:, None]
    if type_info.type.kind == "joint":
        rows = type_info.type.rows
        idx[:, layout.integers] = q * rows
        for k in range(slots):
            idx[:, layout.integers + 1 + k] = (q * slots + k) * 6 * rows
    elif type_info.type.kind == "function":
        idx[:, -1] = 1
    return idx.ravel()


def bodies(rng):
    """The body array: poses, velocities and inertias at random."""
    body = np.array([[random_value((), rng) for _ in range(loop_support.BODY_WIDTH)]
                     for _ in range(INSTANCES + 1)])  # fmt: skip
    for one in body:
        pose = random_pose(rng)
        one[loop_support.A : loop_support.A + 9] = np.ravel(pose.A)
        one[loop_support.P : loop_support.P + 4] = pose.p
    return body


def run(type_info, kind, body, rng):
    """A function that calls a loop CALLS times over all instances; another, over none."""
    loop = build(write(type_info, kind))
    rows = getattr(type_info.type, "rows", 1)
    F = np.array([[random_value((), rng) for _ in range(5)] for _ in range(2)])
    size = INSTANCES * 6 * max(rows, 2) * 3
    idx, par = integers(type_info), numbers(type_info.layout, rng)
    arrays, loops = LoopArrays(body=body, F=F, idx=idx, par=par), loop_list([loop])
    outputs = (np.zeros(size), np.ones(size), np.zeros(size))

    def repeat(count):
        group = np.array([0, 0, count])
        for _ in range(CALLS):
            call_loop(loops, 0, 0.3, arrays, group, *outputs)

    return partial(repeat, INSTANCES), partial(repeat, 0)


def nanoseconds(type_info, kind, body, rng):
    """The least of many runs, for whatever else runs on the machine only adds.

    What the call itself costs from Python is taken off.
    """
    functions = run(type_info, kind, body, rng)
    runs = [median_seconds(functions, 1) for _ in range(RUNS)]
    seconds, empty = (min(column) for column in zip(*runs, strict=True))
    return (seconds - empty) / (CALLS * INSTANCES) * 1e9


def measure():
    """Rows of the table: type, kernel, nanoseconds an instance, and whether that is in the mark."""
    rng = random.Random(1)
    body, rows = bodies(rng), []
    for title, type_info in types(load_registry()):
        for name, kind, one in single(type_info):
            ns = nanoseconds(one, kind, body, rng)
            row = {"kind": type_info.type.kind, "type": title, "kernel": name, "ns": ns}
            if "+" not in name:
                row["in_mark"] = "yes" if ns <= MARK else "no"
            rows.append(row)
    return rows
