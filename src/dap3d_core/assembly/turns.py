"""Angles of joints with their whole turns, counted at accepted steps.

A pose gives an angle but for whole turns. They follow from the angle at the last accepted step and
the mean of the rates at both ends of the step: a step whose ends disagree is too long, and is
shortened (integrators/stepping/turns.py). An angle that is a coordinate of the state (joint
coordinates) is taken from there, whatever the length of the step.

Joints with one or two rotations are counted; the motion is that of assembly/motion/coordinates.py.
"""

import math
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Floats, System, coordinate_offset, velocity_offset
from dap3d_core.assembly.metric import in_body_axes
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.runtime.loop_support import TURN, P, R, V, W, vector_in
from dap3d_core.kernels.scalar_math import atan2, where
from dap3d_core.kernels.vectors import add, cross, dot, scale, sub

#: Columns of ``System.turns``, an angle in each row: index in y of the coordinate that is the
#: angle, and of its rate, -1 where poses give it; bodies i and j; which rotation it is; its first
#: state and its first constant in ``par``.
COORDINATE, COORDINATE_RATE, BODY_I, BODY_J, ROTATION, STATE, CONSTANTS, COLUMNS = range(8)
#: Of a joint with two rotations there is a first and a second one.
ONLY, FIRST, SECOND = range(3)

# State of an angle: itself, its rate and the time at the last accepted step, and at the one before;
# the same at the end of a step that is being tried; what a coordinate is short of the angle, at the
# last accepted step and within it.
(
    ANGLE, RATE, TIME, ANGLE_BEFORE, RATE_BEFORE, TIME_BEFORE, NEXT, NEXT_RATE, NEXT_TIME,
    OFFSET, OFFSET_BEFORE, STATE_WIDTH
) = range(12)  # fmt: skip
# Constants of an angle, with the axes of body i in its pose T0 relative to body j: Euler parameters
# and position of T0; axes of the first and second rotation; a vector of body i, and where it is
# zero a point of the first axis; 1 where the vector is one to a point, of parallel axes.
P_0, R_0, AXIS_1, AXIS_2, ARM, CENTRE, IS_POINT, CONSTANT_WIDTH = 0, 4, 7, 10, 13, 16, 19, 20

#: Two turns, after which Euler parameters are the same again; coordinates are kept within them, so
#: that the tolerance of an angle does not grow with its turns.
TWO_TURNS = 2.0 * TURN

Tuple = Any


@compiled_into
def body_vector(s: Floats, v: Tuple) -> Tuple:
    """A^T v: a global vector along the axes of a body; s: its row of ``System.body``."""
    return in_body_axes(s, v[0], v[1], v[2])


@compiled_into
def after(c: float, v: Tuple, e: float, u: Tuple) -> Tuple:
    """Euler parameters (c, v) (e, u) as scalar and vector."""
    return c * e - dot(v, u), add(add(scale(c, u), scale(e, v)), cross(v, u))


@compiled_into
def rotated(c: float, v: Tuple, x: Tuple) -> Tuple:
    """A vector rotated by Euler parameters (c, v)."""
    across = cross(v, x)
    return add(x, scale(2.0, add(scale(c, across), cross(v, across))))


@compiled_into
def rotation_of(system: System, k: int) -> Tuple:
    """Euler parameters, as scalar and vector, by which body i has rotated since T0; T0^-1 T."""
    par, row = system.par, system.turns[k]
    i, j, n = system.body[row[BODY_I]], system.body[row[BODY_J]], row[CONSTANTS]
    c, v = after(j[P], scale(-1.0, vector_in(j, P + 1)), i[P], vector_in(i, P + 1))
    return after(par[n + P_0], scale(-1.0, vector_in(par, n + P_0 + 1)), c, v)


@compiled_into
def spin_of(system: System, k: int) -> Tuple:
    """Angular velocity of body i relative to body j, in axes of body i."""
    i, j = system.body[system.turns[k, BODY_I]], system.body[system.turns[k, BODY_J]]
    return body_vector(i, sub(vector_in(i, W), vector_in(j, W)))


@compiled
def measure_last(system: System, k: int) -> None:
    """Angle in [-pi, pi] and rate of the only or the second rotation into NEXT, NEXT_RATE."""
    par, row = system.par, system.turns[k]
    state, n = par[row[STATE] :], row[CONSTANTS]
    axis, w = vector_in(par, n + AXIS_2), spin_of(system, k)
    c, v = rotation_of(system, k)
    rate = dot(axis, w)
    if row[ROTATION] == SECOND:  # the first one has just been measured
        first, one = par[system.turns[k - 1, STATE] :], vector_in(par, n + AXIS_1)
        half = 0.5 * first[NEXT]
        c, v = after(math.cos(half), scale(-math.sin(half), one), c, v)
        rate -= dot(one, axis) * first[NEXT_RATE]
    angle = 2.0 * atan2(dot(axis, v), c)
    state[NEXT], state[NEXT_RATE] = angle - TURN * np.rint(angle / TURN), rate


