"""Outputs of linearised equations: any quantity of a result, by its name.

A quantity is evaluated by the post-processor itself, at states displaced along each state of the
linear system, and differentiated by central differences of sixth order. Accelerations and
multipliers follow the linear equations there, so that what is differentiated is smooth.
"""

from collections.abc import Sequence

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.state_layout import split
from dap3d_core.result import Result, RunMetadata, UnknownNameError, find
from dap3d_core.simulation.linearization.inputs import Inputs
from dap3d_core.simulation.linearization.mode_motion import displaced_state
from dap3d_core.simulation.linearization.operating_point import OperatingPoint
from dap3d_core.simulation.linearization.state_space import StateSpace

#: Abscissae and weights of the sixth-order central difference.
ABSCISSAE = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
WEIGHTS = np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0
#: Largest displacement of a body, as a part of the model's size or in rad, and of a velocity.
STEP = 2e-3
#: Least size of a state of an element, of which steps are parts.
LEAST = 1e-3


def output_derivatives(
    point: OperatingPoint, space: StateSpace, inputs: Inputs, names: Sequence[str]
) -> tuple[Floats, Floats]:
    """Derivatives of quantities: C (outputs, states) and D (outputs, inputs).

    Raises:
        UnknownNameError: there is no such quantity, or it is a vector; names the nearest.
    """
    states = len(space.A)
    own = np.zeros((states, point.model.state_count))
    own[:, point.kept] = space.own
    directions = [
        (space.displacement[:, k], space.velocity[:, k], space.acceleration[:, k],
         space.multipliers[:, k], own[k]) for k in range(states)
    ]  # fmt: skip
    unmoved = np.zeros(own.shape[1])
    none = np.zeros(6 * point.model.body_count)
    for wrench, driver in zip(inputs.wrench.T, inputs.driver.T, strict=True):
        a_change = space.acceleration_by_force @ wrench + space.acceleration_by_driver @ driver
        lam_change = space.multipliers_by_force @ wrench + space.multipliers_by_driver @ driver
        directions.append((none, none, a_change, lam_change, unmoved))
    steps = [_step(point, *direction) for direction in directions]
    rows = [
        _row(point, x * h, direction)
        for h, direction in zip(steps, directions, strict=True)
        for x in ABSCISSAE
    ]
    rows.append(_row(point, 0.0, directions[0] if directions else (none,) * 4 + (unmoved,)))
    record = RunMetadata(scene_text=point.compiled.scene_text)
    result = Result.of_run(point.model, np.array(rows), record, lambda: point.evaluator)
    matrix = np.zeros((len(names), len(directions)))
    for k, name in enumerate(names):
        quantity = find(result, name)
        if quantity.values.ndim > 1:
            first = quantity.components[0] if quantity.components else "1"
            raise UnknownNameError(f"output {name!r} has components: name one, as {name}.{first}")
        if name.partition(".")[0] in inputs.elements and quantity.owner == "force":
            raise UnknownNameError(f"output {name!r} belongs to a force that is an input")
        if not np.isfinite(quantity.values[-1]):
            raise UnknownNameError(f"output {name!r} has no value at this state")
        values = quantity.values[:-1].reshape(-1, len(ABSCISSAE))
        matrix[k] = (values - quantity.values[-1]) @ WEIGHTS / steps
    return matrix[:, :states], matrix[:, states:]


def _step(point: OperatingPoint, *direction: Floats) -> float:
    """A step along a direction that moves everything by about STEP of its size."""
    model = point.model
    length = model.part_size
    _, _, v, w = split(point.u)
    weights = np.tile(np.repeat([1.0 / length, 1.0], 3), model.body_count)
    speeds = np.abs(np.hstack([v, w]).ravel()) * weights
    speed = max(float(np.max(speeds, initial=0.0)), 1.0)
    largest = max(
        float(np.max(np.abs(direction[0]) * weights)),
        float(np.max(np.abs(direction[1]) * weights)) / speed,
        float(np.max(np.abs(direction[4]) / np.maximum(np.abs(point.states), LEAST), initial=0.0)),
    )
    return STEP / largest if largest > 0.0 else 1.0


def _row(point: OperatingPoint, h: float, direction: tuple[Floats, ...]) -> Floats:
    """A reported row of the state displaced by h along a direction."""
    model, evaluator = point.model, point.evaluator
    x, v_change, a_change, lam_change, z_change = direction
    evaluator.states = point.states + h * z_change
    u = displaced_state(point.u, h * x, h * v_change)
    layout = model.report_layout
    report = evaluator.report(point.t, u)
    report[layout["v_dot"]] = point.tangent.a + h * a_change
    report[layout["Lam"]] = point.tangent.multipliers + h * lam_change
    return np.concatenate([[point.t], evaluator.integrated(u), report])
