"""Search for a static equilibrium: the pose where a motion without inertia would come to rest.

From the start the forces lead on, by steps on which they do work: never over a hill, so that of
several equilibria the one of the valley that the start lies in is found. A start that is an
equilibrium is returned, stable or not; an unstable one on the way is left again. No potential is
needed: the work of the forces in a step is compared with what stiffness predicts.
"""

from enum import Enum

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.state_layout import at_rest
from dap3d_core.simulation.equilibrium.statics import StaticPose, Statics
from dap3d_core.simulation.errors import AssemblyError
from dap3d_core.simulation.initial.least_change import largest_move

#: A stiffness below this part of the largest is none: rounding errors of K.
NEUTRAL = 1e-11
#: A part of the unbalanced forces below this is none.
BALANCED = 1e-9
#: mu is found to this part of the radius.
FIT = 0.1

MOST_STEPS = 1000
#: Length of the first step, and largest rotation of a body in any, rad or parts of the scene.
FIRST_RADIUS, MOST_TURN = 0.1, 0.4
SHORTEST_RADIUS = 1e-13
#: Unstable equilibria that are left at most.
MOST_LEFT = 20
#: A step is taken if the forces do this part of the work that was predicted.
ACCEPTED = 0.1
#: The radius changes by these factors, below and above these parts of the predicted work.
SHRINK, GROW, POOR, GOOD = 0.25, 2.0, 0.25, 0.75
#: A motion that is further than this from its start, in parts of the scene or rad, does not end.
FARTHEST_MOTION = 1e5
#: The same of rotations, rad: where poses repeat themselves after a turn, and where turns are
#: counted or rolling joints make a way of them.
MOST_TURNS, MOST_COUNTED_TURNS = 6.0 * np.pi, 200.0 * np.pi
#: Unbalanced forces of this part are as small as they get.
LEAST_UNBALANCED = 1e-17

#: K is symmetric if it is so to this part: forces with a potential act.
SYMMETRIC = 1e-6
#: Freedoms without stiffness are moved so far, rad or parts of the scene. They are indifferent if
#: the scene comes to rest between these parts of it from where it was.
FINITE, RETURNED, ESCAPED = 0.05, 0.3, 3.0

#: A motion grows if its rate is above this part of the fastest: rounding errors of double roots.
GROWING = 1e-7


@attrs.frozen(eq=False)
class Step:
    """A step of the freedoms.

    Attributes:
        y: (f,) the step.
        gain: work of the forces that K predicts, N m.
        is_newton: mu is zero.
    """

    y: Floats
    gain: float
    is_newton: bool


def trust_region_step(
    K: Floats, g: Floats, size: float, radius: float, *, leaves: bool = False
) -> Step:
    """The step from unbalanced forces g (f,) with stiffness K (f, f).

    Args:
        K, g: of the freedoms, scaled.
        size: of forces, N m: a part of it is zero.
        radius: largest length of y.
        leaves: along a negative stiffness, though nothing pushes that way.
    """
    symmetric = 0.5 * (K + K.T)
    w, Q = np.linalg.eigh(symmetric)
    share, zero = Q.T @ g, zero_stiffness(w, size)
    held = np.abs(w) > zero if leaves else w > zero
    idle = ~held & (np.abs(share) <= BALANCED * size / np.sqrt(max(len(share), 1)))
    w, Q, share = w[~idle], Q[:, ~idle], share[~idle]
    if not len(w):
        return Step(np.zeros_like(g), 0.0, True)
    lowest = float(w[0])
    own = Q.T @ K @ Q
    if lowest > zero:
        y = Q @ np.linalg.solve(own, share)
        if np.linalg.norm(y) <= radius:
            return Step(y, _gain(K, g, y), True)
    floor = max(0.0, -lowest) + zero
    if lowest <= zero and _length(share, w, floor) < radius:  # the hard case
        z = share / (w + floor)
        rest = np.sqrt(max(radius**2 - float(z @ z), 0.0))
        z[0] += rest if z[0] >= 0.0 else -rest
        y = Q @ z
        return Step(y, _gain(symmetric, g, y), False)
    mu = _damping(share, w, floor, radius)
    y = Q @ np.linalg.solve(own + mu * np.eye(len(w)), share)
    y *= min(1.0, radius / float(np.linalg.norm(y)))
    return Step(y, _gain(K, g, y), False)


