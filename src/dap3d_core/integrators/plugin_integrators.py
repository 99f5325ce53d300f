"""Integrators of dap3d and of other packages, by name."""

from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

from dap3d_core.integrators import EXPLICIT, INTEGRATORS, Integrator, explicit
from dap3d_core.integrators.runge_kutta.tableau import Tableau, lower_triangle

if TYPE_CHECKING:
    from dap3d_core.interface.integrators import RungeKuttaMethod

#: Part of the controller that looks at the last error, from order 5 on: as in DOPRI5.
BETA = 0.04


def integrator_named(name: Any) -> Integrator:
    """The integrator of a name; "auto" begins with ``EXPLICIT``.

    Raises:
        PluginError: it is of another package, and cannot be used.
    """
    name = str(name)
    if name == "auto":
        return EXPLICIT
    return INTEGRATORS.get(name) or _of_package(name)


@lru_cache(maxsize=16)
def _of_package(name: str) -> Integrator:
    from dap3d_core.registry.extensions import extensions

    tableau = tableau_of(extensions("integrator").load(name))
    return Integrator(name, partial(explicit, tableau), adaptive=tableau.adaptive)


def tableau_of(method: "RungeKuttaMethod") -> Tableau:
    """The coefficients as the compiled core reads them.

    An adaptive method gets the cubic dense output of Hermite, between the values and rates of both
    ends, and the controller of DOPRI5.
    """
    s = len(method.b)
    errors: list[list[float]] = []
    if method.b_hat:
        given = [*method.b, 0.0], [*method.b_hat, 0.0][: s + 1]
        errors = [[x - y for x, y in zip(*given, strict=True)]]
    beta = BETA if method.order > 4 else 0.0
    return Tableau(
        name=method.keyword,
        order=method.order,
        stages=s,
        c=[*method.c, 1.0],
        a=lower_triangle(*method.a, method.b),
        e=errors,
        d=[[0.0] * (s + 1)] if errors else [],
        exponent=1.0 / method.order - 0.75 * beta,
        beta=beta,
        factor_min=1.0 / 5.0,
        factor_max=10.0,
    )
