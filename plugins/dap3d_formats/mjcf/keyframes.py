"""Keyframes of MJCF: where joints, mocap bodies, activations and controls of a model start."""

import attrs

from dap3d_core.interface.formats import (
    Articulation,
    FormatError,
    Frame,
    XmlElement,
    from_quaternion,
)
from dap3d_formats.mjcf.document import ACTUATORS, Document

#: Kind of a joint -> its coordinates and its rates.
SIZES = {"free": (7, 6), "ball": (4, 3), "universal": (2, 2), "cylindrical": (2, 2)}


@attrs.frozen(eq=False)
class Keyframe:
    """A keyframe of a document.

    Attributes:
        element: the keyframe; None for none.
        kinds: joint -> its kind, in the order of the file, before equalities fix some.
    """

    element: XmlElement | None
    kinds: dict[str, str]

    @classmethod
    def of(cls, document: Document, model: Articulation) -> "Keyframe":
        """The keyframe that the user names; the first of those without a name is 0, and so on.

        Raises:
            FormatError: there is none of that name.
        """
        kinds = {name: joint.kind for name, joint in model.joints.items() if joint.kind != "fixed"}
        wanted, document.source.key = document.source.key, None
        keys = [key for holder in document.root.all("keyframe") for key in holder.all("key")]
        named = {key.get("name") or str(k): key for k, key in enumerate(keys)}
        if wanted is not None and wanted not in named:
            known = f"it has {', '.join(named)}" if named else "it has none"
            raise FormatError(f"there is no keyframe {wanted!r}", document.root.place, known)
        return cls(None if wanted is None else named[wanted], kinds)

    def start(self, model: Articulation, mocap: list[str]) -> None:
        """Set where joints, and bodies that the user would move, start."""
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
        places, turns = self._all("mpos", 3 * len(mocap)), self._all("mquat", 4 * len(mocap))
        for k, name in enumerate(mocap):
            joint = next(one for one in model.joints.values() if one.child == name)
            r = places[3 * k : 3 * k + 3] or joint.in_parent.r
            A = from_quaternion(turns[4 * k : 4 * k + 4]) if turns else joint.in_parent.A
            joint.in_parent = Frame(r, A)

    def controls(self, elements: list[XmlElement], states: list[bool]) -> list[tuple[float, float]]:
        """Activation and control of actuators at the start, of those with a state the former."""
        controls = self._all("ctrl", len(elements)) or (0.0,) * len(elements)
        left = iter(self._all("act", sum(states)) or (0.0,) * sum(states))
        return [(next(left) if state else 0.0, u)
                for state, u in zip(states, controls, strict=True)]  # fmt: skip

    def _numbers(self, key: str, which: int) -> dict[str, tuple[float, ...]]:
        """The numbers of each joint."""
        sizes = {name: SIZES.get(kind, (1, 1))[which] for name, kind in self.kinds.items()}
        numbers, found, at = self._all(key, sum(sizes.values())), {}, 0
        for name, size in sizes.items():
            if numbers:
                found[name] = numbers[at : at + size]
            at += size
        return found

    def _all(self, key: str, count: int) -> tuple[float, ...]:
        """All numbers of an attribute, or none where it is not there."""
        if self.element is None or key not in self.element.attributes:
            return ()
        return self.element.numbers(key, count)


def actuators_of(document: Document) -> list[XmlElement]:
    """All actuators, with the attributes of their classes."""
    holders = document.root.all("actuator")
    return [document.settled(one, "main") for holder in holders for one in holder
            if one.name in ACTUATORS]  # fmt: skip
