"""Reference for the models `A02-N`: a row of N four-bars whose cranks stay parallel.

With phi the angle of the cranks from the upright, clockwise, the row has the kinetic energy
((N + 1) / 3 + N) phi_dot^2 / 2 and the potential energy g ((N + 1) / 2 + N) cos phi, so

    phi_ddot = w^2 sin(phi),  w^2 = (3/2) g (3 N + 1) / (4 N + 1),  phi(0) = 0,  phi_dot(0) = 1

which elliptic functions solve: phi = pi + 2 am(q t - K, m), q^2 = w^2 + 1/4, m = w^2 / q^2.
Redundant joints leave some reactions open; those given are of least norm, their components in the
plane are unique (but where all links are in line).
"""

from functools import cache

import numpy as np
from kkt import GROUND, Body, Fixed, Joint, System, rev
from rigid import GRAVITY, Array, Z, turn
from scipy.special import ellipj, ellipk

ACROSS, ALONG = 1 / 12, 1e-3
Y = (0.0, 1.0, 0.0)


class Row:
    """A row of n four-bars."""

    def __init__(self, n: int) -> None:
        self.n = n
        self.w2 = 1.5 * GRAVITY * (3 * n + 1) / (4 * n + 1)
        self.q = np.sqrt(self.w2 + 0.25)
        self.m = self.w2 / self.q**2
        self.SYSTEM = self.system()

    def angle(self, t: float) -> tuple[float, float, float]:
        """Return phi, phi_dot and phi_ddot."""
        _, _, dn, am = ellipj(self.q * t - ellipk(self.m), self.m)
        phi = np.pi + 2 * am
        return phi, 2 * self.q * dn, self.w2 * np.sin(phi)

    def system(self) -> System:
        """Return the row in space, at the start."""
        bodies = []
        for k in range(self.n + 1):
            if k:
                about, x = (ALONG, ACROSS, ACROSS), (k - 0.5, 1.0, 0.0)
                bodies.append(Body(f"coupler{k}", 1.0, about, x, v=(1.0, 0.0, 0.0)))
            about, x = (ACROSS, ALONG, ACROSS), (float(k), 0.5, 0.0)
            bodies.append(Body(f"crank{k}", 1.0, about, x, v=(0.5, 0.0, 0.0), w=(0.0, 0.0, -1.0)))

        def revolute(name: str, P_i: Fixed, P_j: Fixed) -> Joint:
            return rev(name, P_i, P_j, *(Fixed(P.body, (0.0, 0.0, 1.0)) for P in (P_i, P_j)))

        joints = []
        for k in range(self.n + 1):
            foot = Fixed(GROUND, (float(k), 0.0, 0.0))
            joints.append(revolute(f"A{k}", Fixed(2 * k, (0.0, -0.5, 0.0)), foot))
        for k in range(1, self.n + 1):
            for name, side, crank in (("L", -0.5, 2 * k - 2), ("R", 0.5, 2 * k)):
                end, tip = Fixed(2 * k - 1, (side, 0.0, 0.0)), Fixed(crank, (0.0, 0.5, 0.0))
                joints.append(revolute(f"{name}{k}", end, tip))
        return System(bodies, joints, up=Y, redundant=True)

    def quantities(self, t: float) -> dict[str, Array]:
        """Return every quantity that `expected.toml` may name, at `t`."""
        phi, rate, second = self.angle(t)
        tip = np.array([np.sin(phi), np.cos(phi), 0.0])
        ahead = np.array([np.cos(phi), -np.sin(phi), 0.0])
        tip_dot, tip_ddot = rate * ahead, second * ahead - rate**2 * tip
        r, p, v, v_dot = [], [], [], []
        for k in range(2 * self.n + 1):
            share = 0.5 if k % 2 == 0 else 1.0
            spin = -1.0 if k % 2 == 0 else 0.0
            r.append(np.array([k / 2, 0.0, 0.0]) + share * tip)
            p.append(turn(Z, spin * phi))
            v.append(np.concatenate([share * tip_dot, spin * rate * Z]))
            v_dot.append(np.concatenate([share * tip_ddot, spin * second * Z]))
        out = self.SYSTEM.quantities(np.array(r), np.array(p), np.ravel(v), np.ravel(v_dot))
        return out | self.SYSTEM.counts | {"rP.B0": tip, "rPd.B0": tip_dot}


@cache
def member(n: int) -> Row:
    """Return the row of n four-bars."""
    return Row(n)
