"""Keyframes of MJCF: where joints, mocap bodies, activations and controls of a model start.

One of an attached model is of what was attached with it; the rest starts where the file draws it.
One of a file that attaches others may end before the numbers of these.
"""

from collections.abc import Iterator
from itertools import accumulate
from typing import Any

import attrs

from dap3d_core.interface.formats import FormatError, Frame, XmlElement
from dap3d_formats.axes import turn
from dap3d_formats.mjcf.document import ACTUATORS, Document
from dap3d_formats.mjcf.reader import MjcfReader

#: Kind of a joint -> its coordinates and its rates.
SIZES = {"free": (7, 6), "ball": (4, 3), "universal": (2, 2), "cylindrical": (2, 2)}


@attrs.frozen(eq=False)
class Keyframe:
    """A keyframe of a document.

    Attributes:
        reader: of the bodies, which have been read.
        element: the keyframe; None for none.
        kinds: joint -> its kind, in the order of the file, before equalities fix some.
    """

    reader: MjcfReader
    element: XmlElement | None
    kinds: dict[str, str]

    @classmethod
    def of(cls, reader: MjcfReader) -> "Keyframe":
        """The keyframe that the user names; the first of those without a name is 0, and so on.

        Raises:
            FormatError: there is none of that name.
        """
        document, joints = reader.document, reader.model.joints
        kinds = {name: joint.kind for name, joint in joints.items() if joint.kind != "fixed"}
        wanted, document.source.key = document.source.key, None
        keys = document.section("keyframe", "key")
        named = {key.get("name") or str(k): key for k, key in enumerate(keys)}
        if wanted is not None and wanted not in named:
            known = f"it has {', '.join(named)}" if named else "it has none"
            raise FormatError(f"there is no keyframe {wanted!r}", document.root.place, known)
        return cls(reader, None if wanted is None else named[wanted], kinds)

    def start(self) -> None:
        """Set where joints, and bodies that the user would move, start."""
        model = self.reader.model
        positions, rates = self._numbers("qpos", 0), self._numbers("qvel", 1)
        for name, kind in self.kinds.items():
            joint = model.joints[name]
            if joint.kind != kind:  # an equality fixes it
                continue
            if name in positions:
                q = positions[name][::-1] if kind == "cylindrical" else positions[name]
                scalar = kind not in SIZES
                joint.position = (q[0] - joint.reference,) if scalar else q
            if name in rates:
                joint.rate = rates[name][::-1] if kind == "cylindrical" else rates[name]
        mocap = {name: (3, 4) for name, scope in self.reader.mocap.items() if self._has(scope)}
        places, turns = (self._split(key, {name: sizes[k] for name, sizes in mocap.items()})
                         for k, key in enumerate(("mpos", "mquat")))  # fmt: skip
        for name in mocap:
            joint = next(one for one in model.joints.values() if one.child == name)
            A = joint.in_parent.A
            if name in turns and self.element is not None:
                A = turn(turns[name], self.element)
            joint.in_parent = Frame(places.get(name, joint.in_parent.r), A)

    def controls(self, elements: list[XmlElement], states: list[bool]) -> list[tuple[float, float]]:
        """Activation and control of actuators at the start, of those with a state the former."""
        mine = {k: 1 for k, element in enumerate(elements) if self._has(element.scope)}
        controls = self._split("ctrl", mine)
        activations = self._split("act", {k: 1 for k in mine if states[k]})
        return [(activations.get(k, (0.0,))[0], controls.get(k, (0.0,))[0])
                for k in range(len(elements))]  # fmt: skip

    def _numbers(self, key: str, which: int) -> dict[str, tuple[float, ...]]:
        """The numbers of each joint."""
        sizes = {name: SIZES.get(kind, (1, 1))[which] for name, kind in self.kinds.items()
                 if self._has(self.reader.joints[name])}  # fmt: skip
        return self._split(key, sizes)

    def _has(self, scope: str) -> bool:
        """True for what the keyframe has numbers of."""
        return self.element is not None and scope.startswith(self.element.scope)

    def _split(self, key: str, sizes: dict[Any, int]) -> dict[Any, tuple[float, ...]]:
        """The numbers of an attribute by what they belong to, none where it is not there.

        Raises:
            FormatError: there are more, or fewer where no model is attached.
        """
        if self.element is None or key not in self.element.attributes:
            return {}
        numbers, scope = self.element.numbers(key), self.element.scope
        ends = list(accumulate(sizes.values()))
        attaches = any(s != scope and self._has(s) for s in self.reader.document.settings)
        if not (attaches and len(numbers) in ends):
            numbers = self.element.numbers(key, sum(sizes.values()))
        return {
            name: numbers[end - size : end]
            for (name, size), end in zip(sizes.items(), ends, strict=True)
            if end <= len(numbers)
        }


