"""Functions of Python, numpy and the C library that compiled code may call."""

import ast
import builtins
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.writer import COUNT, EXACT, LIBRARY, SLOPE, SLOPES, VALUES, Writer

#: Python functions by the name of their compiled form.
KNOWN: dict[Any, str] = {
    **{getattr(math, n): n for n in LIBRARY if n not in ("hypot", "pow", "nextafter")},
    math.sqrt: "sqrt", np.sqrt: "sqrt", np.nextafter: "nextafter", np.rint: "rint",
    math.fabs: "fabs", math.ceil: "integer ceil", np.sign: "sign", np.complex128: "complex",
    complex: "complex", **{getattr(builtins, n): n for n in
    ("abs", "min", "max", "int", "float", "bool")},
}  # fmt: skip


def intrinsic(name: str) -> Callable[[Any], Any]:
    """Decorator of a Python function that compiled code calls in the form of a given name."""

    def mark(function: Any) -> Any:
        function.intrinsic = name
        return function

    return mark


#: A compiled form: takes the compiler, the node of the call and the arguments.
Form = Callable[[Writer, ast.Call, list[t.Value]], t.Value]


def _function_of_floats(name: str) -> Form:
    return lambda w, node, values: w.call(name, *[w.cast(node, v, t.FLOAT).word for v in values])


def _conversion(type_: Any) -> Form:
    return lambda w, node, values: w.cast(node, values[0], type_)


def _ceil(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    return w.cast(node, FORMS["ceil"](w, node, values), t.INT)


def _abs(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    [x] = values
    if x.type in (t.COMPLEX, t.FLOAT):
        return w.call("hypot" if x.type == t.COMPLEX else "fabs", *x.words)
    is_negative = w.comparison(node, ast.Lt(), x, t.constant(0))
    return w.select(node, is_negative, w.negative(node, x), x)


def _complex(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    if len(values) == 1:
        return w.cast(node, values[0], t.COMPLEX)
    return t.Value(t.COMPLEX, tuple(w.cast(node, v, t.FLOAT).word for v in values))


def _extreme(order: ast.cmpop) -> Form:
    """``min`` or ``max``: as in Python, a later value is taken only where the comparison holds."""

    def write(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
        if len(values) < 2:
            w.refuse(node, "min or max of one value", "give it two numbers")
        best = values[0]
        for value in values[1:]:
            best = w.select(node, w.comparison(node, order, value, best), value, best)
        return best

    return write


def _sign(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    x = sign = w.cast(node, values[0], t.FLOAT)  # NaN has that of itself
    for order, value in ((ast.Eq(), 0.0), (ast.Lt(), -1.0), (ast.Gt(), 1.0)):
        test = w.comparison(node, order, x, t.constant(0.0))
        sign = w.select(node, test, t.constant(value), sign)
    return sign


def _where(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    return w.select(node, w.cast(node, values[0], t.BOOL), *values[1:])


def _with_slopes(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    x, source = (w.cast(node, value, t.FLOAT).word for value in values)
    return w.emit(t.FLOAT, f"select i1 true, double {x}, double {source} {SLOPES}")


def _values_alone(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    return w.emit(t.BOOL, f"and i1 false, false {VALUES}")


def _slope(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    x, k = w.cast(node, values[0], t.FLOAT).word, w.cast(node, values[1], t.INT).word
    zero = t.constant(0.0).word
    return w.emit(t.FLOAT, f"select i1 true, double {zero}, double {x} {SLOPE} {k}")


def _slope_count(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    return w.emit(t.INT, f"add i64 0, 0 {COUNT}")


def _is_differentiated(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    return w.comparison(node, ast.Gt(), _slope_count(w, node, values), t.constant(0))


def _pointer(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    first, *lengths = values[0].words
    return t.Value(t.Array(values[0].type.item, 1), (first, w.count_of(lengths)))


#: Compiled forms, by name.
FORMS: dict[str, Form] = {
    **{name: _function_of_floats(name) for name in (*EXACT, *LIBRARY)},
    "int": _conversion(t.INT), "float": _conversion(t.FLOAT), "bool": _conversion(t.BOOL),
    "complex": _complex, "integer ceil": _ceil, "abs": _abs, "sign": _sign,
    "min": _extreme(ast.Lt()), "max": _extreme(ast.Gt()), "pointer": _pointer,
    "where": _where, "with_slopes": _with_slopes, "slope": _slope,
    "slope_count": _slope_count, "is_differentiated": _is_differentiated,
    "values_alone": _values_alone,
}  # fmt: skip
