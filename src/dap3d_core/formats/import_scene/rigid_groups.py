"""Links that move as one: merged along fixed joints, with their mass and inertia together."""

import attrs
import numpy as np

from dap3d_core.formats.import_scene.spanning_tree import SpanningTree
from dap3d_core.interface.formats import solids
from dap3d_core.interface.formats.articulation import WORLD, Inertial, Link
from dap3d_core.interface.formats.frames import IDENTITY, Frame
from dap3d_core.interface.formats.remarks import FormatError, Remarks

#: Mass and inertia of a link without any that moves, as a part of what its joint carries.
STAND_IN = 1e-11
#: The same where contacts are to be stepped, which takes the equations of bodies.
STEPPED = 1e-6
#: Inertias below this part of that of what the joint carries are lost to rounding in a matrix that
#: holds their reciprocals.
LIGHT = 1e-9
#: Principal moments below this part of the largest count as zero, and below this part of that of
#: what the joint carries: beside it they are below rounding.
SMALLEST, LOST = 1e-12, 1e-14
#: Departure from symmetry up to which an inertia matrix counts as symmetric, relative.
ASYMMETRY = 1e-6


@attrs.define(eq=False)
class RigidGroup:
    """Links that move as one.

    Attributes:
        name: of the link that the others are fixed to; WORLD for what does not move.
        links: the links, with their frames in that one.
        inertial: mass and inertia together, in the axes of that link.
        light: True where mass or inertia are stand-ins, or as small beside what it carries.
    """

    name: str
    links: list[tuple[Link, Frame]]
    inertial: Inertial = attrs.Factory(lambda: Inertial(0.0))
    light: bool = False


def rigid_groups(
    tree: SpanningTree,
    remarks: Remarks,
    *,
    fixed_base: bool,
    keep_fixed: bool,
    balance_inertia: bool = False,
    stand_in: float = STAND_IN,
) -> tuple[dict[str, RigidGroup], dict[str, tuple[str, Frame]]]:
    """The groups of a model, and of each link its group and its frame in it.

    Args:
        tree: the tree of the model.
        remarks: takes what is merged.
        fixed_base: links without a joint to a parent belong to the world.
        keep_fixed: fixed joints between moving links stay joints.
        balance_inertia: their mean replaces principal moments that no body has, not the nearest.
        stand_in: STAND_IN or STEPPED.

    Raises:
        FormatError: a mass or an inertia is impossible.
    """
    model = tree.model
    member: dict[str, tuple[str, Frame]] = {WORLD: (WORLD, IDENTITY)}
    groups = {WORLD: RigidGroup(WORLD, [])}
    for name in tree.order:
        joint, link = tree.placing.get(name), model.links[name]
        if joint is None and fixed_base:
            member[name] = (WORLD, model.base_poses.get(name, IDENTITY))
            text = "fixed to ground, and its mass without effect; --free-base frees it"
            text = f"{name} has no joint to a parent: {text}"
            remarks.translate(link.place, text, motion=True)
        elif joint is not None and joint.kind == "fixed":
            group, frame = member[joint.parent]
            if group == WORLD or not keep_fixed:
                here = joint.in_parent @ joint.in_child.inverse()
                member[name] = (group, frame @ here)
                if group != WORLD:
                    remarks.translate(joint.place, "links of fixed joints are merged into one body")
        if name not in member:
            member[name] = (name, IDENTITY)
            groups[name] = RigidGroup(name, [])
        group, frame = member[name]
        groups[group].links.append((link, frame))
    for group_ in groups.values():
        if group_.name != WORLD:
            parts = [
                solids.inertia_moved(_checked(link, remarks, balance_inertia), frame)
                for link, frame in group_.links
                if link.inertial
            ]
            group_.inertial = solids.total_inertia(parts) if parts else Inertial(0.0)
    _stand_in(tree, groups, member, stand_in, remarks)
    return groups, member