@compiled
def measure_first(system: System, k: int) -> None:
    """Angle in (-pi, pi] and rate of the first of two rotations into NEXT, NEXT_RATE.

    It is that about the first axis of a vector of body i along the second one or, where the axes
    are parallel, from the first one to a point of the second.
    """
    par, row = system.par, system.turns[k]
    i, j = system.body[row[BODY_I]], system.body[row[BODY_J]]
    state, n = par[row[STATE] :], row[CONSTANTS]
    axis, arm = vector_in(par, n + AXIS_1), vector_in(par, n + ARM)
    is_point, centre = par[n + IS_POINT], vector_in(par, n + CENTRE)
    c, v = rotation_of(system, k)
    moved, w = rotated(c, v, arm), rotated(c, v, spin_of(system, k))
    way = sub(vector_in(i, R), vector_in(j, R))
    speed = sub(sub(vector_in(i, V), vector_in(j, V)), cross(vector_in(j, W), way))
    back, turn = par[n + P_0], scale(-1.0, vector_in(par, n + P_0 + 1))
    way = rotated(back, turn, sub(body_vector(j, way), vector_in(par, n + R_0)))
    speed = rotated(back, turn, body_vector(j, speed))
    start = sub(arm, scale(is_point, centre))
    now = add(moved, scale(is_point, sub(way, centre)))
    rate = add(cross(w, moved), scale(is_point, speed))
    along = dot(axis, now)
    state[NEXT] = atan2(dot(axis, cross(start, now)), dot(start, now) - dot(axis, start) * along)
    state[NEXT_RATE] = dot(axis, cross(now, rate)) / (dot(now, now) - along * along)


@compiled_into
def pose_and_spin(y: Floats, n: int, b: int) -> Tuple:
    """Euler parameters of body b of n and its angular velocity in its axes, from the state y."""
    c, v, w = 1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if b > 0:
        k, f = coordinate_offset(b), velocity_offset(b, n)
        c, v, w = y[k + 3], vector_in(y, k + 4), vector_in(y, f + 3)
    return c, v, w


@compiled
def measure_in_state(y: Floats, system: System, k: int) -> None:
    """As ``measure_last``, of the only rotation of a joint, from a state y of bodies."""
    par, row, count = system.par, system.turns[k], system.body.shape[0] - 1
    state, n = par[row[STATE] :], row[CONSTANTS]
    axis = vector_in(par, n + AXIS_2)
    c_i, v_i, w_i = pose_and_spin(y, count, row[BODY_I])
    c_j, v_j, w_j = pose_and_spin(y, count, row[BODY_J])
    c, v = after(c_j, scale(-1.0, v_j), c_i, v_i)
    state[NEXT_RATE] = dot(axis, sub(w_i, rotated(c, scale(-1.0, v), w_j)))
    c, v = after(par[n + P_0], scale(-1.0, vector_in(par, n + P_0 + 1)), c, v)
    angle = 2.0 * atan2(dot(axis, v), c)
    state[NEXT] = angle - TURN * np.rint(angle / TURN)


@compiled_into
def is_doubtful(rise: float, before: float, rate: float, h: float, has_length: bool) -> float:
    """1.0 if an angle may be miscounted in a step of length h, else 0.0 (loop_support.doubtful)."""
    if abs(rate - before) * h > 0.5 * TURN or abs(rise - 0.5 * (before + rate) * h) > 0.25 * TURN:
        return 1.0
    return 1.0 if has_length and abs(rise) > 0.5 * TURN else 0.0


@compiled
def measure(t: float, y: Floats, system: System, k: int) -> None:
    """Angle and rate of an angle by the bodies as placed; those of a joint in their order.

    y: a state of bodies, which are not placed; else empty.
    """
    if y.shape[0] > 0:
        measure_in_state(y, system, k)
    elif system.turns[k, ROTATION] == FIRST:
        measure_first(system, k)
    else:
        measure_last(system, k)
    s = system.par[system.turns[k, STATE] :]
    expected = s[ANGLE] + 0.5 * (t - s[TIME]) * (s[RATE] + s[NEXT_RATE])
    s[NEXT], s[NEXT_TIME] = near(s[NEXT], expected), t


@compiled_into
def near(angle: float, expected: float) -> float:
    """The angle with the whole turns by which it is nearest to the one expected."""
    return angle + TURN * np.rint((expected - angle) / TURN)


@compiled
def doubtful_angles(t: float, y: Floats, system: System, has_length: bool) -> float:
    """Number of angles whose turns are not certain at the end t of a step.

    y: as of ``measure``. has_length: its length was given, and is not limited by its error.
    """
    turns, doubtful = system.turns, 0.0
    for k in range(turns.shape[0]):
        if turns[k, COORDINATE] < 0:
            measure(t, y, system, k)
            s = system.par[turns[k, STATE] :]
            doubtful += is_doubtful(
                s[NEXT] - s[ANGLE], s[RATE], s[NEXT_RATE], t - s[TIME], has_length
            )
    return doubtful


