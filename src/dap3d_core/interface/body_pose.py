"""The pose of a body in the scene, an argument of the ``prepare`` of a type."""

from typing import Any

import attrs


@attrs.frozen
class BodyPose:
    """Pose of a body: position r, Euler parameters p, rotation matrix A (rows).

    Jp is its inertia matrix (rows) in its own axes, kg m^2; zeros for ground.
    """

    r: tuple[float, ...]
    p: tuple[float, ...]
    A: tuple[tuple[float, ...], ...]
    Jp: tuple[tuple[float, ...], ...] = ((0.0, 0.0, 0.0),) * 3

    def to_local(self, s: Any) -> tuple[float, ...]:
        """Components on the body of a global 3-vector."""
        return tuple(sum(self.A[r][c] * s[r] for r in range(3)) for c in range(3))

    def to_global(self, s: Any) -> tuple[float, ...]:
        """Global components of a 3-vector given on the body."""
        return tuple(sum(self.A[r][c] * s[c] for c in range(3)) for r in range(3))

    def place(self, s: Any) -> tuple[float, ...]:
        """Global position of a point given by its coordinates on the body."""
        return tuple(a + b for a, b in zip(self.r, self.to_global(s), strict=True))


def pose(r: Any, p: Any, Jp: Any = ((0.0, 0.0, 0.0),) * 3) -> BodyPose:
    """The pose of a body from its position, (unit) Euler parameters and inertia matrix."""
    e0, e1, e2, e3 = (float(x) for x in p)
    matrix = (
        (1 - 2 * (e2 * e2 + e3 * e3), 2 * (e1 * e2 - e0 * e3), 2 * (e1 * e3 + e0 * e2)),
        (2 * (e1 * e2 + e0 * e3), 1 - 2 * (e1 * e1 + e3 * e3), 2 * (e2 * e3 - e0 * e1)),
        (2 * (e1 * e3 - e0 * e2), 2 * (e2 * e3 + e0 * e1), 1 - 2 * (e1 * e1 + e2 * e2)),
    )
    inertia = tuple(tuple(float(x) for x in row) for row in Jp)
    return BodyPose(tuple(float(x) for x in r), (e0, e1, e2, e3), matrix, inertia)
