"""``dap3d plugins``: every type that is installed, and what is wrong with one that is broken."""

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.process.exit_codes import DONE


@click.command(cls=Command, short_help="List the installed types.")
@click.option("--no-compile", is_flag=True, help="Do not try whether kernels compile.")
@click.option("--limit", type=click.FloatRange(min=0.0, min_open=True), metavar="SECONDS",
              help="How long each plugin may take to load (60 by default).")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
def plugins(*, no_compile: bool, limit: float | None, as_json: bool) -> int:
    """List the types of joints, forces and functions that are installed.

    A type that cannot be loaded, or whose kernels cannot be compiled, is listed with the reason.
    The kernels of other packages are compiled for that: the first time a second or so a type.

    DAP3D_BLOCK=NAME leaves out the types of a distribution, DAP3D_BLOCK=NAME:KEYWORD one of them.
    """
    import attrs

    import dap3d_core as dap
    from dap3d_core.cli.console.console import items, output, print_json, show, table, title
    from dap3d_core.registry import LOAD_LIMIT

    registry = dap.load_registry()
    found = registry.listing(compiling=not no_compile, limit_s=limit or LOAD_LIMIT)
    if as_json:
        print_json({"types": [attrs.asdict(t) for t in found], "notes": registry.notes})
        return DONE
    console = output()
    rows = [(t.kind or "?", t.keyword or "?", _origin(t), t.module, t.state) for t in found]
    columns = ("kind", "keyword", "distribution", "module", "state")
    show(console, table(columns, rows, fixed=(0, 1, 4)))
    faults = [f"{t.keyword or t.distribution}: {t.reason}" for t in found if t.reason]
    if faults:
        title(console, "not usable")
        items(console, faults, "red")
    if registry.notes:
        title(console, "notes")
        items(console, registry.notes)
    return DONE


def _origin(info: object) -> str:
    name, version = getattr(info, "distribution", ""), getattr(info, "version", "")
    return f"{name} {version}".strip() or "-"
