"""Force elements evaluated at reported states."""

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

import attrs
import numpy as np

from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.types import acts_on_all
from dap3d_core.model.groups import Floats, Group
from dap3d_core.result.errors import UnknownNameError
from dap3d_core.result.post.point_motion import motion_of
from dap3d_core.result.post.reactions import (
    InstanceParameters,
    Instants,
    Reaction,
    actions_of,
    place_at,
    reactions,
)

if TYPE_CHECKING:
    from dap3d_core.formulations.evaluator import Evaluator


@attrs.frozen(eq=False)
class ForceOutput:
    """Output of a force element at nt instants; None where its type does not have it.

    Attributes:
        on: by slot ("i", "j", "k") force and moment on that body.
        energy: (nt,) J, its potential.
        length: (nt,) m, distance of its ends P_i and P_j.
        length_rate: (nt,) m/s, its time derivative; NaN at zero length.
        tension: (nt,) N, force along the line of its ends, positive where it pulls them together;
            NaN at zero length. (nt,) or (nt, k) by a kernel ``tension``, of each span, say.
    """

    on: Mapping[str, Reaction]
    energy: Floats | None = None
    length: Floats | None = None
    length_rate: Floats | None = None
    tension: Floats | None = None


@np.errstate(all="ignore")  # as compiled code does
def force_output(
    evaluator: "Evaluator", at: Instants, v_dot: Floats, name: str, actuation: Floats | None = None
) -> ForceOutput:
    """Evaluates a force element; unknown angles are counted from one instant to the next.

    Args:
        evaluator: evaluates the model.
        at: where.
        v_dot: (nt, 6 n) accelerations.
        name: of the element.
        actuation: (nt,) what takes the place of the field that its type ``actuates``; the element
            has no potential then.

    Raises:
        UnknownNameError: the element acts on every body or in a joint.
    """
    group, index = group_of(evaluator, name, evaluator.model.force_names.index(name))
    loops, bodies = ForceLoops(evaluator, group, index), group.bodies[index]
    force, energy = np.zeros_like(evaluator.system.force), np.zeros(1)
    out, potential, tensions = (
        np.zeros((len(at.t), *shape)) for shape in ((len(bodies), 6), (), (loops.tension_count,))
    )
    minus_lambda = np.zeros_like(evaluator.system.multipliers)
    for k, time in place_at(evaluator, at):
        if at.angles is None:
            loops.call("angle", time, force, np.ones(1))  # which keeps what it finds
        else:
            loops.parameters.set_angles(at.angles[k])
        if actuation is not None:
            loops.parameters.scale_field(group, loops.actuated, actuation[k])
        force[:] = energy[:] = 0.0
        if group.read:
            minus_lambda[evaluator.system.row] = -at.Lam[k]
        loops.call(loops.law, time, force, minus_lambda)
        loops.call("energy", time, energy)
        out[k], potential[k] = force.reshape(-1, 6)[bodies], energy[0]
        loops.call("tension", time, tensions[k], np.zeros(1))  # from place 0 on
    on = actions_of(evaluator.model, at.u, group, index, out)
    potentials = potential if loops.has("energy") and actuation is None else None
    output = ForceOutput(on, potentials, tension=loops.own_tension(tensions))
    if any(spec.kind == "vector2" for spec in specs_of(group.type_info.type).values()):
        length, rate, tension = _along(group, index, at.u, v_dot, on["i"].force)
        return attrs.evolve(output, length=length, length_rate=rate, tension=tension)
    return output


def reactions_of(
    evaluator: "Evaluator", at: Instants, joints: Collection[int]
) -> dict[int, dict[str, Reaction]]:
    """As ``reactions``, with the forces that joints bring."""
    found = reactions(evaluator, at, joints)
    model = evaluator.model
    for joint, actions in found.items():
        if name := model.brought_forces.get(model.joint_names[joint]):
            rates = np.zeros((len(at.t), 6 * model.body_count))
            output = force_output(evaluator, at, rates, name)
            for slot, more in output.on.items():
                force, moment = actions[slot].force + more.force, actions[slot].moment + more.moment
                actions[slot] = attrs.evolve(actions[slot], force=force, moment=moment)
    return found


