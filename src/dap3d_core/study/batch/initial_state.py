"""The start of a run as compiled code, for many runs of one model (study/batch/driver.py).

What simulation/initial/assemble.py and ``Machine.start`` do for one run, with the same passes: the
least change that brings a state onto its constraints, and what a run remembers of its start.
"""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import (
    ANGLE,
    DOUBTFUL,
    EVEN,
    LENGTH,
    SCRATCH,
    UNSETTLED,
    Floats,
    System,
)
from dap3d_core.assembly.evaluate import call_kinds, place, place_bodies
from dap3d_core.assembly.offsets import velocity_offset
from dap3d_core.assembly.state_update import change_velocity, move
from dap3d_core.formulations.common.constraints import (
    PART,
    correct,
    factorise,
    linearise,
    linearise_evenly,
    residuals,
    velocity_residuals,
)
from dap3d_core.formulations.evaluator import REDUNDANT
from dap3d_core.kernels.runtime.cache import compiled, compiled_inside, compiled_into
from dap3d_core.kernels.runtime.loop_support import A, W
from dap3d_core.linear.ldlt.factor import POOR, assemble, factor
from dap3d_core.linear.rank.rank import PIVOT_TOLERANCE
from dap3d_core.simulation.initial.assemble import (
    FIT,
    MOST_PASSES,
    MOST_SHIFT,
    MOST_TURN,
    TOLERANCE,
)

# Places in ``out`` of these functions. On entry: a length of the model; then largest residuals of
# position and velocity before and after, Newton passes, and the least pivot as a part of its row.
SIZE, C_BEFORE, V_BEFORE, C_AFTER, V_AFTER, NEWTON, LEAST, OPEN, STARTING = range(9)


@compiled_inside
def measure_rows(system: System, squares: Floats) -> None:
    """The squared length of each row of D^."""
    blocks, D = system.blocks, system.D
    for k in range(squares.shape[0]):
        squares[k] = 0.0
    for b in range(blocks.shape[0]):
        first, height, row = blocks[b, 0], blocks[b, 2], blocks[b, 3]
        for i in range(height):
            for c in range(6):
                value = D[first + 6 * i + c]
                squares[row + i] += value * value


@compiled_inside
def leave_out(system: System, rows: Floats) -> None:
    """Make the rows of D^ that are marked with 1 zero."""
    blocks, D = system.blocks, system.D
    for b in range(blocks.shape[0]):
        first, height, row = blocks[b, 0], blocks[b, 2], blocks[b, 3]
        for i in range(height):
            if rows[row + i] != 0.0:
                for c in range(6):
                    D[first + 6 * i + c] = 0.0


@compiled_inside
def factor_positions(system: System, without_position: Floats) -> None:
    """Factors of the rows that have a position level; the unknowns of the others become zero."""
    smallest = system.smallest
    leave_out(system, without_position)
    assemble(system.targets, system.contributions, system.D, system.K)
    measure_rows(system, smallest)
    for k in range(smallest.shape[0]):
        smallest[k] *= PIVOT_TOLERANCE
    factor(system.nodes, system.columns, system.updates, system.K, smallest, True)


@compiled_inside
def smallest_share(system: System) -> float:
    """The least pivot of the factors in K as a part of the squared length of its row of D^."""
    squares = system.smallest
    measure_rows(system, squares)
    least, nodes, K = 1.0, system.nodes, system.K
    for k in range(nodes.shape[0] - 1):
        size, first, diagonal = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        for i in range(size):
            inverse, whole = K[diagonal + i * (size + 1)], squares[first + i]
            share = 1.0 / abs(inverse * whole) if inverse * whole != 0.0 else 0.0
            least = min(least, share) if share == share else 0.0
    return least


@compiled_into
def length_of(a: Floats) -> float:
    """The length of a 3-vector."""
    return np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@compiled_inside
