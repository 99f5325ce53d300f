"""``dap3d equilibrium --over``: an equilibrium followed over the values of a parameter."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dap3d_core.cli.framework import options
from dap3d_core.cli.process.exit_codes import DONE, PARTIAL, refusing

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal
    from dap3d_core.scene import Scene
    from dap3d_core.study.equilibrium_path import EquilibriumPath

#: Points and columns that are printed.
MOST_ROWS, MOST_COLUMNS = 60, 4
#: Smaller numbers, as parts of the largest of a column, are printed as zero.
ROUNDING = 1e-12
#: How a path ends, in words.
ENDS = {
    "reached": "at the last value",
    "returned": "back at the first value, behind a turning point",
    "stuck": "where no step goes on",
    "long": "after too many steps",
}


def follow(
    scene: "Scene",
    over: str,
    quantities: Sequence[str],
    start: Any,
    target: Path | None,
    *,
    force: bool,
    allow_code: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Follow the equilibrium over what --over names, and report the path; the exit code.

    Raises:
        Refused: --over is not PARAMETER=FROM:TO:N; there is no such quantity.
        SceneError: there is no such parameter, or the values are none.
        SimulationError: there is no equilibrium at the first value.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.console import print_json, stdout
    from dap3d_core.cli.console.progress import PreparationProgress
    from dap3d_core.result import UnknownNameError

    with (
        PreparationProgress(quiet=quiet or as_json) as progress,
        options.over_values(over) as (
            name,
            values,
        ),
    ):
        path = dap.equilibrium_path(scene, name, values, start=start, allow_code=allow_code,
                                    announce=progress.announce)  # fmt: skip
    with refusing(UnknownNameError):
        names = list(quantities) or [path.largest_motion()]
        data = {"scene": scene.name, **path.to_dict(*names)}
    if target is not None:
        from dap3d_core.plot import save_plot

        save_plot(path, names, target, force=force)
    if as_json:
        print_json(data | {"file": None if target is None else str(target)})
    elif not quiet:
        _show(stdout(), scene.name, path, names)
        if target is not None:
            stdout().say(f"{target} written", whole=True)
    return DONE if path.end in ("reached", "returned") else PARTIAL


def _show(console: "Terminal", name: str, path: "EquilibriumPath", names: Sequence[str]) -> None:
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
        for k in shown[:MOST_ROWS]
    ]
    heads = [path.parameter.rpartition(".")[2], *(label for label, _ in columns[:MOST_COLUMNS])]
    console.table((*heads, "", ""), rows, right=tuple(range(len(heads))),
                  fixed=tuple(range(len(heads))))  # fmt: skip
    if len(shown) > MOST_ROWS or len(columns) > MOST_COLUMNS:
        console.say("--json prints all", indent=2)
    console.section("notes", path.notes)


def _columns(path: "EquilibriumPath", name: str) -> list[tuple[str, Any]]:
    """Names and values of the components of a quantity; rounding errors are zero."""
    import numpy as np

    quantity = path.quantity(name)
    labels = [f"{name}.{c}" for c in quantity.components] or [name]
    columns = quantity.values.reshape(len(path.values), -1).T
    rounded = [np.where(np.abs(x) > ROUNDING * np.max(np.abs(x)), x, 0.0) for x in columns]
    return list(zip(labels, rounded, strict=True))
