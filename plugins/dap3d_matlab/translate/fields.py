"""Reads fields of MATLAB structures as values of a scene; indices become names."""

import attrs
import numpy as np

from dap3d_core.interface.formats import Place
from dap3d_core.scene import MISSING, Mistake
from dap3d_matlab.files.model_folder import Model
from dap3d_matlab.files.report import ImportReport, remark
from dap3d_matlab.language.structures import DISKS, FILES
from dap3d_matlab.language.values import Broken, Struct, kind_of, plain_value

GROUND = "ground"
#: Array -> prefix of the names of its members in the scene, and their noun.
NAMES = {
    "Bodies": ("body", "body"),
    "Points": ("P", "point"),
    "Vectors1": ("V", "vector"),
    "Vectors2": ("d", "vector of type 2"),
    "Joints": ("J", "joint"),
    "Forces": ("F", "force"),
    "Functs": ("f", "function"),
    DISKS: ("disk", "disk"),
}
_FILE_OF = {f.arrays[0]: f.name for f in FILES} | {DISKS: "inJoints.m"}


def name_of(array: str, number: int) -> str:
    """The name in the scene of a member of an array, by its index from 1."""
    return f"{NAMES[array][0]}{number}"


@attrs.define
class Fields:
    """Reads the fields of the structures of a model; ``Model.mistakes`` collects mistakes.

    An invalid field gives None: the scene is then never used, because there is a mistake.

    Attributes:
        model: the content of the files.
        report: takes defaults, changes and omissions.
        places: place of each key of the scene, for mistakes of its check.
    """

    model: Model
    report: ImportReport
    places: dict[str, Place] = attrs.field(factory=dict)

    def refuse(
        self, struct: Struct, field: str, what: str, remedy: str = "", nearest: str = ""
    ) -> None:
        """Add a mistake at a field."""
        given = struct.given.get(field)
        value = MISSING if given is None else plain_value(given.value)
        place = struct.place_of(field)
        key = f"{struct.variable}.{field}"
        self.model.mistakes.append(
            Mistake(key, value, what, nearest, remedy, place.file, place.line)
        )

    def placed(self, key: str, struct: Struct, field: str = "") -> None:
        """Record the place of a key of the scene."""
        self.places[key] = struct.place_of(field)

    def defaulted(self, struct: Struct, words: str) -> None:
        """Report a default."""
        self.report.defaulted.append(remark(struct.place, f"{struct.variable}: {words}"))

    def changed(self, struct: Struct, field: str, words: str) -> None:
        """Report a converted value."""
        text = f"{struct.variable}.{field} {words}"
        self.report.changed.append(remark(struct.place_of(field), text))

    def left_out(self, struct: Struct, field: str, words: str) -> None:
        """Report a value that is left out."""
        text = f"{struct.variable}.{field} {words}"
        self.report.unused.append(remark(struct.place_of(field), text))

    # ---------------------------------------------------------------- values

    def number(self, struct: Struct, field: str) -> float | None:
        """One number."""
        found = self._numbers(struct, field, 1, "a number")
        return None if found is None else found[0]

    def vector(self, struct: Struct, field: str, count: int = 3) -> tuple[float, ...] | None:
        """A row or a column of numbers."""
        return self._numbers(struct, field, count, f"{count} numbers")

    def _numbers(
        self, struct: Struct, field: str, count: int, should_be: str
    ) -> tuple[float, ...] | None:
        value = struct.value(field)
        if isinstance(value, Broken):
            return None
        if isinstance(value, np.ndarray) and value.size == count and 1 in value.shape:
            return tuple(value.ravel().tolist())
        self.refuse(struct, field, f"should be {should_be}; it is {kind_of(value)}")
        return None

    def matrix(self, struct: Struct, field: str) -> tuple[tuple[float, ...], ...] | None:
        """A 3x3 matrix, or its nine numbers row by row."""
        value = struct.value(field)
        if isinstance(value, Broken):
            return None
        if not isinstance(value, np.ndarray) or value.size != 9:
            what = f"should be 3x3 numbers; it is {kind_of(value)}"
            remedy = "write diag([...]) for a diagonal matrix" if kind_of(value) != "text" else ""
            self.refuse(struct, field, what, remedy)
            return None
        if value.shape != (3, 3):
            self.changed(struct, field, "has nine numbers in line: they are read row by row")
        return tuple(tuple(row) for row in value.reshape(3, 3).tolist())

    def word(self, struct: Struct, field: str) -> str | None:
        """A word."""
        value = struct.value(field)
        if isinstance(value, str):
            return value
        if not isinstance(value, Broken):
            self.refuse(struct, field, f"should be text in quotes; it is {kind_of(value)}")
        return None

    def differs(self, struct: Struct, field: str) -> bool:
        """True if a field is given with another value than its default."""
        if field not in struct.given:
            return False
        value, default = struct.value(field), attrs.evolve(struct, given={}).value(field)
        if isinstance(value, np.ndarray) and isinstance(default, np.ndarray):
            return value.shape != default.shape or not np.array_equal(value, default)
        return bool(value != default) if isinstance(value, str) else True

    # ---------------------------------------------------------------- indices

    def index(self, struct: Struct, field: str, array: str) -> int | None:
        """The index of a member of an array, 0 for none; None where it is wrong."""
        number = self.number(struct, field)
        if number is None:
            return None
        noun = NAMES[array][1]
        if not number.is_integer() or number < 0.0:
            ground = " (0 is the ground)" if array == "Bodies" else ""
            self.refuse(struct, field, f"should be the number of a {noun}, from 1{ground}")
            return None
        members, k = self.model.arrays.get(array, []), int(number)
        if members is None:  # the file of the array has mistakes of its own
            return k
        if k <= len(members):
            return k
        file = _FILE_OF[array]
        what = f"there is no {noun} {k}; {array} has {len(members)}"
        if array in self.model.absent:
            what = f"there is no {noun} {k}, because there is no file {file}"
        elif not members:
            what = f"there is no {noun} {k}; {array} is empty"
        self.refuse(struct, field, what)
        return None

    def reference(self, struct: Struct, field: str, array: str, *, needed: bool) -> str | None:
        """The name of the member with an index; None where it is 0 or wrong."""
        k = self.index(struct, field, array)
        if k == 0 and needed:
            noun = NAMES[array][1]
            what = f"is required: the number of a {noun}, from 1"
            if array == "Bodies":
                what = "is required: the number of a moving body, from 1 (0 is the ground)"
            self.refuse(struct, field, what)
        return name_of(array, k) if k else None

    def body(self, struct: Struct, field: str = "Bindex") -> str | None:
        """The name of a body, ground for 0; None where it is wrong."""
        k = self.index(struct, field, "Bodies")
        return None if k is None else name_of("Bodies", k) if k else GROUND
