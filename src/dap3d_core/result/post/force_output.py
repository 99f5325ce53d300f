"""Reactions of joints, the Jacobian, and force elements, evaluated at reported states."""

from collections.abc import Collection, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.interface.codegen.instance_layout import ANGLE_WIDTH
from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.types import acts_on_all
from dap3d_core.model import Model
from dap3d_core.model.groups import Floats, Group, Integers
from dap3d_core.model.rotations import read_only, to_body, to_global
from dap3d_core.model.state_layout import split
from dap3d_core.result.errors import UnknownNameError
from dap3d_core.result.post.point_motion import motion_of

if TYPE_CHECKING:
    from dap3d_core.formulations.constraint_rows import ConstraintRows
    from dap3d_core.formulations.evaluator import Evaluator
    from dap3d_core.result.arrays import Arrays


#: With more constraint rows than this the Jacobian is a list of sparse arrays.
DENSE_ROWS = 1000


@attrs.frozen(eq=False)
class Reaction:
    """Force and moment of a joint, or a force element, on one of its bodies at nt instants.

    Attributes:
        body: name of the body.
        force: (nt, 3) N, global axes.
        moment: (nt, 3) N m about the body's mass centre, global axes; for ground about the origin.
        p: (nt, 4) Euler parameters of the body.
        local: (3,) m, the element's point on this body (``P_i`` for slot i), body axes; None if
            its type has none.
    """

    body: str
    force: Floats
    moment: Floats
    p: Floats
    local: Floats | None

    @property
    def force_body(self) -> Floats:
        """(nt, 3) N, the force in body axes: A^T f."""
        return to_body(self.p, self.force)

    @property
    def moment_body(self) -> Floats:
        """(nt, 3) N m, the moment about the mass centre in body axes: A^T n."""
        return to_body(self.p, self.moment)

    @property
    def moment_at_point(self) -> Floats | None:
        """(nt, 3) N m, moment about the element's point on this body, global axes: n - s x f.

        None if the type has no such point.
        """
        if self.local is None:
            return None
        return self.moment - np.cross(to_global(self.p, self.local), self.force)


@attrs.frozen(eq=False)
class Instants:
    """Reported states at which elements are evaluated.

    Attributes:
        t, u, Lam: (nt,) s, (nt, 13 n) states, (nt, m) multipliers in the order of the model's rows.
        angles: (nt, k) as in ``Arrays``; None if unknown.
        states: (nt, s) of elements; None for their initial values.
        inputs: (nt, k); None for those that the evaluator has.
    """

    t: Floats
    u: Floats
    Lam: Floats
    angles: Floats | None = None
    states: Floats | None = None
    inputs: Floats | None = None


def rows_at(
    evaluator: "Evaluator", t: Floats, u: Floats, inputs: Floats
) -> Iterator["ConstraintRows"]:
    """Yields the constraint rows at each instant, with inputs (nt, k)."""
    with evaluator.held_inputs():
        for time, state, values in zip(t, u, inputs, strict=True):
            evaluator.set_inputs(values)
            yield evaluator.rows(time, state)


def jacobians(evaluator: "Evaluator", t: Floats, u: Floats, inputs: Floats) -> Any:
    """The constraint Jacobian D of C(q, t) at each reported instant, D v = nu.

    Args:
        evaluator: evaluates the model.
        t: (nt,) s.
        u: (nt, 13 n) states.
        inputs: (nt, k).

    Returns:
        (nt, m, 6 n) array; beyond 1000 rows a list of nt scipy CSR arrays (m, 6 n).
    """
    model = evaluator.model
    if model.row_count > DENSE_ROWS:
        return [rows.sparse() for rows in rows_at(evaluator, t, u, inputs)]
    D = np.zeros((len(t), model.row_count, 6 * model.body_count))
    for k, rows in enumerate(rows_at(evaluator, t, u, inputs)):
        D[k] = rows.dense()
    return read_only(D)


@np.errstate(all="ignore")  # as compiled code does
def reactions_of(
    evaluator: "Evaluator", at: Instants, joints: Collection[int]
) -> dict[int, dict[str, Reaction]]:
    """Reactions of joints, by their indices, on each of their bodies: D_slot^T lambda.

    The forces that joints bring are part of them.

    Returns:
        For each joint a reaction for each slot, by its letter.
    """
    model, loops = evaluator.model, []
    for q, (kind, group) in enumerate(evaluator.loop_groups):
        indices = np.flatnonzero(np.isin(group.members, list(joints)))
        if kind == "acceleration" and len(indices):
            loops.append(_JointLoop(evaluator, q, group, indices))
    wrenches = [np.empty((len(at.t), *loop.shape)) for loop in loops]
    for k, time in place_at(evaluator, at):
        for loop, out in zip(loops, wrenches, strict=True):
            if at.angles is not None:
                loop.parameters.set_angles(at.angles[k])
            out[k] = loop.wrenches(time, at.Lam[k])
    found = {
        int(joint): actions_of(model, at.u, loop.group, index, out[:, n])
        for loop, out in zip(loops, wrenches, strict=True)
        for n, (joint, index) in enumerate(zip(loop.joints, loop.indices, strict=True))
    }
    for joint, actions in found.items():
        if name := model.brought_forces.get(model.joint_names[joint]):
            rates = np.zeros((len(at.t), 6 * model.body_count))
            output = force_output(evaluator, at, rates, name)
            for slot, more in output.on.items():
                force, moment = actions[slot].force + more.force, actions[slot].moment + more.moment
                actions[slot] = attrs.evolve(actions[slot], force=force, moment=moment)
    return found


