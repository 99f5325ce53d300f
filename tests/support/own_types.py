"""Types that a test makes for itself, without a package or a file for them."""

import dap3d_core as dap
from dap3d_core.registry import Registry
from support.internals import discovery


def registry_of(*types):
    """The installed types and these, as if a package brought them."""
    sources = {key: list(found) for key, found in dap.load_registry().sources.items()}
    for type_ in types:
        kind = "contact" if getattr(type_, "is_contact", False) else type_.kind
        key = (kind, type_.keyword)
        sources.setdefault(key, []).append(discovery.Source(*key, type_.__module__, type=type_))
    return Registry(sources)
