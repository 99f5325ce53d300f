"""Linearised equations of motion in coordinates scaled by mass and inertia.

With the mass matrix M = L L^T, block by block, displacements and velocities x^ = L^T x, v^ = L^T v
have the unit mass matrix. In axes that turn with Omega (steady_motion.py) the equations are

    x^_dot = v^ + S x^                            S: (omega - Omega) x on rotations, -Omega x on r
    v^_dot = -K x^ - C v^ + (D^T + F) lambda      C: with Omega x on velocities
    0 = D v^ + G x^       all rows                0 = D x^    those with a position level

F: friction of joints by their multipliers. With states z of elements:

    z_dot = Z_x x^ + Z_v v^ + Z_z z      v^_dot = ... + Z_f z      rows: ... + Z_C z, Z_nu z
"""

from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.model import Model
from dap3d_core.model.rotations import skew
from dap3d_core.model.state_layout import split
from dap3d_core.simulation.linearization.steady_motion import SteadyFrames
from dap3d_core.simulation.linearization.tangent import TangentMatrices


@attrs.frozen(eq=False)
class ScaledStates:
    """The matrices Z above, as scipy CSR arrays.

    Attributes:
        by_displacement, by_velocity: (s, 6 n); by_states: (s, s), of the rates.
        force: (6 n, s).
        position, velocity, acceleration: (rows, s) of D x^, D v^ + G x^, D a - gamma.
    """

    by_displacement: Any
    by_velocity: Any
    by_states: Any
    force: Any
    position: Any
    velocity: Any
    acceleration: Any

    def of(self, kept: Integers) -> "ScaledStates":
        """The matrices of some of the states."""
        rates = {"by_displacement": self.by_displacement, "by_velocity": self.by_velocity}
        others = ("force", "position", "velocity", "acceleration")
        return ScaledStates(
            by_states=self.by_states[kept][:, kept],
            **{name: matrix[kept] for name, matrix in rates.items()},
            **{name: getattr(self, name)[:, kept] for name in others},
        )


@attrs.frozen(eq=False, kw_only=True)
class ScaledEquations:
    """The matrices above, as scipy CSR arrays; rows of D have unit length.

    Attributes:
        U: (6 n, 6 n) L^-T: displacements x = U x^.
        S, K, C: (6 n, 6 n).
        D, G: (rows, 6 n).
        F: (6 n, rows).
        acceleration_by_displacement, acceleration_by_velocity: (rows, 6 n) of D a - gamma.
        gradient: (rows,) lengths of the rows of D before; multipliers are lambda gradient.
        position_row: (rows,) True where a row has a position level.
        states: of elements.
    """

    U: Any
    S: Any
    K: Any
    C: Any
    D: Any
    G: Any
    F: Any
    acceleration_by_displacement: Any
    acceleration_by_velocity: Any
    gradient: Floats
    position_row: NDArray[np.bool_]
    states: ScaledStates


def scaled_equations(
    model: Model, tangent: TangentMatrices, u: Floats, frames: SteadyFrames
) -> ScaledEquations:
    """The scaled equations at a state u (13 n,), in axes in which the motion is steady."""
    from scipy.sparse import block_diag, csr_array, diags_array

    n = model.body_count
    w = split(u)[3]
    L = np.linalg.cholesky(_diagonal_blocks(tangent.M, n))
    U = csr_array(block_diag(list(np.linalg.inv(L).transpose(0, 2, 1)), format="csr"))
    L_T = csr_array(block_diag(list(L.transpose(0, 2, 1)), format="csr"))
    turning = np.zeros((n, 6, 6))
    turning[:, :3, :3], turning[:, 3:, 3:] = skew(frames.of_translation), skew(frames.Omega)
    spin = -turning
    spin[:, 3:, 3:] += skew(w)
    turning, spin = (csr_array(block_diag(list(b), format="csr")) for b in (turning, spin))
    D = tangent.D @ U
    gradient = np.sqrt(np.asarray((D * D).sum(axis=1)).ravel())
    gradient[gradient == 0.0] = 1.0
    inverse = diags_array(1.0 / gradient)
    by_rows = (
        tangent.velocity_by_displacement,
        tangent.acceleration_by_displacement,
        tangent.acceleration_by_velocity,
    )
    G, by_displacement, by_velocity = (csr_array(inverse @ (m @ U)) for m in by_rows)
    return ScaledEquations(
        U=U,
        S=csr_array(L_T @ spin @ U),
        K=csr_array(U.T @ tangent.stiffness @ U),
        C=csr_array(U.T @ tangent.damping @ U + L_T @ turning @ U),
        D=csr_array(inverse @ D),
        G=G,
        F=csr_array(U.T @ tangent.friction_by_multipliers @ inverse),
        acceleration_by_displacement=by_displacement,
        acceleration_by_velocity=by_velocity,
        gradient=gradient,
        position_row=model.position_row,
        states=_scaled_states(tangent, U, inverse),
    )


def _scaled_states(tangent: TangentMatrices, U: Any, inverse: Any) -> ScaledStates:
    own = tangent.states
    if own is None:
        from scipy.sparse import csr_array

        by_six, none = csr_array((0, U.shape[0])), csr_array((0, 0))
        rows = (csr_array((inverse.shape[0], 0)) for _ in range(3))
        return ScaledStates(by_six, by_six, none, by_six.T, *rows)
    return ScaledStates(
        by_displacement=own.rate_by_displacement @ U,
        by_velocity=own.rate_by_velocity @ U,
        by_states=own.rate_by_states,
        force=U.T @ own.force_by_states,
        position=inverse @ own.position_by_states,
        velocity=inverse @ own.velocity_by_states,
        acceleration=inverse @ own.acceleration_by_states,
    )


def _diagonal_blocks(M: Any, n: int) -> Floats:
    """(n, 6, 6) blocks of a block-diagonal matrix."""
    entries = M.tocoo()
    blocks = np.zeros((n, 6, 6))
    blocks[entries.row // 6, entries.row % 6, entries.col % 6] = entries.data
    return blocks
