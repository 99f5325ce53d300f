"""Impacts of the contacts that touch and approach, with friction, the joints held.

By Poisson's law an impact has two phases (Glocker, Set-Valued Force Laws, 2001, ch. 10): impulses
that stop what approaches, within their cones; then e times their normal parts, and friction within
the cones of both together. By Newton's the normal velocity becomes -e of what it was. They go in
rounds: in each what approaches answers, all at once, so that impacts travel through bodies that
touch, as through Newton's cradle. Where e is zero everywhere one round of all that touch is enough.
"""

import attrs
import numpy as np

from dap3d_core.formulations.contacts.contact_rows import ContactRows, ContactTable
from dap3d_core.formulations.contacts.impulses import put_impulses, stop_slip
from dap3d_core.kernels.array_types import Floats

#: Normal speed, m/s of a scene of ordinary size, below which what touches does not approach.
AT_REST = 1e-9
#: Rounds of one instant; in the last one all that touches stops.
ROUNDS = 500
#: Height of a bounce, as a part of the length of the scene, from which on those that would follow
#: are summed: they end after the geometric series of their times, too near to be told from rest.
LAST_HEIGHT = 1e-13


#: Contacts that answer in a round, and coefficients of restitution of all; none where slip jammed.
Round = tuple[list[int], Floats | None]


@attrs.frozen
class Impact:
    """What impacts at one instant did.

    Attributes:
        impulses: (m, 3) in the frames of the contacts.
        work: (m,) J, of the impulses of each contact and of drivers that these make work.
        exchanged: J, sum of the magnitudes of its parts.
        rest: contact -> s from now on until its bounces end.
        rounds: the contacts of each, and the coefficients of restitution of all.
        low: contacts that are held, as they would be back at once.
    """

    impulses: Floats
    work: Floats
    exchanged: float
    rest: dict[int, float]
    rounds: list[Round]
    low: list[int]


def repeat(table: ContactTable, rows: ContactRows, impact: Impact) -> Impact:
    """The rounds of an impact once more, of the same contacts, from other velocities."""
    work = 0.0
    for taking, e in impact.rounds:
        if e is None:
            x = _stopping(rows, taking)
        else:
            x = _impulses(rows, taking, np.where(e > 0.0, table.e, 0.0))
        x = np.zeros(3 * len(taking)) if x is None else x
        before = rows.slip[taking] - rows.driven[taking]
        rows.kick(_spread(x, taking, table.count))
        after = rows.slip[taking] - rows.driven[taking]
        work += float(np.sum(x.reshape(-1, 3) * 0.5 * (before + after)))
    _hold_low(rows, impact.low, [])
    return attrs.evolve(impact, work=np.array([work]))


def collide(table: ContactTable, rows: ContactRows, touching: list[int]) -> Impact:
    """Let the contacts that touch collide until none approaches; velocities of ``rows`` follow."""
    rounds: list[Round] = []
    impulses, rest = np.zeros((table.count, 3)), dict[int, float]()
    work, exchanged = np.zeros(table.count), 0.0
    e = table.e.copy()
    for k in range(ROUNDS):
        slip, closing = rows.slip, rows.closing
        approach = [c for c in touching if closing[c] < -AT_REST * table.length[c]]
        if not approach:
            break
        last = k == ROUNDS - 1
        bounces = np.any(e[touching] > 0.0) and not last
        taking = approach if bounces else touching
        of = np.zeros_like(e) if last else e
        x = _impulses(rows, taking, of)
        short = _last_bounces(table, rows, taking, x, e)
        if short:
            rest |= short
            e[list(short)] = 0.0
            continue
        rounds.append((taking, of.copy()))
        parts = x.reshape(-1, 3) * 0.5 * (slip - rows.driven)[taking]
        rows.kick(_spread(x, taking, table.count))
        after = x.reshape(-1, 3) * 0.5 * (rows.slip - rows.driven)[taking]
        work[taking] += np.sum(parts + after, axis=1)
        exchanged += float(np.sum(np.abs(parts)) + np.sum(np.abs(after)))
        impulses[taking] += x.reshape(-1, 3)
    low = _stop_low_rocking(table, rows, touching)
    return Impact(impulses, work, exchanged, rest, rounds, low)


