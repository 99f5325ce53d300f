"""The nearest right spelling of a word that is wrong."""

from collections.abc import Collection
from difflib import get_close_matches
from typing import Any

#: Beyond this many words only those of similar length that begin alike are compared.
MANY_WORDS = 2000
#: Nothing is similar to a longer word.
LONGEST = 200


def nearest(word: Any, allowed: Collection[str]) -> str:
    """The allowed word most similar to ``word``, regardless of case; "" where none is similar.

    An abbreviation is similar to the word it stands for: ``rev`` to ``revolute``.
    """
    if not isinstance(word, str) or not 0 < len(word) <= LONGEST:
        return ""
    wanted = word.casefold()
    forms: dict[str, str] = {}
    few = len(allowed) <= MANY_WORDS
    for candidate in allowed:
        form = candidate.casefold()
        if few or (form[:1] == wanted[:1] and abs(len(form) - len(wanted)) <= 2):
            forms.setdefault(form, candidate)
    if wanted in forms:
        return forms[wanted]
    near = get_close_matches(wanted, list(forms)[:MANY_WORDS], 1)
    near = near or sorted((f for f in forms if _abbreviates(f, wanted)), key=len)[-1:]
    return forms[near[0]] if near else ""


def _abbreviates(form: str, wanted: str) -> bool:
    return min(len(form), len(wanted)) > 2 and (form.startswith(wanted) or wanted.startswith(form))
