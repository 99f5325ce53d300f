"""Kernels to LLVM IR by running them once with symbolic numbers.

Whatever Python does on the way (helpers, closures, loops over constants, tuples) is gone
afterwards; the operations on numbers are recorded as they happen. A kernel may do anything that
Python can, except decide by a number: it has no value yet.
"""

import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NoReturn

from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.functions import Program
from dap3d_core.kernels.compiler.writer import EXACT, LIBRARY, call_of

_REMEDY = "use the functions of dap3d_core.kernels: sqrt, sin, minimum, ..., where(condition, a, b)"


class TraceError(TypeError):
    """An operation that needs the value of a symbolic number; says what to write instead."""


class _MissingError(TraceError, AttributeError):
    """The same for a missing attribute, so that ``hasattr`` works."""


class Tracer:
    """Records the operations of a kernel; has its functions for symbolic numbers."""

    def __init__(self) -> None:
        self.program, self.lines = Program(), []

    def new(self, text: str) -> str:
        """Add an instruction; returns the name of its result."""
        self.lines.append(f"  %v{len(self.lines)} = {text}")
        return f"%v{len(self.lines) - 1}"

    def word(self, x: Any) -> str:
        """The LLVM value of a number, as a double."""
        if isinstance(x, Symbol):
            return x.word
        if isinstance(x, Integer):
            return self.new(f"sitofp i64 {x.word} to double")
        try:
            return t.bits(float(x))
        except TraceError:
            raise
        except (TypeError, ValueError):
            raise TraceError(f"takes a {type(x).__name__} for a number") from None

    def __getattr__(self, name: str) -> Callable[..., "Symbol"]:
        """A function of floats: sqrt, sin, ..."""
        if name not in (*EXACT, *LIBRARY):
            raise AttributeError(name)

        def function(*numbers: Any) -> Symbol:
            words = [self.word(x) for x in numbers]
            return Symbol(self, self.new(call_of(self.program.needs, name, words)))

        return function

    def where(self, condition: "Condition", a: Any, b: Any) -> Any:
        """``a`` where the condition holds, else ``b``; tuples item by item."""
        if isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
            return tuple(self.where(condition, x, y) for x, y in zip(a, b, strict=True))
        if isinstance(a, Condition) and isinstance(b, Condition):
            text = f"select i1 {condition.word}, i1 {a.word}, i1 {b.word}"
            return Condition(self, self.new(text))
        text = f"select i1 {condition.word}, double {self.word(a)}, double {self.word(b)}"
        return Symbol(self, self.new(text))

    def integer(self, x: Any) -> "Integer":
        """A float as an integer."""
        return Integer(self, self.new(f"fptosi double {self.word(x)} to i64"))

    def row_of(self, row: Any, array: "NumberArray", place: Any, rows: Any, width: int,
               x: Any) -> "Integer":  # fmt: skip
        """Index at which a row of a table begins, found by a function of the subset."""
        name, _ = self.program.function(row, (t.Array(t.FLOAT, 1), t.INT, t.INT, t.INT, t.FLOAT))
        given = (f"ptr {array.base}, i64 0, i64 {self.integer(place).word}, "
                 f"i64 {self.integer(rows).word}, i64 {width}, double {self.word(x)}")  # fmt: skip
        return Integer(self, self.new(f"call i64 @{name}({given})"))


class _Symbolic:
    """A value that is known when the code runs: refuses everything that needs it now."""

    __slots__ = ("tracer", "word")
    __hash__ = None

    def __init__(self, tracer: Tracer, word: str) -> None:
        self.tracer, self.word = tracer, word

    def _refuse(self, *arguments: Any) -> NoReturn:
        raise TraceError(f"needs the number itself; {_REMEDY}")

    __float__ = __int__ = __index__ = __complex__ = __len__ = __iter__ = _refuse
    __round__ = __floor__ = __ceil__ = __trunc__ = _refuse
    __floordiv__ = __mod__ = __rfloordiv__ = __rmod__ = __divmod__ = _refuse

    def __bool__(self) -> NoReturn:
        raise TraceError("branches on a number; use where(condition, a, b)")

    def __getattr__(self, name: str) -> NoReturn:
        raise _MissingError(f"reads {name} of a number; {_REMEDY}")

    def __getitem__(self, k: Any) -> NoReturn:
        raise TraceError("takes a part of a number; tuples have parts")


