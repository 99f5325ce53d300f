"""The data of a page: motion, solids, arrows, curves, and metadata of the run."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.result import Result, ResultError, UnknownNameError, find
from dap3d_core.result.post.force_output import Reaction
from dap3d_core.result.quantities.lookup import available_outputs
from dap3d_core.scene.scene import Scene
from dap3d_core.view.scene3d.elements import ORIGIN, ElementGeometry, Elements, elements_of
from dap3d_core.view.scene3d.primitives import pack
from dap3d_core.view.scene3d.sampled_motion import Motion, at_instants, instants_to_show
from dap3d_core.view.scene3d.scene_data import geometry_of

#: An arrow below this fraction of the largest of its kind is left out.
SMALLEST = 1e-9
#: Greatest lengths of the longest arrow and of the usual one, as fractions of the scene's size.
LONGEST, USUAL_LENGTH = 0.36, 0.16
#: Pairs of shapes whose forces are drawn at most.
MOST_PAIRS = 200


def page_data(
    result: Result, scene: Scene, quantities: Sequence[str], fps: float | None, *, share: int = 1
) -> dict[str, Any]:
    """The data of a page, ready for JSON.

    Args:
        result: the result.
        scene: its scene.
        quantities: curves that are shown at first, by name.
        fps: frames a second; None for all instants, as far as they fit.
        share: number of results on the page.

    Raises:
        UnknownNameError: there is no such quantity.
        ValueError: there is no instant, or fps is not positive.
    """
    if not len(result.t):
        raise ValueError("the result has no instants: there is nothing to show")
    if fps is not None and not (math.isfinite(fps) and 0.0 < fps <= 1e6):
        raise ValueError(f"fps = {fps:g}: the number of frames a second is greater than 0")
    index = instants_to_show(result.t, share * result.summary.body_count, fps)
    shown = at_instants(result, index)
    elements = elements_of(result)
    geometry = geometry_of(shown, scene, elements)
    arrows = _arrows_of(shown, elements, geometry["stage"]["size"])
    notes = [*geometry.pop("notes"), *arrows.pop("notes")]
    if len(index) < len(result.t):
        notes.append(f"{len(index)} of {len(result.t)} reported instants are on this page")
    outputs = (output.name for output in available_outputs(shown))
    energies = (f"energy.{part}" for part in ("kinetic", "potential", "total"))
    names = dict.fromkeys((*energies, *outputs, *quantities))
    return {
        "instants": len(index),
        "t": pack(shown.t, "<f8"),
        "cuts": [event.t for event in result.events if event.kind != "record"],
        "poses": pack(Motion(shown).poses),
        **geometry,
        **arrows,
        "series": [_series(shown, name) for name in names],
        "asked": list(dict.fromkeys(quantities)),
        "about": _about(result, scene, notes),
    }


def _series(result: Result, name: str) -> dict[str, Any]:
    quantity = find(result, name)
    return {
        "name": name,
        "label": quantity.label,
        "unit": quantity.unit,
        "columns": list(quantity.columns),
        "values": pack(quantity.values, "<f8"),
        "rates": pack(find(result, quantity.rate).values, "<f8") if quantity.rate else None,
    }


def _about(result: Result, scene: Scene, notes: list[str]) -> dict[str, Any]:
    ledger = {name: attrs.asdict(entry) for name, entry in result.ledger.items()}
    return _finite(
        {
            "title": result.record.title or "scene without a name",
            "description": str(scene.description),
            "status": result.status,
            "method": result.method,
            "integrator": result.integrator,
            "instants": len(result.t),
            "stats": attrs.asdict(result.stats),
            "ledger": ledger,
            "settings": result.settings,
            "versions": result.versions,
            "notes": result.notes,
            "view_notes": notes,
            "events": [{"t": event.t, "text": event.words} for event in result.events],
            "scene": result.scene_text,
        }
    )


def _finite(value: Any) -> Any:
    """The same value with text for numbers that JSON does not have."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, Mapping):
        return {str(k): _finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    return value


def _arrows_of(result: Result, elements: Elements, size: float) -> dict[str, Any]:
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
    return float(min(LONGEST / peak, USUAL_LENGTH / middle) * size)


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
