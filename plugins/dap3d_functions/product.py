"""Product of functions."""

from dap3d_core.interface import Function, functions, hookimpl

interface_version = 1


class Product(Function):
    """f = f_1 f_2 ..., of the functions named, for every x; derivatives by Leibniz's rule."""

    keyword = "product"
    functions: tuple = functions(doc="names of the functions that are multiplied")

    def value(x, functions):
        f, f1, f2, f3 = functions[0](x)
        for other in functions[1:]:
            g, g1, g2, g3 = other(x)
            f, f1, f2, f3 = (
                f * g,
                f1 * g + f * g1,
                f2 * g + 2.0 * f1 * g1 + f * g2,
                f3 * g + 3.0 * (f2 * g1 + f1 * g2) + f * g3,
            )
        return f, f1, f2, f3


@hookimpl
def dap3d_functions():
    """The function types of this module."""
    return [Product]
