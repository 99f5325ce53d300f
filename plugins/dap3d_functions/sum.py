"""Sum of functions."""

from dap3d_core.interface import Function, functions, hookimpl

interface_version = 1


class Sum(Function):
    """f = f_1 + f_2 + ..., of the functions named, for every x."""

    keyword = "sum"
    functions: tuple = functions(doc="names of the functions that are added")

    def value(x, functions):
        f, f_dot, f_ddot, f_dddot = functions[0](x)
        for other in functions[1:]:
            g, g_dot, g_ddot, g_dddot = other(x)
            f, f_dot, f_ddot, f_dddot = f + g, f_dot + g_dot, f_ddot + g_ddot, f_dddot + g_dddot
        return f, f_dot, f_ddot, f_dddot


@hookimpl
def dap3d_functions():
    """The function types of this module."""
    return [Sum]
