"""The problem of contacts alone, where joints guide their bodies: a round of it.

What an impulse of each contact does to the velocities of all comes from one factorisation of
M + D^T weight s D, in which joints give hardly at all; what they give is taken back round by round.
A round is that of newton.py with the velocities of bodies eliminated, and a pass of it a matrix of
three unknowns a contact.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math

from dap3d_core.assembly.evaluate import copy, zero
from dap3d_core.integrators.moreau import matrix, newton
from dap3d_core.integrators.moreau.arrays import ALONE, CONE, StepArrays
from dap3d_core.integrators.moreau.contact_set import put_speeds
from dap3d_core.integrators.moreau.impulses import STICKS, mode_of
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled

#: Weight of joints times the masses that their rows feel.
STIFF = 1e8
#: Passes of a round at most; to what part of the impulses they are to solve it.
PASSES, FOUND = 10, 1e-4
#: Part of the largest impulse up to which one is rounding.
PUSHES = 1e-12
#: How weights are taken back, at most.
LESS, LEAST = 1e-2, 1.0


@compiled
def factor_joints(s: StepArrays) -> bool:
    """Put the factors of the bodies' masses with stiff joints; False without room."""
    m = s.chosen_count
    if 3 * m > s.felt.shape[0]:
        s.held_count = m
        return False
    s.chosen_count = 0  # the matrix is of joints alone
    has_room = matrix.lay_out(s, 0)
    if has_room:
        matrix.assemble(s, STIFF, 0.0)
        matrix.factor(s)
    s.chosen_count = m
    return has_room


@compiled
def put_felt(s: StepArrays, passes: int) -> None:
    """Put how contacts feel each other with what joints ``answer``.

    By velocities v with answers a, both missed by e, it is J v + a D v: missed by e^2 alone.

    passes: by which joints are met, each to some 1e-6 of the one before.
    """
    m = s.chosen_count
    for p in range(m):
        c = s.chosen[p]
        for r in range(3):
            column = 3 * p + r
            for n in range(s.row_count):
                s.lead[s.rows[n]] = s.answer[column, s.rows[n]] = 0.0
            for k in range(3 * m):
                s.felt[column, k] = s.felt[k, column] = 0.0
            if is_idle(s, c, r):
                continue
            for turn in range(passes):
                newton.clear(s, s.delta)
                for side in range(2):
                    row = s.delta[s.bodies[c, side]]
                    for k in range(6):
                        row[k] = s.J[c, 12 * r + 6 * side + k]
                if turn > 0:
                    newton.add_pull(s, s.lead, s.delta)
                solve_bodies(s)
                for n in range(s.row_count):
                    k = s.rows[n]
                    s.pull[k] = newton.speed_of(s, k, s.delta)
                    s.lead[k] -= STIFF * s.s[k] * s.pull[k]
            for n in range(s.row_count):
                s.answer[column, s.rows[n]] = s.lead[s.rows[n]]
            for q in range(p + 1):
                for i in range(3 if q < p else r + 1):
                    if not is_idle(s, s.chosen[q], i):
                        put_mutual(s, q, i, column)


@compiled
def is_idle(s: StepArrays, c: int, r: int) -> bool:
    """True of a tangent along which a contact never has an impulse."""
    return r > 0 and s.kind[c] == CONE and s.mu[c] == 0.0 and s.x[c, r] == 0.0


@compiled
def put_mutual(s: StepArrays, q: int, i: int, column: int) -> None:
    """Put what direction i of a contact and that of a column, solved last, feel of each other."""
    c, row, felt = s.chosen[q], 3 * q + i, 0.0
    J, first, second = s.J[c], s.delta[s.bodies[c, 0]], s.delta[s.bodies[c, 1]]
    for k in range(6):
        felt += J[12 * i + k] * first[k] + J[12 * i + 6 + k] * second[k]
    for n in range(s.row_count):
        felt += s.answer[row, s.rows[n]] * s.pull[s.rows[n]]
    s.felt[row, column] = s.felt[column, row] = felt


