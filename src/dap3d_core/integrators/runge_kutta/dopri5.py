"""Dormand and Prince's method of order 5(4) with free dense output of order 4.

Six right-hand sides a step: f at the result serves the error estimate, the dense output and the
next step. The choice for loose tolerances (1e-3 to 1e-6).

Sources: Dormand, Prince, J. Comp. Appl. Math. 6 (1980) 19; Hairer, Norsett, Wanner, Solving
Ordinary Differential Equations I, table II.5.2, dense output of II.6 with the coefficients of their
code DOPRI5, controller of II.4 with the stabilisation of volume II, IV.2 (beta = 0.04).
"""

from dap3d_core.integrators.runge_kutta.tableau import Tableau, lower_triangle

DOPRI5 = Tableau(
    name="dopri5",
    order=5,
    stages=6,
    c=[0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1],
    a=lower_triangle(
        [1 / 5],
        [3 / 40, 9 / 40],
        [44 / 45, -56 / 15, 32 / 9],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ),
    e=[[71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40]],
    d=[
        [
            -12715105075 / 11282082432,
            0,
            87487479700 / 32700410799,
            -10690763975 / 1880347072,
            701980252875 / 199316789632,
            -1453857185 / 822651844,
            69997945 / 29380423,
        ]
    ],
    exponent=1 / 5 - 0.75 * 0.04,
    beta=0.04,
    factor_min=1 / 5,
    factor_max=10.0,
)
