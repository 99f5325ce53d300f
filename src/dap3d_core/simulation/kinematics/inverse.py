"""Inverse dynamics: the forces of actuators that produce a motion."""

import os
import time
from collections.abc import Callable, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.common.friction import PASSES, forces_by
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.interface.fields import specs_of
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Group
from dap3d_core.registry.arguments import checked
from dap3d_core.registry.suggestions import nearest
from dap3d_core.result import Result, RunMetadata, RunStatistics, information
from dap3d_core.result.arrays import Arrays
from dap3d_core.result.errors import UnknownNameError
from dap3d_core.result.model_summary import summary_of
from dap3d_core.result.post.force_output import ForceLoops, group_of
from dap3d_core.result.post.point_motion import kinetic_energy
from dap3d_core.scene import Mistake, Scene, SceneError
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.errors import SimulationError, refuse_contacts
from dap3d_core.simulation.failure.negative_reactions import UnilateralMonitor
from dap3d_core.simulation.kinematics.driver_coordinate import driver_names
from dap3d_core.simulation.kinematics.kinematics import check_output
from dap3d_core.simulation.kinematics.motion_data import (
    Motion,
    misfit_notes,
    motion_on,
    read_motion,
)
from dap3d_core.simulation.kinematics.pose_equations import (
    ChosenRows,
    Flags,
    held_states,
    required_forces,
)
from dap3d_core.simulation.redundancy.freedoms import motion_words
from dap3d_core.simulation.settings import compile_exact

Progress = Callable[[float, float], None]

#: What the record of a result has for its integrator.
NAME = "inverse dynamics"
#: Singular values of the actuation below this part of the longest wrench count as zero.
RANK = 1e-9
#: What actuators leave of the forces of a motion, as a part of these, is not worth a note below.
PRODUCED = 1e-8
#: Forces that joints bring have settled where a pass changes multipliers by less than this part.
PASS_SETTLED = 1e-12


@attrs.frozen(eq=False)
class DriverActuator:
    """A driver, whose force takes the place of its multiplier: it holds no position any more.

    The force is that on a body, N, or the moment, N m, however long the row of the driver is: that
    of a driven leg is d, not a unit vector.

    Attributes:
        name: of the joint.
        row: its constraint row.
    """

    name: str
    row: int

    def wrench(self, t: float, D: Floats) -> Floats:
        """(6 n,) force and moment on each body of a force or moment of one; D: (rows, 6 n)."""
        return np.asarray(D[self.row] / self.size(D))

    def size(self, D: Floats) -> float:
        """The force, or moment, of a multiplier of one; 1 where it does nothing."""
        forces, moments = D[self.row].reshape(-1, 2, 3).transpose(1, 0, 2)
        sizes = np.linalg.norm(forces if forces.any() else moments, axis=1)
        return float(sizes.max()) or 1.0

    def unit(self, D: Floats) -> str:
        """Unit of its force: N of a row that holds translations."""
        return "N" if D[self.row].reshape(-1, 6)[:, :3].any() else "N m"

    given = 0.0

    def potential(self) -> float:
        """Potential energy that the force of the scene has, J: none."""
        return 0.0


class ForceActuator:
    """A force element; what its type ``actuates`` is its force.

    Attributes:
        name: of the element.
        given: the force in the scene.
    """

    def __init__(self, evaluator: Evaluator, name: str, group: Group, index: int) -> None:
        self.name, self._group, self._evaluator = name, group, evaluator
        self._loops = ForceLoops(evaluator, group, index)
        self._field = field_of(group)
        offset, shape = group.type_info.layout.numbers[self._field]
        numbers = group.numbers[index, offset : offset + (shape[0] if shape else 1)]
        self.given = float(np.linalg.norm(numbers)) if shape else float(numbers[0])
        self.has_direction = not shape or self.given > 0.0

    def wrench(self, t: float, D: Floats) -> Floats:
        """(6 n,) force and moment on each body of an actuation of one, at the bodies as placed."""
        return np.asarray(self._at(t, "wrench", 1.0) - self._at(t, "wrench", 0.0))[6:]

    def unit(self, D: Floats) -> str:
        """Unit of its force: that of the field."""
        return specs_of(self._group.type_info.type)[self._field].unit or "SI"

    def potential(self) -> float:
        """Potential energy that the force of the scene has, J, at the bodies as placed."""
        if not self._loops.has("energy"):
            return 0.0
        one, none = (self._at(0.0, "energy", x)[0] for x in (self.given, 0.0))
        return float(one - none)

    def _at(self, t: float, kind: str, force: float) -> Floats:
        self._loops.parameters.scale_field(self._group, self._field, force)
        out = np.zeros_like(self._evaluator.system.force) if kind == "wrench" else np.zeros(1)
        self._loops.call(kind, t, out)
        return out


