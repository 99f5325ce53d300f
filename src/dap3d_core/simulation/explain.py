"""Text on what is modelled, and on what is left out and why."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Model
from dap3d_core.model.state_layout import STATE, VELOCITIES
from dap3d_core.registry.suggestions import some
from dap3d_core.scene import Instance, Scene, ValidatedScene
from dap3d_core.simulation.redundancy.other_poses import redundancy_elsewhere
from dap3d_core.simulation.redundancy.redundancy import Redundancy

#: Names that a line lists.
MOST_NAMES = 8


def explain(
    checked: ValidatedScene,
    model: Model,
    evaluator: Evaluator,
    method: str,
    reason: str,
    u: Floats,
    redundancy: Redundancy,
) -> str:
    """A text for people, one fact a line; u (13 n,) is where a run would start."""
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
    lines.append(f"  method     {method}, because {reason}")
    if model.row_count and str(checked.scene.simulation.method) == "auto":
        lines.append(f"  joint      {in_joint_coordinates(evaluator)[1]}")
    compiled = sorted({f"{group.keyword} ({kind})" for kind, group in evaluator.loop_groups})
    lines.append(f"  kernels    {', '.join(compiled) or 'none'}")
    left_out = _left_out(checked, model)
    lines.append("left out")
    lines += [f"  {line}" for line in left_out] or ["  nothing"]
    for note in checked.notes:
        lines.append(f"note: {note}")
    return "\n".join(lines)


def in_joint_coordinates(evaluator: Evaluator) -> tuple[float, str]:
    """Estimate of the time by method joint, over that of an evaluator's; why auto leaves it."""
    from dap3d_core.formulations.joint.coordinates import cost_over_standard

    ratio = cost_over_standard(evaluator.model, evaluator.plan)
    return ratio, (
        f"method joint would take some {ratio:.2g} of the time of a right-hand side; auto keeps "
        "the coordinates of bodies, which radau and packs of studies take"
    )


def types_of(instances: Sequence[Instance]) -> dict[str, int]:
    """Keyword -> how many elements of this type there are, in the order of the file."""
    return dict(Counter(instance.type_info.type.keyword for instance in instances))


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
    for word, declared in _declared(scene).items():
        unused = [name for name in declared if name not in _used(scene)]
        if unused:
            result.append(f"{word} that nothing uses: {some(unused, MOST_NAMES)}")
    if checked.animation_count:
        result.append(f"animation points: {checked.animation_count}, not part of the analysis")
    return result


def _declared(scene: Scene) -> dict[str, Any]:
    return {
        "points": scene.points,
        "vectors": scene.vectors,
        "vectors2": scene.vectors2,
        "functions": scene.functions,
    }


def _used(scene: Scene) -> Counter[str]:
    """Names that joints, forces and vectors2 mention."""
    found: Counter[str] = Counter()
    for elements in (scene.joints, scene.forces):
        for element in elements.values():
            found.update(v for v in element.fields.values() if isinstance(v, str))
    for d in scene.vectors2.values():
        found.update((d.P_i, d.P_j))
    return found
