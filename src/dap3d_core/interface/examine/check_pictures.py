"""Check of what a type says about its picture."""

from collections.abc import Mapping

from dap3d_core.interface.codegen.instance_layout import InstanceLayout
from dap3d_core.interface.contacts.contact import SURFACES
from dap3d_core.interface.errors import PluginError, where_is
from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.types import SYMBOLS, TypeBase


def check_pictures(type_: type[TypeBase], layout: InstanceLayout) -> None:
    """Check the symbol of a type, and the surfaces of a contact.

    Raises:
        PluginError: there is no such picture, or the type lacks what it is drawn from.
    """
    surfaces: Mapping[str, str] = getattr(type_, "surfaces", {})
    for slot, kind in surfaces.items():
        declared = f"{where_is(type_)}: surfaces = {{{slot!r}: {kind!r}}}"
        if slot not in layout.slots or kind not in SURFACES:
            known = f"bodies are {', '.join(layout.slots)}, surfaces {', '.join(SURFACES)}"
            raise PluginError(f"{declared}: {known}")
        if lacking := [n for n in SURFACES[kind] if not {n, f"{n}_{slot}"} & {*layout.numbers}]:
            words = f"is drawn from {', '.join(lacking)}, which the type does not have"
            raise PluginError(f"{declared} {words}")
    if not type_.symbol:
        return
    who, symbol = where_is(type_), f"symbol = {type_.symbol!r}"
    if type_.symbol not in SYMBOLS:
        raise PluginError(f"{who}: {symbol} is not one of {', '.join(SYMBOLS)}")
    stored = {name: s.kind for name, s in specs_of(type_).items() if name in layout.numbers}
    offered = {*layout.slots, *stored, *stored.values()}
    if lacking := [name for name in SYMBOLS[type_.symbol] if name not in offered]:
        raise PluginError(
            f"{who}: {symbol} is drawn from {', '.join(lacking)}, which the type does not have; "
            'name another symbol, or leave "" to draw what it declares'
        )
