"""The user's force, user_force.m: shown, with a stub of a plugin in place of a translation."""

import re
from typing import Any

from dap3d_core.interface.formats import Place
from dap3d_core.scene import MISSING, Mistake, Scene
from dap3d_matlab.files.report import remark
from dap3d_matlab.language.structures import USER_FORCE_FILE
from dap3d_matlab.translate.fields import Fields, name_of

#: The keyword of the force type that the stub makes; the manual's word.
KEYWORD = "user"
SLOTS = ("i", "j", "k")

_BODY = re.compile(r"\bBodies\s*\(\s*([^()]*?)\s*\)")
_COMMENT = re.compile(r"^\s*%.*$|%.*$", re.MULTILINE)

_STUB = '''"""The force of {file}, to be written here.

The scene names its type "{keyword}"; {slots}.
A run loads this file with --allow-code alone.
"""

from dap3d_core.interface import (
    Body,
    Force,
    body,
    hookimpl,
)
from dap3d_core.kernels import where

interface_version = 1

# What it says in MATLAB:
#
{text}


class UserForce(Force):
    """What {file} adds to the bodies."""

    keyword = "{keyword}"
{fields}

    def wrench({parameters}, t):
        # r_i, v_i: position and velocity of body i
        # A_i, w_i: its rotation, angular velocity
        # A branch is written where(condition, a, b).
        raise NotImplementedError("write it here")
        # for each body: force, moment about its
        # mass centre, all in ground axes
        return ({pairs})


@hookimpl
def dap3d_forces():
    """Return the force types of this file."""
    return [UserForce]
'''


def add_user_forces(scene: Scene, fields: Fields) -> None:
    """Give the forces of type user the bodies that the file uses, and write the stub."""
    forces = [f for f in scene.forces.values() if f.type == KEYWORD]
    source, report = fields.model.user_force, fields.report
    if source is None:
        for force in forces:
            place = fields.places[f"forces.{force.name}"]
            what = f"a force of type {KEYWORD} needs the file {USER_FORCE_FILE}, which is not there"
            mistake = Mistake(force.name, MISSING, what, file=place.file, line=place.line)
            fields.model.mistakes.append(mistake)
        return
    place = Place(str(source.path))
    if not forces:
        report.unused.append(remark(place, f"no force is of type {KEYWORD}: not used"))
        return
    report.user_force = source.text
    slots = _bodies_in(source.text, fields, place)
    for force in forces:
        force.fields.update({f"body_{slot}": body for slot, body in slots.items()})
    report.stub = _stub(source.text, slots)


def _bodies_in(text: str, fields: Fields, place: Place) -> dict[str, str]:
    """Slot -> name of the body, for the bodies that the text uses by number."""
    words = [m[1] for m in _BODY.finditer(_COMMENT.sub("", text))]
    numbers = sorted({int(w) for w in words if w.isascii() and w.isdigit() and len(w) < 10})
    bodies = fields.model.arrays["Bodies"]
    if bodies is not None:
        for k in (k for k in numbers if not 1 <= k <= len(bodies)):
            what = f"Bodies({k}): there is no body {k}; Bodies has {len(bodies)}"
            fields.model.mistakes.append(Mistake("", MISSING, what, file=place.file))
    is_computed = any(not (w.isascii() and w.isdigit()) for w in words)
    if is_computed or not 1 <= len(numbers) <= len(SLOTS):
        what = "by numbers that are worked out" if is_computed else f"{len(numbers)} in number"
        text = (
            f"it speaks of bodies {what}; a force type has one to three bodies. The stub has the "
            "first ones: write a force type, and an element of it in the scene, for the others"
        )
        fields.report.unused.append(remark(place, text))
    names = [name_of("Bodies", k) for k in (numbers or [1])]
    return dict(zip(SLOTS, names, strict=False))


def _stub(text: str, slots: dict[str, str]) -> str:
    """The text of a ``plugin.py`` with a stub of the force."""
    names = [f"r_{s}, v_{s}" for s in slots]
    pairs = "".join("((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), " for _ in slots).rstrip()
    of = ", ".join(f"body_{s} is {body}" for s, body in slots.items())
    values: dict[str, Any] = {
        "file": USER_FORCE_FILE,
        "keyword": KEYWORD,
        "slots": of,
        "text": "\n".join(f"#     {line}".rstrip() for line in text.rstrip().split("\n")),
        "fields": "\n".join(
            f'    body_{s}: Body = body(doc="{body} in the scene")' for s, body in slots.items()
        ),
        "parameters": ", ".join(names),
        "pairs": pairs,
    }
    return _STUB.format(**values)
