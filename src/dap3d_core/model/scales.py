"""Sizes of a scene, of one or of many that differ in their numbers."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.model.rotations import to_global
from dap3d_core.model.state_layout import split

if TYPE_CHECKING:
    from dap3d_core.model.model import Model

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


def time_of(model: "Model", forces: Callable[[float], Floats]) -> float:
    """The time, s, that tolerances speak of: a power of ten, 1 of ordinary scenes.

    In that time the start would change by as much as the size of the parts: by its velocities, and
    by what forces do to bodies without joints, which may hold all at first; where nothing moves so,
    by forces that act later. Motions of a scene of ordinary size that are quicker than ordinary
    need no other limits.

    Args:
        model: its state is that at the start.
        forces: gives (n, 6) force and moment on each body, there, at a time, s.
    """
    of_turning = np.linalg.norm(model.Jp, ord=2, axis=(-2, -1))[:, None]
    _, _, v, w = split(model.u0)

    def fastest(t: float) -> float:
        wrench = forces(t)
        moving = np.array([v, wrench[:, :3] / model.mass[:, None]]) / model.part_size
        turning = np.array([w, wrench[:, 3:] / of_turning])
        rates = np.linalg.norm([moving, turning], axis=-1).max(axis=(0, -1), initial=0.0)
        return float(max(rates[0], np.sqrt(rates[1])))

    rate = fastest(0.0)
    if not rate > 1.0 / LONGEST:
        later = LATER if model.functions else ()
        rate = next((1.0 / t for t in later if fastest(t) * t >= 1.0), 1.0)
    least = ORDINARY[0] if model.length != 1.0 else 0.0
    if not 1.0 / LONGEST < rate < LONGEST or least <= 1.0 / rate <= ORDINARY[1]:
        return 1.0
    return float(10.0 ** -np.round(np.log10(rate)))
