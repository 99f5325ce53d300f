"""Types of what resists rolling and spinning at a contact: moments that its normal force bounds.

Each is friction without a gap (loaded.py), of how body i turns over body j: across the normal, with
two rows, or along it, with one. It holds up to a length times the normal force, and turns at it.
"""

from functools import cache
from typing import Any

#: Endings of the names of contacts that resist -> field of the length, and what is resisted.
RESISTED = {"roll": ("mu_roll", "rolling"), "spin": ("mu_spin", "spinning")}
#: What contacts declare that what resists at them has no use for.
_UNUSED = ("gap", "at", "reach", "grip", "grain", "along", "C")


def resist(mu_roll, mu_spin):  # type: ignore[no-untyped-def]
    """The lengths of a material."""
    return mu_roll, mu_spin


@cache
def resisting_type(contact: Any, how: str) -> Any:
    """The type of what resists at a type of contact; how: "roll" or "spin"."""
    body: dict[str, Any] = dict.fromkeys(_UNUSED)
    body |= {
        "__module__": contact.__module__,
        "__doc__": f"What resists {RESISTED[how][1]} at a {contact.keyword}.",
        "keyword": f"{contact.keyword}_{how}",
        "load": (0,),
        "resists": how,
        "resist": contact.resist or resist,
        "variants": (),
    }
    if how == "spin":
        body |= {"along": contact.normal, "normal": None}
    return type(f"{contact.__name__}_{how}", (contact,), body)
