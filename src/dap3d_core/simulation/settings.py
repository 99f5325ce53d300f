"""Settings of a run, checked and completed, and its reporting times."""

import os
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations import Formulation
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.switches import effects_of
from dap3d_core.integrators import EXPLICIT, STEPPING, Integrator
from dap3d_core.integrators.plugin_integrators import integrator_named
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Model
from dap3d_core.result.note import information
from dap3d_core.scene import MISSING, Mistake, Scene, SceneError, Simulation, check_simulation
from dap3d_core.scene.validate.settings import notes_of
from dap3d_core.settings import METHODS, SETTINGS
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.explain import takes_joint_coordinates
from dap3d_core.simulation.initial.tolerances import atol_vector, kinds_of, resolved_atol

#: Points of declared contacts up to which "auto" follows them by events.
MOST_BY_EVENTS = 30
#: Points of one contact that may touch at once, such as the corners of a box on a box.
MOST_CLOSED = 8


def settings_of(compiled: CompiledModel, **asked: Any) -> Simulation:
    """The scene's settings with what is given (not None) in their places.

    Raises:
        SceneError: they make no sense.
    """
    given = {k: v for k, v in asked.items() if v is not None}
    settings = attrs.evolve(compiled.scene.simulation, **given)
    check_simulation(settings, compiled.model.body_names)
    return _with_contact_engine(compiled, settings)


def _with_contact_engine(compiled: CompiledModel, settings: Simulation) -> Simulation:
    """The settings with the integrator that steps contacts, where that is chosen."""
    model = compiled.model
    if integrator_named(settings.integrator).steps_contacts:
        return settings
    if model.collisions is not None and settings.contact == "events":
        what = "shapes that collide are followed by stepping, and not by events"
        remedy = "leave it out, or declare the pairs that touch in [contacts]"
        raise SceneError([Mistake("contact", "events", what, remedy=remedy)])
    if not contact_engine_reason(model, settings.contact):
        return settings
    return attrs.evolve(settings, integrator=STEPPING.name, step=settings.contact_step)


def contact_engine_reason(model: Model, contact: str) -> str:
    """Why contacts are followed by stepping; "" where they are not, or there are none."""
    if contact == "stepping" and (model.contact_count or model.collisions is not None):
        return "asked for"
    if contact == "auto" and model.collisions is not None:
        count = len(set(model.collisions.names))
        return f"{count} shape{'s' * (count != 1)} may meet anywhere"
    if contact == "auto" and _rolls_on_several(model):
        return "several contacts of one body resist that it rolls or spins"
    points = Counter(name.partition("#")[0] for name in model.contact_names)
    closed = sum(min(count, MOST_CLOSED) for count in points.values())
    if contact == "auto" and closed > MOST_BY_EVENTS:
        return f"{closed} points may touch at once, more than {MOST_BY_EVENTS}"
    return ""


def _rolls_on_several(model: Model) -> bool:
    """True if contacts share what resists that a body rolls: by events they may take turns."""
    pressing: set[int] = set()
    for group in model.contacts:
        if group.loaded is not None and group.type_info.type.resists:  # type: ignore[attr-defined]
            pressing.update(group.loaded.tolist())
    count = Counter(b for k in pressing for b in set(model.joint_slots[k]) if b > 0)
    return any(n > 1 for n in count.values())


def settings_notes(compiled: CompiledModel, settings: Simulation) -> list[str]:
    """Warnings on odd settings of a run that its scene does not have."""
    notes = [note for note in notes_of(settings) if note not in compiled.notes]
    if integrator_named(settings.integrator).steps_contacts:
        why = contact_engine_reason(compiled.model, settings.contact) or "asked for"
        words = f"contacts by stepping, h = {settings.step:g} s: {why}; errors are of order h"
        notes.append(information(words))
    return notes


def replaced_notes(
    compiled: CompiledModel, settings: Simulation, asked: Mapping[str, Any]
) -> list[str]:
    """Notes on settings of steps that mean nothing, or another thing, for the scene's contacts.

    Where contacts are not stepped, this is ``contact_step`` alone.

    Args:
        settings: of the run, as of ``settings_of``.
        asked: what it was called with.
    """
    if not integrator_named(settings.integrator).steps_contacts:
        if (step := asked.get("contact_step")) is None:
            return []
        has_contacts = compiled.model.contact_count > 0
        why = "contacts are followed by events" if has_contacts else "the scene has no contacts"
        return [f"contact_step {step:g} left out: {why}"]
    of_scene, given = compiled.scene.simulation, {}
    for name in ("integrator", "step", "atol", "rtol"):
        value, written = asked.get(name), getattr(of_scene, name)
        if value is None and written != SETTINGS[name].default:
            value = written
        if value is not None and (name.endswith("tol") or value != getattr(settings, name)):
            given[name] = value
    notes: list[str] = []
    if "rtol" in given:
        what = "the part of the largest impulse to which the impulses of a step are solved"
        notes.append(information(f"rtol {given.pop('rtol'):g} is {what}"))
    if given:
        left = ", ".join(f"{name} {value}" for name, value in given.items())
        notes.append(f"{left} left out: contacts are stepped, by contact_step and rtol alone")
    return notes


