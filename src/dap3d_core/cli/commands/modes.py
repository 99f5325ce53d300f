"""``dap3d modes``: frequencies, damping, stability and mode shapes of a model about a state."""

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework import completion, options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, Refused, refusing

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal
    from dap3d_core.result import Result
    from dap3d_core.scene import Scene
    from dap3d_core.simulation.linearization.linearization import Linearization
    from dap3d_core.study.modes_over import ModesOver

#: Modes listed by default.
LISTED = 20
#: Bodies that are named of a mode, and the least share of its kinetic energy that they have.
NAMED, LEAST_SHARE = 3, 0.05


@command(
    "Compute frequencies, damping, mode shapes.",
    options.MODEL,
    click.option("--at", "--from", "start", metavar="RESULT[@TIME]",
                 help="Linearise about a state of a result, at an instant in s or its last one; by "
                      "default about the start of the model."),
    click.option("--t", "time", type=options.FiniteFloat(), metavar="S",
                 help="Time of drivers and functions; 0 by default. Not with --at."),
    click.option("--over", metavar="PARAMETER=FROM:TO:N", shell_complete=completion.parameters,
                 help="Follow the modes over the values of a parameter, also FROM:TO:N:log or a "
                      "list. Not with --at, --mode, -o."),
    click.option("-n", "--number", type=click.IntRange(min=1), metavar="NUMBER",
                 help="Number of modes, the lowest ones; 20 are listed by default, 10 of a model "
                      "of more than 150 bodies."),
    click.option("--plot", type=click.Path(), metavar="FILE",
                 help="Draw the eigenvalues, with --over the frequencies over the parameter, into "
                      "a .png, .svg or .pdf file."),
    click.option("--locus", is_flag=True,
                 help="With --over and --plot: draw the root locus, the eigenvalues in the complex "
                      "plane, in place of the frequencies."),
    click.option("--mode", type=click.IntRange(min=1), metavar="NUMBER",
                 help="With -o: the mode whose motion is written; the first by default."),
    options.output("Write the motion of a mode as a result, for `dap3d view` and `animate`."),
    options.FORCE, options.ALLOW_CODE, options.JSON,
)  # fmt: skip
def modes(
    model: str,
    *,
    start: str | None,
    time: float | None,
    over: str | None,
    number: int | None,
    plot: str | None,
    locus: bool,
    mode: int | None,
    output: str | None,
    force: bool,
    allow_code: bool,
) -> int:
    """Linearise a MODEL about a state, and list its modes, the lowest first.

    Of each mode: natural frequency, damping ratio, eigenvalue, and the bodies that have the largest
    shares of its kinetic energy. A real eigenvalue is a motion that decays or, where it is
    positive, one that grows. Zeros are motions that cost nothing.

    \b
    dap3d modes pen1
    dap3d modes pen1 --at pen1.nc@1.5
    dap3d modes pen1 --plot modes.png
    dap3d modes pen1 --over bodies.cone.mass=1:5:9 --plot campbell.png
    dap3d modes pen1 --over bodies.cone.mass=1:5:9 --plot locus.png --locus
    dap3d modes pen1 --mode 1 -o mode.nc     then: dap3d view mode.nc
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.console import show_data

    targets = _targets(plot, output, force)
    if start is not None and time is not None:
        raise Refused("--t does not go with --at: the time is that of the result, RESULT@TIME")
    if mode is not None and output is None:
        raise Refused("--mode chooses the motion that -o writes: name its file, -o FILE.nc")
    if locus and (over is None or plot is None):
        raise Refused("--locus draws eigenvalues over a parameter: give --over and --plot FILE.png")
    scene = dap.load(model)
    if over is not None:
        if not (start is None and output is None):
            raise Refused("--over does not go with --at, --mode and -o: it is about many starts")
        return _over(scene, over, time, number, plot, locus, force, allow_code)
    at, t = state_of(start, allow_code) if start else (None, time or 0.0)
    with refusing(dap.SimulationError):
        found = dap.linearize(scene, at=at, t=t, modes=number, allow_code=allow_code)
        data = _data(scene.name, found, number or LISTED)
    _draw(found, [], plot, force=force)
    if output is not None:
        with refusing(IndexError):
            found.motion((mode or 1) - 1).save(output, force=force)
    total = len(found.mode_eigenvalues)
    show_data(data, lambda console: _show(console, data, total), *targets)
    return DONE


def _over(
    scene: "Scene", over: str, time: float | None, number: int | None, plot: str | None,
    locus: bool, force: bool, allow_code: bool,
) -> int:  # fmt: skip
    """Follow the modes over a parameter, and report them."""
    import dap3d_core as dap
    from dap3d_core.cli.console.console import show_data

    with options.over_values(over) as (name, values), refusing(dap.SimulationError):
        found = dap.modes_over(scene, name, values, t=time or 0.0, modes=number or LISTED,
                               allow_code=allow_code)  # fmt: skip
    _draw(found, ["eigenvalues" if locus else "frequencies"], plot, force=force)
    names = ("parameter", "unit", "values", "frequencies", "damping", "grows", "stable", "steady",
             "notes")  # fmt: skip
    parts = {"real": found.eigenvalues.real, "imag": found.eigenvalues.imag}
    data = {"scene": scene.name} | {n: getattr(found, n) for n in names} | parts
    show_data(data, lambda console: _show_over(console, scene.name, found), plot)
    return DONE


def _draw(found: Any, names: list[str], plot: str | None, *, force: bool) -> None:
    """Draw into the file of --plot, where there is one."""
    if plot is not None:
        from dap3d_core.plot import save_plot

        with refusing(ValueError):
            save_plot(found, names, plot, force=force)


def _targets(plot: str | None, output: str | None, force: bool) -> list[Path]:
    """The files to write; Refused where one cannot be written, or is no picture."""
    from dap3d_core.cli.framework.paths import RESULTS, picture_checks, refuse_all, writable

    checks = [] if plot is None else picture_checks(Path(plot), force=force)
    if output is not None:
        checks.append(partial(writable, Path(output), force=force, kinds=RESULTS))
    refuse_all(*checks)
    return [Path(path) for path in (plot, output) if path is not None]


def state_of(start: str, allow_code: bool) -> tuple["Result", float]:
    """The result that --from names, and the instant.

    Raises:
        Refused: the instant is no number, or the file holds none.
    """
    from dap3d_core.cli.framework.paths import open_state

    (result, t), path = open_state(start, allow_code=allow_code)
    if not len(result.t):
        raise Refused(f"{path} holds no instants")
    return result, float(result.t[-1]) if t is None else t


def _data(name: str, found: "Linearization", number: int) -> dict[str, Any]:
    """The modes as data."""
    values = found.mode_eigenvalues
    listed = [
        {
            "number": k + 1,
            "frequency": found.frequencies[k],
            "damping": found.damping[k],
            "eigenvalue": [values[k].real, values[k].imag],
            "bodies": _shares(found, k),
        }
        for k in range(min(number, len(values)))
    ]
    return {
        "scene": name,
        "t": found.t,
        "dof": found.dof,
        "eigenvalues": [[value.real, value.imag] for value in found.eigenvalues],
        "frequencies": found.frequencies,
        "damping": found.damping,
        "stable": found.stable,
        "steady": found.is_steady,
        "modes": listed,
        "notes": found.notes,
    }


def _shares(found: "Linearization", k: int) -> dict[str, float]:
    """The largest shares of bodies in the kinetic energy of a mode, by name."""
    shares = found.participation[k]
    order = sorted(range(len(shares)), key=lambda b: -shares[b])[:NAMED]
    return {found.body_names[b]: float(shares[b]) for b in order if shares[b] >= LEAST_SHARE}


def _show(console: "Terminal", data: dict[str, Any], total: int) -> None:
    from dap3d_core.cli.console.console import scene_name
    from dap3d_core.cli.console.run_summary import degrees_of_freedom

    console.title(scene_name(data["scene"]))
    stability = "stable" if data["stable"] else "unstable: a motion grows"
    if not data["steady"]:
        stability = "no equilibrium, no steady motion"
    console.facts([("freedoms", degrees_of_freedom(data["dof"])), ("stability", stability)])
    rows = [
        (
            str(mode["number"]),
            f"{mode['frequency']:.5g}",
            f"{mode['damping']:.3g}" if abs(mode["damping"]) > 5e-10 else "0",
            _complex(*mode["eigenvalue"]),
            ", ".join(mode["bodies"]),
        )
        for mode in data["modes"]
    ]
    if rows:
        console.table(("", "Hz", "damping", "eigenvalue", "moves most"), rows, right=(0, 1, 2, 3),
                      fixed=(0, 1, 2, 3))  # fmt: skip
    if total > len(rows):
        console.say(f"and {total - len(rows)} more: -n {total} lists all")
    console.section("notes", data["notes"])


def _complex(real: float, imaginary: float) -> str:
    """An eigenvalue for people: -0.5 ± 3.836i."""
    size = math.hypot(real, imaginary)
    shown = 0.0 if abs(real) <= 1e-9 * size else real
    if imaginary == 0.0:
        return f"{shown:.4g}"
    lead = f"{shown:.3g} " if shown else ""
    return f"{lead}± {imaginary:.4g}i"


def _show_over(console: "Terminal", name: str, found: "ModesOver") -> None:
    """Print the frequency and damping of each mode at the first and the last value."""
    import numpy as np

    from dap3d_core.cli.console.console import scene_name

    console.title(scene_name(name))
    x, stable = found.values, found.stable
    where = "stable at all values"
    if not found.steady.all():
        where = f"no equilibrium, no steady motion at {np.sum(~found.steady)} of {len(x)} values"
    elif not stable.all():
        unstable = x[~stable]
        where = f"unstable at {len(unstable)} of {len(x)} values, "
        where += f"{unstable.min():g} to {unstable.max():g}"
    unit = "" if found.unit in ("1", "SI") else f" {found.unit}"
    ends = f"{found.parameter} from {x[0]:g} to {x[-1]:g}{unit}, {len(x)} values"
    console.facts([("over", ends), ("stability", where)])
    f, damping, grows = found.frequencies, found.damping, found.grows
    rows = [
        (
            str(k + 1),
            *(_number(f[row, k], "", 0.0) for row in (0, -1)),
            *(_number(damping[row, k], "0", 5e-10) for row in (0, -1)),
            f"{x[grows[:, k]].min():g} to {x[grows[:, k]].max():g}" if grows[:, k].any() else "",
        )
        for k in range(f.shape[1])
    ]
    if rows:
        console.table(("", "Hz, first", "last", "damping, first", "last", "grows"), rows,
                      right=(0, 1, 2, 3, 4), fixed=(0, 1, 2, 3, 4))  # fmt: skip
    console.section("notes", found.notes)


def _number(value: float, zero: str, least: float) -> str:
    """A number for people; a dash where there is no such mode."""
    if value != value:
        return "-"
    return zero if zero and abs(value) <= least else f"{value:.5g}" if not zero else f"{value:.3g}"
