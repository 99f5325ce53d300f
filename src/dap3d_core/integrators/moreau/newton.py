"""A semismooth Newton method for the impulses of contacts and joints, to rounding.

An augmented Lagrangian in the velocities v of bodies: with weights rho, from impulses x of contacts
and y of joints,

    M (v - v_free) = J^T P(x - rho (J v + b)) + D^T (y - rho D (v - v_free)),

P the projection of Coulomb's law (Alart, Curnier, Comp. Meth. Appl. Mech. Eng. 92, 1991), is solved
by Newton's method; then the impulses become what they are there. Its matrix M + J^T rho P' J is
regular however rows depend on each other. Large weights make few rounds, and kinks that a pass may
not get over: they are taken back where rounds no longer help, and raised again where they do.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math

from dap3d_core.assembly.evaluate import copy
from dap3d_core.integrators.moreau.arrays import CONE, WHOLE, StepArrays
from dap3d_core.integrators.moreau.contact_set import DECLARED, put_speeds, velocity_of
from dap3d_core.integrators.moreau.matrix import assemble, factor, is_factored, solve_factored
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled

#: Newton passes of a round, and halvings of a pass at most.
PASSES, CUTS = 40, 8
#: The best to which a round is solved.
SOLUTION_ROUNDING = 1e-15
TINY = 1e-300


@compiled
def put_projected(z: Floats, bound: float, kind: int, out: Floats) -> None:
    """Put the impulse next to z that Coulomb's law allows, of friction up to a bound."""
    size = max(math.sqrt(z[1] * z[1] + z[2] * z[2]), TINY)
    out[0] = max(0.0, z[0])
    if kind != CONE:
        size = slip_size(z, kind)
        out[0] = min(1.0, bound / size) * z[0] if kind == WHOLE else 0.0
    part = min(1.0, bound / size)
    out[1], out[2] = part * z[1], part * z[2]


@compiled
def slip_size(z: Floats, kind: int) -> float:
    """Length of what friction of a joint acts along."""
    whole = z[0] * z[0] if kind == WHOLE else 0.0
    return max(math.sqrt(whole + (z[1] * z[1] + z[2] * z[2])), TINY)


@compiled
def put_slopes(z: Floats, mu: float, bound: float, kind: int, B: Floats) -> None:
    """Put the derivatives of ``projected``, (9,) by rows; mu: of the bound, of what pushes."""
    size = max(math.sqrt(z[1] * z[1] + z[2] * z[2]), TINY)
    pushes = 1.0 if z[0] > 0.0 else 0.0
    if kind != CONE:
        size, pushes = slip_size(z, kind), 0.0
    part, d, e = min(1.0, bound / size), z[1] / size, z[2] / size
    slides = 1.0 if bound < size else 0.0
    B[0], B[1], B[2] = pushes, 0.0, 0.0
    B[3], B[6] = slides * pushes * mu * d, slides * pushes * mu * e
    B[4], B[8] = part * (1.0 - slides * d * d), part * (1.0 - slides * e * e)
    B[5] = B[7] = -part * slides * d * e
    if kind == WHOLE:
        c = z[0] / size
        B[0] = part * (1.0 - slides * c * c)
        B[1] = B[3] = -part * slides * c * d
        B[2] = B[6] = -part * slides * c * e


@compiled
def put_missed(x: Floats, u: Floats, bound: float, kind: int, r: float, out: Floats) -> None:
    """Put what an impulse misses Coulomb's law by at a velocity.

    r: mass that the rows feel, kg, which makes an impulse of a velocity.
    """
    z0, z1, z2 = x[0] - r * u[0], x[1] - r * u[1], x[2] - r * u[2]
    size = math.sqrt(z1 * z1 + z2 * z2)
    if kind == WHOLE:
        size = math.sqrt(z0 * z0 + size * size)
    part = bound / max(size, TINY) if size > bound else 1.0
    z0 = max(0.0, z0) if kind == CONE else z0 * part if kind == WHOLE else 0.0
    out[0], out[1], out[2] = x[0] - z0, x[1] - z1 * part, x[2] - z2 * part


@compiled
def rim_of(s: StepArrays, c: int, x: Floats, y: Floats) -> float:
    """Friction that contact c, of a joint or of what rolls, may have, N s.

    x, y: impulses of contacts, and of joints besides those of free motion, N s.
    """
    if s.under[c] >= 0:
        return max(x[s.under[c], 0], 0.0)
    k = s.key[c] - DECLARED
    first, total = s.load_row[k], 0.0
    if s.load_count[k] == 0:
        return s.grip[k] * s.h
    for q in range(first, first + s.load_count[k]):
        one = s.y_free[q] + y[q]
        total += one * one if one > 0.0 or s.load_pushes[k] == 0 else 0.0
    return s.grip[k] * math.sqrt(total)


@compiled
def bound_of(s: StepArrays, c: int, x: Floats, y: Floats) -> float:
    """The most friction of contact c, N s; arguments as of ``rim_of``."""
    return s.mu[c] * max(x[c, 0], 0.0) if s.kind[c] == CONE else rim_of(s, c, x, y)


