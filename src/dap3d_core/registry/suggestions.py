"""Names in messages: the nearest right spelling of one that is wrong, the first of many."""

from bisect import bisect_left
from collections.abc import Collection, Sequence
from difflib import get_close_matches
from functools import lru_cache
from typing import Any, NamedTuple

#: Number of words up to which all are compared; of more, this many neighbours in either order.
MANY_WORDS, NEIGHBOURS = 200, 25
#: Names that a message lists, as a rule.
MOST_NAMES = 6
#: Nothing is similar to a longer word.
LONGEST = 80
#: Names in a scene -> what other programs and textbooks call them.
_OTHER_NAMES = {
    "Jp": "inertia moment_of_inertia moments_of_inertia inertia_tensor J I",
    "mass": "m",
    "r": "position pos xyz origin location x",
    "p": "orientation quaternion quat euler_parameters q rotation",
    "rpy": "euler euler_angles angles",
    "r_dot": "rd velocity vel v",
    "w": "angular_velocity angvel omega",
    "k": "stiffness spring_constant spring_rate",
    "c": "damping damping_coefficient",
    "l0": "free_length rest_length natural_length",
    "gravity": "g gravitational_acceleration",
    "body": "parent link",
    "sPp": "offset coordinates position pos xyz origin location r",
    "sp": "direction axis",
    "wgt": "direction",
    "teeth_i": "z_i N_i",
    "teeth_j": "z_j N_j",
    "name": "title",
    "type": "kind class",
    "scene": "title model header",
    "bodies": "links parts body link part",
    "points": "markers frames sites marker frame site",
    "joints": "constraints joint constraint",
    "forces": "gravity actuators springs force",
    "simulation": "solver options run settings integration",
    "parameters": "variables constants",
    "t_end": "duration end_time stop_time tend tfinal",
    "dt": "timestep time_step",
    "rtol": "tolerance tol reltol",
    "atol": "abstol",
}
_NAMES_OF_OTHER: dict[str, list[str]] = {}
for _name, _others in _OTHER_NAMES.items():
    for _other in _others.split():
        _NAMES_OF_OTHER.setdefault(_other.casefold(), []).append(_name.casefold())


class _Words(NamedTuple):
    """Words regardless of case, in order of their beginnings and, reversed, of their ends."""

    word_of: dict[str, str]
    forward: list[str]
    backward: list[str]


def nearest(word: Any, allowed: Collection[str]) -> str:
    """The allowed word most similar to ``word``, regardless of case; "" where none is similar.

    What other programs call an allowed word is similar to it: ``inertia`` to ``Jp``. So is an
    abbreviation: ``rev`` to ``revolute``.
    """
    if not isinstance(word, str) or not 0 < len(word) <= LONGEST:
        return ""
    wanted, words = word.casefold(), _sorted_words(tuple(allowed))
    if wanted in words.word_of:
        return words.word_of[wanted]
    for name in _NAMES_OF_OTHER.get(wanted, ()):
        if name in words.word_of:
            return words.word_of[name]
    forms = _alike(wanted, words) if len(words.word_of) > MANY_WORDS else list(words.word_of)
    near = [form for form in get_close_matches(wanted, forms) if _begin_alike(form, wanted)]
    near = near or sorted((f for f in forms if _abbreviates(f, wanted)), key=len)[-1:]
    return words.word_of[near[0]] if near else ""


def did_you_mean(
    word: Any, allowed: Collection[str], form: str = "{}", *, otherwise: str = ""
) -> str:
    """The question after the nearest allowed word, in a form such as "; {}", or ``otherwise``."""
    near = nearest(word, allowed)
    return form.format(f"did you mean {near!r}?") if near else otherwise


def some(names: Sequence[str], most: int = MOST_NAMES, between: str = ", ") -> str:
    """The first of several names, and the number of the others."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return between.join(names[:most]) + more


@lru_cache(maxsize=4)
def _sorted_words(allowed: tuple[str, ...]) -> _Words:
    """The words in order, cached: a scene may have many mistakes in references to many names."""
    word_of: dict[str, str] = {}
    for candidate in allowed:
        word_of.setdefault(candidate.casefold(), candidate)
    if len(word_of) <= MANY_WORDS:
        return _Words(word_of, [], [])
    return _Words(word_of, sorted(word_of), sorted(form[::-1] for form in word_of))


def _alike(wanted: str, words: _Words) -> list[str]:
    """The words with the longest beginnings, or the longest ends, in common with another."""
    forms = _neighbours(wanted, words.forward)
    forms += [form[::-1] for form in _neighbours(wanted[::-1], words.backward)]
    return list(dict.fromkeys(forms))


def _neighbours(wanted: str, ordered: list[str]) -> list[str]:
    at = bisect_left(ordered, wanted)
    return ordered[max(0, at - NEIGHBOURS) : at + NEIGHBOURS]


def _begin_alike(form: str, wanted: str) -> bool:
    """False of words that share no more than the letter of a body, such as ``z_i`` and ``P_i``."""
    if form[0] == wanted[0] or form[-2:] != wanted[-2:] or form[-2:-1] != "_":
        return True
    return bool(get_close_matches(wanted[:-2], [form[:-2]]))


def _abbreviates(form: str, wanted: str) -> bool:
    return min(len(form), len(wanted)) > 2 and (form.startswith(wanted) or wanted.startswith(form))
