"""``dap3d check``: validates a model and describes it; nothing is run."""

from typing import TYPE_CHECKING, Any

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, REFUSED, refusing

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal
    from dap3d_core.simulation import CompiledModel
    from dap3d_core.simulation.redundancy.redundancy import Redundancy

#: Violations below this are rounding.
VIOLATION_ROUNDING = 1e-10


@command(
    "Validate a model, count its degrees of freedom.",
    options.MODEL,
    options.SETTING_OPTIONS["method"],
    options.SETTING_OPTIONS["correct_metric"],
    options.ALLOW_CODE,
    options.JSON,
)
def check(model: str, *, method: str | None, correct_metric: str | None, allow_code: bool) -> int:
    """Validate a MODEL; count its rows, rank and degrees of freedom.

    All mistakes are reported at once, each with file, line, key, what is allowed and the nearest
    right spelling; the exit code is then 2. Nothing is simulated.

    Of redundant constraints it says which joints share a freedom, whether they do so at other
    poses, whether the redundant rows agree, and which reactions are unique all the same.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.console import show_data
    from dap3d_core.cli.console.progress import ProgressBar

    with ProgressBar() as progress:
        with refusing(dap.SimulationError):  # a method that does not fit the scene
            compiled = dap.compile(
                model, method=method, allow_code=allow_code, announce=progress.announce
            )
        progress.start()
        data = _data(compiled, correct_metric)
    show_data(data, lambda console: _show(console, compiled, data))
    return REFUSED if data["mistakes"] else DONE


def _data(compiled: "CompiledModel", metric: str | None) -> dict[str, Any]:
    """The model as data: its violation as given, its rank where a run would start.

    Initial conditions that cannot be corrected are the one mistake that compiling does not find.
    """
    from dap3d_core.cli.console.run_summary import correction_data
    from dap3d_core.simulation import AssemblyError
    from dap3d_core.simulation.explain import contacts_of, types_of
    from dap3d_core.simulation.initial.assemble import violation

    model, settings = compiled.model, compiled.scene.simulation
    u, initial = model.u0, None
    mistakes: list[dict[str, Any]] = []
    shared: list[str] = []
    try:
        metric = metric or str(settings.correct_metric)
        start = compiled.start(bool(settings.correct), settings.hold, metric)
        u, redundancy = start.u, start.redundancy
        if start.initial is not None and model.row_count:
            initial = correction_data(model.body_names, model.u0, u)
    except AssemblyError as error:
        mistakes.append({"key": "joints", "what": str(error)})
        redundancy = compiled.redundancy()
    rank, is_assembled = redundancy.rank, not mistakes
    if is_assembled and rank.redundant and model.iterated_forces:
        from dap3d_core.simulation.redundancy.shared_reactions import shared_laws, why_refused

        laws = shared_laws(compiled.checked, compiled.evaluator, u, redundancy)
        shared = [law.force for law in laws]
        if words := why_refused(laws):
            mistakes.append({"key": "forces", "what": words})
    position, velocity = violation(compiled.evaluator, model.u0)
    return {
        "scene": compiled.scene.name,
        "bodies": model.body_count,
        "rows": rank.rows,
        "rank": rank.rank,
        "redundant": rank.redundant,
        "dof": rank.dof,
        "joints": list(redundancy.joints),
        "contradiction": redundancy.contradiction,
        **_redundancy_data(compiled, u, redundancy, shared, assembled=is_assembled),
        "violation": {"position": position, "velocity": velocity},
        "initial": initial,
        "method": compiled.method,
        "reason": compiled.reason,
        "joint_types": types_of(compiled.checked.joints),
        "force_types": types_of(compiled.checked.forces),
        "contact_types": types_of([*contacts_of(compiled.checked).values()]),
        "function_types": types_of(compiled.checked.functions),
        "notes": list(compiled.notes),
        "mistakes": mistakes,
    }


def _redundancy_data(
    compiled: "CompiledModel",
    u: Any,
    redundancy: "Redundancy",
    shared: list[str],
    *,
    assembled: bool,
) -> dict[str, Any]:
    """Redundancy as data; ``about`` has the same in sentences."""
    import attrs

    from dap3d_core.simulation.redundancy.other_poses import GenericRank, redundancy_elsewhere

    rank, elsewhere = redundancy.rank, GenericRank((), None, None)
    about: list[str] = []
    if rank.redundant:
        about.append(redundancy.describe_groups())
        if assembled:
            elsewhere = redundancy_elsewhere(compiled.evaluator, u, redundancy)
            about.append(elsewhere.describe(redundancy))
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
            "read_by": shared,
        },
        "about": about,
        "about_reactions": redundancy.describe_reactions(),
    }


def _show(console: "Terminal", compiled: "CompiledModel", data: dict[str, Any]) -> None:
    from dap3d_core.cli.console.console import count, scene_name
    from dap3d_core.cli.console.run_summary import degrees_of_freedom, show_correction
    from dap3d_core.registry.suggestions import some
    from dap3d_core.simulation.explain import counts_text

    console.title(scene_name(data["scene"]))
    names = some(compiled.model.body_names, 8)
    console.facts([
            ("bodies", f"{count(data['bodies'], 'body', 'bodies')}: {names}"),
            ("joints", counts_text(data["joint_types"])),
            ("forces", counts_text(data["force_types"])),
            ("contacts", counts_text(data["contact_types"]) if data["contact_types"] else ""),
            ("functions", counts_text(data["function_types"])),
            ("freedoms", f"{count(data['rows'], 'row')}, rank {data['rank']}; "
                         f"{degrees_of_freedom(data['dof'])}"),
            ("violation", _violation(data["violation"], compiled) if data["rows"] else ""),
            ("method", f"{data['method']}: {data['reason']}"),
        ],
    )  # fmt: skip
    if data["redundant"]:
        _show_redundancy(console, data)
    if data["initial"] and data["initial"]["changed"]:
        show_correction(console, data["initial"])
    console.section("notes", data["notes"])
    for mistake in data["mistakes"]:
        console.say(mistake["what"], "bold red")
    if not data["mistakes"]:
        console.say("no mistakes found", "green")


def _violation(violation: dict[str, float], compiled: "CompiledModel") -> str:
    text = f"position {violation['position']:.2g}, velocity {violation['velocity']:.2g}"
    if max(violation.values()) < VIOLATION_ROUNDING:
        return text
    corrects = compiled.scene.simulation.correct
    return f"{text}; {'a run corrects it' if corrects else 'correct is off: a run starts with it'}"


def _show_redundancy(console: "Terminal", data: dict[str, Any]) -> None:
    text = f"redundant constraints: {data['redundant']} of {data['rows']} rows repeat other rows"
    console.say(text, "yellow")
    about = list(data["about"])
    if data["contradictions"]:
        about.append("No motion satisfies rows that contradict each other")
    elif data["method"] == "standard":
        about.append(
            "The standard method refuses to run: replace a joint by one with fewer rows, or use "
            "--method lsq"
        )
    console.items(about)
    read = data["reactions"]["read_by"]
    title = f"reactions (read by {', '.join(read)})" if read else "reactions"
    title += "" if read else " (accelerations are unique)"
    console.section(title, data["about_reactions"])
