"""Constants of a tree's nodes and its state, from the poses and velocities of the bodies.

The poses given are the reference: whatever they are, the joints allow every motion from there that
their kinds have. Angles are 1 and lengths the size of the scene there, not zero, so that their
tolerances and the first step of an integration are those of numbers of that size.
"""

import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.formulations.joint.node_layout import (
    AXIS,
    CENTRE,
    CONSTANT_WIDTH,
    COORDINATE,
    FIXED,
    FREE,
    LINK,
    MASS,
    MOTION,
    PARENT,
    PRISMATIC,
    RATE,
    REVOLUTE,
    SPHERICAL,
    TURN,
    TURN_SIN,
)
from dap3d_core.formulations.joint.tree_nodes import MotionGroup, TreeNodes
from dap3d_core.model import Model
from dap3d_core.model.rigid_motion import Pose, adjoint, quaternion_product, relative
from dap3d_core.model.rotations import to_body, to_global
from dap3d_core.model.state_layout import split

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
            if moves.parts[part].constant_in != group.child_slot:
                twist = np.einsum("kab,kdb->kda", change, twist)
            turn, shift = twist[..., 3:], twist[..., :3]
            if motion == PRISMATIC:
                self.axis[group.nodes[:, part]] = to_global(p, shift[:, 0])
                continue
            arm = np.sum(np.cross(turn, shift), axis=1) * (0.5 if motion == SPHERICAL else 1.0)
            if motion == REVOLUTE:
                self.axis[group.nodes[:, part]] = to_global(p, turn[:, 0])
            self.point[group.nodes[:, part]] = r + to_global(p, arm)
        for part in range(len(group.motions) - 2, -1, -1):
            if group.motions[part] == PRISMATIC:  # its point may be any
                self.point[group.nodes[:, part]] = self.point[group.nodes[:, part + 1]]

    def constants(self) -> Floats:
        """``TreeArrays.constants``."""
        table, body, model = self.nodes.table, self.nodes.body, self.model
        parent, motion = table[:, PARENT], table[:, MOTION]
        p, p_parent = self.p[self.nodes.frame], self.p[self.nodes.frame[parent]]
        turning, sliding = motion == REVOLUTE, motion == PRISMATIC
        constants = np.zeros((len(table), CONSTANT_WIDTH))
        turn = quaternion_product(p_parent * np.array([1.0, -1.0, -1.0, -1.0]), p)
        own_axis = to_body(p, self.axis)
        back = np.where(turning, -0.5 * ANGLE, 0.0)[:, None]
        turn = quaternion_product(turn, np.hstack([np.cos(back), np.sin(back) * own_axis]))
        constants[:, TURN : TURN + 4] = turn
        no_scalar = np.hstack([np.zeros((len(table), 1)), own_axis])
        constants[:, TURN_SIN : TURN_SIN + 4] = quaternion_product(turn, no_scalar)
        axis = constants[:, AXIS : AXIS + 3] = to_body(p_parent, self.axis)
        link = to_body(p_parent, self.point - self.point[parent])
        link -= np.where(sliding, model.part_size, 0.0)[:, None] * axis
        constants[:, LINK : LINK + 3] = link
        own = np.flatnonzero(body > 0)
        of = body[own]
        s = to_body(p[own], self.r[of] - self.point[own])
        constants[own, CENTRE : CENTRE + 3] = s
        constants[own, MASS : MASS + 7] = inertias_about(s, model.mass[of - 1], model.Jp[of - 1])
        return constants.ravel()

    def state(self) -> Floats:
        """The state at the poses given, with the velocities that the joints allow; no work.

        With velocities (..., n + 1, 3) in ``v`` and ``w``, states (..., size).
        """
        table, y = self.nodes.table, np.zeros((*self.v.shape[:-2], self.nodes.layout.size))
        motion = table[:, MOTION]
        y[..., table[motion == REVOLUTE, COORDINATE]] = ANGLE
        y[..., table[motion == PRISMATIC, COORDINATE]] = self.model.part_size
        for group in self.nodes.groups:
            last, children = group.nodes[:, -1], group.children
            coordinate, rate = table[last, COORDINATE], table[last, RATE]
            r, p = self.r[children], self.p[children]
            v, w = self.v[..., children, :], self.w[..., children, :]
            if group.motions[-1] == FREE:
                y[..., coordinate[:, None] + np.arange(7)] = np.hstack([r, p])
                moving = np.concatenate([v, to_body(p, w)], axis=-1)
                y[..., rate[:, None] + np.arange(6)] = moving
            elif group.motions[-1] == SPHERICAL:
                y[..., coordinate[:, None] + np.arange(4)] = p
                y[..., rate[:, None] + np.arange(3)] = to_body(p, w)
            elif group.motions[-1] != FIXED:
                y[..., table[group.nodes, RATE]] = self._rates(group)
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
            if motion == REVOLUTE:
                columns[:, 3:, part] = axis
                columns[:, :3, part] = np.cross(axis, self.r[children] - self.point[nodes])
            else:
                columns[:, :3, part] = axis
        if not np.all(np.isfinite(columns)):  # a run that failed: its cause is looked for
            return np.full((*v.shape[:-1], len(group.motions)), np.nan)
        twists = np.concatenate([v, w], axis=-1)
        return np.einsum("kab,...kb->...ka", np.linalg.pinv(columns), twists)


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
