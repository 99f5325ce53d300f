"""Impulses with the joints held: [M D^T; D 0] (dv; -Lambda) = (P; change of D v).

In the scaled coordinates of the bodies (docs/decisions/0006), by the block factors of the
formulation. Compiled for scenes whose velocities jump, at the first jump.
"""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Floats, System, step_functions
from dap3d_core.assembly.evaluate import place
from dap3d_core.formulations.common.constraints import (
    PART,
    acceleration_residual,
    correct,
    factorise_anyway,
    linearise,
    velocity_residuals,
)
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.kernels.runtime.cache import compiled

#: Corrections of one solution. The first solves; the others are refinement and, with regularised
#: factors, passes of the proximal method, each of which leaves a small part (regularised.py).
CORRECTIONS = 6


@compiled
def factor_independent(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """D^ and its factors at a state, and D v - nu into ``residual``; rows are independent."""
    place(t, y, system, loops)
    linearise(t, system, loops)
    velocity_residuals(system)
    factorise_anyway(system, None)


@compiled
def factor_regularised(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """The same for rows that may depend on each other."""
    place(t, y, system, loops)
    linearise(t, system, loops)
    velocity_residuals(system)
    factorise_anyway(system, PART)


@compiled
def solve_held(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Scaled impulses (6 n + 6) and changes of D v (rows) in out become scaled dv and -Lambda."""
    x, gamma, multipliers = system.acceleration, system.gamma, system.multipliers
    size, rows = x.shape[0], gamma.shape[0]
    for k in range(size):
        x[k] = out[k]
    for k in range(rows):
        gamma[k], out[size + k] = out[size + k], 0.0
    for _ in range(CORRECTIONS):
        acceleration_residual(system)
        correct(system)
        for k in range(size):
            x[k] += system.change[k]
        for k in range(rows):
            out[size + k] += multipliers[k]
    for k in range(size):
        out[k] = x[k]


class HeldJoints:
    """The joints of a model at one state, which hold while impulses act.

    Attributes:
        root: (n + 1,) 1/sqrt(m), and B: (n + 1, 3, 3), of each body, ground zero.
        residual: (rows,) D v - nu, and nu: (rows,), both in the order of the solver.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        """Args: an evaluator in coordinates of bodies; its arrays are worked on."""
        self._evaluator = evaluator
        self.size = 6 * (evaluator.model.body_count + 1)
        self._has_rows = evaluator.model.row_count > 0
        if self._has_rows:
            regular = evaluator.formulation.accepts_redundant
            factor = factor_regularised if regular else factor_independent
            self._functions = step_functions(factor, solve_held)

    @IGNORE_FLOAT_ERRORS
    def set_state(self, t: float, u: Floats, states: Floats, inputs: Floats) -> None:
        """Factors at a state u (13 n,), states of elements (states,) and inputs (inputs,)."""
        evaluator = self._evaluator
        evaluator.states = states
        evaluator.set_inputs(inputs)
        system = evaluator.system
        if self._has_rows:
            y = evaluator.integrated(u)
            self._functions[0](t, y, np.zeros(0), system, evaluator.loops)
        else:
            evaluator.place(t, u)
        self.residual, self.nu = system.residual.copy(), system.nu.copy()
        self.root = system.metric[:, 0].copy()
        self.B = system.metric[:, 7:16].reshape(-1, 3, 3).copy()

    @IGNORE_FLOAT_ERRORS
    def solve(self, impulses: Floats, changes: Floats) -> tuple[Floats, Floats]:
        """Scaled changes of velocity, (6 n + 6), and the impulses Lambda of the rows.

        Args:
            impulses: (6 n + 6,) scaled impulses on the bodies, ground first.
            changes: (rows,) change of D v.
        """
        if not self._has_rows:
            return impulses.copy(), np.zeros(0)
        evaluator, size = self._evaluator, impulses.size
        out = np.concatenate([impulses, changes])
        self._functions[1](0.0, out[:0], out, evaluator.system, evaluator.loops)
        return out[:size], -out[size:]

    def scaled(self, impulses: Floats) -> Floats:
        """Scaled impulses or rows (..., 6 n + 6) of those in global axes: G M^(-1/2)."""
        parts = impulses.reshape(*impulses.shape[:-1], self.root.size, 2, 3)
        linear = self.root[:, None] * parts[..., 0, :]
        turning = np.einsum("...nc,ncd->...nd", parts[..., 1, :], self.B)
        scaled: Floats = np.stack([linear, turning], axis=-2).reshape(impulses.shape)
        return scaled

    def unscaled(self, dv: Floats) -> Floats:
        """Changes of velocity (6 n + 6,) in global axes of scaled ones."""
        parts = dv.reshape(-1, 2, 3)
        turning = np.einsum("ncd,nd->nc", self.B, parts[:, 1])
        unscaled: Floats = np.stack([self.root[:, None] * parts[:, 0], turning], axis=1).ravel()
        return unscaled