def _joining(name: str) -> Any:
    def join(self: "Condition", other: Any) -> "Condition":
        if not isinstance(other, (Condition, bool)):
            raise TraceError(f"joins a condition and a {type(other).__name__}; compare numbers")
        word = other.word if isinstance(other, Condition) else str(other).lower()
        return Condition(self.tracer, self.tracer.new(f"{name} i1 {self.word}, {word}"))

    return join


class Condition(_Symbolic):
    """A symbolic truth value."""

    __slots__ = ()
    __and__ = __rand__ = _joining("and")
    __or__ = __ror__ = _joining("or")
    __xor__ = __rxor__ = _joining("xor")

    def __invert__(self) -> "Condition":
        return self ^ True


def _operation(name: str, is_reflected: bool = False) -> Any:
    def operate(self: "Symbol", other: Any) -> "Symbol":
        if isinstance(other, (tuple, list, str)) or other is None:
            raise TraceError(f"{name[1:]}s a number and a {type(other).__name__}; "
                             "for vectors use add, sub, scale, dot")  # fmt: skip
        a, b = (other, self) if is_reflected else (self, other)
        word = self.tracer.word
        return Symbol(self.tracer, self.tracer.new(f"{name} double {word(a)}, {word(b)}"))

    return operate


def _comparison(relation: str) -> Any:
    def compare(self: "Symbol", other: Any) -> Condition:
        text = f"fcmp {relation} double {self.word}, {self.tracer.word(other)}"
        return Condition(self.tracer, self.tracer.new(text))

    return compare


class Symbol(_Symbolic):
    """A symbolic float."""

    __slots__ = ()

    __add__, __radd__ = _operation("fadd"), _operation("fadd", is_reflected=True)
    __sub__, __rsub__ = _operation("fsub"), _operation("fsub", is_reflected=True)
    __mul__, __rmul__ = _operation("fmul"), _operation("fmul", is_reflected=True)
    __truediv__, __rtruediv__ = _operation("fdiv"), _operation("fdiv", is_reflected=True)
    __lt__, __le__, __gt__, __ge__ = (_comparison(r) for r in ("olt", "ole", "ogt", "oge"))
    __eq__, __ne__ = _comparison("oeq"), _comparison("une")

    def __neg__(self) -> "Symbol":
        return Symbol(self.tracer, self.tracer.new(f"fneg double {self.word}"))

    def __pos__(self) -> "Symbol":
        return self

    def __abs__(self) -> "Symbol":
        return self.tracer.fabs(self)

    def __pow__(self, n: Any) -> Any:
        """Products for integer constants, a square root for 0.5, else ``pow`` of the C library."""
        if isinstance(n, int) and abs(n) <= 64:
            result, power, left = None, self, abs(n)
            while left:
                if left & 1:
                    result = power if result is None else result * power
                left >>= 1
                if left:
                    power = power * power
            result = 1.0 if result is None else result
            return 1.0 / result if n < 0 else result
        if isinstance(n, float) and n == 0.5:
            return self.tracer.sqrt(self)
        return self.tracer.pow(self, n)

    def __rpow__(self, x: Any) -> "Symbol":
        return self.tracer.pow(x, self)

    def rint(self) -> "Symbol":
        """The nearest integer, for ``numpy.rint``."""
        return self.tracer.rint(self)

    @property
    def real(self) -> "Symbol":
        """The number itself: conditions of complex numbers compare real parts."""
        return self


