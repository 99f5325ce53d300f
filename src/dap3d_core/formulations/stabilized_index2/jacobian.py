"""The tangent of the equations of motion, element by element, from the types' own group loops.

One element's loop is called (count 1) with the row of one of its bodies moved along one of twelve
coordinates, forwards and backwards: positions r, rotations about body axes, velocities r_dot,
angular velocities in body axes. What it returns differs by the derivative. So every type has a
tangent, a third party's too, and nothing is compiled for it. The error is some 1e-10 of the largest
entry (central differences; the step is 6e-6 of the element's size, or rad), which a simplified
Newton iteration, that reuses its matrix over many steps, does not see.

In the bodies' scaled coordinates (linear/ldlt/factor.py), translations in body axes too, x a
displacement and v a velocity:

    coupling  d(force + D^T lambda) / d(x, v), blocks of 6 x 12 for pairs of bodies
    turning   d(D v - nu) / dx, laid out as D
    force_by_lambda  d(forces that read multipliers) / dlambda, blocks of rows x 6 (transposed)

A fine tangent (``Tangent.fine``) is that of laws which bend within such a step, as contact at rest
and friction below its v_tol do: there the step is shortened until the derivative no longer depends
on it.

In body axes a mechanism that turns as a whole keeps its tangent. What a wrench owes to the body
axes in which its moment acts is in it; the gyroscopic moment is added in closed form.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math
from typing import Any, ClassVar

import attrs

from dap3d_core.assembly.arrays import Floats, Integers, System
from dap3d_core.assembly.evaluate import largest, zero
from dap3d_core.assembly.metric import in_body_axes, scaled_moment
from dap3d_core.kernels.runtime.array_struct import INTEGER_MATRIX, INTEGERS, Arrays
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.runtime.function_lists import call_loop

#: Step of the differences: the cube root of a rounding balances its error with that of the formula.
PART = 6e-6
#: Least step of a velocity in m/s (times PART), and least size of an element in m: below the
#: velocities at which Coulomb friction turns.
SLOWEST, SMALLEST = 0.1, 1e-4
#: Steps of a fine tangent: the next one as part of the one before, how many there are, and to which
#: part two differences agree. Changes of so many roundings of what an element returns say nothing.
FINER, LEVELS, AGREEMENT, NOISY = 0.0625, 8, 0.1, 1e3 * 2.220446049250313e-16
#: ``Tangent.fine`` where a law did bend.
BENT = 2.0
#: What an element is; the last two only of types with states of their own (state_tangent.py).
WRENCH_ELEMENT, JOINT_ELEMENT, FRICTION_ELEMENT, RATE_ELEMENT, POSITION_ELEMENT = range(5)
#: Columns of ``elements``.
(
    LOOP, KIND, STRIDE, WIDTH, SLOT_COUNT, ROW_AT, ROWS, FIRST_PAIR, VELOCITY, FIRST_READING,
    JOINTS_READ, ELEMENT_WIDTH
) = range(12)  # fmt: skip
#: Columns of ``StateTangent.records``: number of states; places in ``values`` of rate by z (m x m),
#: of rate by each slot (m x 12), of force by z of each slot (6 x m), of C and of D v - nu by z
#: (rows x m); slots; rows.
COUNT, RATE_BY_STATE, RATE_BY_BODY, FORCE_BY_STATE, C_BY_STATE, NU_BY_STATE, SLOTS_OF, ROWS_OF = (
    range(8)
)
#: Columns of ``readings``.
PLACE, BODY, FIRST_ROW, ROW_COUNT = range(4)


@attrs.frozen(eq=False, kw_only=True, slots=False)
class StateTangent(Arrays):
    """Tables and derivatives of elements with states of their own (state_tangent.py)."""

    types: ClassVar[dict[str, Any]] = {
        "at": INTEGERS,
        "records": INTEGER_MATRIX,
        "record": INTEGERS,
    }

    at: Integers  # (groups,) of ``elements``: place of the first state in idx, or -1
    records: Integers  # (elements, 8) COUNT, ...
    record: Integers  # (states,) of the element whose first state it is
    values: Floats
    size: Floats  # (states,) least size of a state, of which steps are parts


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Tangent(Arrays):
    """Tables of the differences, and the derivatives that they give."""

    types: ClassVar[dict[str, Any]] = {
        "elements": INTEGER_MATRIX,
        "pairs": INTEGERS,
        "blocks": INTEGER_MATRIX,
        "readings": INTEGER_MATRIX,
        "states": StateTangent.type_of(),
    }

    elements: Integers  # (groups, ELEMENT_WIDTH); ROW_AT: place of the joint's row in idx
    pairs: Integers  # places in ``coupling`` for the slots (a, b) of each element, -1 for none
    blocks: Integers  # (pairs, 3) place in ``coupling``, body of the rows, body of the columns
    coupling: Floats
    turning: Floats  # (block_size,)
    readings: Integers  # (k, 4) of each instance, joint that it reads, slot: PLACE, BODY, ...
    force_by_lambda: Floats  # blocks of ``readings``
    D: Floats  # (block_size,) scratch: an element's own blocks
    gamma: Floats  # (rows,) scratch
    nu: Floats  # (rows,) scratch
    force: Floats  # (6 (n+1),) scratch
    saved: Floats  # (BODY_WIDTH,) scratch
    ahead: Floats  # (outputs,) what the element returns with a body moved forwards
    behind: Floats  # (outputs,) the same backwards
    here: Floats  # (outputs,) the same as it is placed
    column: Floats  # (outputs,) derivatives by a coordinate
    coarser: Floats  # (outputs,) the same by a longer step
    one_sided: Floats  # (outputs,) the same by the side on which it does not jump
    fine: Floats  # (1,) 1 where laws may bend within the usual step, BENT once one did
    states: StateTangent


@compiled
def move_body(s: Floats, saved: Floats, c: int, step: float) -> None:
    """Body row s = ``saved``, moved by ``step`` along coordinate c of 12."""
    for k in range(s.shape[0]):
        s[k] = saved[k]
    if c < 3:
        s[c] += step
    elif c < 6:
        rotate_body(s, saved, c - 3, step)
    elif c < 9:
        s[6 + c] += step  # velocities stand from 12
    else:
        for k in range(3):
            s[15 + k] += saved[3 + 3 * k + c - 9] * step


@compiled
def rotate_body(s: Floats, saved: Floats, axis: int, angle: float) -> None:
    """Turn the body about one of its own axes; it keeps its angular velocity in body axes."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    cosine, sine = math.cos(angle), math.sin(angle)
    w0, w1, w2 = in_body_axes(saved, saved[15], saved[16], saved[17])
    for r in range(3):
        a, b = saved[3 + 3 * r + i], saved[3 + 3 * r + j]
        s[3 + 3 * r + i] = cosine * a + sine * b
        s[3 + 3 * r + j] = cosine * b - sine * a
        s[15 + r] = s[3 + 3 * r] * w0 + s[4 + 3 * r] * w1 + s[5 + 3 * r] * w2
    cosine, sine = math.cos(0.5 * angle), math.sin(0.5 * angle)
    e0, e, ei, ej = saved[18], saved[19 + axis], saved[19 + i], saved[19 + j]
    s[18] = cosine * e0 - sine * e
    s[19 + axis] = cosine * e + sine * e0
    s[19 + i] = cosine * ei + sine * ej
    s[19 + j] = cosine * ej - sine * ei


