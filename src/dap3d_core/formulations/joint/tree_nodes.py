"""Nodes of a tree, elementary motions in chains for each of its joints, and their constants.

Constants and the state follow from the poses and velocities of the bodies. The poses given are the
reference: whatever they are, the joints allow every motion from there that their kinds have. Angles
are 1 and lengths the size of the scene there, not zero, so that their tolerances and the first step
of an integration are those of numbers of that size.
"""

from collections.abc import Iterator

import attrs
import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.assembly.motion.joint_motion import (
    BALL,
    ROTATION,
    TRANSLATION,
    JointMotions,
    ModelMotions,
)
from dap3d_core.formulations.joint import node_layout as node
from dap3d_core.linear.ordering.spanning_forest import SpanningForest
from dap3d_core.model import Model
from dap3d_core.model.rigid_motion import Pose, adjoint, conjugate, quaternion_product, relative
from dap3d_core.model.rotations import to_body, to_global
from dap3d_core.model.state_layout import Layout, split, tree_layout

#: Motions of nodes by the kinds of elementary motions.
MOTIONS = {ROTATION: node.REVOLUTE, TRANSLATION: node.PRISMATIC, BALL: node.SPHERICAL}
#: Segments of the state by motion, with their rates, and entries of each.
SEGMENTS = {
    node.REVOLUTE: ("angles", "angle_rates", 1, 1),
    node.PRISMATIC: ("lengths", "length_rates", 1, 1),
    node.SPHERICAL: ("rotations", "rotation_rates", 4, 3),
    node.FREE: ("poses", "pose_rates", 7, 6),
}


def unsuitable_motion(motions: JointMotions) -> str:
    """The reason why joints with these motions are not in a tree; "" where they can be."""
    kinds = [part.kind for part in motions.parts]
    for kind in kinds:
        if kind not in MOTIONS:
            return f"its motion is a {kind}"
    if BALL in kinds and kinds != [BALL]:
        return "its motion is a rotation about a point and more"
    return ""


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
    motion = np.full(count, node.FIXED, dtype=np.int64)
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
    return TreeNodes(table, tuple(groups), layout, int(table[:, node.ROW].max()) + 1, body, frame)


def _chains(
    tree: SpanningForest, motions: ModelMotions
) -> Iterator[tuple[Integers, JointMotions | None, tuple[int, ...], str]]:
    """(entries, motions from parent to child, motions of the nodes, child's slot) of joints."""
    free = np.flatnonzero(tree.joint < 0)
    if free.size:
        yield free, None, (node.FREE,), ""
    entry_of = dict(zip(tree.joint.tolist(), range(len(tree.joint)), strict=True))
    for group in motions.motions:
        entries = np.array([entry_of.get(k, -1) for k in group.joints.tolist()])
        of_i = (entries >= 0) & (tree.child[entries] == group.body_i)
        for mask, is_reversed in ((of_i, False), ((entries >= 0) & ~of_i, True)):
            here = np.flatnonzero(mask)
            if here.size:
                moves = group.take(here).reversed() if is_reversed else group.take(here)
                kinds = tuple(MOTIONS[part.kind] for part in moves.parts) or (node.FIXED,)
                yield entries[here], moves, kinds, moves.slots[0]


def _table(motion: Integers, parent: Integers, body: Integers, body_count: int) -> Integers:
    """The table of nodes but for their places in the state."""
    count = len(motion)
    table = np.zeros((count, node.TREE_WIDTH), dtype=np.int64)
    massless = body < 0
    table[:, node.ROW] = np.where(massless, body_count + np.cumsum(massless), body)
    table[:, node.PARENT], table[:, node.MOTION] = parent, motion
    table[:, node.PARENT_ROW] = table[parent, node.ROW]
    last_child = np.zeros(count, dtype=np.int64)
    np.maximum.at(last_child, parent[1:], np.arange(1, count))
    table[:, node.FLAGS] = node.HAS_MASS * (body > 0) + node.HAS_CHILDREN * (last_child > 0)
    table[last_child[last_child > 0], node.FLAGS] += node.IS_FIRST
    is_alone = (parent == 0) & (last_child == 0) & (body > 0)
    table[is_alone, node.FLAGS] += node.IS_ALONE
    return table


