"""Examines a type before use: its kernels are called with random numbers, in plain Python.

A wrong shape, an unknown name, a velocity in a position-level kernel or an exception is a
``PluginError`` that names file, type, function and remedy.
"""

import math
import random
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from types import FunctionType
from typing import Any
from warnings import catch_warnings

import attrs

from dap3d_core.interface.codegen.instance_layout import (
    InstanceLayout,
    ShapeError,
    body_slots,
    checked_shape,
    entries,
    layout_of,
    size,
    state_entries,
    value_at,
)
from dap3d_core.interface.codegen.kernel_arguments import (
    SLIP,
    VALUES,
    VECTORS,
    VELOCITY_KERNELS,
    KernelArgument,
    friction_names,
    namespace,
    parameters,
)
from dap3d_core.interface.codegen.loop_source import JUMP_KINDS, jump_names, row_count
from dap3d_core.interface.codegen.reactions import READING, reaction_names
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.contacts.contact import DECLARED, SURFACES
from dap3d_core.interface.derive.derive import CannotDeriveError, derive, missing
from dap3d_core.interface.element_states import unknown_names
from dap3d_core.interface.errors import (
    PluginError,
    fault_of_keyword,
    is_own,
    line_of,
    name_hint,
    no_field,
    plain_words,
    where_is,
)
from dap3d_core.interface.examine.constants import prepared, set_ends
from dap3d_core.interface.examine.random_values import (
    numbers,
    random_field,
    random_pose,
    random_quantity,
)
from dap3d_core.interface.fields import SLOTS, FieldSpec, sized_fields, slot_of, specs_of
from dap3d_core.interface.types import SYMBOLS, Force, Function, Joint, TypeBase

#: Random inputs a type may refuse, or be undefined for, before it counts as broken.
ATTEMPTS = 200


def examine(type_: type[TypeBase], seed: int = 1) -> TypeInfo:
    """Check a type and return what its loops are generated from.

    Raises:
        PluginError: with file, type, function and remedy.
    """
    if sized_fields(type_) and not hasattr(type_, "shape_of_lists"):
        from dap3d_core.interface.examine.sized_types import examine_sized

        return examine_sized(type_, examine, seed)
    own_variants = type_.variants if "variants" in vars(type_) else ()
    for conditions, class_ in own_variants:
        _check_conditions(type_, conditions, class_)
    variants = tuple((conditions, examine(class_, seed)) for conditions, class_ in own_variants)
    _check_class(type_, is_abstract=bool(variants))
    has_states = _declares_states(type_, is_abstract=bool(variants))
    rng = random.Random(seed)
    layout = layout_of(type_, _random_constants(type_, rng))
    _check_pictures(type_, layout)
    _check_named_fields(type_, layout)
    if "reset" in type_.kernels() and not layout.states:
        what = 'defines reset, but no states; add e.g. states = ("z",) and rate'
        raise PluginError(f"{where_is(type_)} {what}")
    if has_states:
        from dap3d_core.interface.examine.check_states import check_state_names

        check_state_names(type_, layout, namespace(type_, attrs.evolve(layout, states={})))
    names = namespace(type_, layout)
    kernels: dict[str, Callable[..., Any]] = type_.kernels()
    outputs: dict[str, tuple[str, ...]] = {}

    def call(kernel_name: str) -> None:
        kernel = kernels[kernel_name]
        offered = _further_names(type_, kernel_name, outputs, len(layout.slots)) | names
        _check_names(type_, kernel_name, parameters(kernel), offered)
        quantities = [offered[n] for n in parameters(kernel)]
        rows = row_count(outputs, len(layout.slots)) if kernel_name == "impulse" else 0
        outputs[kernel_name] = _output(type_, kernel_name, kernel, quantities, rng, rows)

    for kernel_name in kernels:
        if kernel_name not in JUMP_KINDS:  # they take rows that may be derived
            call(kernel_name)
    if lacking := missing(type_, outputs.get("value") == ("out",)):
        try:
            kernels |= derive(type_, layout, names, lacking)
        except CannotDeriveError as error:
            raise PluginError(f"{where_is(type_)}: {error}") from error
    derived = tuple(n for n in lacking if n in kernels)  # nu is left out where it is zero
    for kernel_name in (*derived, *(name for name in JUMP_KINDS if name in kernels)):
        call(kernel_name)
    kernels = {name: k for name, k in kernels.items() if name not in type_.declared}
    outputs |= _bounds(type_)
    _check_jumps(type_, outputs, len(layout.slots))
    functions = tuple(n for n, s in specs_of(type_).items() if s.kind == "function" and s.argument)
    return TypeInfo(type_, layout, names, outputs, kernels, variants, functions,
                    _joint_of_friction(type_), derived=derived)  # fmt: skip