Actuator = DriverActuator | ForceActuator


def actuators_of(
    compiled: CompiledModel, evaluator: Evaluator, names: Sequence[str] | str | None
) -> list[Actuator]:
    """The actuators that are named, in their order; None: all drivers.

    Raises:
        SceneError: there is none of a name, or it cannot be an actuator.
    """
    drivers, forces = driver_names(compiled), _actuating_forces(evaluator)
    if names is None:
        names = drivers
    elif isinstance(names, str):
        names = [names]
    if not names:
        words = "name the actuators whose forces produce the motion"
        remedy = "add drivers, or force elements such as a point-to-point actuator, to the scene"
        if drivers or forces:
            remedy = f"there can be {', '.join([*drivers, *forces])}"
        raise SceneError([Mistake("actuators", [], words, remedy=remedy)])
    found: list[Actuator] = []
    mistakes: list[Mistake] = []
    for name in names:
        if name in [actuator.name for actuator in found]:
            mistakes.append(Mistake("actuators", name, "is named twice"))
        elif name in drivers:
            found.append(_driver(evaluator, name))
        elif name in forces:
            force = ForceActuator(evaluator, name, *forces[name])
            if not force.has_direction:
                words = "its vector is zero, so it has no direction to act in"
                mistakes.append(Mistake("actuators", name, words, remedy="give it one"))
            found.append(force)
        else:
            mistakes.append(_unknown(compiled, name, [*drivers, *forces]))
    if mistakes:
        raise SceneError(mistakes)
    return found


def _driver(evaluator: Evaluator, name: str) -> DriverActuator:
    model = evaluator.model
    return DriverActuator(name, int(model.joint_start[model.joint_names.index(name)]))


def _actuating_forces(evaluator: Evaluator) -> dict[str, tuple[Group, int]]:
    """Force elements that can be actuators, with their groups and places there."""
    found = {}
    for k, name in enumerate(evaluator.model.force_names):
        try:
            group, index = group_of(evaluator, name, k)
        except UnknownNameError:
            continue
        if field_of(group):
            found[name] = group, index
    return found


def field_of(group: Group) -> str:
    """The field that the type of a group ``actuates``, or ""."""
    return str(getattr(group.type_info.type, "actuates", ""))


def _unknown(compiled: CompiledModel, name: Any, known: list[str]) -> Mistake:
    near = nearest(name, known) if isinstance(name, str) else ""
    remedy = "" if near else f"actuators: {', '.join(known)}" if known else ""
    scene = compiled.scene
    if name in scene.joints:
        words = "this joint is no driver: what it bears is found as its reaction"
    elif name in scene.forces:
        words = f"a force of type {scene.forces[name].type} has nothing that an actuator sets"
    else:
        words = "there is no driver and no force of this name"
    return Mistake("actuators", name, words, near, remedy)


@checked
def inverse(
    scene: Scene | str | os.PathLike[str] | CompiledModel,
    motion: Any,
    actuators: Sequence[str] | str | None = None,
    *,
    progress: Progress | None = None,
    allow_code: bool = False,
    announce: Callable[[str], None] | None = None,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
) -> Result:
    """The forces of actuators that produce a motion of a scene.

    M v_dot - g = D^T lambda + B tau is solved for the reactions of the joints and the forces tau
    of the actuators: in the motions N that the joints leave, N^T B tau = N^T (M v_dot - g), tau of
    least norm where it is not unique.

    Args:
        scene: a Scene, what ``load`` takes, or a compiled model.
        motion: a ``Result`` with the same bodies, from which positions, velocities and
            accelerations are taken; or positions over time: {"t": times, "platform.r.x": values},
            a data frame, an xarray.Dataset or the path of a CSV file with a header, whose columns
            are quantities that positions determine (body.r.x, body.p.e1, point.r.z, force.length).
            The motion is the nearest to them, by least squares, that the joints allow; its rates
            are those of splines of degree 5 through its positions.
        actuators: names of drivers (which then prescribe nothing) and of force elements whose type
            says what it ``actuates``; by default all drivers.
        progress, allow_code, announce, output, force: as of ``kinematics``.

    Returns:
        A result with the motion, the reactions, and for each actuator the quantity
        ``NAME.actuation``: the force or moment of a driver, positive where it drives its
        coordinate on, the force f_a of a ``ptp``, N or N m.

    Raises:
        SceneError, PluginError, ResultError: as ``compile``; unusable motion, actuators or output.
        SimulationError: the motion leaves freedoms open, or does not fit the joints.

    Source: Nikravesh, Computer-Aided Analysis of Mechanical Systems, 1988, chapter 11.
    """
    check_output(output, force=force)
    given = read_motion(motion)
    compiled = compile_exact(scene, allow_code, announce)
    refuse_contacts(compiled.model, "inverse dynamics")
    with compiled.borrow_evaluator() as evaluator:
        result = _solved(compiled, evaluator, given, actuators, progress)
    if output is not None:
        result.save(output, force=force)
    return result


