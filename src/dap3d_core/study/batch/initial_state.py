"""Compiled correction of initial states, for many runs of one model (study/batch/driver.py).

Its passes are those of simulation/initial/assemble.py, which solves each by singular values, where
this uses the block factorisation (equal to rounding), and which also takes redundant rows, held
bodies and the mass metric. ``begin_...`` stores references of a start as ``Evaluator.start`` does.
"""

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import (
    ANGLE,
    DOUBTFUL,
    EVEN,
    LENGTH,
    SCRATCH,
    UNSETTLED,
    VALUE,
    Floats,
    System,
    velocity_offset,
)
from dap3d_core.assembly.evaluate import call_kinds, place, place_bodies
from dap3d_core.assembly.state_update import apply_displacement, apply_velocity_change
from dap3d_core.assembly.turns import begin_turns
from dap3d_core.formulations.common import constraints
from dap3d_core.formulations.joint.equations import body_state
from dap3d_core.formulations.joint.place import place_tree
from dap3d_core.formulations.pivots import REDUNDANT
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.runtime.loop_support import A, W
from dap3d_core.kernels.scalar_math import is_differentiated, with_slopes
from dap3d_core.linear.ldlt.factor import SINGULAR_PIVOT_RATIO, assemble, factor, weigh_rows
from dap3d_core.linear.rank import PIVOT_TOLERANCE
from dap3d_core.simulation.initial.assemble import (
    FIT,
    MOST_PASSES,
    MOST_SHIFT,
    MOST_TURN,
    TOLERANCE,
)

# Entries of ``out`` of these functions: a length of the model (given); largest residuals of
# position and velocity before and after; Newton passes; the least pivot as a fraction of its row;
# 1 where positions did not close. From STARTING on (given): 1 for rows without a position level;
# then room for a state, which differentiated code takes.
SIZE, C_BEFORE, V_BEFORE, C_AFTER, V_AFTER, PASSES, LEAST_PIVOT, OPEN, STARTING = range(9)


@compiled
def copy_into(target: Any, source: Any) -> None:
    """Copy a vector."""
    for k in range(source.shape[0]):
        target[k] = source[k]


@compiled
def zero_rows(system: System, rows: Floats) -> None:
    """Zero the rows of D^ that are marked with 1."""
    blocks, D = system.blocks, system.D
    for b in range(blocks.shape[0]):
        first, height, row = blocks[b, 0], blocks[b, 2], blocks[b, 3]
        for i in range(height):
            if rows[row + i] != 0.0:
                for c in range(6):
                    D[first + 6 * i + c] = 0.0


@compiled
def factor_positions(system: System, without_position: Floats) -> None:
    """Factorise the rows with a position level; the unknowns of the others become zero."""
    smallest = system.smallest
    zero_rows(system, without_position)
    assemble(system.targets, system.contributions, system.D, system.K)
    weigh_rows(system.blocks, system.D, PIVOT_TOLERANCE, smallest)
    factor(system.nodes, system.columns, system.updates, system.K, smallest, True)


@compiled
def least_pivot_fraction(system: System) -> float:
    """Least pivot of the factors in K as a fraction of the squared length of its row of D^."""
    squares = system.smallest
    weigh_rows(system.blocks, system.D, 1.0, squares)
    least, nodes, K = 1.0, system.nodes, system.K
    for k in range(nodes.shape[0] - 1):
        size, first, diagonal = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        for i in range(size):
            inverse, whole = K[diagonal + i * (size + 1)], squares[first + i]
            fraction = 1.0 / abs(inverse * whole) if inverse * whole != 0.0 else 0.0
            least = min(least, fraction) if fraction == fraction else 0.0
    return least


@compiled_into
def length_of(a: Floats) -> float:
    """Length of a 3-vector."""
    return np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@compiled
