"""Functions of Python, numpy and the C library that compiled code may call."""

import ast
import builtins
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.writer import EXACT, LIBRARY, Writer

#: Python functions by the name of their compiled form.
KNOWN: dict[Any, str] = {
    **{getattr(math, n): n for n in LIBRARY if n not in ("hypot", "pow", "nextafter")},
    math.sqrt: "sqrt", np.sqrt: "sqrt", np.nextafter: "nextafter", np.rint: "rint",
    math.fabs: "fabs", math.ceil: "ceil", np.sign: "sign", complex: "complex",
    np.complex128: "complex", **{getattr(builtins, n): n for n in
    ("abs", "min", "max", "int", "float", "bool", "len")},
}  # fmt: skip


def intrinsic(name: str) -> Callable[[Any], Any]:
    """Decorator of a Python function that compiled code calls in the form of a given name."""

    def mark(function: Any) -> Any:
        function.intrinsic = name
        return function

    return mark


def _function_of_floats(name: str) -> Callable[[Writer, ast.Call, list[t.Value]], t.Value]:
    def write(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
        return t.Value(t.FLOAT, (w.call(name, *[w.cast(node, v, t.FLOAT).word for v in values]),))

    return write


def _conversion(type_: Any) -> Callable[[Writer, ast.Call, list[t.Value]], t.Value]:
    return lambda w, node, values: w.cast(node, values[0], type_)


def _ceil(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    return w.cast(node, _function_of_floats("ceil")(w, node, values), t.INT)


def _length(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    if not isinstance(values[0].type, t.Array):
        w.refuse(node, "len of what is no array", "pass an array")
    return t.Value(t.INT, values[0].words[1:2])


def _abs(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    [value] = values
    if value.type == t.COMPLEX:
        return t.Value(t.FLOAT, (w.call("hypot", *value.words),))
    if value.type == t.FLOAT:
        return t.Value(t.FLOAT, (w.call("fabs", value.word),))
    x = w.cast(node, value, t.INT).word
    is_negative = w.new(f"icmp slt i64 {x}, 0")
    negative = w.new(f"sub nsw i64 0, {x}")
    return w.emit(t.INT, f"select i1 {is_negative}, i64 {negative}, i64 {x}")


def _complex(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    if len(values) == 1:
        return w.cast(node, values[0], t.COMPLEX)
    return t.Value(t.COMPLEX, tuple(w.cast(node, v, t.FLOAT).word for v in values))


def _extreme(order: ast.cmpop) -> Callable[[Writer, ast.Call, list[t.Value]], t.Value]:
    """``min`` or ``max``: as in Python, a later value is taken only where the comparison holds."""

    def write(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
        if len(values) < 2:
            w.refuse(node, "min or max of one value", "give it two numbers")
        best = values[0]
        for value in values[1:]:
            is_better, type_ = (
                w.comparison(node, order, value, best),
                t.wider(best.type, value.type),
            )
            if is_better.constant is not None:
                best = w.cast(node, value if is_better.constant else best, type_)
                continue
            a, b, word = w.cast(node, value, type_), w.cast(node, best, type_), type_.words[0]
            text = f"select i1 {is_better.word}, {word} {a.word}, {word} {b.word}"
            best = w.emit(type_, text)
        return best

    return write


def _sign(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    x = w.cast(node, values[0], t.FLOAT).word
    sign = x  # of NaN
    for relation, value in (("oeq", 0.0), ("olt", -1.0), ("ogt", 1.0)):
        test = w.new(f"fcmp {relation} double {x}, 0.0")
        sign = w.new(f"select i1 {test}, double {t.bits(value)}, double {sign}")
    return t.Value(t.FLOAT, (sign,))


def _pointer(w: Writer, node: ast.Call, values: list[t.Value]) -> t.Value:
    first, *lengths = values[0].words
    return t.Value(t.Array(values[0].type.item, 1), (first, w.count_of(lengths)))


#: Compiled forms: each takes the compiler, the node of the call and the arguments.
FORMS: dict[str, Callable[[Any, ast.Call, list[t.Value]], t.Value]] = {
    **{name: _function_of_floats(name) for name in (*EXACT, *LIBRARY)},
    "int": _conversion(t.INT), "float": _conversion(t.FLOAT), "bool": _conversion(t.BOOL),
    "complex": _complex, "ceil": _ceil, "len": _length, "abs": _abs, "sign": _sign,
    "min": _extreme(ast.Lt()), "max": _extreme(ast.Gt()), "pointer": _pointer,
}  # fmt: skip
