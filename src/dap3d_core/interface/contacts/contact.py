"""The base class of contact types."""

from collections.abc import Callable, Mapping
from inspect import signature
from itertools import pairwise
from typing import Any, ClassVar

from dap3d_core.interface.contacts.resistance import RESISTED
from dap3d_core.interface.element_states import add_fields
from dap3d_core.interface.fields import FieldSpec, choice, field_of, number, slot_of
from dap3d_core.interface.types import Joint, TypeBase

#: What authors define.
DECLARED = ("gap", "normal")
#: What they may define besides.
OPTIONAL = ("at", "reach", "seam", "along", "grip", "grain", "resist")
#: Kinds of surfaces in pictures -> the fields, with the letter of the body or without it, and
#: numbers of ``prepare``, that each is drawn from (view/scene3d/contact_shapes.py).
SURFACES: Mapping[str, tuple[str, ...]] = {
    "sphere": ("P", "radius"),
    "shell": ("P", "radius"),
    "box": ("P", "size"),
    "disk": ("P", "a", "radius"),
    "cylinder": ("P", "a", "radius", "length"),
    "capsule": ("P", "Q", "radius"),
    "curve": ("P", "samples", "is_closed"),
}
#: Fields that a material gives.
MATERIAL = ("mu", "mu_s", "mu_roll", "mu_spin", "e", "law")
#: Values of ``law``.
LAWS = ("poisson", "newton")
#: Initial mode of a contact that touches as the scene is assembled.
TOUCHES = 1.0
_ZERO = (0.0, 0.0, 0.0)
#: Fields that a run knows best: which point it is, kg that forces are measured by, and the initial
#: values of its states.
HIDDEN: dict[str, Any] = {
    "part": 0.0, "unit_mass": 1.0, "mode_0": 0.0, "way_0": _ZERO, "near_0": _ZERO,
    "mode_atol": 0.0, "way_atol": 0.0, "near_atol": 0.0,
}  # fmt: skip
#: What a contact without friction has in place of a material.
SMOOTH: dict[str, Any] = {"mu": 0.0, "mu_s": 0.0, "law": "poisson", "touch": False}


