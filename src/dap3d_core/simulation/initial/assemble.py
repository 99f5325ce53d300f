"""Initial conditions brought onto the constraints, at position and at velocity level.

The change is the least one: of all that fulfil the linear equations D x = residual the one whose
sum of squares is the smallest, of displacements in m (in units of ``Model.length`` where the scene
is not of ordinary size) and rotations in rad as they are (metric "unit", the manual's), or weighted
by masses and inertias (metric "mass"): a heavy body then stays nearly where it is.
"""

from collections.abc import Collection, Iterator
from itertools import pairwise

import attrs
import numpy as np

from dap3d_core.formulations.constraint_rows import ConstraintRows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.linear.rank import DENSE_ROWS
from dap3d_core.model import Model
from dap3d_core.model.state_layout import at_rest, split, state_layout, velocities_of
from dap3d_core.result import Note, information
from dap3d_core.scene import Body, Scene
from dap3d_core.simulation.errors import AssemblyError
from dap3d_core.simulation.initial.least_change import (
    RCOND,
    displaced,
    displacement,
    displacements,
    finite_rows,
    largest_move,
    least_change,
    quadratic_part,
    scaled_system,
)

#: Position residuals above this are corrected; Newton stops below it.
TOLERANCE = 1e-10
#: Positions that no pass brings closer count as closed below this (as a part of the model where it
#: is smaller than one metre), with a note: joints that are redundant but for a misfit.
FIT = 1e-8
MOST_PASSES = 25
#: A pass turns no body by more than this (rad), moves none by more than this part of the model.
MOST_TURN, MOST_SHIFT = 0.5, 0.5
#: A correction of this part of the model's size, or of the speeds, is one of rounding.
SMALL_CORRECTION = 1e-6
#: A row of a shorter gradient, in its own units, is not changed by small changes.
FLAT = 1e-6
#: Singular poses that an assembly leaves.
MOST_LEFT = 2
#: Joints that the message of a failure lists.
MOST_JOINTS = 10
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


@attrs.frozen(eq=False)
class Initial:
    """A corrected start.

    Attributes:
        u: (13 n,) the state.
        violation: (position, velocity) largest residuals as given.
        residual: the same after the correction.
        passes: Newton passes at position level.
        moved, turned: largest displacement in m and rotation in rad of a body.
        branch: the rotations by which it left a singular pose, in words; "" where there was none.
    """

    u: Floats
    violation: tuple[float, float]
    residual: tuple[float, float]
    passes: int
    moved: float
    turned: float
    branch: str = ""


def violation(evaluator: Evaluator, u: Floats, t: float = 0.0) -> tuple[float, float]:
    """Largest residuals |C| and |D v - nu| of a state u (13 n,).

    In the units of the rows; in m and m/s where the scene is not of ordinary size (Model.length).
    """
    if not evaluator.model.row_count:
        return 0.0, 0.0
    rows = finite_rows(evaluator, t, u)
    weight = weights_of(evaluator)
    residual = rows.product(velocities_of(u)) - rows.nu
    return largest(weight * rows.C), largest(weight * residual)


def weights_of(evaluator: Evaluator) -> Floats:
    """(rows,) weights of the residuals of the model's rows (System.weight)."""
    return evaluator.system.weight[evaluator.system.row]


def correct_initial(
    evaluator: Evaluator,
    u: Floats,
    t: float = 0.0,
    hold: Collection[int] = (),
    metric: str = "unit",
    tolerance: float | None = None,
) -> Initial:
    """Correct positions by Newton's method, velocities by a linear step, each by the least change.

    Rows without a position level do not take part in the position stage.

    Args:
        u: (13 n,) the state as given.
        hold: bodies, from 1, that the position stage leaves where they are.
        metric: "unit" or "mass", see the head of this file.
        tolerance: of the position residual, of 1 m; TOLERANCE by default.

    Raises:
        AssemblyError: the position residual does not vanish; the message has that of each joint.
    """
    before = violation(evaluator, u, t)
    if not evaluator.model.row_count:
        return Initial(u, before, before, 0, 0.0, 0.0)
    start = u
    u, passes = Assembly(evaluator, t, hold, metric, tolerance).close(u, MOST_LEFT)
    branch = _rotations(evaluator.model, start, u) if passes > MOST_PASSES else ""
    rows = finite_rows(evaluator, t, u)
    residual = rows.product(velocities_of(u)) - rows.nu
    if largest(residual) > 0.0:
        u = u.copy()
        velocities = velocities_of(u)
        velocities -= least_change(evaluator, rows, residual, t, None, metric)
    moved, turned = distance(start, u, evaluator.model.body_count)
    after = violation(evaluator, u, t)
    return Initial(u, before, after, passes, float(moved), float(turned), branch)


