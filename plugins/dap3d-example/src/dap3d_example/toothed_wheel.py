"""Toothed wheel, a kind of shape."""

from math import cos, pi, sin

from dap3d_core.interface import hookimpl, number
from dap3d_core.interface.shapes import ShapeKind

interface_version = 1


class ToothedWheel(ShapeKind):
    """A spur gear about its z axis, centred: a prism of teeth of four corners each."""

    keyword = "toothed-wheel"
    radius: float = number(unit="m", positive=True, doc="of the pitch circle")
    width: float = number(unit="m", positive=True, doc="along the axis")
    teeth: float = number(minimum=3.0, maximum=1000.0, whole=True, doc="their number")

    def mesh(self):
        n = int(self.teeth)
        outer, inner = self.radius * (1.0 + 2.0 / n), self.radius * (1.0 - 2.5 / n)
        corners = ((-0.3, inner), (-0.15, outer), (0.15, outer), (0.3, inner))
        rim = [
            (r * cos(2.0 * pi * (k + part) / n), r * sin(2.0 * pi * (k + part) / n))
            for k in range(n)
            for part, r in corners
        ]
        m, half = len(rim), 0.5 * self.width
        vertices = [(x, y, z) for z in (-half, half) for x, y in rim]
        vertices += [(0.0, 0.0, -half), (0.0, 0.0, half)]
        triangles = []
        for k in range(m):
            a, b = k, (k + 1) % m
            triangles += [
                (a, b, b + m),
                (a, b + m, a + m),
                (b, a, 2 * m),
                (a + m, b + m, 2 * m + 1),
            ]
        return vertices, triangles


@hookimpl
def dap3d_shapes():
    """The kinds of shapes of this module."""
    return [ToothedWheel]
