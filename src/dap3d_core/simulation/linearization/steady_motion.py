"""Frames in which a steady motion stands still.

The linearised equations of a steady motion (a relative equilibrium: a spinning satellite, a rolling
wheel, a top that precesses) have constant coefficients in axes that turn with it. Of each set of
connected bodies the angular velocity Omega of these axes fulfils, for every body,

    r_ddot = Omega x r_dot        omega_dot = Omega x omega
    (omega - Omega)~ J = J (omega - Omega)~       the inertia tensor keeps its components

It is found by least squares, the shortest where there are many: a body of revolution that spins
about its axis, a rolling wheel or a sleeping top, is described in axes that do not spin. Where a
common translation of the bodies changes no force and no row, as in space, a common acceleration is
free: such axes may drift and fall.

In a steady motion accelerations turn with the axes as well, which the linearised equations tell:
their rates are Omega x r_ddot and Omega x omega_dot.
"""

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.kernels.array_types import Floats
from dap3d_core.linear.rank import Dependency
from dap3d_core.model import Model
from dap3d_core.model.rotations import rotation, skew
from dap3d_core.model.state_layout import split
from dap3d_core.simulation.initial.assemble import largest
from dap3d_core.simulation.linearization.tangent import TangentMatrices

#: Accelerations beyond those of the steady motion, as a part of those that forces would give, those
#: of a displacement by the size of the bodies among them.
STEADY = 1e-7
#: Singular values below this part of the largest leave Omega undetermined.
RCOND = 1e-9
#: Entries of e~ J - J e~, J of norm 1, below which they are rounding: of a ball's they all are.
ROUNDING_OF_INERTIA = 1e-14


@attrs.frozen(eq=False)
class SteadyFrames:
    """Axes in which the motion is steady.

    Attributes:
        Omega: (n, 3) angular velocity of the axes of each body, global, rad/s.
        of_translation: (n, 3) that of the axes of displacements r: zero for a body whose
            translation changes nothing, so that its drift is no rotation.
        drift: frequencies |Omega|, rad/s, at which a drift of free bodies appears in their axes.
        is_steady: whether accelerations are those of a steady motion.
    """

    Omega: Floats
    of_translation: Floats
    drift: tuple[float, ...]
    is_steady: bool


def steady_frames(
    model: Model, tangent: TangentMatrices, u: Floats, dependencies: Sequence[Dependency] = ()
) -> SteadyFrames:
    """Angular velocities of the axes in which the motion from a state u (13 n,) is steady.

    dependencies: of redundant rows.
    """
    n = model.body_count
    _, p, v, w = split(u)
    A = rotation(p)
    J = A @ model.Jp @ np.swapaxes(A, -1, -2)
    J = J / np.linalg.norm(J, axis=(1, 2), keepdims=True)
    a = tangent.a.reshape(n, 6)
    length = model.part_size
    matrix, side = np.zeros((n, 15, 3)), np.zeros((n, 15))  # one row each equation, r / length
    matrix[:, :3], side[:, :3] = -skew(v) / length, a[:, :3] / length
    matrix[:, 3:6], side[:, 3:6] = -skew(w), a[:, 3:]
    for k in range(3):
        e = skew(np.eye(3)[k])
        matrix[:, 6:, k] = (e @ J - J @ e).reshape(n, 9)
    matrix[:, 6:][np.abs(matrix[:, 6:]) <= ROUNDING_OF_INERTIA] = 0.0
    side[:, 6:] = np.einsum("nrk,nk->nr", matrix[:, 6:], w)
    matrix = np.concatenate([matrix, np.zeros((n, 15, 3))], axis=2)
    matrix[:, :3, 3:] = np.eye(3)  # a common acceleration
    unknowns, of_translation, drift = np.zeros((n, 6)), np.ones((n, 1)), set()
    sets = _connected(tangent)
    for members, is_free in zip(sets, _free(tangent, sets), strict=True):
        count = 6 if is_free else 3
        equations = matrix[members, :, :count].reshape(-1, count)
        solution = np.linalg.lstsq(equations, side[members].ravel(), rcond=RCOND)[0]
        unknowns[members, :count] = solution
        if is_free and len(members) == 1:
            of_translation[members] = 0.0
        elif is_free:
            drift.add(float(np.linalg.norm(solution[:3])))
    missed = side - np.einsum("nrk,nk->nr", matrix, unknowns)
    Omega = unknowns[:, :3]
    mass = np.hstack([np.repeat(model.mass[:, None], 3, 1), np.linalg.norm(model.Jp, ord=-2,
                      axis=(1, 2))[:, None].repeat(3, 1)])  # fmt: skip
    loads = np.abs(tangent.f) + np.abs(tangent.D.T) @ np.abs(tangent.multipliers)
    unit = np.repeat([length, 1.0], 3)
    loads = np.maximum(loads, np.abs(tangent.stiffness) @ np.tile(unit, n))  # f may balance
    size = loads.reshape(n, 6) / mass / unit
    rate = max(largest(w), largest(v) / length, float(np.sqrt(largest(size))))
    is_steady = largest(missed[:, :6]) <= STEADY * rate**2
    is_steady = is_steady and largest(missed[:, 6:]) <= STEADY * rate
    Omega[np.abs(Omega) <= RCOND * rate] = 0.0
    if is_steady and (np.any(v) or np.any(w)):
        change = acceleration_rates(tangent, np.hstack([v, w]).ravel(), dependencies).reshape(n, 6)
        change[:, :3] -= np.cross(Omega, a[:, :3])
        change[:, 3:] -= np.cross(Omega, a[:, 3:])
        is_steady = largest(change / np.repeat([length, 1.0], 3)) <= STEADY * rate**3
    if not is_steady:
        Omega = np.zeros((n, 3))
    return SteadyFrames(Omega, of_translation * Omega, tuple(drift - {0.0}), is_steady)


