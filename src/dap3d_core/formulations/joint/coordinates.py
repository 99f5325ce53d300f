"""Joint coordinates as the state of an evaluator: from body coordinates and back."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import attrs
import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers, System
from dap3d_core.assembly.motion.classify import classify
from dap3d_core.assembly.tree_arrays import KeptRowArrays, TreeArrays
from dap3d_core.formulations.joint.equations import TWO_TURNS, body_state
from dap3d_core.formulations.joint.node_layout import (
    CHILD,
    CHILD_BLOCK,
    CONSTANT_WIDTH,
    COORDINATE,
    FIRST_ROW,
    FREE,
    JOINT_PARENT,
    JOINT_WIDTH,
    MOTION,
    PARENT_BLOCK,
    PRISMATIC,
    RATE,
    REVOLUTE,
    ROW_COUNT,
    SPHERICAL,
    WORK_WIDTH,
)
from dap3d_core.formulations.joint.reference import Reference
from dap3d_core.formulations.joint.tree_nodes import (
    SEGMENTS,
    TreeNodes,
    tree_nodes,
    unsuitable_motion,
)
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH
from dap3d_core.linear.ldlt.plan import Plan
from dap3d_core.linear.ordering.spanning_forest import SpanningForest, spanning_forest
from dap3d_core.model import Model

if TYPE_CHECKING:
    from dap3d_core.formulations.evaluator import Evaluator

#: A note says where right-hand sides take more than this time of method standard.
COSTLY = 1.2
#: Joints that words name.
MOST_NAMES = 5
#: Quantities of the segments of a state, as in tolerances.
QUANTITIES = {
    "angles": "p", "lengths": "r", "rotations": "pppp", "poses": "rrrpppp",
    "angle_rates": "w", "length_rates": "v", "rotation_rates": "www", "pose_rates": "vvvwww",
}  # fmt: skip


class Coordinates:
    """Joint coordinates of a model on a spanning tree of its joints, with their rates.

    Attributes:
        size, length_count: as of ``formulations.coordinates.Coordinates``.
        equations: the package of formulations that has the compiled functions.
        nodes: of the tree.
        kept: joints that are not in the tree, whose rows are kept, and the reasons in words.
    """

    def __init__(self, evaluator: "Evaluator") -> None:
        """Give an evaluator the arrays of a tree.

        Raises:
            UnsuitableError: the rows that are kept on the tree would take too much memory.
            PluginError: the kernels of a type cannot be compiled.
        """
        model = evaluator.model
        motions = classify(model)
        ends: dict[int, tuple[int, int]] = {}
        reasons = dict(motions.refused)
        for group in motions.motions:
            joints = group.joints.tolist()
            if reason := unsuitable_motion(group):
                reasons |= dict.fromkeys(joints, reason)
            else:
                bodies = zip(group.body_i.tolist(), group.body_j.tolist(), strict=True)
                ends |= zip(joints, bodies, strict=True)
        tree = spanning_forest(model.body_count, ends, model.joint_rows.tolist())
        reasons |= {cut.joint: cut.words(model.joint_names) for cut in tree.cuts}
        self.evaluator = evaluator
        self.kept: dict[int, str] = dict(sorted(reasons.items()))
        self.nodes: TreeNodes = tree_nodes(tree, motions, model.body_count)
        self.size = self.nodes.layout.size - 1
        self.length_count = len(self.kept)
        self.equations = "joint_loops" if self.kept else "joint"
        rows = _kept_rows(evaluator, self.nodes, tuple(self.kept)) if self.kept else None
        self._cost_ratio = rows[1] if rows else 0.0
        evaluator.system = _with_tree(evaluator, self.nodes, tree, rows[0] if rows else None)

    @property
    def quantities(self) -> list[str]:
        """As of ``formulations.coordinates.Coordinates``."""
        found: list[str] = []
        for name, letters in QUANTITIES.items():
            found += letters * (self.nodes.layout.length(name) // len(letters))
        return found

    @property
    def bodies(self) -> Integers:
        """(size,) body that each component moves, from 0."""
        table, found = self.nodes.table, np.zeros(self.size, dtype=np.int64)
        for motion, (_, _, size, rate_size) in SEGMENTS.items():
            nodes = 1 + np.flatnonzero(table[1:, MOTION] == motion)
            for column, count in ((COORDINATE, size), (RATE, rate_size)):
                places = table[nodes, column][:, None] + np.arange(count)
                found[places] = self.nodes.frame[nodes][:, None] - 1
        return found

    def structure(self) -> tuple[str, str]:
        """As of ``formulations.coordinates.Coordinates``."""
        table = self.nodes.table[1:, MOTION]
        names = {REVOLUTE: "angles", PRISMATIC: "lengths", SPHERICAL: "balls", FREE: "free bodies"}
        counts = {name: int(np.count_nonzero(table == motion)) for motion, name in names.items()}
        parts = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
        words = f"{len(table)} nodes: {parts or 'nothing moves'}"
        return "tree", f"{words}; {self._kept_words()}" if self.kept else words

    @property
    def notes(self) -> list[str]:
        """As of ``formulations.coordinates.Coordinates``."""
        notes = [f"method joint: {self._kept_words()}"] if self.kept else []
        if self._cost_ratio > COSTLY:
            notes.append(
                f"method joint takes some {self._cost_ratio:.2g} times as long as standard or lsq "
                "here: its kept rows meet far from ground, or many of them do; auto takes those"
            )
        return notes

    def _kept_words(self) -> str:
        """Joints whose rows are kept, with the reasons."""
        model, kept = self.evaluator.model, list(self.kept)
        named = [f"{model.joint_names[k]} ({self.kept[k]})" for k in kept[:MOST_NAMES]]
        more = f" and {len(kept) - MOST_NAMES} more" if len(kept) > MOST_NAMES else ""
        count = int(np.sum(model.joint_rows[kept]))
        return f"{count} rows kept, of {', '.join(named)}{more}"

    def start(self, u: Floats) -> Floats:
        """The state y of a run from a state u (13 n,), whose poses become the reference."""
        reference = Reference(self.nodes, self.evaluator.model, u)
        self._tree.constants[:] = reference.constants()
        y = reference.state()
        if self.kept:
            from dap3d_core.formulations.joint_loops.reference_pivots import judge_kept_rows

            judge_kept_rows(self.evaluator, y)
        return y

    def body_states(self, y: Floats) -> Floats:
        """States (k, 13 n + 1) of bodies of states (k, size + 1)."""
        out = np.empty((len(y), self.evaluator.model.u0.size + 1))
        for state, row in zip(y, out, strict=True):
            body_state(state, row, self.evaluator.system)
        return out

    def continued(self, expected: Floats, y: Floats) -> Floats:
        """The state y with angles that ``project`` has not brought back, near those expected."""
        angles, continued = self.nodes.layout["angles"], y.copy()
        turns = np.rint((expected[angles] - y[angles]) / TWO_TURNS)
        continued[angles] += TWO_TURNS * turns
        return continued

    @contextmanager
    def at(self, u: Floats) -> Iterator[Floats]:
        """The state y of a state u; the reference of a run is restored afterwards."""
        tree = self._tree
        arrays = [tree.constants, *([tree.kept.smallest, tree.kept.settings] if self.kept else [])]
        before = [array.copy() for array in arrays]
        try:
            yield self.start(u)
        finally:
            for array, values in zip(arrays, before, strict=True):
                array[:] = values

    @property
    def _tree(self) -> TreeArrays:
        tree: TreeArrays = self.evaluator.system.tree
        return tree


def _with_tree(
    evaluator: "Evaluator", nodes: TreeNodes, tree: SpanningForest, kept: KeptRowArrays | None
) -> System:
    """The system with arrays of a tree; ``body`` is then the first rows of its places."""
    system, model, plan = evaluator.system, evaluator.model, evaluator.plan
    bodies, count = len(system.body), len(nodes.table)
    places = np.zeros((nodes.row_count, BODY_WIDTH))
    places[:bodies] = system.body
    revolutes = int(np.count_nonzero(nodes.table[1:, MOTION] == REVOLUTE))
    arrays = TreeArrays(
        nodes=nodes.table,
        joints=_joints(tree, model, plan),
        places=places,
        constants=np.zeros(count * CONSTANT_WIDTH),
        work=np.zeros(count * WORK_WIDTH),
        half_angles=np.zeros((2, revolutes)),
        scratch=np.zeros(48),
        force=np.zeros_like(system.force),
        slope=np.zeros(nodes.layout.size),
        kept=kept,
    )
    return attrs.evolve(system, body=places[:bodies], tree=arrays)


def _kept_rows(
    evaluator: "Evaluator", nodes: TreeNodes, joints: tuple[int, ...]
) -> tuple[KeptRowArrays, float]:
    """Arrays of kept rows, and the time that a right-hand side takes over that of standard."""
    from dap3d_core.formulations.joint_loops import tables

    model, plan = evaluator.model, evaluator.plan
    kept = tables.kept_rows(joints, model, nodes)
    calls = tables.kept_calls(kept, evaluator.loop_groups, evaluator.system.groups)
    ratio = tables.cost_ratio(kept, nodes, plan, model.body_count)
    return tables.kept_row_arrays(kept, model, plan, nodes, calls), ratio


def _joints(tree: SpanningForest, model: Model, plan: Plan) -> Integers:
    """``TreeArrays.joints``."""
    rows = []
    for k, parent, child in zip(
        tree.joint[::-1].tolist(), tree.parent[::-1].tolist(), tree.child[::-1].tolist(),
        strict=True,
    ):  # fmt: skip
        if k >= 0:
            row, slots, blocks = [0] * JOINT_WIDTH, model.joint_slots[k], plan.joint_block[k]
            row[CHILD_BLOCK], row[CHILD] = blocks[slots.index(child)], 6 * child
            if parent:
                row[PARENT_BLOCK], row[JOINT_PARENT] = blocks[slots.index(parent)], 6 * parent
            row[ROW_COUNT], row[FIRST_ROW] = model.joint_rows[k], plan.joint_row[k]
            rows.append(row)
    return np.array(rows, dtype=np.int64).reshape(-1, JOINT_WIDTH)
