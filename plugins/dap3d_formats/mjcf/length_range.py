"""Least and greatest lengths of tendons within the limits of joints, and their slopes.

MuJoCo's compiler finds them by simulation: it pulls and pushes along the tendon from where the file
draws the model, to 5 % of the range (tolrange). Here they are the nearest minimum and maximum, or
the limits of the tendon, where these lie between.
"""

from collections.abc import Mapping

import numpy as np

from dap3d_core.interface.formats import WORLD, Frame, Joint, Limits, Tendon, held, length_of_line
from dap3d_formats.mjcf.reader import MjcfReader

#: Changes of joints by which slopes are found, rad and m; parts of the range that end a search.
CHANGE, DONE = 1e-6, 1e-12


def length_range(reader: MjcfReader, line: Tendon) -> tuple[float, float]:
    """The least and greatest length, m; both 0 where neither joints nor the tendon have limits."""
    joints = reader.model.joints
    if line.terms:
        ends = np.zeros(2)
        for name, factor in line.terms:
            limits, reference = joints[name].limits[0], joints[name].reference
            q = np.array([limits.lower, limits.upper]) + reference
            ends += np.sort(factor * q) if factor else 0.0
        return (float(ends[0]), float(ends[1])) if np.isfinite(ends).all() else (0.0, 0.0)
    from scipy.optimize import minimize  # few files need it

    movers = _movers(reader, line)
    leads = {one.joint: one for one in reader.model.couplings if one.joint in movers}
    free = {joint.name: joint for joint in movers.values() if joint.name not in leads}
    for one in leads.values():
        free[one.other] = joints[one.other]
    bounds = [(joint.limits[0].lower, joint.limits[0].upper) for joint in free.values()]
    scalar = all(joint.kind in ("revolute", "prismatic") for joint in free.values())
    own = next((one.limits for one in reader.model.tendons if one.name == line.name), Limits())
    bounded = np.isfinite(bounds).all() or np.isfinite([own.lower, own.upper]).all()
    if not free or not scalar or not bounded:
        return 0.0, 0.0

    def length(x: np.ndarray, sign: float) -> float:
        q = dict(zip(free, x.tolist(), strict=True))
        for one in leads.values():
            q[one.joint] = one.at(q.get(one.other, 0.0))
        poses = {WORLD: Frame()}
        return sign * length_of_line(line, lambda link: _pose(reader, link, q, poses))

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
    movers = _movers(reader, line)
    if any(joint.kind not in ("revolute", "prismatic") for joint in movers.values()):
        return None

    def length(name: str, q: float) -> float:
        poses = {WORLD: Frame()}
        return length_of_line(line, lambda link: _pose(reader, link, {name: q}, poses))

    return {n: (length(n, CHANGE) - length(n, -CHANGE)) / (2.0 * CHANGE) for n in movers}


def _movers(reader: MjcfReader, line: Tendon) -> dict[str, Joint]:
    """The joints that move a part of the tendon against another."""
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


def _pose(reader: MjcfReader, link: str, q: Mapping[str, float], poses: dict[str, Frame]) -> Frame:
    """The pose of a link at coordinates of joints, but for what moves all of a tendon."""
    if link not in poses:
        joint = next(j for j in reader.model.joints.values() if j.child == link and not j.closes)
        if joint.name in q:
            joint = held(joint, q[joint.name])
        above = _pose(reader, joint.parent, q, poses)
        poses[link] = above @ joint.in_parent @ joint.in_child.inverse()
    return poses[link]