def independent_rows(rows: int, dependencies: Sequence[Dependency]) -> Any:
    """Rows without the redundant ones: of each dependency those that its others give."""
    from scipy.linalg import qr

    left_out: list[Any] = []
    for dependency in dependencies:
        _, _, pivots = qr(dependency.combinations, pivoting=True)
        left_out.append(dependency.rows[pivots[: len(dependency.combinations)]])
    return np.setdiff1d(np.arange(rows), np.concatenate([np.zeros(0, dtype=int), *left_out]))


def acceleration_rates(
    tangent: TangentMatrices, v: Floats, dependencies: Sequence[Dependency]
) -> Floats:
    """(6 n,) rates of the accelerations along the motion, by the linearised equations.

    Changes of functions of time beyond their second derivatives are left out. NaN at a singular
    pose.
    """
    from scipy.sparse import block_array, csc_array
    from scipy.sparse.linalg import splu

    chosen = independent_rows(tangent.D.shape[0], dependencies)
    D, a = tangent.D[chosen], tangent.a
    reactions = D.T + tangent.friction_by_multipliers[:, chosen]
    matrix = block_array([[tangent.M, -reactions], [D, None]]) if len(chosen) else tangent.M
    by_motion = (tangent.acceleration_by_displacement @ v + tangent.acceleration_by_velocity @ a)[
        chosen
    ]
    side = np.concatenate([-(tangent.stiffness @ v + tangent.damping @ a), -by_motion])
    try:
        rates: Floats = splu(csc_array(matrix)).solve(side)[: len(a)]
    except RuntimeError:  # exactly singular
        return np.full(len(a), np.nan)
    return rates


def _free(tangent: TangentMatrices, sets: Sequence[Any]) -> NDArray[np.bool_]:
    """True for sets of bodies whose common translation changes no force and no row."""
    from scipy.sparse import csr_array

    label = np.zeros(len(tangent.f) // 6, dtype=np.int64)
    for k, members in enumerate(sets):
        label[members] = k
    row = (6 * np.arange(len(label))[:, None] + np.arange(3)).ravel()
    column = (3 * label[:, None] + np.arange(3)).ravel()
    shape = (len(tangent.f), 3 * len(sets))
    translations = csr_array((np.ones(len(row)), (row, column)), shape=shape)
    free = np.ones(shape[1], dtype=bool)
    for matrix in (tangent.stiffness, tangent.damping, tangent.D):
        change = abs(matrix @ translations) - RCOND * (abs(matrix) @ translations)
        changed = change.tocoo()
        free[changed.col[changed.data > 0.0]] = False
    return np.all(free.reshape(-1, 3), axis=1)


def _connected(tangent: TangentMatrices) -> list[Any]:
    """Bodies that joints or forces connect, other than by ground."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    n = len(tangent.f) // 6
    couplings = abs(tangent.stiffness) + abs(tangent.damping) + abs(tangent.D.T) @ abs(tangent.D)
    entries = couplings.tocoo()
    bodies = (entries.row // 6, entries.col // 6)
    graph = csr_array((np.ones(len(entries.row)), bodies), shape=(n, n))
    count, label = connected_components(graph, directed=False)
    order = np.argsort(label, kind="stable")
    ends = np.cumsum(np.bincount(label, minlength=count))[:-1]
    return np.split(order, ends) if n else []
