"""Redundant constraints: how many, where, and what they leave undetermined."""

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.constraint_rows import ConstraintRows, scaled_rows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.linear.rank import FEW_ROWS, WEIGHT, Dependency, Rank, dense_rank, sparse_rank
from dap3d_core.model import Model
from dap3d_core.registry.suggestions import some
from dap3d_core.simulation.initial.assemble import fit_of
from dap3d_core.simulation.initial.least_change import finite_rows
from dap3d_core.simulation.initial.singular_start import SingularStart, singular_start
from dap3d_core.simulation.redundancy.near_redundant import Binding, bindings

#: Redundant rows whose combination misses zero by more than this contradict each other: per unit of
#: the largest right-hand side, where that is above one (in the time of the scene).
CONSISTENT = 1e-8
#: Velocities this far off the constraints say nothing of the acceleration level.
MOVING_ALONG = 1e-6
#: Names that a paragraph lists.
MOST_NAMES = 12


@attrs.frozen
class Shared:
    """Joints that share freedoms among themselves, and with no others.

    Attributes:
        joints: their names, in file order.
        redundant: how many of their rows are redundant.
    """

    joints: tuple[str, ...]
    redundant: int


@attrs.frozen
class Contradiction:
    """Redundant rows that ask for different things.

    Attributes:
        level: "position" (the rows are open, and no first-order change closes them), "velocity"
            (prescribed velocities disagree) or "acceleration".
        joints: names of the joints whose rows disagree.
        size: length of what no motion can fulfil, |(I - D D^+) right-hand side|, in units of the
            rows.
    """

    level: str
    joints: tuple[str, ...]
    size: float


@attrs.frozen
class ReactionUniqueness:
    """Components of a reaction that are unique, of a joint with redundant rows.

    Attributes:
        joint: its name.
        rows: number of its rows.
        unique_rows: rows, from 1, whose multipliers are unique.
        force, moment: axes ("x", "xy", ..., global) along which force and moment on its first body
            (the moment about the mass centre) are unique at this pose.
    """

    joint: str
    rows: int
    unique_rows: tuple[int, ...]
    force: str
    moment: str

    def describe(self) -> str:
        """Text on the unique components."""
        parts = {"force": self.force, "moment": self.moment}
        words = [f"{name} {', '.join(axes)}" for name, axes in parts.items() if axes]
        if words:
            return f"{' and '.join(words)} alone unique"
        return "some multipliers alone unique" if self.unique_rows else "not unique"


