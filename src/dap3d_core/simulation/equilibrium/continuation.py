"""Continuation of equilibria over a parameter: steps of pseudo-arc length, through turning points.

Equilibria of displacements x and a parameter s are a curve. Its tangent (x', s') solves
K x' = c s' with the stiffness K of the freedoms and the forces c that a change of the parameter
adds. A step leads along the tangent; Newton's method returns to the curve across it, by the
balance of forces and one more equation, so that the singular stiffness of a turning point is no
obstacle. There s' changes its sign, whose root is located. Sources: Riks, J. Appl. Mech. 39, 1972;
Keller, in: Applications of Bifurcation Theory, 1977.
"""

from collections.abc import Callable, Iterator
from enum import Enum
from itertools import pairwise

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.simulation.equilibrium.search import BALANCED, held_solution, zero_stiffness
from dap3d_core.simulation.equilibrium.statics import (
    StaticPose,
    Statics,
    moving_states,
    refuse_carried,
)
from dap3d_core.simulation.errors import AssemblyError, SimulationError
from dap3d_core.simulation.initial.least_change import largest_move

#: The first step, and the shortest, at which the path ends; at most so many are taken. Lengths are
#: of the parameter, as a part of its range, and of the root mean square of displacements, as parts
#: of the scene's extent and in rad.
FIRST_STEP, SHORTEST_STEP, MOST_STEPS = 0.05, 1e-9, 5000
#: Largest rotation of a body in a step, rad.
MOST_TURN = 0.3
#: Cosine of the angle between the tangents at the ends of a step: at least; longer steps follow
#: above the second.
LEAST_COSINE, GOOD_COSINE = 0.95, 0.99
GROW, SHRINK = 2.0, 0.5
#: A correction is at most this part of its step: a longer one may lead to another path.
MOST_CORRECTION = 0.3
#: Steps below this length may cross a corner of the curve, as where a stop is touched: neither
#: their tangents nor their corrections, of at most the second part, are judged as those of others.
CORNER, CORNER_CORRECTION = 1e-5, 3.0
#: Newton passes; derivatives are kept where unbalanced forces are below this part.
MOST_PASSES, KEPT_BELOW = 12, 1e-6
#: Differences of the parameter, as a part of its range.
DIFFERENCE = 1e-4
#: Halvings of a step between whose ends a value is sought; tolerance of a turning point, and rate
#: of the parameter there.
MOST_HALVINGS, LOCATED, TURNED = 60, 1e-12, 1e-13


class Kind(Enum):
    """What a point of a path is: where the parameter turns, where another path crosses, neither."""

    TURNING, BRANCHING, REGULAR = "turning", "branching", "regular"


class End(Enum):
    """How a path ends: at the last value, back at the first one, nowhere to go on, too long."""

    REACHED, RETURNED, STUCK, LONG = "reached", "returned", "stuck", "long"


@attrs.frozen(eq=False)
class PathPoint:
    """An equilibrium of a path.

    Attributes:
        s: the parameter, from 0 at the first value to 1 at the last one.
        pose: the balance of forces.
        states: (s,) states of elements at rest.
        counters: turns of angles and unknowns of joints, as the evaluator stores them.
        tangent: (6 n + 1,) unit vector of displacements, in the measure of ``ParameterStatics``,
            and of the parameter.
        stiffness: (f,) real parts of the eigenvalues of the stiffness, N m, rising.
        kind: whether it is a special point.
    """

    s: float
    pose: StaticPose
    states: Floats
    counters: Floats
    tangent: Floats
    stiffness: Floats
    kind: Kind = Kind.REGULAR

    @property
    def negative_count(self) -> int:
        """Number of freedoms of negative stiffness."""
        zero = zero_stiffness(np.abs(self.stiffness), self.pose.size)
        return int(np.sum(self.stiffness < -zero))


@attrs.frozen(eq=False)
class Slopes:
    """Derivatives of the balance at a pose.

    Attributes:
        stiffness: (f, f) of the freedoms.
        force: (f,) unbalanced forces by s.
        shift: (6 n,) displacements by s, scaled, that keep the joints closed.
        free: (6 n, f) basis of the freedoms.
    """

    stiffness: Floats
    force: Floats
    shift: Floats
    free: Floats


