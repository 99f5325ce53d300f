"""Which contacts hold, slip and stick from an instant on: the cone problem of the accelerations."""

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.formulations.contacts.cone import solve_cone
from dap3d_core.formulations.contacts.contact_rows import ContactRows, ContactTable

#: Speed, m/s, below which a contact is at rest; part of the largest acceleration below which one
#: is zero; part of the largest entry of W below which rows depend on each other.
STILL, ZERO, DEPENDENT = 1e-9, 1e-9, 1e-9
#: Parts of their cones within which contacts that share what they carry are to stay.
INSIDE = (0.5, 0.8, 0.95, 0.99, 0.999, 0.9999, 0.999999)


class JamError(ValueError):
    """No mode is consistent: sliding presses its bodies together; names the contact."""


@attrs.frozen
class Modes:
    """Modes, directions of sliding and shares of all contacts, global axes.

    Attributes:
        mode: (m,) 0 open, 1 slides, 2 sticks.
        way: (m, 3) unit vectors of sliding, zero where none is known.
        near: (m, 3) forces on body i of those that share what they carry.
    """

    mode: Floats
    way: Floats
    near: Floats


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
    slip = rows.slip
    limit = STILL * max(1.0, table.evaluator.model.length)
    closed = [c for c in touching if slip[c, 0] < limit]
    without = [c for c in closed if c not in leaving]
    if len(without) < len(closed):
        x, W, b, _ = _solve(table, rows, without, sliding, limit)
        found = _rates(rows, without, x, closed, W)
        big = float(np.abs(rows.free).max()) + 1e-300
        if all(found[c] >= -ZERO * big for c in closed if c in leaving):
            closed = without
    return _modes(table, rows, closed, sliding, limit)


def _rates(
    rows: ContactRows, contacts: list[int], x: Floats, wanted: list[int], W: Floats
) -> dict[int, float]:
    """Accelerations along the normals of contacts, of the forces (x, with friction) of others."""
    force = np.zeros(len(rows.G))
    force[rows.rows_of(contacts)] = x
    rates = rows.W @ force + rows.free
    return {c: float(rates[3 * c]) for c in wanted}


def _ways(
    table: ContactTable, rows: ContactRows, closed: list[int], sliding: dict[int, Floats],
    limit: float,
) -> dict[int, Floats]:  # fmt: skip
    """Directions (2,) of the contacts that slide."""
    found = {}
    for c in closed:
        u = rows.slip[c, 1:]
        size = float(np.hypot(*u))
        if size > limit:
            found[c] = u / size
        elif c in sliding:
            found[c] = sliding[c]
    return found


def _solve(
    table: ContactTable, rows: ContactRows, closed: list[int], sliding: dict[int, Floats],
    limit: float, part: float = 1.0,
) -> tuple[Floats, Floats, Floats, dict[int, Floats]]:  # fmt: skip
    """Forces (3 k,) with sliding friction, the matrix, accelerations, and directions of sliding."""
    which = rows.rows_of(closed)
    W0, b = rows.W[np.ix_(which, which)], rows.free[which]
    W, mu = W0.copy(), part * table.mu_s[closed]
    ways = _ways(table, rows, closed, sliding, limit)
    for k, c in enumerate(closed):
        if c in ways:
            W[:, 3 * k] -= table.mu[c] * W0[:, 3 * k + 1 : 3 * k + 3] @ ways[c]
            mu[k] = 0.0
            if W[3 * k, 3 * k] <= 0.0:
                raise JamError(table.names[c])
    x, left = solve_cone(W, b, mu)
    if left > 1e-6:
        raise JamError(table.names[closed[0]])
    a = W @ x + b
    for k, c in enumerate(closed):
        if c in ways:
            x[3 * k + 1 : 3 * k + 3] = -table.mu[c] * x[3 * k] * ways[c]
    return x, W, a, ways


def _modes(
    table: ContactTable, rows: ContactRows, closed: list[int], sliding: dict[int, Floats],
    limit: float,
) -> Modes:  # fmt: skip
    mode, way, near = np.zeros(table.count), np.zeros((table.count, 3)), np.zeros((table.count, 3))
    if not closed:
        return Modes(mode, way, near)
    x, W, a, ways = _solve(table, rows, closed, sliding, limit)
    big = float(np.abs(rows.free[rows.rows_of(closed)]).max()) + 1e-300
    shares = np.linalg.matrix_rank(W, tol=DEPENDENT * np.abs(W).max()) < len(W)
    if shares and all(np.abs(a) <= ZERO * big):
        inner = _inside(table, rows, closed, sliding, limit, big)
        x = x if inner is None else inner
    for k, c in enumerate(closed):
        force, rate, frame = x[3 * k : 3 * k + 3], a[3 * k : 3 * k + 3], rows.frames[c]
        if force[0] <= 0.0 and (rate[0] > ZERO * big or (len(closed) == 1 and rate[0] > -ZERO)):
            continue  # it opens
        tangents = frame[1:]
        if c in ways:
            mode[c], way[c] = 1.0, ways[c] @ tangents
        elif table.mu_s[c] == 0.0:
            mode[c] = 1.0
        elif np.hypot(*rate[1:]) > ZERO * big:
            direction = rate[1:] if table.mu[c] == 0.0 else -force[1:]
            size = np.hypot(*direction)
            direction = direction / size if size > 0.0 else rate[1:] / np.hypot(*rate[1:])
            mode[c], way[c] = 1.0, direction @ tangents
        else:
            mode[c] = 2.0
        if shares:
            near[c] = force @ frame if mode[c] == 2.0 else force[0] * frame[0]
    return Modes(mode, way, near)


def _inside(
    table: ContactTable, rows: ContactRows, closed: list[int], sliding: dict[int, Floats],
    limit: float, big: float,
) -> Floats | None:  # fmt: skip
    """Forces well within the cones, of contacts that share what they carry; None: there are none."""
    for part in INSIDE:
        try:
            x, _, a, _ = _solve(table, rows, closed, sliding, limit, part)
        except JamError:
            continue
        if np.abs(a).max() <= ZERO * big:
            return x
    return None
