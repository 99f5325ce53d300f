"""The rounds of a jump, compiled (law.py says what they do)."""

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import IMPULSE, KNOT, RESET, SWITCH, System, velocity_offset
from dap3d_core.assembly.evaluate import call_kinds, copy, place, zero
from dap3d_core.assembly.metric import put_scaled
from dap3d_core.formulations.jumps import jump_arrays as at
from dap3d_core.formulations.jumps.held_joints import FACTOR, SOLVE
from dap3d_core.formulations.jumps.jump_arrays import JumpArrays
from dap3d_core.formulations.jumps.multipliers import find_impulses, missed_row
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled

#: A change of a rate is rounding below this part of what the velocities of its bodies make of it.
RATE_ROUNDING = 1e-13


@compiled
def jump(
    t: float, j: JumpArrays, system: System, loops: Any, of_held: Any, held: System, held_loops: Any
) -> None:
    """The jump at time t and state ``j.y``, which becomes that after it.

    Args:
        t, j: time; state, sides, crossings and rows that are given.
        system, loops: of the elements.
        of_held, held, held_loops: functions of held_joints.py, and what they work on: the same, or
            those of a formulation in coordinates of bodies.
    """
    begin(t, j, system, loops, of_held, held, held_loops)
    is_over = 0
    while (is_over == 0) & (j.rounds < j.most_rounds) & (j.missed == -1):
        asks = find_rows(t, j, system, loops)
        moves = 0
        if (asks != 0) | ((j.follows != 0) & (j.rounds == 0)):
            moves = meet(j, of_held, held, held_loops)
        place(t, j.y, system, loops)
        moves |= reset(t, j, system, loops, of_held, held, held_loops)
        is_over = 1 - (moves | crossings_behind(t, j, system, loops))
    if (is_over == 0) & (j.missed == -1):
        stop(t, j, system, loops, of_held, held, held_loops)
    j.y[-1] += j.work


@compiled
def begin(
    t: float, j: JumpArrays, system: System, loops: Any, of_held: Any, held: System, held_loops: Any
) -> None:
    """Factors, velocities and switches at the state before."""
    j.work = j.exchanged = 0.0
    j.rounds, j.missed = 0, -1
    for k in range(j.acting.shape[0]):
        j.acting[k] = 0
    for k in range(j.is_touched.shape[0]):
        j.is_touched[k] = 0
    hold(t, j, of_held, held, held_loops)
    place(t, j.y, system, loops)
    for b in range(1, system.body.shape[0]):
        for k in range(6):
            v = system.body[b, 12 + k]
            j.v[at.NOW, 6 * b - 6 + k] = j.v[at.BEFORE, 6 * b - 6 + k] = v
            j.v[at.FASTEST, 6 * b - 6 + k] = abs(v)
    evaluate_switches(t, j, system, loops)
    if j.has_sides == 0:
        for k in range(j.switches.shape[1]):
            j.switches[at.SIDE, k] = np.sign(j.switches[at.VALUE, k])


@compiled
def hold(t: float, j: JumpArrays, of_held: Any, held: System, held_loops: Any) -> None:
    """Factors of the joints at the state; what is off their velocities waits to be taken away."""
    factor = of_held[FACTOR]
    factor(t, j.y, j.solution, held, held_loops)
    copy(j.residual, held.residual)
    copy(j.nu, held.nu)


@compiled
def evaluate_switches(t: float, j: JumpArrays, system: System, loops: Any) -> None:
    """All switches of the model, bodies being placed."""
    zero(j.counts)
    call_kinds(SWITCH, KNOT, t, system, loops, j.switches[at.VALUE], j.counts, j.counts)


@compiled
def crossings_behind(t: float, j: JumpArrays, system: System, loops: Any) -> int:
    """Switches that are on another side since this round; whether there are any."""
    s, found = j.switches, 0
    evaluate_switches(t, j, system, loops)
    for k in range(s.shape[1]):
        s[at.CROSSING, k] = 0.0
        if (j.jumps[k] != 0) & (s[at.VALUE, k] * s[at.SIDE, k] < 0.0):
            s[at.CROSSING, k] = s[at.SIDE, k] = np.sign(s[at.VALUE, k])
            found = 1
    return found