class ParameterStatics:
    """Balance of forces at rest over displacements and a parameter.

    Attributes:
        statics: the balance at one value.
        measure: (6 n,) of displacements in the length of the path, over those of ``statics``.
    """

    def __init__(self, evaluator: Evaluator, load: Callable[[float], None]) -> None:
        """Args: the evaluator; what loads its model at a parameter of 0 to 1."""
        self.evaluator, self._load = evaluator, load
        self._loaded = np.nan
        self._first: Floats | None = None
        self.load(0.0)
        self._counted = np.r_[0:0, *evaluator.turn_places()]
        self.statics = Statics(evaluator)
        n, part = evaluator.model.body_count, self.statics.length
        extent = max(evaluator.model.extent, part)
        self.measure = np.tile(np.repeat([part / extent, 1.0], 3), n) / np.sqrt(max(n, 1))

    def load(self, s: float, point: PathPoint | None = None) -> None:
        """Evaluate the model at s; counters and states stay, or are those of a point."""
        evaluator = self.evaluator
        states, par = evaluator.states, evaluator.system.par
        if s != self._loaded:
            counters = par.copy()
            self._load(s)
            if self._loaded == self._loaded:
                par[self._counted] = counters[self._counted]
                evaluator.states = states
            self._loaded = s
        if point is not None:
            par[self._counted], evaluator.states = point.counters, point.states

    def point(self, s: float, pose: StaticPose, normal: Floats) -> PathPoint | None:
        """The point of an equilibrium, its tangent on the side of a normal (6 n + 1,)."""
        evaluator = self.evaluator
        self.load(s)
        if evaluator.model.state_count:
            if self._first is None:
                self._first = pose.u
            refuse_carried(self.evaluator, self._first, pose.u)
            if moving := moving_states(self.evaluator, pose.u):
                raise SimulationError(
                    f"a path cannot be followed: the rate of {moving} vanishes for no value of the "
                    "state at a pose"
                )
        evaluator.count_turns(0.0, pose.u)
        counters, states = evaluator.system.par[self._counted], evaluator.states.copy()
        slopes = self.slopes(s, pose)
        tangent = self._solve(pose, slopes, normal, along=True)
        tangent[:-1] *= self.measure
        length = float(np.linalg.norm(tangent))
        if not 0.0 < length < np.inf:
            return None
        stiffness = np.sort(np.linalg.eigvals(slopes.stiffness).real)
        return PathPoint(s, pose, states, counters, tangent / length, stiffness)

    def corrected(
        self, u: Floats, way: Floats, s: float, normal: Floats
    ) -> tuple[float, StaticPose] | None:
        """The equilibrium near a prediction, across a normal alone; None where none is found.

        Args:
            u: (13 n,) state that the prediction starts from.
            way: (6 n,) predicted displacement, in the measure of the path.
            s: predicted parameter.
            normal: (6 n + 1,) direction along which the equilibrium does not leave the prediction.
        """
        self.load(s)
        pose = self.statics.behind(u, way / self.measure)
        slopes: Slopes | None = None
        for _ in range(MOST_PASSES):
            if slopes is None or pose.residual > KEPT_BELOW:
                slopes = self.slopes(s, pose, moves=bool(np.any(normal[:-1])))
            change = self._solve(pose, slopes, normal, along=False)
            following = s + float(change[-1])
            if not 0.0 <= following <= 1.0:
                return None
            states = self.evaluator.states
            self.load(following)
            trial = self.statics.behind(pose.u, change[:-1])
            if not trial.residual < pose.residual:
                self.load(s)
                self.evaluator.states = states
                break
            helps = trial.residual < 0.5 * pose.residual
            s, pose = following, trial
            if not helps:
                break
        return (s, pose) if pose.residual <= BALANCED else None

    def slopes(self, s: float, pose: StaticPose, *, moves: bool = True) -> Slopes:
        """Derivatives at a pose; ``moves``: by the parameter as well, which otherwise holds."""
        K = self.statics.stiffness(pose)
        force, shift = np.zeros(len(pose.unbalanced)), np.zeros(len(pose.force))
        offsets: tuple[float, ...] = (-1.0, 1.0)
        weights: tuple[float, ...] = (-0.5, 0.5)
        if not DIFFERENCE <= s <= 1.0 - DIFFERENCE:
            side = 1.0 if s < 0.5 else -1.0
            offsets, weights = (0.0, side, 2.0 * side), (-1.5 * side, 2.0 * side, -0.5 * side)
        states = self.evaluator.states
        for offset, weight in zip(offsets, weights, strict=True) if moves else ():
            self.load(s + offset * DIFFERENCE)
            u = self.statics.closed(pose.u) if offset else pose.u
            force += weight / DIFFERENCE * (pose.free.T @ self.statics.balance(u, pose))
            shift += weight / DIFFERENCE * self.statics.way(pose.u, u)
        self.load(s)
        self.evaluator.states = states
        return Slopes(K, force, shift, pose.free)

    def chord(self, a: PathPoint, s: float, u: Floats) -> Floats:
        """(6 n + 1,) from a point to the state u (13 n,) at s, in the measure of the path."""
        return np.append(self.measure * self.statics.way(a.pose.u, u), s - a.s)

    def _solve(self, pose: StaticPose, slopes: Slopes, normal: Floats, *, along: bool) -> Floats:
        """(6 n + 1,) Newton step across the normal, scaled; ``along``: the tangent on its side."""
        basis = pose.free.T @ slopes.free
        K, force, shift = basis @ slopes.stiffness @ basis.T, basis @ slopes.force, slopes.shift
        weight = float(
            np.max(np.abs(K), initial=max(pose.size, np.max(np.abs(force), initial=0.0)))
        )
        weight = weight or 1.0
        across = self.measure * normal[:-1]
        border, corner = across @ pose.free, normal[-1] + across @ shift
        matrix = np.block([[K, -force[:, None]], [weight * border, weight * corner]])
        balance = 0.0 * pose.unbalanced if along else pose.unbalanced
        y = held_solution(matrix, np.append(balance, weight if along else 0.0), pose.size)
        return np.append(pose.free @ y[:-1] + y[-1] * shift, y[-1])


