"""Public function ``equilibrium``: where a scene comes to rest."""

import os
from collections.abc import Callable, Mapping

import attrs
import numpy as np

from dap3d_core.model.joint_angles import JOINT_ANGLES
from dap3d_core.model.rotations import read_only
from dap3d_core.model.state_layout import split
from dap3d_core.registry.arguments import checked
from dap3d_core.result import information
from dap3d_core.result.errors import unknown
from dap3d_core.result.post.force_output import Instants, Reaction, reactions_of
from dap3d_core.scene import Scene
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.equilibrium.rest import EquilibriumSolution, find_rest
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.initial.assemble import violation
from dap3d_core.simulation.initial.start_state import NamedState, Start, start_state
from dap3d_core.simulation.redundancy.redundancy import Redundancy, redundancy_of
from dap3d_core.simulation.settings import compiled_for


class Equilibrium:
    """A static equilibrium of n bodies with m constraint rows: forces and reactions balance.

    Attributes:
        compiled: the model.
        u: (13 n,) the state: r, p, zero velocities.
        r, p: (n, 3) positions, m; (n, 4) Euler parameters.
        angles: (angles,) angles whose turns are counted, rad, in the order of the model.
        states: (s,) states of elements, in the order of the model.
        Lam: (m,) Lagrange multipliers; those of least norm where they are not unique.
        unbalanced: (n, 6) force, N, and moment about the mass centre, N m, left on each body.
        residual: largest of these as a part of the largest force or moment on a body: rounding.
        violation: largest ``|C|`` of the constraint rows.
        stable: no freedom leads away from it; with ``indifferent`` freedoms, none of the others.
        indifferent: number of freedoms that nothing drives or holds, at any small distance.
        stiffness: (f,) eigenvalues of the stiffness of the f freedoms, N m, of displacements in
            parts of a length of the scene and rotations in rad, ascending; complex without a
            potential.
        redundancy: of the constraints there.
        steps: steps of the search.
        notes: what was assumed, and what to know of it.
    """

    def __init__(
        self, compiled: CompiledModel, rest: EquilibriumSolution, notes: tuple[str, ...] = ()
    ) -> None:
        """Compose an equilibrium of a model and what was found."""
        self.compiled = compiled
        self.u, self.Lam = read_only(rest.u), read_only(rest.multipliers)
        self.r, self.p, _, _ = split(self.u)
        self.angles = read_only(rest.angles)
        self.states = read_only(rest.states)
        self.unbalanced = read_only(rest.unbalanced)
        self.residual = rest.search.pose.residual
        evaluator = compiled.evaluator
        self.violation = violation(evaluator, rest.u)[0]
        self.stable = rest.stability.stable
        self.indifferent = len(rest.stability.indifferent)
        self.stiffness = rest.stability.stiffness
        self.redundancy: Redundancy = redundancy_of(evaluator, rest.u)
        self.steps = rest.search.steps
        self.notes = [*notes, *rest.notes]
        if self.redundancy.rank.redundant:
            self.notes.append(f"{self.redundancy.describe()}. Their reactions are not unique; "
                              "those of least |lambda| are reported")  # fmt: skip

    def __repr__(self) -> str:
        kind = "stable" if self.stable else "unstable"
        return f"<Equilibrium {self.compiled.scene.name!r}: {kind}, residual {self.residual:.2g}>"

    @property
    def state(self) -> NamedState:
        """The state, for a run to start from."""
        model = self.compiled.model
        angles = dict(zip(model.angle_names, self.angles.tolist(), strict=True))
        note = information("the start is an equilibrium")
        states = dict(zip(model.state_labels, self.states.tolist(), strict=True))
        return NamedState(str(self.compiled.scene.name) or "the equilibrium", model.body_names,
                          self.u, angles, (note,), states=states)  # fmt: skip

    @checked
    def reaction(self, joint: str) -> Mapping[str, Reaction]:
        """Reaction of a joint on each of its bodies, ground included: D^T lambda.

        Args:
            joint: name of the joint.

        Returns:
            By slot ("i", "j", "k") as of ``Result.reaction``, without its first dimension:
            ``.force`` (3,) N, ``.moment`` (3,) N m about the body's mass centre, global axes.

        Raises:
            UnknownNameError: there is no such joint; names the nearest.
        """
        names = self.compiled.model.joint_names
        if joint not in names:
            raise unknown("joint", joint, names)
        k = names.index(joint)
        at = Instants(np.zeros(1), self.u[None], self.Lam[None], self.angles[None],
                      self.states[None])  # fmt: skip
        found = reactions_of(self.compiled.evaluator, at, [k])[k]
        return {
            slot: attrs.evolve(r, force=r.force[0], moment=r.moment[0], p=r.p[0])
            for slot, r in found.items()
        }

    def scene(self) -> Scene:
        """A copy of the scene whose bodies start here, at rest; it can be saved.

        The reference poses of the bodies, r_0 and p_0, stay those of the scene: coordinates of
        joints are zero in these, a bushing is unloaded there. Angles whose turns are counted begin
        within half a turn: ``scene.notes`` names such elements.
        ``simulate(scene, start=equilibrium)`` keeps turns as they are.
        """
        scene, checked = self.compiled.scene.copy(), self.compiled.checked
        poses = zip(self.r.tolist(), self.p.tolist(), checked.r_0.tolist(), checked.p_0.tolist(),
                    strict=True)  # fmt: skip
        for body, (r, p, r_0, p_0) in zip(scene.bodies.values(), poses, strict=True):
            body.r, body.p, body.r_0, body.p_0 = tuple(r), tuple(p), tuple(r_0), tuple(p_0)
            body.rpy = body.axis_angle = None
            body.r_dot = body.w = (0.0, 0.0, 0.0)
        contacts = self.compiled.model.contact_names
        for state in self.compiled.model.element_states:
            if state.element in contacts:
                continue  # a run finds the modes of contacts itself
            values = self.states[state.places].tolist()
            element = getattr(scene, f"{state.kind}s")[state.element]
            element.fields[f"{state.name}_0"] = values[0] if state.length == 1 else tuple(values)
        scene.simulation.start = "scene"
        wound = [name.rpartition(".")[0] for name, angle in self.state.angles.items()
                 if abs(angle) > np.pi and not name.startswith(JOINT_ANGLES)]  # fmt: skip
        if wound:
            scene.notes.append(
                "whole turns are no part of a scene: it may not be at rest, as these begin without "
                f"them: {', '.join(wound)}"
            )
        return scene