@compiled
def call_element(
    t: float, e: int, q: int, x: Floats, out: Floats, system: System, loops: Any, tangent: Tangent
) -> None:
    """One instance q of group e: force and moment (body axes) of each slot, then D v - nu."""
    row = tangent.elements[e]
    g, kind, slots = row[LOOP], row[KIND], row[SLOT_COUNT]
    i0, p0 = system.groups[g, 0] + q * row[STRIDE], system.groups[g, 1] + q * row[WIDTH]
    body, idx, force, D = system.body, system.idx, tangent.force, tangent.D
    for n in range(slots):
        for c in range(6 * idx[i0 + n], 6 * idx[i0 + n] + 6):
            force[c] = 0.0
    if kind == JOINT_ELEMENT:
        call_loop(loops, g, t, system, (i0, p0, 1), D, tangent.gamma, tangent.nu)
        r0, at = idx[i0 + row[ROW_AT]], i0 + row[ROW_AT] + 1
        for r in range(row[ROWS]):
            rate = -tangent.nu[r0 + r]
            for n in range(slots):
                b, d = idx[i0 + n], idx[at + n] + 6 * r
                if b > 0:
                    for c in range(6):
                        rate += D[d + c] * body[b, 12 + c]
                        force[6 * b + c] -= D[d + c] * x[r0 + r]
            out[6 * slots + r] = rate
    else:
        call_loop(loops, g, t, system, (i0, p0, 1), force, x, x)
    for n in range(slots):
        b = idx[i0 + n]
        for c in range(3):
            out[6 * n + c] = force[6 * b + c]
            turned = 0.0
            for k in range(3):
                turned += body[b, 3 + 3 * k + c] * force[6 * b + 3 + k]
            out[6 * n + 3 + c] = turned


