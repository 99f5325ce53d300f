"""The contacts of a model near one pose, of its shapes and of those that are declared."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math
from typing import Any

from dap3d_core.assembly.arrays import ACCELERATION, POSITION, System
from dap3d_core.assembly.collisions.find import find_touches, touch
from dap3d_core.assembly.collisions.placed_shapes import place_shapes
from dap3d_core.assembly.evaluate import call_kinds, copy, place, zero
from dap3d_core.assembly.metric import put_rotation, rotation_row, square_of
from dap3d_core.formulations.contacts.equations import (
    BODY_I,
    INTEGERS,
    LOOP,
    NEAR,
    NUMBERS,
    ROW,
    STATE,
    UNDER,
)
from dap3d_core.integrators.moreau.arrays import ALONE, BOUNCES, CONE, STAYS, STOPS, StepArrays
from dap3d_core.interface.contacts.rows import FAR_APART, SLIDES, STEPPED
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled

#: Of keys of what resists rolling and spinning, behind those of shapes, and of declared contacts.
ROLLS, SPINS, DECLARED = 2**50, 2**51, 2**52
#: Points of a pair of shapes that keys tell apart.
POINTS = 256
#: The least ratio of an ellipse of friction.
THIN = 1e-9
#: What slides by more than its slip changes by within a step, times this, does not come to rest.
SLIDES_ON = 0.5


@compiled
def find_contacts(
    t: float, y: Floats, most: float, s: StepArrays, system: System, loops: Any
) -> bool:
    """Find the contacts at an integrated state y; False without room.

    Shapes are nearer than the margins of bodies, declared contacts than ``most``; friction of
    joints is among them where that is FAR_APART.
    """
    place_poses(y, s)
    s.contact_count = s.touch_count = 0
    if s.shapes.kind.size > 0:
        if not find_touches(s.shapes, s.poses, s.margin):
            return False
        s.touch_count = s.shapes.point_count
    s.contact_count = (1 + s.resistance_count) * (s.touch_count + s.declared_gap.size)
    if s.contact_count > s.key.size:
        return False
    s.contact_count = s.touch_count
    for c in range(s.touch_count):
        put_touch(c, s)
    if s.declared_gap.size > 0:
        evaluate_rows(t, y, True, s, system, loops)
        for k in range(s.declared_gap.size):
            u = s.declared_under[k]
            if u >= 0:
                near = most >= FAR_APART and s.declared_at[u] >= 0
            elif s.declared_kind[k] != CONE:
                near = most >= FAR_APART
            else:
                near = system.residual[s.declared_gap[k]] < most
            s.declared_at[k] = s.contact_count if near else -1
            if near:
                put_declared(k, s, system)
    s.law_count = s.contact_count
    return True


@compiled
def turn_rows(t: float, y: Floats, hits: bool, s: StepArrays, system: System, loops: Any) -> bool:
    """Take rows of contacts and of joints later in the step; False without room.

    Of what stays closed halfway through it, or of what collides at its instant.

    Args:
        t, y: time and integrated state there.
        hits: rows are of what collides.
        s: ``end`` has the velocities expected at the end of the step.
    """
    shapes, first = s.shapes, s.touch_count
    if s.declared_gap.size + s.y.size > 0:
        evaluate_rows(t, y, False, s, system, loops)
    place_poses(y, s)
    if first > 0:
        place_shapes(shapes, s.poses, s.margin)
    last = first
    for c in range(s.law_count):
        turns = s.collides[c] == STAYS
        if hits:
            presses = s.under[c] if s.under[c] >= 0 else c
            turns = s.collides[presses] == STOPS or s.collides[presses] == BOUNCES
        else:
            copy(s.moved[c], s.J[c])
        if c >= first:
            if turns or (s.kind[c] != CONE and not hits):
                put_rows(c, s, system)
                for i in range(12, 36 if s.under[c] >= 0 else 12):  # as in find_grips
                    s.J[c, i] *= s.grip[s.key[c] - DECLARED]
        elif turns:
            i, j = shapes.which[c, 0], shapes.which[c, 1]
            if last == first or shapes.which[first, 0] != i or shapes.which[first, 1] != j:
                last = touch(shapes, i, j, first)
                if last > shapes.found.shape[0]:
                    shapes.point_count = last
                    return False
            for q in range(first, last):
                if shapes.which[q, 2] == shapes.which[c, 2]:
                    turn_touch(c, shapes.found[q], s)
        if turns and not hits:
            put_turned_bias(c, s)
    return True


@compiled
def turn_touch(c: int, found: Floats, s: StepArrays) -> None:
    """Take the rows of contact c from what is found later, but for a point that leaps."""
    here, gap, far = s.shapes.found[c], s.gap[c], 0.0
    for k in range(3):
        far += (found[k] - here[k]) * (found[k] - here[k])
    if far <= (s.margin[s.bodies[c, 0]] + s.margin[s.bodies[c, 1]]) ** 2:
        copy(here, found)
        put_touch(c, s)
        s.gap[c] = gap


@compiled
def put_turned_bias(c: int, s: StepArrays) -> None:
    """Put what velocities change by as rows turn, from those in ``moved``, by J in half a step.

    Rows at the end of the step are to close it, or to stick. What slides throughout has friction
    along its slip halfway.
    """
    J, old, bias, slip, more = s.J[c], s.moved[c], s.bias[c], s.u[c], s.turned
    a, b, side, sign = s.end[s.bodies[c, 0]], s.end[s.bodies[c, 1]], 0, 1.0
    if s.bodies[c, 0] == 0:
        side, sign = 6, -1.0
    slip[0], slip[1], slip[2] = velocity_of(s, c, s.before)
    zero(more[:3])
    size = change = at_start = turned = 0.0
    for r in range(3):
        u, was = 0.0, 0.0
        for k in range(6):
            u += J[12 * r + k] * a[k] + J[12 * r + 6 + k] * b[k]
            was += old[12 * r + k] * a[k] + old[12 * r + 6 + k] * b[k]
        for k in range(3):
            more[k] += sign * (J[12 * r + side + k] * u - old[12 * r + side + k] * was)
        if r == 0:
            bias[0] += u - was
        else:
            size += slip[r] * slip[r]
            slip[r] = u - slip[r]
            change += slip[r] * slip[r]
            at_start, turned = at_start + was * was, turned + (u - was) * (u - was)
    if change == 0.0:  # none is expected but that, as in the first step
        size, change = at_start, turned
    for r in range(1, 3):
        bias[r] = -0.5 * slip[r]
        if change > SLIDES_ON * SLIDES_ON * size:
            e = J[12 * r + side :]
            bias[r] = sign * (e[0] * more[0] + e[1] * more[1] + e[2] * more[2])


@compiled
def place_poses(y: Floats, s: StepArrays) -> None:
    """Take poses from an integrated state."""
    s.poses[0, 3] = 1.0
    for b in range(1, s.poses.shape[0]):
        pose, first = s.poses[b], 7 * (b - 1)
        for k in range(7):
            pose[k] = y[first + k]


@compiled
def put_inertia(s: StepArrays) -> None:
    """Put moments of inertia of the bodies as placed, in global axes."""
    A = s.turned
    for b in range(1, s.poses.shape[0]):
        e = s.poses[b, 3], s.poses[b, 4], s.poses[b, 5], s.poses[b, 6]
        put_rotation(A, 0, e, 2.0 / square_of(e))
        turn_tensor(A, s.Jp[b], s.spin[b])
        turn_tensor(A, s.Jp_inverse[b], s.spin_inverse[b])


@compiled
def axes_of(p: Floats, k: int) -> tuple[float, float, float]:
    """Row k of the rotation matrix of a pose, whose Euler parameters may have any length."""
    e = p[3], p[4], p[5], p[6]
    return rotation_row(e, 2.0 / square_of(e), k)


@compiled
def turn_tensor(A: Floats, J: Floats, out: Floats) -> None:
    """Put A J A^T of a symmetric J, by rows."""
    for i in range(3):
        a, b, c = A[3 * i], A[3 * i + 1], A[3 * i + 2]
        d = a * J[0] + b * J[3] + c * J[6]
        e = a * J[1] + b * J[4] + c * J[7]
        f = a * J[2] + b * J[5] + c * J[8]
        for k in range(3):
            out[3 * i + k] = d * A[3 * k] + e * A[3 * k + 1] + f * A[3 * k + 2]


@compiled
def put_touch(c: int, s: StepArrays) -> None:
    """Make contact c of a point where shapes may touch."""
    shapes = s.shapes
    which, found, J = shapes.which[c], shapes.found[c], s.J[c]
    i, j = which[0], which[1]
    a, b = shapes.body[i], shapes.body[j]
    s.bodies[c, 0], s.bodies[c, 1] = a, b
    s.key[c] = (i * shapes.kind.size + j) * POINTS + which[2]
    s.gap[c], s.kind[c], s.under[c] = found[6], CONE, -1
    first, second = shapes.material[i], shapes.material[j]
    s.mu[c], s.e[c] = shapes.mu[first, second], shapes.e[first, second]
    put_frame(found[3], found[4], found[5], J)
    half = 0.5 * found[6]
    for r in range(3):
        x, y, z = J[12 * r], J[12 * r + 1], J[12 * r + 2]
        for side in range(2):
            pose, sign, k = s.poses[a if side == 0 else b], 1.0 - 2.0 * side, 12 * r + 6 * side
            p, q, w = (found[0] + sign * half * found[3] - pose[0],
                       found[1] + sign * half * found[4] - pose[1],
                       found[2] + sign * half * found[5] - pose[2])  # fmt: skip
            J[k], J[k + 1], J[k + 2] = sign * x, sign * y, sign * z
            J[k + 3], J[k + 4] = sign * (q * z - w * y), sign * (w * x - p * z)
            J[k + 5] = sign * (p * y - q * x)


@compiled
def put_resistances(c: int, s: StepArrays) -> None:
    """Append contacts of what resists rolling and spinning where shapes touch at contact c."""
    shapes = s.shapes
    i, j = shapes.material[shapes.which[c, 0]], shapes.material[shapes.which[c, 1]]
    roll = shapes.mu_roll[i, j] if shapes.mu_roll.size > 0 else 0.0
    spin = shapes.mu_spin[i, j] if shapes.mu_spin.size > 0 else 0.0
    if roll > 0.0:
        put_resistance(c, ROLLS, s)
        put_turning(c, 1, roll, 1, s)
        put_turning(c, 2, roll, 2, s)
    if spin > 0.0:
        put_resistance(c, SPINS, s)
        put_turning(c, 0, spin, 1, s)


@compiled
def put_resistance(c: int, key: int, s: StepArrays) -> None:
    """Append friction as large as what contact c pushes with, its rows still empty."""
    d = s.contact_count
    s.contact_count = d + 1
    s.bodies[d, 0], s.bodies[d, 1] = s.bodies[c, 0], s.bodies[c, 1]
    s.key[d], s.kind[d], s.under[d] = key + s.key[c], ALONE, c
    s.gap[d] = s.mu[d] = s.e[d] = s.bias[d, 0] = s.bias[d, 1] = s.bias[d, 2] = 0.0
    s.collides[d] = 0
    zero(s.J[d])


@compiled
def put_turning(c: int, along: int, arm: float, row: int, s: StepArrays) -> None:
    """Put turning along a row of contact c into a row of the last one, times ``arm``, m.

    Its velocities are in m/s then, and its impulses, moments over ``arm``, in N s.
    """
    d, of = s.contact_count - 1, 12 * along
    side, sign = (0, 1.0) if s.bodies[c, 0] > 0 else (6, -1.0)
    for k in range(3):
        axis = sign * arm * s.J[c, of + side + k]
        s.J[d, 12 * row + 3 + k], s.J[d, 12 * row + 9 + k] = axis, -axis


@compiled
def put_frame(x: float, y: float, z: float, J: Floats) -> None:
    """Put a normal and two tangents at the begin of the rows of a contact."""
    a, b, c = abs(x), abs(y), abs(z)
    if a <= b and a <= c:
        p, q, r = 0.0, z, -y
    elif b <= c:
        p, q, r = -z, 0.0, x
    else:
        p, q, r = y, -x, 0.0
    length = math.sqrt(p * p + q * q + r * r)
    p, q, r = p / length, q / length, r / length
    J[0], J[1], J[2] = x, y, z
    J[12], J[13], J[14] = p, q, r
    J[24], J[25], J[26] = y * r - z * q, z * p - x * r, x * q - y * p


@compiled
def evaluate_rows(
    t: float, y: Floats, has_gaps: bool, s: StepArrays, system: System, loops: Any
) -> None:
    """Evaluate rows of joints and of declared contacts, these as if all stuck.

    has_gaps: ``residual`` of the system becomes their gaps, and what joints are off by, too.
    """
    place(t, y, system, loops)
    for k in range(s.declared_mode.size):
        first = s.declared_mode[k]
        system.states[first] = STEPPED
        for i in range(3):
            system.states[first + NEAR + i] = 0.0
    if has_gaps:
        residual = system.residual
        zero(residual)
        call_kinds(POSITION, POSITION, t, system, loops, residual, residual, residual)
    call_kinds(ACCELERATION, ACCELERATION, t, system, loops, system.D, system.gamma, system.nu)
    for q in range(s.row_place.size):
        for k in range(6):
            s.D[q, k] = system.D[s.row_place[q] + k]


@compiled
def misfit_of(s: StepArrays, system: System) -> float:
    """How far joints are off where contacts are near, m."""
    found = 0.0
    for k in range(s.y.size if s.contact_count > 0 else 0):
        row = system.row[k]
        found = max(found, abs(system.residual[row]) * system.weight[row])
    return found


@compiled
def find_grips(t: float, s: StepArrays, system: System, loops: Any) -> bool:
    """Find coefficients of contacts whose law of friction is their own, at slip of ``before``.

    False if one, ``driving``, has none that is a number and not negative.

    They are the friction that a normal force of one has at a slip along either tangent. Of what
    resists rolling it is a length, by which rows are multiplied: as of ``put_turning``.
    """
    for c in range(s.touch_count, s.law_count):
        k, least = s.key[c] - DECLARED, 0.0
        if s.under[c] >= 0:
            s.grip[k] = friction_at(t, s, c, 1, 0.0, system, loops)
            for i in range(12, 36):
                s.J[c, i] *= s.grip[k]
            least = s.grip[k]
        elif s.declared_law[k] != 0:
            _, u1, u2 = velocity_of(s, c, s.before)
            speed = math.sqrt(u1 * u1 + u2 * u2)
            slides, sticks = (friction_at(t, s, c, 1, speed, system, loops),
                              friction_at(t, s, c, 1, 0.0, system, loops))  # fmt: skip
            across, held = (friction_at(t, s, c, 2, speed, system, loops),
                            friction_at(t, s, c, 2, 0.0, system, loops))  # fmt: skip
            s.declared_mu[k], s.declared_mu_s[k] = slides, sticks
            s.declared_ratio[k] = max(across / slides, THIN) if slides > 0.0 else 1.0
            s.declared_ratio_s[k] = max(held / sticks, THIN) if sticks > 0.0 else 1.0
            least = s.grip[k] = min(slides, sticks)
        if not least >= 0.0:
            s.driving = k
            return False
    return True


@compiled
def friction_at(
    t: float, s: StepArrays, c: int, along: int, speed: float, system: System, loops: Any
) -> float:
    """Friction of a normal force of one where a contact slides along a tangent, 1 or 2."""
    number = s.key[c] - DECLARED
    row, J, x = system.contacts[number], s.J[c], pointer(system.multipliers)
    loop, force, first = loops[row[LOOP]], s.rest, row[STATE]
    side, turns = 0 if row[BODY_I] > 0 else 1, 3 * s.declared_turns[number]
    b, sign = row[BODY_I + side], 1.0 - 2.0 * side
    e, presses = J[12 * along + 6 * side + turns :], system.contacts[row[UNDER], ROW]
    for k in range(3):
        system.multipliers[presses + k] = -1.0 if k == 0 else 0.0
        system.states[first + 1 + k] = sign * e[k]
    system.states[first] = SLIDES
    for one in range(2):
        moved, velocity = row[BODY_I + one], system.body[row[BODY_I + one]]
        for k in range(6):
            s.trial[moved, k], velocity[12 + k] = velocity[12 + k], 0.0
            force[moved, k] = 0.0
    for k in range(3 if speed > 0.0 else 0):
        system.body[b, 12 + k] = speed * e[k]
    loop(t, system, row[INTEGERS], row[NUMBERS], 1, pointer(force), x, x)
    found = 0.0
    for k in range(3):
        found -= e[k] * force[b, turns + k]
    for one in range(2):
        moved, velocity = row[BODY_I + one], system.body[row[BODY_I + one]]
        for k in range(6):
            velocity[12 + k] = s.trial[moved, k]
    return found


@compiled
def velocity_of(s: StepArrays, c: int, v: Floats) -> tuple[float, float, float]:
    """Normal and tangential velocities of contact c of velocities of bodies."""
    a, b, J = v[s.bodies[c, 0]], v[s.bodies[c, 1]], s.J[c]
    u0, u1, u2 = 0.0, 0.0, 0.0
    for k in range(6):
        u0 += J[k] * a[k] + J[6 + k] * b[k]
        u1 += J[12 + k] * a[k] + J[18 + k] * b[k]
        u2 += J[24 + k] * a[k] + J[30 + k] * b[k]
    return u0, u1, u2


@compiled
def put_speeds(s: StepArrays, c: int, v: Floats) -> None:
    """Put the velocities of contact c with their bias, ``u``."""
    u, bias = s.u[c], s.bias[c]
    u[0], u[1], u[2] = velocity_of(s, c, v)
    for k in range(3):
        u[k] += bias[k]


@compiled
def put_declared(k: int, s: StepArrays, system: System) -> None:
    """Make a contact of one that is declared."""
    c = s.contact_count
    s.contact_count = c + 1
    s.bodies[c, 0], s.bodies[c, 1] = s.declared_bodies[k, 0], s.declared_bodies[k, 1]
    s.key[c], s.gap[c], s.kind[c], s.under[c] = DECLARED + k, 0.0, s.declared_kind[k], -1
    if s.declared_under[k] >= 0:
        s.under[c] = s.declared_at[s.declared_under[k]]
    s.mu[c], s.e[c], s.ratio[k] = 0.0, s.declared_e[k], 1.0
    if s.kind[c] == CONE:
        s.gap[c], s.mu[c] = system.residual[s.declared_gap[k]], s.declared_mu[k]
    put_rows(c, s, system)


@compiled
def put_rows(c: int, s: StepArrays, system: System) -> None:
    """Put the rows of a declared contact as they are evaluated."""
    k = s.key[c] - DECLARED
    for side in range(6):
        first = s.declared_place[k, side]
        for i in range(6):
            s.J[c, 6 * side + i] = system.D[first + i] if first >= 0 else 0.0
