"""Rows of all contacts at an instant, as if they stuck, and what impulses in them change.

In the scaled coordinates of the bodies (docs/decisions/0006): A are the rows of the joints there,
each of unit length, A^+ its pseudo-inverse. Impulses along a row g change velocities by
g - A^+ A g with the joints held, and multipliers by -(A^+)^T g: where rows depend on each other the
least ones.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math
from typing import Any

from dap3d_core.assembly.arrays import ACCELERATION, System, velocity_offset
from dap3d_core.assembly.evaluate import call_kinds, copy, place, zero
from dap3d_core.assembly.metric import in_body_axes, put_scaled
from dap3d_core.formulations import REPORT
from dap3d_core.formulations.contacts.contact_arrays import ContactArrays
from dap3d_core.formulations.contacts.equations import BODY_I, BODY_J, OF_CONTACT
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.runtime.loop_support import JP, MASS
from dap3d_core.linear.least_squares import factor_least, solve_least

#: Part of the longest column of A below which rows of joints depend on each other.
DEPENDENT = 1e-6
#: Part of the largest normal mobility below which normals depend on each other.
DEPENDENT_NORMALS = 1e-12
#: Of a change of velocity this part is rounding; velocities that are set are met to this part.
CANCELLED, HELD = 1e-15, 1e-9
#: Part of the terms of an acceleration that is rounding of it.
RATE_ROUNDING = 1e-14
#: Part of the mobilities of both, or of a joint, by which a contact feels a force.
FELT = 1e-14


@compiled
def put_rows(t: float, s: ContactArrays, system: System, loops: Any) -> None:
    """Rows, velocities and mobilities of the bodies as placed."""
    let_stick(s, system)
    call_kinds(ACCELERATION, ACCELERATION, t, system, loops, system.D, system.gamma, system.nu)
    put_jacobian(s, system)
    put_answers(s)
    put_moves(s, system)
    put_driven(s, system)
    put_frames(s)
    for b in range(1, system.body.shape[0]):
        for k in range(6):
            s.v[6 * b - 6 + k] = s.v_before[6 * b - 6 + k] = system.body[b, 12 + k]
            s.push[6 * b - 6 + k] = 0.0
    put_slip(s, system)


@compiled
def let_stick(s: ContactArrays, system: System) -> None:
    """States of elements as if all contacts stuck."""
    for c in range(s.state.shape[0]):
        first = s.state[c]
        system.states[first] = 2.0
        zero(system.states[first + 1 : first + OF_CONTACT])


@compiled
def put_jacobian(s: ContactArrays, system: System) -> None:
    """Rows of the model, along global axes and scaled; of contacts that turn on their arms."""
    blocks, own = system.blocks, s.lam_free.shape[0]
    for r in range(s.J.shape[0]):
        zero(s.J[r])
        zero(s.scaled[r])
    for q in range(blocks.shape[0]):
        first, b = blocks[q, 0], blocks[q, 1]
        k, o = system.metric[b], 6 * b - 6
        for r in range(blocks[q, 2]):
            place = s.model_row[blocks[q, 3] + r]
            from_row, row, scaled = system.D[first + 6 * r :], s.J[place], s.scaled[place]
            arm = s.arm[(place - own) // 3] if place >= own else 1.0
            for i in range(6):
                row[o + i] = arm * from_row[i]
            put_scaled(k, row, o, scaled)


@compiled
def put_answers(s: ContactArrays) -> None:
    """The columns of A^+, and 1 over the lengths of the joints' rows."""
    own, n = s.lam_free.shape[0], s.v.shape[0]
    for r in range(own):
        square, row, unit = 0.0, s.scaled[r], s.K[r]
        for k in range(n):
            square += row[k] * row[k]
        s.unit[r] = 1.0 / math.sqrt(square) if square > 0.0 else 1.0
        for k in range(n):
            unit[k] = s.unit[r] * row[k]
    if own > 0:
        rank = factor_least(s.K, own, n, DEPENDENT, 0.0, s.w, s.order)
        for r in range(own):
            zero(s.right)
            s.right[r] = 1.0
            solve_least(s.K, own, n, rank, s.w, s.order, s.right, s.answers[r])


@compiled
def along_bodies(c: int, row: Floats, other: Floats, system: System) -> float:
    """The product of a row of contact c with another."""
    total = 0.0
    for side in range(BODY_I, BODY_J + 1):
        o = 6 * system.contacts[c, side] - 6
        for k in range(o, o + 6 if o >= 0 else o):
            total += row[k] * other[k]
    return total


