"""Reference of file formats: what becomes of each element and attribute."""

from collections.abc import Iterator, Mapping

from dap3d_formats.element_table import Table, Word
from dap3d_formats.mjcf.elements import MJCF
from dap3d_formats.sdf.elements import SDF
from dap3d_formats.urdf.elements import URDF
from dap3d_site.markdown import code, page, table

TABLES: Mapping[str, Table] = {"URDF": URDF, "SDF": SDF, "MJCF": MJCF}


def pages() -> Iterator[tuple[str, str]]:
    """The page of file formats: (path, text)."""
    yield "reference/formats.md", page("Elements of URDF, SDF and MJCF", *_formats())


def _formats() -> Iterator[str]:
    yield (
        "What `dap3d import` makes of each element and attribute ([how](../how-to/robots.md)): "
        "*taken*, *translated* into something else, *noted* in the report and left out, or "
        "*refused*; the report begins with what changes the motion. An element that is noted is "
        "left out with all that it holds. Elements and "
        "attributes that are not listed are noted as unknown."
    )
    for title, elements in TABLES.items():
        yield f"## {title}"
        yield table(("element", "attribute", "", "how, or why"), _rows(elements))


def _rows(elements: Table) -> Iterator[tuple[str, str, str, str]]:
    """A row for each element, and one for its attributes of the same kind."""
    for name, attributes in elements.items():
        state, words = attributes.get("", ("taken", ""))
        yield code(name), "", state, words
        alike: dict[Word, list[str]] = {}
        for attribute, word in attributes.items():
            if attribute:
                alike.setdefault(word, []).append(attribute)
        for (state, words), names in alike.items():
            yield code(name), ", ".join(map(code, names)), state, words
