"""The tangent of the equations of motion, element by element, from the types' own group loops.

One element's loop is called (count 1) in its differentiated form (interface/codegen/
loop_derivatives.py), with the motion of one of its bodies as directions: positions r and rotations
about body axes, then velocities r_dot and angular velocities in body axes. So every type has a
tangent, a third party's too, exact to rounding.

Laws that bend within the tolerance of a state, as contact at rest and friction below its v_tol do,
are flat to one side of the bend. Once an iteration failed (``Tangent.bends``) such an element has
the secant across its bend in place of the zero slope.

In the bodies' scaled coordinates (linear/ldlt/factor.py), translations in body axes too, x a
displacement and v a velocity:

    coupling  d(force + D^T lambda) / d(x, v), blocks of 6 x 12 for pairs of bodies
    turning   d(D v - nu) / dx, laid out as D
    force_by_lambda  d(forces that read multipliers) / dlambda, blocks of rows x 6 (transposed)

In body axes a mechanism that turns as a whole keeps its tangent. What a wrench owes to the body
axes in which its moment acts is in it; the gyroscopic moment is added in closed form.

Arrays of the differentiated loops have ``WIDTH`` numbers for each of the plain ones: its value and
its derivatives, called slopes, by the directions.
"""

import math
from typing import Annotated, Any

import attrs

from dap3d_core.assembly.arrays import Floats, Integers, System
from dap3d_core.assembly.evaluate import largest, zero
from dap3d_core.assembly.metric import in_body_axes, scaled_moment
from dap3d_core.kernels.runtime.array_struct import Arrays, IntegerMatrix
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.runtime.function_lists import LoopArrays, call_loop
from dap3d_core.kernels.runtime.loop_support import A, P, R, V, W

#: Numbers of differentiated loops for each: a value and slopes. A body has so many directions of
#: each level, positions and velocities.
WIDTH, DIRECTIONS = 8, 6
#: Numbers of a body row that move.
MOVING = 22
#: Steps of secants: the first one as part of the element's size, the next one as part of the one
#: before, how many there are. Changes of so many roundings of what an element returns are none.
PART, FINER, LEVELS, NOISY = 6e-6, 0.0625, 8, 1e3 * 2.220446049250313e-16
#: ``Tangent.bends`` where an iteration failed with the tangent of its step, so that laws may bend;
#: and where one did.
MAY_BEND, BENT = 1.0, 2.0
#: Least velocity, m/s, and least size of an element, m, that steps are parts of.
SLOWEST, SMALLEST = 0.1, 1e-4
#: What an element is; the last two only of types with states of their own (state_tangent.py).
WRENCH_ELEMENT, JOINT_ELEMENT, FRICTION_ELEMENT, RATE_ELEMENT, POSITION_ELEMENT = range(5)
#: Columns of ``elements``; DERIVATIVE: the differentiated loop.
(
    LOOP, DERIVATIVE, KIND, STRIDE, PAR_WIDTH, SLOT_COUNT, ROW_AT, ROWS, FIRST_PAIR, VELOCITY,
    FIRST_READING, JOINTS_READ, ELEMENT_WIDTH
) = range(13)  # fmt: skip
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

    at: Integers  # (groups,) of ``elements``: place of the first state in idx, or -1
    records: IntegerMatrix  # (elements, 8) COUNT, ...
    record: Integers  # (states,) of the element whose first state it is
    values: Floats


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Tangent(Arrays):
    """Tables of the elements, and the derivatives that they give."""

    elements: IntegerMatrix  # (groups, ELEMENT_WIDTH); ROW_AT: place of the joint's row in idx
    pairs: Integers  # places in ``coupling`` for the slots (a, b) of each element, -1 for none
    blocks: IntegerMatrix  # (pairs, 3) place in ``coupling``, body of the rows, body of the columns
    coupling: Floats
    turning: Floats  # (block_size,)
    readings: IntegerMatrix  # (k, 4) of each instance, joint that it reads, slot: PLACE, BODY, ...
    force_by_lambda: Floats  # blocks of ``readings``
    bends: Floats  # (1,) 0, MAY_BEND or BENT
    states: StateTangent
    wide: Annotated[Any, LoopArrays]  # of the differentiated loops, as the next ones
    D: Floats  # (WIDTH block_size,) an element's own blocks
    gamma: Floats  # (WIDTH rows,)
    nu: Floats  # (WIDTH rows,)
    minus_lambda: Floats  # (WIDTH rows,)
    force: Floats  # (WIDTH 6 (n+1),)
    out: Floats  # (WIDTH outputs,) what an element returns
    kept: Floats  # (WIDTH outputs,) the same at its place, while it is moved
    ahead: Floats  # (WIDTH outputs,) the same moved forwards