def place_at(evaluator: "Evaluator", at: "Instants | Arrays") -> Iterator[tuple[int, float]]:
    """Sets bodies, states, functions and inputs to each instant; yields its index and time."""
    from dap3d_core.assembly.arrays import VALUE
    from dap3d_core.assembly.evaluate import call_kinds, place_bodies

    s = evaluator.system
    with evaluator.held_inputs():
        for k, y in enumerate(evaluator.integrated(at.u) if len(at.t) else ()):
            time = float(at.t[k])
            if at.inputs is not None:
                evaluator.set_inputs(at.inputs[k])
            place_bodies(y, s.body, s.metric)
            s.states[:] = evaluator.states if at.states is None else at.states[k]
            call_kinds(VALUE, VALUE, time, s, evaluator.loops, s.force, s.force, s.force)
            yield k, time


def actions_of(
    model: Model, u: Floats, group: Group, index: int, wrenches: Floats
) -> dict[str, Reaction]:
    """Wrenches (nt, slots, 6) of an instance of a group, by slot."""
    slots, numbers, p = group.type_info.layout.slots, group.of_instance(index), split(u)[1]
    names, actions = ("ground", *model.body_names), {}
    for n, (slot, body) in enumerate(zip(slots, group.bodies[index], strict=True)):
        point = numbers.get(f"P_{slot}")
        local = None if point is None or point.shape != (3,) else read_only(point)
        pose = p[:, body - 1] if body else np.broadcast_to([1.0, 0.0, 0.0, 0.0], (len(u), 4))
        force, moment = read_only(wrenches[:, n, :3]), read_only(wrenches[:, n, 3:])
        actions[slot] = Reaction(names[body], force, moment, pose, local)
    return actions


class InstanceParameters:
    """Copy of the parameters of instances of a group, whose angles are set instead of counted.

    Attributes:
        par: parameters of the model, followed by the copy: tables stay where they are.
        start: first number of the copy.
    """

    def __init__(self, evaluator: "Evaluator", q: int, group: Group, indices: Integers) -> None:
        """Args: evaluator, its loop, the loop's group, (k,) indices of the instances."""
        s, layout = evaluator.system, group.type_info.layout
        shape, first = (group.count, layout.par_width), s.groups[q, 1]
        of_group = s.par[first : first + group.count * layout.par_width].reshape(shape)
        self.par, self.start = np.concatenate([s.par, of_group[indices].ravel()]), len(s.par)
        self._copy = self.par[self.start :].reshape(len(indices), layout.par_width)
        self._columns = evaluator.model.angles_of(group, indices)
        self._offsets = list(layout.angles.values())
        self._given: Floats | None = None

    def scale_field(self, group: Group, field: str, factor: float) -> None:
        """Sets a number; of three numbers the length, in their direction as given."""
        offset, shape = group.type_info.layout.numbers[field]
        part = self._copy[:, offset : offset + (shape[0] if shape else 1)]
        if self._given is None:
            given = part.copy()
            length = np.linalg.norm(given, axis=1, keepdims=True)
            self._given = given / np.where(length > 0.0, length, 1.0) if shape else given**0
        part[:] = factor * self._given

    def set_angles(self, angles: Floats) -> None:
        """Sets the angles from those of all the model at an instant."""
        for column, offset in zip(self._columns.T, self._offsets, strict=True):
            self._copy[:, offset : offset + ANGLE_WIDTH] = 0.0
            self._copy[:, offset] = angles[column]


class _JointLoop:
    """The loop of a type over some of its joints, with separate output arrays.

    Ground then has blocks, too: in the driver they share a location that nothing reads. Row and
    blocks are the last integers of an instance (interface/codegen/loop_source.py).
    """

    def __init__(self, evaluator: "Evaluator", q: int, group: Group, indices: Integers) -> None:
        from dap3d_core.interface.codegen.loop_source import stride

        s, model, count = evaluator.system, evaluator.model, len(indices)
        self.evaluator, self.q, self.group, self.indices = evaluator, q, group, indices
        self.joints = group.members[indices]
        slots, rows = len(group.type_info.layout.slots), int(model.joint_rows[self.joints[0]])
        self.shape = count, slots, 6
        self._rows = model.joint_start[self.joints][:, None] + np.arange(rows)
        width, i0 = stride(group.type_info), s.groups[q, 0]
        idx = s.idx[i0 : i0 + group.count * width].reshape(-1, width)[indices]
        idx[:, -slots - 1] = rows * np.arange(count)
        idx[:, -slots:] = 6 * rows * np.arange(count * slots).reshape(count, slots)
        self._idx = idx.ravel()
        self.parameters = InstanceParameters(evaluator, q, group, indices)
        self._group = np.array([0, self.parameters.start, count])
        self._D = np.zeros((count, slots, rows, 6))
        self._gamma, self._nu = np.zeros(count * rows), np.zeros(count * rows)

    def wrenches(self, time: float, Lam: Floats) -> Floats:
        """(joints, slots, 6) D^T lambda at the current poses, with multipliers Lam (m,)."""
        from dap3d_core.kernels.runtime.function_lists import LoopArrays, call_loop

        s, D = self.evaluator.system, self._D.reshape(-1)
        par = self.parameters.par
        arrays = LoopArrays(body=s.body, F=s.F, idx=self._idx, par=par, states=s.states)
        call_loop(self.evaluator.loops, self.q, time, arrays, self._group, D, self._gamma, self._nu)
        return np.asarray(np.einsum("msrv,mr->msv", self._D, Lam[self._rows]))


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
    numbers = group.of_instance(index)
    local = np.array([numbers["P_i"], numbers["P_j"]])
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
