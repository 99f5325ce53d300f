"""Records of points where two shapes may touch."""

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled

#: Columns of a record: the point halfway between both surfaces, the unit normal from shape j to
#: shape i, the gap. In ``which``: shapes i and j, and a number that tells points of a pair apart.
POINT, NORMAL, GAP, WIDTH = 0, 3, 6, 7


@compiled
def add(
    which: Integers, found: Floats, count: int, i: int, j: int, feature: int,
    x: float, y: float, z: float, nx: float, ny: float, nz: float, gap: float, most: float,
) -> int:  # fmt: skip
    """Append a record whose gap is below ``most``; the new count, beyond the room if there is none.

    x, y, z: the point on the surface of shape j.
    """
    if not gap < most:
        return count
    if count < found.shape[0]:
        which[count, 0], which[count, 1], which[count, 2] = i, j, feature
        row = found[count]
        half = 0.5 * gap
        row[0], row[1], row[2] = x + half * nx, y + half * ny, z + half * nz
        row[3], row[4], row[5] = nx, ny, nz
        row[6] = gap
    return count + 1