@compiled
def spread(values: Floats, wide: Floats) -> None:
    """Numbers into the first lane of wide ones, whose slopes are left as they are."""
    for k in range(values.shape[0]):
        wide[WIDTH * k] = values[k]


@compiled
def load_values(x: Floats, system: System, tangent: Tangent) -> None:
    """Give the differentiated loops the numbers of the present state; x: (row_size,) -lambda."""
    wide = tangent.wide
    for b in range(system.body.shape[0]):
        spread(system.body[b], wide.body[b])
    for f in range(system.F.shape[0]):
        spread(system.F[f], wide.F[f])
    spread(system.par, wide.par)
    spread(system.states, wide.states)
    spread(x, tangent.minus_lambda)


@compiled
def seed_positions(s: Floats, body: Floats) -> None:
    """Slopes of a wide body row s by r and by rotations about the body's own axes.

    It keeps its angular velocity in body axes.
    """
    w = in_body_axes(body, body[W], body[W + 1], body[W + 2])
    for axis in range(3):
        i, j, lane = (axis + 1) % 3, (axis + 2) % 3, 4 + axis
        s[WIDTH * (R + axis) + 1 + axis] = 1.0
        for r in range(3):
            a, b = body[A + 3 * r + i], body[A + 3 * r + j]
            s[WIDTH * (A + 3 * r + i) + lane] = b
            s[WIDTH * (A + 3 * r + j) + lane] = -a
            wi = w[0] if i == 0 else (w[1] if i == 1 else w[2])
            wj = w[0] if j == 0 else (w[1] if j == 1 else w[2])
            s[WIDTH * (W + r) + lane] = b * wi - a * wj
        s[WIDTH * P + lane] = -0.5 * body[P + 1 + axis]
        s[WIDTH * (P + 1 + axis) + lane] = 0.5 * body[P]
        s[WIDTH * (P + 1 + i) + lane] = 0.5 * body[P + 1 + j]
        s[WIDTH * (P + 1 + j) + lane] = -0.5 * body[P + 1 + i]


@compiled
def seed_velocities(s: Floats, body: Floats) -> None:
    """Slopes of a wide body row s by r_dot and by angular velocities in body axes."""
    clear(s)
    for c in range(3):
        s[WIDTH * (V + c) + 1 + c] = 1.0
        for r in range(3):
            s[WIDTH * (W + r) + 4 + c] = body[A + 3 * r + c]


@compiled
def clear(s: Floats) -> None:
    """Take the slopes away from a wide body row."""
    for c in range(MOVING):
        for lane in range(1, WIDTH):
            s[WIDTH * c + lane] = 0.0


@compiled
def call_element(t: float, e: int, q: int, system: System, loops: Any, tangent: Tangent) -> None:
    """What instance q of group e returns, with slopes, into ``out``.

    Of forces and joints: force and moment (body axes) of each slot, then D v - nu. Of others their
    rates, or C.
    """
    row, idx, wide, out = tangent.elements[e], system.idx, tangent.wide, tangent.out
    g, kind, slots = row[LOOP], row[KIND], row[SLOT_COUNT]
    i0, p0 = system.groups[g, 0] + q * row[STRIDE], system.groups[g, 1] + q * row[PAR_WIDTH]
    place, force, D, x = (i0, p0, 1), tangent.force, tangent.D, tangent.minus_lambda
    for n in range(slots):
        zero(force[6 * WIDTH * idx[i0 + n] : 6 * WIDTH * (idx[i0 + n] + 1)])
    if kind == POSITION_ELEMENT:
        call_loop(loops, row[DERIVATIVE], t, wide, place, tangent.gamma, x, x)
        first = WIDTH * idx[i0 + row[ROW_AT]]
        for k in range(WIDTH * row[ROWS]):
            out[k] = tangent.gamma[first + k]
        return
    if kind == JOINT_ELEMENT:
        call_loop(loops, row[DERIVATIVE], t, wide, place, D, tangent.gamma, tangent.nu)
        add_reactions(i0, row, system, tangent)
    else:
        call_loop(loops, row[DERIVATIVE], t, wide, place, force, x, x)
    if kind == RATE_ELEMENT:
        first = idx[i0 + tangent.states.at[e]]
        count = tangent.states.records[tangent.states.record[first], COUNT]
        for k in range(WIDTH * count):
            out[k] = wide.rates[WIDTH * first + k]
        return
    for n in range(slots):
        s, f, o = wide.body[idx[i0 + n]], 6 * WIDTH * idx[i0 + n], 6 * WIDTH * n
        for k in range(3 * WIDTH):
            out[o + k] = force[f + k]
        for c in range(3):
            o, f = 6 * WIDTH * n + WIDTH * (3 + c), 6 * WIDTH * idx[i0 + n] + WIDTH * 3
            zero(out[o : o + WIDTH])  # no part of it: it may have been no number, at a wild stage
            add_product(s, WIDTH * (A + c), force, f, out, o)
            add_product(s, WIDTH * (A + 3 + c), force, f + WIDTH, out, o)
            add_product(s, WIDTH * (A + 6 + c), force, f + 2 * WIDTH, out, o)


