"""Which contacts hold, slip and stick from an instant on: the cone problem of the accelerations."""

from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.contacts.cone import solve_cone
from dap3d_core.formulations.contacts.contact_rows import ContactRows, ContactTable, length_of
from dap3d_core.kernels.array_types import Floats, Integers

#: Speed, m/s of a scene of ordinary size, below which a contact is at rest; part of the largest
#: acceleration below which one is zero; part of the largest entry of A below which rows depend on
#: each other.
STILL, ZERO, DEPENDENT = 1e-9, 1e-9, 1e-12
#: Part of the largest acceleration of a group that counts as one of each of its contacts: what
#: joints let turn fast beside what they let slide is no measure of it, but its rounding is there.
BESIDE = 1e-3
#: Part of the largest acceleration that may be left where contacts hold, by shares alone: their
#: rows take it, within what the cones leave.
HELD, OF_REST, RATE_ROUNDING = 1e-9, 0.05, 1e-13
#: Parts of their cones within which contacts that share what they carry are to stay, each leaving
#: half of what the one before leaves: what they carry reaches its limit with so much left, 1e-9.
INSIDE = tuple(1.0 - 0.5**k for k in range(1, 31))
#: Part of its cone in which friction of contacts that share stays where they begin to slip: what it
#: leaves shows which of them do, and where to.
LOOSE = 1.0 - 1e-6
#: Part of its mobility that friction leaves a contact whose steps become endless: it jams.
NEARLY = 1e-2
#: Part of the largest force that is to be left for a contact that stays as others can carry less.
TO_STAY = 1e-6
#: Passes for the loads of joints, the part that the last one changes, and a load that holds all.
LOAD_PASSES, LOAD_SETTLED, LARGE = 60, 1e-12, 1e200
#: From this pass on loads have settled where rounding is left, of chains of many joints this part.
LATE_PASS, LOAD_NOISE = 15, 1e-8


class JamError(ValueError):
    """No mode is consistent: sliding presses its bodies together; names the contact."""


@attrs.frozen
class Modes:
    """Modes, directions of sliding and shares of all contacts, global axes.

    Attributes:
        mode: (m,) 0 open, 1 slides, 2 sticks.
        way: (m, 3) directions of sliding, of the length of the scene (1 of what turns), zero where
            none is known; of friction alone that sticks 1.0 for rows that do not hold, as others
            hold what they would.
        near: (m, 3) forces on body i of those that share what they carry.
        force: (m, 3) forces with which they were found, in the frames of the contacts.
    """

    mode: Floats
    way: Floats
    near: Floats
    force: Floats


def find_modes(
    table: ContactTable,
    rows: ContactRows,
    touching: list[int],
    sliding: dict[int, Floats],
    leaving: list[int],
) -> Modes:
    """The modes at the state of ``rows``.

    Args:
        table, rows: the contacts, and what they are at this state.
        touching: contacts of no gap.
        sliding: contacts at rest that begin to slide -> direction in their frames, (2,).
        leaving: contacts whose normal force has just vanished: they open where nothing keeps them.

    Raises:
        JamError: a contact jams.
    """
    closing = rows.closing
    found = Modes(*(np.zeros((table.count, *shape)) for shape in ((), (3,), (3,), (3,))))
    for group in _groups(rows, [c for c in touching if closing[c] < STILL * table.length[c]]):
        if table.loads.keys().isdisjoint(group):
            _put_modes(table, rows, group, sliding, leaving, found)
        else:
            _put_loaded(table, rows, group, sliding, leaving, found)
    return found


