"""Parameters of an exported model: numbers of a scene as words of its memory.

They are found by trial: the scene is prepared with other values. What then differs has to be the
value itself, or follow from it at the start by compiled code: masses in the metric, reference
pivots, values of functions at the start, the start as brought onto the constraints.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.assembly.arrays import EVEN, WEAK
from dap3d_core.formulations.arrays import UNEVEN, VERY_UNEVEN
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS
from dap3d_core.integrators.moreau.arrays import LIGHT
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.interface.errors import PluginError
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import ModelError
from dap3d_core.model.state_layout import y_from_u
from dap3d_core.native.run.outputs import Outputs, outputs_of
from dap3d_core.native.run.prepared import ContactCode, PreparedRun, refusal
from dap3d_core.scene import SceneError
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.study.batch import initial_state
from dap3d_core.study.batch.driver import MIN_PIVOT
from dap3d_core.study.parameters import SceneParameter, with_values

#: Factors on a parameter by which its places in the memory are found, and summands where it is 0:
#: the first two that the scene accepts, which may be at a limit.
TRIALS = (1.001, 0.9975), (1.001, 1.0025), (0.999, 0.9975)
TRIALS_OF_ZERO = (1.001, 0.9975), (1e-3, 2.5e-3), (-1e-3, -2.5e-3)
#: What follows from other numbers at the start of a run.
DERIVED = frozenset(
    ("metric", "flags", "smallest", "F", "start", "0.mass_inverse", "0.Jp_inverse", "0.carried")
)
#: Numbers of the settings that follow from masses and inertias.
MASS_FLAGS = np.array([EVEN, WEAK])
#: Arrays of steps of contacts that masses are put into.
OF_STEPS = ("mass", "mass_inverse", "Jp", "Jp_inverse", "carried", "row_start", "row_body")
#: The remedy for parameters that cannot be set.
EXPORT_EACH = "export a model for each value"
#: Two corrections of a start agree to this part of the length of the scene.
ALIKE = 1e-9


@attrs.frozen
class Places:
    """Where a parameter is in the memory.

    Attributes:
        words: each with its sign.
        is_fixed: it is set before a run begins alone.
        moves_start: bodies then start elsewhere, or with other velocities.
    """

    words: dict[int, float]
    is_fixed: bool
    moves_start: bool


def places_of(
    prepared: PreparedRun, parameter: SceneParameter, options: dict[str, Any], outputs: Outputs
) -> Places:
    """Where a parameter of a scene is in the memory of its run, which has these outputs.

    Raises:
        SceneError: more depends on it than compiled code finds at the start.
    """
    name, value = parameter.name, parameter.value
    if value is None:
        raise refusal(f"parameter {name} has no number in the scene", "give it one")
    trials, others = _trials(prepared, parameter, value, options)
    if any(one.stops != prepared.stops for one in others):
        raise _fixed(name, "it moves a break point of a function, where steps end")
    if any(outputs_of(one, outputs.names).text != outputs.text for one in others):
        why = "outputs depend on it that read it as it is in the scene, such as places of points"
        raise _fixed(name, why, f"leave these outputs out, or {EXPORT_EACH}")
    words, moved = _words(prepared, others, value, trials)
    if words is None:
        why = "numbers depend on it that are found in Python before a run, or none does"
        raise _fixed(name, why, f"{EXPORT_EACH}, or name a number that is used as it is")
    moves_start = "start" in moved
    start = prepared.start
    if moves_start and not (start and start.moves and all(map(_is_assembled_alike, others))):
        why = "the start depends on it, and compiled code does not correct it as Python does"
        raise _fixed(name, why)
    return Places(words, bool(moved), moves_start)


def _trials(
    prepared: PreparedRun, parameter: SceneParameter, value: float, options: dict[str, Any]
) -> tuple[list[float], list[PreparedRun]]:
    """Two other values of a parameter, and the runs with these."""
    scene, refused = prepared.compiled.scene, None
    for factors in TRIALS if value else TRIALS_OF_ZERO:
        values = [value * factor if value else factor for factor in factors]
        try:
            found = [PreparedRun(with_values(scene, [parameter], [x]), **options) for x in values]
        except (SceneError, SimulationError, PluginError, ModelError) as error:
            refused = refused or error
            continue
        return values, found
    why = str(refused).splitlines()[0].rstrip(":")
    if isinstance(refused, SceneError):
        why = refused.mistakes[0].what
    raise _fixed(parameter.name, f"a value near its own is refused: {why}") from refused


def _fixed(name: str, why: str, remedy: str = EXPORT_EACH) -> SceneError:
    """The error of a parameter that cannot be set."""
    return refusal(f"parameter {name} cannot be set in an exported model: {why}", remedy)


def _words(
    prepared: PreparedRun, others: Sequence[PreparedRun], value: float, trials: Sequence[float]
) -> tuple[dict[int, float] | None, set[str]]:
    """Words that are the parameter, each with its sign, and what follows from it; None: more does.

    Args:
        prepared: of the scene as it is.
        others: the same with other values, ``trials``, of the parameter.
        value: of the parameter in the scene.
    """
    found: dict[int, float] = {}
    derived: set[str] = set()
    rows = zip(_numbers(prepared), *map(_numbers, others), strict=True)
    for (name, array, places), *changed in rows:
        mine = array.reshape(-1)[places]
        theirs = [a.reshape(-1)[p] for _, a, p in changed]
        if any(len(one) != len(mine) for one in theirs):
            return None, derived
        moved = np.zeros(len(mine), dtype=bool)
        for one in theirs:
            moved |= (one != mine) & ~((one != one) & (mine != mine))
        if name in DERIVED:
            if name == "0.Jp_inverse" and not _are_principal(mine, moved):
                return None, derived
            derived |= {name} if moved.any() else set()
            continue
        for k in np.flatnonzero(moved).tolist():
            sign = next((s for s in (1.0, -1.0) if mine[k] == s * value), 0.0)
            if not sign or array.dtype != np.float64:
                return None, derived
            if any(a[k] != sign * x for a, x in zip(theirs, trials, strict=True)):
                return None, derived
            found[prepared.image.at(array) + int(places[k])] = sign
    can_derive = prepared.start is not None or not derived
    return (found or None) if can_derive else None, derived


def _are_principal(matrices: Floats, moved: NDArray[np.bool_]) -> bool:
    """True if the matrices (9 numbers each) that moved are diagonal: their inverses are, too."""
    own = matrices.reshape(-1, 3, 3)[moved.reshape(-1, 9).any(axis=1)]
    return not np.any(own * (1.0 - np.eye(3)))


def _numbers(prepared: PreparedRun) -> Iterator[tuple[str, Any, Any]]:
    """Names, arrays and flat indices of what nothing changes in the course of a run."""
    from dap3d_core.formulations.programs.symbolic_arrays import constants

    evaluator = prepared.evaluator
    system = evaluator.system
    arrays = dict(system.walk())
    yield "flags", system.settings, MASS_FLAGS
    for name, places in constants(evaluator):
        yield name, arrays[name], np.setdiff1d(places, MASS_FLAGS) if name == "settings" else places
    if prepared.start is not None:
        given = prepared.start.arrays.given
        yield "given", given, np.arange(given.size)
    if isinstance(prepared.jumps, ContactCode):
        for name in ("mu", "mu_s", "ratio", "ratio_s", "e", "length", "rounding"):
            array = getattr(prepared.jumps.arguments[0], name)
            yield f"contacts.{name}", array, np.arange(array.size)
    y = prepared.run.present.work.state[at.Y]
    yield ("start" if prepared.start is not None else "y"), y, np.arange(y.size)
    for k, one in enumerate(prepared.advances):
        work = one.integration.work
        for name in ("real", "integer", "switches", "tolerance"):
            array = getattr(work, name)
            yield f"{k}.{name}", array, np.arange(array.size)
        if one.completes is not None:  # masses, shapes, materials
            steps = one.arguments[1]
            places = np.arange(steps.integer.size) != steps.indices("integer")["light_count"]
            yield f"{k}.counts", steps.integer, np.flatnonzero(places)
            for name, array in steps.walk():
                if array is not steps.integer:
                    yield f"{k}.{name}", array, np.arange(array.size)


@IGNORE_FLOAT_ERRORS
def _is_assembled_alike(other: PreparedRun) -> bool:
    """True if compiled code brings the given start onto the constraints where Python does."""
    evaluator, start, y = other.evaluator, other.start, other.run.present.y
    assert start is not None
    model, system = evaluator.model, evaluator.system
    found = y_from_u(np.asarray(model.u0), states=model.initial_states)
    if start.assembles:
        arrays, kept = start.arrays, system.metric.copy()
        system.metric[1:, :7] = arrays.unit
        out: Floats = arrays.starting.copy()
        start.functions[1](0.0, found, out, system, evaluator.loops)
        system.metric[:] = kept
        if out[initial_state.OPEN] or not out[initial_state.LEAST_PIVOT] > MIN_PIVOT:
            return False
    size = max(1.0, float(np.abs(y).max(initial=0.0)))
    return bool(np.abs(found - y).max(initial=0.0) <= ALIKE * size)


def mass_numbers(prepared: PreparedRun) -> dict[str, Any]:
    """Numbers and places in the memory, by their names in C, of what follows from masses."""
    evaluator, place = prepared.evaluator, prepared.image.at
    scales, settings = evaluator.model.scales, place(evaluator.system.settings)
    found: dict[str, Any] = {
        "IS_EVEN": settings + EVEN,
        "IS_WEAK": settings + WEAK,
        "UNEVEN": UNEVEN,
        "VERY_UNEVEN": VERY_UNEVEN,
        "EXTENT": "INFINITY" if scales.extent == scales.gyration else float(scales.extent).hex(),
        "ARM": float(scales.arm).hex(),
    }
    if not prepared.steps_contacts:
        return found
    steps = prepared.advances[0].arguments[1]
    for name in OF_STEPS:
        array = getattr(steps, name)
        found[name.upper()] = place(array) if array.size else 0
    count = place(steps.integer) + steps.indices("integer")["light_count"]
    rows = len(steps.row_start) - 1
    return found | {"LIGHT_COUNT": count, "LIGHT": LIGHT, "JOINT_ROWS": rows}
