"""Inertias that joints see where a model starts, of its mass matrix."""

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property

import attrs
import numpy as np

from dap3d_core.interface.formats.articulation import KINDS, WORLD, Coupling, Joint, Link
from dap3d_core.interface.formats.frames import Frame
from dap3d_core.interface.formats.joint_motion import joint_motion, rest_coordinates
from dap3d_core.kernels.array_types import Floats

#: Least number that the compiler of MuJoCo divides by.
LEAST = 1e-15
#: Most coordinates of a model whose mass matrix is made.
MOST = 1000
#: Rows of loops and couplings that depend on each other, and coordinates that do not move, up to
#: this.
DEPENDENT = 1e-9


@attrs.define(eq=False)
class JointInertia:
    """Inertias of the coordinates of the joints of a model where it starts.

    Attributes:
        links: by name, with the inertials that count.
        placing: link -> the joint whose child it is; a link without one stands still.
        order: links, each after its parent.
        couplings, loops: what holds the joints besides.
    """

    links: Mapping[str, Link]
    placing: Mapping[str, Joint]
    order: Sequence[str]
    couplings: Sequence[Coupling] = ()
    loops: Iterable[Joint] = ()
    poses: dict[str, Frame] = attrs.Factory(lambda: {WORLD: Frame()})

    def of(self, joint: str, k: int | None = None) -> float | None:
        """The inertia of coordinate k of a joint while all others are free, by default their mean.

        It is None where links have no mass, where it does not move, or the model is too large.
        """
        inverse, place = self._inverse, self._columns.get(joint)
        if inverse is None or place is None:
            return None
        own = inverse[place] if k is None else inverse[place][k : k + 1]
        if not len(own) or not own.mean() > 0.0:
            return None
        return float(1.0 / max(LEAST, own.mean()))

    def of_alone(self, joint: str, k: int) -> float | None:
        """The inertia of coordinate k of a joint while all others are held."""
        place = self._columns.get(joint)
        if self._masses is None or place is None:
            return None
        return float(self._masses[0][place.start + k, place.start + k]) or None

    def of_sum(self, factors: Mapping[str, float]) -> float | None:
        """The inertia of a sum of coordinates, each of a joint that has one, as ``of``."""
        along = self._along(factors)
        if self._modes is None or along is None:
            return None
        free, inverse, _ = self._modes
        left = free.T @ along
        yields = float(left @ inverse @ left)
        return 1.0 / yields if yields > DEPENDENT * float(along @ along) else None

    def acceleration_of(self, factors: Mapping[str, float]) -> float | None:
        """The length of the accelerations of all coordinates by a force of 1 along a sum."""
        along = self._along(factors)
        if self._modes is None or along is None:
            return None
        free, inverse, scale = self._modes
        return float(np.linalg.norm(free @ inverse @ free.T @ along / scale))

    def _along(self, factors: Mapping[str, float]) -> Floats | None:
        """A sum of coordinates, each of a joint that has one, in those that are scaled."""
        if self._modes is None or not factors.keys() <= self._columns.keys():
            return None
        scale = self._modes[2]
        along = np.zeros(len(scale))
        for name, factor in factors.items():
            along[self._columns[name]] += factor
        return along / scale

    @cached_property
    def _columns(self) -> dict[str, slice]:
        """The coordinates of each joint."""
        columns, size = {}, 0
        for joint in self.placing.values():
            columns[joint.name] = slice(size, size + KINDS[joint.kind])
            size += KINDS[joint.kind]
        return columns

    @cached_property
    def _masses(self) -> tuple[Floats, dict[str, Floats]] | None:
        """The mass matrix, and the rates of each link; None for a model that is too large."""
        size = max((place.stop for place in self._columns.values()), default=0)
        return self._matrix(size) if 0 < size <= MOST else None

    @cached_property
    def _modes(self) -> tuple[Floats, Floats, Floats] | None:
        """Motions that are left, the inverse of their mass matrix, and scales of coordinates."""
        if self._masses is None or not (np.diag(self._masses[0]) > 0.0).all():
            return None
        M, rates = self._masses
        scale = np.sqrt(np.diag(M))  # links may be light: their coordinates are scaled
        held = [*self._coupled(len(M)), *self._closed(rates)]
        free = np.eye(len(M))
        if held:
            _, sizes, rows = np.linalg.svd(np.array(held) / scale)
            free = rows[int((sizes > DEPENDENT * sizes.max(initial=0.0)).sum()) :].T
        left = free.T @ (M / np.outer(scale, scale)) @ free
        if not free.size or not np.linalg.cond(left) < 1.0 / np.finfo(float).eps:
            return None
        return free, np.linalg.inv(left), scale

    @cached_property
    def _inverse(self) -> Floats | None:
        """The diagonal of the inverse of the mass matrix, of all motions that are left."""
        if self._modes is None:
            return None
        free, inverted, scale = self._modes
        inverse = np.einsum("ij,jk,ik->i", free, inverted, free)
        moves = np.sqrt((free * free).sum(axis=1)) > DEPENDENT
        return np.asarray(np.where(moves, inverse, 0.0) / scale**2)

    def _matrix(self, size: int) -> tuple[Floats, dict[str, Floats]]:
        """The mass matrix, and the rates of each link: of its point at the origin, and angular."""
        M = np.zeros((size, size))
        rates = {WORLD: np.zeros((6, size))}
        for name in self.order:
            link, joint = self.links[name], self.placing.get(name)
            if joint is None:
                self.poses.setdefault(name, Frame())
                rates[name] = rates[WORLD]
                continue
            at, J = self.poses[joint.parent] @ joint.in_parent, rates[joint.parent].copy()
            columns = self._columns[joint.name]
            J[:, columns], moved = motions(joint, at)
            for k in range(columns.start, columns.stop):  # one number is that of all coordinates
                M[k, k] += joint.armature[min(k - columns.start, len(joint.armature) - 1)]
            self.poses[name], rates[name] = moved @ joint.in_child.inverse(), J
            if link.inertial is not None:
                pose, body = self.poses[name], link.inertial
                com, inertia = pose.r + pose.A @ body.com, pose.A @ body.inertia @ pose.A.T
                v = J[:3] + np.cross(J[3:], com, axis=0)
                M += body.mass * v.T @ v + J[3:].T @ inertia @ J[3:]
        return M, rates

    def _coupled(self, size: int) -> list[Floats]:
        """The rows of couplings."""
        rows = []
        for coupling in self.couplings:
            ends = [self._columns.get(name) for name in (coupling.joint, coupling.other)]
            if None not in ends:
                row = np.zeros(size)
                for place, factor in zip(ends, (1.0, -coupling.ratio), strict=True):
                    row[place] = factor
                rows.append(row)
        return rows

    def _closed(self, rates: Mapping[str, Floats]) -> list[Floats]:
        """The rows of loops: rates of a joint's child against its parent but those it allows."""
        rows: list[Floats] = []
        for joint in self.loops:
            allowed, _ = motions(joint, self.poses[joint.parent] @ joint.in_parent)
            p = (self.poses[joint.child] @ joint.in_child).r
            apart = _at(rates[joint.child] - rates[joint.parent], p)
            own = _at(allowed, p)
            rows += list(apart - own @ np.linalg.pinv(own) @ apart if own.size else apart)
        return rows


def motions(joint: Joint, at: Frame) -> tuple[Floats, Frame]:
    """Rates of a joint's child for each coordinate, and the pose of its frame there.

    at: the joint's frame on the parent.

    Returns:
        (6, coordinates): velocity of the point at the origin, and angular velocity.
    """
    q, size = joint.position or rest_coordinates(joint), KINDS[joint.kind]
    columns, moved = np.zeros((6, size)), at
    for k, rate in enumerate(np.eye(size)):
        motion, v, w = joint_motion(joint, q, tuple(rate))
        moved = at @ motion
        turn = at.A @ w
        columns[:, k] = *(at.A @ v + np.cross(moved.r, turn)), *turn
    return columns, moved


def _at(rates: Floats, point: Floats) -> Floats:
    """Rates whose velocity is that of another point than the origin."""
    return np.vstack([rates[:3] + np.cross(rates[3:], point, axis=0), rates[3:]])
