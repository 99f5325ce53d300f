"""``dap3d equilibrium``: where a model comes to rest."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework import completion, options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, PARTIAL, Refused, refusing

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal
    from dap3d_core.scene import Scene
    from dap3d_core.simulation.equilibrium.equilibrium import Equilibrium
    from dap3d_core.study.equilibrium_path import EquilibriumPath

#: Bodies and joints that are printed.
MOST_ROWS = 12
#: Suffixes of pictures, which are no names for a scene.
PICTURES = (".png", ".svg", ".pdf")
#: Smaller numbers, as parts of the largest of a table, are printed as zero.
PRINTED_AS_ZERO = 1e-12
#: Points and columns that are printed.
MOST_POINTS, MOST_COLUMNS = 60, 4
#: How a path ends, in words.
ENDS = {
    "reached": "at the last value",
    "returned": "back at the first value, behind a turning point",
    "stuck": "where no step goes on",
    "long": "after too many steps",
}


@command(
    "Find where a model comes to rest.",
    options.MODEL,
    options.output("Scene file to write, whose bodies start at rest there; with --over a picture, "
                   ".png, .svg or .pdf."),
    click.option("--over", metavar="PARAMETER=FROM:TO:N", shell_complete=completion.parameters,
                 help="Follow the equilibrium over the values of a parameter, through turning "
                      "points; also FROM:TO:N:log or a list."),
    click.option("--of", "quantities", multiple=True, metavar="QUANTITY",
                 help="With --over: what is listed and drawn, such as crank.r.z, as often as "
                      "wanted; by default the coordinate that changes most."),
    click.option("--from", "start_file", metavar="RESULT[@TIME]",
                 help="Search from the state of a result, at its end or at a time in s."),
    options.FORCE, options.ALLOW_CODE, options.JSON, options.QUIET,
)  # fmt: skip
def equilibrium(
    model: str,
    *,
    output: str | None,
    over: str | None,
    quantities: tuple[str, ...],
    start_file: str | None,
    force: bool,
    allow_code: bool,
) -> int:
    """Find the static equilibrium in which a MODEL comes to rest, and say whether it is stable.

    \b
    dap3d equilibrium pen2
    dap3d equilibrium car.toml -o rest.toml
    dap3d run car.toml --start equilibrium
    dap3d equilibrium truss.toml --over forces.load.f.z=60:-60:13 -o curve.png

    Of several equilibria it is the one that the start of the scene leads to. A start that is an
    equilibrium is reported as it is, stable or not. Forces are those at rest and at t = 0, drivers
    have their initial values, friction is left out. Exit code 1 where nothing holds a freedom: the
    message says which bodies give way, and where to.

    With --over the equilibrium at the first value is followed along its path, stable or not, to the
    last one. Where there is none beyond a value, as at the load at which a truss snaps through, the
    path turns: it may come to a value several times, and ends where it is back at the first one.
    Listed are the given values and the turning points, which the picture marks; unstable parts of
    it are dashed. --json has all points. Exit code 3 where the path ends on its way.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.console import show_data
    from dap3d_core.cli.framework.paths import open_state, write_text

    if quantities and over is None:
        raise Refused("--of names quantities of a path: give --over PARAMETER=FROM:TO:N")
    scene = dap.load(model)
    start, source = (None, None) if start_file is None else open_state(start_file)
    target = _target(output, over, (scene.path, source), force=force)
    if over is not None:
        return follow(scene, over, quantities, start, target, force=force, allow_code=allow_code)
    found = _found(scene, start, allow_code=allow_code)
    rest = None if target is None else found.scene()
    if target is not None and rest is not None:
        write_text(target, rest.to_toml())
    data = _data(found, model, rest.notes if rest is not None else []) | {"file": target}
    show_data(data, lambda console: _show(console, data, target))
    return DONE