# ------------------------------------------------------------------ velocities and residuals


@compiled
def put_velocities(s: StepArrays, v: Floats) -> None:
    """Put the velocities of a group with impulses x and y."""
    for q in range(s.used_count):
        b = s.used[q]
        copy(v[b], s.free[b])
    for q in range(s.chosen_count):
        c = s.chosen[q]
        first, second, moved = v[s.bodies[c, 0]], v[s.bodies[c, 1]], s.moved[c]
        x0, x1, x2 = s.x[c, 0], s.x[c, 1], s.x[c, 2]
        for k in range(6):
            first[k] += x0 * moved[k] + x1 * moved[12 + k] + x2 * moved[24 + k]
            second[k] += x0 * moved[6 + k] + x1 * moved[18 + k] + x2 * moved[30 + k]
    if s.row_count > 0:
        clear(s, s.rest)
        add_pull(s, s.y, s.rest)
        for q in range(s.used_count):
            b, change = s.used[q], s.turned
            times_inverse(s, b, s.rest[b], change)
            for k in range(6):
                v[b, k] += change[k]


@compiled
def clear(s: StepArrays, out: Floats) -> None:
    """Put zero for the bodies of a group."""
    for q in range(s.used_count):
        row = out[s.used[q]]
        for k in range(6):
            row[k] = 0.0


@compiled
def add_pull(s: StepArrays, y: Floats, out: Floats) -> None:
    """Add D^T y."""
    for n in range(s.row_count):
        k = s.rows[n]
        pull = y[k]
        for q in range(s.row_start[k], s.row_start[k + 1]):
            row, D = out[s.row_body[q]], s.D[q]
            for i in range(6):
                row[i] += D[i] * pull


@compiled
def times_inverse(s: StepArrays, b: int, x: Floats, out: Floats) -> None:
    """Put M^-1 x of body b, six numbers."""
    spin, m = s.spin_inverse[b], s.mass_inverse[b]
    for k in range(3):
        out[k] = m * x[k]
        out[3 + k] = spin[3 * k] * x[3] + spin[3 * k + 1] * x[4] + spin[3 * k + 2] * x[5]


@compiled
def speed_of(s: StepArrays, k: int, v: Floats) -> float:
    """D v of row k of joints."""
    found = 0.0
    for q in range(s.row_start[k], s.row_start[k + 1]):
        row = v[s.row_body[q]]
        for i in range(6):
            found += s.D[q, i] * row[i]
    return found


@compiled
def left_at(s: StepArrays, c: int, v: Floats) -> float:
    """What contact c misses the law by."""
    put_speeds(s, c, v)
    u = s.u[c]
    put_missed(s.x[c], u, bound_of(s, c, s.x, s.y), s.kind[c], s.r[c], u)
    return max(abs(u[0]), abs(u[1]), abs(u[2]))


@compiled
def impulse_of(s: StepArrays, c: int) -> float:
    """The size of an impulse, or of the most that friction of a joint has."""
    x = s.x[c]
    found = max(abs(x[0]), abs(x[1]), abs(x[2]))
    return found if s.kind[c] == CONE else max(found, rim_of(s, c, s.x, s.y))


@compiled
def residual_of(s: StepArrays, v: Floats, left: float) -> float:
    """What the law and the joints are missed by at velocities v, a part of the largest impulse.

    left: what else is missed, N s.
    """
    largest = 0.0
    for q in range(s.chosen_count):
        c = s.chosen[q]
        left = max(left, left_at(s, c, v))
        largest = max(largest, impulse_of(s, c))
    for q in range(s.row_count):
        k = s.rows[q]
        speed = speed_of(s, k, v) - s.free_speed[k]
        left, largest = max(left, abs(s.s[k] * speed)), max(largest, abs(s.y[k]))
    return left / max(largest, s.least, TINY)


# ------------------------------------------------------------------ a round


@compiled
def begin_round(s: StepArrays) -> None:
    """Take the velocities v as those that a round counts its changes from."""
    clear(s, s.delta)
    for q in range(s.chosen_count):
        put_speeds(s, s.chosen[q], s.v)
    for q in range(s.row_count):
        k = s.rows[q]
        s.lead[k] = speed_of(s, k, s.v) - s.free_speed[k]