def actuators_of(document: Document) -> list[XmlElement]:
    """All actuators, with the attributes of their classes."""
    actuators = [one for one in document.section("actuator") if one.name in ACTUATORS]
    return [document.settled(one, "main") for one in actuators]


def keys_of_part(model: Document, part: XmlElement, acting: list[XmlElement]) -> list[XmlElement]:
    """The keyframes of a model with the numbers of one body or frame, and of some actuators alone.

    Raises:
        FormatError: one has more numbers, or fewer where no model is attached to it.
    """
    root, document = model.root, XmlElement("body", {}, model.root.place)
    document.children = model.section("worldbody")
    held = list(_held(model, document, part, "main", within=False))
    joints = [(SIZES.get(kind, (1, 1)), at, inside) for kind, at, inside in held if kind != "mocap"]
    mocap = [(at, inside) for kind, at, inside in held if kind == "mocap"]
    motors = [(one, any(one is other for other in acting)) for one in model.section("actuator")
              if one.name in ACTUATORS]  # fmt: skip
    states = [(one, kept) for one, kept in motors
              if model.settled(one, "main").get("dyntype") != "none"]  # fmt: skip
    parts = {key: [(size[k], at, inside) for size, at, inside in joints]
             for k, key in enumerate(("qpos", "qvel"))}  # fmt: skip
    parts |= {key: [(size, *one) for one in mocap] for key, size in (("mpos", 3), ("mquat", 4))}
    parts |= {key: [(1, one.scope, kept) for one, kept in some]
              for key, some in (("ctrl", motors), ("act", states))}  # fmt: skip
    return [
        attrs.evolve(holder, children=[_part_of_key(model, key, parts) for key in holder])
        for holder in root.all("keyframe")
    ]


def _part_of_key(
    model: Document, key: XmlElement, parts: dict[str, list[tuple[int, str, bool]]]
) -> XmlElement:
    """A keyframe with a part of its numbers; parts: attribute -> sizes, scopes, what is kept."""
    attributes = dict(key.attributes)
    for name in parts.keys() & attributes.keys():
        mine = [(size, kept) for size, at, kept in parts[name] if at.startswith(key.scope)]
        words, total = attributes.pop(name).split(), sum(size for size, _ in mine)
        if len(words) > total or (len(words) < total and len(model.settings) == 1):
            key.numbers(name, total)
        held = [kept for size, kept in mine for _ in range(size)]
        if left := [word for word, kept in zip(words, held, strict=False) if kept]:
            attributes[name] = " ".join(left)
    return attrs.evolve(key, attributes=attributes)


def _held(
    model: Document, body: XmlElement, part: XmlElement, childclass: str, *, within: bool
) -> Iterator[tuple[str, str, bool]]:
    """Kinds and scopes of joints, and "mocap", in the order of keyframes; whether in a part."""
    for joints in (True, False):  # those of a body come before those below
        yield from _held_once(model, body, part, childclass, within, joints)


def _held_once(
    model: Document, holder: XmlElement, part: XmlElement, childclass: str, within: bool,
    joints: bool,
) -> Iterator[tuple[str, str, bool]]:  # fmt: skip
    for child in holder:
        inner = child.get("childclass") or childclass
        inside = within or child.children is part.children
        if child.name == "frame":
            yield from _held_once(model, child, part, inner, inside, joints)
        elif joints and child.name in ("joint", "freejoint"):
            kind = model.settled(child, childclass).get("type") or "hinge"
            yield "free" if child.name == "freejoint" else kind, child.scope, within
        elif not joints and child.name == "body":
            if child.get("mocap") == "true":
                yield "mocap", child.scope, inside
            yield from _held(model, child, part, inner, within=inside)
