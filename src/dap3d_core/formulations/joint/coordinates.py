"""Joint coordinates as the state of an evaluator: from body coordinates and back."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.assembly import turns as turn_columns
from dap3d_core.assembly.arrays import Floats, Integers, KeptRowArrays, System, TreeArrays
from dap3d_core.assembly.motion.classify import classify
from dap3d_core.assembly.motion.joint_motion import ModelMotions
from dap3d_core.formulations import FUNCTIONS
from dap3d_core.formulations.coordinates import Coordinates
from dap3d_core.formulations.joint import node_layout as node
from dap3d_core.formulations.joint.equations import body_state
from dap3d_core.formulations.joint.tree_nodes import (
    SEGMENTS,
    Reference,
    TreeNodes,
    inertias_about,
    tree_nodes,
    unsuitable_motion,
)
from dap3d_core.kernels.runtime.cache import prepared
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH
from dap3d_core.linear.ldlt.plan import Plan
from dap3d_core.linear.ordering.spanning_forest import SpanningForest, spanning_forest
from dap3d_core.model import Model
from dap3d_core.model.rotations import euler_rates
from dap3d_core.model.state_layout import join, split, u_from_y, velocities_of
from dap3d_core.registry.suggestions import some

if TYPE_CHECKING:
    from dap3d_core.formulations.evaluator import Evaluator

#: A note says where right-hand sides take more than this time of method standard.
COSTLY = 1.2
#: Bodies of less than this part of the largest mass have next to none: stand-ins of imported links.
LIGHT = 1e-9
#: Joints that words name; elementary motions of a joint at most.
MOST_NAMES, MOST_PARTS = 5, 8
#: Quantities of the segments of a state, as in tolerances.
QUANTITIES = {
    "angles": "p", "lengths": "r", "rotations": "pppp", "poses": "rrrpppp",
    "angle_rates": "w", "length_rates": "v", "rotation_rates": "www", "pose_rates": "vvvwww",
    "states": "z",
}  # fmt: skip
#: Motion of a node -> its noun, of one and of several.
NOUNS = {
    node.REVOLUTE: ("angle", "angles"), node.PRISMATIC: ("length", "lengths"),
    node.SPHERICAL: ("ball", "balls"), node.FREE: ("free body", "free bodies"),
}  # fmt: skip
#: Segments of rates.
RATES = ("angle_rates", "length_rates", "rotation_rates", "pose_rates")


class TreeCoordinates(Coordinates):
    """Joint coordinates of a model on a spanning tree of its joints, with their rates.

    Attributes:
        nodes: of the tree.
        kept: joints that are not in the tree, whose rows are kept, and the reasons in words.
    """

    are_of_bodies = False

    def __init__(self, evaluator: "Evaluator") -> None:
        """Give an evaluator the arrays of a tree.

        Raises:
            UnsuitableError: the rows that are kept on the tree would take too much memory.
            PluginError: the kernels of a type cannot be compiled.
        """
        model = evaluator.model
        motions, tree, reasons = _tree_and_reasons(model)
        self.evaluator = evaluator
        self.kept: dict[int, str] = reasons
        self.nodes: TreeNodes = tree_nodes(tree, motions, model.body_count, model.state_count)
        self.size = self.nodes.layout.size - 1
        self.length_count = len(self.kept)
        if self.kept:  # their loads pass a body with the factors of its inertia
            self.nodes.table[:, node.FLAGS] &= ~node.IS_ALONE
        #: The last start of a run: u, the constants of the tree, y.
        self._last: tuple[Floats, Floats, Floats] | None = None
        rows = _kept_rows(evaluator, self.nodes, tuple(self.kept)) if self.kept else None
        self._cost_ratio = rows[1] if rows else 0.0
        evaluator.system = _with_tree(evaluator, self.nodes, tree, rows[0] if rows else None)
        self.reference = (self._tree.constants,)

    def function(self, k: int) -> Any:
        """As of ``Coordinates``."""
        name = "joint_loops" if self.kept else "joint"
        name += ".contacts" if self.evaluator.model.contact_count else ""
        return getattr(import_module(f"dap3d_core.formulations.{name}"), FUNCTIONS[k])

    @property
    def quantities(self) -> list[str]:
        """As of ``Coordinates``."""
        found: list[str] = []
        for name, letters in QUANTITIES.items():
            found += letters * (self.nodes.layout.length(name) // len(letters))
        return found

    @property
    def bodies(self) -> Integers:
        """As of ``Coordinates``."""
        table, found = self.nodes.table, np.full(self.size, -1)
        for motion, (_, _, size, rate_size) in SEGMENTS.items():
            nodes = 1 + np.flatnonzero(table[1:, node.MOTION] == motion)
            for column, count in ((node.COORDINATE, size), (node.RATE, rate_size)):
                places = table[nodes, column][:, None] + np.arange(count)
                found[places] = self.nodes.frame[nodes][:, None] - 1
        return found

    @property
    def names(self) -> list[str]:
        """As of ``Coordinates``."""
        return [str(1 + k) for k in range(self.size)]

    @property
    def suits_batches(self) -> bool:
        """As of ``Coordinates``: numbers of kept rows and of elements' states are of one run."""
        return not self.kept and not self.evaluator.model.state_count

    def structure(self) -> tuple[str, str]:
        """As of ``Coordinates``."""
        table = self.nodes.table[1:, node.MOTION]
        counts = {motion: int(np.count_nonzero(table == motion)) for motion in NOUNS}
        parts = [f"{n} {NOUNS[motion][n > 1]}" for motion, n in counts.items() if n]
        nodes = f"{len(table)} node{'s' if len(table) != 1 else ''}"
        words = f"{nodes}: {', '.join(parts) or 'nothing moves'}"
        return "tree", f"{words}; {self._kept_words()}" if self.kept else words

    @property
    def notes(self) -> list[str]:
        """As of ``Coordinates``."""
        notes = [f"method joint: {self._kept_words()}"] if self.kept else []
        if self._cost_ratio > COSTLY:
            notes.append(
                f"method joint takes some {self._cost_ratio:.2g} times as long as standard or lsq "
                "here: its kept rows meet far from ground, or many of them do; auto takes those"
            )
        elif self.evaluator.model.contact_count:
            pass  # friction of contacts is linear in their multipliers
        elif forces := self.evaluator.model.iterated_forces:
            notes.append(
                "method joint takes two to three times as long as standard here: at each pass of "
                f"the iteration for {some(forces, MOST_NAMES)} it solves the whole tree; auto "
                "takes standard"
            )
        return notes

    def _kept_words(self) -> str:
        """Joints whose rows are kept, with the reasons."""
        model, kept = self.evaluator.model, list(self.kept)
        named = [f"{model.joint_names[k]} ({self.kept[k]})" for k in kept[:MOST_NAMES]]
        more = f" and {len(kept) - MOST_NAMES} more" if len(kept) > MOST_NAMES else ""
        count = int(np.sum(model.joint_rows[kept]))
        return f"{count} row{'s' if count != 1 else ''} kept, of {', '.join(named)}{more}"

    def start(self, u: Floats) -> Floats:
        """The state y of a run from a state u (13 n,), whose poses become the reference.

        Runs from the same state, one after another, find what the first of them computed.
        """
        if self._last is None or not np.array_equal(self._last[0], u):
            self._last = u.copy(), *self._constants_and_state(u)
        _, self._tree.constants[:], first = self._last
        return self._made_ready(first.copy())

    def _made_ready(self, y: Floats) -> Floats:
        """The state y of the constants as they are, with states of elements; kept rows judged."""
        y[self.nodes.layout["states"]] = self.evaluator.states
        if self.kept:
            from dap3d_core.formulations.joint_loops.tables import judge_kept_rows

            judge_kept_rows(self.evaluator, y)
        return y

    def _constants_and_state(self, u: Floats) -> tuple[Floats, Floats]:
        """``TreeArrays.constants`` with the reference u (13 n,), and its state."""
        reference = Reference(self.nodes, self.evaluator.model, u)
        return reference.constants(), reference.state()

    def starts(self, u: Floats, others: Floats) -> Floats:
        """States (k, size + 1) of runs whose poses at the start are those of u (13 n,).

        others: (k, 13 n) states whose velocities are taken.
        """
        reference = Reference(self.nodes, self.evaluator.model, u)
        ground = np.zeros((len(others), 1, 3))
        _, _, v, w = split(others)
        reference.v, reference.w = (np.concatenate([ground, x], axis=1) for x in (v, w))
        return reference.state()

    def inertia_places(self, bodies: Integers) -> Integers:
        """(7 b,) indices in the tree's constants of the mass and inertia of each."""
        first = node.CONSTANT_WIDTH * self._node_of[bodies] + node.MASS
        return (first[:, None] + np.arange(7)).ravel()

    def inertias(self, bodies: Integers, mass: Floats, Jp: Floats) -> Floats:
        """(k, 7 b) numbers for ``inertia_places`` of masses (k, b) and inertias (k, b, 3, 3)."""
        constants = self._tree.constants.reshape(-1, node.CONSTANT_WIDTH)
        centre = constants[self._node_of[bodies], node.CENTRE : node.CENTRE + 3]
        return inertias_about(centre, mass, Jp).reshape(len(mass), -1)

    def body_states(self, y: Floats) -> Floats:
        """As of ``Coordinates``."""
        out = np.empty((len(y), self.evaluator.model.integrated_layout.size))
        for state, row in zip(y, out, strict=True):
            body_state(state, row, self.evaluator.system)
        return out

    def placer(self, y: Floats) -> Callable[[], object]:
        """As of ``Coordinates``."""
        out = np.empty(self.evaluator.model.integrated_layout.size)
        return prepared(body_state, y, out, self.evaluator.system)

    def continued(self, expected: Floats, y: Floats) -> Floats:
        """The state y with angles that have not been brought back, near those expected."""
        angles, continued = self.nodes.layout["angles"], y.copy()
        turns = np.rint((expected[angles] - y[angles]) / turn_columns.TWO_TURNS)
        continued[angles] += turn_columns.TWO_TURNS * turns
        return continued

    def with_jump(self, y: Floats, dv: Floats, states: Floats, work: float) -> Floats:
        """As of ``Coordinates``."""
        u = u_from_y(self.body_states(y[None]), len(states))[0]
        velocities_of(u)[:] += dv
        moved = Reference(self.nodes, self.evaluator.model, u).state()
        after = y.copy()
        for name in RATES:
            place = self.nodes.layout[name]
            after[place] = moved[place]
        after[self.nodes.layout["states"]] = states
        after[-1] += work
        return after

    def displace(self, y: Floats, moved: Floats) -> None:
        """As of ``Coordinates``: a change of rates, for a unit of time."""
        from dap3d_core.formulations.joint_loops.kept_rows import add_displacement

        change = self.with_jump(y, moved, self.evaluator.states, 0.0) - y
        add_displacement(y, change, self.evaluator.system)

    def u_dot(self, t: float, u: Floats) -> Floats:
        """As of ``Coordinates``."""
        _, p, v, w = split(u)
        a, alpha = np.hsplit(self.report(t, u)[: w.size * 2].reshape(-1, 6), 2)
        return join(v, euler_rates(p, w), a, alpha)

    def report(self, t: float, u: Floats) -> Floats:
        """As of ``Coordinates``; its coordinates are not those of the run, whose turns count."""
        out = super().report(t, u)
        out[self.evaluator.model.report_layout["angles"]] = self.evaluator.counted_angles(t, u)
        return out

    @contextmanager
    def at(self, u: Floats) -> Iterator[Floats]:
        """As of ``Coordinates``; the reference of a run is restored afterwards."""
        tree = self._tree
        arrays = [tree.constants, *([tree.kept.smallest, tree.kept.settings] if self.kept else [])]
        before = [array.copy() for array in arrays]
        try:
            self._tree.constants[:], y = self._constants_and_state(u)
            yield self._made_ready(y)
        finally:
            for array, values in zip(arrays, before, strict=True):
                array[:] = values

    @property
    def _node_of(self) -> Integers:
        """(n + 1,) the node that each body is."""
        body = self.nodes.body
        has_mass = np.flatnonzero(body >= 0)
        return has_mass[np.argsort(body[has_mass])]

    @property
    def _tree(self) -> TreeArrays:
        return self.evaluator.system.tree


