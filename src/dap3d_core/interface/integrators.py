"""Integrators that packages bring: explicit Runge-Kutta methods, as data."""

from collections.abc import Iterator, Sequence

import attrs
import pluggy

from dap3d_core.interface.errors import PluginError
from dap3d_core.interface.hooks import PROJECT

#: Largest error of a row sum or an order condition, of coefficients written as fractions.
COEFFICIENT_ROUNDING = 1e-12

hookspec = pluggy.HookspecMarker(PROJECT)


@attrs.frozen(kw_only=True)
class RungeKuttaMethod:
    """An explicit Runge-Kutta method of s stages by its tableau.

    Notation of Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.1 and II.4.

    Attributes:
        keyword: the value of ``integrator`` in a scene, and the name of the entry point.
        order: of the solution that b gives.
        a: rows 2 to s, each as far as it goes.
        b: (s,) weights of the solution.
        b_hat: weights of the embedded solution, whose order is one less: s of them, or s + 1 with
            that of f at the result; () for a method of fixed steps.
    """

    keyword: str
    order: int
    a: Sequence[Sequence[float]]
    b: Sequence[float]
    b_hat: Sequence[float] = ()

    @property
    def c(self) -> list[float]:
        """(s,) abscissae: the sums of the rows."""
        return [0.0, *(sum(row) for row in self.a)]

    def check(self) -> None:
        """Check the shape, and the conditions of order 1 to 4 as far as they apply.

        Raises:
            PluginError: names what is wrong.
        """
        s, who = len(self.b), f"integrator {self.keyword}"
        if s < 1 or len(self.a) != s - 1 or any(len(r) > k for k, r in enumerate(self.a, 1)):
            raise PluginError(
                f"{who}: b has {s} weights, so a has {s - 1} rows, of at most 1, 2, ... numbers"
            )
        if self.b_hat and len(self.b_hat) not in (s, s + 1):
            raise PluginError(f"{who}: b_hat has {s} weights, or {s + 1}, not {len(self.b_hat)}")
        if type(self.order) is not int or not 1 <= self.order <= s:
            raise PluginError(f"{who}: order is a whole number from 1 to {s}, not {self.order!r}")
        for order, words, value in self._conditions():
            if order <= self.order and not abs(value) < COEFFICIENT_ROUNDING:
                raise PluginError(f"{who} is not of order {order}: {words} is off by {value:.3g}")
        if self.b_hat and not abs(sum(self.b_hat) - 1.0) < COEFFICIENT_ROUNDING:
            raise PluginError(f"{who}: the sum of b_hat is {sum(self.b_hat):.16g}, not 1")

    def _conditions(self) -> Iterator[tuple[int, str, float]]:
        """Order, formula and residual of the conditions up to order 4 (table II.2.2)."""
        a, c = [(), *self.a], self.c

        def through(x: Sequence[float]) -> list[float]:
            return [sum(w * v for w, v in zip(row, x, strict=False)) for row in a]

        def total(*factors: Sequence[float]) -> float:
            products = list(self.b)
            for factor in factors:
                products = [p * f for p, f in zip(products, factor, strict=True)]
            return sum(products)

        ac = through(c)
        cc = [x * x for x in c]
        yield 1, "sum b_i = 1", total() - 1.0
        yield 2, "sum b_i c_i = 1/2", total(c) - 1.0 / 2.0
        yield 3, "sum b_i c_i^2 = 1/3", total(cc) - 1.0 / 3.0
        yield 3, "sum b_i a_ij c_j = 1/6", total(ac) - 1.0 / 6.0
        yield 4, "sum b_i c_i^3 = 1/4", total(cc, c) - 1.0 / 4.0
        yield 4, "sum b_i c_i a_ij c_j = 1/8", total(c, ac) - 1.0 / 8.0
        yield 4, "sum b_i a_ij c_j^2 = 1/12", total(through(cc)) - 1.0 / 12.0
        yield 4, "sum b_i a_ij a_jk c_k = 1/24", total(through(ac)) - 1.0 / 24.0


@hookspec
def dap3d_integrators() -> list[RungeKuttaMethod]:
    """The integrators of a module: a list of ``RungeKuttaMethod``."""
    raise NotImplementedError