def _bounds(type_: type[TypeBase]) -> dict[str, tuple[str, ...]]:
    """Output of the distances of unknowns from their bounds."""
    if not unknown_names(type_):
        return {}
    assert issubclass(type_, Joint)
    bounded = [name for name in unknown_names(type_) if name not in type_.periodic]
    return {"bound": tuple(f"out[{k}]" for k in range(2 * len(bounded)))}


def _further_names(
    type_: type[TypeBase], kernel: str, outputs: Mapping[str, tuple[str, ...]], slots: int
) -> dict[str, KernelArgument]:
    """Names that one kernel alone may use."""
    if kernel == "friction" and issubclass(type_, Joint):
        return friction_names(type_.rows)
    if kernel in JUMP_KINDS:
        return jump_names(type_.kind, kernel, outputs, slots)
    return reaction_names(type_) if kernel in READING else SLIP if kernel == "grip" else {}


def _declares_states(type_: type[TypeBase], *, is_abstract: bool) -> bool:
    """True for a type with states of its own, which are checked."""
    if not type_.states and "rate" not in type_.kernels():
        return False
    from dap3d_core.interface.examine.check_states import check_states

    check_states(type_, is_abstract=is_abstract)
    return True


def _output(
    type_: type[TypeBase],
    kernel_name: str,
    kernel: Callable[..., Any],
    quantities: Sequence[KernelArgument],
    rng: random.Random,
    rows: int = 0,
) -> tuple[str, ...]:
    """Expressions of a kernel's numbers; it may be undefined for some random inputs, not all."""
    who = f"{where_is(type_)}.{kernel_name}"
    for attempt in range(ATTEMPTS):
        try:
            value = kernel(*(random_quantity(q, rng) for q in quantities))
            if kernel_name in ("rate", "reset"):
                paths = state_entries(value, type_)
            else:
                paths = entries(value, *_expected(type_, kernel_name, value, rows))
        except ShapeError as error:
            raise PluginError(f"{who}: {error}") from None
        except Exception as error:
            # Python refuses what IEEE numbers make infinite, also on a side that is not taken.
            if isinstance(error, ArithmeticError) and attempt < ATTEMPTS - 1:
                continue
            reason = f"{type(error).__name__}: {error}{line_of(error, kernel)}"
            if isinstance(error, NameError):
                from dap3d_core.kernels import __all__ as kernel_words

                if error.name in kernel_words:
                    reason += f"; from dap3d_core.kernels import {error.name}"
            if isinstance(error, TypeError) and is_own(kernel):  # of numbers with rates
                reason += f"; {plain_words()}"
            raise PluginError(f"{who} failed on a random input: {reason}") from error
        scalars = [value_at(value, path) for path in paths]
        wrong = [x for x in scalars if isinstance(x, bool) or not isinstance(x, (int, float))]
        wrong = wrong or [x for x in scalars if not math.isfinite(x)]
        if not wrong:
            return tuple(paths)
        if not isinstance(wrong[0], float):
            break
    raise PluginError(f"{who} returned {wrong[0]!r} where a finite number is expected")


def _random_constants(type_: type[TypeBase], rng: random.Random) -> dict[str, Any]:
    """Constants of a random instance; ``prepare`` may refuse many of them, but not all."""
    conditions = next((dict(c) for c, class_ in type_.variants if class_ is type_), {})
    for _ in range(ATTEMPTS):
        bodies = {s: random_pose(rng) for s in body_slots(type_)}
        fields = {n: random_field(spec, rng) for n, spec in specs_of(type_).items()}
        instance = type_(**(fields | conditions))
        set_ends(instance, lambda: numbers(rng, 3))
        try:
            with catch_warnings(action="ignore"):  # of values that mean nothing
                return prepared(instance, bodies)
        except ValueError as error:
            refusal = error
    raise PluginError(
        f"{where_is(type_)}.prepare refuses random values, {ATTEMPTS} times in a row: {refusal}"
    ) from refusal


