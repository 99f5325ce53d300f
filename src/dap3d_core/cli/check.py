"""``dap3d check``: validate a model and say what it is; nothing is run."""

from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.exits import DONE, REFUSED, Refused
from dap3d_core.cli.group import Command

if TYPE_CHECKING:
    from dap3d_core.simulation import CompiledModel


@click.command(cls=Command, short_help="Validate a model, count its degrees of freedom.")
@click.argument("model")
@click.option("--method", metavar="NAME", help="Formulation, in place of the scene's.")
@click.option(
    "--allow-code", is_flag=True, help="Allow the model's own types (plugin.py in its folder)."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
def check(model: str, *, method: str | None, allow_code: bool, as_json: bool) -> int:
    """Validate a MODEL; count its rows, rank and degrees of freedom.

    All mistakes are reported at once, each with file, line, key, what is allowed and the nearest
    right spelling; the exit code is then 2. Nothing is simulated.
    """
    import dap3d_core as dap
    from dap3d_core.cli.progress import RunProgress
    from dap3d_core.cli.rendering import output, print_json

    with RunProgress(quiet=as_json) as progress:
        try:
            compiled = dap.compile(
                model, method=method, allow_code=allow_code, announce=progress.announce
            )
        except dap.SimulationError as error:  # a method that does not fit the scene
            raise Refused(str(error)) from error
        found = facts_of(compiled)
    if as_json:
        print_json(found)
    else:
        _show(output(), compiled, found)
    return REFUSED if found["mistakes"] else DONE


def facts_of(compiled: "CompiledModel") -> dict[str, Any]:
    """The facts of a model: its violation as given, its rank where a run would start.

    A start that cannot be corrected is the one mistake that is found only here.
    """
    from dap3d_core.simulation import AssemblyError
    from dap3d_core.simulation.initial import correct_initial, violation

    model, start = compiled.model, None
    mistakes: list[dict[str, Any]] = []
    if model.row_count and compiled.scene.simulation.correct:
        try:
            start = correct_initial(compiled.machine, model.u0).u
        except AssemblyError as error:
            mistakes.append({"key": "joints", "what": str(error)})
    redundancy = compiled.redundancy(start)
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
        "violation": {"position": position, "velocity": velocity},
        "method": compiled.method,
        "reason": compiled.reason,
        "joint_types": _types(model.joints),
        "force_types": _types(model.forces),
        "function_types": _types(model.functions),
        "notes": list(compiled.notes),
        "mistakes": mistakes,
    }


def _types(groups: Any) -> dict[str, int]:
    """Keyword -> how many elements of this type there are."""
    return {group.keyword: len(set(group.members.tolist())) for group in groups}


def _show(console: Any, compiled: "CompiledModel", found: dict[str, Any]) -> None:
    from dap3d_core.cli.rendering import count, facts, say, title
    from dap3d_core.cli.summary import show_notes

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
        say(console, _about_redundancy(found), "yellow")
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
    from dap3d_core.cli.rendering import count

    words = f"{count(found['rows'], 'row')}, rank {found['rank']}"
    return f"{words}; {count(found['dof'], 'degree')} of freedom".replace("no degrees", "0 degrees")


def _about_redundancy(found: dict[str, Any]) -> str:
    from dap3d_core.simulation.redundancy import CONSISTENT

    words = (
        f"redundant constraints: {found['redundant']} of {found['rows']} rows say what others say, "
        f"in the joints {', '.join(found['joints'])}. Accelerations are unique, some reactions of "
        "these joints are not."
    )
    if found["contradiction"] > CONSISTENT:
        words += f" They contradict each other by {found['contradiction']:.2g}."
    if found["method"] == "standard":
        words += " The standard method refuses to run: replace a joint by one with fewer rows."
    return words
