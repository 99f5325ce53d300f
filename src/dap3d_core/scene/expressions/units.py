"""Units of expressions: carried through arithmetic, refused where unlike ones are added.

A unit is a product of powers of symbols. Bare numbers have no unit that could be known: added, they
take that of the other term; as factors they are collected. A collected factor that is a simple
fraction, as in a mean, or 2 leaves the unit as it is; any other one, 180/pi or 1000, may be the
conversion to another unit, and the unit is not known any more (docs/decisions/0078).
"""

import math
import re
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Final, NamedTuple

#: Unit of a number without dimension; of what depends on the row; of what is not known.
ONE, BY_ROW, NONE = "1", "SI", ""
#: Largest denominator of a simple fraction.
LARGEST = 9

Powers = Mapping[str, Fraction]


def _made_of(**powers: int) -> Powers:
    return {symbol: Fraction(power) for symbol, power in powers.items()}


#: Symbols of units: size in SI units, and dimensions; an angle has none.
SYMBOLS: Final[Mapping[str, tuple[float, Powers]]] = {
    **{symbol: (1.0, {symbol: Fraction(1)}) for symbol in ("m", "s", "kg")},
    "g": (1e-3, _made_of(kg=1)),
    "N": (1.0, _made_of(kg=1, m=1, s=-2)),
    "J": (1.0, _made_of(kg=1, m=2, s=-2)),
    "W": (1.0, _made_of(kg=1, m=2, s=-3)),
    "Pa": (1.0, _made_of(kg=1, m=-1, s=-2)),
    "Hz": (1.0, _made_of(s=-1)),
    "rad": (1.0, {}),
    "deg": (math.pi / 180.0, {}),
    "rev": (2.0 * math.pi, {}),
    "rpm": (2.0 * math.pi / 60.0, _made_of(s=-1)),
    "g0": (9.80665, _made_of(m=1, s=-2)),
    "min": (60.0, _made_of(s=1)),
    "h": (3600.0, _made_of(s=1)),
}
PREFIXES: Final = {"k": 1e3, "M": 1e6, "G": 1e9, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9}
#: The order in which symbols are written; others follow.
ORDER: Final = ("kg", "N", "J", "W", "Pa", "m", "rad")
_SYMBOL = re.compile(r"([^\W\d_]\w*)(?:\^(-?\d+|\(-?\d+/\d+\)))?")

#: Functions by their effect on units; those of ``ALIKE`` take terms of one unit.
ANGULAR = {"sin", "cos", "tan"}
PURE = {"exp", "log", "sign", "sinh", "cosh", "tanh", "and", "or", "not"}
COMPARISONS = {"<", "<=", ">", ">=", "==", "!="}
SAME = {"neg", "abs", "floor", "norm"}
ALIKE = {"+", "-", "%", "mod", "hypot", "minimum", "maximum", "where", "atan2"} | COMPARISONS


class UnitError(ValueError):
    """Terms with unlike units are added or compared."""


class Unit(NamedTuple):
    """A unit as an expression carries it.

    Attributes:
        powers: symbol -> exponent; None where the unit is not known.
        factor: product of the bare numbers that the value was multiplied by.
        exact: False where a bare number, which may have any unit, takes part.
        counted: True where the value was divided by a constant such as deg: how many there are.
    """

    powers: Powers | None = None
    factor: float = 1.0
    exact: bool = False
    counted: bool = False

    @property
    def known(self) -> Powers | None:
        """The powers, where bare factors leave the unit as it is."""
        return self.powers if _is_ratio(self.factor) else None


class Number(float):
    """A number in SI units that has a unit: a constant, or what is computed from constants."""

    unit: Unit

    def __new__(cls, value: float, unit: Unit) -> "Number":
        """A number with its unit."""
        number = super().__new__(cls, value)
        number.unit = unit
        return number

    def __getnewargs__(self) -> tuple[float, Unit]:  # type: ignore[override]
        return float(self), self.unit


#: What an expression carries: bare numbers have no unit.
Carried = Unit | float
UNKNOWN, PLAIN, ANGLE = Unit(), Unit({}), Unit(_made_of(rad=1), exact=True)


