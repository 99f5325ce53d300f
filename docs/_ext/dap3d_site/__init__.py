"""The parts of the site that no page says: references from the sources, models, formulas.

Sphinx reads a copy of ``docs`` (``staging.py``), so that what is generated lies beside it and never
in the repository. ``pages.py`` lists what is generated; each module writes the pages of one subject
as Markdown and imports nothing of Sphinx, so that tests can read them without a build.
"""

from pathlib import Path
from typing import Any

import dap3d_core.cli.app  # noqa: F401  the modules of the commands are loaded by way of it


def setup(app: Any) -> dict[str, Any]:
    """Register with Sphinx: the source folder is filled before anything is read."""
    from dap3d_site.docstrings import lists, signature
    from dap3d_site.formulas import block, inline
    from dap3d_site.staging import fill

    fill(Path(app.srcdir), Path(app.confdir).parent)
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", lists, priority=400)  # napoleon has 500
    app.connect("autodoc-process-signature", signature)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