@compiled
def call_any(
    t: float, e: int, q: int, x: Floats, out: Floats, system: System, loops: Any, tangent: Tangent
) -> None:
    """What instance q of group e returns: rates, C, or as ``call_element``."""
    row = tangent.elements[e]
    if row[KIND] != RATE_ELEMENT and row[KIND] != POSITION_ELEMENT:
        call_element(t, e, q, x, out, system, loops, tangent)
        return
    g = row[LOOP]
    i0, p0 = system.groups[g, 0] + q * row[STRIDE], system.groups[g, 1] + q * row[WIDTH]
    if row[KIND] == POSITION_ELEMENT:
        call_loop(loops, g, t, system, (i0, p0, 1), tangent.gamma, x, x)
        first = system.idx[i0 + row[ROW_AT]]
        for k in range(row[ROWS]):
            out[k] = tangent.gamma[first + k]
        return
    call_loop(loops, g, t, system, (i0, p0, 1), tangent.force, x, x)
    first = system.idx[i0 + tangent.states.at[e]]
    for k in range(tangent.states.records[tangent.states.record[first], COUNT]):
        out[k] = system.rates[first + k]


@compiled
def find_column(
    t: float, e: int, q: int, x: Floats, c: int, step: float, size: int, s: Floats, system: System,
    loops: Any, tangent: Tangent,
) -> None:  # fmt: skip
    """Derivatives of what an element returns, ``size`` numbers, by coordinate c of body row s.

    s is left moved; ``tangent.saved`` has it as it is.
    """
    column, coarser = tangent.column, tangent.coarser
    if tangent.fine[0] != 0.0:
        move_body(s, tangent.saved, c, 0.0)
        call_any(t, e, q, x, tangent.here, system, loops, tangent)
    bent = bends(t, e, q, x, c, step, size, s, system, loops, tangent)
    if tangent.fine[0] == 0.0:
        return
    find_smooth_side(step, size, tangent)
    for _ in range(LEVELS):
        step *= FINER
        was_bent, most, apart = bent, 0.0, 0.0
        for k in range(size):
            coarser[k] = column[k]
        bent = bends(t, e, q, x, c, step, size, s, system, loops, tangent)
        change = here = 0.0
        for k in range(size):
            most, apart = max(most, abs(column[k])), max(apart, abs(column[k] - coarser[k]))
            change = max(change, step * abs(column[k]))
            here = max(here, abs(tangent.here[k]))
        agree = not bent and apart <= AGREEMENT * most
        if change <= NOISY * here or (agree and not was_bent):
            for k in range(size):
                column[k] = coarser[k]
            return
        tangent.fine[0] = BENT
        if agree:
            return
    for k in range(size):  # it jumps here
        column[k] = tangent.one_sided[k]


@compiled
def find_smooth_side(step: float, size: int, tangent: Tangent) -> None:
    """The lesser of both one-sided differences: a jump lies on the other side."""
    ahead, behind, here = tangent.ahead, tangent.behind, tangent.here
    rise = fall = 0.0
    for k in range(size):
        rise, fall = max(rise, abs(ahead[k] - here[k])), max(fall, abs(here[k] - behind[k]))
    for k in range(size):
        change = ahead[k] - here[k] if rise < fall else here[k] - behind[k]
        tangent.one_sided[k] = change / step


@compiled
def bends(
    t: float, e: int, q: int, x: Floats, c: int, step: float, size: int, s: Floats, system: System,
    loops: Any, tangent: Tangent,
) -> bool:  # fmt: skip
    """Central differences into ``tangent.column``; whether they differ from one-sided ones."""
    ahead, behind, here = tangent.ahead, tangent.behind, tangent.here
    move_body(s, tangent.saved, c, step)
    call_any(t, e, q, x, ahead, system, loops, tangent)
    move_body(s, tangent.saved, c, -step)
    call_any(t, e, q, x, behind, system, loops, tangent)
    half, bend, rise = 0.5 / step, 0.0, 0.0
    for k in range(size):
        tangent.column[k] = half * (ahead[k] - behind[k])
        bend = max(bend, abs(ahead[k] - 2.0 * here[k] + behind[k]))
        rise = max(rise, max(abs(ahead[k] - here[k]), abs(behind[k] - here[k])))
    return bend > AGREEMENT * rise