def shorten(system: System, longest_shift: float) -> float:
    """Shorten a displacement in ``force``, of unit metric, so that no body moves too far.

    Returns the part that is left.
    """
    force, shift, turn = system.force, 0.0, 0.0
    for b in range(1, force.shape[0] // 6):
        o = 6 * b
        shift = max(shift, length_of(force[o : o + 3]))
        turn = max(turn, length_of(force[o + 3 : o + 6]))
    part = 1.0
    if shift > longest_shift:
        part = longest_shift / shift
    if turn * part > MOST_TURN:
        part = MOST_TURN / turn
    if part < 1.0:
        for k in range(force.shape[0]):
            force[k] *= part
    return part


@compiled_inside
def place_with_spin(y: Floats, system: System) -> None:
    """Place bodies that were turned; their angular velocities stay as they are in global axes."""
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


@compiled
def assemble_start(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Bring a state onto its constraints, in the metric that stands in the system: unit.

    As ``correct_initial`` for independent rows. out: see above; OPEN is 1 where positions did not
    close; from STARTING on, as an argument, 1 for each row that has no position level.
    """
    size, length, before = out[SIZE], system.settings[LENGTH], 1e300
    out[OPEN], out[NEWTON] = 1.0, 0.0
    place(t, y, system, loops)
    worst = residuals(t, system, loops)
    linearise(t, system, loops)
    out[C_BEFORE], out[V_BEFORE] = worst, velocity_residuals(system)
    for passes in range(MOST_PASSES + 1):
        worst = residuals(t, system, loops)
        stands = worst > 0.5 * before and worst <= FIT * min(length, size)
        if worst <= TOLERANCE * length or stands:
            out[OPEN] = 0.0
            break
        before = worst
        if passes == MOST_PASSES or not worst < 1e100:
            return
        linearise(t, system, loops)
        factor_positions(system, out[STARTING:])
        correct(system)
        shorten(system, MOST_SHIFT * size / length)
        move(y, system.metric, system.force)
        place_with_spin(y, system)
        out[NEWTON] += 1.0
    out[C_AFTER] = worst
    linearise(t, system, loops)
    factorise(system, None)
    out[LEAST] = smallest_share(system)
    if velocity_residuals(system) > 0.0:
        correct(system)
        change_velocity(y, system.metric, system.force)
        place_bodies(y, system.body, system.metric)
    out[V_AFTER] = velocity_residuals(system)


@compiled_into
def remember(t: float, y: Floats, system: System, loops: Any) -> None:
    """The bodies placed, functions' values at the start kept, turns counted from here."""
    unused, F = system.settings[SCRATCH : SCRATCH + 1], system.F
    place(t, y, system, loops)
    for k in range(F.shape[0]):
        F[k, 4] = F[k, 0]
    system.settings[UNSETTLED] = system.settings[DOUBTFUL] = 0.0
    call_kinds(ANGLE, ANGLE, t, system, loops, unused, unused, unused)


@compiled_into
def watch_pivots(t: float, system: System, loops: Any, part: float | None) -> None:
    """As ``Machine.watch_pivots`` does, at the bodies as placed."""
    smallest, nodes, K = system.smallest, system.nodes, system.K
    for k in range(smallest.shape[0]):
        smallest[k] = 0.0
    if system.settings[EVEN] != 0.0:
        linearise_evenly(t, system, loops)
    else:
        linearise(t, system, loops)
    factorise(system, part)
    for k in range(nodes.shape[0] - 1):
        size, first, diagonal = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        for i in range(size):
            pivot = abs(1.0 / K[diagonal + i * (size + 1)])
            if part is not None and pivot < REDUNDANT * system.x[first + i]:
                pivot = 0.0
            smallest[first + i] = POOR * pivot


@compiled
def begin_free(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """What a run of a scene without joints remembers of its start; ``out`` is left as it is."""
    remember(t, y, system, loops)


@compiled
def begin_standard(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """The same with joints whose rows are independent."""
    place(t, y, system, loops)
    watch_pivots(t, system, loops, None)
    remember(t, y, system, loops)


@compiled
def begin_regularised(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """The same for the formulations with regularised factors."""
    place(t, y, system, loops)
    watch_pivots(t, system, loops, PART)
    remember(t, y, system, loops)