def correction_notes(initial: Initial, evaluator: Evaluator, scene: Scene) -> list[str]:
    """Description of the changes.

    No more than rounding, or velocities that the scene leaves open, is for information.
    """
    notes: list[str] = []
    position, velocity = initial.violation
    tolerance = TOLERANCE * evaluator.model.length
    if position > tolerance:
        note = information if position <= SMALL_CORRECTION * evaluator.model.size else Note
        notes.append(
            note(
                f"initial positions corrected in {initial.passes} passes: "
                f"|C| {position:.2g} -> {initial.residual[0]:.2g}; "
                f"bodies moved by up to {initial.moved:.2g} m and {initial.turned:.2g} rad"
            )
        )
    if initial.branch:
        notes.append(
            "the bodies were drawn at a singular pose, such as a straight line, from where two or "
            f"more ways lead to an assembled one. Taken was: {initial.branch}. For another, draw "
            "them a little off that pose"
        )
    if initial.residual[0] > tolerance:
        notes.append(
            f"redundant joints do not fit together: {initial.residual[0]:.2g} of their positions "
            f"stays open. Below {FIT:g} the run goes on as if they fitted"
        )
    if velocity > tolerance:
        speed = largest(velocities_of(evaluator.model.u0))
        usual = attrs.fields(Body)
        open_ = all(
            body.r_dot is usual.r_dot.default and body.w is usual.w.default
            for body in scene.bodies.values()
        )
        note = information if open_ or velocity <= SMALL_CORRECTION * speed else Note
        notes.append(
            note(
                "initial velocities corrected: "
                f"|D v - nu| {velocity:.2g} -> {initial.residual[1]:.2g}"
            )
        )
    return notes