@compiled
def size_along_bodies(c: int, row: Floats, other: Floats, system: System) -> float:
    """The sum of the magnitudes of the terms of ``along_bodies``."""
    total = 0.0
    for side in range(BODY_I, BODY_J + 1):
        o = 6 * system.contacts[c, side] - 6
        for k in range(o, o + 6 if o >= 0 else o):
            total += abs(row[k] * other[k])
    return total


@compiled
def put_moves(s: ContactArrays, system: System) -> None:
    """Changes of scaled velocities and multipliers by unit impulses, and W."""
    own, n = s.lam_free.shape[0], s.v.shape[0]
    for i in range(s.free.shape[0]):
        row, moves = s.scaled[own + i], s.moves[i]
        copy(moves, row)
        for r in range(own):
            part = s.unit[r] * along_bodies(i // 3, row, s.scaled[r], system)
            answer = s.answers[r]
            for k in range(n if part != 0.0 else 0):
                moves[k] -= part * answer[k]
            s.reaction[r, i] = -s.unit[r] * along_bodies(i // 3, row, answer, system)
    for i in range(s.free.shape[0]):
        row = s.scaled[own + i]
        for k in range(i + 1):
            s.W[i, k] = s.W[k, i] = along_bodies(i // 3, row, s.moves[k], system)


@compiled
def put_driven(s: ContactArrays, system: System) -> None:
    """Velocity at each contact of the motion of least energy that the drivers prescribe."""
    own = s.lam_free.shape[0]
    zero(s.push)
    for r in range(own):
        add_scaled(s.unit[r] * system.nu[system.row[r]], s.answers[r], s.push)
    for i in range(s.free.shape[0]):
        s.driven[i // 3, i % 3] = along_bodies(i // 3, s.scaled[own + i], s.push, system)


@compiled
def add_scaled(part: float, row: Floats, out: Floats) -> None:
    """Add a part of a row."""
    for k in range(out.shape[0] if part != 0.0 else 0):
        out[k] += part * row[k]


@compiled
def put_frames(s: ContactArrays) -> None:
    """Normal and tangents of each contact, or the axis of a moment; global axes."""
    own = s.lam_free.shape[0]
    for c in range(s.state.shape[0]):
        o, sign, turns = 6 * s.frame_body[c] - 6, s.frame_sign[c] / s.arm[c], s.turns[c]
        for i in range(3):
            row = s.J[own + 3 * c + i]
            for k in range(3):
                s.frames[c, i, k] = sign * (row[o + k] + row[o + 3 + k] * turns)


@compiled
def put_feels(s: ContactArrays) -> None:
    """Which contacts change slip or load of each other by their forces."""
    m, n, size = s.state.shape[0], s.free.shape[0], s.x
    for i in range(n):
        size[i] = math.sqrt(max(s.W[i, i], 0.0))
    for c in range(m):
        for d in range(m):
            s.feels[c, d] = 0
    for i in range(n):
        for k in range(n):
            if abs(s.W[i, k]) > FELT * size[i] * size[k]:
                s.feels[i // 3, k // 3] = 1
    for c in range(m):
        if s.under[c] >= 0:
            s.feels[c, s.under[c]] = s.feels[s.under[c], c] = 1
        for r in range(s.load_row[c], s.load_row[c] + s.load_count[c]):
            for k in range(n):
                if abs(s.reaction[r, k]) > FELT * size[k] * s.unit[r]:
                    s.feels[c, k // 3] = s.feels[k // 3, c] = 1


@compiled
def put_slip(s: ContactArrays, system: System) -> None:
    """Velocity at each contact, in its frame, and rates of gaps, zero where there is none."""
    own = s.lam_free.shape[0]
    for i in range(s.free.shape[0]):
        s.slip[i // 3, i % 3] = along_bodies(i // 3, s.J[own + i], s.v, system)
    for c in range(s.state.shape[0]):
        s.closing[c] = 0.0 if s.gapless[c] > 0.0 else s.slip[c, 0]
    s.is_free = 0


@compiled
def put_velocities(s: ContactArrays, system: System) -> None:
    """The state with the present velocities, into ``placed``; bodies are placed as in ``y``."""
    y, n = s.placed, system.body.shape[0] - 1
    copy(y, s.y)
    for b in range(1, n + 1):
        o, f = 6 * b - 6, velocity_offset(b, n)
        y[f], y[f + 1], y[f + 2] = s.v[o], s.v[o + 1], s.v[o + 2]
        w = in_body_axes(system.body[b], s.v[o + 3], s.v[o + 4], s.v[o + 5])
        y[f + 3], y[f + 4], y[f + 5] = w


@compiled
def put_free(t: float, s: ContactArrays, system: System, loops: Any, functions: Any) -> None:
    """Rates of slip at the present velocities where all contacts are open, and multipliers."""
    if s.is_free != 0:
        return
    y, out, report = s.placed, s.report, functions[REPORT]
    put_velocities(s, system)
    first = y.shape[0] - 1 - system.states.shape[0]
    for c in range(s.state.shape[0]):
        y[first + s.state[c]] = 0.0
    report(t, y, out, system, loops)
    own, n = s.lam_free.shape[0], s.v.shape[0]
    for r in range(own):
        s.lam_free[r] = out[n + r]
    let_stick(s, system)
    call_kinds(ACCELERATION, ACCELERATION, t, system, loops, system.D, system.gamma, system.nu)
    for i in range(s.free.shape[0]):
        rate = along_bodies(i // 3, s.J[own + i], out, system)
        bent = s.arm[i // 3] * system.gamma[system.row[own + i]]
        s.free[i] = rate - bent
        if i % 3 == 0:
            terms = size_along_bodies(i // 3, s.J[own + i], out, system) + abs(bent)
            for r in range(own):  # a body that joints hold has forces that cancel
                by_row = along_bodies(i // 3, s.scaled[own + i], s.scaled[r], system)
                terms += abs(by_row * s.lam_free[r])
            if abs(s.free[i]) <= RATE_ROUNDING * terms:
                s.free[i] = 0.0  # what falls together does not press
    s.is_free = 1


@compiled
def kick(s: ContactArrays, system: System) -> None:
    """Let impulses x of the contacts that are ``touching`` act."""
    for k in range(s.touching_count):
        for i in range(3):
            add_scaled(s.x[3 * k + i], s.moves[3 * s.touching[k] + i], s.push)
    change(s, system)


@compiled
def change(s: ContactArrays, system: System) -> None:
    """Change velocities by ``push``, which is zero then; of what cancels no rounding is left."""
    unscale(s, system)
    for k in range(s.v.shape[0]):
        s.v[k] += s.push[k]
        if abs(s.v[k]) <= CANCELLED * abs(s.push[k]):
            s.v[k] = 0.0
        s.push[k] = 0.0
    put_slip(s, system)


@compiled
def unscale(s: ContactArrays, system: System) -> None:
    """Let ``push`` be velocities, or small r and rotation vectors, of what is scaled."""
    for b in range(1, system.body.shape[0]):
        m, x = system.metric[b], s.push[6 * b - 6 : 6 * b]
        u0, u1, u2 = x[3], x[4], x[5]
        for i in range(3):
            x[i] = m[0] * x[i]
            x[3 + i] = m[7 + 3 * i] * u0 + m[8 + 3 * i] * u1 + m[9 + 3 * i] * u2


@compiled
def lift(s: ContactArrays) -> int:
    """Put into ``push`` the least change, with the joints held, that lifts contacts.

    It brings ``values``, gaps or their rates, to zero where ``role`` is 1, and lets none be less
    than ``least`` where it is 2. Returns how many are ``active``, by impulses ``inner``.
    """
    count, more = 0, True
    for c in range(s.state.shape[0]):
        s.is_active[c] = 0
        if s.role[c] == 1 and s.gapless[c] == 0.0:
            s.is_active[c], s.active[count] = 1, c
            count += 1
    while more:
        for k in range(count):
            s.right[k] = -s.values[s.active[k]]
            for q in range(count):
                s.B[k, q] = s.W[3 * s.active[k], 3 * s.active[q]]
        rank = factor_least(s.B, count, count, DEPENDENT_NORMALS, 0.0, s.w, s.order)
        solve_least(s.B, count, count, rank, s.w, s.order, s.right, s.inner)
        found, more = count, False
        for c in range(s.state.shape[0]):
            if s.role[c] == 2 and s.is_active[c] == 0:
                moved = s.values[c]
                for k in range(found):
                    moved += s.W[3 * c, 3 * s.active[k]] * s.inner[k]
                if moved < s.least[c]:
                    s.is_active[c], s.active[count], more = 1, c, True
                    count += 1
    for k in range(count):
        add_scaled(s.inner[k], s.moves[3 * s.active[k]], s.push)
    return count


@compiled
def follow_joints(t: float, s: ContactArrays, system: System, loops: Any) -> None:
    """Rows at the state ``y``, and velocities there onto the joints, by impulses in them."""
    place(t, s.y, system, loops)
    put_rows(t, s, system, loops)
    for r in range(s.lam_free.shape[0]):
        rest = system.nu[system.row[r]]
        for k in range(s.v.shape[0]):
            rest -= s.J[r, k] * s.v[k]
        add_scaled(s.unit[r] * rest, s.answers[r], s.push)
    change(s, system)


@compiled
def follow_drivers(t: float, s: ContactArrays, system: System, loops: Any) -> None:
    """Make velocities of the state ``y`` those that joints and drivers ask for."""
    follow_joints(t, s, system, loops)
    keep_velocities(s, system)


@compiled
def keep_velocities(s: ContactArrays, system: System) -> None:
    """Make present velocities those of the state ``y``; what that takes is work, ``taken_work``."""
    s.taken_work = 0.0
    for b in range(1, system.body.shape[0]):
        s.taken_work += put_velocity(b, s, system)
        zero(s.moved[6 * b - 6 : 6 * b])
    s.y[s.y.shape[0] - 1] += s.taken_work


@compiled
def put_velocity(b: int, s: ContactArrays, system: System) -> float:
    """Change the velocity of a body in the state ``y`` as that of now; kinetic energy it takes."""
    y, x, o, f = s.y, system.body[b], 6 * b - 6, velocity_offset(b, system.body.shape[0] - 1)
    turning, energy = s.direction, 0.0
    turning[0], turning[1], turning[2] = in_body_axes(x, s.v[o + 3] - s.v_before[o + 3],
                                                      s.v[o + 4] - s.v_before[o + 4],
                                                      s.v[o + 5] - s.v_before[o + 5])  # fmt: skip
    for k in range(3):
        dv = s.v[o + k] - s.v_before[o + k]
        energy += x[MASS] * dv * (y[f + k] + 0.5 * dv)
        for i in range(3):
            mean = y[f + 3 + i] + 0.5 * turning[i]
            energy += turning[k] * x[JP + 3 * k + i] * mean
        y[f + k] += dv
    for k in range(3):
        y[f + 3 + k] += turning[k]
    return energy


@compiled
def meet(s: ContactArrays, given: Floats, moves: Floats, A: Floats, system: System) -> bool:
    """Bring rows to what they are given, with velocities that joints allow.

    Args:
        s: with rows that are put.
        given: (k, 6 n + 1) rows, global axes, and behind each the change of its rate.
        moves: (k, 6 n) scratch. A: (k, k + 1) scratch, sizes of the rows last.
        system: of the model.

    Returns:
        False where joints hold what a row is to change.
    """
    n, m = s.v.shape[0], given.shape[0]
    for q in range(m):
        for k in range(n):
            given[q, n] += given[q, k] * s.v_before[k]
    for q in range(m):
        A[q, m] = put_held(s, given[q], moves[q], system)
    for q in range(m):
        rest = given[q, n]
        for k in range(n):
            rest -= given[q, k] * s.v[k]
        s.right[q] = rest / A[q, m]
        for p in range(m):
            A[q, p] = 0.0
            for k in range(n):
                A[q, p] += moves[q, k] * moves[p, k]
    rank = factor_least(A, m, m, DEPENDENT_NORMALS, 0.0, s.w, s.order)
    solve_least(A, m, m, rank, s.w, s.order, s.right, s.inner)
    for q in range(m):
        add_scaled(s.inner[q], moves[q], s.push)
    change(s, system)
    missed, size = 0.0, 1.0
    for q in range(m):
        rest = given[q, n]
        size = max(size, abs(rest))
        for k in range(n):
            rest -= given[q, k] * s.v[k]
        missed = max(missed, abs(rest))
    return missed <= HELD * size


@compiled
def put_held(s: ContactArrays, row: Floats, out: Floats, system: System) -> float:
    """A row along global axes, of unit length, less what the joints hold of it; its length."""
    square = 0.0
    for b in range(1, system.body.shape[0]):
        o = 6 * b - 6
        put_scaled(system.metric[b], row, o, out)
        for i in range(o, o + 3):
            square += out[i] * out[i] + out[i + 3] * out[i + 3]
    size = math.sqrt(square)
    for k in range(out.shape[0]):
        out[k] /= size
    for _ in range(2):  # what was held of it is rounding then
        for r in range(s.lam_free.shape[0]):
            s.unit_of[r] = 0.0
            for k in range(out.shape[0]):
                s.unit_of[r] -= s.unit[r] * s.scaled[r, k] * out[k]
        for r in range(s.lam_free.shape[0]):
            add_scaled(s.unit_of[r], s.answers[r], out)
    return size