def _target(
    output: str | None, over: str | None, sources: tuple[Any, ...], *, force: bool
) -> Path | None:
    """The file to write: a scene, or with --over a picture."""
    from dap3d_core.cli.framework.paths import SCENES, writable

    if output is None:
        return None
    if over is not None:
        from dap3d_core.plot.figure_file import check_suffix

        with refusing(ValueError):
            check_suffix(Path(output))
        return writable(Path(output), force=force, sources=sources)
    if Path(output).suffix.lower() in PICTURES:
        raise Refused(f"-o {output}: a picture is that of a path: give --over PARAMETER=FROM:TO:N")
    return writable(Path(output), force=force, sources=sources, kinds=SCENES)


def _found(scene: "Scene", start: Any, *, allow_code: bool) -> "Equilibrium":
    """The equilibrium; mistakes of a start are those of --from."""
    import dap3d_core as dap
    from dap3d_core.cli.console.progress import PreparationProgress

    with PreparationProgress() as progress:
        try:
            return dap.equilibrium(
                scene, start=start, allow_code=allow_code, announce=progress.announce
            )
        except dap.SceneError as error:
            raise options.in_options(error, {"start": "--from"}) from error


def _data(found: "Equilibrium", model: str, more_notes: list[str]) -> dict[str, Any]:
    """An equilibrium as data."""
    compiled, rank = found.compiled, found.redundancy.rank
    names = compiled.model.body_names
    partly = {r.joint: r.describe() for r in found.redundancy.reactions()}
    stiffness = [float(x.real) for x in found.stiffness]
    return {
        "model": model,
        "scene": compiled.scene.name,
        "rows": rank.rows,
        "redundant": rank.redundant,
        "dof": rank.dof,
        "stable": found.stable,
        "indifferent": found.indifferent,
        "stiffness": stiffness,
        "residual": found.residual,
        "violation": found.violation,
        "steps": found.steps,
        "bodies": {name: {"r": found.r[k], "p": found.p[k]} for k, name in enumerate(names)},
        "reactions": {
            joint: {
                "unique": joint not in partly,
                "about": partly.get(joint, "unique"),
                "on": {
                    slot: {"body": one.body, "force": one.force, "moment": one.moment}
                    for slot, one in found.reaction(joint).items()
                },
            }
            for joint in compiled.model.joint_names
        },
        "notes": [*found.notes, *more_notes],
    }


def _show(console: "Terminal", data: dict[str, Any], target: Path | None) -> None:
    from dap3d_core.cli.console.console import count, scene_name, shell_word
    from dap3d_core.cli.console.run_summary import degrees_of_freedom

    kind = "stable" if data["stable"] else "unstable"
    console.title(f"{scene_name(data['scene'])}: {kind} equilibrium")
    freedoms = degrees_of_freedom(data["dof"])
    if data["indifferent"]:
        freedoms += f", {data['indifferent']} indifferent"
    console.facts([
        ("freedoms", freedoms),
        ("residual", f"{data['residual']:.1e} of the forces; joints closed to "
                     f"{data['violation']:.1e}"),
        ("found in", count(data["steps"], "step")),
    ])  # fmt: skip
    _show_vectors(console, "bodies", [(name, "r, m", b["r"]) for name, b in data["bodies"].items()])
    _show_vectors(console, "reactions",
                  [(name, f"on {one['body']}, N" + ("" if r["unique"] else " *"), one["force"])
                   for name, r in data["reactions"].items()
                   for one in list(r["on"].values())[:1]])  # fmt: skip
    if data["redundant"]:
        console.say("* not unique, or in parts: see the notes", indent=2)
    console.section("notes", data["notes"])
    if target is not None:
        console.say(f"{target} written: the scene at rest. Next:", whole=True)
        console.say(f"dap3d run {shell_word(target)}", "green", indent=2, whole=True)


