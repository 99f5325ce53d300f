"""Tendons of MJCF: lines over sites, spheres and cylinders, with pulleys; sums of coordinates."""

from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np

from dap3d_core.interface.formats import (
    UNBOUNDED,
    WORLD,
    Drum,
    FormatError,
    Frame,
    Joint,
    Limits,
    Tendon,
    XmlElement,
    from_quaternion,
    held,
    length_of_line,
)
from dap3d_formats.mjcf.reader import SCALAR, MjcfReader

#: Changes of joints by which slopes are found, rad and m; parts of the range that end a search.
CHANGE, DONE = 1e-6, 1e-12


def tendon_of(reader: MjcfReader, element: XmlElement, key: str) -> XmlElement:
    """The tendon that an element names.

    Raises:
        FormatError: it is not there.
    """
    name, tendons = element.require(key), reader.document.section("tendon")
    found = next((tendon for tendon in tendons if tendon.get("name") == name), None)
    if found is None:
        raise FormatError(f"there is no tendon {name!r}", element.place)
    return settled_tendon(reader, found)


def settled_tendon(reader: MjcfReader, tendon: XmlElement) -> XmlElement:
    """A tendon with the attributes of its class, which all tendons share."""
    settled = reader.document.settled(attrs.evolve(tendon, name="tendon"), "main")
    return attrs.evolve(settled, name=tendon.name)


def read_tendons(reader: MjcfReader) -> None:
    """Read tendons with a spring, a damper, an armature or limits.

    Raises:
        FormatError: one names a site, geom or joint that is not there.
    """
    for k, given in enumerate(reader.document.section("tendon"), 1):
        tendon = settled_tendon(reader, given)
        low, high = reader.document.bounds(tendon, "range", "limited")
        if reader.document.disables("limit", "constraint"):
            low, high = UNBOUNDED
        stiffness, damping, armature = (
            tendon.numbers(key, None, (0.0,))[0] for key in ("stiffness", "damping", "armature")
        )
        if not (stiffness or damping or armature or (low, high) != UNBOUNDED):
            continue
        line = line_of(reader, tendon, f"tendon{k}")
        if line is None:
            continue
        rest = tendon.numbers("springlength", None, (-1.0,))
        drawn = set(rest) == {-1.0}
        reader.model.tendons.append(attrs.evolve(
            line, stiffness=stiffness, damping=damping, armature=armature, limits=Limits(low, high),
            rest=_drawn(reader, line) if drawn else rest[-1], play=rest[-1] - rest[0],
        ))  # fmt: skip


def line_of(reader: MjcfReader, tendon: XmlElement, name: str) -> Tendon | None:
    """The line of a tendon; None, remarked, for joints of several coordinates.

    Raises:
        FormatError: it names a site, geom or joint that is not there.
    """
    name, place = tendon.get("name") or name, tendon.place
    if tendon.name == "fixed":
        terms = tuple((t.require("joint"), t.number("coef")) for t in tendon.all("joint"))
        for joint, _ in terms:
            if joint not in reader.model.joints:
                raise FormatError(f"<fixed>: there is no joint {joint!r}", place)
        if any(reader.model.joints[joint].kind not in (*SCALAR, "fixed") for joint, _ in terms):
            text = "a fixed tendon of a joint of several coordinates"
            reader.remarks.leave_out(place, text, motion=True)
            return None
        return Tendon(name, terms=terms, place=place)
    points: list[tuple[str, Any]] = []
    drums: list[Drum] = []
    divisors: list[float] = []
    divisor = 1.0
    for part in tendon:
        if part.name == "site":
            link, at = reader.site(part, "site")
            if points and divisors[-1] and _same_place(points[-1], (link, at.r)):
                drums = [drum for drum in drums if drum.after < len(points)]
                continue  # between them the tendon pulls nothing, and passes no drum
            points.append((link, at.r))
            divisors.append(divisor)
        elif part.name == "pulley":
            divisor = part.number("divisor")
            divisors[-1:] = [0.0] if divisors else []
        elif part.name == "geom":
            drums.append(_drum(reader, part, len(points)))
    uniform = set(divisors[:-1]) <= {1.0}
    return Tendon(name, tuple(points), place=place, drums=tuple(drums),
                  divisors=() if uniform else tuple(divisors))  # fmt: skip


def _same_place(first: tuple[str, Any], second: tuple[str, Any]) -> bool:
    """True for two places of a link, each its name and (3,) m, that are one."""
    return first[0] == second[0] and bool(np.array_equal(first[1], second[1]))


def _drum(reader: MjcfReader, part: XmlElement, after: int) -> Drum:
    link, shape = reader.solid(part)
    frame, radius = shape.pose, shape.size[0]
    side, inside = None, False
    if "sidesite" in part.attributes:
        on, at = reader.site(part, "sidesite")
        side = (on, at.r)
        arm = (pose_of(reader, on) @ at).r - (pose_of(reader, link) @ frame).r
        inside = bool(np.linalg.norm(arm) < radius)
    return Drum(link, frame, radius, after, shape.kind == "cylinder", side, inside)