@compiled
def sizes_of(e: int, q: int, system: System, tangent: Tangent) -> tuple[float, float]:
    """Extent of an element, m, and its velocity, m/s: what its steps are parts of."""
    row = tangent.elements[e]
    i0 = system.groups[row[LOOP], 0] + q * row[STRIDE]
    extent, speed, spin, body, idx = SMALLEST, SLOWEST, 0.0, system.body, system.idx
    for n in range(row[SLOT_COUNT]):
        b = idx[i0 + n]
        if b == 0:
            continue
        inertia = body[b, 23] + body[b, 27] + body[b, 31]
        extent = max(extent, math.sqrt(inertia / body[b, 22]))
        a = idx[i0] if n > 0 else idx[i0 + min(1, row[SLOT_COUNT] - 1)]
        for c in range(3):
            if a != b:
                extent = max(extent, abs(body[b, c] - body[a, c]))
            speed, spin = max(speed, abs(body[b, 12 + c])), max(spin, abs(body[b, 15 + c]))
    return extent, max(speed, extent * spin)


@compiled
def differentiate_element(
    t: float, e: int, q: int, x: Floats, system: System, loops: Any, tangent: Tangent
) -> None:
    """Add the derivatives of one element by the coordinates of each of its bodies, unscaled."""
    row = tangent.elements[e]
    kind, slots, rows = row[KIND], row[SLOT_COUNT], row[ROWS]
    i0 = system.groups[row[LOOP], 0] + q * row[STRIDE]
    first_pair = row[FIRST_PAIR] + q * slots * slots
    extent, speed = sizes_of(e, q, system, tangent)
    saved, column = tangent.saved, tangent.column
    size = 6 * slots + (rows if kind == JOINT_ELEMENT else 0)
    for m in range(slots):
        b = system.idx[i0 + m]
        if tangent.pairs[first_pair + m * slots + m] < 0:  # ground, or a body met before
            continue
        s = system.body[b]
        for k in range(s.shape[0]):
            saved[k] = s[k]
        for c in range(12 if row[VELOCITY] != 0 else 6):
            scale = extent if c < 3 else 1.0
            if c >= 6:
                scale = speed if c < 9 else speed / extent
            find_column(t, e, q, x, c, PART * scale, size, s, system, loops, tangent)
            for n in range(slots):
                o = tangent.pairs[first_pair + n * slots + m]
                if o >= 0:
                    for k in range(6):
                        tangent.coupling[o + 12 * k + c] += column[6 * n + k]
            if kind == JOINT_ELEMENT:
                d = system.idx[i0 + row[ROW_AT] + 1 + m] + c
                for r in range(rows):
                    tangent.turning[d + 6 * r] += column[6 * slots + r]
        for k in range(s.shape[0]):
            s[k] = saved[k]


@compiled
def differentiate_friction(
    t: float, e: int, q: int, x: Floats, system: System, loops: Any, tangent: Tangent
) -> None:
    """Derivatives of one element by the multipliers that it reads, moments in body axes."""
    row = tangent.elements[e]
    slots = row[SLOT_COUNT]
    for joint in range(row[JOINTS_READ]):
        first = row[FIRST_READING] + (q * row[JOINTS_READ] + joint) * slots
        r0, rows = tangent.readings[first, FIRST_ROW], tangent.readings[first, ROW_COUNT]
        size = 1e-3
        for r in range(r0, r0 + rows):
            size = max(size, abs(x[r]))
        step = PART * size
        for r in range(rows):
            kept = x[r0 + r]
            x[r0 + r] = kept - step  # x is -lambda
            call_element(t, e, q, x, tangent.ahead, system, loops, tangent)
            x[r0 + r] = kept + step
            call_element(t, e, q, x, tangent.behind, system, loops, tangent)
            x[r0 + r] = kept
            for n in range(slots):
                o = tangent.readings[first + n, PLACE]
                if o >= 0:
                    for k in range(6):
                        rise = tangent.ahead[6 * n + k] - tangent.behind[6 * n + k]
                        tangent.force_by_lambda[o + 6 * r + k] += 0.5 / step * rise


@compiled
def turn_to_body(block: Floats, o: int, s: Floats) -> None:
    """Three numbers at o along the global axes become those along the axes of body row s."""
    block[o], block[o + 1], block[o + 2] = in_body_axes(s, block[o], block[o + 1], block[o + 2])


