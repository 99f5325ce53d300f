"""Actuators of MJCF: motors and servos of joints and fixed tendons, motors at sites."""

from collections import Counter
from math import sqrt
from typing import Any

import attrs
import numpy as np

from dap3d_core.interface.formats import (
    LEAST,
    UNBOUNDED,
    WORLD,
    Actuator,
    FormatError,
    Joint,
    JointInertia,
    Tendon,
    XmlElement,
)
from dap3d_formats.mjcf.document import MUSCLE
from dap3d_formats.mjcf.keyframes import Keyframe, actuators_of
from dap3d_formats.mjcf.reader import SCALAR, MjcfReader
from dap3d_formats.mjcf.tendons import length_range, line_of, movers, slopes, tendon_of

Bounds = tuple[float, float]


def read_actuators(reader: MjcfReader, inertia: JointInertia, keyframe: Keyframe) -> None:
    """Read actuators whose force is linear within bounds; others are left out, remarked.

    Args:
        reader: of the bodies, which have been read.
        inertia: of the joints where the model starts.
        keyframe: the controls and activations at the start.

    Raises:
        FormatError: one names a joint, tendon or site that is not there.
    """
    document = reader.document
    options = document.root.all("option")
    disabled = {g for one in options for g in one.numbers("actuatorgroupdisable", None, ())}
    elements = actuators_of(document)
    starts = keyframe.controls(elements, [one.get("dyntype") != "none" for one in elements])
    acting = []
    for element, start in zip(elements, starts, strict=True):
        if element.number("group", 0.0) in disabled:
            reader.remarks.leave_out(element.place, "an actuator of a group that is disabled")
        elif element.name != "plugin":
            acting.append((element, _targets(reader, element), start))
    reading = ActuatorReader(reader, inertia, [(e, targets) for e, targets, _ in acting])
    for one in acting:
        reading.read(*one)


def _targets(reader: MjcfReader, element: XmlElement) -> list[tuple[str, float]]:
    """The joints that an actuator acts on, with the factors of its force."""
    gear, joints = _gear(element), reader.model.joints
    name = element.get("joint") or element.get("jointinparent")
    targets = [] if name is None else [(name, gear)]
    if "tendon" in element.attributes:
        tendon = tendon_of(reader, element, "tendon")
        parts = tendon.all("joint") if tendon.name == "fixed" else []
        targets = [(t.require("joint"), gear * t.number("coef")) for t in parts]
    for name, _ in targets:
        if name not in joints:
            raise FormatError(f"<{element.name}>: there is no joint {name!r}", element.place)
    return targets if all(joints[name].kind in SCALAR for name, _ in targets) else []


