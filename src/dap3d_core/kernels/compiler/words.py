"""Functions of Python, numpy and the C library that compiled code may call."""

import ast
import builtins
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from dap3d_core.kernels.compiler.types import (
    BOOL,
    COMPLEX,
    FLOAT,
    INT,
    Array,
    Value,
    bits,
    wider,
)

#: LLVM intrinsics, exact on every platform.
EXACT = ("sqrt", "fabs", "floor", "ceil", "rint")
#: Functions of the C library, which plain Python calls as well. LLVM must not replace them
#: (nobuiltin): its own versions may round differently.
LIBRARY = ("sin", "cos", "tan", "tanh", "exp", "log", "asin", "acos", "atan", "atan2", "pow",
           "hypot", "nextafter")  # fmt: skip
#: Python functions by the name of their compiled form.
KNOWN: dict[Any, str] = {
    **{getattr(math, n): n for n in LIBRARY if n not in ("hypot", "pow", "nextafter")},
    math.sqrt: "sqrt", np.sqrt: "sqrt", np.nextafter: "nextafter", np.rint: "rint",
    math.fabs: "fabs", math.ceil: "ceil", np.sign: "sign", complex: "complex",
    np.complex128: "complex", **{getattr(builtins, n): n for n in
    ("abs", "min", "max", "int", "float", "bool", "len")},
}  # fmt: skip

#: Compiled forms: each takes the compiler, the node of the call and the arguments.
WORDS: dict[str, Callable[[Any, Any, list[Value]], Value]] = {}


def word(name: str) -> Callable[[Any], Any]:
    """Mark a Python function as known to compiled code under a name of ``WORDS``."""

    def mark(function: Any) -> Any:
        function.compiled_word = name
        return function

    return mark


def _writes(*names: str) -> Callable[[Any], Any]:
    def keep(write: Any) -> Any:
        WORDS.update(dict.fromkeys(names, write))
        return write

    return keep


def call_of(program: Any, name: str, words: Sequence[str]) -> str:
    """LLVM IR of a call of a function of floats, which is declared in the program."""
    symbol = f"llvm.{name}.f64" if name in EXACT else name
    kind = "" if name in EXACT else " nobuiltin nounwind willreturn memory(none)"
    types = ", ".join(["double"] * len(words))
    program.needs[symbol] = f"declare double @{symbol}({types}){kind}"
    return f"call double @{symbol}({', '.join(f'double {x}' for x in words)}){kind}"


def function_of(name: str) -> Callable[[Any, Any, list[Value]], Value]:
    """The compiled form of a function of floats."""

    def write(c: Any, node: Any, values: list[Value]) -> Value:
        words = [c.cast(node, v, FLOAT).word for v in values]
        return Value(FLOAT, (c.new(call_of(c.program, name, words)),))

    return write


WORDS.update({name: function_of(name) for name in (*EXACT, *LIBRARY)})


@_writes("ceil", "len")
def _whole(c: Any, node: Any, values: list[Value]) -> Value:
    if isinstance(values[0].type, Array):
        return Value(INT, values[0].words[1:2])
    return c.cast(node, function_of("ceil")(c, node, values), INT)  # type: ignore[no-any-return]


@_writes("abs")
def _abs(c: Any, node: Any, values: list[Value]) -> Value:
    if values[0].type == COMPLEX:
        both = [Value(FLOAT, (x,)) for x in values[0].words]
        return function_of("hypot")(c, node, both)
    if values[0].type == FLOAT:
        return function_of("fabs")(c, node, values)
    x = c.cast(node, values[0], INT)
    below = c.new(f"icmp slt i64 {x.word}, 0")
    turned = c.new(f"sub nsw i64 0, {x.word}")
    return Value(INT, (c.new(f"select i1 {below}, i64 {turned}, i64 {x.word}"),))


@_writes("int", "float", "bool")
def _as(c: Any, node: Any, values: list[Value]) -> Value:
    type_ = {"int": INT, "float": FLOAT, "bool": BOOL}[node.func.id]
    return c.cast(node, values[0], type_)  # type: ignore[no-any-return]


