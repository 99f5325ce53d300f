"""``dap3d info``: the contents of a result file."""

from pathlib import Path

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, refusing
from dap3d_core.cli.process.streams import prints_json


@command("Describe a result file.", options.RESULT, options.JSON)
def info(result: str) -> int:
    """Describe a RESULT file, or that of a sweep: its contents, and how the run ended."""
    from dap3d_core.study.sweep.dataset import is_sweep

    show = _show_sweep if is_sweep(result) else _show_run
    show(result)
    return DONE


def _show_sweep(file: str) -> None:
    import dap3d_core as dap
    from dap3d_core.cli.console.console import print_json, size, stdout
    from dap3d_core.cli.console.sweep_tables import show_failing, show_sweep, sweep_data
    from dap3d_core.result import ResultError

    with refusing(ResultError), dap.open_sweep(file) as dataset:
        data = sweep_data(dataset)
        text = dataset.attrs["scene"]
    byte_count = Path(file).stat().st_size
    if prints_json():
        print_json({"file": file, "size_bytes": byte_count, **data, "scene_text": text})
        return
    show_sweep(stdout(), data, f"{file}, {size(byte_count)}")
    show_failing(stdout(), data, "--json has them")


def _show_run(file: str) -> None:
    from dap3d_core.cli.console.console import count, print_json, scene_name, size, stdout
    from dap3d_core.cli.console.run_summary import MOST_OF_FILE, run_data, run_pairs, show_details
    from dap3d_core.cli.framework.paths import open_result
    from dap3d_core.registry.suggestions import some

    result = open_result(file)
    data, byte_count = run_data(result), Path(file).stat().st_size
    summary = result.summary
    names = {
        "body_names": summary.body_names,
        "joint_names": list(summary.joint_index),
        "contact_names": result.contact_names,
        "shape_names": result.record.contacts.names,
        "shape_contacts": len(result.record.contacts),
        "point_names": summary.point_names,
    }
    if prints_json():
        about = {"file": file, "size_bytes": byte_count}
        print_json({**about, **data, **names, "scene_text": result.scene_text})
        return
    console = stdout()
    settings = (f"{k} {_short(v)}" for k, v in result.settings.items()
                if v is not None and k != "stepping")  # fmt: skip
    shapes = result.record.contacts
    console.title(f"{scene_name(data['scene'])}: {data['status']}")
    console.facts(
        [
            ("file", f"{file}, {size(byte_count)}"),
            ("bodies", some(summary.body_names, 12)),
            ("joints", some(tuple(summary.joint_index), 12)),
            ("contacts", some(result.contact_names, 12)),
            ("shapes", some(shapes.names, 12)),
            ("met", f"at {count(len(shapes), 'point')} at reported instants" * bool(shapes.names)),
            ("points", some(summary.point_names, 12)),
            *run_pairs(data),
            ("settings", ", ".join(settings)),
            ("made with", ", ".join(f"{name} {v}" for name, v in result.versions.items())),
        ]
    )
    show_details(console, data, MOST_OF_FILE)


def _short(value: object) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, dict):  # tolerances by quantity
        return f"({', '.join(f'{k} {_short(v)}' for k, v in value.items())})"
    return f"{value:g}" if isinstance(value, float) else str(value)
