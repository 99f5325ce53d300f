"""The settings of a run: [simulation] of a scene file, or what a script or command line gives."""

from collections.abc import Callable, Collection, Mapping
from typing import Any

from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene.errors import MISSING, Key, Mistake, SceneError, dotted
from dap3d_core.scene.scene import HEADER_KEYS, SCHEMA, Scene, Simulation
from dap3d_core.scene.validate.coerce_values import (
    Fault,
    bounded,
    number_of,
    text_of,
    truth_of,
    word_of,
)

#: What ``method`` and ``integrator`` may say.
METHODS = ("auto", "unconstrained", "standard", "penalty", "lsq")
INTEGRATORS = ("auto", "dopri5", "dop853", "adams", "rk4", "radau")
#: What ``correct_metric`` may say (simulation/initial/assemble.py).
CORRECT_METRICS = ("unit", "mass")
#: Integrators without an error estimate, which need a step.
FIXED_STEP = ("rk4",)
#: Integrators that take no step.
NO_STEP = ("adams",)
#: Absolute tolerances that are taken where none are given, SI, and what may have one of its own.
USUAL_ATOL = 1e-10
QUANTITIES = ("r", "p", "v", "w")
#: Relative tolerances below are beyond double precision.
SMALLEST_RTOL = 1e-14
#: Times that are shorter, s, leave double precision in products and quotients.
SHORTEST_TIME = 1e-100
#: More reported times are refused before anything is computed.
MOST_ROWS = 5e7


def _time(value: Any, *, positive: bool = True) -> Any:
    """A time, s, long enough to be computed with, or 0 where that is allowed."""
    number = bounded(number_of(value), positive=positive, minimum=0.0)
    if isinstance(number, Fault) or number == 0.0 or number >= SHORTEST_TIME:
        return number
    return Fault(f"should be {'' if positive else '0 or '}at least {SHORTEST_TIME:g}")


def _tolerance(value: Any) -> Any:
    """An absolute tolerance: a number, or a table of some by quantity."""
    if not isinstance(value, Mapping):
        return bounded(number_of(value), minimum=0.0)
    for name, part in value.items():
        if name not in QUANTITIES:
            words = f"has no quantity {name!r}: r (m), p, v (m/s), w (rad/s)"
            return Fault(words, nearest=nearest(str(name), QUANTITIES) or "")
        number = bounded(number_of(part), minimum=0.0)
        if isinstance(number, Fault):
            return Fault(f"{name} {number.what}", number.remedy, number.nearest)
    return value


_READ: dict[str, Callable[[Any], Any]] = {
    "t_end": lambda v: _time(v, positive=False),
    "dt": _time,
    "method": lambda v: word_of(v, METHODS),
    "integrator": lambda v: word_of(v, INTEGRATORS),
    "rtol": lambda v: bounded(number_of(v), minimum=SMALLEST_RTOL, maximum=1.0),
    "atol": lambda v: _tolerance(v),
    "step": _time,
    "correct": truth_of,
    "project": truth_of,
    "correct_metric": lambda v: word_of(v, CORRECT_METRICS),
    "alpha": lambda v: bounded(number_of(v), positive=True),
    "Omega": lambda v: bounded(number_of(v), positive=True),
    "mu": lambda v: bounded(number_of(v), positive=True),
}
#: Settings that may be left open.
OPEN = ("t_end", "dt", "atol", "step")


def check_simulation(simulation: Simulation, body_names: Collection[str]) -> None:
    """Refuse settings that make no sense, such as those a script or a command line gives.

    Args:
        simulation: the settings.
        body_names: bodies that ``hold`` may name.

    Raises:
        SceneError: all mistakes; their keys are the names of the settings.
    """
    found = simulation_mistakes(simulation, body_names)
    if found:
        raise SceneError(m for _, m in found)


