"""The path of a scene whose drivers fix every freedom: poses in time, closed by Newton's method.

Where all rows have a position level, C(q, t) = 0 alone determines a pose: a step is predicted from
velocities and accelerations, and corrected until C is at rounding, so that errors do not add up.
Rows of the velocity level alone fix q by D(q, t) q_dot = nu, a differential equation of first
order, which DOP853 integrates to a tolerance near rounding; the other rows are closed as above.

A step is as long as its prediction is good, so that the corrections stay on the branch that the
motion is on. A singular pose is met where a determinant changes its sign between two poses, or
where no step goes on. Source: Nikravesh, Computer-Aided Analysis of Mechanical Systems, 1988,
chapter 5 (kinematic analysis, singular configurations).
"""

from collections.abc import Callable
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.rotations import angular_velocities, euler_rates
from dap3d_core.model.state_layout import join, split, velocities_of
from dap3d_core.simulation.initial.assemble import max_speed
from dap3d_core.simulation.initial.least_change import displaced, finite_rows
from dap3d_core.simulation.kinematics.pose_equations import LinearisedRows

#: Newton stops behind a correction (rad, or parts of the model) whose product with the one behind
#: which rows were factored is this: the size of the next; or where corrections no longer shrink.
CLOSED, LEAST_ERROR, MOST_PASSES = 1e-17, 1e-7, 16
#: Rows are factored anew behind a larger correction.
FACTORED_ANEW = 1e-3
#: Corrections of an accepted step are at most this; a step aims at a hundredth of it, and moves
#: nothing by more than MOST_TURN.
MOST_CORRECTION, MOST_TURN = 0.02, 0.4
#: Steps are at least this part of the whole path: what stops them is located so well.
SHORTEST = 1e-10
#: A pose with a smaller singular value of its scaled rows is no end of a step.
NEAR_SINGULAR = 1e-7
#: Closer to a singular pose, positions are interpolated between poses on both sides, this part of a
#: step away and twice as far: rounding would be multiplied by the inverse of the singular value.
INTERPOLATED, OFFSET_TIME = 1e-4, 0.2
#: A singular pose is located between poses so many steps aside, which a cubic goes through.
LOCATED = 2e-3
#: Tolerances of the integration of rows of the velocity level.
RTOL, ATOL = 1e-12, 1e-13


@attrs.frozen(eq=False)
class Pose:
    """A pose of the path.

    Attributes:
        t: time, s.
        u: (13 n,) state.
        v_dot: (6 n,) accelerations.
        rows: the constraint rows there.
        residual: largest |D v_dot - gamma|.
    """

    t: float
    u: Floats
    v_dot: Floats
    rows: LinearisedRows
    residual: float = 0.0


class PathEndError(Exception):
    """The path does not go on.

    Attributes:
        t: the instant at which it ends, s.
        pose: the last pose.
    """

    def __init__(self, t: float, pose: Pose) -> None:
        super().__init__(f"the path ends at t = {t:.10g}")
        self.t, self.pose = t, pose


