"""Masses and inertias of solids of uniform density."""

from collections.abc import Iterable, Sequence
from math import pi

import numpy as np

from dap3d_core.interface.formats.articulation import Inertial
from dap3d_core.interface.formats.frames import Frame
from dap3d_core.kernels.array_types import Floats, Integers


def inertia_of_solid(kind: str, size: Sequence[float]) -> tuple[float, Floats]:
    """Volume, and inertia about the mass centre for a mass of 1, of a solid.

    Args:
        kind: box, sphere, cylinder, capsule, ellipsoid or cone.
        size: as of ``Geometry``; radius and length of a cone along z, whose mass centre lies a
            quarter of the length above its base.

    Raises:
        ValueError: there is no such kind.
    """
    if kind == "box":
        x, y, z = (edge * edge / 12.0 for edge in size)
        return float(np.prod(size)), np.diag([y + z, z + x, x + y])
    if kind in ("sphere", "ellipsoid"):
        a, b, c = size if kind == "ellipsoid" else (size[0],) * 3
        x, y, z = (semi * semi / 5.0 for semi in (a, b, c))
        return 4.0 / 3.0 * pi * a * b * c, np.diag([y + z, z + x, x + y])
    if kind == "cylinder":
        r, length = size
        across = r * r / 4.0 + length * length / 12.0
        return pi * r * r * length, np.diag([across, across, r * r / 2.0])
    if kind == "cone":
        r, length = size
        across = 3.0 / 80.0 * (4.0 * r * r + length * length)
        return pi * r * r * length / 3.0, np.diag([across, across, 0.3 * r * r])
    if kind == "capsule":
        return _capsule(*size)
    raise ValueError(f"no solid is of kind {kind}")


def _capsule(r: float, length: float) -> tuple[float, Floats]:
    """A cylinder with two half balls, whose mass centres lie 3/8 r beyond its ends."""
    whole = length + 4.0 / 3.0 * r  # of a cylinder of the same volume
    tube, ball = length / whole, 4.0 / 3.0 * r / whole
    along = (tube / 2.0 + ball * 0.4) * r * r
    across = tube * (r * r / 4.0 + length * length / 12.0)
    across += ball * (0.4 * r * r + length * length / 4.0 + 3.0 / 8.0 * length * r)
    return pi * r * r * whole, np.diag([across, across, along])


def inertia_of_mesh(
    vertices: Floats, triangles: Integers, *, all_positive: bool = False
) -> tuple[float, Floats, Floats]:
    """Volume, mass centre, and inertia about it for a mass of 1, of a closed mesh.

    The tetrahedra of all triangles and an apex are summed with their signs: M. Kallay, "Computing
    the moment of inertia of a solid defined by a triangle mesh" (2006).

    Args:
        vertices, triangles: of the mesh.
        all_positive: all tetrahedra count as positive, as MuJoCo does by default ("legacy"): so
            triangles may have any sense; the mass centre with the centroid of the surface as apex,
            then volume and inertia with the mass centre as apex.

    Raises:
        ValueError: the mesh encloses no volume.
    """
    apex = np.zeros(3)
    if all_positive:
        a, b, c = (vertices[triangles[:, k]] for k in range(3))
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        apex = areas @ (a + b + c) / (3.0 * areas.sum())
    volume, com, second = _tetrahedra(vertices - apex, triangles, all_positive)
    if not all_positive:
        second = second - np.outer(com, com)
    else:
        apex, com = apex + com, np.zeros(3)
        volume, _, second = _tetrahedra(vertices - apex, triangles, all_positive)
    return volume, apex + com, np.trace(second) * np.eye(3) - second


def _tetrahedra(
    vertices: Floats, triangles: Integers, all_positive: bool
) -> tuple[float, Floats, Floats]:
    """Volume, first and second moments over it, of the tetrahedra of triangles and the origin."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    determinants = np.einsum("ij,ij->i", a, np.cross(b, c))
    if all_positive:
        determinants = np.abs(determinants)
    volume = float(determinants.sum()) / 6.0
    if not abs(volume) > 0.0:
        raise ValueError("the mesh encloses no volume")
    total = a + b + c
    second = sum(np.einsum("i,ij,ik->jk", determinants, p, p) for p in (a, b, c, total))
    return volume, determinants @ total / (24.0 * volume), second / (120.0 * volume)


def inertia_moved(inertial: Inertial, frame: Frame) -> Inertial:
    """The same in the axes of another frame; ``frame`` is the pose of the link in it."""
    com = frame.r + frame.A @ inertial.com
    return Inertial(inertial.mass, com, frame.A @ inertial.inertia @ frame.A.T)


def balanced_inertia(inertia: Floats) -> Floats:
    """The mean of principal moments that no body has, for all three, as MuJoCo balances them."""
    least, middle, most = np.linalg.eigvalsh(inertia).tolist()
    if least + middle >= most:
        return inertia
    return (least + middle + most) / 3.0 * np.eye(3)


def nearest_inertia(inertia: Floats) -> Floats:
    """The nearest matrix (3, 3) that is the inertia of a body, by Frobenius' norm of S below.

    S = tr(J) / 2 1 - J holds the second moments of the mass, none of which is negative: those that
    are count as zero. So a largest principal moment stays, and of the others each gains half of
    what their sum lacks.
    """
    moments, axes = np.linalg.eigh(0.5 * (inertia + inertia.T))
    second = np.maximum(moments.sum() / 2.0 - moments, 0.0)
    nearest: Floats = axes @ np.diag(second.sum() - second) @ axes.T
    return nearest


def total_inertia(parts: Iterable[Inertial]) -> Inertial:
    """Mass, mass centre and inertia of parts in the same axes, by Steiner's theorem."""
    listed = list(parts)
    if len(listed) == 1:
        return listed[0]
    mass = sum(part.mass for part in listed)
    if not mass > 0.0:
        return Inertial(0.0)
    com = sum(part.mass * part.com for part in listed) / mass
    inertia = np.zeros((3, 3))
    for part in listed:
        d = part.com - com
        inertia += part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return Inertial(mass, com, inertia)
