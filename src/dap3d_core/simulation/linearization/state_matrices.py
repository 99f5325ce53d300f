"""Eigenvalues of state matrices, and their response to inputs that oscillate.

Zero eigenvalues come in chains. A motion that costs nothing, the position of a free body or the
heading of a wheel, is a zero row or column. Its zero eigenvalue has a Jordan chain, which rounding
would scatter over a circle of radius eps^(1/2) or wider. So zeros are split off first, as null
spaces, one link of all chains after the other (Kublanovskaya, USSR Comput. Math. 6(4), 1966); what
is left has eigenvalues that are known to rounding.
"""

from typing import Any, NamedTuple

import attrs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from dap3d_core.kernels.array_types import Floats

Complex = NDArray[np.complex128]

#: A singular value below this part of the matrix's terms, times the root of their number, is zero.
#: A slow motion beside a fast one is not, down to 1e-7 of its frequency.
ZERO = 1e-14
#: Range of frequencies by default: below the lowest mode and above the highest, and without modes.
BELOW, ABOVE, WITHOUT = 0.1, 10.0, (0.1, 100.0)
#: Modes slower than this part of the fastest are drifts, and say nothing about a range.
DRIFTS = 1e-6


@attrs.frozen(eq=False)
class Eigenvalues:
    """Eigenvalues and eigenvectors.

    Attributes:
        values: (k,) by magnitude, zeros first; of a conjugate pair that with Im > 0 first.
        vectors: (states, k) unit eigenvectors; of zero as many as there are, then columns of zeros.
    """

    values: Complex
    vectors: Complex


def eigenvalues_of(A: Floats, size: float) -> Eigenvalues:
    """All eigenvalues and eigenvectors of a real matrix A, its terms of magnitude ``size``."""
    splits: list[tuple[Floats, Floats, Floats]] = []
    rest, zeros, limit = A, 0, ZERO * max(size, 1e-300) * np.sqrt(len(A))
    while len(rest):
        _, values, right = np.linalg.svd(rest)
        null = right[values <= limit].T
        if not null.shape[1]:
            break
        other = right[values > limit].T
        splits.append((null, other, null.T @ rest @ other))
        rest, zeros = other.T @ rest @ other, zeros + null.shape[1]
    values, vectors = np.linalg.eig(rest) if len(rest) else (np.zeros(0), np.zeros((0, 0)))
    values, vectors = values.astype(complex), vectors.astype(complex)
    for null, other, coupling in reversed(splits):
        vectors = other @ vectors + null @ (coupling @ vectors / values)
    vectors = vectors / np.linalg.norm(vectors, axis=0)
    order = order_of(values)
    of_zero = np.zeros((len(A), zeros), dtype=complex)
    if splits:
        of_zero[:, : splits[0][0].shape[1]] = splits[0][0]
    return Eigenvalues(
        np.concatenate([np.zeros(zeros, dtype=complex), values[order]]),
        np.hstack([of_zero, vectors[:, order]]),
    )


def order_of(values: Any) -> Any:
    """Indices of eigenvalues by magnitude, of a conjugate pair that with Im > 0 first."""
    magnitude = np.abs(values)
    rounded = np.zeros(len(values))
    by_size = np.argsort(magnitude, kind="stable")
    group, last = 0, -1.0
    for k in by_size:  # magnitudes that agree but for rounding are of one group
        if magnitude[k] > last * (1.0 + 1e-9):
            group, last = group + 1, magnitude[k]
        rounded[k] = group
    return np.lexsort((-np.sign(values.imag), -np.abs(values.imag), values.real, rounded))


class Peak(NamedTuple):
    """A frequency, Hz, at which a gain is largest among its neighbours; phase in rad."""

    frequency: float
    gain: float
    phase: float


def response(A: Floats, B: Floats, C: Floats, D: Floats, frequencies: ArrayLike) -> Complex:
    """(f, outputs, inputs) C (i omega - A)^-1 B + D; infinite at an undamped resonance.

    frequencies: (f,) Hz.

    Raises:
        ValueError: a frequency is negative or not finite.
    """
    given = np.atleast_1d(np.asarray(frequencies, dtype=float))
    if given.ndim != 1 or not np.all(np.isfinite(given)) or np.any(given < 0.0):
        raise ValueError(f"frequencies are finite numbers of 0 Hz and more, not {frequencies!r}")
    found = np.empty((len(given), *D.shape), dtype=complex)
    for k, f in enumerate(given):
        try:
            found[k] = C @ np.linalg.solve(2j * np.pi * f * np.eye(len(A)) - A, B) + D
        except np.linalg.LinAlgError:
            found[k] = np.inf
    return found


def usual_range(modes: Floats) -> tuple[float, float]:
    """Frequencies, Hz, between which a response is of interest: around those of the modes."""
    known = modes[np.isfinite(modes)]
    known = known[known > DRIFTS * np.max(known, initial=0.0)]
    if not len(known):
        return WITHOUT
    return BELOW * float(known.min()), ABOVE * float(known.max())


def samples(modes: Floats, damping: Floats, first: float, last: float, count: int) -> Floats:
    """(f,) frequencies, Hz, evenly spaced by their logarithms, and closely about each mode."""
    even = np.geomspace(first, last, count)
    width = np.maximum(np.abs(damping), 1e-3)
    near = modes[:, None] * (1.0 + width[:, None] * np.linspace(-3.0, 3.0, 61))
    inside = near[(near >= first) & (near <= last)]
    return np.unique(np.concatenate([even, inside]))


def peaks(frequencies: Floats, values: Complex) -> list[Peak]:
    """Peaks of one response (f,), in the order of their frequencies.

    Between samples by parabolas of the logarithms of gains, where neighbours are no less than half.
    """
    gain = np.abs(values)
    inner = (gain[1:-1] >= gain[:-2]) & (gain[1:-1] > gain[2:])
    phase = np.unwrap(np.angle(np.where(np.isfinite(values), values, 0.0)))
    found = []
    for k in 1 + np.flatnonzero(inner):
        f, size, turn = (x[k - 1 : k + 2] for x in (frequencies, gain, phase))
        if not size[1] < 2.0 * min(size[0], size[2]):
            found.append(Peak(float(f[1]), float(size[1]), float(turn[1])))
            continue
        high = np.polyfit(f - f[1], np.log(size), 2)
        x = -0.5 * high[1] / high[0]
        through = np.polyfit(f - f[1], turn, 2)
        peak = float(np.exp(np.polyval(high, x)))
        found.append(Peak(float(f[1] + x), peak, float(np.polyval(through, x))))
    return found
