"""``dap3d info``: what a result file holds."""

from pathlib import Path

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.framework.completion import results as complete_results
from dap3d_core.cli.process.exit_codes import DONE, Refused


@click.command(cls=Command, short_help="Say what a result file holds.")
@click.argument("result", shell_complete=complete_results)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
def info(result: str, *, as_json: bool) -> int:
    """Say what a RESULT file, or that of a sweep, holds and how it went."""
    from dap3d_core.study.sweep.dataset import is_sweep

    return _of_sweep(result, as_json=as_json) if is_sweep(result) else _of_run(result, as_json)


def _of_sweep(file: str, *, as_json: bool) -> int:
    """Tell of the points of a sweep."""
    import dap3d_core as dap
    from dap3d_core.cli.console.console import output, print_json, size
    from dap3d_core.cli.console.sweep_tables import show_failing, show_sweep, sweep_facts
    from dap3d_core.result import ResultError

    try:
        with dap.open_sweep(file) as dataset:
            found = sweep_facts(dataset)
            text = dataset.attrs["scene"]
    except ResultError as error:
        raise Refused(str(error)) from error
    byte_count = Path(file).stat().st_size
    if as_json:
        print_json({"file": file, "size_bytes": byte_count, **found, "scene_text": text})
        return DONE
    show_sweep(output(), found, f"{file}, {size(byte_count)}")
    show_failing(output(), found, "--json has them")
    return DONE


def _of_run(result: str, as_json: bool) -> int:
    """Tell of the run that made a result."""
    from dap3d_core.cli.console.console import facts, output, print_json, size, title
    from dap3d_core.cli.console.run_facts import facts_of
    from dap3d_core.cli.console.run_summary import run_pairs, show_events, show_ledger, show_remarks
    from dap3d_core.cli.framework.paths import open_result

    opened = open_result(result)
    found = {"file": result, "size_bytes": Path(result).stat().st_size, **facts_of(opened)}
    subject = opened.subject
    names = {
        "body_names": subject.body_names,
        "joint_names": subject.joint_names,
        "point_names": subject.point_names,
    }
    if as_json:
        print_json({**found, **names, "scene_text": opened.scene_text})
        return DONE
    console = output()
    versions = ", ".join(f"{name} {number}" for name, number in opened.versions.items())
    settings = ", ".join(f"{k} {_short(v)}" for k, v in opened.settings.items() if v is not None)
    title(console, f"{found['scene'] or 'scene without a name'}: {found['status']}")
    facts(
        console,
        [
            ("file", f"{result}, {size(found['size_bytes'])}"),
            ("bodies", _some(subject.body_names)),
            ("joints", _some(subject.joint_names)),
            ("points", _some(subject.point_names)),
            *run_pairs(found),
            ("settings", settings),
            ("made with", versions),
        ],
    )
    show_events(console, found)
    show_ledger(console, found)
    show_remarks(console, found)
    return DONE


def _some(names: tuple[str, ...], most: int = 12) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _short(value: object) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)
