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
        given["t_end"] = _ask_number("Final time in seconds", settings.t_end, least=0.0)
    t_end = given["t_end"]
    if given["dt"] is None and t_end:
        usual = settings.dt if isinstance(settings.dt, (int, float)) else 0.0
        usual = usual if 0.0 < usual <= t_end else t_end / 100.0
        given["dt"] = _ask_number("Reporting time-step in seconds", usual, above=0.0, most=t_end)
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


def _ask_number(
    question: str, usual: Any, *, least: float = -math.inf, above: float = -math.inf,
    most: float = math.inf,
) -> float:  # fmt: skip
    """A finite number within its bounds; the question is repeated until it is one."""

    def read(text: Any) -> float:
        try:
            value = float(text)
        except (TypeError, ValueError):
            raise click.UsageError(f"{text!r} is not a number") from None
        if not math.isfinite(value):
            raise click.UsageError("the number must be finite")
        if value < least:
            raise click.UsageError(f"the number must be at least {least:g}")
        if value <= above:
            raise click.UsageError(f"the number must be above {above:g}")
        if value > most:
            raise click.UsageError(f"the number must be at most {most:g}")
        return value

    default = f"{usual:g}" if isinstance(usual, (int, float)) else None
    return float(click.prompt(question, default=default, value_proc=read, err=True))


def _ask_method(usual: str) -> str:
    """The formulation; its first letters are enough, as in the manual."""
    from dap3d_core.scene import METHODS

    def read(text: str) -> str:
        matches = [m for m in METHODS if m.startswith(text.strip().lower())]
        if text.strip() and len(matches) == 1:
            return matches[0]
        raise click.UsageError(f"one of {', '.join(METHODS)}")

    default = usual if usual in METHODS else "auto"
    question = f"Solution method ({', '.join(METHODS)})"
    return str(click.prompt(question, default=default, value_proc=read, err=True))