def _put_loaded(
    table: ContactTable, rows: ContactRows, group: list[int], sliding: dict[int, Floats],
    leaving: list[int], found: Modes,
) -> None:  # fmt: skip
    """The modes of a group with friction of joints: found by loads that they give themselves.

    What may stick is held at first, however large its load: friction that raises its own load by
    more than itself holds. Then each pass takes the loads of the one before, extrapolated from
    those of as many passes as there are loads.
    """
    mine = [c for c in group if c in table.loads]
    ways, none = _ways(table, rows, group, sliding), np.zeros(len(rows.G))
    slides = np.array([c in ways for c in mine])
    loads = np.where(slides, rows.loads_by(none)[mine], LARGE)
    taken: list[Floats] = []
    rests: list[Floats] = []
    for k in range(LOAD_PASSES):
        rows.load[mine] = loads
        for values in attrs.astuple(found, recurse=False):
            values[group] = 0.0
        _put_modes(table, rows, group, sliding, leaving, found)
        force = np.zeros_like(found.force)
        force[group] = found.force[group]
        given = rows.loads_by(force.ravel())[mine]
        rest = given - loads
        part = LOAD_SETTLED if k < LATE_PASS else LOAD_NOISE
        if np.abs(rest).max() <= part * max(given.max(), loads.max()):
            return
        if k == 0 and not slides.all():
            loads = np.where(slides, loads, given)
            continue
        taken, rests = [*taken, loads][-len(mine) - 1 :], [*rests, rest][-len(mine) - 1 :]
        loads = np.maximum(extrapolated(given, taken, rests), 0.0)
    raise JamError(table.names[mine[int(np.argmax(np.abs(rest)))]])


def extrapolated(given: Floats, taken: list[Floats], rests: list[Floats]) -> Floats:
    """What a fixed point is taken for next (Anderson, J. ACM 12 (1965) 547).

    Args:
        given: what the last of ``taken`` gave.
        taken, rests: the last guesses, and by how much each gave something else.
    """
    if len(rests) < 2:
        return given
    changes, moves = np.diff(rests, axis=0).T, np.diff(taken, axis=0).T
    share = np.linalg.lstsq(changes, rests[-1], rcond=1e-10)[0]
    found: Floats = given - (moves + changes) @ share
    return found


def _groups(rows: ContactRows, closed: list[int]) -> list[list[int]]:
    """Contacts that feel each other's forces, together."""
    blocks = rows.feels
    left, found = list(closed), []
    while left:
        group = [left.pop(0)]
        for c in group:
            near = [k for k in left if blocks[c, k]]
            group += near
            left = [k for k in left if k not in near]
        found.append(sorted(group))
    return found


def _put_modes(
    table: ContactTable, rows: ContactRows, closed: list[int], sliding: dict[int, Floats],
    leaving: list[int], found: Modes,
) -> None:  # fmt: skip
    """Find the modes of one group of contacts."""
    left = [c for c in leaving if c in closed]
    if left or any(c in sliding for c in closed):
        # of contacts that share, one at the end of its cone may only have to carry less
        inner = _inside(table, rows, closed, {})
        if inner is not None and all(
            inner[3 * closed.index(c)] > TO_STAY * inner.max() for c in left
        ):
            _put(table, rows, closed, {}, found, inner)
            return
        which = rows.rows_of(closed)
        if not left and _share(table, closed, rows.W[np.ix_(which, which)], {}):
            # what each of them carried was a choice, and so is the direction of it
            _put(table, rows, closed, {}, found, loose=True)
            return
    _put(table, rows, _staying(table, rows, closed, sliding, left), sliding, found)


def _staying(
    table: ContactTable, rows: ContactRows, closed: list[int], sliding: dict[int, Floats],
    leaving: list[int],
) -> list[int]:  # fmt: skip
    """Contacts that stay where some leave, unless these would close again at once.

    What carries nothing leaves with them: it would be the next to.
    """
    big = float(np.abs(rows.free[rows.rows_of(closed)]).max()) + 1e-300
    gone: list[int] = []
    while leaving:
        gone, without = [*gone, *leaving], [c for c in closed if c not in leaving]
        try:
            x, _ = _solve(table, rows, without, *_matrix(table, rows, without, sliding))
        except JamError:
            return closed
        rates = _rates(rows, without, x, gone)
        if any(rate < -ZERO * big for rate in rates):
            only = [c for c, rate in zip(gone, rates, strict=True) if rate < -ZERO * big]
            return closed if without else only
        normal = x[::3]
        idle = ~table.alone[without] & (normal <= ZERO * normal.max(initial=0.0))
        closed, leaving = without, [c for c, is_idle in zip(without, idle, strict=True) if is_idle]
    return closed