@compiled
def add_product(a: Floats, i: int, b: Floats, j: int, out: Floats, o: int) -> None:
    """Add value and slopes of a[i] b[j] to out[o]."""
    x, y = a[i], b[j]
    out[o] += x * y
    for lane in range(1, WIDTH):
        out[o + lane] = out[o + lane] + x * b[j + lane] + y * a[i + lane]


@compiled
def add_reactions(i0: int, row: Integers, system: System, tangent: Tangent) -> None:
    """Reactions D^T lambda of a joint's instance into ``force``, its D v - nu into ``out``."""
    idx, slots, D, out = system.idx, row[SLOT_COUNT], tangent.D, tangent.out
    r0, at = idx[i0 + row[ROW_AT]], i0 + row[ROW_AT] + 1
    for r in range(row[ROWS]):
        o, x = WIDTH * (6 * slots + r), tangent.minus_lambda[WIDTH * (r0 + r)]
        for lane in range(WIDTH):
            out[o + lane] = -tangent.nu[WIDTH * (r0 + r) + lane]
        for n in range(slots):
            b, d = idx[i0 + n], WIDTH * (idx[at + n] + 6 * r)
            if b > 0:
                for c in range(6):
                    add_product(D, d + WIDTH * c, tangent.wide.body[b], WIDTH * (V + c), out, o)
                for k in range(6 * WIDTH):
                    tangent.force[6 * WIDTH * b + k] -= D[d + k] * x


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
            speed, spin = max(speed, abs(body[b, V + c])), max(spin, abs(body[b, W + c]))
    return extent, max(speed, extent * spin)


@compiled
def move(s: Floats, body: Floats, lane: int, step: float) -> None:
    """A wide body row s, moved from where it is along a direction."""
    for c in range(MOVING):
        s[WIDTH * c] = body[c] + step * s[WIDTH * c + lane]


@compiled
def bridge_bends(
    t: float, e: int, q: int, b: int, level: int, size: int, system: System, loops: Any,
    tangent: Tangent,
) -> None:  # fmt: skip
    """Secants across bends into ``out``, where its slopes by a level of body b are zero.

    The shortest step that sees the bend is taken: that is as long as the bend is away. A jump,
    which every step sees, has none.
    """
    out, kept, ahead = tangent.out, tangent.kept, tangent.ahead
    s, body = tangent.wide.body[b], system.body[b]
    extent, speed = sizes_of(e, q, system, tangent)
    here = 0.0
    for k in range(WIDTH * size):
        kept[k] = out[k]
        here = max(here, abs(out[k]) if k % WIDTH == 0 else 0.0)
    for lane in range(1, 1 + DIRECTIONS):
        step = PART * (speed if level == 1 else extent) / (1.0 if lane < 4 else extent)
        slope = 0.0
        for k in range(size):
            slope = max(slope, abs(kept[WIDTH * k + lane]))
        level_count, seen = (LEVELS if step * slope <= NOISY * here else 0), 0
        for _ in range(level_count):
            move(s, body, lane, step)
            call_element(t, e, q, system, loops, tangent)
            for k in range(size):
                ahead[k] = out[WIDTH * k]
            move(s, body, lane, -step)
            call_element(t, e, q, system, loops, tangent)
            change = 0.0
            for k in range(size):
                change = max(change, abs(ahead[k] - out[WIDTH * k]))
            if change <= NOISY * here:
                break
            seen += 1
            for k in range(size):
                kept[WIDTH * k + lane] = 0.5 / step * (ahead[k] - out[WIDTH * k])
            step *= FINER
        if seen == LEVELS:  # it jumps here
            for k in range(size):
                kept[WIDTH * k + lane] = 0.0
        elif seen > 0:
            tangent.bends[0] = BENT
        move(s, body, lane, 0.0)
    for k in range(WIDTH * size):
        out[k] = kept[k]