class Integer(_Symbolic):
    """A symbolic integer of the loop, an index or a count; kernels do not see it."""

    __slots__ = ()

    def _with(self, other: Any, name: str) -> "Integer":
        word = other.word if isinstance(other, Integer) else str(int(other))
        return Integer(self.tracer, self.tracer.new(f"{name} nsw i64 {self.word}, {word}"))

    def __add__(self, other: Any) -> "Integer":
        return self._with(other, "add")

    def __mul__(self, other: Any) -> "Integer":
        return self._with(other, "mul")

    __radd__, __rmul__ = __add__, __mul__


class NumberArray:
    """An array of a loop: one-dimensional, or with rows of a known width."""

    def __init__(self, tracer: Tracer, base: str, item: str = "double", width: int = 0) -> None:
        self.tracer, self.base, self._item, self._width = tracer, base, item, width

    def _at(self, k: Any) -> str:
        if isinstance(k, tuple):
            k = k[0] * self._width + k[1]
        word = k.word if isinstance(k, Integer) else str(int(k))
        return self.tracer.new(f"getelementptr inbounds {self._item}, ptr {self.base}, i64 {word}")

    def __getitem__(self, k: Any) -> Any:
        kind = Integer if self._item == "i64" else Symbol
        text = f"load {self._item}, ptr {self._at(k)}, align 8"
        return kind(self.tracer, self.tracer.new(text))

    def __setitem__(self, k: Any, x: Any) -> None:
        word = self.tracer.word(x)
        at = self._at(k)
        self.tracer.lines.append(f"  store double {word}, ptr {at}, align 8")


_LOOP = """define void @{symbol}(double %t, ptr %arrays, i64 %i0, i64 %p0, i64 %count,
                           ptr %out1, ptr %out2, ptr %out3) nounwind {{
entry:
{head}
  %some = icmp sgt i64 %count, 0
  br i1 %some, label %instance, label %exit
instance:
  %q = phi i64 [0, %entry], [%following, %instance]
{body}
  %following = add nsw i64 %q, 1
  %more = icmp slt i64 %following, %count
  br i1 %more, label %instance, label %exit
exit:
  ret void
}}
"""


def trace(
    symbol: str, namespace: dict[str, Any], members: Mapping[str, tuple[int, str, int]]
) -> str:
    """LLVM IR of a group loop.

    Args:
        symbol: name of its function.
        namespace: of the module with the Python function ``loop`` (runtime/loop_modules.py).
        members: for each array that it reads: index of its address in the struct, LLVM type of its
            items, width of its rows (0: one-dimensional).

    Raises:
        CompileError: with the line of the kernel, and what to write instead.
    """
    tracer, arrays, head = Tracer(), SimpleNamespace(), []
    for name, (word, item, width) in members.items():
        head += [f"  %{name}.at = getelementptr inbounds i64, ptr %arrays, i64 {word}",
                 f"  %{name} = load ptr, ptr %{name}.at, align 8"]  # fmt: skip
        setattr(arrays, name, NumberArray(tracer, f"%{name}", item, width))
    outputs = [NumberArray(tracer, f"%out{k}") for k in (1, 2, 3)]
    i0, p0, count, q = (Integer(tracer, f"%{name}") for name in ("i0", "p0", "count", "q"))
    namespace["range"] = lambda count: [q]  # one symbolic instance
    try:
        namespace["loop"](Symbol(tracer, "%t"), arrays, i0, p0, count, *outputs)
    except Exception as error:
        raise t.CompileError(f"{_reason(error)}{_line_of(error)}") from error
    body = "\n".join(tracer.lines)
    tracer.program.text.append(_LOOP.format(symbol=symbol, head="\n".join(head), body=body))
    return tracer.program.module()


def _reason(error: BaseException) -> str:
    if isinstance(error, TraceError):
        return f"it {error}"
    return f"{type(error).__name__}: {error}; {_REMEDY}"


def _line_of(error: BaseException) -> str:
    """The line of the kernel: the last one outside this package."""
    ours = Path(__file__).parents[1]
    line = ""
    for frame in traceback.extract_tb(error.__traceback__):
        if not frame.filename.startswith("<") and not Path(frame.filename).is_relative_to(ours):
            line = f" [{frame.filename}:{frame.lineno}]"
    return line
