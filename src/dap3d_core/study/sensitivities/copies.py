"""Derivatives of a model's numbers by parameters that are copied there (study/batch).

No model has to be made at other values: what a parameter of a force, a mass or an initial state
becomes is known, and so is its derivative, to rounding.
"""

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.simulation.run import Run
from dap3d_core.study.batch.compiled_batch import Starts, arrays_of_numbers
from dap3d_core.study.batch.parameter_map import NotCopiedError, ParameterMap
from dap3d_core.study.batch.slopes import COPIES, starts_with_slopes
from dap3d_core.study.parameters import SceneParameter


def copied_slopes(
    run: Run, parameter: SceneParameter, size: float
) -> tuple[list[Floats], Floats] | None:
    """Derivatives of arrays, flat, as of ``arrays_of_numbers``, and (n,) of the state at the start.

    None where the parameter is not copied, or where joints may move with it at the start.

    Args:
        run: at its start.
        parameter, size: of its scene, and its size.
    """
    evaluator, model = run.evaluator, run.evaluator.model
    coordinates, is_plain = evaluator.coordinates, run.present.takes_programs and not model.breaks
    is_plain &= run.settings.start == "scene" and run.start is None
    if not is_plain or any(switch.jumps for switch in evaluator.switches):
        return None
    try:
        if parameter.table not in ("bodies", "points", "forces"):
            return None
        by_map = ParameterMap(run.compiled.checked, evaluator, (parameter,))
    except NotCopiedError:
        return None
    if by_map.moves_start and (model.row_count or not coordinates.are_of_bodies):
        return None

    def starts(values: Floats) -> Starts:
        table, _ = by_map.table(values, is_checked=False)
        if coordinates.are_of_bodies:
            y0 = by_map.states(values, model.u0)
            by_map.set_states(y0, values)
        else:
            y0 = np.zeros((len(values), coordinates.size + 1))
        return Starts(table, by_map.places, y0, 0)

    x = np.array([parameter.value])
    found = starts_with_slopes(starts, x, np.array([size]), *COPIES)
    if found is None:
        return None
    _, of_numbers, of_state = found
    ends = np.cumsum([array.size for array in arrays_of_numbers(evaluator)])
    slopes = np.zeros(ends[-1])
    slopes[by_map.places] = of_numbers[:, 0]
    return np.split(slopes, ends[:-1]), of_state[:, 0]
