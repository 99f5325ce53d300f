"""Search for a static equilibrium: the pose where a motion without inertia would come to rest.

From the start the forces lead on, by steps on which they do work (trust_region.py): never over a
hill, so that of several equilibria the one of the valley that the start lies in is found. A start
that is an equilibrium is returned, stable or not; an unstable one on the way is left again. No
potential is needed: the work of the forces in a step is compared with what stiffness predicts.
"""

from enum import Enum

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.simulation.equilibrium.statics import StaticPose, Statics, at_rest, displacement
from dap3d_core.simulation.equilibrium.trust_region import (
    BALANCED,
    Step,
    held_solution,
    trust_region_step,
    zero_stiffness,
)
from dap3d_core.simulation.errors import AssemblyError

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


class Outcome(Enum):
    """How a search ended."""

    BALANCED, RUNAWAY, STALLED = "balanced", "runaway", "stalled"


@attrs.frozen(eq=False)
class Search:
    """A search that has ended.

    Attributes:
        outcome: how.
        pose: the last pose.
        steps: how many were taken.
        started_balanced: the start is an equilibrium.
        left: the motion came to an unstable equilibrium, and left it to an arbitrary side.
        motion: (n, 6) the last displacement, in parts of the scene's length, and rotation vector,
            rad, of each body.
    """

    outcome: Outcome
    pose: StaticPose
    steps: int
    started_balanced: bool
    left: bool
    motion: Floats


def search_equilibrium(evaluator: Evaluator, u: Floats, t: float = 0.0) -> Search:
    """Search from a state u (13 n,); its velocities are left out.

    Turns of angles are counted on from those that the evaluator has.

    Raises:
        AssemblyError: the start cannot be assembled.
    """
    return _Search(Statics(evaluator, t), u).run()


class _Search:
    """The state of a search."""

    def __init__(self, statics: Statics, u: Floats) -> None:
        self.statics = statics
        self.pose = statics.at(statics.closed(at_rest(u)))
        model = statics.evaluator.model
        self.extent = max(model.extent, statics.length)
        self.radius = FIRST_RADIUS
        self.path = np.zeros((model.body_count, 6))
        self.motion = np.zeros_like(self.path)
        self.leaves = 0
        repeats = not model.own_angle_count and bool(np.all(model.position_row))
        self.most_turns = MOST_TURNS if repeats else MOST_COUNTED_TURNS

    def run(self) -> Search:
        """Take steps until the forces are balanced, the motion runs away, or nothing helps."""
        started_balanced = self.pose.residual <= BALANCED
        if started_balanced:
            return self._ended(Outcome.BALANCED, self._refine(), started_balanced)
        leaves = False
        for steps in range(1, MOST_STEPS + 1):
            if not self._advance(leaves=leaves):
                return self._ended(Outcome.STALLED, steps, False)
            leaves = self.pose.residual <= BALANCED and self._is_unstable()
            if leaves:
                self.leaves += 1
                self.radius = FIRST_RADIUS
            if self.pose.residual <= BALANCED and (not leaves or self.leaves > MOST_LEFT):
                return self._ended(Outcome.BALANCED, steps + self._refine(), False)
            if self._is_far():
                return self._ended(Outcome.RUNAWAY, steps, False)
        return self._ended(Outcome.STALLED, MOST_STEPS, False)

    def _ended(self, outcome: Outcome, steps: int, started_balanced: bool) -> Search:
        return Search(outcome, self.pose, steps, started_balanced, self.leaves > 0, self.motion)

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
            x = self._displacement(pose, trial)
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
            turn = np.linalg.norm((pose.free @ step.y).reshape(-1, 6)[:, 3:], axis=1)
            largest = float(np.max(turn, initial=0.0))
            if largest <= MOST_TURN:
                return step
            self.radius = float(np.linalg.norm(step.y)) * 0.9 * MOST_TURN / largest

    def _trial(self, pose: StaticPose, step: Step) -> StaticPose | None:
        """The pose after a step; None where it cannot be assembled."""
        try:
            u = self.statics.closed(self.statics.moved(pose.u, pose.free @ step.y))
            trial = self.statics.at(u)
        except (AssemblyError, np.linalg.LinAlgError):
            return None
        return trial if np.isfinite(trial.residual) else None

    def _displacement(self, pose: StaticPose, trial: StaticPose) -> Floats:
        shift, turn = displacement(pose.u, trial.u)
        return np.hstack([shift / self.statics.length, turn])

    def _work(self, pose: StaticPose, trial: StaticPose, x: Floats) -> float:
        """Work of the forces from a pose to another, by the trapezoidal rule.

        Reactions of fixed multipliers do none between poses on the constraints, and with them the
        sum is free of the large parts that cancel.
        """
        before = self.statics.balance(pose.u, pose)
        after = self.statics.balance(trial.u, pose)
        return 0.5 * float((before + after) @ x.ravel())

    def _take(self, trial: StaticPose, x: Floats) -> None:
        self.pose, self.motion = trial, x
        self.path += x
        self.statics.evaluator.count_turns(self.statics.t, trial.u)

    def _is_far(self) -> bool:
        shift = np.linalg.norm(self.path[:, :3], axis=1) * self.statics.length
        turn = np.linalg.norm(self.path[:, 3:], axis=1)
        return bool(np.any(shift > FARTHEST_MOTION * self.extent) or np.any(turn > self.most_turns))

    def _refine(self) -> int:
        """Newton steps, as long as they help; returns their number."""
        for steps in range(20):
            pose = self.pose
            if pose.residual <= LEAST_UNBALANCED:
                return steps
            K = self.statics.stiffness(pose)
            y = held_solution(K, pose.unbalanced, pose.size)
            trial = self._trial(pose, Step(y, 0.0, True))
            if trial is None or not trial.residual < pose.residual:
                return steps
            self._take(trial, self._displacement(pose, trial))
            if trial.residual > 0.5 * pose.residual:
                return steps + 1
        return 20
