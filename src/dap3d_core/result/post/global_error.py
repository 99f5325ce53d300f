"""Estimate of a result's global error: its difference from a second, finer run of the scene.

A run at tolerances ten times tighter (or half the step) has an error several times smaller, so the
difference of the two is the error of the coarser one, up to that smaller part. It is an estimate,
not a bound: it does not see an error that both runs have, in a model or past an event.
"""

from typing import Any

import attrs
import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.model.state_layout import split

#: The parts of a state by their symbols, with their units.
PARTS = {"r": "m", "p": "1", "rd": "m/s", "w": "rad/s"}
#: A state is meaningless where its error exceeds this fraction of its size.
MEANINGLESS = 1e-3
#: Least number of instants, and of powers of ten, for exponential growth.
FEWEST, DECADES = 10, 3.0
#: Least sizes, as a fraction of the scene's: of its length, of 1, and of the speeds that cover
#: those in the whole run.
SMALLEST_PART = 1e-3


def _part(place: int, meaning: str) -> Any:
    """The attribute for a part of the state."""
    return property(lambda estimate: split(estimate.u)[place], doc=meaning)


@attrs.frozen(eq=False)
class ErrorEstimate:
    """Estimated global errors of n bodies at nt instants, with the names of the quantities.

    Attributes:
        t: (nt,) reported instants, s.
        u: (nt, 13 n) errors of the state, none negative, in its order and units.
        size: the largest magnitude over bodies and instants of r (m), p, rd (m/s), w (rad/s).
        length: m, that tolerances of the scene refer to.
    """

    t: Floats
    u: Floats
    size: dict[str, float]
    length: float = 1.0

    r = _part(0, "(nt, n, 3) error of the positions of the mass centres, m.")
    p = _part(1, "(nt, n, 4) error of the Euler parameters; p and -p are one orientation.")
    rd = _part(2, "(nt, n, 3) error of the velocities, m/s.")
    w = _part(3, "(nt, n, 3) error of the angular velocities, rad/s, global axes.")

    @property
    def largest(self) -> dict[str, float]:
        """By symbol, the largest error of a body's vector at any instant."""
        return sizes_of(self.u)

    @property
    def meaningless_from(self) -> float | None:
        """First instant, s, at which an error exceeds 1e-3 of the size of its quantity, else None.

        Sizes are at least 1e-3 of the scene's (``least_sizes``).
        """
        beyond = self.relative > MEANINGLESS
        return float(self.t[np.argmax(beyond)]) if beyond.any() else None

    @property
    def relative(self) -> Floats:
        """(nt,) largest error at each instant, relative to the size of its quantity."""
        least = least_sizes(self.t, self.length)
        parts = [
            norms / max(self.size[name], least[name])
            for name, norms in largest_norms(self.u).items()
        ]
        return np.asarray(np.max(parts, axis=0, initial=0.0))

    @property
    def tenfold(self) -> float | None:
        """Time, s, in which the error grows tenfold if it grows exponentially, else None.

        From the slope of its logarithm over the instants before ``meaningless_from``; beyond, an
        error is as large as the motion and stops growing. None also if log(t) fits it better than
        t: without chaos errors grow with a power of time.
        """
        relative, end = self.relative, self.meaningless_from
        chosen = (self.t > self.t[0]) & (relative > 0.0)
        if end is not None:
            chosen &= self.t < end
        if np.count_nonzero(chosen) < FEWEST:
            return None
        elapsed, digits = self.t[chosen] - self.t[0], np.log10(relative[chosen])
        slope, residual = _line(elapsed, digits)
        if slope * elapsed[-1] < DECADES or residual >= _line(np.log10(elapsed), digits)[1]:
            return None
        return 1.0 / slope


def _line(x: Floats, y: Floats) -> tuple[float, float]:
    """Slope of the regression line through points, and its sum of squared residuals."""
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
    """By symbol r, p, rd, w: sizes in a run over instants t below which a magnitude counts as zero.

    Fractions of the length, m, of a unit vector, and of the speeds that cover those in the run.
    """
    duration = float(t[-1] - t[0]) if len(t) else 0.0
    rate = 1.0 / duration if duration > 0.0 else np.inf
    sizes = {"r": length, "p": 1.0, "rd": length * rate, "w": rate}
    return {name: SMALLEST_PART * size for name, size in sizes.items()}


def difference(u: Floats, other: Floats) -> Floats:
    """State u minus another one of the same bodies, Euler parameters with the closer sign.

    Args:
        u, other: (nt, 13 n) each.

    Returns:
        (nt, 13 n), a new array.
    """
    apart = u - other
    p, q = split(u)[1], split(other)[1]
    opposite = np.einsum("tbe,tbe->tb", p, q) < 0.0
    split(apart)[1][opposite] = (p + q)[opposite]
    return apart


def estimated_error(u: Floats, finer: Floats, step_count: int) -> Floats:
    """Largest |u - finer| of each instant and its neighbours, at least the rounding error.

    Neighbours, because the difference passes through zero where the error does not vanish. Rounding
    errors of steps, random in sign, add up to the root of the number of steps.

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
    for part, size in zip(split(found), sizes_of(u).values(), strict=True):
        np.maximum(part, rounding * size, out=part)
    return found
