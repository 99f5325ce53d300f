"""Bodies without shapes: links from the origin to points, or axes and the ellipsoid of inertia."""

from collections.abc import Iterable

import numpy as np

from dap3d_core.interface.formats.frames import quaternion
from dap3d_core.model.groups import Floats
from dap3d_core.result.model_summary import ModelSummary
from dap3d_core.view.scene3d.elements import ORIGIN, ElementGeometry
from dap3d_core.view.scene3d.primitives import Mark, Point, ball, plain, rod

#: Points this near, relative to the largest coordinate, are one.
_SAME = 1e-6


def attachment_points(
    summary: ModelSummary, elements: Iterable[ElementGeometry]
) -> list[list[Point]]:
    """The points (m, body axes) of each body, ground first: its own, and those of elements.

    The origin is left out, and so are duplicates.
    """
    attached: list[list[Point]] = [[] for _ in range(summary.body_count + 1)]
    for body, at in zip(summary.point_body, summary.point_local, strict=True):
        attached[int(body)].append(plain(at))
    for one in elements:
        for body, at in one.points.values():
            attached[body].append(at)
    return [_distinct(points) for points in attached]


def _distinct(points: list[Point]) -> list[Point]:
    size = max((abs(x) for point in points for x in point), default=0.0)
    kept: dict[tuple[int, ...], Point] = {}
    for point in points:
        if size > 0.0 and max(map(abs, point)) > _SAME * size:
            kept.setdefault(tuple(round(x / (_SAME * size)) for x in point), point)
    return list(kept.values())


def unit_of(points: list[list[Point]], size: float) -> float:
    """Radius of a link, m, by the usual length of links and the size of the scene, m."""
    lengths = [float(np.linalg.norm(at)) for on_body in points[1:] for at in on_body]
    usual = 0.05 * float(np.median(lengths)) if lengths else 0.01 * size
    return float(np.clip(usual, 0.0012 * size, 0.008 * size))


def links(body: int, points: list[Point], unit: float, color: str, name: str,
          *, ends: Iterable[Point] = ()) -> list[Mark]:  # fmt: skip
    """Links of a radius ``unit`` from the origin of a body to points, and a ball at its origin.

    ``ends`` are the points that have a ball, as no joint is drawn there.
    """
    marks = [rod("bodies", body, ORIGIN, at, unit, color=color, owner=name) for at in points]
    marks.append(ball("bodies", body, ORIGIN, 1.5 * unit, color=color, owner=name))
    marks += [ball("bodies", body, at, 1.25 * unit, color=color, owner=name) for at in ends]
    return marks


def inertia_ellipsoid(body: int, mass: float, Jp: Floats, most: float, color: str,
                      name: str) -> Mark:  # fmt: skip
    """The homogeneous ellipsoid of a mass (kg) and an inertia (3, 3) in body axes (kg m^2).

    Its semi-axes are a_k^2 = 5 (J_1 + J_2 + J_3 - 2 J_k) / (2 m) along the principal axes, all
    scaled down where one is longer than ``most``, m.
    """
    J, axes = np.linalg.eigh(Jp)
    semi = np.sqrt(np.maximum(2.5 * (J.sum() - 2.0 * J) / mass, 0.0))
    semi = np.maximum(semi, 0.05 * semi.max())
    semi *= min(1.0, most / semi.max())
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return Mark("inertia", "sphere", body, ORIGIN, plain(semi), quaternion(axes), color, name)


def bare_body(body: int, mass: float, Jp: Floats, most: float, color: str, name: str) -> list[Mark]:
    """A body without points: its ellipsoid of inertia, and its axes, which show that it turns.

    Arguments as ``inertia_ellipsoid``.
    """
    ellipsoid = inertia_ellipsoid(body, mass, Jp, most, color, name)
    reach = max(ellipsoid.size)
    arms = [plain(axis) for axis in 1.5 * reach * np.eye(3)]
    return [ellipsoid, *links(body, arms, 0.06 * reach, color, name)]
