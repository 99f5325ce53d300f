"""The state about which a scene is linearised, checked for what linearisation needs."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations import WATCH
from dap3d_core.formulations.constraint_rows import scaled_rows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.interface.codegen.kernel_arguments import parameters
from dap3d_core.interface.codegen.reactions import reaction_names
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.linear.rank import Rank, dense_rank
from dap3d_core.model import Model
from dap3d_core.model.state_layout import join
from dap3d_core.result import Result, information
from dap3d_core.scene import Scene
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.errors import SimulationError, refuse_collisions
from dap3d_core.simulation.initial.assemble import correct_initial, fit_of, violation
from dap3d_core.simulation.initial.given_state import state_of, time_of
from dap3d_core.simulation.initial.start_state import set_by_events
from dap3d_core.simulation.initial_state import start_notes
from dap3d_core.simulation.linearization.scaled_equations import ScaledEquations, scaled_equations
from dap3d_core.simulation.linearization.steady_motion import SteadyFrames, steady_frames
from dap3d_core.simulation.linearization.tangent import TangentMatrices, tangent_matrices
from dap3d_core.simulation.redundancy.redundancy import redundancy_of
from dap3d_core.simulation.redundancy.shared_reactions import refuse_shared, shared_laws
from dap3d_core.simulation.settings import compile_exact

#: Residuals of the constraints beyond this make a state unfit, in m and m/s of an ordinary scene.
OFF_CONSTRAINTS = 1e-6
#: A switch this close to zero is at its point of change, in lengths of the scene.
AT_SWITCH = 1e-9
#: Rates of states below this part of their terms are zero.
STEADY_STATES = 1e-8
#: An instant of a result within this part of its time span of the requested one is that one.
SAME_INSTANT = 1e-9


@attrs.frozen(eq=False)
class OperatingPoint:
    """A state and the linearised equations there.

    Attributes:
        compiled: the scene.
        t: time, s.
        u: (13 n,) the state, on the constraints.
        states: (s,) states of elements.
        turns: (angles,) with counted turns, where they are known; inputs: (inputs,) their values.
        tangent: derivatives of the equations of motion.
        frames: axes in which the equations are written.
        notes: choices and warnings.
        rank: of all rows, those of closed contacts too.
    """

    compiled: CompiledModel
    t: float
    u: Floats
    states: Floats
    turns: Floats | None
    inputs: Floats
    tangent: TangentMatrices
    frames: SteadyFrames
    notes: tuple[str, ...]
    rank: Rank

    @property
    def model(self) -> Model:
        """The model."""
        return self.compiled.model

    @property
    def evaluator(self) -> Evaluator:
        """The evaluator of the calling thread."""
        return self.compiled.evaluator

    @contextmanager
    def placed(self) -> Iterator[Evaluator]:
        """``evaluator`` in this state, whatever was computed with it since."""
        with self.compiled.borrow_evaluator() as evaluator, evaluator.held_inputs():
            evaluator.set_inputs(self.inputs)
            evaluator.start(self.t, self.u, self.turns, self.states)
            evaluator.place(self.t, self.u)
            yield evaluator

    @cached_property
    def equations(self) -> ScaledEquations:
        """The linearised equations, scaled."""
        found = scaled_equations(self.model, self.tangent, self.u, self.frames)
        return attrs.evolve(found, states=found.states.of(self.kept))

    @cached_property
    def kept(self) -> Integers:
        """(k,) places of the states of elements that may change: those of contacts stay."""
        contacts = set(self.model.contact_names)
        places = np.arange(self.model.state_count)
        own = [places[s.places] for s in self.model.element_states if s.element not in contacts]
        return np.concatenate([places[:0], *own])

    @cached_property
    def position_rank(self) -> int:
        """Number of independent rows with a position level."""
        position = self.model.position_row
        if np.all(position):
            return self.rank.rank
        with self.placed() as evaluator:
            rows, _ = scaled_rows(evaluator.rows(self.t, self.u), self.model.length)
        return dense_rank(rows.dense()[position], fit_of(self.model)).rank


def operating_point(
    scene: Scene | str | os.PathLike[str] | CompiledModel, at: Any, t: float, allow_code: bool
) -> OperatingPoint:
    """The state to linearise about; arguments and errors as of ``linearize``."""
    t = time_of(t)
    compiled = compile_exact(scene, allow_code)
    refuse_collisions(compiled.model, "linearisation")
    with compiled.borrow_evaluator() as evaluator, evaluator.held_inputs():
        return _point_at(compiled, evaluator, at, t)


def _point_at(compiled: CompiledModel, evaluator: Evaluator, at: Any, t: float) -> OperatingPoint:
    """As ``operating_point``, of a compiled model and its evaluator."""
    model = compiled.model
    notes: list[str] = []
    u, turns, states = _state(compiled, at, t, notes)
    evaluator.start(t, u, turns, states)
    _refuse_unknown_modes(evaluator, t, u, states)
    _check(evaluator, t, u)
    redundancy = redundancy_of(evaluator, u, t)
    if redundancy.singular is not None:
        notes.append(
            "the pose is singular: constraint rows lose rank here, and freedoms that exist at "
            "this pose alone count as freedoms; linearise about a pose nearby"
        )
    tangent = tangent_matrices(evaluator, t, u)
    rank = redundancy.rank
    if model.contact_count:
        every = scaled_rows(evaluator.rows(t, u), model.length)[0].dense()
        rank = dense_rank(every, fit_of(model))
    frames = steady_frames(model, tangent, u, rank.dependencies)
    if not (frames.is_steady and _keeps_states(model, tangent, evaluator.states)):
        frames = attrs.evolve(frames, is_steady=False)
        notes.append(
            "the state is neither at rest nor in steady motion: the matrices hold at this instant "
            "alone, and the eigenvalues say nothing about stability; `dap3d equilibrium MODEL -o "
            "rest.toml`, `dap.equilibrium`, find a state at rest"
        )
    elif np.any(frames.Omega):
        largest = frames.Omega[np.argmax(np.linalg.norm(frames.Omega, axis=1))]
        words = ", ".join(f"{w:.6g}" for w in largest)
        notes.append(
            information(
                f"steady motion: the equations are written in axes that turn at "
                f"({words}) rad/s, in which their coefficients are constant"
            )
        )
    if rated := _rates_on_reactions(model):
        raise SimulationError(
            "linearisation does not know states whose rates depend on the reactions of joints: "
            f"leave {', '.join(rated)} out of the scene"
        )
    refuse_shared(shared_laws(compiled.checked, evaluator, u, redundancy, t), evaluator)
    if model.friction:
        notes.append(
            "joints with friction: linearised with the smooth law of friction at this state, "
            "which at rest is a strong damper and no stiction"
        )
    return OperatingPoint(
        compiled, t, u, evaluator.states, turns, evaluator.inputs, tangent, frames, tuple(notes),
        rank,
    )  # fmt: skip


def _refuse_unknown_modes(evaluator: Evaluator, t: float, u: Floats, states: Floats | None) -> None:
    """Refuses a state at which bodies touch, in modes that are not known."""
    if states is not None or not evaluator.model.contact_count:
        return
    from dap3d_core.formulations.contacts.contact_table import GAP, ContactTable

    table = ContactTable(evaluator)
    gaps = table.outputs(t, u)[:, GAP]
    k = int(np.argmin(gaps))
    if gaps[k] < AT_SWITCH * evaluator.model.length:
        raise SimulationError(
            f"whether what touches ({table.names[k]}) sticks or slips is known from a run alone: "
            "linearize about a state of one, at=result, t=... (dap3d modes --from RESULT@TIME)"
        )


def _keeps_states(model: Model, tangent: TangentMatrices, states: Floats) -> bool:
    """True if the states of elements do not change, but for rounding."""
    own = tangent.states
    if own is None:
        return True
    size = np.full(6 * model.body_count, 1.0)
    size.reshape(-1, 6)[:, :3] = model.part_size
    terms = abs(own.rate_by_states) @ np.abs(states)
    terms += abs(own.rate_by_displacement) @ size + abs(own.rate_by_velocity) @ size
    return bool(np.all(np.abs(own.rates) <= STEADY_STATES * terms))


def _rates_on_reactions(model: Model) -> list[str]:
    """Names of forces with a ``rate`` that reads reactions."""
    return [
        model.force_names[int(member)]
        for group in model.forces
        if group.read
        and set(parameters(group.type_info.kernels.get("rate", lambda: None)))
        & set(reaction_names(group.type_info.type))
        for member in group.members
    ]


def _state(
    compiled: CompiledModel, at: Any, t: float, notes: list[str]
) -> tuple[Floats, Floats | None, Floats | None]:
    """The state, and the angles with counted turns and states of elements that a result has."""
    model = compiled.model
    if at is None:
        settings = compiled.scene.simulation
        start = compiled.start(settings.correct, settings.hold, str(settings.correct_metric))
        notes += start_notes(start, compiled.evaluator, compiled.scene)
        if t != 0.0 and settings.correct:  # drivers have moved on
            return correct_initial(compiled.evaluator, start.u, t).u.copy(), None, None
        return start.u.copy(), None, None
    if isinstance(at, Result):
        if at.summary.body_names != model.body_names:
            raise SimulationError("the result is of another scene: its bodies differ")
        span = max(float(np.ptp(at.t)), abs(t)) if len(at.t) else 0.0
        k = int(np.argmin(np.abs(at.t - t))) if len(at.t) else -1
        if k < 0 or abs(at.t[k] - t) > SAME_INSTANT * span:
            near = f"; the nearest is t = {at.t[k]:.9g} s" if k >= 0 else ""
            raise SimulationError(f"the result has no instant at t = {t:.9g} s{near}")
        _refuse_changed(compiled.scene, at, float(at.t[k]))
        angles = np.zeros(model.angle_count)
        known = at.arrays.angles[k]  # an older file has no angles of joints
        if known.size not in (model.own_angle_count, model.angle_count):
            known = known[:0]
        angles[: known.size] = known
        states = at.arrays.states[k] if at.arrays.states.shape[1] == model.state_count else None
        if at.summary.input_names == model.input_names:
            compiled.evaluator.set_inputs(at.inputs[k])
        return at.u[k].copy(), angles, states
    if hasattr(at, "r") and hasattr(at, "p"):
        r, p = np.asarray(at.r, dtype=float), np.asarray(at.p, dtype=float)
        if r.shape != (model.body_count, 3) or p.shape != (model.body_count, 4):
            raise SimulationError("the equilibrium is of another scene: its bodies differ")
        u = join(r, p, np.zeros_like(r), np.zeros_like(r))
        return u, getattr(at, "angles", None), getattr(at, "states", None)
    return state_of(at, model.body_names), None, None


def _refuse_changed(scene: Scene, result: Result, t: float) -> None:
    """Refuses forces that by t an event gave other numbers than they have in the scene."""
    for name, value in set_by_events(result, t).items():
        force, _, field = name.rpartition(".")
        own: Any = scene.forces[force].fields.get(field) if force in scene.forces else value
        if not np.array_equal(own, value):
            raise SimulationError(
                f"an event of the run has set {field} = {value} of force {force}: give it to the "
                "scene, too, to linearize it there"
            )


def _check(evaluator: Evaluator, t: float, u: Floats) -> None:
    """Refuses a state off the constraints, or at a switch."""
    position, velocity = violation(evaluator, u, t)
    length = evaluator.model.length
    if max(position, velocity * evaluator.time) > OFF_CONSTRAINTS * length:
        raise SimulationError(
            f"the state is off the constraints (position {position:.2g}, velocity {velocity:.2g}): "
            "equations of motion cannot be linearised there; correct it, or take a state of a run"
        )
    if not evaluator.switches:
        return
    values = np.zeros(len(evaluator.switches))
    watch = evaluator.functions[WATCH]
    with evaluator.coordinates.at(u) as y:
        watch(t, y, values, evaluator.system, evaluator.loops)
    k = int(np.argmin(np.abs(values)))
    if abs(values[k]) <= AT_SWITCH * length:
        switch = evaluator.switches[k]
        raise SimulationError(
            f"the state is at a switch of {switch.name(evaluator.model)} (its value is "
            f"{values[k]:.2g}), where the equations change their form and have no derivative; "
            "move the state to one side of it"
        )
