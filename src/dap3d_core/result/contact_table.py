"""Contacts as a table, a row for each point that pushes at a reported instant."""

from typing import TYPE_CHECKING, Any, Self

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.result.errors import unknown
from dap3d_core.scene.coerce import canonical

if TYPE_CHECKING:
    import xarray

#: Attribute -> dimensions, unit, meaning; in files with ``contact_`` before the name.
FIELDS = {
    "t": (("contact",), "s", "instant of the report"),
    "pair": (("contact", "side"), "1", "shapes i and j, places in contact_shape"),
    "mode": (("contact",), "1", "1 slides, 2 sticks"),
    "gap": (("contact",), "m", "distance of both surfaces, of shapes as the step began"),
    "point": (
        ("contact", "axis"),
        "m",
        "of contact, of shapes halfway between both surfaces as the step began",
    ),
    "normal": (("contact", "axis"), "1", "unit vector from j to i"),
    "force": (("contact", "axis"), "N", "on i, of shapes the mean of the step that ends at t"),
}
#: Columns of rows as integrations collect them.
WIDTH = 14


@attrs.frozen(eq=False, repr=False)
class ContactTable:
    """Contacts, k of them, by rising instants; global axes.

    Of shapes that collide a row has means and places of the step that ends at its instant; of
    declared contacts what holds there.

    Attributes:
        names: of the shapes of the scene that collide; then ``ground`` and the bodies, where there
            are declared contacts.
        t: (k,) s, one of the reported instants.
        pair: (k, 2) shapes or bodies i and j, places in ``names``.
        mode: (k,) 1 slides, 2 sticks.
        gap: (k,) m, of shapes as the step that ends at t began.
        point: (k, 3) m, of shapes halfway between both surfaces then.
        normal: (k, 3) unit vectors from j to i.
        force: (k, 3) N on i, of shapes the mean of that step.
    """

    names: tuple[str, ...]
    t: Floats
    pair: Integers
    mode: Integers
    gap: Floats
    point: Floats
    normal: Floats
    force: Floats

    @classmethod
    def of_rows(cls, names: tuple[str, ...], rows: Floats) -> Self:
        """The table of rows (k, WIDTH): t, i, j, mode, gap, point, normal, force."""
        pair, mode = rows[:, 1:3].astype(np.int64), rows[:, 3].astype(np.int64)
        parts = rows[:, 4], rows[:, 5:8], rows[:, 8:11], rows[:, 11:]
        return cls(names, rows[:, 0], pair, mode, *parts)

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return f"<ContactTable: {len(self)} contacts of {len(self.names)} shapes and bodies>"

    def __eq__(self, other: object) -> bool:
        same = isinstance(other, ContactTable) and self.names == other.names
        return same and all(np.array_equal(getattr(self, n), getattr(other, n)) for n in FIELDS)

    __hash__ = None  # type: ignore[assignment]

    def of(self, shape: str, other: str | None = None) -> "ContactTable":
        """The rows of a shape or body, or of a pair, with it as i: normal and force on it.

        Raises:
            UnknownNameError: there is no such shape that collides.
        """
        places = []
        for name in (shape,) if other is None else (shape, other):
            if canonical(name) not in self.names:
                raise unknown("shape", name, self.names)
            places.append([k for k, one in enumerate(self.names) if one == canonical(name)])
        found = self._part(np.all([np.isin(self.pair, k).any(axis=1) for k in places], axis=0))
        turned = ~np.isin(found.pair[:, 0], places[0])
        sign = np.where(turned, -1.0, 1.0)[:, None]
        pair = np.where(turned[:, None], found.pair[:, ::-1], found.pair)
        return attrs.evolve(found, pair=pair, normal=sign * found.normal, force=sign * found.force)

    def at(self, t: Floats) -> "ContactTable":
        """The rows of some of the reported instants."""
        return self._part(np.isin(self.t, t))

    def joined(self, other: "ContactTable") -> "ContactTable":
        """The rows of both, by rising instants."""
        if not self.names:
            return other
        parts = {n: np.concatenate([getattr(self, n), getattr(other, n)]) for n in FIELDS}
        parts["pair"][len(self) :] += len(self.names)
        names = (*self.names, *other.names)
        return ContactTable(names, **parts)._part(np.argsort(parts["t"], kind="stable"))

    def _part(self, chosen: Any) -> "ContactTable":
        return attrs.evolve(self, **{name: getattr(self, name)[chosen] for name in FIELDS})

    def to_xarray(self) -> "xarray.Dataset":
        """The table with dimensions contact, side, axis, and names of shapes."""
        import xarray

        variables = {
            name: (dimensions, getattr(self, name), {"units": unit, "long_name": meaning})
            for name, (dimensions, unit, meaning) in FIELDS.items()
        }
        of = np.array(self.names, dtype=str)[self.pair]
        axes = {"axis": list("xyz"), "shapes": (("contact", "side"), of)}
        return xarray.Dataset(variables, axes)


def no_contacts() -> ContactTable:
    """The table of a run without shapes that collide."""
    return ContactTable.of_rows((), np.zeros((0, WIDTH)))
