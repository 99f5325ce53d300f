"""Arguments and options of commands, each defined once."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework import completion
from dap3d_core.cli.framework.command import Option
from dap3d_core.cli.process.exit_codes import Refused
from dap3d_core.settings import SETTINGS as ALL_SETTINGS
from dap3d_core.settings import Setting

if TYPE_CHECKING:
    from dap3d_core.scene import Scene, SceneError


class Tolerance(click.ParamType):  # type: ignore[type-arg]
    """A number, or numbers by quantity: what ``Simulation.atol`` accepts."""

    name = "tolerance"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Convert r=1e-12,v=1e-9 to a dictionary."""
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


class Number(click.types.FloatParamType):
    """A number, with its unit in messages."""

    def __init__(self, unit: str = "") -> None:
        self.name = f"number in {unit}" if unit else "number"


class FiniteFloat(Number):
    """A finite number.

    Attributes:
        positive: True if it must be above 0.
    """

    def __init__(self, *, positive: bool = False) -> None:
        super().__init__()
        self.positive = positive

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Convert to a number; refuse inf and nan."""
        import math

        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number", param, ctx)
        if self.positive and number <= 0.0:
            self.fail(f"{value!r} is not above 0", param, ctx)
        return number


class Seconds(click.ParamType):  # type: ignore[type-arg]
    """A duration in s, written as 90, 90s, 5min or 2h."""

    name = "time"
    _UNITS = (("min", 60.0), ("s", 1.0), ("h", 3600.0), ("", 1.0))

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert to a number of seconds."""
        import math

        if isinstance(value, float):
            return value
        unit, factor = next((u, f) for u, f in self._UNITS if value.endswith(u))
        try:
            seconds = float(value.removesuffix(unit)) * factor
        except ValueError:
            seconds = math.nan
        if not 0.0 < seconds < math.inf:
            self.fail(f"{value!r} is no time; write 90, 90s, 5min or 2h", param, ctx)
        return seconds


def _setting(setting: Setting) -> Option:
    """The option of a setting of a run."""
    text = f"{setting.text[0].upper()}{setting.text[1:]}."
    if setting.kind == "truth":
        return click.option(f"{setting.option}/--no-{setting.option[2:]}", default=None, help=text)
    if setting.kind in ("word", "integrator"):  # those of packages are checked with the scene
        if setting.name in ("method", "integrator"):
            return click.option(setting.option, metavar="NAME", help=text)
        return click.option(setting.option, type=click.Choice(setting.words), help=text)
    if setting.kind == "tolerance":
        return click.option(setting.option, type=Tolerance(), metavar="X", help=text)
    unit = "s" if setting.kind in ("end", "time") else ""
    return click.option(setting.option, type=Number(unit), metavar=unit.upper() or "X", help=text)


#: Settings of a run that the command line overrides: name in the scene -> option, its name.
SETTING_OPTIONS = {n: _setting(one) for n, one in ALL_SETTINGS.items() if one.on_command_line}
SETTINGS = {name: ALL_SETTINGS[name].option for name in SETTING_OPTIONS}

RESULT = click.argument("result", type=click.Path())
MODEL = click.argument("model", shell_complete=completion.models)
MODEL_OF_RESULT = click.option(
    "--model", metavar="MODEL",
    help="The model whose own types (plugin.py) and meshes the run used.",
)  # fmt: skip
ALLOW_CODE = click.option(
    "--allow-code", is_flag=True,
    help="Allow the model's own types (plugin.py in its folder) to run.",
)  # fmt: skip
FPS = click.option("--fps", type=float, metavar="NUMBER",
                   help="Frames a second; every reported instant by default.")  # fmt: skip
STRICT = click.option(
    "--strict", is_flag=True,
    help="Exit with 1 if there are warnings (notes of a change) or the ledger does not close; the "
    "result is saved all the same.",
)  # fmt: skip
FORCE = click.option("--force", is_flag=True, help="Overwrite existing files.")
JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
QUIET = click.option("-q", "--quiet", is_flag=True, help="Print errors and warnings only.")


def output(help_text: str, metavar: str = "FILE", **settings: Any) -> Option:
    """The option ``--output``."""
    return click.option("-o", "--output", type=click.Path(), metavar=metavar, help=help_text,
                        **settings)  # fmt: skip


def check_settings(scene: "Scene", given: dict[str, Any]) -> None:
    """Refuse settings of options before the model is compiled, under the names of the options."""
    import attrs

    from dap3d_core.scene import SceneError, check_simulation

    values = {name: given[name] for name in SETTINGS if given[name] is not None}
    try:
        check_simulation(attrs.evolve(scene.simulation, **values), scene.bodies)
    except SceneError as error:
        names = of_settings(given)
        checked = names.keys() | ({"dt"} if "t_end" in values else set())
        mistakes = [m for m in error.mistakes if m.key in checked]
        if mistakes:  # others are reported with the whole scene, with their lines
            raise in_options(SceneError(mistakes), names) from error


def of_settings(given: Mapping[str, Any]) -> dict[str, str]:
    """Names of the options of settings that are given; an integrator may need ``--step``."""
    names = {name for name, value in given.items() if value is not None}
    names |= {"step"} if "integrator" in names else set()
    return {name: SETTINGS[name] for name in SETTINGS.keys() & names}


def in_options(error: "SceneError", options: Mapping[str, str] = SETTINGS) -> "SceneError":
    """The same mistakes; those of settings, outside of a file, under the names of options."""
    import attrs

    from dap3d_core.scene import MISSING, SceneError

    return SceneError(
        attrs.evolve(m, key=options[m.key], value=MISSING if m.value is None else m.value)
        if m.key in options and not m.file
        else m
        for m in error.mistakes
    )


@contextmanager
def over_values(over: str) -> Iterator[tuple[str, str]]:
    """The parameter and the values of ``--over``; mistakes in them are those of the option.

    Raises:
        Refused: it is not PARAMETER=FROM:TO:N.
    """
    from dap3d_core.scene import SceneError
    from dap3d_core.study.design import FORMS

    name, sign, values = (part.strip() for part in over.rpartition("="))
    if not (name and sign and values):
        raise Refused(f"--over {over}: write PARAMETER=FROM:TO:N, with values such as {FORMS}")
    try:
        yield name, values
    except SceneError as error:
        names = {"parameter": "--over", "values": "--over", "start": "--from"}
        raise in_options(error, names) from error
