"""Materials, and which shapes that collide meet each other."""

from collections.abc import Mapping
from typing import Any

import attrs

from dap3d_core.scene.coerce import plain

#: Coefficients that a pair of materials may have.
OF_PAIRS = ("mu", "e", "mu_roll", "mu_spin")


@attrs.define
class Material:
    """What surfaces do where they touch: its name, and fields of contacts.

    Attributes:
        name: its name in the scene.
        mu, mu_s: coefficients of friction of sliding and of sticking.
        mu_roll, mu_spin: moments against rolling and spinning over the force that presses, m.
        e, law: coefficient of restitution, and of whose law of impact.
        with_: of shapes that collide: name of another material -> fields of the pair (``with`` in
            scene files). Of pairs that are not named coefficients are geometric means.
    """

    name: str
    mu: Any = attrs.field(default=None, converter=plain)
    mu_roll: Any = attrs.field(default=None, converter=plain)
    mu_spin: Any = attrs.field(default=None, converter=plain)
    mu_s: Any = attrs.field(default=None, converter=plain)
    e: Any = attrs.field(default=None, converter=plain)
    law: Any = attrs.field(default=None, converter=plain)
    with_: Any = attrs.field(default=None, converter=plain)


@attrs.frozen
class Materials:
    """The materials of a scene, read (contacts/read_contacts.py).

    Attributes:
        by_name: name -> material, of numbers and words; None for what is not given, or wrong.
        pairs: two names in their order -> the coefficients that the pair has.
    """

    by_name: Mapping[str, Material] = attrs.Factory(dict)
    pairs: Mapping[tuple[str, ...], Mapping[str, float]] = attrs.Factory(dict)

    def pair(self, a: str, b: str) -> list[float]:
        """Those OF_PAIRS for two materials: of the pair, or else geometric means."""
        declared, found = self.pairs.get(tuple(sorted((a, b))), {}), []
        for name in OF_PAIRS:
            own = [getattr(self.by_name.get(m), name, None) or 0.0 for m in (a, b)]
            mean = own[0] if own[0] == own[1] else (own[0] * own[1]) ** 0.5
            found.append(declared.get(name, mean))
        return found


@attrs.define
class Collisions:
    """Which shapes that collide meet each other.

    Attributes:
        bodies: "all", or names of bodies, ``ground`` among them.
        exclude: pairs of names of bodies that do not meet; bodies of one joint
            never do, but ground.
        material: of shapes that name none.
    """

    bodies: Any = attrs.field(default="all", converter=plain)
    exclude: Any = attrs.field(default=(), converter=plain)
    material: Any = attrs.field(default=None, converter=plain)
