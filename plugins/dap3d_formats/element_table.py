"""What becomes of each element and attribute of a format: tables that readers and the docs share.

A table maps an element, ``parent/name`` where its meaning depends on its parent, to a word for
itself (key "") and for each attribute: TAKEN, or a pair of NOTED, MOVES, TRANSLATED or REFUSED and
the reason. What is NOTED or MOVES is left out, an element with all that it holds; without what
MOVES the motion is another. A key ``name=value`` is of an attribute with this value alone.
"""

from collections.abc import Callable, Mapping
from functools import partial

from dap3d_core.interface.formats import FormatError, Remarks, XmlElement

TAKEN, TRANSLATED, NOTED, REFUSED = "taken", "translated", "noted", "refused"
MOVES = "noted, changes the motion"
#: The remark of an import without contacts, of shapes that touch others in the file.
NO_CONTACTS = "shapes that collide pass through each other; --contacts has them touch"

Word = tuple[str, str]
Table = Mapping[str, Mapping[str, Word]]


def _row(state: str, names: str = "", words: str = "") -> dict[str, Word]:
    """The words for attributes, or for the element itself where there are no names."""
    return dict.fromkeys(names.split() or [""], (state, words))


taken = partial(_row, TAKEN)
translated = partial(_row, TRANSLATED)
noted = partial(_row, NOTED)
moves = partial(_row, MOVES)
refused = partial(_row, REFUSED)


def first_counts(*repeatable: str) -> Callable[[str, str], Word]:
    """The word for a further element, but for those that may be repeated."""

    def further(parent: str, name: str) -> Word:
        if name in repeatable:
            return TAKEN, ""
        return NOTED if parent in ("visual", "material") else MOVES, "the first counts"

    return further


def note_elements(
    root: XmlElement, table: Table, remarks: Remarks,
    further: Callable[[str, str], Word],
) -> None:  # fmt: skip
    """Remark what of a file is left out: what the table says so of, and what it does not know.

    Args:
        root: of the file.
        table: see above.
        remarks: is added to.
        further: the word for an element that its parent has another of before, by their names.

    Raises:
        FormatError: something is refused.
    """
    stack: list[tuple[XmlElement, XmlElement | None]] = [(root, None)]
    while stack:
        element, holder = stack.pop()
        parent = holder.name if holder else ""
        key = f"{parent}/{element.name}" if f"{parent}/{element.name}" in table else element.name
        row = table.get(key)
        if row is None:
            remarks.leave_out(element.place, f"<{element.name}>: an unknown element")
            continue
        if _is_left_out(row.get("", (TAKEN, "")), f"<{element.name}>", element, remarks):
            continue
        if holder is not None:  # a <geometry> holds one shape, whatever its name
            first = holder.children[0] if parent == "geometry" else holder.first(element.name)
        if holder is not None and first is not element:
            word = further(parent, element.name)
            if _is_left_out(word, f"a further <{element.name}> of <{parent}>", element, remarks):
                continue
        for name, value in element.attributes.items():
            if not name.startswith("xmlns") and ":" not in name:
                usual = row.get(name, (NOTED, "an unknown attribute"))
                word = row.get(f"{name}={value.strip()}", usual)
                _is_left_out(word, f"{name} of <{element.name}>", element, remarks)
        stack += [(child, element) for child in reversed(element.children)]


def _is_left_out(word: Word, label: str, element: XmlElement, remarks: Remarks) -> bool:
    """True, with a remark, for what is left out."""
    state, reason = word
    if state == REFUSED:
        raise FormatError(f"{label}: {reason}", element.place)
    left_out = state in (NOTED, MOVES)
    if left_out:
        remarks.leave_out(element.place, f"{label}: {reason}", motion=state == MOVES)
    return left_out
