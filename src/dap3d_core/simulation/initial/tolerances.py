"""Absolute tolerances of a run, of each quantity: as they are given, else by the scene's scales.

1e-10 (m, 1, m/s, rad/s) suits scenes of metres and seconds. In others it is 1e-10 of their own
length and time (``Model.length``, ``Evaluator.time``).
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.integrators import Integration
from dap3d_core.integrators.stepping.integration_state import ABSOLUTE, NOISE, Y
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.state_layout import split
from dap3d_core.registry.suggestions import some
from dap3d_core.scene import Simulation
from dap3d_core.scene.validate.settings import QUANTITIES, USUAL_ATOL

#: A motion is resolved that is this many times what a step may be off by.
RESOLVED = 1e3


def resolved_atol(atol: Any, evaluator: Evaluator) -> float | dict[str, float]:
    """Absolute tolerances as a run uses them: one for all, or by quantity.

    atol: as given: None, a number, or a table of some quantities.
    """
    if isinstance(atol, (int, float)):
        return float(atol)
    usual = usual_atol(evaluator)
    if atol is None:
        return usual
    names = _quantities(evaluator)
    every = usual if isinstance(usual, dict) else dict.fromkeys(names, usual)
    return every | {name: float(value) for name, value in atol.items() if name in names}


def _quantities(evaluator: Evaluator) -> tuple[str, ...]:
    """Quantities that have a tolerance: without states of elements those of bodies alone."""
    return QUANTITIES if evaluator.model.state_count else QUANTITIES[:-1]


def usual_atol(evaluator: Evaluator) -> float | dict[str, float]:
    """Default of the absolute tolerances."""
    length, time = evaluator.model.length, evaluator.time
    if length == time == 1.0:
        return USUAL_ATOL
    scales = {"r": length, "p": 1.0, "v": length / time, "w": 1.0 / time, "z": 1.0}
    names = _quantities(evaluator)
    return {name: float(f"{USUAL_ATOL * scales[name]:.6g}") for name in names}


def motion_notes(low: Floats, high: Floats, settings: Simulation) -> list[str]:
    """That what moves is no more than what a step may be off by, in words.

    A scene at rest moves by rounding, far less than that, and has no such note.

    Args:
        low, high: (13 n,) the least and the largest value of each component of u.
        settings: of the run, its tolerances resolved.
    """
    moved, size = high - low, np.maximum(np.abs(low), np.abs(high))
    atol = (
        settings.atol
        if isinstance(settings.atol, Mapping)
        else dict.fromkeys(QUANTITIES, settings.atol)
    )
    shift, turn, _, _ = split(moved)
    far = split(size)[0]
    part, rtol = _largest(shift), float(settings.rtol)
    allowed = atol["r"] + rtol * float(np.max(far, initial=0.0))
    turning = _largest(turn) > RESOLVED * (atol["p"] + rtol)
    if turning or not allowed / RESOLVED < part < RESOLVED * allowed:
        return []
    return [
        f"no body moves by more than {part:.2g} m, and a step may be off by {allowed:.2g} m (atol "
        "+ rtol |r|, with |r| from the origin): the motion is hardly resolved. Give a smaller rtol "
        "and atol (atol = {r = 1e-15, v = 1e-15}), and place the scene near the origin"
    ]


def rounding_notes(runs: Sequence[Integration], evaluator: Evaluator) -> list[str]:
    """That rounding, and not the tolerances, limits the accuracy of some bodies, in words."""
    work = runs[-1].work
    if not work.rounding_state > 1:
        return []
    names = evaluator.model.body_names
    noise = work.h * work.tolerance[NOISE, :-1]
    above = noise > work.tolerance[ABSOLUTE, :-1] + work.rtol * np.abs(work.state[Y, :-1])
    found = np.unique(evaluator.coordinates.bodies[above]).tolist()
    bodies = [names[k] for k in found if k >= 0]
    if not bodies:
        return []
    return [
        f"the accuracy of {some(bodies)} is limited by rounding, not by the tolerances: very "
        "different inertias, a place far from the origin or a very fast motion do that; smaller "
        "tolerances change nothing there"
    ]


def _largest(vectors: Floats) -> float:
    return float(np.max(np.linalg.norm(vectors, axis=1), initial=0.0))


def atol_vector(atol: float | Mapping[str, float], evaluator: Evaluator) -> float | Floats:
    """Absolute tolerances of the components of y, in its order; a number may stay one.

    States of elements have those that their fields give, the work the largest of all.
    """
    own = np.zeros(0)
    if evaluator.model.state_count:
        from dap3d_core.model.element_states import tolerances

        own = tolerances(evaluator.model.acting)
    if not isinstance(atol, Mapping):
        if not own.any():
            return atol
        atol = dict.fromkeys(QUANTITIES, atol)
    of_motion = [atol[name] for name in evaluator.coordinates.quantities]
    every = np.array([*of_motion, max(atol.values())])
    last = len(every) - 1
    every[last - len(own) : last] = np.where(own > 0.0, own, every[last - len(own) : last])
    return every


def kinds_of(evaluator: Evaluator) -> list[int]:
    """First component of the quantity that each component of y is of; states are their own."""
    first: dict[str, int] = {}
    return [
        i if quantity == "z" else first.setdefault(quantity, i)
        for i, quantity in enumerate(evaluator.coordinates.quantities)
    ]


def tighter(atol: float | Mapping[str, float], factor: float) -> float | dict[str, float]:
    """Absolute tolerances divided by a factor."""
    if isinstance(atol, Mapping):
        return {name: value / factor for name, value in atol.items()}
    return atol / factor


def words_of(atol: float | Mapping[str, float]) -> str:
    """As messages have it."""
    if isinstance(atol, Mapping):
        return ", ".join(f"{name} = {value:g}" for name, value in atol.items())
    return f"{atol:g}"


def atol_notes(given: Any, used: float | Mapping[str, float], evaluator: Evaluator) -> list[str]:
    """That the usual tolerances were scaled to the scene, in words."""
    if not isinstance(used, Mapping) or (given is not None and {*given} >= {*used}):
        return []
    model, words = evaluator.model, words_of(used)
    if model.length != 1.0:
        return [f"atol follows the size of the parts, {model.part_size:.2g} m: {words}"]
    slow = f"atol follows the motion, whose time is of the order of {evaluator.time:g} s: {words}"
    return [slow] if evaluator.time != 1.0 else []