class Contact(Joint):
    """Two bodies, i and j, that may touch at one point, where friction holds or lets slip.

    Subclasses define three pure functions of quantities of the position level:

    * ``gap``     the distance, m, negative where the bodies overlap;
    * ``at``      the point of contact, global axes;
    * ``normal``  the unit vector there that points from body j to body i.

    A fourth is for surfaces that end, as edges do: ``reach``, not negative while the point of
    contact is on both of them. Where it becomes negative the contact opens, whatever its force, and
    beyond it nothing touches. ``seam`` is for surfaces of several parts, one or more numbers that
    change sign where the point goes from one to the next: the force may jump there with the
    curvature, and a step ends.

    Without ``at`` the gap is an angle, m being rad, and the normal the axis of a moment on body i,
    which alone acts: the rate of the gap is the angular velocity of body i less that of body j
    along it.

    A law of friction other than mu and mu_s is ``grip``: the coefficient at a ``speed`` of slip,
    m/s, which it may name besides what the others may; continuous, also a little below zero. What
    sticks holds up to that of no speed. Two coefficients are along ``grain``, a vector of the
    position level, and across it: friction is within the ellipse of both. It has fields mu and mu_s
    if it names them.

    Moments resist that bodies roll and spin over each other, up to lengths times the normal force:
    ``resist`` returns those of rolling and of spinning about the normal, m. Without it they are
    the fields mu_roll and mu_spin; it has these fields if it names them.

    Dry friction of a size of its own, as of seals, has no gap and no normal, but ``along``: the
    unit vector that body i slides along at the point ``at``, or without that turns about.
    ``prepare`` returns what it is where it slides, ``mu``, and the most where it sticks, ``mu_s``,
    N or N m.

    Friction of a joint, ``class OfHinge(Contact, of=Hinge)``, has no gap either, but ``load``, the
    rows of the joint whose multipliers together (the root of the sum of their squares) press its
    surfaces; of a row in ``unilateral`` it is what pushes. It slides along ``along``, or in the
    plane across ``normal``, or without both in every direction; at the point ``at``, or turns. The
    fields that these functions name, points and vectors are those of the joint; ``mu``, ``mu_s``
    and of what turns ``radius`` come from the force that switches the friction on.

    Rows, right-hand sides, slip and friction follow from them: one of the normal, two across it, of
    the velocity of body i at the point of contact less that of body j. The gap must be such that
    its rate is that velocity along the normal, as of every distance between smooth surfaces
    (``dap3d check-plugin`` compares them). Rates of the point and the normal, which move over both
    bodies, are derived.

    Attributes:
        surfaces: body slot -> what it touches with in pictures, one of SURFACES.
        points: at how many points the bodies may touch. Each is a contact of its own, whose
            ``part``, 0 and so on, ``prepare`` reads: it returns what differs between them.
        is_smooth: without friction, and without fields of a material but ``e``.
        shared: of a variant of a force, the fields of that force that it has, too.
        load: of friction of a joint, adjacent rows of the joint.
        pushes: that load is of one row, and none where that pulls.
        resists: of what resists at another contact (resistance.py), "roll" or "spin".
        holds: which of its three rows act where it sticks.
    """

    kernel_names: ClassVar[tuple[str, ...]] = (  # type: ignore[assignment]
        *DECLARED, *OPTIONAL, *Joint.kernel_names, "tension", "knot"
    )  # fmt: skip
    rows = 3
    holonomic: ClassVar[bool | tuple[bool, ...]] = (True, False, False)
    is_contact: ClassVar[bool] = True
    declared: ClassVar[tuple[str, ...]] = (*DECLARED, *OPTIONAL)
    surfaces: ClassVar[Mapping[str, str]] = {}
    points: ClassVar[int] = 1
    is_smooth: ClassVar[bool] = False
    shared: ClassVar[tuple[str, ...]] = ()
    load: ClassVar[tuple[int, ...]] = ()
    pushes: ClassVar[bool] = False
    resists: ClassVar[str] = ""
    holds: ClassVar[tuple[bool, bool, bool]] = (True, True, True)
    at: ClassVar[Any] = None
    along: ClassVar[Any] = None
    grip: ClassVar[Any] = None
    resist: ClassVar[Any] = None
    normal: ClassVar[Any] = None

    def __init_subclass__(cls, of: type[TypeBase] | None = None, **conditions: Any) -> None:
        if "kernel_names" not in vars(cls):
            cls.states = {"mode": 1, "way": 3, "near": 3}
            if of is not None:
                add_fields(cls, _shared_fields(cls, of))
            _add_material(cls)
            if cls.load:
                pushing = getattr(of, "unilateral", ())
                cls.holonomic = False
                cls.pushes = len(cls.load) == 1 and pushing is not True and cls.load[0] in pushing
            is_whole = all(getattr(cls, name, None) is not None for name in DECLARED)
            if not cls.load and (cls.along is not None or is_whole):
                for name, kernel in _kernels(cls).items():
                    setattr(cls, name, kernel)
            cls.holds = _holds(cls)
        if of is not None and cls.load:
            of.grips = (*vars(of).get("grips", ()), cls)  # type: ignore[attr-defined]
        elif of is not None:  # class RigidStop(Contact, of=SpringStop, k=False): no stiffness
            of.variants, conditions = (*of.variants, (conditions, cls)), {}
        super().__init_subclass__(**conditions)

    @classmethod
    def kernels(cls) -> dict[str, Callable[..., Any]]:
        """As of other types; those of friction of a joint are made where a scene has some."""
        if cls.load and "gamma" not in vars(cls):
            for name, kernel in _kernels(cls).items():
                setattr(cls, name, staticmethod(kernel))
        return super().kernels()

    @classmethod
    def has_law(cls) -> bool:
        """True if what it says ends with coefficients, which kernels find."""
        return cls.grip is not None or bool(cls.resists)

    @classmethod
    def is_friction_alone(cls) -> bool:
        """True of what has no gap: it slides or sticks, and is never open."""
        return bool(cls.load) or cls.along is not None

    def prepare(self, bodies: Mapping[str, Any]) -> dict[str, Any]:
        """The coefficient of sticking friction where it is that of sliding, those of moments."""
        given: Any = self
        mu_s = given.mu if given.mu_s is None else given.mu_s
        if not self.load or self.resists:
            return {"mu_s": mu_s}
        arm = 1.0 if self.at is not None else given.radius
        return {"mu": arm * given.mu, "mu_s": arm * mu_s}


def hidden(value: Any) -> Any:
    """A field that no scene gives."""
    return field_of(FieldSpec("vec3" if isinstance(value, tuple) else "number", value, given=False))


