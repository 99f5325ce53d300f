"""States displaced along directions; the motion of a mode as a result that can be looked at."""

from contextlib import suppress

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.rigid_motion import quaternion_product
from dap3d_core.model.state_layout import join, split, velocities_of
from dap3d_core.result import Result, RunMetadata, information
from dap3d_core.simulation.errors import AssemblyError
from dap3d_core.simulation.initial.assemble import correct_initial
from dap3d_core.simulation.linearization.operating_point import OperatingPoint
from dap3d_core.simulation.linearization.state_matrices import Complex

#: Largest rotation of a body that is shown, rad.
MOST_TURN = 0.5


def displaced_state(u: Floats, x: Floats, velocity: Floats) -> Floats:
    """The state u (13 n,) displaced by x (6 n,), its velocities changed (6 n,); global axes.

    Rotation vectors may be large: p becomes exp(theta / 2) p.
    """
    r, p, v, w = split(u)
    x, velocity = x.reshape(-1, 6), velocity.reshape(-1, 6)
    half = 0.5 * x[:, 3:]
    angle = np.linalg.norm(half, axis=1, keepdims=True)
    e0, e = np.cos(angle), np.sinc(angle / np.pi) * half
    turned = quaternion_product(np.hstack([e0, e]), p)
    return join(r + x[:, :3], turned, v + velocity[:, :3], w + velocity[:, 3:])


def mode_motion(
    point: OperatingPoint,
    shapes: Complex,
    eigenvalues: Complex,
    mode: int,
    size: float,
    instants: int,
) -> Result:
    """The motion of a mode over one period; arguments and errors as of ``Linearization.motion``."""
    model = point.model
    if not 0 <= mode < len(eigenvalues):
        raise IndexError(f"there is no mode {mode + 1}: the modes are 1 to {len(eigenvalues)}")
    if not (size > 0.0 and instants > 1):
        raise ValueError("size is above zero, and instants are two or more")
    shape, rate = shapes[:, mode], abs(eigenvalues[mode].imag)
    period = 2.0 * np.pi / rate if rate > 0.0 else 1.0
    parts = np.abs(shape).reshape(-1, 6)
    shift, turn = float(np.max(parts[:, :3])), float(np.max(parts[:, 3:]))
    factors = [size * model.extent / shift if shift > 0.0 else np.inf,
               MOST_TURN / turn if turn > 0.0 else np.inf]  # fmt: skip
    amplitude = min(factors)
    rows = []
    with point.placed() as evaluator:
        for t in np.linspace(0.0, period, instants):
            phase = np.exp(2j * np.pi * t / period)
            velocity = amplitude * np.real(shape * phase * 2j * np.pi / period)
            change = velocity - velocities_of(point.u)
            u = displaced_state(point.u, amplitude * np.real(shape * phase), change)
            with suppress(AssemblyError):  # a mode shape is straight, the joints are not
                u = correct_initial(evaluator, u, point.t).u
            report = evaluator.report(point.t, u)
            rows.append(np.concatenate([[t], evaluator.integrated(u), report]))
    note = information(
        f"mode {mode + 1} of a linearisation, eigenvalue {eigenvalues[mode]:.6g}: "
        "displacements along a mode shape, joints closed; no simulation"
    )
    record = RunMetadata(scene_text=point.compiled.scene_text, method=point.compiled.method,
                         integrator="none", notes=(note,), types=point.compiled.types)  # fmt: skip
    return Result.of_run(model, np.array(rows), record, lambda: point.evaluator)
