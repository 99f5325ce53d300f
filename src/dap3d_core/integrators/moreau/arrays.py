"""What a step works on: bodies, the contacts near, rows of joints, and scratch of the solution."""

import itertools
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.collisions.placed_shapes import (
    POSE,
    PlacedShapes,
    placed_shapes,
    with_room,
)
from dap3d_core.formulations.contacts.contact_table import ContactTable
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import Arrays, IntegerMatrix, Matrix, Scalar
from dap3d_core.model import Model

#: Contacts that there is room for at first, besides those declared.
ROOM = 16
#: Columns of a row of contacts that shapes push with: t, i, j, mode, gap, point, normal, force.
MET = 14
#: Reported rows of such contacts that there is room for at first.
LOG_ROOM = 64
#: Pairs of shapes a shape, and points a pair, that exported models have room for; entries of their
#: matrices a body; contacts that joints hold.
MOST_PAIRS, MOST_POINTS, MOST_ENTRIES, MOST_HELD = 32, 8, 16, 100
#: Part of the mass, or moment, of what a joint holds at a body below which that body is light.
LIGHT = 1e-3
#: Unknowns up to which the problem of contacts beside joints is solved alone: those of three. Four
#: may share what they carry, and it gave two feet of a quadruped 67 N, the others 1.
SMALL_SIZE = 9
#: Unknowns up to which the matrix of a pass is a square; that of more has blocks.
DENSE_SIZE = 60
#: Kinds of contacts: with a cone; friction of a joint, or of what rolls, along rows 1 and 2; of a
#: joint along all three.
CONE, ALONE, WHOLE = range(3)
#: What a contact does in a step: it collides, and comes to a stop or bounces; or it stays closed.
STOPS, BOUNCES, STAYS = 1, 2, 3


def _integer() -> Scalar[int]:
    return Scalar("integer")


def _real() -> Scalar[float]:
    return Scalar("real")


