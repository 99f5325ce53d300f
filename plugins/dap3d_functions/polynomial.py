"""Function of type a: a polynomial of second order."""

from dap3d_core.interface import Function, hookimpl, vec3

interface_version = 1


class Polynomial(Function):
    """f = c1 + c2 x + c3 x^2, for every x (manual: type ``a``)."""

    keyword, smooth = "a", True
    synonyms = ("polynomial", "linear", "constant")
    coeff: tuple = vec3(doc="c1, c2, c3")

    def value(x, coeff):
        c1, c2, c3 = coeff
        return c1 + x * (c2 + x * c3), c2 + 2.0 * x * c3, 2.0 * c3, 0.0


@hookimpl
def dap3d_functions():
    """The function types of this module."""
    return [Polynomial]
