"""The contacts of a model near one pose, of its shapes and of those that are declared."""

from typing import TYPE_CHECKING

import attrs
import numpy as np

from dap3d_core.assembly.collisions.find import ShapeFinder
from dap3d_core.formulations.contacts.contact_rows import ContactTable
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.model.state_layout import split

if TYPE_CHECKING:
    from dap3d_core.scene.contacts.collision_shapes import CollisionShapes

#: Of keys of declared contacts, which are beyond those of shapes.
DECLARED = 2**52


@attrs.frozen(eq=False)
class ContactSet:
    """Contacts, m of them.

    Attributes:
        bodies: (m, 2) i and j, ground 0.
        key: (m,) a number that a contact keeps.
        J: (m, 3, 12) rows of the velocity of body i less that of body j: normal, then tangents.
        gap: (m,) m.
        mu, e: (m,).
        shapes: (k, 2) of the first k, which are of shapes.
        point: (k, 3) of these, m, global axes.
    """

    bodies: Integers
    key: Integers
    J: Floats
    gap: Floats
    mu: Floats
    e: Floats
    shapes: Integers
    point: Floats

    def some(self, chosen: Integers) -> "ContactSet":
        """A part of the contacts, without what is of shapes alone."""
        names = ("bodies", "key", "J", "gap", "mu", "e")
        return attrs.evolve(self, **{name: getattr(self, name)[chosen] for name in names})


class ContactFinder:
    """Finds the contacts of a model."""

    def __init__(self, evaluator: Evaluator) -> None:
        """Args: the evaluator of the model."""
        model = evaluator.model
        self._evaluator = evaluator
        self.shapes: CollisionShapes | None = model.collisions
        self._finder = None if self.shapes is None else ShapeFinder(self.shapes)
        self.table = ContactTable(evaluator) if model.contact_count else None
        slots = model.joint_slots[len(model.joint_slots) - model.contact_count :]
        self._slots = np.array([(s[0], s[1] if len(s) > 1 else 0) for s in slots], dtype=np.int64)
        #: (n + 1,) m, how far shapes reach from the mass centres of their bodies.
        self.reach = np.zeros(model.body_count + 1)
        if self.shapes is not None:
            far = np.linalg.norm(self.shapes.at, axis=1) + self.shapes.reach
            np.maximum.at(self.reach, self.shapes.body, far)
        self.reach[0] = 0.0

    def find(self, t: float, u: Floats, margin: Floats) -> ContactSet:
        """Contacts at a state u (13 n,), those of shapes within margins (n + 1,) of bodies, m."""
        found = self._of_shapes(u, margin)
        if self.table is None:
            return found
        declared = self._declared(t, u)
        names = ("bodies", "key", "J", "gap", "mu", "e")
        both = {n: np.concatenate([getattr(found, n), getattr(declared, n)]) for n in names}
        return attrs.evolve(found, **both)

    def _of_shapes(self, u: Floats, margin: Floats) -> ContactSet:
        if self._finder is None or self.shapes is None:
            none = np.zeros((0, 2), dtype=np.int64)
            zero = np.zeros(0)
            return ContactSet(none, none[:, 0], np.zeros((0, 3, 12)), zero, zero, zero,
                              none, np.zeros((0, 3)))  # fmt: skip
        r, p, _, _ = split(u)
        touches, shapes = self._finder.find(r, p, margin), self.shapes
        bodies = shapes.body[touches.shapes]
        first, second = shapes.material[touches.shapes].T
        centres = np.concatenate([np.zeros((1, 3)), r])[bodies]
        E = frames(touches.normal)
        arms = touches.point[:, None, :] - centres
        turned = np.cross(arms[:, :, None, :], E[:, None])
        J = np.concatenate([E, turned[:, 0], -E, -turned[:, 1]], axis=2)
        return ContactSet(
            bodies, touches.key, J, touches.gap, shapes.mu[first, second], shapes.e[first, second],
            touches.shapes, touches.point,
        )  # fmt: skip

    def _declared(self, t: float, u: Floats) -> ContactSet:
        """The declared contacts, as if all stuck."""
        evaluator, table = self._evaluator, self.table
        assert table is not None
        states = evaluator.states
        stuck = states.copy()
        stuck[table.mode], stuck[table.near.ravel()] = 2.0, 0.0
        evaluator.states = stuck
        rows = evaluator.rows(t, u)
        evaluator.states = states
        table.find_grips(t, u)
        own, count = evaluator.model.joint_row_count, table.count
        G = rows.dense()[own:].reshape(count, 3, -1, 6)
        G = np.concatenate([np.zeros((count, 3, 1, 6)), G], axis=2)
        each, (i, j) = np.arange(count), self._slots.T
        J = np.concatenate([G[each, :, i], G[each, :, j]], axis=2)
        J[:, 2] *= table.ratio[:, None]  # an ellipse, stretched to a circle
        none = np.zeros((0, 2), dtype=np.int64)
        gaps: Floats = rows.C[own:].reshape(-1, 3)[:, 0]
        return ContactSet(self._slots, DECLARED + each, J, gaps, table.mu, table.e,
                          none, np.zeros((0, 3)))  # fmt: skip


def frames(normal: Floats) -> Floats:
    """(m, 3, 3) normals and two tangents of each."""
    axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first = np.cross(normal, axis)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([normal, first, np.cross(normal, first)], axis=1)