class Continuation:
    """The path of equilibria from the first value of a parameter on.

    Attributes:
        family: the balance of forces over displacements and the parameter.
        points: of the path so far.
    """

    def __init__(self, family: ParameterStatics, given: Floats) -> None:
        """Args: the balance; (k,) rising values of s that are reported, from 0 to 1."""
        self.family, self.given = family, given
        self.points: list[PathPoint] = []
        self._step = FIRST_STEP

    def run(self, u: Floats) -> End:
        """Follow the path from an equilibrium u (13 n,) at s = 0.

        Raises:
            SimulationError: it has no tangent there.
        """
        family = self.family
        normal = np.append(np.zeros(len(family.statics.scale)), 1.0)
        start = family.point(0.0, family.statics.at(u), normal)
        if start is None:
            raise SimulationError("no path leaves the equilibrium at the first value")
        self.points = [start]
        for _ in range(MOST_STEPS):
            found = self._advance(self.points[-1])
            if not found:
                return End.STUCK
            for point in found:
                self.points.append(point)
                if point.s in (0.0, 1.0) and (point.s - 0.5) * point.tangent[-1] > 0.0:
                    return End.REACHED if point.s else End.RETURNED
        return End.LONG

    def _advance(self, a: PathPoint) -> list[PathPoint]:
        """The next point, behind those that the step crosses; none where no step goes on."""
        while self._step > SHORTEST_STEP:
            b = self._next(a)
            found = self._crossed(a, b) if b is not None else None
            if b is None or found is None:
                self._step *= SHRINK
                continue
            cosine = float(a.tangent @ b.tangent)
            self._step *= GROW if cosine > GOOD_COSINE else 1.0
            return found
        return []

    def _next(self, a: PathPoint) -> PathPoint | None:
        """A point one step away, or at the next given value; None where the step is too long."""
        rate = float(a.tangent[-1])
        _, turn = largest_move(a.tangent[:-1] / self.family.measure)
        length = min(self._step, MOST_TURN / turn if turn > 0.0 else np.inf)
        ahead = self.given[(self.given - a.s) * rate > 0.0]
        s = None
        if len(ahead):
            nearest = float(ahead[np.argmin(np.abs(ahead - a.s))])
            if abs(rate) * length >= abs(nearest - a.s):
                s, length = nearest, (nearest - a.s) / rate
        b = self._at(a, length, s)
        if b is None or (a.tangent @ b.tangent < LEAST_COSINE and length > CORNER):
            return None
        return b

    def _at(self, a: PathPoint, length: float, s: float | None = None) -> PathPoint | None:
        """The point a length along the tangent of a point, or near it at s."""
        normal = a.tangent
        predicted = a.s + length * float(a.tangent[-1])
        if s is not None:
            normal, predicted = np.append(np.zeros(len(a.tangent) - 1), 1.0), s
        if not 0.0 <= predicted <= 1.0:
            return None
        way = length * a.tangent[:-1]
        self.family.load(predicted, a)
        try:
            found = self.family.corrected(a.pose.u, way, predicted, normal)
            if found is None:
                return None
            at, pose = found
            moved = self.family.chord(a, at, pose.u)
            most = MOST_CORRECTION if length > CORNER else CORNER_CORRECTION
            if np.linalg.norm(moved - length * a.tangent) > most * length:
                return None
            b = self.family.point(at, pose, a.tangent)
        except (AssemblyError, SimulationError, np.linalg.LinAlgError):
            return None
        return b if b is None or s is None else attrs.evolve(b, s=s)

    def _crossed(self, a: PathPoint, b: PathPoint) -> list[PathPoint] | None:
        """The points between the ends of a step that are reported, then its end."""
        corners = [a, b]
        if a.tangent[-1] * b.tangent[-1] < 0.0:
            turning = self._located(a, b, Kind.TURNING, lambda point: float(point.tangent[-1]))
            if turning is None:
                return None
            corners = [a, turning, b]
        elif a.negative_count != b.negative_count:
            k = min(a.negative_count, b.negative_count)
            branching = self._located(a, b, Kind.BRANCHING, lambda point: point.stiffness[k])
            if branching is None and self._length(a, b) > CORNER:  # b may be of another path
                return None
            if branching is not None and abs(branching.s - a.s) < SHORTEST_STEP:
                self.points[-1] = attrs.evolve(a, kind=Kind.BRANCHING)
            elif branching is not None:
                corners = [a, branching, b]
        found: list[PathPoint] = []
        for p, q in pairwise(corners):
            low, high = sorted((p.s, q.s))
            inside = self.given[(self.given > low) & (self.given < high)]
            for s in inside if p.s < q.s else inside[::-1]:
                point = self._between(found[-1] if found else p, q, float(s))
                if point is None:
                    return None
                found.append(point)
            found.append(q)
        return found

    def _located(
        self, a: PathPoint, b: PathPoint, kind: Kind, value: Callable[[PathPoint], float]
    ) -> PathPoint | None:
        """The point between two at which a value vanishes; None where it is not located."""
        from scipy.optimize import brentq

        def value_at(length: float) -> float:
            point = self._at(a, length) if length else a
            if point is None:
                raise AssemblyError("the path is not resolved")
            found = float(value(point))
            return found if kind is not Kind.TURNING or abs(found) > TURNED else 0.0

        try:
            length = brentq(value_at, 0.0, self._length(a, b), xtol=LOCATED, rtol=LOCATED)
        except (AssemblyError, ValueError):
            return None
        point = self._at(a, float(length))
        return None if point is None else attrs.evolve(point, kind=kind)

    def _between(self, a: PathPoint, b: PathPoint, s: float) -> PathPoint | None:
        """The point at s between two, from one to the other of which the parameter does not turn.

        The prediction takes the parameter for the cubic of its values and rates at both.
        """
        for _ in range(MOST_HALVINGS):
            length = self._length(a, b)
            cubic = _cubic(a.s, a.tangent[-1] * length, b.s, b.tangent[-1] * length)
            part = next(_roots_within(cubic, s), 0.5)
            point = self._at(a, part * length, s)
            if point is not None:
                return point
            middle = self._at(a, 0.5 * length)
            if middle is None:
                return None
            a, b = (middle, b) if (middle.s - s) * (a.s - s) > 0.0 else (a, middle)
        return None

    def _length(self, a: PathPoint, b: PathPoint) -> float:
        """How far a point is along the tangent of another."""
        return float(a.tangent @ self.family.chord(a, b.s, b.pose.u))


def _cubic(y0: float, d0: float, y1: float, d1: float) -> Floats:
    """Coefficients, the highest first, of the cubic of values and slopes at 0 and 1."""
    gap = y1 - y0
    return np.array([d0 + d1 - 2.0 * gap, 3.0 * gap - 2.0 * d0 - d1, d0, y0])


def _roots_within(cubic: Floats, value: float) -> Iterator[float]:
    """Where a cubic has a value between 0 and 1."""
    for root in np.roots(cubic - np.array([0.0, 0.0, 0.0, value])):
        if abs(root.imag) < 1e-9 and 0.0 < root.real < 1.0:
            yield float(root.real)
