"""Continues an integration from arrays of a file, after a check of every number.

Compiled code checks no index. So of a file only what a run changes is taken, and only where it
lies in the range that is declared next to its definition (integration_state.py, adams.py,
radau/state.py); settings and constants are those of the integration that was set up anew.
"""

from collections.abc import Container, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.kernels.array_types import Floats, Integers

#: Arrays that the set-up gives, or that are found anew before each step.
GIVEN = ("times", "rows", "stops", "limits")


class Restorable:
    """Base of integrations: takes over the state of one that was saved.

    Attributes:
        work: as in ``Integration``.
    """

    work: Any

    def all_arrays(self) -> Iterator[tuple[str, Any]]:
        """Name and array of all that a run continues from, once its ``rows`` are taken.

        What ``functions`` keep in ``system`` is not among them.
        """
        return ((name, a) for name, a in self.work.walk() if name not in GIVEN)

    def restore(self, found: Mapping[str, Any]) -> None:
        """Continue from arrays of a file, which ``all_arrays`` of the same run once named.

        Raises:
            ValueError: they are of another model, or hold what no run can have; says which.
        """
        new = {name: self.restored(name, a, found.get(name)) for name, a in self.all_arrays()}
        integers, reals = self.scalars(new, "integer"), self.scalars(new, "real")
        allowed = self.allowed_integers(integers)
        for key, value in integers.items():
            if value not in allowed.get(key, range(at.MOST_COUNTED)):
                raise ValueError(f"{key} is {value}, which no run can have there")
        for key, (least, most) in at.allowed_reals(self.work).items():
            if not least <= reals[key] <= most:
                raise ValueError(f"{key} is {reals[key]:g}, which no run can have there")
        check_crossings(new["crossings"], integers["crossing_count"], self.work)
        if not np.isfinite(new["state"][at.Y]).all():
            raise ValueError("its state is not finite")
        noise = new["tolerance"][[at.NOISE, at.MOST]]
        if not (np.isfinite(noise) & (noise >= 0.0)).all():
            raise ValueError("tolerance: no rounding can be so large")
        for name, array in self.all_arrays():
            if array.flags.writeable:
                array[...] = new[name]

    def restored(self, name: str, array: Any, found: Any) -> Any:
        """The new contents of an array, given that of a file.

        Raises:
            ValueError: it is of another model.
        """
        own = {
            "real": self.indices("real", at.REAL_SETTINGS),
            "integer": self.indices("integer", at.INTEGER_SETTINGS),
            "switches": (at.DOES, at.BAND),
            "table": range(len(array)),
            "tolerance": (at.ABSOLUTE, at.KIND),
        }
        return restored(name, array, found, own.get(name, ()))

    def indices(self, array: str, names: Iterable[str]) -> list[int]:
        """Indices of scalars in an array of the state."""
        indices = type(self.work).indices(array)
        return [indices[name] for name in names]

    def scalars(self, arrays: Mapping[str, Any], array: str) -> dict[str, Any]:
        """The scalars in one of some arrays of a state, by name."""
        return {name: arrays[array][k].item() for name, k in type(self.work).indices(array).items()}

    def allowed_integers(self, found: Mapping[str, int]) -> dict[str, Container[int]]:
        """As ``integration_state.allowed_integers``."""
        return at.allowed_integers(self.work, found)


def check_alike(name: str, found: Any, array: Any) -> None:
    """ValueError unless an array of a file has the shape and kind of one of the model."""
    if found is None or found.shape != array.shape or found.dtype != array.dtype:
        raise ValueError(f"its scene gives another model here ({name})")


def restored(name: str, array: Any, found: Any, own: Iterable[Any] = ()) -> Any:
    """The new contents of an array: those of a file, except ``own`` items or rows, which it keeps.

    Raises:
        ValueError: the file's has another shape or kind; or these places are integers, and differ.
    """
    check_alike(name, found, array)
    new, places = found.copy(), list(own)
    if array.dtype.kind == "i" and not np.array_equal(found[places], array[places]):
        raise ValueError(f"its scene gives another model here ({name})")
    new[places] = array[places]
    return new


def check_crossings(crossings: Floats, count: int, work: Any) -> None:
    """ValueError for sign changes of switches that there are not, or outside of the run."""
    t, which, side = crossings[: min(count, at.LOGGED)].T
    switches, (first, last) = work.switches.shape[1], at.allowed_reals(work)["t"]
    good = (first <= t) & (t <= last) & np.isin(which, np.arange(switches)) & np.isin(side, (-1, 1))
    if not good.all() or (count and not switches):
        raise ValueError("crossings: no such sign change of a switch can be")


def check_pivots(name: str, pivots: Integers, sizes: Integers) -> None:
    """ValueError for row exchanges that leave their node, given its size for each row."""
    if not ((pivots >= 0) & (pivots < sizes)).all():
        raise ValueError(f"{name} exchange rows of different nodes")
