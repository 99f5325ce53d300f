"""Integrators, compiled. All but radau know a vector and its functions, no mechanics."""

from collections.abc import Callable
from functools import partial
from typing import Any

import attrs

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.integrators.runge_kutta.dop853 import DOP853
from dap3d_core.integrators.runge_kutta.dopri5 import DOPRI5
from dap3d_core.integrators.runge_kutta.integration import RungeKutta
from dap3d_core.integrators.runge_kutta.rk4 import RK4
from dap3d_core.integrators.runge_kutta.tableau import Tableau
from dap3d_core.integrators.stepping.integration import Integration, StepCounts
from dap3d_core.integrators.stepping.integration_state import Status

#: The explicit Runge-Kutta methods by name.
TABLEAUS: dict[str, Tableau] = {method.name: method for method in (DOP853, DOPRI5, RK4)}


def explicit(
    method: Tableau, evaluator: Evaluator, y0: Any, times: Any, **options: Any
) -> Integration:
    """An integration by an explicit Runge-Kutta method."""
    return _of_functions(partial(RungeKutta, method), evaluator, y0, times, **options)


def _adams(evaluator: Evaluator, y0: Any, times: Any, **options: Any) -> Integration:
    from dap3d_core.integrators.adams import AdamsIntegration

    return _of_functions(AdamsIntegration, evaluator, y0, times, **options)


def _of_functions(
    make: Callable[..., Integration], evaluator: Evaluator, y0: Any, times: Any, **options: Any
) -> Integration:
    """An integration that knows the functions of an evaluator, and no mechanics."""
    return make(
        evaluator.functions, evaluator.system, evaluator.loops, y0, times,
        length_count=evaluator.length_count, watched=evaluator.watched, **options,
    )  # fmt: skip


def _radau(evaluator: Evaluator, y0: Any, times: Any, **options: Any) -> Integration:
    if evaluator.formulation.has_own_coordinates:
        from dap3d_core.integrators.radau.joint_integration import JointRadauIntegration

        return JointRadauIntegration(evaluator, y0, times, **options)
    from dap3d_core.integrators.radau.integration import RadauIntegration

    return RadauIntegration(evaluator, y0, times, **options)


def _moreau(evaluator: Evaluator, y0: Any, times: Any, **options: Any) -> Integration:
    from dap3d_core.integrators.moreau.integration import MoreauIntegration

    return MoreauIntegration(evaluator, y0, times, **options)


@attrs.frozen
class Integrator:
    """The properties of an integrator.

    Attributes:
        name: its name in scenes.
        make: an ``Integration`` of (evaluator, y0, times, **options), with the options of
            ``Integration``; imports and compiles what no other integrator needs.
        adaptive: steps are chosen by their error; else ``step`` is needed.
        one_step: explicit and of one step, so that runs may share one compiled call.
        leaves_singular: it can start at a singular pose.
        requires: why it needs a formulation that is exact; "" where it does not.
        needs_body_coordinates: its equations are those of body coordinates.
        prefers_body_coordinates: in others its time grows with the third power of their number.
        steps_contacts: contacts are followed by impulses over its steps, not by events.
    """

    name: str
    make: Callable[..., Integration]
    adaptive: bool = True
    one_step: bool = False
    leaves_singular: bool = False
    requires: str = ""
    needs_body_coordinates: bool = False
    prefers_body_coordinates: bool = False
    steps_contacts: bool = False


#: By name.
INTEGRATORS = {
    integrator.name: integrator
    for integrator in (
        Integrator("dopri5", partial(explicit, DOPRI5), one_step=True),
        Integrator("dop853", partial(explicit, DOP853), one_step=True, leaves_singular=True),
        Integrator("adams", _adams, requires="past accelerations on one smooth motion"),
        Integrator("rk4", partial(explicit, RK4), adaptive=False, one_step=True),
        Integrator(
            "radau", _radau, requires="the constraints themselves", prefers_body_coordinates=True
        ),
        Integrator(
            "moreau", _moreau, adaptive=False, requires="the constraints themselves",
            needs_body_coordinates=True, steps_contacts=True,
        ),
    )
}  # fmt: skip

#: That of ``contact = "stepping"``.
STEPPING = next(i for i in INTEGRATORS.values() if i.steps_contacts)
#: Integrator "auto" begins with the first, and continues with the second where a scene is stiff.
EXPLICIT, IMPLICIT = INTEGRATORS["dop853"], INTEGRATORS["radau"]

__all__ = [
    "EXPLICIT", "IMPLICIT", "INTEGRATORS", "TABLEAUS", "explicit", "Integration", "Integrator",
    "RungeKutta", "STEPPING", "StepCounts", "Status", "Tableau",
]  # fmt: skip