def unjam(
    table: ContactTable, rows: ContactRows, touching: list[int], impact: Impact
) -> Impact | None:
    """Stop slip that jams behind an impact, by an impulse without a collision; None if none does.

    While it slips its friction presses bodies together, however short the time: an impulse, until
    it sticks; then that turns what approaches back (Genot, Brogliato, Eur. J. Mech. A 18 (1999)
    653). So what holds is at rest then, and nothing bounces.
    """
    closed = [c for c in touching if rows.closing[c] < AT_REST * table.length[c]]
    x = _stopping(rows, closed)
    if x is None:
        return None
    parts, before = x.reshape(-1, 3), (rows.slip - rows.driven)[closed]
    rows.kick(_spread(x, closed, table.count))
    shares = parts * 0.5 * np.stack([before, (rows.slip - rows.driven)[closed]])
    work, impulses = impact.work.copy(), impact.impulses.copy()
    work[closed] += shares.sum(axis=(0, 2))
    impulses[closed] += parts
    exchanged = impact.exchanged + float(np.abs(shares).sum())
    rounds = [*impact.rounds, (closed, None)]
    return Impact(impulses, work, exchanged, impact.rest, rounds, impact.low)


def _stopping(rows: ContactRows, closed: list[int]) -> Floats | None:
    """(3 k,) impulses that stop slip, of contacts that do not approach; None but zero."""
    s = rows.put(closed)
    return s.x[: 3 * len(closed)].copy() if stop_slip(s) else None


def _stop_low_rocking(table: ContactTable, rows: ContactRows, touching: list[int]) -> list[int]:
    """Hold what would be back from a height too low to tell from rest, as of rocking: which."""
    v, a = rows.closing, -rows.free[::3]
    limit = 2.0 * LAST_HEIGHT * table.length * a
    low = [c for c in touching if v[c] > AT_REST * table.length[c] and v[c] ** 2 < limit[c]]
    _hold_low(rows, low, [c for c in touching if c not in low])
    return low


def _hold_low(rows: ContactRows, low: list[int], others: list[int]) -> None:
    if low:
        rows.change(rows.lifted(rows.closing, low, others))


def _spread(x: Floats, contacts: list[int], count: int) -> Floats:
    every = np.zeros((count, 3))
    every[contacts] = x.reshape(-1, 3)
    return every.ravel()


def _impulses(rows: ContactRows, contacts: list[int], e: Floats) -> Floats:
    """(3 k,) impulses of one round."""
    s = rows.put(contacts)
    put_impulses(s, e)
    return s.x[: 3 * len(contacts)].copy()


def _last_bounces(
    table: ContactTable, rows: ContactRows, contacts: list[int], x: Floats, e: Floats
) -> dict[int, float]:
    """Contacts whose bounces would be too low from here on -> how long these would take, s."""
    which = rows.rows_of(contacts)
    after = (rows.W[np.ix_(which, which)] @ x)[::3] + rows.slip[contacts, 0]
    found = {}
    for c, v in zip(contacts, after, strict=True):
        a = -float(rows.free[3 * c])
        low = 0.0 < v * v < 2.0 * a * LAST_HEIGHT * table.length[c] if a > 0.0 else False
        if e[c] > 0.0 and low and rows.slip[c, 0] < 0.0:
            # what has come to rest before: the speeds after bounces are v, e v, e^2 v, ...
            found[c] = 2.0 * float(v) / (a * (1.0 - float(e[c]))) if e[c] < 1.0 else np.inf
    return {c: t for c, t in found.items() if np.isfinite(t)}