@attrs.define(eq=False, kw_only=True, slots=False)
class StepArrays(Arrays):
    """n bodies and ground, c contacts at most, d of them declared, k rows of joints.

    A step reads nothing of it that it did not write, but for what the last one leaves for reports.
    """

    # of the step
    contact_count = _integer()
    touch_count = _integer()  # the first ones, of shapes
    law_count = _integer()  # with those declared; behind them what resists their rolling
    stage = _integer()  # of a step that waits for room: 0, or FREE or MOVED (step.py)
    driving = _integer()  # a declared contact whose friction was found to be negative
    is_solved = _integer()  # 1: there were contacts in the last step
    met_count = _integer()
    log_count = _integer()
    # of a solution
    chosen_count = _integer()
    used_count = _integer()
    row_count = _integer()
    matrix_size = _integer()  # numbers of K that are needed
    width = _integer()  # numbers from row to row of K: all unknowns, or 6 where it has blocks
    entry_count = _integer()  # blocks of K below the diagonal
    bit_size = _integer()  # words of bits
    held_count = _integer()  # contacts that scratch of held ones is needed for
    carries = _integer()  # 1: r and s are of the masses that light links carry
    turn = _integer()  # round of an impact whose problem is solved; 0: that of the step
    is_exported = _integer()  # 1: Python makes no room, and takes no log
    # constants
    light_count = _integer()  # bodies that carry far heavier ones
    dense_size = _integer()  # unknowns up to which K is a square
    resistance_count = _integer()  # of rolling and spinning: how many a contact has at most
    first_v_dot = _integer()  # places in reported rows
    first_lam = _integer()
    first_state = _integer()
    is_steady = _integer()  # 1 where contacts push as in the last step, and hit nothing
    t1 = _real()  # s, end of the step, and its length
    h = _real()
    residual = _real()
    least = _real()  # N s, an impulse beside which residuals of a problem of joints are rounding
    factored = _real()  # weight whose matrix K has the factors of, or 0
    length = _real()  # of the scene, m

    shapes: PlacedShapes
    integer: Integers
    real: Floats
    # of bodies, with ground first
    poses: Matrix  # (n + 1, POSE) where contacts are sought
    margin: Floats  # m
    shape_reach: Floats  # m, how far shapes reach from the mass centre
    mass: Floats
    mass_inverse: Floats  # zero of ground
    carried: Matrix  # (n + 1, 2) 1/kg, 1/(kg m^2) of what joints hold at a body far lighter, or 0
    Jp: Matrix  # (n + 1, 9), and its inverse; in global axes
    Jp_inverse: Matrix
    spin: Matrix
    spin_inverse: Matrix
    before: Matrix  # (n + 1, 6) velocities at the start, without contacts, with them; scratch
    free: Matrix
    v: Matrix
    delta: Matrix  # what it changes by within a round
    trial: Matrix
    rest: Matrix
    trial_rest: Matrix
    end: Matrix  # at the end of the step
    path: Matrix  # means of velocities of motion without contacts, with accelerations ``pushed``
    hit: Floats  # the part of the step at which a body is hit
    flies: Floats  # the part of its change without contacts that these do not bear else
    jump: Matrix  # (n + 1, 6) what rounds of an impact change its velocities by
    bounce: Matrix  # (n + 1, 5) of each group (restitution.py)
    v_bounce: Matrix  # (n + 1, 6), (c, 3), (k,) what bounces lead to
    x_bounce: Matrix
    machine: Integers  # the least body of those that joints connect
    first: IntegerMatrix  # (n + 1, 3) first body, contact, row of each group, or -1; the next ones
    next_body: Integers
    used: Integers  # bodies of a group that is solved, in the order of K; the place of each, or -1
    place: Integers
    parent: Integers  # scratch of groups and of the order of bodies
    queue: Integers
    order: Integers
    bits: Integers
    entry_start: Integers  # (n + 2,) first of the blocks of K below the diagonal of each column
    entries: Integers  # their rows
    # of contacts
    bodies: IntegerMatrix  # (c, 2) i and j, ground 0
    key: Integers  # a number that a contact keeps
    kind: Integers  # CONE, ALONE or WHOLE
    under: Integers  # the contact whose rolling it resists, or -1
    group: Integers  # the least body of those that joints and contacts connect
    next_contact: Integers
    chosen: Integers  # contacts of a group that is solved
    collides: Integers  # STOPS, BOUNCES, STAYS or 0; the part of the step at which it closes
    closing: Floats
    takes: Integers  # the last round of an impact in which it takes part, or -1
    strike: Matrix  # (c, 2) of impacts (restitution.py)
    J: Matrix  # (c, 36) rows of the velocity of body i less that of j: normal, tangents
    moved: Matrix  # the same times M^-1
    own: Matrix  # (c, 9) J M^-1 J^T of each
    own_held: Matrix  # the same with what joints answer
    gap: Floats
    mu: Floats  # of the cone
    rim: Floats  # friction besides, N s
    e: Floats
    bias: Matrix  # (c, 3) m/s, added to velocities
    r: Floats  # masses that rows feel, kg
    x: Matrix  # (c, 3) impulses, N s; what is projected, its slopes, impulses tried, others kept
    z: Matrix
    B: Matrix
    B_factored: Matrix  # those of K
    push: Matrix
    kept: Matrix
    missing: Matrix  # what they leave of the equations of a round
    u: Matrix  # velocities
    met: Matrix  # (c, MET) contacts that shapes push with
    # of declared contacts
    declared_bodies: IntegerMatrix  # (d, 2)
    declared_place: IntegerMatrix  # (d, 6) place in D of the system: normal of i and j, ...; -1
    declared_gap: Integers  # in the residual of the system
    declared_mode: Integers  # first state
    declared_kind: Integers
    declared_turns: Integers  # 1 of moments
    declared_speed: Floats  # what limits of speeds are multiplied by, m/s or rad/s
    declared_law: Integers  # 1 of those whose law of friction is their own
    declared_mu: Floats  # where it slides, where it sticks
    declared_mu_s: Floats
    declared_ratio: Floats  # the same along the second tangent, as parts of these: 1 but in
    declared_ratio_s: Floats  # ellipses
    declared_under: Integers  # of what resists rolling the contact that presses, or -1
    declared_at: Integers  # where it is among the contacts of a step, or -1
    declared_e: Floats
    held: Integers  # 1 where it has stuck until this step
    grip: Floats  # coefficient that counts now, m of what resists rolling, and ratio, by which the
    ratio: Floats  # second row is multiplied
    load_row: Integers  # of friction of a joint: its load's first row, their number, whether it
    load_count: Integers  # pushes alone; none where friction is of a size of its own
    load_pushes: Integers
    declared_x: Matrix  # (d, 7) impulses of the last step, modes, directions of slip
    # of rows of joints
    row_owner: Integers  # the machine of each
    next_row: Integers
    rows: Integers  # those of a group that is solved
    row_start: Integers  # (k + 1,) first entry of each
    row_body: Integers  # body of each entry, and where its six numbers are in D of the system
    row_place: Integers
    D: Matrix  # (entries, 6)
    s: Floats  # masses that they feel
    y: Floats  # impulses; tried, kept, and of the last step; those of motion without contacts
    lead: Floats  # D v at the begin of a round, less that of motion without contacts, m/s
    pull: Floats
    y_kept: Floats
    y_bounce: Floats
    y_free: Floats
    free_speed: Floats  # D v of motion without contacts, m/s
    # scratch
    slopes: Floats  # (2, y) flat: dy/dt
    slots: Integers  # table of the contacts remembered
    K: Floats
    exchanged: Integers  # rows of K
    change: Floats
    turned: Floats  # (36,)
    log: Matrix  # (room, MET) contacts at instants reported
    felt: Matrix  # (3 c, 3 c) how contacts feel each other with what joints answer, once needed
    answer: Matrix  # (3 c, k) that
    small: Floats  # the matrix of a pass of the problem of contacts alone, and its solution
    small_step: Floats


