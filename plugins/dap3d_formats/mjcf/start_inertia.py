"""The mass matrix where a model starts, by which MuJoCo's compiler scales springs and dampers."""

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dap3d_core.interface.formats import WORLD, Articulation, Frame, Joint, from_quaternion

#: Least number that the compiler divides by.
LEAST = 1e-15
#: Most coordinates of a model whose mass matrix is made.
MOST = 1000

Floats = NDArray[np.float64]


class StartInertia:
    """Inertias of the coordinates of the joints of a model, at zero coordinates.

    Args:
        model: of all bodies, without loops.
    """

    def __init__(self, model: Articulation) -> None:
        self.links, self.joints = dict(model.links), dict(model.joints)
        self.columns: dict[str, slice] = {}

    def of(self, joint: str) -> float | None:
        """The inertia of a joint while all others are free, the mean over its coordinates.

        As MuJoCo 4.0 has it, for servos too; earlier ones hold the others there. It is None where
        links have no mass, or the model is too large.
        """
        inverse = self._inverse
        if inverse is None:
            return None
        return float(1.0 / max(LEAST, inverse[self.columns[joint]].mean()))

    @cached_property
    def _inverse(self) -> Floats | None:
        """The diagonal of the inverse of the mass matrix; None where it has none."""
        M = self._matrix()
        if M is None or not np.linalg.cond(M) < 1.0 / np.finfo(float).eps:
            return None
        return np.asarray(np.diag(np.linalg.inv(M)))

    def _matrix(self) -> Floats | None:
        placing = {joint.child: joint for joint in self.joints.values()}
        size = 0
        for joint in self.joints.values():
            count = len(list(_motions(joint, Frame())))
            self.columns[joint.name] = slice(size, size + count)
            size += count
        if size > MOST:
            return None
        M = np.zeros((size, size))
        poses = {WORLD: Frame()}
        rates = {WORLD: np.zeros((6, size))}  # of the point of a link at the origin; angular
        for link in self.links.values():  # parents first
            joint = placing[link.name]
            at = poses[joint.parent] @ joint.in_parent
            if joint.kind == "free":
                at = Frame(joint.position[:3], from_quaternion(joint.position[3:]))
            J = rates[joint.parent].copy()
            for k, motion in enumerate(_motions(joint, at), self.columns[joint.name].start):
                J[:, k] = motion
                M[k, k] += joint.armature[0]
            poses[link.name], rates[link.name] = at @ joint.in_child.inverse(), J
            if link.inertial is not None:
                pose, body = poses[link.name], link.inertial
                com, inertia = pose.r + pose.A @ body.com, pose.A @ body.inertia @ pose.A.T
                v = J[:3] + np.cross(J[3:], com, axis=0)
                M += body.mass * v.T @ v + J[3:].T @ inertia @ J[3:]
        return M


def _motions(joint: Joint, at: Frame) -> Iterator[Floats]:
    """Velocity of the point at the origin, and angular velocity, of each coordinate."""
    axes = [at.A @ np.asarray(axis, dtype=float) for axis in joint.axes]
    slides = axes if joint.kind in ("prismatic", "cylindrical") else []
    turns = axes if joint.kind in ("revolute", "universal", "cylindrical") else []
    if joint.kind in ("ball", "free"):
        turns = list(at.A.T)
    if joint.kind == "free":
        slides = list(np.eye(3))
    for axis in slides:
        yield np.array([*axis, 0.0, 0.0, 0.0])
    for axis in turns:
        yield np.array([*np.cross(at.r, axis), *axis])
