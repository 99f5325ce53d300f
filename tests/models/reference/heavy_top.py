"""Closed form of a symmetric heavy top released at rest from the horizontal: checks `pen1`, `pen2`.

n is the unit vector from the pivot to the mass centre, u = n_z, I the transverse inertia about the
pivot, L the angular momentum along n (constant), G = sum of m g times distance. Energy and vertical
angular momentum give

    u_dot^2 = (2 G / I) u (u^2 - 2 kappa u - 1),   kappa = L^2 / (4 G I)
    u(t) = u_a cn^2(q t + K | m),                  u_a = kappa - sqrt(kappa^2 + 1)
    azimuth rate = -L u / (I (1 - u^2))

with q^2 = (G / 2 I)(u_b - u_a), u_b = kappa + sqrt(kappa^2 + 1), m = -u_a / (u_b - u_a). The
azimuth is counted from +y towards -x. A double pendulum whose two bodies share one straight axis
(`pen2`) is one such top: each body keeps its own spin about the axis.
"""

from itertools import pairwise

import numpy as np
from rigid import Array, Z
from scipy.integrate import quad
from scipy.special import ellipj, ellipk


class HeavyTop:
    """The motion of the axis n; `axis` gives n and its first two derivatives."""

    def __init__(self, G: float, inertia: float, L: float) -> None:
        self.G, self.inertia, self.L = G, inertia, L
        kappa = L * L / (4 * G * inertia)
        root = np.sqrt(kappa * kappa + 1)
        self.lowest, self.m = kappa - root, (root - kappa) / (2 * root)
        self.q = np.sqrt(G * root / inertia)

    def height(self, t: float) -> tuple[float, float]:
        """Return u and u_dot."""
        sn, cn, dn, _ = ellipj(self.q * t + ellipk(self.m), self.m)
        return self.lowest * cn * cn, -2 * self.lowest * self.q * cn * sn * dn

    def azimuth_rate(self, t: float) -> float:
        """Return the rate of the azimuth [rad/s]."""
        u = self.height(t)[0]
        return -self.L * u / (self.inertia * (1 - u * u))

    def azimuth(self, t: float) -> float:
        """Return the azimuth [rad], interval by interval from one lowest point to the next."""
        half = ellipk(self.m) / self.q
        cuts = [x for x in half * np.arange(0, 2 + t / half) if x < t] + [t]
        pieces = [
            quad(self.azimuth_rate, a, b, epsabs=1e-14, epsrel=1e-13, limit=400)[0]
            for a, b in pairwise(cuts)
        ]
        return float(sum(pieces))

    def axis(self, t: float) -> tuple[Array, Array, Array]:
        """Return n, n_dot and n_ddot."""
        u, u_dot = self.height(t)
        angle, rate = self.azimuth(t), self.azimuth_rate(t)
        flat = np.sqrt(1 - u * u)
        out = np.array([-np.sin(angle), np.cos(angle), 0.0])
        side = np.array([-np.cos(angle), -np.sin(angle), 0.0])
        n = flat * out + u * Z
        flat_dot = -u * u_dot / flat if flat > 0 else 0.0
        n_dot = flat_dot * out + flat * rate * side + u_dot * Z
        turn_rate = (-self.L * n_dot - self.G * np.cross(n, Z)) / self.inertia
        return n, n_dot, np.cross(turn_rate, n) - (n_dot @ n_dot) * n

    def body(self, t: float, distance: float, spin: float) -> tuple[Array, ...]:
        """Return r, v, w, v_dot, w_dot of a body on the axis that spins about it at `spin`."""
        n, n_dot, n_ddot = self.axis(t)
        w = np.cross(n, n_dot) + spin * n
        w_dot = np.cross(n, n_ddot) + spin * n_dot
        return distance * n, distance * n_dot, w, distance * n_ddot, w_dot
