"""Quantities of a result by name, as plots and tables ask for them: ``crank.r.z``."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.registry.suggestions import nearest
from dap3d_core.result.errors import LISTED, UnknownNameError
from dap3d_core.result.quantities.catalogue import (
    ACTIONS,
    AXES,
    KINDS,
    POINT_ARRAYS,
    SLOTS,
    WHOLE,
    Owner,
)

if TYPE_CHECKING:
    from dap3d_core.result.result import Result

NORM = "norm"
#: Kinds whose names a result knows without its scene; forces are looked for after them.
NAMED = ("body", "point", "joint")


class Quantity(NamedTuple):
    """A quantity over the reported instants.

    Attributes:
        name: as it was asked for.
        values: (nt,), or (nt, components).
        kind: what it is, without whose: "velocity".
        label: what it is in words: "velocity of crank, z".
        unit: SI unit, "1" for none, "SI" where it depends on the row.
        components: names of the columns; empty for (nt,).
        owner: "body", "point", "joint" or "force"; "" for a quantity of the whole.
        rate: name of the quantity that is its derivative in time, "" where none is.
    """

    name: str
    values: Floats
    kind: str
    label: str
    unit: str
    components: tuple[str, ...]
    owner: str = ""
    rate: str = ""


def find(result: "Result", name: str) -> Quantity:
    """A quantity of a result.

    A whole vector, ``crank.r``; a component, ``crank.r.z``; or its length, ``crank.r.norm``. Where
    a body and a point share a name, the body is meant unless only the point has the quantity; a
    joint goes before a force of its name.

    Args:
        result: whose quantity.
        name: ``BODY.`` r p rd w wp rdd wd wpd; ``POINT.`` r v a (also rP rPd rPdd); ``JOINT.`` or
            ``JOINT.SLOT.`` force moment force_body moment_body moment_at_point, without a slot on
            the body of the first; ``JOINT.lambda`` (rows from 1); ``FORCE.`` or ``FORCE.SLOT.``
            the same but lambda, ``FORCE.`` length length_rate tension energy; energy.kinetic
            .potential .total; work; constraint.position .velocity .acceleration; t.

    Raises:
        UnknownNameError: there is no such quantity; names the nearest.
        ResultError: reactions and forces of a result whose model cannot be had.
        TypeError: the name is no text.
    """
    if not isinstance(name, str):
        raise TypeError(f"a quantity is named by text such as 'crank.r.z', not by {name!r}")
    if name in WHOLE:
        words, unit, of = WHOLE[name]
        return Quantity(name, of(result), words, words, unit, ())
    for kinds in (NAMED, ("force",)):
        for owner, attribute, component in _readings(result, name, kinds):
            found = _read(result, name, owner, attribute, component)
            if found is not None:
                return found
    raise _unknown(result, name)


def _read(
    result: "Result", name: str, owner: Owner, attribute: str, component: str
) -> Quantity | None:
    """The quantity of an owner, None where it has no such."""
    meant = KINDS[owner.kind].get(attribute)
    if meant is None:
        return None
    columns = _components(result, owner, attribute)
    label = f"{meant.words} of {owner.shown}"
    rate = f"{owner.shown}.{meant.rate}" if meant.rate else ""
    if not component:
        values = meant.values(result, owner)
        return Quantity(name, values, meant.words, label, meant.unit, columns, owner.kind, rate)
    label = f"{label}, {component}"
    if component == NORM and meant.components is AXES:
        values, rate = np.linalg.norm(meant.values(result, owner), axis=1), ""
    elif component in columns:
        values = meant.values(result, owner)[:, columns.index(component)]
        rate = f"{rate}.{component}" if rate else ""
    else:
        return None
    return Quantity(name, values, meant.words, label, meant.unit, (), owner.kind, rate)


def _components(result: "Result", owner: Owner, attribute: str) -> tuple[str, ...]:
    if attribute == "lambda" and owner.kind == "joint":
        return tuple(str(k + 1) for k in range(result.subject.joint_rows[owner.place]))
    return KINDS[owner.kind][attribute].components


def _places(result: "Result", kinds: Iterable[str] = tuple(KINDS)) -> dict[str, Mapping[str, int]]:
    """Names of each kind with their places; those of forces are read from the scene."""
    subject = result.subject
    found: dict[str, Mapping[str, int]] = {}
    for kind in kinds:
        if kind == "force":
            found[kind] = {name: k for k, name in enumerate(result.force_names)}
        else:
            found[kind] = getattr(subject, f"{kind}_index")
    return found


def _owners(result: "Result", shown: str, kinds: Iterable[str] = tuple(KINDS)) -> list[Owner]:
    """Who may be meant by a name, with a slot behind it or not."""
    head, _, slot = shown.rpartition(".")
    found = []
    for kind, places in _places(result, kinds).items():
        if shown in places:
            found.append(Owner(kind, shown, places[shown]))
        elif kind in ("joint", "force") and slot in SLOTS and head in places:
            found.append(Owner(kind, head, places[head], slot))
    return found


def _readings(result: "Result", name: str, kinds: Iterable[str]) -> list[tuple[Owner, str, str]]:
    """Ways to read a name as (owner, attribute, component or "")."""
    parts = name.split(".")
    found = []
    for tail in (2, 1)[len(parts) < 3 :]:
        attribute, component = parts[-tail], parts[-1] if tail == 2 else ""
        for owner in _owners(result, ".".join(parts[:-tail]), kinds):
            meant = POINT_ARRAYS.get(attribute, attribute) if owner.kind == "point" else attribute
            if not owner.slot or meant in ACTIONS:
                found.append((owner, meant, component))
    return found


def _unknown(result: "Result", name: str) -> UnknownNameError:
    """What is wrong with a name: its owner, its attribute or its component."""
    parts = name.split(".")
    for size in (2, 1):  # an animation point has a dot in its name
        for owner in _owners(result, ".".join(parts[:size])):
            words = _fault(result, owner, parts[size:])
            return UnknownNameError(words, _mended(result, owner.shown, parts[size:]))
    whole = nearest(name, WHOLE)
    heads = [w for w in WHOLE if w.startswith(f"{parts[0]}.")]
    if heads or len(parts) == 1:
        choices = heads or ["BODY.r", "BODY.w.z", "POINT.v", "JOINT.force.norm", *WHOLE]
        words = f"there is no quantity {name!r}; there are {', '.join(choices)}"
        return UnknownNameError(words, whole)
    size = 2 if parts[0] == "animation" and len(parts) > 2 else 1
    given = ".".join(parts[:size])
    names = {kind: tuple(places) for kind, places in _places(result).items()}
    words = f"there is no body, point, joint or force {given!r}"
    near = nearest(given, [n for of_kind in names.values() for n in of_kind])
    if not near and sum(map(len, names.values())) <= LISTED:
        words += "".join(f"; {kind}: {', '.join(known)}" for kind, known in names.items() if known)
    return UnknownNameError(words, _mended(result, near, parts[size:]))


def _attributes(owner: Owner) -> tuple[str, ...]:
    """What may stand after an owner."""
    return tuple(ACTIONS if owner.slot else KINDS[owner.kind])


def _fault(result: "Result", owner: Owner, rest: list[str]) -> str:
    attributes = _attributes(owner)
    if not rest:
        return f"which quantity of the {owner.kind} {owner.shown!r}: {', '.join(attributes)}"
    if rest[0] not in attributes:
        return f"the {owner.kind} {owner.shown!r} has {', '.join(attributes)}, not {rest[0]!r}"
    columns = _parts(result, owner, rest[0])
    there = ", ".join(columns) if columns else "no components"
    return f"{owner.shown}.{rest[0]} has {there}, not {'.'.join(rest[1:])!r}"


def _mended(result: "Result", shown: str, rest: list[str]) -> str:
    """The nearest right name of a quantity of an owner, or ""."""
    if not rest:
        return ""
    for owner in _owners(result, shown):
        attribute = nearest(rest[0], _attributes(owner))
        if attribute:
            columns = _parts(result, owner, attribute)
            component = nearest(rest[1], columns) if len(rest) > 1 else ""
            return ".".join([shown, attribute, *([component] if component else [])])
    return ""


def _parts(result: "Result", owner: Owner, attribute: str) -> tuple[str, ...]:
    """What may stand after an attribute."""
    columns = _components(result, owner, attribute)
    return (*columns, NORM) if KINDS[owner.kind][attribute].components is AXES else columns


def names_of(result: "Result", begin: str = "") -> list[str]:
    """Names of quantities that go on from a beginning, one part further, in the scene's order.

    Args:
        result: whose quantities.
        begin: what there is of a name: "" gives all owners, "crank." what a body has, "crank.r."
            the components, "J1.j." what a joint does to its second body.

    Returns:
        Whole names, and names of owners, which end in a dot.
    """
    owners = [name for places in _places(result).values() for name in places]
    found = [*(f"{name}." for name in owners), *WHOLE]
    head = begin.rpartition(".")[0]
    shown, _, attribute = head.rpartition(".")
    for owner in _owners(result, head):
        found += [f"{head}.{one}" for one in _attributes(owner)]
    for owner in _owners(result, shown):
        if attribute in _attributes(owner):
            found += [f"{head}.{part}" for part in _parts(result, owner, attribute)]
    found = [name for name in dict.fromkeys(found) if name.startswith(begin) and name != begin]
    if len(found) == 1 and found[0].endswith("."):
        return names_of(result, found[0])
    return found
