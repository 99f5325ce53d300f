"""From a state to bodies, functions, forces, rows: what every formulation evaluates.

The integrated state y has the order of u, with the angular velocity in body axes, and more at its
end: the states of elements that have some (docs/decisions/0054), and the work done on the system
(docs/decisions/0002). It reads r, p of all bodies; v, w' of all bodies; states; work.
"""

from typing import Any

from dap3d_core.assembly.arrays import (
    ENERGY,
    RATE,
    SCRATCH,
    TURNED,
    VALUE,
    WRENCH,
    Floats,
    System,
    coordinate_offset,
    velocity_offset,
)
from dap3d_core.assembly.metric import (
    gyroscopic_moment,
    orient_by_state,
    scaled,
    scaled_moment,
    unscaled,
)
from dap3d_core.kernels.array_types import SeparateFloats
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.scalar_math import where


@compiled
def place_bodies(y: Floats, body: Floats, metric: Floats) -> None:
    """Poses and velocities of the bodies of a state: body (r, A, v, w, p), metric (B, w')."""
    n = body.shape[0] - 1
    for b in range(1, n + 1):
        c, f = coordinate_offset(b), velocity_offset(b, n)
        s, k = body[b], metric[b]
        orient_by_state(s, 0, (y[c + 3], y[c + 4], y[c + 5], y[c + 6]))
        w0, w1, w2 = k[16], k[17], k[18] = y[f + 3], y[f + 4], y[f + 5]
        s[0], s[1], s[2] = y[c], y[c + 1], y[c + 2]
        s[12], s[13], s[14] = y[f], y[f + 1], y[f + 2]
        s[15] = s[3] * w0 + s[4] * w1 + s[5] * w2
        s[16] = s[6] * w0 + s[7] * w1 + s[8] * w2
        s[17] = s[9] * w0 + s[10] * w1 + s[11] * w2
        place_metric(s, k)


@compiled_into
def place_states(y: Floats, system: System) -> None:
    """States of elements of a state, whatever its coordinates: they stand before the work."""
    states = system.states
    first = y.shape[0] - 1 - states.shape[0]
    for k in range(states.shape[0]):
        states[k] = y[first + k]


@compiled_into
def place_state(y: Floats, system: System) -> None:
    """Bodies and states of elements as they are in the state y."""
    place_bodies(y, system.body, system.metric)
    place_states(y, system)


@compiled_into
def state_rates(t: float, out: Floats, system: System, loops: Any) -> None:
    """Derivatives of the elements' states into dy/dt, once the multipliers are known.

    Those of forces are known since their wrenches are.
    """
    count = system.states.shape[0]
    first = out.shape[0] - 1 - count
    if count > 0:
        x = system.multipliers
        call_kinds(RATE, RATE, t, system, loops, x, x, x)
    for k in range(count):
        out[first + k] = system.rates[k]


@compiled_into
def place_metric(s: Floats, k: Floats) -> None:
    """B = A U of a body as placed; s: its row of body, k: its row of metric."""
    a00, a01, a02, a10, a11, a12 = s[3], s[4], s[5], s[6], s[7], s[8]
    a20, a21, a22 = s[9], s[10], s[11]
    u00, u01, u02, u11, u12, u22 = k[1], k[2], k[3], k[4], k[5], k[6]
    k[7], k[8], k[9] = a00 * u00, a00 * u01 + a01 * u11, a00 * u02 + a01 * u12 + a02 * u22
    k[10], k[11], k[12] = a10 * u00, a10 * u01 + a11 * u11, a10 * u02 + a11 * u12 + a12 * u22
    k[13], k[14], k[15] = a20 * u00, a20 * u01 + a21 * u11, a20 * u02 + a21 * u12 + a22 * u22


@compiled_into
def call_kinds(
    first: int,
    last: int,
    t: float,
    system: System,
    loops: Any,
    out1: Floats,
    out2: Floats,
    out3: Floats,
) -> None:
    """Call the group loops of the kinds (assembly.system.KINDS) from first to last."""
    groups, kinds = system.groups, system.kinds
    p1, p2, p3 = pointer(out1), pointer(out2), pointer(out3)
    for q in range(kinds[first], kinds[last + 1]):
        loop = loops[q]
        loop(t, system, groups[q, 0], groups[q, 1], groups[q, 2], p1, p2, p3)


@compiled_into
def place(t: float, y: Floats, system: System, loops: Any) -> None:
    """Bodies, states and functions of time at time t in the state y; writes into ``force``."""
    place_state(y, system)
    call_kinds(VALUE, VALUE, t, system, loops, system.force, system.force, system.force)


@compiled
def zero(values: Floats) -> None:
    """Fill with zeros (a slice assignment would compile numpy's error messages)."""
    for k in range(values.shape[0]):
        values[k] = 0.0


@compiled
def copy(out: SeparateFloats, x: Floats) -> None:
    """``out = x``, as long as out is."""
    for i in range(out.size):
        out[i] = x[i]


@compiled
def scale_forces(body: Floats, metric: Floats, force: Floats, out: Floats) -> float:
    """Scaled right-hand side of the bodies into out, from forces; returns the power of these.

    Per body (f, n) becomes (f / sqrt(m), B^T n - U^T (w' x J' w')), the gyroscopic moment included.
    """
    power = 0.0
    for b in range(1, body.shape[0]):
        s, k, o = body[b], metric[b], 6 * b
        f0, f1, f2 = force[o], force[o + 1], force[o + 2]
        n0, n1, n2 = force[o + 3], force[o + 4], force[o + 5]
        power += f0 * s[12] + f1 * s[13] + f2 * s[14] + n0 * s[15] + n1 * s[16] + n2 * s[17]
        J = s[23], s[24], s[25], s[27], s[28], s[31]
        g0, g1, g2 = gyroscopic_moment(J, (k[16], k[17], k[18]))
        out[o], out[o + 1], out[o + 2] = f0 * k[0], f1 * k[0], f2 * k[0]
        g0, g1, g2 = scaled_moment(k, g0, g1, g2)
        out[o + 3] = k[7] * n0 + k[10] * n1 + k[13] * n2 - g0
        out[o + 4] = k[8] * n0 + k[11] * n1 + k[14] * n2 - g1
        out[o + 5] = k[9] * n0 + k[12] * n1 + k[15] * n2 - g2
    return power


