"""What data determine: covariance of fitted parameters, and those that cannot be told apart."""

from collections.abc import Sequence
from fractions import Fraction

import attrs
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Singular values of the scaled Jacobian, over the largest, below which a direction is lost: this,
#: or so many times the error that a tolerance of the integration leaves in a central difference.
SMALLEST, ROUGH = 1e-6, 5.0
#: ... or below so many times the error of the Jacobian, where it is known.
ERRORS = 3.0
#: Changes of the predictions below this many tolerances of the integration say nothing.
TOLERANCES = 100.0
#: A parameter has a part in a lost direction from here on.
PART = 1e-3
#: Largest whole number in the words for a combination, and how near numbers are to one.
WHOLE, NEAR = 3, 1e-3

#: The quantile of the normal distribution that leaves 95 % between it and its negative.
NORMAL_95 = 1.959963984540054


@attrs.frozen(eq=False)
class Determined:
    """What data say of parameters at the optimum.

    Attributes:
        covariance: (d, d) with a standard deviation of 1 for the weighted data; rows of parameters
            that are not determined are inf on the diagonal and NaN else; NaN for those held.
        rank: how many combinations the data determine.
        words: what is to be said, a sentence each.
    """

    covariance: Floats
    rank: int
    words: tuple[str, ...]


@attrs.frozen
class Resolution:
    """What can be told from runs at all.

    Attributes:
        smallest: singular value of the scaled Jacobian, over the largest, of a lost direction.
        floor: changes of the predictions, (m,) as a vector, that say nothing.
    """

    smallest: float
    floor: float

    @classmethod
    def of(cls, rtol: float, predicted: Floats) -> "Resolution":
        """That of runs with a tolerance, which predict (m,) numbers."""
        smallest = max(SMALLEST, ROUGH * rtol ** (2.0 / 3.0))
        return cls(smallest, TOLERANCES * rtol * float(np.linalg.norm(predicted)))


def steadied(jacobian: Floats, resolution: Resolution) -> tuple[Floats, Floats]:
    """A Jacobian (m, d) without lost directions, and (d, d) rows that hold parameters along them.

    With these rows below it, and zeros below the residuals, no step goes where nothing is to be
    gained and only the errors of the derivatives lead. Parameters are over their scales.
    """
    size = np.linalg.norm(jacobian, axis=0)
    idle = size <= resolution.floor
    free = np.flatnonzero(~idle)
    rows = np.diag(np.where(idle, max(size.max(), 1.0), 0.0))
    kept = np.where(idle, 0.0, jacobian)
    if len(free):
        u, s, vt = np.linalg.svd(jacobian[:, free] / size[free], full_matrices=False)
        lost = s <= resolution.smallest * s[0]
        kept[:, free] = (u * np.where(lost, 0.0, s)) @ vt * size[free]
        held = s[0] * vt[lost] * size[free]
        rows[np.ix_(free[: len(held)], free)] = held
    return kept, rows


def determine(
    names: Sequence[str], x: Floats, scale: Floats, jacobian: Floats, error: Floats,
    held: NDArray[np.bool_], resolution: Resolution,
) -> Determined:  # fmt: skip
    """What a Jacobian says of parameters.

    Args:
        names: (d,) of the parameters.
        x, scale: (d,) their values; changes of them that matter.
        jacobian, error: (m, d) derivatives of the weighted predictions, and how wrong they are.
        held: (d,) those that stand at a bound, which are taken as known.
        resolution: what can be told at all.
    """
    d = len(names)
    size = np.linalg.norm(jacobian, axis=0)
    wrong = np.linalg.norm(error, axis=0)
    idle = ~held & ((size <= ERRORS * wrong) | (size * scale <= resolution.floor))
    free = np.flatnonzero(~held & ~idle)
    covariance = np.full((d, d), np.nan)
    covariance[idle, idle] = np.inf
    words = [f"{n} has no effect on these data" for n, i in zip(names, idle, strict=True) if i]
    if not len(free):
        return Determined(covariance, 0, tuple(words))
    doubt = np.linalg.norm(error[:, free] / size[free], ord=2)
    _, s, vt = np.linalg.svd(jacobian[:, free] / size[free], full_matrices=False)
    lost = s <= max(resolution.smallest * s[0], ERRORS * doubt)
    inverse = np.where(lost, 0.0, 1.0 / np.where(lost, 1.0, s) ** 2)
    inner = (vt.T * inverse) @ vt / np.outer(size[free], size[free])
    for relation in _relations(vt[lost]):
        part = np.flatnonzero(relation)
        words.append(_told([names[free[j]] for j in part], x[free[part]],
                           relation[part] / size[free[part]]))  # fmt: skip
    unknown = (np.abs(vt[lost]) > PART).any(axis=0)
    inner[unknown, :] = inner[:, unknown] = np.nan
    inner[unknown, unknown] = np.inf
    covariance[np.ix_(free, free)] = inner
    return Determined(covariance, int((~lost).sum()), tuple(words))