class KinematicPath:
    """Steps along the path from a pose, in either direction of time.

    Attributes:
        before, pose: the ends of the last step.
        steps, rejected, evaluations: counts.
    """

    def __init__(self, evaluator: Evaluator, t: float, u: Floats, end: float) -> None:
        """Args: evaluator; time, s, and state (13 n,) of the start, assembled; time of the end."""
        self.evaluator, self.end = evaluator, end
        self.steps = self.rejected = self.evaluations = 0
        self._span = abs(end - t) or 1.0
        self._is_integrated = not bool(np.all(evaluator.model.position_row))
        self.pose = self.before = self._completed(t, self._closed(t, u))
        self._integration: Any = None
        self._dense: Callable[[float], Floats] | None = None
        self._h = (end - t) / 10.0

    @property
    def is_done(self) -> bool:
        """Whether the end has been reached."""
        return bool((self.pose.t - self.end) * np.sign(self._h) >= 0.0)

    def advance(self) -> None:
        """Take a step.

        Raises:
            PathEndError: no step goes on.
        """
        if self._is_integrated:
            self._integrate()
            return
        start, h, shortest = self.pose, self._limited(self._h), SHORTEST * self._span
        longer = True
        while True:
            t = start.t + h
            if abs(t - self.end) < shortest:
                t = self.end
            found = self._stepped(start, t)
            if found is not None:
                pose, correction = found
                if pose.rows.least > NEAR_SINGULAR:
                    break
                h, longer = h * (1.37 if longer else 0.71), False
            else:
                h *= 0.5
            self.rejected += 1
            if abs(h) < shortest:
                raise PathEndError(self._dead_point(start, start.t + 2.0 * h), start)
        growth = (0.01 * MOST_CORRECTION / max(correction, 1e-12)) ** (1.0 / 3.0)
        self._h = h * float(np.clip(growth, 0.3, 3.0))
        self.before, self.pose = start, pose
        self.steps += 1

    def at(self, t: float) -> tuple[Pose, bool]:
        """The pose at an instant of the last step, and whether it is a singular one."""
        for pose in (self.before, self.pose):
            if pose.t == t and pose.rows.least > INTERPOLATED:
                return pose, False
        pose = self._between(t)
        if pose.rows.least > INTERPOLATED:
            return pose, False
        h = OFFSET_TIME * abs(self.pose.t - self.before.t)
        near, far = (
            _interpolated(self._between(t - gap), self._between(t + gap), t) for gap in (h, 2.0 * h)
        )
        # Midway, positions and rates err by h^6 and second derivatives by h^4: extrapolated.
        y, y_dot, y_ddot = (
            x + (x - z) / (ratio - 1.0)
            for x, z, ratio in zip(near, far, (64.0, 64.0, 16.0), strict=True)
        )
        r, p = _parts(y)
        v, a = _velocity(y, y_dot, y_ddot)
        u = join(r, p / np.linalg.norm(p, axis=1, keepdims=True), *_by_body(v))
        return Pose(t, u, a, self._rows(t, u)), True

    def singular_instant(self) -> float | None:
        """When a singular pose lay between the ends of the last step, s; None where none did."""
        before, pose = self.before, self.pose
        if not pose.rows.turned_from(before.rows):
            return None
        low, high = before.t, pose.t
        width = LOCATED * (high - low)
        while abs(high - low) > abs(0.5 * width):
            middle = 0.5 * (low + high)
            if self._between(middle).rows.turned_from(before.rows):
                high = middle
            else:
                low = middle
        middle = 0.5 * (low + high)
        x = np.array([-2.0, -1.0, 1.0, 2.0])
        y = [self._between(middle + k * width).rows.signed(before.rows) for k in x]
        roots = np.roots(np.polyfit(x, y, 3))
        real = roots[np.abs(roots.imag) < 1e-6].real
        return float(middle + width * min(real, key=abs, default=0.0))

    # ------------------------------------------------------------------ steps

    def _limited(self, h: float) -> float:
        """A step that moves nothing too far and ends at the end at most."""
        speed = max_speed(self.evaluator, velocities_of(self.pose.u))
        rise = max_speed(self.evaluator, self.pose.v_dot)
        longest = (
            2.0 * MOST_TURN / max(speed + (speed * speed + 2.0 * rise * MOST_TURN) ** 0.5, 1e-300)
        )
        left = self.end - self.pose.t
        return float(np.sign(left) * min(abs(h), longest, abs(left)))

    def _stepped(self, start: Pose, t: float) -> tuple[Pose, float] | None:
        """The pose at t from a near one, and the size of its correction; None where none is."""
        h = t - start.t
        way = h * velocities_of(start.u) + 0.5 * h * h * start.v_dot
        closed = self._newton(t, displaced(start.u, way))
        if closed is None:
            return None
        u, correction = closed
        return (self._completed(t, u), correction) if correction <= MOST_CORRECTION else None

    def _between(self, t: float) -> Pose:
        """The pose at an instant of the last step, or near it."""
        if self._dense is not None:
            y = self._dense(t)
        else:
            y = _interpolated(self.before, self.pose, t)[0]
        r, p = _parts(y)
        p = p / np.linalg.norm(p, axis=1, keepdims=True)
        return self._completed(t, self._closed(t, join(r, p, 0.0 * r, 0.0 * r)))

    def _closed(self, t: float, u: Floats) -> Floats:
        closed = self._newton(t, u)
        if closed is None:
            raise PathEndError(t, self.pose)
        return closed[0]

    def _newton(self, t: float, u: Floats) -> tuple[Floats, float] | None:
        """A state whose positions are closed, and the size of the first correction; or None."""
        first, before = 0.0, np.inf
        rows = self._rows(t, u)
        C = rows.rows.C
        for passes in range(MOST_PASSES):
            change = rows.solve(C)
            size = max_speed(self.evaluator, change)
            if passes == 0:
                first = factored_at = size
            if not np.isfinite(size) or size > max(MOST_TURN, 4.0 * before):
                return None
            u = displaced(u, -change)
            if size * factored_at <= CLOSED or (size <= LEAST_ERROR and size > 0.5 * before):
                return u, first
            if factored_at > FACTORED_ANEW:
                rows, factored_at = self._rows(t, u), size
                C = rows.rows.C
            else:
                C = finite_rows(self.evaluator, t, u).C
            before = size
        return None

    def _rows(self, t: float, u: Floats) -> LinearisedRows:
        self.evaluations += 1
        return LinearisedRows(finite_rows(self.evaluator, t, u), self.evaluator.model.size)

    def _completed(self, t: float, u: Floats) -> Pose:
        """The pose with its velocities and accelerations."""
        rows, u = self._rows(t, u), u.copy()
        velocities_of(u)[:] = rows.solve(rows.rows.nu)
        gamma = finite_rows(self.evaluator, t, u).gamma
        v_dot = rows.solve(gamma)
        return Pose(t, u, v_dot, rows, float(np.max(np.abs(rows.product(v_dot) - gamma))))

    def _dead_point(self, pose: Pose, failed: float) -> float:
        """When the path ends, between the last pose and a step that failed.

        Where velocities grow without a bound, the square of the singular value falls linearly.
        """
        squares = self.before.rows.least**2, pose.rows.least**2
        if self.before.t == pose.t or squares[1] >= squares[0]:
            return 0.5 * (pose.t + failed)
        ahead = (pose.t - self.before.t) * squares[1] / (squares[0] - squares[1])
        low, high = sorted((pose.t, failed))
        return float(np.clip(pose.t + ahead, low, high))

    # ------------------------------------------------------------------ rows of velocity level

    def _integrate(self) -> None:
        """A step of DOP853."""
        from scipy.integrate import DOP853

        if self._integration is None:
            r, p, _, _ = split(self.pose.u)
            y = np.concatenate([r.ravel(), p.ravel()])
            self._integration = DOP853(self._rates, self.pose.t, y, self.end, rtol=RTOL, atol=ATOL)
        run, start = self._integration, self.pose
        with np.errstate(all="ignore"):
            message = run.step()
        if run.status == "failed":
            raise PathEndError(float(run.t), start) from RuntimeError(message)
        self._dense = run.dense_output()
        self.before, self.pose = start, self._between(float(run.t))
        self.steps += 1

    def _rates(self, t: float, y: Floats) -> Floats:
        """dy/dt of y = (r, p)."""
        r, p = _parts(y)
        unit = p / np.linalg.norm(p, axis=1, keepdims=True)
        rows = self._rows(float(t), join(r, unit, 0.0 * r, 0.0 * r))
        v, w = _by_body(rows.solve(rows.rows.nu))
        return np.concatenate([v.ravel(), euler_rates(p, w).ravel()])


