"""Arrays on which compiled code decides what contacts do at an instant."""

from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.contacts.cone import Cone, cone_of
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import (
    Arrays,
    IntegerMatrix,
    Matrix,
    Scalar,
    Tensor,
)


def _integer() -> Scalar[int]:
    return Scalar("integer")


def _real() -> Scalar[float]:
    return Scalar("real")


@attrs.define(eq=False, kw_only=True, slots=False)
class ContactOutputs(Arrays):
    """What contacts say of themselves, by the loops of their types.

    Its numbers are those of the kernel ``tension`` (interface/contacts/rows.py).
    """

    groups: IntegerMatrix  # (loops, 5) i0, p0, count; numbers of a contact; first of ``which``
    which: Integers  # (m,) contacts, in the order of the loops
    found: Matrix  # (m, WIDTH)
    values: Floats  # scratch of a loop
    place: Floats  # (1,)


@attrs.define(eq=False, kw_only=True, slots=False)
class ContactArrays(Arrays):
    """Contacts at one instant: m of them, of which l have friction that a joint loads.

    Sets of contacts are their numbers, ascending, and how many they are; or 1 for each that is in
    it. Directions are in the frames of contacts: normal, tangents.
    """

    touching_count = _integer()
    closed_count = _integer()
    group_count = _integer()
    kept_count = _integer()
    mine_count = _integer()
    in_touch_count = _integer()
    is_free = _integer()  # 1: ``free`` is of the present velocities
    starts = _integer()  # 1 at the start of a run
    repeats = _integer()  # 1 where loads are shared by contacts whose modes are known
    jammed = _integer()  # a contact that has been found to jam, or -1
    freed = _integer()  # how often impulses without a collision have ended a jam
    culprit = _integer()  # a contact with which no motion goes on
    round_count = _integer()  # of those kept
    exchanged = _real()  # J, sum of the magnitudes of work
    taken_work = _real()  # J, of joints and drivers that velocities have been brought onto

    cone: Cone
    says: ContactOutputs
    integer: Integers
    real: Floats
    # constants
    mu: Floats  # (m,) along the first tangent, and along the second as a part of that
    mu_s: Floats
    ratio: Floats
    ratio_s: Floats
    e: Floats
    length: Floats  # (m,) of the scene, m
    speed: Floats  # that in the time of the scene, m/s
    rounding: Floats  # of gaps, m
    arm: Floats  # of what turns that length, which makes it slip; else 1
    gapless: Floats  # 1 where the first row is one of slip, and not along a normal
    newton: Integers  # 1 where the law of impact is Newton's
    alone: Integers  # 1 of friction without a gap: of joints
    under: Integers  # of what resists rolling the contact whose normal force bounds it; else -1
    holds: IntegerMatrix  # (m, 3) 1 of rows that act where it sticks
    turns: Floats  # 1 of those whose gap or slip is an angle
    state: Integers  # the first of their numbers among the states of elements
    switches: IntegerMatrix  # (m, 2) among those of the model
    frame_body: Integers  # a body, and 1 or -1: its block of their rows is the frame
    frame_sign: Floats
    model_row: Integers  # rows of the model, in the order of the plan
    load_row: Integers  # (m,) first row of the joint that loads its friction, their number, and 1
    load_count: Integers  # where that pushes alone; none where there is no such load
    load_pushes: Integers
    # at the instant, as if all contacts stuck, with the joints held
    y: Floats  # the state in coordinates of bodies
    placed: Floats  # the same with present velocities
    report: Floats
    v: Floats  # (6 n,) r_dot and omega at present, and before
    v_before: Floats
    push: Floats  # changes of them, or small r and rotation vectors
    J: Matrix  # (rows of all, 6 n) along global axes, and scaled
    scaled: Matrix
    unit: Floats  # (rows,) of joints: 1 over their lengths, and scratch
    unit_of: Floats
    K: Matrix  # (rows, 6 n) their factors; columns of the pseudo-inverse
    answers: Matrix
    moves: Matrix  # (3 m, 6 n) changes of scaled velocities by unit impulses
    driven: Matrix  # (m, 3) velocity of the motion that drivers prescribe
    W: Matrix  # (3 m, 3 m) changes of slip by impulses
    free: Floats  # (3 m,) rates of slip where all contacts are open
    slip: Matrix  # (m, 3)
    closing: Floats  # (m,) rates of gaps
    load: Floats  # (m,) of friction alone, by which mu is multiplied
    frames: Tensor  # (m, 3, 3)
    feels: IntegerMatrix  # (m, m) 1 where one changes slip or load of the other
    lam_free: Floats  # (rows,) multipliers of joints where all contacts are open
    reaction: Matrix  # (rows, 3 m) their changes by forces
    # what is asked for
    ended: IntegerMatrix  # (m, 2) 1 of switches that have changed their sign
    limit: Floats  # (m,) gaps below which bodies touch
    touching: Integers  # contacts of no gap
    begins: Integers  # 1 of those at rest that begin to slide, and the direction of that
    begin_way: Matrix
    leaves: Integers  # 1 of those whose normal force has just vanished
    # what is found
    mode: Floats  # (m,) 0 open, 1 slides, 2 sticks
    way: Matrix  # (m, 3) directions of sliding, as long as ``speed``, zero where none is known; of
    near: Matrix  # what sticks that length for rows that do not hold, as others hold that;
    force: Matrix  # forces on body i of those that share, global axes; forces in their frames
    jams: Integers  # 1 of contacts that jam
    moved: Floats  # (6 n,) small r and rotation vectors
    # of an event
    was: Floats  # (m,) modes before
    in_touch: Integers  # contacts that touch
    stops: Integers  # 1 of those whose slip is stopped
    opening: Integers  # 1 of those that open again at once
    impulses: Matrix  # (m, 3); work, J, of each and of drivers that it makes work
    work: Floats
    rests_soon: Integers  # 1 of those whose bounces end, and how long these take, s
    rest_time: Floats
    is_low: Integers  # 1 of those that are held, as they would be back at once
    e_now: Floats
    taking: IntegerMatrix  # (rounds, m) 1 of those that take part, with restitution; -1: slip ends
    restitution: Matrix
    slips: Matrix  # (rounds m, 3) slip before each of them
    role: Integers  # of ``lift``: 1 of what it holds, 2 of what it lets not be less than ``least``
    values: Floats
    least: Floats
    is_active: Integers
    active: Integers
    kept_way: Matrix
    # of the set that is worked on
    closed: Integers
    group: Integers
    kept: Integers
    before: Integers
    gone: Integers  # 1 of what has left, and of what leaves with it
    along_with: Integers
    slides: Integers  # 1 of contacts that slide, the direction, and what begins to slip
    along: Matrix
    slipping: Integers
    inner: Floats  # (3 m,) forces well within cones; accelerations
    rates: Floats
    sizes: Floats  # (m,) of accelerations: part of one is rounding
    # of loads
    mine: Integers  # contacts with such
    loads: Floats  # (l,) taken, given
    given: Floats
    taken: Matrix  # (l + 1, l) the last ones, and what they missed
    rests: Matrix
    # scratch
    rows: Integers  # (3 m,)
    B: Matrix  # factors
    w: Matrix
    order: Integers
    x: Floats
    right: Floats  # right-hand sides
    direction: Floats  # (3,)