def zero_stiffness(w: Floats, size: float) -> float:
    """The stiffness below which one of all, w (f,), is none; size: of forces, N m."""
    return NEUTRAL * max(float(np.max(np.abs(w), initial=0.0)), size)


def held_solution(matrix: Floats, side: Floats, size: float) -> Floats:
    """The least solution of equations of stiffness, without directions that none holds.

    size: of forces, N m: a part of it is zero.
    """
    left, values, right = np.linalg.svd(matrix)
    held = values > zero_stiffness(values, size)
    return right[held].T @ ((left.T @ side)[held] / values[held])


def _gain(K: Floats, g: Floats, y: Floats) -> float:
    return float(g @ y - 0.5 * y @ K @ y)


def _length(share: Floats, w: Floats, mu: float) -> float:
    return float(np.linalg.norm(share / (w + mu)))


def _damping(share: Floats, w: Floats, floor: float, radius: float) -> float:
    """The mu above a floor at which the step is as long as the radius."""
    low, high = floor, float(np.linalg.norm(share)) / radius + floor
    if _length(share, w, low) <= radius:
        return low
    for _ in range(200):
        mu = np.sqrt(low * high) if low > 0.0 and high > 4.0 * low else 0.5 * (low + high)
        length = _length(share, w, mu)
        if abs(length - radius) <= FIT * radius:
            break
        low, high = (mu, high) if length > radius else (low, mu)
    return float(mu)


class Outcome(Enum):
    """How a search ended."""

    BALANCED, RUNAWAY, STALLED = "balanced", "runaway", "stalled"