@compiled
def put_rest(s: StepArrays, delta: Floats, weight: float, R: Floats) -> float:
    """Put what velocities v + delta leave of the equations of a round; its square in M^-1.

    ``push`` and ``pull`` become the impulses there, z what is projected. Weights multiply the
    rounding of delta, and not that of v.
    """
    for q in range(s.row_count):
        k = s.rows[q]
        s.pull[k] = s.y[k] - weight * s.s[k] * (s.lead[k] + speed_of(s, k, delta))
    clear(s, R)
    add_pull(s, s.pull, R)
    for q in range(s.used_count):
        b, x = s.used[q], s.turned
        row, spin, m = R[b], s.spin[b], s.mass[b]
        for k in range(6):
            x[k] = (s.v[b, k] - s.free[b, k]) + delta[b, k]
        for k in range(3):
            turn = spin[3 * k] * x[3] + spin[3 * k + 1] * x[4] + spin[3 * k + 2] * x[5]
            row[k], row[3 + k] = m * x[k] - row[k], turn - row[3 + k]
    for q in range(s.chosen_count):
        c = s.chosen[q]
        u0, u1, u2 = velocity_of(s, c, delta)
        part, z, J = weight * s.r[c], s.z[c], s.J[c]
        z[0], z[1] = s.x[c, 0] - part * (s.u[c, 0] + u0), s.x[c, 1] - part * (s.u[c, 1] + u1)
        z[2] = s.x[c, 2] - part * (s.u[c, 2] + u2)
        s.push[c, 0] = z[0]
        s.rim[c] = bound_of(s, c, s.push, s.pull)
        put_projected(z, s.rim[c], s.kind[c], s.push[c])
        p, y, w = s.push[c, 0], s.push[c, 1], s.push[c, 2]
        first, second = R[s.bodies[c, 0]], R[s.bodies[c, 1]]
        for k in range(6):
            first[k] -= J[k] * p + J[12 + k] * y + J[24 + k] * w
            second[k] -= J[6 + k] * p + J[18 + k] * y + J[30 + k] * w
    merit = 0.0
    for q in range(s.used_count):
        merit += product_of(
            R[s.used[q]], R[s.used[q]], s.mass_inverse[s.used[q]], s.spin_inverse[s.used[q]]
        )
    return merit


@compiled
def product_of(x: Floats, y: Floats, m: float, spin: Floats) -> float:
    """X . M y of six numbers each, by the mass and the moments of inertia of a body."""
    total = 0.0
    for k in range(3):
        turned = spin[3 * k] * y[3] + spin[3 * k + 1] * y[4] + spin[3 * k + 2] * y[5]
        total += m * x[k] * y[k] + x[3 + k] * turned
    return total


@compiled
def solve_round(s: StepArrays, weight: float, tolerance: float) -> None:
    """Bring v to where it solves the equations of a round; impulses there in push and pull."""
    rubs = is_far = False
    for q in range(s.chosen_count):
        rubs |= s.kind[s.chosen[q]] != CONE
    begin_round(s)
    merit = put_rest(s, s.delta, weight, s.rest)
    for _ in range(PASSES):
        if merit <= aim_of(s, tolerance, rubs):
            break
        better = try_pass(s, weight, merit, 1.0)
        if better < 0.0:
            put_rest(s, s.delta, weight, s.rest)
            better = try_pass(s, weight, merit, 0.0)
        if better < 0.0 and is_far:
            put_rest(s, s.delta, weight, s.rest)
            break
        if better < 0.0:
            is_far = True
            for q in range(s.used_count):
                for k in range(6):
                    s.delta[s.used[q], k] = s.free[s.used[q], k] - s.v[s.used[q], k]
            better = put_rest(s, s.delta, weight, s.rest)
        merit = better
    for q in range(s.used_count):
        for k in range(6):
            s.v[s.used[q], k] += s.delta[s.used[q], k]


@compiled
def aim_of(s: StepArrays, tolerance: float, rubs: bool) -> float:
    """The merit at which a round is solved.

    rubs: friction of joints may be little beside the momentum of its bodies, which is left out.
    """
    size = TINY
    for q in range(s.used_count):
        b, x = s.used[q], s.change
        for k in range(6):
            x[k] = s.free[b, k] - s.v[b, k] - s.delta[b, k]
        size += product_of(x, x, s.mass[b], s.spin[b])
        if not rubs:
            size += product_of(s.free[b], s.free[b], s.mass[b], s.spin[b])
    return max(tolerance, SOLUTION_ROUNDING) ** 2 * size


@compiled
def try_pass(s: StepArrays, weight: float, merit: float, feels: float) -> float:
    """Take a Newton step, or a part of it; the new merit, -1 if none is better.

    feels: 1.0, or 0.0 where friction is taken as if it did not depend on what presses.
    """
    for q in range(s.chosen_count):
        c = s.chosen[q]
        put_slopes(s.z[c], feels * s.mu[c], s.rim[c], s.kind[c], s.B[c])
    if not is_factored(s, weight, feels):
        assemble(s, weight, feels)
        factor(s)
    for q in range(s.used_count):
        for k in range(6):
            s.change[6 * q + k] = -s.rest[s.used[q], k]
    solve_factored(s)
    part = 1.0
    for _ in range(CUTS):
        for q in range(s.used_count):
            b = s.used[q]
            for k in range(6):
                s.trial[b, k] = s.delta[b, k] + part * s.change[6 * q + k]
        found = put_rest(s, s.trial, weight, s.trial_rest)
        if found < (1.0 - 0.1 * part) * merit:
            for q in range(s.used_count):
                b = s.used[q]
                for k in range(6):
                    s.delta[b, k], s.rest[b, k] = s.trial[b, k], s.trial_rest[b, k]
            return found
        part *= 0.5
    return -1.0