def constant(symbol: str) -> Number:
    """The constant of a symbol: its size, with the SI unit of its dimensions."""
    size, dimensions = _size({symbol: Fraction(1)})
    powers = {"rad": Fraction(1)} if symbol in ("deg", "rpm") else {}
    return Number(size, Unit({**powers, **dimensions}, exact=True))


def unit_of(text: str, *, exact: bool = True) -> Unit:
    """The unit that a text names; one that cannot be read is a symbol of its own."""
    if text == BY_ROW:
        return Unit({BY_ROW: Fraction(1)})
    return Unit(_parsed(text), exact=exact) if text else UNKNOWN


def text_of(unit: Carried) -> str:
    """The unit of a value as text; "" where it is not known."""
    unit = _unit(unit)
    return ONE if isinstance(unit, float) else _text(unit.known)


def unit_of_call(word: str, *arguments: Carried) -> Carried:
    """The unit of a call from those of its arguments.

    Raises:
        UnitError: it adds or compares unlike units.
    """
    units = [_unit(argument) for argument in arguments]
    first = units[0]
    if word in ALIKE:
        alike = _alike(word, units[1:] if word == "where" else units)
        return PLAIN if word in COMPARISONS else ANGLE if word == "atan2" else alike
    if word in SAME:
        return first
    if word in PURE:
        return PLAIN
    if word in ANGULAR:
        is_other = isinstance(first, Unit) and first.exact and set(first.known or {}) - {"rad"}
        return UNKNOWN if is_other else PLAIN
    if word in ("asin", "acos", "atan"):
        return ANGLE
    if word == "sqrt":
        return _power(first, 0.5)
    if word == "**":
        return _power(first, units[1])
    second = _power(units[1], -1.0) if word == "/" else units[1]
    if {float, Number} == {type(argument) for argument in arguments}:
        return first if isinstance(first, Unit) else second  # how many of a unit
    product = _product(first, second)
    if word == "/" and isinstance(arguments[1], Number) and isinstance(product, Unit):
        return product._replace(counted=True)
    return product


def number_of_call(value: float, word: str, *arguments: float) -> float:
    """The value of a call of numbers, with its unit where one of them has a unit."""
    if not any(isinstance(argument, Number) for argument in arguments):
        return value
    unit = unit_of_call(word, *arguments)
    return Number(value, unit) if isinstance(unit, Unit) and unit.powers else value


def contradiction(declared: str, unit: Carried) -> str:
    """The fault of a declared unit, where the value surely has another one; "" for none."""
    unit = _unit(unit)
    if isinstance(unit, float) or not unit.exact or unit.counted or not unit.known:
        return ""
    powers = _parsed(declared)
    counts_cycles = "rad" in unit.known and any(symbol.endswith("Hz") for symbol in powers)
    is_strange = bool(set(_size(powers)[1]) - {"m", "s", "kg"})
    if is_strange or (_is_like(powers, unit.known) and not counts_cycles):
        return ""
    return f"is declared in {declared}, and its value is in {_text(unit.known)}"


def _unit(argument: Carried) -> Carried:
    return argument.unit if isinstance(argument, Number) else argument


def _is_ratio(factor: float) -> bool:
    """True for a simple fraction of one, one, and two, to rounding."""
    if not 0.0 < factor < 2.5:
        return False
    ratio = Fraction(factor).limit_denominator(LARGEST)
    return (ratio <= 1 or ratio == 2) and math.isclose(ratio, factor, rel_tol=1e-12)


def _is_like(one: Powers, other: Powers) -> bool:
    """True where units have the same dimensions and the same size."""
    (size, dimensions), (other_size, other_dimensions) = _size(one), _size(other)
    return dimensions == other_dimensions and math.isclose(size, other_size)


def _alike(word: str, units: Sequence[Carried]) -> Unit:
    """The common unit of terms, of which bare numbers take any."""
    terms = [unit for unit in units if isinstance(unit, Unit)]
    if not terms:
        return PLAIN
    exact = [unit.known for unit in terms if unit.exact and unit.known is not None]
    for powers in exact[1:]:
        if not _is_like(exact[0], powers):
            raise UnitError(
                f"'{word}' of {_text(exact[0])} and {_text(powers)}, which are unlike units: "
                "convert one of them, or divide each by what it is measured in (deg, rpm, mm, g0)"
            )
    first = terms[0].known
    if first is None or any(unit.known is None for unit in terms):
        return UNKNOWN
    others = [unit.known or {} for unit in terms]
    same_angle = all(powers.get("rad") == first.get("rad") for powers in others)
    if not same_angle or not all(_is_like(first, powers) for powers in others):
        return UNKNOWN
    return Unit(first, exact=all(unit.exact for unit in terms))