@attrs.frozen(eq=False)
class Redundancy:
    """Rank of the constraints at a state.

    Attributes:
        rank: rows, rank, degrees of freedom.
        joints: names of the joints whose rows depend on each other, in file order.
        contradiction: how much prescribed velocities of dependent rows disagree.
        groups: the same joints by what they share.
        contradictions: where redundant rows ask for different things; empty if they agree.
        bindings: where redundant rows, besides, are nearly dependent on others and so lock a
            motion that they hardly hold.
        singular: branch on which the motion continues where the pose is singular.
    """

    rank: Rank
    joints: tuple[str, ...] = ()
    contradiction: float = 0.0
    groups: tuple[Shared, ...] = ()
    contradictions: tuple[Contradiction, ...] = ()
    bindings: tuple[Binding, ...] = ()
    singular: SingularStart | None = None
    _model: Model | None = attrs.field(default=None, repr=False)
    _rows: ConstraintRows | None = attrs.field(default=None, repr=False)

    @property
    def is_plain(self) -> bool:
        """True if redundant rows agree and stay so: a run may start as from independent ones."""
        return not (self.contradictions or self.bindings or self.singular)

    @property
    def unique_joints(self) -> tuple[str, ...]:
        """Names of the joints whose reactions are unique: those without a shared row."""
        involved = set(self.joints)
        names = self._model.joint_names if self._model else ()
        return tuple(name for name in names if name not in involved)

    def reactions(self) -> list[ReactionUniqueness]:
        """Uniqueness of the reactions of ``joints``, in their order.

        A multiplier is unique if its row is part of no dependency. The reaction J^T lambda of a
        joint can change by J^T c for each combination c of its rows; components that no c touches
        are unique although the multipliers may not be.
        """
        if self._model is None or self._rows is None:
            return []
        model, D = self._model, self._rows.sparse()
        changes: dict[int, list[Floats]] = {}
        for dependency in self.rank.dependencies:
            for k, mine in by_joint(model, dependency.rows):
                body = next(b for b in model.joint_slots[k] if b)
                D_b = D[dependency.rows[mine], 6 * body - 6 : 6 * body].toarray()
                changes.setdefault(k, []).append(dependency.combinations[:, mine] @ D_b)
        shared = self.rank.shared
        found = []
        for k in sorted(changes):
            rows = np.arange(model.joint_start[k], model.joint_start[k + 1])
            free = np.max(np.abs(np.vstack(changes[k])), axis=0) <= WEIGHT
            alone = np.flatnonzero(~np.isin(rows, shared)) + 1
            force, moment = ("".join(a for a, f in zip("xyz", part, strict=True) if f)
                             for part in (free[:3], free[3:]))  # fmt: skip
            unique_rows = tuple(int(row) for row in alone)
            found.append(
                ReactionUniqueness(model.joint_names[k], len(rows), unique_rows, force, moment)
            )
        return found

    def describe_reactions(self) -> list[str]:
        """A line for all joints of whose reactions the same is unique."""
        alike: dict[str, list[str]] = {}
        for reaction in self.reactions():
            alike.setdefault(reaction.describe(), []).append(reaction.joint)
        lines = [f"{words}: {some(names, MOST_NAMES)}" for words, names in alike.items()]
        if lines and self.unique_joints:
            lines.append(f"unique: {some(self.unique_joints, MOST_NAMES)}")
        return lines

    def describe(self) -> str:
        """One paragraph for people."""
        rank = self.rank
        freedoms = f"{rank.dof} degree{'s' if rank.dof != 1 else ''} of freedom"
        if not rank.redundant:
            return f"{rank.rows} rows, all independent; {freedoms}"
        verb = "is" if rank.redundant == 1 else "are"
        text = (
            f"{rank.redundant} of {rank.rows} constraint rows {verb} redundant (rank {rank.rank} "
            f"by {rank.method}, tolerance {rank.tolerance:.1e}); {freedoms}. "
            f"{self.describe_groups()}"
        )
        return ". ".join([text, *self.describe_contradictions()])

    def describe_groups(self) -> str:
        """The joints that share a freedom, by groups."""
        if len(self.groups) == 1:
            return f"The joints that share a freedom: {some(self.joints, MOST_NAMES)}"
        first = self.groups[:MOST_NAMES]
        words = [f"{some(g.joints, MOST_NAMES)} ({g.redundant} rows)" for g in first]
        more = len(self.groups) - len(words)
        words += [f"{more} more"] if more else []
        return f"The joints that share a freedom, in {len(self.groups)} groups: {'; '.join(words)}"

    def describe_contradictions(self) -> list[str]:
        """A sentence, without its full stop, for each contradiction."""
        what = {
            "position": "they cannot be closed together; what remains open is",
            "velocity": "their prescribed velocities disagree by",
            "acceleration": "what they ask of the accelerations disagrees by",
        }
        return [
            f"{'rows of ' if len(c.joints) == 1 else ''}{some(c.joints, MOST_NAMES)} contradict "
            f"each other: {what[c.level]} {c.size:.3g}"
            for c in self.contradictions
        ] + [binding.words for binding in self.bindings]


def redundancy_of(evaluator: Evaluator, u: Floats, t: float = 0.0) -> Redundancy:
    """Rank of the constraints of a model at a state u (13 n,).

    Raises:
        AssemblyError: a row is not finite there.
    """
    model = evaluator.model
    if not model.joint_row_count:
        return Redundancy(Rank(0, 6 * model.body_count, 0, 0.0, "svd"))
    found = finite_rows(evaluator, t, u)
    if model.contact_count:  # what contacts hold, they share by their own law
        found = found.first(model.joint_row_count)
    rows, gradient = scaled_rows(found, model.length)
    rank = rank_of(evaluator, rows)
    involved = sorted({k for d in rank.dependencies for k, _ in by_joint(model, d.rows)})
    binding = bindings(evaluator, rows, u, t) if rank.redundant else ()
    return Redundancy(
        rank,
        tuple(model.joint_names[k] for k in involved),
        max((_size(d, rows.nu, gradient) for d in rank.dependencies), default=0.0),
        _groups(model, rank.dependencies),
        tuple(_contradictions(evaluator, rank.dependencies, rows, gradient, u)),
        binding,
        singular_start(evaluator, u, rank, t) if rank.redundant and not binding else None,
        model,
        rows,
    )


