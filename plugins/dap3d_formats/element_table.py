"""What becomes of each element and attribute of a format: tables that readers and the docs share.

A table maps an element, ``parent/name`` where its meaning depends on its parent, to a word for
itself (key "") and for each attribute: TAKEN, or a pair of NOTED, MOVES, TRANSLATED or REFUSED and
the reason. What is NOTED or MOVES is left out, an element with all that it holds; without what
MOVES the motion is another. A key ``name=value`` is of an attribute with this value alone.
"""

from collections.abc import Mapping

from dap3d_core.interface.formats import FormatError, Remarks, XmlElement

TAKEN, TRANSLATED, NOTED, REFUSED = "taken", "translated", "noted", "refused"
MOVES = "noted, changes the motion"
#: The remark of an import without contacts, of shapes that touch others in the file.
NO_CONTACTS = "shapes that collide pass through each other; --contacts has them touch"

Word = tuple[str, str]
Table = Mapping[str, Mapping[str, Word]]


def taken(names: str = "", words: str = "") -> dict[str, Word]:
    """Attributes, or the element itself for "", that are taken as they are."""
    return dict.fromkeys(names.split() or [""], (TAKEN, words))


def translated(names: str, words: str) -> dict[str, Word]:
    """Attributes, or the element itself for "", that are said in another way."""
    return dict.fromkeys(names.split() or [""], (TRANSLATED, words))


def noted(names: str, words: str) -> dict[str, Word]:
    """Attributes, or the element itself for "", that are left out with a note."""
    return dict.fromkeys(names.split() or [""], (NOTED, words))


def moves(names: str, words: str) -> dict[str, Word]:
    """As ``noted``, of what changes the motion."""
    return dict.fromkeys(names.split() or [""], (MOVES, words))


def refused(names: str, words: str) -> dict[str, Word]:
    """Attributes, or the element itself for "", with which no model is imported."""
    return dict.fromkeys(names.split() or [""], (REFUSED, words))


def note_elements(root: XmlElement, table: Table, remarks: Remarks) -> None:
    """Remark what of a file is left out: what the table says so of, and what it does not know.

    Raises:
        FormatError: something is refused.
    """
    stack = [(root, "")]
    while stack:
        element, parent = stack.pop()
        key = f"{parent}/{element.name}" if f"{parent}/{element.name}" in table else element.name
        row = table.get(key)
        if row is None:
            remarks.leave_out(element.place, f"<{element.name}>: an unknown element")
            continue
        state, words = row.get("", (TAKEN, ""))
        if state == REFUSED:
            raise FormatError(f"<{element.name}>: {words}", element.place)
        if state in (NOTED, MOVES):
            text = f"<{element.name}>: {words}"
            remarks.leave_out(element.place, text, motion=state == MOVES)
            continue
        for name in element.attributes:
            _note(element, name, row, remarks)
        stack += [(child, element.name) for child in reversed(element.children)]


def _note(element: XmlElement, name: str, row: Mapping[str, Word], remarks: Remarks) -> None:
    if name.startswith("xmlns") or ":" in name:
        return
    usual = row.get(name, (NOTED, "an unknown attribute"))
    state, words = row.get(f"{name}={element.attributes[name].strip()}", usual)
    if state == REFUSED:
        raise FormatError(f"{name} of <{element.name}>: {words}", element.place)
    if state in (NOTED, MOVES):
        text = f"{name} of <{element.name}>: {words}"
        remarks.leave_out(element.place, text, motion=state == MOVES)
