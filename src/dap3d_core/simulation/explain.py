"""The method that fits a model; text on what is modelled, and on what is left out and why."""

from collections import Counter
from collections.abc import Mapping, Sequence

from dap3d_core.formulations import FORMULATIONS
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.programs.change_over import MOST_BODIES
from dap3d_core.integrators.plugin_integrators import integrator_named
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Model
from dap3d_core.model.state_layout import STATE, VELOCITIES
from dap3d_core.registry import PluginError
from dap3d_core.registry.suggestions import some
from dap3d_core.result.note import Note, information
from dap3d_core.scene import Instance, Scene, ValidatedScene
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.redundancy.other_poses import redundancy_elsewhere
from dap3d_core.simulation.redundancy.redundancy import Redundancy

#: Names that a line lists.
MOST_NAMES = 8
#: ``auto`` takes method ``joint`` for trees of so many bodies: to find the motions of the joints
#: takes as long as seconds of the motion of fewer bodies.
MANY_BODIES = 64
#: A note says where method joint would take less than this part of the time.
WORTHWHILE = 0.7
#: Which code runs.
PROGRAM = (
    "one of the scene's own, once general code has run for a while; describe --source counts its "
    "operations"
)


def takes_joint_coordinates(integrator: str) -> bool:
    """True if ``auto`` may choose method ``joint``: of "auto" not, which may go on with radau."""
    try:
        found = integrator_named(integrator)
    except PluginError:  # whoever runs it says so
        return False
    prefers_bodies = found.needs_body_coordinates or found.prefers_body_coordinates
    return integrator != "auto" and not prefers_bodies


def choose_method(model: Model, requested: str) -> tuple[str, str]:
    """The formulation for a model, as far as its number of rows decides, and the reason in words.

    Raises:
        SimulationError: the requested method does not fit the scene.
    """
    if model.contact_count:
        if requested in ("auto", "lsq"):
            touch = any(hasattr(group.type_info.type, "gap") for group in model.contacts)
            return "lsq", "the scene has contacts" if touch else "joints have dry friction"
        if requested == "joint" and not model.breaks:
            return "joint", "asked for"
        raise SimulationError(
            f"method {requested} does not fit: the scene has contacts, whose rows hold and let go; "
            f"use {'lsq' if model.breaks else 'lsq, joint'} or auto"
        )
    if model.breaks:
        if requested in ("auto", "lsq"):
            return "lsq", "joints may break or hold at times"
        raise SimulationError(
            f"method {requested} does not fit: joint {next(iter(model.breaks))} may end "
            "(breaks_at, active), and its rows are zero then; use lsq or auto"
        )
    constrained = model.row_count > 0
    usual = next(f.name for f in FORMULATIONS.values() if f.needs_joints == constrained)
    if requested == "auto":
        return usual, f"the scene has {'' if constrained else 'no '}joints"
    if FORMULATIONS[requested].needs_joints == constrained:
        return requested, "asked for"
    if not constrained:
        return usual, f"asked for {requested}, but the scene has no joints"
    raise SimulationError(
        f"method {requested} does not fit: the scene has joints; use {usual} or auto"
    )


def method_note(method: str, reason: str, requested: str) -> Note:
    """The choice of a method: a warning where it is another one than was asked for."""
    text = f"method {method}: {reason}"
    return information(text) if requested in ("auto", method) else Note(text)


