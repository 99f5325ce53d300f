"""Motion of mechanisms in minimal coordinates, from closed forms of their poses.
An implementation of its own: d'Alembert's principle over all bodies. Jacobians are complex steps,
exact to rounding, and second derivatives along the motion differences of these of the fourth
order, which err by about STEP^4 = 1e-12."""

import attrs
import numpy as np
from scipy.integrate import solve_ivp

STEP = 1e-3
GRAVITY = np.array([0.0, 0.0, -9.81])


def unit(v):
    """A unit vector along a vector that may be complex."""
    return v / np.sqrt(v @ v)


def cross(a, b):
    """a x b of two vectors; numpy's own takes ten times as long for its checks of axes."""
    (x, y, z), (p, q, r) = a, b
    return np.array([y * r - z * q, z * p - x * r, x * q - y * p])


def turned(axis, angle):
    """The rotation matrix about a unit vector (Rodrigues)."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K)


def rod_axes(d, u):
    """Axes of a rod along d on a cross, one arm of which is u; its z axis is the other arm."""
    z = unit(cross(u, d))
    return np.stack([d, cross(z, d), z], axis=1)


@attrs.frozen
class Body:
    """A rigid body: mass, principal moments in its axes about its mass centre, and this."""

    mass: float
    J: tuple
    com: tuple = (0.0, 0.0, 0.0)


class MinimalMotion:
    """The motion of a mechanism.

    Args:
        bodies: name -> Body.
        poses: function of the coordinates: name -> (origin, axes as columns), also for complex
            coordinates.
        start: the coordinates at the start, where all is at rest.
        springs: (k, c) of each spring.
        lengths: function of the coordinates: those of the springs, at rest at the start.
    """

    def __init__(self, bodies, poses, start, springs=(), lengths=None):
        self.bodies, self.poses, self.start = bodies, poses, np.array(start, dtype=float)
        self.springs = np.array(springs, dtype=float).reshape(-1, 2)
        self.lengths = lengths or (lambda s: np.zeros(0, dtype=s.dtype))

    def rates(self, s, direction):
        """Rates of mass centres, axes and spring lengths along a direction: lists by body."""
        h = 1e-30
        moved = s + 1j * h * direction
        v, A_dot = [], []
        for name, (o, A) in self.poses(moved).items():
            A_dot.append(np.imag(A) / h)
            v.append(np.imag(o) / h + A_dot[-1] @ self.bodies[name].com)
        return v, A_dot, np.imag(self.lengths(moved)) / h

    def bias(self, s, rate):
        """Accelerations of mass centres, and second derivatives of axes, without those of s."""
        total = [0.0, 0.0]
        for n, weight in ((1, 8.0), (-1, -8.0), (2, -1.0), (-2, 1.0)):
            v, A_dot, _ = self.rates(s + n * STEP * rate, rate)
            parts = (np.array(v), np.array(A_dot))
            total = [a + weight * b for a, b in zip(total, parts, strict=True)]
        return [a / (12.0 * STEP) for a in total]

    def accelerations(self, s, rate):
        """The second derivatives of the coordinates."""
        columns = [self.rates(s, e) for e in np.eye(len(s))]
        accelerations, A_two_dots = self.bias(s, rate)
        M, Q = np.zeros((len(s), len(s))), np.zeros(len(s))
        for k, (name, (_, A)) in enumerate(self.poses(s).items()):
            body = self.bodies[name]
            V = np.array([column[0][k] for column in columns]).T
            W = np.array([_axial(column[1][k] @ A.T) for column in columns]).T
            A_dot = sum(x * column[1][k] for x, column in zip(rate, columns, strict=True))
            alpha = _axial(A_two_dots[k] @ A.T + A_dot @ A_dot.T)
            inertia, w = A @ np.diag(body.J) @ A.T, W @ rate
            M += body.mass * V.T @ V + W.T @ inertia @ W
            Q += body.mass * V.T @ (GRAVITY - accelerations[k])
            Q -= W.T @ (inertia @ alpha + cross(w, inertia @ w))
        if len(self.springs):
            D = np.array([column[2] for column in columns]).T
            stretch = self.lengths(s) - self.lengths(self.start)
            Q -= D.T @ (self.springs[:, 0] * stretch + self.springs[:, 1] * (D @ rate))
        return np.linalg.solve(M, Q)

    def centres(self, t):
        """The mass centres of all bodies at times: name -> (n, 3)."""
        n = len(self.start)
        found = solve_ivp(
            lambda _, y: np.concatenate([y[n:], self.accelerations(y[:n], y[n:])]),
            (0.0, t[-1]), np.concatenate([self.start, np.zeros(n)]), "DOP853", t,
            rtol=1e-9, atol=1e-11,
        )  # fmt: skip
        poses = [self.poses(s) for s in found.y[:n].T]
        return {
            name: np.array([o + A @ body.com for o, A in (pose[name] for pose in poses)])
            for name, body in self.bodies.items()
        }


def _axial(S):
    """The vector of a skew matrix."""
    return np.array([S[2, 1], S[0, 2], S[1, 0]])