class Search:
    """A search from a state u (13 n,); its velocities are left out.

    Turns of angles are counted on from those that the evaluator has.

    Attributes:
        outcome: how it has ended.
        pose: the last pose.
        steps: how many were taken.
        started_balanced: the start is an equilibrium.
        left: how often the motion came to an unstable equilibrium, and left it to either side.
        motion: (6 n,) the last displacement, in parts of the scene's length, and rotation vector,
            rad, of each body.

    Raises:
        AssemblyError: the start cannot be assembled.
    """

    def __init__(self, statics: Statics, u: Floats) -> None:
        self.statics, self.steps, self.left = statics, 0, 0
        self.pose = statics.at(statics.closed(at_rest(u)))
        model = statics.evaluator.model
        self.extent = max(model.extent, statics.length)
        self.radius = FIRST_RADIUS
        self.path = self.motion = np.zeros(6 * model.body_count)
        repeats = not model.own_angle_count and bool(np.all(model.position_row))
        self.most_turns = MOST_TURNS if repeats else MOST_COUNTED_TURNS
        self.started_balanced = self.pose.residual <= BALANCED
        self.outcome = self._run()

    def _run(self) -> Outcome:
        """Take steps until the forces are balanced, the motion runs away, or nothing helps."""
        leaves = False
        while self.pose.residual > BALANCED or (leaves and self.left <= MOST_LEFT):
            if self._is_far():
                return Outcome.RUNAWAY
            if self.steps == MOST_STEPS:
                return Outcome.STALLED
            self.steps += 1
            if not self._advance(leaves=leaves):
                return Outcome.STALLED
            leaves = self.pose.residual <= BALANCED and self._is_unstable()
            if leaves:
                self.left += 1
                self.radius = FIRST_RADIUS
        self._refine()
        return Outcome.BALANCED

    def _is_unstable(self) -> bool:
        """Whether a stiffness at this pose is negative."""
        K = self.statics.stiffness(self.pose)
        w = np.asarray(np.linalg.eigvalsh(0.5 * (K + K.T)), dtype=np.float64)
        return bool(np.any(w < -zero_stiffness(w, self.pose.size)))

    def _advance(self, *, leaves: bool) -> bool:
        """Take the next step, as long as the forces follow it; False if none is short enough.

        leaves: it leaves an unstable equilibrium.
        """
        pose = self.pose
        K = self.statics.stiffness(pose)
        while self.radius > SHORTEST_RADIUS:
            step = self._limited(K, leaves=leaves)
            trial = self._trial(pose, step)
            if trial is None:
                self.radius *= SHRINK
                continue
            x = self.statics.way(pose.u, trial.u)
            ratio = self._work(pose, trial, x) / step.gain if step.gain > 0.0 else -1.0
            settles = step.is_newton and trial.residual < 0.5 * pose.residual
            if ratio >= GOOD and not step.is_newton:
                self.radius *= GROW
            elif ratio < POOR and not settles:
                self.radius = SHRINK * min(self.radius, float(np.linalg.norm(step.y)))
            if ratio >= ACCEPTED or (settles and trial.residual < 1e-4):
                self._take(trial, x)
                return True
        return False

    def _limited(self, K: Floats, *, leaves: bool) -> Step:
        """A step within the radius, which is made shorter where it turns a body too far."""
        pose = self.pose
        while True:
            step = trust_region_step(K, pose.unbalanced, pose.size, self.radius, leaves=leaves)
            _, largest = largest_move(pose.free @ step.y)
            if largest <= MOST_TURN:
                return step
            self.radius = float(np.linalg.norm(step.y)) * 0.9 * MOST_TURN / largest

    def _trial(self, pose: StaticPose, step: Step) -> StaticPose | None:
        """The pose after a step; None where it cannot be assembled."""
        try:
            trial = self.statics.behind(pose.u, pose.free @ step.y)
        except (AssemblyError, np.linalg.LinAlgError):
            return None
        return trial if np.isfinite(trial.residual) else None

    def _work(self, pose: StaticPose, trial: StaticPose, x: Floats) -> float:
        """Work of the forces from a pose to another, by the trapezoidal rule.

        Reactions of fixed multipliers do none between poses on the constraints, and with them the
        sum is free of the large parts that cancel.
        """
        before = self.statics.balance(pose.u, pose)
        after = self.statics.balance(trial.u, pose)
        return 0.5 * float((before + after) @ x)

    def _take(self, trial: StaticPose, x: Floats) -> None:
        self.pose, self.motion, self.path = trial, x, self.path + x
        self.statics.evaluator.count_turns(self.statics.t, trial.u)

    def _is_far(self) -> bool:
        path = self.path.reshape(-1, 6)
        shift = np.linalg.norm(path[:, :3], axis=1) * self.statics.length
        turn = np.linalg.norm(path[:, 3:], axis=1)
        return bool(np.any(shift > FARTHEST_MOTION * self.extent) or np.any(turn > self.most_turns))

    def _refine(self) -> None:
        """Newton steps, as long as they help."""
        for _ in range(20):
            pose = self.pose
            if pose.residual <= LEAST_UNBALANCED:
                return
            K = self.statics.stiffness(pose)
            y = held_solution(K, pose.unbalanced, pose.size)
            trial = self._trial(pose, Step(y, 0.0, True))
            if trial is None or not trial.residual < pose.residual:
                return
            self._take(trial, self.statics.way(pose.u, trial.u))
            self.steps += 1
            if trial.residual > 0.5 * pose.residual:
                return


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
            search = Search(Statics(statics.evaluator, statics.t), statics.moved(pose.u, x))
        except AssemblyError:  # the other joints do not let it
            continue
        moved = float(np.max(np.abs(statics.way(pose.u, search.pose.u))))
        if search.outcome is not Outcome.BALANCED or moved > ESCAPED * FINITE:
            return Fate.ESCAPES
        remains |= moved > RETURNED * FINITE
    return Fate.STAYS if remains else Fate.RETURNS
