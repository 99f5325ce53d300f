"""The shape of this package is a closed solid of the right volume."""

from collections import Counter

import numpy as np
import pytest

from dap3d_example.toothed_wheel import ToothedWheel


def test_a_toothed_wheel_is_closed():
    """Each edge is in two triangles, once each way; the volume is that of the polygon times width.

    Of a tooth from angle to angle: half the product of the radii and the sine between, four times.
    """
    ToothedWheel.check()
    n, r, width = 20, 0.02, 0.01
    vertices, triangles = ToothedWheel(radius=r, width=width, teeth=float(n)).mesh()
    edges = Counter((t[k], t[(k + 1) % 3]) for t in triangles for k in range(3))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)
    a, b, c = np.array(vertices)[np.array(triangles)].transpose(1, 0, 2)
    pitch, outer, inner = 2.0 * np.pi / n, r * (1.0 + 2.0 / n), r * (1.0 - 2.5 / n)
    sector = (2.0 * outer * inner * np.sin(0.15 * pitch) + outer**2 * np.sin(0.3 * pitch)
              + inner**2 * np.sin(0.4 * pitch))  # fmt: skip
    volume = np.sum(a * np.cross(b, c)) / 6.0
    assert volume == pytest.approx(0.5 * n * sector * width, rel=1e-12)
