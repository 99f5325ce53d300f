"""Contacts held between bodies that joints guide.

Impulses are not unique there, and Newton's method has no way from far away: sweeps that count in
what joints answer with have one.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from dap3d_core.formulations.jumps.multipliers import diagonalise
from dap3d_core.integrators.moreau.arrays import StepArrays
from dap3d_core.integrators.moreau.gauss_seidel import sweep_contacts
from dap3d_core.integrators.moreau.newton import newton, times_inverse, velocity_of
from dap3d_core.kernels.runtime.cache import compiled

#: Rounds of sweeps and Newton's method at most, and sweeps of one.
ROUNDS, SWEEPS = 3, 200
#: Part of the largest below which joints depend on each other, and of its own below which a contact
#: cannot move.
DEPENDENT, HELD = 1e-12, 1e-12


@compiled
def refine_held(s: StepArrays, tolerance: float, aim: float) -> bool:
    """Improve impulses by sweeps, then Newton's method, to a tolerance; False without room."""
    m = s.contact_count
    if 3 * m > s.felt.shape[0]:
        s.held_count = m
        return False
    put_answer(s)
    put_felt(s)
    for c in range(m):
        own = s.own_held[c]
        for r in range(3):
            for q in range(3):
                own[3 * r + q] = s.felt[3 * c + r, 3 * c + q]
        if own[0] * s.r[c] < HELD:
            own[0] = 0.0
    best = s.residual
    keep(s)
    for _ in range(ROUNDS):
        for c in range(m):
            u = s.u[c]
            u[0], u[1], u[2] = velocity_of(s, c, s.free)
            u[0] += s.bias[c]
            for r in range(3):
                for q in range(m):
                    for k in range(3):
                        u[r] += s.felt[3 * c + r, 3 * q + k] * s.x[q, k]
        sweep_contacts(s.felt, s.own_held, s.u, s.mu[:m], s.x, SWEEPS, aim)
        for k in range(s.y.size):
            s.y[k] = 0.0
            for c in range(m):
                for r in range(3):
                    s.y[k] -= s.answer[k, 3 * c + r] * s.x[c, r]
        s.residual = newton(s, aim)
        if s.residual < best:
            best = s.residual
            keep(s)
        else:
            take_kept(s)
            s.residual = best
        if best <= tolerance:
            break
    return True


@compiled
def keep(s: StepArrays) -> None:
    """Keep the impulses."""
    for c in range(s.contact_count):
        for k in range(3):
            s.kept[c, k] = s.x[c, k]
    for k in range(s.y.size):
        s.y_kept[k] = s.y[k]


@compiled
def take_kept(s: StepArrays) -> None:
    """Take those kept."""
    for c in range(s.contact_count):
        for k in range(3):
            s.x[c, k] = s.kept[c, k]
    for k in range(s.y.size):
        s.y[k] = s.y_kept[k]


@compiled
def put_crossed(s: StepArrays) -> None:
    """Put D M^-1 D^T into ``values``, and D M^-1 J^T into ``crossed``."""
    for k in range(s.y.size):
        for b in range(s.rest.shape[0]):
            for i in range(6):
                s.rest[b, i] = 0.0
        for q in range(s.row_start[k], s.row_start[k + 1]):
            row = s.rest[s.row_body[q]]
            for i in range(6):
                row[i] += s.D[q, i]
        for c in range(s.contact_count):
            first, second, moved = s.rest[s.bodies[c, 0]], s.rest[s.bodies[c, 1]], s.moved[c]
            for r in range(3):
                total = 0.0
                for i in range(6):
                    total += moved[12 * r + i] * first[i] + moved[12 * r + 6 + i] * second[i]
                s.crossed[k, 3 * c + r] = total
        for p in range(s.y.size):
            total = 0.0
            for q in range(s.row_start[p], s.row_start[p + 1]):
                times_inverse(s, s.row_body[q], s.D[q], s.turned)
                row = s.rest[s.row_body[q]]
                for i in range(6):
                    total += s.turned[i] * row[i]
            s.values[k, p] = total


@compiled
def put_answer(s: StepArrays) -> None:
    """Put what joints answer to impulses of contacts, (D M^-1 D^T)^+ D M^-1 J^T."""
    put_crossed(s)
    size, largest = s.y.size, 0.0
    diagonalise(size, s.values, s.vectors)
    for q in range(size):
        largest = max(largest, abs(s.values[q, q]))
    for k in range(size):
        for c in range(3 * s.contact_count):
            s.answer[k, c] = 0.0
    for q in range(size):
        if abs(s.values[q, q]) > DEPENDENT * largest:
            for c in range(3 * s.contact_count):
                part = 0.0
                for k in range(size):
                    part += s.vectors[k, q] * s.crossed[k, c]
                part /= s.values[q, q]
                for k in range(size):
                    s.answer[k, c] += part * s.vectors[k, q]


@compiled
def put_felt(s: StepArrays) -> None:
    """Put how contacts feel each other, with what joints answer."""
    for c in range(s.contact_count):
        for r in range(3):
            for q in range(s.contact_count):
                for k in range(3):
                    total = 0.0
                    for side in range(2):
                        b = s.bodies[q, side]
                        for other in range(2):
                            if b > 0 and s.bodies[c, other] == b:
                                for i in range(6):
                                    total += (s.moved[c, 12 * r + 6 * other + i]
                                              * s.J[q, 12 * k + 6 * side + i])  # fmt: skip
                    for p in range(s.y.size):
                        total -= s.crossed[p, 3 * c + r] * s.answer[p, 3 * q + k]
                    s.felt[3 * c + r, 3 * q + k] = total
