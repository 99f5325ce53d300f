"""Forces of contacts that are closed, by the cone problem of the accelerations."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math

from dap3d_core.assembly.evaluate import zero
from dap3d_core.formulations.contacts.cone import solve_cone
from dap3d_core.formulations.contacts.contact_arrays import ContactArrays
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled

#: Speed, m/s, below which a contact is at rest; part of the largest acceleration below which one
#: is zero.
STILL, ZERO = 1e-9, 1e-9
#: Part of the largest acceleration of a group that counts as one of each of its contacts: what
#: joints let turn fast beside what they let slide is no measure of it, but its rounding is there.
BESIDE = 1e-3
#: Part of the terms of an acceleration that may be rounding of it.
CANCELLED = 1e-12
#: What is left of a cone problem that has no solution.
UNSOLVED = 1e-6
#: A load that bounds nothing.
BOUNDLESS = 1e100


@compiled
def still_speed(s: ContactArrays, c: int) -> float:
    """Speed, m/s, below which a contact is at rest."""
    return STILL * s.speed[c]


@compiled
def size_across(s: ContactArrays, c: int, u: Floats) -> float:
    """The length of what of u (3,) is slip of a contact."""
    first = u[0] * u[0] if s.gapless[c] > 0.0 else 0.0
    return math.sqrt(first + u[1] * u[1] + u[2] * u[2])


@compiled
def put_across(s: ContactArrays, c: int, u: Floats, part: float, out: Floats) -> None:
    """Put a part of what of u (3,) is slip of a contact."""
    out[0] = part * u[0] if s.gapless[c] > 0.0 else 0.0
    out[1], out[2] = part * u[1], part * u[2]


@compiled
def against(ratio: float, way: Floats) -> tuple[float, float]:
    """What friction that slides acts against along the tangents, in parts of mu: a unit vector."""
    if ratio == 1.0:
        return way[1], way[2]
    size = max(math.sqrt(way[1] * way[1] + ratio * ratio * way[2] * way[2]), 1e-300)
    return way[1] / size, ratio * ratio * way[2] / size


@compiled
def put_slip_against(s: ContactArrays, c: int, force: Floats, out: Floats) -> None:
    """Put the direction in which a contact begins to slip against friction at its limit."""
    put_across(s, c, force, -1.0, out)
    if s.ratio_s[c] != 1.0:
        out[2] /= s.ratio_s[c] * s.ratio_s[c]
    put_across(s, c, out, 1.0 / size_across(s, c, out), out)


@compiled
def put_matrix(s: ContactArrays, begins: bool) -> bool:
    """Rates by forces of closed contacts, along normals with sliding friction; False if one jams.

    begins: those that begin to slide, slide.
    """
    put_plain(s)
    for k in range(s.closed_count):
        c = s.closed[k]
        size = size_across(s, c, s.slip[c])
        if size > still_speed(s, c):
            put_across(s, c, s.slip[c], 1.0 / size, s.along[c])
            s.slides[c] = 1
        elif begins and s.begins[c] != 0:
            put_across(s, c, s.begin_way[c], 1.0, s.along[c])
            s.slides[c] = 1
    return add_sliding(s)


@compiled
def put_plain(s: ContactArrays) -> None:
    """Rates by forces of closed contacts, as if none slid."""
    for k in range(s.closed_count):
        c, u = s.closed[k], s.under[s.closed[k]]
        s.slides[c], s.cone.under[k] = 0, k
        for q in range(k if u >= 0 else 0):
            if s.closed[q] == u:
                s.cone.under[k] = q
        for i in range(3):
            row, from_row = s.cone.A[3 * k + i], s.W[3 * c + i]
            for q in range(s.closed_count):
                d = 3 * s.closed[q]
                row[3 * q], row[3 * q + 1] = from_row[d], from_row[d + 1]
                row[3 * q + 2] = from_row[d + 2]


@compiled
def pressing(s: ContactArrays, k: int) -> float:
    """What bounds friction of closed contact k: a normal force, or the load of a joint."""
    return s.cone.x[3 * s.cone.under[k]] + s.load[s.closed[k]]


@compiled
def add_sliding(s: ContactArrays) -> bool:
    """Add what friction of what slides does along with normal forces; False if one jams."""
    A = s.cone.A
    for k in range(s.closed_count):
        c = s.closed[k]
        if s.slides[c] != 0 and s.gapless[c] == 0.0:
            (first, second), u = against(s.ratio[c], s.along[c]), s.cone.under[k]
            for i in range(3 * s.closed_count):
                A[i, 3 * u] -= s.mu[c] * (A[i, 3 * k + 1] * first + A[i, 3 * k + 2] * second)
            if A[3 * u, 3 * u] <= 0.0 and s.alone[s.closed[u]] == 0:
                s.jams[s.closed[u]] = 1
                return False
    return True


@compiled
def put_open(s: ContactArrays) -> None:
    """Rates of closed contacts without their forces, with friction that is given: ``cone.b``.

    Of friction in joints those are zero that are rounding beside what it could do.
    """
    n, cone = 3 * s.closed_count, s.cone
    for k in range(n):
        cone.b[k] = s.free[3 * s.closed[k // 3] + k % 3]
    for k in range(s.closed_count):
        c = s.closed[k]
        for i in range(n if s.slides[c] != 0 else 0):
            row = cone.A[i][3 * k : 3 * k + 3]
            if s.gapless[c] > 0.0:
                way = s.along[c]
                along = row[0] * way[0] + row[1] * way[1] + row[2] * way[2]
                cone.b[i] -= s.load[c] * s.mu[c] * along
            elif s.alone[c] != 0:  # in its first column is what a load of one does
                cone.b[i] += s.load[c] * row[0]
    for k in range(s.closed_count):
        c = s.closed[k]
        # dependent rows, as of gears, could not hold it
        if s.alone[c] != 0 and s.load_count[c] == 0 and s.slides[c] == 0:
            least = CANCELLED * s.mu_s[c] * s.load[c]
            for i in range(3 * k, 3 * k + 3):
                cone.b[i] = cone.b[i] if abs(cone.b[i]) > least * cone.A[i, i] else 0.0


@compiled
def put_rates(s: ContactArrays) -> None:
    """Rates of closed contacts with their forces; then what slides has its friction, too."""
    n, cone = 3 * s.closed_count, s.cone
    for i in range(n):
        s.rates[i] = cone.b[i]
        for k in range(n):
            s.rates[i] += cone.A[i, k] * cone.x[k]
    for k in range(s.closed_count):
        if s.slides[s.closed[k]] != 0:
            put_sliding_force(s, k)


@compiled
def some_slide(s: ContactArrays) -> bool:
    """True if a closed contact slides against friction."""
    found = False
    for k in range(s.closed_count):
        c = s.closed[k]
        found |= s.slides[c] != 0 and s.alone[c] == 0 and s.mu[c] > 0.0
    return found


@compiled
def solve_forces(s: ContactArrays, part: float, sticks: bool) -> bool:
    """Forces of closed contacts into ``cone.x``, which is where it begins, and ``rates``.

    False where there are none.

    part: of the cones; contacts that are ``slipping`` have mu, not mu_s.
    sticks: friction of what presses holds, however large.
    """
    cone = s.cone
    cone.count = s.closed_count
    put_open(s)
    zero(cone.noise[: 3 * s.closed_count])
    for k in range(s.closed_count):
        c = s.closed[k]
        mu = s.mu[c] if s.slipping[c] != 0 else s.mu_s[c]
        cone.mu[k] = 0.0 if s.slides[c] != 0 else part * mu
        cone.more[k] = BOUNDLESS if sticks and s.alone[c] == 0 else s.load[c]
        cone.gapless[k], cone.ratio[k] = s.gapless[c], s.ratio_s[c]
    if solve_cone(cone) > UNSOLVED:
        for k in range(s.closed_count):
            s.jams[s.closed[k]] = 1
        return False
    put_rates(s)
    return True


@compiled
def put_sliding_force(s: ContactArrays, k: int) -> None:
    """Put friction of closed contact k, which slides, beside its normal force."""
    c, x = s.closed[k], s.cone.x[3 * k : 3 * k + 3]
    if s.gapless[c] > 0.0:
        for i in range(3):
            x[i] = -s.mu[c] * s.load[c] * s.along[c, i]
        return
    first, second = against(s.ratio[c], s.along[c])
    friction = s.mu[c] * pressing(s, k)
    x[1], x[2] = -friction * first, -friction * second


@compiled
def put_sizes(s: ContactArrays, all_hold: bool) -> float:
    """Sizes of accelerations of closed contacts, and the largest of them.

    all_hold: none is taken for one that slides.
    """
    found, beside, largest = 0, 0.0, 0.0
    for k in range(s.closed_count):
        c = s.closed[k]
        s.sizes[k] = own = max(abs(s.free[3 * c]), abs(s.free[3 * c + 1]), abs(s.free[3 * c + 2]))
        largest = max(largest, own)
        if all_hold or s.slides[c] == 0:  # what slides may turn far faster
            beside, found = max(beside, own), 1
    least = BESIDE * (beside if found != 0 else largest) + 1e-300
    for k in range(s.closed_count):
        s.sizes[k] = max(s.sizes[k], least)
        largest = max(largest, least)
    return largest


@compiled
def largest_entry(A: Floats, n: int) -> float:
    """The largest magnitude among the first n rows and columns."""
    found = 0.0
    for i in range(n):
        for k in range(n):
            found = max(found, abs(A[i, k]))
    return found


@compiled
def begin_to_move(s: ContactArrays, part: float, anew: bool) -> bool:
    """Forces of closed contacts, and accelerations that are zero where they are rounding.

    What begins to slip has mu, not mu_s, and then others may slip as well. False if they jam.
    anew: from zero, not from what is in ``cone.x``.
    """
    differs = False
    for k in range(s.closed_count):
        c = s.closed[k]
        s.slipping[c] = 0
        differs |= s.mu_s[c] > s.mu[c]
    while True:
        for k in range(3 * s.closed_count if anew else 0):
            s.cone.x[k] = 0.0
        if not solve_to_move(s, part):
            return False
        more = False
        for k in range(s.closed_count):
            c = s.closed[k]
            if size_across(s, c, s.rates[3 * k : 3 * k + 3]) > 0.0 and s.slipping[c] == 0:
                s.slipping[c], more = 1, True
        if not (more and differs):
            return True


@compiled
def solve_to_move(s: ContactArrays, part: float) -> bool:
    """As ``begin_to_move``, where it is known what is ``slipping``."""
    if not solve_forces(s, part, False):
        return False
    put_sizes(s, False)
    for k in range(s.closed_count):
        least = max(ZERO * s.sizes[k], CANCELLED * terms_of(s, k))
        clear_rounding(s, k, least, s.rates[3 * k : 3 * k + 3])
    return True


@compiled
def terms_of(s: ContactArrays, k: int) -> float:
    """The largest sum of the terms that forces add to a rate of closed contact k.

    Of bodies that fall beside each other these are all there is, where others hold one of them.
    """
    largest, n = 0.0, 3 * s.closed_count
    for i in range(3 * k, 3 * k + 3):
        total = 0.0
        for q in range(n):
            total += abs(s.cone.A[i, q] * s.cone.x[q])
        largest = max(largest, total)
    return largest


@compiled
def clear_rounding(s: ContactArrays, k: int, least: float, a: Floats) -> None:
    """Put zero for accelerations of closed contact k that are rounding.

    Less than a part of what friction alone could change is that as well.
    """
    c, row, stops = s.closed[k], 3 * s.closed[k], 0.0
    if s.alone[c] != 0:
        own = max(s.W[row, row], s.W[row + 1, row + 1], s.W[row + 2, row + 2])
        stops = ZERO * s.mu_s[c] * pressing(s, k) * own
    across = size_across(s, c, a) > max(least, stops)
    if s.gapless[c] == 0.0:
        a[0] = a[0] if abs(a[0]) > least else 0.0
    elif not across:
        a[0] = 0.0
    if not across:
        a[1] = a[2] = 0.0