def simulation_mistakes(
    simulation: Simulation, body_names: Collection[str], key: Key = ()
) -> list[tuple[Key, Mistake]]:
    """Everything that is wrong in settings, under a key such as ``("simulation",)``."""
    found: list[tuple[Key, Mistake]] = []
    good: dict[str, Any] = {}
    for name, read in _READ.items():
        value = getattr(simulation, name)
        result = None if value is None and name in OPEN else read(value)
        if isinstance(result, Fault):
            found.append(_mistake((*key, name), value, result))
        else:
            good[name] = result
    found += _step_mistakes(simulation, good, key)
    found += _span_mistakes(simulation, good, len(body_names), key)
    found += _hold_mistakes(simulation.hold, body_names, (*key, "hold"))
    return found


def _step_mistakes(
    simulation: Simulation, good: dict[str, Any], key: Key
) -> list[tuple[Key, Mistake]]:
    if good.get("integrator") in NO_STEP and simulation.step is not None:
        words = f"{simulation.integrator} chooses its step itself, together with its order"
        fault = Fault(words, "leave step out, or take rk4, dopri5 or dop853")
        return [_mistake((*key, "step"), simulation.step, fault)]
    if good.get("integrator") not in FIXED_STEP or simulation.step is not None:
        return []
    words = f"{simulation.integrator} does not choose its step"
    fault = Fault(f"{words}: give step, or take an adaptive method")
    return [_mistake((*key, "step"), MISSING, fault)]


def _span_mistakes(
    simulation: Simulation, good: dict[str, Any], body_count: int, key: Key
) -> list[tuple[Key, Mistake]]:
    """A reporting step that fits the final time, and not too many reports."""
    t_end, dt = good.get("t_end"), good.get("dt")
    if not t_end or not dt:
        return []
    if dt > t_end:
        fault = Fault(f"the reporting step is longer than the run (t_end = {t_end:g})")
    elif t_end / dt > MOST_ROWS:
        rows, numbers = t_end / dt, 13 * max(body_count, 1)
        fault = Fault(
            f"t_end / dt asks for {rows:.3g} reported times of {numbers} numbers or more, "
            f"{8 * numbers * rows / 2**30:.3g} GiB; at most {MOST_ROWS:g} times are reported",
            f"give dt of at least {t_end / MOST_ROWS:.3g}",
        )
    else:
        return []
    return [_mistake((*key, "dt"), simulation.dt, fault)]


def _hold_mistakes(hold: Any, body_names: Collection[str], key: Key) -> list[tuple[Key, Mistake]]:
    if type(hold) is not tuple:
        return [_mistake(key, hold, Fault('should be a list of names of bodies, ["crank"]'))]
    known = frozenset(body_names)
    wrong = [(k, n) for k, n in enumerate(hold) if not (isinstance(n, str) and n in known)]
    near = {name: nearest(name, known) for _, name in wrong[:100] if isinstance(name, str)}
    return [
        _mistake((*key, k), name, Fault(f"there is no body {name!r}", "", near.get(name, "")))
        for k, name in wrong
    ]


def header_mistakes(scene: Scene) -> list[tuple[Key, Mistake]]:
    """Everything that is wrong in [scene]."""
    found: list[tuple[Key, Mistake]] = []
    for name in sorted(HEADER_KEYS - {"schema"}):
        text = text_of(getattr(scene, name))
        if isinstance(text, Fault):
            found.append(_mistake(("scene", name), getattr(scene, name), text))
    schema = scene.schema
    if type(schema) is not int or schema < 1:
        fault = Fault(f"the version of the file format is a whole number; the newest is {SCHEMA}")
    elif schema > SCHEMA:
        fault = Fault(
            f"the file format is newer than this program, which reads up to {SCHEMA}",
            "install a newer dap3d",
        )
    else:
        return found
    return [*found, _mistake(("scene", "schema"), schema, fault)]


def notes_of(simulation: Simulation) -> list[str]:
    """What looks odd in settings that are allowed."""
    atol = simulation.atol
    parts = atol.values() if isinstance(atol, Mapping) else [atol]
    if any(part == 0.0 and type(part) in (int, float) for part in parts):
        return ["simulation.atol = 0: a quantity that is zero is then asked for without any error"]
    return []


def _mistake(key: Key, value: Any, fault: Fault) -> tuple[Key, Mistake]:
    return key, Mistake(dotted(key), value, fault.what, fault.nearest, fault.remedy)