def _add_material(class_: type) -> None:
    """Give a class the fields of its material, unless it has them."""
    e = number(0.0, minimum=0.0, maximum=1.0, doc="coefficient of restitution")
    fields = {
        "mu": number(0.0, minimum=0.0, doc="coefficient of friction of sliding"),
        "mu_s": number(None, minimum=0.0, doc="the same of sticking; mu where it is left out"),
        "e": e,
        "law": choice(LAWS, "poisson", doc="of impacts: whose coefficient e is"),
        "touch": choice((False, True), False, doc="the bodies are moved until they touch at t = 0"),
    }
    if class_.at is not None:  # type: ignore[attr-defined]
        for name, what in RESISTED.values():
            doc = f"moment against {what} over the force that presses"
            fields[name] = number(0.0, minimum=0.0, unit="m", doc=doc)
    alone = class_.is_friction_alone()  # type: ignore[attr-defined]
    if class_.is_smooth or alone:  # type: ignore[attr-defined]
        fields = {name: hidden(0.0) for name in ("e", "mu", "mu_s")}
        fields |= {} if alone else {"e": e}
        if class_.load and class_.at is None and not class_.resists:  # type: ignore[attr-defined]
            fields["radius"] = hidden(1.0)
    if class_.grip is not None:  # type: ignore[attr-defined]
        unread = {"mu", "mu_s"} - set(signature(class_.grip).parameters)  # type: ignore[attr-defined]
        fields |= {name: hidden(0.0) for name in unread}
    if class_.resist is not None:  # type: ignore[attr-defined]
        read = signature(class_.resist).parameters  # type: ignore[attr-defined]
        fields |= {name: hidden(0.0) for name, _ in RESISTED.values() if name not in read}
    fields |= {name: hidden(value) for name, value in HIDDEN.items()}
    add_fields(class_, fields)


def _shared_fields(class_: Any, of: type[TypeBase]) -> dict[str, Any]:
    """Fields that a class has of the force, or the joint, that it belongs to."""
    from dap3d_core.interface.codegen.kernel_arguments import parameters

    specs = _specs(of)
    if not class_.load:
        return {name: field_of(specs[name]) for name in class_.shared}
    named = {n for k in ("along", "at", "normal") if k in vars(class_)
             for n in parameters(vars(class_)[k])}  # fmt: skip
    places = ("body", "point", "vector", "vector2")
    return {n: field_of(s) for n, s in specs.items() if s.kind in places or n in named}


def _holds(class_: Any) -> tuple[bool, bool, bool]:
    """Rows of a contact that act where it sticks: normal, and two across it."""
    if class_.is_friction_alone():
        every = class_.along is None and class_.normal is None
        return every, True, class_.along is None
    return True, not class_.is_smooth, not class_.is_smooth


def _specs(class_: type) -> dict[str, FieldSpec]:
    """Declared fields of a class, before attrs has made them, and of its bases."""
    found: dict[str, FieldSpec] = {}
    for base in class_.__mro__:
        made = {a.name: a for a in vars(base).get("__attrs_attrs__", ())}
        for name, field in {**made, **vars(base)}.items():
            spec = getattr(field, "metadata", {}).get("dap3d")
            if spec is not None:
                found.setdefault(name, spec)
    return found


def _kernels(class_: Any) -> dict[str, Callable[..., Any]]:
    """The kernels of a type of contact, from those that it declares."""
    # imported here: finding types by keyword does not need kernels
    from dap3d_core.interface.codegen.kernel_arguments import parameters
    from dap3d_core.interface.codegen.specialise import bound_kernel
    from dap3d_core.interface.contacts import grips, loaded, rates, rows

    names_of = [n for n in (*DECLARED, *OPTIONAL) if getattr(class_, n, None) is not None]
    declared = {name: getattr(class_, name) for name in names_of}
    specs = _specs(class_)
    has_j = any(slot_of(name) == "j" or spec.kind == "vector2" for name, spec in specs.items())
    calls, wanted = _expressions(declared, specs)
    if not has_j:
        calls |= dict.fromkeys(("r_j", "v_j", "w_j"), "(0.0, 0.0, 0.0)")
    kernels = {f"{name}__": kernel for name, kernel in declared.items()}
    every: dict[str, Any] = kernels | {"rate_of__": rates.rate_of, "turned__": rates.turned}

    if class_.load:
        how = class_.resists or ("push" if class_.pushes else "")
        table = loaded.kernels_of(calls, wanted, every, how=how)
    elif "along" in declared:
        table = grips.KERNELS if "at" in declared else grips.TURNING
    else:
        table = dict[str, Any](rows.KERNELS if "at" in declared else rows.TURNING)
        for name in rows.KERNELS_WITH.keys() & declared.keys():
            table |= rows.KERNELS_WITH[name]

    def bound(name: str, kernel: Callable[..., Any]) -> Any:
        given = {n: calls[n] for n in parameters(kernel) if n in calls}
        needed = dict.fromkeys(n for short in given for n in wanted.get(short, ()))
        part = "[0]" if name in ("J", "friction") and not has_j else ""  # that of body i
        return bound_kernel(kernel, given, needed, every, f"return {{}}{part}")

    return {name: bound(name, kernel) for name, kernel in table.items()}