@compiled
def has_crossed(j: JumpArrays, first: int, count: int) -> int:
    """Whether one of some switches of an element has just changed its sign."""
    found = 0
    for k in range(first, first + count):
        found |= j.switches[at.CROSSING, j.of_switch[k]] != 0.0
    return found


@compiled
def find_rows(t: float, j: JumpArrays, system: System, loops: Any) -> int:
    """Impulses P, and the rows that are to jump; whether there are any."""
    for k in range(j.order.shape[0]):
        j.of_loop[k] = j.switches[at.CROSSING, j.order[k]]
    zero(j.numbers)
    zero(j.counts)
    zero(j.P)
    call_kinds(IMPULSE, IMPULSE, t, system, loops, j.numbers, j.counts, j.of_loop)
    asks = 0
    for k in range(j.kicks.shape[0]):
        asks |= kick(j, k)
    zero(j.P[:6])
    j.row_count = 0
    for k in range(j.rows.shape[0]):
        change = j.numbers[j.rows[k, at.CHANGE]]
        if change != 0.0:
            fill_row(j, k, j.G[j.row_count], change)
            if takes_part(j, k, j.G[j.row_count]):
                add_row(j, k, j.rows[k, at.PUSHES])
    if j.rounds == 0:
        for k in range(j.given_count):
            copy(j.G[j.row_count], j.given[k])
            j.which[j.row_count], j.pushes[j.row_count] = -1, 0
            j.row_count += 1
    return asks | (j.row_count > 0)