def rank_of(evaluator: Evaluator, rows: ConstraintRows) -> Rank:
    """Rank of the rows that ``evaluator`` has just evaluated, scaled (``scaled_rows``).

    Singular values below FIT count as zero: joints are put together to no more than that, and an
    opening tilts rows that would depend on each other by as much.
    """
    model, blur = evaluator.model, fit_of(evaluator.model)
    if model.breaks and len(there := _rows_there(model, rows.dense())) < rows.shape[0]:
        rank = dense_rank(rows.dense()[there], blur)
        own = (attrs.evolve(d, rows=there[d.rows]) for d in rank.dependencies)
        return attrs.evolve(rank, dependencies=tuple(own))
    if model.row_count <= FEW_ROWS or model.contact_count:
        return dense_rank(rows.dense(), blur)
    D = evaluator.blocks(rows)
    return sparse_rank(evaluator.plan, D, evaluator.system.row, 6 * model.body_count, blur)


def _rows_there(model: Model, D: Floats) -> Integers:
    """Places of the rows of joints that hold; those of joints that do not are zero."""
    names = np.repeat(model.joint_names, np.diff(model.joint_start))[: len(D)]
    return np.flatnonzero(D.any(axis=1) | ~np.isin(names, list(model.breaks)))


def by_joint(model: Model, rows: Any) -> list[tuple[int, Any]]:
    """Joints that rows (ascending) belong to, and the places of each one's."""
    owner = np.searchsorted(model.joint_start, rows, side="right") - 1
    joints, first = np.unique(owner, return_index=True)
    places = np.split(np.arange(len(rows)), first[1:])
    return [(int(k), mine) for k, mine in zip(joints, places, strict=True)]


def _groups(model: Model, dependencies: Sequence[Dependency]) -> tuple[Shared, ...]:
    """Dependencies that have a joint in common are one group."""
    groups: list[tuple[set[int], int]] = []
    of_joint: dict[int, int] = {}
    for dependency in dependencies:
        joints = {k for k, _ in by_joint(model, dependency.rows)}
        redundant = len(dependency.combinations)
        for old in {of_joint[k] for k in joints if k in of_joint}:
            joints |= groups[old][0]
            redundant += groups[old][1]
            groups[old] = (set(), 0)
        groups.append((joints, redundant))
        of_joint.update(dict.fromkeys(joints, len(groups) - 1))
    found = sorted((sorted(joints), redundant) for joints, redundant in groups if joints)
    return tuple(Shared(tuple(model.joint_names[k] for k in j), r) for j, r in found)


def _gap(dependency: Dependency, side: Floats) -> Floats:
    """Part of a right-hand side that no motion fulfils, on a basis of the combinations."""
    return dependency.combinations @ side[dependency.rows]


def _size(dependency: Dependency, side: Floats, gradient: Floats) -> float:
    """Length of what no motion can fulfil, in units of the rows."""
    return float(np.linalg.norm(_gap(dependency, side)) * np.max(gradient[dependency.rows]))


def _contradictions(
    evaluator: Evaluator,
    dependencies: Sequence[Dependency],
    rows: ConstraintRows,
    gradient: Floats,
    u: Floats,
) -> list[Contradiction]:
    """At each level, where the one below leaves it a meaning."""
    found: list[Contradiction] = []
    model, time = evaluator.model, evaluator.time
    if not dependencies:
        return found
    v = u[-rows.shape[1] :] / np.tile(np.repeat([model.length, 1.0], 3), model.body_count)
    off = rows.product(v) - rows.nu
    fastest = max(1.0 / time, float(np.max(np.abs(v))))
    moving_along = float(np.max(np.abs(off))) <= MOVING_ALONG * fastest
    for dependency in dependencies:
        open_ = _judged(model, dependency, rows.C, gradient, "position", 1.0)
        gap = np.linalg.norm(_gap(dependency, rows.C))
        if open_ and gap > 0.5 * np.linalg.norm(rows.C[dependency.rows]):
            found.append(open_)
        level = _judged(model, dependency, rows.nu, gradient, "velocity", 1.0 / time)
        if not level and moving_along and not open_:
            level = _judged(model, dependency, rows.gamma, gradient, "acceleration", time**-2)
        found += [level] if level else []
    return found


def _judged(
    model: Model, dependency: Dependency, side: Floats, gradient: Floats, level: str, least: float
) -> Contradiction | None:
    gap = _gap(dependency, side)
    size, limit = float(np.linalg.norm(gap)), CONSISTENT * max(least, float(np.max(np.abs(side))))
    if size <= limit:
        return None
    missed = np.abs(gap @ dependency.combinations)
    chosen = dependency.rows[missed > 0.01 * np.max(missed)]
    names = tuple(model.joint_names[k] for k, _ in by_joint(model, chosen))
    return Contradiction(level, names, _size(dependency, side, gradient))
