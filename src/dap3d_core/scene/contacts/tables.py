"""Materials, and how a script adds them and contacts."""

from typing import Any

import attrs

from dap3d_core.scene.coerce import plain


@attrs.define
class Material:
    """What surfaces do where they touch: its name, and fields of contacts.

    Attributes:
        name: its name in the scene.
        mu, mu_s: coefficients of friction of sliding and of sticking.
        e, law: coefficient of restitution, and of whose law of impact.
    """

    name: str
    mu: Any = attrs.field(default=None, converter=plain)
    mu_s: Any = attrs.field(default=None, converter=plain)
    e: Any = attrs.field(default=None, converter=plain)
    law: Any = attrs.field(default=None, converter=plain)


class ContactTables:
    """The part of a scene that takes materials and contacts."""

    __slots__ = ()

    def add_material(self, name: str, **fields: Any) -> str:
        """Add a material, fields that contacts take from it, and return its name.

        Args:
            name: without dots, not used by another material.
            fields: mu, mu_s, e, law, as in ``Material``.

        Raises:
            SceneError: the name is taken or illegal, or a key is unknown.
        """
        scene: Any = self
        return str(scene._add("materials", name, fields))

    def add_contact(self, type: str, name: str | None = None, **fields: Any) -> str:
        """Add a contact of a type (its keyword) and return its name, made from the type if None.

        Raises:
            SceneError: the name is taken or illegal. Fields are checked with the whole scene.
        """
        scene: Any = self
        return str(scene._add_element("contacts", type, name, fields))