def _place_coordinates(table: Integers, state_count: int) -> Layout:
    """Give every node its places in the state; the layout of that."""
    counts = [int(np.count_nonzero(table[1:, node.MOTION] == motion)) for motion in SEGMENTS]
    layout = tree_layout(*counts, states=state_count)
    for motion, (segment, rates, size, rate_size) in SEGMENTS.items():
        nodes = 1 + np.flatnonzero(table[1:, node.MOTION] == motion)
        order = np.arange(len(nodes))
        table[nodes, node.COORDINATE] = layout[segment].start + size * order
        table[nodes, node.RATE] = layout[rates].start + rate_size * order
    return layout


#: Angles of the reference, rad.
ANGLE = 1.0


class Reference:
    """The poses and velocities of all bodies, ground first, that a tree is built at.

    Attributes:
        r, p, v, w: (n + 1, 3 or 4) of bodies, ground 0.
        axis, point: (nodes, 3) of each node's joint, global axes, from the origin.
    """

    def __init__(self, nodes: TreeNodes, model: Model, u: Floats) -> None:
        """Args: the nodes, their model, the state u (13 n,)."""
        self.nodes, self.model = nodes, model
        r, p, v, w = split(u)
        p = p / np.linalg.norm(p, axis=-1, keepdims=True)
        zero = np.zeros((1, 3))
        self.r, self.v, self.w = (np.concatenate([zero, x]) for x in (r, v, w))
        self.p = np.concatenate([[[1.0, 0.0, 0.0, 0.0]], p])
        self.axis = np.zeros((len(nodes.table), 3))
        self.point = np.zeros((len(nodes.table), 3))
        for group in nodes.groups:
            self._set_lines(group)

    def _set_lines(self, group: MotionGroup) -> None:
        """Axes and reference points of the nodes of a group."""
        r, p = self.r[group.children], self.p[group.children]
        self.point[group.nodes] = r[:, None]
        moves = group.moves
        if moves is None or not moves.parts:
            return
        here = relative(Pose(self.r[group.parents], self.p[group.parents]), Pose(r, p))
        change = adjoint(relative(here, moves.start))
        for part, (columns, motion) in enumerate(zip(moves.columns, group.motions, strict=True)):
            twist = moves.screws[:, columns]
            if not _is_in_child(group, moves, part):
                twist = np.einsum("kab,kdb->kda", change, twist)
            turn, shift = twist[..., 3:], twist[..., :3]
            if motion == node.PRISMATIC:
                self.axis[group.nodes[:, part]] = to_global(p, shift[:, 0])
                continue
            arm = np.sum(np.cross(turn, shift), axis=1) * (0.5 if motion == node.SPHERICAL else 1.0)
            if motion == node.REVOLUTE:
                self.axis[group.nodes[:, part]] = to_global(p, turn[:, 0])
            self.point[group.nodes[:, part]] = r + to_global(p, arm)
        for part in range(len(group.motions) - 2, -1, -1):
            if group.motions[part] == node.PRISMATIC:  # its point may be any
                self.point[group.nodes[:, part]] = self.point[group.nodes[:, part + 1]]

    def constants(self) -> Floats:
        """``TreeArrays.constants``."""
        table, body, model = self.nodes.table, self.nodes.body, self.model
        parent, motion = table[:, node.PARENT], table[:, node.MOTION]
        p, p_parent = self.p[self.nodes.frame], self.p[self.nodes.frame[parent]]
        turning, sliding = motion == node.REVOLUTE, motion == node.PRISMATIC
        constants = np.zeros((len(table), node.CONSTANT_WIDTH))
        turn = quaternion_product(conjugate(p_parent), p)
        own_axis = to_body(p, self.axis)
        back = np.where(turning, -0.5 * ANGLE, 0.0)[:, None]
        turn = quaternion_product(turn, np.hstack([np.cos(back), np.sin(back) * own_axis]))
        constants[:, node.TURN : node.TURN + 4] = turn
        no_scalar = np.hstack([np.zeros((len(table), 1)), own_axis])
        constants[:, node.TURN_SIN : node.TURN_SIN + 4] = quaternion_product(turn, no_scalar)
        axis = constants[:, node.AXIS : node.AXIS + 3] = to_body(p_parent, self.axis)
        link = to_body(p_parent, self.point - self.point[parent])
        link -= np.where(sliding, model.part_size, 0.0)[:, None] * axis
        constants[:, node.LINK : node.LINK + 3] = link
        own = np.flatnonzero(body > 0)
        of = body[own]
        s = to_body(p[own], self.r[of] - self.point[own])
        constants[own, node.CENTRE : node.CENTRE + 3] = s
        constants[own, node.MASS : node.MASS + 7] = inertias_about(
            s, model.mass[of - 1], model.Jp[of - 1]
        )
        return constants.ravel()

    def state(self) -> Floats:
        """The state at the poses given, with the velocities that the joints allow; no work.

        With velocities (..., n + 1, 3) in ``v`` and ``w``, states (..., size).
        """
        table, y = self.nodes.table, np.zeros((*self.v.shape[:-2], self.nodes.layout.size))
        motion = table[:, node.MOTION]
        y[..., table[motion == node.REVOLUTE, node.COORDINATE]] = ANGLE
        y[..., table[motion == node.PRISMATIC, node.COORDINATE]] = self.model.part_size
        for group in self.nodes.groups:
            last, children = group.nodes[:, -1], group.children
            coordinate, rate = table[last, node.COORDINATE], table[last, node.RATE]
            r, p = self.r[children], self.p[children]
            v, w = self.v[..., children, :], self.w[..., children, :]
            if group.motions[-1] == node.FREE:
                y[..., coordinate[:, None] + np.arange(7)] = np.hstack([r, p])
                moving = np.concatenate([v, to_body(p, w)], axis=-1)
                y[..., rate[:, None] + np.arange(6)] = moving
            elif group.motions[-1] == node.SPHERICAL:
                y[..., coordinate[:, None] + np.arange(4)] = p
                y[..., rate[:, None] + np.arange(3)] = to_body(p, w)
            elif group.motions[-1] != node.FIXED:
                y[..., table[group.nodes, node.RATE]] = self._rates(group)
        return y

    def _rates(self, group: MotionGroup) -> Floats:
        """(..., k, parts) rates of angles and lengths by which the children move as given."""
        parents, children = group.parents, group.children
        arm = self.r[children] - self.r[parents]
        w_parent = self.w[..., parents, :]
        w = self.w[..., children, :] - w_parent
        v = self.v[..., children, :] - self.v[..., parents, :] - np.cross(w_parent, arm)
        columns = np.zeros((len(children), 6, len(group.motions)))
        for part, motion in enumerate(group.motions):
            nodes: Integers = group.nodes[:, part]
            axis = self.axis[nodes]
            if motion == node.REVOLUTE:
                columns[:, 3:, part] = axis
                columns[:, :3, part] = np.cross(axis, self.r[children] - self.point[nodes])
            else:
                columns[:, :3, part] = axis
        if not np.all(np.isfinite(columns)):  # a run that failed: its cause is looked for
            return np.full((*v.shape[:-1], len(group.motions)), np.nan)
        twists = np.concatenate([v, w], axis=-1)
        return np.einsum("kab,...kb->...ka", np.linalg.pinv(columns), twists)


def _is_in_child(group: MotionGroup, moves: JointMotions, part: int) -> bool:
    """True if the axis of a part is fixed in the child, False if in the parent.

    A rotation that follows translations across it goes along with them, and they do not turn with
    it, whichever body its type names them in.
    """
    motions = group.motions
    turns_last = motions[-1] == node.REVOLUTE
    is_planar = motions.count(node.PRISMATIC) == len(motions) - 1 > 1
    if is_planar and (turns_last or motions[0] == node.REVOLUTE):
        return bool(turns_last == (motions[part] == node.REVOLUTE))
    return bool(moves.parts[part].constant_in == group.child_slot)


def inertias_about(s: Floats, mass: Floats, Jp: Floats) -> Floats:
    """(..., 7) mass and inertia (xx, xy, xz, yy, yz, zz) of bodies about points, body axes.

    Args:
        s: (..., 3) from the point to the mass centre.
        mass, Jp: (...,) and (..., 3, 3) of the bodies.
    """
    J = Jp + mass[..., None, None] * (
        np.sum(s * s, axis=-1)[..., None, None] * np.eye(3) - s[..., :, None] * s[..., None, :]
    )
    return np.concatenate([mass[..., None], J[..., [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]], -1)
