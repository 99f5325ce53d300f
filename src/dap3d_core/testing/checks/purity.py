"""Checks of all kernels: pure, the same when compiled, and good for numbers of any kind."""

import builtins
import dis
import operator
import random
import sys
import types
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from dap3d_core.interface.codegen.kernel_arguments import friction_names, parameters
from dap3d_core.interface.codegen.loop_source import JUMP_KINDS, LOOP_KINDS, jump_names, kernels_of
from dap3d_core.interface.codegen.reactions import READING, reaction_names
from dap3d_core.interface.errors import line_of, plain_words
from dap3d_core.interface.examine.examine import ATTEMPTS
from dap3d_core.interface.examine.random_values import random_quantity
from dap3d_core.kernels.runtime.cache import jit_is_on
from dap3d_core.kernels.runtime.source_digest import codes_in, reached
from dap3d_core.testing.checks.compare import Comparison
from dap3d_core.testing.checks.findings import LEFT_OUT, CheckOutcome
from dap3d_core.testing.samples.complex_step import Stepped
from dap3d_core.testing.samples.sampled_type import UNDEFINED, Sample, SampledType, UndefinedError

#: Compiled and plain code round differently (a b + c in one rounding).
COMPILED_TOLERANCE = 1e-12
#: Modules and built-in functions that no pure function uses.
IMPURE_MODULES = ("datetime", "io", "os", "pathlib", "random", "secrets", "socket", "subprocess",
                  "sys", "tempfile", "threading", "time", "uuid")  # fmt: skip
IMPURE_BUILTINS = ("delattr", "eval", "exec", "globals", "id", "input", "locals", "open", "print",
                   "setattr", "vars")  # fmt: skip
#: Types that a kernel may read from outside: immutable, or checked themselves.
CONSTANTS = (bool, int, float, complex, str, bytes, type(None), type, types.FunctionType,
             types.BuiltinFunctionType, np.generic, np.ufunc)  # fmt: skip
#: Random inputs of each kernel, for both branches of ``where``.
TRIES = 8


def purity(subject: SampledType) -> CheckOutcome:
    """Kernels return the same numbers each time, and read and change nothing outside."""
    c = Comparison("purity", subject, "", "the same numbers each time, nothing from outside")
    for name in _names(subject):
        c.kernel = name
        for words in _outside(subject.type_info.kernels[name]):
            c.fail(f"{name} is not pure: {words}")
    for name, difference in differing(subject).items():
        c.kernel = name
        c.fail(*difference)
    c.kernel = "prepare"
    try:
        same = all(a.element.par == b.element.par
                   for a, b in zip(subject.samples, subject.again(), strict=True))  # fmt: skip
    except UndefinedError:
        same = False
    if not same:
        c.fail(
            "prepare returns other numbers for the same fields and poses when it is called again"
        )
    return c.outcome(sized=False)


def differing(subject: SampledType) -> dict[str, tuple[str, Sample, int]]:
    """The kernels that return other numbers in a second call: text, pose and row."""
    return subject.cached("differing", lambda: dict(_differing(subject)))


def _differing(subject: SampledType) -> Iterator[tuple[str, tuple[str, Sample, int]]]:
    for name in _names(subject):
        samples = (subject.friction if name == "friction" else subject).samples
        first = [sample.value(name) for sample in samples]
        again = [sample.value(name) for sample in reversed(samples)][::-1]
        different = [(sample, k, one[k], other[k])
                 for sample, one, other in zip(samples, first, again, strict=True)
                 for k in range(len(one)) if not np.array_equal(one[k], other[k])]  # fmt: skip
        if different:
            sample, k, one, other = different[0]
            text = f"row {k + 1} of {name} gives other numbers when it is called again: "
            yield name, (f"{text}{_number(one)}, then {_number(other)}", sample, k + 1)


def _names(subject: SampledType) -> tuple[str, ...]:
    """The kernels of a type, the friction of a joint among them."""
    return (*subject.kernels.names(), *(("friction",) if _has_friction(subject) else ()))


