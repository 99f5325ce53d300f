"""The estimate of a result's global error: how far a second, finer run of the same scene is away.

A run at tolerances ten times tighter (or half the step) has an error several times smaller, so the
difference of the two is the error of the coarser one, but for that smaller part. It is an estimate
and no bound: where both runs go the same wrong way, in a model or past an event, it shows nothing.
"""

import attrs
import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.model.state_layout import split
from dap3d_core.result.arrays import Column

#: The optional array of a result, as ``COLUMNS`` has the others.
U_ERROR = Column(
    "u_error", "state", "SI", "estimated global error of the state u, entry by entry; no bound"
)
#: The parts of a state by their symbols, with their units.
PARTS = {"r": "m", "p": "1", "rd": "m/s", "w": "rad/s"}
#: A state means nothing any more where its error is beyond this part of its size.
MEANINGLESS = 1e-3
#: Errors grow exponentially, and not with a power of time, where that line fits them better, over
#: this many instants and this many powers of ten at least.
FEWEST, DECADES = 10, 3.0
#: Sizes below this part of the scene's are taken for that: of its length, of 1, and of the speeds
#: that move a body by its length, or turn it by 1 rad, in the whole run.
SMALLEST_PART = 1e-3


@attrs.frozen(eq=False)
class ErrorEstimate:
    """Estimated global errors of n bodies at nt instants, with the names of the quantities.

    Attributes:
        t: (nt,) reported instants, s.
        u: (nt, 13 n) errors of the state, none negative, in its order and units.
        size: the largest magnitude over bodies and instants of r (m), p, rd (m/s), w (rad/s).
        length: m, that tolerances of the scene speak of.
    """

    t: Floats
    u: Floats
    size: dict[str, float]
    length: float = 1.0

    @property
    def r(self) -> Floats:
        """(nt, n, 3) error of the positions of the mass centres, m."""
        return self._part(0)

    @property
    def p(self) -> Floats:
        """(nt, n, 4) error of the Euler parameters; p and -p are one orientation."""
        return self._part(1)

    @property
    def rd(self) -> Floats:
        """(nt, n, 3) error of the velocities, m/s."""
        return self._part(2)

    @property
    def w(self) -> Floats:
        """(nt, n, 3) error of the angular velocities, rad/s, global axes."""
        return self._part(3)

    @property
    def largest(self) -> dict[str, float]:
        """By symbol, the largest error of a body's vector at any instant."""
        return {name: float(np.max(norms, initial=0.0)) for name, norms in self._norms().items()}

    @property
    def meaningless_from(self) -> float | None:
        """The first instant, s, at which an error is beyond 1e-3 of the size of what it belongs to.

        Sizes below 1e-3 of the scene's (``least_sizes``) count as that. None where no error is.
        """
        lost = self.relative > MEANINGLESS
        return float(self.t[np.argmax(lost)]) if lost.any() else None

    @property
    def relative(self) -> Floats:
        """(nt,) the largest error at each instant, as a part of the size of what it belongs to."""
        least = least_sizes(self.t, self.length)
        parts = [norms / max(self.size[name], least[name]) for name, norms in self._norms().items()]
        found: Floats = np.max(parts, axis=0, initial=0.0)
        return found

    @property
    def tenfold(self) -> float | None:
        """The time, s, in which the error grows tenfold, where it grows exponentially, else None.

        The slope of its logarithm over the instants before ``meaningless_from``; beyond, an error
        is as large as the motion and grows no more. None as well where log(t) fits it better than
        t: the errors of a motion that is no chaos grow with a power of time.
        """
        relative, end = self.relative, self.meaningless_from
        chosen = (self.t > self.t[0]) & (relative > 0.0)
        if end is not None:
            chosen &= self.t < end
        if np.count_nonzero(chosen) < FEWEST:
            return None
        elapsed, digits = self.t[chosen] - self.t[0], np.log10(relative[chosen])
        slope, missed = _line(elapsed, digits)
        if slope * elapsed[-1] < DECADES or missed >= _line(np.log10(elapsed), digits)[1]:
            return None
        return 1.0 / slope

    def _part(self, place: int) -> Floats:
        return split(self.u)[place]

    def _norms(self) -> dict[str, Floats]:
        """By symbol, (nt,) the largest error of a body's vector."""
        return largest_norms(self.u)


def _line(x: Floats, y: Floats) -> tuple[float, float]:
    """Slope of the straight line through points, and the sum of squares that it misses."""
    dx, dy = x - x.mean(), y - y.mean()
    slope = float(dx @ dy / (dx @ dx))
    return slope, float(np.sum((dy - slope * dx) ** 2))


def largest_norms(u: Floats) -> dict[str, Floats]:
    """By symbol r, p, rd, w: (nt,) the largest magnitude of a body's vector in u (nt, 13 n)."""
    parts = split(u)
    return {
        name: np.linalg.norm(part, axis=2).max(axis=1, initial=0.0)
        for name, part in zip(PARTS, parts, strict=True)
    }


def sizes_of(u: Floats) -> dict[str, float]:
    """By symbol r, p, rd, w: the largest magnitude of a body's vector in u (nt, 13 n)."""
    return {name: float(np.max(norms, initial=0.0)) for name, norms in largest_norms(u).items()}


def least_sizes(t: Floats, length: float) -> dict[str, float]:
    """By symbol r, p, rd, w: below which a magnitude in a run over instants t is as good as zero.

    A part of the scene's length, m, of a unit vector, and of the speeds that make those in the run.
    """
    duration = float(t[-1] - t[0]) if len(t) else 0.0
    rate = 1.0 / duration if duration > 0.0 else np.inf
    sizes = {"r": length, "p": 1.0, "rd": length * rate, "w": rate}
    return {name: SMALLEST_PART * size for name, size in sizes.items()}


def estimate_of(
    t: Floats, u: Floats, u_error: Floats | None, length: float
) -> ErrorEstimate | None:
    """The estimate of a result's arrays; None where none was asked for."""
    return None if u_error is None else ErrorEstimate(t, u_error, sizes_of(u), length)


def difference(u: Floats, other: Floats) -> Floats:
    """State u less another one of the same bodies, Euler parameters with the sign that is nearer.

    Args:
        u, other: (nt, 13 n) each.

    Returns:
        (nt, 13 n), a new array.
    """
    found = u - other
    p, q = split(u)[1], split(other)[1]
    opposite = np.einsum("tbe,tbe->tb", p, q) < 0.0
    split(found)[1][opposite] = (p + q)[opposite]
    return found


def estimated_error(u: Floats, finer: Floats, step_count: int) -> Floats:
    """|u - finer| at each instant and its neighbours, the larger; at least what rounding comes to.

    The difference changes its sign now and then, which says nothing of the error there. A rounding
    error of each step, random in sign, adds up to the root of their number.

    Args:
        u: (nt, 13 n) states of a run.
        finer: those of a finer run at the same instants.
        step_count: steps of the finer run.

    Returns:
        (nt, 13 n), none negative.
    """
    apart = np.abs(difference(u, finer))
    found = apart.copy()
    np.maximum(found[1:-1], apart[2:], out=found[1:-1])  # the start is known
    np.maximum(found[1:], apart[:-1], out=found[1:])
    rounding = float(np.finfo(float).eps) * np.sqrt(step_count)
    parts = split(found)
    for part, size in zip(parts, sizes_of(u).values(), strict=True):
        np.maximum(part, rounding * size, out=part)
    return found