def limit_displacement(system: System, max_shift: float) -> None:
    """Shorten the displacement ``change``, of unit metric, so that no body moves too far."""
    change, shift, turn = system.change, 0.0, 0.0
    for b in range(1, change.shape[0] // 6):
        o = 6 * b
        shift = max(shift, length_of(change[o : o + 3]))
        turn = max(turn, length_of(change[o + 3 : o + 6]))
    ratio = 1.0
    if shift > max_shift:
        ratio = max_shift / shift
    if turn * ratio > MOST_TURN:
        ratio = MOST_TURN / turn
    if ratio < 1.0:
        for k in range(change.shape[0]):
            change[k] *= ratio


@compiled
def place_with_spin(y: Floats, system: System) -> None:
    """Place bodies that were rotated; angular velocities stay the same in global axes."""
    body, first = system.body, velocity_offset(1, system.body.shape[0] - 1)
    for b in range(1, body.shape[0]):
        o = first + 6 * (b - 1) + 3
        for c in range(3):
            y[o + c] = body[b, W + c]
    place_bodies(y, body, system.metric)
    for b in range(1, body.shape[0]):
        o, s = first + 6 * (b - 1) + 3, body[b]
        w0, w1, w2 = y[o], y[o + 1], y[o + 2]
        for c in range(3):
            y[o + c] = s[A + c] * w0 + s[A + 3 + c] * w1 + s[A + 6 + c] * w2
    place_bodies(y, body, system.metric)


@compiled_into
def store_function_values(system: System) -> None:
    """Store functions' values as those at the start."""
    F = system.F
    for k in range(F.shape[0]):
        F[k, 4] = F[k, 0]


@compiled
def assemble_start(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Correct a state of independent rows, in the metric of the system, which is unit."""
    size, length, before = out[SIZE], system.settings[LENGTH], 1e300
    out[OPEN], out[PASSES] = 1.0, 0.0
    place(t, y, system, loops)
    store_function_values(system)  # joints that are driven begin with those of this run
    worst = constraints.residuals(t, system, loops)
    constraints.linearise(t, system, loops)
    out[C_BEFORE], out[V_BEFORE] = worst, constraints.velocity_residuals(system)
    for passes in range(MOST_PASSES + 1):
        worst = constraints.residuals(t, system, loops)
        stalls = worst > 0.5 * before and worst <= FIT * min(length, size)
        if worst <= TOLERANCE * length or stalls:
            out[OPEN] = 0.0
            break
        before = worst
        if passes == MOST_PASSES or not worst < 1e100:
            return
        correct_positions(t, y, out, system, loops)
        out[PASSES] += 1.0
    if is_differentiated() and worst < 1e100:  # derivatives of a start that values leave as it is
        kept = out[STARTING + system.multipliers.shape[0] :]
        copy_into(kept, y)
        correct_positions(t, y, out, system, loops)
        put_back(y, kept)
        place(t, y, system, loops)
    out[C_AFTER] = worst
    constraints.linearise(t, system, loops)
    constraints.factorise(system, None)
    out[LEAST_PIVOT] = least_pivot_fraction(system)
    if constraints.velocity_residuals(system) > 0.0:
        correct_velocities(y, system)
        place_bodies(y, system.body, system.metric)
    elif is_differentiated():
        kept = out[STARTING + system.multipliers.shape[0] :]
        copy_into(kept, y)
        correct_velocities(y, system)
        put_back(y, kept)
        place_bodies(y, system.body, system.metric)
    out[V_AFTER] = constraints.velocity_residuals(system)


@compiled
def correct_positions(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """One pass of Newton's iteration for the positions of a start."""
    constraints.linearise(t, system, loops)
    factor_positions(system, out[STARTING:])
    constraints.correct(system)
    limit_displacement(system, MOST_SHIFT * out[SIZE] / system.settings[LENGTH])
    apply_displacement(y, system)
    place_with_spin(y, system)


@compiled_into
def correct_velocities(y: Floats, system: System) -> None:
    """Correct the velocities of a start by ``residual``."""
    constraints.correct(system)
    apply_velocity_change(y, system.metric, system.change)


@compiled_into
def put_back(y: Floats, kept: Floats) -> None:
    """Put a state back, with the derivatives of the one it has become."""
    for k in range(y.shape[0]):
        y[k] = with_slopes(kept[k], y[k])


@compiled_into
def store_start(t: float, y: Floats, system: System, loops: Any) -> None:
    """Place bodies, store functions' values at the start, count turns from here."""
    place(t, y, system, loops)
    count_from_here(t, y, system, loops)


@compiled_into
def count_from_here(t: float, y: Floats, system: System, loops: Any) -> None:
    """Store functions' values at the start and count turns, at bodies and functions as placed."""
    counts = system.settings[SCRATCH : SCRATCH + 1]
    store_function_values(system)
    system.settings[UNSETTLED], counts[0] = 0.0, 1.0
    call_kinds(ANGLE, ANGLE, t, system, loops, system.settings[DOUBTFUL:], counts, counts)
    begin_turns(t, y, system)


@compiled_into
def store_reference_pivots(t: float, system: System, loops: Any, part: float | None) -> None:
    """Store reference pivots as ``formulations.pivots`` does, at the bodies as placed."""
    smallest, nodes, K = system.smallest, system.nodes, system.K
    for k in range(smallest.shape[0]):
        smallest[k] = 0.0
    if system.settings[EVEN] != 0.0:
        constraints.linearise_evenly(t, system, loops)
    else:
        constraints.linearise(t, system, loops)
    constraints.factorise(system, part)
    for k in range(nodes.shape[0] - 1):
        size, first, diagonal = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        for i in range(size):
            pivot = abs(1.0 / K[diagonal + i * (size + 1)])
            if part is not None and pivot < REDUNDANT * system.compliance[first + i]:
                pivot = 0.0
            smallest[first + i] = SINGULAR_PIVOT_RATIO * pivot


@compiled
def begin_free(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Begin a run of a scene without joints; ``out`` is not used."""
    store_start(t, y, system, loops)


@compiled
def begin_standard(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Begin a run with joints of independent rows."""
    place(t, y, system, loops)
    store_reference_pivots(t, system, loops, None)
    store_start(t, y, system, loops)


@compiled
def begin_regularised(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Begin a run of the formulations with regularised factors."""
    place(t, y, system, loops)
    store_reference_pivots(t, system, loops, constraints.PART)
    store_start(t, y, system, loops)


@compiled
def begin_tree(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Begin a run; ``out`` is not used."""
    place_tree(y, system)
    call_kinds(VALUE, VALUE, t, system, loops, system.force, system.force, system.force)
    count_from_here(t, y, system, loops)


@compiled
def state_of_bodies(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """The state y in coordinates of bodies into ``out``."""
    body_state(y, out, system)