def _check_named_fields(type_: type[TypeBase], layout: InstanceLayout) -> None:
    for word, shapes, what in (
        ("actuates", ((), (3,)), "of a number or of three; name the one that an actuator sets"),
        ("regularised", ((),), "of a number; name the speed below which friction fades"),
    ):
        field = getattr(type_, word, "")
        if field and layout.numbers.get(field, (0, 0))[1] not in shapes:
            raise PluginError(f"{where_is(type_)}: {word} = {field!r} names no field {what}")


def _joint_of_friction(type_: type[TypeBase]) -> str:
    """The field of the joint by whose friction a force acts; "" where it has a law of its own."""
    if type_.kind != "force" or {"wrench", "energy", "impulse"} & set(type_.kernels()):
        return ""
    joints = [name for name, spec in specs_of(type_).items() if spec.kind == "joint"]
    if len(joints) > 1:
        raise PluginError(
            f"{where_is(type_)} has no wrench and would act by the friction of a joint, but names "
            f"several joints: {', '.join(joints)}; declare one, or define wrench"
        )
    return joints[0] if joints else ""


def _check_conditions(type_: type[TypeBase], conditions: Mapping[str, Any], variant: type) -> None:
    """A variant is for a word of a choice, the presence of another field, or an input."""
    specs = specs_of(type_)
    for name, wanted in conditions.items():
        spec = specs.get(name)
        allowed = spec.choices if spec is not None and spec.kind == "choice" else (True, False)
        known = spec is not None and (spec.kind == "choice" or spec.asks_presence)
        if not known or wanted not in (*allowed, *(spec.by_name if spec else ())):
            raise PluginError(
                f"{where_is(variant)} is the variant for {name} = {wanted!r}, "
                f"which no choice, function, input or optional number of {type_.__name__} can be"
            )


def _check_class(type_: type[TypeBase], *, is_abstract: bool = False) -> None:
    who, kind = where_is(type_), type_.kind
    if fault := fault_of_keyword(type_):
        raise PluginError(f"{who} {fault}")
    for field in attrs.fields(type_):  # type: ignore[arg-type]
        if "dap3d" not in field.metadata and field.default is attrs.NOTHING:
            raise PluginError(f"{who}: {no_field(type_, field.name)}")
    if issubclass(type_, Function) and type_.arguments not in (1, 2):
        raise PluginError(f"{who}: arguments = {type_.arguments!r}; a function takes 1 or 2")
    kernels, by_joint = type_.kernels(), bool(_joint_of_friction(type_))
    derivable = missing(type_)
    needed = {"joint": ["J", "gamma"], "force": ["wrench"], "function": ["value"]}[kind]
    acts_by_jumps = kind == "force" and "impulse" in kernels
    needed = [] if derivable or acts_by_jumps else needed
    if (is_abstract and not kernels) or by_joint:
        needed = []
    elif issubclass(type_, Joint):
        _check_rows(type_)
        if derivable and type_.velocity_rows():
            needed = ["C_dot"]
        needed = [*(["C"] if type_.position_rows() else []), *needed]
    if kind != "function" and not by_joint and not body_slots(type_):
        raise PluginError(f"{who} acts on no body; declare a field such as P_i: Point = point()")
    _check_fields(type_)
    if unknown_names(type_) or "G" in kernels:
        from dap3d_core.interface.examine.check_states import check_unknowns

        check_unknowns(type_)
    _check_members(type_)
    for name in needed:
        if name not in kernels:
            if type_.is_contact:
                name = " and ".join(one for one in DECLARED if getattr(type_, one, None) is None)
            raise PluginError(f"{who} does not define {name}")


def _check_pictures(type_: type[TypeBase], layout: InstanceLayout) -> None:
    """Check the symbol of a type, and the surfaces of a contact."""
    surfaces: Mapping[str, str] = getattr(type_, "surfaces", {})
    for slot, kind in surfaces.items():
        declared = f"{where_is(type_)}: surfaces = {{{slot!r}: {kind!r}}}"
        if slot not in layout.slots or kind not in SURFACES:
            known = f"bodies are {', '.join(layout.slots)}, surfaces {', '.join(SURFACES)}"
            raise PluginError(f"{declared}: {known}")
        if lacking := [n for n in SURFACES[kind] if not {n, f"{n}_{slot}"} & {*layout.numbers}]:
            words = f"is drawn from {', '.join(lacking)}, which the type does not have"
            raise PluginError(f"{declared} {words}")
    if not type_.symbol:
        return
    who, symbol = where_is(type_), f"symbol = {type_.symbol!r}"
    if type_.symbol not in SYMBOLS:
        raise PluginError(f"{who}: {symbol} is not one of {', '.join(SYMBOLS)}")
    stored = {name: s.kind for name, s in specs_of(type_).items() if name in layout.numbers}
    offered = {*layout.slots, *stored, *stored.values()}
    if lacking := [name for name in SYMBOLS[type_.symbol] if name not in offered]:
        raise PluginError(
            f"{who}: {symbol} is drawn from {', '.join(lacking)}, which the type does not have; "
            'name another symbol, or leave "" to draw what it declares'
        )


