"""Assembly at a singular pose, such as that of a mechanism drawn straight.

No small change closes a gap there to first order. Along velocities v that the rows allow C changes
by -gamma(v) s^2 / 2: the direction in which that closes the gap with the least motion leads away.
"""

from collections.abc import Iterator

import numpy as np

from dap3d_core.formulations.constraint_rows import ConstraintRows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.linear.rank.rank import DENSE_ROWS
from dap3d_core.model import Model
from dap3d_core.model.state_layout import split, velocities_of
from dap3d_core.simulation.initial.least_change import (
    RCOND,
    displacements,
    finite_rows,
    quadratic_part,
    scaled_system,
)

#: Freedoms beyond which no way out is searched: the work grows with the square of them.
MOST_FREE = 60
#: Part of a gap that no first-order change closes at a singular pose, at least.
OPEN = 0.9
#: A rate of closing below this part of the largest, or of the length of the scene, is none.
CLOSING = 1e-6
#: Directions that close a gap equally well, but for this part, are equal.
TIED = 1e-6
#: Ways out that are tried; singular values above this part of the largest are no rounding: a way
#: that ends at another singular pose, such as a folded one, is taken only where there is no other.
MOST_WAYS, REGULAR = 4, 1e-4
#: Rotations that a sentence gives, in rad from this on.
MOST_BODIES, TURNED = 6, 1e-3


def ways_out(
    evaluator: Evaluator, u: Floats, rows: ConstraintRows, t: float, held: Integers, metric: str
) -> Iterator[Floats]:
    """Displacements (n, 6) from a singular pose that close its gap, the smallest first.

    Of those that close it equally well, and of the two signs, the one in which the first component
    that can be largest is positive.
    """
    if len(rows.C) > DENSE_ROWS:
        return
    D, gap = scaled_system(evaluator, rows, rows.C, held, metric)
    is_free = np.repeat(~np.isin(np.arange(1, evaluator.model.body_count + 1), held), 6)
    left, values, right = np.linalg.svd(D[:, is_free])
    rank = _rank(values, RCOND)
    beyond = gap - left[:, :rank] @ (left[:, :rank].T @ gap)
    distance = float(np.linalg.norm(beyond))
    if distance < OPEN * np.linalg.norm(gap) or not 0 < len(right) - rank <= MOST_FREE:
        return
    motions = np.zeros((len(right) - rank, len(is_free)))
    motions[:, is_free] = right[rank:]
    closing = _closing(evaluator, u, rows, t, held, metric, motions, beyond / distance)
    rates, directions = np.linalg.eigh(closing)
    least = CLOSING * max(-float(rates[0]), evaluator.model.length)
    for _ in range(MOST_WAYS):
        if not rates.size or not rates[-1] > least:
            return
        equal = rates >= (1.0 - TIED) * rates[-1]
        yield displacements(
            evaluator,
            _first_of(directions[:, equal].T @ motions) * (2.0 * distance / rates[-1]) ** 0.5,
            metric,
        )
        rates, directions = rates[~equal], directions[:, ~equal]


def _first_of(directions: Floats) -> Floats:
    """A unit vector (6 n,) of the space of orthonormal ones (k, 6 n), the same on any computer."""
    size = np.sum(directions**2, axis=0)
    k = int(np.argmax(size >= (1.0 - TIED) * np.max(size)))
    first: Floats = directions[:, k] @ directions / size[k] ** 0.5
    return first


def _rank(values: Floats, part: float) -> int:
    return int(np.sum(values > part * np.max(values, initial=0.0)))


def is_farther(evaluator: Evaluator, u: Floats, other: ConstraintRows, t: float) -> bool:
    """True if the rows of a state are clearly more independent than those of a singular pose."""
    parts = ((finite_rows(evaluator, t, u), REGULAR), (other, RCOND))
    no_one = np.zeros(0, dtype=np.int64)
    ranks = [
        _rank(np.linalg.svd(scaled_system(evaluator, r, r.C, no_one, "unit")[0])[1], part)
        for r, part in parts
    ]
    return ranks[0] > ranks[1]


def _closing(
    evaluator: Evaluator,
    u: Floats,
    rows: ConstraintRows,
    t: float,
    held: Integers,
    metric: str,
    ways: Floats,
    direction: Floats,
) -> Floats:
    """(f, f) the quadratic form by which motions along ways (f, 6 n) close a gap, rows (m,)."""
    still = u.copy()
    velocities_of(still)[:] = 0.0

    def closed(x: Floats) -> float:
        gamma = quadratic_part(evaluator, still, displacements(evaluator, x, metric).ravel(), t)
        return float(direction @ scaled_system(evaluator, rows, gamma, held, metric)[1])

    f = len(ways)
    form = np.zeros((f, f))
    for i in range(f):
        for j in range(i + 1):
            both = closed(ways[i] + ways[j]) - closed(ways[i] - ways[j])
            form[i, j] = form[j, i] = both / 4.0
    return form


def rotations(model: Model, start: Floats, end: Floats) -> str:
    """The rotations of bodies from one state (13 n,) to another, in words."""
    p, q = split(start)[1], split(end)[1]
    # q = d p, Euler parameters of the rotation between them: d = q p*
    cosine = np.sum(p * q, axis=1)
    sine = p[:, :1] * q[:, 1:] - q[:, :1] * p[:, 1:] - np.cross(q[:, 1:], p[:, 1:])
    sine *= np.where(cosine < 0.0, -1.0, 1.0)[:, None]
    size = np.linalg.norm(sine, axis=1)
    angle = 2.0 * np.arctan2(size, np.abs(cosine))
    order = [int(k) for k in np.argsort(-angle, kind="stable") if angle[k] > TURNED]
    listed = [
        f"{model.body_names[k]} turned by {angle[k]:.3g} rad about {_axis(sine[k] / size[k])}"
        for k in sorted(order[:MOST_BODIES])
    ]
    more = [f"and {len(order) - MOST_BODIES} bodies more"] if len(order) > MOST_BODIES else []
    return ", ".join([*listed, *more]) or "bodies moved without turning"


def _axis(n: Floats) -> str:
    return "[" + ", ".join(f"{c:.3g}" for c in np.where(np.abs(n) > TURNED, n, 0.0)) + "]"