@compiled
def solve_bodies(s: StepArrays) -> None:
    """Overwrite ``delta`` with K^-1 times it."""
    for q in range(s.used_count):
        for k in range(6):
            s.change[6 * q + k] = s.delta[s.used[q], k]
    matrix.solve_factored(s)
    zero(s.delta[0])
    for q in range(s.used_count):
        for k in range(6):
            s.delta[s.used[q], k] = s.change[6 * q + k]


@compiled
def meet_joints(s: StepArrays) -> None:
    """Improve the impulses y of joints, given those of contacts, and put velocities with both."""
    newton.put_velocities(s, s.v)
    left = largest = 0.0
    for n in range(s.row_count):
        k = s.rows[n]
        missed = s.s[k] * (newton.speed_of(s, k, s.v) - s.free_speed[k])
        left, largest = max(left, abs(missed)), max(largest, abs(s.y[k]))
        s.lead[k] = -STIFF * missed
    if left <= newton.SOLUTION_ROUNDING * largest:  # it would be of rounding alone
        return
    newton.clear(s, s.delta)
    newton.add_pull(s, s.lead, s.delta)
    solve_bodies(s)
    for n in range(s.row_count):
        k = s.rows[n]
        s.y[k] += s.lead[k] - STIFF * s.s[k] * newton.speed_of(s, k, s.delta)
    for q in range(s.used_count):
        for k in range(6):
            s.v[s.used[q], k] += s.delta[s.used[q], k]


@compiled
def reduced_round(s: StepArrays, weight: float, tolerance: float) -> float:
    """Bring x and y to the end of a round; those of before are in ``push`` and ``pull``.

    Returns the weight, less than asked for where no pass was found with that.
    """
    m = s.chosen_count
    for q in range(m):
        put_speeds(s, s.chosen[q], s.v)
    while not solve_reduced(s, weight, tolerance) and weight >= LEAST:
        weight *= LESS
    for n in range(s.row_count):
        s.pull[s.rows[n]] = s.y[s.rows[n]]
    for q in range(m):
        c = s.chosen[q]
        for r in range(3):
            y, answer, old, push = s.y, s.answer[3 * q + r], s.x[c, r], s.push[c, r]
            for n in range(s.row_count):
                y[s.rows[n]] += answer[s.rows[n]] * push
            s.x[c, r], s.push[c, r] = old + push, old
    meet_joints(s)
    return weight


@compiled
def solve_reduced(s: StepArrays, weight: float, tolerance: float) -> bool:
    """Find what impulses change by in a round, ``push``, by Newton's method; True if found.

    Weights multiply the rounding of what impulses change by, and not that of impulses.
    """
    holds, is_far = True, False
    for q in range(s.chosen_count):
        c = s.chosen[q]
        s.push[c, 0] = s.push[c, 1] = s.push[c, 2] = 0.0
    merit = put_missing(s, s.push, weight)
    for _ in range(PASSES):
        if merit <= aim_of(s, tolerance):
            break
        better = try_reduced(s, weight, merit, 1.0, True) if holds else -1.0
        if better < 0.0:
            if holds:
                put_missing(s, s.push, weight)
            better = try_reduced(s, weight, merit, 1.0, False)
        holds = False
        if better < 0.0:
            put_missing(s, s.push, weight)
            better = try_reduced(s, weight, merit, 0.0, False)
        if better < 0.0 and is_far:
            break
        if better < 0.0:
            is_far = True
            for q in range(s.chosen_count):
                c = s.chosen[q]
                for k in range(3):
                    s.push[c, k] = -s.x[c, k]
            better = put_missing(s, s.push, weight)
        merit = better
    return merit <= aim_of(s, FOUND)


@compiled
def aim_of(s: StepArrays, tolerance: float) -> float:
    """The merit at which a round is solved."""
    size = newton.TINY
    for q in range(s.chosen_count):
        c = s.chosen[q]
        for k in range(3):
            x = s.x[c, k] + s.push[c, k]
            size += x * x / s.r[c]
    return max(tolerance, newton.SOLUTION_ROUNDING) ** 2 * size