def step_arrays(evaluator: Evaluator, size: int, remembered: int) -> StepArrays:
    """The arrays of a model.

    Args:
        evaluator: of the model.
        size: numbers of its integrated state.
        remembered: impulses that are kept from step to step.
    """
    model = evaluator.model
    n, k = model.body_count, model.joint_row_count
    layout = model.row_layout
    scratch: dict[str, Any] = {
        **{name: np.zeros(k) for name in (
            "s", "y", "lead", "pull", "y_kept", "y_bounce", "y_free", "free_speed")},
        **{name: np.zeros(k, dtype=np.int64) for name in ("next_row", "rows")},
        **{name: np.zeros((0, 0)) for name in ("felt", "answer")},
        "small": np.zeros(SMALL_SIZE**2 if k else 0),
        "small_step": np.zeros(SMALL_SIZE if k else 0),
    }  # fmt: skip
    arrays = StepArrays(
        shapes=placed_shapes(model.collisions),
        integer=np.zeros(len(StepArrays.indices("integer")), dtype=np.int64),
        real=np.zeros(len(StepArrays.indices("real"))),
        poses=np.zeros((n + 1, POSE)),
        **_of_bodies(model),
        **_joint_rows(evaluator),
        **_declared(evaluator),
        **_of_contacts(ROOM + model.contact_count),
        **scratch,
        slopes=np.zeros(2 * size),
        slots=np.zeros(2 * remembered + 1, dtype=np.int64),
        K=np.zeros(min(6 * n, DENSE_SIZE) ** 2),
        exchanged=np.zeros(max(DENSE_SIZE, 6), dtype=np.int64),
        change=np.zeros(6 * n),
        turned=np.zeros(36),
        log=np.zeros((LOG_ROOM, MET)),
    )
    arrays.dense_size, arrays.length = DENSE_SIZE, model.length
    arrays.first_v_dot, arrays.first_lam = layout["v_dot"].start, layout["Lam"].start
    arrays.first_state = layout["states"].start
    if model.collisions is not None and model.collisions.resists_turning:
        arrays.resistance_count = 2
    _put_carried(arrays)
    return arrays


def _put_carried(s: StepArrays) -> None:
    """Put what joints hold at bodies that are far lighter: stand-in links, feet with a rotor.

    Through light ones, too: joints in a row, and wheels of a sum, hold light bodies at light ones.
    """
    own = np.array([s.mass, np.linalg.eigvalsh(s.Jp.reshape(-1, 3, 3))[:, -1]]).T
    carried, passed = own, None
    while passed is None or not np.array_equal(carried, passed):
        light: Any = np.any(own < LIGHT * carried, axis=1)
        passed, felt = carried, np.where(light[:, None], carried, own)
        carried = felt.copy()
        for first, last in itertools.pairwise(s.row_start):
            bodies = s.row_body[first:last]
            carried[bodies] = np.maximum(carried[bodies], felt[bodies].max(axis=0))
    s.carried[light], s.light_count = 1.0 / carried[light], int(light.sum())


