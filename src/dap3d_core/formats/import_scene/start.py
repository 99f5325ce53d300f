"""Coordinates of joints where a scene starts: given, followed by coupled joints, within limits."""

from collections.abc import Mapping, Sequence
from math import atan2, cos, inf, sin

import attrs
import numpy as np

from dap3d_core.formats.import_scene.spanning_tree import SpanningTree
from dap3d_core.interface.formats.articulation import Articulation, Coupling, Joint, Limits
from dap3d_core.interface.formats.joint_motion import held, rest_coordinates
from dap3d_core.interface.formats.remarks import FormatError, Remarks

#: Kinds of joints with one coordinate, which may follow each other.
SCALAR = ("revolute", "prismatic")
#: Positions and rates of coupled joints that are given agree up to this.
AGREE = 1e-9

Given = Mapping[str, Sequence[float]]


def couples(model: Articulation, coupling: Coupling) -> bool:
    """True for a coupling of two joints of the model that have one coordinate each."""
    ends = [model.joints.get(name) for name in (coupling.joint, coupling.other)]
    return all(one is not None and one.kind in SCALAR for one in ends)


def coordinate(joint: Joint) -> float:
    """The coordinate of a joint that has one, or had one before it was fixed."""
    return joint.position[0] if joint.position else 0.0


def start_of(
    model: Articulation, positions: Given, rates: Given, remarks: Remarks, *, limited: bool
) -> Articulation:
    """The model with the coordinates and rates of its joints where it starts.

    Joints that follow others are where these put them; with ``limited``, joints outside of their
    limits are put at them, and those whose limits are equal are fixed there.

    Args:
        model: the model.
        positions, rates: joint -> its coordinates, as its file counts them, and their rates.
        remarks: takes what was moved.
        limited: whether joints keep to their limits.

    Raises:
        FormatError: positions or rates contradict the couplings.
    """
    joints = {
        name: attrs.evolve(
            joint,
            position=_position(joint, positions.get(name)),
            rate=tuple(rates.get(name, joint.rate)),
        )
        for name, joint in model.joints.items()
    }
    model = attrs.evolve(model, joints=joints, couplings=list(model.couplings))
    start = _Start(model, remarks, limited)
    start.place(positions)
    start.move(rates)
    return model


def _position(joint: Joint, given: Sequence[float] | None) -> tuple[float, ...]:
    """The coordinates of a joint, which are counted from its reference."""
    if given is None:
        return joint.position or rest_coordinates(joint)
    return tuple(q - joint.reference for q in given) if joint.kind in SCALAR else tuple(given)


