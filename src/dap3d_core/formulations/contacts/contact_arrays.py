"""Arrays on which compiled code decides what contacts do at an instant."""

from typing import Any, ClassVar

import attrs
import numpy as np

from dap3d_core.formulations.contacts.cone import Cone, cone_of
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import (
    INTEGER_MATRIX,
    INTEGERS,
    MATRIX,
    TENSOR,
    Arrays,
    Scalar,
)


def _integer() -> Scalar[int]:
    return Scalar("integer")


@attrs.define(eq=False, kw_only=True, slots=False)
class ContactArrays(Arrays):
    """Contacts at one instant: m of them, of which l have friction that a joint loads.

    Sets of contacts are their numbers, ascending, and how many they are; or 1 for each that is in
    it. Directions are in the frames of contacts: normal, tangents.
    """

    types: ClassVar[dict[str, Any]] = {
        "cone": Cone.type_of(),
        **dict.fromkeys(
            ("integer", "newton", "alone", "load_row", "load_count", "load_pushes", "touching",
             "closed", "group", "kept", "mine", "begins", "leaves", "gone", "slides", "slipping",
             "jams", "order", "rows", "before", "along_with"),
            INTEGERS,
        ),
        **dict.fromkeys(("holds", "feels"), INTEGER_MATRIX),
        **dict.fromkeys(
            ("W", "reaction", "slip", "begin_way", "along", "way", "near", "force", "B", "w",
             "taken", "rests"),
            MATRIX,
        ),
        "frames": TENSOR,
    }  # fmt: skip

    touching_count = _integer()
    closed_count = _integer()
    group_count = _integer()
    kept_count = _integer()
    mine_count = _integer()

    cone: Cone
    integer: Integers
    # constants
    mu: Floats  # (m,) along the first tangent, and along the second as a part of that
    mu_s: Floats
    ratio: Floats
    ratio_s: Floats
    e: Floats
    length: Floats  # of the scene, m, and 1 of what turns
    gapless: Floats  # 1 where the first row is one of slip, and not along a normal
    newton: Integers  # 1 where the law of impact is Newton's
    alone: Integers  # 1 of friction without a gap: of joints
    holds: Integers  # (m, 3) 1 of rows that act where it sticks
    load_row: Integers  # (m,) first row of the joint that loads its friction, their number, and 1
    load_count: Integers  # where that pushes alone; none where there is no such load
    load_pushes: Integers
    # at the instant, as if all contacts stuck, with the joints held
    W: Floats  # (3 m, 3 m) changes of slip by impulses
    free: Floats  # (3 m,) rates of slip where all contacts are open
    slip: Floats  # (m, 3)
    load: Floats  # (m,) of friction alone, by which mu is multiplied
    frames: Floats  # (m, 3, 3)
    feels: Integers  # (m, m) 1 where one changes slip or load of the other
    lam_free: Floats  # (rows,) multipliers of joints where all contacts are open
    reaction: Floats  # (rows, 3 m) their changes by forces
    # what is asked for
    touching: Integers  # contacts of no gap
    begins: Integers  # 1 of those at rest that begin to slide, and the direction of that
    begin_way: Floats
    leaves: Integers  # 1 of those whose normal force has just vanished
    # what is found
    mode: Floats  # (m,) 0 open, 1 slides, 2 sticks
    way: Floats  # (m, 3) directions of sliding, as long as ``length``, zero where none is known; of
    near: Floats  # friction alone that sticks 1 for rows that do not hold, as others hold that;
    force: Floats  # forces on body i of those that share, global axes; forces in their frames
    jams: Integers  # 1 of contacts that jam
    # of the set that is worked on
    closed: Integers
    group: Integers
    kept: Integers
    before: Integers
    gone: Integers  # 1 of what has left, and of what leaves with it
    along_with: Integers
    slides: Integers  # 1 of contacts that slide, the direction, and what begins to slip
    along: Floats
    slipping: Integers
    inner: Floats  # (3 m,) forces well within cones; accelerations
    rates: Floats
    sizes: Floats  # (m,) of accelerations: part of one is rounding
    # of loads
    mine: Integers  # contacts with such
    loads: Floats  # (l,) taken, given
    given: Floats
    taken: Floats  # (l + 1, l) the last ones, and what they missed
    rests: Floats
    # scratch
    rows: Integers  # (3 m,)
    B: Floats  # factors
    w: Floats
    order: Integers
    x: Floats
    direction: Floats  # (3,)


def contact_arrays(m: int, rows: int, loads: int, given: dict[str, Any]) -> ContactArrays:
    """Arrays of m contacts, beside so many rows of joints, with so many loads.

    given: arrays of coefficients.
    """
    n = 3 * m
    whole = ("newton", "alone", "load_row", "load_count", "load_pushes", "touching", "begins",
             "leaves", "jams", "closed", "group", "kept", "gone", "slides", "slipping",
             "mine", "before", "along_with")  # fmt: skip
    arrays: dict[str, Any] = {
        **{name: np.zeros(m, dtype=np.int64) for name in whole},
        **{name: np.zeros(m) for name in ("load", "mode", "sizes")},
        **{name: np.zeros((m, 3)) for name in (
            "slip", "begin_way", "along", "way", "near", "force")},
        **{name: np.zeros(n) for name in ("free", "inner", "rates", "x")},
        **{name: np.zeros((n, n)) for name in ("W", "B")},
        **{name: np.zeros(n, dtype=np.int64) for name in ("rows", "order")},
        **{name: np.zeros(loads) for name in ("loads", "given")},
        **{name: np.zeros((loads + 1, loads)) for name in ("taken", "rests")},
    }  # fmt: skip
    return ContactArrays(
        **given,
        **arrays,
        cone=cone_of(m),
        integer=np.zeros(len(ContactArrays.indices("integer")), dtype=np.int64),
        holds=np.ones((m, 3), dtype=np.int64),
        feels=np.zeros((m, m), dtype=np.int64),
        direction=np.zeros(3),
        frames=np.zeros((m, 3, 3)),
        lam_free=np.zeros(rows),
        reaction=np.zeros((rows, n)),
        w=np.zeros((3, n)),
    )