def _check_rows(type_: type[Joint]) -> None:
    who, rows, mask = where_is(type_), type_.rows, type_.holonomic
    if not isinstance(rows, int) or rows < 1:
        raise PluginError(f"{who} declares rows = {rows!r}; a joint has one row or more")
    if not all(isinstance(k, int) and 0 <= k < rows for k in type_.unilateral):
        raise PluginError(
            f"{who}.unilateral names rows, 0 to {rows - 1}; it is {type_.unilateral!r}"
        )
    if not isinstance(mask, bool) and len(mask) != rows:
        raise PluginError(f"{who}.holonomic needs one truth value for each of its {rows} rows")


def _fault_of_default(spec: FieldSpec) -> str:
    """The reason why a scene could not give a number as its default is; "" where it could."""
    x = spec.default
    if spec.required or x is None or spec.by_name:
        return ""
    if isinstance(x, bool) or not isinstance(x, (int, float)) or not math.isfinite(x):
        return "which is no finite number"
    if spec.positive and x <= 0.0:
        return "and is to be positive"
    low = -math.inf if spec.minimum is None else spec.minimum
    high = math.inf if spec.maximum is None else spec.maximum
    return "" if low <= x <= high else "which is out of its bounds"


def _check_fields(type_: type[TypeBase]) -> None:
    who, specs = where_is(type_), specs_of(type_)
    if sum(spec.kind == "vector2" for spec in specs.values()) > 1:
        raise PluginError(
            f"{who} declares more than one vector2, and each would have the ends P_i and P_j; "
            "declare points, and form the others in the kernel: sub(r_Q_j, r_Q_i)"
        )
    taken = {f"{q}_{s}" for q in ("r", "A", "p", "w", "mass", "Jp") for s in body_slots(type_)}
    reactions = reaction_names(type_)
    for name, spec in specs.items():
        other = specs.get(spec.across)
        if spec.across and (other is None or other.kind != "vector"):
            raise PluginError(f"{who}.{name} is across {spec.across}, which is no vector field")
        if spec.kind == "number" and (fault := _fault_of_default(spec)):
            raise PluginError(f"{who}.{name} has the default {spec.default!r}, {fault}")
        if name in taken:
            raise PluginError(f"{who} has a field {name}, which is the body's; take another name")
        if name in reactions:
            raise PluginError(
                f"{who} has a field {name}, which is the reaction of a joint that it names; take "
                "another name"
            )
        if spec.rows is not None and not (isinstance(spec.rows, int) and spec.rows > 0):
            raise PluginError(
                f"{who}.{name} is to be a joint of rows = {spec.rows!r}; take 1 or more"
            )
        slot = slot_of(name) if spec.kind in ("point", "body") else None
        if slot and slot not in body_slots(type_):
            before = SLOTS[SLOTS.index(slot) - 1]
            raise PluginError(
                f"{who}.{name} is on a body {slot}, but nothing is on a body {before}; the bodies "
                f"of a type are {', '.join(SLOTS)}, without a gap after j"
            )


def _check_members(type_: type[TypeBase]) -> None:
    """A public function that nothing calls is a misspelt kernel."""
    kind = type_.kind
    allowed = [
        *type_.kernel_names,
        "prepare",
        "prepare_functions",
        *["breaks"] * (getattr(type_, "arguments", 0) == 1),
    ]
    for name, value in vars(type_).items():
        is_public = isinstance(value, (staticmethod, FunctionType)) and not name.startswith("_")
        if is_public and name not in allowed:
            near = get_close_matches(name, allowed, 1)
            choice = f"a {kind} may define {', '.join(allowed)}"
            hint = f"did you mean {near[0]}?" if near else choice
            raise PluginError(f"{where_is(type_)} defines {name}, which nothing calls; {hint}")


