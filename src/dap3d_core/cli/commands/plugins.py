"""``dap3d plugins``: all installed types, and why some cannot be used."""

from typing import TYPE_CHECKING

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE

if TYPE_CHECKING:
    from dap3d_core.registry import PluginInfo


@command(
    "List the installed types.",
    click.option("--no-compile", is_flag=True, help="Do not check that kernels compile."),
    click.option("--limit", type=click.FloatRange(min=0.0, min_open=True), metavar="SECONDS",
                 help="Time in which a plugin must load (60 by default)."),
    options.JSON,
)  # fmt: skip
def plugins(*, no_compile: bool, limit: float | None, as_json: bool) -> int:
    """List the types of joints, forces and functions that are installed.

    A type that cannot be loaded, or whose kernels cannot be compiled, is listed with the reason.
    For that the kernels of other packages are compiled: the first time about a second a type.

    DAP3D_BLOCK=NAME leaves out the types of a distribution, DAP3D_BLOCK=NAME:KEYWORD one of them.
    """
    import attrs

    import dap3d_core as dap
    from dap3d_core.cli.console.console import print_json, stdout
    from dap3d_core.registry import LOAD_LIMIT

    registry = dap.load_registry()
    types = registry.listing(compiling=not no_compile, limit_s=limit or LOAD_LIMIT)
    if as_json:
        print_json({"types": [attrs.asdict(t) for t in types], "notes": registry.notes})
        return DONE
    console = stdout()
    rows = [(t.kind or "?", t.keyword or "?", _origin(t), t.module, t.state) for t in types]
    columns = ("kind", "keyword", "distribution", "module", "state")
    console.table(columns, rows, fixed=(0, 1, 4))
    faults = [f"{t.keyword or t.distribution}: {t.reason}" for t in types if t.reason]
    console.section("not usable", faults, "red")
    console.section("notes", registry.notes)
    return DONE


def _origin(info: "PluginInfo") -> str:
    return f"{info.distribution} {info.version}".strip() or "-"
