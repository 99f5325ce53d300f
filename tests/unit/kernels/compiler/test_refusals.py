"""What compiled code cannot say is refused: file, line, why, and what to write instead."""

import math

import numpy as np
import pytest
from support.at_all_levels import function_of
from support.internals import (
    FLOAT,
    INT,
    Array,
    CompileError,
    Program,
    Signature,
    Table,
    compile_all,
)
from support.own_types import registry_of
from support.plain import jit_is_on

from dap3d_core.interface import Body, Force, PluginError, body, examine, number

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")
VECTOR, MATRIX = Array(FLOAT, 1), Array(FLOAT, 2)
TYPES = {"x": VECTOR, "m": MATRIX, "a": FLOAT, "i": INT, "table": Table(Signature((FLOAT,)))}

#: Each with a word of the reason; the third line of the function is at fault.
CASES = {
    "y = [q for q in range(3)]": "ListComp",
    "y = sum(q for q in range(3))": "GeneratorExp",
    "y = {q for q in range(3)}": "SetComp",
    "y = {q: 1 for q in range(3)}": "DictComp",
    "y = [1.0, a]": "pass an array",
    "y = {1: a}": "pass arrays",
    "y = {1, 2}": "pass arrays",
    "y = lambda q: q": "Lambda",
    "y = f'{a}'": "texts",
    "y = 'text'": "no real number",
    "y = 1j": "no real number",
    "y = +a": "no UAdd",
    "y: float = a": "without an annotation",
    "y = (z := a)": "NamedExpr",
    "yield a": "write into an array",
    "with a: pass": "With",
    "try: pass\n    except ValueError: pass": "Try",
    "raise ValueError": "Raise",
    "assert a > 0.0": "Assert",
    "def g(): pass": "FunctionDef",
    "class G: pass": "ClassDef",
    "import math": "import at the top",
    "from math import sin": "import at the top",
    "global here": "Global",
    "del a": "Delete",
    "match i:\n        case 1: pass": "if and elif",
    "for q in x: pass": "no range",
    "for q in range(0, 9, 0): pass": "is zero",
    "while a > 0.0: break\n    else: pass": "else",
    "for q in range(3): pass\n    else: pass": "else",
    "y = x[a]": "is an index or a count",
    "y = x[::2]": "step",
    "y = m[:, 1]": "whole rows",
    "x[:] = 0.0": "more than one number",
    "y = x + x": "one by one",
    "y = x if a > 0.0 else m": "one type",
    "y = a // 2.0": "no FloorDiv of a float and a float; take integers",
    "y = a & 1": "no BitAnd of a float and a int; take integers",
    "y = i ** i": "no Pow of a int and a int; multiply",
    "y = i ** 2": "multiply",
    "y = unknown": "not defined",
    "y = np.zeros(3)": "not known",
    "y = math.gamma(a)": "not known",
    "y = print(a)": "not known",
    "y = a.shape": "no shape",
    "y = x.T": "no T",
    "y = a is x": "more than None",
    "y = i and a": "compare it",
    "y = x < x": "one by one",
    "y = (a, i)[i]": "no constant",
    "y = table[0](a, a)": "2 arguments",
    "a[0] = 1.0": "written into",
    "y, z = a": "unpacks 2 values",
    "a.b = 1.0": "only arrays and scalars",
    "y = z": "not defined",
    "y = f(x, m, a, i, table)": "calls itself",
    "y = helper()": "required argument: 'q'",
    "y = helper(q=a)": "by position",
    "b = 1": "holds a float and a int",
    "for q in range(0, 9, i): pass": "no constant",
    "y = helper(1.0, 2.0)": "as it is defined",
    "y = 2 ** 70": "64 bits",
    "y = 1 / 0": "division by zero",
    "y = a and a > 0.0": "compare it",
    "y = min(a)": "two numbers",
    "y = not x": "condition",
    "a + 1.0": "does nothing",
    "y = variable": "argument",
}


def helper(q):
    """What a program may call."""
    return q


