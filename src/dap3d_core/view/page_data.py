"""The data of a page: motion, solids, arrows, curves, and metadata of the run."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import attrs

from dap3d_core.result import Result, find
from dap3d_core.result.quantities.lookup import available_outputs
from dap3d_core.scene.scene import Scene
from dap3d_core.view.scene3d.arrows import arrows_of
from dap3d_core.view.scene3d.elements import elements_of
from dap3d_core.view.scene3d.primitives import pack
from dap3d_core.view.scene3d.sampled_motion import Motion, at_instants, instants_to_show
from dap3d_core.view.scene3d.scene_data import geometry_of

#: Curves that every page can draw besides those derived from motion and reactions.
USUAL = ("energy.kinetic", "energy.potential", "energy.total")


def page_data(
    result: Result,
    scene: Scene,
    quantities: Sequence[str],
    fps: float | None,
    *,
    share: int = 1,
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
    arrows = arrows_of(shown, elements, geometry["stage"]["size"])
    notes = [*geometry.pop("notes"), *arrows.pop("notes")]
    if len(index) < len(result.t):
        notes.append(f"{len(index)} of {len(result.t)} reported instants are on this page")
    outputs = (output.name for output in available_outputs(shown))
    names = dict.fromkeys((*USUAL, *outputs, *quantities))
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
        "components": list(quantity.components),
        "values": pack(quantity.values, "<f8"),
        "rates": pack(find(result, quantity.rate).values, "<f8") if quantity.rate else None,
    }


def _about(result: Result, scene: Scene, notes: list[str]) -> dict[str, Any]:
    ledger = {name: attrs.asdict(entry) for name, entry in result.ledger.items()}
    about: dict[str, Any] = _finite(
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
    return about


def _finite(value: Any) -> Any:
    """The same value with text for numbers that JSON does not have."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, Mapping):
        return {str(k): _finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    return value