def _of_bodies(model: Model) -> dict[str, Any]:
    """Arrays of bodies, with their masses and how far their shapes reach."""
    n = model.body_count
    found: dict[str, Any] = {
        **{name: np.zeros((n + 1, 9)) for name in ("Jp", "Jp_inverse", "spin", "spin_inverse")},
        **{name: np.zeros((n + 1, 6)) for name in (
            "before", "free", "v", "delta", "trial", "rest", "trial_rest", "end", "path",
            "v_bounce", "jump")},
        "bounce": np.zeros((n + 1, 5)),
        "carried": np.zeros((n + 1, 2)),
        **{name: np.zeros(n + 1) for name in (
            "margin", "shape_reach", "mass", "mass_inverse", "hit", "flies")},
        **{name: np.zeros(n + 1, dtype=np.int64) for name in (
            "next_body", "used", "place", "parent", "queue", "order")},
        "first": np.zeros((n + 1, 3), dtype=np.int64),
        "entry_start": np.zeros(n + 2, dtype=np.int64),
        **{name: np.zeros(0, dtype=np.int64) for name in ("bits", "entries")},
    }  # fmt: skip
    found["mass"][1:], found["mass_inverse"][1:] = model.mass, 1.0 / model.mass
    found["Jp"][1:] = model.Jp.reshape(-1, 9)
    found["Jp_inverse"][1:] = np.linalg.inv(model.Jp).reshape(-1, 9)
    if (shapes := model.collisions) is not None:
        far = np.linalg.norm(shapes.at, axis=1) + shapes.reach
        np.maximum.at(found["shape_reach"], shapes.body, far)
        found["shape_reach"][0] = 0.0
    return found


def _of_contacts(room: int) -> dict[str, Any]:
    """Arrays of so many contacts."""
    widths = {"J": 36, "moved": 36, "met": MET, "strike": 2,
              **dict.fromkeys(("own", "own_held", "B", "B_factored"), 9),
              **dict.fromkeys(("x", "u", "z", "bias", "push", "kept", "missing", "x_bounce"),
                              3)}  # fmt: skip
    return {
        "bodies": np.zeros((room, 2), dtype=np.int64),
        **{name: np.zeros(room, dtype=np.int64) for name in (
            "key", "kind", "under", "group", "next_contact", "chosen", "collides", "takes")},
        **{name: np.zeros(room) for name in ("gap", "mu", "rim", "e", "r", "closing")},
        **{name: np.zeros((room, width)) for name, width in widths.items()},
    }  # fmt: skip


def _joint_rows(evaluator: Evaluator) -> dict[str, Any]:
    """Entries of the rows of joints, row by row."""
    own, (row, column, place) = evaluator.model.joint_row_count, evaluator.pattern
    row, body, place = row[::6], column[::6] // 6 + 1, place[::6]
    order = np.flatnonzero(row < own)
    order = order[np.argsort(row[order], kind="stable")]
    start = np.searchsorted(row[order], np.arange(own + 1))
    machine, found = np.arange(evaluator.model.body_count + 1), None
    while found is None or not np.array_equal(machine, found):
        found = machine.copy()
        for first, last in itertools.pairwise(start):
            bodies = body[order[first:last]]
            machine[bodies] = machine[bodies].min(initial=len(machine))
    owner = np.array([machine[body[order[k]]] for k in start[:-1]], dtype=np.int64)
    return {
        "machine": machine,
        "row_owner": owner,
        "row_start": start.astype(np.int64),
        "row_body": np.ascontiguousarray(body[order]),
        "row_place": np.ascontiguousarray(place[order]),
        "D": np.zeros((len(order), 6)),
    }


