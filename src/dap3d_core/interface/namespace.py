"""Which names a type offers to its kernels, what each holds, and how a group loop computes it.

| field | names it offers |
| --- | --- |
| body slot i (``body_i``, point or vector on it) | ``r_i A_i p_i mass_i Jp_i``; ``v_i w_i`` |
| point ``P_i`` | ``s_P_i`` (arm, global) ``r_P_i``; ``s_P_i_dot v_P_i`` |
| vector ``a_i`` | ``a_i``; ``a_i_dot`` |
| vector2 ``d`` | ``d`` and its ends as points ``P_i``, ``P_j``; ``d_dot`` |
| number, vec3, matrix | itself |
| function ``function`` | ``f f_dot f_ddot``; of another name ``g``: ``g g_dot g_ddot`` |
| what ``prepare`` returns | itself; a 3-tuple ``n_j``: a vector fixed in body j, with ``n_j_dot`` |
| always | ``t`` |

Names after a semicolon are of the velocity level: a position-level kernel may not ask for them.
"""

from collections.abc import Callable, Iterable, Mapping
from inspect import Parameter, signature
from typing import Any

import attrs

from dap3d_core.interface.fields import FieldSpec, slot_of, specs_of
from dap3d_core.interface.types import TypeBase

SLOTS = ("i", "j", "k")
#: Kernels that may name quantities of the velocity level; all others see positions and time only.
VELOCITY_KERNELS = ("gamma", "wrench")


@attrs.frozen
class Quantity:
    """One name: what it is and how a loop finds it.

    Attributes:
        name: as kernels write it.
        shape: () number, (3,) vector, (4,) Euler parameters, (3, 3) matrix, (n,) other tuples.
        velocity: whether it belongs to the velocity level.
        code: Python expression over the loop's variables and ``needs`` (prefixed by ``x_``).
        needs: names that must be computed before.
        doc: what it is, for ``describe``.
    """

    name: str
    shape: tuple[int, ...]
    velocity: bool
    code: str
    needs: tuple[str, ...] = ()
    doc: str = ""


@attrs.frozen
class Layout:
    """Where one instance's integers and numbers stand.

    Attributes:
        slots: body slots, in the order of the J blocks.
        functions: function fields, in order; their rows of F follow the bodies in ``idx``.
        numbers: name -> (offset in ``par``, shape) of what is stored for each instance.
        par_width: numbers an instance takes.
    """

    slots: tuple[str, ...]
    functions: tuple[str, ...]
    numbers: dict[str, tuple[int, tuple[int, ...]]]
    par_width: int


def body_slots(type_: type[TypeBase]) -> tuple[str, ...]:
    """The body slots of a type, in the order i, j, k."""
    found = {"i"} if getattr(type_, "each_body", False) else set()
    for name, spec in specs_of(type_).items():
        if spec.kind == "vector2":
            found |= {"i", "j"}
        elif spec.kind in ("body", "point", "vector") and (slot := slot_of(name)):
            found.add(slot)
    return tuple(s for s in SLOTS if s in found)


def size(shape: tuple[int, ...]) -> int:
    """How many numbers a shape holds."""
    n = 1
    for extent in shape:
        n *= extent
    return n


def shape_of(value: Any) -> tuple[int, ...]:
    """Shape of a number or a nested tuple of numbers."""
    if isinstance(value, (tuple, list)):
        return (len(value), *shape_of(value[0])) if value else (0,)
    return ()


def layout_of(type_: type[TypeBase], constants: Mapping[str, Any]) -> Layout:
    """How instances of a type are stored, given what ``prepare`` returned for one of them."""
    numbers: dict[str, tuple[int, tuple[int, ...]]] = {}
    width = 0

    def keep(name: str, shape: tuple[int, ...]) -> None:
        nonlocal width
        numbers[name] = (width, shape)
        width += size(shape)

    functions = []
    for name, spec in specs_of(type_).items():
        if name in constants:
            continue
        if spec.kind == "vector2":
            keep("P_i", (3,))
            keep("P_j", (3,))
        elif spec.kind in ("point", "vector", "vec3"):
            keep(name, (3,))
        elif spec.kind == "matrix":
            keep(name, (3, 3))
        elif spec.kind == "number":
            keep(name, ())
        elif spec.kind == "function":
            functions.append(name)
    for name, value in constants.items():
        keep(name, shape_of(value))
    return Layout(body_slots(type_), tuple(functions), numbers, width)


def namespace(type_: type[TypeBase], constants: Mapping[str, Any]) -> dict[str, Quantity]:
    """Every name that the kernels of a type may use."""
    layout = layout_of(type_, constants)
    names: dict[str, Quantity] = {}

    def offer(
        name: str,
        shape: tuple[int, ...],
        code: str,
        needs: Iterable[str] = (),
        velocity: bool = False,
        doc: str = "",
    ) -> None:
        names[name] = Quantity(name, shape, velocity, code, tuple(needs), doc)

    offer("t", (), "t", doc="time, s")
    if type_.kind == "function":
        offer("x", (), "t", doc="the argument of the function")
    for s in layout.slots:
        _offer_body(offer, s)
    for name, spec in specs_of(type_).items():
        if name not in constants:
            _offer_field(offer, name, spec, layout)
    for name, value in constants.items():
        _offer_constant(offer, name, shape_of(value), layout)
    return names