def _rates(rows: ContactRows, contacts: list[int], x: Floats, wanted: list[int]) -> list[float]:
    """Accelerations along the normals of contacts, by the forces x of others."""
    force = np.zeros(len(rows.G))
    force[rows.rows_of(contacts)] = x
    rates = rows.W @ force + rows.free
    return [float(rates[3 * c]) for c in wanted]


def _ways(
    table: ContactTable, rows: ContactRows, closed: list[int], sliding: dict[int, Floats],
) -> dict[int, Floats]:  # fmt: skip
    """Directions (2,) of the contacts that slide."""
    found = {}
    for c in closed:
        u = rows.slip[c, table.across(c)]
        size = length_of(u)
        if size > STILL * table.length[c]:
            found[c] = u / size
        elif c in sliding:
            found[c] = sliding[c]
    return found


def _matrix(
    table: ContactTable, rows: ContactRows, closed: list[int], sliding: dict[int, Floats],
) -> tuple[Floats, dict[int, Floats]]:  # fmt: skip
    """Rates by forces, those along normals with sliding friction, and directions of sliding."""
    which = rows.rows_of(closed)
    full = rows.W[np.ix_(which, which)]
    A, ways = full.copy(), _ways(table, rows, closed, sliding)
    for k, c in enumerate(closed):
        if c in ways and not table.gapless[c]:
            across = full[:, 3 * k + 1 : 3 * k + 3]
            A[:, 3 * k] -= table.mu[c] * across @ table.against(c, ways[c])
            if A[3 * k, 3 * k] <= 0.0 and not table.alone[c]:
                raise JamError(table.names[c])
    return A, ways


def nearly_jams(table: ContactTable, rows: ContactRows, closed: list[int]) -> str:
    """Name of a contact whose friction leaves next to nothing of how it gives way; "" of none.

    Its normal force grows beyond all bounds there, in a finite time.
    """
    pushed = [c for c in closed if not table.alone[c]]
    A, ways = _matrix(table, rows, pushed, {})
    for k, c in enumerate(pushed):
        if c in ways and A[3 * k, 3 * k] < NEARLY * rows.W[3 * c, 3 * c]:
            return table.names[c]
    return ""