@attrs.define(eq=False)
class ActuatorReader:
    """Reads actuators, each with what it acts on.

    Attributes:
        reader: of the bodies.
        inertia: of the joints.
        elements: with the joints that they act on, and the factors of their forces.
    """

    reader: MjcfReader
    inertia: JointInertia
    elements: list[tuple[XmlElement, list[tuple[str, float]]]]

    def read(
        self, element: XmlElement, targets: list[tuple[str, float]], start: tuple[float, float]
    ) -> None:
        """Read one actuator, with its activation and control at the start."""
        place, law, activation = element.place, _law(element), self._activation(element)
        actuator = Actuator(
            self._name(element), "", place=place, control=self._control(element),
            force=self._range(element, "force"), start=start, **activation or {},
        )  # fmt: skip
        why, line = "", self._line(element, targets)
        if activation is not None and activation["activation"] == "muscle":
            why = self._muscle(element, actuator, line)
        elif law is None or activation is None:
            why = "its law"
        elif "site" in element.attributes:
            why = self._act_at_site(element, attrs.evolve(actuator, gear=law[0]), law)
        elif line is not None and (not targets or (len(targets) > 1 and any(law[1:]))):
            gear, (gain, constant, position, rate) = _gear(element), law
            if position > 0.0 or rate > 0.0:
                why = "a servo of a tendon with dampratio, or that drives it away"
            else:
                self.reader.model.actuators.append(attrs.evolve(
                    actuator, tendon=line, gear=gear * gain, bias=gear * constant,
                    stiffness=-gear * gear * position, damping=-gear * gear * rate,
                    force=_scaled(actuator.force, gear) if gear else (0.0, 0.0),
                ))  # fmt: skip
        elif not targets:
            why = "on this body, or a joint of several coordinates"
        else:
            for joint, gear in targets:
                self._act_in_joint(element, attrs.evolve(actuator, joint=joint, gear=gear), law)
            return
        if not why:
            self._note_bounds(element, line)
        else:
            text = f"an actuator <{element.name}>: {why}"
            self.reader.remarks.leave_out(place, text, motion=True)

    def _note_bounds(self, element: XmlElement, line: Tendon | None) -> None:
        """Remark on bounds of joints that an actuator moves by a site or a tendon."""
        if line is None:
            link, at = self.reader.site(element, "site")
            line = Tendon("", points=((link, at.r), (WORLD, np.zeros(3))))
        ranges = self.reader.force_ranges
        if any(ranges.get(name, UNBOUNDED) != UNBOUNDED for name in movers(self.reader, line)):
            text = "actuatorfrcrange of a joint that a site, a tendon or a muscle moves"
            self.reader.remarks.leave_out(element.place, text, motion=True)

    def _line(self, element: XmlElement, targets: list[tuple[str, float]]) -> Tendon | None:
        """The line of the tendon, or of the joint of one coordinate, that an actuator acts on."""
        if "tendon" in element.attributes:
            return line_of(self.reader, tendon_of(self.reader, element, "tendon"), "")
        terms = tuple((name, 1.0) for name, _ in targets)
        return Tendon(self._name(element), terms=terms, place=element.place) if terms else None

    def _muscle(self, element: XmlElement, actuator: Actuator, line: Tendon | None) -> str:
        """Add a muscle; why not, or ""."""
        if line is None or {element.get("gaintype"), element.get("biastype")} != {"muscle"}:
            return "its law"
        low, high = self._length_range(element, line)
        at_low, at_high, *others = (*element.numbers("gainprm", None, (1.0,)), *[0.0] * 9)[:9]
        number = dict(zip(list(MUSCLE)[1:], others, strict=True))
        force = number["force"]
        if not low < high or not at_low < at_high:
            return "a muscle without lengthrange, of joints without limits: give lengthrange"
        gear = _gear(element)
        if force < 0.0:  # the acceleration that it gives is
            arms = slopes(self.reader, line)
            moved = None if arms is None else self.inertia.acceleration_of(arms)
            if moved is None:
                return "a muscle whose force is scaled by the mass matrix, which is not known"
            force = number["scale"] / max(LEAST, abs(gear) * moved)
        times = (*element.numbers("dynprm", None, (1.0,)), 0.0, 0.0)[:3]
        optimum = (high - low) / (at_high - at_low)
        if not gear or not min(times[:2]) > 0.0:
            return "a muscle of gear 0 or a time constant of 0"
        muscle = {
            "peak": gear * force,
            "optimum": optimum / gear,
            "sinew": (low - at_low * optimum) / gear,
        }
        for key in ("l_min", "l_max", "v_max", "fp_max", "fv_max"):
            muscle[key] = number[key.replace("_", "")]
        muscle |= dict(zip(("time_up", "time_down", "smoothing"), times, strict=True))
        force_bounds = _scaled(actuator.force, gear)
        self.reader.model.actuators.append(
            attrs.evolve(actuator, tendon=line, muscle=muscle, force=force_bounds)
        )
        return ""

    def _length_range(self, element: XmlElement, line: Tendon) -> Bounds:
        """The least and greatest length of the actuator, given or where joints may go."""
        if "lengthrange" in element.attributes:
            low, high = element.numbers("lengthrange", 2)
            return low, high
        return _scaled(length_range(self.reader, line), _gear(element))

    def _name(self, element: XmlElement) -> str:
        names = {one.name for one in self.reader.model.actuators}
        return element.get("name") or f"actuator{len(names) + 1}"

    def _act_in_joint(self, element: XmlElement, actuator: Actuator, law: Any) -> None:
        """Add an actuator of a joint, whose ``gear`` is that of the transmission."""
        remarks, (gain, constant, position, rate) = self.reader.remarks, law
        target, gear = self.reader.model.joints[actuator.joint], actuator.gear
        if rate > 0.0 and gain == -position:
            moved = self.inertia.of(actuator.joint)
            if moved is None:
                text = "dampratio: links without mass, or too many, for a mass matrix"
                remarks.leave_out(element.place, text, motion=True)
            rate *= -_critical(gain, gear, moved or 0.0)
        force = _scaled(actuator.force, gear) if gear else (0.0, 0.0)
        force = self._within_joint(element, actuator.joint, force)
        bias = gear * constant + gear * gear * position * target.reference
        stiffness, damping = -gear * gear * position, -gear * gear * rate
        whole = force == UNBOUNDED and not actuator.activation
        if whole and not (bias and not stiffness + target.stiffness[0]):
            _add_law(target, bias, stiffness, damping)
            bias = stiffness = damping = 0.0
            if position or rate:
                text = "a servo is an input, and a spring and a damper of its joint"
                remarks.translate(element.place, text)
        self.reader.model.actuators.append(attrs.evolve(
            actuator, gear=gear * gain, force=force, bias=bias, stiffness=stiffness,
            damping=damping,
        ))  # fmt: skip

    def _within_joint(self, element: XmlElement, joint: str, force: Bounds) -> Bounds:
        """The bounds of the force of an actuator, within those of all actuators of its joint."""
        given = self.reader.force_ranges.get(joint, UNBOUNDED)
        count = Counter(name for _, targets in self.elements for name, _ in targets)[joint]
        if given != UNBOUNDED and count > 1:
            text = "actuatorfrcrange of a joint with several actuators"
            self.reader.remarks.leave_out(element.place, text, motion=True)
            return force
        low, high = np.clip(force, *given).tolist()
        return low, high

    def _act_at_site(self, element: XmlElement, actuator: Actuator, law: Any) -> str:
        """Add a force and moment at a site, in its axes; why not, or "".

        Its length is zero, so that a spring has no effect.
        """
        link, frame = self.reader.site(element, "site")
        if actuator.activation or actuator.force != UNBOUNDED or law[1] or law[3]:
            return "of a site but a motor without forcerange"
        if "refsite" in element.attributes:
            return "of a site with a refsite"
        gear = (*element.numbers("gear", None, (1.0,)), *[0.0] * 6)[:6]
        wrench = tuple(actuator.gear * x for x in gear)
        self.reader.model.actuators.append(
            attrs.evolve(actuator, link=link, at=frame, wrench=wrench)
        )
        return ""

    def _range(self, element: XmlElement, key: str) -> Bounds:
        """The bounds ctrlrange, forcerange or actrange, where they hold."""
        return self.reader.document.bounds(element, f"{key}range", f"{key}limited")

    def _control(self, element: XmlElement) -> Bounds:
        inherited, joint = element.number("inheritrange", 0.0), element.get("joint")
        if element.name == "position" and inherited > 0.0 and joint in self.reader.model.joints:
            target = self.reader.model.joints[joint]
            low, high = target.limits[0].lower, target.limits[0].upper
            mean, half = (low + high) / 2.0 + target.reference, (high - low) / 2.0
            return mean - inherited * half, mean + inherited * half
        if self.reader.document.disables("clampctrl"):
            return UNBOUNDED
        return self._range(element, "ctrl")

    def _activation(self, element: XmlElement) -> dict[str, Any] | None:
        """How the control acts by a state: none, a lag, an integral; None for others."""
        kind = element.get("dyntype")
        if kind == "none":
            return {"activation": ""}
        if kind == "muscle":
            return {"activation": "muscle", "active": self._range(element, "act")}
        if kind not in ("integrator", "filter", "filterexact"):
            return None
        time = element.numbers("dynprm", None, (1.0,))[0]
        active = {"active": self._range(element, "act")}
        if kind == "integrator":
            return {"activation": "integral"} | active
        return {"activation": "lag", "time": time} | active