def _declared(evaluator: Evaluator) -> dict[str, Any]:
    """The declared contacts."""
    model = evaluator.model
    d, own = model.contact_count, model.joint_row_count
    table = ContactTable(evaluator) if d else None
    given = model.joint_slots[len(model.joint_slots) - d :]
    bodies = np.array([(s[0], s[1] if len(s) > 1 else 0) for s in given]).reshape(d, 2)
    places = np.full((d, 6), -1)
    row, column, place = evaluator.pattern
    for at, b, first in zip(row[::6] - own, column[::6] // 6 + 1, place[::6], strict=True):
        if at >= 0:
            contact, part = divmod(int(at), 3)
            for side in np.flatnonzero(bodies[contact] == b):
                places[contact, 2 * part + side] = first
    found = {
        "declared_bodies": bodies.astype(np.int64),
        "declared_place": places,
        "declared_gap": np.ascontiguousarray(evaluator.system.row[own::3][:d]),
        **{name: np.zeros(d, dtype=np.int64) for name in (
            "declared_mode", "declared_kind", "declared_turns", "declared_law", "declared_under",
            "declared_at", "held", "load_row", "load_count", "load_pushes")},
        **{name: np.zeros(d) for name in (
            "declared_mu", "declared_mu_s", "declared_e", "declared_speed", "grip")},
        **{name: np.ones(d) for name in ("declared_ratio", "declared_ratio_s", "ratio")},
        "declared_x": np.zeros((d, 7)),
    }  # fmt: skip
    if table is not None:
        found |= {"declared_mode": table.mode, "declared_mu": table.mu, "declared_e": table.e}
        found |= {"declared_under": table.under, "declared_speed": table.speed}
        found |= {"declared_mu_s": table.mu_s, "declared_turns": table.turns.astype(np.int64)}
        found["declared_kind"] = np.where(table.alone, np.where(table.holds[:, 0], WHOLE, ALONE),
                                          CONE)  # fmt: skip
        first = len(model.joint_names) - d
        for group in model.contacts:
            type_: Any = group.type_info.type
            found["declared_law"][group.members - first] = type_.grip is not None
        for c, (rows, pushes) in table.loads.items():
            found["load_row"][c], found["load_count"][c] = rows[0], len(rows)
            found["load_pushes"][c] = pushes
    return found


def all_room(s: StepArrays) -> StepArrays:
    """The same arrays with room for all that exported models may need, and no log."""
    m, n = len(s.shapes.kind), len(s.mass) - 1
    s.shapes.pair_count = min(m * (m - 1) // 2, MOST_PAIRS * m)
    s.shapes.point_count = MOST_POINTS * s.shapes.pair_count
    s.bit_size = n * (n // 32 + 1)
    s.entry_count = min(n * (n - 1) // 2, MOST_ENTRIES * n)
    s.matrix_size = 36 * (n + 2 * s.entry_count)
    points = s.shapes.point_count + len(s.declared_gap)
    s.held_count = min((1 + s.resistance_count) * points, MOST_HELD) if len(s.y) else 0
    found = grown(s)
    found.shapes.pair_count = found.shapes.point_count = 0
    found.entry_count = found.held_count = 0
    found.is_exported = 1
    return found


def grown(s: StepArrays) -> StepArrays:
    """The same arrays with the room that a step has asked for."""
    new: dict[str, Any] = {"shapes": with_room(s.shapes)}
    points = s.shapes.point_count + len(s.declared_gap)
    room = max(s.contact_count, (1 + s.resistance_count) * points)
    if room > len(s.key):
        new |= _of_contacts(room + room // 4)
        new["met"][: s.met_count] = s.met[: s.met_count]
    if 2 * s.met_count > len(s.log):
        new["log"] = np.zeros((4 * s.met_count, MET))
    if s.matrix_size > len(s.K):
        new["K"] = np.zeros(s.matrix_size)
    for name, size in (("entries", s.entry_count), ("bits", s.bit_size)):
        if size > len(getattr(s, name)):
            new[name] = np.zeros(size + size // 4, dtype=np.int64)
    if s.held_count > len(s.felt) // 3:
        m = 3 * s.held_count
        new |= {"felt": np.zeros((m, m)), "answer": np.zeros((m, len(s.y)))}
    return attrs.evolve(s, **new)
