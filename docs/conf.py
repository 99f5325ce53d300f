"""Sphinx: how the site is built. ``make docs`` does it."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))

project = "dap3d"
author = "the dap3d authors"
copyright = author
root_doc = "index"

extensions = [
    "dap3d_site",  # fills the source folder, so it comes first
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_*"]
smartquotes = False  # a prime is a prime, and -- an option

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
napoleon_numpy_docstring = False

sphinx_gallery_conf = {
    "examples_dirs": "_scripts",
    "gallery_dirs": "models",
    "filename_pattern": "",
    "copyfile_regex": "",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "capture_repr": ("_repr_html_",),
    "download_all_examples": False,
    "notebook_extensions": (),
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 3600,
    "write_computation_times": False,
}

html_theme = "furo"
html_title = "dap3d"
html_math_renderer = "mathml"
html_show_sphinx = False
html_copy_source = False
html_show_sourcelink = False
html_static_path = ["_static"]
html_css_files = ["site.css"]