@compiled
def scale_columns(block: Floats, o: int, k: Floats, s: Floats) -> None:
    """Six numbers at o, derivatives by (r, rotation) of a body, become those in scaled ones."""
    turn_to_body(block, o, s)
    for c in range(3):
        block[o + c] *= k[0]
    x, y, z = scaled_moment(k, block[o + 3], block[o + 4], block[o + 5])
    block[o + 3], block[o + 4], block[o + 5] = x, y, z


@compiled
def scale_tangent(system: System, tangent: Tangent) -> None:
    """Rows and columns of the derivatives into the bodies' scaled coordinates."""
    metric, block = system.metric, tangent.coupling
    for p in range(tangent.blocks.shape[0]):
        o, a, b = tangent.blocks[p, 0], tangent.blocks[p, 1], tangent.blocks[p, 2]
        k, s = metric[a], system.body[a]
        for r in range(6):
            scale_columns(block, o + 12 * r, metric[b], system.body[b])
            scale_columns(block, o + 12 * r + 6, metric[b], system.body[b])
        for c in range(o, o + 12):
            x, y, z = in_body_axes(s, block[c], block[c + 12], block[c + 24])
            block[c], block[c + 12], block[c + 24] = k[0] * x, k[0] * y, k[0] * z
            x, y, z = scaled_moment(k, block[c + 36], block[c + 48], block[c + 60])
            block[c + 36], block[c + 48], block[c + 60] = x, y, z
    for q in range(system.blocks.shape[0]):
        o, b = system.blocks[q, 0], system.blocks[q, 1]
        for _ in range(system.blocks[q, 2]):
            scale_columns(tangent.turning, o, metric[b], system.body[b])
            o += 6
    for p in range(tangent.readings.shape[0]):
        o, b = tangent.readings[p, PLACE], tangent.readings[p, BODY]
        for _ in range(tangent.readings[p, ROW_COUNT] if o >= 0 else 0):
            scale_columns(tangent.force_by_lambda, o, metric[b], system.body[b])
            o += 6


@compiled
def add_gyroscopic(system: System, tangent: Tangent) -> None:
    """d(-w' x J' w') / dw' of each body, unscaled, into its own block (the first n of them)."""
    block = tangent.coupling
    for b in range(1, system.body.shape[0]):
        s, o = system.body[b], tangent.blocks[b - 1, 0] + 45
        w0, w1, w2 = in_body_axes(s, s[15], s[16], s[17])
        for c in range(3):  # J' e_c x w'
            j0, j1, j2 = s[23 + c], s[26 + c], s[29 + c]
            block[o + c] += j1 * w2 - j2 * w1
            block[o + 12 + c] += j2 * w0 - j0 * w2
            block[o + 24 + c] += j0 * w1 - j1 * w0
        h0 = s[23] * w0 + s[24] * w1 + s[25] * w2
        h1 = s[26] * w0 + s[27] * w1 + s[28] * w2
        h2 = s[29] * w0 + s[30] * w1 + s[31] * w2
        block[o + 1] -= h2  # J' w' x e_c
        block[o + 2] += h1
        block[o + 12] += h2
        block[o + 14] -= h0
        block[o + 24] -= h1
        block[o + 25] += h0


@compiled
def differentiate(t: float, x: Floats, system: System, loops: Any, tangent: Tangent) -> bool:
    """The tangent at the bodies as placed, functions of time as they stand.

    Args:
        t: time, s.
        x: (row_size,) -lambda.
        system, loops: of the evaluator.
        tangent: its outputs are overwritten.

    Returns:
        whether it is finite.
    """
    zero(tangent.coupling)
    zero(tangent.turning)
    zero(tangent.force_by_lambda)
    for e in range(tangent.elements.shape[0]):
        count = system.groups[tangent.elements[e, LOOP], 2]
        for q in range(count if tangent.elements[e, KIND] < RATE_ELEMENT else 0):
            differentiate_element(t, e, q, x, system, loops, tangent)
            if tangent.elements[e, KIND] == FRICTION_ELEMENT:
                differentiate_friction(t, e, q, x, system, loops, tangent)
    add_gyroscopic(system, tangent)
    scale_tangent(system, tangent)
    worst = largest(tangent.coupling) + largest(tangent.turning) + largest(tangent.force_by_lambda)
    return worst < math.inf
