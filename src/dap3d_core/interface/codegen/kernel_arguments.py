"""Names that a type offers to its kernels, with the code by which a group loop computes each.

docs/reference/names.md lists them by field. A field ``v_i`` replaces the velocity of that name;
other names of a body are reserved.
"""

from collections.abc import Callable, Iterable, Mapping
from inspect import Parameter, signature
from keyword import iskeyword
from types import FunctionType
from typing import Any

import attrs

from dap3d_core.interface.codegen.instance_layout import InstanceLayout, prefix_of, size
from dap3d_core.interface.fields import FieldSpec, slot_of, specs_of
from dap3d_core.interface.types import TypeBase

#: Kernels that may use quantities of the velocity level; all others use positions and time only.
VELOCITY_KERNELS = (
    "C_dot", "gamma", "wrench", "friction", "switch", "rate", "impulse", "reset", "tension"
)  # fmt: skip
#: Numbers of a force ``friction`` for the kernel ``friction`` of its joint.
FRICTION_NUMBERS = ("mu", "v_tol", "radius")
#: Kernels of contacts that return vectors.
VECTORS = ("at", "normal", "along", "grain")
#: Suffixes of a function's value and derivatives.
DERIVATIVES = ("", "_dot", "_ddot", "_dddot")
#: The same of a function of two arguments: its partial derivatives.
PARTIALS = ("", "_x", "_y", "_xx", "_xy", "_yy")
#: What functions of one and of two arguments return: shape and words.
VALUES = {1: ((4,), "(f, f', f'', f''')"), 2: ((6,), "(f, f_x, f_y, f_xx, f_xy, f_yy)")}
#: ``KernelArgument.derivative`` of a tuple of functions.
SEVERAL = len(PARTIALS)


@attrs.frozen
class KernelArgument:
    """One name: its meaning and its code.

    Attributes:
        name: the parameter name in kernels.
        shape: () number, (3,) vector, (4,) Euler parameters, (3, 3) matrix, (n,) other tuples.
        velocity: it belongs to the velocity level.
        code: Python expression of the loop's variables and ``needs`` (prefixed by ``x_``).
        needs: names that must be computed before.
        doc: its meaning, for ``describe``.
        columns: of a table; 0 for all else.
        derivative: place in DERIVATIVES, or PARTIALS, of a function to be called, SEVERAL of a
            tuple of functions; -1 for all else.
        arguments: how many a function to be called takes.
        rate: its rate of change as an expression of ``needs`` and the velocities ``V_i``, ``W_i``
            of the bodies, for derivations. "" for a constant.
        rate_name: the name of its rate; "" where there is none.
        motion: the expression, in the same names as a rate, of a name of the velocity level that
            is the rate of no other.
        derivable: formulas that use it can be derived.
    """

    name: str
    shape: tuple[int, ...]
    velocity: bool
    code: str
    needs: tuple[str, ...] = ()
    doc: str = ""
    columns: int = 0
    derivative: int = -1
    arguments: int = 1
    rate: str = ""
    rate_name: str = ""
    motion: str = ""
    derivable: bool = True


#: A further name of the kernel ``grip`` of a contact.
SLIP = {"speed": KernelArgument("speed", (), False, "", doc="of slip, m/s")}


def namespace(type_: type[TypeBase], layout: InstanceLayout) -> dict[str, KernelArgument]:
    """Every name that the kernels of a type may use."""
    names: dict[str, KernelArgument] = {}

    def offer(
        name: str,
        shape: tuple[int, ...],
        code: str,
        needs: Iterable[str] = (),
        velocity: bool = False,
        doc: str = "",
        **more: Any,
    ) -> None:
        names[name] = KernelArgument(name, shape, velocity, code, tuple(needs), doc, **more)

    offer("t", (), "t", doc="time, s", rate="1.0")
    arguments = argument_names(type_)
    if arguments:
        offer("x", (), "t", doc="the argument of the function")
    if len(arguments) > 1:  # its loop is for tests alone: y is in the row of F behind its own
        offer("y", (), "F[idx[b0] + 1, 0]", doc="its second argument")
    for s in layout.slots:
        _offer_body(offer, s)
    for name, spec in specs_of(type_).items():
        # v_i may be a vector, not a velocity
        if name not in layout.constants and name not in arguments:
            _offer_field(offer, name, prefix_of(type_, name), spec, layout)
    for name in layout.constants:
        _offer_constant(offer, name, layout)
    for name in layout.unknowns:
        offer(name, (), "", doc="unknown of the joint", rate=f"x_{name}_dot")
        rate = f"rate of {name}"
        offer(f"{name}_dot", (), "", velocity=True, doc=rate, motion="0.0")
    if type_.is_contact:
        lam = f"({''.join(f'-out3[row + {k}], ' for k in range(3))})"
        offer("lam", (3,), lam, velocity=True, doc="its multipliers", derivable=False)
        if load := type_.load:  # type: ignore[attr-defined]
            at = layout.integers + 1 + len(layout.slots)
            joint = f"idx[b0 + {at}]"
            lam = f"({''.join(f'-out3[{joint} + {k}], ' for k in load)})"
            doc = "multipliers of the joint that press its surfaces"
            offer("lam_load", (len(load),), lam, velocity=True, doc=doc, derivable=False)
        if type_.resists:  # type: ignore[attr-defined]
            near = f"({''.join(f'states[idx[b0 + {at + 1}] + {k}], ' for k in range(3))})"
            offer("near_load", (3,), near, doc="share of the contact", derivable=False)
    for name, (at, shape) in layout.states.items():
        offer(name, shape, _state(at, shape), doc="state of the element", derivable=False)
    return names