@_writes("complex")
def _complex(c: Any, node: Any, values: list[Value]) -> Value:
    if len(values) == 1:
        return c.cast(node, values[0], COMPLEX)  # type: ignore[no-any-return]
    return Value(COMPLEX, tuple(c.cast(node, v, FLOAT).word for v in values))


@_writes("min", "max")
def _extreme(c: Any, node: Any, values: list[Value]) -> Value:
    """As in Python, a later value is taken only where the comparison holds."""
    if len(values) < 2:
        c.refuse(node, "min or max of one value", "give it two numbers")
    order = ast.Gt() if node.func.id == "max" else ast.Lt()
    best = values[0]
    for value in values[1:]:
        better = c.comparison(node, order, value, best)
        type_ = wider(best.type, value.type)
        if better.constant is not None:
            best = c.cast(node, value if better.constant else best, type_)
            continue
        a, b = c.cast(node, value, type_), c.cast(node, best, type_)
        word_ = type_.words[0]
        text = f"select i1 {better.word}, {word_} {a.word}, {word_} {b.word}"
        best = Value(type_, (c.new(text),))
    return best


@_writes("sign")
def _sign(c: Any, node: Any, values: list[Value]) -> Value:
    x = c.cast(node, values[0], FLOAT).word
    found = x  # of NaN
    for relation, value in (("oeq", 0.0), ("olt", -1.0), ("ogt", 1.0)):
        test = c.new(f"fcmp {relation} double {x}, 0.0")
        found = c.new(f"select i1 {test}, double {bits(value)}, double {found}")
    return Value(FLOAT, (found,))


def complex_product(c: Any, a: Value, b: Value) -> Value:
    """(a0 b0 - a1 b1, a0 b1 + a1 b0)."""
    (a0, a1), (b0, b1) = a.words, b.words
    p, q, r, s = (c.new(f"fmul double {x}, {y}")
                  for x, y in ((a0, b0), (a1, b1), (a0, b1), (a1, b0)))  # fmt: skip
    return Value(COMPLEX, (c.new(f"fsub double {p}, {q}"), c.new(f"fadd double {r}, {s}")))


def complex_quotient(c: Any, a: Value, b: Value) -> Value:
    """Smith's division as numpy does it: by the ratio of the smaller part to the larger one."""
    (a0, a1), (b0, b1) = a.words, b.words
    sizes = [function_of("fabs")(c, None, [Value(FLOAT, (x,))]).word for x in (b0, b1)]
    test = c.new(f"fcmp oge double {sizes[0]}, {sizes[1]}")

    def choose(x: str, y: str) -> str:
        return c.new(f"select i1 {test}, double {x}, double {y}")  # type: ignore[no-any-return]

    large, small = choose(b0, b1), choose(b1, b0)
    ratio = c.new(f"fdiv double {small}, {large}")
    share = c.new(f"fmul double {small}, {ratio}")
    scale = c.new(f"fdiv double {bits(1.0)}, {c.new(f'fadd double {large}, {share}')}")
    r0, r1 = c.new(f"fmul double {a0}, {ratio}"), c.new(f"fmul double {a1}, {ratio}")
    real = choose(c.new(f"fadd double {a0}, {r1}"), c.new(f"fadd double {r0}, {a1}"))
    imag = choose(c.new(f"fsub double {a1}, {r0}"), c.new(f"fsub double {r1}, {a0}"))
    both = [c.new(f"fmul double {x}, {scale}") for x in (real, imag)]
    nothing = c.new(f"fcmp oeq double {c.new(f'fadd double {sizes[0]}, {sizes[1]}')}, 0.0")
    plain = [c.new(f"fdiv double {x}, {sizes[0]}") for x in (a0, a1)]
    pairs = zip(plain, both, strict=True)
    words = [c.new(f"select i1 {nothing}, double {x}, double {y}") for x, y in pairs]
    return Value(COMPLEX, tuple(words))


# ------------------------------------------------------------------ arrays and other threads


@_writes("pointer")
def _pointer(c: Any, node: Any, values: list[Value]) -> Value:
    first, *lengths = values[0].words
    return Value(Array(values[0].type.item, 1), (first, c.count_of(lengths)))
