"""Response of a linearisation to inputs that oscillate, and its peaks."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.kernels.array_types import Floats
from dap3d_core.simulation.linearization.eigenvalues import Complex

#: Range of frequencies by default: below the lowest mode and above the highest, and without modes.
BELOW, ABOVE, WITHOUT = 0.1, 10.0, (0.1, 100.0)
#: Modes slower than this part of the fastest are drifts, and say nothing about a range.
DRIFTS = 1e-6


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
