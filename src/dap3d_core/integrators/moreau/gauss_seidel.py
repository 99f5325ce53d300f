"""Projected Gauss-Seidel on contacts: impulses and velocities, of bodies or of the contacts.

Of contacts held between bodies that joints guide impulses are not unique, and Newton's method has
no way from far away: sweeps that count in what joints answer with have one.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math

from dap3d_core.assembly.evaluate import copy
from dap3d_core.integrators.moreau.arrays import CONE, WHOLE
from dap3d_core.integrators.moreau.newton import TINY
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled


@compiled
def sweep_bodies(
    chosen: Integers, bodies: Integers, J: Floats, moved: Floats, own: Floats, bias: Floats,
    kind: Integers, under: Integers, mu: Floats, rim: Floats, x: Floats, v: Floats, sweeps: int,
    tolerance: float, relax: float,
) -> int:  # fmt: skip
    """Sweep until no impulse changes by more than a part of the largest; sweeps done.

    Args:
        chosen: the contacts of a group, of m.
        bodies: (m, 2) i and j, ground 0.
        J, moved: (m, 36) rows normal, tangents, each of bodies i and j; the same times M^-1.
        own: (m, 9) J moved^T of each contact.
        bias: (m, 3) m/s, added to velocities.
        kind: (m,) CONE, ALONE or WHOLE.
        under: (m,) contact before, whose push is the most friction of one, or -1.
        mu, rim: (m,) friction is at most mu times what pushes, and ``rim``, N s.
        x: (m, 3) impulses, N s, changed in place.
        v: (n + 1, 6) velocities with these impulses, changed with them.
        relax: 1, or more to go beyond what each contact asks for by itself.
    """
    for done in range(sweeps):
        change, largest = 0.0, 1e-300
        for q in range(chosen.size):
            c = chosen[q]
            i, j = bodies[c, 0], bodies[c, 1]
            a, b, rows, moves = v[i], v[j], J[c], moved[c]
            u0, u1, u2 = bias[c, 0], bias[c, 1], bias[c, 2]
            for k in range(6):
                u0 += rows[k] * a[k] + rows[6 + k] * b[k]
                u1 += rows[12 + k] * a[k] + rows[18 + k] * b[k]
                u2 += rows[24 + k] * a[k] + rows[30 + k] * b[k]
            if under[c] >= 0:
                rim[c] = x[under[c], 0]
            d0, d1, d2 = change_of(
                own[c], kind[c], mu[c], rim[c], x[c], relax * u0, relax * u1, relax * u2
            )
            for k in range(6):
                a[k] += moves[k] * d0 + moves[12 + k] * d1 + moves[24 + k] * d2
                b[k] += moves[6 + k] * d0 + moves[18 + k] * d1 + moves[30 + k] * d2
            change = max(change, abs(d0), abs(d1), abs(d2))
            largest = max(largest, x[c, 0] if kind[c] == CONE else size_of(x[c]))
        if change <= tolerance * largest:
            return done + 1
    return sweeps


@compiled
def sweep_contacts(
    chosen: Integers, felt: Floats, own: Floats, u: Floats, kind: Integers, under: Integers,
    mu: Floats, rim: Floats, x: Floats, sweeps: int, tolerance: float,
) -> int:  # fmt: skip
    """The same where joints answer as well: u = felt x + what there is without impulses.

    Args:
        chosen: the contacts of a group, n of m.
        felt: (3 n, 3 n) how these feel each other, symmetric.
        own: (m, 9) its diagonal blocks; contacts whose first number is zero are left as they are.
        u: (m, 3) velocities with the impulses x, changed with them.
        kind, under, mu, rim, x, sweeps, tolerance: as of ``sweep_bodies``.
    """
    for done in range(sweeps):
        change, largest = 0.0, 1e-300
        for place in range(chosen.size):
            c = chosen[place]
            if own[c, 0] == 0.0:
                continue
            if under[c] >= 0:
                rim[c] = x[under[c], 0]
            d0, d1, d2 = change_of(own[c], kind[c], mu[c], rim[c], x[c], u[c, 0], u[c, 1], u[c, 2])
            p, q, r = felt[3 * place], felt[3 * place + 1], felt[3 * place + 2]
            for k in range(chosen.size):
                for s in range(3):
                    u[chosen[k], s] += p[3 * k + s] * d0 + q[3 * k + s] * d1 + r[3 * k + s] * d2
            change = max(change, abs(d0), abs(d1), abs(d2))
            largest = max(largest, x[c, 0] if kind[c] == CONE else size_of(x[c]))
        if change <= tolerance * largest:
            return done + 1
    return sweeps


@compiled
def size_of(x: Floats) -> float:
    """The largest of three numbers."""
    return max(abs(x[0]), abs(x[1]), abs(x[2]))


@compiled
def change_of(
    own: Floats, kind: int, mu: float, rim: float, x: Floats, u0: float, u1: float, u2: float
) -> tuple[float, float, float]:
    """Bring the impulse of one contact into its cone, given its velocities; what it changes by."""
    old, p, q = x[0], x[1], x[2]
    if kind == WHOLE:
        big = own[0] + own[4] + own[8]
        w, y, z = old - u0 / big, p - u1 / big, q - u2 / big
        part = rim / max(rim, math.sqrt(w * w + y * y + z * z), TINY)
        x[0], x[1], x[2] = part * w, part * y, part * z
        return x[0] - old, x[1] - p, x[2] - q
    x[0] = max(0.0, old - u0 / own[0]) if kind == CONE else 0.0
    d0 = x[0] - old
    if mu > 0.0 or rim > 0.0:
        a, b, o = own[4], own[8], own[5]
        big = 0.5 * (a + b) + math.sqrt(0.25 * (a - b) * (a - b) + o * o)
        y, z = p - (u1 + own[3] * d0) / big, q - (u2 + own[6] * d0) / big
        most, far = mu * x[0] + rim, math.sqrt(y * y + z * z)
        if far > most:
            y, z = y * most / far, z * most / far
        x[1], x[2] = y, z
    else:
        x[1], x[2] = 0.0, 0.0
    return d0, x[1] - p, x[2] - q


@compiled
def copy_impulses(x: Floats, y: Floats, to_x: Floats, to_y: Floats, count: int) -> None:
    """Copy the impulses of so many contacts, and of joints."""
    for c in range(count):
        copy(to_x[c], x[c])
    copy(to_y, y)