def _gear(element: XmlElement) -> float:
    """The first number of the gear of an actuator."""
    return element.numbers("gear", None, (1.0,))[0]


def _scaled(bounds: Bounds, gear: float) -> Bounds:
    """Bounds, times a gear."""
    low, high = sorted(gear * bound for bound in bounds)
    return low, high


def _critical(kp: float, gear: float, inertia: float) -> float:
    """The damping of a servo whose damping ratio is one."""
    mass = inertia / gear**2 if gear**2 > LEAST else 0.0
    return 2.0 * sqrt(max(0.0, kp * mass))


def _law(element: XmlElement) -> tuple[float, float, float, float] | None:
    """Gain g and bias (b0, b1, b2) of the force g u + b0 + b1 length + b2 rate; None for others.

    A positive b2 of a servo, b1 = -g, is a damping ratio.
    """
    if element.get("gaintype") != "fixed" or element.get("biastype") not in ("none", "affine"):
        return None
    gain = element.numbers("gainprm", None, (1.0,))[0]
    if element.get("biastype") == "none":
        return gain, 0.0, 0.0, 0.0
    b0, b1, b2 = (*element.numbers("biasprm", None, (0.0,)), 0.0, 0.0)[:3]
    return gain, b0, b1, b2


def _add_law(joint: Joint, constant: float, stiffness: float, damping: float) -> None:
    """Add a force constant - stiffness q - damping q_dot to the spring and damper of a joint."""
    k, rest = joint.stiffness[0], joint.rest[0]
    total = k + stiffness
    joint.damping = (joint.damping[0] + damping,)
    if total:
        joint.rest = ((k * rest + constant) / total,)
        joint.stiffness = (total,)
