"""Values of MATLAB expressions: numbers, text, structures and arrays of these."""

from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.interface.formats import Place
from dap3d_matlab.language.structures import STRUCTURES, Default, Structure

#: A matrix of numbers; a single number is 1 x 1.
Numbers = NDArray[np.float64]
#: Maximal number of entries of a matrix.
LARGEST_MATRIX = 10_000


class Broken:
    """A value that is unknown because of a reported mistake."""


BROKEN = Broken()


@attrs.frozen(eq=False)
class GivenValue:
    """A value that a file gives to a field, and its place."""

    value: Any
    place: Place


@attrs.define(eq=False)
class Struct:
    """A structure such as ``Body_struct`` makes.

    Attributes:
        structure: its kind and fields.
        place: the place where it was made.
        variable: the last variable it was assigned to, for messages.
        given: the fields that the file gives.
    """

    structure: Structure
    place: Place
    variable: str
    given: dict[str, GivenValue] = attrs.field(factory=dict)

    def copy(self) -> "Struct":
        """A copy with separate fields, as MATLAB assigns structures."""
        return attrs.evolve(self, given=dict(self.given))

    def value(self, field: str) -> Any:
        """The given value of a field, or its default."""
        if field in self.given:
            return self.given[field].value
        return as_value(self.structure.default(field))

    def place_of(self, field: str) -> Place:
        """The place where a field was given, or where the structure was made."""
        return self.given[field].place if field in self.given else self.place


def as_value(default: Default) -> Any:
    """A default of a structure as a value of the language."""
    if isinstance(default, str):
        return default
    if isinstance(default, tuple):
        return np.array(default, dtype=np.float64) if default else np.zeros((0, 0))
    return np.array([[default]])


def make(kind: str, place: Place) -> Struct:
    """A structure with all defaults."""
    return Struct(STRUCTURES[kind], place, f"{kind}_struct")


def copied(value: Any) -> Any:
    """A deep copy of a value."""
    if isinstance(value, Struct):
        return value.copy()
    if isinstance(value, list):
        return [v if isinstance(v, Broken) else v.copy() for v in value]
    return value.copy() if isinstance(value, np.ndarray) else value


def as_array(value: Any) -> Any:
    """One structure, and no entries, as an array of structures; other values as they are."""
    if isinstance(value, Struct):
        return [value]
    return [] if isinstance(value, np.ndarray) and value.size == 0 else value


def size_of(value: Numbers) -> str:
    """The size of a matrix, for messages."""
    return f"{value.shape[0]}x{value.shape[1]}"


def kind_of(value: Any) -> str:
    """The kind of a value, for messages."""
    if isinstance(value, str):
        return "text"
    if isinstance(value, Struct):
        return f"a {value.structure.kind}_struct"
    if isinstance(value, list):
        return "an array of structures"
    if isinstance(value, np.ndarray):
        if value.size == 0:
            return "empty"
        return "a number" if value.size == 1 else f"a matrix of {size_of(value)}"
    return f"a {type(value).__name__}"


def plain_value(value: Any) -> Any:
    """A value in the form of messages."""
    if isinstance(value, np.ndarray):
        if value.size == 1:
            return shortened(float(value[0, 0]))
        if 1 in value.shape:
            return tuple(shortened(x) for x in value.ravel().tolist())
        return tuple(tuple(shortened(x) for x in row) for row in value.tolist())
    return value if isinstance(value, str) else kind_of(value)


def shortened(number: float) -> float | int:
    """An integer for a whole number: an index is 3, not 3.0."""
    return int(number) if number.is_integer() and abs(number) < 1e15 else number