@attrs.define(eq=False)
class _Forces:
    """What is found at each instant, and what limits it.

    Attributes:
        tau: (nt, k) forces of the actuators.
        Lam: (nt, m) multipliers.
        potential, angles, residuals: (nt,), (nt, a), (nt, 3) of the result.
        rank: the least of the actuation; freedoms: the most that the joints leave.
        idle: (k,) actuators that move nothing at any instant; units: of tau.
        missing: largest part of the forces that no actuator produces, with its instant and motion.
    """

    tau: Floats
    Lam: Floats
    potential: Floats
    angles: Floats
    residuals: Floats
    rank: int
    idle: Flags
    units: Sequence[str] = ()
    freedoms: int = 0
    missing: tuple[float, float, Floats] | None = None


def _solved(
    compiled: CompiledModel,
    evaluator: Evaluator,
    given: Any,
    names: Sequence[str] | str | None,
    progress: Progress | None,
) -> Result:
    started, model = time.perf_counter(), evaluator.model
    chosen = actuators_of(compiled, evaluator, names)
    if others := [n for n in model.iterated_forces if n not in model.brought_forces.values()]:
        raise SimulationError(
            "inverse dynamics does not know Coulomb friction in joints, nor other forces that "
            f"depend on their reactions: leave {', '.join(others)} out of the scene"
        )
    held = np.ones(model.row_count, dtype=bool)
    held[[a.row for a in chosen if isinstance(a, DriverActuator)]] = False
    settings = compiled.scene.simulation
    start = compiled.start(True, settings.hold, str(settings.correct_metric))
    evaluator.start(0.0, start.u)
    motion = motion_on(evaluator, given, start.u, held, compiled.scene_text)
    evaluator.start(float(motion.t[0]), motion.u[0])
    forces = _forces(evaluator, motion, chosen, held, progress)
    summary = summary_of(model)
    kinetic = kinetic_energy(summary, motion.u)
    position, velocity, acceleration = forces.residuals.T
    arrays = Arrays(
        motion.t.copy(), motion.u, motion.v_dot, forces.Lam, kinetic - kinetic[0],
        forces.potential, position, velocity, acceleration, forces.angles,
        np.tile(evaluator.states, (len(motion.t), 1)),
        np.tile(model.input_values, (len(motion.t), 1)),
    )  # fmt: skip
    pulling = UnilateralMonitor(model)
    pulling.update(arrays)
    notes = [*compiled.notes, *misfit_notes(motion.misfit), *_notes(evaluator, chosen, forces)]
    notes += held_states(model)
    about = RunMetadata(
        scene_text=compiled.scene_text,
        stats=RunStatistics(
            wall_time_s=time.perf_counter() - started, compile_time_s=compiled.compile_time
        ),
        method=compiled.method,
        integrator=NAME,
        notes=[*notes, *pulling.notes()],
        types=compiled.types,
        settings={
            "t_end": float(motion.t[-1]),
            "actuators": ", ".join(actuator.name for actuator in chosen),
            "actuation_units": ", ".join(forces.units),
            "length": model.length,
            "project": True,
            "correct": False,
            "rank": 6 * model.body_count - forces.freedoms,
            "conservative": False,
            "work_from_energy": True,
        },
        actuation={a.name: forces.tau[:, k] for k, a in enumerate(chosen)},
    )
    return Result(summary, arrays, about, lambda: (model, lambda: compiled.evaluator))


