"""Sizes of a scene, of one or of many that differ in their numbers."""

from typing import NamedTuple

import numpy as np

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.model.rotations import to_global

#: Sizes, m, and times, s, of ordinary scenes: their tolerances are in metres and seconds.
ORDINARY = 0.03, 30.0
#: An extent beyond is none: a radius of gyration of masses that are no masses.
WIDEST = 1e20
#: Times beyond are no scale of a motion, s.
LONGEST = 1e12
#: Instants, s, at which forces may show that do not act at first.
LATER = tuple(10.0**k for k in range(-9, 10))
#: Points nearer than this part of their distance from the origin are one but for rounding.
EXTENT = 1e-12


class Scales(NamedTuple):
    """Lengths, m, each (...): see the properties of ``Model`` of these names.

    Attributes:
        exponent: of ten in the length that tolerances speak of.
        gyration: the largest radius of gyration of a body.
        arm: the largest distance of a point of a body from its centre of mass.
    """

    size: Floats
    extent: Floats
    part_size: Floats
    exponent: Floats
    gyration: Floats
    arm: Floats


def moments_of(Jp: Floats) -> Floats:
    """Principal moments of inertia (..., 3), in order, of matrices (..., 3, 3)."""
    return np.asarray(np.linalg.eigvalsh(Jp), dtype=np.float64)


def gyrations_of(mass: Floats, Jp: Floats) -> Floats:
    """Radii of gyration (..., n), m, of bodies with masses (..., n), inertias (..., n, 3, 3)."""
    found: Floats = np.sqrt(np.linalg.norm(Jp, ord=2, axis=(-2, -1)) / mass)
    return found


def scales_of(
    gyrations: Floats, r: Floats, p: Floats, point_body: Integers, point_local: Floats
) -> Scales:
    """Scales of scenes (...) with n bodies; arguments that are the same for all have no (...).

    Args:
        gyrations: (..., n) radii of gyration of the bodies.
        r: (..., n, 3) of the bodies.
        p: (n, 4) their Euler parameters.
        point_body: (points,) body of each point, ground 0.
        point_local: (..., points, 3) in axes of the bodies.
    """
    ground = np.zeros((*r.shape[:-2], 1, 3))
    places = np.concatenate([ground, r], axis=-2)[..., point_body, :]
    poses = np.vstack([[1.0, 0.0, 0.0, 0.0], p])[point_body]
    points = np.concatenate([r, places + to_global(poses, point_local)], axis=-2)
    reach = np.max(np.abs(np.concatenate([r, point_local], axis=-2)), axis=(-2, -1), initial=0.0)
    if not gyrations.shape[-1]:
        one, none = np.ones(reach.shape), np.zeros(reach.shape)
        return Scales(np.where(reach > 0.0, reach, one), one, one, none, none, none)
    gyration = np.max(gyrations, axis=-1)
    extent = np.linalg.norm(np.max(points, axis=-2) - np.min(points, axis=-2), axis=-1)
    extent = np.where(extent > EXTENT * np.max(np.abs(points), axis=(-2, -1)), extent, gyration)
    arms = np.linalg.norm(point_local[..., point_body > 0, :], axis=-1)
    arm = np.max(arms, axis=-1, initial=0.0)
    part_size = np.minimum(extent, np.maximum(arm, gyration))
    is_ordinary = (ORDINARY[0] <= part_size) & (part_size <= ORDINARY[1])
    is_ordinary |= ~((part_size > 1 / WIDEST) & (part_size < WIDEST))
    exponent = np.asarray(np.round(np.log10(np.where(is_ordinary, 1.0, part_size))), dtype=float)
    size = np.where(reach > 0.0, reach, extent)
    return Scales(size, extent, part_size, exponent, gyration, arm)
