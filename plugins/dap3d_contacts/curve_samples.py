"""Points along a curve x(s), y(s), z(s), and what a contact cannot take of one."""

from typing import Any

#: Points from which the nearest one is sought, of PLACES that are looked at.
SAMPLES, PLACES = 32, 401
#: Both ends of a closed curve, and its directions and bends there, agree to this part.
EQUAL = 1e-9
#: It stands still where it is slower, by this part, than on the average.
STILL = 1e-6
#: What touches fits a hollow by this part of its radius.
FITS = 0.98
#: Another part of the curve is nearer by this part, beyond rounding.
NEARER = 1e-6


class Curve:
    """Places along a curve.

    Args:
        functions: of x, y and maybe z, each (f, f', f'', f''') of s.
        s_min, s_max: where it begins and ends.

    Attributes:
        s: (n,) parameters.
        point, first, second: (n, 3) the curve and its derivatives there.
    """

    def __init__(self, functions: Any, s_min: float, s_max: float) -> None:
        import numpy as np

        if not s_max > s_min:
            raise ValueError(f"s_max = {s_max:g} is not beyond s_min = {s_min:g}")
        self.functions = functions
        self.s = np.linspace(s_min, s_max, PLACES)
        self.point, self.first, self.second = self.at(self.s)
        self.speed = np.linalg.norm(self.first, axis=1)
        slowest = int(np.argmin(self.speed))
        if not self.speed[slowest] > STILL * self.speed.mean():
            raise ValueError(
                f"the curve has no direction at s = {self.s[slowest]:g}, where all of its "
                "derivatives are 0: it turns back, or its functions stand still; give points apart"
            )

    def at(self, s: Any) -> Any:
        """The curve and its first two derivatives (3, n, 3) at s (n,)."""
        import numpy as np

        found = np.zeros((3, len(s), 3))
        for axis, f in enumerate(self.functions):
            found[:, :, axis] = np.array([f(float(x))[:3] for x in s]).T
        return found

    def check_closed(self) -> None:
        """Refuses a curve that does not go on at its end as it began, or crosses itself."""
        import numpy as np

        period = self.s[-1] - self.s[0]
        # at its ends themselves, then beyond them
        for s in (self.s[0], self.s[PLACES // 3]):
            one, other = self.at(np.array([s, s + period])).transpose(1, 0, 2)
            for name, here, there, every in zip(("place", "direction", "bend"), one, other,
                                                self.at(self.s), strict=True):  # fmt: skip
                if np.max(np.abs(here - there)) > EQUAL * np.max(np.abs(every)):
                    raise ValueError(
                        f"the curve is not closed: its {name} at s = {s + period:g} is "
                        f"{_words(there)}, and at {s:g}, a period before, {_words(here)}; give "
                        "functions of this period, such as a spline with periodic = true whose "
                        "first value comes again as its last, or leave out closed"
                    )
        if len(self.functions) < 3:
            s = self.s + 0.382 * (self.s[1] - self.s[0])  # not where it crosses itself by symmetry
            if (pair := crossing(self.at(s)[0, :, :2])) is not None:
                raise ValueError(
                    f"the closed curve crosses itself, near s = {s[pair[0]]:g} and "
                    f"{s[pair[1]]:g}, and has no outside"
                )

    def is_clockwise(self) -> bool:
        """True of a closed plane curve with its outside on its left."""
        x, y, _ = self.point.T
        return bool(sum(x[:-1] * y[1:] - x[1:] * y[:-1]) < 0.0)

    def check_room(self, left: float, reach: float) -> None:
        """Refuses what touches and is wider than a hollow or a neck: it would touch at two points.

        Args:
            left: 1.0: it is on the left of a plane curve, -1.0 on its right; 0.0: in space.
            reach: from the curve to its centre, m.
        """
        import numpy as np

        turn = np.cross(self.first, self.second)
        bend = left * turn[:, 2] if left else np.linalg.norm(turn, axis=1)
        bend = bend / self.speed**3
        most = int(np.argmax(bend))
        tight = f"at s = {self.s[most]:g}, a hollow of radius {1.0 / max(bend[most], 1e-99):.4g} m"
        fits = reach * bend[most] <= FITS
        if fits and left:  # nearer to another part than to the one it touches
            normal = np.cross([0.0, 0.0, left], self.first) / self.speed[:, None]
            centre = self.point + reach * normal
            away = np.linalg.norm(centre[:, None] - self.point[None], axis=2)
            one, other = np.unravel_index(int(np.argmin(away)), away.shape)
            fits = away[one, other] >= reach * (1.0 - NEARER)
            tight = f"between s = {self.s[one]:g} and {self.s[other]:g}"
        if not fits:
            raise ValueError(
                f"{reach:g} m from the curve to the centre of what touches are too much {tight}: "
                "it would touch at two points; make it smaller, or give a contact for either part "
                "of the curve by s_min and s_max"
            )

    def samples(self) -> Any:
        """(SAMPLES, 4) s, x, y, z of points along it: closer where it bends."""
        import numpy as np

        way = self.first / self.speed[:, None]
        length = np.linalg.norm(np.diff(self.point, axis=0), axis=1)
        turn = np.linalg.norm(np.diff(way, axis=0), axis=1)
        part = length / length.sum() + turn / max(turn.sum(), 1.0)
        s = np.interp(np.linspace(0.0, part.sum(), SAMPLES), [0.0, *np.cumsum(part)], self.s)
        return np.column_stack([s, self.at(s)[0]])


def crossing(points: Any) -> tuple[int, int] | None:
    """The first two pieces of a closed line of points (n, 2), the first again the last, that cross.

    Pieces next to each other have a point in common, and do not count.
    """
    import numpy as np

    start, way = points[:-1], np.diff(points, axis=0)

    def sides(of: Any) -> Any:
        """(n, n) on which side of each piece points are."""
        d = of[None] - start[:, None]
        return way[:, None, 0] * d[:, :, 1] - way[:, None, 1] * d[:, :, 0]

    apart = sides(start) * sides(points[1:]) < 0.0
    found = np.argwhere(np.triu(apart & apart.T, 2))
    count = len(start)
    pairs = [(int(a), int(b)) for a, b in found if not (a == 0 and b == count - 1)]
    return pairs[0] if pairs else None


def _words(x: Any) -> str:
    return f"({', '.join(f'{c:.6g}' for c in x)})"
