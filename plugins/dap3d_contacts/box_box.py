"""Two boxes: corners at faces, and edges at edges."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import Contact, Point, hookimpl, point, vec3
from dap3d_core.kernels import add, cross, dot, rotate, scale, sqrt, sub, transpose, where

interface_version = 1
#: Parts: the corners of i, those of j, pairs of edges, 4 of each pair of their directions.
CORNERS, EDGES = 8, 36
#: Parts of the size of a box by which a corner may be beyond the end of a face, and an edge must be
#: short of that of another: where both end, corners are enough. Sine of the tilt up to which both
#: edges of a face are the farthest of a box.
BEYOND, SHORT, LEVEL = 1e-9, 1e-8, 1e-6
#: Sine of the angle below which edges are parallel.
PARALLEL = 1e-6
_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def size_of(x):
    """The magnitude of a number."""
    return where(x < 0.0, -x, x)


def sign_of(x):
    """-1 or 1."""
    return where(x < 0.0, -1.0, 1.0)


def larger(a, b):
    """The larger of two."""
    return where(a > b, a, b)


def smaller(a, b):
    """The smaller of two."""
    return where(a < b, a, b)


def extent(n, A, h):
    """Half the width of a box along n."""
    return sum(size_of(x) * w for x, w in zip(rotate(transpose(A), n), h, strict=True))


def picked(first, second, values):
    """One of three values, by two conditions."""
    return where(first, values[0], where(second, values[1], values[2]))


def at_face(corner, r, A, h, other, B, k):
    """A corner of a box (other, B, k) at the nearest face of a box (r, A, h).

    Gap, reach, normal off the face, distance of the other box from its plane. The face is that
    whose plane is the farthest from the other box, so that of corners on edges the normal is that
    of the plane which parts the boxes.
    """
    x, d = (rotate(transpose(A), sub(p, r)) for p in (corner, other))
    axes = transpose(A)
    apart = [size_of(d[m]) - h[m] - extent(axes[m], B, k) for m in range(3)]
    first, second = (apart[0] >= apart[1]) & (apart[0] >= apart[2]), apart[1] >= apart[2]
    over = [size_of(x[m]) - h[m] for m in range(3)]
    sides = larger(over[1], over[2]), larger(over[0], over[2]), larger(over[0], over[1])
    sign = [sign_of(d[m]) for m in range(3)]
    gap = picked(first, second, [sign[m] * x[m] - h[m] for m in range(3)])
    slack = BEYOND * larger(h[0], larger(h[1], h[2]))
    reach = slack - picked(first, second, sides)
    return (
        gap,
        reach,
        picked(first, second, [scale(sign[m], axes[m]) for m in range(3)]),
        picked(first, second, apart),
    )


def edge_of(n, centre, u, p, q, h, parity):
    """The middle of an edge along u that is farthest along n, and whether it is: not negative.

    Where n is that of a face, both edges of it are; the parity tells which.
    """
    along_p, along_q = dot(n, p), dot(n, q)
    main = size_of(along_p) > size_of(along_q)
    s, t = sign_of(along_p), sign_of(along_q)
    middle = add(centre, add(scale(h[1] * where(main, s, parity * t), p),
                             scale(h[2] * where(main, parity * s, t), q)))  # fmt: skip
    return middle, LEVEL + parity * where(main, s * along_q, t * along_p)


def at_edge(r_i, r_j, edge_i, edge_j, one, two):
    """An edge of i at one of j: gap, reach, normal from j to i, point on the edge of i.

    edge: directions (u, p, q); one, two: half lengths along them, and a parity.
    """
    u, v = edge_i[0], edge_j[0]
    n = cross(u, v)
    square = dot(n, n)
    crossed = square > PARALLEL * PARALLEL
    d = sub(r_i, r_j)
    n = where(crossed, n, (0.0, 0.0, 1.0))  # any, of edges that are parallel
    n = scale(sign_of(dot(n, d)) / sqrt(dot(n, n)), n)
    at_i, far_i = edge_of(scale(-1.0, n), r_i, *edge_i, one, one[3])
    at_j, far_j = edge_of(n, r_j, *edge_j, two, two[3])
    between, c = sub(at_i, at_j), dot(u, v)
    a, b = dot(between, u), dot(between, v)
    rest = where(crossed, 1.0 - c * c, 1.0)
    s, t = (c * b - a) / rest, (b - c * a) / rest
    inner = smaller(one[0] * (1.0 - SHORT) - size_of(s), two[0] * (1.0 - SHORT) - size_of(t))
    inner = smaller(inner, smaller(far_i, far_j))
    return dot(n, between), where(crossed, inner, -1.0), n, add(at_i, scale(s, u))


def touch(r_P_i, r_P_j, A_i, A_j, corner_i, corner_j, u_i, p_i, q_i, u_j, p_j, q_j,
          one, two, size_i, size_j, sort):  # fmt: skip
    """Gap, reach, normal and point of a part; sort: -1 a corner of i, 1 of j, 0 edges."""
    h, k = scale(0.5, size_i), scale(0.5, size_j)
    of_j = sort > 0.5
    c_i, c_j = add(r_P_i, corner_i), add(r_P_j, corner_j)
    g_i, reach_i, n_i, apart_i = at_face(c_i, r_P_j, A_j, k, r_P_i, A_i, h)
    g_j, reach_j, n_j, apart_j = at_face(c_j, r_P_i, A_i, h, r_P_j, A_j, k)
    g, reach, n, place = at_edge(r_P_i, r_P_j, (u_i, p_i, q_i), (u_j, p_j, q_j), one, two)
    # edges do not touch where a plane of a face parts the boxes further
    apart = dot(n, sub(r_P_i, r_P_j)) - extent(n, A_i, h) - extent(n, A_j, k)
    further = apart - larger(apart_i, apart_j) + LEVEL * (one[0] + two[0])
    edges = g, smaller(reach, further), n, place
    corners = (
        where(of_j, g_j, g_i), where(of_j, reach_j, reach_i),
        where(of_j, scale(-1.0, n_j), n_i), where(of_j, c_j, c_i),
    )  # fmt: skip
    is_corner = of_j | (sort < -0.5)
    return tuple(where(is_corner, x, y) for x, y in zip(corners, edges, strict=True))


class BoxBox(Contact):
    """The box about P_i at that about P_j, both with edges along the axes of their bodies.

    Corners of each at the faces of the other, and edges at edges: two faces touch where corners are
    within the other face, and where edges cross.

        gap = n . (r_i - r_j),   r_i and r_j the corner, edge or face, n off the face or across both
    """

    keyword, points = "box_box", 2 * CORNERS + EDGES
    surfaces: ClassVar[Mapping[str, str]] = {"i": "box", "j": "box"}
    example: ClassVar[Mapping[str, str]] = {
        "P_j": '"rod.O"', "size_i": "[0.1, 0.1, 0.1]", "size_j": "[0.2, 0.3, 0.4]",
    }  # fmt: skip
    P_i: Point = point(doc="centre of a box")
    size_i: tuple = vec3(unit="m", doc="lengths of its edges, along the axes of its body")
    P_j: Point = point(doc="centre of the other")
    size_j: tuple = vec3(unit="m", doc="lengths of its edges, along the axes of its body")

    def gap(r_P_i, r_P_j, A_i, A_j, corner_i, corner_j, u_i, p_i, q_i, u_j, p_j, q_j,
            one, two, size_i, size_j, sort):  # fmt: skip
        return touch(r_P_i, r_P_j, A_i, A_j, corner_i, corner_j, u_i, p_i, q_i, u_j, p_j, q_j,
                     one, two, size_i, size_j, sort)[0]  # fmt: skip

    def reach(r_P_i, r_P_j, A_i, A_j, corner_i, corner_j, u_i, p_i, q_i, u_j, p_j, q_j,
              one, two, size_i, size_j, sort):  # fmt: skip
        return touch(r_P_i, r_P_j, A_i, A_j, corner_i, corner_j, u_i, p_i, q_i, u_j, p_j, q_j,
                     one, two, size_i, size_j, sort)[1]  # fmt: skip

    def normal(r_P_i, r_P_j, A_i, A_j, corner_i, corner_j, u_i, p_i, q_i, u_j, p_j, q_j,
               one, two, size_i, size_j, sort):  # fmt: skip
        return touch(r_P_i, r_P_j, A_i, A_j, corner_i, corner_j, u_i, p_i, q_i, u_j, p_j, q_j,
                     one, two, size_i, size_j, sort)[2]  # fmt: skip

    def at(r_P_i, r_P_j, A_i, A_j, corner_i, corner_j, u_i, p_i, q_i, u_j, p_j, q_j,
           one, two, size_i, size_j, sort):  # fmt: skip
        return touch(r_P_i, r_P_j, A_i, A_j, corner_i, corner_j, u_i, p_i, q_i, u_j, p_j, q_j,
                     one, two, size_i, size_j, sort)[3]  # fmt: skip

    def prepare(self, bodies):
        """The corner, or the edges, of this part, in axes of the bodies."""
        return {**super().prepare(bodies), **part_of(int(self.part), self.size_i, self.size_j)}


def part_of(part, size_i, size_j):
    """The numbers of a part."""
    k, sort = part % CORNERS, -1.0 if part < CORNERS else 1.0
    pair, parity_i, parity_j = 0, 1.0, 1.0
    if part >= 2 * CORNERS:
        sort, rest = 0.0, part - 2 * CORNERS
        pair, parity_i, parity_j = rest // 4, 2.0 * (rest & 1) - 1.0, (rest & 2) - 1.0
    signs = (2 * (k & 1) - 1, (k & 2) - 1, (k & 4) // 2 - 1)
    found = {"sort": sort}
    for slot, number, size, axis, parity in (
        ("i", "one", size_i, pair // 3, parity_i), ("j", "two", size_j, pair % 3, parity_j)
    ):  # fmt: skip
        order = [(axis + m) % 3 for m in range(3)]
        found[f"corner_{slot}"] = tuple(0.5 * s * x for s, x in zip(signs, size, strict=True))
        found |= {f"{name}_{slot}": _AXES[m] for name, m in zip("upq", order, strict=True)}
        found[number] = (*(0.5 * size[m] for m in order), parity)
    return found


@hookimpl
def dap3d_contacts():
    """The contact types of this module."""
    return [BoxBox]
