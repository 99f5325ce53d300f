"""Design of a study: what varies, and its points as a grid of values or as samples."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

import attrs
import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene import MISSING, Mistake, SceneError
from dap3d_core.scene.coerce import plain
from dap3d_core.scene.validate.coerce_values import LARGEST

DESIGNS = ("lhs", "random", "sobol", "halton")
GRID = "grid"
#: Limits; Sobol' sequences are tabled for up to 21201 dimensions.
MAX_POINTS, MAX_VARIED = 10**8, 1000
#: Samples of (0, 1) stay so far from its ends, where the normal distribution is infinite.
MARGIN = 2.0**-53
NO_NUMBER = f"is no finite number of at most {LARGEST:g} in size"
FORMS = "1:5:9 (from:to:count), 1:100:5:log or 10,50,100 (a list)"
SAMPLED = "1:5 (from:to), 1:100:log, 3~0.1 (mean~standard deviation), 10,50,100 (one of these)"


@attrs.frozen(eq=False)
class VariedParameter:
    """A parameter, and the values or the distribution that it takes.

    Attributes:
        name: dotted name of the parameter.
        spec: as given: text, or a list of numbers.
        values: (count,) of a list or an axis of a grid; else None.
        kind: its distribution where it is sampled: "list", "uniform", "log" or "normal".
        first, second: ends of its range; or mean and standard deviation.
    """

    name: str
    spec: str | list[float]
    values: Floats | None
    kind: str = "list"
    first: float = 0.0
    second: float = 0.0

    def quantiles(self, shares: Floats) -> Floats:
        """Values (n,) below which a share (n,) of the distribution lies."""
        if self.values is not None:
            index = np.minimum((shares * len(self.values)).astype(int), len(self.values) - 1)
            return np.asarray(self.values[index])
        if self.kind == "normal":
            from scipy.special import ndtri

            inside = np.clip(shares, MARGIN, 1.0 - MARGIN)
            return np.asarray(self.first + self.second * ndtri(inside))
        return _between(self.first, self.second, shares, self.kind == "log")


@attrs.frozen(eq=False)
class Design:
    """The points of a study.

    Attributes:
        varied: what varies, in order.
        name: "grid", or one of ``DESIGNS``.
        count, seed: of the samples; None for a grid.
    """

    varied: tuple[VariedParameter, ...]
    name: str = GRID
    count: int | None = None
    seed: int | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each axis of a grid; (count,) of samples."""
        return tuple(map(len, self.axes)) if self.count is None else (self.count,)

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Names of the axes: those of the parameters; of samples, ``point``."""
        return tuple(v.name for v in self.varied) if self.count is None else ("point",)

    @property
    def axes(self) -> list[Floats]:
        """The values of each parameter of a grid."""
        return [v.values for v in self.varied if v.values is not None]

    @property
    def size(self) -> int:
        """Number of points."""
        return math.prod(self.shape)

    def points(self) -> Floats:
        """The values at all points (N, parameters), the last parameter fastest."""
        if self.count is None:
            grid = np.meshgrid(*self.axes, indexing="ij")
            return np.stack([axis.ravel() for axis in grid], axis=1)
        shares = self._unit_cube(self.count)
        return np.stack([v.quantiles(shares[:, k]) for k, v in enumerate(self.varied)], axis=1)

    def _unit_cube(self, count: int) -> Floats:
        """Points (count, parameters) of the unit cube."""
        generator = np.random.default_rng(self.seed)
        dimension = len(self.varied)
        if self.name == "random":
            return generator.random((count, dimension))
        from scipy.stats import qmc

        engines = {"lhs": qmc.LatinHypercube, "sobol": qmc.Sobol, "halton": qmc.Halton}
        return np.asarray(engines[self.name](d=dimension, seed=generator).random(count))


def design_of(vary: Any, sample: int | None = None, design: str = "lhs", seed: int = 0) -> Design:
    """The design that a script or a command line describes.

    Args:
        vary: name -> how it varies: text in one of the forms below, a number, or a list or an
            array of numbers; or texts ``NAME=FORM``. On a grid: ``1:5:9`` (from:to:count, evenly),
            ``1:100:5:log`` (evenly in the logarithm), ``10,50,100``. For samples: ``1:5``,
            ``1:100:log``, ``3~0.1`` (normal: mean~standard deviation), ``10,50,100`` (each of
            these as often).
        sample: number of samples; None for a grid of all combinations.
        design: how samples are drawn: "lhs" (Latin hypercube), "random", "sobol", "halton".
        seed: of the generator they are drawn with.

    Raises:
        SceneError: all mistakes.
    """
    mistakes = _sampling_mistakes(sample, design, seed)
    pairs = _pairs(vary, mistakes)
    read = [_read(name, spec, sample is not None) for name, spec in pairs]
    mistakes += [one for one in read if isinstance(one, Mistake)]
    varied = tuple(one for one in read if not isinstance(one, Mistake))
    if len(pairs) > MAX_VARIED:
        what = f"{len(pairs)} numbers vary; at most {MAX_VARIED} do"
        mistakes.append(Mistake("vary", MISSING, what))
    lengths = [len(axis) for axis in Design(varied).axes]
    if sample is None and math.prod(lengths) > MAX_POINTS:
        product = f"{' x '.join(f'{n:,}' for n in lengths)} = {math.prod(lengths):.3g}"
        what = f"the grid has {product} points; a study has at most {MAX_POINTS:g}"
        mistakes.append(Mistake("vary", MISSING, what, remedy="sample it: sample=1000, --sample"))
    if mistakes:
        raise SceneError(mistakes)
    return Design(varied) if sample is None else Design(varied, design, int(sample), int(seed))


def _sampling_mistakes(sample: Any, design: Any, seed: Any) -> list[Mistake]:
    mistakes = []
    if sample is not None and not (_is_whole(sample) and 1 <= sample <= MAX_POINTS):
        what = f"the number of samples is a whole number from 1 to {MAX_POINTS:g}"
        mistakes.append(Mistake("sample", sample, what))
    if design not in DESIGNS:
        what = f"samples are drawn by one of {', '.join(DESIGNS)}"
        remedy = "for a grid leave sample and design out" if design == GRID else ""
        mistakes.append(Mistake("design", design, what, nearest(design, DESIGNS), remedy))
    if not (_is_whole(seed) and 0 <= seed < 2**63):
        mistakes.append(Mistake("seed", seed, "the seed is a whole number from 0 to 2^63 - 1"))
    return mistakes


def _is_whole(value: Any) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def _pairs(vary: Any, mistakes: list[Mistake]) -> list[tuple[str, Any]]:
    """Name and form of each parameter."""
    pairs: list[tuple[str, Any]] = []
    if isinstance(vary, Mapping):
        pairs = list(vary.items())
    elif isinstance(vary, Iterable):
        for one in [vary] if isinstance(vary, str) else vary:
            name, sign, spec = one.rpartition("=") if isinstance(one, str) else ("", "", "")
            if sign and name:
                pairs.append((name.strip(), spec))
            else:
                what = 'what varies is NAME=FORM, such as "bodies.crank.mass=1:5:9"'
                mistakes.append(Mistake("vary", one, what))
    else:
        mistakes.append(Mistake("vary", vary, 'what varies is {"bodies.crank.mass": "1:5:9"}'))
        return pairs
    if not pairs and not mistakes:
        what = "nothing varies: a study varies at least one number"
        mistakes.append(Mistake("vary", MISSING, what, remedy="bodies.crank.mass=1:5:9"))
    pairs = [(plain(name), values) for name, values in pairs]
    names = [name for name, _ in pairs]
    twice = dict.fromkeys(n for n in names if names.count(n) > 1)
    mistakes += [Mistake("vary", name, "a number is varied only once") for name in twice]
    return pairs


def _read(name: Any, spec: Any, sampled: bool) -> VariedParameter | Mistake:
    """One varied parameter, or its mistake."""
    if not isinstance(spec, str):
        return _list(name, spec, spec)
    if "~" in spec:
        return _normal(name, spec, sampled)
    if ":" in spec:
        return _range(name, spec, sampled)
    if not spec.strip():
        return Mistake(f"vary {name}", spec, f"no values; write {FORMS}")
    return _list(name, spec, [part.strip() for part in spec.split(",")])


def _list(name: str, spec: Any, values: Any) -> VariedParameter | Mistake:
    """A list of different numbers."""
    key = f"vary {name}"
    try:
        array = np.atleast_1d(np.asarray(values))
    except ValueError:  # ragged
        array = np.asarray(None)
    if array.ndim != 1 or array.dtype.kind not in "iufU" or isinstance(values, Mapping):
        return Mistake(key, spec, f"should be numbers in a list, or text: {FORMS}")
    if not len(array):
        return Mistake(key, spec, "no points: there is no value in the list")
    if len(array) > MAX_POINTS:
        return Mistake(key, MISSING, f"{len(array):.3g} values; at most {MAX_POINTS:g}")
    numbers = np.empty(len(array))
    for k, part in enumerate(array.tolist()):
        number = _number(part)
        if number is None:
            return Mistake(key, part, f"{NO_NUMBER}; write {FORMS}")
        numbers[k] = number
    unique, counts = np.unique(numbers, return_counts=True)
    if len(unique) < len(numbers):
        return Mistake(key, spec, f"{unique[counts > 1][0]:g} is in the list twice")
    return VariedParameter(name, spec if isinstance(spec, str) else numbers.tolist(), numbers)


def _range(name: str, spec: str, sampled: bool) -> VariedParameter | Mistake:
    """``from:to:count``, ``from:to``, each perhaps with ``:log``."""
    key = f"vary {name}"
    parts = [part.strip() for part in spec.split(":")]
    is_log = parts[-1] == "log"
    parts = parts[:-1] if is_log else parts
    if len(parts) not in (2, 3):
        return Mistake(key, spec, f"should be one of {SAMPLED if sampled else FORMS}")
    ends = [_number(part) for part in parts[:2]]
    for part, end in zip(parts, ends, strict=False):
        if end is None:
            return Mistake(key, spec, f"{part!r} {NO_NUMBER}")
    low, high = ends[0] or 0.0, ends[1] or 0.0
    if low == high:
        remedy = f"a constant value is {name}={low:g}"
        return Mistake(key, spec, "the range begins where it ends", remedy=remedy)
    if is_log and min(low, high) < 1.0 / LARGEST:
        what = f"a logarithm is of positive numbers; both ends should be {1.0 / LARGEST:g} or more"
        return Mistake(key, spec, what)
    if sampled and len(parts) == 3:
        remedy = f"leave the count out: {':'.join(parts[:2] + ['log'] * is_log)}"
        return Mistake(key, spec, "a range that is sampled has no count", remedy=remedy)
    if sampled:
        return VariedParameter(name, spec, None, "log" if is_log else "uniform", low, high)
    if len(parts) == 2:
        tail = ":log" if is_log else ""
        remedy = f"add how many, {':'.join(parts)}:9{tail}, or sample: sample=N, --sample N"
        return Mistake(key, spec, "a range of a grid needs a count", remedy=remedy)
    return _axis(name, spec, (low, high), parts[2], is_log)


def _axis(
    name: str, spec: str, ends: tuple[float, float], text: str, is_log: bool
) -> VariedParameter | Mistake:
    """An axis of a grid."""
    key = f"vary {name}"
    try:
        count = int(text) if text.isascii() else 0
    except ValueError:
        return Mistake(key, spec, f"the count {text!r} is no whole number")
    if count < 1:
        return Mistake(key, spec, "no points: the count is at least 1")
    if count == 1:
        what = "one value does not reach from one end to the other"
        return Mistake(key, spec, what, remedy=f"a constant value is {name}={ends[0]:g}")
    if count > MAX_POINTS:
        return Mistake(key, spec, f"{count:.3g} points; a study has at most {MAX_POINTS:g}")
    values = np.linspace(*ends, count)
    if is_log:
        values = _between(*ends, np.linspace(0.0, 1.0, count), is_log)
        values[-1] = ends[1]  # which rounding may miss
    return VariedParameter(name, spec, values)


def _between(low: float, high: float, shares: Floats, is_log: bool) -> Floats:
    if is_log:
        return np.asarray(low * (high / low) ** shares)
    return np.asarray(low + (high - low) * shares)


def _normal(name: str, spec: str, sampled: bool) -> VariedParameter | Mistake:
    """``mean~standard deviation``."""
    key = f"vary {name}"
    numbers = [_number(part.strip()) for part in spec.split("~")]
    if len(numbers) != 2 or numbers[0] is None or numbers[1] is None:
        return Mistake(key, spec, "should be two finite numbers, mean~standard deviation")
    if numbers[1] <= 0.0:
        return Mistake(key, spec, "a standard deviation is greater than 0")
    if not sampled:
        remedy = "say how many: sample=N, --sample N; or list values"
        return Mistake(key, spec, "a normal distribution is sampled", remedy=remedy)
    return VariedParameter(name, spec, None, "normal", numbers[0], numbers[1])


def _number(value: Any) -> float | None:
    """A finite number that a scene may hold; None for anything else."""
    if isinstance(value, str) and "_" in value:  # which Python takes for a comma
        return None
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        return None
    return number if abs(number) <= LARGEST else None
