"""Reads meshes, with trimesh: vertices and triangles, without materials and other files."""

import re
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

#: Larger files are not read, bytes: 300 000 triangles as text.
LARGEST_MESH = 100 * 2**20

Arrays = tuple[np.ndarray[Any, np.dtype[np.float64]], np.ndarray[Any, np.dtype[np.int64]]]


def read_mesh(path: Path, name: str) -> Arrays | str:
    """Vertices (k, 3) and triangles (m, 3) of a mesh file, or why there are none.

    Args:
        path: the file, one that may be read.
        name: of the file, for messages.
    """
    try:
        import trimesh
    except ImportError:
        return "reading meshes needs trimesh: pip install trimesh"
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_MESH + 1)
        if len(data) > LARGEST_MESH:
            return f"{name} has more than {LARGEST_MESH >> 20} MiB; save fewer triangles, or binary"
        kind = path.suffix[1:].lower()
        if kind == "msh":
            return _checked(*_counted(data), name)
        whole = _without_groups(data) if kind == "obj" else _one_solid(data)
        # from memory: materials, which are other files, are not read
        with np.errstate(all="ignore"):  # numbers are judged below
            mesh: Any = trimesh.load(
                BytesIO(whole), file_type=kind, force="mesh", skip_materials=True
            )
        vertices = np.asarray(mesh.vertices, dtype=np.float64)
        triangles = np.asarray(mesh.faces, dtype=np.int64)
    except Exception as error:  # a broken file makes a reader fail in any way
        return f"{name} cannot be read: {error or type(error).__name__}"
    return _checked(vertices, triangles, name)


def _checked(vertices: Any, triangles: Any, name: str) -> Arrays | str:
    """The arrays of a file, or what is wrong with them."""
    if not len(triangles):
        return f"{name} holds no triangles; is it a mesh?"
    if not np.all(np.isfinite(vertices)):
        return f"{name} holds no numbers"
    return vertices, triangles


def _counted(data: bytes) -> tuple[Any, Any]:
    """Vertices and triangles of MuJoCo's own format of meshes.

    Four numbers of vertices, normals, texture coordinates and triangles, and then these.
    """
    counts = [int(n) for n in np.frombuffer(data, "<i4", 4)]
    ends = np.cumsum([16, *(4 * n * size for n, size in zip(counts, (3, 3, 2, 3), strict=True))])
    if min(counts) < 0 or ends[-1] != len(data):
        raise ValueError("its length is not that of its numbers")
    vertices = np.frombuffer(data[16 : ends[1]], "<f4").astype(np.float64).reshape(-1, 3)
    triangles = np.frombuffer(data[ends[3] :], "<i4").astype(np.int64).reshape(-1, 3)
    if triangles.size and not 0 <= triangles.min() <= triangles.max() < len(vertices):
        raise ValueError("a triangle names no vertex")
    return vertices, triangles


def _without_groups(data: bytes) -> bytes:
    """An OBJ file reduced to vertices and faces.

    The reader makes a mesh of each group, object and material, and the time to join them grows
    with the square of their number.
    """
    text = data.replace(b"\r\n", b"\n").replace(b"\\\n", b"")
    lines = re.findall(rb"^[ \t]*[vf][ \t][^\n#]*", text, re.MULTILINE)
    return b"\n".join(lines).replace(b"usemtl", b"") + b"\n"


def _one_solid(data: bytes) -> bytes:
    """An STL file with all facets in one solid, for the same reason; a binary file has one."""
    if len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return data
    first, *others = data.lower().split(b"endsolid")
    facets = [part[part.find(b"facet") :] for part in others if b"facet" in part]
    return b"".join([first, *facets, b"\nendsolid" if others else b""])