def _drawn(reader: MjcfReader, line: Tendon) -> float:
    """The length where the springs of all joints are at rest."""
    if line.terms:
        joints = [(reader.model.joints[name], factor) for name, factor in line.terms]
        return sum(factor * (joint.rest[0] + joint.reference) for joint, factor in joints)
    scalar = (joint for joint in reader.model.joints.values() if joint.kind in SCALAR)
    at_rest = {joint.name: joint.rest[0] for joint in scalar}
    return length_of_line(line, lambda link: pose_of(reader, link, at_rest))


def pose_of(
    reader: MjcfReader, link: str, q: Mapping[str, float] | None = None,
    poses: dict[str, Frame] | None = None,
) -> Frame:  # fmt: skip
    """The pose of a link.

    Args:
        reader: of the bodies.
        link: its name.
        q: coordinates of joints; the others are where the file draws them.
        poses: those that have been found at these coordinates.
    """
    chain, q, poses = [], q or {}, {} if poses is None else poses
    while link != WORLD and link not in poses:
        joint = next(j for j in reader.model.joints.values() if j.child == link and not j.closes)
        chain.append(held(joint, q[joint.name]) if joint.name in q else joint)
        link = joint.parent
    pose = poses.get(link, Frame())
    for joint in reversed(chain):
        step = joint.in_parent @ joint.in_child.inverse()
        if joint.kind == "free":
            step = Frame(joint.position[:3], from_quaternion(joint.position[3:]))
        pose = poses[joint.child] = pose @ step
    return pose


def length_range(reader: MjcfReader, line: Tendon) -> tuple[float, float]:
    """The least and greatest length, m; both 0 where neither joints nor the tendon have limits.

    MuJoCo's compiler finds them by simulation: it pulls and pushes along the tendon from where the
    file draws the model, to 5 % of the range (tolrange). Here they are the nearest minimum and
    maximum, or the limits of the tendon, where these lie between.
    """
    joints = reader.model.joints
    if line.terms:
        ends = np.zeros(2)
        for name, factor in line.terms:
            limits, reference = joints[name].limits[0], joints[name].reference
            q = np.array([limits.lower, limits.upper]) + reference
            ends += np.sort(factor * q) if factor else 0.0
        return (float(ends[0]), float(ends[1])) if np.isfinite(ends).all() else (0.0, 0.0)
    from scipy.optimize import minimize  # few files need it

    moving = movers(reader, line)
    leads = {one.joint: one for one in reader.model.couplings if one.joint in moving}
    free = {joint.name: joint for joint in moving.values() if joint.name not in leads}
    for one in leads.values():
        free[one.other] = joints[one.other]
    bounds = [(joint.limits[0].lower, joint.limits[0].upper) for joint in free.values()]
    scalar = all(joint.kind in SCALAR for joint in free.values())
    own = next((one.limits for one in reader.model.tendons if one.name == line.name), Limits())
    bounded = np.isfinite(bounds).all() or np.isfinite([own.lower, own.upper]).all()
    if not free or not scalar or not bounded:
        return 0.0, 0.0

    def length(x: np.ndarray, sign: float) -> float:
        q = dict(zip(free, x.tolist(), strict=True))
        for one in leads.values():
            q[one.joint] = one.at(q.get(one.other, 0.0))
        poses: dict[str, Frame] = {}
        return sign * length_of_line(line, lambda link: pose_of(reader, link, q, poses))

    start = np.clip(np.zeros(len(free)), *np.array(bounds).T)
    settings = {"eps": CHANGE, "ftol": DONE}
    low, high = (
        sign * minimize(length, start, (sign,), "L-BFGS-B", bounds=bounds, options=settings).fun
        for sign in (1.0, -1.0)
    )
    return max(float(low), own.lower), min(float(high), own.upper)


def slopes(reader: MjcfReader, line: Tendon) -> dict[str, float] | None:
    """By what the length grows with each joint, where the file draws it; None for balls."""
    if line.terms:
        return dict(line.terms)
    moving = movers(reader, line)
    if any(joint.kind not in SCALAR for joint in moving.values()):
        return None

    def length(name: str, q: float) -> float:
        poses: dict[str, Frame] = {}
        return length_of_line(line, lambda link: pose_of(reader, link, {name: q}, poses))

    return {n: (length(n, CHANGE) - length(n, -CHANGE)) / (2.0 * CHANGE) for n in moving}


def movers(reader: MjcfReader, line: Tendon) -> dict[str, Joint]:
    """The joints that move a part of the tendon against another, or that it is a sum of."""
    if line.terms:
        return {name: reader.model.joints[name] for name, _ in line.terms}
    above = {joint.child: joint for joint in reader.model.joints.values() if not joint.closes}
    links = {link for link, _ in line.points} | {drum.link for drum in line.drums}
    chains = []
    for link in links:
        chain, at = [], link
        while at != WORLD:
            chain.append(above[at])
            at = above[at].parent
        chains.append({joint.name: joint for joint in chain if joint.kind != "fixed"})
    common = set.intersection(*map(set, chains))
    return {name: joint for chain in chains for name, joint in chain.items() if name not in common}
