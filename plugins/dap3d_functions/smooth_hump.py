"""Function of type c: a smooth transition through an extreme value."""

from dap3d_core.interface import Function, hookimpl, number
from dap3d_core.kernels import where

interface_version = 1

#: A curve that leaves the range of its three values by more than this many times the range means
#: nothing any more.
MOST_BEYOND = 1e3


class SmoothHump(Function):
    """From f_start through the extreme f_max at x_max to f_end (manual: type ``c``).

    With D = x_end - x_start and u = (x - x_start) / D:

        f = f_start + q3 u^3 + q4 u^4 + q5 u^5 + q6 u^6 + q7 u^7,  constant before and after

    The five coefficients give value f_end with slope and curvature zero at u = 1, and value f_max
    with slope zero at x_max. Elsewhere the curve may leave the range from f_start and f_end to
    f_max; a warning says by how much.
    """

    keyword = "c"
    x_start: float = number(default=0.0, doc="where the transition begins")
    x_end: float = number(default=1.0, doc="where it ends")
    f_start: float = number(default=0.0, doc="value before")
    f_end: float = number(default=1.0, doc="value after")
    x_max: float = number(doc="where the extreme value is taken")
    f_max: float = number(doc="the extreme value")

    def prepare(self, bodies):
        import warnings

        import numpy as np

        D = self.x_end - self.x_start
        if not self.x_start < self.x_max < self.x_end:
            raise ValueError(
                f"x_max = {self.x_max:g} must lie between x_start = {self.x_start:g} "
                f"and x_end = {self.x_end:g}"
            )
        k, m = np.arange(3.0, 8.0), (self.x_max - self.x_start) / D
        equations = [np.ones(5), k, k * (k - 1.0), m**k, k * m ** (k - 1.0)]
        values = [self.f_end - self.f_start, 0.0, 0.0, self.f_max - self.f_start, 0.0]
        q = np.linalg.solve(equations, values)
        given = np.array([self.f_start, self.f_end, self.f_max])
        u = np.linspace(0.0, 1.0, 1001)
        f = self.f_start + u**3 * np.polyval(q[::-1], u)
        low, high = given.min() - f.min(), f.max() - given.max()
        if max(low, high) > MOST_BEYOND * np.ptp(given):
            raise ValueError(
                f"x_max = {self.x_max:g} is so near to an end that the curve reaches "
                f"{f.min():.3g} to {f.max():.3g}; take it nearer to the middle of x_start = "
                f"{self.x_start:g} and x_end = {self.x_end:g}"
            )
        if max(low, high) > 1e-3 * np.ptp(given):
            worst = np.argmin(f) if low > high else np.argmax(f)
            warnings.warn(
                f"reaches {f[worst]:.6g} at x = {self.x_start + D * u[worst]:.4g}, outside the "
                f"range {given.min():g} to {given.max():g} of f_start, f_end and f_max; "
                "an x_max nearer to the middle mends it",
                stacklevel=2,
            )
        return {"q": q}

    def breaks(self):
        return self.x_start, self.x_end

    def value(x, x_start, x_end, f_start, f_end, q):
        D = x_end - x_start
        q3, q4, q5, q6, q7 = q
        u = (x - x_start) / D
        inside = where(u < 0.0, 0.0, where(u > 1.0, 0.0, 1.0))
        u = where(u < 0.0, 0.0, where(u > 1.0, 1.0, u))
        f = u * u * u * (q3 + u * (q4 + u * (q5 + u * (q6 + u * q7))))
        f_1 = u * u * (3.0 * q3 + u * (4.0 * q4 + u * (5.0 * q5 + u * (6.0 * q6 + u * 7.0 * q7))))
        f_2 = u * (6.0 * q3 + u * (12.0 * q4 + u * (20.0 * q5 + u * (30.0 * q6 + u * 42.0 * q7))))
        f_3 = 6.0 * q3 + u * (24.0 * q4 + u * (60.0 * q5 + u * (120.0 * q6 + u * 210.0 * q7)))
        return f_start + f, inside * f_1 / D, inside * f_2 / (D * D), inside * f_3 / (D * D * D)


@hookimpl
def dap3d_functions():
    """The function types of this module."""
    return [SmoothHump]