def _expressions(
    declared: Mapping[str, Callable[..., Any]], specs: Mapping[str, FieldSpec]
) -> tuple[dict[str, str], dict[str, list[str]]]:
    """Expressions for parameters of kernels, by what authors declare, and the names in each."""
    from dap3d_core.interface.codegen.kernel_arguments import parameters

    kinds, slopes = {name: spec.kind for name, spec in specs.items()}, _slopes(specs)
    calls, wanted = dict[str, str](), dict[str, list[str]]()
    shorts = {"gap": "gap", "c": "at", "n": "normal", "e": "along", "grain": "grain"}
    for short, name in shorts.items():
        if name not in declared:
            continue
        names = parameters(declared[name])
        changes = [slopes.get(n) or _rate_name(n, kinds) for n in names]
        calls[short] = f"{name}__({', '.join(names)})"
        calls[f"{short}_dot"] = f"rate_of__({name}__, ({_list(names)}), ({_list(changes)}))"
        wanted[short] = list(names)
        found = [c.removeprefix("turned__(").strip("(,)").split(", ") for c in changes]
        of_rates = [n for c in found for n in c if n not in ("None", "1.0", "") and n not in names]
        wanted[f"{short}_dot"] = [*names, *of_rates]
    if "reach" in declared:
        wanted["reach"] = list(parameters(declared["reach"]))
        calls["reach"] = f"reach__({', '.join(wanted['reach'])})"
    else:
        calls["reach"] = "1.0"
    if "seam" in declared:
        wanted["seam"] = list(parameters(declared["seam"]))
        calls["seam"] = f"seam__({', '.join(wanted['seam'])})"
    if "grain" not in declared:
        calls |= {"grain": "None", "grain_dot": "None"}
    if "grip" in declared:
        given = parameters(declared["grip"])
        wanted["grip"] = wanted["hold"] = [name for name in given if name != "speed"]
        calls["grip"] = f"lambda speed: grip__({', '.join(given)})"
        calls["hold"] = f"grip__({', '.join('0.0' if n == 'speed' else n for n in given)})"
    else:
        wanted |= {"grip": ["mu"], "hold": ["mu_s"]}
        calls |= {"grip": "lambda speed: mu", "hold": "mu_s"}
    if "resist" in declared:
        wanted["resist"] = list(parameters(declared["resist"]))
        calls["resist"] = f"resist__({', '.join(wanted['resist'])})"
    return calls, wanted


def _slopes(specs: Mapping[str, FieldSpec]) -> dict[str, str]:
    """Names of functions that kernels call -> their partial derivatives, by name."""
    found: dict[str, str] = {}
    for name, spec in specs.items():
        if spec.kind != "function" or not spec.argument:
            continue
        f = "f" if name == "function" else name
        if spec.arguments == 1:
            orders = [f"{f}{suffix}" for suffix in ("", "_dot", "_ddot", "_dddot")]
            found |= {a: f"({b},)" for a, b in pairwise(orders)} | {orders[-1]: "()"}
        else:
            found |= {f: f"({f}_x, {f}_y)", f"{f}_x": f"({f}_xx, {f}_xy)"}
            found |= {f"{f}_y": f"({f}_xy, {f}_yy)"}
            found |= {f"{f}_{which}": "()" for which in ("xx", "xy", "yy")}
    return found


def _list(words: Any) -> str:
    return "".join(f"{word}, " for word in words)


def _rate_name(name: str, kinds: Mapping[str, str]) -> str:
    """Expression for the rate of a quantity; None of a constant."""
    head, _, rest = name.partition("_")
    if name == "t":
        return "1.0"
    if kinds.get(name) in ("vector", "vector2"):
        return f"{name}_dot"
    if kinds.get(name) == "angle":
        return f"{name}_dot"
    if name in kinds:
        return "None"
    if head == "r" and rest:
        return f"v_{rest}"
    if head == "A" and rest:
        return f"turned__(w_{rest}, {name})"
    if (head == "s" and rest) or slot_of(name):
        return f"{name}_dot"
    return "None"