#: Vectors of m numbers, and of m directions or points.
WHOLE = (
    "load_row", "load_count", "load_pushes", "touching", "begins", "leaves",
    "jams", "closed", "group", "kept", "gone", "slides", "slipping", "mine", "before", "along_with",
    "in_touch", "stops", "opening", "is_low", "rests_soon", "role", "is_active", "active",
)  # fmt: skip
NUMBERS = (
    "load", "mode", "sizes", "closing", "limit", "was", "work", "rest_time", "e_now",
    "values", "least",
)  # fmt: skip
DIRECTIONS = (
    "slip", "begin_way", "along", "way", "near", "force", "driven", "impulses", "kept_way"
)  # fmt: skip


def contact_arrays(
    m: int, rows: int, loads: int, rounds: int, given: dict[str, Any]
) -> ContactArrays:
    """Arrays of m contacts, beside so many rows of joints, with so many loads.

    rounds: of an impact that are kept. given: arrays of coefficients, y and v among them.
    """
    n, size = 3 * m, len(given["v"])
    longest = max(n, rows, size)
    arrays: dict[str, Any] = {
        **{name: np.zeros(m, dtype=np.int64) for name in WHOLE},
        **{name: np.zeros(m) for name in NUMBERS},
        **{name: np.zeros((m, 3)) for name in DIRECTIONS},
        **{name: np.zeros(n) for name in ("free", "rates")},
        **{name: np.zeros((n, n)) for name in ("W", "B")},
        **{name: np.zeros(longest) for name in ("inner", "x", "right")},
        **{name: np.zeros(size) for name in ("v_before", "push", "moved")},
        **{name: np.zeros(rows) for name in ("lam_free", "unit", "unit_of")},
        **{name: np.zeros((rows, size)) for name in ("K", "answers")},
        **{name: np.zeros((rows + n, size)) for name in ("J", "scaled")},
        **{name: np.zeros(loads) for name in ("loads", "given")},
        **{name: np.zeros((loads + 1, loads)) for name in ("taken", "rests")},
    }  # fmt: skip
    return ContactArrays(
        **given,
        **arrays,
        cone=cone_of(m),
        integer=np.zeros(len(ContactArrays.indices("integer")), dtype=np.int64),
        real=np.zeros(len(ContactArrays.indices("real"))),
        placed=np.zeros_like(given["y"]),
        moves=np.zeros((n, size)),
        rows=np.zeros(n, dtype=np.int64),
        order=np.zeros(longest, dtype=np.int64),
        ended=np.zeros((m, 2), dtype=np.int64),
        feels=np.zeros((m, m), dtype=np.int64),
        taking=np.zeros((rounds, m), dtype=np.int64),
        restitution=np.zeros((rounds, m)),
        slips=np.zeros((rounds * m, 3)),
        direction=np.zeros(3),
        frames=np.zeros((m, 3, 3)),
        reaction=np.zeros((rows, n)),
        w=np.zeros((3, longest)),
    )