@compiled
def put_missing(s: StepArrays, change: Floats, weight: float) -> float:
    """Put what changes of impulses leave of the equations of a round, ``missing``; its square.

    They are x + change = P(x - weight r (u + W change)).
    """
    m, total = s.chosen_count, 0.0
    for p in range(m):
        c = s.chosen[p]
        z, x, missing, part = s.z[c], s.x[c], s.missing[c], weight * s.r[c]
        for r in range(3):
            row, u = s.felt[3 * p + r], s.u[c, r]
            for q in range(m):
                d = change[s.chosen[q]]
                u += row[3 * q] * d[0] + row[3 * q + 1] * d[1] + row[3 * q + 2] * d[2]
            z[r] = x[r] - part * u
        s.rim[c] = newton.bound_of(s, c, s.z, s.y)
        newton.put_projected(z, s.rim[c], s.kind[c], missing)
        for r in range(3):
            missing[r] = change[c, r] - (missing[r] - x[r])
            total += missing[r] * missing[r] / s.r[c]
    return total


@compiled
def try_reduced(s: StepArrays, weight: float, merit: float, feels: float, holds: bool) -> float:
    """Take a Newton step, or a part of it; the new merit, -1 if none is better.

    feels: as of ``try_pass``. holds: what pushes is taken to do so still, whatever velocities,
    times a large weight, say; no parts then.
    """
    m, n, K, step, largest = s.chosen_count, 3 * s.chosen_count, s.small, s.small_step, 0.0
    for q in range(m if holds else 0):
        largest = max(largest, s.x[s.chosen[q], 0])
    for q in range(m):
        c = s.chosen[q]
        B, z, part = s.B[c], s.z[c], weight * s.r[c]
        newton.put_slopes(z, feels * s.mu[c], s.rim[c], s.kind[c], B)
        if holds and s.kind[c] == CONE and s.x[c, 0] > PUSHES * largest:
            hold(s, c)
        for r in range(3):
            at, row = n * (3 * q + r), s.felt
            for k in range(n):
                K[at + k] = part * (
                    B[3 * r] * row[3 * q, k]
                    + B[3 * r + 1] * row[3 * q + 1, k]
                    + B[3 * r + 2] * row[3 * q + 2, k]
                )
            K[at + 3 * q + r] += 1.0
            step[3 * q + r] = -s.missing[c, r]
        size = math.sqrt(z[1] * z[1] + z[2] * z[2])
        if s.kind[c] == ALONE and s.under[c] >= 0 and feels > 0.0 and 0.0 < s.rim[c] < size:
            u = s.under[c]
            first = 3 * place_of(s, u)
            for r in range(1, 3):  # what resists rolling grows with what presses
                along = weight * s.r[u] * z[r] / size
                for k in range(n):
                    K[n * (3 * q + r) + k] += along * s.felt[first, k]
    matrix.factor_square(K, s.exchanged, n)
    matrix.solve_square(K, s.exchanged, step, n)
    part = 1.0
    for _ in range(1 if holds else newton.CUTS):
        for q in range(m):
            c = s.chosen[q]
            for k in range(3):
                s.kept[c, k] = s.push[c, k] + part * step[3 * q + k]
        found = put_missing(s, s.kept, weight)
        if found < (1.0 - 0.1 * part) * merit:
            for q in range(m):
                c = s.chosen[q]
                copy(s.push[c], s.kept[c])
            return found
        part *= 0.5
    return -1.0


@compiled
def hold(s: StepArrays, c: int) -> None:
    """Take a contact to push, and to stick or slide, as its impulse does: slopes, ``missing``."""
    x, z, held, missing = s.x[c], s.z[c], s.turned, s.missing[c]
    size, rim = math.sqrt(z[1] * z[1] + z[2] * z[2]), s.mu[c] * x[0]
    held[0], held[1], held[2] = x[0], z[1], z[2]
    if mode_of(s, c) == STICKS:
        rim = size
    newton.put_slopes(held, s.mu[c], rim, CONE, s.B[c])
    part = s.mu[c] * z[0] / size if rim < size else 1.0
    missing[0] = x[0] - z[0]
    missing[1], missing[2] = x[1] - part * z[1], x[2] - part * z[2]


@compiled
def place_of(s: StepArrays, c: int) -> int:
    """Place of a contact among those of its group."""
    q = 0
    while s.chosen[q] != c:
        q += 1
    return q
