"""Formulas as MathML, which browsers draw themselves: no script, no network, no LaTeX."""

import re
import unicodedata
from html import unescape
from typing import Any

#: A letter of a variant. Browsers ignore the attribute; letters of their own they draw.
STYLED = re.compile(r'<m([in]) mathvariant="(bold|bold-italic)">(.|&#x\w+;)</m[in]>')


def mathml(formula: str, display: str) -> str:
    """A formula of LaTeX as MathML.

    Args:
        formula: without dollars.
        display: ``inline`` or ``block``.

    Raises:
        ValueError: it holds a command or an environment that is not understood.
    """
    from latex2mathml.converter import convert

    found = STYLED.sub(_letter, convert(formula, display=display))
    if "\\" in found or "&amp;" in found:
        raise ValueError(f"a formula is not understood: {formula}")
    return found


def _letter(match: re.Match[str]) -> str:
    tag, variant, letter = match.groups()
    name = re.sub("LATIN |GREEK |LETTER ", "", unicodedata.name(unescape(letter)))
    styled = f"MATHEMATICAL {variant.replace('-', ' ').upper()} {name}"
    return f"<m{tag}>{unicodedata.lookup(styled)}</m{tag}>"


def inline(visitor: Any, node: Any) -> None:
    """Write a formula within a line."""
    _write(visitor, node, "{}", "inline")


def block(visitor: Any, node: Any) -> None:
    """Write a formula of its own."""
    _write(visitor, node, '<div class="math">{}</div>', "block")


def _write(visitor: Any, node: Any, around: str, display: str) -> None:
    from docutils.nodes import SkipNode

    visitor.body.append(around.format(mathml(node.astext(), display)))
    raise SkipNode