def group_of(evaluator: "Evaluator", name: str, element: int) -> tuple[Group, int]:
    """The group of a force element and its index there."""
    for group in evaluator.model.forces:
        indices = np.flatnonzero(group.members == element)
        if len(indices) and not acts_on_all(group.type_info.type):
            return group, int(indices[0])
    raise UnknownNameError(
        f"the force {name!r} has no quantities: it acts on every body or in a joint, not on bodies "
        "of its own"
    )


def _along(
    group: Group, index: int, u: Floats, v_dot: Floats, force: Floats
) -> tuple[Floats, Floats, Floats]:
    """Length, its rate and the tension (nt,) of an element between points P_i and P_j."""
    numbers, ends = group.type_info.layout.numbers, []
    for end in ("P_i", "P_j"):
        at, _ = numbers[end]
        ends.append(group.numbers[index, at : at + 3])
    local = np.array(ends)
    r, v = (motion_of(group.bodies[index], local, u, v_dot, level) for level in (0, 1))
    d, d_dot = r[:, 1] - r[:, 0], v[:, 1] - v[:, 0]
    length = np.linalg.norm(d, axis=1)
    d[length == 0.0] = d_dot[length == 0.0]  # the direction it has at once
    size = np.linalg.norm(d, axis=1)
    rate, tension = (np.einsum("tc,tc->t", d, a) for a in (d_dot, force))
    nonzero = np.where(size > 0.0, size, 1.0)
    return length, rate / nonzero, tension / nonzero


class ForceLoops:
    """The loops over one force element, with a copy of its parameters."""

    def __init__(self, evaluator: "Evaluator", group: Group, index: int) -> None:
        from dap3d_core.interface.codegen.compile_loops import compiled_loop
        from dap3d_core.interface.codegen.loop_source import stride
        from dap3d_core.kernels.runtime.function_lists import loop_list

        s = evaluator.system
        self._evaluator = evaluator
        self.actuated = getattr(group.type_info.type, "actuates", "")
        self._loops = {kind: q for q, (kind, g) in enumerate(evaluator.loop_groups) if g is group}
        #: The loop of its wrench; one that reads reactions is called as friction is.
        self.law = "wrench" if "wrench" in self._loops else "friction"
        q = self._loops[self.law]
        self.parameters = InstanceParameters(evaluator, q, group, np.array([index]))
        self.parameters.set_angles(np.zeros(evaluator.model.angle_count))
        self._groups, start = s.groups.copy(), self.parameters.start
        for q in self._loops.values():
            self._groups[q] = s.groups[q, 0] + index * stride(group.type_info), start, 1
        self._lists = {
            kind: (evaluator.loops, q, self._groups[q]) for kind, q in self._loops.items()
        }
        paths = group.type_info.outputs.get("tension", ())
        self.tension_count, self.is_single = len(paths), paths == ("out",)
        if paths:  # no run has its loop
            loops = loop_list([compiled_loop(group.type_info, "tension")])
            self._lists["tension"] = loops, 0, self._lists[self.law][2]

    def own_tension(self, values: Floats) -> Floats | None:
        """(nt,) of one number, (nt, k) of a tuple, from (nt, k) values; None without a kernel."""
        if not self.has("tension"):
            return None
        return values[:, 0] if self.is_single else values

    def has(self, kind: str) -> bool:
        """True if there is a loop of a kind."""
        return kind in self._lists

    def call(self, kind: str, time: float, out: Floats, multipliers: Floats | None = None) -> None:
        """Runs a loop, if there is one, at the current poses; it adds to ``out``.

        multipliers: (rows,) -lambda as the driver has it, for a loop that reads reactions.
        """
        from dap3d_core.kernels.runtime.function_lists import LoopArrays, call_loop

        if self.has(kind):
            s = self._evaluator.system
            par = self.parameters.par
            arrays = LoopArrays(body=s.body, F=s.F, idx=s.idx, par=par, states=s.states)
            loops, q, group = self._lists[kind]
            given = out if multipliers is None else multipliers
            call_loop(loops, q, time, arrays, group, out, given, given)
