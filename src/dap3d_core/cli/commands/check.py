"""``dap3d check``: validate a model and say what it is; nothing is run."""

from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.framework.completion import models as complete_models
from dap3d_core.cli.process.exit_codes import DONE, REFUSED, Refused

if TYPE_CHECKING:
    from dap3d_core.simulation import CompiledModel
    from dap3d_core.simulation.redundancy.redundancy import Redundancy


@click.command(cls=Command, short_help="Validate a model, count its degrees of freedom.")
@click.argument("model", shell_complete=complete_models)
@click.option("--method", metavar="NAME", help="Formulation, in place of the scene's.")
@click.option(
    "--correct-metric",
    type=click.Choice(["unit", "mass"]),
    help="The least correction is that in m and rad, or weighted by masses.",
)
@click.option(
    "--allow-code", is_flag=True, help="Allow the model's own types (plugin.py in its folder)."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
def check(
    model: str, *, method: str | None, correct_metric: str | None, allow_code: bool, as_json: bool
) -> int:
    """Validate a MODEL; count its rows, rank and degrees of freedom.

    All mistakes are reported at once, each with file, line, key, what is allowed and the nearest
    right spelling; the exit code is then 2. Nothing is simulated.

    Where constraints are redundant: which joints share a freedom, whether that is so at other
    poses, whether the redundant rows agree, and which reactions are unique all the same.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.console import output, print_json
    from dap3d_core.cli.console.progress import RunProgress

    with RunProgress(quiet=as_json) as progress:
        try:
            compiled = dap.compile(
                model, method=method, allow_code=allow_code, announce=progress.announce
            )
        except dap.SimulationError as error:  # a method that does not fit the scene
            raise Refused(str(error)) from error
        progress.start()
        found = facts_of(compiled, correct_metric)
    if as_json:
        print_json(found)
    else:
        _show(output(), compiled, found)
    return REFUSED if found["mistakes"] else DONE


def facts_of(compiled: "CompiledModel", metric: str | None = None) -> dict[str, Any]:
    """The facts of a model: its violation as given, its rank where a run would start.

    A start that cannot be corrected is the one mistake that is found only here.

    Args:
        compiled: the model.
        metric: of the correction, in place of the scene's.
    """
    from dap3d_core.cli.console.initial_state import start_facts
    from dap3d_core.simulation import AssemblyError
    from dap3d_core.simulation.explain import types_of
    from dap3d_core.simulation.initial.assemble import violation

    model, settings = compiled.model, compiled.scene.simulation
    u, initial = model.u0, None
    mistakes: list[dict[str, Any]] = []
    try:
        metric = metric or str(settings.correct_metric)
        start = compiled.start(bool(settings.correct), settings.hold, metric)
        u, redundancy = start.u, start.redundancy
        if start.initial is not None and model.row_count:
            initial = start_facts(model.body_names, model.u0, u)
    except AssemblyError as error:
        mistakes.append({"key": "joints", "what": str(error)})
        redundancy = compiled.redundancy()
    rank = redundancy.rank
    position, velocity = violation(compiled.machine, model.u0)
    return {
        "scene": compiled.scene.name,
        "bodies": model.body_count,
        "rows": rank.rows,
        "rank": rank.rank,
        "redundant": rank.redundant,
        "dof": rank.dof,
        "joints": list(redundancy.joints),
        "contradiction": redundancy.contradiction,
        **_redundancy_facts(compiled, u, redundancy, assembled=not mistakes),
        "violation": {"position": position, "velocity": velocity},
        "initial": initial,
        "method": compiled.method,
        "reason": compiled.reason,
        "joint_types": types_of(compiled.checked.joints),
        "force_types": types_of(compiled.checked.forces),
        "function_types": types_of(compiled.checked.functions),
        "notes": list(compiled.notes),
        "mistakes": mistakes,
    }


def _redundancy_facts(
    compiled: "CompiledModel", u: Any, redundancy: "Redundancy", *, assembled: bool
) -> dict[str, Any]:
    """Groups, other poses, contradictions, reactions; ``about`` has the same in sentences."""
    import attrs

    from dap3d_core.simulation.redundancy.other_poses import Elsewhere, redundancy_elsewhere

    rank, elsewhere = redundancy.rank, Elsewhere((), None, None)
    about: list[str] = []
    if rank.redundant:
        if assembled:
            elsewhere = redundancy_elsewhere(compiled.machine, u, redundancy)
            about.append(elsewhere.describe(redundancy))
        about.insert(0, redundancy.describe_groups())
        about += redundancy.describe_contradictions()
        if redundancy.singular:
            about.append(redundancy.singular.describe())
    return {
        "rank_method": rank.method,
        "rank_tolerance": rank.tolerance,
        "groups": [attrs.asdict(group) for group in redundancy.groups],
        "everywhere": elsewhere.everywhere,
        "redundant_elsewhere": elsewhere.redundant,
        "poses": list(elsewhere.poses),
        "contradictions": [attrs.asdict(c) for c in redundancy.contradictions],
        "reactions": {
            "unique": list(redundancy.unique_joints),
            "shared": {r.joint: attrs.asdict(r) for r in redundancy.reactions()},
        },
        "about": about,
        "about_reactions": redundancy.describe_reactions(),
    }


def _show(console: Any, compiled: "CompiledModel", found: dict[str, Any]) -> None:
    from dap3d_core.cli.console.console import count, facts, say, title
    from dap3d_core.cli.console.initial_state import show_start
    from dap3d_core.cli.console.run_summary import show_notes

    title(console, found["scene"] or "scene without a name")
    bodies = count(found["bodies"], "body", "bodies")
    names = compiled.model.body_names
    some = ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
    violation = found["violation"]
    facts(
        console,
        [
            ("bodies", f"{bodies}: {some}"),
            ("joints", _listed(found["joint_types"])),
            ("forces", _listed(found["force_types"])),
            ("functions", _listed(found["function_types"])),
            ("freedoms", _freedoms(found)),
            ("violation", _violation(violation, compiled) if found["rows"] else ""),
            ("method", f"{found['method']}: {found['reason']}"),
        ],
    )
    if found["redundant"]:
        _show_redundancy(console, found)
    if found["initial"] and found["initial"]["changed"]:
        show_start(console, found["initial"])
    show_notes(console, found["notes"])
    for mistake in found["mistakes"]:
        say(console, mistake["what"], "bold red")
    if not found["mistakes"]:
        say(console, "no mistakes found", "green")


def _listed(types: dict[str, int]) -> str:
    return ", ".join(f"{number} {keyword}" for keyword, number in types.items()) or "none"


def _violation(violation: dict[str, float], compiled: "CompiledModel") -> str:
    words = f"position {violation['position']:.2g}, velocity {violation['velocity']:.2g}"
    if max(violation.values()) < 1e-10:
        return words
    settings = compiled.scene.simulation
    remedy = "a run corrects it" if settings.correct else "correct is off: a run would start so"
    return f"{words}; {remedy}"


def _freedoms(found: dict[str, Any]) -> str:
    from dap3d_core.cli.console.console import count

    words = f"{count(found['rows'], 'row')}, rank {found['rank']}"
    return f"{words}; {count(found['dof'], 'degree')} of freedom".replace("no degrees", "0 degrees")


def _show_redundancy(console: Any, found: dict[str, Any]) -> None:
    from dap3d_core.cli.console.console import items, say, title

    words = (
        f"redundant constraints: {found['redundant']} of {found['rows']} rows say what others say"
    )
    say(console, words, "yellow")
    said = list(found["about"])
    if found["contradictions"]:
        said.append("No motion satisfies rows that contradict each other")
    elif found["method"] == "standard":
        said.append(
            "The standard method refuses to run: replace a joint by one with fewer rows, or take "
            "--method lsq"
        )
    items(console, said)
    title(console, "reactions (accelerations are unique)")
    items(console, found["about_reactions"])
