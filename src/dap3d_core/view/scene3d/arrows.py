"""Reactions of joints, forces of force elements and of contacts as arrows over the instants."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.result import Result, ResultError, UnknownNameError
from dap3d_core.result.post.reactions import Reaction
from dap3d_core.view.scene3d.elements import ORIGIN, ElementGeometry, Elements
from dap3d_core.view.scene3d.primitives import pack

#: An arrow below this fraction of the largest of its kind is left out.
SMALLEST = 1e-9
#: Greatest lengths of the longest arrow and of the usual one, as fractions of the scene's size.
LONGEST, USUAL = 0.36, 0.16
#: Pairs of shapes whose forces are drawn at most.
MOST_PAIRS = 200


def arrows_of(result: Result, elements: Elements, size: float) -> dict[str, Any]:
    """The arrows of a page and their scales.

    The force of a contact on body i is at the point of contact, which moves. A joint's reaction is
    that on the body of its first slot, at the joint's point there; the other body feels the
    opposite force. A force element has an arrow on each of its moving bodies.

    Args:
        result: its instants are those of the page.
        elements: joints and forces.
        size: of the scene, m.

    Returns:
        ``arrows``: ``layer``, ``what``, ``name``, ``body``, ``at``, packed ``values`` (nt, 3) N or
        N m, global axes, of contacts packed ``places`` (nt, 3) m; ``scales``: m for one N, m for
        one N m; ``notes``.
    """
    notes: list[str] = []
    every = [
        *_reactions(result, elements), *_applied(result, elements, notes), *_contacts(result),
        *_shape_contacts(result, notes),
    ]  # fmt: skip
    scales, arrows, least = {}, [], 0.0
    for what in ("force", "moment"):
        alike = [
            (one, np.linalg.norm(one["values"], axis=1)) for one in every if one["what"] == what
        ]
        largest = max((float(length.max()) for _, length in alike), default=0.0)
        least = max(least * size, SMALLEST * largest)  # forces that cancel leave rounding moments
        visible = [(arrow, length) for arrow, length in alike if length.max() > least]
        scales[what] = _scale([length for _, length in visible], size)
        arrows += [
            {n: pack(v) if n in ("values", "places") else v for n, v in arrow.items()}
            for arrow, _ in visible
        ]
    return {"arrows": arrows, "scales": scales, "notes": notes}


def _scale(lengths: list[Floats], size: float) -> float:
    """Metres for one N or N m: peaks, as of impacts, may be longer than usual."""
    if not lengths:
        return 1.0
    peak = max(float(np.max(length)) for length in lengths)
    usual = max(float(np.median(length)) for length in lengths)
    middle = np.sqrt(max(usual, 1e-3 * peak) * peak)
    return float(min(LONGEST / peak, USUAL / middle) * size)


def _reactions(result: Result, elements: Elements) -> Iterator[dict[str, Any]]:
    every = result.reactions() if elements.joints else {}
    for joint in (one for one in elements.joints if one.name in every):  # contacts have none
        slot, reaction = next(iter(every[joint.name].items()))
        yield from _pair("reactions", joint, slot, reaction)


def _applied(result: Result, elements: Elements, notes: list[str]) -> Iterator[dict[str, Any]]:
    for force in elements.forces:
        try:
            applied = result.force(force.name)
        except UnknownNameError:  # it acts in a joint
            continue
        except ResultError as error:
            notes.append(f"arrows of force {force.name} are not drawn: {error}")
            continue
        for slot, action in applied.on.items():
            if force.bodies.get(slot):
                yield from _pair("forces", force, slot, action)


def _contacts(result: Result) -> Iterator[dict[str, Any]]:
    for name in result.contact_names:
        contact = result.contact(name)
        forces, places = (x.reshape(len(result.t), -1, 3) for x in (contact.force, contact.at))
        for k in range(forces.shape[1]):
            if np.all(np.isfinite(forces[:, k])):
                yield {"layer": "contacts", "what": "force", "name": name, "body": 0, "at": ORIGIN,
                       "values": forces[:, k], "places": places[:, k]}  # fmt: skip


def _shape_contacts(result: Result, notes: list[str]) -> Iterator[dict[str, Any]]:
    """What each pair of shapes pushes with, all its points together, on shape i."""
    table = result.record.contacts.at(result.t)
    pairs, which = np.unique(table.pair, axis=0, return_inverse=True)
    size = np.linalg.norm(table.force, axis=1)
    largest = np.argsort(-np.bincount(which.ravel(), size, len(pairs)), kind="stable")[:MOST_PAIRS]
    if len(pairs) > MOST_PAIRS:
        notes.append(f"arrows of {MOST_PAIRS} of {len(pairs)} pairs of shapes that touch are drawn")
    place = np.searchsorted(result.t, table.t)
    for k in largest:
        chosen = which.ravel() == k
        at, weight = place[chosen], size[chosen]
        forces, places = np.zeros((2, len(result.t), 3))
        total = np.bincount(at, weight, len(result.t))[:, None]
        for axis in range(3):
            forces[:, axis] = np.bincount(at, table.force[chosen, axis], len(result.t))
            sums = np.bincount(at, weight * table.point[chosen, axis], len(result.t))
            np.divide(sums, total[:, 0], out=places[:, axis], where=total[:, 0] > 0.0)
        name = " on ".join(table.names[i] for i in pairs[k][::-1])
        yield {"layer": "contacts", "what": "force", "name": name, "body": 0,
               "at": ORIGIN, "values": forces, "places": places}  # fmt: skip


def _pair(
    layer: str, one: ElementGeometry, slot: str, action: Reaction
) -> Iterator[dict[str, Any]]:
    body, at = one.place(slot)
    moment = action.moment if action.local is None else action.moment_at_point
    if action.local is None:
        at = ORIGIN
    about = {"layer": layer, "name": one.name, "body": body, "at": at}
    for what, values in (("force", action.force), ("moment", moment)):
        if values is not None and np.all(np.isfinite(values)):
            yield {**about, "what": what, "values": np.asarray(values, dtype=np.float64)}