def compiled_for(
    scene: Scene | str | os.PathLike[str] | CompiledModel,
    allow_code: bool,
    announce: Callable[[str], None] | None = None,
    *,
    method: str | None = None,
    integrator: str | None = None,
    **_: Any,
) -> CompiledModel:
    """The compiled model of a scene; one that was compiled before must have the requested method.

    method, integrator: those of the runs; the scene's when left out. Other settings make no odds.

    Raises:
        SceneError: there is no such method.
        SimulationError: it has another.
    """
    if not isinstance(scene, CompiledModel):
        joint = None if integrator is None else takes_joint_coordinates(integrator)
        return CompiledModel(
            scene, method=method, allow_code=allow_code, announce=announce, joint=joint
        )
    if method is not None and method not in METHODS:
        settings = attrs.evolve(scene.scene.simulation, method=method)
        check_simulation(settings, scene.model.body_names)
    other = method not in (None, scene.requested_method)
    if other and scene.select_method(str(method))[0] != scene.method:
        words = f"the model was compiled for method {scene.method}; compile it for {method}"
        raise SimulationError(words)
    return scene.for_integrator(integrator or str(scene.scene.simulation.integrator))


def compile_exact(
    scene: Scene | str | os.PathLike[str] | CompiledModel,
    allow_code: bool,
    announce: Callable[[str], None] | None = None,
) -> CompiledModel:
    """The compiled model of a scene, with a method whose accelerations fulfil the constraints."""
    if isinstance(scene, CompiledModel):
        if scene.evaluator.formulation.is_exact:
            return scene
        scene = scene.scene
    return CompiledModel(
        scene, method="auto", allow_code=allow_code, announce=announce, joint=False
    )


def check_checkpoint(seconds: float | None, output: str | os.PathLike[str] | None) -> None:
    """Refuse checkpoints that make no sense.

    Raises:
        SceneError: their distance is no positive time, or there is no result file.
    """
    if seconds is None:
        return
    if not isinstance(seconds, (int, float)) or isinstance(seconds, bool) or not seconds > 0.0:
        words = "the time between two checkpoints is a positive number of seconds"
        raise SceneError([Mistake("checkpoint", seconds, words)])
    if output is None:
        words = "a checkpoint belongs to a result file"
        raise SceneError([Mistake("checkpoint", seconds, words, remedy="give output")])


def report_times(t_end: float | None, dt: float | None) -> Floats:
    """Reporting times (nt,): multiples of dt, and t_end where it is none of them.

    Raises:
        SceneError: no final time.
    """
    if t_end is None:
        remedy = "give t_end in the scene's [simulation], or --t-end"
        raise SceneError([Mistake("t_end", MISSING, "a run needs a final time", remedy=remedy)])
    if t_end == 0.0:
        return np.zeros(1)
    dt = t_end / 100.0 if dt is None else dt
    count = int(np.floor(t_end / dt * (1.0 + 1e-12) + 1e-9))
    times = dt * np.arange(count + 1, dtype=np.float64)
    if t_end - times[-1] > 1e-9 * dt:
        return np.append(times, t_end)
    times[-1] = t_end
    return times


def integration_options(evaluator: Evaluator, settings: Simulation) -> dict[str, Any]:
    """Arguments common to all integrations, from an evaluator and the settings of a run."""
    return {
        "rtol": settings.rtol,
        "atol": atol_vector(resolved_atol(settings.atol, evaluator), evaluator),
        "step": settings.step,
        "project_on": settings.project,
        "error_size": evaluator.coordinates.size,  # the work steers long steps alone
        "report_size": evaluator.report_size,
        "ends": effects_of(evaluator.switches),
        "kinds": kinds_of(evaluator),
    }


def fits(integrator: Integrator, formulation: Formulation) -> bool:
    """Checks that an integrator can take the accelerations of a formulation."""
    if formulation.has_own_coordinates and integrator.needs_body_coordinates:
        return False
    return formulation.is_exact or not integrator.requires


def check_fit(integrator: Integrator, formulation: Formulation) -> None:
    """Refuse an integrator that a formulation does not suit.

    Raises:
        SimulationError: it requires accelerations that satisfy the constraints.
    """
    if formulation.has_own_coordinates and integrator.needs_body_coordinates:
        other = f"integrator {EXPLICIT.name}"
        other += ' with contact = "events"' if integrator.steps_contacts else ""
        raise SimulationError(
            f"integrator {integrator.name} does not fit method {formulation.name}: its equations "
            f"are those of body coordinates; use method auto, or {other}"
        )
    if not fits(integrator, formulation):
        raise SimulationError(
            f"integrator {integrator.name} does not fit method {formulation.name}, whose "
            f"accelerations leave the constraints: it needs {integrator.requires}; use method "
            f"standard, lsq or auto, or integrator {EXPLICIT.name}"
        )


def refuse_singular_start(
    settings: Simulation, first_step: float, formulation: Formulation
) -> None:
    """Only dop853 leaves a singular pose: its result does not use the first stages, close to it.

    first_step: it takes so long, s, because close to the pose rounding takes the place of rates.

    Raises:
        SimulationError: the integrator is another, its steps are fixed, projection is off, the run
            is too short, or the formulation has coordinates of its own.
    """
    if formulation.has_own_coordinates:
        raise SimulationError(
            f"the run starts at a singular pose, from which method {formulation.name} finds no "
            "way: take method standard or lsq, or start at another pose"
        )
    t_end = float(settings.t_end or 0.0)
    if 0.0 < t_end < first_step:
        raise SimulationError(
            f"the run starts at a singular pose, which one step has to leave behind: give t_end of "
            f"{first_step:.3g} s or more ({t_end:g} is given)"
        )
    integrator = integrator_named(settings.integrator)
    if not integrator.leaves_singular or settings.step is not None or not settings.project:
        raise SimulationError(
            f"the run starts at a singular pose, from which integrator {EXPLICIT.name} alone (or "
            "auto) goes on, by steps that its error chooses and with project on; take it, or start "
            "at another pose"
        )
