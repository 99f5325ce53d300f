"""Settings of a report: a ladder of tolerances or steps for each method and integrator."""

from collections.abc import Iterable, Sequence
from typing import Any

import attrs

from dap3d_core.formulations import FORMULATIONS
from dap3d_core.integrators import INTEGRATORS, TABLEAUS
from dap3d_core.simulation.settings import fits

#: Relative tolerances of integrators that choose their step.
TOLERANCES = tuple(float(f"1e-{k}") for k in range(3, 13))
QUICK_TOLERANCES = (1e-4, 1e-7, 1e-10)
#: atol divided by rtol.
ATOL = 1e-2
#: Rungs of a ladder of steps, each half the previous one: an error of order 4 falls by 2e8 from the
#: first to the last.
STEPS, QUICK_STEPS = 8, 3
QUICK_FACTOR = 4.0

#: Integrators of a report: time stepping of contacts is of low order, for what no other can do.
MEASURED = tuple(name for name, one in INTEGRATORS.items() if not one.steps_contacts)
#: Integrators that choose their step, those of the highest order first.
ADAPTIVE = tuple(
    sorted(
        (i.name for i in INTEGRATORS.values() if i.adaptive),
        key=lambda name: -int(getattr(TABLEAUS.get(name), "order", 0)),
    )
)


@attrs.frozen
class Setting:
    """One rung: a method, an integrator, and tolerances or a step.

    Attributes:
        method: the formulation.
        integrator: the method of integration.
        rtol, atol: tolerances of a step's error; None for fixed steps.
        step: fixed step, s; None where the integrator chooses it.
    """

    method: str
    integrator: str
    rtol: float | None = None
    atol: float | None = None
    step: float | None = None

    @property
    def options(self) -> dict[str, Any]:
        """Options of ``simulate``; without the method, for which a model is compiled."""
        return {name: value for name, value in self.to_dict().items() if name != "method"}

    @property
    def flags(self) -> str:
        """Options of the command line for the same run."""
        return " ".join(
            f"--{name} {value if isinstance(value, str) else repr(value)}"
            for name, value in self.to_dict().items()
        )

    @property
    def control(self) -> str:
        """The tolerance or the step, for users."""
        return f"step {self.step:g} s" if self.step is not None else f"rtol {self.rtol:.0e}"

    def to_dict(self) -> dict[str, Any]:
        """The values that are set, by name."""
        return attrs.asdict(self, filter=lambda _, value: value is not None)

    def __str__(self) -> str:
        return f"{self.method}, {self.integrator}, {self.control}"


def controlled(method: str, integrator: str, rtol: float) -> Setting:
    """The setting of an integrator that chooses its step."""
    return Setting(method, integrator, rtol, float(f"{ATOL * rtol:.6g}"))


def ladder(
    method: str, integrator: str, tolerances: Iterable[float], steps: Iterable[float]
) -> list[Setting]:
    """The rungs of a method and an integrator, coarse ones first; none where they do not fit."""
    if not fits(INTEGRATORS[integrator], FORMULATIONS[method]):
        return []
    if not INTEGRATORS[integrator].adaptive:
        return [Setting(method, integrator, step=h) for h in sorted(steps, reverse=True)]
    return [controlled(method, integrator, rtol) for rtol in sorted(tolerances, reverse=True)]


def ladder_of_steps(t_end: float, dt: float, step_count: int, *, quick: bool) -> tuple[float, ...]:
    """Fixed steps that suit a scene, s.

    The first is the mean step of a coarse controlled run: the time scale of the motion.

    Args:
        t_end: final time, s.
        dt: the reporting step, s, an upper bound.
        step_count: steps of the coarse run.
        quick: fewer steps.
    """
    first = min(t_end / max(step_count, 1), dt)
    count, factor = (QUICK_STEPS, QUICK_FACTOR) if quick else (STEPS, 2.0)
    return tuple(float(f"{first / factor**k:.3g}") for k in range(count))


def chosen(names: Sequence[str] | None, known: Sequence[str]) -> tuple[str, ...]:
    """The requested names, by default all known ones; each once."""
    return tuple(dict.fromkeys(names)) if names else tuple(known)