@checked
def equilibrium(
    scene: Scene | str | os.PathLike[str] | CompiledModel,
    *,
    start: Start | None = None,
    allow_code: bool = False,
    announce: Callable[[str], None] | None = None,
) -> Equilibrium:
    """Find the static equilibrium in which a scene comes to rest.

    From its start the scene follows the forces as a motion without inertia would, and Newton's
    method ends it: of several equilibria the one of the valley that the start lies in is found. A
    start that is an equilibrium is returned, stable or not. Joints are closed to rounding;
    redundant joints and singular poses are no obstacle. All forces are those at rest, at t = 0;
    drivers have their initial values; friction is left out.

    Args:
        scene: a Scene, what ``load`` takes, or a compiled model.
        start: a result (its end), a result and a time, or an equilibrium, to begin at in place of
            the scene's initial conditions.
        allow_code, announce: as of ``compile``.

    Raises:
        SceneError, PluginError: as ``compile``.
        SimulationError: there is no equilibrium, because nothing holds a freedom, or none was
            found; names what gives way. AssemblyError: the joints cannot be assembled.
    """
    compiled = compiled_for(scene, allow_code, announce, integrator="auto")
    settings = compiled.scene.simulation
    state = None if start is None else start_state(start, compiled.model, compiled.checked)
    brought = compiled.model.brought_forces.values()
    if reading := [name for group in compiled.model.forces if group.read
                   for k in group.members.tolist()
                   if (name := compiled.model.force_names[k]) not in brought]:  # fmt: skip
        raise SimulationError(
            "statics does not know forces that depend on the reactions of joints: leave "
            f"{', '.join(reading)} out of the scene, or let a damped motion come to rest"
        )
    with compiled.borrow_evaluator() as evaluator:
        first = compiled.start(True, settings.hold, str(settings.correct_metric), state)
        rest = find_rest(evaluator, first.u, first.angles, first.states)
        return Equilibrium(compiled, rest, tuple(compiled.notes))
