"""Impulses of the contacts that answer at once, in a round of an impact."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from dap3d_core.formulations.contacts.cone import TRIES, solve_cone
from dap3d_core.formulations.contacts.contact_arrays import ContactArrays
from dap3d_core.formulations.contacts.forces import UNSOLVED, put_plain
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.least_squares import factor_least, solve_least

#: Part of the longest column below which slips depend on each other.
DEPENDENT = 1e-12


@compiled
def begin_problem(s: ContactArrays) -> None:
    """The cone problem of the contacts that touch: from their slip on, with impulses zero."""
    cone = s.cone
    for k in range(s.touching_count):
        s.closed[k] = s.touching[k]
    s.closed_count = cone.count = s.touching_count
    put_plain(s)
    for k in range(s.closed_count):
        c = s.closed[k]
        cone.mu[k], cone.more[k] = s.mu[c], 0.0
        cone.gapless[k], cone.ratio[k] = s.gapless[c], s.ratio[c]
        for i in range(3):
            cone.b[3 * k + i], cone.x[3 * k + i] = s.slip[c, i], 0.0


@compiled
def put_impulses(s: ContactArrays, e: Floats) -> None:
    """Impulses x (3 k,) of the contacts that touch, in both phases; e: (m,) of restitution."""
    begin_problem(s)
    cone, n, widens = s.cone, 3 * s.closed_count, False
    for k in range(s.closed_count):
        c = s.closed[k]
        if s.newton[c] != 0:
            cone.b[3 * k] += e[c] * min(s.slip[c, 0], 0.0)
    solve_cone(cone, TRIES)
    for k in range(n):
        s.x[k] = cone.x[k]
    for k in range(s.closed_count):
        c = s.closed[k]
        if s.newton[c] == 0:  # friction of joints alone has none
            cone.more[k] = e[c] * s.x[3 * k]
            s.x[3 * k] += cone.more[k]
            widens |= cone.more[k] != 0.0
    if not widens:
        return
    for i in range(n):
        cone.x[i], cone.b[i] = 0.0, s.slip[s.closed[i // 3], i % 3]
        for k in range(n):
            cone.b[i] += cone.A[i, k] * s.x[k]
    solve_cone(cone, TRIES)
    for k in range(n):
        s.x[k] += cone.x[k]


@compiled
def stop_slip(s: ContactArrays) -> bool:
    """Impulses x (3 k,) that stop slip, of those that touch and do not approach; False if zero."""
    begin_problem(s)
    cone, n, pushes = s.cone, 3 * s.closed_count, False
    for i in range(n):
        s.x[i] = -cone.b[i]
        for k in range(n):
            s.B[i, k] = cone.A[i, k]
    rank = factor_least(s.B, n, n, DEPENDENT, 0.0, s.w, s.order)
    solve_least(s.B, n, n, rank, s.w, s.order, s.x, cone.x)
    left = solve_cone(cone, TRIES)
    for k in range(n):
        s.x[k] = cone.x[k]
    for k in range(s.closed_count):
        pushes |= s.x[3 * k] > 0.0
    return pushes and left <= UNSOLVED