def _product(one: Carried, other: Carried) -> Carried:
    if isinstance(one, float):
        if isinstance(other, float):
            return one * other
        one, other = other, one
    if isinstance(other, float):
        return one._replace(factor=one.factor * (abs(other) or 1.0), exact=False)
    if one.powers is None or other.powers is None:
        return UNKNOWN
    powers = {symbol: one.powers.get(symbol, Fraction(0)) + other.powers.get(symbol, Fraction(0))
              for symbol in (*one.powers, *other.powers)}  # fmt: skip
    if BY_ROW in powers and one.powers and other.powers:
        return UNKNOWN
    if not set(powers) <= {"rad", "s"}:  # the length of an arc, the power of a moment
        powers.pop("rad", None)
    powers = {symbol: power for symbol, power in powers.items() if power}
    return Unit(powers, one.factor * other.factor, one.exact and other.exact,
                one.counted or other.counted)  # fmt: skip


def _power(base: Carried, exponent: Carried) -> Carried:
    if not isinstance(exponent, float):
        return PLAIN if isinstance(base, float) or base.powers == {} else UNKNOWN
    if isinstance(base, float):
        return float(abs(base) ** exponent) if base else PLAIN
    power = Fraction(exponent).limit_denominator(100)
    if base.powers is None or BY_ROW in base.powers or not math.isclose(power, exponent):
        return UNKNOWN
    try:
        factor = base.factor**exponent
    except (OverflowError, ZeroDivisionError):
        return UNKNOWN
    powers = {symbol: one * power for symbol, one in base.powers.items() if power}
    return base._replace(powers=powers, factor=factor)


def _parsed(text: str) -> Powers:
    """Powers of a text such as ``N m/rad``, ``m^3/(s Pa)``, ``1/s``."""
    above, _, below = text.strip().partition("/")
    parts = (above, 1), (below.strip().removeprefix("(").removesuffix(")"), -1)
    powers: dict[str, Fraction] = {}
    for part, sign in parts:
        for word in part.replace("*", " ").split():
            match = _SYMBOL.fullmatch(word)
            if match:
                power = sign * Fraction((match[2] or "1").strip("()"))
                powers[match[1]] = powers.get(match[1], Fraction(0)) + power
            elif word != ONE:
                return {text: Fraction(1)}
    return {symbol: power for symbol, power in powers.items() if power}


def _text(powers: Powers | None) -> str:
    if powers is None:
        return NONE
    places = {symbol: k for k, symbol in enumerate(ORDER)}
    ordered = sorted(powers, key=lambda symbol: (places.get(symbol, len(places)), symbol))
    above = " ".join(_factor(s, powers[s]) for s in ordered if powers[s] > 0)
    below = [_factor(s, -powers[s]) for s in ordered if powers[s] < 0]
    if not below:
        return above or ONE
    return f"{above or ONE}/" + (below[0] if len(below) == 1 else f"({' '.join(below)})")


def _factor(symbol: str, power: Fraction) -> str:
    if power == 1:
        return symbol
    return f"{symbol}^{power}" if power.denominator == 1 else f"{symbol}^({power})"


def _size(powers: Powers) -> tuple[float, Powers]:
    """Size in SI units, and dimensions; a symbol that is not known is a dimension of its own."""
    size, dimensions = 1.0, dict[str, Fraction]()
    for symbol, power in powers.items():
        scale, parts = _of_symbol(symbol)
        size *= scale ** float(power)
        for one, exponent in parts.items():
            dimensions[one] = dimensions.get(one, Fraction(0)) + exponent * power
    return size, {one: exponent for one, exponent in dimensions.items() if exponent}


def _of_symbol(symbol: str) -> tuple[float, Powers]:
    prefix, tail = symbol[:1], symbol[1:]
    if symbol not in SYMBOLS and prefix in PREFIXES and tail in SYMBOLS:
        return PREFIXES[prefix] * SYMBOLS[tail][0], SYMBOLS[tail][1]
    return SYMBOLS.get(symbol, (1.0, {symbol: Fraction(1)}))
