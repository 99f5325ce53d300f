"""The settings of runs as options: for every command that makes runs of a scene."""

from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from dap3d_core.scene import Scene, SceneError

#: Settings of a run that the command line overrides, with the options that do.
SETTINGS = {
    "t_end": "--t-end",
    "dt": "--dt",
    "method": "--method",
    "integrator": "--integrator",
    "rtol": "--rtol",
    "atol": "--atol",
    "step": "--step",
    "correct": "--correct",
    "project": "--project",
    "correct_metric": "--correct-metric",
}


class _Tolerance(click.ParamType):  # type: ignore[type-arg]
    """A number, or numbers by quantity."""

    name = "tolerance"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """As ``Simulation.atol`` takes it."""
        if not isinstance(value, str):
            return value
        try:
            if "=" not in value:
                return float(value)
            pairs = (part.partition("=") for part in value.split(","))
            return {name.strip(): float(number) for name, _, number in pairs}
        except ValueError:
            self.fail(f"{value!r} is neither a number nor numbers by quantity (r=1e-12,v=1e-9)",
                      param, ctx)  # fmt: skip


ATOL = _Tolerance()

SETTING_OPTIONS = (
    click.option("--t-end", type=float, metavar="S",
                 help="Final time in s; 0 solves once at t = 0."),
    click.option("--dt", type=float, metavar="S", help="Reporting step in s."),
    click.option("--method", metavar="NAME",
                 help="Formulation: auto, unconstrained, standard, penalty, lsq."),
    click.option("--integrator", metavar="NAME",
                 help="dop853, dopri5, adams, radau for stiff scenes, or rk4 with --step."),
    click.option("--rtol", type=float, metavar="X", help="Relative tolerance."),
    click.option("--atol", type=ATOL, metavar="X",
                 help="Absolute tolerance: a number, or r=1e-12,p=1e-10,v=1e-12,w=1e-10 or some."),
    click.option("--step", type=float, metavar="S",
                 help="Fixed step in s, without error control."),
    click.option("--correct/--no-correct", default=None,
                 help="Correct the initial conditions so that they fulfil the constraints."),
    click.option("--correct-metric", type=click.Choice(["unit", "mass"]), default=None,
                 help="The least correction is that in m and rad, or weighted by masses."),
    click.option("--project/--no-project", default=None,
                 help="Bring every step onto the constraints."),
)  # fmt: skip
ALLOW_CODE = click.option(
    "--allow-code", is_flag=True,
    help="Allow the model's own types (plugin.py in its folder) to run.",
)  # fmt: skip
JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
QUIET = click.option("-q", "--quiet", is_flag=True, help="Print what went wrong alone.")


def with_options(*options: Callable[..., Any]) -> Callable[[Callable[..., Any]], Any]:
    """A decorator that adds options to a command, in this order."""

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


def check_settings(scene: "Scene", given: dict[str, Any]) -> None:
    """Refuse what the options say before the model is compiled; names the options."""
    import attrs

    from dap3d_core.scene import SceneError, check_simulation

    said = {name: value for name, value in given.items() if value is not None}
    try:
        check_simulation(attrs.evolve(scene.simulation, **said), scene.bodies)
    except SceneError as error:
        options = said.keys() | ({"step"} if "integrator" in said else set())
        about = options | ({"dt"} if "t_end" in said else set())
        mistakes = [m for m in error.mistakes if m.key in about]
        if mistakes:  # others are found again with the whole scene, with their lines
            raise in_options(SceneError(mistakes), options) from error


def in_options(
    error: "SceneError", said: Collection[str], options: Mapping[str, str] = SETTINGS
) -> "SceneError":
    """The same mistakes, those of some settings under the names of their options."""
    import attrs

    from dap3d_core.scene import MISSING, SceneError

    return SceneError(
        attrs.evolve(m, key=options[m.key], value=MISSING if m.value is None else m.value)
        if m.key in said and not m.file
        else m
        for m in error.mistakes
    )