def explain(
    checked: ValidatedScene,
    evaluator: Evaluator,
    method: str,
    joint_cost: float | None,
    u: Floats,
    redundancy: Redundancy,
) -> str:
    """A text for people, one fact a line.

    Args:
        method: the method, and why.
        joint_cost: estimate of the time by method joint, over that of the method, or None.
        u: (13 n,) where a run would start.
        redundancy: the rank of the rows there.
    """
    model = evaluator.model
    n = model.body_count
    lines = [f"scene {checked.scene.name or '(no name)'}"]
    own = f" and {model.state_count} of elements" if model.state_count else ""
    sizes = f"{STATE * n} states{own}, {VELOCITIES * n} accelerations"
    lines.append(f"  bodies     {n}: {some(model.body_names, MOST_NAMES)}; {sizes}")
    kinds = {"joints": checked.joints, "forces": checked.forces, "functions": checked.functions}
    lines += [
        f"  {title:10s} {counts_text(types_of(instances))}" for title, instances in kinds.items()
    ]
    if model.row_count:
        lines.append(f"  rows       {redundancy.describe()}")
        lines += [f"  reactions  {words}" for words in redundancy.describe_reactions()]
        if redundancy.rank.redundant:
            elsewhere = redundancy_elsewhere(evaluator, u, redundancy)
            lines.append(f"  poses      {elsewhere.describe(redundancy)}")
            if redundancy.singular:
                lines.append(f"  start      {redundancy.singular.describe()}")
        title, words = evaluator.coordinates.structure()
        lines.append(f"  {title:10s} {words}")
    lines.append(f"  method     {method}")
    if joint_cost is not None:
        lines.append(f"  joint      {in_joint_coordinates(joint_cost)}")
    kernels = sorted({f"{group.keyword} ({kind})" for kind, group in evaluator.loop_groups})
    lines.append(f"  kernels    {', '.join(kernels) or 'none'}")
    few = n <= MOST_BODIES
    lines.append(f"  program    {PROGRAM if few else f'none: more than {MOST_BODIES} bodies'}")
    left_out = _left_out(checked, model)
    lines.append("left out")
    lines += [f"  {line}" for line in left_out] or ["  nothing"]
    for note in checked.notes:
        lines.append(f"note: {note}")
    return "\n".join(lines)


def in_joint_coordinates(ratio: float) -> str:
    """What method joint would take of the time of a right-hand side, and when auto takes it."""
    return (
        f"method joint would take some {ratio:.2g} of the time of a right-hand side; auto takes it "
        f"for {MANY_BODIES} bodies or more whose joints all form a tree, with integrators that "
        "take it"
    )


def types_of(instances: Sequence[Instance]) -> dict[str, int]:
    """Keyword -> how many elements of this type there are, in the order of the file."""
    return dict(Counter(instance.type_info.type.keyword for instance in instances))


def contacts_of(checked: ValidatedScene) -> dict[str, Instance]:
    """The contacts of a scene by name, each by one of its points."""
    return {c.name.partition("#")[0]: c for c in checked.contacts}


def counts_text(types: Mapping[str, int]) -> str:
    """Numbers of elements by type, as ``types_of`` has them, in words."""
    return ", ".join(f"{count} {word}" for word, count in types.items()) or "none"


def _left_out(checked: ValidatedScene, model: Model) -> list[str]:
    scene = checked.scene
    elements = {"constraints": model.joints, "forces": model.forces, "functions": model.functions}
    result = []
    for title, groups in elements.items():
        if not groups:
            result.append(f"{title}: the scene has none, so no code for them was loaded")
    if model.forces and not any(g.type_info.type.keyword == "weight" for g in model.forces):
        result.append("weight: no force of this type, so there is no gravity")
    for word in ("points", "vectors", "vectors2", "functions"):
        unused = [name for name in getattr(scene, word) if name not in _used(scene)]
        if unused:
            result.append(f"{word} that nothing uses: {some(unused, MOST_NAMES)}")
    if checked.animation_count:
        result.append(f"animation points: {checked.animation_count}, not part of the analysis")
    return result


def _used(scene: Scene) -> Counter[str]:
    """Names that joints, forces and vectors2 mention."""
    found: Counter[str] = Counter()
    for elements in (scene.joints, scene.forces):
        for element in elements.values():
            found.update(v for v in element.fields.values() if isinstance(v, str))
    for d in scene.vectors2.values():
        found.update((d.P_i, d.P_j))
    return found
