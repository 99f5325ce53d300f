"""Tendon of constant length."""

from typing import ClassVar

import attrs

from dap3d_core.interface import Joint, hookimpl, number, numbers, vectors
from dap3d_core.interface import points as places
from dap3d_core.kernels import (
    add,
    by_body,
    cable_bending,
    cable_length,
    cable_pulls,
    cable_spans,
    cross,
    row,
)

interface_version = 1


class Route:
    """Fields of what is led over points and drums."""

    samples: ClassVar = (
        {"points": (0, 1), "drums": (2,), "after": (1.0,), "sides": (0,), "ways": (1.0,)},
        {"points": (0, 1, 1, 2), "drums": (2, 0), "axes": (2,), "sides": (2, 1),
         "after": (1.0, 3.0), "ways": (1.0, 0.0), "divisors": (2.0, 0.0, 1.0, 1.0)},
    )  # fmt: skip
    points: tuple = places("n", least=2, doc="ends, and points that it is led over, in order")
    drums: tuple = places("m", least=0, doc="centres of the drums")
    after: tuple = numbers("m", 0.0, constant=True, doc="the point before each drum, from 1")
    radii: tuple = numbers("m", 1.0, positive=True, unit="m", doc="radii of the drums")
    axes: tuple = vectors("a", least=0, doc="axes of the drums that are cylinders, the first ones")
    sides: tuple = places("s", least=0, doc="points on whose side the tendon passes, of each drum")
    ways: tuple = numbers("m", 0.0, constant=True, doc="past each drum: 0, 1 or 2")
    divisors: tuple = numbers("n", 1.0, constant=True, doc="by which spans count less; 0 for none")

    def length_at_start(self, bodies):
        """The length in the poses of the scene.

        Raises:
            ValueError: drums contradict each other, or a span has no length, and no direction.
        """
        check_drums(self, bodies)
        r, drums, sides = (
            [pose.place(P) for P, pose in zip(getattr(self, name), bodies[name], strict=True)]
            for name in ("points", "drums", "sides")
        )
        for k, (P, Q, divisor) in enumerate(zip(r, r[1:], self.divisors, strict=False), 1):
            if divisor and tuple(P) == tuple(Q):
                raise ValueError(f"points {k} and {k + 1} are in one place; leave one out")
        axes = [pose.to_global(a) for a, pose in zip(self.axes, bodies["axes"], strict=True)]
        lists = self.after, self.ways, self.divisors
        return cable_length(cable_spans(r, drums, self.radii, axes, sides, *lists))


attrs.define(Route, slots=False, kw_only=True)


class Tendon(Route, Joint):
    """The length L of a tendon over points, drums and pulleys is constant.

    L is that of the force ``tendon``, with the same fields:

        C     = length - L
        J     of a tension of 1 on each body,  nu = 0
        gamma = the second derivative of L, but for the accelerations of bodies

    ``length`` left out is that of the start. The multiplier is the tension. A last branch with the
    divisor -1, to a light body on a joint ``tran``, is as long as the others: its ``lower`` and
    ``upper`` are limits of their length.
    """

    keyword, rows = "tendon", 1
    synonyms = ("wrap", "drum")
    length: float = number(None, unit="m", doc="as at the start where left out")

    def prepare(self, bodies):
        start = self.length_at_start(bodies)
        return {"length": start if self.length is None else self.length}

    def C(r_points, r_drums, axes, r_sides, radii, after, ways, divisors, length):
        path = cable_spans(r_points, r_drums, radii, axes, r_sides, after, ways, divisors)
        return length - cable_length(path)

    def J(r_points, s_points, on_points, r_drums, s_drums, on_drums, axes, r_sides,
          radii, after, ways, divisors, body_count):  # fmt: skip
        path = cable_spans(r_points, r_drums, radii, axes, r_sides, after, ways, divisors)
        parts = pulls_of(path, on_points, s_points, on_drums, s_drums)
        rows = [(row(F, cross(s, F)),) for _, s, F in parts]
        return by_body([on for on, _, _ in parts], rows, body_count)

    def gamma(r_points, v_points, s_points_dot, w_points, r_drums, v_drums, s_drums_dot, w_drums,
              axes, r_sides, radii, after, ways, divisors):  # fmt: skip
        path = cable_spans(r_points, r_drums, radii, axes, r_sides, after, ways, divisors)
        turning = [cross(*x) for x in zip(w_points, s_points_dot, strict=True)]
        about = [cross(*x) for x in zip(w_drums, s_drums_dot, strict=True)]
        return cable_bending(
            path, (r_points, v_points, turning), (r_drums, v_drums, about, w_drums), axes, ways
        )


def pulls_of(path, on_points, s_points, on_drums, s_drums):
    """(body, arm, force) of a tension of 1, wherever it acts."""
    at_points, at_drums = cable_pulls(path)
    parts = [(on_points[k], s_points[k], F) for k, F in at_points]
    return parts + [(on_drums[b], add(s_drums[b], arm), F) for b, arm, F in at_drums]


def check_drums(tendon, bodies):
    """Refuse lists of drums that contradict each other.

    Raises:
        ValueError: they do.
    """
    last, count = len(tendon.points) - 1, len(tendon.drums)
    if not all(x in range(1, last + 1) for x in tendon.after):
        raise ValueError(f"after should have a number from 1 to {last} for each drum")
    if len(set(tendon.after)) < count:
        raise ValueError("after has one point twice; give a point between two drums")
    if len(tendon.axes) > count or len(tendon.sides) not in (0, count):
        raise ValueError("there should be as many sides as drums, or none, and no more axes")
    if not all(x in (0.0, 2.0) or (x == 1.0 and tendon.sides) for x in tendon.ways):
        raise ValueError("ways should be 0, 1 with sides, or 2 for each drum")
    if any(x is not y for x, y in zip(bodies["axes"], bodies["drums"], strict=False)):
        raise ValueError("axes should lie on the bodies of their drums, the first ones")


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Tendon]