class Assembly:
    """Positions of a model brought onto its constraints, by Newton's method.

    Rows without a position level do not take part.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        t: float = 0.0,
        hold: Collection[int] = (),
        metric: str = "unit",
        tolerance: float | None = None,
    ) -> None:
        """Args: as of ``correct_initial``."""
        self.evaluator, self.t, self.metric = evaluator, t, metric
        self.held = np.array(sorted(hold), dtype=np.int64)
        self.closed = evaluator.model.length * (TOLERANCE if tolerance is None else tolerance)

    def close(self, u: Floats, leaves: int = 0) -> tuple[Floats, int]:
        """The state with other r and p, and the passes.

        leaves: how many singular poses it may leave, on one of several branches; passes are then
        more than MOST_PASSES.

        Raises:
            AssemblyError: the residual does not vanish; the message has that of each joint.
        """
        evaluator, model, limit, before = self.evaluator, self.evaluator.model, 1.0, np.inf
        weight, fit = weights_of(evaluator), model.length * fit_of(model)
        for passes in range(MOST_PASSES + 1):
            rows = finite_rows(evaluator, self.t, u)
            worst = largest(weight * rows.C)
            stands = worst > 0.5 * before and worst <= max(fit, TOLERANCE * model.length)
            if worst <= self.closed or stands:
                return u, passes
            before = worst
            if passes == MOST_PASSES:
                break
            change = least_change(evaluator, rows, rows.C, self.t, self.held, self.metric)
            limit = _step_limit(change, model.size)
            u = displaced(u, -limit * change)
        if leaves and not _without_gradient(evaluator, rows):
            found = self._leave(u, rows, leaves)
            if found is not None:
                return found[0], passes + found[1]
        raise _failure(evaluator, rows, passes, self.held, is_far=limit < 1.0)

    def _leave(self, u: Floats, rows: ConstraintRows, leaves: int) -> tuple[Floats, int] | None:
        """Assemble from a singular pose; None where that fails."""
        found = None
        for change in self._ways_out(u, rows):
            away = displaced(u, _step_limit(change, self.evaluator.model.size) * change)
            try:
                closed, passes = self.close(away, leaves - 1)
            except AssemblyError:
                continue
            if _is_farther(self.evaluator, closed, rows, self.t):
                return closed, passes + 1
            found = found or (closed, passes + 1)
        return found

    def _ways_out(self, u: Floats, rows: ConstraintRows) -> Iterator[Floats]:
        """Displacements (n, 6) from a singular pose that close its gap, the smallest first.

        No small change closes a gap there to first order: of a mechanism drawn straight, for
        example. Along velocities v that the rows allow C changes by -gamma(v) s^2 / 2: the
        direction in which that closes the gap with the least motion leads away. Of those that close
        it equally well, and of the two signs, the one in which the first component that can be
        largest is positive.
        """
        if len(rows.C) > DENSE_ROWS:
            return
        evaluator, held = self.evaluator, self.held
        D, gap = scaled_system(evaluator, rows, rows.C, held, self.metric)
        is_free = np.repeat(~np.isin(np.arange(1, evaluator.model.body_count + 1), held), 6)
        left, values, right = np.linalg.svd(D[:, is_free])
        rank = _rank(values, RCOND)
        beyond = gap - left[:, :rank] @ (left[:, :rank].T @ gap)
        distance = float(np.linalg.norm(beyond))
        if distance < OPEN * np.linalg.norm(gap) or not 0 < len(right) - rank <= MOST_FREE:
            return
        motions = np.zeros((len(right) - rank, len(is_free)))
        motions[:, is_free] = right[rank:]
        closing = self._closing(u, rows, motions, beyond / distance)
        rates, directions = np.linalg.eigh(closing)
        least = CLOSING * max(-float(rates[0]), evaluator.model.length)
        for _ in range(MOST_WAYS):
            if not rates.size or not rates[-1] > least:
                return
            equal = rates >= (1.0 - TIED) * rates[-1]
            yield displacements(
                evaluator,
                _first_of(directions[:, equal].T @ motions) * (2.0 * distance / rates[-1]) ** 0.5,
                self.metric,
            )
            rates, directions = rates[~equal], directions[:, ~equal]

    def _closing(self, u: Floats, rows: ConstraintRows, ways: Floats, direction: Floats) -> Floats:
        """(f, f) the quadratic form by which motions along ways (f, 6 n) close a gap, rows (m,)."""
        still, evaluator, metric = at_rest(u), self.evaluator, self.metric

        def closed(x: Floats) -> float:
            gamma = quadratic_part(
                evaluator, still, displacements(evaluator, x, metric).ravel(), self.t
            )
            return float(direction @ scaled_system(evaluator, rows, gamma, self.held, metric)[1])

        f = len(ways)
        form = np.zeros((f, f))
        for i in range(f):
            for j in range(i + 1):
                both = closed(ways[i] + ways[j]) - closed(ways[i] - ways[j])
                form[i, j] = form[j, i] = both / 4.0
        return form


def _step_limit(change: Floats, size: float) -> float:
    """The part of a change (n, 6) that a pass makes."""
    shift, turn = largest_move(change)
    shift_limit = MOST_SHIFT * size / shift if shift else 1.0
    turn_limit = MOST_TURN / turn if turn else 1.0
    return min(1.0, shift_limit, turn_limit)


def distance(u: Floats, other: Floats, n: int) -> tuple[Floats, Floats]:
    """Largest displacement, m, and rotation, rad, of a body between states (..., 13 n or more)."""
    size = state_layout(n).size
    r, p, _, _ = split(u[..., :size])
    s, q, _, _ = split(other[..., :size])
    cosine = np.sum(p * q, axis=-1)
    sine = np.linalg.norm(p - np.sign(cosine)[..., None] * q, axis=-1)
    cosine = np.clip(np.abs(cosine), 0.0, 1.0)
    small, large = 4.0 * np.arcsin(np.clip(sine / 2.0, 0, 1)), 2.0 * np.arccos(cosine)
    angle = np.where(cosine > 0.9, small, large)
    shift = np.linalg.norm(r - s, axis=-1)
    return np.max(shift, axis=-1, initial=0.0), np.max(angle, axis=-1, initial=0.0)


def fit_of(model: Model) -> float:
    """Residual at which joints count as closed, as a fraction of the scene's length (FIT)."""
    return FIT * min(1.0, model.size / model.length)


def max_speed(evaluator: Evaluator, v: Floats) -> float:
    """Largest speed at velocities (6 n,), in rad/s or lengths of the model a second."""
    x = np.abs(v.reshape(-1, 6))
    return max(largest(x[:, :3]) / evaluator.model.size, largest(x[:, 3:]))


def largest(values: Floats) -> float:
    """The largest magnitude; 0 of no values."""
    return float(np.max(np.abs(values), initial=0.0))