def _forces(
    evaluator: Evaluator,
    motion: Motion,
    actuators: list[Actuator],
    held: Flags,
    progress: Progress | None,
) -> _Forces:
    """Forces and reactions at all instants."""
    model, count = evaluator.model, len(motion.t)
    layout = model.report_layout
    out = _Forces(np.zeros((count, len(actuators))), np.zeros((count, model.row_count)),
                  np.zeros(count), np.zeros((count, model.angle_count)), np.zeros((count, 3)),
                  rank=len(actuators), idle=np.ones(len(actuators), dtype=bool))  # fmt: skip
    for k, (t, u, v_dot) in enumerate(zip(motion.t.tolist(), motion.u, motion.v_dot, strict=True)):
        if motion.angles is None:
            evaluator.count_turns(t, u)
        else:
            evaluator.begin_turns(t, u, motion.angles[k])
        report = evaluator.report(t, u)
        out.angles[k] = report[layout["angles"]]
        needed = required_forces(evaluator, t, u, v_dot)
        rows = ChosenRows(evaluator, t, u, held)
        wrenches = np.array([a.wrench(t, rows.all_rows) for a in actuators]).T
        out.idle &= ~wrenches.any(axis=0)
        out.units = out.units or [a.unit(rows.all_rows) for a in actuators]
        out.potential[k] = report[layout["potential_energy"]][0]
        out.potential[k] -= sum(a.potential() for a in actuators)
        needed = needed + wrenches @ [a.given for a in actuators]  # tau takes the place of these
        out.tau[k], out.Lam[k], rank, left = _balanced(rows, wrenches, actuators, held, needed)
        for _ in range(PASSES if model.brought_forces else 0):
            before = out.Lam[k].copy()
            evaluator.place(t, u)
            more = needed - forces_by(t, evaluator.system, evaluator.loops, before)[6:]
            out.tau[k], out.Lam[k], rank, left = _balanced(rows, wrenches, actuators, held, more)
            if np.max(np.abs(out.Lam[k] - before)) <= PASS_SETTLED * np.max(np.abs(before)):
                break
        v = u[-6 * model.body_count :]
        out.residuals[k] = (np.max(np.abs(rows.rows.C[held]), initial=0.0),
                            rows.residual(v, rows.rows.nu),
                            rows.residual(v_dot, rows.rows.gamma))  # fmt: skip
        out.rank, out.freedoms = min(out.rank, rank), max(out.freedoms, rows.free.shape[1])
        size = float(np.linalg.norm(left))
        if size > PRODUCED * np.linalg.norm(needed) and (
            out.missing is None or size > out.missing[0]
        ):
            out.missing = size, t, rows.free @ left
        if not (np.all(np.isfinite(out.tau[k])) and np.all(np.isfinite(out.Lam[k]))):
            raise SimulationError(f"the forces are not finite at t = {t:.6g} s")
        if progress is not None:
            progress(t, float(motion.t[-1]))
    return out


def _balanced(
    rows: ChosenRows, wrenches: Floats, actuators: list[Actuator], held: Flags, needed: Floats
) -> tuple[Floats, Floats, int, Floats]:
    """Tau and multipliers (rows,) that give forces (6 n,); rank and remainder of ``_actuation``."""
    tau, rank, left = _actuation(rows.free, wrenches, rows.free.T @ needed)
    Lam = np.zeros(len(held))
    Lam[held] = rows.multipliers(needed - wrenches @ tau)
    for place, actuator in enumerate(actuators):
        if isinstance(actuator, DriverActuator):
            Lam[actuator.row] = tau[place] / actuator.size(rows.all_rows)
    return tau, Lam, rank, left


def _actuation(free: Floats, wrenches: Floats, side: Floats) -> tuple[Floats, int, Floats]:
    """Tau of least norm with N^T B tau nearest to side, the rank, and what is left of side."""
    A = free.T @ wrenches
    left, values, right = np.linalg.svd(A, full_matrices=False)
    rank = int(np.sum(values > RANK * np.max(np.linalg.norm(wrenches, axis=0))))
    tau = right[:rank].T @ ((left[:, :rank].T @ side) / values[:rank])
    return tau, rank, side - A @ tau


def _notes(evaluator: Evaluator, actuators: list[Actuator], forces: _Forces) -> list[str]:
    """Redundant actuators, and forces that none produces, in words."""
    notes: list[str] = []
    names = ", ".join(actuator.name for actuator in actuators)
    surplus = len(actuators) - forces.rank - int(forces.idle.sum())
    drivers = [a.name for a in actuators if isinstance(a, DriverActuator)]
    if drivers:
        notes.append(
            information(
                f"{', '.join(drivers)} prescribe{'s' * (len(drivers) == 1)} nothing here: "
                "the motion is the one given, and the driver's actuation is the force that it takes"
            )
        )
    if forces.idle.any():
        idle = ", ".join(
            a.name for a, is_idle in zip(actuators, forces.idle, strict=True) if is_idle
        )
        notes.append(f"{idle} moves nothing at any instant: an input or a function that is its "
                     "factor is zero; give the input a value")  # fmt: skip
    if surplus > 0:
        notes.append(
            f"the actuation is redundant: of {len(actuators)} actuators ({names}) "
            f"{forces.rank} are independent; reported are the forces of least norm, the square "
            "root of the sum of their squares in N and N m"
        )
    if forces.missing is not None:
        size, t, motion = forces.missing
        notes.append(
            f"the actuators ({names}) cannot produce the whole motion: at t = {t:.6g} s {size:.3g} "
            f"(N, N m) is missing, where {motion_words(evaluator.model, motion)}; name actuators "
            "that move this, too"
        )
    return notes
