"""Lines of group loops of joints that have unknowns of their own (kernels/eliminate_unknowns.py).

An unknown is kept like an angle whose turns are counted: its value, rate and time at the last
accepted step, from which it is predicted. Behind them is the sign of its column of R, which is
chosen at the start, so that multipliers mean the same from then on. The rows of the position level,
less as many as there are unknowns, come before those of the velocity level.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import attrs

from dap3d_core.interface.codegen import loop_source
from dap3d_core.interface.codegen.instance_layout import ANGLE_WIDTH
from dap3d_core.interface.codegen.kernel_arguments import parameters
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.element_states import GREATEST, LEAST
from dap3d_core.interface.types import Joint
from dap3d_core.kernels.eliminate_unknowns import eliminate, least_change, settled, solved
from dap3d_core.kernels.runtime.loop_modules import Loop

#: What the lines call.
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "eliminate": eliminate, "least_change": least_change, "settled": settled, "solved": solved
}  # fmt: skip


def write_with_unknowns(
    type_info: TypeInfo, what: str, kernels: Mapping[str, Callable[..., Any]], wanted: list[str]
) -> Loop | None:
    """As ``loop_source.write``, of a joint with unknowns.

    wanted: the names that the kernels need.
    """
    layout, unknowns = type_info.layout, type_info.layout.unknowns
    bounds = bound_values(type_info) if what == "bound" else []
    if what == "bound" and not bounds:
        return None
    rates = any(f"{name}_dot" in wanted for name in unknowns) or what == "angle"
    finding = [n for n in ("C", "G", *(("J", "nu") if rates else ())) if n in type_info.kernels]
    wanted = wanted + [n for kernel in finding for n in parameters(type_info.kernels[kernel])]
    lines = list(loop_source.gathering_lines(type_info, wanted))
    lines += solving_lines(type_info, what, rates)
    if what == "acceleration":
        lines += store_acceleration(type_info)
    elif what == "position":
        lines += store_position(type_info)
    elif what == "angle":
        for name, at in layout.angles.items():
            is_unknown = name in unknowns
            found = loop_source.keep(at, kept_value(type_info, name), f"x_{name}_dot")
            lines += found if is_unknown else loop_source.store_angle(name, at)
        lines.append("_, _, signs = eliminate(G, (), signs)")
        lines += [loop_source.kept(f"par[p1 + {layout.angles[name] + ANGLE_WIDTH}]", f"signs[{k}]")
                  for k, name in enumerate(unknowns)]  # fmt: skip
    elif what == "turned":
        lines += loop_source.append([kept_value(type_info, name) for name in layout.angles])
    elif what == "bound":
        lines += loop_source.append(bounds)
    else:
        for name in kernels:
            lines.append(f"out = {loop_source.called_with(type_info, name)}")
            lines += loop_source.store(type_info, name)
    title = f"{type_info.type.keyword}{type_info.given}: {', '.join(kernels) or what}"
    called = {f"kernel_{n}": type_info.kernels[n] for n in (*kernels, *finding)}
    return Loop(title, called | FUNCTIONS, lines)


def solving_lines(type_info: TypeInfo, what: str, rates: bool) -> Iterator[str]:
    """The unknowns, and their rates where they are wanted."""
    unknowns, layout = type_info.layout.unknowns, type_info.layout
    names = "".join(f"x_{name}, " for name in unknowns)
    for name in unknowns:
        at = layout.angles[name]
        ahead = f"par[p1 + {at + 1}] * (t - par[p1 + {at + 2}])"
        yield f"x_{name} = par[p1 + {at}] + {ahead}"
    count = len(_joint(type_info).position_rows())
    for kernel, shape in (("C", None), ("G", len(unknowns))):
        paths = type_info.outputs[kernel]
        text = _tuple(paths) if shape is None else _rows(paths, count, shape)
        call = loop_source.called_with(type_info, kernel)
        yield f"{kernel}_of = lambda {names[:-2]}: (lambda out: {text})({call})"
    yield f"{names}= solved(({names}), C_of, G_of)"
    if what not in ("angle", "turned"):  # a start may be found from far by several calls
        yield f"{names}= settled(({names}), C_of, G_of)"
    yield f"G = G_of({names})"
    places = [f"par[p1 + {layout.angles[name] + ANGLE_WIDTH}]" for name in unknowns]
    yield f"signs = {_tuple(places)}"
    if rates:
        has_nu = "nu" in type_info.kernels
        yield f"J = {loop_source.called_with(type_info, 'J')}"
        if has_nu:
            yield f"nu = {loop_source.called_with(type_info, 'nu')}"
        rows = [_rate(type_info, row, has_nu) for row in _joint(type_info).position_rows()]
        yield f"own_rates = least_change(G, {_tuple(rows)})"
        yield from (f"x_{name}_dot = -own_rates[{k}]" for k, name in enumerate(unknowns))


def store_position(type_info: TypeInfo) -> Iterator[str]:
    """Call C, and store the rows that remain."""
    unknowns = len(type_info.layout.unknowns)
    yield f"out = {loop_source.called_with(type_info, 'C')}"
    yield f"_, reduced, _ = eliminate(G, ({_tuple(type_info.outputs['C'])},), signs)"
    for r in range(len(_joint(type_info).position_rows()) - unknowns):
        yield f"out1[row + {r}] = reduced[0][{unknowns + r}]"


def store_acceleration(type_info: TypeInfo) -> Iterator[str]:
    """Call J, gamma and nu, and store the rows that remain."""
    type_ = _joint(type_info)
    layout, unknowns = type_info.layout, len(type_info.layout.unknowns)
    position, velocity, slots = type_.position_rows(), type_.velocity_rows(), len(layout.slots)
    kernels = [name for name in ("J", "gamma", "nu") if name in type_info.kernels]
    for name in kernels:
        yield f"{name} = {loop_source.called_with(type_info, name)}"
    entry = _entries(type_info)
    columns = [[entry("J", n, r, c) for r in position] for n in range(slots) for c in range(6)]
    columns += [[entry(name, r) for r in position] for name in kernels[1:]]
    columns_of = "".join(f"{_tuple(column)}, " for column in columns)
    yield f"_, reduced, _ = eliminate(G, ({columns_of}), signs)"
    remaining = len(position) - unknowns
    for n in range(slots):
        yield f"d = idx[b0 + {layout.integers + 1 + n}]"
        for c in range(6):
            for r in range(remaining):
                yield f"out1[d + {6 * r + c}] = reduced[{6 * n + c}][{unknowns + r}]"
            for k, r in enumerate(velocity, start=remaining):
                yield f"out1[d + {6 * k + c}] = {entry('J', n, r, c)}"
    for which, name in enumerate(kernels[1:], start=6 * slots):
        array = "out2" if name == "gamma" else "out3"
        for r in range(remaining):
            yield f"{array}[row + {r}] = reduced[{which}][{unknowns + r}]"
        for k, r in enumerate(velocity, start=remaining):
            yield f"{array}[row + {k}] = {entry(name, r)}"


def with_sample_unknowns(type_info: TypeInfo) -> TypeInfo:
    """A joint with rows as its kernels return them: unknowns and their rates are rows of ``F``.

    They stand behind its functions of time, for checks of formulas.
    """
    layout, names = type_info.layout, {}
    for k, name in enumerate(layout.unknowns):
        row = 1 + len(layout.functions) + k
        for order, of_order in enumerate((name, f"{name}_dot")):
            argument = type_info.names[of_order]
            names[of_order] = attrs.evolve(argument, code=f"F[{row}, {order}]")
    angles = {name: at for name, at in layout.angles.items() if name not in layout.unknowns}
    raw = attrs.evolve(layout, unknowns=(), angles=angles)
    return attrs.evolve(type_info, layout=raw, names=type_info.names | names)


def kept_value(type_info: TypeInfo, name: str) -> str:
    """Expression of an unknown as it is kept: within its bounds, where it is periodic."""
    if name not in type_info.layout.unknowns or name not in _joint(type_info).periodic:
        return f"x_{name}"
    low, high = (f"par[p1 + {type_info.layout.numbers[f'{name}{suffix}'][0]}]"
                 for suffix in (LEAST, GREATEST))  # fmt: skip
    return f"within(x_{name}, {low}, {high})"


def bound_values(type_info: TypeInfo) -> list[str]:
    """Distances of the unknowns from their bounds, but for those that are periodic."""
    signs, numbers = {"least": "", "greatest": "-"}, type_info.layout.numbers
    return [
        f"{signs[words]}(x_{name} - par[p1 + {numbers[field][0]}])"
        for name, words, field in bound_words(type_info)
    ]


def bound_words(type_info: TypeInfo) -> list[tuple[str, str, str]]:
    """(unknown, "least" or "greatest", its field) of each of ``bound_values``."""
    return [
        (name, words, f"{name}{suffix}")
        for name in type_info.layout.unknowns
        if name not in _joint(type_info).periodic
        for suffix, words in ((LEAST, "least"), (GREATEST, "greatest"))
    ]


def _joint(type_info: TypeInfo) -> type[Joint]:
    assert issubclass(type_info.type, Joint)
    return type_info.type


def _tuple(paths: Any) -> str:
    return f"({''.join(f'{path}, ' for path in paths)})"


def _rows(paths: Any, rows: int, columns: int) -> str:
    return _tuple(_tuple(paths[columns * r : columns * (r + 1)]) for r in range(rows))


def _entries(type_info: TypeInfo) -> Callable[..., str]:
    """Expression of an entry of J (slot, row, column), or of a row of another kernel."""
    rows = _joint(type_info).rows

    def entry(kernel: str, *index: int) -> str:
        place = index[0] if len(index) == 1 else (index[0] * rows + index[1]) * 6 + index[2]
        path: str = type_info.outputs[kernel][place]
        return kernel + path.removeprefix("out")

    return entry


def _rate(type_info: TypeInfo, row: int, has_nu: bool) -> str:
    """Expression of J v - nu of a row."""
    entry = _entries(type_info)
    terms = [f"{entry('J', n, row, c)} * body[b_{s}, V + {c}]"
             for n, s in enumerate(type_info.layout.slots) for c in range(6)]  # fmt: skip
    return " + ".join(terms) + (f" - {entry('nu', row)}" if has_nu else "")
