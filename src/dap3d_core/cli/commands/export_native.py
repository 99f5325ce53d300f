"""``dap3d export MODEL --format c|fmu``: a model that runs without Python."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from dap3d_core.cli.process.exit_codes import DONE, Refused

#: Options of these formats alone, by parameter.
OPTIONS = {
    "quantities": click.option(
        "--quantity", "quantities", multiple=True, metavar="NAME",
        help="c, fmu: an output, such as load.r.z, once for each; those of the MODEL by default."),
    "parameters": click.option(
        "--parameter", "parameters", multiple=True, metavar="NAME",
        help="c, fmu: a number that may be set, such as forces.spring.k, once for each."),
    "platforms": click.option(
        "--platform", "platforms", multiple=True, metavar="NAME",
        help="c, fmu: linux, windows, macos, or linux-arm64 ..., once for each; this one by "
        "default."),
    "fmi": click.option("--fmi", type=click.Choice(["3", "2"]), default=None,
                        help="fmu: version of the standard; 3 by default."),
}  # fmt: skip


def is_native(kind: str | None, output: str | None) -> bool:
    """True if a file without a Python is asked for."""
    return kind in ("c", "fmu") or (kind is None and str(output or "").endswith(".fmu"))


def refuse_native(given: Mapping[str, Any]) -> None:
    """Refuse options of these formats for another.

    Raises:
        Refused: one is given.
    """
    words = {"quantities": "--quantity", "parameters": "--parameter", "platforms": "--platform"}
    for name, value in given.items():
        if value:
            raise Refused(f"{words.get(name, f'--{name}')} is of formats c and fmu")


def export_native(
    model: str,
    kind: str | None,
    output: str | None,
    *,
    quantities: Sequence[str],
    parameters: Sequence[str],
    platforms: Sequence[str],
    fmi: str | None,
    strict: bool,
    force: bool,
    allow_code: bool,
    as_json: bool,
) -> int:
    """Write a model as a C library or an FMU."""
    import dap3d_core as dap
    from dap3d_core.cli.console.console import count, print_json, stdout
    from dap3d_core.cli.framework.paths import writable

    kind = kind or "fmu"
    name = Path(model).stem if Path(model).is_file() else Path(model).name
    target = Path(output if output is not None else name + (".fmu" if kind == "fmu" else ""))
    scene = dap.load(model)
    if kind == "fmu" or not target.exists():
        writable(target, force=force, sources=(scene.path,))
    try:
        made: Any = dap.export_model(
            scene, target, format=kind, outputs=list(quantities) or None,
            parameters=list(parameters), platforms=list(platforms), fmi=int(fmi or 3),
            strict=strict, force=force, allow_code=allow_code,
        )  # fmt: skip
    except FileExistsError as error:
        raise Refused(f"{target} exists; --force overwrites it") from error
    except OSError as error:
        raise Refused(f"cannot write {target}: {error.strerror or error}") from error
    data = {
        "file": str(target), "format": kind, "platforms": made.platforms, "inputs": made.inputs,
        "parameters": made.parameters, "outputs": made.outputs, "left_out": made.left_out,
    }  # fmt: skip
    if as_json:
        print_json(data)
        return DONE
    console = stdout()
    contents = ", ".join(
        count(len(names), noun)
        for names, noun in ((made.inputs, "input"), (made.parameters, "parameter"),
                            (made.outputs, "output"))
        if names
    )  # fmt: skip
    console.say(f"{target} written: {contents}; {', '.join(made.platforms)}")
    console.section("left out", list(made.left_out))
    return DONE