class _Start:
    """Sets coordinates and rates of the joints of one model."""

    def __init__(self, model: Articulation, remarks: Remarks, limited: bool) -> None:
        self.model, self.remarks, self.limited = model, remarks, limited
        self.couplings: list[Coupling] = []
        self.locked: list[str] = []
        tree = SpanningTree.of(model)
        self.in_loops, self.closing = tree.in_loops(), {joint.name for joint in tree.loops}

    def place(self, given: Given) -> None:
        """Set the coordinates."""
        joints = self.model.joints
        self._take_tangents()
        self._hold_followers(given)
        start = {name: joint.position[0] for name, joint in joints.items() if joint.kind in SCALAR}
        for name, q in self._followed(start, given, "position").items():
            joints[name].position = (q,)
        for one in (one for one in self.couplings if one.curve):
            joints[one.joint].position = (one.at(joints[one.other].position[0]),)
        self._take_tangents()
        for name in self.locked:
            text = "limits that are equal hold a joint: it is fixed"
            self.remarks.translate(joints[name].place, text, motion=True)
            joints[name] = held(joints[name], joints[name].position[0])
        for joint in joints.values():
            if self.limited and joint.kind == "universal" and len(joint.limits) == 2:
                pairs = zip(joint.position, joint.limits, strict=True)
                joint.position = tuple(self._inside(joint, q, one) for q, one in pairs)
            if self.limited and joint.kind == "ball":
                self._turn_inside(joint)

    def _take_tangents(self) -> None:
        """Take the ratios of curved couplings where the others are, within their limits."""
        for k, one in enumerate(self.model.couplings):
            if one.curve and couples(self.model, one):
                q, limits = coordinate(self.model.joints[one.other]), Limits()
                if self.limited:
                    limits = self.model.joints[one.other].limits[0]
                self.model.couplings[k] = one.tangent(min(max(q, limits.lower), limits.upper))

    def _hold_followers(self, given: Given) -> None:
        """Fix joints that are coupled with fixed ones.

        Raises:
            FormatError: one is given another position.
        """
        joints, waiting = self.model.joints, True
        while waiting:
            waiting = False
            for one in self.model.couplings:
                ends = [joints.get(name) for name in (one.joint, one.other)]
                kinds = [None if end is None else end.kind for end in ends]
                if kinds[1] == "fixed" and kinds[0] in SCALAR:
                    joint, q = one.joint, one.at(coordinate(joints[one.other]))
                elif kinds[0] == "fixed" and kinds[1] in SCALAR and one.ratio and not one.curve:
                    joint, q = one.other, (coordinate(joints[one.joint]) - one.offset) / one.ratio
                else:
                    continue
                if joint in given and abs(coordinate(joints[joint]) - q) > AGREE:
                    leader = one.other if joint == one.joint else one.joint
                    self._refuse(leader, joint, "position", q, coordinate(joints[joint]))
                text = "a joint that is coupled with a fixed one is fixed"
                self.remarks.translate(one.place, text)
                joints[joint], waiting = held(joints[joint], q), True
        self.couplings = [one for one in self.model.couplings if couples(self.model, one)]

    def move(self, given: Given) -> None:
        """Set the rates of joints that follow others.

        Raises:
            FormatError: one is fixed.
        """
        for name in given:
            if self.model.joints[name].kind == "fixed":
                raise FormatError(f"rate of {name}: it is fixed", self.model.joints[name].place)
        self.couplings = [one for one in self.couplings if couples(self.model, one)]
        start = {name: (*joint.rate, 0.0)[0] for name, joint in self.model.joints.items()}
        for name, rate in self._followed(start, given, "rate").items():
            if given:
                self.model.joints[name].rate = (rate,)

    def _followed(self, start: Mapping[str, float], given: Given, what: str) -> dict[str, float]:
        """Coordinates, or rates, of joints that have one.

        Raises:
            FormatError: those given contradict the couplings.
        """
        known: dict[str, float] = {}
        followers = {one.joint for one in self.couplings}
        for name in sorted(start, key=lambda name: (name not in given, name in followers)):
            if name in known or self.model.joints[name].kind not in SCALAR:
                continue
            chain = self._chain(name, known, 0.0 if what == "rate" else 1.0)
            for other, (a, b) in chain.items():
                wanted = a + b * start[name]
                if other in given and abs(start[other] - wanted) > AGREE * max(1.0, abs(wanted)):
                    self._refuse(name, other, what, wanted, start[other])
            s = start[name] if what == "rate" else self._within(chain, start[name])
            known |= {other: a + b * s for other, (a, b) in chain.items()}
        for one in self.couplings:
            offset = one.offset if what == "position" else 0.0
            wanted = offset + one.ratio * known[one.other]
            if abs(known[one.joint] - wanted) > AGREE * max(1.0, abs(wanted)):
                self._refuse(one.other, one.joint, what, wanted, known[one.joint])
        return known

    def _refuse(self, leader: str, joint: str, what: str, wanted: float, found: float) -> None:
        """Refuse a start that contradicts a coupling."""
        zero = self.model.joints[joint].reference if what == "position" else 0.0
        text = f"{what} of {joint} = {found + zero:g}: it is coupled with {leader}, which puts it "
        place = self.model.joints[joint].place
        raise FormatError(f"{text}at {wanted + zero:g}", place, "give one of them alone")

    def _chain(
        self, seed: str, known: Mapping[str, float], offsets: float
    ) -> dict[str, tuple[float, float]]:
        """Joints that move with one, itself included: (a, b) of each, which is at a + b s."""
        chain, queue = {seed: (0.0, 1.0)}, [seed]
        for name in queue:  # grows
            a, b = chain[name]
            for one in self.couplings:
                offset = offsets * one.offset
                if one.other == name and one.joint not in chain and one.joint not in known:
                    chain[one.joint] = offset + one.ratio * a, one.ratio * b
                    queue.append(one.joint)
                elif one.joint == name and one.ratio and one.other not in {*chain, *known}:
                    chain[one.other] = (a - offset) / one.ratio, b / one.ratio
                    queue.append(one.other)
        return chain

    def _within(self, chain: Mapping[str, tuple[float, float]], s: float) -> float:
        """The coordinate of a joint, moved until all that move with it are within their limits."""
        low, high, at, equal = -inf, inf, s, False
        for name, (a, b) in chain.items():
            limits = self.model.joints[name].limits[0]
            equal = equal or limits.lower == limits.upper
            if b:
                ends = sorted(((limits.lower - a) / b, (limits.upper - a) / b))
                low, high = max(low, ends[0]), min(high, ends[1])
        if self.limited and low <= high and not self.in_loops & chain.keys():
            at = min(max(s, low), high)
            self.locked += chain if equal else ()
        if self.limited and low >= high and not equal:
            joint = self.model.joints[next(iter(chain))]
            text = f"limits of {', '.join(chain)}, which are coupled, leave them no room to move"
            self.remarks.translate(joint.place, text, motion=True)
        for name, (a, b) in chain.items():
            if self.limited:
                self._remark(self.model.joints[name], a + b * s, a + b * at)
        return at

    def _turn_inside(self, joint: Joint) -> None:
        """Turn a ball back about the axis that it is turned about, into its limit."""
        q = np.array(joint.position) * (1.0 if joint.position[0] >= 0.0 else -1.0)
        size = float(np.linalg.norm(q[1:]))
        angle = 2.0 * atan2(size, q[0])
        at = self._inside(joint, angle, joint.limits[0])
        if at != angle:
            joint.position = (cos(at / 2.0), *(sin(at / 2.0) / size * q[1:]).tolist())

    def _inside(self, joint: Joint, q: float, limits: Limits) -> float:
        """A coordinate of a joint with several, moved into its limits."""
        at = q if joint.name in self.in_loops else min(max(q, limits.lower), limits.upper)
        self._remark(joint, q, at, limits)
        return at

    def _remark(self, joint: Joint, q: float, at: float, given: Limits | None = None) -> None:
        """Remark that a joint starts beyond its limits, and what was done."""
        limits, zero = given or joint.limits[0], joint.reference
        if joint.name in self.closing:  # the others place it
            return
        slack = AGREE * max(1.0, abs(at))
        if limits.contain(q, slack):
            return
        text = f"joint {joint.name} starts at {q + zero:g}, beyond its limits "
        text += f"{limits.lower + zero:g} and {limits.upper + zero:g}: "
        inside = limits.contain(at, slack)
        text += f"it is put at {at + zero:g}" if inside else "its stops push it back"
        self.remarks.translate(joint.place, text, motion=True)