def intervals(
    said: Determined, x: Floats, cost: float, degrees: int, *, known: bool
) -> tuple[Floats, list[tuple[float, float]]]:
    """Covariance and 95 % intervals: normal where sigma is known, else by Student's t."""
    from scipy.special import stdtrit

    covariance, quantile = said.covariance.copy(), NORMAL_95
    finite = np.isfinite(covariance)
    if not known and degrees:
        covariance[finite] *= 2.0 * cost / degrees
        quantile = float(stdtrit(degrees, 0.975))
    elif not known:  # as many numbers as parameters leave nothing to estimate a deviation from
        covariance[finite] = np.nan
        covariance[np.diag_indices(len(x))] = np.where(finite.diagonal(), np.inf, np.nan)
    half = quantile * np.sqrt(np.diag(covariance))
    return covariance, [(float(v - h), float(v + h)) for v, h in zip(x, half, strict=True)]


def correlation_of(covariance: Floats) -> Floats:
    """(d, d) of a covariance, NaN where that is no number."""
    deviation = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        found = covariance / np.outer(deviation, deviation)
    return np.asarray(np.where(np.isfinite(found), found, np.nan))


def _relations(directions: Floats) -> Floats:
    """Lost directions (n, d) as such of few parameters each: reduced, with the largest pivots."""
    left = directions.copy()
    for k in range(len(left)):
        pivot = np.unravel_index(np.argmax(np.abs(left[k:])), left[k:].shape)
        row, column = k + int(pivot[0]), int(pivot[1])
        left[[k, row]] = left[[row, k]]
        left[k] /= left[k, column]
        for other in range(len(left)):
            if other != k:
                left[other] -= left[other, column] * left[k]
    left[np.abs(left) < PART] = 0.0
    return left


def _told(names: list[str], x: Floats, direction: Floats) -> str:
    """The sentence on parameters that can change together along a direction unnoticed."""
    listed = f"{', '.join(names[:-1])} and {names[-1]}"
    begin = f"{listed} cannot be told apart by these data"
    if len(names) == 2:
        return f"{begin}: only {_combination(names, x, direction)} is determined"
    relative = direction / x if (x != 0.0).all() else None
    if relative is not None and np.ptp(relative) < NEAR * np.abs(relative).max():
        return f"{begin}: only their ratios are determined"
    change = direction / np.abs(direction).max()
    shown = ", ".join(f"{n} by {c:+.3g}" for n, c in zip(names, change, strict=True))
    return f"{begin}: changing {shown} together, in this proportion, leaves the predictions"


def _combination(names: list[str], x: Floats, direction: Floats) -> str:
    """What stays the same along a direction of two parameters: a product of powers, or a sum."""
    if (x != 0.0).all():
        whole = _whole(direction[1] / x[1], -direction[0] / x[0])
        if whole:
            return _product(names, whole)
    whole = _whole(direction[1], -direction[0])
    a, b = whole or (1.0, -direction[0] / direction[1])
    first = names[0] if a == 1 else f"{a:.4g} {names[0]}"
    second = names[1] if abs(b) == 1 else f"{abs(b):.4g} {names[1]}"
    return f"{first} {'-' if b < 0 else '+'} {second}"


def _whole(a: float, b: float) -> tuple[int, int] | None:
    """Small whole numbers, the first above zero, in the ratio a : b."""
    if not a or not b:
        return None
    ratio = Fraction(b / a).limit_denominator(WHOLE)
    if not 0 < abs(ratio.numerator) <= WHOLE or abs(float(ratio) * a / b - 1.0) > NEAR:
        return None
    return ratio.denominator, ratio.numerator


def _product(names: list[str], powers: tuple[int, int]) -> str:
    def power(name: str, p: int) -> str:
        return name if p == 1 else f"{name}^{p}"

    first, second = power(names[0], powers[0]), power(names[1], abs(powers[1]))
    return f"{first} * {second}" if powers[1] > 0 else f"{first} / {second}"