def compiled(subject: SampledType) -> CheckOutcome:
    """Compiled kernels return the numbers of plain Python."""
    if not jit_is_on():
        words = "nothing is compiled (DAP3D_PLAIN)"
        return CheckOutcome("compiled", subject.variant, LEFT_OUT, words)
    c = Comparison("compiled", subject, "", "compiled numbers against those of plain Python")
    for kind in LOOP_KINDS:
        owner = subject.friction if kind == "friction" and _has_friction(subject) else subject
        if set(owner.kernels.names()) & set(kernels_of(owner.type.kind, kind)):
            _compare_compiled(c, owner, kind)
    return c.outcome()


_COMPILED = "row {x.n} of {name} is {x.is_:.17g} compiled and {x.should:.17g} in plain Python"


def _compare_compiled(c: Comparison, subject: SampledType, kind: str) -> None:
    for sample in subject.samples:
        try:
            found = subject.kernels.compiled_values(kind, sample.element, sample.state)
        except Exception as error:
            c.kernel = kind
            c.fail(
                f"the kernels of its loop cannot be compiled ({kind}): {error}; a kernel is plain: "
                "tuples of numbers, the functions of dap3d_core.kernels, where() for branches"
            )
            return
        for name, value in found.items():
            c.kernel = name
            expected = sample.value(name)
            if name == "J":  # rows first
                value, expected = value.transpose(1, 0, 2), expected.transpose(1, 0, 2)
            c.compare(sample, value, expected, _COMPILED, words={"name": name},
                      tolerance=COMPILED_TOLERANCE)  # fmt: skip


def _has_friction(subject: SampledType) -> bool:
    return "friction" in subject.type_info.kernels and subject.type.kind == "joint"


def _outside(kernel: Callable[..., Any]) -> Iterator[str]:
    """Texts on the outside state that a function, and those it calls, read or change."""
    for function in reached(kernel)[0]:
        if (function.__module__ or "").partition(".")[0] == "dap3d_core":
            continue
        where = "" if function.__code__ is kernel.__code__ else f" (in {function.__name__})"
        for code in codes_in(function.__code__):
            for step in dis.get_instructions(code):
                if words := _about(function, step):
                    yield f"{words}{where}"


def _about(function: Any, step: dis.Instruction) -> str:
    name = str(step.argval)
    if step.opname in ("STORE_GLOBAL", "DELETE_GLOBAL"):
        return f"it changes {name} of its module; return what is to be known"
    if step.opname in ("STORE_ATTR", "STORE_SUBSCR", "DELETE_SUBSCR", "DELETE_ATTR"):
        return "it changes something in place; tuples are made anew"
    if step.opname in ("IMPORT_NAME", "IMPORT_FROM"):
        return f"it imports {name}; import at the top of the file"
    if step.opname == "LOAD_GLOBAL":
        if name in function.__globals__:
            return _about_value(name, function.__globals__[name])
        is_impure = name in IMPURE_BUILTINS and hasattr(builtins, name)
        return f"it calls {name}()" if is_impure else ""
    if step.opname == "LOAD_DEREF" and name in function.__code__.co_freevars:
        cells = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
        return _about_value(name, cells[name].cell_contents)
    return ""


def _about_value(name: str, value: Any) -> str:
    """The reason why an outside value is no constant; "" where it is one."""
    module = (
        value.__name__ if isinstance(value, types.ModuleType) else getattr(value, "__module__", "")
    )
    if str(module).partition(".")[0].lstrip("_") in IMPURE_MODULES or isinstance(
        getattr(value, "__self__", None), random.Random
    ):
        return f"it uses {name} of the module {module}, whose answer is not made of its arguments"
    if isinstance(value, tuple):
        return next((w for v in value if (w := _about_value(name, v))), "")
    if isinstance(value, (*CONSTANTS, types.ModuleType)) or hasattr(value, "__wrapped__"):
        return ""
    return (
        f"it reads {name}, a {type(value).__name__} that anyone may change; make it a tuple, or "
        "let prepare return it"
    )


