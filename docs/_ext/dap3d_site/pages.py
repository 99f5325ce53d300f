"""All pages that are generated from the sources."""

from dap3d_site import commands, formats, interface, python, settings, types


def generated() -> dict[str, str]:
    """Path and text of every generated page; the models' pages are made by ``gallery.py``."""
    writers = (types, interface, formats, settings, commands, python)
    return {path: text for writer in writers for path, text in writer.pages()}
