"""The classical Runge-Kutta method: order 4, fixed step, no error estimate.

Four right-hand sides a step. The method has no dense output: between two reporting times it takes
equal steps that are no longer than ``step``.

Sources: Kutta, Zeitschrift fuer Mathematik und Physik 46 (1901) 435; Hairer, Norsett, Wanner,
Solving Ordinary Differential Equations I, table II.1.2.
"""

from dap3d_core.integrators.runge_kutta.tableau import Tableau, lower_triangle

RK4 = Tableau(
    name="rk4",
    order=4,
    stages=4,
    c=[0, 1 / 2, 1 / 2, 1, 1],
    a=lower_triangle([1 / 2], [0, 1 / 2], [0, 0, 1], [1 / 6, 1 / 3, 1 / 3, 1 / 6]),
    e=[],
    d=[],
)
