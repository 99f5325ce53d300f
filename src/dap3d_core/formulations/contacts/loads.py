"""Modes of contacts whose friction joints load: found by loads that they give themselves."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math

from dap3d_core.formulations.contacts.contact_arrays import ContactArrays
from dap3d_core.formulations.contacts.forces import size_across, still_speed
from dap3d_core.formulations.contacts.modes import clear_mode, next_group, put_closed, put_modes
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.least_squares import factor_least, solve_least

#: Passes for the loads of joints, the part that the last one changes, and a load that holds all.
PASSES, SETTLED, LARGE = 60, 1e-12, 1e200
#: From this pass on loads have settled where rounding is left, of chains of many joints this part.
LATE_PASS, NOISE = 15, 1e-8
#: Part of the longest column below which changes of loads depend on each other.
DEPENDENT = 1e-10


@compiled
def find_modes(s: ContactArrays) -> bool:
    """The modes of all contacts, from those that are ``touching``; False if ``jams`` do."""
    put_closed(s)
    while next_group(s):
        s.mine_count = 0
        for k in range(s.group_count):
            if s.load_count[s.group[k]] > 0:
                s.mine[s.mine_count] = s.group[k]
                s.mine_count += 1
        if s.mine_count > 0:
            if not put_loaded(s):
                return False
        elif not put_modes(s):
            return False
    return True


@compiled
def put_loaded(s: ContactArrays) -> bool:
    """The modes of the group, with friction of joints.

    What may stick is held at first, however large its load: friction that raises its own load by
    more than itself holds. Then each pass takes the loads of the one before, extrapolated from
    those of as many passes as there are loads.
    """
    count, all_slide = s.mine_count, True
    for k in range(s.group_count):
        clear_mode(s, s.group[k])
    put_loads(s, s.loads)
    for k in range(count):
        c = s.mine[k]
        if not (s.begins[c] != 0 or size_across(s, c, s.slip[c]) > still_speed(s, c)):
            s.loads[k], all_slide = LARGE, False
    kept = 0
    for step in range(PASSES):
        for k in range(count):
            s.load[s.mine[k]] = s.loads[k]
        for k in range(s.group_count):
            clear_mode(s, s.group[k])
        if not put_modes(s):
            return False
        put_loads(s, s.given)
        rest = largest = 0.0
        for k in range(count):
            rest = max(rest, abs(s.given[k] - s.loads[k]))
            largest = max(largest, s.given[k], s.loads[k])
        if rest <= (SETTLED if step < LATE_PASS else NOISE) * largest:
            return True
        if step == 0 and not all_slide:
            for k in range(count):
                s.loads[k] = s.given[k] if s.loads[k] == LARGE else s.loads[k]
            continue
        kept = remember(s, kept)
        extrapolate(s, kept)
    worst = 0
    for k in range(count):
        if abs(s.given[k] - s.loads[k]) > abs(s.given[worst] - s.loads[worst]):
            worst = k
    s.jams[s.mine[worst]] = 1
    return False


@compiled
def put_loads(s: ContactArrays, loads: Floats) -> None:
    """Loads of the group's friction where its contacts have the forces found."""
    for k in range(s.mine_count):
        c = s.mine[k]
        total = 0.0
        for row in range(s.load_row[c], s.load_row[c] + s.load_count[c]):
            lam = s.lam_free[row]
            for q in range(s.group_count):
                d = s.group[q]
                for i in range(3):
                    lam += s.reaction[row, 3 * d + i] * s.force[d, i]
            total += lam * lam if s.load_pushes[c] == 0 or lam > 0.0 else 0.0
        loads[k] = math.sqrt(total)


@compiled
def remember(s: ContactArrays, kept: int) -> int:
    """Keep the loads of a pass, and what they missed, behind those before; how many there are."""
    count = s.mine_count
    if kept > count:
        for q in range(kept - 1):
            for k in range(count):
                s.taken[q, k], s.rests[q, k] = s.taken[q + 1, k], s.rests[q + 1, k]
        kept -= 1
    for k in range(count):
        s.taken[kept, k], s.rests[kept, k] = s.loads[k], s.given[k] - s.loads[k]
    return kept + 1


@compiled
def extrapolate(s: ContactArrays, kept: int) -> None:
    """Loads of the next pass, from those kept (Anderson, J. ACM 12 (1965) 547)."""
    count, steps = s.mine_count, kept - 1
    for k in range(count):
        s.x[k] = s.rests[kept - 1, k]
        for q in range(steps):
            s.B[k, q] = s.rests[q + 1, k] - s.rests[q, k]
    rank = factor_least(s.B, count, steps, DEPENDENT, 0.0, s.w, s.order)
    solve_least(s.B, count, steps, rank, s.w, s.order, s.x, s.inner)
    for k in range(count):
        found = s.given[k]
        for q in range(steps):
            moved = s.taken[q + 1, k] - s.taken[q, k] + s.rests[q + 1, k] - s.rests[q, k]
            found -= moved * s.inner[q]
        s.loads[k] = max(found, 0.0)