@compiled_into
def add_force(b: int, force: Floats, out: Floats, system: System, power: float) -> float:
    """Add the force on body b, and its moment, to scaled forces ``out``; the power with theirs."""
    s, k, o = system.body[b], system.metric[b], 6 * b
    n0, n1, n2 = force[o + 3], force[o + 4], force[o + 5]
    for c in range(6):
        power += force[o + c] * s[12 + c]
    for c in range(3):
        out[o + c] += k[0] * force[o + c]
        out[o + 3 + c] += k[7 + c] * n0 + k[10 + c] * n1 + k[13 + c] * n2
    return power


@compiled
def scale_velocities(body: Floats, metric: Floats, out: Floats) -> None:
    """The velocities of the bodies in scaled coordinates: (sqrt(m) v, L^T w')."""
    for b in range(1, body.shape[0]):
        s, k, o = body[b], metric[b], 6 * b
        out[o], out[o + 1], out[o + 2] = s[12] / k[0], s[13] / k[0], s[14] / k[0]
        out[o + 3], out[o + 4], out[o + 5] = scaled(k, k[16], k[17], k[18])


@compiled
def rates(y: Floats, metric: Floats, acceleration: Floats, out: Floats) -> None:
    """dy/dt: of coordinates from y, of velocities from the scaled accelerations."""
    n, a = metric.shape[0] - 1, acceleration
    for b in range(1, n + 1):
        c, f, o, k = coordinate_offset(b), velocity_offset(b, n), 6 * b, metric[b]
        e0, e1, e2, e3 = y[c + 3], y[c + 4], y[c + 5], y[c + 6]
        w0, w1, w2 = 0.5 * y[f + 3], 0.5 * y[f + 4], 0.5 * y[f + 5]
        out[c], out[c + 1], out[c + 2] = y[f], y[f + 1], y[f + 2]
        out[c + 3] = -e1 * w0 - e2 * w1 - e3 * w2
        out[c + 4] = e0 * w0 - e3 * w1 + e2 * w2
        out[c + 5] = e3 * w0 + e0 * w1 - e1 * w2
        out[c + 6] = -e2 * w0 + e1 * w1 + e0 * w2
        out[f], out[f + 1], out[f + 2] = k[0] * a[o], k[0] * a[o + 1], k[0] * a[o + 2]
        a0, a1, a2 = unscaled(k, a[o + 3], a[o + 4], a[o + 5])
        out[f + 3], out[f + 4], out[f + 5] = a0, a1, a2


@compiled_into
def put_rates(t: float, y: Floats, power: float, out: Floats, system: System, loops: Any) -> None:
    """dy/dt from ``acceleration`` and ``multipliers``; the power is the rate of the work."""
    rates(y, system.metric, system.acceleration, out)
    state_rates(t, out, system, loops)
    out[out.shape[0] - 1] = power


@compiled
def global_accelerations(metric: Floats, acceleration: Floats, out: Floats) -> None:
    """v_dot (6 n: r_ddot, omega_dot, global) from the scaled accelerations: omega_dot = B a."""
    for b in range(1, metric.shape[0]):
        o, k = 6 * b, metric[b]
        a0, a1, a2 = acceleration[o + 3], acceleration[o + 4], acceleration[o + 5]
        for c in range(3):
            out[o - 6 + c] = k[0] * acceleration[o + c]
            out[o - 3 + c] = k[7 + 3 * c] * a0 + k[8 + 3 * c] * a1 + k[9 + 3 * c] * a2


@compiled_into
def report_energy(t: float, out: Floats, system: System, loops: Any) -> None:
    """Potential energy, fourth from the end of out; angles of elements, behind the multipliers."""
    value = system.settings[SCRATCH : SCRATCH + 1]
    value[0] = 0.0
    call_kinds(ENERGY, ENERGY, t, system, loops, value, value, value)
    out[out.shape[0] - 4] = value[0]
    value[0] = 0.0
    angles = out[6 * (system.body.shape[0] - 1) + system.row.shape[0] :]
    call_kinds(TURNED, TURNED, t, system, loops, angles, value, value)


@compiled
def largest_weighted(values: Floats, weights: Floats) -> float:
    """Largest magnitude of values times weights; NaN where one is NaN."""
    found = 0.0
    for k in range(values.shape[0]):
        size = abs(values[k]) * weights[k]
        found = where((size > found) | (size != size), size, found)
    return found


@compiled
def largest(values: Floats) -> float:
    """Largest magnitude; NaN where one is NaN."""
    found = 0.0
    for k in range(values.shape[0]):
        size = abs(values[k])
        found = where((size > found) | (size != size), size, found)
    return found


@compiled_into
def evaluate_forces(t: float, y: Floats, system: System, loops: Any) -> float:
    """Place the bodies of a state; scaled forces into ``acceleration``; returns their power.

    Functions of time stand ready after that.
    """
    body, metric, force = system.body, system.metric, system.force
    place_state(y, system)
    zero(force)
    call_kinds(VALUE, WRENCH, t, system, loops, force, force, force)
    return scale_forces(body, metric, force, system.acceleration)