@compiled
def differentiate_element(
    t: float, e: int, q: int, system: System, loops: Any, tangent: Tangent
) -> None:
    """Add the derivatives of one element by the coordinates of each of its bodies, unscaled."""
    row, out = tangent.elements[e], tangent.out
    slots = row[SLOT_COUNT]
    i0 = system.groups[row[LOOP], 0] + q * row[STRIDE]
    first_pair = row[FIRST_PAIR] + q * slots * slots
    for m in range(slots):
        b = system.idx[i0 + m]
        if tangent.pairs[first_pair + m * slots + m] < 0:  # ground, or a body met before
            continue
        seed_positions(tangent.wide.body[b], system.body[b])
        for level in range(1 + row[VELOCITY]):
            if level == 1:
                seed_velocities(tangent.wide.body[b], system.body[b])
            call_element(t, e, q, system, loops, tangent)
            if tangent.bends[0] != 0.0 and row[KIND] != JOINT_ELEMENT:
                bridge_bends(t, e, q, b, level, 6 * slots, system, loops, tangent)
            for n in range(slots):
                o = tangent.pairs[first_pair + n * slots + m]
                if o >= 0:
                    for k in range(6):
                        for c in range(6):
                            slope = out[WIDTH * (6 * n + k) + 1 + c]
                            tangent.coupling[o + 12 * k + 6 * level + c] += slope
        clear(tangent.wide.body[b])
        if row[KIND] == JOINT_ELEMENT:
            d = system.idx[i0 + row[ROW_AT] + 1 + m]
            for r in range(row[ROWS]):
                for c in range(6):
                    tangent.turning[d + 6 * r + c] += out[WIDTH * (6 * slots + r) + 1 + c]


@compiled
def differentiate_friction(
    t: float, e: int, q: int, system: System, loops: Any, tangent: Tangent
) -> None:
    """Derivatives of one element by the multipliers that it reads, moments in body axes."""
    row, x = tangent.elements[e], tangent.minus_lambda
    slots = row[SLOT_COUNT]
    for joint in range(row[JOINTS_READ]):
        first = row[FIRST_READING] + (q * row[JOINTS_READ] + joint) * slots
        r0, rows = tangent.readings[first, FIRST_ROW], tangent.readings[first, ROW_COUNT]
        for r in range(rows):
            x[WIDTH * (r0 + r) + 1 + r % DIRECTIONS] = -1.0
            if r % DIRECTIONS < DIRECTIONS - 1 and r < rows - 1:
                continue
            call_element(t, e, q, system, loops, tangent)
            for k in range(r - r % DIRECTIONS, r + 1):
                lane = 1 + k % DIRECTIONS
                x[WIDTH * (r0 + k) + lane] = 0.0
                for n in range(slots):
                    o = tangent.readings[first + n, PLACE]
                    if o >= 0:
                        for c in range(6):
                            slope = tangent.out[WIDTH * (6 * n + c) + lane]
                            tangent.force_by_lambda[o + 6 * k + c] += slope


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


@compiled_into
def scale_column(block: Floats, c: int, n: int, k: Floats, s: Floats) -> None:
    """Six numbers, each n behind the one before, a force and a moment in body axes, scaled."""
    x, y, z = in_body_axes(s, block[c], block[c + n], block[c + 2 * n])
    block[c], block[c + n], block[c + 2 * n] = k[0] * x, k[0] * y, k[0] * z
    c += 3 * n
    x, y, z = scaled_moment(k, block[c], block[c + n], block[c + 2 * n])
    block[c], block[c + n], block[c + 2 * n] = x, y, z


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
            scale_column(block, c, 12, k, s)
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
        system: of the evaluator.
        loops: with the differentiated ones.
        tangent: its outputs are overwritten.

    Returns:
        whether it is finite.
    """
    zero(tangent.coupling)
    zero(tangent.turning)
    zero(tangent.force_by_lambda)
    load_values(x, system, tangent)
    for e in range(tangent.elements.shape[0]):
        count = system.groups[tangent.elements[e, LOOP], 2]
        for q in range(count if tangent.elements[e, KIND] < RATE_ELEMENT else 0):
            differentiate_element(t, e, q, system, loops, tangent)
            if tangent.elements[e, KIND] == FRICTION_ELEMENT:
                differentiate_friction(t, e, q, system, loops, tangent)
    add_gyroscopic(system, tangent)
    scale_tangent(system, tangent)
    worst = largest(tangent.coupling) + largest(tangent.turning) + largest(tangent.force_by_lambda)
    return worst < math.inf
