"""Random smooth motions of bodies, with exact rates: the contract is tested along them."""

import numpy as np
from numpy.polynomial import Polynomial

from support.internals import join

#: Sixth-order central differences of the first derivative.
OFFSETS = np.array([-3, -2, -1, 1, 2, 3])
WEIGHTS = np.array([-1, 9, -45, 45, -9, 1]) / 60.0


class Motion:
    """n bodies whose coordinates and Euler parameters (normalised) are polynomials of time."""

    def __init__(self, n, rng, level=1.0):
        self.n = n
        self.r = [[Polynomial(rng.uniform(-1, 1, 4) * level) for _ in range(3)] for _ in range(n)]
        turn = [rng.uniform(-1, 1, (4, 4)) * level for _ in range(n)]
        for k in turn:
            k[0, 0] += 2.0  # keeps the quaternion away from zero near t = 0
        self.q = [[Polynomial(k[c]) for c in range(4)] for k in turn]

    def u(self, t):
        """State (13 n,) at time t."""
        return self._state(t)[0]

    def v_dot(self, t):
        """Accelerations (6 n,), global axes, at time t."""
        return self._state(t)[1]

    def _state(self, t):
        r, p, v, w, a, w_dot = ([] for _ in range(6))
        for b in range(self.n):
            r.append([x(t) for x in self.r[b]])
            v.append([x.deriv()(t) for x in self.r[b]])
            a.append([x.deriv(2)(t) for x in self.r[b]])
            q = np.array([x(t) for x in self.q[b]])
            q1, q2 = (np.array([x.deriv(k)(t) for x in self.q[b]]) for k in (1, 2))
            n = np.linalg.norm(q)
            n1 = q @ q1 / n
            n2 = (q1 @ q1 + q @ q2 - n1 * n1) / n
            p0 = q / n
            p1 = q1 / n - q * n1 / n**2
            p2 = q2 / n - 2 * q1 * n1 / n**2 - q * n2 / n**2 + 2 * q * n1**2 / n**3
            p.append(p0)
            w.append(2 * G(p0) @ p1)
            w_dot.append(2 * G(p0) @ p2)  # G_dot p_dot = 0
        u = join(np.array(r), np.array(p), np.array(v), np.array(w))
        return u, np.hstack([np.array(a), np.array(w_dot)]).ravel()


def G(p):
    """The 3x4 matrix with omega = 2 G p_dot."""
    e0, e1, e2, e3 = p
    return np.array([[-e1, e0, -e3, e2], [-e2, e3, e0, -e1], [-e3, -e2, e1, e0]])


def derivative(function, t, h):
    """d/dt of a function of time by sixth-order central differences."""
    return sum(c * function(t + k * h) for k, c in zip(OFFSETS, WEIGHTS, strict=True)) / h