def cost_over_standard(model: Model, plan: Plan) -> float:
    """Estimate of the time of a right-hand side, over that of method standard or lsq."""
    from dap3d_core.formulations.joint_loops import tables

    motions, tree, reasons = _tree_and_reasons(model)
    nodes = tree_nodes(tree, motions, model.body_count, model.state_count)
    kept = tables.kept_rows(tuple(reasons), model, nodes)
    return tables.cost_ratio(kept, nodes, plan, model.body_count)


def _tree_and_reasons(model: Model) -> tuple[ModelMotions, SpanningForest, dict[int, str]]:
    """Motions of joints, the joints of a tree, and why others keep their rows."""
    motions = model.motions or classify(model)
    count = len(model.joint_names)
    of_contacts = range(count - model.contact_count, count)
    ends: dict[int, tuple[int, int]] = {}
    reasons = dict(motions.refused) | dict.fromkeys(of_contacts, "it is a contact")
    for group in motions.motions:
        joints = group.joints.tolist()
        if reason := unsuitable_motion(group):
            reasons |= dict.fromkeys(joints, reason)
        else:
            bodies = zip(group.body_i.tolist(), group.body_j.tolist(), strict=True)
            ends |= zip(joints, bodies, strict=True)
    light = 1 + np.flatnonzero(model.mass < LIGHT * model.mass.max(initial=0.0))
    tree = spanning_forest(model.body_count, ends, model.joint_rows.tolist(), set(light.tolist()))
    reasons |= {cut.joint: cut.words(model.joint_names) for cut in tree.cuts}
    return motions, tree, dict(sorted(reasons.items()))