def argument_names(type_: type[TypeBase]) -> tuple[str, ...]:
    """The arguments of a function type, ``x`` or ``x`` and ``y``; none of other types."""
    return ("x", "y")[: type_.arguments] if type_.kind == "function" else ()  # type: ignore[attr-defined]


def derivative_names(arguments: int) -> tuple[str, ...]:
    """Suffixes of the value and the derivatives of a function of so many arguments."""
    return PARTIALS if arguments > 1 else DERIVATIVES


def friction_names(rows: int) -> dict[str, KernelArgument]:
    """Further names of the kernel ``friction`` of a joint; their numbers follow its own."""
    reaction = f"({''.join(f'-out2[row + {k}], ' for k in range(rows))})"
    docs = ("friction coefficient", "velocity below which friction fades, m/s", "of the pin, m")
    names = {"lam": KernelArgument("lam", (rows,), True, reaction, doc="its multipliers")}
    for name, doc in zip(FRICTION_NUMBERS, docs, strict=True):
        names[name] = KernelArgument(name, (), False, "", doc=doc)
    return names


def _offer_body(offer: Callable[..., None], s: str) -> None:
    b = f"b_{s}"
    place, turn = f"position of body {s}, m", f"rotation matrix of body {s}"
    moves = {"rate": f"V_{s}", "rate_name": f"v_{s}"}
    offer(f"r_{s}", (3,), f"vector_at(body, {b}, R)", doc=place, **moves)
    turned = f"turned(W_{s}, x_A_{s})"
    offer(f"A_{s}", (3, 3), f"matrix_at(body, {b}, A)", doc=turn, rate=turned)
    parameters, rate = _tuple(f"body[{b}, P + {{}}]", 4), f"euler_rate(W_{s}, x_p_{s})"
    offer(f"p_{s}", (4,), parameters, doc=f"Euler parameters of body {s}", rate=rate)
    speed = f"velocity of body {s}, m/s"
    offer(f"v_{s}", (3,), f"vector_at(body, {b}, V)", velocity=True, doc=speed)
    spin = f"angular velocity of body {s}, global, rad/s"
    offer(f"w_{s}", (3,), f"vector_at(body, {b}, W)", velocity=True, doc=spin)
    offer(f"mass_{s}", (), f"body[{b}, MASS]", doc=f"mass of body {s}, kg")
    inertia = f"inertia matrix of body {s} in its axes, kg m^2"
    offer(f"Jp_{s}", (3, 3), f"matrix_at(body, {b}, JP)", doc=inertia)


