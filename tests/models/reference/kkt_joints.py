"""Further joints of the generic simulator `kkt`, each by its position-level equations alone.
A rolling disk has none for its slip: there the velocity of the material point at the contact is
given, and differentiated by a complex step."""

import numpy as np
from kkt import GROUND, Fixed, Jet, Joint, Motion, dot
from rigid import Array, cross


def normals(axis: tuple[float, float, float]) -> tuple[Array, Array]:
    """Return two unit vectors that complete `axis` to a right-handed triad."""
    a = np.array(axis)
    start = np.eye(3)[np.argmin(np.abs(a))]
    n = start - (start @ a) * a
    n /= np.linalg.norm(n)
    return n, cross(a, n)


def cyl(name: str, P_i: Fixed, P_j: Fixed, a_i: Fixed, a_j: Fixed) -> Joint:
    """Return a cylindrical joint: a_i and the line P_i P_j are normal to two normals of a_j."""
    n_j, m_j = (Fixed(a_j.body, tuple(x)) for x in normals(a_j.local))

    def C(m: Motion) -> list[Jet]:
        a, d = m.direction(a_i), m.point(P_j) - m.point(P_i)
        n, other = m.direction(n_j), m.direction(m_j)
        return [dot(a, n), dot(a, other), dot(d, n), dot(d, other)]

    return Joint(name, P_i.body, P_j.body, C)


def turned(m: Motion, i: int, j: int) -> list[Jet]:
    """Return the three rows that keep the axes of j along those of i, their rate w_j - w_i there.
    Row x is (z_i . y_j - y_i . z_j) / 2, and so on in cyclic order."""
    axes = [[m.direction(Fixed(b, tuple(e))) for e in np.eye(3)] for b in (i, j)]
    rows = []
    for k in range(3):
        y, z = (k + 1) % 3, (k + 2) % 3
        twice = dot(axes[0][z], axes[1][y]) - dot(axes[0][y], axes[1][z])
        rows.append(Jet(*(x / 2 for x in twice)))
    return rows


def tran(name: str, P_i: Fixed, P_j: Fixed, a_j: Fixed) -> Joint:
    """Return a translational joint of two bodies whose axes are parallel at the start."""
    n_j, m_j = (Fixed(a_j.body, tuple(x)) for x in normals(a_j.local))

    def C(m: Motion) -> list[Jet]:
        d = m.point(P_j) - m.point(P_i)
        rows = [dot(d, m.direction(n_j)), dot(d, m.direction(m_j))]
        return [*turned(m, P_i.body, P_j.body), *rows]

    return Joint(name, P_i.body, P_j.body, C)


def fix(name: str, body: int, r0: tuple[float, float, float]) -> Joint:
    """Return a joint that keeps a body, unturned, at r0."""

    def C(m: Motion) -> list[Jet]:
        place = m.point(Fixed(body, (0.0, 0.0, 0.0))) - m.point(Fixed(GROUND, r0))
        return [place, *turned(m, GROUND, body)]

    return Joint(name, body, GROUND, C)


def contact(eta: Array, radius: float) -> tuple[Array, Array, Array]:
    """Return the arm from the centre of a disk to its lowest point, and the directions t and n.
    `eta` is the normal of the disk; t lies in the disk and in the ground, n = t x z."""
    k = np.array([0.0, 0.0, 1.0])[:, None]
    sine = np.sqrt(1 - eta[2] ** 2)
    return -radius / sine * (k - eta[2] * eta), cross(k, eta) / sine, (eta - eta[2] * k) / sine


def disk(name: str, body: int, radius: float, slip: str) -> Joint:
    """Return a thin disk on the ground z = 0: rows as in "xyz", "z", "zn" or "zt"."""

    def C(m: Motion) -> list[Jet]:
        eta, h = m.direction(Fixed(body, (0.0, 1.0, 0.0))), 1e-30
        v, w = (m.batch[6 * body + k : 6 * body + k + 3] for k in (0, 3))
        s, t, n = contact(eta.f0, radius)
        s_dot, t_dot, n_dot = (x.imag / h for x in contact(eta.f0 + 1j * h * eta.f1, radius))
        at, later = v + cross(w, s), cross(w, s_dot)
        still = np.zeros_like(s)
        ways = {"t": (t, t_dot), "n": (n, n_dot)}
        for k, axis in enumerate("xyz"):
            ways[axis] = (np.eye(3)[k][:, None] + still, still)
        rows = []
        for letter in slip:
            u, u_dot = ways[letter]
            height = (m.r[body] + s.T)[:, 2] if letter == "z" else still[0]
            first = (u * at).sum(axis=0, keepdims=True)
            second = (u_dot * at + u * later).sum(axis=0, keepdims=True)
            rows.append(Jet(height[None, :], first, second))
        return rows

    return Joint(name, body, GROUND, C)