def _with_tree(
    evaluator: "Evaluator", nodes: TreeNodes, tree: SpanningForest, kept: KeptRowArrays | None
) -> System:
    """The system with arrays of a tree; ``body`` is then the first rows of its places."""
    system, model, plan = evaluator.system, evaluator.model, evaluator.plan
    bodies, count = len(system.body), len(nodes.table)
    places = np.zeros((nodes.row_count, BODY_WIDTH))
    places[:bodies] = system.body
    revolutes = int(np.count_nonzero(nodes.table[1:, node.MOTION] == node.REVOLUTE))
    arrays = TreeArrays(
        nodes=nodes.table,
        joints=_joints(tree, model, plan),
        places=places,
        constants=np.zeros(count * node.CONSTANT_WIDTH),
        work=np.zeros(count * node.WORK_WIDTH),
        half_angles=np.zeros((2, revolutes)),
        scratch=np.zeros(48),
        force=np.zeros_like(system.force),
        slope=np.zeros(nodes.layout.size),
        kept=kept,
    )
    turns = turns_of_coordinates(system.turns, model, nodes)
    return attrs.evolve(system, body=places[:bodies], tree=arrays, turns=turns)


def turns_of_coordinates(turns: Integers, model: Model, nodes: TreeNodes) -> Integers:
    """``System.turns`` with the places of those angles that are coordinates of a tree."""
    table, angles = turns.copy(), model.joint_angles
    assert angles is not None
    keys = angles.coordinates @ (MOST_PARTS, 1)
    for group in nodes.groups:
        joints = group.moves.joints if group.moves else np.zeros(0, dtype=np.int64)
        for part in np.flatnonzero(np.equal(group.motions, node.REVOLUTE)).tolist():
            first = np.searchsorted(keys, MOST_PARTS * joints)
            is_reversed = angles.bodies[first, 0] != group.children
            k = np.where(is_reversed, len(group.motions) - 1 - part, part)
            rows = np.searchsorted(keys, MOST_PARTS * joints + k)
            chain = nodes.table[group.nodes[:, part]]
            table[rows, turn_columns.COORDINATE] = chain[:, node.COORDINATE]
            table[rows, turn_columns.COORDINATE_RATE] = chain[:, node.RATE]
    return table


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
            row, slots, blocks = [0] * node.JOINT_WIDTH, model.joint_slots[k], plan.joint_block[k]
            row[node.CHILD_BLOCK], row[node.CHILD] = blocks[slots.index(child)], 6 * child
            if parent:
                row[node.PARENT_BLOCK] = blocks[slots.index(parent)]
                row[node.JOINT_PARENT] = 6 * parent
            row[node.ROW_COUNT], row[node.FIRST_ROW] = model.joint_rows[k], plan.joint_row[k]
            rows.append(row)
    return np.array(rows, dtype=np.int64).reshape(-1, node.JOINT_WIDTH)