def _failure(
    evaluator: Evaluator, rows: ConstraintRows, passes: int, held: Integers, *, is_far: bool
) -> AssemblyError:
    """Reason of the failure: the open joints, the worst first, in lines of at most 80 columns."""
    model, C = evaluator.model, weights_of(evaluator) * rows.C
    tolerance = TOLERANCE * model.length
    worst = np.array([largest(C[a:b]) for a, b in pairwise(model.joint_start)])
    still_open = [int(k) for k in np.argsort(-worst, kind="stable") if worst[k] > tolerance]
    types = {int(k): group.keyword for group in model.joints for k in group.members}
    lines = [f"  {'joint':30} {'type':10} {'residual':>9}  rows"]
    for k in still_open[:MOST_JOINTS]:
        open_rows = np.flatnonzero(np.abs(C[slice(*model.joint_start[k : k + 2])]) > tolerance) + 1
        words = ", ".join(map(str, open_rows))
        name = f"{_cut(model.joint_names[k], 30):30} {_cut(types[k], 10):10}"
        lines.append(f"  {name} {worst[k]:9.3g}  {_cut(words, 25)}")
    if len(still_open) > MOST_JOINTS:
        lines.append(f"  and {len(still_open) - MOST_JOINTS} joints more")
    names = ", ".join(model.body_names[b - 1] for b in held)
    why = ["bodies that do not reach their joints, and", "contradictory joints cannot be assembled"]
    if is_far:
        why = ["the bodies were still on their way: give positions nearer to an assembled pose,",
               "unless the joints contradict each other"]  # fmt: skip
    if flat := _without_gradient(evaluator, rows):
        why = [f"no small change closes {flat}: points coincide there, or axes are",
               "parallel or perpendicular and should not be; begin at another pose"]  # fmt: skip
    text = "\n".join(
        [
            "the initial positions cannot be assembled:",
            f"after {passes} passes these joints are still open",
            *lines,
            "check the points, axes and lengths of these joints;",
            *why,
            *([f"held where they are: {names}"] if names else []),
        ]
    )
    return AssemblyError(text, [model.joint_names[k] for k in still_open])


def _without_gradient(evaluator: Evaluator, rows: ConstraintRows) -> str:
    """The first open row that no change of the pose affects to first order, in words; else ""."""
    weight, unit = weights_of(evaluator), evaluator.model.length
    length = weight * np.bincount(rows.row, rows.value**2, minlength=rows.shape[0]) ** 0.5
    stuck = np.flatnonzero((weight * np.abs(rows.C) > TOLERANCE * unit) & (length < FLAT * unit))
    if not len(stuck):
        return ""
    k = int(np.searchsorted(evaluator.model.joint_start, stuck[0], side="right")) - 1
    row = int(stuck[0] - evaluator.model.joint_start[k]) + 1
    return f"row {row} of {_cut(evaluator.model.joint_names[k], 30)}"


def _is_farther(evaluator: Evaluator, u: Floats, other: ConstraintRows, t: float) -> bool:
    """True if the rows of a state are clearly more independent than those of a singular pose."""
    parts = ((finite_rows(evaluator, t, u), REGULAR), (other, RCOND))
    no_one = np.zeros(0, dtype=np.int64)
    ranks = [
        _rank(np.linalg.svd(scaled_system(evaluator, r, r.C, no_one, "unit")[0])[1], part)
        for r, part in parts
    ]
    return ranks[0] > ranks[1]


def _cut(words: str, width: int) -> str:
    return words if len(words) <= width else f"{words[: width - 3]}..."


def _first_of(directions: Floats) -> Floats:
    """A unit vector (6 n,) of the space of orthonormal ones (k, 6 n), the same on any computer."""
    size = np.sum(directions**2, axis=0)
    k = int(np.argmax(size >= (1.0 - TIED) * np.max(size)))
    return directions[:, k] @ directions / size[k] ** 0.5


def _rank(values: Floats, part: float) -> int:
    return int(np.sum(values > part * np.max(values, initial=0.0)))


def _rotations(model: Model, start: Floats, end: Floats) -> str:
    """The rotations of bodies from one state (13 n,) to another, in words."""
    _, turn = displacement(start, end)
    angle = np.linalg.norm(turn, axis=1)
    order = [int(k) for k in np.argsort(-angle, kind="stable") if angle[k] > TURNED]
    listed = [
        f"{model.body_names[k]} turned by {angle[k]:.3g} rad about {_axis(turn[k] / angle[k])}"
        for k in sorted(order[:MOST_BODIES])
    ]
    more = [f"and {len(order) - MOST_BODIES} bodies more"] if len(order) > MOST_BODIES else []
    return ", ".join([*listed, *more]) or "bodies moved without turning"


def _axis(n: Floats) -> str:
    return "[" + ", ".join(f"{c:.3g}" for c in np.where(np.abs(n) > TURNED, n, 0.0)) + "]"
