"""Settings of a run: names, defaults, allowed values and words, of which all else is made.

Scene files, arguments of functions, options of commands and the pages of the documentation have
their settings from ``SETTINGS``. This file imports next to nothing, for commands that only help.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple, TypedDict

#: Values of ``method`` and ``integrator``: "auto", and names of formulations and integrators.
METHODS = ("auto", "unconstrained", "standard", "penalty", "lsq", "joint")
INTEGRATORS = ("auto", "dopri5", "dop853", "adams", "rk4", "radau", "moreau")
#: Integrators without an error estimate, which need a step; integrators that take none.
FIXED_STEP, NO_STEP = ("rk4", "moreau"), ("adams",)
#: Relative tolerances below are beyond double precision.
SMALLEST_RTOL = 1e-14


class Setting(NamedTuple):
    """A setting of a run.

    Attributes:
        name: its key in [simulation], and the name of its argument; that of its option follows.
        kind: "time" and "end" (or 0), s, "number", "tolerance" (a number, or some by quantity),
            "truth", "word" (one of ``words``), "integrator" (those of packages as well), "bodies".
        default: its value; None where it is left open.
        text: what it is.
        words: the allowed words.
        least, most: bounds of a number; it is above ``least`` where there is no ``most``.
        on_command_line: commands take it as an option.
    """

    name: str
    kind: str
    default: Any
    text: str
    words: tuple[str, ...] = ()
    least: float = 0.0
    most: float | None = None
    on_command_line: bool = True

    @property
    def option(self) -> str:
        """Its option, such as ``--t-end``."""
        return f"--{self.name.replace('_', '-')}"


SETTINGS = {
    setting.name: setting
    for setting in (
        Setting("t_end", "end", None, "final time, s; 0 solves once at t = 0"),
        Setting("dt", "time", None, "reporting step, s, by default t_end / 100"),
        Setting("method", "word", "auto", f"formulation: {', '.join(METHODS)}", METHODS),
        Setting("integrator", "integrator", "dop853",
                "integrator: dop853, dopri5, adams, radau for stiff scenes, rk4 with a step, auto; "
                "moreau with a step for contacts",
                INTEGRATORS),
        Setting("rtol", "number", 1e-8, "relative tolerance of a step", least=SMALLEST_RTOL,
                most=1.0),
        Setting("atol", "tolerance", None, "absolute tolerance of a step: a number, or some by "
                "quantity: r (m), p, v (m/s), w (rad/s), z (states)"),
        Setting("step", "time", None, "fixed step, s, without error control"),
        Setting("correct", "truth", True,
                "correct the initial conditions so that they fulfil the constraints"),
        Setting("project", "truth", True, "project every step onto the constraints"),
        Setting("hold", "bodies", (), "bodies that the correction does not move",
                on_command_line=False),
        Setting("correct_metric", "word", "unit",
                "the smallest correction is that in m and rad (unit), or weighted by masses (mass)",
                ("unit", "mass")),
        Setting("start", "word", "scene",
                "start from the scene's initial conditions, or where they come to rest",
                ("scene", "equilibrium")),
        Setting("contact", "word", "auto",
                "follow contacts by events, exact, or by stepping, for any number of them",
                ("auto", "events", "stepping")),
        Setting("contact_step", "time", 1e-3, "longest step of contact stepping, s"),
        Setting("alpha", "number", 1e7, "factor of penalty forces", on_command_line=False),
        Setting("Omega", "number", 10.0, "natural frequency of method penalty, rad/s",
                on_command_line=False),
        Setting("mu", "number", 1.0, "damping ratio of method penalty", on_command_line=False),
    )
}  # fmt: skip


class StepSettings(TypedDict, total=False):
    """Settings of how a run takes its steps; None is that of the scene."""

    method: str | None
    integrator: str | None
    rtol: float | None
    atol: float | Mapping[str, float] | None
    step: float | None
    correct: bool | None
    project: bool | None
    correct_metric: str | None
    contact: str | None
    contact_step: float | None


class RunSettings(StepSettings, total=False):
    """The same, with its end and its reports."""

    t_end: float | None
    dt: float | None
