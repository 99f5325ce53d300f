"""What force elements do to bodies: their kernels evaluated again at reported states (spec 6)."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import attrs
import numpy as np

from dap3d_core.interface.fields import specs_of
from dap3d_core.model.groups import Floats, Group
from dap3d_core.result.errors import UnknownNameError
from dap3d_core.result.post.point_motion import motion_of
from dap3d_core.result.post.reactions import Angles, Reaction, actions_of, placed

if TYPE_CHECKING:
    from dap3d_core.formulations.evaluator import Machine


@attrs.frozen(eq=False)
class Applied:
    """What a force element did at nt instants; what its type does not have is None.

    Attributes:
        on: by slot ("i", "j", "k") what it exerts on that body.
        energy: (nt,) J, its potential.
        length: (nt,) m, distance of its ends P_i and P_j.
        length_rate: (nt,) m/s, the rate of that; NaN where the length is zero.
        tension: (nt,) N, its force along the line of its ends, positive where it pulls them
            together; NaN where the length is zero.
    """

    on: Mapping[str, Reaction]
    energy: Floats | None = None
    length: Floats | None = None
    length_rate: Floats | None = None
    tension: Floats | None = None


@np.errstate(all="ignore")  # as compiled code does
def applied(
    machine: "Machine",
    t: Floats,
    u: Floats,
    v_dot: Floats,
    name: str,
    element: int,
    angles: Floats | None,
) -> Applied:
    """Evaluate a force element.

    Args:
        machine: evaluates the model.
        t: (nt,) s.
        u: (nt, 13 n) states.
        v_dot: (nt, 6 n) accelerations.
        name: what it is called, for the error.
        element: its place among the forces of the model.
        angles: (nt, k) angles as ``Arrays`` has them; None where they are not known: they are then
            counted from one instant to the next.

    Raises:
        UnknownNameError: the element acts on every body or in a joint: it has no bodies of its own.
    """
    group, place = _group_of(machine, name, element)
    own, bodies = _OwnElement(machine, group, place), group.bodies[place]
    force, energy = np.zeros_like(machine.system.force), np.zeros(1)
    out, potential = np.zeros((len(t), len(bodies), 6)), np.zeros(len(t))
    for k, time in placed(machine, t, u):
        if angles is None:
            own.call("angle", time, force)
        else:
            own.angles.set(angles[k])
        force[:] = energy[:] = 0.0
        own.call("wrench", time, force)
        own.call("energy", time, energy)
        out[k], potential[k] = force.reshape(-1, 6)[bodies], energy[0]
    on = actions_of(machine.model, u, group, place, out)
    found = Applied(on, potential if own.has("energy") else None)
    if any(spec.kind == "vector2" for spec in specs_of(group.examined.type).values()):
        length, rate, tension = _along(group, place, u, v_dot, on["i"].force)
        return attrs.evolve(found, length=length, length_rate=rate, tension=tension)
    return found


def _group_of(machine: "Machine", name: str, element: int) -> tuple[Group, int]:
    """The group of a force element and its place there."""
    for group in machine.model.forces:
        places = np.flatnonzero(group.members == element)
        if len(places) and not getattr(group.examined.type, "each_body", False):
            return group, int(places[0])
    raise UnknownNameError(
        f"the force {name!r} has no quantities: it acts on every body or in a joint, not on bodies "
        "of its own"
    )


def _along(
    group: Group, place: int, u: Floats, v_dot: Floats, force: Floats
) -> tuple[Floats, Floats, Floats]:
    """Length, its rate and the tension (nt,) of an element between points P_i and P_j."""
    numbers, ends = group.examined.layout.numbers, []
    for end in ("P_i", "P_j"):
        at, _ = numbers[end]
        ends.append(group.numbers[place, at : at + 3])
    local = np.array(ends)
    r, v = (motion_of(group.bodies[place], local, u, v_dot, level) for level in (0, 1))
    d, d_dot = r[:, 1] - r[:, 0], v[:, 1] - v[:, 0]
    length = np.linalg.norm(d, axis=1)
    nowhere = np.full(len(length), np.nan)
    rate, tension = (
        np.divide(np.einsum("tc,tc->t", d, a), length, out=nowhere.copy(), where=length > 0.0)
        for a in (d_dot, force)
    )
    return length, rate, tension


class _OwnElement:
    """The loops over one force element, with numbers of its own."""

    def __init__(self, machine: "Machine", group: Group, place: int) -> None:
        from dap3d_core.interface.codegen.loop_source import stride

        s = machine.system
        self._machine = machine
        self._loops = {kind: q for q, (kind, g) in enumerate(machine.what) if g is group}
        self._groups, width = s.groups.copy(), group.examined.layout.par_width
        first = s.groups[self._loops["wrench"], 1] + place * width
        numbers = s.par[first : first + width].copy()
        self._par = np.concatenate([s.par, numbers])  # tables keep their places
        own = self._par[len(s.par) :].reshape(1, width)
        self.angles = Angles(machine.model, group, np.array([place]), own)
        self.angles.set(np.zeros(machine.model.angle_count))
        for q in self._loops.values():
            self._groups[q] = s.groups[q, 0] + place * stride(group.examined), len(s.par), 1

    def has(self, kind: str) -> bool:
        """Whether there is a loop of a kind."""
        return kind in self._loops

    def call(self, kind: str, time: float, out: Floats) -> None:
        """Run a loop, where there is one, on the bodies as they stand; it adds to an array."""
        from dap3d_core.kernels.runtime.function_lists import LoopArrays, call_loop

        if self.has(kind):
            s = self._machine.system
            arrays = LoopArrays(body=s.body, F=s.F, idx=s.idx, par=self._par)
            q, loops = self._loops[kind], self._machine.loops
            call_loop(loops, q, time, arrays, self._groups[q], out, out, out)