@compiled
def kick(j: JumpArrays, k: int) -> int:
    """Add the impulses of an element that has crossed; whether it has some."""
    row, found = j.kicks[k], 0
    if has_crossed(j, row[at.KICK_SWITCH], row[at.KICK_SWITCHES]) == 0:
        return 0
    for n in range(6 * row[at.KICK_SLOTS]):
        found |= j.numbers[row[at.KICK] + n] != 0.0
    if found != 0:
        j.acting[row[at.KICK_ELEMENT]] = 1
        for n in range(6 * row[at.KICK_SLOTS]):
            body = j.bodies[row[at.KICK_BODY] + n // 6]
            j.P[6 * body + n % 6] += j.numbers[row[at.KICK] + n]
    return found


@compiled
def fill_row(j: JumpArrays, k: int, G: Floats, change: float) -> None:
    """A row of an element in global axes, and its change."""
    row = j.rows[k]
    zero(G)
    for n in range(row[at.SLOTS]):
        body, entry = j.bodies[row[at.BODY] + n], row[at.ENTRY] + n * row[at.STEP]
        if body > 0:
            for c in range(6):
                G[6 * body + c] += j.numbers[entry + c]
    G[j.P.shape[0]] = change


@compiled
def takes_part(j: JumpArrays, k: int, G: Floats) -> bool:
    """True if a row crosses, is closed, or closes soon."""
    row, s, near = j.rows[k], j.switches, 0
    if row[at.OWN] >= 0:
        rate = 0.0
        for c in range(6, j.P.shape[0]):
            rate += G[c] * j.v[at.NOW, c - 6]
        near |= s[at.VALUE, row[at.OWN]] <= -j.soon * rate
    for n in range(row[at.SWITCH], row[at.SWITCH] + row[at.SWITCHES]):
        q = j.of_switch[n]
        is_near = (s[at.CROSSING, q] != 0.0) | (s[at.VALUE, q] <= 0.0) | (s[at.SIDE, q] == 0.0)
        near |= is_near & ((row[at.OWN] < 0) | (row[at.OWN] == q))
    return near != 0


@compiled
def add_row(j: JumpArrays, k: int, pushes: int) -> None:
    """Keep the row of the round that was filled last, if its change is no rounding."""
    q, size = j.row_count, 0.0
    for c in range(6, j.P.shape[0]):
        size += abs(j.G[q, c]) * j.v[at.FASTEST, c - 6]
    if abs(j.G[q, j.P.shape[0]]) > RATE_ROUNDING * size:
        j.which[q], j.pushes[q] = k, pushes
        j.row_count = q + 1


@compiled
def meet(j: JumpArrays, of_held: Any, held: System, held_loops: Any) -> int:
    """Let P act and the rows change their rates as they ask for; whether velocities change."""
    m, size, solve = j.row_count, j.P.shape[0], of_held[SOLVE]
    unit_rows(j, of_held, held, held_loops)
    scale(held, j.P, j.solution)
    for k in range(j.residual.shape[0]):
        j.solution[size + k] = -j.residual[k]
    solve(0.0, j.y, j.solution, held, held_loops)
    for q in range(m):
        part = 0.0
        for c in range(size):
            part += j.scaled[q, c] * j.solution[c]
        j.Lam[0, q] = j.G[q, size] / j.length[q] - part
    find_impulses(m, j.A, j.Lam, j.pushes, j.acts, j.space)
    missed = missed_row(m, j.A, j.Lam, j.pushes)
    if missed >= 0:
        j.missed = j.rows[j.which[missed], at.ELEMENT] if j.which[missed] >= 0 else -2
        return 0
    for q in range(m):
        for c in range(size):
            j.solution[c] += j.Lam[1, q] * j.x[q, c]
        for k in range(j.residual.shape[0]):
            j.solution[size + k] += j.Lam[1, q] * j.held[q, k]
    return take(j, held)


@compiled
def unit_rows(j: JumpArrays, of_held: Any, held: System, held_loops: Any) -> None:
    """Rows of unit length, what their impulses change, and A."""
    m, size, solve = j.row_count, j.P.shape[0], of_held[SOLVE]
    for q in range(m):
        scale(held, j.G[q], j.scaled[q])
        length = 0.0
        for c in range(size):
            length += j.scaled[q, c] * j.scaled[q, c]
        length = np.sqrt(length)
        j.length[q] = length = length if length > 0.0 else 1.0
        for c in range(size):
            j.scaled[q, c] /= length
        copy(j.solution[:size], j.scaled[q])
        zero(j.solution[size:])
        solve(0.0, j.y, j.solution, held, held_loops)
        copy(j.x[q], j.solution[:size])
        copy(j.held[q], j.solution[size:])
    for q in range(m):
        for r in range(q + 1):
            part = 0.0
            for c in range(size):
                part += 0.5 * (j.scaled[q, c] * j.x[r, c] + j.scaled[r, c] * j.x[q, c])
            j.A[q, r] = j.A[r, q] = part


@compiled
def scale(held: System, G: Floats, out: Floats) -> None:
    """Scaled impulses or rows of those in global axes: G M^(-1/2)."""
    for b in range(held.metric.shape[0]):
        put_scaled(held.metric[b], G, 6 * b, out)


@compiled
def take(j: JumpArrays, held: System) -> int:
    """Velocities and work after the scaled changes of ``solution``; whether velocities change."""
    size, changes, v = j.P.shape[0], 0, j.v
    first = velocity_offset(1, held.metric.shape[0] - 1)
    for b in range(1, held.metric.shape[0]):
        m, s, x, o = held.metric[b], held.body[b], j.solution[6 * b : 6 * b + 6], 6 * b - 6
        for c in range(3):
            linear = m[0] * x[c]
            turning = m[7 + 3 * c] * x[3] + m[8 + 3 * c] * x[4] + m[9 + 3 * c] * x[5]
            v[at.OLD, o + c], v[at.OLD, o + 3 + c] = v[at.NOW, o + c], v[at.NOW, o + 3 + c]
            v[at.NOW, o + c] += linear
            v[at.NOW, o + 3 + c] += turning
            j.y[first + o + c] += linear
            for i in range(3):
                j.y[first + o + 3 + i] += s[3 + 3 * c + i] * turning
            changes |= (linear != 0.0) | (turning != 0.0)
    work, exchanged = 0.0, 0.0
    for c in range(size - 6):
        mean = 0.5 * (v[at.OLD, c] + v[at.NOW, c])
        work += j.P[c + 6] * mean
        exchanged += abs(j.P[c + 6] * mean)
        v[at.FASTEST, c] = max(v[at.FASTEST, c], abs(v[at.NOW, c]))
    for q in range(j.row_count):
        Lam, before, after = j.Lam[1, q] / j.length[q], 0.0, 0.0
        for c in range(size - 6):
            before += j.G[q, c + 6] * v[at.OLD, c]
            after += j.G[q, c + 6] * v[at.NOW, c]
        work += 0.5 * Lam * (before + after)
        exchanged += 0.5 * abs(Lam) * (abs(before) + abs(after))
        remember(j, q, Lam)
    for k in range(j.residual.shape[0]):
        work -= j.solution[size + k] * (j.nu[k] + 0.5 * j.residual[k])
        j.residual[k] = 0.0
    j.work += work
    j.exchanged += exchanged
    j.rounds += 1
    return changes


@compiled
def remember(j: JumpArrays, q: int, Lam: float) -> None:
    """Take note of a row that has taken part."""
    k = j.which[q]
    if (k >= 0) & (Lam != 0.0):
        j.acting[j.rows[k, at.ELEMENT]] = 1
    if (k >= 0) & (j.pushes[q] != 0):
        j.is_touched[k] = 1
        copy(j.touched[k], j.G[q])


@compiled
def reset(
    t: float, j: JumpArrays, system: System, loops: Any, of_held: Any, held: System, held_loops: Any
) -> int:
    """States that elements reset, and velocities that follow the joints; whether these change."""
    count, found = system.states.shape[0], 0
    first = j.y.shape[0] - 1 - count
    for k in range(j.resets.shape[0]):
        found |= has_crossed(j, j.resets[k, at.RESET_SWITCH], j.resets[k, at.RESET_SWITCHES])
    if found == 0:
        return 0
    for k in range(j.reset_order.shape[0]):
        j.of_loop[k] = j.switches[at.CROSSING, j.reset_order[k]]
    for k in range(count):
        j.numbers[k] = j.y[first + k]
    zero(j.counts)
    call_kinds(RESET, RESET, t, system, loops, j.numbers, j.counts, j.of_loop)
    for k in range(j.resets.shape[0]):
        row = j.resets[k]
        if has_crossed(j, row[at.RESET_SWITCH], row[at.RESET_SWITCHES]) != 0:
            j.acting[row[at.RESET_ELEMENT]] = 1
            for n in range(row[at.RESET_STATE], row[at.RESET_STATE] + row[at.RESET_STATES]):
                j.y[first + n] = j.numbers[n]
    hold(t, j, of_held, held, held_loops)
    zero(j.P)
    j.row_count = 0
    found = meet(j, of_held, held, held_loops)
    place(t, j.y, system, loops)
    return found


@compiled
def stop(
    t: float, j: JumpArrays, system: System, loops: Any, of_held: Any, held: System, held_loops: Any
) -> None:
    """Stop what still approaches, of all rows that push and have answered."""
    size, found = j.P.shape[0], 0
    zero(j.P)
    for k in range(j.is_touched.shape[0]):
        if j.is_touched[k] != 0:
            change = 0.0
            for c in range(size):
                j.G[found, c] = j.touched[k, c]
                if c >= 6:
                    change -= j.touched[k, c] * j.v[at.NOW, c - 6]
            j.G[found, size], j.which[found], j.pushes[found] = change, k, 1
            found += 1
    j.row_count = found
    if found > 0:
        meet(j, of_held, held, held_loops)
        place(t, j.y, system, loops)