def _solve(
    table: ContactTable, rows: ContactRows, closed: list[int], A: Floats, ways: dict[int, Floats],
    part: float = 1.0, *, slipping: Any = (), **more: Any,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Forces (3 k,) with sliding friction, and accelerations; A, ways: of ``_matrix``.

    part: of the cones; slipping: contacts that have mu, not mu_s.
    """
    b, load = rows.free[rows.rows_of(closed)].copy(), rows.load[closed]
    for k, c in enumerate(closed):
        if c in ways and table.gapless[c]:
            b -= load[k] * table.mu[c] * A[:, 3 * k : 3 * k + 3] @ ways[c]
        elif c in ways and table.alone[c]:  # in its first column is what a load of one does
            b += load[k] * A[:, 3 * k]
    mu = part * np.where([c in slipping for c in closed], table.mu[closed], table.mu_s[closed])
    mu[[c in ways for c in closed]] = 0.0
    gapless, ratio = table.gapless[closed], table.ratio_s[closed]
    x, left = solve_cone(A, b, mu, load, gapless=gapless, ratio=ratio, **more)
    if left > 1e-6 and not more:
        raise JamError(" with ".join(table.names[c] for c in closed))
    a = A @ x + b
    for k, c in enumerate(closed):
        if c in ways:
            pressing = load[k] if table.gapless[c] else x[3 * k] + load[k]
            against = table.against(c, ways[c])
            x[3 * k : 3 * k + 3][table.across(c)] = -table.mu[c] * pressing * against
    return x, a


def _put(
    table: ContactTable, rows: ContactRows, closed: list[int], sliding: dict[int, Floats],
    found: Modes, inner: Floats | None = None, *, loose: bool = False,
) -> None:  # fmt: skip
    """Put the modes of contacts that are closed among those found; inner: of ``_inside``.

    loose: those that share begin to slip.
    """
    if not closed:
        return
    A, ways = _matrix(table, rows, closed, sliding)
    shares = _share(table, closed, A, ways)
    if inner is None and not loose:
        inner = _inside(table, rows, closed, sliding)
    if inner is None:
        x, moves = _begin(table, rows, closed, A, ways, LOOSE if loose else 1.0)
    else:
        x, moves = inner, np.zeros_like(inner)  # all of them hold
    for k, c in enumerate(closed):
        force, rate, frame = x[3 * k : 3 * k + 3], moves[3 * k : 3 * k + 3], rows.frames[c]
        across = table.across(c)
        if not table.alone[c] and rate[0] > max(A[3 * k, 3 * k] * force[0], 0.0):
            continue  # it opens
        if len(closed) == 1 and not table.alone[c] and force[0] <= 0.0:
            continue
        if c in ways:
            mode, way = 1.0, ways[c]
        elif table.mu_s[c] == 0.0:
            mode, way = 1.0, np.zeros_like(rate[across])
        elif np.any(rate[across]):
            has_force = table.mu[c] > 0.0 and np.any(force[across])
            along = table.slip_against(c, force[across]) if has_force else rate[across]
            mode, way = 1.0, along / length_of(along)
        else:
            mode, way = 2.0, np.zeros_like(rate[across])
        found.mode[c], found.force[c] = mode, force
        found.way[c] = table.length[c] * way @ frame[across]
        if shares or table.alone[c]:  # what its row adds has next to no rounding then
            normal = 0.0 if table.gapless[c] else force[0]
            found.near[c] = force @ frame if mode == 2.0 else normal * frame[0]
    if shares:
        _leave_to_others(table, rows, closed, found)


def _begin(
    table: ContactTable, rows: ContactRows, closed: list[int], A: Floats, ways: dict[int, Floats],
    part: float,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Forces (3 k,), and accelerations (3 k,), zero where these are rounding.

    What begins to slip has mu, not mu_s, and then others may slip as well.
    """
    slipping: set[int] = set()
    while True:
        x, a = _solve(table, rows, closed, A, ways, part, slipping=slipping)
        least = ZERO * _sizes(table, rows, closed, ways)
        moves = a.reshape(-1, 3)
        for k, c in enumerate(closed):
            across = table.across(c)
            moves[k, across] *= length_of(moves[k, across]) > max(
                least[k], ZERO * _stops(table, rows, c)
            )
            if not table.gapless[c]:
                moves[k, 0] *= abs(moves[k, 0]) > least[k]
        new = {c for k, c in enumerate(closed) if np.any(moves[k, table.across(c)])}
        if new <= slipping or not np.any(table.mu_s[closed] > table.mu[closed]):
            return x, moves.ravel()
        slipping |= new


def _stops(table: ContactTable, rows: ContactRows, c: int) -> float:
    """The rate of slip that friction alone could change: less than a part of it is rounding."""
    own = np.diag(rows.W)[3 * c : 3 * c + 3]
    return float(table.mu_s[c] * rows.load[c] * own.max()) if table.alone[c] else 0.0


def _leave_to_others(
    table: ContactTable, rows: ContactRows, closed: list[int], found: Modes
) -> None:
    """Let rows of friction alone not hold where others, and the joints, hold what they would.

    They carry what was found for them; joints and rows would divide that between them otherwise.
    """
    alone = [c for c in closed if table.alone[c] and found.mode[c] == 2.0]
    mine = [(c, k) for c in alone for k in np.flatnonzero(table.holds[c]).tolist()]
    others = [3 * c + k for c in closed if not table.alone[c] for k in range(3)
              if found.mode[c] > (0.5 if k == 0 else 1.5)]  # fmt: skip
    mobility, left = rows.W, dict.fromkeys(mine)
    least, kept = DEPENDENT * np.abs(mobility).max(), others
    while left:
        back = np.linalg.pinv(mobility[np.ix_(kept, kept)], rcond=DEPENDENT, hermitian=True)
        own = {at: 3 * at[0] + at[1] for at in left}
        free = {
            at: mobility[q, q] - mobility[q, kept] @ back @ mobility[kept, q]
            for at, q in own.items()
        }
        best = max(free, key=lambda at: float(free[at]))
        if free[best] <= least:
            break
        kept = [*kept, own[best]]
        del left[best]
    for c, k in left:
        found.way[c, k] = 1.0


def _share(table: ContactTable, closed: list[int], A: Floats, ways: dict[int, Floats]) -> bool:
    """True if forces of contacts may change without a change of the motion."""
    own = _own_rows(table, closed, ways)
    block = A[np.ix_(own, own)]
    return bool(np.linalg.matrix_rank(block, tol=DEPENDENT * np.abs(A).max()) < len(own))


def _own_rows(table: ContactTable, closed: list[int], ways: dict[int, Floats]) -> Integers:
    """Rows along which contacts act: of what slides, and of smooth ones, the normal alone."""
    acts, slides = table.holds[closed], np.array([c in ways for c in closed])
    acts[:, 1:] &= (~slides & (table.alone[closed] | (table.mu_s[closed] > 0.0)))[:, None]
    acts[:, 0] &= ~slides | ~table.alone[closed]
    return np.flatnonzero(acts)


def _inside(
    table: ContactTable, rows: ContactRows, closed: list[int], sliding: dict[int, Floats],
) -> Floats | None:  # fmt: skip
    """Forces well within the cones of contacts that share what they carry, and hold.

    None where they do not share, or there are none.
    """
    A, ways = _matrix(table, rows, closed, sliding)
    if not _share(table, closed, A, ways):
        return None
    own, own_rates = _own_rows(table, closed, ways), np.diag(A).reshape(-1, 3).max(axis=1)
    big = _sizes(table, rows, closed, {})

    def forces(k: int, start: Floats | None) -> Floats | None:
        x, a = _solve(table, rows, closed, A, ways, INSIDE[k], start=start, tries=3)
        carried = table.mu_s[closed] * (x[::3] + rows.load[closed])
        rest = OF_REST * (1.0 - INSIDE[k]) * own_rates * carried + RATE_ROUNDING * big.max()
        limits = np.repeat(np.minimum(HELD * big, rest), 3)
        return x if np.all(np.abs(a[own]) <= limits[own]) else None

    best = forces(0, None)  # as a rule
    if best is not None:
        return best
    low, high = 1, len(INSIDE) - 2
    best = forces(high + 1, None)
    while best is not None and low <= high:  # what one part allows, so does every larger one
        k = (low + high) // 2
        x = forces(k, best)
        best, low, high = (best, k + 1, high) if x is None else (x, low, k - 1)
    return best


def _sizes(
    table: ContactTable, rows: ContactRows, closed: list[int], ways: dict[int, Floats]
) -> Floats:
    """(k,) sizes of accelerations of contacts: part of one is rounding."""
    own = np.abs(rows.free).reshape(-1, 3).max(axis=1)
    still = [c for c in closed if c not in ways] or closed  # what slides may turn far faster
    least = BESIDE * own[still].max() + 1e-300
    found: Floats = np.maximum(own[closed], least)
    return found
