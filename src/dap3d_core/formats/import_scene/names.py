"""Names of a file as names of a scene."""

import attrs

from dap3d_core.interface.formats.remarks import Place, Remarks
from dap3d_core.scene.tables import fault_of_name


@attrs.define
class Names:
    """The names taken in each table of a scene.

    Attributes:
        taken: table -> names.
        scene_names: (table, name in the file) -> name in the scene.
        places: (table, name in the scene) -> its place in the file.
    """

    taken: dict[str, set[str]] = attrs.Factory(dict)
    scene_names: dict[tuple[str, str], str] = attrs.Factory(dict)
    places: dict[tuple[str, str], Place] = attrs.Factory(dict)

    def of(self, table: str, name: str, place: Place, remarks: Remarks) -> str:
        """A name that the scene can have: the same one, or one made of it, which is remarked."""
        good = self.free(table, name)
        self.scene_names[table, name], self.places[table, good] = good, place
        if good != name:
            remarks.translate(place, f"{name!r} is called {good!r} in the scene")
        return good

    def free(self, table: str, name: str) -> str:
        """A name that the scene can have, or the first of NAME_2, ... that is free: it is taken."""
        taken, name = self.taken.setdefault(table, set()), usable(name)
        number, candidate = 1, name
        while candidate in taken:
            number += 1
            candidate = f"{name}_{number}"
        taken.add(candidate)
        return candidate


def usable(name: str) -> str:
    """A name that a scene can have: the same one, or one made of it."""
    good = "".join(c if c.isprintable() and c != "." else "_" for c in name.strip()) or "unnamed"
    return f"{good}_" if fault_of_name(good) else good