def _by_body(v: Floats) -> tuple[Floats, Floats]:
    moves = v.reshape(-1, 6)
    return moves[:, :3], moves[:, 3:]


def _parts(y: Floats) -> tuple[Floats, Floats]:
    """R (n, 3) and p (n, 4) of y = (r, p)."""
    n = len(y) // 7
    return y[: 3 * n].reshape(-1, 3), y[3 * n :].reshape(-1, 4)


def _velocity(y: Floats, y_dot: Floats, y_ddot: Floats) -> tuple[Floats, Floats]:
    """(6 n,) velocities and accelerations of y = (r, p) and its derivatives."""
    (_, p), (v, rate), (a, second) = (_parts(part) for part in (y, y_dot, y_ddot))
    w, alpha = angular_velocities(p, rate), angular_velocities(p, second)  # G_dot p_dot = 0
    first, other = (np.hstack([x, z]).ravel() for x, z in ((v, w), (a, alpha)))
    return first, other


def _interpolated(one: Pose, other: Pose, t: float) -> tuple[Floats, Floats, Floats]:
    """Y = (r, p) and its two derivatives at t: the polynomial of degree 5 through two poses."""
    h = other.t - one.t
    ends = []
    for pose in (one, other):
        r, p, v, w = split(pose.u)
        a, alpha = _by_body(pose.v_dot)
        rate = euler_rates(p, w)
        second = euler_rates(p, alpha) + euler_rates(rate, w)
        ends.append([np.concatenate([x.ravel(), z.ravel()])
                     for x, z in ((r, p), (v, rate), (a, second))])  # fmt: skip
    (y0, v0, a0), (y1, v1, a1) = ends
    v0, v1, a0, a1 = h * v0, h * v1, h * h * a0, h * h * a1
    gap = y1 - y0
    c = [y0, v0, 0.5 * a0, 10.0 * gap - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1,
         -15.0 * gap + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1,
         6.0 * gap - 3.0 * (v0 + v1) - 0.5 * (a0 - a1)]  # fmt: skip
    s = (t - one.t) / h
    y = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
    y_dot = c[1] + s * (2 * c[2] + s * (3 * c[3] + s * (4 * c[4] + s * 5 * c[5])))
    y_ddot = 2 * c[2] + s * (6 * c[3] + s * (12 * c[4] + s * 20 * c[5]))
    return y, y_dot / h, y_ddot / (h * h)
