"""Nodes of a tree: the motion of each of its joints as a chain of elementary ones."""

from collections.abc import Iterator

import attrs
import numpy as np

from dap3d_core.assembly.arrays import Integers
from dap3d_core.assembly.motion.joint_motion import (
    BALL,
    ROTATION,
    TRANSLATION,
    JointMotions,
    ModelMotions,
)
from dap3d_core.formulations.joint.node_layout import (
    COORDINATE,
    FIXED,
    FLAGS,
    FREE,
    HAS_CHILDREN,
    HAS_MASS,
    IS_ALONE,
    IS_FIRST,
    MOTION,
    PARENT,
    PARENT_ROW,
    PRISMATIC,
    RATE,
    REVOLUTE,
    ROW,
    SPHERICAL,
    TREE_WIDTH,
)
from dap3d_core.linear.ordering.spanning_forest import SpanningForest
from dap3d_core.model.state_layout import Layout, tree_layout

#: Motions of nodes by the kinds of elementary motions.
MOTIONS = {ROTATION: REVOLUTE, TRANSLATION: PRISMATIC, BALL: SPHERICAL}
#: Segments of the state by motion, with their rates, and entries of each.
SEGMENTS = {
    REVOLUTE: ("angles", "angle_rates", 1, 1),
    PRISMATIC: ("lengths", "length_rates", 1, 1),
    SPHERICAL: ("rotations", "rotation_rates", 4, 3),
    FREE: ("poses", "pose_rates", 7, 6),
}


def unsuitable_motion(motions: JointMotions) -> str:
    """The reason why joints with these motions are not in a tree; "" where they can be."""
    kinds = [part.kind for part in motions.parts]
    for kind in kinds:
        if kind not in MOTIONS:
            return f"its motion is a {kind}"
    return (
        "its motion is a rotation about a point and more"
        if BALL in kinds and kinds != [BALL]
        else ""
    )


@attrs.frozen(eq=False)
class MotionGroup:
    """Joints of a tree with the same chain of elementary motions.

    Attributes:
        entries: (k,) their places in the tree.
        parents, children: (k,) bodies, ground 0.
        nodes: (k, parts) node of each part; the last one is the child.
        motions: of the parts.
        moves: those of the joints, bodies i being the children; None of free bodies.
        child_slot: letter of the child's slot, "" of free bodies.
    """

    entries: Integers
    parents: Integers
    children: Integers
    nodes: Integers
    motions: tuple[int, ...]
    moves: JointMotions | None = None
    child_slot: str = ""


@attrs.frozen(eq=False)
class TreeNodes:
    """All nodes of a tree, whatever the poses.

    Attributes:
        table: (nodes, TREE_WIDTH) ``TreeArrays.nodes``.
        groups: the joints and free bodies.
        layout: of the state.
        row_count: rows of ``TreeArrays.places``.
        body: (nodes,) body of each node, ground 0; -1 where it has no mass.
        frame: (nodes,) body whose axes a node has at the start.
    """

    table: Integers
    groups: tuple[MotionGroup, ...]
    layout: Layout
    row_count: int
    body: Integers
    frame: Integers


def tree_nodes(
    tree: SpanningForest, motions: ModelMotions, body_count: int, state_count: int
) -> TreeNodes:
    """Lay out the nodes of a tree; its state has as many states of elements besides."""
    chains = list(_chains(tree, motions))
    parts = np.ones(len(tree.joint), dtype=np.int64)
    for entries, _, kinds, *_ in chains:
        parts[entries] = len(kinds)
    last = np.cumsum(parts)  # node of each child; node 0 is ground
    first = last - parts + 1
    count = int(last[-1]) + 1
    motion = np.full(count, FIXED, dtype=np.int64)
    groups = []
    for entries, moves, kinds, slot in chains:
        nodes = first[entries][:, None] + np.arange(len(kinds))
        motion[nodes] = kinds
        ends = tree.parent[entries], tree.child[entries]
        groups.append(MotionGroup(entries, *ends, nodes, kinds, moves, slot))
    node_of_body = np.zeros(body_count + 1, dtype=np.int64)
    node_of_body[tree.child] = last
    body = np.full(count, -1, dtype=np.int64)
    body[0], body[last] = 0, tree.child
    frame = np.zeros(count, dtype=np.int64)
    frame[1:] = np.repeat(tree.child, parts)
    parent = np.arange(count) - 1
    parent[0], parent[first] = 0, node_of_body[tree.parent]
    table = _table(motion, parent, body, body_count)
    layout = _place_coordinates(table, state_count)
    return TreeNodes(table, tuple(groups), layout, int(table[:, ROW].max()) + 1, body, frame)


def _chains(
    tree: SpanningForest, motions: ModelMotions
) -> Iterator[tuple[Integers, JointMotions | None, tuple[int, ...], str]]:
    """(entries, motions from parent to child, motions of the nodes, child's slot) of joints."""
    free = np.flatnonzero(tree.joint < 0)
    if free.size:
        yield free, None, (FREE,), ""
    entry_of = dict(zip(tree.joint.tolist(), range(len(tree.joint)), strict=True))
    for group in motions.motions:
        entries = np.array([entry_of.get(k, -1) for k in group.joints.tolist()])
        of_i = (entries >= 0) & (tree.child[entries] == group.body_i)
        for mask, is_reversed in ((of_i, False), ((entries >= 0) & ~of_i, True)):
            here = np.flatnonzero(mask)
            if here.size:
                moves = group.take(here).reversed() if is_reversed else group.take(here)
                kinds = tuple(MOTIONS[part.kind] for part in moves.parts) or (FIXED,)
                yield entries[here], moves, kinds, moves.slots[0]


def _table(motion: Integers, parent: Integers, body: Integers, body_count: int) -> Integers:
    """The table of nodes but for their places in the state."""
    count = len(motion)
    table = np.zeros((count, TREE_WIDTH), dtype=np.int64)
    massless = body < 0
    table[:, ROW] = np.where(massless, body_count + np.cumsum(massless), body)
    table[:, PARENT], table[:, PARENT_ROW], table[:, MOTION] = parent, table[parent, ROW], motion
    last_child = np.zeros(count, dtype=np.int64)
    np.maximum.at(last_child, parent[1:], np.arange(1, count))
    table[:, FLAGS] = HAS_MASS * (body > 0) + HAS_CHILDREN * (last_child > 0)
    table[last_child[last_child > 0], FLAGS] += IS_FIRST
    is_alone = (parent == 0) & (last_child == 0) & (body > 0)
    table[is_alone, FLAGS] += IS_ALONE
    return table


def _place_coordinates(table: Integers, state_count: int) -> Layout:
    """Give every node its places in the state; the layout of that."""
    counts = [int(np.count_nonzero(table[1:, MOTION] == motion)) for motion in SEGMENTS]
    layout = tree_layout(*counts, states=state_count)
    for motion, (segment, rates, size, rate_size) in SEGMENTS.items():
        nodes = 1 + np.flatnonzero(table[1:, MOTION] == motion)
        order = np.arange(len(nodes))
        table[nodes, COORDINATE] = layout[segment].start + size * order
        table[nodes, RATE] = layout[rates].start + rate_size * order
    return layout