def _offer_field(
    offer: Callable[..., None], name: str, prefix: str, spec: FieldSpec, layout: InstanceLayout
) -> None:
    if spec.kind == "point" and (slot := slot_of(name)):
        _offer_point(offer, name, slot, layout)
    elif spec.kind == "vector" and spec.ground:
        offer(name, (3,), stored(layout, name), doc="vector fixed in ground")
    elif spec.kind == "vector":
        _offer_vector(offer, name, slot_of(name) if name not in layout.others else name, layout)
    elif spec.kind == "vector2":
        for end, slot in (("P_i", "i"), ("P_j", "j")):
            _offer_point(offer, end, slot, layout)
        between, rate = "vector from P_i to P_j, m", f"rate of {name}, m/s"
        grows = "sub(add(V_j, cross(W_j, x_s_P_j)), add(V_i, cross(W_i, x_s_P_i)))"
        rates = {"rate": grows, "rate_name": f"{name}_dot"}
        offer(name, (3,), "sub(x_r_P_j, x_r_P_i)", ("r_P_i", "r_P_j"), doc=between, **rates)
        offer(f"{name}_dot", (3,), "sub(x_v_P_j, x_v_P_i)", ("v_P_i", "v_P_j"), True, rate)
    elif spec.by_name:
        _offer_function(offer, name, prefix, spec, layout, f"{stored(layout, name)} + ")
    elif spec.kind in ("number", "numbers", "vec3", "matrix"):
        doc = f"{spec.doc or name}{f', {spec.unit}' if spec.unit else ''}"
        offer(name, layout.numbers[name][1], stored(layout, name), doc=doc)
    elif spec.kind == "function":
        _offer_function(offer, name, prefix, spec, layout)
    elif spec.kind == "functions":
        doc = f"{spec.doc or name}: a tuple of functions, to be called"
        offer(name, (), "", doc=doc, derivative=SEVERAL, derivable=False)
    elif spec.kind == "input":
        doc = f"{spec.doc or name}: an input, held until it is set again"
        offer(name, (), f"F[{_row_of(name, layout)}, 0]", doc=doc)
    elif spec.kind == "table" and not spec.by_rows:
        offset, columns = layout.tables[name]
        sample = f"({'0.0, ' * columns})"
        code = f"(par, par[p1 + {offset}], par[p1 + {offset + 1}], {sample})"
        doc = f"{spec.doc or name}, by lookup"
        offer(name, (4,), code, doc=doc, columns=columns, derivable=False)
    elif spec.kind == "angle":
        _offer_angle(offer, name, spec, layout)


def _offer_function(
    offer: Callable[..., None],
    name: str,
    f: str,
    spec: FieldSpec,
    layout: InstanceLayout,
    number: str = "",
) -> None:
    """A function; of time with a ``number`` that is added to its value."""
    if spec.argument:
        for order, suffix in enumerate(derivative_names(spec.arguments)):
            which = suffix.strip("_") if spec.arguments > 1 and order else order
            doc = f"function of {spec.argument}, derivative {which}; to be called"
            offer(f"{f}{suffix}", (), "", doc=doc, derivative=order, arguments=spec.arguments)
        return
    at = _row_of(name, layout)
    for order, suffix in enumerate(DERIVATIVES):
        doc, code = f"function of time, derivative {order}", f"F[{at}, {order}]"
        if number:
            doc, code = f"{spec.doc}, derivative {order}", code if order else f"{number}{code}"
        higher = f"{f}{DERIVATIVES[order + 1]}" if order < 3 else ""
        rates = {"rate": f"x_{higher}", "rate_name": higher} if higher else {"derivable": False}
        offer(f"{f}{suffix}", (), code, doc=doc, **rates)
    offer(f"{f}_0", (), f"{number}F[{at}, 4]", doc="its value at t = 0")


def _row_of(name: str, layout: InstanceLayout) -> str:
    """Expression for the row of F of a field; that of zeros where no kernel names it."""
    if name not in layout.functions:
        return "0"
    return f"idx[b0 + {len(layout.slots) + layout.functions.index(name)}]"


def _offer_angle(
    offer: Callable[..., None], name: str, spec: FieldSpec, layout: InstanceLayout
) -> None:
    u, v, k = spec.axes
    at, axes = layout.angles[name], f"x_{u}, x_{v}, x_{k}"
    ahead = f"par[p1 + {at}] + par[p1 + {at + 1}] * (t - par[p1 + {at + 2}])"
    code = f"unwound(angle_about({axes}), {ahead})"
    one, other = slot_of(u), slot_of(v)
    # its rate is that of the formula; theta_dot is it where both bodies turn about k alone
    turning = ", ".join(f"cross(W_{slot_of(a)}, x_{a})" for a in spec.axes)
    rates = {"rate": f"angle_rate({axes}, {turning})", "derivable": slot_of(k) is not None}
    offer(name, (), code, (u, v, k), doc=f"angle from {u} to {v} about {k}, rad", **rates)
    rate = f"dot(x_{k}, sub(x_w_{other}, x_w_{one}))"
    needs = (k, f"w_{one}", f"w_{other}")
    motion = f"dot(x_{k}, sub(W_{other}, W_{one}))"
    offer(f"{name}_dot", (), rate, needs, True, f"rate of {name}, rad/s", motion=motion)


