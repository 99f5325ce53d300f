"""``dap3d sensitivities``: derivatives of a run by parameters, as elasticities."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, Refused, refusing

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal
    from dap3d_core.study.sensitivities.sensitivities import Sensitivities

#: Width of the longest bar of a table.
BAR = 12


@command(
    "Compute how quantities depend on parameters.",
    options.MODEL,
    click.option("--by", "by", multiple=True, required=True, metavar="NAME",
                 help="A parameter, such as bodies.crank.mass. As often as wanted."),
    click.option("--of", "of", multiple=True, metavar="QUANTITY",
                 help="A scalar quantity of results, as often as wanted; by default the outputs of "
                      "the scene, or the position of its last body."),
    *options.SETTING_OPTIONS.values(),
    options.output("Write quantities and derivatives over time (.nc), or draw bars and curves "
                   "(.png, .svg or .pdf)."),
    options.FORCE, options.ALLOW_CODE, options.JSON,
)  # fmt: skip
def sensitivities(
    model: str,
    *,
    by: tuple[str, ...],
    of: tuple[str, ...],
    output: str | None,
    force: bool,
    allow_code: bool,
    **settings: Any,
) -> int:
    """Simulate a MODEL, and list exact derivatives at the end of the run by parameters.

    An elasticity is the change of a quantity in per cent by 1 % more of a parameter.

    \b
    dap3d sensitivities pen2 --by bodies.rod.mass --by forces.gravity.gravity
    dap3d sensitivities pen2 --by bodies.rod.mass --of cylinder.r.z -o by-mass.png
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.console import show_data
    from dap3d_core.result import UnknownNameError

    if output is not None:
        from dap3d_core.cli.framework.paths import refuse_all, writable

        refuse_all(lambda: _check(Path(output)), lambda: writable(Path(output), force=force))
    scene = dap.load(model)
    with refusing(dap.SimulationError, UnknownNameError):
        found = dap.sensitivities(scene, list(by), allow_code=allow_code, **settings)
        last = found.result.summary.body_names[-1]
        usual = tuple(found.result.outputs) or tuple(f"{last}.r.{axis}" for axis in "xyz")
        quantities = _scalar(found, of or usual)
        data = _data(scene.name, found, quantities)
    if output is not None:
        _write(found, quantities, Path(output), force=force)
    show_data(data, lambda console: _show(console, data), output)
    return DONE


def _check(target: Path) -> None:
    """Refuse a file of another kind."""
    from dap3d_core.plot.figure_file import FORMATS

    if target.suffix.lower() not in (".nc", *FORMATS):
        raise ValueError(f"cannot write {target}: write .nc, or a figure: {', '.join(FORMATS)}")


def _scalar(found: "Sensitivities", quantities: tuple[str, ...]) -> tuple[str, ...]:
    """The quantities.

    Raises:
        Refused: one is a vector.
        UnknownNameError: there is no such quantity.
    """
    from dap3d_core.result import find

    for name in quantities:
        if (quantity := find(found.result, name)).components:
            raise Refused(f"{name} is a vector; take {quantity.columns[0]}")
    return quantities


def _data(name: str, found: "Sensitivities", quantities: tuple[str, ...]) -> dict[str, Any]:
    """The derivatives at the end as data."""
    return {
        "scene": name,
        "t": float(found.result.t[-1]),
        "by": list(found.names),
        "values": found.values,
        "of": [
            {
                "quantity": quantity,
                "value": float(found.result.quantity(quantity).values[-1]),
                "unit": found.result.quantity(quantity).unit,
                "derivatives": found.final(quantity),
                "elasticities": found.elasticities(quantity),
            }
            for quantity in quantities
        ],
        "notes": found.result.notes,
    }


def _write(
    found: "Sensitivities", quantities: tuple[str, ...], target: Path, *, force: bool
) -> None:
    if target.suffix.lower() == ".nc":
        found.save(target, quantities, force=force)
        return
    from dap3d_core.plot.figure import SensitivityPicture
    from dap3d_core.plot.figure_file import save_figure
    from dap3d_core.plot.style import WIDTH

    picture = SensitivityPicture(found, quantities)
    save_figure(picture.draw, target, (WIDTH, picture.height), 200.0, force=force)


def _show(console: "Terminal", data: dict[str, Any]) -> None:
    import numpy as np

    from dap3d_core.cli.console.console import scene_name

    console.title(scene_name(data["scene"]))
    for one in data["of"]:
        unit = "" if one["unit"] == "1" else f" {one['unit']}"
        console.say(f"{one['quantity']} = {one['value']:.6g}{unit} at t = {data['t']:g} s")
        sizes = np.abs(np.nan_to_num(one["elasticities"], posinf=0.0, neginf=0.0))
        largest = float(sizes.max(initial=0.0))
        rows = [
            (
                name,
                f"{derivative:.5g}",
                f"{elasticity:.3g}" if np.isfinite(elasticity) else "-",
                "#" * round(BAR * size / largest) if largest else "",
            )
            for name, derivative, elasticity, size in zip(
                data["by"], one["derivatives"], one["elasticities"], sizes, strict=True
            )
        ]
        console.table(("by", "derivative", "% by 1 %", ""), rows, right=(1, 2), fixed=(1, 2))
    console.section("notes", data["notes"])