@compiled
def needs_places(system: System) -> bool:
    """True if bodies have to be placed to measure: joints with two rotations."""
    found = False
    for k in range(system.turns.shape[0]):
        found = found or system.turns[k, ROTATION] != ONLY
    return found


@compiled
def has_measured(t: float, system: System) -> bool:
    """True if the angles that poses give are known at time t."""
    turns = system.turns
    for k in range(turns.shape[0]):
        if turns[k, COORDINATE] < 0 and system.par[turns[k, STATE] + NEXT_TIME] != t:
            return False
    return True


@compiled
def measure_all(t: float, y: Floats, system: System) -> None:
    """Measure the angles that poses give; y: as of ``measure``."""
    turns = system.turns
    for k in range(turns.shape[0]):
        if turns[k, COORDINATE] < 0:
            measure(t, y, system, k)


@compiled
def keep_turns(t: float, y: Floats, system: System, from_end: bool) -> None:
    """Take over the angles at an accepted state y, which has been measured.

    Coordinates are brought within two turns. from_end: reported states within the step continue
    those at its end; else those at its start.
    """
    turns = system.turns
    for k in range(turns.shape[0]):
        s, i = system.par[turns[k, STATE] :], turns[k, COORDINATE]
        s[ANGLE_BEFORE], s[RATE_BEFORE], s[TIME_BEFORE] = s[ANGLE], s[RATE], s[TIME]
        s[TIME] = t
        if i < 0:
            s[ANGLE], s[RATE], s[NEXT_TIME] = s[NEXT], s[NEXT_RATE], -1.0
        else:
            s[ANGLE], s[RATE] = y[i] + s[OFFSET], y[turns[k, COORDINATE_RATE]]
            s[OFFSET_BEFORE] = s[OFFSET]
            if abs(y[i]) > TWO_TURNS:
                whole = TWO_TURNS * np.rint(y[i] / TWO_TURNS)
                y[i] -= whole
                s[OFFSET] += whole
            if from_end:
                s[OFFSET_BEFORE] = s[OFFSET]


@compiled
def begin_turns(t: float, y: Floats, system: System) -> None:
    """Begin to count at a state y, where the bodies are, within half a turn of the angles given."""
    turns = system.turns
    for k in range(turns.shape[0]):
        s, i = system.par[turns[k, STATE] :], turns[k, COORDINATE]
        s[TIME], s[RATE] = t, 0.0
        measure(t, y[:0], system, k)
        s[ANGLE], s[RATE], s[NEXT_TIME] = s[NEXT], s[NEXT_RATE], -1.0
        s[ANGLE_BEFORE], s[RATE_BEFORE], s[TIME_BEFORE] = s[ANGLE], s[RATE], t
        if i >= 0:
            s[OFFSET] = s[OFFSET_BEFORE] = s[ANGLE] - y[i]


@compiled
def follow_poses(t: float, system: System) -> None:
    """Count all angles up to the bodies as placed, less than half a turn from what rates say."""
    turns = system.turns
    for k in range(turns.shape[0]):
        measure(t, system.par[:0], system, k)
        s = system.par[turns[k, STATE] :]
        s[ANGLE_BEFORE], s[RATE_BEFORE], s[TIME_BEFORE] = s[ANGLE], s[RATE], s[TIME]
        s[ANGLE], s[RATE], s[TIME] = s[NEXT], s[NEXT_RATE], t


@compiled
def report_turns(t: float, y: Floats, out: Floats, system: System) -> None:
    """Angles at an instant of the last accepted step, or near its end, into ``out``.

    y: the state; empty where all angles are taken from the bodies as placed.
    """
    turns = system.turns
    for k in range(turns.shape[0]):
        s, i = system.par[turns[k, STATE] :], turns[k, COORDINATE]
        if 0 <= i < y.shape[0]:
            out[k] = y[i] + where(t < s[TIME], s[OFFSET_BEFORE], s[OFFSET])
        else:
            measure(t, y[:0], system, k)
            out[k] = near(s[NEXT], expected_angle(t, s))
            s[NEXT_TIME] = -1.0


@compiled_into
def expected_angle(t: float, s: Floats) -> float:
    """Angle by those at both ends of the last step and their rates; s: the state of the angle."""
    h, left = s[TIME] - s[TIME_BEFORE], t - s[TIME]
    is_beyond = (left >= 0.0) | (h <= 0.0)
    x, rise = 1.0 + left / where(is_beyond, 1.0, h), s[ANGLE] - s[ANGLE_BEFORE]
    ahead, behind = h * s[RATE_BEFORE], h * s[RATE]
    bend = 3.0 * rise - 2.0 * ahead - behind + x * (ahead + behind - 2.0 * rise)
    within = s[ANGLE_BEFORE] + x * (ahead + x * bend)
    return where(is_beyond, s[ANGLE] + s[RATE] * left, within)
