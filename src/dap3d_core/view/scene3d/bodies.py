"""How a body looks without shapes: links from its origin to its points, or its inertia."""

from collections.abc import Iterable

import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.result.model_summary import Subject
from dap3d_core.view.scene3d.elements import ORIGIN, Placed
from dap3d_core.view.scene3d.primitives import Located, Mark, ball, plain, rod
from dap3d_core.view.scene3d.sampled_motion import Motion

#: Coordinates this near, relative to the largest, are one place.
_SAME = 1e-6


def attached(subject: Subject, elements: Iterable[Placed]) -> list[list[tuple[float, ...]]]:
    """The places (m, body axes) where something is attached to each body, ground first.

    Those are its declared points, its animation points, and where joints and forces take hold.
    The origin is not among them, and nothing twice.
    """
    found: list[list[tuple[float, ...]]] = [[] for _ in range(subject.body_count + 1)]
    for body, at in zip(subject.point_body, subject.point_local, strict=True):
        found[int(body)].append(plain(at))
    for one in elements:
        for body, at in one.points.values():
            found[body].append(at)
    return [_distinct(places) for places in found]


def _distinct(places: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    size = max((abs(x) for place in places for x in place), default=0.0)
    kept: dict[tuple[int, ...], tuple[float, ...]] = {}
    for place in places:
        if size > 0.0 and max(map(abs, place)) > _SAME * size:
            kept.setdefault(tuple(round(x / (_SAME * size)) for x in place), place)
    return list(kept.values())


def unit_of(places: list[list[tuple[float, ...]]], size: float) -> float:
    """Radius of a link, m: a part of the usual length of links, bounded by the whole scene's size.

    Args:
        places: as ``attached`` gives them.
        size: of the scene, m.
    """
    lengths = [float(np.linalg.norm(at)) for on_body in places[1:] for at in on_body]
    usual = 0.05 * float(np.median(lengths)) if lengths else 0.01 * size
    return float(np.clip(usual, 0.0012 * size, 0.008 * size))


def links(body: int, places: list[tuple[float, ...]], unit: float, color: str, name: str,
          *, ends: Iterable[tuple[float, ...]] = ()) -> list[Mark]:  # fmt: skip
    """Links from the origin of a body to its places, and a ball at its origin.

    Args:
        body, places: which, and where.
        unit: radius of a link, m.
        color, name: of the body.
        ends: places that get a ball, as no joint is drawn there.
    """
    marks = [rod("bodies", body, ORIGIN, at, unit, color=color, owner=name) for at in places]
    marks.append(ball("bodies", body, ORIGIN, 1.5 * unit, color=color, owner=name))
    marks += [ball("bodies", body, at, 1.25 * unit, color=color, owner=name) for at in ends]
    return marks


def inertia_ellipsoid(body: int, mass: float, Jp: Floats, most: float, color: str,
                      name: str) -> Mark:  # fmt: skip
    """A body that nothing is attached to, as the ellipsoid of its mass and inertia.

    Its semi-axes are a_k^2 = 5 (J_1 + J_2 + J_3 - 2 J_k) / (2 m) along the principal axes.

    Args:
        body, color, name: which body, how it is drawn.
        mass: kg.
        Jp: (3, 3) inertia matrix in body axes, kg m^2.
        most: longest semi-axis that is drawn, m; longer ones are all scaled down.
    """
    J, axes = np.linalg.eigh(Jp)
    semi = np.sqrt(np.maximum(2.5 * (J.sum() - 2.0 * J) / mass, 0.0))
    semi = np.maximum(semi, 0.05 * semi.max())
    semi *= min(1.0, most / semi.max())
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return Mark("inertia", "sphere", body, ORIGIN, plain(semi), _quaternion(axes), color, name)


def _quaternion(A: Floats) -> tuple[float, ...]:
    """Euler parameters of a rotation matrix (3, 3): of the four forms the best conditioned."""
    trace = np.array([A.trace(), *A.diagonal()])
    k = int(np.argmax(trace))
    square = np.empty((4, 4))
    square[0] = [1 + A.trace(), A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]]
    square[1:, 1:] = A + A.T
    square[1:, 0] = square[0, 1:]
    for n in range(3):
        square[n + 1, n + 1] = 1 + 2 * A[n, n] - A.trace()
    row = square[k]
    return plain(row / np.linalg.norm(row))


def framing(motion: Motion, places: list[list[tuple[float, ...]]]) -> list[Located]:
    """The points that the page must show: origins and places of all bodies."""
    moving = [(k, at) for k, on in enumerate(places) for at in on]
    return [*((k, ORIGIN) for k in range(1, len(motion.result.subject.body_names) + 1)), *moving]
