"""Meshes of models, whose mass properties may count."""

from pathlib import Path

from dap3d_core.interface.formats.remarks import FormatError, Place
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.scene.files.read_mesh import read_mesh as read_arrays

#: Meshes of more triangles are refused.
MOST_TRIANGLES = 3_000_000


def read_mesh(path: Path, place: Place) -> tuple[Floats, Integers]:
    """Vertices (k, 3) and triangles (m, 3) of a mesh file.

    Raises:
        FormatError: it cannot be read, is too large, or trimesh is not installed.
    """
    mesh = read_arrays(path, path.name)
    if isinstance(mesh, str):
        raise FormatError(mesh, place)
    if len(mesh[1]) > MOST_TRIANGLES:
        raise FormatError(f"{path.name} has more than {MOST_TRIANGLES} triangles", place)
    return mesh
