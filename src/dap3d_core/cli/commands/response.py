"""``dap3d response``: gain and phase of outputs over inputs that oscillate."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, Refused, refusing

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal
    from dap3d_core.kernels.array_types import Floats
    from dap3d_core.simulation.linearization.linearization import Linearization
    from dap3d_core.simulation.linearization.state_matrices import Complex

#: Frequencies by default, evenly spaced by their logarithms; more stand about each mode.
COUNT = 200
#: Peaks listed of each output over each input.
LISTED = 10


@command(
    "Compute frequency responses, with Bode plots.",
    options.MODEL,
    click.option("--input", "inputs", multiple=True, required=True, metavar="NAME",
                 help="What oscillates: an input of the scene, a force or a number of one "
                      "(push.f.x), the acceleration of a driver. As often as wanted."),
    click.option("--output", "outputs", multiple=True, required=True, metavar="QUANTITY",
                 help="What answers: a quantity of results, as often as wanted."),
    click.option("--at", "start", metavar="RESULT[@TIME]",
                 help="Linearise about a state of a result, at an instant in s or its last one; by "
                      "default about the start of the model."),
    click.option("--from", "first", type=options.FiniteFloat(positive=True), metavar="HZ",
                 help="The lowest frequency; by default a tenth of the lowest mode's."),
    click.option("--to", "last", type=options.FiniteFloat(positive=True), metavar="HZ",
                 help="The highest frequency; by default ten times the highest mode's."),
    click.option("-n", "--number", type=click.IntRange(min=2, max=100_000), default=COUNT,
                 metavar="NUMBER", help="Frequencies beside those about the modes, 200."),
    click.option("-o", "target", type=click.Path(), metavar="FILE",
                 help="Draw gain and phase into a .png, .svg or .pdf file."),
    options.FORCE, options.ALLOW_CODE, options.JSON,
)  # fmt: skip
def response(
    model: str,
    *,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    start: str | None,
    first: float | None,
    last: float | None,
    number: int,
    target: str | None,
    force: bool,
    allow_code: bool,
) -> int:
    """Linearise a MODEL about a state, and list the peaks of its frequency responses.

    Gains are in units of the output over those of the input. A phase below zero lags.

    \b
    dap3d response car --input engine.f.z --output body.r.z
    dap3d response car --input road --output body.rdd.z --from 0.1 --to 100 -o bode.png
    """
    import dap3d_core as dap
    from dap3d_core.cli.commands.modes import state_of
    from dap3d_core.cli.console.console import show_data
    from dap3d_core.result import UnknownNameError

    if target is not None:
        from dap3d_core.cli.framework.paths import picture_checks, refuse_all

        refuse_all(*picture_checks(Path(target), force=force))
    scene = dap.load(model)
    at, t = state_of(start, allow_code) if start else (None, 0.0)
    with refusing(dap.SimulationError, UnknownNameError):
        lin = dap.linearize(scene, at=at, t=t, inputs=inputs, outputs=outputs,
                            allow_code=allow_code)  # fmt: skip
        frequencies = _frequencies(lin, first, last, number)
        found = lin.frequency_response(frequencies)
    if target is not None:
        from dap3d_core.plot.figure_file import save_figure
        from dap3d_core.plot.modes_over import BodePicture
        from dap3d_core.plot.style import WIDTH

        picture = BodePicture(frequencies, found, inputs, outputs)
        save_figure(picture.draw, Path(target), (WIDTH, picture.height), 200.0, force=force)
    data = _data(scene.name, lin, frequencies, found)
    show_data(data, lambda console: _show(console, data), target)
    return DONE


def _frequencies(
    lin: "Linearization", first: float | None, last: float | None, number: int
) -> "Floats":
    """Frequencies in Hz; those that are not given are around the modes."""
    from dap3d_core.simulation.linearization.state_matrices import samples, usual_range

    low, high = usual_range(lin.frequencies)
    low, high = low if first is None else first, high if last is None else last
    if not low < high:
        raise Refused(f"the frequencies run from {low:g} to {high:g} Hz: give --from below --to")
    return samples(lin.frequencies, lin.damping, low, high, number)


def _data(
    name: str, lin: "Linearization", frequencies: "Floats", found: "Complex"
) -> dict[str, Any]:
    """The responses as data."""
    import numpy as np

    from dap3d_core.simulation.linearization.state_matrices import peaks

    return {
        "scene": name,
        "t": lin.t,
        "steady": lin.is_steady,
        "frequencies": frequencies,
        "responses": [
            {
                "input": one,
                "output": other,
                "real": found[:, j, i].real,
                "imag": found[:, j, i].imag,
                "gain_at_lowest": float(np.abs(found[0, j, i])),
                "peaks": [peak._asdict() for peak in peaks(frequencies, found[:, j, i])],
            }
            for j, other in enumerate(lin.outputs)
            for i, one in enumerate(lin.inputs)
        ],
        "notes": lin.notes,
    }


def _show(console: "Terminal", data: dict[str, Any]) -> None:
    import math

    from dap3d_core.cli.console.console import scene_name

    console.title(scene_name(data["scene"]))
    if not data["steady"]:
        console.facts([("state", "no equilibrium, no steady motion: the response is of a moment")])
    low = data["frequencies"][0]
    for one in data["responses"]:
        console.say(
            f"{one['output']} over {one['input']}: {one['gain_at_lowest']:.5g} at {low:.4g} Hz"
        )
        rows = [
            (
                f"{peak['frequency']:.5g}",
                f"{peak['gain']:.5g}",
                f"{math.degrees(peak['phase']):.4g}",
            )
            for peak in one["peaks"][:LISTED]
        ]
        if rows:
            console.table(
                ("peak, Hz", "gain", "phase, deg"), rows, right=(0, 1, 2), fixed=(0, 1, 2)
            )
        else:
            console.say("no peak in this range")
    console.section("notes", data["notes"])
