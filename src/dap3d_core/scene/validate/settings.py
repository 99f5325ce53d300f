"""Check of the settings of a run, from a scene file, a script or the command line."""

from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import Any

from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene.errors import MISSING, Key, MistakeList
from dap3d_core.scene.scene import Scene
from dap3d_core.scene.tables import HEADER_KEYS, SCHEMA, Simulation
from dap3d_core.scene.validate.coerce_values import (
    Fault,
    bounded,
    number_of,
    text_of,
    truth_of,
    word_of,
)
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.settings import FIXED_STEP, NO_STEP, SETTINGS, Setting

#: Default absolute tolerance, SI, and the quantities that may have one of their own.
USUAL_ATOL = 1e-10
QUANTITIES = ("r", "p", "v", "w", "z")
#: Shorter times, s, leave double precision in products and quotients.
SHORTEST_TIME = 1e-100
#: Maximal number of reported times.
MOST_ROWS = 5e7


def _time(value: Any, *, positive: bool = True) -> Any:
    """A time, s, long enough to compute with, or 0 where that is allowed."""
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
            what = f"has no quantity {name!r}: r (m), p, v (m/s), w (rad/s), z (states)"
            return Fault(what, nearest=nearest(str(name), QUANTITIES) or "")
        number = bounded(number_of(part), minimum=0.0)
        if isinstance(number, Fault):
            return Fault(f"{name} {number.what}", number.remedy, number.nearest)
    return value


def _integrator(value: Any, words: tuple[str, ...]) -> Any:
    """An integrator of dap3d, or of an installed package; it is loaded where a run begins."""
    if value in words:
        return value
    from dap3d_core.registry.extensions import extensions

    return word_of(value, (*words, *extensions("integrator").keywords))


def _number(value: Any, setting: Setting) -> Any:
    """A number within the bounds of a setting."""
    if setting.most is None:
        return bounded(number_of(value), positive=True)
    return bounded(number_of(value), minimum=setting.least, maximum=setting.most)


#: Readers of the kinds of settings; bodies have theirs below.
_READERS: dict[str, Callable[..., Any]] = {
    "end": lambda v, setting: _time(v, positive=False),
    "time": lambda v, setting: _time(v),
    "word": lambda v, setting: word_of(v, setting.words),
    "integrator": lambda v, setting: _integrator(v, setting.words),
    "number": _number,
    "tolerance": lambda v, setting: _tolerance(v),
    "truth": lambda v, setting: truth_of(v),
}


def check_simulation(simulation: Simulation, body_names: Collection[str]) -> None:
    """Check settings such as those of a script or the command line.

    Args:
        simulation: the settings.
        body_names: bodies that ``hold`` may name.

    Raises:
        SceneError: all mistakes; their keys are the names of the settings.
    """
    report = Collector(Scene())
    check_settings(report, simulation, body_names, ())
    report.raise_mistakes()


def check_settings(
    report: Collector, simulation: Simulation, body_names: Collection[str], key: Key
) -> None:
    """Report all mistakes in settings, under a key such as ``("simulation",)``."""
    good: dict[str, Any] = {}
    for name, setting in SETTINGS.items():
        value = getattr(simulation, name)
        if setting.kind == "bodies" or (value is None and setting.default is None):
            continue
        result = report.read((*key, name), value, partial(_READERS[setting.kind], setting=setting))
        if not isinstance(result, Fault):
            good[name] = result
    _check_step(report, simulation, good.get("integrator"), (*key, "step"))
    _check_span(report, simulation, good, len(body_names), (*key, "dt"))
    _check_hold(report, simulation.hold, body_names, (*key, "hold"))


def _check_step(report: MistakeList, simulation: Simulation, integrator: Any, key: Key) -> None:
    if integrator in NO_STEP and simulation.step is not None:
        what = f"{integrator} chooses its step itself, together with its order"
        remedy = "leave step out, or take rk4, dopri5 or dop853"
        report.add(key, simulation.step, what, remedy=remedy)
    if integrator in FIXED_STEP and simulation.step is None:
        what = f"{integrator} does not choose its step: give step, or take an adaptive method"
        report.add(key, MISSING, what)


def _check_span(
    report: MistakeList, simulation: Simulation, good: dict[str, Any], body_count: int, key: Key
) -> None:
    """The reporting step is not longer than the run, and not too many times are reported."""
    t_end, dt = good.get("t_end"), good.get("dt")
    if not t_end or not dt:
        return
    if dt > t_end:
        what = f"the reporting step is longer than the run (t_end = {t_end:g})"
        report.add(key, simulation.dt, what)
    elif t_end / dt > MOST_ROWS:
        rows, scalars = t_end / dt, 13 * max(body_count, 1)
        what = (
            f"t_end / dt asks for {rows:.3g} reported times of {scalars} numbers or more, "
            f"{8 * scalars * rows / 2**30:.3g} GiB; at most {MOST_ROWS:g} times are reported"
        )
        report.add(key, simulation.dt, what, remedy=f"give dt of at least {t_end / MOST_ROWS:.3g}")


def _check_hold(report: MistakeList, hold: Any, body_names: Collection[str], key: Key) -> None:
    if type(hold) is not tuple:
        report.add(key, hold, 'should be a list of names of bodies, ["crank"]')
        return
    known = frozenset(body_names)
    for k, name in enumerate(hold):
        if not (isinstance(name, str) and name in known):
            report.add((*key, k), name, f"there is no body {name!r}", report.nearest(name, known))


def check_header(report: Collector) -> None:
    """Report all mistakes in [scene]."""
    for name in sorted(HEADER_KEYS - {"schema"}):
        report.read(("scene", name), getattr(report.scene, name), text_of)
    schema, key = report.scene.schema, ("scene", "schema")
    if type(schema) is not int or schema < 1:
        what = f"the version of the file format is a whole number; the newest is {SCHEMA}"
        report.add(key, schema, what)
    elif schema > SCHEMA:
        what = f"the file format is newer than this program, which reads up to {SCHEMA}"
        report.add(key, schema, what, remedy="install a newer dap3d")


def notes_of(simulation: Simulation) -> list[str]:
    """Notes on settings that are allowed and unusual."""
    atol = simulation.atol
    parts = atol.values() if isinstance(atol, Mapping) else [atol]
    if any(part == 0.0 and type(part) in (int, float) for part in parts):
        return ["simulation.atol = 0: a quantity that is zero then allows no error"]
    return []
