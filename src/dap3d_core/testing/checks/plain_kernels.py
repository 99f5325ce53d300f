"""Check that kernels run on numbers of any kind, to be compiled and differentiated."""

import random
import sys
from collections.abc import Callable
from typing import Any

from dap3d_core.interface.codegen.jump_source import JUMP_KINDS, jump_names
from dap3d_core.interface.codegen.kernel_arguments import friction_names, parameters
from dap3d_core.interface.codegen.reactions import READING, reaction_names
from dap3d_core.interface.errors import line_of, plain_words
from dap3d_core.interface.examine.examine import ATTEMPTS
from dap3d_core.interface.examine.random_values import random_quantity
from dap3d_core.testing.checks.compare import Comparison
from dap3d_core.testing.checks.findings import CheckOutcome
from dap3d_core.testing.samples.complex_step import Stepped
from dap3d_core.testing.samples.sampled_type import UNDEFINED, SampledType

#: Random inputs of each kernel, for both branches of ``where``.
TRIES = 8


class BranchError(TypeError):
    """A kernel branches on a condition on its numbers."""


class Condition:
    """A comparison of numbers with a result that only the words of kernels may read."""

    __slots__ = ("holds",)

    def __init__(self, holds: bool) -> None:
        self.holds = holds

    def __bool__(self) -> bool:
        caller = sys._getframe(1).f_globals.get("__name__", "")
        if not caller.startswith("dap3d_core.kernels"):
            raise BranchError("a branch on a number")
        return bool(self.holds)

    def __and__(self, other: Any) -> "Condition":
        return Condition(self.holds & getattr(other, "holds", other))

    def __or__(self, other: Any) -> "Condition":
        return Condition(self.holds | getattr(other, "holds", other))

    def __xor__(self, other: Any) -> "Condition":
        return Condition(self.holds ^ getattr(other, "holds", other))

    def __invert__(self) -> "Condition":
        return Condition(not self.holds)

    __rand__, __ror__, __rxor__ = __and__, __or__, __xor__


def _compared(name: str) -> Callable[[Any, Any], Condition]:
    compare = getattr(Stepped, name)
    return lambda self, other: Condition(compare(self, other))


class OpaqueNumber(Stepped):
    """A number that is no float and hides its value."""

    __slots__ = ()
    __hash__ = complex.__hash__
    __eq__, __ne__ = _compared("__eq__"), _compared("__ne__")
    __lt__, __le__ = _compared("__lt__"), _compared("__le__")
    __gt__, __ge__ = _compared("__gt__"), _compared("__ge__")

    def __bool__(self) -> bool:
        raise BranchError("a branch on a number")

    def _has_no_digits(self, *_: Any) -> Any:
        raise TypeError("the value of a number is rounded")

    __floor__ = __ceil__ = __trunc__ = _has_no_digits
    __round__ = _has_no_digits  # type: ignore[assignment]


def plain(subject: SampledType) -> CheckOutcome:
    """Kernels branch by ``where`` only, and take their mathematics from the words of kernels."""
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
        except BranchError as error:
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
    return OpaqueNumber(value) if isinstance(value, float) else value