def _offer_point(offer: Callable[..., None], name: str, s: str, layout: InstanceLayout) -> None:
    arm, rate, local = f"s_{name}", f"s_{name}_dot", stored(layout, name)
    place, speed = f"position of {name}, m", f"velocity of {name}, m/s"
    turns = {"rate": f"cross(W_{s}, x_{arm})", "rate_name": rate}
    moves = {"rate": f"add(V_{s}, cross(W_{s}, x_{arm}))", "rate_name": f"v_{name}"}
    code, doc = f"rotate(x_A_{s}, {local})", f"arm of {name}, global, m"
    offer(arm, (3,), code, (f"A_{s}",), doc=doc, **turns)
    offer(f"r_{name}", (3,), f"add(x_r_{s}, x_{arm})", (f"r_{s}", arm), doc=place, **moves)
    offer(rate, (3,), f"cross(x_w_{s}, x_{arm})", (f"w_{s}", arm), True, "rate of the arm, m/s")
    code = f"add(vector_at(body, b_{s}, V), x_{rate})"  # a field may have the name v_i
    offer(f"v_{name}", (3,), code, (rate,), True, speed)


def _offer_vector(
    offer: Callable[..., None], name: str, s: str | None, layout: InstanceLayout
) -> None:
    """A vector fixed in the body of slot s, or in a body of its own where s is its own name."""
    local = stored(layout, name)
    needs: tuple[str, ...] = ()
    if s in layout.slots:
        turned, turning, needs = f"x_A_{s}", f"x_w_{s}", (f"A_{s}", f"w_{s}")
        fixed = f"vector fixed in body {s}, global"
    else:
        turned, turning = f"matrix_at(body, b_{s}, A)", f"vector_at(body, b_{s}, W)"
        fixed = "vector fixed in a body of the element, global"
    turns = {"rate": f"cross(W_{s}, x_{name})", "rate_name": f"{name}_dot"}
    known = turns if needs else {"derivable": False}
    offer(name, (3,), f"rotate({turned}, {local})", needs[:1], doc=fixed, **known)
    rate = f"cross({turning}, x_{name})"
    offer(f"{name}_dot", (3,), rate, (*needs[1:], name), True, f"rate of {name}, 1/s")


def _offer_constant(offer: Callable[..., None], name: str, layout: InstanceLayout) -> None:
    slot, shape = slot_of(name), layout.numbers[name][1]
    if shape == (3,) and slot in layout.slots:
        _offer_vector(offer, name, slot, layout)
    else:
        offer(name, shape, stored(layout, name), doc="constant found by prepare")


def stored(layout: InstanceLayout, name: str) -> str:
    """Expression for a number of an instance."""
    offset, shape = layout.numbers[name]
    if shape == (3,):
        return f"vector_in(par, p1 + {offset})"
    if shape == (3, 3):
        return f"matrix_in(par, p1 + {offset})"
    return _nested(shape, offset)


def _state(at: int, shape: tuple[int, ...]) -> str:
    """Expression for a state of an instance."""
    return _tuple(f"states[z0 + {at} + {{}}]", shape[0]) if shape else f"states[z0 + {at}]"


def _nested(shape: tuple[int, ...], offset: int) -> str:
    if not shape:
        return f"par[p1 + {offset}]"
    parts = (_nested(shape[1:], offset + k * size(shape[1:])) for k in range(shape[0]))
    return f"({', '.join(parts)},)"


def _tuple(pattern: str, n: int) -> str:
    return "(" + "".join(pattern.format(k) + ", " for k in range(n)) + ")"


def parameters(kernel: Callable[..., Any]) -> tuple[str, ...]:
    """The parameters of a kernel."""
    if isinstance(kernel, FunctionType) and not hasattr(kernel, "__wrapped__"):  # most are
        return kernel.__code__.co_varnames[: kernel.__code__.co_argcount]
    positional = (Parameter.POSITIONAL_OR_KEYWORD, Parameter.POSITIONAL_ONLY)
    return tuple(n for n, p in signature(kernel).parameters.items() if p.kind in positional)


def can_be_parameter(name: Any) -> bool:
    """True for text that a kernel can have as a parameter."""
    return isinstance(name, str) and name.isidentifier() and not iskeyword(name)


def in_order(names: Mapping[str, KernelArgument], wanted: Iterable[str]) -> list[KernelArgument]:
    """The wanted quantities and all they need, each after what it needs."""
    done: dict[str, KernelArgument] = {}

    def visit(name: str) -> None:
        if name not in done:
            for need in names[name].needs:
                visit(need)
            done[name] = names[name]

    for name in wanted:
        visit(name)
    return list(done.values())
