"""Stability of a static equilibrium, by the stiffness of its freedoms."""

from enum import Enum

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.kernels.array_types import Floats
from dap3d_core.simulation.equilibrium.search import Outcome, search_equilibrium
from dap3d_core.simulation.equilibrium.statics import StaticPose, Statics, displacement
from dap3d_core.simulation.equilibrium.trust_region import zero_stiffness
from dap3d_core.simulation.errors import AssemblyError

#: K is symmetric if it is so to this part: forces with a potential act.
SYMMETRIC = 1e-6
#: Freedoms without stiffness are moved so far, rad or parts of the scene. They are indifferent if
#: the scene comes to rest between these parts of it from where it was.
FINITE, RETURNED, ESCAPED = 0.05, 0.3, 3.0

#: A motion grows if its rate is above this part of the fastest: rounding errors of double roots.
GROWING = 1e-7


@attrs.frozen(eq=False)
class Stability:
    """Stability of an equilibrium.

    Attributes:
        stable: no freedom leads away.
        stiffness: (f,) eigenvalues of the stiffness, N m, ascending by their real parts.
        escaping, indifferent: (k, 6 n) scaled displacements that lead away, that nothing resists.
        is_symmetric: the forces have a potential near the equilibrium.
    """

    stable: bool
    stiffness: NDArray[np.complexfloating]
    escaping: Floats
    indifferent: Floats
    is_symmetric: bool


def stability_of(statics: Statics, pose: StaticPose) -> Stability:
    """Stability of an equilibrium.

    With a potential an equilibrium is stable where it is least: all eigenvalues of the stiffness
    are positive (Lagrange, Dirichlet). Along freedoms of no stiffness a small finite motion
    decides. Without a potential the growth rates of small motions do, with masses and dampers.
    """
    tangent = statics.tangent(pose)
    K = statics.reduced(tangent.stiffness, pose)
    largest = float(np.max(np.abs(K), initial=0.0))
    is_symmetric = float(np.max(np.abs(K - K.T), initial=0.0)) <= SYMMETRIC * largest
    values, Q = np.linalg.eigh(0.5 * (K + K.T)) if is_symmetric else np.linalg.eig(K)
    order = np.argsort(values.real, kind="stable")
    values, Q = values[order], Q[:, order]
    zero = zero_stiffness(np.abs(values), pose.size)
    growing = values.real < -zero
    modes = (pose.free @ Q.real).T
    idle = modes[(np.abs(values) <= zero) & ~growing]
    escaping = modes[growing]
    if len(idle) and not len(escaping):
        fate = _fate(statics, pose, idle)
        escaping = idle[:1] if fate is Fate.ESCAPES else escaping
        idle = idle if fate is Fate.STAYS else idle[:0]
    if not (is_symmetric and tangent.states is None) and not len(escaping):
        mass, damping = (statics.reduced(matrix, pose) for matrix in (tangent.M, tangent.damping))
        motions = np.vstack([np.hstack([0.0 * K, np.eye(len(K))]),
                             -np.linalg.solve(mass, np.hstack([K, damping]))])  # fmt: skip
        if tangent.states is not None:
            motions = _with_states(statics, pose, mass, damping)
        escaping = (pose.free @ _growing_motions(motions, len(K))).T
    return Stability(not len(escaping), values, escaping, idle, is_symmetric)


def _with_states(statics: Statics, pose: StaticPose, mass: Floats, damping: Floats) -> Floats:
    """The matrix of small motions x, x', and of the states of elements."""
    fixed = statics.fixed_tangent(pose)
    own = fixed.states
    assert own is not None
    f, s = len(mass), len(own.rates)
    basis = statics.scale[:, None] * pose.free
    forces = [-statics.reduced(fixed.stiffness, pose), -damping, basis.T @ own.force_by_states]
    matrix = np.zeros((2 * f + s, 2 * f + s))
    matrix[:f, f : 2 * f] = np.eye(f)
    matrix[f : 2 * f] = np.linalg.solve(mass, np.hstack(forces))
    by_motion = (own.rate_by_displacement @ basis, own.rate_by_velocity @ basis)
    matrix[2 * f :] = np.hstack([*by_motion, own.rate_by_states.toarray()])
    return matrix


def _growing_motions(motions: Floats, f: int) -> Floats:
    """(f, k) shapes of f freedoms in the motions (x, x', ...)' = A (x, x', ...) that grow."""
    rates, shapes = np.linalg.eig(motions)
    shapes = shapes[:f, (rates.real > GROWING * np.abs(rates).max()) & (rates.imag >= 0.0)]
    # the phase that leaves the largest real part
    phase = np.exp(-0.5j * np.angle(np.sum(shapes**2, axis=0)))
    return (shapes * phase).real


class Fate(Enum):
    """What follows a small finite motion along freedoms without stiffness."""

    RETURNS, STAYS, ESCAPES = range(3)


def _fate(statics: Statics, pose: StaticPose, modes: Floats) -> Fate:
    """Where a motion without inertia comes to rest after a small displacement to either side."""
    mix = np.random.default_rng(1).standard_normal(len(modes)) @ modes
    mix /= np.max(np.abs(mix))
    remains = False
    for x in (FINITE * mix, -FINITE * mix):
        try:
            search = search_equilibrium(statics.evaluator, statics.moved(pose.u, x), statics.t)
        except AssemblyError:  # the other joints do not let it
            continue
        shift, turn = displacement(pose.u, search.pose.u)
        moved = float(np.max(np.abs(np.hstack([shift / statics.length, turn]))))
        if search.outcome is not Outcome.BALANCED or moved > ESCAPED * FINITE:
            return Fate.ESCAPES
        remains |= moved > RETURNED * FINITE
    return Fate.STAYS if remains else Fate.RETURNS