def _check_names(
    type_: type[TypeBase], kernel: str, wanted: tuple[str, ...], names: Mapping[str, KernelArgument]
) -> None:
    who = f"{where_is(type_)}.{kernel}"
    unseen = {name for name, spec in specs_of(type_).items() if not spec.given}
    for name in wanted:
        if name not in names:
            hint = name_hint(type_, name, names)
            if name in reaction_names(type_):
                hint = f"reactions are known to {' and '.join(READING)} alone; "
            raise PluginError(
                f"{who} asks for {name}, which its fields do not offer; {hint}"
                f"they offer {', '.join(n for n in names if n not in unseen)}"
            )
        if names[name].velocity and kernel not in VELOCITY_KERNELS:
            raise PluginError(
                f"{who} asks for {name}, a quantity of the velocity level; "
                "at position level only positions and time may be used "
                "(move the term to gamma or wrench)"
            )


def _check_jumps(type_: type[TypeBase], outputs: Mapping[str, Sequence[str]], slots: int) -> None:
    """Check what a type says of its jumps besides the kernels themselves."""
    who, rows = where_is(type_), row_count(outputs, slots) if type_.kind == "force" else 0
    jumps = [name for name in JUMP_KINDS if name in outputs]
    if jumps and "switch" not in outputs:
        raise PluginError(
            f"{who} defines {jumps[0]}, but no switch: velocities and states jump where a switch "
            "changes its sign; define switch, a number that does so there"
        )
    if rows and "impulse" not in outputs:
        raise PluginError(f"{who} defines J without impulse, which nothing calls; define impulse")
    if not issubclass(type_, Force):
        return
    if not all(isinstance(k, int) and 0 <= k < rows for k in type_.unilateral):
        words = f"0 to {rows - 1}" if rows else "and it has none"
        raise PluginError(f"{who}.unilateral names rows of J, {words}; it is {type_.unilateral!r}")
    e = specs_of(type_).get(type_.restitution)
    if type_.restitution and (e is None or e.kind != "number" or not rows):
        raise PluginError(
            f"{who}: restitution = {type_.restitution!r} is the field of a number, the coefficient "
            "of restitution of rows J"
        )


def _expected(
    type_: type[TypeBase], kernel: str, value: Any, rows: int = 0
) -> tuple[tuple[int, ...], str]:
    """The shape that a kernel should return, and words for it; rows: of J, for ``impulse``."""
    slots = len(body_slots(type_))
    if kernel == "impulse":
        if rows and type_.kind == "force":
            return (rows,), f"{rows} numbers, the change of J v, one for each row of J"
        return (slots, 2, 3), f"(impulse, moment of impulse) for each of {slots} bodies"
    if kernel == "J" and type_.kind == "force":
        count = max(1, size(checked_shape(value)) // (6 * slots))
        return (slots, count, 6), f"a block of rows x 6 for each of {slots} bodies"
    if kernel == "resist":
        return (2,), "2 numbers, lengths of rolling and of spinning"
    if kernel in ("switch", "tension", "grip", "seam", "knot"):
        shape = (len(value),) if isinstance(value, tuple) and value else ()
        return shape, "one number, or a tuple of numbers"
    if kernel in ("wrench", "friction"):
        return (slots, 2, 3), f"(force, moment) for each of {slots} bodies"
    if issubclass(type_, Function):
        shape, words = VALUES[type_.arguments]
        return shape if isinstance(value, (tuple, list)) else (), words
    if not issubclass(type_, Joint) or kernel in type_.declared:  # of contacts
        return ((3,), "3 numbers") if kernel in VECTORS else ((), "one number")
    if kernel == "G":
        n, k = len(type_.position_rows()), len(unknown_names(type_))
        return (n, k), f"{n} rows of the derivatives of C by its {k} unknowns"
    if kernel == "J":
        return (slots, type_.rows, 6), f"a block of {type_.rows} x 6 for each of {slots} bodies"
    if kernel in ("C", "C_dot"):
        level = "position" if kernel == "C" else "velocity"
        n = len(type_.position_rows() if kernel == "C" else type_.velocity_rows())
        return (n,), f"{n} number{'s' * (n != 1)}, one for each row of the {level} level"
    return (type_.rows,), f"{type_.rows} number{'s' * (type_.rows != 1)}, one for each row"