def _offer_body(offer: Callable[..., None], s: str) -> None:
    b = f"b_{s}"
    offer(f"r_{s}", (3,), f"vector_at(body, {b}, R)", doc=f"position of body {s}, m")
    offer(f"A_{s}", (3, 3), f"matrix_at(body, {b}, A)", doc=f"rotation matrix of body {s}")
    offer(f"p_{s}", (4,), _tuple(f"body[{b}, P + {{}}]", 4), doc=f"Euler parameters of body {s}")
    speed = f"velocity of body {s}, m/s"
    offer(f"v_{s}", (3,), f"vector_at(body, {b}, V)", velocity=True, doc=speed)
    spin = f"angular velocity of body {s}, global, rad/s"
    offer(f"w_{s}", (3,), f"vector_at(body, {b}, W)", velocity=True, doc=spin)
    offer(f"mass_{s}", (), f"body[{b}, MASS]", doc=f"mass of body {s}, kg")
    inertia = f"inertia matrix of body {s} in its axes, kg m^2"
    offer(f"Jp_{s}", (3, 3), f"matrix_at(body, {b}, JP)", doc=inertia)


def _offer_field(offer: Callable[..., None], name: str, spec: FieldSpec, layout: Layout) -> None:
    if spec.kind == "point" and (slot := slot_of(name)):
        _offer_point(offer, name, slot, layout)
    elif spec.kind == "vector" and (slot := slot_of(name)):
        _offer_vector(offer, name, slot, layout)
    elif spec.kind == "vector2":
        for end, slot in (("P_i", "i"), ("P_j", "j")):
            _offer_point(offer, end, slot, layout)
        between, rate = "vector from P_i to P_j, m", f"rate of {name}, m/s"
        offer(name, (3,), "sub(x_r_P_j, x_r_P_i)", ("r_P_i", "r_P_j"), doc=between)
        offer(f"{name}_dot", (3,), "sub(x_v_P_j, x_v_P_i)", ("v_P_i", "v_P_j"), True, rate)
    elif spec.kind in ("number", "vec3", "matrix"):
        unit = f", {spec.unit}" if spec.unit else ""
        offer(name, layout.numbers[name][1], _stored(layout, name), doc=f"{spec.doc or name}{unit}")
    elif spec.kind == "function":
        f = "f" if name == "function" else name
        at = f"idx[b0 + {len(layout.slots) + layout.functions.index(name)}]"
        for order, suffix in enumerate(("", "_dot", "_ddot")):
            doc = f"function of time, derivative {order}"
            offer(f"{f}{suffix}", (), f"F[{at}, {order}]", doc=doc)


def _offer_point(offer: Callable[..., None], name: str, s: str, layout: Layout) -> None:
    arm, rate, local = f"s_{name}", f"s_{name}_dot", _stored(layout, name)
    place, speed = f"position of {name}, m", f"velocity of {name}, m/s"
    offer(arm, (3,), f"rotate(x_A_{s}, {local})", (f"A_{s}",), doc=f"arm of {name}, global, m")
    offer(f"r_{name}", (3,), f"add(x_r_{s}, x_{arm})", (f"r_{s}", arm), doc=place)
    offer(rate, (3,), f"cross(x_w_{s}, x_{arm})", (f"w_{s}", arm), True, "rate of the arm, m/s")
    offer(f"v_{name}", (3,), f"add(x_v_{s}, x_{rate})", (f"v_{s}", rate), True, speed)


def _offer_vector(offer: Callable[..., None], name: str, s: str, layout: Layout) -> None:
    fixed, rate = f"vector fixed in body {s}, global", f"rate of {name}, 1/s"
    offer(name, (3,), f"rotate(x_A_{s}, {_stored(layout, name)})", (f"A_{s}",), doc=fixed)
    offer(f"{name}_dot", (3,), f"cross(x_w_{s}, x_{name})", (f"w_{s}", name), True, rate)


def _offer_constant(
    offer: Callable[..., None], name: str, shape: tuple[int, ...], layout: Layout
) -> None:
    slot = slot_of(name)
    if shape == (3,) and slot in layout.slots:
        _offer_vector(offer, name, slot, layout)
    else:
        offer(name, shape, _stored(layout, name), doc="constant found by prepare")


def _stored(layout: Layout, name: str) -> str:
    offset, shape = layout.numbers[name]
    if shape == ():
        return f"par[p1 + {offset}]"
    if shape == (3,):
        return f"vector_in(par, p1 + {offset})"
    if shape == (3, 3):
        return f"matrix_in(par, p1 + {offset})"
    return _nested(shape, offset)


def _nested(shape: tuple[int, ...], offset: int) -> str:
    if not shape:
        return f"par[p1 + {offset}]"
    parts = (_nested(shape[1:], offset + k * size(shape[1:])) for k in range(shape[0]))
    return f"({', '.join(parts)},)"


def _tuple(pattern: str, n: int) -> str:
    return "(" + "".join(pattern.format(k) + ", " for k in range(n)) + ")"


def parameters(kernel: Callable[..., Any]) -> tuple[str, ...]:
    """The names a kernel asks for."""
    positional = (Parameter.POSITIONAL_OR_KEYWORD, Parameter.POSITIONAL_ONLY)
    return tuple(n for n, p in signature(kernel).parameters.items() if p.kind in positional)


def in_order(names: Mapping[str, Quantity], wanted: Iterable[str]) -> list[Quantity]:
    """The wanted quantities and all they need, each after what it needs."""
    done: dict[str, Quantity] = {}

    def visit(name: str) -> None:
        if name not in done:
            for need in names[name].needs:
                visit(need)
            done[name] = names[name]

    for name in wanted:
        visit(name)
    return list(done.values())
