"""Laws that steps may pass over, because their types do not say where they change."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.kernels import lookup, where
from dap3d_core.kernels.runtime.source_digest import reached
from dap3d_core.model.groups import Grouping
from dap3d_core.model.knots import breaks_are_told, breaks_of
from dap3d_core.model.model import ReferencePoses
from dap3d_core.result import information
from dap3d_core.scene import Instance, ValidatedScene

#: Functions of kernels that choose between formulas.
CHOOSING = (where, lookup)
#: Kernels that make the law of a force, and those of its states.
LAWS = ("wrench", "energy")
STATES = ("rate",)
#: Python's own words for a number with a corner, and that of an angle: it jumps at half a turn.
CORNERS = ("abs", "min", "max", "atan2")
#: Distance from a knot, of the largest one; least jump of a curvature, of the largest at SAMPLES.
NEAR, JUMP, SAMPLES = 1e-7, 1e-3, 33


def notes_on_laws(checked: ValidatedScene) -> list[str]:
    """Functions of an argument, and laws with branches, that do not say where they change."""
    functions = {function.name: function for function in checked.functions}
    elements = (*checked.joints, *checked.forces)
    called = dict.fromkeys(
        name
        for element in elements
        for field in element.type_info.argument_functions
        if (name := element.values[field]) is not None
    )
    found = [
        f"functions.{name} ({functions[name].type_info.type.keyword}): its type says neither where "
        "it takes another form (breaks) nor that it does not (smooth): steps may pass over what it "
        "does over a short way"
        for name in called
        if not breaks_are_told(functions[name])
    ]
    return found + [
        information(
            f"{forces}: its law has branches and its type no switch: steps go across them, and may "
            "pass over a short one"
        )
        for forces in _without_switch(checked, LAWS)
    ]


def notes_on_derivatives(checked: ValidatedScene) -> list[str]:
    """Laws with branches or corners at which no step ends: what derivatives of a run are there."""
    found = [
        f"derivatives: {forces} has a law with branches or corners and no switch: where the motion "
        "passes a jump of it, they are wrong from there on; at a corner they are good to a part of "
        "a thousand or so, whatever the tolerance"
        for forces in _without_switch(checked, (*LAWS, *STATES), CORNERS)
    ]
    return found + [
        f"derivatives: contacts.{contact.name} rubs along functions.{function.name} "
        f"({function.type_info.type.keyword}), whose curvature jumps: where it passes that, they "
        "are wrong from there on; types such as b and spline have none"
        for contact in checked.contacts
        if contact.values.get("mu") != 0.0
        for function in checked.functions
        if function.name in map(contact.values.get, contact.type_info.argument_functions)
        and _bends_at_once(checked, function)
    ]


def _bends_at_once(checked: ValidatedScene, function: Instance) -> bool:
    """True if the second derivative of a function of one argument jumps where it changes form."""
    type_: Any = function.type_info.type
    knots = breaks_of(function)
    if type_.arguments > 1 or not knots.size:
        return False
    f = Grouping("function", ReferencePoses(checked), 0, checked.functions).callable_of(function)
    beside = NEAR * np.max(np.abs(knots))
    jumps = [abs(f(x + beside)[2] - f(x - beside)[2]) for x in knots]
    between = [abs(f(x)[2]) for x in np.linspace(knots.min(), knots.max(), SAMPLES)]
    return bool(max(jumps) > JUMP * max(between))


def _without_switch(
    checked: ValidatedScene, names: Sequence[str], corners: Sequence[str] = ()
) -> Iterator[str]:
    """For each type without a switch whose laws choose between formulas: its forces, in words."""
    of_types: dict[Any, list[Instance]] = {}
    for force in checked.forces:
        if "." not in force.name:  # those that joints bring move nothing
            of_types.setdefault(force.type_info.type, []).append(force)
    for type_, (first, *others) in of_types.items():
        info = first.type_info
        if "switch" not in info.kernels and _chooses(info, names, corners):
            more = f" and {len(others)} more" if others else ""
            yield f"{type_.kind}s.{first.name}{more} ({type_.keyword})"


def _chooses(type_info: TypeInfo, names: Sequence[str], corners: Sequence[str]) -> bool:
    """True if a law of a type chooses between formulas, or calls one of Python's with a corner."""
    laws = [type_info.kernels[name] for name in names if name in type_info.kernels]
    return any(
        plain.__globals__.get(name) is word or name in corners
        for plain in reached(*laws)[0]
        for name in plain.__code__.co_names
        for word in CHOOSING
    )


def notes_on_drivers(checked: ValidatedScene) -> list[str]:
    """Drivers between bodies that nothing else connects: allowed, and perhaps a joint is missing.

    Bodies are connected by a chain of joints, ground among them, or by another driver.
    """
    drivers = [joint for joint in checked.joints if _drives(joint)]
    if not drivers:
        return []
    names = ("ground", *checked.body_names)
    part = list(range(len(names)))

    def top(body: int) -> int:
        while part[body] != body:
            part[body] = body = part[part[body]]
        return body

    for joint in checked.joints:
        if not _drives(joint):
            for body in joint.bodies[1:]:
                part[top(body)] = top(joint.bodies[0])
    ends = [tuple(sorted({top(body) for body in driver.bodies})) for driver in drivers]
    count = Counter(ends)
    return [
        information(
            f"joints.{driver.name}: no other joint connects "
            f"{' and '.join(names[body] for body in driver.bodies)}; a driver prescribes one "
            "freedom and leaves the others as they are"
        )
        for driver, parts in zip(drivers, ends, strict=True)
        if len(parts) > 1 and count[parts] == 1
    ]


def _drives(joint: Instance) -> bool:
    return bool(getattr(joint.type_info.type, "drives", False))