def _checked(link: Link, remarks: Remarks, balance_inertia: bool) -> Inertial:
    """The inertial of a link.

    Principal moments that no body has are replaced by the nearest that one has, or their mean.
    """
    inertial = link.inertial or Inertial(0.0)
    scale = float(np.abs(inertial.inertia).max(initial=0.0))
    finite = np.isfinite([inertial.mass, *inertial.com, *inertial.inertia.ravel()]).all()
    if not finite or inertial.mass < 0.0:
        raise FormatError(f"link {link.name}: mass and inertia should be numbers, not negative",
                          link.place)  # fmt: skip
    if np.abs(inertial.inertia - inertial.inertia.T).max(initial=0.0) > ASYMMETRY * scale:
        raise FormatError(f"link {link.name}: the inertia matrix is not symmetric", link.place)
    least, middle, most = np.linalg.eigvalsh(inertial.inertia).tolist()
    if least >= -ASYMMETRY * scale and least + middle >= most * (1.0 - ASYMMETRY):
        return inertial
    what = f"link {link.name}: no body has the principal moments of inertia {least:.4g}, "
    what += f"{middle:.4g}, {most:.4g}: "
    if balance_inertia:
        text, J = "their mean replaces them", solids.balanced_inertia(inertial.inertia)
    elif least < -ASYMMETRY * scale:
        raise FormatError(f"{what}none is negative", link.place, "correct the file, or take their "
                          "mean with --balance-inertia (balance_inertia=True)")  # fmt: skip
    else:
        J, lack = solids.nearest_inertia(inertial.inertia), most - least - middle
        text = f"the largest is at most the sum of the others, which are made {lack:.2g} more"
    remarks.translate(link.place, what + text, motion=True)
    return Inertial(inertial.mass, inertial.com, J)


def _stand_in(
    tree: SpanningTree,
    groups: dict[str, RigidGroup],
    member: dict[str, tuple[str, Frame]],
    stand_in: float,
    remarks: Remarks,
) -> None:
    """Give groups that move without mass, or without inertia, the least that can be computed.

    It is a part of what the joint of the group carries, which is what the joint feels: of mass, and
    of inertia about it. Method ``joint`` loses nothing to rounding by it, since it adds inertias
    along the tree; a saddle-point matrix would hold its reciprocal.
    """
    carried = _carried(tree, groups, member)
    scales: dict[str, tuple[float, float]] = {WORLD: (1.0, 1.0)}
    for name in tree.order:
        if name in groups:
            joint = tree.placing.get(name)
            above = scales[WORLD if joint is None else member[joint.parent][0]]
            own = carried[name]
            scales[name] = (own[0] or above[0], own[1] or above[1])
            _complete(groups[name], scales[name], stand_in, remarks)


def _carried(
    tree: SpanningTree, groups: dict[str, RigidGroup], member: dict[str, tuple[str, Frame]]
) -> dict[str, tuple[float, float]]:
    """Mass of each group and of all that it carries, and its mean inertia about its joint."""
    parts = {name: [group.inertial] for name, group in groups.items()}
    carried = {}
    for name in reversed(tree.order):
        if name not in groups:
            continue
        joint, total = tree.placing.get(name), solids.total_inertia(parts[name])
        arm = total.com - (np.zeros(3) if joint is None else joint.in_child.r)
        mean = float(np.trace(total.inertia)) / 3.0 + total.mass * float(arm @ arm) * 2.0 / 3.0
        carried[name] = total.mass, mean
        if joint is not None:
            holder, frame = member[joint.parent]
            pose = frame @ joint.in_parent @ joint.in_child.inverse()
            parts[holder].append(solids.inertia_moved(total, pose))
    return carried


def _complete(
    group: RigidGroup, scale: tuple[float, float], stand_in: float, remarks: Remarks
) -> None:
    """Complete mass and inertia of a group by parts of a mass and a moment of inertia."""
    place, old = group.links[0][0].place, group.inertial
    inertia = old.inertia
    least, _, most = np.linalg.eigvalsh(inertia).tolist()
    moment, is_stepped = stand_in * max(scale[1], most), stand_in > STAND_IN
    if least <= max(SMALLEST * most, (stand_in if is_stepped else LOST) * scale[1]):
        inertia = inertia + (moment - min(least, 0.0)) * np.eye(3)
    if not old.mass:
        text = f"a link without mass that moves has {stand_in:g} of the mass that it carries"
        remarks.translate(place, text, motion=is_stepped)
    elif inertia is not old.inertia:
        text = f"a moment of inertia of 0 is {stand_in:g} of that of what the joint carries"
        remarks.translate(place, text, motion=is_stepped)
    group.light = not is_stepped and (not old.mass or most < LIGHT * scale[1])
    group.inertial = Inertial(old.mass or stand_in * scale[0], old.com, inertia)
