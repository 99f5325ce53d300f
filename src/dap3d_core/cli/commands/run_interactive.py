"""Questions of the manual, for ``run`` without a model; the defaults are the scene's."""

import math
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.console.console import stderr

if TYPE_CHECKING:
    from dap3d_core.scene import Scene


def ask(given: dict[str, Any]) -> tuple[str, "Scene"]:
    """Ask for the model and the settings of its run.

    Args:
        given: settings by name; answers replace those that no option gives.

    Returns:
        The name of the model, and its scene.
    """
    model, scene = _ask_model()
    settings = scene.simulation
    if given["correct"] is None and scene.joints:
        question = "Do you want to correct the initial conditions?"
        given["correct"] = click.confirm(question, default=settings.correct is not False, err=True)
    if given["t_end"] is None:
        given["t_end"] = _ask_number("Final time in seconds", settings.t_end, min=0.0)
    t_end = given["t_end"]
    if given["dt"] is None and t_end:
        usual = settings.dt if isinstance(settings.dt, (int, float)) else 0.0
        usual = usual if 0.0 < usual <= t_end else t_end / 100.0
        given["dt"] = _ask_number(
            "Reporting time-step in seconds", usual, min=0.0, min_open=True, max=t_end
        )
    if given["method"] is None:
        given["method"] = _ask_method(str(settings.method))
    return model, scene


def _ask_model() -> tuple[str, "Scene"]:
    from dap3d_core.scene import SceneError, load, shipped_models

    console = stderr()
    console.say(f"Shipped models: {', '.join(shipped_models()) or 'none'}")
    while True:
        model = click.prompt("Which model (a name, a folder or a file)", type=str, err=True)
        try:
            return model, load(model)
        except SceneError as error:
            console.say(str(error), "red")


class _Finite(click.FloatRange):
    """A finite number within bounds."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        return number if math.isfinite(number) else self.fail("the number must be finite")


def _ask_number(question: str, usual: Any, **bounds: Any) -> float:
    """A number within its bounds; the question is repeated until it is one."""
    default = f"{usual:g}" if isinstance(usual, (int, float)) else None
    return float(click.prompt(question, default=default, type=_Finite(**bounds), err=True))


def _ask_method(usual: str) -> str:
    """The formulation; its first letters are enough, as in the manual."""
    from dap3d_core.settings import METHODS

    def read(text: str) -> str:
        matches = [m for m in METHODS if m.startswith(text.strip().lower())]
        if text.strip() and len(matches) == 1:
            return matches[0]
        raise click.UsageError(f"one of {', '.join(METHODS)}")

    default = usual if usual in METHODS else "auto"
    question = f"Solution method ({', '.join(METHODS)})"
    return str(click.prompt(question, default=default, value_proc=read, err=True))