def _number(value: Any) -> str:
    worst = np.ravel(value)
    return f"{worst[0]:.17g}" if len(worst) == 1 else str(tuple(worst.tolist()))


class _BranchError(TypeError):
    """A kernel branches on a condition on its numbers."""


def _joined(operation: Callable[[Any, Any], Any]) -> Callable[[Any, Any], "_Condition"]:
    return lambda self, other: _Condition(operation(self.holds, getattr(other, "holds", other)))


class _Condition:
    """A comparison of numbers with a result that only the functions of kernels may read."""

    __slots__ = ("holds",)

    def __init__(self, holds: bool) -> None:
        self.holds = holds

    def __bool__(self) -> bool:
        caller = sys._getframe(1).f_globals.get("__name__", "")
        if not caller.startswith("dap3d_core.kernels"):
            raise _BranchError("a branch on a number")
        return bool(self.holds)

    __and__ = __rand__ = _joined(operator.and_)
    __or__ = __ror__ = _joined(operator.or_)
    __xor__ = __rxor__ = _joined(operator.xor)

    def __invert__(self) -> "_Condition":
        return _Condition(not self.holds)


def _compared(name: str) -> Callable[[Any, Any], _Condition]:
    compare = getattr(Stepped, name)
    return lambda self, other: _Condition(compare(self, other))


class _OpaqueNumber(Stepped):
    """A number that is no float and hides its value."""

    __slots__ = ()
    __hash__ = complex.__hash__
    __eq__, __ne__ = _compared("__eq__"), _compared("__ne__")
    __lt__, __le__ = _compared("__lt__"), _compared("__le__")
    __gt__, __ge__ = _compared("__gt__"), _compared("__ge__")

    def __bool__(self) -> bool:
        raise _BranchError("a branch on a number")

    def _has_no_digits(self, *_: Any) -> Any:
        raise TypeError("the value of a number is rounded")

    __floor__ = __ceil__ = __trunc__ = _has_no_digits
    __round__ = _has_no_digits  # type: ignore[assignment]


def plain(subject: SampledType) -> CheckOutcome:
    """Kernels branch by ``where`` only, and take mathematics from dap3d_core.kernels."""
    words = "kernels run on numbers that are no floats, as derivatives and compilers have them"
    c = Comparison("plain", subject, "", words)
    for name, kernel in subject.type_info.kernels.items():
        if reason := _not_plain(subject, name, kernel):
            c.kernel = name
            c.fail(f"{name} {reason}; {plain_words()}")
    return c.outcome(sized=False)


def _not_plain(subject: SampledType, name: str, kernel: Callable[..., Any]) -> str:
    """The reason why a kernel is not plain, with its line; "" where it is."""
    offered, rng = subject.type_info.names, random.Random(f"{subject.seed} {name}")
    if name == "friction":
        offered = friction_names(subject.type.rows) | offered
    elif name in READING:
        offered = reaction_names(subject.type) | offered
    elif name in JUMP_KINDS:
        info = subject.type_info
        slots = len(info.layout.slots)
        offered = jump_names(info.type.kind, name, info.outputs, slots) | offered
    tries = 0
    for _ in range(ATTEMPTS):
        values = [random_quantity(offered[n], rng) for n in parameters(kernel)]
        try:
            kernel(*map(_opaque, values))
        except UNDEFINED:
            continue
        except _BranchError as error:
            return f"branches on a number{line_of(error, kernel)}"
        except Exception as error:
            words = f"{type(error).__name__}: {error}"
            if "__array_ufunc__" in words:
                words = "a function of numpy or scipy"
            return f"takes floats alone ({words}){line_of(error, kernel)}"
        tries += 1
        if tries == TRIES:
            break
    return ""


def _opaque(value: Any) -> Any:
    """A value with opaque numbers; tables and functions are unchanged."""
    if isinstance(value, tuple) and not (value and isinstance(value[0], list)):
        return tuple(map(_opaque, value))
    return _OpaqueNumber(value) if isinstance(value, float) else value
