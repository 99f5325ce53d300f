"""The shapes of a scene that collide, as arrays."""

from typing import TYPE_CHECKING

import attrs

if TYPE_CHECKING:
    from dap3d_core.kernels.array_types import Floats, Integers

#: Kinds of shapes that collide, by number; of a pair body i has the higher one.
PLANE, SPHERE, CAPSULE, CYLINDER, BOX, ELLIPSOID, HULL = range(7)
KINDS = {
    "plane": PLANE, "sphere": SPHERE, "capsule": CAPSULE, "cylinder": CYLINDER, "box": BOX,
    "ellipsoid": ELLIPSOID, "mesh": HULL, "height_field": HULL,
}  # fmt: skip


def _no_pairs() -> "Floats":
    from numpy import zeros

    return zeros((0, 0))


@attrs.frozen(eq=False)
class CollisionShapes:
    """Shapes that collide, m of them, in the order of the scene; prisms, of a height field.

    Attributes:
        names: of the shapes.
        kind, body: (m,) one of KINDS, index of the body (ground 0).
        at, p: (m, 3), (m, 4) its centre, m, and Euler parameters of its axes in the body; the axis
            of a rod and the normal of a plane are its z.
        size: (m, 3) m: radius; radius, half the length; half edges, also of a hull; semi-axes.
        corners: (m, 2) first row in ``vertices`` and number of the vertices of a hull.
        vertices: (k, 3) m, about the centres of their hulls.
        material: (m,) index.
        bits: (m, 2) groups that each is in, and that it meets.
        mu, e: (materials, materials) coefficients of pairs.
        apart: (k,) i (n + 1) + j, i < j, ascending, of bodies that do not meet.
        mu_roll, mu_spin: (materials, materials) moments against rolling and spinning over the force
            that presses, m; (0, 0) where all are zero.
    """

    names: tuple[str, ...]
    kind: "Integers"
    body: "Integers"
    at: "Floats"
    p: "Floats"
    size: "Floats"
    corners: "Integers"
    vertices: "Floats"
    material: "Integers"
    bits: "Integers"
    mu: "Floats"
    e: "Floats"
    apart: "Integers"
    mu_roll: "Floats" = attrs.field(factory=_no_pairs)
    mu_spin: "Floats" = attrs.field(factory=_no_pairs)

    @property
    def resists_turning(self) -> bool:
        """True if some pairs resist rolling or spinning."""
        return self.mu_roll.size + self.mu_spin.size > 0

    @property
    def reach(self) -> "Floats":
        """(m,) radius of a ball about the centre of each that holds it, m; planes have none."""
        from numpy import hypot, linalg, select

        radius, half, _ = self.size.T
        rods, box = radius + half, linalg.norm(self.size, axis=1)
        of = [self.kind == k for k in (SPHERE, CAPSULE, CYLINDER, BOX, ELLIPSOID, HULL)]
        far = self.size.max(axis=1)
        return select(of, [radius, rods, hypot(radius, half), box, far, box], 0.0)