def _show_vectors(console: "Terminal", heading: str, rows: list[tuple[str, str, Any]]) -> None:
    """Print vectors with their names; the first of many."""
    import numpy as np

    if not rows:
        return
    console.title(heading)
    largest = max(float(np.max(np.abs(vector))) for *_, vector in rows)
    cells = [
        (name, what, *(f"{x:.6g}" if abs(x) > PRINTED_AS_ZERO * largest else "0" for x in vector))
        for name, what, vector in rows
    ]
    console.table(("", "", "x", "y", "z"), cells[:MOST_ROWS], right=(2, 3, 4))
    if len(rows) > MOST_ROWS:
        console.say(f"and {len(rows) - MOST_ROWS} more; --json prints all", indent=2)


def follow(
    scene: "Scene",
    over: str,
    quantities: Sequence[str],
    start: Any,
    target: Path | None,
    *,
    force: bool,
    allow_code: bool,
) -> int:
    """Follow the equilibrium over what --over names, and report the path; the exit code.

    Raises:
        Refused: --over is not PARAMETER=FROM:TO:N; there is no such quantity.
        SceneError: there is no such parameter, or the values are none.
        SimulationError: there is no equilibrium at the first value.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.console import show_data
    from dap3d_core.cli.console.progress import PreparationProgress
    from dap3d_core.result import UnknownNameError

    with PreparationProgress() as progress, options.over_values(over) as (name, values):
        path = dap.equilibrium_path(scene, name, values, start=start, allow_code=allow_code,
                                    announce=progress.announce)  # fmt: skip
    with refusing(UnknownNameError):
        names = list(quantities) or [path.largest_motion()]
        data = {"scene": scene.name, **path.to_dict(*names), "file": target}
    if target is not None:
        from dap3d_core.plot import save_plot

        save_plot(path, names, target, force=force)
    show_data(data, lambda console: _show_path(console, scene.name, path, names), target)
    return DONE if path.end in ("reached", "returned") else PARTIAL


def _show_path(
    console: "Terminal", name: str, path: "EquilibriumPath", names: Sequence[str]
) -> None:
    """Print the given values, the turning points, and where other paths cross."""
    import numpy as np

    from dap3d_core.cli.console.console import count, scene_name

    console.title(scene_name(name))
    unit = "" if path.unit in ("1", "SI") else f" {path.unit}"
    turns = ", ".join(f"{x:.8g}{unit}" for x in path.values[path.turning]) or "none"
    console.facts([
        ("over", f"{path.parameter}, {count(len(path.values), 'point')}"),
        ("turns at", turns),
        ("ends", ENDS[path.end]),
    ])  # fmt: skip
    columns = [(label, column) for one in names for label, column in _columns(path, one)]
    shown = np.flatnonzero(path.given | path.turning | path.branching)
    rows = [
        (
            f"{path.values[k]:.6g}",
            *(f"{column[k]:.6g}" for _, column in columns[:MOST_COLUMNS]),
            "stable" if path.stable[k] else "unstable",
            "turns" if path.turning[k] else "another path" if path.branching[k] else "",
        )
        for k in shown[:MOST_POINTS]
    ]
    heads = [path.parameter.rpartition(".")[2], *(label for label, _ in columns[:MOST_COLUMNS])]
    console.table((*heads, "", ""), rows, right=tuple(range(len(heads))),
                  fixed=tuple(range(len(heads))))  # fmt: skip
    if len(shown) > MOST_POINTS or len(columns) > MOST_COLUMNS:
        console.say("--json prints all", indent=2)
    console.section("notes", path.notes)


def _columns(path: "EquilibriumPath", name: str) -> list[tuple[str, Any]]:
    """Names and values of the components of a quantity; rounding errors are zero."""
    import numpy as np

    quantity = path.quantity(name)
    columns = quantity.values.reshape(len(path.values), -1).T
    rounded = [np.where(np.abs(x) > PRINTED_AS_ZERO * np.max(np.abs(x)), x, 0.0) for x in columns]
    return list(zip(quantity.columns, rounded, strict=True))
