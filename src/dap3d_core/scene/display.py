"""Representation of a scene at a prompt and in a notebook."""

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

#: Maximal number of rows of a table in a notebook.
MOST_ROWS = 50
#: Parts of a scene that are counted: table, one, several.
COUNTED = (
    ("bodies", "body", "bodies"),
    ("points", "point", "points"),
    ("joints", "joint", "joints"),
    ("forces", "force", "forces"),
    ("functions", "function", "functions"),
    ("inputs", "input", "inputs"),
    ("shapes", "shape", "shapes"),
    ("contacts", "contact", "contacts"),
)


class SceneDisplay:
    """The representations of a scene; all text in them is escaped."""

    __slots__ = ()

    def __repr__(self) -> str:
        name: Any = getattr(self, "name", "")
        return f"<Scene {name!r}: {', '.join(self._counts_in_words())}>"

    def _repr_html_(self) -> str:
        """A table of bodies and one of elements, for notebooks."""
        scene: Any = self
        title = f"{scene.name or 'scene without a name'}: {', '.join(self._counts_in_words())}"
        bodies = [(b.name, b.mass, b.Jp, b.r) for b in scene.bodies.values()]
        elements = [
            (one, element.name, element.type, _fields(element.fields))
            for table, one, _ in COUNTED[2:]
            if table != "inputs"
            for element in getattr(scene, table).values()
        ]
        parts = [f"<p><strong>{escape(title)}</strong></p>"]
        if scene.description:
            parts.append(f"<p>{escape(str(scene.description))}</p>")
        if bodies:
            parts.append(html_table(("body", "mass [kg]", "Jp [kg m²]", "r [m]"), bodies))
        if elements:
            parts.append(html_table(("", "name", "type", "fields"), elements))
        return "".join(parts)

    def _counts_in_words(self) -> list[str]:
        counts = [(len(getattr(self, table)), one, many) for table, one, many in COUNTED]
        return [f"{n} {one if n == 1 else many}" for n, one, many in counts if n] or ["empty"]


def html_table(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """An HTML table, its texts escaped; of many rows the first, and the number of the others."""
    rows = list(rows)
    lines = [_row("th", header), *(_row("td", row) for row in rows[:MOST_ROWS])]
    if len(rows) > MOST_ROWS:
        lines.append(f'<tr><td colspan="{len(header)}">{len(rows) - MOST_ROWS} more</td></tr>')
    return f"<table>{''.join(lines)}</table>"


def _row(tag: str, cells: Iterable[Any]) -> str:
    return f"<tr>{''.join(f'<{tag}>{escape(_text(cell))}</{tag}>' for cell in cells)}</tr>"


def _text(value: Any) -> str:
    """A value for readers: numbers in six digits, None as ""."""
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        return ", ".join(_text(one) for one in value)
    return str(value)


def _fields(fields: dict[str, Any]) -> str:
    return ", ".join(f"{name} = {_text(value)}" for name, value in fields.items())