@pytest.mark.parametrize("line", CASES)
def test_it_says_what_is_wrong_and_in_which_line(line):
    source = f"def f(x, m, a, i, table):\n    b = a + 1.0\n    {line}\n    return b\n"
    function = function_of(source, helper=helper, math=math, variable=[1.0])
    with pytest.raises(CompileError) as caught:
        Program().function(function, tuple(TYPES.values()))
    said = str(caught.value)
    assert CASES[line] in said
    assert said.endswith(f"[{function.__code__.co_filename}:3]"), said
    assert ";" in said  # what to do stands behind it


@pytest.mark.parametrize(("body", "words"), [
    ("    if a > 0.0:\n        return a\n", "may end without a result"),
    ("    y = 1.0\n    if a > 0.0:\n        y = x\n    return y\n", "y holds a float and a array"),
    ("    if a > 0.0:\n        return a\n    return x\n", "several types"),
])  # fmt: skip
def test_ways_that_do_not_agree_are_refused(body, words):
    function = function_of(f"def f(x, a):\n{body}")
    with pytest.raises(CompileError, match=words):
        Program().function(function, (VECTOR, FLOAT))


def test_source_that_is_not_there_is_refused():
    namespace = {}
    exec("def f(a):\n    return a\n", namespace)
    with pytest.raises(CompileError, match="put it into a file"):
        Program().function(namespace["f"], (FLOAT,))


ZERO = (0.0, 0.0, 0.0)


class Pushing(Force):
    """What the types here have in common."""

    keyword = "pushing"
    body_i: Body = body()
    k: float = number(default=1.0)


def force_of(x):
    return (((x, 0.0, 0.0), ZERO),)


class Branches(Pushing):
    def wrench(k):
        return force_of(k if k > 0.0 else 0.0)


class TakesTheGreater(Pushing):
    def wrench(k):
        return force_of(max(k, 0.0))


class AsksTheLibrary(Pushing):
    def wrench(k):
        return force_of(math.sqrt(k))


class AsksNumpy(Pushing):
    def wrench(k):
        return force_of(np.sin(k))


class Counts(Pushing):
    def wrench(k):
        return force_of(sum(1.0 for _ in range(int(k))))


class Writes(Pushing):
    def wrench(k):
        return force_of(float(f"{k}"))


class Rounds(Pushing):
    def wrench(k):
        return force_of(round(k))


class Divides(Pushing):
    def wrench(k):
        return force_of(k // 2.0)


class Chains(Pushing):
    def wrench(k):
        return force_of(k * (0.0 < k < 1.0))


class AddsAVector(Pushing):
    def wrench(r_i, k):
        return force_of(k + r_i)


CALLED = [Branches, TakesTheGreater, AsksTheLibrary, AsksNumpy, Counts, Writes, Rounds, Divides,
          Chains, AddsAVector]  # fmt: skip


@pytest.mark.parametrize("type_", CALLED)
def test_a_kernel_that_asks_for_the_number_is_refused_in_its_line(type_):
    """One sentence: type, kernel, reason, remedy, and the line of the author's."""
    try:
        type_info = examine(type_)
    except PluginError:
        pytest.skip("plain Python refuses it already")
    with pytest.raises(PluginError) as caught:
        compile_all(type_info)
    said = str(caught.value)
    line = type_.wrench.__code__.co_firstlineno + 1
    assert f"{type_.__name__}: its kernels cannot be compiled (pushing: wrench)" in said
    assert f"[{__file__}:{line}]" in said
    assert "A kernel is plain" in said
    assert "\n" not in said


def test_what_python_does_on_the_way_is_done_and_gone():
    """Loops over constants, texts, generators, helpers, default arguments."""

    class Busy(Pushing):
        def wrench(r_i, k):
            names = [f"x{n}" for n in range(3)]
            parts = dict(zip(names, r_i, strict=True))
            return ((tuple(k * parts[name] for name in names), ZERO),)

    compile_all(examine(Busy))


def test_the_list_of_types_says_it_where_it_compiles():
    registry = registry_of(Branches)
    quick = {t.keyword: t for t in registry.listing()}
    assert quick["pushing"].state == "ok"
    found = {t.keyword: t for t in registry.listing(compiling=True)}
    assert found["pushing"].state == "broken"
    assert "where(condition, a, b)" in found["pushing"].reason
    assert found["sph"].state == "ok"
